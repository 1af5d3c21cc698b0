"""Functions that kernels call and that are no kernels: those of libm, and those between nested tuples and rows.

Each is an ordinary function when it is called from Python, and has a twin for compiled code.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from bowden.core.nested import (
    compiled_flat,
    compiled_unflatten,
    flat,
    unflatten,
)


def _libm(name: str) -> Callable[..., Any]:
    reference = getattr(math, {"power": "pow"}.get(name, name))

    def function(*arguments: Any) -> Any:
        try:
            return reference(*arguments)
        except (OverflowError, ValueError) as error:  # C returns an infinity or a NaN where Python raises
            if isinstance(error, ValueError) and not (name in ("log", "power") and arguments[0] == 0.0):
                return math.nan
            if name == "power" and arguments[1] % 2.0 == 1.0:  # an odd power keeps its base's sign, even a zero's
                return math.copysign(math.inf, arguments[0])
            return -math.inf if name == "log" else math.inf

    function.__name__ = function.__qualname__ = name
    function.__doc__ = f"``{name}`` of libm, interpreted, compiled and exported."
    return function


exp = _libm("exp")
sin = _libm("sin")
cos = _libm("cos")
log = _libm("log")
power = _libm("power")
sqrt = _libm("sqrt")
tanh = _libm("tanh")


def floor(x: Any) -> Any:
    """The largest whole number that is not above x, as a float; NaN and infinities stay what they are."""
    return float(np.floor(x))


PRIMITIVES: set[Callable[..., Any]] = {
    *(exp, sin, cos, log, power, sqrt, tanh, floor),
    *(unflatten, flat),
}


def twin_of(function: Callable[..., Any]) -> Callable[..., Any]:
    """Counterpart of a primitive in compiled code: a plain function to be compiled, or one that Numba knows."""
    made: dict[Callable[..., Any], Callable[[], Any]] = {
        unflatten: compiled_unflatten,
        flat: compiled_flat,
        power: lambda: _pow,
        floor: lambda: floor,
    }
    return made[function]() if function in made else getattr(math, function.__name__)


def _pow(base: float, exponent: float) -> float:
    return math.pow(base, exponent)
