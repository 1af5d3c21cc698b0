"""A user's own Python file: run as a module of its own, its mistakes told in one line with the file's.

Compiled code is kept under the hash of the file (see `bowden.core.kernel_cache`), so an edited file is never met by
stale code.
"""

import contextlib
import hashlib
import re
import sys
import traceback
from collections.abc import Iterable, Iterator
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import CodeType, FunctionType, ModuleType
from typing import Any

from bowden.core.errors import ParameterError
from bowden.core.files import whole_files
from bowden.core.kernel_cache import cache_folder
from bowden.core.kernel_content import global_names

_PACKAGE = Path(__file__).parents[1]


def split(name: str) -> tuple[str, str]:
    """``FILE.py:NAME`` as file and name, which is empty where there is none."""
    file, colon, attribute = name.rpartition(":")
    return (file, attribute) if colon and file.endswith(".py") else (name, "")


@contextlib.contextmanager
def explained(path: Path, what: str) -> Iterator[None]:
    """Turn what goes wrong in the kernels of a file into one line, with the line of the file where that is known.

    Args:
        path: of the file.
        what: the kernels are of, for messages.

    Raises:
        ParameterError: they cannot be compiled, or a user's own fail while they run interpreted.
    """
    try:
        yield
    except ParameterError:
        raise
    except Exception as error:
        if not type(error).__module__.startswith("numba."):
            last = traceback.extract_tb(error.__traceback__)[-1].filename
            if Path(last) != path or path.is_relative_to(_PACKAGE):
                raise  # a mistake of ours
            raise mistake(error, path) from error
        text = re.sub(r"\x1b\[[0-9;]*m", "", str(error))
        numbers = re.findall(rf'File "(?:[^"]*[/\\])?{re.escape(path.name)}", line (\d+)', text)
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        said = next((line for line in lines if not line.startswith(_ABOUT_ITSELF)), type(error).__name__)
        raise ParameterError(
            f"{path}{f', line {numbers[-1]}' if numbers else ''}: {what} cannot be compiled: {said}",
            do="use only numbers, NamedTuples and kernels in it (docs/kernels.md)",
        ) from error


_ABOUT_ITSELF = (
    "Failed in",
    "During",
    "File",
    "<source",
    "Overload",
    "There are",
    "- ",
    "In definition",
    "raised from",
)
"""How those lines of Numba's messages begin that tell where it was, not what is wrong."""


def fingerprint(source: bytes) -> str:
    """A short name of what stands in a file."""
    return hashlib.sha256(source).hexdigest()[:16]


def source_of(path: Path, what: str) -> bytes:
    """What stands in a file that is to hold a `what`.

    Raises:
        ParameterError: it cannot be read.
    """
    try:
        return path.read_bytes()
    except (OSError, ValueError) as error:  # ValueError: a null byte in its name
        reason = (isinstance(error, OSError) and error.strerror) or str(error)
        raise ParameterError(
            f"cannot read the {what} {path}: {reason.lower()}", expected="a Python file", do="check the path"
        ) from error


def restored(path: Path, source: bytes, folder: str) -> Path:
    """A file as it once stood: itself where it still does, and else a copy under the same name.

    Args:
        path: where it was.
        source: what was in it.
        folder: for the copies, inside that of compiled code.
    """
    if path.is_file() and path.read_bytes() == source:
        return path
    home = cache_folder() / folder / fingerprint(source)
    with whole_files(home) as stage:
        (stage / path.name).write_bytes(source)
    return home / path.name


def run(path: Path, what: str) -> ModuleType:
    """Execute the file as a module of its own, found again by its content when cached code is loaded.

    Args:
        path: of the file.
        what: it is to hold: ``law``, ``plant``.

    Raises:
        ParameterError: a file that cannot be read, or a mistake in it, with its line.
    """
    source = source_of(path, what)
    name = f"bowden_user_{what}_{fingerprint(source)}"
    known = sys.modules.get(name)
    if known is not None and _is_copy(path, known, source):  # what is handed to another process names the first's types
        return known
    module = ModuleType(name)
    module.__file__ = str(path)
    sys.modules[module.__name__] = module
    try:
        code = compile(source, str(path), "exec", dont_inherit=True)
    except SyntaxError as error:
        line = f", line {error.lineno}" if error.lineno else ""
        raise ParameterError(f"{path}{line}: {error.msg}", do="correct it there") from error
    except ValueError as error:  # null bytes, before Python 3.12
        raise ParameterError(f"{path} is not Python: {error}", expected="a Python file", do="give another") from error
    try:
        with contextlib.redirect_stdout(sys.stderr):  # standard output may be a JSON document
            exec(code, module.__dict__)
    except (Exception, SystemExit) as error:
        raise mistake(error, path) from error
    module.__spec__ = ModuleSpec(name, None, origin=str(path))  # it ran to its end
    return module


def _is_copy(path: Path, known: ModuleType, source: bytes) -> bool:
    """Whether a file is a copy, under its name, of the one elsewhere that a module was made of and still stands for."""
    first = Path(known.__spec__.origin or "") if known.__spec__ else path
    return first != path and first.name == path.name and first.is_file() and first.read_bytes() == source


def mistake(error: BaseException, path: Path) -> ParameterError:
    """An exception from the user's code as one line, with the last line of the file that it passed through."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    where = f"{path}, line {lines[-1]}" if lines else str(path)
    said = " ".join(str(error).split())
    return ParameterError(f"{where}: {type(error).__name__}: {said}", do="correct it there")


def line(function: Any, path: Path) -> str:
    """Where a function of the file begins, for messages."""
    code = getattr(function, "__code__", None)
    return f"{path}, line {code.co_firstlineno}" if code is not None else f"{path}: {function!r}"


def check_kernels(functions: Iterable[Any], path: Path) -> None:
    """Refuse what is no kernel.

    Raises:
        ParameterError: the first such thing.
    """
    for part in functions:
        if not isinstance(part, FunctionType) or not hasattr(part, "__kernel__"):
            raise ParameterError(f"{line(part, path)}: not a kernel", do="put @kernel of bowden.core.kernel before it")


def code_of(*functions: Any) -> str:
    """A hash of what functions compute, wherever they stand: their code with its constants, and that of functions and
    numbers outside that it names."""
    return hashlib.sha256(repr([_code(one, ()) for one in functions]).encode()).hexdigest()[:16]


def _code(part: Any, above: tuple[Any, ...]) -> Any:
    if isinstance(part, FunctionType) and part not in above:
        outside = [part.__globals__.get(name) for name in global_names(part.__code__)]
        return _code(part.__code__, above), [_code(one, (*above, part)) for one in outside]
    if isinstance(part, CodeType):
        return part.co_code, part.co_names, [_code(one, above) for one in part.co_consts]
    return repr(part) if isinstance(part, int | float | str | tuple) else getattr(part, "__name__", "")
