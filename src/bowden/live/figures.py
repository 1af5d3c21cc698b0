"""Figures of runs and their logs, as they are printed as JSON too."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from bowden.core.documented import Documented
from bowden.hardware.realtime import Grant


@dataclass(frozen=True)
class Lateness(Documented):
    """How late a loop's cycles began, between a deadline and the moment of waking, or how long they took: percentiles
    [µs]."""

    p50_us: float
    p99_us: float
    p999_us: float
    max_us: float
    cycles: int


@dataclass(frozen=True)
class Damage(Documented):
    """Parts of a log that could not be read."""

    chunks: int
    """Chunks whose checksum is wrong; their rows are left out."""
    skipped: int
    """Bytes between records that are none."""
    torn: int
    """Bytes at the end that are no whole row or record: the chunk that a kill cut off."""


@dataclass(frozen=True)
class Replay(Documented):
    """Comparison of a replay with its record."""

    cycles: int
    """Cycles that were compared: all but the first after each beginning, whose state is taken from the record."""
    beginnings: int
    """Number of times that the state was taken from the record: at its begin and after each gap."""
    law_cycles: int
    """Cycles of those in which the law had the motor."""
    requested_target_largest: float | None
    """Largest difference of the requested target from the recorded one; null where the law never led [rad]."""
    requested_target_rms: float | None
    """Its root mean square [rad]."""
    first_difference: float | None
    """The record's time at the first requested target that differs [s]."""
    verdicts_differing: int
    """Cycles with another power, mode, reaction or set of faults, or with a target or torque offset in one of both
    alone."""
    command_largest: float
    """Largest difference of the supervisor's target [rad]."""
    first_other_verdict: float | None
    """The record's time at the first verdict that differs [s]."""
    torque_largest: float | None
    """Largest difference of the drive's torque offset at the recorded targets [N·m]; null in a run without one."""

    @property
    def deviates(self) -> bool:
        """True if a requested target, a verdict, a target or a torque offset is another one than was recorded."""
        requested = self.first_difference is not None
        return requested or bool(self.verdicts_differing or self.command_largest or self.torque_largest)


@dataclass(frozen=True)
class Recovery(Documented):
    """Rows of a log that were saved, and those that are known to be lost."""

    rows: int
    """Cycles in the new log."""
    missing: int
    """Cycles before the last of them that are lost."""
    missing_seconds: float
    """Those cycles' share of the run [s]."""
    tail_seconds: float
    """Time that may be missing from the end of the run, on a healthy disk; 0 where the log was closed properly [s]."""
    damage: Damage
    """What could not be read."""


@dataclass(frozen=True)
class Machine(Documented):
    """Properties of a machine that matter to the live loop."""

    release: str
    """The kernel's."""
    preemption: str
    """``PREEMPT_RT``, ``PREEMPT_DYNAMIC``, … or ``none``, as the kernel's version says."""
    real_time: bool
    """True if the kernel is a PREEMPT_RT one."""
    clock_source: str
    """The clock of the kernel; ``tsc`` is the quick one on a PC."""
    processors: tuple[int, ...]
    """Processors on which this process may run."""
    isolated: tuple[int, ...]
    """Processors that the kernel keeps free of other work."""
    can: dict[str, str]
    """CAN interface -> its state."""
    can_known: bool
    """True if the kernel has CAN sockets at all."""


@dataclass(frozen=True)
class RunStop(Documented):
    """One end of power by a fault."""

    time_s: float
    """Since the first cycle [s]."""
    causes: tuple[str, ...]
    """The faults that came first."""
    remedies: tuple[str, ...]
    """Remedy of each."""
    consequences: tuple[str, ...]
    """The faults that came after them or follow from them, in their order."""
    too_busy: str | None
    """Message that this computer was too busy, or its twin silent, with figure and limit; null where neither was."""
    motor: str | None = None
    """Motor that the stop came from, in a run with several, whose causes these are; null where it came to
    all at once."""


@dataclass(frozen=True)
class TimedText(Documented):
    """Something that happened in a run."""

    time_s: float | None
    """Time of the cycle in which it shows [s]."""
    text: str


@dataclass(frozen=True)
class GainChange(Documented):
    """A gain that was changed while the law ran."""

    name: str
    """Name of the gain."""
    time_s: float | None
    """Time at which the loop took the change [s]."""
    before: float
    """Value in force before, in the law's own unit."""
    to: float
    """Value that was asked for."""
    in_force_s: float | None
    """Time at which the law first ran with the new value, 0.5 s later [s]; null where the log ends before."""


@dataclass(frozen=True)
class Tracked(Documented):
    """Tracking errors of the joint under a law; of several motors the largest of each."""

    law: str | None
    """Name of the law; of several motors with different ones all of them; null where the log does not say."""
    rig: str | None
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log. null in a log without
    one."""
    rmse_deg: float | None
    """Joint against reference under the law, root mean square; null where none led [deg]."""
    peak_deg: float | None
    """Largest error under the law, likewise [deg]."""
    estimate_std_deg: float | None
    """Standard deviation of the joint's angle under the law, root mean square, where it is estimated; null of a joint
    with an encoder [deg]."""
    seconds_led: float
    """Time under the law [s]."""


@dataclass(frozen=True)
class RecordedRun(Tracked):
    """Figures of a run, from its log."""

    twin: bool | None
    """True if the drive was the command's own twin, and not one on the rig's bus."""
    stops: tuple[RunStop, ...]
    """All stops of the run in the order of time, acknowledged ones too."""
    emergencies: tuple[TimedText, ...]
    """The drive's emergencies in words, with their codes, in their order."""
    lateness: Lateness | None
    """Of the cycles; null where it was not recorded."""
    run_time: Lateness | None
    """Time that a cycle takes; null likewise."""


