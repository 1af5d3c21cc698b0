"""bowden: an open control stack for soft exosuits driven through Bowden cables.

A cable in a sheath loses motion: friction and play make a hysteresis that changes whenever the sheath bends. The
package takes a log of such a cable to an identified model, and the model to a controller that makes the joint follow.

    import bowden

    fit = bowden.identify("log.csv")                # or arrays: identify(time, motor, joint)
    rig = bowden.init(fit).rig                      # within the log's motion; or bowden.Rig.read("rig.toml")
    bowden.simulate(rig).plot()
    rig = bowden.tune(rig).rig
    with bowden.run(rig, twin=True) as session: ...

All angles are in radians, all else in SI. The names below are loaded when they are first asked for, so that
``import bowden`` takes a few milliseconds; see docs/python.md.
"""

import sys
from functools import cache
from importlib import import_module
from types import FunctionType, ModuleType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bowden.control import LAWS as LAWS
    from bowden.control.law import Law as Law
    from bowden.core.errors import BowdenError as BowdenError
    from bowden.core.kernel import kernel as kernel
    from bowden.core.signals import Reference as Reference
    from bowden.core.signals import Sample as Sample
    from bowden.face.campaign import campaign as campaign
    from bowden.face.check import check as check
    from bowden.face.emg import emg_calibrate as emg_calibrate
    from bowden.face.emg import emg_score as emg_score
    from bowden.face.export import export as export
    from bowden.face.identify import identify as identify
    from bowden.face.identify import read_log as read_log
    from bowden.face.init import init as init
    from bowden.face.motion import MinimumJerk as MinimumJerk
    from bowden.face.read_trace import read_trace as read_trace
    from bowden.face.run import run as run
    from bowden.face.several_logs import identify_together as identify_together
    from bowden.face.several_logs import recalibrate as recalibrate
    from bowden.face.simulate import simulate as simulate
    from bowden.face.tune import tune as tune
    from bowden.identify.cable.model import CableModel as CableModel
    from bowden.models.cable.bouc_wen import BoucWen as BoucWen
    from bowden.models.cable.sheath import Sheath as Sheath
    from bowden.models.drive.encoder import Encoder as Encoder
    from bowden.models.drive.motor import Motor as Motor
    from bowden.models.drive.servo import Servo as Servo
    from bowden.records.trace import Trace as Trace
    from bowden.rig.rig import Rig as Rig

__version__ = "0.2.0"

_HOMES = {
    "BoucWen": "bowden.models.cable.bouc_wen",
    "BowdenError": "bowden.core.errors",
    "CableModel": "bowden.identify.cable.model",
    "Encoder": "bowden.models.drive.encoder",
    "LAWS": "bowden.control",
    "Law": "bowden.control.law",
    "MinimumJerk": "bowden.face.motion",
    "Motor": "bowden.models.drive.motor",
    "Reference": "bowden.core.signals",
    "Rig": "bowden.rig.rig",
    "Sample": "bowden.core.signals",
    "Servo": "bowden.models.drive.servo",
    "Sheath": "bowden.models.cable.sheath",
    "Trace": "bowden.records.trace",
    "campaign": "bowden.face.campaign",
    "check": "bowden.face.check",
    "emg_calibrate": "bowden.face.emg",
    "emg_score": "bowden.face.emg",
    "export": "bowden.face.export",
    "identify": "bowden.face.identify",
    "identify_together": "bowden.face.several_logs",
    "init": "bowden.face.init",
    "kernel": "bowden.core.kernel",
    "read_log": "bowden.face.identify",
    "read_trace": "bowden.face.read_trace",
    "recalibrate": "bowden.face.several_logs",
    "run": "bowden.face.run",
    "simulate": "bowden.face.simulate",
    "tune": "bowden.face.tune",
}
"""Each name that is offered, and the module that it is taken from when it is first asked for."""

