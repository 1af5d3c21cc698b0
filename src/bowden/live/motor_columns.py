"""The columns of a run with several motors: what is common stands once, the first motor's columns have their plain
names, and those of another motor begin with its name, ``knee.joint``.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

COMMON = frozenset({"time", "lateness", "elapsed", "overruns", "operator_age", "recorder", "run_time"})
"""Columns of the loop, which is one for all motors."""
TOGETHER: Mapping[str, str] = {"others": "1", "preflight_alone": "1"}
"""Column → unit of what a motor among others has besides: what its supervisor is shown of the others, and the outcome
of its own preflight, where ``preflight`` is that of all."""

SHARED: Mapping[str, str] = {"neighbour": "rad"}
"""Column → unit of what a motor that shares its joint has besides: the angle of another one, as its supervisor is shown
it."""


def of_all(blocks: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """Column → unit of a run.

    Args:
        blocks: name of a motor → column → unit of it alone, the first motor's first.

    >>> of_all({"hip": {"time": "s", "joint": "rad"}, "knee": {"time": "s", "joint": "rad"}})
    {'time': 's', 'joint': 'rad', 'knee.joint': 'rad'}
    """
    first, *others = blocks
    found = dict(blocks[first])
    for name in others:
        found |= {f"{name}.{column}": unit for column, unit in blocks[name].items() if column not in COMMON}
    return found


class MotorView(NamedTuple):
    """Where the columns of one motor are among those of a run."""

    places: tuple[int, ...]
    columns: tuple[str, ...]
    """Their names without the motor's."""


def view(columns: Sequence[str], names: Sequence[str], name: str) -> MotorView:
    """The columns of one motor with those that are common.

    Args:
        columns: of the run.
        names: of its motors, in their order.
        name: of the motor.

    >>> view(("time", "joint", "knee.joint"), ("hip", "knee"), "knee")
    MotorView(places=(0, 2), columns=('time', 'joint'))
    """
    of_others = tuple(f"{other}." for other in names[1:])
    if name == names[0]:
        kept = [(i, column) for i, column in enumerate(columns) if not column.startswith(of_others)]
    else:
        own = f"{name}."
        kept = [
            (i, column.removeprefix(own))
            for i, column in enumerate(columns)
            if column in COMMON or column.startswith(own)
        ]
    return MotorView(tuple(i for i, _ in kept), tuple(column for _, column in kept))


def named(columns: Sequence[str], names: Sequence[str]) -> tuple[str, ...]:
    """The same columns of every motor of a run: those that are common once.

    >>> named(("time", "joint"), ("hip", "knee"))
    ('time', 'joint', 'knee.joint')
    """
    more = (f"{name}.{column}" for name in names[1:] for column in columns if column not in COMMON)
    return (*columns, *more)
