"""The notebooks of docs/notebooks: they run with what a user has, and keep outputs that hold for everyone."""

import ast
import importlib.util
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[1]
NOTEBOOKS = sorted((ROOT / "docs" / "notebooks").glob("*.ipynb"))
NUMBER = re.compile(r"[-−]?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def name_of(path: Path) -> str:
    return path.stem


def read(path: Path) -> Any:
    return json.loads(path.read_text(encoding="utf-8"))


def code_of(notebook: Any) -> list[Any]:
    return [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]


def printed(notebook: Any) -> list[str]:
    """What each cell prints, without numbers and spaces, which differ a little from one processor to another."""
    texts = ["".join("".join(one.get("text", "")) for one in cell["outputs"]) for cell in code_of(notebook)]
    return [re.sub(r"\s+", " ", NUMBER.sub("#", text)) for text in texts]


@pytest.mark.parametrize("path", NOTEBOOKS, ids=name_of)
def test_a_notebook_needs_nothing_but_the_public_face(path: Path) -> None:
    allowed = {"bowden", "numpy", "matplotlib.pyplot", "typing", "pathlib"}
    for cell in code_of(read(path)):
        for node in ast.walk(ast.parse("".join(cell["source"]))):
            if isinstance(node, ast.Import):
                assert {name.name for name in node.names} <= allowed
            elif isinstance(node, ast.ImportFrom):
                assert node.module in allowed
        assert all(len(line) <= 100 for line in "".join(cell["source"]).splitlines()), "the page cuts longer lines"


@pytest.mark.skipif(
    not all(importlib.util.find_spec(name) for name in ("nbclient", "ipykernel")),
    reason="nbclient and ipykernel are not installed",
)
@pytest.mark.parametrize("path", NOTEBOOKS, ids=name_of)
def test_a_notebook_runs_from_its_first_cell_to_its_last_and_prints_what_it_keeps(path: Path, tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "tools" / "make_notebooks.py"), "--to", str(tmp_path), path.stem]
    environment = os.environ | {"PYTHONPATH": os.pathsep.join([str(ROOT / "src"), os.environ.get("PYTHONPATH", "")])}
    done = subprocess.run(command, capture_output=True, text=True, timeout=280, env=environment)
    assert done.returncode == 0, done.stderr[-3000:]
    now, kept = read(tmp_path / path.name), read(path)
    kinds = [[one["output_type"] for one in cell["outputs"]] for cell in code_of(now)]
    assert kinds == [[one["output_type"] for one in cell["outputs"]] for cell in code_of(kept)]
    assert printed(now) == printed(kept), "make notebooks"


def test_a_line_of_progress_is_one_line_and_ends(capsys: pytest.CaptureFixture[str]) -> None:
    from bowden.operations.support.progress import reported

    calls: list[tuple[str, float]] = []
    with reported(lambda what, share: calls.append((what, share)), "tune") as report:
        report("searching", 0.5)
    assert calls == [("searching", 0.5)]
    for given in (None, False, True):  # no terminal here: nothing is written
        with reported(given, "tune") as report:
            report("searching", 0.5)
    assert capsys.readouterr() == ("", "")


def test_a_terminal_gets_its_line_again_and_again(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    from bowden.operations.support.progress import reported

    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    with reported(True, "tune") as report:
        report("searching", 0.5)
    assert capsys.readouterr().err == f"\rtune:  50 %  searching\r{'tune: done':<22}\n"
