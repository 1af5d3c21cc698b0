"""Kernels: pure functions of numbers and NamedTuples that run interpreted, compiled and exported from one source.

``@kernel`` leaves the plain Python function in place, so that a call from Python, a debugger or a symbolic trace sees
ordinary code, and marks it; `compiled` gives its Numba twin, in which every kernel it names is compiled too. Numba is
imported only then. Compiled code is cached on disk (`bowden.core.kernel_cache`).
"""

import importlib
import sys
from collections.abc import Callable, Mapping
from functools import cache
from types import FunctionType
from typing import Any, TypeVar

from bowden.core.errors import ParameterError, near
from bowden.core.kernel_cache import Program, keep
from bowden.core.kernel_content import (
    Parts,
    circle,
    content_of,
    content_of_files,
    global_names,
    is_kernel,
    is_primitive,
    meant,
    reaching,
    stand_ins,
)
from bowden.core.primitives import PRIMITIVES, cos, exp, floor, log, power, sel, sin, sqrt, tanh, twin_of

__all__ = [
    "compiled",
    "cos",
    "exp",
    "floor",
    "kernel",
    "log",
    "power",
    "program",
    "sel",
    "sin",
    "specialise",
    "sqrt",
    "stand_in",
    "tanh",
]

F = TypeVar("F", bound=Callable[..., Any])

_NUMBA_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "forceinline": True}


def kernel(function: F) -> F:
    """Mark a pure function as a kernel; the function itself is returned unchanged.

    >>> @kernel
    ... def double(x: float) -> float:
    ...     return 2.0 * x
    >>> double(3.0), compiled(double)(3.0)
    (6.0, 6.0)

    Raises:
        ParameterError: what is no function.
    """
    if not isinstance(function, FunctionType):
        raise ParameterError(
            f"kernel: function is {function!r}",
            expected="a function",
            do="put @kernel on the line before its def",
        )
    function.__kernel__ = True  # type: ignore[attr-defined]  # functions take attributes; mypy has no type for it
    return function


def apart(function: F) -> F:
    """Mark a kernel that is not to be put into each place that calls it: a long one, beside which the call is nothing.

    What it computes is the same; whatever calls it is compiled in a fraction of the time.
    """
    function.__apart__ = True  # type: ignore[attr-defined]
    return kernel(function)


def stand_in(function: F) -> F:
    """Mark a kernel whose place `specialise` gives to another one.

    Only what is marked so is replaced: a law or a plant may have helpers of any name.
    """
    function.__stand_in__ = True  # type: ignore[attr-defined]
    return kernel(function)


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The Numba twin of a kernel, compiled at its first call and cached on disk.

    Raises:
        TypeError: `function` is not a kernel.
    """
    if function in PRIMITIVES:
        return _primitive(function, within=False)
    if not is_kernel(function):
        raise TypeError(f"{function!r} is not a kernel; decorate it with @kernel")
    return _compile(function, function.__qualname__, (), within=False)


def specialise(template: Callable[..., Any], name: str, **replacements: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a template in which stand-ins that it calls, or that the kernels call which it calls, are replaced.

    This is how one closed-loop source serves every law and plant and is still cached on disk: a closure over its
    kernels would be compiled again in every process. Variants are distinguished by the kernels they are made of.

    Args:
        template: a kernel.
        name: what to call this variant, for whoever reads a profile or the cache folder.
        replacements: name of a stand-in → kernel to put there.

    Raises:
        ParameterError: a name that no stand-in has which the template reaches.
    """
    assert isinstance(template, FunctionType)
    return _compile(template, f"{template.__qualname__}_{name}", _known(template, replacements), within=False)


def _known(template: FunctionType, replacements: Mapping[str, Callable[..., Any]]) -> Parts:
    """The replacements in order, each of which the template reaches."""
    parts = tuple(sorted(replacements.items()))
    there = stand_ins(template, parts)
    for part, _ in parts:
        if part not in there:
            raise ParameterError(
                f"specialise: {template.__qualname__} reaches no stand-in {part!r}",
                expected=near(part, sorted(there)),
                do="correct the name, or leave it out",
            )
    return parts


def reached(
    template: Callable[..., Any], replacements: Mapping[str, Callable[..., Any]]
) -> dict[str, Callable[..., Any]]:
    """Those replacements that a template reaches: of a set that is made for several templates."""
    there = stand_ins(template, tuple(sorted(replacements.items())))
    return {name: part for name, part in replacements.items() if name in there}


