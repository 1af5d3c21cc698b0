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
from bowden.core.errors import ParameterError, asked_for_by
from bowden.core.toml_text import quoted
from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import Cycle
from bowden.cycle.torque_offset import TorqueOffset
from bowden.design.objections import reference_beyond, refuse_sources, require_joint, turned
from bowden.hardware.emg.course import EmgCourse
from bowden.hardware.emg.intent_block import IntentReader
from bowden.hardware.ports import BrakedDrive, Drive
from bowden.live import axis_columns, excitation, row
from bowden.live.admittance_live import live_pushing
from bowden.live.brake_hold import BrakeHold
from bowden.live.preflight import Preflight
from bowden.live.run_settings import plain, run_settings
from bowden.live.script import Home, Script
from bowden.live.suit_preflight import on_suit
from bowden.plants.pushing import Pushing
from bowden.rig.drive import most_push
from bowden.rig.emg_setup import EmgRun
from bowden.rig.families import DriveNeeds
from bowden.rig.pair import PairSettings
from bowden.rig.rig import Rig
from bowden.rig.settings import LiveSettings
from bowden.safety.limits import Limits
from bowden.safety.release import longest_release, release_speed
from bowden.sensing.intent import FOLLOWED_ACCELERATION, FOLLOWED_SPEED, TURNED_ACCELERATION, TURNED_SPEED
from bowden.sim.pair_of_rig import parting_in_run

WRONG_WAY = 1.5 * RADIANS
"""Motion of the joint that the preflight believes: after a reversal the paper's own cable first goes the wrong way by
more than half a degree (docs/background/theory.md, erratum on monotone travel) [rad]."""

READER_SHARE = 0.2
"""Of `emg_age`, after which a process that has not looked for samples is gone: it looks every 2 ms, and needs not wait
for a network or a base station as samples do."""

_NONE = 1e-9
"""A limit of zero, where something is divided by it."""


