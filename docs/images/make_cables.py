"""Draw the validation figures of docs/own_law.md: ``python docs/images/make_cables.py``.

Left: one slow stroke and a smaller one inside it, joint over motor, of the sliding tendon with 40 elements. Middle: the
tension at the motor after a reversal, over the motor's travel, against the closed form. Right: the errors of slopes and
dead zone over the number of elements. The same source gives the same bytes.
"""

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from bowden.core.kernel import compiled
from bowden.drawing import style
from bowden.models.cable import capstan, sliding_cable
from bowden.models.cable.capstan import Tendon
from bowden.models.cable.sliding_cable import TendonMemory, prepare_tendon

_START, _ADVANCE = compiled(sliding_cable.start_tendon), compiled(sliding_cable.advance_tendon)
_JOINT, _PULL = compiled(sliding_cable.tendon_joint), compiled(sliding_cable.motor_tension)
_CUTS = (4, 8, 16, 32, 64, 128)


def _walk(tendon: Tendon, path: list[float]) -> TendonMemory:
    prepared = prepare_tendon(tendon)
    memory: TendonMemory = _START(prepared, 0.0, 1.0)
    for motor in path:
        _ADVANCE(prepared, memory, motor, 1.0)
    return memory


def _joint(tendon: Tendon, path: list[float]) -> float:
    return float(_JOINT(prepare_tendon(tendon), _walk(tendon, path)))


def branch(tendon: Tendon, *, pulling: bool) -> float:
    """Slope of a sliding branch as the elements have it [rad/rad]."""
    start = [1.5] if pulling else [1.8, 1.0]
    end = 1.7 if pulling else 0.8
    return (_joint(tendon, [*start, end]) - _joint(tendon, start)) / (end - start[-1])


def lost(tendon: Tendon) -> float:
    """Dead zone after a pull to 1.5 rad as the elements have it, over the closed form's [–]."""
    joint, back = _joint(tendon, [1.5]), _joint(tendon, [1.5, 0.9])
    found = 0.6 - (joint - back) / branch(tendon, pulling=False)
    return found / capstan.dead_zone(tendon, joint)


def errors() -> dict[str, list[float]]:
    """Relative errors over `_CUTS`."""
    table: dict[str, list[float]] = {"loading slope": [], "unloading slope": [], "dead zone": []}
    for n in _CUTS:
        tendon = Tendon(elements=n)
        for name, pulling in (("loading slope", True), ("unloading slope", False)):
            table[name].append(abs(branch(tendon, pulling=pulling) / capstan.slope(tendon, pulling=pulling) - 1.0))
        table["dead zone"].append(abs(lost(tendon) - 1.0))
    return table


def _loop(axes: Axes) -> None:
    tendon = Tendon(elements=40)
    prepared, memory = prepare_tendon(tendon), _walk(tendon, [])
    motor = np.concatenate([np.linspace(a, b, 80) for a, b in ((0, 1.5), (1.5, 0.4), (0.4, 1.1), (1.1, 0.0))])
    joint = []
    for angle in motor.tolist():
        _ADVANCE(prepared, memory, angle, 1.0)
        joint.append(_JOINT(prepared, memory))
    axes.plot(np.degrees(motor), np.degrees(joint))
    turn = math.degrees(_joint(tendon, [1.5]))
    start = 1.5 - capstan.dead_zone(tendon, math.radians(turn))
    axes.plot([math.degrees(start)], [turn], "o", fillstyle="none", label="end of the dead\nzone, closed form")
    axes.set(xlabel="motor [°]", ylabel="joint [°]")
    axes.legend(loc="lower right")
    axes.set_title("Sliding tendon")


def _front(axes: Axes) -> None:
    for n in (5, 20, 80):
        tendon = Tendon(elements=n)
        prepared, memory = prepare_tendon(tendon), _walk(tendon, [1.5])
        before, joint = _PULL(prepared, memory), _JOINT(prepared, memory)
        travel = np.linspace(0.0, capstan.dead_zone(tendon, joint), 80)
        pull = []
        for back in travel.tolist():
            _ADVANCE(prepared, memory, 1.5 - back, 1.0)
            pull.append(_PULL(prepared, memory))
        axes.plot(np.degrees(travel), pull, label=f"{n} elements")
    exact = [capstan.tension_after_reversal(tendon, before, back * tendon.motor_radius) for back in travel.tolist()]
    axes.plot(np.degrees(travel), exact, "k:", label="closed form")
    axes.set(xlabel="given back by the motor [°]", ylabel="tension at the motor [N]")
    axes.legend(loc="upper right")
    axes.set_title("Inside the dead zone")


def _convergence(axes: Axes) -> None:
    for name, values in errors().items():
        axes.loglog(_CUTS, values, "o-", label=name)
    axes.loglog(_CUTS, [0.03 / n**2 for n in _CUTS], "k:", label="second order")
    axes.set(xlabel="elements", ylabel="relative error")
    axes.set_ylim(1e-9, 1e-2)
    axes.legend(loc="lower left")
    axes.set_title("Convergence")


def validation() -> Figure:
    """All three."""
    figure, axes = style.new_figure(columns=3, width=10.0, height=3.1)
    for draw, panel in zip((_loop, _front, _convergence), axes, strict=True):
        draw(panel)
    style.finish(figure)
    return figure


if __name__ == "__main__":
    drawn = validation()
    with style.drawing():
        drawn.savefig(Path(__file__).with_name("cable_physics.svg"), metadata={"Date": None, "Creator": None})
    for name, values in errors().items():
        print(name, *(f"{value:.1e}" for value in values))
