"""The exact inverse's command: what a law would send that knew the plant's cable and state without error.

The motor's path m(t) is the one on which the plant's own cable, moved slowly, has its joint exactly at the reference;
where the reference turns, the motor jumps whatever the cable loses there. Where it does not jump, the command is ahead
of it by the servo's lag,

    command = m + (2ζ/ω)·dm/dt + d²φ/dt²/(ω²·slope)

with the cable's slope at its identified bend in the last, small term, because a kink in m would make d²m/dt² infinite.
Its total variation is what `bowden.design.league` measures every law's command by.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.control.reference import Trajectory
from bowden.core.kernel import kernel, specialise, stand_in
from bowden.models.cable.lumped_cable import PreparedLumped
from bowden.plants.cable_body import cable_advance, cable_look
from bowden.plants.cable_plant import Cable, CablePlant
from bowden.plants.cables import Hysteresis
from bowden.plants.friction_cables import sliding
from bowden.plants.plant import sheath_path
from bowden.sim.scenario import BendPath

Array = NDArray[np.float64]

STEP = 5e-3
"""Time between two points of the path [s]."""

_TURN_BACK = np.radians(0.1)
"""An error for which it pays to turn the motor against the reference's motion, as a moving sheath may ask [rad]."""

_SLOWLY = 1e4
"""Time that each of the path's steps is given, so long that mass and damping do not show [s]."""

_REACH = 1.5
"""Longest move that is tried for one point; beyond it the joint cannot be where the reference is [rad]."""


@stand_in
def copied(memory: Any, spare: Any) -> Any:
    """A cable's memory made of arrays, copied into another one."""
    for i in range(len(memory)):
        spare[i][:] = memory[i]
    return spare


@kernel
def kept(memory: Any, spare: Any) -> Any:
    """A cable's memory made of numbers, which nothing changes."""
    return memory


@kernel
def exact_path(
    cable: Any,
    memory: Any,
    spare: Any,
    motor: float,
    references: Array,
    speeds: Array,
    widths: Array,
    factors: Array,
    dt: float,
    path: Array,
) -> None:
    """Fill `path` (n,) with the motor angles at which the joint is at `references` (n,) [rad].

    A move is lengthened until the joint has passed the reference, which on a cable that first moves the wrong way is
    behind its jump, and then shortened by regula falsi (in which the end that stays counts half). A point that cannot
    be reached leaves the motor where it is.
    """
    heading = 0.0
    for k in range(references.size):
        width, factor = widths[k], factors[k]
        memory = cable_advance(cable, memory, motor, motor, width, factor, dt)
        error = references[k] - cable_look(cable, memory, motor, width, factor).joint
        side = 1.0 if error > 0.0 else -1.0
        tolerance = 1e-9 if side * speeds[k] > 0.0 or side * heading > 0.0 else _TURN_BACK
        path[k] = motor
        if abs(error) < tolerance:
            continue
        near, left = 0.0, -abs(error)
        stride = max(1e-5, abs(error))
        far, right = 0.0, left
        while right < -1e-9 and far < _REACH:
            near, left = far, right
            far += stride
            trial = cable_advance(cable, copied(memory, spare), motor, motor + side * far, width, factor, dt)
            right = side * (cable_look(cable, trial, motor + side * far, width, factor).joint - references[k])
            stride = min(1.5 * stride, 0.01)
        if right < -1e-9:
            continue
        weight_near, weight_far = left, right
        for _ in range(60):
            if right < 1e-10 or far - near < 1e-12:
                break
            middle = far - weight_far * (far - near) / (weight_far - weight_near)
            trial = cable_advance(cable, copied(memory, spare), motor, motor + side * middle, width, factor, dt)
            value = side * (cable_look(cable, trial, motor + side * middle, width, factor).joint - references[k])
            if value >= 0.0:
                far, right, weight_far, weight_near = middle, value, value, 0.5 * weight_near
            else:
                near, weight_near, weight_far = middle, value, 0.5 * weight_far
        memory = cable_advance(cable, memory, motor, motor + side * far, width, factor, dt)
        motor, heading = motor + side * far, side
        path[k] = motor


def exact_motor(
    plant: CablePlant, reference: Trajectory, *, duration: float, bend: BendPath, initial_motor: float
) -> tuple[Array, Array]:
    """The motor's path on which the joint is at the reference, and the reference there.

    Args:
        plant: with its cable.
        reference: the joint's desired motion.
        duration: of the run [s].
        bend: the sheath's total bend over time.
        initial_motor: motor angle at rest before the start [rad].

    Returns:
        The path (n,) [rad] and position, velocity, acceleration of the reference (n, 3), every `STEP`.
    """
    time = np.arange(round(duration / STEP), dtype=np.float64) * STEP
    samples = np.ascontiguousarray(reference.sample(time))
    _, widths, factors = sheath_path(plant.sheath, bend(time))
    cable = _slow(plant.cable)
    prepared = cable.prepared
    memory, spare = (cable.start(prepared, initial_motor, float(widths[0]), float(factors[0])) for _ in range(2))
    path = np.empty(len(time))
    parts = {"cable_advance": cable.advance, "cable_look": cable.look}
    tried = {"copied": kept} if isinstance(memory, Hysteresis) else {}
    walk = specialise(exact_path, cable.advance.__name__, **parts, **tried)
    columns = (np.ascontiguousarray(samples[:, 0]), np.ascontiguousarray(samples[:, 1]))
    walk(prepared, memory, spare, float(initial_motor), *columns, widths, factors, _SLOWLY, path)
    return path, samples


def _slow(cable: Cable) -> Cable:
    """The cable for slow motion: of lumped masses, one long step a move.

    With Coulomb friction that step, which takes friction's limit from its beginning, overshoots a jump; a slow motion
    of these masses is that of the sliding tendon on their grid.
    """
    prepared = cable.prepared
    if not isinstance(prepared, PreparedLumped):
        return cable
    return (
        replace(cable, prepared=prepared._replace(step=_SLOWLY)) if prepared.dahl else sliding(cable.parameters.tendon)
    )


def exact_travel(
    plant: CablePlant, reference: Trajectory, *, duration: float, bend: BendPath, initial_motor: float
) -> float:
    """Total variation of the exact inverse's command, from rest on [rad]; see `exact_motor` for the arguments."""
    path, samples = exact_motor(plant, reference, duration=duration, bend=bend, initial_motor=initial_motor)
    asked = np.abs(np.diff(samples[:, 0])) / abs(plant.cable.slope)
    moves = np.diff(path)
    jumps = np.abs(moves) > np.maximum(2e-3, 5.0 * asked)
    rate = np.append(np.where(jumps, 0.0, moves), 0.0) / STEP
    servo = plant.servo
    command = path + 2.0 * servo.damping / servo.natural_frequency * rate
    command += samples[:, 2] / (servo.natural_frequency**2 * plant.cable.slope)
    return float(np.abs(np.diff(command, prepend=initial_motor)).sum())
