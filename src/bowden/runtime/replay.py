"""Replay: a recorded run once more through law and supervisor, cycle by cycle, against what was commanded then."""

from typing import Any, NamedTuple

import numpy as np

from bowden.control.law import Law
from bowden.core.errors import LogError
from bowden.core.signals import DriveReading, Reference, Sample
from bowden.runtime.cycle import LAW_BEGINS, Cycle, CycleState, Filters, Plan
from bowden.runtime.mcap_read import Recording
from bowden.safety.limits import Limits
from bowden.safety.supervisor import Observed, SupervisorState

_SURROUNDINGS = ("lateness", "elapsed", "request", "operator_age", "recorder", "preflight")
_VERDICT = ("command", "power", "mode", "reaction", "faults")
_NEEDED = (
    *("reference", "reference_velocity", "reference_acceleration", *DriveReading._fields, *_SURROUNDINGS, *_VERDICT),
    *("joint_seen", "motor_seen", "wish", "source", *(f"supervisor.{name}" for name in SupervisorState._fields)),
)


class Replay(NamedTuple):
    """How a replay compares with its record."""

    cycles: int
    """That were compared: all but the first after each beginning, whose state is taken from the record."""
    beginnings: int
    """1, and one more for each gap."""
    law_cycles: int
    """Those of them in which the law had the motor."""
    wish_largest: float | None
    """Largest difference of the wish from the one recorded, where both are numbers; None where they never are [rad]."""
    wish_rms: float | None
    """Its root mean square [rad]."""
    first_difference: float | None
    """The record's time at the first wish that is another number [s]."""
    verdicts_differing: int
    """Cycles with another power, mode, reaction or set of faults."""
    command_largest: float
    """Largest difference of the supervisor's target [rad]."""
    first_other_verdict: float | None
    """The record's time at the first of them [s]."""


def replay(found: Recording, law: Law, limits: Limits, filters: Filters, period: float, *, same: bool) -> Replay:
    """Run the cycle of the live loop on recorded readings.

    The same compiled function as in the loop, so that the law and limits of the record give its very numbers. The motor
    of the record does not follow another law: what is compared then is what that law would have asked for, and what
    the supervisor would have said to it, at the angles that there were.

    Args:
        found: the record.
        law: with its gains.
        limits: of the supervisor.
        filters: in front of the law.
        period: of the loop [s].
        same: whether it is the law of the record, whose state is taken from there; another begins where that one did.

    Raises:
        LogError: a column is missing, or the record has fewer than two rows.
    """
    _check(found, law, same)
    cycle = Cycle(law, limits, filters, period)
    at = {name: i for i, name in enumerate(found.columns)}
    reading, surroundings, verdict, reference, supervisor = (
        [at[name] for name in names]
        for names in (
            DriveReading._fields,
            _SURROUNDINGS,
            _VERDICT,
            ("reference", "reference_velocity", "reference_acceleration"),
            tuple(f"supervisor.{name}" for name in SupervisorState._fields),
        )
    )
    gaps = np.diff(found.numbers, prepend=found.numbers[0] - 2) > 1
    wishes = np.full(len(found.rows), np.nan)
    said = np.full((len(found.rows), len(_VERDICT)), np.nan)
    for k, array in enumerate(found.rows):
        row = array.tolist()
        if gaps[k]:
            sample = Sample(row[at["joint_seen"]], row[at["motor_seen"]])
            cycle.state = CycleState(
                sample, _law_state(law, sample, row, at, same), SupervisorState(*(row[i] for i in supervisor))
            )
            continue
        emg_age = row[at["emg.age"]] if "emg.age" in at else 0.0
        around = (*(row[i] for i in surroundings), emg_age)
        observed = Observed(DriveReading(*(row[i] for i in reading)), *around)
        plan = Plan(row[at["source"]], row[at["wish"]], Reference(*(row[i] for i in reference)))
        wishes[k], judged = cycle.step(observed, plan)
        said[k] = judged
    return _compared(found, gaps, wishes, said, found.rows[:, verdict])


def _law_state(law: Law, sample: Sample, row: list[float], at: dict[str, int], same: bool) -> Any:
    fresh = law.start(sample)
    values = [row[at[f"law.{name}"]] for name in fresh._fields] if same else map(float, fresh)
    return type(fresh)(*values)


def _compared(found: Recording, gaps: Any, wishes: Any, said: Any, told: Any) -> Replay:
    law_had = ~gaps & (found["source"] >= LAW_BEGINS)
    wish = found["wish"]
    equal = (wishes == wish) | (np.isnan(wishes) & np.isnan(wish))
    difference = np.where(equal, 0.0, wishes - wish)[law_had]
    difference = difference[np.isfinite(difference)]
    other = ~gaps & (said[:, 1:] != told[:, 1:]).any(axis=1)
    command = np.abs(said[:, 0] - told[:, 0])[~gaps]
    command = command[np.isfinite(command)]
    time = found["time"]

    def first(where: Any) -> float | None:
        return float(time[where.argmax()]) if where.any() else None

    return Replay(
        cycles=int((~gaps).sum()),
        beginnings=int(gaps.sum()),
        law_cycles=int(law_had.sum()),
        wish_largest=float(np.abs(difference).max()) if len(difference) else None,
        wish_rms=float(np.sqrt(np.mean(difference**2))) if len(difference) else None,
        first_difference=first(law_had & ~equal),
        verdicts_differing=int(other.sum()),
        command_largest=float(command.max()) if len(command) else 0.0,
        first_other_verdict=first(other),
    )


def _check(found: Recording, law: Law, same: bool) -> None:
    wanted = list(_NEEDED)
    if same:
        wanted += [f"law.{name}" for name in type(law.start(Sample(0.0, 0.0)))._fields]
    missing = [name for name in wanted if name not in found.columns]
    if missing:
        raise LogError(
            f"the log has no column {', '.join(missing[:3])}{' …' if missing[3:] else ''}",
            expected="a log of bowden run, with the state of its law and supervisor",
            do="replay it with the version of bowden that wrote it",
        )
    if len(found.rows) < 2:
        raise LogError(f"the log has {len(found.rows)} rows", expected="two at least")
