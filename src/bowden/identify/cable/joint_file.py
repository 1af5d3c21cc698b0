"""model.toml of several logs fitted together, and of a model that was recalibrated."""

import dataclasses
import math
from collections.abc import Iterable, Mapping

from bowden import __version__
from bowden.core.toml_text import quoted
from bowden.core.units import DEGREES
from bowden.identify.cable.cycles import Cycles
from bowden.identify.cable.loads import JointFit
from bowden.identify.cable.recalibrate import Recalibration, to_identify
from bowden.plants.cable_parameters import meaning
from bowden.plants.model_file import log_lines
from bowden.plants.trust import trust_lines


def joint_text(fit: JointFit) -> str:
    """The content of model.toml of several logs: the scheduled model, the plain one, how each log was judged."""
    lines = [
        f"# The cable of {len(fit.logs)} logs, identified by bowden {__version__}. All angles are in radians.",
        "# A rig sets the load with load = … under [cable.parameters]. judged_rms_deg is the error to expect of",
        "# another log of this cable once its offset is known; the model itself was fitted to all logs.",
        "",
        f"best = {quoted(fit.best.name)}",
        f"source = {quoted(', '.join(_line(one.name) for one in fit.logs))}",
        f"samples = {fit.samples}",
        *_warnings(fit.warnings),
        *trust_lines(fit.trust),
        *log_lines(fit.best.covered, fit.best.encoders),
        "",
        f"[models.{fit.best.name}]",
        *_errors({name: getattr(fit, name) for name in ("train_rms", "test_rms")} | {"judged_rms": fit.judged}),
        *(f"{name}_unit = {quoted(unit)}" for name, unit in zip(fit.variables, fit.units, strict=True)),
        "",
        f"[models.{fit.best.name}.parameters]",
        *_parameters(fit.best.parameters),
    ]
    for name, parameters in fit.best.others.items():
        lines += ["", f"[models.{name}.parameters]  # of the log in the middle", *_parameters(parameters)]
    for one in fit.logs:
        lines += ["", "[[logs]]", f"name = {quoted(_line(one.name))}"]
        lines += [f"{name} = {value!r}" for name, value in zip(fit.variables, one.values, strict=True)]
        lines.append(_cycles(one.cycles, one.cycles.to_record))
        lines += _errors({name: value for name, value in dataclasses.asdict(one).items() if name.endswith("_rms")})
    return "\n".join(lines) + "\n"


def recalibrated_text(found: Recalibration, source: str) -> str:
    """The content of model.toml of a recalibrated model; how good it was judged stays as its first file has it."""
    lines = [
        f"# Gain and offset of {_line(source)} fitted to {_line(found.log.name)} by bowden {__version__}.",
        "# judged_rms_deg is that of the first model; recalibrated_rms_deg what is left on the new log.",
        "",
        f"best = {quoted(found.best.name)}",
        f"source = {quoted(_line(found.log.name))}",
        f"recalibrated_from = {quoted(_line(source))}",
        f"gain = {found.gain!r}  # over that model's",
        f"samples = {found.samples}",
        _cycles(found.cycles, to_identify(found.cycles)),
        *_warnings(found.warnings),
        *trust_lines(found.best.trust),
        *log_lines(found.best.covered, found.best.encoders),
    ]
    for name, parameters in ((found.best.name, found.best.parameters), *found.best.others.items()):
        lines += ["", f"[models.{name}]"]
        if name == found.best.name:
            lines += _errors({"judged_rms": found.judged_rms, "recalibrated_rms": found.after_rms})
            lines += [f"{variable}_unit = {quoted(unit)}" for variable, unit in found.units.items()]
        lines += ["", f"[models.{name}.parameters]", *_parameters(parameters)]
    return "\n".join(lines) + "\n"


def _cycles(cycles: Cycles, advice: str) -> str:
    return f"whole_cycles = {cycles.whole}  # up and down; {advice or 'enough'}"


def _warnings(warnings: Iterable[str]) -> list[str]:
    return ["warnings = [" + "".join(f"\n  {quoted(_line(warning))}," for warning in warnings) + "\n]"]


def _errors(given: Mapping[str, float]) -> list[str]:
    """Those errors that there are, in degrees."""
    return [f"{name}_deg = {value * DEGREES:.6g}" for name, value in given.items() if math.isfinite(value)]


def _parameters(parameters: Mapping[str, float]) -> list[str]:
    said = {name: meaning(name) for name in parameters}
    return [f"{name} = {float(parameters[name])!r}  # [{unit}] {text}" for name, (unit, text) in said.items()]


def _line(text: str) -> str:
    return " ".join("".join(c if c.isprintable() else " " for c in text).split())
