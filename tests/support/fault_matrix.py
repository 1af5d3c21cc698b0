"""The fault matrix: what the supervisor must make of each injected fault, and of each two."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from bowden.control.law import Law
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.units import RADIANS
from bowden.plants.plant import Plant
from bowden.safety.faults import Fault, of
from bowden.safety.limits import Limits
from bowden.safety.release import longest_release
from bowden.sim.injected import Injected
from support.supervised import Outcome, supervised

MEASURED = Limits(measures_tension=True, measures_temperature=True, uses_emg=True)
"""Limits of a rig that measures all there is to measure, in a run by EMG."""
FIRST, LAST, AFTER = 0.6, 3.2, 2.8
"""Faults begin between these times [s], and a run lasts so much longer."""
REFERENCE = PeriodicMinimumJerk(0.0, 70.0 * RADIANS, 2.0)
"""Quick enough for every fault to show."""


class Row(NamedTuple):
    """What a fault must lead to."""

    reactions: tuple[int, ...]
    """Any of these; of several the milder is the detector that came before."""
    faults: tuple[Fault, ...]
    """Any of these is among what stops, or, where nothing stops, among what is seen."""
    within: int
    """From its showing to R2 or R3, at most [cycles of 1 ms]."""


def _row(reactions: str, faults: str, within: int) -> Row:
    return Row(tuple(int(one) for one in reactions), tuple(Fault[name] for name in faults.split()), within)


_TARGET = "TARGET_LOST TARGET_STEP TARGET_TOO_FAR TARGET_TOO_HARD"
"""What a law may ask for on a wrong angle before the angle itself is found to be wrong."""
_JOINT = f"JOINT_FROZEN JOINT_MOTOR_MISMATCH JOINT_JUMP {_TARGET}"
_MOTOR = f"NOT_FOLLOWING MOTOR_JUMP JOINT_MOTOR_MISMATCH JOINT_FROZEN {_TARGET}"
ROWS = {
    Injected.JOINT_NAN: _row("2", "JOINT_LOST", 8),
    Injected.JOINT_RANGE: _row("2", "JOINT_LOST", 8),
    Injected.JOINT_FROZEN: _row("2", _JOINT, 20),
    Injected.JOINT_SPIKE: _row("1", "JOINT_JUMP", 0),
    Injected.JOINT_SPIKES: _row("2", "JOINT_JUMP", 20),
    Injected.JOINT_DROPOUT: _row("2", "JOINT_STALE", 20),
    Injected.JOINT_DELAY: _row("2", _JOINT, 20),
    Injected.JOINT_SIGN: _row("23", f"{_JOINT} JOINT_OVER_SPEED", 20),  # a small jump looks like speed
    Injected.MOTOR_NAN: _row("3", "MOTOR_LOST", 8),
    Injected.MOTOR_RANGE: _row("3", "MOTOR_LOST", 8),
    Injected.MOTOR_FROZEN: _row("23", _MOTOR, 20),
    Injected.MOTOR_SPIKE: _row("1", "MOTOR_JUMP", 0),
    Injected.MOTOR_SPIKES: _row("3", "MOTOR_JUMP MOTOR_OVER_SPEED", 20),
    Injected.MOTOR_DROPOUT: _row("3", "MOTOR_STALE", 20),
    Injected.MOTOR_DELAY: _row("23", _MOTOR, 20),
    Injected.MOTOR_SIGN: _row("23", _MOTOR, 20),
    Injected.SLACK: _row("2", f"SLACK JOINT_MOTOR_MISMATCH {_TARGET}", 60),
    Injected.BROKEN_CABLE: _row("23", f"{_JOINT} JOINT_OVER_SPEED SLACK", 60),
    Injected.JOINT_OVER_TRAVEL: _row("23", f"JOINT_OVER_TRAVEL JOINT_OVER_SPEED JOINT_MOTOR_MISMATCH {_TARGET}", 10),
    Injected.MOTOR_OVER_TRAVEL: _row("3", "MOTOR_OVER_TRAVEL NOT_FOLLOWING", 20),
    Injected.OVER_SPEED: _row("3", "MOTOR_OVER_SPEED JOINT_OVER_SPEED NOT_FOLLOWING MOTOR_OVER_TRAVEL", 20),
    Injected.OVER_TENSION: _row("3", "OVER_TENSION", 4),
    Injected.JAM: _row("23", "SATURATED NOT_FOLLOWING", 60),
    Injected.PEAK_CURRENT: _row("3", "OVER_CURRENT", 10),
    Injected.LONG_CURRENT: _row("2", "I2T CURRENT_STUCK", 2600),
    Injected.DRIVE_HOT: _row("2", "DRIVE_HOT", 8),
    Injected.CURRENT_NAN: _row("2", "CURRENT_LOST", 8),
    Injected.TENSION_NAN: _row("2", "TENSION_LOST", 8),
    Injected.DRIVE_SILENT: _row("3", "MOTOR_STALE", 20),
    Injected.HEARTBEAT_SILENT: _row("3", "HEARTBEAT_LOST", 4),
    Injected.HOST_SILENT: _row("3", "DRIVE_FAULT NOT_FOLLOWING", 20),
    Injected.BUS_OFF: _row("3", "BUS_ERRORS", 8),
    Injected.LATE_PDOS: _row("3", "MOTOR_STALE", 20),
    Injected.EMERGENCY: _row("3", "EMERGENCY", 4),
    Injected.DRIVE_FAULT: _row("3", "DRIVE_FAULT", 4),
    Injected.DRIVE_REBOOT: _row("3", "DRIVE_DROPPED", 4),
    Injected.DRIVE_DROPPED: _row("3", "DRIVE_DROPPED", 4),
    Injected.OVERRUN: _row("2", "LATE", 4),
    Injected.OVERRUNS: _row("2", "LATE", 40),
    Injected.CLOCK_BACK: _row("2", "CLOCK", 4),
    Injected.CLOCK_FORWARD: _row("23", "CLOCK", 4),
    Injected.LAW_NAN: _row("2", "TARGET_LOST", 8),
    Injected.LAW_STEP: _row("2", "TARGET_STEP TARGET_LOST", 8),
    Injected.LAW_BEYOND: _row("2", "TARGET_LOST", 8),
    Injected.LAW_RAMP: _row("23", "TARGET_LOST TARGET_TOO_FAR TARGET_TOO_HARD JOINT_OVER_SPEED MOTOR_OVER_SPEED", 60),
    Injected.LAW_SHAKES: _row("2", "TARGET_STEP TARGET_LOST", 60),
    Injected.OPERATOR_LOST: _row("2", "OPERATOR_LOST", 1004),
    Injected.RECORDER_LOST: _row("0", "RECORDER_LOST", 0),
    Injected.STOP: _row("2", "", 4),
    Injected.EMG_SILENT: _row("2", "EMG_LOST", 204),
    Injected.EMG_TIMELESS: _row("2", "EMG_LOST", 4),
}
"""Injected fault → what must come of it."""

AT_ONCE = (
    *(Injected.MOTOR_NAN, Injected.MOTOR_RANGE, Injected.PEAK_CURRENT, Injected.BUS_OFF, Injected.EMERGENCY),
    *(Injected.DRIVE_FAULT, Injected.DRIVE_REBOOT, Injected.DRIVE_DROPPED),
)
"""Causes of R3 that show as soon as they begin, whatever else is wrong."""
_OLD = {
    *(Injected.MOTOR_FROZEN, Injected.MOTOR_DROPOUT, Injected.MOTOR_DELAY),
    *(Injected.LATE_PDOS, Injected.DRIVE_SILENT, Injected.BUS_OFF),
}
HIDING = {
    Injected.MOTOR_NAN: _OLD,
    Injected.MOTOR_RANGE: _OLD,
    Injected.PEAK_CURRENT: {Injected.LONG_CURRENT, Injected.CURRENT_NAN},
}
"""What writes another figure over the one by which a fault would be seen: it cannot show then."""
ASLEEP = {Injected.OVERRUN: 22, Injected.OVERRUNS: 3}
"""Cycles in which a loop that is late does nothing, whatever happens."""
RELEASE = 4 + round(1000.0 * longest_release(MEASURED))
"""From R2 to power off, at most [cycles]."""


def begins(kinds: tuple[Injected, ...], seed: int, onset: int) -> list[float]:
    """When the faults of a run begin [s]: the second up to 30 ms after the first; drawn from the run's numbers."""
    random = np.random.default_rng([seed, onset, *kinds])
    first = random.uniform(FIRST, LAST)
    return [first, *(first + random.uniform(0.0, 0.03, len(kinds) - 1)).tolist()]


