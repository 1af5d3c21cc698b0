"""The content of model.toml: what a rig takes of a fit, and what a person reads of it."""

import math
from collections.abc import Mapping

from bowden import __version__
from bowden.core.errors import ParameterError
from bowden.core.toml_text import quoted
from bowden.core.units import DEGREES
from bowden.identify.cable.cycles import Cycles
from bowden.identify.cable.fitted import Fitted, FittedLog, ModelFit
from bowden.identify.cable.loop import HysteresisLoop
from bowden.plants.cable_parameters import check_parameters, meaning
from bowden.plants.model_file import log_lines
from bowden.plants.trust import trust_lines


def model_text(fit: Fitted) -> str:
    """The content of model.toml."""
    best = fit.best
    lines = [
        f"# The cable of {one_line(fit.name)}, identified by bowden {__version__}. All angles are in radians.",
        "# Each value is followed by its unit, one standard deviation of it where one is stated, and what it is. The",
        "# models were fitted to all; test_rms_deg is the error on second halves of what was fitted to first halves.",
        "",
        "# Recommended: the simplest whose error on stretches left out of the fit is not clearly above the least.",
        f"best = {quoted(best.name)}",
        f"source = {quoted(one_line(fit.name))}",
        f"samples = {fit.samples}",
        _cycles_row(fit.cycles),
        "warnings = [" + "".join(f"\n  {quoted(one_line(warning))}," for warning in fit.warnings) + "\n]",
        *trust_lines(fit.trust),
        *log_lines(best.covered, best.encoders),
    ]
    if found := fit.recalibration:
        lines += [
            "",
            "[recalibration]  # gain and offset of a known model, fitted to this log; all else is that model's",
            f"from = {quoted(one_line(found.source))}",
            f"gain = {found.gain!r}",
            f"gain_error = {found.gain_error!r}",
            f"offset_deg = {_number(found.offset * DEGREES)}",
        ]
    if ahead := fit.forecast:
        left, without, counts = (_number(value * DEGREES) for value in ahead)
        lines += [
            "",
            "[forecast]  # error of the joint on a motion like the log's; the servo is taken to follow at once",
            f"compensated_rms_deg = {left}  # with the recommended model's inverse as feed-forward",
            f"uncompensated_rms_deg = {without}  # with a straight line's",
            f"resolution_rms_deg = {counts}  # of both encoders' counts; 0 where the log shows none",
        ]
    lines += _loop_lines(fit.chosen.loop)
    for name, fitted in fit.models.items():
        if name not in (best.name, "bouc_wen") and not _usable(name, fitted):
            lines += ["", f"# {name} is left out: the log does not show its parameters; no cable has what they came to"]
            continue
        recommended = {"judged_rms": fit.judged_rms} if name == best.name else {}
        units = [f"{one}_unit = {quoted(unit)}" for one, unit in fit.units.items()] if recommended else []
        lines += _model_lines(name, fitted, recommended, units)
    for one in fit.logs if len(fit.logs) > 1 else ():
        lines += _lines_of_log(fit, one)
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


def _usable(name: str, fitted: ModelFit) -> bool:
    """True if a rig takes the parameters."""
    try:
        check_parameters(name, fitted.parameters, name)
    except ParameterError:
        return False
    return True


def _model_lines(name: str, fitted: ModelFit, judged: Mapping[str, float], units: list[str]) -> list[str]:
    errors = {"train_rms": fitted.train_rms, "test_rms": fitted.test_rms, **judged}
    lines = ["", f"[models.{name}]", *_error_lines(errors), *units, "", f"[models.{name}.parameters]"]
    for key, value in fitted.parameters.items():
        unit, text = meaning(key)
        spread = f" {_spread(fitted.uncertainty[key])};" if fitted.uncertainty else ""
        lines.append(f"{key} = {float(value)!r}  # [{unit}]{spread} {text}")
    if not fitted.uncertainty:
        return lines
    lines += [
        "",
        f"[models.{name}.uncertainty]  # one standard deviation; inf: the log does not show it; not here: none stated",
    ]
    return lines + [f"{key} = {_number(value)}" for key, value in fitted.uncertainty.items() if not math.isnan(value)]


def _lines_of_log(fit: Fitted, one: FittedLog) -> list[str]:
    names = ("train", "test", "same", "same_offset", "unseen", "unseen_offset")
    return [
        "",
        "[[logs]]",
        f"name = {quoted(one_line(one.name))}",
        *(f"{name} = {value!r}" for name, value in zip(fit.units, one.values, strict=True)),
        _cycles_row(one.cycles),
        *_error_lines({f"{name}_rms": getattr(one, f"{name}_rms") for name in names}),
    ]


def _cycles_row(cycles: Cycles) -> str:
    return f"whole_cycles = {cycles.whole}  # up and down; {cycles.to_record or 'enough'}"


def _error_lines(given: Mapping[str, float]) -> list[str]:
    return [f"{name}_deg = {_number(value * DEGREES)}" for name, value in given.items() if math.isfinite(value)]


def _spread(uncertainty: float) -> str:
    if math.isnan(uncertainty):
        return "no deviation stated"
    return "not identifiable from this log" if math.isinf(uncertainty) else f"± {uncertainty:.2g}"


def _number(value: float) -> str:
    return f"{value:.6g}"


def one_line(text: str) -> str:
    """The text without breaks and what cannot be printed."""
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
