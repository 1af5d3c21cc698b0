"""The benchmarks still fit the package: every module imports, and ours is fitted to the searches' log."""

import importlib
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import results_page

BENCHMARKS = Path(__file__).parents[1] / "benchmarks"


@pytest.fixture(autouse=True)
def among_the_benchmarks(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [str(BENCHMARKS), *sys.path])


@pytest.mark.parametrize("name", sorted(file.stem for file in BENCHMARKS.glob("*.py")))
def test_every_module_imports(name: str) -> None:
    importlib.import_module(name)


def test_every_part_has_its_module() -> None:
    modules = [module for module, *_ in importlib.import_module("run").PARTS.values() if module]
    assert all(hasattr(importlib.import_module(module), "figures") for module in modules)


def test_a_long_part_goes_on_where_it_was_left(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    kept = importlib.import_module("kept").Kept("squares", tmp_path)

    def squares(first: int) -> Iterator[list[int]]:
        for k in range(first, 9):
            if k == 5 and not first:
                raise KeyboardInterrupt
            yield [k, k * k]

    with pytest.raises(SystemExit, match="5 of 9"):
        kept.filled(squares(0), 9)
    (file,) = tmp_path.iterdir()
    file.write_text(file.read_text() + "[5, 2")  # cut off
    assert not capsys.readouterr().err, "no terminal, no progress"
    there = kept.rows()
    assert there == [[k, k * k] for k in range(5)]
    assert kept.filled(squares(len(there)), 9) == kept.rows() == [[k, k * k] for k in range(9)]


def test_rows_that_are_written_become_a_table(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    rows = [["`play`", 0.5, "1 of 2"], ["`line`", -1.25, "–"]]
    measure = importlib.import_module("measure")
    measure.write_rows("some", "What", "cmd", ["law", "[°]", "n"], rows, "How.", tmp_path)
    monkeypatch.setattr(results_page, "RESULTS", tmp_path)
    assert results_page.results("some")["commit"]
    made = results_page.results_table("some")
    assert made.startswith("law | [°] | n\n---|---|---\n`play` | 0.5 | 1 of 2\n`line` | -1.25 | –\n\n*What. ")
    assert made.endswith(", `cmd`. How.*")
