"""The package: what is in a wheel and a source distribution, what the core needs, the lock, a clean install."""

import ast
import subprocess
import sys
from importlib.metadata import packages_distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import lock
import release

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "bowden"

EXTRA_MODULES = {
    "pyarrow": "parquet",
    "python_calamine": "xlsx",
    "nptdms": "tdms",
    "rosbags": "rosbag",
    "h5py": "hdf5",
    "pylsl": "lsl",
    "imufusion": "imu",
    "serial": "serial",
    "dask": "cluster",
    "distributed": "cluster",
    "foxglove": "foxglove",
}
"""Module → the extra that brings it."""
PACKAGE_OF = {"foxglove": "foxglove-sdk", "serial": "pyserial"}
"""Module → its package, where that has another name."""
OWNERS = packages_distributions()
PARTS = {
    "llvmlite": "numba",
    "PIL": "matplotlib",
    "cycler": "matplotlib",
    "markupsafe": "jinja2",
    "pydantic_core": "pydantic",
}
"""Module → the dependency that is made of it, among others."""
OF_THE_USER = {"pandas", "polars", "IPython"}
"""Taken where they are there, and named where they are not."""


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    pytest.importorskip(
        "hatchling", reason="hatchling is not installed, which builds the package: the extra dev has it"
    )
    return release.build(tmp_path_factory.mktemp("dist"))


def test_the_wheel_has_the_package_and_nothing_else(built: tuple[Path, Path]) -> None:
    assert list(release.wheel_problems(built[0])) == []


def test_the_sources_have_all_that_is_needed_to_build_and_test(built: tuple[Path, Path]) -> None:
    assert list(release.source_problems(built[1])) == []


def test_all_that_must_be_in_the_wheel_is_in_the_package() -> None:
    files = release.package_files()
    assert {f"bowden/{name}" for name in release.MUST_HAVE} <= files
    read_as_data = {name for name in files if not name.endswith(".py")}
    assert read_as_data == {f"bowden/{name}" for name in release.MUST_HAVE}, "name it in tools/release.py"


def test_locks_belong_to_this_pyproject() -> None:
    for name in lock.LOCKS:
        text = (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8")
        assert lock.problems(lock.project(), name, text) == [], "make lock"


def imported(path: Path) -> list[tuple[str, bool]]:
    """Packages of others that a module imports, and whether it does so whenever it is imported itself."""
    tree = ast.parse(path.read_text(encoding="utf-8"))
    tree.body = [
        node for node in tree.body if not (isinstance(node, ast.If) and "TYPE_CHECKING" in ast.unparse(node.test))
    ]
    at_once = {id(node) for statement in tree.body for node in ast.walk(statement) if not _within_function(statement)}
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module or ""]
        elif isinstance(node, ast.Call) and ast.unparse(node.func).endswith(("import_module", "extra_module")):
            first = node.args[0]
            names = [first.value] if isinstance(first, ast.Constant) and isinstance(first.value, str) else []
        else:
            continue
        found += [(name.partition(".")[0], id(node) in at_once) for name in names]
    return [(name, once) for name, once in found if name not in sys.stdlib_module_names and name != "bowden"]


def _within_function(node: ast.stmt) -> bool:
    return isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)


def test_what_is_imported_is_a_dependency_or_comes_with_an_extra() -> None:
    """A package that is only there because another one brings it goes when that one does."""
    said = lock.project()
    core = {canonicalize_name(Requirement(one).name) for one in said["dependencies"]}
    extras = {
        canonicalize_name(Requirement(one).name): extra
        for extra in sorted({*EXTRA_MODULES.values()})
        for one in said["optional-dependencies"][extra]
    }
    wrong = []
    for path in sorted(PACKAGE.rglob("*.py")):
        for module, at_once in imported(path):
            if module in EXTRA_MODULES:
                assert EXTRA_MODULES[module] == extras[canonicalize_name(PACKAGE_OF.get(module, module))]
                if at_once:
                    wrong.append(f"{path.relative_to(PACKAGE)} imports {module}, which an extra brings, at once")
            elif module not in OF_THE_USER and not {canonicalize_name(name) for name in _owners(module)} & core:
                wrong.append(f"{path.relative_to(PACKAGE)} imports {module}, which pyproject.toml does not name")
    assert wrong == []


CORE_ALONE = """
import sys
for name in {blocked}:
    sys.modules[name] = None
from bowden.app.main import run
for line in {commands}:
    assert run(line.split()) == 0, line
assert run("campaign study.toml".split()) == 2
"""


def test_the_core_alone_simulates_identifies_and_draws(tmp_path: Path) -> None:
    commands = (
        "init",
        "simulate rig.toml --duration 12 --csv --law observer",
        "identify out/simulate/observer.npz",
        "reproduce --only fig4",
    )
    (tmp_path / "study.toml").write_text('runs = 2\nlaws = ["uncompensated"]\n[vary]\n"servo.damping" = 1.0\n')
    blocked = sorted({*EXTRA_MODULES, *OF_THE_USER, "hypothesis"})
    script = CORE_ALONE.format(blocked=blocked, commands=commands)
    done = subprocess.run(
        [sys.executable, "-P", "-W", "error", "-c", script], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert 'a campaign needs the package pyarrow, which is not installed; pip install "bowden[parquet]"' in done.stderr
    assert not (tmp_path / "out" / "campaign").exists()


def _owners(module: str) -> list[str]:
    return [PARTS[module]] if module in PARTS else list(OWNERS.get(module, []))


@pytest.mark.long
def test_a_clean_environment_has_all_that_the_core_needs(built: tuple[Path, Path], tmp_path: Path) -> None:
    pip = [
        sys.executable,
        "-m",
        "pip",
        "download",
        "--quiet",
        "--no-deps",
        "--dest",
        str(tmp_path),
        "typing-inspection",
    ]
    if subprocess.run(pip, capture_output=True, check=False).returncode:
        pytest.skip("no package index is reached from here")
    assert list(release.installed_problems(built[0], tmp_path)) == []
