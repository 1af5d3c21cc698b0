"""Kernels: pure functions of numbers and NamedTuples that run interpreted, compiled and exported from one source.

``@kernel`` leaves the plain Python function in place, so that a call from Python, a debugger or a symbolic trace sees
ordinary code, and marks it; `compiled` gives its Numba twin, in which every kernel it names is compiled too. Numba is
imported only then. Compiled code is cached on disk (`bowden.core.kernel_cache`).
"""

import hashlib
import importlib
import sys
from collections.abc import Callable
from functools import cache
from types import FunctionType, ModuleType
from typing import Any, TypeGuard, TypeVar

import numpy as np

from bowden.core.kernel_cache import Files, file_of, file_of_type, keep, number_of
from bowden.core.primitives import PRIMITIVES, cos, exp, log, power, sel, sin, tanh, twin_of

__all__ = ["compiled", "cos", "exp", "kernel", "log", "power", "sel", "sin", "specialise", "tanh"]

F = TypeVar("F", bound=Callable[..., Any])

_NUMBA_OPTIONS: dict[str, Any] = {"error_model": "numpy", "fastmath": False, "forceinline": True}


def kernel(function: F) -> F:
    """Mark a pure function as a kernel; the function itself is returned unchanged.

    >>> @kernel
    ... def double(x: float) -> float:
    ...     return 2.0 * x
    >>> double(3.0), compiled(double)(3.0)
    (6.0, 6.0)
    """
    function.__kernel__ = True  # type: ignore[attr-defined]  # functions take attributes; mypy has no type for it
    return function


def apart(function: F) -> F:
    """Mark a kernel that is not to be put into each place that calls it: a long one, beside which the call is nothing.

    What it computes is the same; whatever calls it is compiled in a fraction of the time.
    """
    function.__apart__ = True  # type: ignore[attr-defined]
    return kernel(function)


def _is_kernel(value: Any) -> TypeGuard[FunctionType]:
    return isinstance(value, FunctionType) and hasattr(value, "__kernel__")


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The Numba twin of a kernel, compiled at its first call and cached on disk.

    Raises:
        TypeError: `function` is not a kernel.
    """
    if function in PRIMITIVES:
        return _primitive(function)
    if not _is_kernel(function):
        raise TypeError(f"{function!r} is not a kernel; decorate it with @kernel")
    assert isinstance(function, FunctionType)
    return _compile(function, function.__qualname__, ())


def specialise(template: Callable[..., Any], name: str, **replacements: Callable[..., Any]) -> Callable[..., Any]:
    """Compile a template in which some of the kernels it calls by global name are replaced by others.

    This is how one closed-loop source serves every law and plant and is still cached on disk: a closure over its
    kernels would be compiled anew in every process. Variants are told apart by the kernels they are made of.

    Args:
        template: a kernel.
        name: what to call this variant, for whoever reads a profile or the cache folder.
        replacements: global name → kernel to put there, in the template and in the kernels that it calls.
    """
    assert isinstance(template, FunctionType)
    parts = tuple(sorted(replacements.items()))
    return _compile(template, f"{template.__qualname__}_{name}_{_digest(parts)}", parts)


def _digest(parts: "_Parts") -> str:
    told_apart = "|".join(f"{key}={part.__module__}.{part.__qualname__}" for key, part in parts)
    return hashlib.sha256(told_apart.encode()).hexdigest()[:8]


_Parts = tuple[tuple[str, Callable[..., Any]], ...]
"""Global names, and what to put there."""


@cache
def _compile(function: FunctionType, name: str, replacements: _Parts) -> Callable[..., Any]:
    numba = _numba()
    namespace = dict(function.__globals__) | dict(replacements)
    for key in function.__code__.co_names:
        value = namespace.get(key)
        if _is_kernel(value):
            inner = _reaching(value, replacements)
            told_apart = f"_{_digest(inner)}" if inner else ""
            namespace[key] = _compile(value, value.__qualname__ + told_apart, inner)
        elif callable(value) and value in PRIMITIVES:
            namespace[key] = _primitive(value)
    twin = FunctionType(function.__code__, namespace, function.__name__, function.__defaults__, function.__closure__)
    twin.__qualname__, twin.__module__ = name, function.__module__
    options = _NUMBA_OPTIONS | {"forceinline": not hasattr(function, "__apart__")}
    dispatcher: Callable[..., Any] = numba.njit(**options)(twin)
    keep(dispatcher, _files(function).union(*(_files(part) for _, part in replacements)))
    return dispatcher


@cache
def _numba() -> Any:
    """Numba with its array functions, but without SciPy, which takes a quarter of a second.

    Numba imports scipy.linalg only to know whether a kernel may multiply matrices; that SciPy is there, we know. What a
    kernel calls of it is found when such a kernel is compiled.
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


_COMPILING = (__name__, "bowden.core.primitives", "bowden.core.nested")
"""Modules that decide how a kernel is compiled, whatever it is."""


@cache
def _files(function: Callable[..., Any]) -> Files:
    """What a kernel and the kernels it calls are made of: their files, those of the types that they make, and numbers.

    A number may have come from a further file, and is compiled in. No file tells code typed at a prompt, functions made
    by other functions, and what stands in the script itself, whose types have another identity in each process.
    """
    files: set[str | None] = set()
    for module in _COMPILING:
        files |= file_of(getattr(sys.modules.get(module), "__file__", None), module)
    for part in _called(function):
        if part.__closure__ or "<locals>" in part.__qualname__:
            files.add(None)
            continue
        files |= file_of(part.__code__.co_filename, part.__module__)
        for key in sorted(set(part.__code__.co_names)):
            value = part.__globals__.get(key)
            if isinstance(value, type):
                files |= file_of_type(value)
            elif isinstance(value, ModuleType) and value.__name__.startswith("bowden."):
                files |= file_of(value.__file__, value.__name__)
            elif isinstance(value, int | float | tuple | np.ndarray):
                files.add(number_of(key, value))
    return frozenset(files)


@cache
def _called(function: Callable[..., Any]) -> frozenset[FunctionType]:
    """A kernel and the kernels that it calls, and these call."""
    assert isinstance(function, FunctionType)
    seen: set[FunctionType] = {function}
    todo: list[FunctionType] = [function]
    while todo:
        part = todo.pop()
        named = [part.__globals__.get(key) for key in part.__code__.co_names]
        called: set[FunctionType] = {value for value in named if _is_kernel(value)} - seen
        todo += called
        seen |= called
    return frozenset(seen)


def _reaching(function: FunctionType, replacements: _Parts) -> _Parts:
    """Those replacements that a kernel names, or that the kernels name which it calls, replaced ones among them."""
    named: set[str] = set()
    todo: list[Callable[..., Any]] = [function]
    while todo:
        new = {key for part in _called(todo.pop()) for key in part.__code__.co_names} - named
        todo += [part for key, part in replacements if key in new]
        named |= new
    return tuple(part for part in replacements if part[0] in named)


@cache
def _primitive(function: Callable[..., Any]) -> Callable[..., Any]:
    numba = _numba()
    twin = twin_of(function)
    if _is_kernel(twin):  # one that calls primitives itself
        return _compile(twin, twin.__qualname__, ())
    return numba.njit(**_NUMBA_OPTIONS)(twin) if isinstance(twin, FunctionType) else twin
