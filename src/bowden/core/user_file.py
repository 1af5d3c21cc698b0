"""A user's own Python file, a law or a plant: run as a module of its own, its mistakes reported in one line.

Modules beside it that it imports (`bowden.core.own_file`) are run of what was read. What is installed, and what the
user has imported elsewhere under the same names, is not touched.
"""

import contextlib
import linecache
import re
import sys
import sysconfig
import traceback
from collections.abc import Iterable, Iterator, Sequence
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from importlib.util import spec_from_loader
from pathlib import Path
from types import FunctionType, ModuleType
from typing import Any

from bowden.core.errors import ParameterError, article
from bowden.core.kernel_cache import cache_folder
from bowden.core.own_file import OwnFile, UserModule, digest, modules_of, split

_PACKAGE = Path(__file__).parents[1]
_LIBRARIES = tuple({sysconfig.get_path(name) for name in ("stdlib", "platstdlib", "purelib", "platlib")})


_RUN: dict[tuple[str, bytes, tuple[UserModule, ...]], ModuleType | None] = {}
"""A file that was run, with what it imports → its module, which is None while it runs."""
_OURS = "bowden_user_"
"""How the names of modules begin that are run here."""


def run(file: OwnFile) -> ModuleType:
    """Execute a file as a module of its own, named after its name and content, as are those that it imports.

    What another process is handed names its types, and kept code what it is made of.

    Raises:
        ParameterError: a mistake in it or in what it imports, with file and line.
    """
    path, source, modules = Path(file.path), file.source, file.modules
    key = file.path, source, modules
    if known := _RUN.get(key):
        return known
    if key in _RUN:
        raise ParameterError(
            f"{path}: the {file.what} in it is asked for while the file runs, so that it would run again without end",
            expected="a file that defines, and does nothing else",
            do='put what it does below: if __name__ == "__main__":',
        )
    name = f"{_OURS}{file.what}_{digest(path.name.encode() + source, modules)[:16]}"
    module = ModuleType(name)
    module.__file__ = str(path)
    sys.modules[name] = module
    _RUN[key] = None
    try:
        code = compile(source, str(path), "exec", dont_inherit=True)
        with contextlib.redirect_stdout(sys.stderr), _Beside(file, name):  # standard output may be a JSON document
            exec(code, module.__dict__)
    except (Exception, SystemExit) as error:  # ValueError: null bytes, before Python 3.12
        raise mistake(error, path) from error
    else:
        _RUN[key] = module
    finally:
        if _RUN[key] is None:
            del _RUN[key]
    return module


def defined(file: OwnFile, kind: type, parts: Sequence[str]) -> tuple[Any, dict[str, Any]]:
    """The object of a kind that a file defines, and all names in it, once it has run.

    Of a file that defines only the parts of one the object is None, and the first part, a class, is made with its
    defaults.

    Args:
        file: of which the object has the given name, or is the only one.
        kind: a law, a plant.
        parts: names of all the parts.

    Raises:
        ParameterError: a mistake in the file, with its line; there is no such object, or several, or not all the parts.
    """
    path, attribute, what = Path(file.path), split(file.name)[1], kind.__name__
    names = dict(vars(run(file)))
    own = [name for name, value in names.items() if isinstance(value, kind)]
    if attribute:
        if attribute in names and attribute not in own:
            given = article(type(names[attribute]).__name__)
            raise ParameterError(f"{attribute} in {path} is {given}", expected=article(what), do="name one")
        if attribute not in names:
            expected = f"one of {', '.join(own) or f'those of type {what}'}"
            raise ParameterError(f"{path} has no {attribute!r}", expected=expected, do="name one of them")
        return names[attribute], names
    missing = [part for part in parts if part not in names]
    if len(own) > 1 or (not own and missing):
        found = f"several of type {what}: {', '.join(own)}" if own else f"no {what} and no {', '.join(missing)}"
        do = f"say which: {path.name}:NAME" if own else "write them (docs/own_law.md)"
        raise ParameterError(f"{path} has {found}", expected=f"one {what}, or {', '.join(parts)}", do=do)
    if own:
        return names[own[0]], names
    try:
        return None, names | {parts[0]: names[parts[0]]()}
    except Exception as error:
        raise mistake(error, path) from error


class _Beside(MetaPathFinder, Loader):
    """Meanwhile, imports find the modules of a file by their plain names; afterwards they have names of their own."""

    def __init__(self, file: OwnFile, prefix: str) -> None:
        names = {one.file.removesuffix(".py").removesuffix("/__init__").replace("/", "."): one for one in file.modules}
        folders = {name[:at] for name in names for at, letter in enumerate(name) if letter == "."}
        self._modules: dict[str, UserModule | None] = dict.fromkeys(folders) | names
        self._folder, self._prefix, self._before = Path(file.path).parent, prefix, dict[str, ModuleType]()

    def __enter__(self) -> None:
        self._before = {name: sys.modules.pop(name) for name in self._modules if name in sys.modules}
        sys.meta_path.insert(0, self)

    def __exit__(self, *error: object) -> None:
        sys.meta_path.remove(self)
        for name in self._modules:
            if module := sys.modules.pop(name, None):
                sys.modules[f"{self._prefix}.{name}"] = module
                for value in vars(module).values():
                    if isinstance(value, type) and value.__module__ == name:
                        value.__module__ = f"{self._prefix}.{name}"  # where pickle finds it
        sys.modules.update(self._before)

    def find_spec(self, name: str, path: Any = None, target: Any = None) -> ModuleSpec | None:
        """That of one of the modules, or of a folder that has one; None of any other name."""
        if name not in self._modules:
            return None
        if (one := self._modules[name]) is None:
            return ModuleSpec(name, None, is_package=True)
        return spec_from_loader(name, self, is_package=one.file.endswith("__init__.py"))

    def exec_module(self, module: ModuleType) -> None:
        """Run a module of what was in its file."""
        one = self._modules[module.__name__]
        assert one is not None
        module.__file__ = str(self._folder / one.file)
        exec(compile(one.source, module.__file__, "exec", dont_inherit=True), module.__dict__)


