"""The part of `console_kills` that needs a browser: the console's page in Chromium, whose processes are killed, halted
and sent away.
"""

import contextlib
import os
import random
import signal
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

from playwright.sync_api import Error, sync_playwright

import console_chromium
from console_kills import (
    A_SESSION,
    BROWSER_KINDS,
    STILL,
    BarePage,
    Bench,
    Loss,
    armed,
    await_moment,
    bench_of,
    drawn,
    flushed,
)

Back = Callable[[], None]
_TAKES = 20_000.0
"""Of a command to the browser, at most [ms]."""
BACK = (0.9, 2.5)


class BrowserPage:
    """The page in a tab of its own, beside another one; arming takes the second that its user takes."""

    def __init__(self, browser: Any, bench: Bench) -> None:
        self._bench, self.browser = bench, browser
        self.context = browser.new_context(viewport={"width": 1280, "height": 720})
        self.context.set_default_timeout(_TAKES)
        self.other = self.context.new_page()
        self.tab = self.context.new_page()
        self.tab.goto(f"http://127.0.0.1:{bench.console.port}/?token={bench.console.token}")
        self._button("Take control").click()
        self.kinds = console_chromium.processes(browser)

    def _button(self, name: str) -> Any:
        return self.tab.get_by_role("button", name=name, exact=True)

    def ask(self, request: str) -> str:
        """Arm or run, as its user does; why it does nothing."""
        mode = self._bench.watcher.mode
        try:
            if request == "run":
                self._button("Run").click(timeout=1000.0)
                return ""
            if request == "acknowledge":
                self._button("Acknowledge fault").click(timeout=1000.0)
                return ""
            box = self._button("Hold to arm").bounding_box()
            self.tab.mouse.move(box["x"] + 30, box["y"] + 10)
            self.tab.mouse.down()
            deadline = time.monotonic() + 4.0
            while self._bench.watcher.mode == mode and time.monotonic() < deadline:
                time.sleep(0.01)
            self.tab.mouse.up()
        except Error as error:
            return str(error)
        return "" if self._bench.watcher.mode != mode else "nothing came of it"

    def close(self) -> None:
        """End its tabs, if they are there."""
        with contextlib.suppress(Error):
            if self.browser.is_connected():
                self.context.close()


def _ready(bench: Bench) -> None:
    """A session that stands, by a page without a browser."""
    page = BarePage(bench)
    try:
        if bench.watcher.state["phase"] == "idle":
            page.begin()
            bench.until(lambda state: state["phase"] == "live" and state["run"], "the session", 180.0)
        bench.log = str(bench.watcher.state["run"]["log"])
        if bench.watcher.mode == "latched":
            page.ask("acknowledge")
        bench.until(lambda state: state["run"]["mode"] == "stopped", "a stop")
    finally:
        page.close()
    bench.until(lambda state: state["you"]["controller"] is None, "nobody in control")


def _case(bench: Bench, browser: Any, loss: Loss, more: random.Random) -> None:
    _ready(bench)
    page = BrowserPage(browser, bench)
    try:
        bench.until(lambda state: state["you"]["controller"] is not None, "control")
        await_moment(bench, page, armed(bench, page) + loss.moment)
        loss.load = os.getloadavg()[0]
        loss.at = time.monotonic()
        back = _taken(page, loss.kind.partition(": ")[2])
        loss.took = time.monotonic() - loss.at
        time.sleep(max(0.0, loss.at + more.uniform(*BACK) - time.monotonic()))
        bench.until(lambda state: state["run"]["mode"] in ("stopped", "latched"), "the release")
        back()
        time.sleep(STILL)
        loss.controls = bench.watcher.state["you"]["controller"] is not None
        loss.until = time.monotonic()
    finally:
        page.close()


def _taken(page: BrowserPage, how: str) -> Back:
    """Take it away; what gives it back."""
    renderers = [pid for pid, kind in page.kinds.items() if kind == "renderer"]
    first = next(pid for pid, kind in page.kinds.items() if kind == "browser")
    if how == "tab closed":
        page.tab.close()
    elif how == "tab hidden":
        page.context.new_cdp_session(page.tab).send("Emulation.setFocusEmulationEnabled", {"enabled": False})
        page.other.bring_to_front()
        return lambda: page.tab.bring_to_front()
    elif how == "tab crashed":
        _each(renderers, signal.SIGKILL)
    elif how == "tab frozen":
        _each(renderers, signal.SIGSTOP)
        return lambda: _each(renderers, signal.SIGCONT)
    elif how == "navigated away":
        page.tab.goto("about:blank", wait_until="commit")
        return lambda: page.tab.go_back(wait_until="commit")
    elif how == "browser killed":
        os.kill(first, signal.SIGKILL)
    else:
        all_ = console_chromium.descendants(first)
        _each(all_, signal.SIGSTOP)
        return lambda: _each(all_, signal.SIGCONT)
    return lambda: None


def _each(processes: list[int], number: signal.Signals) -> None:
    for pid in processes:
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, number)


def chromium_cases(numbers: Iterable[int]) -> Iterator[list[Any]]:
    """`console_kills.COLUMNS` of each case in Chromium."""
    waiting = list(numbers)
    with tempfile.TemporaryDirectory() as name, sync_playwright() as playwright:
        while waiting:
            with bench_of(Path(name), waiting[0]) as bench:
                yield from _console(playwright, bench, waiting)


def _console(playwright: Any, bench: Bench, waiting: list[int]) -> Iterator[list[Any]]:
    """Cases until one of them goes wrong, or there is none left."""
    browser = console_chromium.launched(playwright)
    try:
        while waiting:
            number = waiting.pop(0)
            kind, moment, more = drawn(number, BROWSER_KINDS)
            loss = Loss(number, kind, moment, BROWSER_KINDS[kind].bound)
            bench.losses.append(loss)
            try:
                _case(bench, browser, loss, more)
            except (AssertionError, Error, OSError, KeyError) as error:
                loss.said = f"{type(error).__name__}: {error}"[:300]
            if len(bench.losses) >= A_SESSION or not waiting or loss.said:
                yield from flushed(bench, lambda: BarePage(bench))
                bench.log = ""
            if loss.said:
                return
            if not browser.is_connected():
                browser = console_chromium.launched(playwright)
    finally:
        with contextlib.suppress(Error):
            browser.close()
