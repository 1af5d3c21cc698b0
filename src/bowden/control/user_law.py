"""A user's own law, from a Python file.

The file either defines a `Law` object, or the three parts of one: a NamedTuple ``Gains`` with a default for every
field, and the kernels ``start(gains, sample)`` and ``step(gains, state, sample, reference, dt)``; with them, if it
likes, ``FROM_RIG``, what its gains take from a rig (`Law.from_rig`), and ``TUNABLE``, which of them are a choice
(`Law.tunable`). What it defines is tried for a few cycles, interpreted, before anything is compiled, because Python's
messages name the line and a compiler's rarely do, and because compiled code that never returns cannot be ended.
Compiled code is kept under what it is made of (`bowden.core.kernel_cache`), so an edited law is never met by stale
code.
"""

import contextlib
import math
import re
import sys
from collections.abc import Iterator, Mapping
from enum import IntEnum
from itertools import pairwise
from pathlib import Path
from types import FrameType
from typing import Any

import numpy as np

from bowden.control.knowledge import Knowledge, informed
from bowden.control.law import FromRig, Law
from bowden.control.law_parts import LAG
from bowden.core import user_file
from bowden.core.errors import ParameterError, article, error_context
from bowden.core.nested import leaves, name_of
from bowden.core.own_file import OwnFile, split
from bowden.core.signals import Reference, Sample
from bowden.models.cable.bouc_wen import BoucWen

_CORRECT = "correct the law there"
_RENAME = "give it another name"
_TRIAL_CYCLES = 5
_TRIAL_TIME = 1e-3
_SWEEP = [0.02 * k for k in (*range(66), *range(66, -66, -1), *range(-66, 1))]
"""References through which a law must return, whatever it gives there: to 75°, to −75° and back [rad]."""
_MOST_LINES = 300_000
"""Lines of Python in one call of a law; so many, compiled, are no cycle's any more."""
_DISCRETE = (bool, np.bool_, IntEnum)
"""Types of a state that need not be float."""
_EXAMPLE = Knowledge(50.0, 1.0, 1.5e-3, 1e-3, 1.0, 0.1, 0.1, BoucWen(), 0.0, 1e-4, 1e-4, 1e-4, 1e-4)
"""Knowledge with which a law's own functions of it are tried, beside none."""


def is_file(name: str) -> bool:
    """True if a law is named by its file, ``my_law.py`` or ``my_law.py:NAME``, and not by its key in `LAWS`."""
    return split(name)[0].endswith(".py")


def load_file(file: OwnFile) -> Law:
    """The law in a file that has been read, by its name there; the only one if it has none.

    Raises:
        ParameterError: no such name, a mistake in the file (with its line), or something that is not a law.
    """
    path = Path(file.path)
    law, names = user_file.defined(file, Law, ("Gains", "start", "step"))
    found: Law = _of_parts(names, path) if law is None else law
    check_law(found, path)
    return found


@contextlib.contextmanager
def explained(law: Law) -> Iterator[None]:
    """Turn what goes wrong in a law's kernels into one line, with the line of the file where that is known.

    Raises:
        ParameterError: the law cannot be compiled, or a user's own fails while it runs interpreted.
    """
    with user_file.explained(Path(law.step_kernel.__code__.co_filename), f"the law {law.name!r}"):
        yield


def is_own(law: Law) -> bool:
    """True if a law is a user's own: its step is none of this package's."""
    return not user_file.is_package(Path(law.step_kernel.__code__.co_filename))


def refuse_no_number(law: Law, columns: Mapping[str, float], time: float) -> None:
    """Refuse what a user's own law gave `time` [s] after its start, where it is no number.

    Args:
        law: whose; of one of this package's nothing is said.
        columns: what it gave, by name.
        time: [s]

    Raises:
        ParameterError: the first such column, with the law's file and line.
    """
    for name, value in columns.items():
        if not math.isfinite(value) and is_own(law):
            where = user_file.line(law.step_kernel, Path(law.step_kernel.__code__.co_filename))
            raise ParameterError(
                f"{where}: the law {law.name!r} gave {value} for {name} at t = {time:.6g} s",
                expected="a finite number",
                do=_CORRECT,
            )


_BY_NAME: Mapping[str, FromRig] = {
    **{name: name for name in ("servo_frequency", "servo_damping", "delay")},
    **LAG,
}
"""Values from the rig for gains of these names in a file that has the parts of a law; its `FROM_RIG` says more."""


def _of_parts(names: Mapping[str, Any], path: Path) -> Law:
    gains = names["Gains"]
    more = names.get("FROM_RIG", {})
    by_name: dict[str, FromRig] = {
        name: what for name, what in _BY_NAME.items() if name in getattr(gains, "_fields", ())
    }
    with error_context(str(path)):
        return Law(
            path.stem,
            gains,
            names["start"],
            names["step"],
            source=str(path),
            from_rig={**by_name, **more} if isinstance(more, Mapping) else more,
            tunable=names.get("TUNABLE"),
        )


