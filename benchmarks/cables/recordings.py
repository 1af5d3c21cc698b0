"""Recordings of cables that anyone can fetch, and the splits on which methods are compared.

The recordings are those of `shared/data/README.md`: da Vinci grasper cables of O'Neill, Stephens and Kowalewski, IEEE
RA-L 3(4), 2018, from MRDLab/mis-tool-characterization (ODbL 1.0). Any folder of such files takes their place: CSV with
`time_s`, `motor_deg`, `joint_deg`. `L_4_XY` are one cable at frequency X and load Y.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import bowden
from bowden.core.errors import BowdenError
from bowden.identify.cable.turns import motor_noise, reversals

Array = NDArray[np.float64]
RATE = 100.0
"""Samples a second that every method but ours is given; the motions take 1 to 20 s a cycle."""
SPLITS = ("second half", "first two cycles", "other run", "other frequency", "other load")


class Recording(NamedTuple):
    """A motion of motor and joint."""

    time: Array
    """(n,) [s]."""
    motor: Array
    """(n,) [rad]."""
    joint: Array
    """(n,) [rad]."""

    @property
    def half(self) -> float:
        """The time at which its second half begins [s]."""
        return 0.5 * float(self.time[0] + self.time[-1])

    @property
    def two_cycles(self) -> float:
        """The time at which the motor has made two whole cycles: of its fifth reversal [s]."""
        turns = reversals(self.motor, max(8.0 * motor_noise(self.motor), 0.05 * float(np.ptp(self.motor))))
        return float(self.time[turns[4]]) if len(turns) > 4 else np.inf

    def until(self, time: float) -> "Recording":
        """Its part before a time."""
        return Recording(*(one[self.time < time] for one in self))

    def thinned(self) -> "Recording":
        """At `RATE`."""
        step = max(1, round(1.0 / RATE / float(np.median(np.diff(self.time)))))
        return Recording(*(one[::step] for one in self))


class Task(NamedTuple):
    """Learn from one recording up to a time; be judged on the second half of another, or of the same."""

    split: str
    learned: str
    until: float
    """[s]"""
    judged: str


def load(folder: Path) -> dict[str, Recording]:
    """All recordings of a folder and its folders, by name; of equal names the last one.

    Raises:
        BowdenError: there is none.
    """
    found = {}
    for path in sorted(folder.rglob("*.csv*")):
        log = bowden.read_log(path)
        found[path.name.split(".")[0]] = Recording(log.time, log.motor, log.joint)
    if not found:
        raise BowdenError(f"{folder} has no recording", expected="CSV files", do="name the folder that has them")
    return found


def tasks(recordings: dict[str, Recording]) -> Iterator[Task]:
    """The tasks of every split, in their order.

    Of a recording whose first two cycles outlast its first half there is none of the second split.
    """
    for name, one in recordings.items():
        yield Task(SPLITS[0], name, one.half, name)
        if one.two_cycles < one.half:
            yield Task(SPLITS[1], name, one.two_cycles, name)
    for name, one in recordings.items():
        for other in recordings:
            if split := _between(name, other):
                yield Task(split, name, one.half, other)


def _between(name: str, other: str) -> str:
    """The split of two recordings of one cable in one pose; empty where they are none."""
    if name == other:
        return ""
    here, there = (re.fullmatch(r"L_4_(\d)(\d)", one) for one in (name, other))
    if here and there:
        same_frequency, same_load = here[1] == there[1], here[2] == there[2]
        return SPLITS[3] if same_load else SPLITS[4] if same_frequency else ""
    return SPLITS[2] if name.rpartition("_")[0] == other.rpartition("_")[0] else ""
