"""How a rig says what it is, and draws what it will do."""

import dataclasses
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from bowden.core.errors import counted
from bowden.core.quantity import Quantity, declared
from bowden.core.units import DEGREES, HERTZ
from bowden.drawing.shown import listed, number
from bowden.drawing.style import COLOURS, thin
from bowden.plants.cable_parameters import parameter_lines
from bowden.plants.identified import IdentifiedCable

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_INSTANTS = 2001


def rows(rig: Any) -> list[tuple[str, str]]:
    """What a rig is, a line for each part."""
    said = [("plant", "suit on an arm" if rig.worn is not None else "bench"), ("cable", _cable(rig))]
    servo, clock = rig.servo, f"{rig.sample_time * 1e3:g} ms, delay of {counted(rig.delay, 'cycle')}"
    encoders = [
        f"{name} {number(one.resolution * DEGREES, '°')} a count, {number(one.noise * DEGREES, '°')} of noise"
        for name, one in (("joint", rig.joint_encoder), ("motor", rig.motor_encoder))
    ]
    reference = rig.trajectory.describe()
    units = _units(type(rig.trajectory))
    moved = ", ".join(f"{name} {_said(value, units.get(name))}" for name, value in reference.items() if name != "kind")
    gains = ", ".join(f"{name} {value:.4g}" for name, value in rig.gains.items())
    return [
        ("law", listed((rig.law_name, f"preset {rig.preset}" if rig.preset else "", gains))),
        *([("plant", _own(rig))] if rig.plant is not None else said),
        ("servo", f"{servo.natural_frequency / HERTZ:.4g} Hz, damping {servo.damping:.4g}"),
        ("encoders", "; ".join(encoders)),
        ("clock", clock),
        ("reference", f"{str(reference['kind']).replace('_', ' ')}: {moved}"),
        ("sheath", f"bend from {' to '.join(f'{end * DEGREES:.4g}°' for end in _bends(rig))}"),
        ("run", f"{rig.duration:g} s, seed {rig.seed}"),
        *(("note", note) for note in rig.notes),
    ]


def _cable(rig: Any) -> str:
    """Where the cable is known from, and the parameters of what a simulation runs."""
    cable = rig.cable
    if rig.worn is not None:
        whose = f"of {cable.file or 'a log'}" if isinstance(cable, IdentifiedCable) else "by hand"
        return f"{rig.suit.cable} {whose}, ±{number(1e3 * rig.worn.flexor.half_width, 'mm')} at the spool"
    known, given = "by hand", rig.bench.cable._asdict()
    if isinstance(cable, IdentifiedCable):
        known, given = f"identified as {cable.best}", cable.parameters
        known += "" if cable.simulated == cable.best else f", simulated as {cable.simulated}"
    parts = [f"{label} {text}" for label, text in parameter_lines(given, {})]
    return f"{known}: {', '.join(parts)}"


def _own(rig: Any) -> str:
    """The plant of the user's own, with its numbers."""
    plant = rig.own_plant
    numbers = [f"{name} {value:.4g}" for name, value in plant.parameters._asdict().items() if isinstance(value, float)]
    return f"{plant.name} of {plant.path.name}: {', '.join(numbers)}"


def draw(axes: "Sequence[Axes]", rig: Any) -> None:
    """Where the joint shall be and, on second axes, the sheath's bend."""
    time = np.linspace(0.0, rig.duration, _INSTANTS)
    axes[0].plot(*thin(time, rig.trajectory.sample(time)[:, 0] * DEGREES), color=COLOURS["reference"])
    axes[0].set_ylabel("reference [°]")
    for below in axes[1:]:
        below.plot(time, np.broadcast_to(rig.bend_path(time), time.shape) * DEGREES, color=COLOURS["data"])
        below.set_ylabel("bend [°]")
        below.set_ylim(bottom=0.0)
    axes[-1].set_xlabel("time [s]")


def _bends(rig: Any) -> tuple[float, float]:
    path = rig.bend_path(np.linspace(0.0, rig.duration, _INSTANTS))
    return float(np.min(path)), float(np.max(path))


def _units(kind: type) -> dict[str, Quantity]:
    """Name → unit of the numbers that make a reference, as far as they are declared."""
    return {one.name: one.quantity for one in declared(kind)} if dataclasses.is_dataclass(kind) else {}


def _said(value: object, quantity: Quantity | None = None) -> str:
    """A value, in the unit that a file has it in."""
    if isinstance(value, list):
        return f"[{', '.join(_said(one, quantity) for one in value)}]"
    if not isinstance(value, float):
        return str(value)
    if quantity is None or quantity.unit == "–":
        return f"{value:.4g}"
    return number(value / quantity.factor, quantity.file_unit, 4)
