"""What the console costs while the loop runs: frames a second in Chromium, processor time, the loop's punctuality,
memory.

    python benchmarks/console_cost.py drawing|memory --minutes 2                   # a try

`drawing`: a run on the twin that a page without curves controls, and beside it one in Chromium that shows eight curves
of 1 kHz over 10 s, and joint over motor. That one comes and goes, turn by turn within one run, so that the loop's
figures with and without it are of the same minutes. `memory`: three pages with eight curves each look on for as long
as asked, and the process of the console may not grow.
"""

import argparse
import contextlib
import json
import os
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

import screen

sys.path.append(str(Path(__file__).parents[1] / "tests"))  # where the page's client is

from bowden.live.row import AT
from bowden.safety.state import Mode
from console_client import Page, RunningConsole, running_console
from console_kills import rows_of
from live_runs import SHARED
from measure import Figure
from steady_run import state_of

TURN, SETTLED = 20.0, 6.0
"""A turn with or without the page, and how much of its beginning does not count [s]."""
FRAMES, LONGEST = 30.0, 0.040
"""Fewest frames a second; 95th percentile from one to the next at most [s]."""
SHARE = 0.2
"""Of a core, at most."""
MOST_GROWTH = 4.0
"""Of resident memory [MB]."""
FILLED = 660.0
"""By then the stores of rows of 5 minutes have been filled twice, and all their pages touched [s]."""
EVERY = 2.0
VIEWERS, TRACES = 3, 8
RIG = f"""[reference]
kind = 'periodic_minimum_jerk'
low_deg = 0.0
high_deg = 50.0
period_s = 4.0
[scenario]
duration_s = {{seconds}}
[limits]
{SHARED}"""
"""Limits that a computer shared with others keeps: what is measured here is in the log, and one run goes on."""


@contextlib.contextmanager
def running(folder: Path, seconds: float) -> Iterator[tuple[RunningConsole, Page]]:
    """A console, and a page in control of its session, which is not begun."""
    (folder / "rig.toml").write_text(RIG.format(seconds=seconds))
    with running_console(folder / "rig.toml", folder / "out", "--twin") as console:
        page = console.page().open().take()
        page.until(lambda state: state["phase"] == "idle", 60.0, "idle")
        page.start()
        yield console, page
        page.close()


def seen(page: Page) -> None:
    """Look at eight curves over 10 s."""
    columns = [one["name"] for one in page.state["run"]["columns"]][:TRACES]
    page.say(json.dumps({"view": {"columns": columns, "seconds": 10, "pixels": 900, "xy": True, "number": 1}}))


def revived(page: Page) -> bool:
    """Run on, where a computer that stalls has stopped the run or taken the control from the page; whether it does."""
    try:
        page.take().run()
    except AssertionError as error:
        print(f"not yet: {str(error)[:100]}", file=sys.stderr)
        return False
    return True


def end(page: Page) -> None:
    """End the session."""
    page.take().post("/api/request", request="end")
    page.until(lambda state: state["phase"] == "idle", 60.0, "the end")


def used(pid: int) -> float:
    """Processor time of a process, without its children [s]."""
    words = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")


def stolen() -> float:
    """Time that the hypervisor gave to others, of all processors [s]."""
    words = Path("/proc/stat").read_text().partition("\n")[0].split()
    return int(words[8]) / os.sysconf("SC_CLK_TCK")


