"""Quaternions of an IMU, of one body or of two, as an angle about the axis about which they turn."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bowden.records.table import Table

Array = NDArray[np.float64]

_PART = re.compile(r"(.*?)[\s_./-]*q?(?:uat\w*)?[\s_./-]*([wxyz])(?:\s*[\[(].*)?", re.IGNORECASE)
JOINT, MOTOR = "joint_angle_rad", "motor_angle_rad"
"""Columns that stand for quaternions."""


def with_angles(table: Table) -> Table:
    """The table with a column for the angle of its quaternions: of one body, or of the second against the first.

    Those with motor in their names are the motor's.
    """
    bodies: dict[str, dict[str, int]] = {}
    for place, name in enumerate(table.names):
        if found := _PART.fullmatch(name.strip()):
            bodies.setdefault(found[1].lower(), {})[found[2].lower()] = place
    whole = {base: [parts[one] for one in "wxyz"] for base, parts in bodies.items() if len(parts) == 4}
    sides: dict[str, list[list[int]]] = {}
    for base, places in whole.items():
        sides.setdefault(MOTOR if "motor" in base else JOINT, []).append(places)
    added = {name: places for name, places in sides.items() if len(places) <= 2 and name not in table.names}
    if not added:
        return table
    count = len(table.names)

    def read(columns: Sequence[int], clock: int | None) -> list[Array]:
        parts = {column: [*added.values()][column - count] for column in columns if column >= count}
        needed = [one for places in parts.values() for body in places for one in body]
        flat = list(dict.fromkeys([*(one for one in columns if one < count), *needed]))
        values = dict(zip(flat, table.read(flat, clock), strict=True))
        for column, places in parts.items():
            values[column] = angle_of([np.array([values[one] for one in body]) for body in places])
        return [values[column] for column in columns]

    return replace(table, names=(*table.names, *added), read=read)


def angle_of(bodies: Sequence[Array]) -> Array:
    """The angle (n,) [rad] of one body's quaternions (4, n), w first, against its first, or of a second's to a first's.

    >>> half = np.linspace(0.0, 1.0, 5)
    >>> turned = np.stack([np.cos(half), 0.0 * half, np.sin(half), 0.0 * half])
    >>> angle_of([turned]).round(6).tolist()
    [0.0, 0.5, 1.0, 1.5, 2.0]
    """
    from scipy.spatial.transform import Rotation

    known = np.asarray(np.isfinite(np.concatenate(bodies)).all(axis=0))
    turned = [Rotation.from_quat(one[:, known].T, scalar_first=True) for one in bodies]
    between = turned[0].inv() * turned[1] if len(turned) == 2 else turned[0]
    w, *vectors = (between[0].inv() * between).as_quat(scalar_first=True).T
    axis = np.linalg.svd(np.stack(vectors) @ np.stack(vectors).T)[0][:, 0]
    axis *= np.sign(axis[np.argmax(np.abs(axis))])  # the same way round whatever the log
    angle = np.full(len(known), np.nan)
    angle[known] = np.unwrap(2.0 * np.arctan2(axis @ vectors, w))
    return angle
