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
    from bowden.control.motion import MinimumJerk as MinimumJerk
    from bowden.core.errors import BowdenError as BowdenError
    from bowden.core.kernel import kernel as kernel
    from bowden.core.signals import Reference as Reference
    from bowden.core.signals import Sample as Sample
    from bowden.identify.log.read import read_log as read_log
    from bowden.live.mcap_read import read_trace as read_trace
    from bowden.models.cable.bouc_wen import BoucWen as BoucWen
    from bowden.models.cable.sheath import Sheath as Sheath
    from bowden.models.drive.encoder import Encoder as Encoder
    from bowden.models.drive.motor import Motor as Motor
    from bowden.models.drive.servo import Servo as Servo
    from bowden.operations import campaign as _campaign
    from bowden.operations import check as _check
    from bowden.operations import emg_calibrate as _emg_calibrate
    from bowden.operations import emg_score as _emg_score
    from bowden.operations import export as _export
    from bowden.operations import identify as _identify
    from bowden.operations import identify_servo as _identify_servo
    from bowden.operations import simulate as _simulate
    from bowden.operations import tune as _tune
    from bowden.operations.init import init as init
    from bowden.operations.run import run as run
    from bowden.operations.support.python import public
    from bowden.plants.identified import CableModel as CableModel
    from bowden.records.trace import Trace as Trace
    from bowden.rig.rig import Rig as Rig

    campaign, check, export = public(_campaign.campaign), public(_check.check), public(_export.export)
    emg_calibrate, emg_score = public(_emg_calibrate.emg_calibrate), public(_emg_score.emg_score)
    identify_servo = public(_identify_servo.identify_servo)
    identify, simulate, tune = public(_identify.identify), public(_simulate.simulate), public(_tune.tune)

__version__ = "0.2.0"

_HOMES = {
    "BoucWen": "bowden.models.cable.bouc_wen",
    "BowdenError": "bowden.core.errors",
    "CableModel": "bowden.plants.identified",
    "Encoder": "bowden.models.drive.encoder",
    "LAWS": "bowden.control",
    "Law": "bowden.control.law",
    "MinimumJerk": "bowden.control.motion",
    "Motor": "bowden.models.drive.motor",
    "Reference": "bowden.core.signals",
    "Rig": "bowden.rig.rig",
    "Sample": "bowden.core.signals",
    "Servo": "bowden.models.drive.servo",
    "Sheath": "bowden.models.cable.sheath",
    "Trace": "bowden.records.trace",
    "campaign": "bowden.operations.campaign",
    "check": "bowden.operations.check",
    "emg_calibrate": "bowden.operations.emg_calibrate",
    "emg_score": "bowden.operations.emg_score",
    "export": "bowden.operations.export",
    "identify": "bowden.operations.identify",
    "identify_servo": "bowden.operations.identify_servo",
    "init": "bowden.operations.init",
    "kernel": "bowden.core.kernel",
    "read_log": "bowden.identify.log.read",
    "read_trace": "bowden.live.mcap_read",
    "run": "bowden.operations.run",
    "simulate": "bowden.operations.simulate",
    "tune": "bowden.operations.tune",
}
"""Each name that is offered, and the module that it is taken from when it is first asked for."""

_GUESSES = {
    "fit": "bowden.identify(log)",
    **dict.fromkeys(
        ("load", "read", "open"), "bowden.Rig.read(path), bowden.read_log(path) or bowden.read_trace(path)"
    ),
    "save": "rig.write(path), fit.write(path) or trace.write(path)",
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
    "calibrate": "bowden.identify(log, model=model), or bowden.emg_calibrate(mvc)",
    "plot": "trace.plot(), fit.plot(), rig.plot()",
    "optimize": "bowden.tune(rig)",
    "laws": "bowden.LAWS",
}
"""Name that is often guessed → what to write."""

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


_OF_CALLS = ("bowden.operations.", "bowden.identify.given_log", "bowden.live.mcap_read")
"""Modules whose functions answer what they cannot be called with."""


@cache
def _loaded(name: str) -> Any:
    """What a name of `_HOMES` stands for; an operation as a function."""
    found = getattr(import_module(_HOMES[name]), name)
    if not (_HOMES[name].startswith(_OF_CALLS) and isinstance(found, FunctionType)):
        return found
    return import_module(f"{__name__}.operations.support.python").public(found)


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
