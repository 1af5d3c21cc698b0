"""Nested states and the flat rows they are kept in: one made of the other, by name.

A state is a NamedTuple of numbers and of further NamedTuples. A trace, a log, a replay and exported code need it flat:
`columns` names its numbers (``motor.speed``) and gives their units, `flat` gives them in that order, `unflatten`
makes the state again. Interpreted, compiled and while exporting it is the same order.

A unit is declared where the field is, ``speed: Annotated[float, Quantity(…, "rad/s")]``. A law of a user's file may
name units apart, by column or by the field's own name.

Compiled code cannot loop over a list of parameter sets whose type it does not know: a law's gains are whatever its
author made them. A row of numbers beside one example of the tuple can stand for each of them.
"""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Any, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from bowden.core.quantity import Quantity, declared

Array = NDArray[np.float64]

Path = tuple[str | int, ...]
"""Names of fields, and places in tuples without names, from the outside."""


def is_named(value: Any) -> bool:
    """True if a value is a NamedTuple."""
    return isinstance(value, tuple) and hasattr(value, "_fields")


def leaves(value: Any, path: Path = ()) -> Iterator[tuple[Path, Any]]:
    """Every number (or array) in nested tuples with the way to it, from left to right.

    >>> list(leaves((1.0, (2.0, 3.0))))
    [((0,), 1.0), ((1, 0), 2.0), ((1, 1), 3.0)]
    """
    if isinstance(value, tuple):
        names = value._fields if hasattr(value, "_fields") else range(len(value))
        for name, inner in zip(names, value, strict=True):
            yield from leaves(inner, (*path, name))
    else:
        yield path, value


def map_leaves(template: Any, replace: Callable[[Path, Any], Any], path: Path = ()) -> Any:
    """The same structure with what `replace` makes of each leaf."""
    if not isinstance(template, tuple):
        return replace(path, template)
    names: Iterable[str | int] = template._fields if hasattr(template, "_fields") else range(len(template))
    parts = [map_leaves(inner, replace, (*path, name)) for name, inner in zip(names, template, strict=True)]
    return type(template)(*parts) if hasattr(template, "_fields") else tuple(parts)


def name_of(path: Path) -> str:
    """A leaf's name.

    >>> name_of(("motor", "speed"))
    'motor.speed'
    """
    return ".".join(map(str, path))


def names(example: Any, prefix: str = "") -> list[str]:
    """The columns of a state, in their order: unique, and the same for every value of its type.

    >>> from bowden.core.signals import Reference
    >>> names(Reference(0.0, 0.0, 0.0), "law")
    ['law.position', 'law.velocity', 'law.acceleration']
    """
    return [name_of((prefix, *path) if prefix else path) for path, _ in leaves(example)]


def columns(example: Any, prefix: str = "", units: Mapping[str, str] | None = None) -> dict[str, str]:
    """Column → unit of a state: the unit that `units` has for it, by column or by field, its type's, or 1.

    Args:
        example: a state.
        prefix: put before each name, with a dot.
        units: column without the prefix, or the field's own name → unit.
    """
    apart = units or {}
    found = {}
    for path, _ in leaves(example):
        quantity, name = quantity_at(example, path), name_of(path)
        own = quantity.unit.replace("–", "1") if quantity else ""
        unit = apart.get(name) or apart.get(str(path[-1]) if path else "") or own or "1"
        found[f"{prefix}.{name}" if prefix and name else prefix or name] = unit
    return found


def quantity_at(value: Any, path: Path) -> Quantity | None:
    """How the innermost type on the way to a leaf declares its field; None where none does."""
    return innermost(value, path, lambda kind: {one.name: one.quantity for one in declared(kind)})


def innermost(value: Any, path: Path, of: Callable[[Any], Mapping[str, Any]]) -> Any:
    """What `of` has for a leaf, a type's fields each by its name, of the innermost type on the way; None of none."""
    found = None
    for step in path:
        if isinstance(step, str):
            found = of(type(value)).get(step, found)
            value = getattr(value, step)
        else:
            value = value[step]
    return found


def from_columns(example: Any, row: Mapping[str, float], prefix: str = "") -> Any:
    """The state like `example` that a row's columns have; what else is in the row is not looked at.

    >>> from bowden.core.signals import Reference
    >>> row = {"law.position": 1.0, "law.velocity": 2.0, "law.acceleration": 3.0, "time": 0.0}
    >>> from_columns(Reference(0.0, 0.0, 0.0), row, "law")
    Reference(position=1.0, velocity=2.0, acceleration=3.0)

    Raises:
        KeyError: a column is missing.
    """
    return map_leaves(example, lambda path, old: type(old)(row[name_of((prefix, *path) if prefix else path)]))


