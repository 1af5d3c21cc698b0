"""What the wearer felt of a suit that followed their push, by the torque that the run went by."""

from typing import TYPE_CHECKING

import numpy as np

from bowden.cycle.one_cycle import TargetSource
from bowden.design.felt import beside_load, rms_and_peak, settled
from bowden.live.figures import FeltInRun

if TYPE_CHECKING:
    from bowden.live.mcap_read import Recording
    from bowden.plants.pushing import Pushing

NEEDED = ("joint_seen", "joint_torque", "admittance.estimate.torque", "admittance.estimate.doubt")
"""Columns of the log that the figures come from, beside those of every run."""


def figures(log: "Recording", pushing: "Pushing", period: float) -> FeltInRun | None:
    """RMS and peak of the torque less the weight that is to be carried, and the median of its doubt [N·m].

    The torque is the load cell's, of which no doubt is known, in a run that went by it, and else the loop's estimate.

    Args:
        log: of the run.
        pushing: as the run had it.
        period: of a cycle [s].
    """
    led = np.flatnonzero(log["source"] >= TargetSource.LAW_BEGINS)
    if not len(led):
        return None
    led = led[settled(period * np.arange(len(led)))]
    measured = pushing.section.torque == "load_cell"
    torque, joint = log["joint_torque" if measured else "admittance.estimate.torque"][led], log["joint_seen"][led]
    left = beside_load(torque, joint, pushing.suit.arm, pushing.section.carried)
    known = np.isfinite(left)
    if not known.any():
        return None
    rms, peak = rms_and_peak(left[known])
    doubt = 0.0 if measured else float(np.median(log["admittance.estimate.doubt"][led][known]))
    return FeltInRun(rms, peak, doubt)
