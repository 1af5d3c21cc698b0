"""A user's own Python file: run as a module of its own, its mistakes reported in one line with the file's.

What it imports is found beside it first, as Python does it for a script. Modules of the user's own that it imports
belong to it (`modules_of`): they are read when it is read, and run of what was read, for that file alone. What the user
has imported under their names stays what it is, and is not looked at: it may be of another file, or of an older text.
"""

import ast
import base64
import builtins
import contextlib
import hashlib
import importlib
import itertools
import re
import site
import sys
import sysconfig
import traceback
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder
from importlib.util import spec_from_loader
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any, NamedTuple

from bowden.core.bounded import MOST_TEXT, read_whole, reason
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
    path: str = ""
    """Where it stood; beside the file that imports it where that is not known."""


class UserFile(NamedTuple):
    """A Python file of the user's with all that it imports, ready to be run."""

    path: Path
    """Where it stands."""
    source: bytes
    """What is in it."""
    modules: tuple[UserModule, ...]
    """The user's own that it imports, with where they stand."""


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
            if where is None or where.name not in _together(path):
                raise  # a mistake of ours
            raise mistake(error, path, what) from error
        text = re.sub(r"\x1b\[[0-9;]*m", "", str(error))
        files = _together(path)
        places = [(Path(name), number) for name, number in re.findall(r'File "([^"]+)", line (\d+)', text)]
        at = [f"{_at(files, file)}, line {number}" for file, number in places if file.name in files]
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
"""How those lines of Numba's messages begin that say where it was, not what is wrong."""


def fingerprint(source: bytes) -> str:
    """A short name of what stands in a file."""
    return hashlib.sha256(source).hexdigest()[:16]


def source_of(path: Path, what: str) -> bytes:
    """What stands in a file that is to hold a `what`.

    Raises:
        ParameterError: it cannot be read.
    """
    try:
        return read_whole(path, MOST_TEXT, unpack=False)
    except (OSError, ValueError) as error:  # ValueError: a null byte in its name
        raise ParameterError(
            f"cannot read the {what} {path}: {reason(error)}", expected="a Python file", do="check the path"
        ) from error


def found(path: Path, what: str) -> UserFile:
    """A file as it stands now, with what it imports.

    Raises:
        ParameterError: it cannot be read.
    """
    source = source_of(path, what)
    return UserFile(path, source, modules_of(path, source))


_WRITTEN_ELSEWHERE = "take a rig that bowden has packed"


def written(file: Any) -> dict[str, Any]:
    """A user's file (name, path, source, modules) as JSON values; see `read`."""
    sources = {one.file: [one.name, base64.b64encode(one.source).decode(), one.path] for one in file.modules}
    found = {"name": file.name, "path": file.path, "source": base64.b64encode(file.source).decode()}
    return found | ({"modules": sources} if sources else {})


def read(given: Mapping[str, Any]) -> dict[str, Any]:
    """Source and modules of what `written` gave.

    Raises:
        ParameterError: a module's file is not the one in which Python looks for a module of its name.
    """
    modules = []
    for file, (name, source, *path) in given.get("modules", {}).items():
        place = name.replace(".", "/")
        if not name.replace(".", "").isidentifier() or file not in (f"{place}.py", f"{place}/__init__.py"):
            raise ParameterError(
                f"module {name!r} should be in {file!r}", expected=f"{place}.py", do=_WRITTEN_ELSEWHERE
            )
        modules.append(UserModule(name, file, base64.b64decode(source), *map(str, path)))
    return {"source": base64.b64decode(given["source"]), "modules": tuple(modules)}


def restored(path: Path, source: bytes, folder: str, modules: tuple[UserModule, ...] = ()) -> UserFile:
    """A file as it once was, with what it imported: each itself where it still stands, and else a copy under its name.

    Args:
        path: where it was.
        source: what was in it.
        folder: for the copies, inside that of compiled code.
        modules: that it imported.
    """
    home = cache_folder() / folder / _digest(source, modules)

    def placed(file: Path, name: str, content: bytes) -> Path:
        if _stands(file, content):
            return file
        if not _stands(home / name, content):
            (home / name).parent.mkdir(parents=True, exist_ok=True)
            with whole_file(home / name) as part:
                part.write_bytes(content)
        return home / name

    places = [placed(Path(one.path or path.parent / one.file), one.file, one.source) for one in modules]
    there = (one._replace(path=str(place)) for one, place in zip(modules, places, strict=True))
    return UserFile(placed(path, path.name, source), source, tuple(there))


