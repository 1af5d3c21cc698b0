"""A number that is not known yet: what a kernel is handed while it is traced.

A `Symbol` takes what the portable subset allows and adds it to a CasADi expression; all else it refuses, with the line
of the kernel that asked for it. A bare CasADi expression would not do: ``math.tanh`` of one is a silent NaN,
``np.where`` and ``np.clip`` pass, and so would what they mean to Numba and to C, which is not the same for NaN.
"""

import contextlib
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

import numpy as np

from bowden.core.errors import ParameterError, article

_HERE = Path(__file__).parent
_INSTEAD = {
    "where": "sel(condition, a, b)",
    "select": "sel(condition, a, b)",
    "clip": "np.fmax(low, np.fmin(high, x))",
    "maximum": "np.fmax",
    "max": "np.fmax",
    "minimum": "np.fmin",
    "min": "np.fmin",
    "round": "np.floor(x + 0.5)",
    "rint": "np.floor(x + 0.5)",
    "isnan": "x == x, which does not hold for NaN",
    "isfinite": "np.abs(x) < 1e9, which does not hold for NaN or infinity",
    "hypot": "np.sqrt(x * x + y * y)",
    "square": "x * x",
    **{name: f"{name}(x) of bowden.core.kernel" for name in ("tanh", "exp", "sin", "cos", "log")},
    **dict.fromkeys(("power", "float_power"), "power(x, y) of bowden.core.kernel"),
    **dict.fromkeys(("logical_and", "bitwise_and"), "a * b"),
    **dict.fromkeys(("logical_or", "bitwise_or"), "a + b > 0.0"),
    "logical_not": "1.0 - a",
}
"""NumPy's function → what a kernel takes in its place."""
_KERNELS = [_HERE.parent / "core" / name for name in ("kernel.py", "primitives.py")]


@dataclass(frozen=True)
class Place:
    """Where in the kernels an expression comes from."""

    order: int
    """Number among all expressions of the trace, in the order in which Python met them."""
    file: Path
    line: int
    function: str
    """Module and name, such as ``parts.bounded``."""


class KernelTrace:
    """Everything that was met while kernels were traced."""

    def __init__(self) -> None:
        self.casadi = casadi()
        self.places: dict[int, Place] = {}
        """Where a CasADi expression comes from, by its identity."""
        self.literals: dict[str, Symbol] = {}
        """Numbers that stand in the kernels, by their bits, so that a zero keeps its sign."""
        self.refused: ParameterError | None = None
        """The first thing that was refused, since a kernel may catch exceptions of its own."""
        self._kept: list[Symbol] = []  # an identity is an address, which must not be used twice

    def variable(self, name: str) -> "Symbol":
        """A new symbol."""
        symbol = Symbol(self, self.casadi.SX.sym(name))
        self._kept.append(symbol)
        return symbol

    def expression(self, sx: Any) -> "Symbol":
        """The result of an operation."""
        self.places.setdefault(sx.element_hash(), Place(len(self.places), *_line()))
        symbol = Symbol(self, sx)
        self._kept.append(symbol)
        return symbol

    def known(self, value: Any) -> "Symbol":
        """A number, or a symbol of this trace, as a symbol.

        Raises:
            ParameterError: it is neither.
        """
        if isinstance(value, Symbol):
            return value
        if not isinstance(value, bool | int | float | np.bool_ | np.number):
            self.refuse(f"{article(type(value).__name__)} as a number", "numbers, or a NamedTuple of numbers")
        key = float(value).hex()
        if key not in self.literals:
            self.literals[key] = self.variable(f"literal {key}")
        return self.literals[key]

    def refuse(self, what: str, instead: str) -> NoReturn:
        """Say that something cannot be exported, with the line that does it, and what a kernel takes in its place.

        Raises:
            ParameterError: always.
        """
        file, line, _ = _line()
        error = ParameterError(
            f"{file}, line {line}: {what} cannot be exported",
            expected="the portable subset of docs/kernels.md",
            do=f"use {instead}",
        )
        self.refused = self.refused or error
        raise error