def check_law(law: Law, path: Path | None = None) -> None:
    """Try a law for a few cycles, as the loop will call it.

    Args:
        law: with its gains.
        path: the file that it stands in; the one of its `step` where it is not given.

    Raises:
        ParameterError: it is no law of numbers and kernels, or its step fails; with the file and line.
    """
    path = path or Path(law.step_kernel.__code__.co_filename)
    if not re.fullmatch(r"[A-Za-z0-9_.-]+", law.name):
        raise ParameterError(
            f"{path}: the law's name is {law.name!r}", expected="letters, digits, '_', '-' and '.'", do=_RENAME
        )
    user_file.check_kernels((law.start_kernel, law.step_kernel), path)
    _check_numbers(law.gains, "gains", str(path), whole=True)
    where = user_file.line(law.step_kernel, path)
    try:
        with error_context(str(path)):
            tried = [informed(law, known).gains for known in (Knowledge(), _EXAMPLE)]
    except ParameterError:
        raise
    except Exception as error:
        raise user_file.mistake(error, path) from error
    for gains in tried:
        _check_numbers(gains, "gains that come from the rig", str(path), whole=True)
    sample = Sample(0.01, 0.02)
    try:
        with _returning(law):
            state = law.start(sample)
        begun = state
        _check_state(state, "the state from start", user_file.line(law.start_kernel, path), begun)
        for k in range(_TRIAL_CYCLES):
            with _returning(law):
                answer = law.step(state, sample, Reference(0.1 + 1e-4 * k, 0.1, 0.0), _TRIAL_TIME)
            if not isinstance(answer, tuple) or len(answer) != 2:
                raise ParameterError(
                    f"{where}: step returns {answer!r}", expected="a pair, state and command", do=_CORRECT
                )
            if type(answer[0]) is not type(state):
                given, right = type(answer[0]).__name__, type(state).__name__
                raise ParameterError(
                    f"{where}: the state from step is {article(given)}",
                    expected=f"{article(right)}, as from start",
                    do=_CORRECT,
                )
            state, command = answer
            _check_state(state, "the state from step", where, begun)
            _check_number(command, "the command", where)
    except ParameterError:
        raise
    except Exception as error:
        raise user_file.mistake(error, path) from error
    try:
        for before, angle in pairwise(_SWEEP):
            speed = (angle - before) / _TRIAL_TIME
            with _returning(law), np.errstate(all="ignore"):
                state, _ = law.step(state, Sample(before, before), Reference(angle, speed, 0.0), _TRIAL_TIME)
    except ParameterError:
        raise
    except Exception:  # it need not be fit for angles that its rig does not reach
        return


@contextlib.contextmanager
def _returning(law: Law) -> Iterator[None]:
    """Refuse a law that does not return from one call, by the lines that it goes through: no clock is in this."""
    file, gone = law.step_kernel.__code__.co_filename, 0

    def line(frame: FrameType, _event: str, _arg: Any) -> Any:
        nonlocal gone
        gone += 1
        if gone <= _MOST_LINES:
            return line
        own: FrameType | None = frame
        while own is not None and own.f_code.co_filename != file:
            own = own.f_back
        at = frame if own is None else own
        raise ParameterError(
            f"{at.f_code.co_filename}:{at.f_lineno}: the law {law.name!r} does not return from one cycle: it has gone "
            f"through {_MOST_LINES} lines there",
            expected="a start and a step that end within a cycle",
            do=_CORRECT,
        )

    before = sys.gettrace()
    sys.settrace(line)
    try:
        yield
    finally:
        sys.settrace(before)


def _check_numbers(values: Any, what: str, where: str, *, whole: bool = False) -> None:
    if not hasattr(values, "_asdict"):
        raise ParameterError(
            f"{where}: {what} is {article(type(values).__name__)}", expected="a NamedTuple of floats", do=_CORRECT
        )
    for name, value in values._asdict().items():
        check = _check_numbers if isinstance(value, tuple) else _check_number
        check(value, f"{name} in {what}", where, whole=whole)


def _check_state(state: Any, what: str, where: str, begun: Any) -> None:
    """Finite floats, bools and members of enums, each of the kind that it was `begun` with: others do not compile."""
    if not hasattr(state, "_asdict"):
        raise ParameterError(
            f"{where}: {what} is {article(type(state).__name__)}", expected="a NamedTuple of floats", do=_CORRECT
        )
    for (path, value), (_, first) in zip(leaves(state), leaves(begun), strict=False):
        name = f"{name_of(path)} in {what}"
        if not isinstance(first, _DISCRETE):
            _check_number(value, name, where)
        elif not isinstance(value, bool | np.bool_ if isinstance(first, bool) else type(first)):
            raise ParameterError(
                f"{where}: {name} is {value!r} ({type(value).__name__})",
                expected=f"{article(type(first).__name__)}, as from start",
                do=_CORRECT,
            )


def _check_number(value: Any, what: str, where: str, *, whole: bool = False) -> None:
    """A finite float, or an int where `whole` allows it: a state that begins as an int would not compile."""
    if not (isinstance(value, float) or (whole and type(value) is int)):
        raise ParameterError(
            f"{where}: {what} is {value!r} ({type(value).__name__})", expected="a float, such as 0.0", do=_CORRECT
        )
    if not math.isfinite(value):
        raise ParameterError(f"{where}: {what} is {value}", expected="a finite number", do=_CORRECT)