def run_row(plant: Plant, law: Law, kinds: tuple[Injected, ...], seed: int, onset: int) -> Outcome:
    """One run with faults that begin where the run's numbers put them."""
    injected = tuple(zip(kinds, begins(kinds, seed, onset), strict=True))
    return supervised(plant, law, REFERENCE, MEASURED, duration=LAST + AFTER, seed=seed, injected=injected)[0]


def complaints(kind: Injected, outcome: Outcome) -> Iterator[str]:
    """What is wrong with a run in which one fault was injected."""
    row, shown = ROWS[kind], outcome.shown
    if outcome.bad:
        yield f"{outcome.bad:.0f} targets beyond what they may be"
    if outcome.released < 0.0 and shown < 0.0 and max(row.reactions) > 1:
        return  # nothing happened that anyone could see
    if outcome.reaction not in row.reactions:
        yield f"reaction {outcome.reaction:.0f}, not {row.reactions}"
    seen = set(of(outcome.stopping if max(row.reactions) > 1 else outcome.faults))
    if row.faults and not seen & set(row.faults):
        yield f"{[fault.name for fault in seen]}, not {[fault.name for fault in row.faults]}"
    if max(row.reactions) > 1:
        if not 0.0 <= outcome.released <= (shown + row.within if shown >= 0.0 else np.inf):
            yield f"stopped at {outcome.released:.0f}, shown at {shown:.0f}, within {row.within}"
        yield from unfinished(outcome)


