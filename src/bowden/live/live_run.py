"""From a rig to a live run of it."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from bowden.control import LAWS, Law
from bowden.control.law_file import LawFile
from bowden.control.source import TABLE, Source
from bowden.core.errors import ParameterError, error_context
from bowden.core.toml_text import quoted
from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import Cycle
from bowden.cycle.torque_offset import TorqueOffset
from bowden.design.objections import reference_beyond, refuse_sources, require_joint, turned
from bowden.hardware.emg.course import EmgCourse
from bowden.hardware.emg.intent_block import IntentReader
from bowden.hardware.ports import BrakedDrive, Drive
from bowden.live import excitation, row
from bowden.live.admittance_live import live_pushing
from bowden.live.brake_hold import BrakeHold
from bowden.live.joint_estimate import LiveEstimate
from bowden.live.preflight import Preflight, on_suit
from bowden.live.run_settings import plain, run_settings
from bowden.live.script import Home, Script
from bowden.live.together import columns_of_all
from bowden.models.minimum_jerk import minimum_jerk_over
from bowden.plants.pushing import Pushing
from bowden.rig.emg_run import EmgRun
from bowden.rig.families import DriveNeeds, family_of
from bowden.rig.joints import RigJoint
from bowden.rig.rig import Rig
from bowden.rig.settings import LiveSettings
from bowden.safety.limits import Limits
from bowden.safety.release import longest_release, release_speed
from bowden.sim.parting import parting_of
from bowden.sim.rig_runs import cabled_joint_of, joint_ranges

WRONG_WAY = 1.5 * RADIANS
"""Motion of the joint that the preflight believes: after a reversal the paper's own cable first goes the wrong way by
more than half a degree (docs/background/theory.md, erratum on monotone travel) [rad]."""

_BRAKED = 0.5
"""In which the time of a reference that still moves at the end of a run comes to a stand [s]."""

READER_SHARE = 0.2
"""Of `emg_age`, after which a process that has not looked for samples is gone: it looks every 2 ms, and needs not wait
for a network or a base station as samples do."""


@dataclass(frozen=True)
class Live:
    """A run, all but its drive; `live_run` makes it."""

    rig: Rig
    measure: bool
    """True if the motor moves through the excitation, in place of a law."""
    law: Law
    limits: Limits
    table: NDArray[np.float64]
    """See `live.script.Script`."""
    servo_from: int
    """First row of an excitation that is for the servo; 0 for a law."""
    start: float
    """Motor angle at which the run begins [rad]."""
    pushing: Pushing | None
    """The wearer's push, as the live loop has it."""
    notes: tuple[str, ...]
    """Notes for the user."""
    logged: Rig
    """The rig as the log keeps it: on the bus that it names, where a twin's own is gone after the run."""
    name: str = ""
    """Of the motor, where there are several."""
    several: "tuple[Live, ...]" = ()
    """Each motor, where there are several; what stands here is then that of the first."""
    whole: Rig | None = None
    """The rig with all its motors, where there are several."""
    joint: RigJoint | None = None
    """Of its motor, where there are several."""

    @property
    def motors(self) -> "tuple[Live, ...]":
        """Each motor; itself where there is one."""
        return self.several or (self,)

    @property
    def said(self) -> str:
        """The motor in a message; empty where there is one."""
        return f"motor {quoted(self.name)}" if self.name else ""

    @property
    def names(self) -> tuple[str, ...]:
        """Of the motors; one without a name where there is one."""
        return tuple(motor.name for motor in self.motors)

    @property
    def independent(self) -> bool:
        """True if a motor that is stopped by a fault leaves the others running."""
        return self.whole is not None and self.whole.independent

    @property
    def patience(self) -> float:
        """Age of the operator's sign of life at which the run is ended; of several motors the smallest [s]."""
        return min(motor.limits.operator_age for motor in self.motors)

    @property
    def opposed(self) -> bool:
        """True if its cable pulls against that of the motor whose drive has the joint's encoder."""
        return self.joint is not None and self.joint.against(self.rig)

    @property
    def encoders(self) -> tuple[int, ...]:
        """For each motor the place of the one whose drive has its joint's encoder."""
        return tuple(
            i if motor.joint is None else self.names.index(motor.joint.names[0]) for i, motor in enumerate(self.motors)
        )

    @property
    def neighbours(self) -> tuple[int, ...]:
        """For each motor the place of another one on its joint, by turns, whose angle its supervisor is shown; its own
        place where it moves a joint alone."""
        return tuple(
            i if motor.joint is None else self.names.index(_neighbour(motor.joint, motor.name))
            for i, motor in enumerate(self.motors)
        )

    @property
    def length(self) -> float:
        """Of the run, without what comes before the law or the motion leads [s]."""
        return max(len(motor.table) for motor in self.motors) * self.rig.sample_time

    def following(self, off_reference: Sequence[float]) -> "Live":
        """The same run whose joints may be this far off their references, one number a motor [rad]."""
        motors = [
            replace(motor, limits=motor.limits._replace(off_reference=most))
            for motor, most in zip(self.motors, off_reference, strict=True)
        ]
        return replace(self, limits=motors[0].limits, several=tuple(motors) if self.several else ())

    def columns(self) -> dict[str, str]:
        """Column → unit of the run's rows."""
        together = bool(self.several)
        return columns_of_all({motor.name: motor._columns(together=together) for motor in self.motors})

    def _columns(self, *, together: bool) -> dict[str, str]:
        emg, pushed = self.emg is not None, self.push() is not None
        kinds = {
            "emg": emg,
            "pushed": pushed,
            "braked": self.braked,
            "together": together,
            "shared": self.limits.shared,
        }
        return row.columns(self.law, **kinds, source=self.source())

    @property
    def needs(self) -> DriveNeeds:
        """Requirements on the drive."""
        return self.rig.drive_needs

    @property
    def emg(self) -> EmgRun | None:
        """Where the reference comes from in a run by EMG; the table is not looked at then."""
        return None if self.measure else self.rig.emg_run

    def cycle(self) -> Cycle:
        """Law under supervisor."""
        return Cycle(self.law, self.limits, self.rig.filters, self.rig.sample_time, self.source())

    def source(self) -> Source:
        """Of the reference: the wearer's push, or else the script's."""
        return TABLE if self.pushing is None else self.pushing.source(self.law)

    def course(self, block: Path | None, start: int) -> EmgCourse | None:
        """The reference of a run by EMG, from what its process writes; `start` as `EmgCourse` has it."""
        if self.emg is None or block is None:
            return None
        patience = READER_SHARE * self.limits.emg_age
        return EmgCourse(self.emg.course, IntentReader(block), start, len(self.table), patience)

    def push(self) -> TorqueOffset | None:
        """The torque offset of a drive that takes one."""
        torque, spool, substeps = self.needs.torque_offset, self.needs.spool, self.rig.substeps
        return None if spool is None or torque == 0.0 else TorqueOffset(torque, substeps, spool)

    @property
    def braked(self) -> bool:
        """True if a holding brake works in it; while the motor is measured it stays released."""
        return self.rig.brake.enabled and not self.measure

    def brake(self, drive: Drive) -> BrakeHold | None:
        """The holding brake of the rig's drive, where it works."""
        if not self.braked:
            return None
        return BrakeHold(cast(BrakedDrive, drive), self.rig.brake, self.limits, self.rig.sample_time)

    def estimate(self) -> LiveEstimate | None:
        """The estimate of the joint's angle, where this motor's drive is to have it and no encoder does.

        Raises:
            StreamError: the sensor's stream cannot be opened.
        """
        first = self.joint is None or self.joint.names[0] == self.name  # the other motors of a joint borrow it
        return LiveEstimate(self.rig) if first and self.rig.joint_sensor.estimated else None

    def _push_settings(self) -> Mapping[str, Any]:
        spool = plain(self.needs.spool)
        return {"torque": self.needs.torque_offset, "substeps": self.rig.substeps, "spool": spool}

    def losses(self) -> str:
        """How soon the power is off when somebody of the run is gone, for whoever starts it."""
        limits = max((motor.limits for motor in self.motors), key=longest_release)
        late = longest_release(limits) + self.rig.sample_time
        what = f"the {'joint' if self.rig.worn is None else 'arm'} is let down at {limits.lowering / RADIANS:.0f}°/s"
        off = f"{self.patience + late:.2f} s (operator_age_s of [limits])"
        said = f"if this terminal closes, or this command is killed, {what}; the power is off within {off}"
        if self.emg is None:
            return said
        reader, stream = READER_SHARE * limits.emg_age + late, limits.emg_age + late
        return (
            f"{said}; likewise within {reader:.2f} s if the process that reads EMG ends, and within {stream:.2f} s "
            "if samples stop arriving (emg_age_s)"
        )

    def script(self, course: EmgCourse | None = None) -> Script:
        """The run's plan."""
        limits, basis = self.limits, self.rig.basis
        speed = LiveSettings().approach / basis.slope if math.isnan(self.rig.live.approach) else self.rig.live.approach
        doubt = self.rig.joint_sensor.noise if self.rig.joint_sensor.sensed else 0.0
        checks = Preflight(
            pull_sign=-limits.slack_sign,
            moved=WRONG_WAY + doubt,
            noise=Preflight().noise + _ESTIMATE * doubt,
            light=limits.released_current if limits.homed else math.inf,
            low=limits.motor_low,
            high=limits.motor_high,
            tension=limits.measures_tension,
            torque=limits.measures_torque,
        ).on_cable(basis, self.rig.motor_encoder)
        if self.opposed:  # all motors of a joint move it the first one's way, or none would
            checks = checks._replace(pull_sign=-checks.pull_sign, load_sign=-1.0)
        suit = self.rig.worn
        checks = checks if suit is None else on_suit(checks, suit)
        slope = 1.0 if suit is not None else self.rig.slope
        return Script(self.table, self.start, speed, checks, self.rig.sample_time, course, slope, self.home)

    @property
    def home(self) -> Home | None:
        """Where the reference leads at the end; None where the wearer's push makes it."""
        limits = self.limits
        if self.pushing is not None:
            return None
        if self.measure:
            return Home(limits.taut, release_speed(limits, False))
        return Home(0.0 if limits.shared else self.rig.home, limits.lowering)

    def log_settings(self) -> dict[str, Any]:
        """Settings that the log keeps: law, limits, and all of the rig, so that a log is enough.

        Of several motors ``motors`` has those of each with its name, but for the rig, which is the whole one; what
        stands beside is that of the first.
        """
        law = run_settings(self.law, self.limits, self.rig.filters, self.rig.sample_time)
        own = {**law, **self.settings()}
        if not self.several:
            return own
        motors = [{**motor.log_settings(), "name": motor.name} for motor in self.several]
        for motor in motors:
            del motor["rig"], motor["names"]
        return {**own, "motors": motors, "independent": self.independent}

    def settings(self) -> Mapping[str, Any]:
        """Settings of the rig for the log, beside law and limits."""
        law = self.rig.law
        return {
            "reference": self.rig.trajectory.describe(),
            "seed": self.rig.seed,
            "rig": self.logged.document(),
            **(
                {"law_file": law.path + law.name.rpartition(".py")[2]}
                if isinstance(law, LawFile) and not self.measure
                else {}
            ),
            **({"emg": self.emg.settings()} if self.emg else {}),
            **({"push": self._push_settings()} if self.needs.torque_offset > 0.0 else {}),
            **({} if self.pushing is None else {"admittance": plain(self.source().settings)}),
        }


