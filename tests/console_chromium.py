"""Chromium for tests and benchmarks of the console's page: Debian's, driven by Playwright."""

import shutil
from pathlib import Path
from typing import Any

FLAGS = (
    "--no-sandbox",
    "--disable-gpu",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)


def program() -> str | None:
    """Where Chromium is; None where it is not."""
    return next((path for name in ("chromium", "chromium-browser") if (path := shutil.which(name))), None)


def launched(playwright: Any, *, keeps_pages: bool = False) -> Any:
    """A browser without a window.

    Args:
        playwright: that drives it.
        keeps_pages: keep pages for the way back, as Chromium does and Playwright's does not.
    """
    left_out = ["--disable-back-forward-cache"] if keeps_pages else []
    return playwright.chromium.launch(executable_path=program(), args=list(FLAGS), ignore_default_args=left_out)


def processes(browser: Any) -> dict[int, str]:
    """Its processes: id → kind, such as ``browser`` and ``renderer``."""
    tools = browser.new_browser_cdp_session()
    found = {one["id"]: one["type"] for one in tools.send("SystemInfo.getProcessInfo")["processInfo"]}
    tools.detach()
    return found


def descendants(of: int) -> list[int]:
    """The process itself and all that come from it, also those that DevTools does not name."""
    found, new = [of], [of]
    while new:
        children = [int(one) for pid in new for task in _tasks(pid) for one in _words(task / "children")]
        new = [pid for pid in children if pid not in found]
        found += new
    return found


def _tasks(pid: int) -> list[Path]:
    try:
        return list(Path(f"/proc/{pid}/task").iterdir())
    except OSError:
        return []


def _words(file: Path) -> list[str]:
    try:
        return file.read_text().split()
    except OSError:
        return []
