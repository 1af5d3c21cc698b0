"""A law or a plant in a file of the user's, as it stood when it was named, and whether it was ever run here.

Such a file is a program, and may do whatever its user may. One that the user names, or that a rig.toml names which the
user gives, runs; it is remembered by the SHA-256 of its text and of what it imports. What a log brings along runs only
if it is one of those, so that a log of somebody else's is no program until its user has said so.

Modules that it imports and that stand beside it, in its folder or in folders of that, belong to it: they are read when
it is read, and kept with it.
"""

import ast
import base64
import contextlib
import hashlib
import re
import sys
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, NamedTuple, Self

from bowden.core.bounded import MOST_TEXT, read_whole, reason
from bowden.core.errors import ParameterError
from bowden.core.files import whole_file
from bowden.core.kernel_cache import cache_folder


class UserModule(NamedTuple):
    """A Python file beside the user's that this imports, as it stood when that was read."""

    file: str
    """From the folder of the importing file: ``friction.py``, ``lab/__init__.py``."""
    source: bytes
    """Its contents."""


@dataclass(frozen=True)
class OwnFile:
    """A file of the user's; `LawFile` and `PlantFile` say what is in it."""

    name: str
    """``FILE.py:NAME``, as it was given."""
    path: str
    """Where the file was."""
    source: bytes
    """Its contents."""
    modules: tuple[UserModule, ...] = ()
    """The user's own modules that it imports."""
    what: ClassVar[str] = "program"

    def load(self) -> Any:
        """The object that it defines; of a file that has changed or is gone, from the contents as they were.

        Raises:
            ParameterError: something else than that, with the line.
        """
        raise NotImplementedError  # always replaced

    @classmethod
    def seen(cls, name: str, folder: Path | None = None) -> Self:
        """The file that ``FILE.py:NAME`` names as it stands now, without running it.

        Args:
            name: the file and, after a colon, a name in it; without one it is the only one there.
            folder: where a relative file is looked for; the current one where it is not given.

        Raises:
            ParameterError: it cannot be read.
        """
        path = ((folder or Path()) / split(name)[0]).absolute()
        try:
            source = read_whole(path, MOST_TEXT, unpack=False)
        except (OSError, ValueError) as error:  # ValueError: a null byte in its name
            said = f"cannot read the {cls.what} {path}: {reason(error)}"
            raise ParameterError(said, expected="a Python file", do="check the path") from error
        return cls(name, str(path), source, modules_of(path, source))

    @classmethod
    def found(cls, name: str, folder: Path | None = None) -> Self:
        """The same, loaded, and remembered as one that its user has named.

        Raises:
            ParameterError: it cannot be read or has no such thing; a mistake in it has its line.
        """
        found = cls.seen(name, folder)
        found.load()
        found.remember()
        return found

    @classmethod
    def again(cls, name: str, folder: Path, before: Any) -> Self:
        """`found`; what was found `before` is taken where it has that name."""
        return before if isinstance(before, cls) and before.name == name else cls.found(name, folder)

    @classmethod
    def around(cls, function: Any, kind: type[Any], name: str) -> Iterator[Self]:
        """The file in which a function stands, alone and by each thing of a kind and a name that stands beside it."""
        if not reads_as_module(function):
            return
        beside = [key for key, one in list(function.__globals__.items()) if isinstance(one, kind) and one.name == name]
        for attribute in ("", *beside):
            with contextlib.suppress(ParameterError):
                yield cls.found(f"{function.__code__.co_filename}{attribute and f':{attribute}'}")

    def restored(self) -> Self:
        """The file as it once was: where it stands if it and its modules are unchanged there, and else copies of all.

        The copies are in the folder of compiled code.
        """
        path = Path(self.path)
        whole = (UserModule(path.name, self.source), *self.modules)
        if all(_stands(path.parent / one.file, one.source) for one in whole):
            return self
        home = cache_folder() / f"{self.what}s" / digest(self.source, self.modules)[:16]
        for one in whole:
            if not _stands(home / one.file, one.source):
                (home / one.file).parent.mkdir(parents=True, exist_ok=True)
                with whole_file(home / one.file) as part:
                    part.write_bytes(one.source)
        return replace(self, path=str(home / path.name))

    @property
    def known(self) -> bool:
        """True if this very file, with its imports, was named here before."""
        return self._mark.exists()

    def remember(self) -> None:
        """Its user has named it; where that cannot be kept, the next log that has it is asked about."""
        with contextlib.suppress(OSError):
            self._mark.parent.mkdir(mode=0o700, exist_ok=True)
            self._mark.touch()

    @property
    def _mark(self) -> Path:
        return cache_folder() / "named" / digest(self.source, self.modules)

    def packed(self) -> dict[str, Any]:
        """The file as JSON values; see `unpacked`."""
        modules = {one.file: base64.b64encode(one.source).decode() for one in self.modules}
        found = {"name": self.name, "path": self.path, "source": base64.b64encode(self.source).decode()}
        return found | ({"modules": modules} if modules else {})

    @classmethod
    def unpacked(cls, given: Mapping[str, Any], **more: Any) -> Self:
        """The file of what `packed` gave, and of fields that are more than that.

        Raises:
            ParameterError: a module that would not stand beside the file.
        """
        for file in given.get("modules", {}):
            if not re.fullmatch(r"(\w+/)*\w+\.py", file):
                expected = "a file such as friction.py or lab/friction.py"
                do = "take a rig that bowden has packed"
                raise ParameterError(f"a module is in {file!r}", expected=expected, do=do)
        modules = (UserModule(file, base64.b64decode(source)) for file, source in given.get("modules", {}).items())
        return cls(given["name"], given["path"], base64.b64decode(given["source"]), tuple(modules), **more)


