"""Content hash of compiled code, over the instructions, constants, types and callees of a kernel.

Two kernels of one hash compute the same, wherever they stand. It is taken of what was loaded, not of the file, which
may have changed since. Compiled code is kept by it (`bowden.core.kernel_cache`).
"""

import dis
import enum
import hashlib
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from types import BuiltinFunctionType, CodeType, FunctionType, ModuleType
from typing import Any, TypeGuard

import numpy as np

from bowden.core.primitives import PRIMITIVES

Content = str | None
"""A hash of what something is made of; None where that is not known."""

Parts = tuple[tuple[str, Callable[..., Any]], ...]
"""Names of placeholders, and the kernels to put there."""

_FOREIGN = ("builtins", "math", "numba", "numpy", "llvmlite")
"""Packages whose versions say what their functions do."""


class _UnknownError(Exception):
    """The content of a piece of code is not known."""


def is_kernel(value: Any) -> TypeGuard[FunctionType]:
    """True if a value is a function marked as a kernel."""
    return isinstance(value, FunctionType) and hasattr(value, "__kernel__")


def is_primitive(value: Any) -> bool:
    """True if a value is one of `PRIMITIVES`."""
    return isinstance(value, FunctionType) and value in PRIMITIVES


def content_of(function: Callable[..., Any], parts: Parts = ()) -> Content:
    """The hash of a function and of all that it calls, in which names of placeholders mean `parts`."""
    try:
        return _value(function, frozenset(), parts)
    except (_UnknownError, RecursionError):
        return None


def code_of(*functions: Callable[..., Any]) -> Content:
    """The hash of several functions."""
    found = [content_of(one) for one in functions]
    return None if None in found else _digest(map(str, found))


def content_of_types(kinds: Iterable[Any]) -> Content:
    """The hash of the types of arguments, as Numba has them; None of one that no other process finds by its name.

    One of the main script is such a type: what is kept has a copy of it, which is none of the script's own.
    """
    try:
        return _digest(map(_kind, kinds))
    except _UnknownError:
        return None


@cache
def global_names(code: CodeType) -> tuple[str, ...]:
    """The names that code, and code within it, looks up outside of it, in alphabetical order."""
    steps = (step for inner in _codes(code) for step in dis.get_instructions(inner))
    return tuple(sorted({step.argval for step in steps if step.opname == "LOAD_GLOBAL"}))


def global_value(function: FunctionType, name: str, replaced: Mapping[str, Callable[..., Any]]) -> Any:
    """The value of a global name in a function, or its replacement where that is a placeholder."""
    own = function.__globals__.get(name)
    return replaced.get(name, own) if hasattr(own, "__placeholder__") else own


@cache
def reaching(function: Callable[..., Any], parts: Parts) -> Parts:
    """Those parts that a kernel names, or that the kernels name which it calls, parts among them."""
    named = placeholders(function, parts)
    return tuple(part for part in parts if part[0] in named)


@cache
def placeholders(function: Callable[..., Any], parts: Parts) -> frozenset[str]:
    """The placeholders that a kernel names, or that the kernels name which it calls, parts among them."""
    replaced, named = dict(parts), set()
    todo, seen = [function], {function}
    while todo:
        part = todo.pop()
        if not is_kernel(part):
            continue
        for name in global_names(part.__code__):
            if hasattr(part.__globals__.get(name), "__placeholder__"):
                named.add(name)
            value = global_value(part, name, replaced)
            if is_kernel(value) and value not in seen:
                seen.add(value)
                todo.append(value)
    return frozenset(named)


@cache
def _function(function: FunctionType, parts: Parts) -> str:
    code, replaced, names = function.__code__, dict(parts), global_names(function.__code__)
    attributes = frozenset(name for inner in _codes(code) for name in inner.co_names)
    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    values = (*(function.__defaults__ or ()), *cells, *(global_value(function, name, replaced) for name in names))
    marked = f"{function.__qualname__} {hasattr(function, '__noinline__')}"
    return _digest([marked, *_code(code), *names, *(_value(value, attributes, parts) for value in values)])


