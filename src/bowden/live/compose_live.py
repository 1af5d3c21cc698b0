"""From a rig.toml to a live run: the second of the two places where things are wired."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.control import LAWS, Law, user_law
from bowden.control.source import TABLE, Source
from bowden.core.errors import ParameterError
from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import Cycle
from bowden.cycle.torque_offset import TorqueOffset
from bowden.hardware.drives.parameters import DriveParameters, most_push
from bowden.hardware.emg.course import EmgCourse
from bowden.hardware.emg.intent_block import IntentReader
from bowden.hardware.realtime import Settings
from bowden.live import excitation
from bowden.live.admittance_live import live_pushing
from bowden.live.preflight import Preflight
from bowden.live.run_settings import plain
from bowden.live.script import Script
from bowden.live.suit_preflight import on_suit
from bowden.rig import compose
from bowden.rig import drive as rig_drive
from bowden.rig import schema as schema
from bowden.rig.emg_setup import EmgRun, emg_run
from bowden.safety.limits import Limits
from bowden.sensing.intent import FOLLOWED_ACCELERATION, FOLLOWED_SPEED, TURNED_ACCELERATION, TURNED_SPEED

WRONG_WAY = 1.5 * RADIANS
"""Motion of the joint that the preflight believes: after a reversal the paper's own cable first goes the wrong way by
more than half a degree (docs/theory.md, erratum on monotone travel) [rad]."""

_NONE = 1e-9
"""A limit of zero, where something is divided by it."""


@dataclass(frozen=True)
class Asked:
    """What the command line asks for."""

    rig: Path
    law: str | None = None
    preset: str | None = None
    duration: float | None = None
    """[s]"""
    channel: str | None = None
    """Of the bus, in place of the rig's."""
    interface: str | None = None
    """Of that bus, in place of the rig's."""
    measure: bool = False
    """Move the motor through the excitation, in place of a law."""
    emg: str | None = None
    """Source of EMG, in place of the rig's."""


@dataclass(frozen=True)
class Live:
    """A run, all but its drive."""

    setup: compose.Setup
    description: schema.Rig
    law: Law
    drive: DriveParameters
    limits: Limits
    settings: Settings
    table: NDArray[np.float64]
    """See `runtime.script.Script`."""
    servo_from: int
    """Row of an excitation from which on it is meant for the servo; 0 for a law."""
    start: float
    """Motor angle at which the run begins [rad]."""
    law_file: str = ""
    """Where a user's own law came from, as ``FILE.py:NAME``."""
    emg: EmgRun | None = None
    """Where the reference comes from in a run by EMG; the table is not looked at then."""

    def cycle(self) -> Cycle:
        """Law under supervisor."""
        filters, period = rig_drive.filters(self.description), self.drive.sample_time
        return Cycle(self.law, self.limits, filters, period, self.source())

    def source(self) -> Source:
        """Of the reference: the wearer's push, or else the script's."""
        pushing = self.setup.pushing
        return TABLE if pushing is None else pushing.source(self.law)

    def course(self, block: Path | None, start: int) -> EmgCourse | None:
        """The reference of a run by EMG, from what its process writes; `start` as `EmgCourse` has it."""
        if self.emg is None or block is None:
            return None
        return EmgCourse(self.emg.course, IntentReader(block), start, len(self.table))

    def push(self) -> TorqueOffset | None:
        """The torque offset of a drive that takes one."""
        torque, spool, substeps = self.drive.torque_offset, self.drive.spool, self.setup.bench.substeps
        return None if spool is None or torque == 0.0 else TorqueOffset(torque, substeps, spool)

    def _told_push(self) -> Mapping[str, Any]:
        spool = plain(self.drive.spool)
        return {"torque": self.drive.torque_offset, "substeps": self.setup.bench.substeps, "spool": spool}

    def script(self, course: EmgCourse | None = None) -> Script:
        """The run's plan."""
        speed = self.description.live.approach_deg_per_s * RADIANS
        checks = Preflight(pull_sign=-self.limits.slack_sign, moved=WRONG_WAY)
        suit = self.setup.suit
        checks = checks if suit is None else on_suit(checks, suit)
        slope = 1.0 if suit is not None else self.setup.bench.cable.slope
        return Script(self.table, self.start, speed, checks, self.drive.sample_time, course, slope)

    def told(self) -> Mapping[str, Any]:
        """What the log keeps of the rig, beside the law and the limits."""
        return {
            "reference": self.setup.reference.describe(),
            "seed": self.setup.seed,
            "rig": self.description.model_dump(mode="json"),
            **({"law_file": self.law_file} if self.law_file else {}),
            **({"emg": self.emg.told()} if self.emg else {}),
            **({"push": self._told_push()} if self.drive.torque_offset > 0.0 else {}),
            **({} if self.setup.pushing is None else {"admittance": plain(self.source().settings)}),
        }


