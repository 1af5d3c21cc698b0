"""Kernels: pure functions of numbers and NamedTuples that run interpreted, compiled and exported from one source.

``@kernel`` leaves the plain Python function in place, so that a call from Python, a debugger or a symbolic trace sees
ordinary code, and marks it; `compiled` gives its Numba twin, in which every kernel it names is compiled too. Numba is
imported only then. Compiled code is cached on disk in a folder named after a hash of the package's source, because
Numba's own cache does not notice when a function that another one calls has changed. Kernels from files outside the
package go to a folder of their own below it, named after those files' bytes, together with what they call: an edited
file is compiled anew, and two files never see one another's types. What has no file, or is the script itself, is
compiled in every process.
"""

import contextlib
import hashlib
import importlib
import math
import os
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any, TypeGuard, TypeVar

from bowden.core.refill import compiled_refilled, refilled

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


def _is_kernel(value: Any) -> TypeGuard[FunctionType]:
    return isinstance(value, FunctionType) and hasattr(value, "__kernel__")


def compiled(function: Callable[..., Any]) -> Callable[..., Any]:
    """The Numba twin of a kernel, compiled at its first call and cached on disk.

    Raises:
        TypeError: `function` is not a kernel.
    """
    if function in _PRIMITIVES:
        return _primitive(function)
    if not _is_kernel(function):
        raise TypeError(f"{function!r} is not a kernel; decorate it with @kernel")
    assert isinstance(function, FunctionType)
    return _compile(function, function.__qualname__, (), frozenset())


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
    return _compile(template, f"{template.__qualname__}_{name}_{_digest(parts)}", parts, frozenset())


def _digest(parts: "_Parts") -> str:
    told_apart = "|".join(f"{key}={part.__module__}.{part.__qualname__}" for key, part in parts)
    return hashlib.sha256(told_apart.encode()).hexdigest()[:8]


_Parts = tuple[tuple[str, Callable[..., Any]], ...]
"""Global names, and what to put there."""
_Files = frozenset[Path | None]
"""Files outside the package that compiled code depends on; None among them stands for code that no file tells."""


@cache
def _compile(function: FunctionType, name: str, replacements: _Parts, caller: _Files) -> Callable[..., Any]:
    """`caller`: the files of the code that calls this; its types may come in, so the two are cached together."""
    import numba

    files = caller | _outside(function)
    namespace = dict(function.__globals__) | dict(replacements)
    for key in function.__code__.co_names:
        value = namespace.get(key)
        if _is_kernel(value):
            inner = _reaching(value, replacements)
            told_apart = f"_{_digest(inner)}" if inner else ""
            namespace[key] = _compile(value, value.__qualname__ + told_apart, inner, files)
        elif callable(value) and value in _PRIMITIVES:
            namespace[key] = _primitive(value)
    twin = FunctionType(function.__code__, namespace, function.__name__, function.__defaults__, function.__closure__)
    twin.__qualname__, twin.__module__ = name, function.__module__
    files = files.union(*(_outside(part) for _, part in replacements))
    with _cache_at(files):
        dispatcher: Callable[..., Any] = numba.njit(cache=None not in files, **_NUMBA_OPTIONS)(twin)
    return dispatcher


@cache
def _outside(function: Callable[..., Any]) -> _Files:
    """The files outside the package that a kernel and the kernels it calls stand in.

    No file tells code typed at a prompt, functions made by other functions, and what stands in the script itself,
    whose types have another identity in each process.
    """
    files: set[Path | None] = set()
    for part in _called(function):
        file = Path(part.__code__.co_filename)
        local = bool(part.__closure__) or "<locals>" in part.__qualname__
        if not file.is_relative_to(Path(__file__).parents[1]) or local:
            files.add(None if local or part.__module__ == "__main__" or not file.is_file() else file)
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