def casadi() -> Any:
    """CasADi.

    Raises:
        ParameterError: it is not installed.
    """
    try:
        import casadi as found
    except ImportError as error:
        raise ParameterError(
            "the export needs CasADi, which is not installed", do='pip install "bowden[export]"'
        ) from error
    return found


@contextlib.contextmanager
def exactly() -> Iterator[None]:
    """CasADi without its simplifications while expressions are built: x·0 is not 0 where x may be NaN."""
    options = casadi().GlobalOptions
    before = options.getSimplificationOnTheFly()
    options.setSimplificationOnTheFly(False)
    try:
        yield
    finally:
        options.setSimplificationOnTheFly(before)


def _line() -> tuple[Path, int, str]:
    """The innermost line that is neither the exporter's nor NumPy's nor the kernels' own, and its function."""
    frame = sys._getframe(1)
    while frame.f_back is not None and not _kernels_own(frame.f_code.co_filename):
        frame = frame.f_back
    file = Path(frame.f_code.co_filename)
    return file, frame.f_lineno, f"{file.stem}.{frame.f_code.co_qualname}"


@cache
def _kernels_own(filename: str) -> bool:
    file = Path(filename)
    return file.parent != _HERE and file not in _KERNELS and "numpy" not in file.parts


def _binary(combine: Callable[[Any, Any], Any]) -> Callable[["Symbol", Any], "Symbol"]:
    def operation(self: "Symbol", other: Any) -> "Symbol":
        return self.trace.expression(combine(self.sx, self.trace.known(other).sx))

    return operation


def _reflected(combine: Callable[[Any, Any], Any]) -> Callable[["Symbol", Any], "Symbol"]:
    def operation(self: "Symbol", other: Any) -> "Symbol":
        return self.trace.expression(combine(self.trace.known(other).sx, self.sx))

    return operation


def _unary(apply: Callable[[Any], Any]) -> Callable[["Symbol"], "Symbol"]:
    return lambda self: self.trace.expression(apply(self.sx))


def _refused(what: str, instead: str) -> Any:
    def operation(self: "Symbol", *arguments: Any, **options: Any) -> NoReturn:
        self.trace.refuse(what, instead)

    return operation


def _in_place_of(function: str) -> str:
    return _INSTEAD.get(function, "one of its functions: np.abs, np.sqrt, np.floor, np.fmin, np.fmax, …")


_UFUNCS: dict[str, Callable[..., Any]] = {
    "add": lambda x, y: x + y,
    "subtract": lambda x, y: x - y,
    "multiply": lambda x, y: x * y,
    "divide": lambda x, y: x / y,
    "negative": lambda x: -x,
    "less": lambda x, y: x < y,
    "less_equal": lambda x, y: x <= y,
    "greater": lambda x, y: x > y,
    "greater_equal": lambda x, y: x >= y,
    "equal": lambda x, y: x == y,
    "not_equal": lambda x, y: x != y,
    "absolute": lambda x: casadi().fabs(x),
    "sqrt": lambda x: casadi().sqrt(x),
    "floor": lambda x: casadi().floor(x),
    "sign": lambda x: casadi().sign(x),
    "fmin": lambda x, y: casadi().fmin(x, y),
    "fmax": lambda x, y: casadi().fmax(x, y),
    "copysign": lambda x, y: casadi().copysign(x, y),
}
"""NumPy's functions of the subset, of CasADi's expressions; the operators are among them for NumPy's own numbers."""