def program(template: Callable[..., Any], name: str = "", **replacements: Callable[..., Any]) -> Callable[..., Any]:
    """As `specialise`, or `compiled` without replacements, for what is called a few times and takes long.

    Where it is kept on disk it is called without Numba, whose import takes longer than most such calls
    (`bowden.core.native_code`). A call costs some microseconds more for every number in its arguments.
    """
    assert isinstance(template, FunctionType)
    whole = f"{template.__qualname__}_{name}" if name else template.__qualname__
    return _program(template, whole, _known(template, replacements))


@cache
def _program(function: FunctionType, name: str, parts: Parts) -> Callable[..., Any]:
    content = content_of(function, parts)
    if content is None or _COMPILING is None:
        return _compile(function, name, parts, within=False)
    return Program(
        name,
        f"{_COMPILING} {content}",
        bare=lambda: _dispatcher(function, name, parts, within=True),
        whole=lambda: _compile(function, name, parts, within=False),
    )


@cache
def _compile(function: FunctionType, name: str, parts: Parts, *, within: bool) -> Callable[..., Any]:
    """The Numba twin of a kernel in which global names stand for `parts`.

    One that is called `within` compiled code alone goes without what a call from Python needs: to take nested tuples
    apart and to put them together again is half of what there is to compile.
    """
    dispatcher = _dispatcher(function, name, parts, within=within)
    content = content_of(function, parts)
    if content is not None and _COMPILING is not None:
        keep(dispatcher, f"{_COMPILING} {content} {within}")
    return dispatcher


def _dispatcher(function: FunctionType, name: str, parts: Parts, *, within: bool) -> Callable[..., Any]:
    """`_compile`, of which nothing is kept but what it calls."""
    options = _NUMBA_OPTIONS | {"forceinline": not hasattr(function, "__apart__")}
    if within:
        options |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    dispatcher: Callable[..., Any] = _numba().njit(**options)(_twin(function, name, parts))
    return dispatcher


@cache
def _twin(function: FunctionType, name: str, parts: Parts) -> FunctionType:
    """A kernel that calls the twins of what it calls, named after its content.

    What differs has another name, in this process and in those that the cache's code came from.
    """
    if found := circle(function, parts):
        code = found[0].__code__
        raise ParameterError(
            f"{code.co_filename}, line {code.co_firstlineno}: the kernel {found[0].__name__!r} calls itself"
            + "".join(f", by {one.__name__!r}" for one in found[1:]),
            expected="kernels that call others",
            do="write it as a loop: for i in range(n)",
        )
    content = content_of(function, parts)
    namespace, replaced = dict(function.__globals__), dict(parts)
    for key in global_names(function.__code__):
        value = meant(function, key, replaced)
        if is_kernel(value):
            namespace[key] = _compile(value, value.__qualname__, reaching(value, parts), within=True)
        elif is_primitive(value):
            namespace[key] = _primitive(value, within=True)
    twin = FunctionType(function.__code__, namespace, function.__name__, function.__defaults__, function.__closure__)
    twin.__qualname__, twin.__module__ = f"{name}_{content[:16]}" if content else name, function.__module__
    return twin


@cache
def _numba() -> Any:
    """Numba with its array functions, but without SciPy, which takes a quarter of a second.

    Numba imports scipy.linalg only to know whether a kernel may multiply matrices. None of ours does; one of a user's
    that does finds SciPy, or is refused for want of it, when it is compiled.
    """
    import numba

    linalg: Any = importlib.import_module("numba.np.linalg")
    asked = getattr(linalg, "ensure_blas", None)
    if asked is None or "numba.np.arraymath" in sys.modules:
        return numba
    linalg.ensure_blas = lambda: None
    try:
        importlib.import_module("numba.np.arraymath")
    finally:
        linalg.ensure_blas = asked
    return numba


_COMPILING = content_of_files(
    __name__,
    "bowden.core.primitives",
    "bowden.core.nested",
    "bowden.core.kernel_cache",
    "bowden.core.native_code",
)
"""Of what decides how a kernel is compiled, whatever it is."""


@cache
def _primitive(function: Callable[..., Any], *, within: bool) -> Callable[..., Any]:
    twin = twin_of(function)
    if is_kernel(twin):  # one that calls primitives itself
        return _compile(twin, twin.__qualname__, (), within=within)
    return _numba().njit(**_NUMBA_OPTIONS)(twin) if isinstance(twin, FunctionType) else twin
