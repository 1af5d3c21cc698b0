"""Quantities: what a field of a NamedTuple means, in which unit it is, and how a file names it.

A field that a user may set is declared once, `Annotated[float, Quantity(…)]`. Its key in rig.toml, the conversion both
ways, its range, the pages of documentation and the schemas are made from that.
"""

import ast
import dataclasses
import inspect
import math
import textwrap
import types
import typing
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any, NamedTuple

from bowden.core.units import RADIANS

_SHOWN = {"rad": "°", "rad/s": "°/s", "rad/s²": "°/s²"}
"""Unit inside → unit in a file, where they differ by rule."""

_SUFFIX = {
    "°": "_deg",
    "°/s": "_deg_per_s",
    "°/s²": "_deg_per_s2",
    "rad": "_rad",
    "1/rad": "_per_rad",
    "Hz": "_hz",
    "s": "_s",
    "ms": "_ms",
    "1/s": "_per_s",
    "mm": "_mm",
    "m": "_m",
    "kg": "_kg",
    "kg·m²": "_kg_m2",
    "N": "_n",
    "N/m": "_n_per_m",
    "N/m²": "_n_per_m2",
    "N·s/m": "_ns_per_m",
    "N·m": "_nm",
    "N·m/A": "_nm_per_a",
    "N·m/rad": "_nm_per_rad",
    "N·m·s/rad": "_nms_per_rad",
    "A": "_a",
    "J": "_j",
    "V": "_v",
    "mV": "_mv",
    "N/mV": "_n_per_mv",
    "N·m/mV": "_nm_per_mv",
    "Ω": "_ohm",
    "°C": "_c",
    "K/W": "_k_per_w",
    "J/K": "_j_per_k",
    "% MVC": "_percent",
}
"""Unit in a file → ending of a key; units that are not here have none."""

_FACTOR = {
    ("rad", "°"): RADIANS,
    ("rad/s", "°/s"): RADIANS,
    ("rad/s²", "°/s²"): RADIANS,
    ("rad/s", "Hz"): 2.0 * math.pi,
    ("s", "ms"): 1e-3,
    ("m", "mm"): 1e-3,
    ("–", "% MVC"): 0.01,
}
"""Unit inside, unit in a file → what one of the latter is inside."""


_ROUNDING = 1e-12
"""Of a bound, by which a value may miss it after a change of unit [–]."""


SIZES = 1e-60, 1e60
"""Everything that is measured is 0 or between these; a fifth power of it, and its inverse, are still numbers."""


def has_size(value: float) -> bool:
    """True if a finite number is 0 or between `SIZES`; infinity and NaN are not judged.

    >>> has_size(-1e-3), has_size(0.0), has_size(5e-324), has_size(1e308)
    (True, True, False, False)
    """
    return value == 0.0 or not math.isfinite(value) or SIZES[0] <= abs(value) <= SIZES[1]


@dataclass(frozen=True, kw_only=True)
class Quantity:
    """Declaration of a field. The range is in the file's unit, where it can be written without rounding."""

    meaning: str = dataclasses.field(kw_only=False)
    unit: str = dataclasses.field(default="–", kw_only=False)
    """Inside: SI and radians; – for none."""
    shown: str = ""
    """Unit in a file; by rule (degrees for radians) where it is empty."""
    symbol: str = ""
    """Of the paper."""
    key: str | None = ""
    """Name in a file; the field's with the unit as its ending where it is empty, and None where a file cannot set it.
    """
    gt: float | None = None
    ge: float | None = None
    lt: float | None = None
    le: float | None = None
    example: Any = None
    """A value for a file, where the default is none."""
    endless: bool = False
    """True if it may be infinite, for no limit."""
    least: int = 0
    """Shortest length of a list."""
    live: bool = False
    """Of a law's gain: whether it may be changed while the law runs (`Law.live`)."""
    hint: str = ""
    """Likely other reading of a value out of the range, ``{value}``."""
    follows: bool = False
    """True if it may be left out, as NaN; it then follows from the rig's other parts (`rig.consistent`)."""

    @cached_property
    def file_unit(self) -> str:
        """Unit in a file."""
        return self.shown or _SHOWN.get(self.unit, self.unit)

    @cached_property
    def factor(self) -> float:
        """One of the file's unit, in the unit inside."""
        return 1.0 if self.file_unit == self.unit else _FACTOR[self.unit, self.file_unit]

    def named(self, field: str) -> str:
        """The key in a file of a field of this name."""
        return self.key or field + _SUFFIX.get(self.file_unit, "")

    @property
    def rules(self) -> dict[str, float]:
        """The range, as far as there is one."""
        found = {"gt": self.gt, "ge": self.ge, "lt": self.lt, "le": self.le}
        return {name: value for name, value in found.items() if value is not None}

    @property
    def range(self) -> str:
        """The range in words, in the unit inside; empty where there is none.

        >>> Quantity("an angle", "rad", gt=0.0, le=180.0).range
        'above 0 and at most 3.142'
        """
        words = (("above", self.gt), ("at least", self.ge), ("below", self.lt), ("at most", self.le))
        return " and ".join(f"{word} {value * self.factor:.4g}" for word, value in words if value is not None)

    def holds(self, value: float) -> bool:
        """True if a number in the unit inside is in the range; NaN, or a number of no plausible size, is not."""
        if not has_size(value):
            return False
        if math.isinf(value):
            return self.endless and value > 0.0
        scaled = value / self.factor
        return (
            math.isfinite(value)
            and (self.gt is None or scaled > self.gt)
            and (self.ge is None or scaled >= self.ge - _ROUNDING * abs(self.ge))
            and (self.lt is None or scaled < self.lt)
            and (self.le is None or scaled <= self.le + _ROUNDING * abs(self.le))
        )

    @property
    def ends(self) -> tuple[float, float]:
        """The smallest and the largest value, in the unit inside; infinite where there is no such rule.

        >>> Quantity("a share", ge=0.0, le=1.0).ends
        (0.0, 1.0)
        """
        low = self.ge if self.gt is None else math.nextafter(self.gt, math.inf)
        high = self.le if self.lt is None else math.nextafter(self.lt, -math.inf)
        return (
            -math.inf if low is None else low * self.factor,
            math.inf if high is None else high * self.factor,
        )


