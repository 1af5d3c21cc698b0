"""The path of a log: the motor's travel from reversal to reversal, freed of encoder noise, with the joint along it.

All models here are rate-independent: only the order of the motor's positions matters, not when they were reached. A
log is therefore thinned along its travel. Between two reversals, following samples are averaged into nodes that do not
step back; each reversal is a node of its own, with a weight of zero. Without this, every flicker of an encoder would
count as a reversal.
"""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bowden.core.kernel import compiled, kernel
from bowden.identify.cable.turns import Turns

Array = NDArray[np.float64]

_STROKES = 25
"""Strokes for which the nodes that are asked for are enough: more of them get as many each."""
_GOLDEN = 0.6180339887498949


@dataclass(frozen=True)
class Path:
    """Nodes in the order in which the motor passed them."""

    motor: Array
    """Motor angle (n,) [rad]."""
    joint: Array
    """Mean joint angle (n,) [rad]; zero where the weight is."""
    weight: Array
    """Samples averaged in the node (n,) [–]; zero at the start and the reversals."""
    time: Array
    """Mean time (n,) [s]."""
    stroke: NDArray[np.int64]
    """Which stroke the node belongs to, from 0 (n,)."""
    turning: Array
    """Motor angle at the start, at each reversal, and at the end (strokes + 1,) [rad]."""
    start_error: float
    """Standard error of the motor angle at the start [rad]."""
    reversal_error: float
    """Standard error that all reversals of one side may have in common [rad]."""

    @property
    def strokes(self) -> int:
        """Monotone strokes of the motor."""
        return len(self.turning) - 1

    @property
    def span(self) -> float:
        """Range of the motor [rad]."""
        return float(np.ptp(self.turning))

    @property
    def direction(self) -> float:
        """1 where the joint goes the motor's way, −1 where it goes the other."""
        away = self.motor - np.average(self.motor, weights=self.weight)
        return 1.0 if self.weight * away @ self.joint >= 0.0 else -1.0

    def first(self, strokes: int) -> "Path":
        """Its first strokes only."""
        kept = self.stroke < strokes
        parts = (self.motor[kept], self.joint[kept], self.weight[kept], self.time[kept], self.stroke[kept])
        return Path(*parts, self.turning[: strokes + 1], self.start_error, self.reversal_error)

    def at(self, time: Array, values: Array) -> Array:
        """Values of the nodes (n,) at times of the log (m,): straight between the nodes that have a weight.

        A path at the log's full rate is the motor's motion freed of encoder noise, along which a model is simulated.
        Bouc–Wen needs that: its small loops do not close, so that a flicker of the encoder, at rest most of all, drives
        h towards zero, which the cable itself does not do.
        """
        counted = self.weight > 0.0
        return np.interp(time, self.time[counted], values[counted])

    def with_weight(self, weight: Array) -> "Path":
        """The same path, its nodes weighted otherwise (n,)."""
        return replace(self, weight=weight)


