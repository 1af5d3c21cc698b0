"""How a kernel's NamedTuples look in C: names, structs, and what each field means."""

import re
import unicodedata
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

from bowden.core import nested
from bowden.core.nested import is_named
from bowden.core.quantity import meanings

_WORDS = """
auto break case char const continue default do double else enum extern float for goto if inline int long register
restrict return short signed sizeof static struct switch typedef union unsigned void volatile while
and bool catch class delete explicit export false friend mutable namespace new not operator or private protected public
template this throw true try typename using virtual xor
"""
_RESERVED = frozenset(_WORDS.split())
"""Of C, and of C++, whose compilers may have to read the header."""


@dataclass(frozen=True)
class Leaf:
    """One number in a structure."""

    path: nested.Path
    """Names of fields and places in tuples, from the outside."""
    value: Any

    @property
    def name(self) -> str:
        """Its path as one identifier of C."""
        return identifier("_".join(map(str, self.path)))

    def access(self, of: str) -> str:
        """How C reaches it, from a pointer, or from a variable where the structure is a number."""
        if not self.path:
            return of
        steps = "".join(f"[{step}]" if isinstance(step, int) else f".{identifier(step)}" for step in self.path)
        return f"{of}->{steps.removeprefix('.')}"


def identifier(name: str) -> str:
    """A name as C takes it: letters beyond ASCII by their names, and none of C's own words.

    >>> identifier("κ_gain"), identifier("default")
    ('kappa_gain', 'default_')
    """
    plain = "".join(c if c.isascii() else unicodedata.name(c, "x").split()[-1].lower() for c in name)
    plain = re.sub(r"\W", "_", plain)
    if not plain or plain[0].isdigit():
        plain = f"n{plain}"
    return f"{plain}_" if plain in _RESERVED else plain


def leaves(value: Any) -> Iterator[Leaf]:
    """Every number of a structure, in its order."""
    return (Leaf(path, number) for path, number in nested.leaves(value))


def rebuilt(value: Any, replace: Callable[[Leaf], Any]) -> Any:
    """The same structure with other leaves."""
    return nested.rebuilt(value, lambda path, number: replace(Leaf(path, number)))


def snake(name: str) -> str:
    """A class's name in the style of C.

    >>> snake("DriveReading")
    'drive_reading'
    """
    return re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name).lower()


class Structs:
    """The structs of one module of C, each written once, inner ones first."""

    def __init__(self, prefix: str) -> None:
        self.prefix = prefix
        self.written: dict[str, str] = {}

    def name(
        self,
        value: Any,
        called: str = "",
        units: Mapping[str, str] | None = None,
        meant: Mapping[str, str] | None = None,
    ) -> str:
        """The type of a structure in C; its struct is written if it is new.

        Args:
            value: a NamedTuple, or a number.
            called: its name, in place of its class's.
            units: field → unit, where the class does not say.
            meant: field → what it means, likewise.
        """
        if not is_named(value):
            return f"{self.prefix}_real"
        name = f"{self.prefix}_{called or snake(identifier(type(value).__name__))}"
        if name not in self.written:
            kind: Any = type(value)
            meaning_of = {**(meant or {}), **meanings(kind)}
            rows = [self._field(field, inner, meaning_of, units or {}) for field, inner in value._asdict().items()]
            self.written[name] = "typedef struct {\n" + "\n".join(rows) + f"\n}} {name};\n"
        return name

    def _field(self, field: str, value: Any, meaning_of: Mapping[str, str], units: Mapping[str, str]) -> str:
        array = isinstance(value, tuple) and not is_named(value)
        kind = self.name(value[0] if array else value)
        size = f"[{len(value)}]" if array else ""
        unit = f"[{'–' if units[field] == '1' else units[field]}]" if field in units else ""
        text = meaning_of.get(field, "")
        return f"    {kind} {identifier(field)}{size};{comment(text if '[' in text else f'{text} {unit}')}"


def comment(text: str) -> str:
    """A text behind a line of C; nothing where there is none."""
    text = text.strip().replace("*/", "* /").replace("/*", "/ *")
    return f" /* {text} */" if text else ""