@dataclass(frozen=True)
class LogFacts(RecordedRun):
    """Content of a log."""

    outcome: str
    """How the run ended: as asked, or what ended it first."""
    closed: bool
    """True if the recorder closed it properly."""
    whole: bool
    """True if it was closed and nothing in it changed since."""
    cycles: int
    """Cycles in the log."""
    missing: int
    """Cycles before the last of them that are not in it."""
    damage: Damage
    """What could not be read."""
    duration_s: float
    """From the first cycle to the last [s]."""
    begin_s: float | None
    """Column time of the first cycle: zero is when the command began [s]; null in a log without a cycle."""
    running_s: float | None
    """Column time of the first cycle in the mode *running*; null in a log of a run that never was [s]."""
    sample_time_s: float | None
    """Median time between two cycles; null with fewer than two [s]."""
    start_utc: str
    """When the column time was zero, ISO 8601."""
    seed: int | None
    """Seed of the run's random numbers."""
    overruns: int | None
    """Deadlines that were skipped; null where they were not recorded."""
    gains: tuple[GainChange, ...]
    """Gains that were changed while the law ran, in the order of time."""
    motions: tuple[TimedText, ...]
    """Motions that the wearer's EMG began or turned round while the law led: ``flex`` or ``extend``; none where the
    joint follows the envelope, or in a run without EMG."""
    events: tuple[TimedText, ...]
    """Changes of modes and faults, in their order."""
    software: dict[str, str]
    """Versions, git revisions and host of the run."""
    recorder: dict[str, str]
    """Last report of the recorder, as text; empty where the log was not closed."""
    columns: dict[str, str]
    """Name of each column and its unit."""
    settings: dict[str, Any]
    """All that made the run; a number that is not finite is null."""
    motors: dict[str, Tracked]
    """Each motor by its name, in a run with several."""


@dataclass(frozen=True)
class DelaySpread(Documented):
    """Quantiles of a delay [ms]."""

    p50: float
    p99: float
    max: float


@dataclass(frozen=True)
class EmgRunFigures(Documented):
    """Figures of a run by EMG."""

    source: str
    stream: str
    """Description of the stream, by itself."""
    wearer: str | None
    """The wearer's file whose levels the run went by, as rig.toml names it; null without."""
    motions: int | None
    """Motions that contractions began or turned round; null in the proportional mode."""
    onset_to_cycle_ms: DelaySpread | None
    """Until the cycle in which the reference began to move."""
    onset_to_command_ms: DelaySpread | None
    """Until the command had moved by 0.1°."""
    onset_to_joint_ms: DelaySpread | None
    """Until the joint had moved by 1°."""
    peak_after_first_second_deg: float | None
    """Largest error after the first second of each motion."""
    age_ms: DelaySpread | None
    """Age of the newest sample in the loop's cycles."""
    samples: int
    """Samples that came, missing ones included."""
    lost: int
    """Samples that are missing."""
    why_lost: str | None
    """Why nothing came any more at the end; null where the stream was alive."""


@dataclass(frozen=True)
class FeltInRun(Documented):
    """Interaction torque at the wearer."""

    rms_nm: float
    """RMS of the suit's torque on the elbow less the weight that it is to carry [N m]."""
    peak_nm: float
    """Its largest size [N m]."""
    doubt_nm: float
    """Median of the standard deviation that the estimate reckons with [N m]."""


@dataclass(frozen=True)
class RunMotor(Tracked):
    """One motor of several."""

    name: str
    drive: str
    mode: str | None
    faults: tuple[str, ...]
    preflight: str | None
    """Why its preflight failed; null where it did not."""
    torque: Literal["off", "unknown", "on"]


@dataclass(frozen=True)
class EndedRun(RecordedRun):
    """A live run that has ended: what its log shows, and what its session knows besides."""

    drive: str
    """Identity of the drive, as it reports it."""
    ended_well: bool
    """True if the run ended as asked, not by a fault."""
    mode: str | None
    """The supervisor's last mode; null where the loop failed."""
    faults: tuple[str, ...]
    remedies: tuple[str, ...]
    stalled_ms: float | None
    """Time for which this computer stalled the loop, where that ended the run [ms]; else null."""
    unattended: str | None
    """That the run was ended before its time because the command that started it gave no sign of life, with the figure
    and what to set; null where it was not."""
    preflight: str | None
    """Why the preflight failed; null where it did not."""
    torque: Literal["off", "unknown", "on"]
    """What the drive has said of its torque at the end: off; on, although it was switched off; unknown, if it has not
    confirmed it: press the emergency stop."""
    error: str | None
    """Why the loop ended without a word of its own; null where it did not."""
    cycles: int | None
    cycles_logged: int
    """Cycles in the log."""
    overruns: int | None
    """Deadlines that were skipped."""
    emg: EmgRunFigures | None
    """Figures of a run by EMG; null in any other. Delays count from the sample in which a contraction was found."""
    interaction: FeltInRun | None
    """What the wearer felt of a suit that follows their push ([admittance]), as the loop estimated it, after the first
    4 s or half of a shorter run; null in any other run."""
    grants: tuple[Grant, ...]
    log: Path
    """The MCAP file."""
    more_logs: tuple[Path, ...]
    """Where the recorder had to be started again: what it wrote then, which begins with the last half minute before."""
    log_whole: bool
    """True if the log was closed properly and every row that was written can be read."""
    log_lost: str | None
    """What became of a log that is not there at the end: removed, replaced or moved; null where it is."""
    motors: tuple[RunMotor, ...]
    """The same for each motor of a rig with several; else empty."""
