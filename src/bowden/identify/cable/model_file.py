"""model.toml: an identified cable as a commented file, the same bytes for the same log."""

import math
from pathlib import Path

from bowden import __version__
from bowden.core.files import write_text
from bowden.core.toml_text import quoted
from bowden.core.units import DEGREES
from bowden.identify.cable.fit import Fit, ModelFit
from bowden.identify.cable.loop import HysteresisLoop
from bowden.plants.cable_parameters import meaning
from bowden.plants.model_file import log_lines
from bowden.plants.predicted import NAMES
from bowden.plants.trust import trust_lines


def write_model(path: Path | str, fit: Fit, source: str) -> None:
    """Write every model of a fit, with units, uncertainties and the recommendation.

    Args:
        path: of the file.
        fit: what was identified.
        source: the log's name.

    Raises:
        OutputError: the file cannot be written.
    """
    text = model_text(fit, source)
    write_text(path, text)


def model_text(fit: Fit, source: str) -> str:
    """The content of model.toml."""
    lines = [
        f"# The cable of {_one_line(source)}, identified by bowden {__version__}. All angles are in radians.",
        "# Each value is followed by its unit, one standard deviation of it, and what it is. The models were fitted to",
        "# the whole log; test_rms_deg is the error on the second half of the same families fitted to the first.",
        "",
        "# Recommended: the simplest whose error on stretches left out of the fit is not clearly above the least.",
        f"best = {quoted(fit.best.name)}",
        f"source = {quoted(_one_line(source))}",
        f"samples = {fit.samples}",
        f"whole_cycles = {fit.cycles.whole}  # up and down; {fit.cycles.advice or 'enough'}",
        "warnings = [" + "".join(f"\n  {quoted(_one_line(warning))}," for warning in fit.warnings) + "\n]",
    ]
    lines += trust_lines(fit.trust)
    lines += log_lines(fit.log.covered, fit.log.encoders)
    left, without, counts = (_number(value * DEGREES) for value in fit.forecast)
    lines += [
        "",
        "[forecast]  # error of the joint on a motion like the log's; the servo is taken to follow at once",
        f"compensated_rms_deg = {left}  # with the recommended model's inverse as feed-forward",
        f"uncompensated_rms_deg = {without}  # with a straight line's",
        f"resolution_rms_deg = {counts}  # of both encoders' counts; 0 where the log shows none",
    ]
    lines += _loop_lines(fit.chosen.loop)
    for name in NAMES:
        lines += _model_lines(name, fit.models[name])
    return "\n".join(lines) + "\n"


def _loop_lines(loop: HysteresisLoop | None) -> list[str]:
    """The section with the recommended model's loop; empty where the log shows none."""
    if loop is None:
        return []
    texts = {
        "slope": "[rad/rad] of the middle half of the stroke",
        "offset": "[rad] joint angle at motor angle 0 of the line through it",
        "height": "[rad] how far apart both ways are there, at the joint",
        "rising_place": "[rad] motor angles along the stroke while it rises",
        "rising": "[rad] joint angles there",
        "falling_place": "[rad] while it falls",
        "falling": "[rad] joint angles there",
    }
    lines = [
        "",
        "[loop]  # of the recommended model over this log; _error: one standard deviation, inf where not shown",
    ]
    for key, value in loop._asdict().items():
        said = "[" + ", ".join(_number(one) for one in value) + "]" if isinstance(value, tuple) else _number(value)
        lines.append(f"{key} = {said}" + (f"  # {texts[key]}" if key in texts else ""))
    return lines


def _model_lines(name: str, fitted: ModelFit) -> list[str]:
    lines = [
        "",
        f"[models.{name}]",
        f"train_rms_deg = {_number(fitted.train_rms * DEGREES)}",
        f"test_rms_deg = {_number(fitted.test_rms * DEGREES)}",
        "",
        f"[models.{name}.parameters]",
    ]
    for key, value in fitted.parameters.items():
        unit, text = meaning(key)
        lines.append(f"{key} = {float(value)!r}  # [{unit}] {_spread(fitted.uncertainty[key])}; {text}")
    lines += [
        "",
        f"[models.{name}.uncertainty]  # one standard deviation; inf: the log does not show it; not here: none stated",
    ]
    return lines + [f"{key} = {_number(value)}" for key, value in fitted.uncertainty.items() if not math.isnan(value)]


def _spread(uncertainty: float) -> str:
    if math.isnan(uncertainty):
        return "no uncertainty stated"
    return "not identifiable from this log" if math.isinf(uncertainty) else f"± {uncertainty:.2g}"


def _number(value: float) -> str:
    return f"{value:.6g}" if math.isfinite(value) else "nan" if math.isnan(value) else "inf"


def _one_line(text: str) -> str:
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