def _digest(source: bytes, modules: tuple[UserModule, ...]) -> str:
    return fingerprint(source + b"".join(one.file.encode() + one.source for one in modules))


def _stands(path: Path, source: bytes) -> bool:
    return path.is_file() and path.read_bytes() == source


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
        if file is None or _installed(file):  # a file that is imported in a circle runs again, as a script's does
            continue
        is_package, content = file.name == "__init__.py", file.read_bytes()
        place = name.replace(".", "/") + ("/__init__.py" if is_package else ".py")
        found[name] = UserModule(name, place, content, str(file))
        todo |= _imported(content, name if is_package else name.rpartition(".")[0])
    return tuple(found[name] for name in sorted(found))


def _imported(source: bytes, package: str) -> set[str]:
    """Names of all modules that a source may import, and of the packages that they are in."""
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
    return {".".join(name.split(".")[: i + 1]) for name in names for i in range(name.count(".") + 1)}


def _found(name: str, places: list[str]) -> Path | None:
    """The file of a module by that name, looked for in these folders; nothing is loaded."""
    where: Any = places
    spec: ModuleSpec | None = None
    parts = name.split(".")
    for i in range(len(parts)):
        try:
            spec = PathFinder.find_spec(parts[i], where)  # without the names of folders, which would have to be loaded
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


def run(file: UserFile, what: str) -> ModuleType:
    """Execute a file as a module of its own, named after its name and content, as are those that it imports.

    What another process is handed names its types, and kept code what it is made of.

    Args:
        file: with what it imports.
        what: it is to hold: ``law``, ``plant``.

    Raises:
        ParameterError: a mistake in it or in what it imports, with file and line.
    """
    path, source, modules = file
    name = f"{_OURS}{what}_{_digest(path.name.encode() + source, modules)}"
    known = _RUN.get(name)
    if known is not None and known[1] == file and all(_stands(*each) for each in _contents(file)):
        return known[0]
    module = ModuleType(name)
    module.__file__ = str(path)
    module.__dict__["__builtins__"] = _own_imports(_package_of(modules))
    sys.modules[name] = module
    _FILES.update({place: file for place, _ in _contents(file)})
    try:
        code = compile(source, str(path), "exec", dont_inherit=True)
    except SyntaxError as error:
        raise mistake(error, path) from error
    except ValueError as error:  # null bytes, before Python 3.12
        raise ParameterError(f"{path} is not Python: {error}", expected="a Python file", do="give another") from error
    try:
        with contextlib.redirect_stdout(sys.stderr), _beside(path):  # standard output may be a JSON document
            exec(code, module.__dict__)
    except (Exception, SystemExit) as error:
        raise mistake(error, path) from error
    _RUN[name] = module, file
    return module


def _contents(file: UserFile) -> Iterator[tuple[Path, bytes]]:
    """Where a file and what it imports stand, and what was in them."""
    yield file.path, file.source
    yield from ((Path(one.path), one.source) for one in file.modules)


_OURS = "bowden_user_"
"""How the names of modules begin that are run here."""

_RUN: dict[str, tuple[ModuleType, UserFile]] = {}
"""Name of a module that ran to its end → itself, and the file that it was made of."""

_MODULES: dict[str, tuple[UserModule, ...]] = {}
"""Name of the package that stands for some modules of the user's → these, with where they stand."""

_FILES: dict[Path, UserFile] = {}
"""A file that was run, or was imported by one → that one."""


def _package_of(modules: tuple[UserModule, ...]) -> str:
    """The name of the package that stands for modules; those that ran before where they stood then are forgotten."""
    package = f"{_OURS}{_digest(b'', modules)}"
    known = _MODULES.get(package, modules)
    if known != modules or not all(_stands(Path(one.path), one.source) for one in known):
        for name in [name for name in sys.modules if name.startswith(f"{package}.")]:
            del sys.modules[name]
        _MODULES.pop(package, None)
    _MODULES.setdefault(package, modules)
    return package


def _own_imports(package: str) -> dict[str, Any]:
    """Python's builtins for a file that imports the modules of a package of ours as if they stood alone."""
    tops = {one.name.partition(".")[0] for one in _MODULES[package]}

    def imported(
        name: str, globals: Any = None, locals: Any = None, fromlist: Sequence[str] = (), level: int = 0
    ) -> Any:
        top = name.partition(".")[0]
        if level > 0 or top not in tops:
            return builtins.__import__(name, globals, locals, fromlist, level)
        found = builtins.__import__(f"{package}.{name}", globals, locals, fromlist, 0)
        return found if fromlist else sys.modules[f"{package}.{top}"]

    return vars(builtins) | {"__import__": imported}


