"""Replay: a recorded run once more through law and supervisor, cycle by cycle, against what was commanded then."""

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from bowden.control.conditioning import COLUMNS as CONDITIONED
from bowden.control.conditioning import Conditioned
from bowden.control.law import Law
from bowden.control.source import TABLE, Measurement, Source
from bowden.core.errors import LogError
from bowden.core.nested import from_columns, unflatten
from bowden.core.signals import DriveReading, Sample
from bowden.cycle.one_cycle import LAW_BEGINS, NOTHING_OBSERVED, NOTHING_PLANNED, Cycle, CycleState, Filters, verdict_of
from bowden.cycle.torque_offset import COLUMNS, TorqueOffset
from bowden.live.figures import Replay
from bowden.live.gain_ramp import IN_FORCE
from bowden.live.mcap_read import Recording
from bowden.live.ring import RecorderState
from bowden.live.row import STOPPED, SUPERVISOR
from bowden.live.run_settings import push_of
from bowden.records.metrics import rmse
from bowden.safety.limits import Limits

_SURROUNDINGS = ("lateness", "elapsed", "request", "operator_age", "recorder", "preflight")
_VERDICT = ("command", "power", "mode", "reaction", "faults")
_NEEDED = (
    *("reference", "reference_velocity", "reference_acceleration", *DriveReading._fields, *_SURROUNDINGS, *_VERDICT),
    *("joint_seen", "motor_seen", "requested_target", "source", *SUPERVISOR),
)


def replay(
    found: Recording,
    law: Law,
    limits: Limits,
    filters: Filters,
    period: float,
    *,
    same: bool,
    source: Source = TABLE,
) -> Replay:
    """Run the cycle of the live loop on recorded readings.

    The same compiled function as in the loop, so that the law and limits of the record give its very numbers. The motor
    of the record does not follow another law: what is compared then is what that law would have asked for, and what
    the supervisor would have said to it, at the angles that there were.

    Args:
        found: the record, of one motor.
        law: with its gains.
        limits: of the supervisor.
        filters: in front of the law.
        period: of the loop [s].
        same: whether it is the law of the record, whose state is taken from there; another begins where that one did.
        source: of the record's reference, whose state is taken from there; it makes the reference again.

    Raises:
        LogError: a column is missing, or the record has fewer than two rows.
    """
    _check(found, law, same, source)
    cycle = Cycle(law, limits, filters, period, source)
    at = {name: i for i, name in enumerate(found.columns)}
    reading, surroundings, verdict, reference = (
        [at[name] for name in names]
        for names in (
            DriveReading._fields,
            _SURROUNDINGS,
            _VERDICT,
            ("reference", "reference_velocity", "reference_acceleration"),
        )
    )
    recorded = at["recorder"]
    changed = _gain_columns(found, law) if same else []
    gaps = np.diff(found.numbers, prepend=found.numbers[0] - 2) > 1
    requested = np.full(len(found.rows), np.nan)
    said = np.full((len(found.rows), len(_VERDICT)), np.nan)
    for k, array in enumerate(found.rows):
        row = array.tolist()
        if gaps[k]:
            first = dict(zip(found.columns, row, strict=True))
            sample = Sample(first["joint_seen"], first["motor_seen"])
            law_begun, begun = law.start(sample), source.start(Measurement(sample.joint, sample.motor, 0.0, np.nan))
            cycle.state = CycleState(
                sample,
                from_columns(law_begun, first, "law") if same else law_begun,
                _conditioned(first),
                begun if source is TABLE else from_columns(begun, first, source.name),
                from_columns(STOPPED, first, "supervisor"),
            )
            continue
        emg_age = row[at["emg.age"]] if "emg.age" in at else 0.0
        among = (row[at[name]] if name in at else 0.0 for name in ("others", "neighbour"))
        row[recorded] = float(row[recorded] == RecorderState.OK)
        around = (*(row[i] for i in surroundings), emg_age, *among, math.nan)
        observed = unflatten(NOTHING_OBSERVED, np.array([*(row[i] for i in reading), *around]))
        plan = unflatten(
            NOTHING_PLANNED, np.array([row[at["source"]], row[at["requested_target"]], *(row[i] for i in reference)])
        )
        for place, column in changed:
            cycle.gains[place] = row[column]
        requested[k], judged = cycle.step(observed, plan)
        said[k] = judged
    return _compared(found, gaps, requested, said, found.rows[:, verdict], _torques(found, gaps, period))


