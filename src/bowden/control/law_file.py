"""The law that a rig names: one of ours, a user's file with its bytes, or a `Law` of Python's."""

from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar

from bowden.control import LAWS, Law, user_law
from bowden.core import user_file
from bowden.core.arguments import format_value
from bowden.core.errors import ParameterError
from bowden.core.kernel_content import Content, code_of
from bowden.core.own_file import OwnFile


@dataclass(frozen=True)
class LawFile(OwnFile):
    """A law in a file of the user's."""

    what: ClassVar[str] = "law"

    def load(self) -> Law:
        """See `OwnFile.load`."""
        return _load(self)


@lru_cache(64)
def _load(file: LawFile) -> Law:
    """The law, made once in a process: what a file prints is printed once."""
    law = user_law.load_file(file.restored())
    _READ.setdefault(_key(law), (law, file))
    return law


def load(name: str, folder: Path | None = None) -> Law:
    """The law that ``FILE.py:NAME`` or ``FILE.py`` names; see `OwnFile.found`."""
    return LawFile.found(name, folder).load()


def named(name: str, folder: Path | None = None) -> str | LawFile:
    """A law by its name, checked.

    Args:
        name: a key of `LAWS`, or ``FILE.py:NAME`` of a user's own.
        folder: where a relative FILE is found.

    Raises:
        ParameterError: an unknown law, or a user's file that cannot be used.
    """
    return LawFile.found(name, folder) if user_law.is_file(name) else LAWS[name].name


def loaded(given: str | Law | LawFile) -> Law:
    """The law with its own gains.

    Raises:
        ParameterError: a user's file that cannot be used.
    """
    return given if isinstance(given, Law) else LAWS[given] if isinstance(given, str) else given.load()


def same_file(one: Any, other: Any) -> bool:
    """True if two laws are the same one of a user's file, by whatever way it is named."""
    if not (isinstance(one, LawFile) and isinstance(other, LawFile)):
        return False
    names = [law.name.rpartition(".py")[2] for law in (one, other)]
    return names[0] == names[1] and (one.path, one.source, one.modules) == (other.path, other.source, other.modules)


def packable(law: str | Law | LawFile) -> tuple[str | LawFile, dict[str, Any]]:
    """A law as its name or file and, of one of Python's, the gains chosen for it, as `Law.with_gains` takes them.

    Raises:
        ParameterError: a law that stands in no file.
    """
    if not isinstance(law, Law):
        return law, {}
    base: str | LawFile | None = None
    known = LAWS.get(law.name)
    if known is not None and known.step_kernel is law.step_kernel and known.start_kernel is law.start_kernel:
        base = law.name
    else:
        known, base = _in_file(law)
    if known is None or base is None:
        raise ParameterError(
            f"the law {law.name!r} is not in a file, so that it cannot be used in another process",
            do=user_file.elsewhere(law.step_kernel, "law"),
        )
    own = {
        name
        for name, value in law.gains._asdict().items()
        if name in law.overridden_gains - known.overridden_gains
        or (value != getattr(known.gains, name) and name not in law.from_rig)
    }
    return base, {name: value for name, value in law.numbers.items() if name.partition(".")[0] in own}


def held(given: Any) -> str | Law | LawFile:
    """The form in which a rig holds a law.

    The file in which one of Python's stands is read now, and what it was is what other processes get.

    Raises:
        ParameterError: it is no law, or there is none of that name.
    """
    if isinstance(given, str):
        return named(given)
    if not isinstance(given, Law | LawFile):
        raise ParameterError(
            f"Rig: law is {format_value(given)}",
            expected='a name ("adaptive"), "FILE.py:NAME" or a Law',
            do="list(bowden.LAWS) has the names",
        )
    if isinstance(given, Law):
        if LAWS.get(given.name) == given:
            return given.name
        _in_file(given)
    return given


def code_of_law(law: Law) -> Content:
    """Content of its kernels, and of those that they call."""
    return code_of(law.start_kernel, law.step_kernel)


def _in_file(law: Law) -> tuple[Law | None, LawFile | None]:
    key = _key(law)
    if key not in _READ:
        _READ[key] = _looked_for(law)
    return _READ[key]


_READ: dict[Any, tuple[Law | None, LawFile | None]] = {}
"""Law by its kernels → as its file had it, and that file, as they were when the law was first met."""


def _key(law: Law) -> Any:
    return law.name, law.start_kernel, law.step_kernel


def _looked_for(law: Law) -> tuple[Law | None, LawFile | None]:
    for found in LawFile.around(law.step_kernel, Law, law.name):
        known, code = found.load(), code_of_law(law)
        if known.name == law.name and code is not None and code == code_of_law(known):
            return known, found
    return None, None
