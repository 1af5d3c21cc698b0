"""What compiled code is made of: a hash over the instructions, constants, types and callees of a kernel.

Two kernels of one hash compute the same. Numba's own cache looks at one file's time; an edit in a called function of
another file would run old code. So compiled code is named and kept by this hash (`bowden.core.kernel_cache`). It is
taken of what was loaded, not of the file, which may have changed since.
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
    """What code is made of is not known."""


def is_kernel(value: Any) -> TypeGuard[FunctionType]:
    """Whether a value is a function marked as a kernel."""
    return isinstance(value, FunctionType) and hasattr(value, "__kernel__")


def is_primitive(value: Any) -> bool:
    """Whether a value is one of `PRIMITIVES`."""
    return any(value is one for one in PRIMITIVES)  # not everything that can be called has a hash


def content_of(function: FunctionType, parts: Parts = ()) -> Content:
    """The hash of a function and of all that it calls, in which names of placeholders mean `parts`."""
    return _known(lambda: _function(function, parts))


def code_of(*functions: Callable[..., Any]) -> Content:
    """The hash of functions wherever they stand: the same in two files, or in a file that is loaded twice."""
    return _known(lambda: _digest(_value(one, frozenset(), (), places=False) for one in functions))


def content_of_types(kinds: Iterable[Any]) -> Content:
    """The hash of the types of arguments, as Numba has them.

    None for one of the main script: what is kept names a type by its module, but has a copy of one of the main
    script's, which is none of its own.
    """
    return _known(lambda: _digest(map(_kind, kinds)))


def _known(made: Callable[[], str]) -> Content:
    try:
        return made()
    except (_UnknownError, RecursionError):
        return None


@cache
def global_names(code: CodeType) -> tuple[str, ...]:
    """The names that code, and code within it, looks up outside of it, in alphabetical order."""
    steps = (step for inner in _codes(code) for step in dis.get_instructions(inner))
    return tuple(sorted({step.argval for step in steps if step.opname == "LOAD_GLOBAL"}))


def meant(function: FunctionType, name: str, replaced: Mapping[str, Callable[..., Any]]) -> Any:
    """What a function means by a global name: what it has there, or what replaces it where that is a placeholder."""
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
            value = meant(part, name, replaced)
            if is_kernel(value) and value not in seen:
                seen.add(value)
                todo.append(value)
    return frozenset(named)


@cache
def _function(function: FunctionType, parts: Parts, *, places: bool = True) -> str:
    name = _name(function, places=places)
    if _is_foreign(function):
        return name  # whose version is known
    replaced = dict(parts)
    attributes = frozenset(name for inner in _codes(function.__code__) for name in inner.co_names)

    def described(value: Any) -> str:
        return _value(value, attributes, parts, places=places)

    cells = [cell.cell_contents for cell in function.__closure__ or ()]
    names = global_names(function.__code__)
    return _digest(
        [
            f"{name} {hasattr(function, '__noinline__')}",
            *_code(function.__code__),
            *map(described, (*(function.__defaults__ or ()), *cells)),
            *(f"{name}={described(meant(function, name, replaced))}" for name in names),
        ]
    )


def _name(made: Any, *, places: bool) -> str:
    """The name of a function or type; without `places` that of a user's file is left out."""
    own = places or made.__module__.partition(".")[0] == __name__.partition(".")[0] or _is_foreign(made)
    return f"{made.__module__}.{made.__qualname__}" if own else str(made.__qualname__)


