"""Check that what is here may be released: `make release`; CONTRIBUTING.md has the rest.

python tools/release.py              # versions, locks, wheel and sdist and what is in them
python tools/release.py --install    # and a clean environment into which the wheel is installed (needs an index)
"""

import re
import subprocess
import sys
import tarfile
import tempfile
import venv
import zipfile
from collections.abc import Iterator
from pathlib import Path

import lock

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "bowden"

LARGEST_WHEEL = 2_000_000
"""Larger, and something is in it that does not belong there [bytes]."""
LARGEST_INSTALL = 450_000_000
"""Of all that a core install brings but pip itself, compiled modules included [bytes]."""
MUST_HAVE = (
    "py.typed",
    "paper/calibration.toml",
    "paper/claims.toml",
    "paper/plausible_sets.csv",
    "plants/presets/paper.toml",
    "report/templates/page.html",
    "report/templates/page.css",
    "export/templates/arduino.cpp",
    "export/templates/board.cpp",
    "export/templates/loop.h",
    "export/templates/Makefile",
    "export/templates/README.md",
    "export/templates/module.c",
    "export/templates/module.h",
    "export/templates/platformio.ini",
    "export/templates/replay.c",
    "export/templates/loop.c",
    "console/static/index.html",
    "console/static/console.js",
    "console/static/console.css",
    "console/static/favicon.svg",
    "console/static/third-party.txt",
)
"""What is no Python and is needed none the less."""
SOURCES = ("pyproject.toml", "README.md", "LICENSE", "CHANGELOG.md", "CITATION.cff", "Makefile", "tests/conftest.py")
"""What a source distribution must have beside the package."""
_FOREIGN = re.compile(r"(^|/)(__pycache__|\.venv|\.git|\.ci|\.\w+_cache|\.hypothesis|out|dist|build|shared)(/|$)")
_DATA = re.compile(r"\.(pyc|csv|gz|mat|mcap|parquet|npz|npy)$")


def versions() -> dict[str, str]:
    """Where a version is written → which."""
    init = re.search(r'^__version__ = "(.+)"$', (PACKAGE / "__init__.py").read_text(encoding="utf-8"), re.MULTILINE)
    cited = re.search(r"^version: (.+)$", (ROOT / "CITATION.cff").read_text(encoding="utf-8"), re.MULTILINE)
    changed = re.search(r"^## \[?(\d[\w.]*)", (ROOT / "CHANGELOG.md").read_text(encoding="utf-8"), re.MULTILINE)
    found = {"bowden.__version__": init, "CITATION.cff": cited, "CHANGELOG.md": changed}
    return {"pyproject.toml": lock.project()["version"]} | {name: one[1] if one else "" for name, one in found.items()}


def build(folder: Path) -> tuple[Path, Path]:
    """Wheel and source distribution, made by hatchling without a network; the wheel from the unpacked sources.

    Raises:
        subprocess.CalledProcessError: they cannot be built.
    """
    hatchling = [sys.executable, "-P", "-m", "hatchling", "build", "-d", str(folder)]
    subprocess.run([*hatchling, "-t", "sdist"], cwd=ROOT, check=True, capture_output=True)
    (sources,) = folder.glob("*.tar.gz")
    with tempfile.TemporaryDirectory() as scratch, tarfile.open(sources) as packed:
        packed.extractall(scratch, filter="data")
        (unpacked,) = Path(scratch).iterdir()
        subprocess.run([*hatchling, "-t", "wheel"], cwd=unpacked, check=True, capture_output=True)
    (wheel,) = folder.glob("*.whl")
    return wheel, sources