@dataclass(frozen=True)
class Live:
    """A run, all but its drive; `live_run` makes it."""

    rig: Rig
    measure: bool
    """Whether the motor moves through the excitation, in place of a law."""
    law: Law
    limits: Limits
    table: NDArray[np.float64]
    """See `live.script.Script`."""
    servo_from: int
    """Row of an excitation from which on it is meant for the servo; 0 for a law."""
    start: float
    """Motor angle at which the run begins [rad]."""
    pushing: Pushing | None
    """The wearer's push, as the live loop has it."""
    notes: tuple[str, ...]
    """What the user should know."""
    logged: Rig
    """The rig as the log keeps it: on the bus that it names, where a twin's own is gone after the run."""
    name: str = ""
    """Of the axis, where there are several."""
    several: "tuple[Live, ...]" = ()
    """Each axis, where there are several; what stands here is then that of the first."""
    whole: Rig | None = None
    """The rig with all its axes, where there are several."""
    opposed: bool = False
    """Whether it is the antagonist of a pair: it pulls the joint down, and has its angle from the agonist's drive."""

    @property
    def axes(self) -> "tuple[Live, ...]":
        """Each axis; itself where there is one."""
        return self.several or (self,)

    @property
    def names(self) -> tuple[str, ...]:
        """Of the axes; empty where there is one."""
        return tuple(axis.name for axis in self.several)

    @property
    def independent(self) -> bool:
        """Whether an axis that is stopped by a fault leaves the others running."""
        return self.whole is not None and self.whole.independent

    @property
    def patience(self) -> float:
        """Age of the operator's sign of life at which the run is ended; of several axes the smallest [s]."""
        return min(axis.limits.operator_age for axis in self.axes)

    @property
    def joints(self) -> tuple[int, ...]:
        """For each axis the place of the one whose drive has its joint's encoder."""
        agonist = "" if self.whole is None else self.whole.pair.agonist
        return tuple(self.names.index(agonist) if axis.opposed else i for i, axis in enumerate(self.axes))

    @property
    def paired(self) -> tuple[int, ...]:
        """Places of the axes whose motors pull at one joint, the agonist's first; empty where there are none."""
        if self.whole is None or not self.whole.pair.there:
            return ()
        return tuple(self.names.index(name) for name in self.whole.pair.names)

    @property
    def length(self) -> float:
        """Of the run, without what comes before the law or the motion leads [s]."""
        return max(len(axis.table) for axis in self.axes) * self.rig.sample_time

    def following(self, off_reference: Sequence[float]) -> "Live":
        """The same run whose joints may be this far off their references, one number an axis [rad]."""
        axes = [
            replace(axis, limits=axis.limits._replace(off_reference=most))
            for axis, most in zip(self.axes, off_reference, strict=True)
        ]
        return replace(self, limits=axes[0].limits, several=tuple(axes) if self.several else ())

    def columns(self) -> dict[str, str]:
        """Column → unit of the run's rows."""
        if not self.several:
            return self._columns(together=False)
        paired = [self.names[place] for place in self.paired]
        return axis_columns.of_all(
            {axis.name: axis._columns(together=True, paired=axis.name in paired) for axis in self.several}
        )

    def _columns(self, *, together: bool, paired: bool = False) -> dict[str, str]:
        emg, pushed = self.emg is not None, self.push() is not None
        kinds = {"emg": emg, "pushed": pushed, "braked": self.braked, "together": together, "paired": paired}
        return row.columns(self.law, **kinds, source=self.source())

    @property
    def needs(self) -> DriveNeeds:
        """What is asked of the drive."""
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
        """Whether a holding brake works in it; while the motor is measured it stays released."""
        return self.rig.brake.there and not self.measure

    def brake(self, drive: Drive) -> BrakeHold | None:
        """The holding brake of the rig's drive, where it works."""
        if not self.braked:
            return None
        return BrakeHold(cast(BrakedDrive, drive), self.rig.brake, self.limits, self.rig.sample_time)

    def _push_settings(self) -> Mapping[str, Any]:
        spool = plain(self.needs.spool)
        return {"torque": self.needs.torque_offset, "substeps": self.rig.substeps, "spool": spool}

    def losses(self) -> str:
        """How soon the power is off when somebody of the run is gone, for whoever starts it."""
        limits = max((axis.limits for axis in self.axes), key=longest_release)
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
        checks = Preflight(
            pull_sign=-limits.slack_sign,
            moved=WRONG_WAY,
            light=limits.released_current if limits.homed else math.inf,
            low=limits.motor_low,
            high=limits.motor_high,
            tension=limits.measures_tension,
            torque=limits.measures_torque,
        ).on_cable(basis, self.rig.motor_encoder)
        if self.opposed:  # both motors of a pair move the joint the agonist's way, or neither would
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
        return Home(0.0 if limits.paired else self.rig.home, limits.lowering)

    def log_settings(self) -> dict[str, Any]:
        """What the log keeps of the run: law, limits, and all of the rig, so that a log is enough.

        Of several axes ``axes`` has those of each with its name, but for the rig, which is the whole one; what stands
        beside is that of the first.
        """
        law = run_settings(self.law, self.limits, self.rig.filters, self.rig.sample_time)
        own = {**law, **self.settings()}
        if not self.several:
            return own
        axes = [{**axis.log_settings(), "name": axis.name} for axis in self.several]
        for axis in axes:
            del axis["rig"], axis["names"]
        return {**own, "axes": axes, "independent": self.independent}

    def settings(self) -> Mapping[str, Any]:
        """What is kept of the rig, beside the law and the limits."""
        law = self.rig.law
        return {
            "reference": self.rig.trajectory.describe(),
            "seed": self.rig.seed,
            "rig": self.logged.document(),
            **({"law_file": _where(law)} if isinstance(law, LawFile) and not self.measure else {}),
            **({"emg": self.emg.settings()} if self.emg else {}),
            **({"push": self._push_settings()} if self.needs.torque_offset > 0.0 else {}),
            **({} if self.pushing is None else {"admittance": plain(self.source().settings)}),
        }


def _where(law: LawFile) -> str:
    """A user's law as ``FILE.py:NAME`` with the file's whole path."""
    return law.path + law.name.rpartition(".py")[2]