def _gain_columns(found: Recording, law: Law) -> list[tuple[int, int]]:
    """Place of each live gain among the law's, and its column; none in a log from before there were such."""
    order = list(law.numbers)
    names = [name for name in law.live if f"{IN_FORCE}{name}" in found.columns]
    return [(order.index(name), found.columns.index(f"{IN_FORCE}{name}")) for name in names]


def _conditioned(row: Mapping[str, float]) -> Conditioned:
    """What the law was shown in a row; the reference itself in a log from before there was a conditioner."""
    shown = (row["reference"], row["reference_velocity"], row["reference_acceleration"])
    begun = Conditioned(*shown, row["reference"], 0.0, 0.0, 0.0)
    return begun if set(CONDITIONED) - set(row) else from_columns(begun, row, "conditioned")


def _torques(found: Recording, gaps: Any, period: float) -> Any:
    """Differences of the torque offset (n,) [N·m], not a number where one of both alone is none; None in a run without.

    Its first value after each gap is taken from the record.
    """
    push, differences = push_of(found.settings), np.zeros(len(found.rows))
    if push is None or not set(COLUMNS) <= set(found.columns):
        return None
    offset = TorqueOffset(*push)
    recorded = found.rows[:, [found.columns.index(name) for name in COLUMNS]].tolist()
    said = found.rows[:, [found.columns.index(name) for name in _VERDICT]].tolist()
    for k, (gap, row, verdict) in enumerate(zip(gaps, recorded, said, strict=True)):
        if gap:
            offset.take(row)
            continue
        again = offset.step(verdict[0], verdict_of(*verdict), period)
        if not (math.isnan(again) and math.isnan(row[0])):
            differences[k] = abs(again - row[0])
    return differences


def _compared(found: Recording, gaps: Any, requested: Any, said: Any, recorded: Any, torques: Any) -> Replay:
    law_had = ~gaps & (found["source"] >= LAW_BEGINS)
    requested_target = found["requested_target"]
    equal = (requested == requested_target) | (np.isnan(requested) & np.isnan(requested_target))
    difference = np.where(equal, 0.0, requested - requested_target)[law_had]
    difference = difference[np.isfinite(difference)]
    other = ~gaps & ((said[:, 1:] != recorded[:, 1:]).any(axis=1) | (np.isnan(said[:, 0]) != np.isnan(recorded[:, 0])))
    other |= torques is not None and np.isnan(torques)
    command = np.abs(said[:, 0] - recorded[:, 0])[~gaps]
    command = command[np.isfinite(command)]
    time = found["time"]

    def first(where: Any) -> float | None:
        return float(time[where.argmax()]) if where.any() else None

    return Replay(
        cycles=int((~gaps).sum()),
        beginnings=int(gaps.sum()),
        law_cycles=int(law_had.sum()),
        requested_target_largest=float(np.abs(difference).max()) if len(difference) else None,
        requested_target_rms=rmse(difference) if len(difference) else None,
        first_difference=first(law_had & ~equal),
        verdicts_differing=int(other.sum()),
        command_largest=float(command.max()) if len(command) else 0.0,
        first_other_verdict=first(other),
        torque_largest=None if torques is None else float(np.nanmax(torques, initial=0.0)),
    )


def _check(found: Recording, law: Law, same: bool, source: Source) -> None:
    wanted = [*_NEEDED, *([] if source is TABLE else source.columns()), *(law.columns() if same else [])]
    missing = [name for name in wanted if name not in found.columns]
    if missing:
        raise LogError(
            f"the log has no column {', '.join(missing[:3])}{' …' if missing[3:] else ''}",
            expected="a log of bowden run, with the state of its law and supervisor",
            do="replay it with the version of bowden that wrote it",
        )
    if len(found.rows) < 2:
        raise LogError(f"the log has {len(found.rows)} rows", expected="two at least")
