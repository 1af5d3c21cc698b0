"""Where compiled kernels are kept on disk.

A file for each function and each set of types that it was called with, named after its content
(`bowden.core.kernel_content`), the types, the processor and the versions of what compiles: what is found under a name
is what would be compiled, and nothing that is kept is ever stale. Numba's own cache does not notice when a function
that another one calls has changed, and two processes that write to one of its indices can mix up what they keep.

What cannot be identified by its content (a type that no other process can find, a function that calls itself) is
compiled in every process; and so is what takes or gives a type of the main script or of a notebook's cell, of which
Numba keeps a copy: to the script that reads it that is another type of the same name.
"""

import contextlib
import hashlib
import importlib
import os
import pickle
import platform
import tempfile
from collections.abc import Iterable
from functools import cache
from pathlib import Path
from typing import Any

from bowden.core.kernel_content import content_of_types


def keep(dispatcher: Any, content: str) -> None:
    """Let what a Numba dispatcher compiles be kept on disk.

    Args:
        dispatcher: from ``numba.njit``.
        content: what the code is made of, and how it is compiled.
    """
    dispatcher._cache = _Kept(dispatcher.py_func.__qualname__, content)


class _Kept:
    """Cache of one function, in the place of Numba's own."""

    def __init__(self, name: str, content: str) -> None:
        self._name = name
        self._content = content

    @property
    def cache_path(self) -> str:
        """The folder."""
        return str(cache_folder())

    def load_overload(self, signature: tuple[Any, ...], target: Any) -> Any:
        """Compiled code kept for the types of arguments, or None."""
        target.refresh()  # so that it knows all that kept code may call
        path = self._path(signature, target.codegen())
        if path is None or not path.is_file():
            return None
        compiler: Any = importlib.import_module("numba.core.compiler")
        try:
            return compiler.CompileResult._rebuild(target, *pickle.loads(path.read_bytes()))
        except Exception:  # whatever a torn or foreign file may raise: it is compiled again and written over
            return None

    def save_overload(self, signature: tuple[Any, ...], result: Any) -> None:
        """Keep what was compiled for the types of arguments; where nothing can be written, nothing is kept."""
        path = self._path(signature, result.codegen)
        given = content_of_types([result.signature.return_type])
        if path is None or given is None or result.library.has_dynamic_globals or result.lifted:
            return
        serialize: Any = importlib.import_module("numba.core.serialize")
        _write(path, serialize.dumps(result._reduce()))

    def flush(self) -> None:
        """Nothing: what is kept is never stale."""

    def _path(self, signature: Iterable[Any], codegen: Any) -> Path | None:
        types = content_of_types(signature)
        if types is None:
            return None
        whole = f"{self._content} {types} {codegen.magic_tuple()} {_versions()}"
        return cache_folder() / f"{self._name}-{hashlib.sha256(whole.encode()).hexdigest()[:16]}.kernel"


def _write(path: Path, content: bytes) -> None:
    """Write a file, whole or not at all; nothing where it cannot be written."""
    with contextlib.suppress(OSError), tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as part:
        try:
            part.write(content)
            part.close()
            os.replace(part.name, path)
        except OSError:
            os.unlink(part.name)


@cache
def _versions() -> str:
    """Everything that decides how any kernel is compiled: versions, options, and the files here that do it."""
    config: Any = importlib.import_module("numba.core.config")
    options = (config.OPT, config.BOUNDSCHECK, config.DEBUGINFO_DEFAULT, config.LOOP_VECTORIZE, config.SLP_VECTORIZE)
    versions = [importlib.import_module(name).__version__ for name in ("numba", "llvmlite", "numpy")]
    files = [Path(__file__).with_name(f"{name}.py") for name in ("kernel", "primitives", "nested", "kernel_cache")]
    here = hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()
    return f"{platform.python_version()} {versions} {options} {here}"


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