def _value(value: Any, attributes: frozenset[str], parts: Parts, *, places: bool = True) -> str:
    """A value that code names; of a module, what it has under the names of `attributes`."""
    if is_primitive(value):
        return f"primitive {value.__name__}"
    if isinstance(value, FunctionType):
        return _function(value, reaching(value, parts), places=places)
    if isinstance(inner := getattr(value, "py_func", None), FunctionType):  # compiled by its author
        return _digest(["compiled", _function(inner, (), places=places), str(getattr(value, "targetoptions", ""))])
    if isinstance(value, type):
        return _type(value, places=places)
    if isinstance(value, ModuleType):
        if _is_foreign(value):
            return value.__name__
        found = {name: getattr(value, name, None) for name in sorted(attributes)}
        return _digest(
            f"{name}={_value(inner, attributes, parts, places=places)}"
            for name, inner in found.items()
            if not isinstance(inner, FunctionType)  # of a module's functions, only compiled ones can be called
            and (not isinstance(inner, ModuleType) or inner.__name__.startswith(f"{value.__name__}."))
        )
    if isinstance(value, enum.Enum):
        return f"{_type(type(value), places=places)}.{value.name}"
    if isinstance(value, tuple):
        items = (_value(item, attributes, parts, places=places) for item in value)
        return _digest([_type(type(value), places=places), *items])
    if isinstance(value, np.ndarray):
        layout = (value.dtype.descr, value.shape, value.flags.c_contiguous, value.flags.f_contiguous)
        return _digest([f"array {layout}", hashlib.sha256(value.tobytes()).hexdigest()])
    if value is None or isinstance(value, str | bytes | int | float | complex | np.generic):
        return f"{type(value).__name__} {value!r}"
    if isinstance(value, np.dtype):
        return f"dtype {value.descr!r}"
    if isinstance(value, np.ufunc | BuiltinFunctionType) or (hasattr(value, "__name__") and _is_foreign(value)):
        return f"{type(value).__name__} {getattr(value, '__module__', '')}.{value.__name__}"
    raise _UnknownError


def _is_foreign(value: Any) -> bool:
    name = value.__name__ if isinstance(value, ModuleType) else value.__module__
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
        yield inner.co_code.hex()
        yield inner.co_exceptiontable.hex()
        yield repr((inner.co_argcount, inner.co_posonlyargcount, inner.co_kwonlyargcount, inner.co_flags))
        yield repr((inner.co_names, inner.co_varnames, inner.co_freevars, inner.co_cellvars))
        for constant in inner.co_consts:
            if not isinstance(constant, CodeType):
                yield repr(sorted(map(repr, constant)) if isinstance(constant, frozenset) else constant)


@cache
def _type(made: type, *, places: bool = True) -> str:
    """A type: its name, and the fields of a tuple with their defaults, or the members of an enum."""
    name = _name(made, places=places)
    if _is_foreign(made):
        return name
    if hasattr(made, "class_type"):  # a jitclass, whose methods are compiled with it
        raise _UnknownError
    if places and made.__module__ == "__main__" and issubclass(made, BaseException):
        raise _UnknownError  # kept as a whole, so that what is raised would be of another class
    fields: dict[str, Any] = {}
    if issubclass(made, tuple):
        fields = dict.fromkeys(getattr(made, "_fields", ())) | getattr(made, "_field_defaults", {})
    elif issubclass(made, enum.Enum):
        fields = {member.name: member.value for member in made}
    if places and fields and not _is_found(made):
        raise _UnknownError
    values = (f"{field}={_value(value, frozenset(), (), places=places)}" for field, value in fields.items())
    return _digest([name, *values])


def _is_found(made: type) -> bool:
    """Whether a type is found by its name, as a process must that reads what is kept."""
    found: Any = sys.modules.get(made.__module__)
    for part in made.__qualname__.split("."):
        found = getattr(found, part, None)
    return found is made


def _kind(kind: Any) -> str:
    """One of Numba's types: numbers, arrays, members of an enum, and tuples of these."""
    from numba.core import types

    if isinstance(kind, types.BaseTuple):
        inner: Any = list(kind)  # type: ignore[call-overload]  # tuples of types can be walked
        return _digest([_own(getattr(kind, "instance_class", tuple)), *map(_kind, inner)])
    if isinstance(kind, types.IntEnumMember):
        return _digest([_own(kind.instance_class), _kind(kind.dtype)])
    if isinstance(kind, types.Number | types.Boolean | types.Array | types.NoneType | types.Omitted):
        return str(kind.name)
    raise _UnknownError


def _own(made: type) -> str:
    if made.__module__ == "__main__":
        raise _UnknownError
    return _type(made)


def _digest(parts: Iterable[str]) -> str:
    digest = hashlib.sha256()
    for part in parts:
        digest.update(f"{len(part)}:{part}".encode())
    return digest.hexdigest()[:32]
