"""Figures of runs and their logs, as they are printed as JSON too."""

from dataclasses import dataclass

from bowden.core.documented import Documented


@dataclass(frozen=True)
class Lateness(Documented):
    """How late a loop's cycles began: percentiles of the time between a deadline and the moment of waking [µs]."""

    p50_us: float
    p99_us: float
    p999_us: float
    max_us: float
    cycles: int


@dataclass(frozen=True)
class Damage(Documented):
    """What of a log could not be read."""

    chunks: int
    """Chunks whose checksum is wrong; their rows are left out."""
    skipped: int
    """Bytes between records that are none."""
    torn: int
    """Bytes at the end that are no whole row or record: the chunk that a kill cut off."""


@dataclass(frozen=True)
class Replay(Documented):
    """How a replay compares with its record."""

    cycles: int
    """Cycles that were compared: all but the first after each beginning, whose state is taken from the record."""
    beginnings: int
    """How often the state was taken from the record: at its begin and after each gap."""
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
        """Whether a requested target, a verdict, a target or a torque offset is another one than was recorded."""
        requested = self.first_difference is not None
        return requested or bool(self.verdicts_differing or self.command_largest or self.torque_largest)


@dataclass(frozen=True)
class Recovery(Documented):
    """What was saved of a log, and what is known to be lost."""

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
    """What a machine can do for the live loop."""

    release: str
    """The kernel's."""
    preemption: str
    """``PREEMPT_RT``, ``PREEMPT_DYNAMIC``, … or ``none``, as the kernel's version says."""
    real_time: bool
    """Whether the kernel is a PREEMPT_RT one."""
    clock_source: str
    """The clock of the kernel; ``tsc`` is the quick one on a PC."""
    processors: tuple[int, ...]
    """That this process may run on."""
    isolated: tuple[int, ...]
    """Processors that the kernel keeps free of other work."""
    can: dict[str, str]
    """CAN interface -> its state."""
    can_known: bool
    """Whether the kernel has CAN sockets at all."""
