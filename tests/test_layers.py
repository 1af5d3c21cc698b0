"""The rules of the house that no other tool checks: layers, sizes, the portable subset, and no one's own paths."""

import ast
import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "bowden"

FLOORS = [
    ["core"],
    ["drawing"],
    ["records"],
    ["models"],
    ["sensing", "safety"],
    ["control"],
    ["cycle"],
    ["plants"],
    ["rig"],
    ["sim"],
    ["identify"],
    ["hardware"],
    ["design", "export"],
    ["study"],
    ["live"],
    ["report"],
    ["console"],
    ["operations"],
    ["views"],
    ["paper"],
    ["app"],
]
"""From the ground up; a room imports from itself and from floors below its own."""

FLOOR_OF = {room: i for i, rooms in enumerate(FLOORS) for room in rooms}

PORTABLE_ROOMS = ("sensing", "safety", "control")
"""Whose kernels must run interpreted, compiled and exported."""

PORTABLE_MODELS = (PACKAGE / "models" / "minimum_jerk.py",)
"""Whose kernels the laws call."""

OF_MATH = {"isnan", "isfinite", "copysign", "pi", "inf", "nan"}
"""What of ``math`` means the same in Python, compiled and in C."""


def modules() -> list[Path]:
    return sorted(PACKAGE.rglob("*.py"))


def room_of(path: Path) -> str | None:
    """The room that a module stands in; None for the package's own ``__init__``."""
    parts = path.relative_to(PACKAGE).parts
    return parts[0] if len(parts) > 1 else None


def imported_rooms(source: str, path: Path) -> Iterator[tuple[int, str]]:
    """Line and room of every import of the package, those inside functions and type checks too."""
    for node in ast.walk(ast.parse(source)):
        names = []
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and node.level == 0:
            names = [node.module or ""] + [f"{node.module}.{alias.name}" for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            raise AssertionError(f"{path}:{node.lineno}: write imports in full, so that their floor can be seen")
        for name in names:
            parts = name.split(".")
            if parts[0] == "bowden" and len(parts) > 1 and parts[1] in FLOOR_OF:
                yield node.lineno, parts[1]


def without_type_checks(source: str) -> str:
    """The source without what stands under ``if TYPE_CHECKING:``."""
    tree = ast.parse(source)
    tree.body = [
        node for node in tree.body if not (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test))
    ]
    return ast.unparse(tree)


def wrong_imports(source: str, path: Path, room: str) -> list[str]:
    return [
        f"{path}:{line}: {room} imports {other}"
        for line, other in imported_rooms(source, path)
        if other != room and FLOOR_OF[other] >= FLOOR_OF[room]
    ]


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_down(path: Path) -> None:
    room = room_of(path)
    if room is None:  # the package's own module imports nothing of its rooms: it names them, and loads them when asked
        assert not [at for at in imported_rooms(without_type_checks(path.read_text()), path) if at[1] != "core"]
        return
    assert room in FLOOR_OF, f"{room} has no floor; give it one in DESIGN and here"
    assert not wrong_imports(path.read_text(), path, room)


def test_nothing_imports_the_paper() -> None:
    others = [path for path in modules() if room_of(path) not in (None, "paper")]
    assert not [path for path in others if any(room == "paper" for _, room in imported_rooms(path.read_text(), path))]


@pytest.mark.parametrize(
    ("source", "wrong"),
    [
        ("from bowden.core import kernel", False),
        ("from bowden.control.law import Law", False),
        ("from bowden.app import main", True),
        ("import bowden.report.page", True),
        ("from bowden import identify", True),
        ("def f():\n    from bowden.identify.log.read import read", True),
    ],
)
def test_the_import_test_sees_what_it_should(source: str, wrong: bool) -> None:
    assert bool(wrong_imports(source, Path("sim/x.py"), "sim")) is wrong


def module_of(path: Path) -> str:
    """A module's name within the package."""
    return ".".join(path.relative_to(PACKAGE).with_suffix("").parts)


def imported_modules(source: str, known: set[str]) -> set[str]:
    """Modules of the package that a source imports, within functions and for types alone too."""
    found = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found |= {node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)}
    return {name.removeprefix("bowden.") for name in found} & known


def in_circles(imports: dict[str, set[str]]) -> set[str]:
    """Of modules and what each imports, those that import themselves in the end."""
    left = {name: set(of) for name, of in imports.items()}
    while ends := {name for name, of in left.items() if not of or not any(name in other for other in left.values())}:
        left = {name: of - ends for name, of in left.items() if name not in ends}
    return set(left)


def test_no_module_imports_itself_in_a_circle() -> None:
    sources = {module_of(path): path.read_text() for path in modules() if path.name != "__init__.py"}
    assert not in_circles({name: imported_modules(source, set(sources)) for name, source in sources.items()})