def flat(value: Any) -> tuple[Any, ...]:
    """The numbers of nested tuples in one tuple, in the order of `names`. Compiled, it is a primitive of kernels.

    >>> flat((1.0, (2.0, 3.0)))
    (1.0, 2.0, 3.0)
    """
    return tuple(leaf for _, leaf in leaves(value))


def numbers_of(value: Any) -> list[float]:
    """The numbers in nested tuples, from left to right; arrays among them are left out.

    >>> numbers_of((1.0, (2, 3.0)))
    [1.0, 2.0, 3.0]
    """
    return [float(leaf) for leaf in flat(value) if not isinstance(leaf, np.ndarray)]


def form_of(value: Any) -> tuple[Any, ...]:
    """Form that values share if one of them can be the template of the others: kinds of numbers, and arrays.

    >>> form_of((1.0, (2, 3.0)))
    (<class 'float'>, <class 'int'>, <class 'float'>)
    """
    return tuple((leaf.shape, leaf.tobytes()) if isinstance(leaf, np.ndarray) else type(leaf) for leaf in flat(value))


def unflatten(template: Any, row: Array) -> Any:
    """Nested tuples like `template` with the numbers of `row` (n,), each of the template's type.

    Arrays in the template stay. What is left of the row is not looked at. Compiled, it is a primitive of kernels.

    >>> unflatten((1.0, (2, 3.0)), np.array([4.0, 5.0, 6.0]))
    (4.0, (5, 6.0))
    """
    numbers = iter(row.tolist())
    return map_leaves(template, lambda _, old: old if isinstance(old, np.ndarray) else type(old)(next(numbers)))


def zeros_of(kind: Any) -> Any:
    """A value of a type with nothing but zeros in it; of an enum the member that is 0.

    >>> from typing import NamedTuple
    >>> class State(NamedTuple):
    ...     angle: float
    ...     steps: tuple[int, int]
    >>> zeros_of(State)
    State(angle=0.0, steps=(0, 0))
    """
    if get_origin(kind) is tuple:
        return tuple(map(zeros_of, get_args(kind)))
    if hasattr(kind, "_fields"):
        hints = get_type_hints(kind)
        return kind(*(zeros_of(hints[name]) for name in kind._fields))
    return kind(0)


def _number(kind: Any) -> Any:
    """The type of a leaf in compiled code; an enum's member is the whole number that it stands for."""
    return getattr(kind, "dtype", kind)


def _parts(kind: Any) -> list[Any]:
    """The types in a tuple's."""
    return list(kind)


def compiled_unflatten() -> Any:
    """`unflatten` for Numba, which unrolls the nesting while it compiles."""
    from numba.core import cgutils, types
    from numba.extending import intrinsic

    structure: Any = cgutils.create_struct_proxy  # untyped

    def filled(context: Any, builder: Any, kind: Any, old: Any, data: Any, at: list[int]) -> Any:
        if isinstance(kind, types.BaseTuple):
            inner = enumerate(_parts(kind))
            parts = [filled(context, builder, part, builder.extract_value(old, i), data, at) for i, part in inner]
            return context.make_tuple(builder, kind, parts)
        if isinstance(kind, types.Array):
            context.nrt.incref(builder, kind, old)
            return old
        place = builder.gep(data, [context.get_constant(types.intp, at[0])])
        at[0] += 1
        return context.cast(builder, builder.load(place), types.float64, _number(kind))

    @intrinsic
    def restore(typing: Any, template: Any, row: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            array = structure(signature.args[1])(context, builder, value=arguments[1])
            return filled(context, builder, template, arguments[0], array.data, [0])

        return template(template, row), generate

    return restore


def compiled_flat() -> Any:
    """`flat` for Numba: floats, so that compiled code may go through them by number."""
    from numba.core import types
    from numba.extending import intrinsic

    def numbers(context: Any, builder: Any, kind: Any, value: Any) -> list[Any]:
        if not isinstance(kind, types.BaseTuple):
            return [context.cast(builder, value, _number(kind), types.float64)]
        inner = [(part, builder.extract_value(value, i)) for i, part in enumerate(_parts(kind))]
        return [number for part, one in inner for number in numbers(context, builder, part, one)]

    def count(kind: Any) -> int:
        return sum(map(count, _parts(kind))) if isinstance(kind, types.BaseTuple) else 1

    @intrinsic
    def flatten(typing: Any, value: Any) -> Any:
        uniform: Any = types.UniTuple  # untyped
        made = uniform(types.float64, count(value))

        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return context.make_tuple(builder, made, numbers(context, builder, signature.args[0], arguments[0]))

        return made(value), generate

    return flatten
