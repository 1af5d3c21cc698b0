"""Where compiled kernels are kept on disk.

In a folder named after a hash of the package's source, because Numba's own cache does not notice when a function that
another one calls has changed. What depends on files outside the package, by its code or by the types that it is called
with, goes to a folder of its own below it, named after those files' bytes: an edited file is compiled anew, and what
is kept for a type is only looked for where the type is known. What has no file, or is the script itself, is compiled
in every process.
"""

import hashlib
import importlib
import os
import sys
import tempfile
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from types import FunctionType
from typing import Any

Files = frozenset[str | None]
"""Files outside the package that compiled code depends on, as hashes of their bytes at the time when they were first
looked at; None among them stands for code that no file tells."""

_PACKAGE = Path(__file__).parents[1]


def keep(dispatcher: Any, files: Files) -> None:
    """Let what a Numba dispatcher compiles be kept on disk.

    Args:
        dispatcher: from ``numba.njit``.
        files: what its code depends on.
    """
    if None not in files:
        dispatcher._cache = _BySignature(dispatcher.py_func, files)


def outside(file: str | None, module: str) -> Files:
    """The file in which something of a module stands, where that is outside the package; not to be asked twice."""
    path = Path(file) if file else None
    if path and path.is_relative_to(_PACKAGE):
        return frozenset()
    if path is None or module == "__main__" or not path.is_file():
        return frozenset([None])
    return frozenset([hashlib.sha256(path.read_bytes()).hexdigest()])


class _BySignature:
    """Numba's cache of one function, in as many folders as the types come from that it is called with."""

    def __init__(self, function: FunctionType, files: Files) -> None:
        self._function = function
        self._files = files
        self._places: dict[Files, Any] = {}

    @property
    def cache_path(self) -> str:
        """The folder of what is called with numbers and the package's own types."""
        return str(self._at(self._files).cache_path)

    def load_overload(self, signature: tuple[Any, ...], target: Any) -> Any:
        """What is kept for the types of arguments, or None."""
        return self._at(self._files | _files_of(signature)).load_overload(signature, target)

    def save_overload(self, signature: tuple[Any, ...], result: Any) -> None:
        """Keep what was compiled for the types of arguments."""
        self._at(self._files | _files_of(signature)).save_overload(signature, result)

    def flush(self) -> None:
        """Forget what is kept, as recompiling needs it."""
        for place in self._places.values():
            place.flush()

    def _at(self, files: Files) -> Any:
        if files not in self._places:
            self._places[files] = _numbas_cache(self._function, files)
        return self._places[files]


def _numbas_cache(function: FunctionType, files: Files) -> Any:
    caching: Any = importlib.import_module("numba.core.caching")
    hashes = sorted(file for file in files if file)
    if len(hashes) < len(files):
        return caching.NullCache()
    config: Any = importlib.import_module("numba.core.config")  # its options come from a table, unseen by types
    before = config.CACHE_DIR  # other users of Numba in this process keep theirs
    part = hashlib.sha256("".join(hashes).encode()).hexdigest()[:16] if hashes else ""
    config.CACHE_DIR = str(cache_folder() / part)
    try:
        return caching.FunctionCache(function)
    finally:
        config.CACHE_DIR = before


def _files_of(kinds: Iterable[Any]) -> Files:
    """The files outside the package that the types of arguments stand in, in tuples of tuples."""
    files: Files = frozenset()
    for kind in kinds:
        if (made := getattr(kind, "instance_class", None)) is not None:
            files |= _file_of(made)
        if _is_tuple(kind):
            files |= _files_of(kind)
    return files


def _is_tuple(kind: Any) -> bool:
    types: Any = importlib.import_module("numba.core.types")
    return isinstance(kind, types.BaseTuple)


@cache
def _file_of(made: type) -> Files:
    if "<locals>" in made.__qualname__:
        return frozenset([None])
    return outside(getattr(sys.modules.get(made.__module__), "__file__", None), made.__module__)


@cache
def cache_folder() -> Path:
    """Where compiled code is kept: ``$BOWDEN_CACHE_DIR`` or the user's cache folder, then a hash of the source.

    Where that cannot be written (a read-only home), a folder in the system's temporary one that only this user can
    read and write, since what is cached is run; a fresh one if another user has taken its name.
    """
    try:
        root = os.environ.get("BOWDEN_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        folder = Path(root) / "bowden" / _source_hash()
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except (OSError, RuntimeError):  # RuntimeError: no home folder at all
        user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
        own = Path(tempfile.gettempdir()) / f"bowden-{user}"
        own.mkdir(mode=0o700, exist_ok=True)
        if hasattr(os, "getuid") and (own.stat().st_uid != os.getuid() or own.stat().st_mode & 0o077):
            own = Path(tempfile.mkdtemp(prefix="bowden-"))
        folder = own / _source_hash()
        folder.mkdir(exist_ok=True)
        return folder


def _source_hash() -> str:
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
