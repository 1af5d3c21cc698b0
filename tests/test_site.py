"""The site: its API pages, links, equations and notebooks; that it is built and loads nothing from elsewhere."""

import base64
import importlib
import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import bowden
import site_api
import site_notebooks
from site_check import loads
from site_links import relinked

ROOT = Path(__file__).parents[1]
PICTURE = b"\x89PNG\r\n\x1a\n"


def test_every_name_of_the_package_is_on_one_page_of_the_api() -> None:
    names = [name for page in site_api.PAGES.values() for name in page.names]
    assert sorted(names) == sorted({*bowden.__all__} - {"__version__"})


@pytest.mark.parametrize("name", [name for page in site_api.PAGES.values() for name in page.beside])
def test_what_stands_beside_is_there_and_is_described(name: str) -> None:
    module, _, own = name.rpartition(".")
    assert getattr(importlib.import_module(module), own).__doc__


@pytest.mark.parametrize(
    ("text", "origin", "uri", "made"),
    [
        ("[a](simulate.md#b)", "docs/run.md", "run.md", "[a](simulate.md#b)"),
        ("[a](#b)", "docs/run.md", "run.md", "[a](#b)"),
        ("![a](images/a.svg)", "docs/identify.md", "identify.md", "![a](images/a.svg)"),
        ("[x.py](../src/x.py) [b](../tests/y.py)", "docs/identify.md", "identify.md", "`x.py` b"),
        ("[`x`](../src/x.py)", "docs/identify.md", "identify.md", "`x`"),
        ("[a](docs/own_law.md#b)", "CONTRIBUTING.md", "contributing.md", "[a](own_law.md#b)"),
        ("[a](../../benchmarks/RESULTS.md)", "docs/background/emg.md", "background/emg.md", "[a](results.md)"),
        ("[a](decisions)", "docs/README.md", "README.md", "[a](decisions/index.md)"),
        ("[a](../emg.md)", "docs/notebooks/a.ipynb", "notebooks/a.md", "[a](../emg.md)"),
        ("[a](notebooks/a.ipynb)", "docs/README.md", "README.md", "[a](notebooks/a.md)"),
        ("[a](https://mcap.dev/spec)", "docs/logs.md", "logs.md", "[a](https://mcap.dev/spec)"),
        ("```\n[a](../src/x.py)\n```", "docs/identify.md", "identify.md", "```\n[a](../src/x.py)\n```"),
    ],
)
def test_links_are_made_for_the_site(text: str, origin: str, uri: str, made: str) -> None:
    assert relinked(text, origin, uri) == made


@pytest.mark.parametrize(
    ("name", "text", "found"),
    [
        ("a.html", '<script src="https://cdn.example/a.js"></script>', 1),
        ("a.html", '<link rel="stylesheet" href="//fonts.example/a.css"><img src="http://a.example/b.png">', 2),
        ("a.html", "<style>@import 'https://a.example/b.css'; a { background: url(//a.example/c) }</style>", 2),
        ("a.css", "a { background: url('https://a.example/c') }", 1),
        ("a.html", '<a href="https://a.example">a</a><img src="b.png"><code>https://a.example</code>', 0),
        ("a.css", "/* https://a.example */ a { background: url(b.png) }", 0),
    ],
)
def test_what_is_loaded_from_elsewhere_is_found(tmp_path: Path, name: str, text: str, found: int) -> None:
    (tmp_path / name).write_text(text, encoding="utf-8")
    assert len(loads(tmp_path).get(name, [])) == found


def test_a_notebook_is_a_page_with_its_results(tmp_path: Path) -> None:
    cells = [
        {"cell_type": "markdown", "source": ["# A cable\n", "Its loop."]},
        {
            "cell_type": "code",
            "source": "fit.plot()",
            "outputs": [
                {"output_type": "stream", "text": ["\x1b[1m0.2°\x1b[0m\n"]},
                {"output_type": "display_data", "data": {"image/png": base64.b64encode(PICTURE).decode()}},
                {"output_type": "execute_result", "data": {"text/plain": "0.5"}},
                {"output_type": "display_data", "data": {"text/html": ["<div>a\n<svg xmlns='s'>", "\n</svg></div>"]}},
            ],
        },
        {"cell_type": "code", "source": "", "outputs": []},
    ]
    path = tmp_path / "cable.ipynb"
    path.write_text(json.dumps({"cells": cells}), encoding="utf-8")
    text, pictures = site_notebooks.page(path)
    assert text.startswith("# A cable\n\n*The notebook [cable.ipynb](cable.ipynb), as it ran.*\n\nIts loop.")
    assert "```python\nfit.plot()\n```\n\n```text\n0.2°\n```\n\n![Drawn by the cell above](cable-1.png)" in text
    assert "```text\n0.5\n```" in text
    assert "<div>a </div>\n\n![Drawn by the cell above](cable-2.svg)" in text
    assert pictures == {"cable-1.png": PICTURE, "cable-2.svg": b"<svg xmlns='s'>\n</svg>"}


def test_equations_are_drawn_without_a_script() -> None:
    markdown = pytest.importorskip("markdown", reason="the extra bowden[docs] is not installed")
    equations = importlib.import_module("site_equations").Equations()
    made = markdown.Markdown(extensions=[equations, "fenced_code"])
    shown = made.convert(
        "With $a_1$ and `$b$`:\n\n```math\n\\frac{1}{2}\n```\n\n    $ bowden run\n\nIt costs 3$ or 4$."
    )
    assert shown.count("<math") == 2
    assert "<mfrac>" in shown
    assert "<code>$b$</code>" in shown
    assert "$ bowden run" in shown
    for page in sorted((ROOT / "docs").rglob("*.md")):
        assert "\\" not in "".join(re.findall(r"<math.*?</math>", made.convert(page.read_text(encoding="utf-8")))), page


def test_the_site_is_built_without_a_warning_and_loads_nothing(tmp_path: Path) -> None:
    pytest.importorskip("mkdocs", reason="the extra bowden[docs] is not installed")
    command = [sys.executable, "-m", "mkdocs", "build", "--strict", "--quiet", "--site-dir", str(tmp_path / "site")]
    surroundings = {**os.environ, "NO_MKDOCS_2_WARNING": "1"}
    built = subprocess.run(command, cwd=ROOT, env=surroundings, capture_output=True, text=True, check=False)
    assert built.returncode == 0, built.stdout + built.stderr
    site = tmp_path / "site"
    assert not loads(site)
    index = json.loads((site / "search" / "search_index.json").read_text(encoding="utf-8"))
    places = {entry["location"] for entry in index["docs"]}
    assert {"day_one_bench.html", "api/simulate.html", "background/theory.html", "decisions/index.html"} <= places
    assert "simulate(" in re.sub(r"<[^>]+>", "", (site / "api" / "simulate.html").read_text(encoding="utf-8"))