def turns(minutes: float) -> Iterator[dict[str, Any]]:
    """Figures of each turn, in their order."""
    from playwright.sync_api import sync_playwright

    import console_chromium

    count = 2 * max(1, round(60.0 * minutes / (2.0 * TURN)))
    with (
        tempfile.TemporaryDirectory() as name,
        running(Path(name), count * TURN + 120.0) as (console, page),
        sync_playwright() as playwright,
    ):
        browser = console_chromium.launched(playwright)
        tab = browser.new_page(viewport={"width": 1280, "height": 720})
        link = f"http://127.0.0.1:{console.port}/"
        tab.goto(f"{link}?token={console.token}")
        while not revived(page):
            tab.wait_for_timeout(1e3)
        tab.wait_for_timeout(12_000)  # a window full of curves
        found = [_turn(console, page, tab, link, shows=number % 2 == 0) for number in range(count)]
        browser.close()
        log = console.out / f"{page.state['run']['log']}.mcap"
        end(page)
        table, start = rows_of(log)
    when = table[:, AT["time"]] + start
    for one in found:
        rows = table[np.searchsorted(when, one["from"]) : np.searchsorted(when, one["to"])]
        late = rows[:, AT["lateness"]]
        yield one | {
            "cycles": len(rows),
            "overruns": int(rows[:, AT["overruns"]].sum()),
            "times": int(np.count_nonzero(rows[:, AT["overruns"]])),
            "late_p99_us": 1e6 * float(np.quantile(late, 0.99)),
            "late_most_us": 1e6 * float(late.max()),
            "running": float(np.mean(rows[:, AT["mode"]] == Mode.RUNNING)),
        }


def _turn(console: RunningConsole, page: Page, tab: Any, link: str, *, shows: bool) -> dict[str, Any]:
    """One turn with the page or without it."""
    while page.mode != "running":
        revived(page)
    tab.goto(link if shows else "about:blank")
    tab.wait_for_timeout(1e3 * SETTLED)
    begun, before, before_stolen = time.monotonic(), used(console.process.pid), stolen()
    since = tab.evaluate("performance.now()")
    tab.wait_for_timeout(1e3 * (TURN - SETTLED))
    ended, after = time.monotonic(), used(console.process.pid)
    found = {
        "shows": shows,
        "from": begun,
        "to": ended,
        "share": (after - before) / (ended - begun),
        "load": os.getloadavg()[0],
        "stolen": (stolen() - before_stolen) / (ended - begun),
    }
    if shows:
        drawn = [one for one in tab.evaluate("window.bowdenConsole.drawn()") if one["at"] > since]
        steps = np.diff([one["at"] for one in drawn]) * 1e-3
        found |= {
            "rate": len(drawn) / (ended - begun),
            "p95": float(np.quantile(steps, 0.95)),
            "longest": float(steps.max()),
            "took_ms": float(np.mean([one["took"] for one in drawn])),
        }
    return found


def figures(minutes: float) -> tuple[list[Figure], str]:
    """Figures of the drawing over so many minutes, and how they were made."""
    found = list(turns(minutes))
    for one in found:
        print({name: round(value, 4) for name, value in one.items()}, file=sys.stderr)
    by, without = ([one for one in found if one["shows"] is shows] for shows in (True, False))
    rate, p95, share = (np.array([one[name] for one in by]) for name in ("rate", "p95", "share"))
    idle = np.array([one["share"] for one in without])
    over, over_without = (sum(one["overruns"] for one in part) for part in (by, without))
    times, times_without = (sum(one["times"] for one in part) for part in (by, without))
    cycles = sum(one["cycles"] for one in by)
    stolen_by, stolen_without = (100.0 * np.mean([one["stolen"] for one in part]) for part in (by, without))
    load = [one["load"] for one in found]
    shown = [
        Figure(
            "frames a second, 8 curves of 1 kHz over 10 s",
            f"{np.median(rate):.1f} in the median of {len(by)} turns, {rate.min():.1f} at least",
            f"≥ {FRAMES:g}",
            bool(np.median(rate) >= FRAMES),
        ),
        Figure(
            "95th percentile from one frame to the next",
            f"{1e3 * np.median(p95):.1f} ms in the median, {1e3 * p95.max():.1f} ms at most",
            f"≤ {1e3 * LONGEST:.0f} ms",
            bool(np.median(p95) <= LONGEST),
        ),
        Figure(
            "processor time of the console with that page, and without it",
            f"{100 * share.mean():.1f} % of a core ({100 * share.max():.1f} % at most), {100 * idle.mean():.1f} %",
            f"≤ {100 * SHARE:.0f} %",
            bool(share.mean() <= SHARE),
        ),
        Figure(
            "cycles that the loop left out with the page, and without it",
            f"{over} of {cycles} at {times} times, {over_without} of {sum(one['cycles'] for one in without)} at "
            f"{times_without} times",
            "at no more times, within 2 √n",
            times - times_without <= 2.0 * np.sqrt(max(1, times + times_without)),
        ),
    ]
    for name, what in (("late_p99_us", "99th percentile of the lateness"), ("late_most_us", "largest lateness")):
        both = [f"{np.median([one[name] for one in part]):.0f} µs" for part in (by, without)]
        shown.append(Figure(f"{what} of a cycle, median of the turns", ", ".join(both), "–"))
    return shown, (
        f"- Turns of {TURN:g} s in one run, with and without the page in Chromium (without a GPU), whose first "
        f"{SETTLED:g} s do not count; without it a page that shows no curves controls. "
        f"Load of the machine {min(load):.1f} to {max(load):.1f} on {os.cpu_count()} processors, of whose time the "
        f"hypervisor gave {stolen_by:.1f} % to others with the page and {stolen_without:.1f} % without it."
    )