def test_the_circle_test_sees_what_it_should() -> None:
    lazy = imported_modules(
        "if TYPE_CHECKING:\n    from bowden.a import b\ndef f():\n    import bowden.c", {"a.b", "c", "d"}
    )
    assert lazy == {"a.b", "c"}
    assert in_circles({"a": {"b"}, "b": {"c"}, "c": {"a"}, "d": {"a"}, "e": set()}) == {"a", "b", "c"}
    assert not in_circles({"a": {"b", "c"}, "b": {"c"}, "c": set()})


def test_a_rig_is_described_without_what_runs_it() -> None:
    """Plants, laws, limits at work and drives are found by their names, when somebody runs the rig."""
    ask = "import sys, bowden.rig.rig; print(*(name for name in sys.modules if name.startswith('bowden')))"
    done = subprocess.run([sys.executable, "-P", "-c", ask], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert not loaded & {"bowden.control.law", "bowden.plants.bench", "bowden.rig.plant", "bowden.hardware"}
    assert len(loaded) <= 70


def test_no_two_public_classes_have_one_name() -> None:
    homes: dict[str, list[str]] = {}
    for path in modules():
        for node in ast.parse(path.read_text()).body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                homes.setdefault(node.name, []).append(str(path.relative_to(PACKAGE)))
    assert not {name: where for name, where in homes.items() if len(where) > 1}


def portable_faults(source: str) -> list[str]:
    """What the kernels of a source file take from outside the portable subset, with the line."""
    faults = []
    for function in ast.walk(ast.parse(source)):
        if not isinstance(function, ast.FunctionDef):
            continue
        if not any(isinstance(mark, ast.Name) and mark.id == "kernel" for mark in function.decorator_list):
            continue
        for node in (node for statement in function.body for node in ast.walk(statement)):
            said = None
            if isinstance(
                node, ast.While | ast.Match | ast.Try | ast.With | ast.Lambda | ast.List | ast.Dict | ast.Set
            ):
                said = type(node).__name__
            elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                of, name = node.value.id, node.attr
                said = ast.unparse(node) if of == "np" or (of == "math" and name not in OF_MATH) else None
            elif isinstance(node, ast.Call) and ast.unparse(node.func).rpartition(".")[2] in ("round", "_replace"):
                said = ast.unparse(node.func)
            if said:
                faults.append(f"line {getattr(node, 'lineno', function.lineno)}, {function.name}: {said}")
    return faults


@pytest.mark.parametrize(
    "path",
    [
        path
        for path in [*modules(), *sorted((ROOT / "examples").glob("*.py"))]
        if path in PORTABLE_MODELS or not path.is_relative_to(PACKAGE) or room_of(path) in PORTABLE_ROOMS
    ],
    ids=lambda path: path.name,
)
def test_laws_filters_and_limits_stay_in_the_portable_subset(path: Path) -> None:
    assert not portable_faults(path.read_text())


@pytest.mark.parametrize(
    "line",
    [
        "y = np.where(x > 0, x, 0.0)",
        "y = np.abs(x)",
        "y = math.tanh(x)",
        "y = round(x)",
        "y = x._replace(a=1.0)",
        "y = [x]",
        "while x > 0: x = x - 1",
    ],
)
def test_the_subset_test_sees_what_it_should(line: str) -> None:
    assert portable_faults(f"@kernel\ndef f(x):\n    {line}\n    return y\n")
    assert not portable_faults(f"def f(x):\n    {line}\n    return y\n")


def tracked_files() -> list[Path]:
    done = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True, text=True)
    if done.returncode != 0:
        pytest.skip("not a git checkout, so nothing says which files are the project's")
    return [ROOT / name for name in done.stdout.split("\0") if name and (ROOT / name).is_file()]


MACHINE = re.compile(r"(?<![\w.])/(?:home|Users|root|work|mnt|opt|srv)/[\w.-]+|[A-Z]:\\Users\\")


def test_no_file_names_a_place_on_somebodys_machine() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{number}: {line.strip()[:100]}"
        for path in tracked_files()
        if path != Path(__file__) and path.suffix not in (".png", ".gz", ".parquet", ".mat")
        for number, line in enumerate(path.read_text(encoding="utf-8", errors="replace").splitlines(), 1)
        if MACHINE.search(line)
    ]
    assert not found


def test_that_test_sees_a_place() -> None:
    assert MACHINE.search("cd /home/somebody/bowden")
    assert not MACHINE.search("see https://example.org/home/page and ../shared/data")


def test_no_child_takes_modules_from_the_folder_in_which_a_command_runs() -> None:
    """A ``queue.py`` that lies there would run within the loop: Python puts that folder first unless told ``-P``."""
    found = []
    for path in modules():
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if isinstance(node, ast.List) and node.elts and ast.unparse(node.elts[0]) == "sys.executable":
                found.append((path.name, ast.unparse(node.elts[1])))
    assert len(found) >= 5
    assert [name for name, option in found if option != "'-P'"] == []
