"""What is to be exported: kernels and their arguments, as functions of a module of C."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Any

from bowden.core.errors import ParameterError
from bowden.core.kernel_content import Parts
from bowden.export.kinds import Kind, kind_of


@dataclass(frozen=True)
class Argument:
    """What a kernel is handed."""

    name: str
    example: Any
    """A value of the same structure; of a constant, its value."""
    constant: bool = False
    """Whether it is written into the code."""
    said: str = ""
    """What a constant is."""

    @property
    def kind(self) -> Kind:
        """Its kind; what C has none for is refused."""
        if (kind := kind_of(self.example)) is None:
            what, expected = f"{self.name} is {self.example!r}", "numbers, and NamedTuples of numbers"
            raise ParameterError(what, expected=expected, do="take texts and arrays out of it")
        return kind


@dataclass(frozen=True)
class Public:
    """A kernel that other files of C call, as ``PREFIX_name``."""

    name: str
    kernel: Callable[..., Any]
    arguments: tuple[Argument, ...]
    """In the kernel's order; the one called ``state`` is what the function reads and writes."""
    results: tuple[str, ...]
    """In the kernel's order: ``state``, ``return`` for what the function returns, other names for pointers to it."""
    summary: str


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
    begins: tuple[str, Any, Any, str] | None = None
    """Name, state, and what the function is: a function that sets a state which was worked out here, whose fields with
    the value of the second are those of its one argument."""

    @property
    def public(self) -> set[str]:
        """The functions' names in C."""
        return {f"{self.prefix}_{one.name}" for one in self.functions}
