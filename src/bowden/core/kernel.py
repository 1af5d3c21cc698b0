"""Kernels: pure functions of numbers and NamedTuples that run interpreted, compiled and exported from one source.

``@kernel`` leaves the plain Python function in place, so that a call from Python, a debugger or the exporter sees
ordinary code, and marks it; `compiled` gives its Numba twin, in which every kernel it names is compiled too. Numba is
imported only then. Compiled code is cached on disk (`bowden.core.kernel_cache`).
"""

from collections.abc import Callable, Mapping
from contextvars import ContextVar
from functools import cache
from types import FunctionType
from typing import Any, TypeVar

from bowden.core.errors import ParameterError, near
from bowden.core.kernel_content import (
    Parts,
    content_of,
    global_names,
    global_value,
    is_kernel,
    is_primitive,
    placeholders,
    reaching,
)
from bowden.core.primitives import PRIMITIVES, cos, exp, floor, log, power, sin, sqrt, tanh, twin_of

__all__ = [
    "compiled",
    "cos",
    "exp",
    "floor",
    "kernel",
    "log",
    "placeholder",
    "power",
    "sin",
    "specialise",
    "sqrt",
    "tanh",
]

F = TypeVar("F", bound=Callable[..., Any])


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


def noinline(function: F) -> F:
    """Mark a kernel that is not to be put into each place that calls it: a long one, beside which the call is nothing.

    What it computes is the same; whatever calls it is compiled in a fraction of the time.
    """
    function.__noinline__ = True  # type: ignore[attr-defined]
    return kernel(function)


def placeholder(function: F) -> F:
    """Mark a kernel whose place `specialise` gives to another one.

    Only what is marked so is replaced: a law or a plant may have helpers of any name.
    """
    function.__placeholder__ = True  # type: ignore[attr-defined]
    return kernel(function)


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The Numba twin of a kernel, compiled at its first call and cached on disk.

    Raises:
        TypeError: `function` is not a kernel.
    """
    if function in PRIMITIVES:
        return _primitive(function)
    if not is_kernel(function):
        raise TypeError(f"{function!r} is not a kernel; decorate it with @kernel")
    return _compile(function, function.__qualname__, (), within=False)


def specialise(template: Callable[..., Any], name: str, **replacements: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a template in which placeholders that it calls, or that the kernels call which it calls, are replaced.

    This is how one closed-loop source serves every law and plant and is still cached on disk: a closure over its
    kernels would be compiled again in every process. Variants are distinguished by the kernels they are made of.

    Args:
        template: a kernel.
        name: what to call this variant, for whoever reads a profile or the cache folder.
        replacements: name of a placeholder → kernel to put there.

    Raises:
        ParameterError: a name that no placeholder has which the template reaches.
    """
    assert isinstance(template, FunctionType)
    return _compile(template, f"{template.__qualname__}_{name}", _known(template, replacements), within=False)


def _known(template: FunctionType, replacements: Mapping[str, Callable[..., Any]]) -> Parts:
    """The replacements in order, each of which the template reaches."""
    parts = tuple(sorted(replacements.items()))
    there = placeholders(template, parts)
    for part, _ in parts:
        if part not in there:
            raise ParameterError(
                f"specialise: {template.__qualname__} reaches no placeholder {part!r}",
                expected=near(part, sorted(there)),
                do="correct the name, or leave it out",
            )
    return parts


def reached(
    template: Callable[..., Any], replacements: Mapping[str, Callable[..., Any]]
) -> dict[str, Callable[..., Any]]:
    """Those replacements that a template reaches: of a set that is made for several templates."""
    there = placeholders(template, tuple(sorted(replacements.items())))
    return {name: part for name, part in replacements.items() if name in there}


@cache
def _compile(function: FunctionType, name: str, parts: Parts, *, within: bool) -> Callable[..., Any]:
    """The Numba twin of a kernel in which names of placeholders mean `parts`.

    One that is called `within` compiled code alone goes without what a call from Python needs: to take nested tuples
    apart and to put them together again is half of what there is to compile.
    """
    options = {"forceinline": not hasattr(function, "__noinline__")}
    if within:
        options |= {"no_cpython_wrapper": True, "no_cfunc_wrapper": True}
    content = content_of(function, parts)
    twin = _twin(function, parts)
    # what differs has another name, in this process and in those that the cache's code came from
    twin.__qualname__, twin.__module__ = f"{name}_{content[:16]}" if content else name, function.__module__
    dispatcher = _njit(twin, **options)
    if content is not None:
        from bowden.core.kernel_cache import keep  # what only describes a rig compiles nothing

        keep(dispatcher, f"{function.__module__} {content} {within}")
    return dispatcher


_OPEN: ContextVar[tuple[FunctionType, ...]] = ContextVar("kernels", default=())
"""Kernels whose twins this thread is making, each called by the one before."""


def _twin(function: FunctionType, parts: Parts) -> FunctionType:
    """A kernel that calls the twins of what it calls.

    Raises:
        ParameterError: it calls itself.
    """
    above = _OPEN.get()
    if function in above:
        code, others = function.__code__, above[above.index(function) + 1 :]
        raise ParameterError(
            f"{code.co_filename}, line {code.co_firstlineno}: the kernel {function.__name__!r} calls itself"
            + "".join(f", by {one.__name__!r}" for one in others),
            expected="kernels that call others",
            do="write it as a loop: for i in range(n)",
        )
    token = _OPEN.set((*above, function))
    try:
        namespace, replaced = dict(function.__globals__), dict(parts)
        for key in global_names(function.__code__):
            value = global_value(function, key, replaced)
            if is_kernel(value):
                namespace[key] = _compile(value, value.__qualname__, reaching(value, parts), within=True)
            elif is_primitive(value):
                namespace[key] = _primitive(value)
    finally:
        _OPEN.reset(token)
    return FunctionType(function.__code__, namespace, function.__name__, function.__defaults__, function.__closure__)


def _njit(function: Callable[..., Any], **options: bool) -> Callable[..., Any]:
    import numba

    chosen: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "forceinline": True} | options
    made: Callable[..., Any] = numba.njit(**chosen)(function)
    return made


@cache
def _primitive(function: Callable[..., Any]) -> Callable[..., Any]:
    twin = twin_of(function)
    return _njit(twin) if isinstance(twin, FunctionType) else twin
