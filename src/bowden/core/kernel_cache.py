"""Where compiled kernels are kept on disk.

In a folder named after what the compiled code is made of: the bytes of the files in which the kernel, the kernels that
it calls and the types that it is called with stand, and the numbers that these name. Numba's own cache does not notice
when a function that another one calls has changed. So an edited file costs the compilation of what is made of it, and
of nothing else, and what is kept for a type is only looked for where the type is known. What has no file, or is the
script itself, is compiled in every process.
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

import numpy as np

Files = frozenset[str | None]
"""What compiled code is made of: hashes of files' bytes at the time when they were first looked at, and of numbers;
None among them stands for code that no file tells."""


def keep(dispatcher: Any, files: Files) -> None:
    """Let what a Numba dispatcher compiles be kept on disk.

    Args:
        dispatcher: from ``numba.njit``.
        files: what its code depends on.
    """
    if None not in files:
        dispatcher._cache = _BySignature(dispatcher.py_func, files)


@cache
def file_of(file: str | None, module: str) -> Files:
    """The file in which something of a module stands."""
    path = Path(file) if file else None
    if path is None or module == "__main__" or not path.is_file():
        return frozenset([None])
    return frozenset([hashlib.sha256(path.read_bytes()).hexdigest()])


@cache
def file_of_type(made: type) -> Files:
    """The file in which a class stands; none of Python's own."""
    if made.__module__ == "builtins":
        return frozenset()
    if "<locals>" in made.__qualname__:
        return frozenset([None])
    return file_of(getattr(sys.modules.get(made.__module__), "__file__", None), made.__module__)


def number_of(name: str, value: Any) -> str:
    """A number, numbers or an array that compiled code has in it by a name."""
    whole = value.tobytes() if isinstance(value, np.ndarray) else repr(value).encode()
    return hashlib.sha256(name.encode() + b"=" + whole).hexdigest()


class _BySignature:
    """Numba's cache of one function, in as many folders as the types come from that it is called with."""

    def __init__(self, function: FunctionType, files: Files) -> None:
        self._function = function
        self._files = files
        self._places: dict[Files, Any] = {}

    @property
    def cache_path(self) -> str:
        """The folder of what is called with numbers alone."""
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
    part = hashlib.sha256("".join(hashes).encode()).hexdigest()[:16]
    config.CACHE_DIR = str(cache_folder() / part)
    try:
        return caching.FunctionCache(function)
    finally:
        config.CACHE_DIR = before


def _files_of(kinds: Iterable[Any]) -> Files:
    """The files that the types of arguments stand in, in tuples of tuples."""
    files: Files = frozenset()
    for kind in kinds:
        if (made := getattr(kind, "instance_class", None)) is not None:
            files |= file_of_type(made)
        if _is_tuple(kind):
            files |= _files_of(kind)
    return files


def _is_tuple(kind: Any) -> bool:
    types: Any = importlib.import_module("numba.core.types")
    return isinstance(kind, types.BaseTuple)


@cache
def cache_folder() -> Path:
    """Where compiled code is kept: in ``$BOWDEN_CACHE_DIR`` or the user's cache folder.

    Where that cannot be written (a read-only home), a folder in the system's temporary one that only this user can
    read and write, since what is cached is run; a fresh one if another user has taken its name.
    """
    try:
        root = os.environ.get("BOWDEN_CACHE_DIR") or os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
        folder = Path(root) / "bowden" / "kernels"
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder):
            return folder
    except (OSError, RuntimeError):  # RuntimeError: no home folder at all
        user = os.getuid() if hasattr(os, "getuid") else os.environ.get("USERNAME", "user")
        own = Path(tempfile.gettempdir()) / f"bowden-{user}"
        own.mkdir(mode=0o700, exist_ok=True)
        if hasattr(os, "getuid") and (own.stat().st_uid != os.getuid() or own.stat().st_mode & 0o077):
            own = Path(tempfile.mkdtemp(prefix="bowden-"))
        folder = own / "kernels"
        folder.mkdir(exist_ok=True)
        return folder


@cache
def source_hash() -> str:
    """A hash of the package's source: what may give other numbers has another one."""
    digest = hashlib.sha256()
    for path in sorted(Path(__file__).parents[1].rglob("*.py")):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:16]
