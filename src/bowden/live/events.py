"""What changed from row to row, in words: modes, reactions, faults that come and go, emergencies, gains, missing
rows.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import counted
from bowden.live.gain_ramp import ASKED, IN_FORCE
from bowden.live.mcap_log import Event
from bowden.live.ring import Description

WATCHED = ("mode", "reaction", "power", "source", "preflight_reason")
"""Columns that hold the number of a state."""
FAULTS = "faults"
"""Column that holds a set of faults, fault i as the bit 2^i."""
UNREAD = frozenset({"joint_lost", "joint_stale", "motor_lost", "motor_stale", "current_lost"})
"""Faults of a run's first row that say no more than that its drive has not been read yet."""
UNREAD_EMG = frozenset({"emg_lost"})
"""The same of its EMG, which comes later than the drive's reading."""
UNSETTLED = frozenset({"joint_over_speed", "motor_over_speed"})
"""Faults of the row with a run's first reading that say no more than that its speeds are not known yet: the angles step
from nothing to what they are."""
EMERGENCY = "emergency"
"""Column that holds the error code of the drive in the cycle in which it comes, otherwise 0."""


class Changes:
    """Finds events in rows that come in pieces; names come from ``settings["names"]``.

    That table has a list for each column of `WATCHED` and for `FAULTS`: the name of state i, or of bit i.

    Args:
        description: of the rows.
        last: number and values of the row before the first that comes.
    """

    def __init__(self, description: Description, last: tuple[int, NDArray[np.float64]] | None = None) -> None:
        self._description, self._last = description, last
        columns = list(description.columns)
        self._time = columns.index("time")
        self._watched: list[tuple[str, str, int]] = []
        """Of each motor: what its events begin with, the column's name without the motor's, and its place."""
        self._gains: list[tuple[str, int, int]] = []
        motors = [str(one["name"]) for one in description.settings.get("motors") or ()]
        for number, motor in enumerate(motors or [""]):
            prefix, label = f"{motor}." if number else "", f"{motor}: " if motor else ""
            for name in (*WATCHED, FAULTS, EMERGENCY):
                if prefix + name in columns:
                    self._watched.append((label, name, columns.index(prefix + name)))
            for name in [one.removeprefix(prefix + ASKED) for one in columns if one.startswith(prefix + ASKED)]:
                if (column := f"{prefix}{IN_FORCE}{name}") in columns:
                    asked = columns.index(f"{prefix}{ASKED}{name}")
                    self._gains.append((f"{label}gain {name}", columns.index(column), asked))
        self._names: Mapping[str, Any] = description.settings.get("names", {})

    def find(self, numbers: NDArray[np.int64], rows: NDArray[np.float64]) -> tuple[list[Event], "Changes"]:
        """Events of the next rows (n,) and (n, width), in their order; and who finds those of the rows after them."""
        if not len(rows):
            return [], self
        number, row = self._last or (-1, np.full(rows.shape[1], np.nan))
        before, earlier = np.concatenate([row[None], rows[:-1]]), np.concatenate([[number], numbers[:-1]])
        events = list[Event]()

        def add(i: int, text: str) -> None:
            events.append(Event(int(numbers[i]), float(rows[i, self._time]), text))

        for i in np.flatnonzero(numbers - earlier > 1).tolist():
            add(i, f"{counted(int(numbers[i] - earlier[i]) - 1, 'row')} lost before this one")
        for label, name, at in self._watched:
            old, new = before[:, at], rows[:, at]
            for i in np.flatnonzero((old != new) & ~(np.isnan(old) & np.isnan(new))).tolist():
                if text := self._text(name, old[i], new[i]):
                    add(i, label + text)
        for name, at, goal in self._gains:
            values, asked, was_asked = rows[:, at], rows[:, goal], before[:, goal]
            for i in np.flatnonzero((asked != was_asked) & ~np.isnan(was_asked)).tolist():
                add(i, f"{name}: {before[i, at]:.6g} → {asked[i]:.6g} asked for")
            for i in np.flatnonzero((values == asked) & (before[:, at] != was_asked) & ~np.isnan(was_asked)).tolist():
                add(i, f"{name}: {values[i]:.6g} in force")
        events.sort(key=lambda event: event.number)
        return events, Changes(self._description, (int(numbers[-1]), rows[-1].copy()))

    def _text(self, column: str, old: float, new: float) -> str:
        if column == EMERGENCY:
            return f"emergency: 0x{int(new):04X}" if 0.0 < new < 2.0**16 else ""
        return self._faults(old, new) if column == FAULTS else self._state(column, old, new)

    def _state(self, column: str, old: float, new: float) -> str:
        names = self._names.get(column, ())
        came = _name(new, names)
        return f"{column}: {came}" if np.isnan(old) else f"{column}: {_name(old, names)} → {came}"

    def _faults(self, old: float, new: float) -> str:
        names = self._names.get(FAULTS, ())
        was, now = _bits(old), _bits(new)
        came = [_name(bit, names) for bit in sorted(now - was)]
        unread = [name for name in came if np.isnan(old) and name in UNREAD | UNREAD_EMG]
        parts = [f"not read yet: {', '.join(unread)}"] * bool(unread)
        gone = [_name(bit, names) for bit in sorted(was - now)]
        unsettled = [name for name in came if name in UNSETTLED and {"joint_lost", "motor_lost"} & {*gone}]
        parts += [f"not settled yet: {', '.join(unsettled)}"] * bool(unsettled)
        parts += [f"fault: {name}" for name in came if name not in unread + unsettled]
        parts += [f"fault gone: {name}" for name in gone]
        return "; ".join(parts)


def _bits(value: float) -> set[int]:
    if not 0.0 <= value < 2.0**53:
        return set()
    return {bit for bit in range(int(value).bit_length()) if int(value) >> bit & 1}


def _name(value: float, names: Sequence[str]) -> str:
    known = float(value).is_integer() and 0 <= value < len(names)
    return names[int(value)] if known else f"{value:g}"
