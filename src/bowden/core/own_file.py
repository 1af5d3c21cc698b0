"""A law or a plant in a file of the user's, as it stood when it was named, and whether it was ever run here.

Such a file is a program, and may do whatever its user may. One that the user names, or that a rig.toml names which the
user gives, runs; it is remembered by the SHA-256 of its text and of what it imports. What a log brings along runs only
if it is one of those, so that a log of somebody else's is no program until its user has said so.
"""

import base64
import contextlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, ClassVar, Self

from bowden.core import user_file
from bowden.core.errors import ParameterError
from bowden.core.kernel_cache import cache_folder
from bowden.core.user_file import UserFile, UserModule


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
        there = user_file.found(((folder or Path()) / user_file.split(name)[0]).absolute(), cls.what)
        return cls(name, str(there.path), there.source, there.modules)

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
        if not user_file.reads_as_module(function):
            return
        beside = [key for key, one in list(function.__globals__.items()) if isinstance(one, kind) and one.name == name]
        for attribute in ("", *beside):
            with contextlib.suppress(ParameterError):
                yield cls.found(f"{function.__code__.co_filename}{attribute and f':{attribute}'}")

    @property
    def ready(self) -> tuple[UserFile, str]:
        """The file to be run, and the name in it, which is empty where there is none."""
        there = user_file.restored(Path(self.path), self.source, f"{self.what}s", self.modules)
        return there, user_file.split(self.name)[1]

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
        return cache_folder() / "named" / user_file.digest(self.source, self.modules)

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
