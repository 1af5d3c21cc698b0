"""A recorded motion as a reference: what a file says of it, held in the rig."""

from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.reference import Recorded
from bowden.core.quantity import Quantity

Array = NDArray[np.float64]


class RecordedFile(NamedTuple):
    """A recorded motion, smoothed by a zero-phase low-pass filter."""

    file: Annotated[str, Quantity("CSV, csv.gz or Parquet file, found from this file", example="motion.csv")]
    time_column: Annotated[str, Quantity("its column of times, in seconds")] = "time_s"
    position_column: Annotated[str, Quantity("its column of joint angles")] = "joint_deg"
    unit: Annotated[Literal["deg", "rad"], Quantity("unit of the angles")] = "deg"
    cutoff: Annotated[float, Quantity("cut-off of the filter; 0 for none", "Hz", ge=0.0, le=1000.0)] = 6.0


@dataclass(frozen=True, eq=False)
class RecordedMotion:
    """A `Trajectory` with the numbers of its file, so that nothing is read again."""

    said: RecordedFile
    """The keys of [reference] for the file."""
    time: Array = field(repr=False)
    """(n,) [s]."""
    position: Array = field(repr=False)
    """(n,) [rad]."""

    @cached_property
    def motion(self) -> Recorded:
        """The smoothed motion."""
        return Recorded(self.time, self.position, cutoff=self.said.cutoff, name=Path(self.said.file).name)

    @property
    def duration(self) -> float:
        """Length of the recording [s]."""
        return self.motion.duration

    def sample(self, time: Array) -> Array:
        """See `Trajectory.sample`."""
        return self.motion.sample(time)

    def describe(self) -> dict[str, Any]:
        """See `Trajectory.describe`."""
        return self.motion.describe()

    def __eq__(self, other: object) -> bool:
        return (
            isinstance(other, RecordedMotion)
            and self.said == other.said
            and np.array_equal(self.time, other.time)
            and np.array_equal(self.position, other.position)
        )

    def __hash__(self) -> int:
        return hash((self.said, len(self.time)))

    def __getstate__(self) -> dict[str, Any]:
        return {"said": self.said, "time": self.time, "position": self.position}


def held(motion: Recorded) -> RecordedMotion:
    """A recorded motion of Python's as one that a rig holds; its file would have this name."""
    said = RecordedFile(f"{motion.name}.csv", "time_s", "joint_rad", "rad", motion.cutoff)
    return RecordedMotion(said, motion.time, motion.position)