def package_files() -> set[str]:
    """What the package consists of, by the names that it has in a wheel."""
    files = (path for path in PACKAGE.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
    return {path.relative_to(PACKAGE.parent).as_posix() for path in files}


def wheel_problems(wheel: Path) -> Iterator[str]:
    """What is wrong with a wheel."""
    with zipfile.ZipFile(wheel) as packed:
        names = set(packed.namelist())
        about = next(name for name in names if name.endswith(".dist-info/METADATA"))
        metadata = packed.read(about).decode()
        points = packed.read(about.replace("METADATA", "entry_points.txt")).decode()
    info = about.rpartition("/")[0]
    inside = {name for name in names if not name.startswith(f"{info}/")}
    yield from (f"wheel: {name} is missing" for name in sorted(package_files() - inside))
    yield from (f"wheel: {name} does not belong there" for name in sorted(inside - package_files()))
    yield from (f"wheel: bowden/{name} is missing" for name in MUST_HAVE if f"bowden/{name}" not in inside)
    if f"{info}/licenses/LICENSE" not in names:
        yield "wheel: the licence is missing"
    if "bowden = bowden.app.main:main" not in points or "[can.interface]" not in points:
        yield "wheel: its entry points are not those of pyproject.toml"
    if f"Version: {lock.project()['version']}\n" not in metadata or "Requires-Python: >=3.11\n" not in metadata:
        yield "wheel: its metadata are not those of pyproject.toml"
    if not wheel.name.endswith("-py3-none-any.whl"):
        yield f"wheel: {wheel.name} is not for any system"
    if wheel.stat().st_size > LARGEST_WHEEL:
        yield f"wheel: {wheel.stat().st_size / 1e6:.1f} MB"


def source_problems(sources: Path) -> Iterator[str]:
    """What is wrong with a source distribution."""
    with tarfile.open(sources) as packed:
        names = {name.partition("/")[2] for name in packed.getnames()}
    for name in (*SOURCES, *(f"src/{one}" for one in package_files())):
        if name not in names:
            yield f"sdist: {name} is missing"
    for name in sorted(names):
        kept = name.startswith("tests/data/") and not name.endswith(".pyc")
        kept = kept or name.removeprefix("src/bowden/") in MUST_HAVE
        if _FOREIGN.search(name) or (_DATA.search(name) and not kept):
            yield f"sdist: {name} does not belong there"


def installed_problems(wheel: Path, folder: Path) -> Iterator[str]:
    """What is wrong with the wheel in a clean environment, in which nothing but what it asks for is installed."""
    venv.create(folder / "env", with_pip=True)
    python = folder / "env" / "bin" / "python"
    pip = [str(python), "-m", "pip", "--disable-pip-version-check", "install", "--quiet"]
    done = subprocess.run([*pip, str(wheel)], capture_output=True, text=True, check=False)
    if done.returncode:
        yield f"install: {done.stderr.strip()[-300:]}"
        return
    size = sum(path.stat().st_size for path in _installed(python))
    if size > LARGEST_INSTALL:
        yield f"install: {size / 1e6:.0f} MB, and {LARGEST_INSTALL / 1e6:.0f} MB are allowed"
    bowden, version = str(python.with_name("bowden")), lock.project()["version"]
    said = subprocess.run([bowden, "--version"], capture_output=True, text=True, check=False).stdout
    if version not in said:
        yield f"install: bowden --version says {said.strip()!r}"
    commands = (
        ["init"],
        ["simulate", "rig.toml", "--law", "adaptive", "--duration", "20", "--csv"],
        ["identify", "out/simulate/adaptive.csv"],
        ["check", "rig.toml"],
        ["run", "rig.toml", "--twin", "--auto", "--duration", "3"],
    )
    for command in commands:
        ran = subprocess.run([bowden, *command], cwd=folder, capture_output=True, text=True, check=False)
        if ran.returncode:
            yield f"install: bowden {' '.join(command)} exits with {ran.returncode}: {ran.stderr.strip()[-300:]}"
    typed = "import bowden, pathlib; assert (pathlib.Path(bowden.__file__).parent / 'py.typed').is_file()"
    if subprocess.run([str(python), "-P", "-c", typed], cwd=folder, check=False).returncode:
        yield "install: py.typed is missing"


def _installed(python: Path) -> Iterator[Path]:
    """The files of an environment but for pip's own."""
    for packages in python.parents[1].glob("lib/python3*/site-packages"):
        for path in packages.rglob("*"):
            own = path.relative_to(packages).parts[0]
            if path.is_file() and not own.startswith(("pip", "setuptools", "pkg_resources", "_distutils_hack")):
                yield path


def main() -> None:
    """All checks; exits with 1 and says what is wrong."""
    found = versions()
    problems = [f"versions differ: {found}"] if len(set(found.values())) > 1 else []
    for name in lock.LOCKS:
        text = (ROOT / "requirements" / f"{name}.txt").read_text(encoding="utf-8")
        problems += lock.problems(lock.project(), name, text)
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        wheel, sources = build(folder)
        problems += [*wheel_problems(wheel), *source_problems(sources)]
        print(
            f"{wheel.name}: {wheel.stat().st_size / 1e6:.2f} MB; {sources.name}: {sources.stat().st_size / 1e6:.2f} MB"
        )
        if "--install" in sys.argv[1:]:
            problems += installed_problems(wheel, folder)
    print("\n".join(problems) if problems else f"{found['pyproject.toml']} may be released")
    sys.exit(bool(problems))


if __name__ == "__main__":
    main()