def compose_live(asked: Asked) -> Live:
    """Read the rig and put a run together.

    Raises:
        ParameterError: a file, key or value that cannot be used, or a rig that cannot run live.
    """
    setup, rig = compose.setup(asked.rig, asked.duration, emg=asked.emg)
    if setup.turned:
        raise ParameterError(
            f"{asked.rig}: the cable's slope is negative",
            expected="a joint angle that grows with the motor's",
            do="turn motor_direction or joint_direction of [drive] round, and measure anew",
        )
    drive = rig_drive.on_bus(rig_drive.drive_parameters(rig, setup.bench, setup.suit), asked.channel, asked.interface)
    limits, source = rig_drive.limits(rig, setup.bench), ""
    emg = None if asked.measure else emg_run(rig.emg, asked.rig.parent, asked.emg)
    if asked.measure:
        setup = replace(setup, pushing=None)
    if setup.pushing is not None:
        pushing, notes = live_pushing(setup.pushing, limits, most_push(drive), by_emg=emg is not None)
        setup = replace(setup, pushing=pushing, notes=(*setup.notes, *notes))
    if emg is not None:
        _check_range(emg, limits)
        _check_duration(emg, limits)
        limits = limits._replace(uses_emg=1.0)
    if asked.measure:
        law, moved = LAWS["uncompensated"], excitation.excitation(limits, drive.sample_time)
        table, servo_from, start = moved.motor[:, None], moved.servo_from, float(moved.motor[0])
    else:
        folder = Path() if asked.law else asked.rig.parent
        name = asked.law or rig.control.law
        law = compose.law_for(name, rig, setup.bench, folder, asked.preset)
        source = user_law.absolute(name, folder) if user_law.is_file(name) else ""
        time = np.arange(round(setup.duration / drive.sample_time), dtype=np.float64) * drive.sample_time
        table, servo_from, start = setup.reference.sample(time), 0, setup.initial_motor
    return Live(setup, rig, law, drive, limits, rig_drive.settings(rig), table, servo_from, start, source, emg)


def _check_range(emg: EmgRun, limits: Limits) -> None:
    """Refuse motions that the supervisor would end."""
    low, high = emg.course.intent.low, emg.course.intent.high
    if not limits.joint_low < low < high < limits.joint_high:
        raise ParameterError(
            f"emg.low_deg is {low / RADIANS:g} and high_deg {high / RADIANS:g}",
            expected=f"within the joint's limits, {limits.joint_low / RADIANS:g} to {limits.joint_high / RADIANS:g}",
            do="correct them, or [limits]",
        )


def _check_duration(emg: EmgRun, limits: Limits) -> None:
    """Refuse motions that are quicker than the supervisor lets joint and motor be."""
    intent, given = emg.course.intent, emg.course.intent.duration
    turned = emg.course.proportional < 0.5
    speed, acceleration = (TURNED_SPEED, TURNED_ACCELERATION) if turned else (FOLLOWED_SPEED, FOLLOWED_ACCELERATION)
    joint = intent.high - intent.low
    motor = joint / max(limits.slope_low, _NONE)
    least, what = max(
        (speed * joint / max(limits.joint_speed, _NONE), "the joint's speed, limits.joint_speed_deg_per_s"),
        (speed * motor / max(limits.motor_speed, _NONE), "the motor's speed, limits.motor_speed_deg_per_s"),
        (
            math.sqrt(acceleration * motor / max(limits.acceleration, _NONE)),
            "the motor's acceleration, limits.acceleration_deg_per_s2",
        ),
    )
    if given < least:
        raise ParameterError(
            f"emg.duration_s is {given:g}, for {joint / RADIANS:g}°",
            expected=f"at least {math.ceil(100.0 * least) / 100.0:g} s, by {what}",
            do="make it longer, or the range smaller",
        )