def unfinished(outcome: Outcome) -> Iterator[str]:
    """What is wrong with how a run ended that had to end."""
    if outcome.bad:
        yield f"{outcome.bad:.0f} targets beyond what they may be"
    if not outcome.released <= outcome.off <= outcome.released + RELEASE or outcome.released < 0.0:
        yield f"stopped at {outcome.released:.0f}, power off at {outcome.off:.0f}"
    if outcome.mode not in (0.0, 5.0):
        yield f"ended in mode {outcome.mode:.0f}"


def pair_complaints(kinds: tuple[Injected, ...], seed: int, onset: int, outcome: Outcome) -> Iterator[str]:
    """What is wrong with a run of two faults: targets, an end without power, and R3 in its time where one asks for it.

    A fault that stops the run keeps the other from showing, so that only causes of R3 which show at once are timed.
    """
    if outcome.bad:
        yield f"{outcome.bad:.0f} targets beyond what they may be"
    if max(min(ROWS[kind].reactions) for kind in kinds) > 1:
        yield from unfinished(outcome)
    for kind, begin in zip(kinds, begins(kinds, seed, onset), strict=True):
        latest = round(begin * 1000.0) + ROWS[kind].within + sum(ASLEEP.get(other, 0) for other in kinds)
        hidden = HIDING.get(kind, set()) & set(kinds)
        if kind in AT_ONCE and not hidden and not 0.0 <= outcome.off <= latest:
            yield f"power off at {outcome.off:.0f}, with {kind.name} by {latest} at the latest"