@contextlib.contextmanager
def _cache_at(files: _Files) -> Iterator[None]:
    """Let Numba choose our folder while it decorates; other users of Numba in this process keep theirs."""
    config: Any = importlib.import_module("numba.core.config")  # its options come from a table, unseen by types
    before = config.CACHE_DIR
    contents = [file.read_bytes() for file in sorted(file for file in files if file)]
    part = hashlib.sha256(b"".join(contents)).hexdigest()[:16] if contents else ""
    config.CACHE_DIR = str(cache_folder() / part)
    try:
        yield
    finally:
        config.CACHE_DIR = before


@cache
def cache_folder() -> Path:
    """Where compiled code is kept: ``$BOWDEN_CACHE_DIR`` or the user's cache folder, then a hash of the source.

    Where that cannot be written (a read-only home), a folder in the system's temporary one that only this user can
    read and write, since what is cached is run; a fresh one if another user has taken its name.
    """
    try:
        root = os.environ.get("BOWDEN_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        folder = Path(root) / "bowden" / _source_hash()
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except (OSError, RuntimeError):  # RuntimeError: no home folder at all
        user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
        own = Path(tempfile.gettempdir()) / f"bowden-{user}"
        own.mkdir(mode=0o700, exist_ok=True)
        if hasattr(os, "getuid") and (own.stat().st_uid != os.getuid() or own.stat().st_mode & 0o077):
            own = Path(tempfile.mkdtemp(prefix="bowden-"))
        folder = own / _source_hash()
        folder.mkdir(exist_ok=True)
        return folder


def _source_hash() -> str:
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def sel(condition: Any, a: Any, b: Any) -> Any:
    """`a` where the condition holds, else `b`: the portable subset's ``if``. Both sides are always evaluated.

    Compound conditions are products: ``sel((x >= low) * (x <= high), x, refused)``.
    """
    kind = type(condition)
    if hasattr(kind, "__sel__"):
        return condition.__sel__(a, b)
    if kind.__module__.partition(".")[0] == "casadi":
        import casadi

        return casadi.if_else(condition, a, b)
    return a if condition else b


def _symbolic(value: Any) -> bool:
    """Whether a value stands for a number: a CasADi expression, or one of the exporter's, which has ``__sel__``."""
    kind = type(value)
    return hasattr(kind, "__sel__") or kind.__module__.partition(".")[0] == "casadi"


def _traced(name: str, arguments: tuple[Any, ...]) -> Any:
    for argument in arguments:
        if hasattr(type(argument), "__libm__"):
            return argument.__libm__(name, arguments)
    return arguments[0] ** arguments[1] if name == "power" else getattr(arguments[0], name)()


def _libm(name: str) -> Callable[..., Any]:
    reference = getattr(math, {"power": "pow"}.get(name, name))

    def function(*arguments: Any) -> Any:
        if any(_symbolic(argument) for argument in arguments):
            return _traced(name, arguments)
        try:
            return reference(*arguments)
        except (OverflowError, ValueError) as error:  # C returns an infinity or a NaN where Python raises
            if isinstance(error, ValueError) and not (name in ("log", "power") and arguments[0] == 0.0):
                return math.nan
            if name == "power" and arguments[1] % 2.0 == 1.0:  # an odd power keeps its base's sign, even a zero's
                return math.copysign(math.inf, arguments[0])
            return -math.inf if name == "log" else math.inf

    function.__name__ = function.__qualname__ = name
    function.__doc__ = f"``{name}`` of libm, interpreted and compiled; the symbolic function while exporting."
    return function


tanh = _libm("tanh")
exp = _libm("exp")
sin = _libm("sin")
cos = _libm("cos")
log = _libm("log")
power = _libm("power")

_PRIMITIVES: set[Callable[..., Any]] = {sel, tanh, exp, sin, cos, log, power, refilled}


@cache
def _primitive(function: Callable[..., Any]) -> Callable[..., Any]:
    import numba

    if function is sel:
        return numba.njit(**_NUMBA_OPTIONS)(_choose)
    if function is refilled:
        return compiled_refilled()
    if function is power:
        return numba.njit(**_NUMBA_OPTIONS)(_pow)
    return getattr(math, function.__name__)


def _choose(condition: Any, a: Any, b: Any) -> Any:
    return a if condition else b


def _pow(base: float, exponent: float) -> float:
    return math.pow(base, exponent)
