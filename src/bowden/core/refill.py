"""Numbers in a row and the nested NamedTuples that kernels take, one made of the other.

Compiled code cannot loop over a list of parameter sets whose type it does not know: a law's gains are whatever its
author made them. A row of numbers beside one example of the tuple can stand for each of them.
"""

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def numbers_of(value: Any) -> list[float]:
    """The numbers in nested tuples, from left to right; arrays among them are left out.

    >>> numbers_of((1.0, (2, 3.0)))
    [1.0, 2.0, 3.0]
    """
    return [float(leaf) for leaf in _leaves(value, []) if not isinstance(leaf, np.ndarray)]


def form_of(value: Any) -> tuple[Any, ...]:
    """What values must have in common for one of them to be the template of the others: kinds of numbers, and arrays.

    >>> form_of((1.0, (2, 3.0)))
    (<class 'float'>, <class 'int'>, <class 'float'>)
    """
    return tuple(
        (leaf.shape, leaf.tobytes()) if isinstance(leaf, np.ndarray) else type(leaf) for leaf in _leaves(value, [])
    )


def _leaves(value: Any, found: list[Any]) -> list[Any]:
    if isinstance(value, tuple):
        for part in value:
            _leaves(part, found)
    else:
        found.append(value)
    return found


def refilled(template: Any, row: Array) -> Any:
    """Nested tuples like `template` with the numbers of `row` (n,), whole ones where the template has whole ones.

    Arrays in the template stay. What is left of the row is not looked at. Compiled, it is a primitive of kernels.

    >>> refilled((1.0, (2, 3.0)), np.array([4.0, 5.0, 6.0]))
    (4.0, (5, 6.0))
    """
    return _taken(template, iter(row.tolist()))


def _taken(template: Any, numbers: Any) -> Any:
    if isinstance(template, tuple):
        parts = [_taken(part, numbers) for part in template]
        return type(template)(*parts) if hasattr(template, "_fields") else tuple(parts)
    if isinstance(template, np.ndarray):
        return template
    return type(template)(next(numbers))


def compiled_refilled() -> Any:
    """`refilled` for Numba, which unrolls the nesting while it compiles."""
    from numba.core import cgutils, types

    structure: Any = cgutils.create_struct_proxy  # untyped
    from numba.extending import intrinsic

    def filled(context: Any, builder: Any, kind: Any, old: Any, data: Any, at: list[int]) -> Any:
        if isinstance(kind, types.BaseTuple):
            inner: Any = list(kind)  # type: ignore[call-overload]  # tuples of types can be walked
            parts = [
                filled(context, builder, part, builder.extract_value(old, i), data, at) for i, part in enumerate(inner)
            ]
            made = context.make_tuple(builder, kind, parts)
            for i, part in enumerate(inner):
                if isinstance(part, types.Array):
                    context.nrt.incref(builder, part, parts[i])
            return made
        if isinstance(kind, types.Array):
            return old
        place = builder.gep(data, [context.get_constant(types.intp, at[0])])
        at[0] += 1
        return context.cast(builder, builder.load(place), types.float64, kind)

    @intrinsic
    def refill(typing: Any, template: Any, row: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            array = structure(signature.args[1])(context, builder, value=arguments[1])
            return filled(context, builder, signature.args[0], arguments[0], array.data, [0])

        return template(template, row), generate

    return refill