def live_run(rig: Rig, *, measure: bool = False, logged: Rig | None = None, joint_elsewhere: bool = False) -> Live:
    """The live run of a rig.

    Args:
        rig: with the law and all else that is to run.
        measure: move the motor through the excitation, in place of a law; not with several motors.
        logged: the same rig on the bus that it names, where it runs on a twin's own; for the log.
        joint_elsewhere: whether another motor's drive measures its joint.

    Raises:
        ParameterError: a rig that cannot run live.
    """
    if rig.motors:
        _ = rig.only() if measure else rig.pack()
        return _together(rig, logged or rig)
    if rig.turned:
        raise turned(rig)
    _ = rig.drive_parameters  # which refuses what makes no sense together
    if not joint_elsewhere:
        require_joint(rig)
    _ = rig.pack()  # which refuses more than a log's head and the loop's process can take
    limits, notes, logged = rig.supervisor_limits, rig.notes, logged or rig
    for beyond in () if measure else reference_beyond(rig, limits):
        raise ParameterError(beyond)
    emg = None if measure else rig.emg_run
    pushing = None if measure else rig.pushing
    if pushing is not None:
        strongest = family_of(rig.drive).most_push(rig.drive, rig.drive_needs)
        pushing, more = live_pushing(pushing, limits, strongest, by_emg=emg is not None)
        notes = (*notes, *more)
    if emg is not None:
        limits = limits._replace(uses_emg=True)
    if measure and rig.joint_sensor.estimated:
        raise ParameterError(
            f"{rig.origin}: the joint's angle is an estimate by the cable's model, which bowden measure is to find",
            expected="an encoder at the joint for it",
            do="log with one, and delete source of [joint_sensor] meanwhile; or take a model of a like cable",
        )
    if measure:
        moved = excitation.excitation(limits, rig.sample_time)
        table, start = moved.motor[:, None], float(moved.motor[0])
        return Live(rig, measure, LAWS["uncompensated"], limits, table, moved.servo_from, start, pushing, notes, logged)
    return Live(rig, measure, rig.fitted(), limits, _table(rig), 0, rig.start_motor, pushing, notes, logged)