def memory(minutes: float) -> tuple[list[Figure], str]:
    """Growth of the console's process over so many minutes with viewers, and how it was measured."""
    with tempfile.TemporaryDirectory() as name, running(Path(name), 60.0 * minutes + 300.0) as (console, page):
        pages = [page, *(console.page().open() for _ in range(VIEWERS - 1))]
        for one in pages[1:]:
            one.until(lambda state: state["run"], 30.0, "the run")
        for one in pages:
            seen(one)
        page.run()
        begun, runs = time.monotonic(), 1
        samples: list[tuple[float, float, int, int]] = []
        before, frames = used(console.process.pid), 0
        while (now := time.monotonic() - begun) < 60.0 * minutes:
            samples.append((now, *state_of(console.process.pid)))
            if page.mode != "running":
                runs += revived(page)
            for one in pages:
                frames += len(one.frames)
                one.frames.clear()
            screen.line(f"memory: {now:.0f} s, {samples[-1][1]:.1f} MB")
            time.sleep(EVERY)
        seconds = time.monotonic() - begun
        share, load = (used(console.process.pid) - before) / seconds, os.getloadavg()[0]
        for one in pages[1:]:
            one.close()
        end(page)
    screen.end()
    settled = FILLED if 60.0 * minutes > 1.5 * FILLED else 0.5 * seconds
    later = np.array([one for one in samples if one[0] >= settled])
    half = max(1, min(len(later) // 2, 30))
    grown = float(later[-half:, 1].mean() - later[:half, 1].mean())
    hour = 3600.0 * float(np.polyfit(later[:, 0], later[:, 1], 1)[0])
    said = f"{samples[0][1]:.0f} MB, {later[0, 1]:.1f} MB after {settled:.0f} s, {grown:+.2f} MB from then on"
    files, threads = later[:, 2], later[:, 3]
    shown = [
        Figure(
            f"memory of the console over {minutes:g} min with {VIEWERS} viewers",
            f"{said} ({hour:+.1f} MB an hour)",
            f"≤ {MOST_GROWTH:g} MB more",
            grown <= MOST_GROWTH,
        ),
        Figure(
            "its descriptors, its threads",
            f"{files.min():.0f} to {files.max():.0f}, {threads.min():.0f} to {threads.max():.0f}",
            "–",
        ),
        Figure("its processor time", f"{100 * share:.1f} % of a core", f"≤ {100 * SHARE:.0f} %", share <= SHARE),
        Figure("frames a second to each viewer", f"{frames / VIEWERS / seconds:.0f}", f"≥ {FRAMES:g}"),
    ]
    return shown, (
        f"- Three pages that look at eight curves of 1 kHz over 10 s and at joint over motor; one of them controls. "
        f"{runs} {'run' if runs == 1 else 'runs'} in one log. Until {settled:.0f} s the stores of five minutes of "
        f"rows fill for the first time. Load of the machine at the end: {load:.1f}."
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=["drawing", "memory"])
    parser.add_argument("--minutes", type=float, default=2.0)
    given = parser.parse_args()
    found, more = (figures if given.part == "drawing" else memory)(given.minutes)
    for figure in found:
        print(f"{figure.what}: {figure.found} (target {figure.target}{'' if figure.held else ', missed'})")
    print(more)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