class Symbol:
    """A number that is known only when the exported code runs."""

    __slots__ = ("sx", "trace")

    def __init__(self, trace: KernelTrace, sx: Any) -> None:
        self.trace = trace
        self.sx = sx

    def __sel__(self, a: Any, b: Any) -> "Symbol":
        """What `core.kernel.sel` makes of a condition; the emitter writes it as C's ``?:``."""
        a, b = self.trace.known(a), self.trace.known(b)
        return self.trace.expression(self.trace.casadi.if_else(self.sx, a.sx, b.sx))

    def __libm__(self, name: str, arguments: tuple[Any, ...]) -> "Symbol":
        """What the functions of `core.kernel` make of symbols."""
        numbers = [self.trace.known(argument).sx for argument in arguments]
        return self.trace.expression(numbers[0] ** numbers[1] if name == "power" else getattr(numbers[0], name)())

    def __array_ufunc__(self, ufunc: Any, method: str, *inputs: Any, **options: Any) -> "Symbol":
        if method != "__call__" or options or ufunc.__name__ not in _UFUNCS:
            self.trace.refuse(f"np.{ufunc.__name__}", _in_place_of(ufunc.__name__))
        return self.trace.expression(_UFUNCS[ufunc.__name__](*(self.trace.known(value).sx for value in inputs)))

    def __array_function__(self, function: Any, types: Any, arguments: Any, options: Any) -> NoReturn:
        self.trace.refuse(f"np.{function.__name__}", _in_place_of(function.__name__))

    __add__, __radd__ = _binary(_UFUNCS["add"]), _reflected(_UFUNCS["add"])
    __sub__, __rsub__ = _binary(_UFUNCS["subtract"]), _reflected(_UFUNCS["subtract"])
    __mul__, __rmul__ = _binary(_UFUNCS["multiply"]), _reflected(_UFUNCS["multiply"])
    __truediv__, __rtruediv__ = _binary(_UFUNCS["divide"]), _reflected(_UFUNCS["divide"])
    __lt__, __le__ = _binary(_UFUNCS["less"]), _binary(_UFUNCS["less_equal"])
    __gt__, __ge__ = _binary(_UFUNCS["greater"]), _binary(_UFUNCS["greater_equal"])
    __eq__ = _binary(_UFUNCS["equal"])  # type: ignore[assignment]  # a comparison of symbols is a symbol
    __ne__ = _binary(_UFUNCS["not_equal"])  # type: ignore[assignment]
    __neg__, __abs__ = _unary(_UFUNCS["negative"]), _unary(_UFUNCS["absolute"])

    __bool__ = _refused(
        "an if, while, and, or, not, min, max or chain of comparisons that depends on a value",
        "sel(condition, a, b) of bowden.core.kernel for a choice, a * b for and, np.fmin and np.fmax for min and max",
    )
    __float__ = _refused(
        "math.*, float() or another function of plain numbers of a value",
        "exp, sin, cos, log, power or tanh of bowden.core.kernel, np.sqrt, np.floor or np.abs",
    )
    __int__ = __index__ = _refused(
        "a loop, an index or an int() that depends on a value", "a loop of fixed length, with sel() in it"
    )
    __round__ = __floor__ = __ceil__ = __trunc__ = _refused("rounding of a value", "np.floor")
    __iter__ = __len__ = __getitem__ = _refused("taking a number apart", "a NamedTuple of numbers")
    __hash__ = _refused("looking a value up", "sel(condition, a, b) of bowden.core.kernel")
    __and__ = __rand__ = __or__ = __ror__ = __xor__ = __rxor__ = __invert__ = _refused(
        "& | ^ ~ of a value", "a * b for and, a + b > 0.0 for or"
    )
    __pow__ = __rpow__ = _refused("** of a value", "x * x, or power(x, y) of bowden.core.kernel")
    __floordiv__ = __rfloordiv__ = __mod__ = __rmod__ = __divmod__ = _refused(
        "// or % of a value", "np.floor(x / y), and x - y * np.floor(x / y)"
    )
    __array__ = _refused("an array of values", "a NamedTuple of numbers")
    __complex__ = _refused("complex()", "real numbers")
