"""The written pages: their Python runs, their commands work and print what is shown, their links resolve."""

import doctest
import importlib
import os
import re
import shlex
import sys
import textwrap
import warnings
from pathlib import Path
from typing import Any

import pytest

import bowden
import commands_page
import results_page
from bowden.app.main import run
from live_runs import SHARED_LIMITS, tries
from page_steps import PageFile, commands, steps
from walk import pages, walk_page

pytestmark = pytest.mark.usefixtures("undrawn")

ROOT = Path(__file__).parents[1]
PACKAGE = ROOT / "src" / "bowden"
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").rglob("*.md"))]
CURRENT = [page for page in PAGES if page.parent.name != "decisions"]
"""A decision says what was so when it was made; every other page says what is so."""
NUMBER = re.compile(r"(?<![\w.])[-−]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def page_id(path: Path) -> str:
    return str(path.relative_to(ROOT))


def blocks(path: Path, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```$", path.read_text(encoding="utf-8"), re.DOTALL | re.MULTILINE)


@pytest.mark.usefixtures("small_search")
@pytest.mark.parametrize("page", [page for page in PAGES if blocks(page, "python")], ids=page_id)
def test_python_on_a_page_runs(page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    run_python(page)


@pytest.mark.live
def test_the_tasks_of_the_package_run_as_they_are_printed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """From a log to a run on a twin; only that search and run are shorter than by default."""
    monkeypatch.chdir(tmp_path)
    assert run(["sample", "cable", "."]) == 0
    tune, live, tuned = bowden.tune, bowden.run, []

    def sooner(rig: bowden.Rig) -> Any:
        tuned.append(tune(rig, generations=1))
        return tuned[-1]

    def shorter(rig: bowden.Rig, **options: Any) -> Any:
        return live(rig.replace(limits=rig.limits._replace(**SHARED_LIMITS)), duration=3.0, **options)

    monkeypatch.setattr(bowden, "tune", sooner)
    monkeypatch.setattr(bowden, "run", shorter)
    text = bowden.__doc__ or ""
    (printed,) = re.findall(r"^    fit = bowden\.identify\(.*?(?=^\S|\Z)", text, re.DOTALL | re.MULTILINE)
    for _ in tries():
        names: dict[str, Any] = {"bowden": bowden}
        with warnings.catch_warnings(record=True) as said:  # a computer shared with others stalls, which ends the run
            warnings.simplefilter("always")
            exec(compile(textwrap.dedent(printed), "the tasks", "exec"), names)
        if not said:
            break
    assert all("the run was ended" in str(one.message) for one in said)
    assert names["rig"] == tuned[-1].rig  # whose gains may be as they were: the search found no better ones
    assert len(names["session"].trace()) > 0


def run_python(page: Path) -> None:
    """One page runs as one script in this folder; a block that begins with ``# name.py`` is that file's contents."""
    names: dict[str, object] = {}
    for i, block in enumerate(blocks(page, "python")):
        file = re.match(r"# (\w+\.py)\n", block)
        if file:
            Path(file[1]).write_text(block, encoding="utf-8")
        elif ">>>" in block:
            example = doctest.DocTestParser().get_doctest(block, names, f"{page.name}[{i}]", str(page), 0)
            assert doctest.DocTestRunner(verbose=False).run(example, clear_globs=False).failed == 0
            names = example.globs
        else:
            exec(compile(block, f"{page.name}[{i}]", "exec"), names)


SITE = (ROOT / "mkdocs.yml").read_text(encoding="utf-8")
IN_ORDER = re.findall(r"^ +- (?:[^:\n]+: )?([\w/-]+\.md)$", SITE, re.MULTILINE)
"""The pages in the order of the site."""


@pytest.mark.parametrize("page", [page for page in CURRENT if "made by make docs" in page.read_text()], ids=page_id)
def test_tables_are_those_of_the_results(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert text == results_page.with_tables(text), "make docs"


def test_every_page_has_its_place_in_the_site_and_in_the_index() -> None:
    pages = {str(page.relative_to(ROOT / "docs")) for page in CURRENT if page.is_relative_to(ROOT / "docs")}
    assert set(IN_ORDER) == pages
    assert len(IN_ORDER) == len(pages)
    listed = set(re.findall(r"\]\(([\w/-]+\.md)\)", (ROOT / "docs" / "README.md").read_text(encoding="utf-8")))
    assert listed == pages - {"README.md"}


def test_decisions_are_numbered_without_gaps() -> None:
    for number, path in enumerate(sorted((ROOT / "docs" / "decisions").glob("*.md")), 1):
        assert path.name.startswith(f"{number:04d}-")
        assert path.read_text(encoding="utf-8").startswith(f"# {number}. ")


def test_the_page_of_commands_is_current() -> None:
    page = (ROOT / "docs" / "commands.md").read_text(encoding="utf-8")
    assert page == commands_page.markdown(), "make docs"


def slug(heading: str) -> str:
    """The anchor that GitHub gives a heading."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", "-")


def headings(path: Path) -> set[str]:
    text = re.sub(r"^```.*?^```$", "", path.read_text(encoding="utf-8"), flags=re.DOTALL | re.MULTILINE)
    return {slug(heading) for heading in re.findall(r"^#+ (.+)$", text, re.MULTILINE)}


@pytest.mark.parametrize("page", PAGES, ids=page_id)
def test_links_resolve(page: Path) -> None:
    for target in re.findall(r"\]\(([^)\s]+)\)", page.read_text(encoding="utf-8")):
        if re.match(r"[a-z]+:", target):
            continue
        file, _, anchor = target.partition("#")
        goal = (page.parent / file).resolve() if file else page
        assert goal.exists(), f"{page_id(page)} links to {target}"
        if anchor:
            assert anchor in headings(goal), f"{page_id(page)} links to {target}"


ROOMS = sorted(folder.name for folder in PACKAGE.iterdir() if (folder / "__init__.py").exists())
_ROOM = "|".join(ROOMS)
DOTTED = re.compile(rf"(?<![\w./])(?:bowden\.(?:{_ROOM})|(?!control\.gains)(?:{_ROOM})\.[a-z_]\w*)(?:\.[A-Za-z_]\w*)+")
"""A name of the package with its module, as ``bowden.control.law`` or ``control.law.Law``; no key of a rig's gains."""
FILES = re.compile(r"(?<![\w/.~\-])(?:[\w\-]+/)+[\w\-]+\.(?:py|md|toml|csv|json|svg|png)\b")
OURS = ("src", "tests", "docs", "benchmarks", "examples", "tools", *ROOMS)


def is_there(name: str) -> bool:
    """Whether a dotted name of the package is a module, or something in one."""
    parts = name.split(".")
    for i in range(len(parts), 0, -1):
        try:
            found = importlib.import_module(".".join(parts[:i]))
        except ModuleNotFoundError:
            continue
        for part in parts[i:]:
            if part in getattr(found, "__annotations__", {}):  # a field without a default
                return True
            if not hasattr(found, part):
                return False
            found = getattr(found, part)
        return True
    return False


def lost_names(text: str) -> list[str]:
    """Dotted names of the package in a text that are not there."""
    found = {f"bowden.{name.removeprefix('bowden.')}" for name in DOTTED.findall(text) if not name.endswith(".json")}
    return sorted(name for name in found if not is_there(name))


@pytest.mark.parametrize("page", CURRENT, ids=page_id)
def test_names_and_files_on_a_page_are_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert not lost_names(text)
    for file in FILES.findall(text):
        if file.split("/")[0] in OURS:
            places = (ROOT / file, PACKAGE / file, ROOT / "docs" / file, page.parent / file)
            assert any(place.exists() for place in places), f"{page_id(page)} names {file}"


def test_names_in_docstrings_and_comments_are_there() -> None:
    lost = {
        str(path.relative_to(PACKAGE)): names
        for path in sorted(PACKAGE.rglob("*.py"))
        if (names := lost_names(" ".join(re.findall(r"`([a-z_.]+\.\w+)`", path.read_text(encoding="utf-8")))))
    }
    assert not lost


@pytest.mark.parametrize("page", [page for page in PAGES if commands(page)], ids=page_id)
def test_commands_and_options_exist(page: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for line in (one.text for one in commands(page)):
        program, *words = shlex.split(line)
        if program != "bowden" or words[0] == "--help":
            continue
        names = words[:2] if words[0] in ("log", "emg", "drive") else words[:1]
        assert run([*names, "--help"]) == 0, line
        known = capsys.readouterr().out
        for option in (word for word in words if word.startswith("--")):
            assert re.search(rf"{option}\b", known), f"{line}: {words[0]} has no {option}"


def same(given: str, wanted: str) -> bool:
    """Words equal, numbers within 2 % (or half a unit of what is shown), a table's lines left out."""

    def reduced(text: str) -> tuple[list[str], list[float]]:
        numbers = [float(number.replace("−", "-")) for number in NUMBER.findall(text)]
        return NUMBER.sub("#", re.sub(r"[─━]+", "", text)).split(), numbers

    (words, numbers), (wanted_words, wanted_numbers) = reduced(given), reduced(wanted)
    return words == wanted_words and numbers == pytest.approx(wanted_numbers, rel=0.02, abs=0.006)


@pytest.mark.parametrize("page", [page for page in PAGES if any(one.shown for one in commands(page))], ids=page_id)
def test_a_page_prints_what_it_shows(
    page: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Commands up to the last one whose output is shown, in an empty folder; … stands for lines that are left out."""
    monkeypatch.chdir(tmp_path)
    asked = steps(page)
    last = max(i for i, one in enumerate(asked) if not isinstance(one, PageFile) and one.shown)
    for one in asked[: last + 1]:
        if isinstance(one, PageFile):
            Path(one.name).write_text(one.text, encoding="utf-8")
            continue
        if one.elsewhere:
            continue
        name, *words = shlex.split(one.text)
        assert name == "bowden"
        code, printed = run(words), capsys.readouterr()
        assert code == one.exits, printed.err
        said = (printed.out + printed.err).splitlines()
        for line in (line for line in (one.shown or "").splitlines() if line.strip("─ …")):
            assert any(same(other, line) for other in said), f"{one.text} prints no {line!r} but\n{printed.out}"


@pytest.mark.live
@pytest.mark.long
@pytest.mark.parametrize("page", [page for page in pages() if commands(page)], ids=page_id)
def test_all_commands_of_a_page_end_as_it_says(page: Path, tmp_path: Path) -> None:
    """The same as `tools/walk.py`, in the environment of the tests."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    found = walk_page(page, tmp_path, dict(os.environ) | {"PATH": path})
    assert not [(one.command.text, one.exit_code, one.said) for one in found if not one.passed and not one.why_not]
