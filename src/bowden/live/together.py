"""Several motors in one run: their columns, and what they are asked for and shown, so that they begin and end together.

Of the columns what is common stands once, the first motor's have their plain names, and those of another motor begin
with its name, ``knee.joint``.

A motor that a fault stops is shown to the supervisors of the others, which release or switch off too (`safety.faults`,
`OTHER_RELEASED`, `OTHER_OFF`). What no fault is, and would have one motor move without another, is met here: arming and
running are passed on only where every motor can follow, and a motor that has not followed within `PATIENCE` cycles, or
has gone without a fault, ends the run of all by the request that an operator stops it with.
"""

import functools
import operator
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.safety.faults import Reaction, shown_to_others
from bowden.safety.state import Mode, PreflightResult, Request

COMMON = frozenset({"time", "lateness", "elapsed", "overruns", "operator_age", "recorder", "run_time"})
"""Columns of the loop, which is one for all motors."""
TOGETHER: Mapping[str, str] = {"others": "1", "preflight_alone": "1"}
"""Column → unit of what a motor among others has besides: what its supervisor is shown of the others, and the outcome
of its own preflight, where ``preflight`` is that of all."""

SHARED: Mapping[str, str] = {"neighbour": "rad"}
"""Column → unit of what a motor that shares its joint has besides: the angle of another one, as its supervisor is shown
it."""


def columns_of_all(blocks: Mapping[str, Mapping[str, str]]) -> dict[str, str]:
    """Column → unit of a run.

    Args:
        blocks: name of a motor → column → unit of it alone, the first motor's first.

    >>> columns_of_all({"hip": {"time": "s", "joint": "rad"}, "knee": {"time": "s", "joint": "rad"}})
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


PATIENCE = 20
"""Cycles that the motors may need to begin to run, one after the other: a bridged reading keeps one back for 5."""
_UNDER_WAY = frozenset({Mode.RUNNING, Mode.BRIDGING})
_ON = _UNDER_WAY | {Mode.PREFLIGHT}
_OFF = frozenset({Mode.STOPPED, Mode.LATCHED})


class AxisCoordinator:
    """The motors of one run.

    Args:
        count: of them.
        independent: whether each goes alone.
    """

    def __init__(self, count: int, *, independent: bool) -> None:
        self._count, self._independent = count, independent
        self._apart = 0

    def asked(self, request: Request, modes: Sequence[Mode], faults: Sequence[int]) -> list[Request]:
        """What each supervisor is asked for in this cycle.

        Args:
            request: of the operator, for all.
            modes: of each motor after the cycle before.
            faults: that each had then, a sum of 2**fault.
        """
        if self._independent:
            return [request] * self._count
        if request == Request.ARM and not all(
            mode == Mode.STOPPED and not found for mode, found in zip(modes, faults, strict=True)
        ):
            request = Request.NONE
        if request == Request.RUN and any(mode != Mode.PREFLIGHT for mode in modes):
            request = Request.NONE
        on = [mode in _ON for mode in modes]
        apart = any(mode in _OFF for mode in modes) and any(on)
        asked = [request] * self._count
        if Mode.RUNNING in modes and Mode.PREFLIGHT in modes:
            self._apart += 1
            asked = [Request.RUN if mode == Mode.PREFLIGHT and request == Request.NONE else request for mode in modes]
        else:
            self._apart = 0
        if apart or self._apart > PATIENCE:
            asked = [Request.STOP if is_on else one for is_on, one in zip(on, asked, strict=True)]
        return asked

    def shown(self, latched: Sequence[int]) -> list[Reaction]:
        """What each supervisor is shown of the others: the worst reaction to their own faults.

        Args:
            latched: faults that each motor had latched after the cycle before, a sum of 2**fault.
        """
        if self._independent or not any(latched):
            return [Reaction.NONE] * self._count
        own = [shown_to_others(bits) for bits in latched]
        return [max((*own[:i], *own[i + 1 :])) for i in range(self._count)]

    def outcomes(self, alone: Sequence[PreflightResult]) -> list[PreflightResult]:
        """The outcome of the preflight that each supervisor is shown: failed as soon as one has, passed once all have.

        Args:
            alone: outcome of each motor's own.
        """
        return list(alone) if self._independent else [min(alone)] * self._count

    def over(self, done: Sequence[bool], modes: Sequence[Mode]) -> bool:
        """True if the run has come to its end: every motor that runs has, and one does.

        Args:
            done: whether each motor's script has.
            modes: of each motor after the cycle before.
        """
        led = [ended for ended, mode in zip(done, modes, strict=True) if mode in _UNDER_WAY]
        return Mode.RUNNING in modes and all(led) and (self._independent or len(led) == self._count)


_ORDER = (Mode.STOPPED, Mode.LATCHED, Mode.PREFLIGHT, Mode.RUNNING, Mode.BRIDGING, Mode.RELEASING)
_ALONE = (Mode.STOPPED, Mode.LATCHED, Mode.RELEASING, Mode.PREFLIGHT, Mode.RUNNING, Mode.BRIDGING)


def mode_of_all(modes: Sequence[float], *, independent: bool) -> Mode:
    """Where a run of several motors stands: the mode of the motor that is the furthest from having no power.

    >>> mode_of_all((5.0, 4.0), independent=False)
    <Mode.RELEASING: 4>
    >>> mode_of_all((4.0, 2.0), independent=True)
    <Mode.RUNNING: 2>
    """
    order = _ALONE if independent else _ORDER
    return max((Mode(int(mode)) for mode in modes), key=order.index)


def modes_of_all(modes: NDArray[np.float64], *, independent: bool) -> NDArray[np.float64]:
    """`mode_of_all` of many rows (n, motors)."""
    if modes.shape[1] == 1:
        return modes[:, 0]
    order = np.array(_ALONE if independent else _ORDER, dtype=np.float64)
    places = np.argsort(order)[np.nan_to_num(modes).astype(np.int64)]
    return order[places.max(axis=1)]


OF_ALL = ("mode", "faults", "reaction", "power", "preflight", "preflight_reason")
"""Columns that a row of several motors has for all of them."""


def of_all(rows: Sequence[Mapping[str, float]], *, independent: bool) -> dict[str, float]:
    """What stands for all motors in a row: the furthest mode, every fault, the worst reaction, the preflight of all.

    Args:
        rows: of each motor, by its columns without its name.
        independent: whether each goes alone.
    """
    if len(rows) == 1:
        return {name: rows[0][name] for name in OF_ALL}
    bits = functools.reduce(operator.or_, (int(row["faults"]) for row in rows))
    return {
        "mode": float(mode_of_all([row["mode"] for row in rows], independent=independent)),
        "faults": float(bits),
        "reaction": max(row["reaction"] for row in rows),
        "power": max(row["power"] for row in rows),
        "preflight": min(row["preflight"] for row in rows),
        "preflight_reason": next((row["preflight_reason"] for row in rows if row["preflight_reason"]), 0.0),
    }
