"""Chromium for the tests of the console's page: Debian's, driven by Playwright."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import console_chromium

AXE = Path(__file__).parents[2] / "web" / "node_modules" / "axe-core" / "axe.min.js"


@pytest.fixture(scope="session")
def playwright() -> Iterator[Any]:
    """What drives a browser."""
    sync = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed: the extra dev has it")
    if console_chromium.program() is None:
        pytest.skip("there is no Chromium: apt-get install chromium")
    with sync.sync_playwright() as started:
        yield started


@pytest.fixture(scope="session")
def browser(playwright: Any) -> Iterator[Any]:
    """One Chromium for all tests of this folder."""
    started = console_chromium.launched(playwright)
    yield started
    started.close()


@pytest.fixture
def page(browser: Any) -> Iterator[Any]:
    """A page of 1280 × 720; the test fails if the page reports an error of its scripts or its policy."""
    context = browser.new_context(viewport={"width": 1280, "height": 720})
    opened = context.new_page()
    errors: list[str] = []
    opened.on("pageerror", lambda error: errors.append(str(error)))
    opened.on("console", lambda message: errors.append(message.text) if "Content Security" in message.text else None)
    yield opened
    context.close()
    assert errors == []


@pytest.fixture(scope="session")
def axe() -> str:
    """The script that looks for barriers."""
    if not AXE.is_file():
        pytest.skip("web/node_modules has no axe-core: npm --prefix web ci")
    return AXE.read_text(encoding="utf-8")
