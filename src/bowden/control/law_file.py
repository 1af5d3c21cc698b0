"""The law that a rig names: one of ours, a user's file with its bytes, or a `Law` of Python's."""

from collections.abc import Iterator, Mapping
from functools import lru_cache
from pathlib import Path
from typing import Any, NamedTuple

from bowden.control import LAWS, Law, user_law
from bowden.core import own_code, user_file
from bowden.core.errors import ParameterError
from bowden.core.kernel_content import Content, code_of
from bowden.core.user_file import UserModule


class LawFile(NamedTuple):
    """A law in a file of the user's, as it stood when the rig was made."""

    name: str
    """``FILE.py:NAME``, as it was given."""
    path: str
    """Where the file was."""
    source: bytes
    """What was in it."""
    modules: tuple[UserModule, ...] = ()
    """What it imports of the user's own."""

    def load(self) -> Law:
        """The law; of a file that has changed since or is not there any more, what it was.

        Raises:
            ParameterError: something that is not a law, with the line.
        """
        return _load(self)


@lru_cache(64)
def _load(file: LawFile) -> Law:
    """The law, made once in a process: what a file prints is printed once."""
    there = user_file.restored(Path(file.path), file.source, "laws", file.modules)
    law = user_law.load_file(there, user_file.split(file.name)[1])
    _READ.setdefault(_key(law), (law, file))
    return law


def law_file(name: str, folder: Path | None = None) -> LawFile:
    """The file that ``FILE.py:NAME`` names, read.

    Raises:
        ParameterError: it cannot be read, or has no such law.
    """
    file, _ = user_file.split(name)
    there = user_file.found(((folder or Path()) / file).absolute(), "law")
    found = LawFile(name, str(there.path), there.source, there.modules)
    found.load()
    own_code.remember(found.source, found.modules)
    return found


def named(name: str, folder: Path | None = None) -> str | LawFile:
    """A law by its name, checked.

    Args:
        name: a key of `LAWS`, or ``FILE.py:NAME`` of a user's own.
        folder: where a relative FILE is found.

    Raises:
        ParameterError: an unknown law, or a user's file that cannot be used.
    """
    if user_law.is_file(name):
        return law_file(name, folder)
    return LAWS[name].name


def loaded(given: str | LawFile) -> Law:
    """The law with its own gains.

    Raises:
        ParameterError: a user's file that cannot be used.
    """
    return LAWS[given] if isinstance(given, str) else given.load()


def packable(law: Law) -> tuple[str | LawFile, dict[str, Any]]:
    """A law of Python's as its name or file, and the gains that were chosen for it, as `Law.with_gains` takes them.

    Raises:
        ParameterError: a law that stands in no file.
    """
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


def held(law: Law) -> Law:
    """A law of Python's; the file in which it stands is read now, and what it was is what other processes get."""
    _in_file(law)
    return law


def code_of_law(law: Law) -> Content:
    """What its kernels, and those that they call, are made of."""
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
    path = Path(law.step_kernel.__code__.co_filename)
    if not user_file.reads_as_module(law.step_kernel):
        return None, None
    for attribute in ("", *_laws_in(law)):
        try:
            found = law_file(f"{path}:{attribute}" if attribute else str(path))
            loaded = found.load()
        except ParameterError:
            continue
        code = code_of_law(law)
        if loaded.name == law.name and code is not None and code == code_of_law(loaded):
            return loaded, found
    return None, None


def _laws_in(law: Law) -> Iterator[str]:
    """Names of laws beside a law's kernels."""
    around: Mapping[str, Any] = law.step_kernel.__globals__
    yield from (name for name, value in list(around.items()) if isinstance(value, Law) and value.name == law.name)
