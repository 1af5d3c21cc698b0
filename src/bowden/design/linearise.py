"""Any law as a linear system near rest: central differences on the plain step, one encoder count wide.

A difference as wide as one count sees a steep curve, such as tanh(s/ε), as the encoder sees it. States that act as
parameters (estimates) are found by trying them, and frozen.
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.law import Law, State, law_start, law_step
from bowden.control.stability import StateSpace
from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel, specialise
from bowden.core.nested import flat, leaves, map_leaves, name_of, names, unflatten
from bowden.core.signals import Reference, Sample
from bowden.core.units import RADIANS

Array = NDArray[np.float64]

_TRIAL_CYCLES = 20
_NOISE = 1e-9
"""Part of a difference, counted in the widths that it was taken with, that is rounding."""

_SHORTEST = 0.4e-3
"""A cycle in which a joint of 30 rad/s goes by the largest `Law.deadband`, so that a law takes that for no jump [s]."""


class NoNumberError(ParameterError):
    """A law that gives no number near rest, so that it has no linear model there."""


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

    States that the motor and the joint do not reach, or that do not reach the command, are left out; flags and phases
    stay as they are.

    Args:
        law: with its gains.
        dt: sample time [s].
        width: half of the difference in the two angles, an encoder's count for what the loop will see; of the joint no
            less than what the law weighs in full, `Law.deadband` [rad].
        estimates: name of a state (``part.field`` where it nests) → the value at which it is frozen.
        at: joint and motor angle of the rest [rad]; the reference is there as well.

    Raises:
        NoNumberError: its command or a state of it is no finite number there.
        ParameterError: in so short a cycle the law takes that difference of the joint for a reading that jumps.
    """
    frozen, across = estimates or {}, np.array([max(width, law.deadband), width])
    rest = map_leaves(law.start(Sample(at, at)), lambda path, old: type(old)(frozen.get(name_of(path), old)))
    free = [i for i, (path, old) in enumerate(leaves(rest)) if name_of(path) not in frozen and isinstance(old, float)]
    start = np.array(flat(rest), dtype=np.float64)

    def differences(states: Array, samples: Array) -> Array:
        """Halves of the differences between each row and the one after it, commands with the opposite sign last."""
        stepped, commands = _walked(law, states, samples, at, dt, 1)
        both = np.column_stack([stepped, -commands])
        finite = np.isfinite(both).all(axis=0)
        if not finite.all():
            first = [*(f"its state {name}" for name in names(rest)), "its command"][int(np.argmin(finite))]
            raise NoNumberError(
                f"{law.name} has no linear model: {first} is no finite number at rest at {at / RADIANS:g}° or a count "
                "of the encoder beside it",
                expected="a law that is defined there",
                do="correct the law",
            )
        return (both[::2] - both[1::2]) / 2.0

    moved = differences(np.tile(start, (4, 1)), at + np.kron(np.diag(across), np.array([[1.0], [-1.0]])))
    widths = np.maximum(np.max(np.abs(moved), axis=0)[:-1], 1e-9 * (1.0 + np.abs(start)))
    sides = np.zeros((len(free), len(start)))
    sides[np.arange(len(free)), free] = widths[free]
    sided = np.stack([start + sides, start - sides], axis=1).reshape(2 * len(free), len(start))
    columns = differences(sided, np.full((2 * len(free), 2), at))
    by_state = columns.T  # in widths of the state
    by_input = moved.T  # in widths of the angles
    scale = widths[free]
    model = _reduced(by_state[free], by_input[free], by_state[-1], by_input[-1], scale, across)
    if law.deadband and dt < _SHORTEST and not (model.d[0] or model.b[:, 0].any()):
        raise ParameterError(
            f"{law.name} cannot be judged in cycles of {1e3 * dt:g} ms: the {across[0] / RADIANS:.2g}° of the joint by "
            "which it would show its feedback are a jump to it, which it leaves out",
            expected=f"a cycle of {1e3 * _SHORTEST:g} ms or more",
            do="lengthen sample_time_ms in [bench], or take another law",
        )
    return model


def _reduced(into: Array, driven: Array, out: Array, direct: Array, scale: Array, across: Array) -> LawModel:
    """The part that the inputs reach and that reaches the command, in SI units."""
    a, b = into / scale[:, None], driven / scale[:, None]  # both now free of units
    links = np.abs(a) > _NOISE
    reached = _spread(np.any(np.abs(b) > _NOISE, axis=1), links)
    observable = _spread(
        np.abs(out) > _NOISE * max(float(np.max(np.abs([*out, *direct]), initial=0.0)), 1e-300), links.T
    )
    keep = np.flatnonzero(reached & observable)
    s = scale[keep]
    return LawModel(
        a=a[np.ix_(keep, keep)] * s[:, None] / s[None, :],
        b=b[keep] * s[:, None] / across,
        c=(out[keep] / s)[None, :],
        d=direct / across,
    )


def _spread(marked: NDArray[np.bool_], links: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Marks carried along `links[to, from]` until nothing more is reached."""
    for _ in range(len(marked)):
        marked = marked | (links @ marked)
    return marked


def find_estimates(law: Law, visited: State, dt: float) -> list[str]:
    """The states of a law that act as parameters: one that is changed stays, and at rest at zero no command shows it.

    An integral acts at once and a filter's memory fades; an estimate of a slope or of a height multiplies something
    that is zero at rest, and keeps its value.

    Args:
        law: with its gains.
        visited: values that the states take in a run, to try.
        dt: sample time [s].
    """
    rest = law.start(Sample(0.0, 0.0))
    start = np.array(flat(rest), dtype=np.float64)
    change = np.array(flat(visited), dtype=np.float64) - start
    change = np.where(change == 0.0, _NOISE, change)
    states = np.vstack([start, start + np.diag(change)])
    after, commands = _walked(law, states, np.zeros((len(states), 2)), 0.0, dt, _TRIAL_CYCLES)
    kept = (np.diag(after[1:]) - after[0]) / change
    silent = (commands[1:] == commands[0]).all(axis=1)
    return [name for name, quiet, stays in zip(names(rest), silent, kept > 0.9, strict=True) if quiet and stays]


def _walked(law: Law, states: Array, samples: Array, at: float, dt: float, cycles: int) -> tuple[Array, Array]:
    """The states (m, n) after some cycles at each row of `samples` (m, 2), and the commands meanwhile (m, cycles)."""
    after, commands = np.empty_like(states), np.empty((len(states), cycles))
    walk = specialise(walk_near_rest, law.name, law_start=law.start_kernel, law_step=law.step_kernel)
    walk(law.gains, states, samples, Reference(float(at), 0.0, 0.0), float(dt), after, commands)
    return after, commands


@kernel
def walk_near_rest(
    gains: Any, states: Array, samples: Array, reference: Reference, dt: float, after: Array, commands: Array
) -> None:
    """From each row of `states` (m, n), cycles at one sample; fills `after` (m, n) and `commands` (m, cycles).

    Compiled, since hundreds of steps of a law with many states take half a second interpreted.
    """
    like = law_start(gains, Sample(0.0, 0.0))
    for i in range(len(states)):
        state = unflatten(like, states[i])
        sample = Sample(samples[i, 0], samples[i, 1], np.nan, np.nan)
        for k in range(commands.shape[1]):
            state, command = law_step(gains, state, sample, reference, dt)
            commands[i, k] = command
        numbers = flat(state)
        for j in range(len(numbers)):
            after[i, j] = numbers[j]
