"""A drive with a motor and any plant behind it that can break, cycle by cycle: what the supervisor is tested on.

    drive = drive_start(settings, motor, sheath)
    in each cycle:
        drive, reading = drive_read(settings, drive, power, …)      with what is wrong at sensors, bus, drive and cable
        drive = drive_moved(settings, drive, target, …)             one cycle later

Both the fault matrix (`support.supervised`, compiled) and the drive of the live loop (`support.injected_loop`) are made
of these, with a plant's kernels in the place of `plant_rest` … `plant_look` (`of_plant`).
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import kernel, reached, specialise
from bowden.core.signals import DriveReading, Power
from bowden.models.drive.motor import Motor
from bowden.models.drive.motor import current as motor_current
from bowden.plants.plant import (
    Dynamics,
    Plant,
    SheathState,
    plant_advance,
    plant_look,
    plant_observe,
    plant_rest,
)
from bowden.sim.injected import CONSUMER, DISABLED, ENABLED, Injected, misread

SPOOL_RADIUS = 0.02
"""Of the tension that is simulated [m]."""
TRAIN = 0.938
"""Torque of the spool over that of the joint [N·m/(N·m)]."""
SLACK = 0.8
"""Way of the motor for which the joint stays where it is when the cable is slack [rad]."""

POWER_ON = float(Power.ON)


class DriveSettings(NamedTuple):
    """What does not change in a run."""

    plant: Any
    """`Dynamics.plant`."""
    motor: Motor
    """For the current and the tension that are simulated."""
    dt: float
    """Length of a cycle [s]."""


class Place(NamedTuple):
    """Where motor and joint truly are."""

    joint: float
    """[rad]"""
    motor: float
    """[rad]"""
    velocity: float
    """Of the motor [rad/s]."""
    acceleration: float
    """Of the motor, over the last cycle [rad/s²]."""


class Damage(NamedTuple):
    """What is broken; flags are 0 or 1."""

    slack: float = 0.0
    anchor: float = 0.0
    """Motor angle at which the cable went slack [rad]."""
    frozen: float = 0.0
    """The joint's then [rad]."""
    torn: float = 0.0
    fallen: float = 0.0
    """How far the joint has gone since the cable tore [rad]."""
    pushed: float = 0.0
    """How far the limb has been pushed on [rad]."""
    slipped: float = 0.0
    """How far the motor's zero has slipped [rad]."""
    runs_away: float = 0.0
    jams: float = 0.0
    deaf: float = 0.0
    """Nothing reaches the drive."""
    dead: float = 0.0
    """It has switched itself off."""


class DriveState(NamedTuple):
    """Where drive and plant are."""

    body: Any
    """The plant's."""
    place: Place
    state: float
    """Of CiA 402, before what the bus makes of it."""
    power: float
    """As told, 0 or 3."""
    applied: float
    """Target that is followed [rad]."""
    damage: Damage