def split(name: str) -> tuple[str, str]:
    """``FILE.py:NAME`` as file and name, which is empty where there is none."""
    file, colon, attribute = name.rpartition(":")
    return (file, attribute) if colon and file.endswith(".py") else (name, "")


def modules_of(path: Path, source: bytes) -> tuple[UserModule, ...]:
    """The modules beside a file that it imports, and that these import, in the order of their names."""
    files: dict[str, bytes] = {}
    todo = [(source, "")]
    while todo:
        for name in _imported(*todo.pop()):
            place = name.replace(".", "/")
            for file in (f"{place}/__init__.py", f"{place}.py"):
                if file not in files and (path.parent / file).is_file():
                    files[file] = (path.parent / file).read_bytes()
                    todo.append((files[file], name if file.endswith("__init__.py") else name.rpartition(".")[0]))
    return tuple(UserModule(file, files[file]) for file in sorted(files))


def _imported(source: bytes, package: str) -> set[str]:
    """Names of all modules that a source in a package may import, and of the packages that they are in."""
    try:
        nodes = list(ast.walk(ast.parse(source)))
    except (SyntaxError, ValueError):  # reported when it is run
        return set()
    names: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join(filter(None, (*above, node.module)))
            names |= {base, *(f"{base}.{alias.name}" for alias in node.names)} if base else set()
    parts = (name.split(".") for name in names if name.partition(".")[0] not in sys.stdlib_module_names)
    return {".".join(part[: i + 1]) for part in parts for i in range(len(part))}


def digest(source: bytes, modules: Iterable[UserModule] = ()) -> str:
    """SHA-256 of what stands in a file and in what it imports."""
    parts = [hashlib.sha256(source).hexdigest()]
    parts += [f"{one.file} {hashlib.sha256(one.source).hexdigest()}" for one in modules]
    return hashlib.sha256("\n".join(parts).encode()).hexdigest()


def _stands(path: Path, source: bytes) -> bool:
    return path.is_file() and path.read_bytes() == source


def reads_as_module(function: Any) -> bool:
    """True if the file in which a function stands may be run again for its definitions.

    The script that is being run may not, unless it has a part of its own for that, ``if __name__ == "__main__":``. What
    it does would be done twice.
    """
    path = Path(function.__code__.co_filename)
    if path.suffix != ".py" or not path.is_file():
        return False
    return function.__module__ != "__main__" or re.search(rb"^if .*\b__name__\b", path.read_bytes(), re.M) is not None