class _Modules(MetaPathFinder, Loader):
    """Finds and runs `_MODULES` under the names of their packages."""

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """That of one of the modules, or of a folder that has one; None of any other name."""
        package, _, own = name.partition(".")
        if package not in _MODULES:
            return None
        for one in _MODULES[package]:
            if one.name == own:
                is_package = one.file.endswith("__init__.py")
                spec = spec_from_loader(name, self, origin=one.path, is_package=is_package)
                if spec is not None and is_package:
                    spec.submodule_search_locations = [str(Path(one.path).parent)]
                return spec
        inside = not own or any(one.name.startswith(f"{own}.") for one in _MODULES[package])
        return ModuleSpec(name, None, is_package=True) if inside else None

    def exec_module(self, module: ModuleType) -> None:
        """Run a module of what was in its file."""
        package, _, own = module.__name__.partition(".")
        one = next(one for one in _MODULES[package] if one.name == own)
        module.__file__ = one.path
        module.__dict__["__builtins__"] = _own_imports(package)
        exec(compile(one.source, one.path, "exec", dont_inherit=True), module.__dict__)


sys.meta_path.insert(0, _Modules())  # before that which looks into folders


@contextlib.contextmanager
def _beside(path: Path) -> Iterator[None]:
    """What is imported meanwhile is looked for in the folder of a file first, and leaves no bytecode behind.

    Bytecode is matched to its source by the second of an edit and by the length alone.
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


def _innermost(error: BaseException) -> Path | None:
    """The file of the innermost code that an exception passed through and that belongs to no library."""
    files = [Path(frame.filename) for frame in traceback.extract_tb(error.__traceback__)]
    own = [file for file in files if file.is_relative_to(_PACKAGE) or not _installed(file)]
    return own[-1] if own else None


def _together(path: Path) -> dict[str, tuple[Path, ...]]:
    """Name → places of a file and of the user's own modules that it imports.

    Kept code names the file that it was compiled from, which may since stand elsewhere.
    """
    file = _FILES.get(path)
    if file is None and path.is_file() and not path.is_relative_to(_PACKAGE):  # loaded by somebody else
        file = UserFile(path, b"", modules_of(path, path.read_bytes()))
    places = dict.fromkeys((path, *(() if file is None else (place for place, _ in _contents(file)))))
    return {name: tuple(one for one in places if one.name == name) for name in {place.name for place in places}}


def _at(files: Mapping[str, tuple[Path, ...]], file: Path) -> Path:
    """Where a file stands that code names: itself, or the one of its name that has most of its folders' names too."""

    def alike(one: Path) -> int:
        pairs = zip(reversed(one.parts), reversed(file.parts), strict=False)
        return sum(1 for _ in itertools.takewhile(lambda pair: pair[0] == pair[1], pairs))

    return max(files.get(file.name, (file,)), key=alike)


def mistake(error: BaseException, path: Path, what: str = "") -> ParameterError:
    """An exception from the user's code as one line, with the last line of the user's that it passed through.

    Args:
        error: the exception.
        path: of the file, for what stands in none of its lines.
        what: failed.
    """
    own = _together(path)
    frames = [(Path(frame.filename), frame.lineno) for frame in traceback.extract_tb(error.__traceback__)]
    if isinstance(error, SyntaxError) and error.filename:
        frames.append((Path(error.filename), error.lineno))
    at = [(_at(own, file), line) for file, line in frames if file.name in own and not _installed(file)]
    where = f"{at[-1][0]}, line {at[-1][1]}" if at and at[-1][1] else str(at[-1][0] if at else path)
    text = error.msg if isinstance(error, SyntaxError) else " ".join(str(error).split())
    text = re.sub(rf"\b{_OURS}[0-9a-f]+\.", "", text)
    kind = "" if isinstance(error, SyntaxError) else type(error).__name__
    said = ": ".join(filter(None, (what and f"{what} failed", kind, text)))
    return ParameterError(f"{where}: {said}", do=_correct(at[-1][0] if at else path))


def _correct(path: Path) -> str:
    """What to do about a mistake in a file."""
    if path.is_relative_to(cache_folder()):
        return "this is the rig's copy: correct the file from which the rig was made, and make the rig again"
    return "correct it there"


def line(function: Any, path: Path) -> str:
    """Where a function begins that stands in the file, or in one that this imports, for messages."""
    code = getattr(function, "__code__", None)
    if code is None:
        return f"{path}: {function!r}"
    file = Path(code.co_filename)
    return f"{_at(_together(path), file)}, line {code.co_firstlineno}"


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
