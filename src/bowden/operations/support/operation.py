"""An operation as its file declares it, and its parameters as its signature and docstring have them."""

import enum
import importlib.util
import inspect
import pkgutil
import re
import types
import typing
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Annotated, Any, NamedTuple

PACKAGES = ("bowden.operations", "bowden.paper.operations")
"""Folders whose files declare operations in ``OPERATIONS``, and those of a group what it is, in ``GROUP``.

A file's name begins with the first word of its operations (``emg_stream.py`` has ``emg stream`` and ``emg serve``), so
that a command line imports what its first word names, and no other. The view of ``operations/NAME.py`` is
``views/NAME.py``, or in ``views/short.py``.
"""


class Switch(NamedTuple):
    """What a command line has of a parameter, where its annotation does not say it."""

    kind: Any = None
    """Type of what is written there, where Python takes more; ``Role`` where it is not written there at all."""
    name: str = ""
    """In place of the parameter's own: ``--for``."""
    metavar: str | None = None
    """Stands for its value in the help."""
    least: float | None = None
    most: float | None = None
    place: bool = False
    """Given by its place, though it has a default."""
    hidden: bool = False
    """Not in the help."""
    default: Any = None
    """In place of the function's own: a path as text."""


class Role(enum.Enum):
    """What a caller hands over by itself."""

    PROGRESS = "progress"
    """Called with what is being done and the share that is done."""
    TELL = "tell"
    """Called with what the user should know at once."""
    QUIET = "quiet"
    """Whether nothing but the result is to be printed."""
    PYTHON = "python"
    """A parameter that only Python has."""


Progress = Callable[[str, float], None]
GivenProgress = Annotated[Progress | bool | None, Switch(Role.PROGRESS)]
"""True for a line on the screen, False or None for nothing, or a function of what is being done and the share done."""
Tell = Annotated[Callable[[str], None] | None, Switch(Role.TELL)]
Quiet = Annotated[bool, Switch(Role.QUIET)]
GivenRig = Annotated["Rig | str | Path", Switch(Path, metavar="RIG")]  # type: ignore[name-defined]  # noqa: F821
"""A `Rig`, the path of its rig.toml, or of the log of a run (``.mcap``), which holds its rig."""
GivenLaw = Annotated["Law | str | Path", Switch(str)]  # type: ignore[name-defined]  # noqa: F821
"""A key of `LAWS`, ``FILE.py:NAME`` of a user's own, or a `Law`."""
Folder = Annotated[Path, Switch(metavar="FOLDER")]
"""A folder that results are written to: looked at before anything is computed."""


class OperationParameter(NamedTuple):
    """A parameter of an operation."""

    name: str
    kind: Any
    """bool, int, float, str, Path, an enum, a list of one of these; or a `Role`."""
    default: Any
    """``inspect.Parameter.empty`` where it must be given."""
    switch: Switch
    means: str
    """What the docstring says of it."""
    alone: bool
    """True if it is an option, and not given by its place."""
    plain: Any
    """Type that Python takes, where it is a plain one; else None."""
    is_rig: bool
    is_folder: bool

    @property
    def option(self) -> str:
        """As the command line has it: ``--force``, or ``RIG`` by its place."""
        return self.switch.name or (f"--{self.name.strip('_').replace('_', '-')}" if self.alone else self.name.upper())


def parameters(function: Callable[..., Any]) -> dict[str, OperationParameter]:
    """The parameters of a function by name."""
    means = _meanings(inspect.getdoc(function) or "")
    found = {}
    for name, one in inspect.signature(function).parameters.items():
        if one.kind is inspect.Parameter.VAR_KEYWORD:
            continue
        switch, kind, given, several = Switch(), one.annotation, one.annotation, False
        while typing.get_origin(given) in (Annotated, types.UnionType, typing.Union):
            if typing.get_origin(given) is Annotated:
                given, *marks = typing.get_args(given)
                switch = next((mark for mark in marks if isinstance(mark, Switch)), switch)
                kind = given
            else:
                inside = [part for part in typing.get_args(given) if part is not types.NoneType]
                given = kind = inside[0]
                several = several or len(inside) > 1
                if switch != Switch():
                    break
        plain = kind if switch.kind in (None, Role.PYTHON) and not several else None
        kind = switch.kind or kind
        needed = one.default is inspect.Parameter.empty and one.kind is not inspect.Parameter.KEYWORD_ONLY
        found[name] = OperationParameter(
            name,
            kind,
            one.default if switch.default is None else switch.default,
            switch,
            means.get(name, ""),
            alone=switch.name.startswith("--") or not (needed or switch.place),
            plain=plain,
            is_rig=switch is typing.get_args(GivenRig)[1],
            is_folder=switch.metavar == "FOLDER",
        )
    return found