_ESTIMATE = 3.0
"""Span of an estimate of the joint at rest, over its sensor's noise [–]."""


def _table(rig: Rig) -> NDArray[np.float64]:
    """The reference of each cycle (n, 3), brought to rest on its own path where the run ends while it moves."""
    whole, dt = round(rig.duration / rig.sample_time), rig.sample_time
    table = rig.trajectory.sample(np.arange(whole, dtype=np.float64) * dt)
    if not whole or table[-1, 1] == 0.0:
        return table
    time = np.arange(round(_BRAKED / dt) + 1, dtype=np.float64) * dt
    slowed, pace, _ = minimum_jerk_over(0.0, 1.0, _BRAKED, time)
    x, rate, slows = time / _BRAKED, 1.0 - slowed, -pace
    position, velocity, acceleration = rig.trajectory.sample(
        whole * dt + _BRAKED * (x - 2.5 * x**4 + 3.0 * x**5 - x**6)
    ).T
    braked = np.stack((position, velocity * rate, acceleration * rate**2 + velocity * slows), axis=1)
    return np.concatenate((table, braked))


def _together(rig: Rig, logged: Rig) -> Live:
    """The live run of a rig with several motors."""
    refuse_sources(rig)
    joints = {name: joint for joint in rig.each_joint for name in joint.names}
    found = []
    for one, kept in zip(rig.motors, logged.motors, strict=True):
        with error_context(f"motor {quoted(one.name)}"):
            found.append(_one_of(one.name, one.rig, joints[one.name], kept.rig))
    notes = tuple(f"{motor.said}: {note}" for motor in found for note in motor.notes)
    said = tuple(_said_of(joint) for joint in rig.each_joint if joint.shared)
    return replace(found[0], several=tuple(found), whole=rig, logged=logged, notes=(*rig.remarks, *said, *notes))


