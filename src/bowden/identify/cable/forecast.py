"""What a law can make of an identified model: the joint's error with the model's inverse as feed-forward.

A law that commands the motor to where the model has the joint at its reference r leaves

    joint(motor) − r = joint(motor) − model(motor),    motor = model⁻¹(r)

which is the model's own error along that motion. On a motion like the log's it is what the model errs by on the half
that it has not seen, but for the time spent at each place: the inverse runs through the play at once, where the log's
motor took its time. At a place where the model's joint moves by dm per dx of the motor, the law spends dm/(c·dx) of the
log's time (c: slope of the straight line), and there the error counts by this much. Without compensation the motor goes
to where the straight line has the joint at r, and the line's error is left. Neither counts the servo: it is taken to
follow at once.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.identify.cable.fitted import FittedLog
from bowden.identify.cable.turns import motor_noise

Array = NDArray[np.float64]

_PLACES = 500
"""Pieces of the second half, in each of which the motions of motor and model are compared."""


class Forecast(NamedTuple):
    """Root mean square error of the joint on a motion like the log's second half."""

    compensated: float
    """With the inverse of the recommended model commanded exactly [rad]."""
    uncompensated: float
    """With the inverse of the straight line [rad]."""
    resolution: float
    """Of both encoders' counts, at the joint: √((slope·motor count)² + (joint count)²)/√12. What is below it neither
    shows in this log nor can be commanded; zero where the log shows no counts [rad]."""


def forecast(one: FittedLog, slope: float, error: float, of_line: float) -> Forecast:
    """See `Forecast`.

    Args:
        one: what was fitted, and how the recommended model predicts it.
        slope: of the straight line [rad/rad].
        error: of the recommended model on the second half [rad].
        of_line: the straight line's [rad].
    """
    of_motor, of_joint = one.log.resolutions
    counts = math.hypot(slope * of_motor, of_joint)
    motor, predicted, joint = (values[one.split :] for values in (one.log.motor, one.predicted, one.log.joint))
    return Forecast(_share(motor, predicted, joint - predicted, abs(slope)) * error, of_line, counts / math.sqrt(12.0))


def _share(motor: Array, model: Array, error: Array, slope: float) -> float:
    """Error along the inverse's motion over that along the log's, both root mean square."""
    pieces = max(1, min(_PLACES, len(motor) // 4))
    edges = np.linspace(0, len(motor) - 1, pieces + 1).astype(int)
    moved, went = (np.abs(np.diff(one[edges])) for one in (model, motor))
    resting = went <= 4.0 * motor_noise(motor)
    spent = np.where(resting, 1.0, moved / np.where(resting, 1.0, slope * went)) * np.diff(edges)
    square = np.add.reduceat(error[:-1] ** 2, edges[:-1]) / np.diff(edges)
    whole = float(np.diff(edges) @ square) / float(edges[-1])
    if not (whole > 0.0 and spent.sum() > 0.0):
        return 1.0
    return math.sqrt(float(spent @ square) / float(spent.sum()) / whole)
