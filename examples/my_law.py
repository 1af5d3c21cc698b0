"""A control law of your own: the inverse of a play, with integral feedback.

Run it beside the built-in ones:

    bowden simulate rig.toml --law examples/my_law.py --law adaptive

A law is two pure functions of numbers and NamedTuples, marked with @kernel, and the gains they take. It runs as it
stands here, compiled in simulation, and later as C: ordinary Python with `if`, `min`, `max`, `abs` (docs/own_law.md),
and `tanh`, `sin`, `exp` from `bowden.core.kernel`. Angles are in radians.
"""

from typing import NamedTuple

from bowden import Reference, Sample, kernel
from bowden.core.kernel import tanh


class Gains(NamedTuple):
    """Every gain needs a default; change them in [control.gains] of rig.toml."""

    slope: float = 0.938
    """Joint motion per motor motion [rad/rad]."""
    play: float = 0.09
    """Motor travel lost at a reversal [rad]."""
    blend: float = 0.02
    """Reference velocity at which most of the play is taken up [rad/s]."""
    integral_gain: float = 5.0
    """[1/s]"""


class State(NamedTuple):
    """What the law remembers from one cycle to the next: floats, bools and enums."""

    integral: float
    """∫(reference − joint) dt [rad·s]."""


@kernel
def start(gains: Gains, sample: Sample) -> State:
    """The state before the first cycle."""
    return State(0.0)


@kernel
def step(gains: Gains, state: State, sample: Sample, reference: Reference, dt: float) -> tuple[State, float]:
    """One cycle: the next state, and the motor's target angle [rad]."""
    integral = state.integral + (reference.position - sample.joint) * dt
    ahead = 0.5 * gains.play * tanh(reference.velocity / gains.blend)
    command = reference.position / gains.slope + ahead + gains.integral_gain * integral
    return State(integral), command
