"""What is to be exported: kernels and their arguments, as functions of a module of C."""

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from bowden.core.errors import ParameterError
from bowden.core.kernel_content import Parts
from bowden.export.kinds import Kind, annotated, hints_of, kind_of


@dataclass(frozen=True)
class Constant:
    """A value that is written into the code in place of an argument."""

    value: Any
    said: str = ""
    """What it is."""


@dataclass(frozen=True)
class Public:
    """A kernel that other files of C call, as ``PREFIX_name``.

    Its arguments have the kernel's names; the one called ``state`` is what the function reads and writes.
    """

    name: str
    kernel: Callable[..., Any]
    results: tuple[str, ...]
    """In the kernel's order: ``state``, ``return`` for what the function returns, other names for pointers to it."""
    summary: str
    given: Mapping[str, Any] = field(default_factory=dict)
    """Argument → its `Constant`, or an example where its annotation leaves something open."""

    @property
    def kinds(self) -> dict[str, Kind]:
        """Argument → its kind; what C has none for is refused."""
        found, hints = {}, hints_of(self.kernel)
        for name in inspect.signature(self.kernel).parameters:
            value = self.given.get(name)
            value = value.value if isinstance(value, Constant) else value
            if (kind := kind_of(value) if name in self.given else annotated(hints.get(name))) is None:
                expected, do = "numbers, and NamedTuples of numbers", "take texts and arrays out of it"
                raise ParameterError(f"{name} is {value!r}", expected=expected, do=do)
            found[name] = kind
        return found


@dataclass(frozen=True)
class Module:
    """What belongs in one pair of files."""

    prefix: str
    """Of every name that others see, and the files' own."""
    title: str
    functions: Sequence[Public]
    parts: Parts = ()
    """What stands for the placeholders that the kernels reach."""
    units: dict[str, str] = field(default_factory=dict)
    """Field → unit, where its class does not say."""
    enums: Sequence[type[IntEnum]] = ()
    """Whose members a caller needs."""
    numbers: dict[str, tuple[float, str]] = field(default_factory=dict)
    """Name → another number that a caller needs, and what it means."""

    @property
    def public(self) -> set[str]:
        """The functions' names in C."""
        return {f"{self.prefix}_{one.name}" for one in self.functions}