def _meanings(doc: str) -> dict[str, str]:
    """OperationParameter → what the section ``Args:`` of a docstring says of it."""
    section = re.search(r"^Args:\n(.*?)(?=^\S|\Z)", doc, re.DOTALL | re.MULTILINE)
    if section is None:
        return {}
    entries = re.findall(r"^    \*{0,2}(\w+): (.*?)(?=^    \S|\Z)", section[1], re.DOTALL | re.MULTILINE)
    return {name: " ".join(text.split()) for name, text in entries}


class Operation(NamedTuple):
    """An operation, as its file declares it."""

    words: str
    """What comes after ``bowden``: ``simulate``, or ``log info`` in a group."""
    function: Callable[..., Any]
    """Returns its result, or yields it and goes on until it is ended."""
    place: int = 100
    """Where it stands in ``bowden --help``: in the order of what is done with a rig, and then of the names."""

    @property
    def summary(self) -> str:
        """One line: the first of the docstring."""
        return " ".join((inspect.getdoc(self.function) or "").partition("\n\n")[0].split())

    @property
    def text(self) -> str:
        """What the docstring says before its sections."""
        sections = r"^(?:Args|Returns|Yields|Raises|Examples):$|^>>> "
        return re.split(sections, inspect.getdoc(self.function) or "", flags=re.M)[0]

    @property
    def examples(self) -> list[str]:
        """Whole lines to type: the section ``Examples:`` of the docstring."""
        return re.findall(
            r"^    (bowden .*)$", (inspect.getdoc(self.function) or "").partition("\nExamples:\n")[2], re.M
        )

    @property
    def results(self) -> tuple[type, ...]:
        """The types of what it returns or yields, one of them."""
        given: Any = inspect.signature(self.function).return_annotation
        origin = typing.get_origin(given)
        if isinstance(origin, type) and issubclass(origin, Iterator):
            (given,) = typing.get_args(given)
        return typing.get_args(given) if isinstance(given, types.UnionType) else (given,)

    @property
    def view(self) -> Any:
        """The module that shows and writes its results: ``show_NAME``, and ``write_NAME`` where it writes files."""
        own = self.function.__module__.replace(".operations.", ".views.")
        return importlib.import_module(own if importlib.util.find_spec(own) else "bowden.views.short")

    def viewer(self, does: str) -> Callable[..., Any] | None:
        """The function ``show_NAME`` or ``write_NAME`` of its view."""
        return getattr(self.view, f"{does}_{self.function.__name__}", None)


class DeclaredOperations(NamedTuple):
    """What files declare."""

    operations: tuple[Operation, ...]
    """In the order of ``bowden --help``."""
    groups: dict[str, str]
    """First word of a group's operations → what the group is."""


def files() -> dict[str, str]:
    """Module → first word of its operations, of all that declare some; none is imported for it."""
    found: dict[str, str] = {}
    for package in PACKAGES:
        path = importlib.import_module(package).__path__
        names = (one.name for one in pkgutil.iter_modules(path) if not one.ispkg)
        found |= {f"{package}.{name}": _first(name) for name in names}
    return found


def declared(first_word: str = "") -> DeclaredOperations:
    """The operations that begin with a word and those that share its file's name, or all.

    Args:
        first_word: of the command line; all where it is empty, or where no file is named after it.
    """
    every = files()
    chosen = [name for name, first in every.items() if first_word and first == _first(first_word)]
    operations: list[Operation] = []
    groups: dict[str, str] = {}
    for name in chosen or every:
        module = importlib.import_module(name)
        operations += module.OPERATIONS
        if hasattr(module, "GROUP"):
            groups[every[name]] = module.GROUP
    operations.sort(key=lambda one: (" " in one.words, one.place, one.words))
    return DeclaredOperations(tuple(operations), groups)


def named(words: str) -> Operation:
    """The operation of these words, such as ``log info``.

    Raises:
        LookupError: there is none.
    """
    return next(one for one in declared(words.partition(" ")[0]).operations if one.words == words)


def _first(name: str) -> str:
    """The first part of a file's or an operation's name."""
    return re.split("[-_]", name)[0]