def in_unit(value: float, unit: float) -> float:
    """The shortest decimal x with x·unit = `value` exactly, if there is one; otherwise value/unit.

    >>> in_unit(0.3490658503988659, RADIANS)
    20.0
    """
    if unit == 1.0 or not math.isfinite(value):
        return value
    quotient = value / unit
    decimals = (float(f"{quotient:.{digits}g}") for digits in range(1, 18))
    return next((x for x in decimals if x * unit == value), quotient)


class Declared(NamedTuple):
    """One declared field of a NamedTuple or a dataclass."""

    name: str
    kind: Any
    """Its type without the declaration."""
    quantity: Quantity


def declared(kind: Any) -> tuple[Declared, ...]:
    """The declared fields of a NamedTuple or dataclass, in their order.

    >>> class Disc(NamedTuple):
    ...     radius: typing.Annotated[float, Quantity("of the disc", "m", shown="mm")] = 0.1
    >>> declared(Disc)[0].quantity.named("radius")
    'radius_mm'
    """
    return _declared(kind)


@cache
def _declared(kind: Any) -> tuple[Declared, ...]:
    hints = typing.get_type_hints(kind, include_extras=True).items()
    extras = ((name, hint, extra) for name, hint in hints for extra in getattr(hint, "__metadata__", ()))
    return tuple(Declared(name, hint.__origin__, one) for name, hint, one in extras if isinstance(one, Quantity))


def optional(kind: Any) -> Any:
    """The type that a field has where it is not None; None for a type that does not allow None.

    >>> optional(float | None), optional(float)
    (<class 'float'>, None)
    """
    if isinstance(kind, types.UnionType) and type(None) in kind.__args__:
        (inner,) = (part for part in kind.__args__ if part is not type(None))
        return inner
    return None


@cache
def meanings(kind: Any) -> Mapping[str, str]:
    """Meaning of each field of a NamedTuple: as declared, or the text below it, or the comment behind it."""
    said = {one.name: f"{one.quantity.meaning} [{one.quantity.unit}]" for one in declared(kind)}
    try:
        source = textwrap.dedent(inspect.getsource(kind))
        body = ast.parse(source).body[0]
    except (OSError, SyntaxError, TypeError):
        return said
    if not isinstance(body, ast.ClassDef):
        return said
    return texts_of(body.body, source) | said


def texts_of(body: Sequence[ast.stmt], source: str) -> dict[str, str]:
    """Name that a class or module assigns → the text below that, or the comment behind it."""
    lines, found = source.splitlines(), {}
    for node, after in zip(body, [*body[1:], ast.Pass()], strict=False):
        if not isinstance(node, ast.Assign | ast.AnnAssign):
            continue
        text = lines[(node.end_lineno or 1) - 1][node.end_col_offset or 0 :].partition("#")[2]
        if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) and isinstance(after.value.value, str):
            text = after.value.value
        for target in node.targets if isinstance(node, ast.Assign) else [node.target]:
            names = (one.id for one in ast.walk(target) if isinstance(one, ast.Name))
            found.update(dict.fromkeys(names, " ".join(text.split())))
    return found
