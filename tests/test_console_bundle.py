"""The console's page: the bundle in the package belongs to its sources, is small, and trusts no text."""

import hashlib
import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
WEB = ROOT / "web"
STATIC = ROOT / "src" / "bowden" / "console" / "static"
LOOSE = ("build.mjs", "package.json", "package-lock.json", "tsconfig.json")
MOST_BYTES = 150_000


def sources() -> list[Path]:
    found = [path for folder in ("src", "static") for path in (WEB / folder).rglob("*") if path.is_file()]
    return sorted([*found, *(WEB / name for name in LOOSE)], key=lambda path: path.relative_to(WEB).as_posix())


def test_the_bundle_was_made_from_these_sources() -> None:
    made = hashlib.sha256()
    for path in sources():
        made.update(path.relative_to(WEB).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    for name in ("console.js", "console.css"):
        head = (STATIC / name).read_text(encoding="utf-8").splitlines()[0]
        assert f"sources sha256:{made.hexdigest()} " in head, f"{name} is older than web/: make console"


@pytest.mark.parametrize("name", ["index.html", "favicon.svg"])
def test_what_is_only_copied_is_the_same(name: str) -> None:
    assert (STATIC / name).read_bytes() == (WEB / "static" / name).read_bytes()


def test_the_bundle_is_made_again_to_the_byte(tmp_path: Path) -> None:
    node = shutil.which("node")
    if node is None or not (WEB / "node_modules" / "esbuild").is_dir():
        pytest.skip("no Node, or no web/node_modules: npm --prefix web ci")
    subprocess.run([node, "build.mjs", "--out", str(tmp_path)], cwd=WEB, check=True, capture_output=True)
    for path in sorted(STATIC.iterdir()):
        assert (tmp_path / path.name).read_bytes() == path.read_bytes(), f"{path.name} differs: make console"


def test_the_page_is_small() -> None:
    assert (STATIC / "console.js").stat().st_size <= MOST_BYTES


@pytest.mark.parametrize("path", sorted((WEB / "src").glob("*.ts")), ids=lambda path: path.name)
def test_no_text_becomes_html_or_code(path: Path) -> None:
    source = path.read_text(encoding="utf-8")
    ways = r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|\beval\b|new Function|createContextualFragment"
    assert re.findall(ways, source) == []
    assert re.findall(r"DOMParser|srcdoc|javascript:|setAttribute\(\s*[\"'](on|style)", source) == []


def test_the_page_loads_nothing_from_elsewhere_and_has_no_inline_code() -> None:
    page = (STATIC / "index.html").read_text(encoding="utf-8")
    assert re.findall(r"(?:src|href)=\"(?!/static/)", page) == []
    assert re.findall(r"<script[^>]*>[^<]|<style|\sstyle=|\son\w+=", page) == []
    for name in ("console.js", "console.css"):
        assert re.findall(r"(?:url\(|import\s*\()", (STATIC / name).read_text(encoding="utf-8")) == []


def test_versions_are_exact_and_the_lock_names_no_host() -> None:
    package = (WEB / "package.json").read_text(encoding="utf-8")
    assert re.findall(r"\"[\^~>*]", package) == []
    assert '"resolved"' not in (WEB / "package-lock.json").read_text(encoding="utf-8")
