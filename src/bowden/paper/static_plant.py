"""The paper's own picture of the bench: a static plant, and the adaptive law solved together with it (reading 7).

The paper takes joint = αφ·motor + hysteresis, with no servo between command and motor. Then s, ė and the command
depend on one another at one instant: each sample asks for the motor angle m with

    m = law(joint(m)),    joint(m) the cable's answer to a motor that goes straight from its last angle to m

As long as joint(m) does not fall with m, and β̂ and D̂m are not negative, m − law(joint(m)) rises strictly: there is
exactly one such angle, and bisection finds it. That holds for the play operator, and for Bouc–Wen where αφ + αh·ρ is
positive and h does not overshoot; it does not for the printed Bouc–Wen parameters, whose joint first runs the wrong way
after a reversal (reading 6). There bisection finds *a* solution, and the motor jumps from one branch to another.
"""

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.laws.adaptive import AdaptiveGains
from bowden.control.laws.adaptive import start as law_start
from bowden.control.laws.adaptive import step as law_step
from bowden.control.reference import Trajectory
from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel, placeholder, specialise
from bowden.core.signals import Reference, Sample
from bowden.models.cable.backlash import Play, push
from bowden.models.cable.backlash import joint_angle as play_joint_angle
from bowden.models.cable.bouc_wen import BoucWen, advance
from bowden.models.cable.bouc_wen import joint_angle as bouc_wen_joint_angle

Array = NDArray[np.float64]


class StaticRun(NamedTuple):
    """The solution over time, arrays (n,); NaN from the sample on at which no motor angle within 1000 rad solves it."""

    time: Array
    """[s]"""
    reference: Array
    """[rad]"""
    motor: Array
    """The command, which the static plant follows at once [rad]."""
    joint: Array
    """[rad]"""
    slope_inverse: Array
    """β̂ [rad/rad]."""
    bound: Array
    """D̂m [rad]."""


@kernel
def play_after(z: float, before: float, motor: float, cable: Play) -> float:
    """The play's slot after the motor has gone from `before` to `motor` [rad]."""
    return push(z, motor, cable.half_width)


@kernel
def play_joint(motor: float, z: float, cable: Play) -> float:
    """The joint angle with the play's slot at z [rad]."""
    return play_joint_angle(z, cable)


@kernel
def bouc_wen_after(h: float, before: float, motor: float, cable: BoucWen) -> float:
    """Bouc–Wen's h after the motor has gone from `before` to `motor` [rad]."""
    return advance(h, motor - before, cable)


@placeholder
def memory_after(memory: float, before: float, motor: float, cable: Any) -> float:
    """Placeholder for the cable's memory in the loop's source; `specialise` puts a cable's own in its place."""
    raise NotImplementedError  # always replaced


@placeholder
def joint_of(motor: float, memory: float, cable: Any) -> float:
    """Placeholder for the cable's joint angle."""
    raise NotImplementedError  # always replaced


@kernel
def run_implicit(gains: AdaptiveGains, cable: Any, references: Array, dt: float, record: Array) -> int:
    """Solve every sample, fill `record` (n, 4) and return how many could be solved."""
    memory, motor = 0.0, 0.0
    state = law_start(gains, Sample(joint_of(motor, memory, cable), motor))
    for k in range(references.shape[0]):
        reference = Reference(references[k, 0], references[k, 1], references[k, 2])
        before, old = motor, state
        low, high, reach = -math.inf, math.inf, 1e-6
        while True:
            after = memory_after(memory, before, motor, cable)
            joint = joint_of(motor, after, cable)
            state, command = law_step(gains, old, Sample(joint, motor), reference, dt)
            if command > motor:
                low = motor
            else:
                high = motor
            if math.isfinite(high - low):
                middle = 0.5 * (low + high)
                if not low < middle < high:
                    break
                motor = middle
            elif reach < 1e3:  # not bracketed yet: look further out on the open side
                motor = low + reach if math.isfinite(low) else high - reach
                reach *= 2.0
            else:
                return k
        memory = after
        record[k, 0], record[k, 1], record[k, 2], record[k, 3] = motor, joint, state.slope_inverse, state.bound
    return references.shape[0]


def static_plant_run(
    gains: AdaptiveGains, cable: Play | BoucWen, reference: Trajectory, duration: float, dt: float
) -> StaticRun:
    """The adaptive law on the static plant from rest at motor angle zero, law and plant solved together each sample.

    Args:
        gains: of the adaptive law; the paper's are ``LAWS["adaptive"].presets["paper"]``.
        cable: the plant.
        reference: the joint's desired motion.
        duration: length of the run [s].
        dt: sample time [s].

    Raises:
        ParameterError: a duration or sample time that cannot be.
    """
    if not (dt > 0.0 and dt <= duration < 1e9 * dt):
        raise ParameterError(f"static plant: duration {duration}, dt {dt}", expected="0 < dt <= duration")
    time = np.arange(round(duration / dt), dtype=np.float64) * dt
    references = reference.sample(time)
    record = np.full((len(time), 4), np.nan)
    if isinstance(cable, Play):
        solve = specialise(run_implicit, "play", memory_after=play_after, joint_of=play_joint)
    else:
        solve = specialise(run_implicit, "bouc_wen", memory_after=bouc_wen_after, joint_of=bouc_wen_joint_angle)
    solve(gains, cable, references, float(dt), record)
    return StaticRun(time, references[:, 0].copy(), *(column.copy() for column in record.T))