def _together(path: Path, file: str) -> Path | None:
    """The user's file that code names `file`, of one and what it imports; None of a file of others.

    Kept code names the place where it was compiled, which may be another.
    """
    modules = next((modules for file, _, modules in _RUN if file == str(path)), None)
    if modules is None:  # loaded by somebody else
        modules = modules_of(path, path.read_bytes()) if path.is_file() and not is_package(path) else ()
    places = {one: path.parent / one for one in (path.name, *(one.file for one in modules))}
    if Path(file) not in places.values() and (file.startswith(_LIBRARIES) or is_package(Path(file))):
        return None
    return places.get(max((one for one in places if f"/{file}".endswith(f"/{one}")), key=len, default=""))


def is_package(path: Path) -> bool:
    """True if a file is one of this package's."""
    return path.is_relative_to(_PACKAGE)


def mistake(error: BaseException, path: Path, what: str = "") -> ParameterError:
    """An exception from the user's code as one line, with the last line of the user's that it passed through.

    Args:
        error: the exception.
        path: of the file, for what stands in none of its lines.
        what: failed.
    """
    frames = [(frame.filename, frame.lineno) for frame in traceback.extract_tb(error.__traceback__)]
    if isinstance(error, SyntaxError) and error.filename:
        frames.append((error.filename, error.lineno))
    at = [(own, line) for file, line in frames if (own := _together(path, file))]
    where = f"{at[-1][0]}, line {at[-1][1]}" if at and at[-1][1] else str(at[-1][0] if at else path)
    text = error.msg if isinstance(error, SyntaxError) else " ".join(str(error).split())
    kind = "" if isinstance(error, SyntaxError) else type(error).__name__
    do = "correct it there"
    if path.is_relative_to(cache_folder()):
        do = "this is the rig's copy: correct the file from which the rig was made, and make the rig again"
    return ParameterError(f"{where}: {': '.join(filter(None, (what and f'{what} failed', kind, text)))}", do=do)


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
            frames = [frame.filename for frame in traceback.extract_tb(error.__traceback__)]
            known = [file for file in frames if is_package(Path(file)) or _together(path, file)]
            if is_package(path) or not known or is_package(Path(known[-1])):
                raise  # a mistake of ours
            raise mistake(error, path, what) from error
        text = re.sub(r"\x1b\[[0-9;]*m", "", str(error))
        named_by = re.findall(r'(?:File "|at |from )([^"\s]+\.py)"?(?:, line | \()(\d+)', text)
        places = [(own, int(number)) for file, number in named_by if (own := _together(path, file))]
        if named and not places:
            raise
        begin = f"{places[0][0]}, line {places[0][1]}" if places else str(path)  # the innermost comes first
        line = linecache.getline(str(places[0][0]), places[0][1]).strip() if places else ""
        about_itself = r"\s*(Failed in|During|File|<source|Overload|There are|- |In definition|raised from|$)"
        said = next((one for one in text.splitlines() if not re.match(about_itself, one)), type(error).__name__)
        for internal in (r",? (?:for )?'\$[^']*'(?: \(temporary variable\))?", r"<iv=[^>]*>", r"_[0-9a-f]{16}",
                         r",? (?:defined at|[Rr]aised from) \S+ \(\d+\)", rf"\b{_OURS}\w+?\."):  # fmt: skip
            said = re.sub(internal, "", said)
        raise ParameterError(
            f"{begin}: {what} cannot be compiled{f', at {line!r}' if line else ''}: {said.strip('. ')}",
            do="use only numbers, NamedTuples and kernels in it (docs/own_law.md)",
        ) from error


def elsewhere(function: Any, what: str) -> str:
    """Advice: how other processes find the law or plant of which this is a function."""
    script = function.__module__ == "__main__" and Path(function.__code__.co_filename).is_file()
    below = f'put what the script does below: if __name__ == "__main__":, or the {what} into a file and name that'
    return f"{below if script else 'write it into a file and name that'}: my_{what}.py:NAME"


def line(function: Any, path: Path) -> str:
    """Where a function begins that stands in the file, or in one that this imports, for messages."""
    code = getattr(function, "__code__", None)
    if code is None:
        return f"{path}: {function!r}"
    return f"{_together(path, code.co_filename) or code.co_filename}, line {code.co_firstlineno}"


def check_kernels(functions: Iterable[Any], path: Path) -> None:
    """Refuse what is no kernel.

    Raises:
        ParameterError: the first such thing.
    """
    for part in functions:
        if not isinstance(part, FunctionType) or not hasattr(part, "__kernel__"):
            raise ParameterError(f"{line(part, path)}: not a kernel", do="put @kernel of bowden.core.kernel before it")