@kernel
def drive_start(settings: DriveSettings, motor: float, sheath: SheathState) -> DriveState:
    """Without power, at rest at a `motor` angle [rad]."""
    nothing = Damage(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    body = plant_rest(settings.plant, motor, sheath)
    seen = plant_look(settings.plant, body)
    return DriveState(body, Place(seen.joint, seen.motor, 0.0, 0.0), DISABLED, 0.0, motor, nothing)


@kernel
def drive_heard(drive: DriveState, power: float) -> DriveState:
    """The drive in its next state: one step a cycle towards operation enabled, and off at once."""
    state = min(drive.state + 1.0, ENABLED) if power == POWER_ON else DISABLED
    return DriveState(drive.body, drive.place, state, power, drive.applied, drive.damage)


@kernel
def drive_turns(drive: DriveState) -> bool:
    """Whether the motor has torque."""
    return drive.power == POWER_ON and drive.damage.dead == 0.0


@kernel
def true_joint(drive: DriveState) -> float:
    """The joint's angle, wherever slack, a torn cable or a push have it [rad]."""
    damage = drive.damage
    held = damage.slack > 0.0 and abs(drive.place.motor - damage.anchor) < SLACK
    return (damage.frozen if held else drive.place.joint) + (damage.pushed - damage.fallen)


@kernel
def drive_reading(
    settings: DriveSettings, drive: DriveState, normals: NDArray[np.float64]
) -> tuple[DriveState, DriveReading]:
    """What the drive says in order: before what is injected at sensors and bus. `normals` (m,) are the sensors'."""
    damage, motor, place, joint = drive.damage, settings.motor, drive.place, true_joint(drive)
    pulls = 0.0 if damage.slack + damage.torn > 0.0 else 1.0
    load = TRAIN * (motor.pretension + motor.spring * joint) * pulls
    amperes = motor_current(place.acceleration, 0.0, 0.0, motor) + load / (motor.gear * motor.torque_constant)
    amperes = (motor.current_limit if damage.jams > 0.0 else amperes) if drive_turns(drive) else 0.0
    body, measured = plant_observe(settings.plant, drive.body, normals)
    return DriveState(body, place, drive.state, drive.power, drive.applied, damage), DriveReading(
        measured.motor + damage.slipped,
        measured.joint + (joint - place.joint),
        amperes,
        max(0.0, load / SPOOL_RADIUS),
        40.0,
        0.0,
        0.0,
        0.01,
        drive.state,
        0.0,
        0.0,
        0.0,
        0.0,
        np.nan,
        np.nan,
        np.nan,
        np.nan,
    )


@kernel
def drive_damaged(settings: DriveSettings, drive: DriveState, kind: int, since: int) -> DriveState:
    """The drive with a fault that began `since` cycles ago."""
    place, dt = drive.place, settings.dt
    slack, anchor, frozen, torn, fallen, pushed, slipped, runs_away, jams, deaf, dead = drive.damage
    if kind == Injected.SLACK and slack == 0.0:
        slack, anchor, frozen = 1.0, place.motor, place.joint
    elif kind == Injected.BROKEN_CABLE:
        torn = 1.0
        fallen += (place.joint + 0.2 - fallen) * dt / 0.03
    elif kind == Injected.JOINT_OVER_TRAVEL:
        pushed += 4.0 * dt
    elif kind == Injected.MOTOR_OVER_TRAVEL:
        slipped += 2.0 * dt
    elif kind == Injected.OVER_SPEED:
        runs_away = 1.0
    elif kind == Injected.JAM:
        jams = 1.0
    elif kind == Injected.HOST_SILENT:
        deaf, dead = 1.0, 1.0 if since > CONSUMER else dead
    elif kind == Injected.DRIVE_FAULT or kind == Injected.DRIVE_REBOOT or kind == Injected.DRIVE_DROPPED:
        dead = 1.0
    damage = Damage(slack, anchor, frozen, torn, fallen, pushed, slipped, runs_away, jams, deaf, dead)
    return DriveState(drive.body, place, drive.state, drive.power, drive.applied, damage)


@kernel
def drive_read(
    settings: DriveSettings,
    drive: DriveState,
    power: float,
    k: int,
    normals: NDArray[np.float64],
    kinds: NDArray[np.int64],
    onsets: NDArray[np.int64],
    joints: NDArray[np.float64],
    motors: NDArray[np.float64],
) -> tuple[DriveState, DriveReading]:
    """The drive in cycle k under the `power` that has reached it, and what comes of its reading.

    Args:
        settings: of the drive.
        drive: as the plant left it.
        power: 0 or 3.
        k: the cycle.
        normals: of the encoders (n, 2).
        kinds: of what is injected (m,).
        onsets: from which cycles on (m,).
        joints: what the joint's encoder said in each cycle, before faults (n,); this cycle's is written.
        motors: likewise.
    """
    drive = drive_heard(drive, power)
    drive, told = drive_reading(settings, drive, normals[k])
    joints[k], motors[k] = told.joint, told.motor
    for i in range(len(kinds)):
        if k >= onsets[i]:
            told = misread(kinds[i], k - onsets[i], told, joints, motors, k)
            drive = drive_damaged(settings, drive, kinds[i], k - onsets[i])
    return drive, told


@kernel
def drive_moved(
    settings: DriveSettings, drive: DriveState, target: float, sheath: SheathState, next_sheath: SheathState
) -> DriveState:
    """One cycle later under a `target` [rad], in a sheath that is so at the cycle's beginning and at its end.

    A motor without torque coasts to a stop; the servo of one that runs away is drawn on, one that is jammed stands with
    all that is behind it, and nothing reaches one that is deaf.
    """
    damage, place = drive.damage, drive.place
    applied = drive.applied if damage.deaf > 0.0 else target
    body = drive.body
    if damage.jams > 0.0:
        still = Place(place.joint, place.motor, 0.0, 0.0)
        return DriveState(body, still, drive.state, drive.power, applied, damage)
    aim = applied
    if not drive_turns(drive):
        aim = place.motor * (1.0 - settings.dt / 0.1)
    elif damage.runs_away > 0.0:
        aim = place.motor + 0.93
    body = plant_advance(settings.plant, body, aim, sheath, next_sheath)
    seen = plant_look(settings.plant, body)
    there = Place(seen.joint, seen.motor, seen.motor_velocity, (seen.motor_velocity - place.velocity) / settings.dt)
    return DriveState(body, there, drive.state, drive.power, applied, damage)


def settings_of(plant: Plant, dynamics: Dynamics) -> DriveSettings:
    """What a drive with that plant behind it is made of; one whose motor is no plain one has the default's currents."""
    motor = plant.motor if isinstance(plant.motor, Motor) else Motor()
    return DriveSettings(dynamics.plant, motor, plant.sample_time)


def of_plant(function: Callable[..., Any], dynamics: Dynamics) -> Callable[..., Any]:
    """One of these kernels, compiled for a plant."""
    return specialise(function, dynamics.name, **reached(function, dynamics.kernels()))
