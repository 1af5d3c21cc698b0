"""A sensor that goes wrong for a while, in a simulation without a supervisor: what the law is shown."""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import noinline, placeholder
from bowden.core.signals import DriveReading, Sample
from bowden.sim.injected import Injected, misread


class SensorFault(NamedTuple):
    """What goes wrong, and when."""

    kind: Injected = Injected.NOTHING
    """Of the joint's or the motor's angle."""
    begin: int = 0
    """First cycle."""
    end: int = 0
    """The cycle after the last."""


@placeholder
def as_it_is(fault: SensorFault, sample: Sample, kept: NDArray[np.float64], k: int) -> Sample:
    """The sample: where nothing goes wrong, this is compiled into the loop in place of `faulty`."""
    return sample


@noinline
def faulty(fault: SensorFault, sample: Sample, kept: NDArray[np.float64], k: int) -> Sample:
    """What the law is shown in cycle k; `kept` (2, n) holds the true readings for faults that look back."""
    kept[0, k], kept[1, k] = sample.joint, sample.motor
    if not fault.begin <= k < fault.end:
        return sample
    true = DriveReading(
        sample.motor, sample.joint, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
        sample.joint_age, sample.joint_std, math.nan,
    )  # fmt: skip
    misread_sample = misread(fault.kind, k - fault.begin, true, kept[0], kept[1], k)
    return Sample(misread_sample.joint, misread_sample.motor, sample.joint_age, sample.joint_std)
