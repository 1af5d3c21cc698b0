"""A user's own Python file: run as a module of its own, its mistakes told in one line with the file's.

What it imports is found beside it first, as Python does it for a script. Modules of the user's own that it imports
belong to it (`modules_of`): they are read when it is read, and an edited one is never met by what it was before.
"""

import ast
import base64
import contextlib
import hashlib
import importlib
import re
import site
import sys
import sysconfig
import traceback
from collections.abc import Iterable, Iterator, Mapping
from functools import cache
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, NamedTuple

from bowden.core.errors import ParameterError
from bowden.core.files import whole_file
from bowden.core.kernel_cache import cache_folder

_PACKAGE = Path(__file__).parents[1]


class UserModule(NamedTuple):
    """A Python file of the user's that another one imports, as it stood when that was read."""

    name: str
    """As it is imported: ``friction``, ``lab.friction``."""
    file: str
    """From the folder in which it is found: ``friction.py``, ``lab/__init__.py``."""
    source: bytes
    """What was in it."""


def split(name: str) -> tuple[str, str]:
    """``FILE.py:NAME`` as file and name, which is empty where there is none."""
    file, colon, attribute = name.rpartition(":")
    return (file, attribute) if colon and file.endswith(".py") else (name, "")


@contextlib.contextmanager
def explained(path: Path, what: str, *, named: bool = False) -> Iterator[None]:
    """Turn what goes wrong in the kernels of a file into one line, with the line of the file where that is known.

    Args:
        path: of the file.
        what: the kernels are of, for messages.
        named: leave a compiler's message alone that does not name the file.

    Raises:
        ParameterError: they cannot be compiled, or a user's own, or a module's that it imports, fail while they run.
    """
    try:
        yield
    except ParameterError:
        raise
    except Exception as error:
        if not type(error).__module__.startswith("numba."):
            where = None if path.is_relative_to(_PACKAGE) else _innermost(error)
            if where not in (path, *_imports(path)):
                raise  # a mistake of ours
            raise mistake(error, Path(str(where)), what) from error
        text = re.sub(r"\x1b\[[0-9;]*m", "", str(error))
        files = {file.name: file for file in (*_imports(path), path)}
        places = re.findall(r'File "(?:[^"]*[/\\])?([^"/\\]+)", line (\d+)', text)
        at = [f"{files[name]}, line {number}" for name, number in places if name in files]
        if named and not at:
            raise
        lines = [line.strip() for line in text.splitlines() if line.strip()]
        said = next((line for line in lines if not line.startswith(_ABOUT_ITSELF)), type(error).__name__)
        raise ParameterError(
            f"{at[-1] if at else path}: {what} cannot be compiled: {said}",
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


def written(file: Any) -> dict[str, Any]:
    """A user's file (name, path, source, modules) as JSON values; see `read`."""
    sources = {one.file: [one.name, base64.b64encode(one.source).decode()] for one in file.modules}
    found = {"name": file.name, "path": file.path, "source": base64.b64encode(file.source).decode()}
    return found | ({"modules": sources} if sources else {})


def read(given: Mapping[str, Any]) -> dict[str, Any]:
    """Source and modules of what `written` gave."""
    modules = given.get("modules", {}).items()
    found = tuple(UserModule(name, file, base64.b64decode(source)) for file, (name, source) in modules)
    return {"source": base64.b64decode(given["source"]), "modules": found}


def restored(path: Path, source: bytes, folder: str, modules: tuple[UserModule, ...] = ()) -> Path:
    """A file as it once stood: itself where it still does with all that it imports, and else a copy under its name.

    Args:
        path: where it was.
        source: what was in it.
        folder: for the copies, inside that of compiled code.
        modules: that it imported.
    """
    if _stands(path, source) and all(_stands(path.parent / one.file, one.source) for one in modules):
        return path
    digest = fingerprint(source + b"".join(one.file.encode() + one.source for one in modules))
    home = cache_folder() / folder / digest
    for file, content in ((path.name, source), *((one.file, one.source) for one in modules)):
        if not _stands(home / file, content):
            (home / file).parent.mkdir(parents=True, exist_ok=True)
            with whole_file(home / file) as part:
                part.write_bytes(content)
    return home / path.name


def _stands(path: Path, source: bytes) -> bool:
    return path.is_file() and path.read_bytes() == source


_LOADED: dict[str, tuple[ModuleType, bytes]] = {}
"""Name of a user's module → what was loaded for a user's file, and of what source."""


def modules_of(path: Path, source: bytes) -> tuple[UserModule, ...]:
    """The user's own modules that a file imports, and that these import, in the order of their names.

    Those of Python, of this package and of what is installed are not among them.
    """
    places = [str(path.parent.absolute()), *sys.path]
    found: dict[str, UserModule] = {}
    todo = _imported(source, "")
    while todo:
        name = todo.pop()
        if name in found or name.partition(".")[0] in sys.stdlib_module_names:
            continue
        file = _found(name, places)
        if file is None or file == path or _installed(file):
            continue
        is_package, content = file.name == "__init__.py", file.read_bytes()
        place = name.replace(".", "/") + ("/__init__.py" if is_package else ".py")
        found[name] = UserModule(name, place, content)
        todo |= _imported(content, name if is_package else name.rpartition(".")[0])
    return tuple(found[name] for name in sorted(found))


def _imported(source: bytes, package: str) -> set[str]:
    """Names of all modules that a source may import, and of the packages that they are in."""
    try:
        nodes = list(ast.walk(ast.parse(source)))
    except (SyntaxError, ValueError):  # told when it is run
        return set()
    names: set[str] = set()
    for node in nodes:
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join(filter(None, (*above, node.module)))
            names |= {base, *(f"{base}.{alias.name}" for alias in node.names)} if base else set()
    return {".".join(name.split(".")[: i + 1]) for name in names for i in range(name.count(".") + 1)}


def _found(name: str, places: list[str]) -> Path | None:
    """The file of a module by that name, looked for in these folders; nothing is loaded."""
    where: Any = places
    spec: ModuleSpec | None = None
    parts = name.split(".")
    for i in range(len(parts)):
        try:
            spec = PathFinder.find_spec(".".join(parts[: i + 1]), where)
        except (ImportError, ValueError):
            return None
        if spec is None or ((where := spec.submodule_search_locations) is None and i + 1 < len(parts)):
            return None
    origin = Path(spec.origin) if spec is not None and spec.origin else None
    return origin if origin is not None and origin.suffix == ".py" and origin.is_file() else None


def _installed(file: Path) -> bool:
    """Whether a file belongs to Python, to this package, or to what is installed."""
    return any(file.is_relative_to(place) for place in _libraries())


@cache
def _libraries() -> tuple[Path, ...]:
    own = (sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib"))
    return (_PACKAGE, *map(Path, (*own, *site.getsitepackages(), site.getusersitepackages())))


def run(path: Path, what: str) -> ModuleType:
    """Execute the file as a module of its own, found again by its content when cached code is loaded.

    Args:
        path: of the file.
        what: it is to hold: ``law``, ``plant``.

    Raises:
        ParameterError: a file that cannot be read, or a mistake in it, with its line.
    """
    source = source_of(path, what)
    modules = modules_of(path, source)
    name = f"bowden_user_{what}_{fingerprint(source)}"
    known = sys.modules.get(name)
    if known is not None and _is_copy(path, known, source, modules):  # what another process is handed names its types
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
    if any(_LOADED.get(one.name) != (sys.modules.get(one.name), one.source) for one in modules):
        for one in modules:  # loaded of another source, or by somebody else
            sys.modules.pop(one.name, None)
    try:
        with contextlib.redirect_stdout(sys.stderr), _beside(path):  # standard output may be a JSON document
            exec(code, module.__dict__)
    except (Exception, SystemExit) as error:
        raise mistake(error, path) from error
    _LOADED.update((one.name, (sys.modules[one.name], one.source)) for one in modules if one.name in sys.modules)
    module.__spec__ = ModuleSpec(name, None, origin=str(path))  # it ran to its end
    return module


@contextlib.contextmanager
def _beside(path: Path) -> Iterator[None]:
    """What is imported meanwhile is looked for in the folder of a file first, and leaves no bytecode behind.

    Bytecode is told from its source by the second of an edit and by the length alone.
    """
    before, folder = sys.dont_write_bytecode, str(path.parent.absolute())
    sys.dont_write_bytecode = True
    sys.path.insert(0, folder)
    importlib.invalidate_caches()
    try:
        yield
    finally:
        sys.path.remove(folder)
        sys.dont_write_bytecode = before


def _is_copy(path: Path, known: ModuleType, source: bytes, modules: tuple[UserModule, ...]) -> bool:
    """Whether a file is a copy, under its name, of the one elsewhere that a module was made of and still stands for."""
    first = Path(known.__spec__.origin or "") if known.__spec__ else path
    same = first != path and first.name == path.name and _stands(first, source)
    return same and all(_LOADED.get(one.name, (None, b""))[1] == one.source for one in modules)


def _innermost(error: BaseException) -> Path | None:
    """The file of the innermost code that an exception passed through and that belongs to no library."""
    files = [Path(frame.filename) for frame in traceback.extract_tb(error.__traceback__)]
    own = [file for file in files if file.is_relative_to(_PACKAGE) or not _installed(file)]
    return own[-1] if own else None


def _imports(path: Path) -> list[Path]:
    """The files of the user's own modules that a file imports."""
    if path.is_relative_to(_PACKAGE) or not path.is_file():
        return []
    places = [str(path.parent.absolute()), *sys.path]
    found = (_found(one.name, places) for one in modules_of(path, path.read_bytes()))
    return [file for file in found if file is not None]


def mistake(error: BaseException, path: Path, what: str = "") -> ParameterError:
    """An exception from the user's code as one line, with the last line of the file that it passed through."""
    lines = [frame.lineno for frame in traceback.extract_tb(error.__traceback__) if frame.filename == str(path)]
    where = f"{path}, line {lines[-1]}" if lines else str(path)
    said = ": ".join(filter(None, (what and f"{what} failed", type(error).__name__, " ".join(str(error).split()))))
    return ParameterError(f"{where}: {said}", do="correct it there")


def line(function: Any, path: Path) -> str:
    """Where a function of the file begins, for messages."""
    code = getattr(function, "__code__", None)
    return f"{path}, line {code.co_firstlineno}" if code is not None else f"{path}: {function!r}"


def is_ours(function: Any) -> bool:
    """Whether a function stands in a file of this package."""
    return Path(function.__code__.co_filename).is_relative_to(_PACKAGE)


def check_kernels(functions: Iterable[Any], path: Path) -> None:
    """Refuse what is no kernel.

    Raises:
        ParameterError: the first such thing.
    """
    for part in functions:
        if not isinstance(part, FunctionType) or not hasattr(part, "__kernel__"):
            raise ParameterError(f"{line(part, path)}: not a kernel", do="put @kernel of bowden.core.kernel before it")