def _value(value: Any, attributes: frozenset[str], parts: Parts) -> str:
    """A value that code names; of a module, what it has under the names of `attributes`."""
    if is_primitive(value):
        return f"primitive {value.__name__}"
    if isinstance(value, ModuleType | type | FunctionType | BuiltinFunctionType | np.ufunc) and _is_foreign(value):
        return f"{getattr(value, '__module__', '')}.{value.__name__}"
    if isinstance(value, FunctionType):
        return _function(value, reaching(value, parts))
    if isinstance(inner := getattr(value, "py_func", None), FunctionType):  # compiled by its author
        return _digest(["compiled", _function(inner, ()), str(getattr(value, "targetoptions", ""))])
    if isinstance(value, type):
        return _type(value)
    if isinstance(value, ModuleType):
        found = {name: getattr(value, name, None) for name in sorted(attributes)}
        return _digest(
            f"{name}={_value(inner, attributes, parts)}"
            for name, inner in found.items()
            if not isinstance(inner, FunctionType)  # of a module's functions, only compiled ones can be called
            and (not isinstance(inner, ModuleType) or inner.__name__.startswith(f"{value.__name__}."))
        )
    if isinstance(value, enum.Enum):
        return f"{_type(type(value))}.{value.name}"
    if isinstance(value, tuple):
        return _digest([_type(type(value)), *(_value(item, attributes, parts) for item in value)])
    if isinstance(value, np.ndarray):
        layout = (value.dtype.descr, value.shape, value.flags.c_contiguous, value.flags.f_contiguous)
        return _digest([f"array {layout}", hashlib.sha256(value.tobytes()).hexdigest()])
    if value is None or isinstance(value, str | bytes | int | float | complex | np.generic | np.dtype):
        return f"{type(value).__name__} {value!r}"
    if hasattr(value, "__name__") and _is_foreign(value):
        return f"{value.__module__}.{value.__name__}"
    raise _UnknownError


def _is_foreign(value: Any) -> bool:
    name = value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", "numpy")
    if name is None:  # made of a text, in no module
        raise _UnknownError
    return name.partition(".")[0] in _FOREIGN


def _codes(code: CodeType) -> Iterator[CodeType]:
    yield code
    for constant in code.co_consts:
        if isinstance(constant, CodeType):
            yield from _codes(constant)


def _code(code: CodeType) -> Iterator[str]:
    """Instructions, constants and names of code; where it stands in its file is left out."""
    for inner in _codes(code):
        yield f"{inner.co_code.hex()} {inner.co_exceptiontable.hex()}"
        yield repr((inner.co_argcount, inner.co_posonlyargcount, inner.co_kwonlyargcount, inner.co_flags))
        yield repr((inner.co_names, inner.co_varnames, inner.co_freevars, inner.co_cellvars))
        for constant in inner.co_consts:
            if not isinstance(constant, CodeType):
                yield repr(sorted(map(repr, constant)) if isinstance(constant, frozenset) else constant)


@cache
def _type(made: type) -> str:
    """A type: its name, and the fields of a tuple with their defaults, or the members of an enum."""
    if _is_foreign(made):
        return f"{made.__module__}.{made.__qualname__}"
    if hasattr(made, "class_type"):  # a jitclass, whose methods are compiled with it
        raise _UnknownError
    if made.__module__ == "__main__" and issubclass(made, BaseException):
        raise _UnknownError  # kept as a whole, so that what is raised would be of another class
    fields: dict[str, Any] = {}
    if issubclass(made, tuple):
        fields = dict.fromkeys(getattr(made, "_fields", ())) | getattr(made, "_field_defaults", {})
    elif issubclass(made, enum.Enum):
        fields = {member.name: member.value for member in made}
    return _digest([made.__qualname__, *(f"{name}={_value(one, frozenset(), ())}" for name, one in fields.items())])


def _kind(kind: Any) -> str:
    """One of Numba's types: numbers, arrays, members of an enum, and tuples of these."""
    from numba.core import types

    if isinstance(kind, types.BaseTuple):
        inner: Any = list(kind)  # type: ignore[call-overload]  # tuples of types can be walked
        return _digest([_found(getattr(kind, "instance_class", tuple)), *map(_kind, inner)])
    if isinstance(kind, types.IntEnumMember):
        return _digest([_found(kind.instance_class), _kind(kind.dtype)])
    if isinstance(kind, types.Number | types.Boolean | types.Array | types.NoneType | types.Omitted):
        return str(kind.name)
    raise _UnknownError


def _found(made: type) -> str:
    """The name and content of a type that a process which reads what is kept finds by that name."""
    found: Any = None if made.__module__ == "__main__" else sys.modules.get(made.__module__)
    for part in made.__qualname__.split("."):
        found = getattr(found, part, None)
    if found is not made:
        raise _UnknownError
    return f"{made.__module__} {_type(made)}"


def _digest(parts: Iterable[str]) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(f"{len(part)}:{part}".encode())
    return digest.hexdigest()[:32]