def build_path(time: Array, motor: Array, joint: Array, turns: Turns, nodes: int, most: int | None = None) -> Path:
    """The path of a log.

    Args:
        time: (n,) [s].
        motor: (n,) [rad].
        joint: (n,) [rad].
        turns: of the motor.
        nodes: about how many nodes are wanted; a log of many strokes gets more, so that each keeps its shape, up to
            ten times as many.
        most: strokes that are read. Of the others only those reversals are kept that a rate-independent model still
            needs, see `remembered`: a longer log has as many nodes in a stroke as a short one, and the corners of its
            loop stay as sharp. All strokes are read where it is not given.
    """
    strokes = len(turns.at) + 1
    bounds = np.array([0, *turns.at, len(motor)])
    # Multiples of the golden ratio modulo one: no repeating programme of amplitudes falls between those that are read.
    read = (np.arange(strokes) // 2 * _GOLDEN) % 1.0 < (most or strokes) / strokes
    samples, travels = np.diff(bounds)[read].sum(), np.abs(np.diff(turns.angle))[read].sum()
    strokes = int(read.sum())
    kept = remembered(turns.angle, read)
    bounds, turning, read = bounds[kept], turns.angle[kept], read[kept[:-1]]
    nodes = max(nodes, 8 * strokes, min(strokes * max(8, nodes // _STROKES), 10 * nodes))
    fast = float(np.quantile(np.abs(motor[9:] - motor[:-9]), 0.9)) / 9.0  # per sample; nine outweigh the noise
    together = max(1, int(float(travels) / nodes / max(fast, 1e-12)), int(samples) // (4 * nodes))
    together = min(together, max(1, int(samples) // nodes))
    size = len(motor) // together + 2 * len(bounds)
    nodes_of, stroke = np.empty((4, size)), np.empty(size, np.int64)
    count = compiled(gather)(time, motor, joint, bounds, turning, read, together, nodes_of, stroke)
    m, j, w, t = (np.array(row[:count]) for row in nodes_of)
    return Path(m, j, w, t, stroke[:count].copy(), turning, turns.start_error, turns.common_error)


def remembered(turning: Array, read: NDArray[np.bool_]) -> NDArray[np.intp]:
    """Reversals (strokes + 1,) [rad] that matter where only some strokes (strokes,) are read, by their number.

    A swing within the ones before and after it closes a loop, which leaves no trace in a play or a sum of plays, and
    next to none in a Bouc–Wen cable: both its ends are left out, where none of the three swings is read.

    Source: Brokate and Sprekels, *Hysteresis and Phase Transitions*, 1996, Section 2.3 (Madelung's deletion).

    >>> remembered(np.array([0.0, 3.0, 1.0, 2.0, -3.0]), np.array([True, False, False, False])).tolist()
    [0, 1, 4]
    """
    kept: list[int] = []
    for last in range(len(turning)):
        kept.append(last)
        while len(kept) > 3 and not read[kept[-4] : last].any():
            before, swing, after = np.abs(np.diff(turning[kept[-4:]]))
            if swing > min(before, after):
                break
            del kept[-3:-1]
    return np.array(kept, np.intp)


@kernel
def gather(
    time: Array,
    motor: Array,
    joint: Array,
    bounds: NDArray[np.int64],
    turning: Array,
    read: NDArray[np.bool_],
    together: int,
    nodes: Array,
    owner: NDArray[np.int64],
) -> int:
    """Average every `together` samples of a stroke into a node; then merge nodes that would step back.

    The samples are grouped by time, not by travel: a group that ended where a reading is large would be biased. The
    merging (pooled adjacent violators) gives the monotone motion closest to the readings; a rest becomes one node. It
    leaves the last node of a stroke a little too far out, so no node may lie beyond the reversals.

    Args:
        time: (n,) [s].
        motor: (n,) [rad].
        joint: (n,) [rad].
        bounds: first sample of each stroke, and one past the last.
        turning: motor angle at both ends of each stroke [rad].
        read: strokes of which more than the reversals is wanted.
        together: samples in a node.
        nodes: (4, m) to be filled with motor, joint, weight and time of each node.
        owner: (m,) to be filled with its stroke.

    Returns:
        How many nodes there are.
    """
    m, j, w, t = nodes[0], nodes[1], nodes[2], nodes[3]
    n = 0
    for stroke in range(bounds.size - 1):
        sign = 1.0 if turning[stroke + 1] >= turning[stroke] else -1.0
        m[n], j[n], w[n] = turning[stroke], 0.0, 0.0
        t[n], owner[n] = time[bounds[stroke]], stroke
        n += 1
        first = n
        if not read[stroke]:
            continue
        for begin in range(bounds[stroke], bounds[stroke + 1], together):
            stop = min(begin + together, bounds[stroke + 1])
            m[n], j[n] = np.mean(motor[begin:stop]), np.mean(joint[begin:stop])
            t[n], w[n], owner[n] = np.mean(time[begin:stop]), stop - begin, stroke
            n += 1
            while n - 1 > first and sign * (m[n - 1] - m[n - 2]) <= 0.0:
                share = w[n - 1] / (w[n - 2] + w[n - 1])
                m[n - 2] += (m[n - 1] - m[n - 2]) * share
                j[n - 2] += (j[n - 1] - j[n - 2]) * share
                t[n - 2] += (t[n - 1] - t[n - 2]) * share
                w[n - 2] += w[n - 1]
                n -= 1
        for k in range(first, n):
            m[k] = sign * min(max(sign * m[k], sign * turning[stroke]), sign * turning[stroke + 1])
    return n