def live_run(rig: Rig, *, measure: bool = False, logged: Rig | None = None, joint_elsewhere: bool = False) -> Live:
    """The live run of a rig.

    Args:
        rig: with the law and all else that is to run.
        measure: move the motor through the excitation, in place of a law; not with several axes.
        logged: the same rig on the bus that it names, where it runs on a twin's own; for the log.
        joint_elsewhere: whether another axis' drive measures its joint.

    Raises:
        ParameterError: a rig that cannot run live.
    """
    if rig.axes:
        _ = rig.axis() if measure else rig.pack()
        return _together(rig, logged or rig)
    if rig.turned:
        raise turned(rig)
    _ = rig.drive_parameters  # which refuses what makes no sense together
    if not joint_elsewhere:
        require_joint(rig)
    _ = rig.pack()  # which refuses more than a log's head and the loop's process can take
    limits, notes, logged = rig.supervisor_limits, rig.notes, logged or rig
    emg = None if measure else rig.emg_run
    pushing = None if measure else rig.pushing
    if pushing is not None:
        strongest = most_push(rig.drive, rig.drive_needs)
        pushing, more = live_pushing(pushing, limits, strongest, by_emg=emg is not None)
        notes = (*notes, *more)
    if emg is not None:
        _check_range(emg, limits)
        _check_duration(emg, limits)
        limits = limits._replace(uses_emg=True)
    if measure:
        moved = excitation.excitation(limits, rig.sample_time)
        table, start = moved.motor[:, None], float(moved.motor[0])
        return Live(rig, measure, LAWS["uncompensated"], limits, table, moved.servo_from, start, pushing, notes, logged)
    time = np.arange(round(rig.duration / rig.sample_time), dtype=np.float64) * rig.sample_time
    table = rig.trajectory.sample(time)
    for beyond in reference_beyond(rig, limits):
        raise ParameterError(beyond)
    return Live(rig, measure, rig.fitted(), limits, table, 0, rig.start_motor, pushing, notes, logged)


def _together(rig: Rig, logged: Rig) -> Live:
    """The live run of a rig with axes."""
    refuse_sources(rig)
    found = []
    for (name, own), (_, kept) in zip(rig.axes, logged.axes, strict=True):
        with asked_for_by(f"axis {quoted(name)}"):
            found.append(_one_of(rig, name, own, kept))
    notes = tuple(f"axis {quoted(axis.name)}: {note}" for axis in found for note in axis.notes)
    paired = (_said_of_pair(rig.pair),) if rig.pair.there else ()
    return replace(found[0], several=tuple(found), whole=rig, logged=logged, notes=(*rig.remarks, *paired, *notes))


def _one_of(rig: Rig, name: str, own: Rig, kept: Rig) -> Live:
    """The live run of one axis of a rig."""
    pair = rig.pair
    if not pair.there or name not in pair.names:
        return replace(live_run(own, logged=kept), name=name)
    opposed = name == pair.antagonist
    made = live_run(pulling(own, pair.co_contraction), logged=kept, joint_elsewhere=opposed)
    parting = parting_in_run(rig)
    allowed = made.limits._replace(
        paired=True,
        parting=parting.most + parting.bent,
        parting_offset=-parting.offset if opposed else parting.offset,
        parting_slope=-parting.slope if opposed else parting.slope,
        parting_lag=parting.lag,
        taut=own.limits.slack_sign * pair.co_contraction,
    )
    if opposed:
        # where its cable is taut is where the joint is: nothing can be said of zero; and after a release it hangs, with
        # the joint anywhere below its motor
        allowed = allowed._replace(homed=False, slope_low=0.0)
    return replace(made, name=name, opposed=opposed, limits=allowed)


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
    turned = not emg.course.proportional
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


def pulling(rig: Rig, co_contraction: float) -> Rig:
    """The rig of one axis whose motor pulls so much further than the joint asks for [rad].

    Everything above the drive knows the joint's coordinate alone: the motor's home is moved.
    """
    home = rig.drive.motor_home + rig.limits.slack_sign * co_contraction
    return rig.replace(drive=rig.drive._replace(motor_home=home))


def _said_of_pair(pair: PairSettings) -> str:
    """The pair in a sentence, for whoever starts a run."""
    return (
        f"axes {quoted(pair.agonist)} and {quoted(pair.antagonist)} are on one joint, with a co-contraction of "
        f"{pair.co_contraction / RADIANS:g}°"
    )
