"""The site: its API pages, links, equations and notebooks; that it is built and loads nothing from elsewhere."""

import json
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

import bowden
import site_api
from site_check import loads
from site_links import relinked

ROOT = Path(__file__).parents[1]


def test_every_name_of_the_package_is_on_one_page_of_the_api() -> None:
    names = [name for page in site_api.PAGES.values() for name in page.names]
    assert sorted(names) == sorted({*bowden.__all__} - {"__version__"})


@pytest.mark.parametrize(
    ("text", "origin", "uri", "made"),
    [
        ("[a](simulate.md#b)", "docs/run.md", "run.md", "[a](simulate.md#b)"),
        ("[a](#b)", "docs/run.md", "run.md", "[a](#b)"),
        ("![a](images/a.svg)", "docs/identify.md", "identify.md", "![a](images/a.svg)"),
        ("[x.py](../src/x.py) [b](../tests/y.py)", "docs/identify.md", "identify.md", "`x.py` b"),
        ("[`x`](../src/x.py)", "docs/identify.md", "identify.md", "`x`"),
        ("[a](docs/own_law.md#b)", "CONTRIBUTING.md", "contributing.md", "[a](own_law.md#b)"),
        ("[a](decisions)", "docs/README.md", "README.md", "[a](decisions/index.md)"),
        ("[a](../emg.md)", "docs/notebooks/a.ipynb", "notebooks/a.md", "[a](../emg.md)"),
        ("[a](notebooks/a.ipynb)", "docs/README.md", "README.md", "[a](notebooks/a.md)"),
        ("[a](https://mcap.dev/spec)", "docs/logs.md", "logs.md", "[a](https://mcap.dev/spec)"),
        ("```\n[a](../src/x.py)\n```", "docs/identify.md", "identify.md", "```\n[a](../src/x.py)\n```"),
    ],
)
def test_links_are_made_for_the_site(text: str, origin: str, uri: str, made: str) -> None:
    assert relinked(text, origin, uri) == made


@pytest.mark.long
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