_GUESSES = {
    "fit": "bowden.identify(log)",
    **dict.fromkeys(
        ("load", "read", "open"), "bowden.Rig.read(path), bowden.read_log(path) or bowden.read_trace(path)"
    ),
    "save": "rig.write(path), fit.write(path) or trace.write(path)",
    "identify_servo": "bowden identify-servo, in a terminal; what it finds goes into bowden.Rig(servo={…})",
    **{name: f"bowden {name}, in a terminal" for name in ("measure", "confirm", "console", "demo", "doctor", "sample")},
    "twin": "bowden.run(rig, twin=True)",
    "Model": "bowden.CableModel",
    "Controller": "bowden.Law",
    "load_log": "bowden.read_log(path)",
    "load_rig": "bowden.Rig.read(path)",
    "read_rig": "bowden.Rig.read(path)",
    "load_model": "bowden.CableModel.read(path)",
    "read_model": "bowden.CableModel.read(path)",
    "load_trace": "bowden.read_trace(path)",
    "calibrate": "bowden.recalibrate(log, model), or bowden.emg_calibrate(mvc)",
    "plot": "trace.plot(), fit.plot(), rig.plot()",
    "optimize": "bowden.tune(rig)",
    "laws": "bowden.LAWS",
}
"""Name that is often guessed → what to write."""

_ARGUMENTS = {
    "gains": "rig.replace(gains={…}), or a law with them: bowden.LAWS[name].with_gains(…)",
    "gain": "rig.with_gain(name, value)",
    "units": "unit=",
    "fs": "rate=, in Hz",
    "dt": "rate=, in Hz; of a rig its sample_time",
    "sample_time": "rig.replace(sample_time=…)",
    "reference": "rig.replace(reference=…)",
    "delay": "rig.replace(delay=…)",
    **dict.fromkeys(("out", "to", "path"), "folder="),
    **dict.fromkeys(("T", "time", "length"), "duration=, in s"),
    "emg": "rig.with_emg(source)",
    "verbose": "progress=True, where a function has it",
}
"""Argument of a function that is often guessed → what to write."""

_ROOMS = ("identify", "export")
"""Names that are a function here and a folder of the package as well: the folder can be called as the function."""

__all__ = [*_HOMES, "__version__"]


def __getattr__(name: str) -> Any:
    """A name of `_HOMES`, loaded when it is first asked for (PEP 562)."""
    if name in _ROOMS:
        return import_module(f"{__name__}.{name}")
    if name in _HOMES:
        found = globals()[name] = _loaded(name)
        return found
    if name.startswith("__"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from bowden.core.guesses import answer

    raise AttributeError(answer("bowden", name, _HOMES, _GUESSES))


@cache
def _loaded(name: str) -> Any:
    """What a name of `_HOMES` stands for; a function of the face answers arguments that it does not have."""
    found = getattr(import_module(_HOMES[name]), name)
    if not (_HOMES[name].startswith(f"{__name__}.face.") and isinstance(found, FunctionType)):
        return found
    from bowden.core.guesses import public

    return public(found, _ARGUMENTS)


def __dir__() -> list[str]:
    return sorted({*__all__, *(name for name in globals() if name.startswith("__"))})


class _Room(ModuleType):
    """A folder of the package that is called as the function of its name."""

    def __call__(self, *given: Any, **named: Any) -> Any:
        return self._function(*given, **named)

    @property
    def _function(self) -> Any:
        return _loaded(self.__name__.rpartition(".")[2])

    @property
    def __doc__(self) -> str:  # type: ignore[override]  # help shows how it is called, and then the folder
        from inspect import getdoc, signature

        function = self._function
        how = (getdoc(function) or "").partition("\n>>>")[0].rstrip()
        return f"{function.__name__}{signature(function)}\n\n{how}\n\n{self.__dict__.get('__doc__') or ''}"

    @property
    def __signature__(self) -> Any:
        from inspect import signature

        return signature(self._function)


class _Package(ModuleType):
    """This package, which turns those folders into `_Room` when their import puts them here."""

    def __setattr__(self, name: str, value: Any) -> None:
        if name in _ROOMS and isinstance(value, ModuleType):
            value.__class__ = _Room
        super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package
