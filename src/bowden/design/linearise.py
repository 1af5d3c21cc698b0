"""Any law as a linear system near rest: central differences on the plain step, one encoder count wide.

A difference as wide as one count sees a steep curve, such as tanh(s/ε), as the encoder sees it. States that act as
parameters (estimates) are found by trying them, and frozen.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.law import Law, State
from bowden.control.stability import StateSpace
from bowden.core.nested import flat, name_of, names, rebuilt
from bowden.core.signals import Reference, Sample

Array = NDArray[np.float64]

_REST = Reference(0.0, 0.0, 0.0)
_TRIAL_CYCLES = 20
_NOISE = 1e-9
"""Part of a difference, counted in the widths that it was taken with, that is rounding."""


class LawModel(NamedTuple):
    """A law near rest, x⁺ = A·x + B·(joint, motor), −command = C·x + D·(joint, motor)."""

    a: Array
    """(k, k)."""
    b: Array
    """(k, 2)."""
    c: Array
    """(1, k)."""
    d: Array
    """(2,)."""

    def seen_through(self, slope: float) -> StateSpace:
        """From the motor's angle to minus the command, the joint moving by `slope` per motor motion."""
        through = np.array([slope, 1.0])
        return StateSpace(self.a, (self.b @ through)[:, None], self.c, float(self.d @ through))

    @property
    def by_joint(self) -> StateSpace:
        """From the measured joint to minus the command."""
        return StateSpace(self.a, self.b[:, :1], self.c, float(self.d[0]))

    @property
    def by_motor(self) -> StateSpace:
        """From the measured motor to minus the command."""
        return StateSpace(self.a, self.b[:, 1:], self.c, float(self.d[1]))


def linearise(
    law: Law, dt: float, *, width: float = 1e-6, estimates: dict[str, float] | None = None, at: float = 0.0
) -> LawModel:
    """The law near rest, with its estimates frozen.

    States that the motor and the joint do not reach, or that do not reach the command, are left out.

    Args:
        law: with its gains.
        dt: sample time [s].
        width: half of the difference in the two angles, an encoder's count for what the loop will see [rad].
        estimates: name of a state (``part.field`` where it nests) → the value at which it is frozen.
        at: joint and motor angle of the rest [rad]; the reference is there as well.
    """
    frozen = estimates or {}
    sample, reference = Sample(at, at), Reference(at, 0.0, 0.0)
    rest = law.start(sample)
    rest = rebuilt(rest, lambda path, old: frozen.get(name_of(path), old))
    free = [i for i, name in enumerate(names(rest)) if name not in frozen]
    start = np.array(flat(rest))

    def after(state: Sequence[float] | Array, joint: float, motor: float) -> Array:
        numbers = iter(state)
        stepped, command = law.step(rebuilt(rest, lambda *_: next(numbers)), Sample(joint, motor), reference, dt)
        return np.array([*flat(stepped), -command])

    moved = [
        (after(flat(rest), at + joint, at + motor) - after(flat(rest), at - joint, at - motor)) / 2.0
        for joint, motor in ((width, 0.0), (0.0, width))
    ]
    widths = np.maximum(np.max(np.abs(moved), axis=0)[:-1], 1e-9 * (1.0 + np.abs(start)))
    columns = []
    for i in free:
        side = np.zeros(len(start))
        side[i] = widths[i]
        columns.append((after(start + side, at, at) - after(start - side, at, at)) / 2.0)
    by_state = np.array(columns).reshape(len(free), len(start) + 1).T  # in widths of the state
    by_input = np.array(moved).T  # in widths of the angles
    scale = widths[free]
    return _reduced(by_state[free], by_input[free], by_state[-1], by_input[-1], scale, width)


def _reduced(into: Array, driven: Array, out: Array, direct: Array, scale: Array, width: float) -> LawModel:
    """The part that the inputs reach and that reaches the command, in SI units."""
    a, b = into / scale[:, None], driven / scale[:, None]  # both now free of units
    links = np.abs(a) > _NOISE
    reached = _spread(np.any(np.abs(b) > _NOISE, axis=1), links)
    heard = _spread(np.abs(out) > _NOISE * max(float(np.max(np.abs([*out, *direct]), initial=0.0)), 1e-300), links.T)
    keep = np.flatnonzero(reached & heard)
    s = scale[keep]
    return LawModel(
        a=a[np.ix_(keep, keep)] * s[:, None] / s[None, :],
        b=b[keep] * s[:, None] / width,
        c=(out[keep] / s)[None, :],
        d=direct / width,
    )


def _spread(marked: NDArray[np.bool_], links: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Marks carried along `links[to, from]` until nothing more is reached."""
    for _ in range(len(marked)):
        marked = marked | (links @ marked)
    return marked


def find_estimates(law: Law, visited: State, dt: float) -> list[str]:
    """The states of a law that act as parameters: one that is changed stays, and at rest at zero no command shows it.

    An integral is heard at once and a filter's memory fades; an estimate of a slope or of a height multiplies something
    that is zero at rest, and keeps its value.

    Args:
        law: with its gains.
        visited: values that the states take in a run, to try.
        dt: sample time [s].
    """
    sample = Sample(0.0, 0.0)
    rest = law.start(sample)
    still, quiet = _at_rest(law, rest, sample, dt)
    found = []
    for i, (name, begun, tried) in enumerate(zip(names(rest), flat(rest), flat(visited), strict=True)):
        change = tried - begun or _NOISE
        moved = {name: begun + change}
        other = rebuilt(rest, lambda path, old, moved=moved: moved.get(name_of(path), old))  # type: ignore[misc]
        state, commands = _at_rest(law, other, sample, dt)
        kept = (flat(state)[i] - flat(still)[i]) / change
        if np.array_equal(commands, quiet) and kept > 0.9:
            found.append(name)
    return found


def _at_rest(law: Law, state: State, sample: Sample, dt: float) -> tuple[State, Array]:
    """The state after a few cycles at rest, and the commands meanwhile."""
    commands = np.empty(_TRIAL_CYCLES)
    for k in range(_TRIAL_CYCLES):
        state, commands[k] = law.step(state, sample, _REST, dt)
    return state, commands