def _one_of(name: str, own: Rig, joint: RigJoint, kept: Rig) -> Live:
    """The live run of one motor of several."""
    if not joint.shared:
        return replace(live_run(own, logged=kept), name=name, joint=joint)
    contraction = joint.settings.co_contraction
    made = live_run(with_co_contraction(own, contraction), logged=kept, joint_elsewhere=own is not joint.first)
    i, j = (joint.names.index(one) for one in (name, _neighbour(joint, name)))
    parting = parting_of(cabled_joint_of(joint), *joint_ranges(joint), i, j)
    allowed = made.limits._replace(
        shared=True,
        parting=parting.most + parting.bent,
        parting_offset=parting.offset,
        parting_slope=parting.slope,
        parting_lag=parting.lag,
        taut=own.limits.slack_sign * contraction,
    )
    if joint.against(own):
        # where its cable is taut is where the joint is: nothing can be said of zero; and after a release it hangs, with
        # the joint anywhere below its motor
        allowed = allowed._replace(homed=False, slope_low=0.0)
    return replace(made, name=name, joint=joint, limits=allowed)


def _neighbour(joint: RigJoint, name: str) -> str:
    """The motor after this one on its joint, by turns: so each is watched by one that watches another."""
    return joint.names[(joint.names.index(name) + 1) % len(joint.names)]


def with_co_contraction(rig: Rig, co_contraction: float) -> Rig:
    """The rig of a motor that pulls so much further than the joint asks for [rad].

    Everything above the drive knows the joint's coordinate alone: the motor's home is moved.
    """
    home = rig.drive.motor_home + rig.limits.slack_sign * co_contraction
    return rig.replace(drive=rig.drive._replace(motor_home=home))


def _said_of(joint: RigJoint) -> str:
    """A joint in a sentence, for whoever starts a run."""
    names = " and ".join(map(quoted, joint.names))
    contraction = joint.settings.co_contraction / RADIANS
    return f"motors {names} are on one joint, {quoted(joint.name)}, with a co-contraction of {contraction:g}°"
