"""How many whole cycles a log has, and what more of them may be expected to give.

A whole cycle passes each place in the middle half of the motor's range, on the way up and on the way down. What a
stroke tells of the next one, a fit learns only from several: a cable settles, and strays. So the error after the log
falls with the cycles that were fitted; and what a fit states of it, the error on the half that it has not seen, rests
on as few. Both were measured on recordings that were cut short (docs/background/theory.md), each identified alone:
of several logs fitted together, and of a recalibration, only what is to be recorded is said.
"""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from bowden.identify.cable.path import Path

ENOUGH = 5
"""Whole cycles from which on more of them are not asked for."""
FOR_YES = 4
"""Whole cycles from which on the stated error held, see `_TOO_SURE`."""
_PLACES = np.linspace(0.25, 0.75, 11)
"""Where passes are counted, over the motor's range; not every cycle reaches its ends."""
_LEFT = {1: 0.5, 2: 0.7, 3: 0.8, 4: 0.8}
"""Error later on after five cycles, over that after so many: the median of 18 recordings [–]."""
_TOO_SURE = {2: 3.3, 3: 2.8}
"""Error later on over the stated one, the largest of 19 recordings; with other numbers of cycles it was below 2 [–]."""


class Cycles(NamedTuple):
    """Whole cycles of a log, and how many more to record."""

    whole: int
    """That the log has: as often the motor passed each place in the middle half of its range both ways."""
    more: int
    """To record; 0 where the log has five or more."""

    @property
    def to_record(self) -> str:
        """What to record, in one line; empty where nothing is to be."""
        return f"record {self.more} more whole cycle{'s' * (self.more > 1)} (up and down)" if self.more else ""

    @property
    def counted(self) -> str:
        """How many the log has, in words."""
        return f"{self.whole or 'no'} whole cycle{'s' * (self.whole != 1)}"

    @property
    def advice(self) -> str:
        """What to record, and what it may be expected to give, in one line; empty where nothing is to be recorded."""
        if not self.more:
            return ""
        record = self.to_record
        if not self.whole:
            return f"{record}: nothing says how the loop closes over the middle of the motor's range"
        gain = f"expect some {_LEFT[self.whole]:g} times the error in later motion"
        if self.whole not in _TOO_SURE:
            return f"{record}: {gain}"
        return f"{record}: {gain}; after logs as short it was up to {_TOO_SURE[self.whole]:g} times the stated error"

    def __str__(self) -> str:
        return f"{self.counted}; {self.advice}" if self.more else self.counted


def drift(path: "Path") -> float:
    """How fast the joint moves away from where it was when the motor passed the same place the same way [rad/s].

    No loop that closes does so, and a sensor that drifts does. The first stroke is not yet on the loop, and left out.
    Zero where it is below three deviations of what is left.
    """
    places, counted, found = float(path.turning.min()) + _PLACES * path.span, path.weight > 0.0, []
    edges = np.searchsorted(path.stroke, np.arange(path.strokes + 1))
    for begin, end, first, stop in zip(path.turning[1:-1], path.turning[2:], edges[1:-1], edges[2:], strict=True):
        seen = slice(first, stop) if begin < end else slice(stop - 1, first - 1 if first else None, -1)
        motor, joint, time = (one[seen][counted[seen]] for one in (path.motor, path.joint, path.time))
        if len(motor):
            passed = np.flatnonzero((min(begin, end) <= places) & (places <= max(begin, end)))
            at = places[passed]
            way = passed + len(places) * (begin < end)
            found.append(np.stack([way, np.interp(at, motor, time), np.interp(at, motor, joint)]))
    if not found:
        return 0.0
    own, time, joint = np.concatenate(found, axis=1)
    way = own.astype(np.int64)
    time, joint = (one - (np.bincount(way, one) / np.maximum(np.bincount(way), 1))[way] for one in (time, joint))
    power = float(time @ time)
    if power == 0.0:
        return 0.0
    rate = float(time @ joint) / power
    deviation = float(np.sqrt(np.mean((joint - rate * time) ** 2) * len(_PLACES) / power))  # a stroke's places go along
    return rate if abs(rate) > 3.0 * deviation else 0.0


def whole_cycles(path: "Path") -> Cycles:
    """Of the motor's path through a whole log."""
    begin, end = path.turning[:-1], path.turning[1:]
    places = float(path.turning.min()) + _PLACES * path.span
    passed = (np.minimum(begin, end)[:, None] <= places) & (places <= np.maximum(begin, end)[:, None])
    up, down = (np.count_nonzero(passed[way], axis=0) for way in (end > begin, end < begin))
    whole = int(np.minimum(up, down).min())
    return Cycles(whole, max(0, ENOUGH - whole))
