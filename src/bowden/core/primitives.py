"""What kernels call that is no kernel: functions of libm, and a tanh of our own.

Each is an ordinary function when it is called from Python, and has a twin for compiled code. One that has bits of its
own, whatever the C library, is of use twice: compiled and exported it stands in line, and its result on a
microcontroller is Python's.
"""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from bowden.core.nested import (
    compiled_flat,
    compiled_unflatten,
    compiled_unflatten_like,
    flat,
    unflatten,
    unflatten_like,
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


def floor(x: Any) -> Any:
    """The largest whole number that is not above x, as a float; NaN and infinities stay what they are."""
    return float(np.floor(x))


TANH = {
    "most": 20.0,  # tanh is 1 in double from 19.07 on
    "per_piece": 2.0 / math.log(2.0),
    "high": float.fromhex("0x1.62e42fee00000p-2"),  # ln 2/2, cut so that its product with k is exact, …
    "low": float.fromhex("0x1.a39ef35793c76p-34"),  # … and the rest
    "shift": 1.5 * 2.0**52,  # a sum with it has the whole number next to the other term in its last bits
    "p1": 0.11109938059851718,
    "p2": 0.0010574195870983604,
    "q1": 0.44443271393184475,
    "q2": 0.0158683242329108,
    "r1": 0.11109938059851718 - 0.44443271393184475,
    "r2": 0.0010574195870983604 - 0.0158683242329108,
}
"""Constants of `tanh`: P and Q are the rational of their degrees, 1 at 0, whose relative error is smallest for
|b| ≤ ln 2/4, 5e-18; R = (P − Q)/b²."""

_MOST, _PER_PIECE, _HIGH, _LOW, _SHIFT, _P1, _P2, _Q1, _Q2, _R1, _R2 = TANH.values()


def tanh(x: Any) -> Any:
    """The hyperbolic tangent, to within 2 units in the last place, with the same bits on every machine.

    In a compiled loop it takes a fraction of the C library's time.

    >>> tanh(0.0), tanh(math.inf), round(tanh(-0.5), 12)
    (0.0, 1.0, -0.46211715726)
    """
    return _tanh(float(x))


def _tanh(x: float) -> float:
    """With |x| = k·ln 2/2 + b, k whole and |b| ≤ ln 2/4, tanh b = b·P(b²)/Q(b²), and the theorem of addition:

        c = tanh(k·ln 2/2) = u/v,  u = 1 − 2⁻ᵏ,  v = 1 + 2⁻ᵏ
        tanh |x| = c + (1 − c²)·tanh b/(1 + c·tanh b) = c + (1 − c²)·(b + b·(v·b²·R − u·bP)/(v·Q + u·bP))

    The last form rounds little, is x itself where x is small, and its two divisions need not wait for one another: a
    law's next command does.
    """
    size = abs(x)
    near = _MOST if size > _MOST else size
    k = (near * _PER_PIECE + _SHIFT) - _SHIFT
    b = (near - k * _HIGH) - k * _LOW
    s, square = half_to(k), b * b
    u, v, fourth = 1.0 - s, 1.0 + s, square * square
    c = u / v
    p = u * b * (1.0 + square * _P1 + fourth * _P2)
    q = v * (1.0 + square * _Q1 + fourth * _Q2)
    r = v * (square * _R1 + fourth * _R2)
    return math.copysign(c + (1.0 - c * c) * (b + b * ((r - p) / (q + p))), x)


_tanh.__kernel__ = True  # type: ignore[attr-defined]  # as `core.kernel.kernel` does, which calls this module


def half_to(k: float) -> float:
    """2⁻ᵏ for a whole k from −1023 to 1022; of a NaN, anything. A part of `tanh`, which laws cannot call.

    >>> half_to(3.0)
    0.125
    """
    return math.ldexp(1.0, -int(k)) if k == k else k


PRIMITIVES: set[Callable[..., Any]] = {
    *(tanh, exp, sin, cos, log, power, sqrt, floor, half_to, unflatten_like, unflatten, flat),
}


def twin_of(function: Callable[..., Any]) -> Callable[..., Any]:
    """What stands for a primitive in compiled code: a plain function to be compiled, or what Numba knows."""
    for primitive, made in (
        (unflatten_like, compiled_unflatten_like),
        (unflatten, compiled_unflatten),
        (flat, compiled_flat),
    ):
        if function is primitive:
            return made()
    if function is half_to:
        return _compiled_half_to()
    plain: dict[Callable[..., Any], Callable[..., Any]] = {power: _pow, tanh: _tanh, floor: floor}
    return plain[function] if function in plain else getattr(math, function.__name__)


def _pow(base: float, exponent: float) -> float:
    return math.pow(base, exponent)


def _compiled_half_to() -> Any:
    """The last bits of 1.5·2⁵² + 1023 − k are the exponent of 2⁻ᵏ; here they are shifted to its place."""
    from llvmlite import ir
    from numba.core import types
    from numba.extending import intrinsic

    @intrinsic
    def half_to(typing: Any, k: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            double, whole = ir.DoubleType(), ir.IntType(64)
            shifted = builder.fsub(ir.Constant(double, _SHIFT + 1023.0), arguments[0])
            bits = builder.shl(builder.bitcast(shifted, whole), ir.Constant(whole, 52))
            return builder.bitcast(bits, double)

        return types.float64(types.float64), generate

    return half_to
