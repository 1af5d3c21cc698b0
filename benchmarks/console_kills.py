"""The console loses its page, its network or itself at random moments of a run on the twin: when the release begins.

    python benchmarks/console_kills.py bare|chromium [--count 8] [--first 0]       # a try: the cases, a line each

Two parts. `bare`: a page as far as the console sees one, in Python; its network goes through a proxy that halts,
delays, drops packets and cuts. `chromium`: the page itself in Chromium, whose processes are killed and halted. A case
arms the rig, begins the run when it is ready, and takes something away at a moment drawn from the case's number; then
it gives it back, and looks whether anything moves again. Times of both sides are of the computer's one monotonic
clock: the loss as this process has it, the release as the run's log has it.
"""

import argparse
import contextlib
import json
import os
import random
import signal
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

sys.path.append(str(Path(__file__).parents[1] / "tests"))  # where the page's client is

from bad_network import DOWN, UP, BadNetwork
from bowden.core.errors import BowdenError
from bowden.live.mcap_reader import LogReader
from bowden.live.row import AT
from bowden.safety.faults import of
from bowden.safety.limits import Limits
from bowden.safety.state import Mode
from console_client import Page, RunningConsole, running_console
from kept import Kept
from measure import Figure

COUNTS = {"bare": 180, "chromium": 50}
"""Cases of each part."""
EARLIEST, LATEST = 0.05, 6.0
"""After the rig was armed; by then it is in the preflight, on its way to the beginning, or under its law [s]."""
BACK = (0.9, 2.5)
"""From the loss until what was taken away is given back [s]."""
STILL = 0.8
"""From then on it is looked at for this long [s]."""
LEASE, OPERATOR = Limits().console_lease, 0.3
"""Limits of the lease, and of the operator: near to what it is by default on hardware. A twin of the console's own has
a longer one, but where the rig gives another one than by default."""
MORE, CYCLE = 0.25, 0.005
"""How much later a release may begin than the limit of the lease; and than that of the operator: the loop's own [s]."""
PINGS = 1.5
"""A page that answers no ping is dropped after this long, at most [s]."""
PATIENCE = 30.0
A_SESSION = 8
"""Cases with one log."""
COLUMNS = (
    *("number", "kind", "moment", "mode", "took", "began", "off", "bound", "again", "late", "age", "load", "before"),
    "controls",
)
"""Of a case: mode at the loss; how long taking it away took; from its beginning to the release and to power off; mode
of a motion after it; largest lateness of the loop and age of the operator until the release; load of the machine; how
the run had ended before; whether the page controlled again by itself. Times in s."""
LIMITS = f"[limits]\nreading_age = 10.0\nlateness_s = 0.04\noperator_age_s = {OPERATOR}\n"
RIG = f"""[reference]
kind = 'periodic_minimum_jerk'
low_deg = 0.0
high_deg = 50.0
period_s = 4.0
[scenario]
duration_s = 60.0
{LIMITS}"""
POWERED = (float(Mode.PREFLIGHT), float(Mode.RUNNING), float(Mode.BRIDGING))
PAGE, CONSOLE, DEAF = LEASE + MORE, OPERATOR + CYCLE, PINGS + MORE


@dataclass(frozen=True)
class Kind:
    """What is taken away."""

    bound: float
    """From the loss to the release [s]."""
    weight: float
    said: str


KINDS = {
    "tab closed": Kind(PAGE, 1.0, "its connection ends in order"),
    "tab frozen": Kind(PAGE, 2.0, "no sign of life, its connection is there and read"),
    "tab stuck": Kind(PAGE, 1.0, "no sign of life, and nothing is read"),
    "network gone": Kind(PAGE, 2.0, "nothing comes through, then all of it late"),
    "network up gone": Kind(PAGE, 1.0, "nothing comes from the page"),
    "network down gone": Kind(DEAF, 1.0, "nothing comes to the page, whose signs of life go on"),
    "network drops packets": Kind(PAGE, 2.0, "the kernel drops each packet of both ends, acknowledgements too"),
    "network slow": Kind(PAGE, 1.0, "everything comes 0.8 to 3 s late"),
    "network cut": Kind(PAGE, 1.0, "the connection is reset"),
    "console killed": Kind(CONSOLE, 1.0, "SIGKILL"),
    "console frozen": Kind(CONSOLE, 1.2, "SIGSTOP, then SIGCONT"),
    "console ended": Kind(MORE, 0.5, "SIGTERM"),
}
"""Of a bare page."""
BROWSER_KINDS = {
    "Chromium: tab closed": Kind(PAGE, 1.0, "page.close"),
    "Chromium: tab hidden": Kind(PAGE, 1.0, "another tab comes to the front"),
    "Chromium: tab crashed": Kind(PAGE, 1.0, "SIGKILL of its renderer"),
    "Chromium: tab frozen": Kind(PAGE, 1.0, "SIGSTOP of its renderer, then SIGCONT"),
    "Chromium: navigated away": Kind(PAGE, 1.0, "to another page, then back"),
    "Chromium: browser killed": Kind(PAGE, 1.0, "SIGKILL of its first process"),
    "Chromium: computer frozen": Kind(PAGE, 1.0, "SIGSTOP of all its processes, then SIGCONT"),
}


def drawn(number: int, kinds: dict[str, Kind]) -> tuple[str, float, random.Random]:
    """Kind and moment of a case, and what draws the rest of it."""
    more = random.Random(number)
    kind = more.choices(list(kinds), [one.weight for one in kinds.values()])[0]
    return kind, more.uniform(EARLIEST, LATEST), more


@dataclass
class Loss:
    """One case, as far as this process has seen it."""

    number: int
    kind: str
    moment: float
    bound: float
    load: float = 0.0
    at: float = float("nan")
    """The loss [s]."""
    took: float = 0.0
    until: float = float("inf")
    """Until then nothing may move again [s]."""
    controls: bool = False
    said: str = ""
    """Why it did not come to the loss."""


@dataclass
class Bench:
    """A console on its twin, with a page beside that looks on."""

    console: RunningConsole
    watcher: Page
    losses: list[Loss] = field(default_factory=list)
    """Those whose log is still being written."""
    log: str = ""

    def until(self, holds: Callable[[dict[str, Any]], Any], what: str, seconds: float = PATIENCE) -> None:
        """Wait until the state is like this."""
        self.watcher.until(holds, seconds, what)

    def settle(self, page: Any) -> None:
        """Have a session that stands, without power and without a fault; it is begun where there is none."""
        state = self.watcher.state
        if state["phase"] == "idle":
            page.begin()
            self.until(lambda state: state["phase"] == "live" and state["run"], "the session", 180.0)
        self.log = str(self.watcher.state["run"]["log"])

    @property
    def file(self) -> Path:
        """The log."""
        return self.console.out / f"{self.log}.mcap"


class BarePage:
    """The page of a case: a bare client behind a bad network."""

    def __init__(self, bench: Bench) -> None:
        self.network = BadNetwork(bench.console.port)
        self.page = Page(bench.console.port, cookie=bench.watcher.cookie, via=self.network.port).open().take()
        self.page.until(lambda state: True, PATIENCE, "a state")

    def begin(self) -> None:
        """A session."""
        self.page.start()

    def ask(self, request: str) -> str:
        """Ask for something; why it does nothing."""
        return str(self.page.post("/api/request", request=request))

    def look(self, columns: list[str]) -> None:
        """See curves, as a page does."""
        view = {"columns": columns, "seconds": 10, "pixels": 900, "xy": True, "number": 1}
        self.page.say(json.dumps({"view": view}))

    def close(self) -> None:
        """End, whatever has become of it."""
        with contextlib.suppress(Exception):
            self.network.mend()
            self.page.alive.clear()
            self.page.closed.set()
            self.network.close()
            self.page.close()


def armed(bench: Bench, page: Any) -> float:
    """Arm, and when that was [s]; a latched fault is acknowledged first."""
    deadline = time.monotonic() + PATIENCE
    while True:
        mode = bench.watcher.mode
        if mode == "latched" or (mode == "stopped" and bench.watcher.state["run"]["first_fault"]):
            page.ask("acknowledge")
        elif mode == "stopped" and page.ask("arm") == "":
            return time.monotonic()
        if time.monotonic() > deadline:
            raise AssertionError(f"cannot be armed: {mode} {bench.watcher.state['run']['next']}")
        time.sleep(0.05)


def await_moment(bench: Bench, page: Any, moment: float) -> None:
    """Begin the run as soon as it is ready, until the moment has come [s of the monotonic clock]."""
    while (left := moment - time.monotonic()) > 0.0:
        if bench.watcher.mode == "ready" and left > 0.05:
            page.ask("run")
            time.sleep(min(0.2, max(0.0, moment - time.monotonic())))
        time.sleep(min(0.01, max(0.0, moment - time.monotonic())))


def bare_case(bench: Bench, loss: Loss, more: random.Random) -> None:
    """One case with a bare page."""
    page = BarePage(bench)
    try:
        bench.settle(page)
        page.look([one["name"] for one in bench.watcher.state["run"]["columns"]][:8])
        await_moment(bench, page, armed(bench, page) + loss.moment)
        loss.load = os.getloadavg()[0]
        loss.at = time.monotonic()
        back = _taken(bench, page, loss.kind, more)
        loss.took = time.monotonic() - loss.at
        _given_back(bench, loss, more, back)
    finally:
        page.close()


def _taken(bench: Bench, page: BarePage, kind: str, more: random.Random) -> Callable[[], None]:
    """Take it away; what gives it back."""
    client, network, process = page.page, page.network, bench.console.process
    if kind == "tab closed":
        client.close()
    elif kind == "tab frozen":
        client.alive.clear()
        return client.alive.set
    elif kind == "tab stuck":
        client.alive.clear()
        network.halted = frozenset({DOWN})
        return lambda: (client.alive.set(), network.mend())[1]
    elif kind in ("network gone", "network up gone", "network down gone"):
        network.halted = frozenset({"gone": {UP, DOWN}, "up": {UP}, "down": {DOWN}}[kind.split()[1]])
        return network.mend
    elif kind == "network drops packets":
        network.drop()
        return network.mend
    elif kind == "network slow":
        network.delay = more.uniform(0.8, 3.0)
        return network.mend
    elif kind == "network cut":
        network.cut()
    elif kind == "console frozen":
        os.kill(process.pid, signal.SIGSTOP)
        return lambda: os.kill(process.pid, signal.SIGCONT)
    else:
        os.kill(process.pid, signal.SIGKILL if kind == "console killed" else signal.SIGTERM)
    return lambda: None


def _given_back(bench: Bench, loss: Loss, more: random.Random, back: Callable[[], None]) -> None:
    """Give it back after a while, and look on until it is clear that nothing moves."""
    dead = loss.kind in ("console killed", "console ended")
    if loss.kind == "network down gone":  # whose bound is longer
        bench.until(lambda state: state["run"]["mode"] in ("stopped", "latched"), "the release")
    left = loss.at + more.uniform(*BACK) - time.monotonic()
    time.sleep(max(0.0, left))
    back()
    if dead:
        with contextlib.suppress(Exception):
            bench.console.process.wait(PATIENCE)
        time.sleep(STILL)
    else:
        bench.until(lambda state: state["phase"] != "live" or state["run"]["mode"] in ("stopped", "latched"), "the end")
        time.sleep(STILL)
        loss.controls = bench.watcher.state["you"]["controller"] is not None
    loss.until = time.monotonic()


def rows_of(file: Path) -> tuple[Any, float]:
    """Rows of a log, as far as it was written, and its start on the monotonic clock [s]."""
    log = LogReader(file)
    pieces = [piece.rows for piece in log]
    return np.concatenate(pieces), 1e-9 * float(log.about["start_monotonic_ns"])


def judged(losses: list[Loss], file: Path) -> Iterator[list[Any]]:
    """`COLUMNS` of the cases of one log."""
    try:
        table, start = rows_of(file)
    except (BowdenError, ValueError) as error:
        table, start = np.empty((0, 0)), 0.0
        for loss in losses:
            loss.said = loss.said or f"no log: {error}"
    when = table[:, AT["time"]] + start if len(table) else np.empty(0)
    for loss in losses:
        yield [loss.number, loss.kind, loss.moment, *_judged(loss, table, when)]


def _judged(loss: Loss, table: Any, when: Any) -> list[Any]:
    nothing = float("nan")
    at = int(np.searchsorted(when, loss.at)) - 1 if len(when) else -1
    if loss.said or at < 0:
        why = loss.said or "not in the log"
        return ["", loss.took, nothing, nothing, loss.bound, "", nothing, nothing, loss.load, why, False]
    modes = table[:, AT["mode"]]
    mode = Mode(int(modes[at])).name.lower()
    powered = np.isin(modes, POWERED)
    if not powered[at]:
        bits = [fault.name for fault in of(float(table[at, AT["faults"]]))]
        why = " ".join(bits) or f"was {mode}"
        return [mode, loss.took, nothing, nothing, loss.bound, "", nothing, nothing, loss.load, why, loss.controls]
    after = np.flatnonzero(~powered[at:])
    began = at + int(after[0]) if len(after) else len(when) - 1
    rest = np.flatnonzero(np.isin(modes[began:], (float(Mode.STOPPED), float(Mode.LATCHED))))
    off = float(when[began + rest[0]]) - loss.at if len(rest) else float("inf")
    end = int(np.searchsorted(when, loss.until))
    again = np.flatnonzero(powered[began:end])
    late = float(np.max(table[at : began + 1, AT["lateness"]]))
    age = float(np.max(table[at : began + 1, AT["operator_age"]]))
    first = float(when[began]) - loss.at if len(after) else float("inf")
    moved = Mode(int(modes[began + again[0]])).name.lower() if len(again) and len(after) else ""
    faults = " ".join(fault.name for fault in of(float(table[began, AT["faults"]])))
    if "OPERATOR" not in faults and faults:  # a fault of its own ended the run in that very moment
        return [mode, loss.took, nothing, nothing, loss.bound, "", late, age, loss.load, faults, loss.controls]
    return [mode, loss.took, first, off, loss.bound, moved, late, age, loss.load, "", loss.controls]


@contextlib.contextmanager
def bench_of(folder: Path, number: int) -> Iterator[Bench]:
    """A console, whose process may die before the end."""
    (folder / "rig.toml").write_text(RIG)
    with running_console(folder / "rig.toml", folder / f"out{number}", "--twin") as console:
        watcher = console.page().open()
        watcher.until(lambda state: True, PATIENCE, "a state")
        yield Bench(console, watcher)
        watcher.close()


def flushed(bench: Bench, take: Callable[[], Any] | None) -> list[list[Any]]:
    """End the session, if there is one, and judge its cases.

    Args:
        bench: with the cases.
        take: gives a page that can end it; None where the console is dead, and the loop ends by itself.
    """
    if not bench.losses:
        return []
    if take is None:
        time.sleep(6.0)  # loop and recorder end
    else:
        page = take()
        if bench.watcher.state["phase"] == "live":
            page.ask("end")
        bench.until(lambda state: state["phase"] == "idle", "the end", 60.0)
        page.close()
    found = list(judged(bench.losses, bench.file))
    bench.losses.clear()
    return found


def bare_cases(numbers: Iterable[int]) -> Iterator[list[Any]]:
    """`COLUMNS` of each case with a bare page."""
    waiting = list(numbers)
    with tempfile.TemporaryDirectory() as name:
        while waiting:
            with bench_of(Path(name), waiting[0]) as bench:
                yield from _bare_console(bench, waiting)


def _bare_console(bench: Bench, waiting: list[int]) -> Iterator[list[Any]]:
    """Cases until the console is dead, or there is none left."""
    while waiting:
        number = waiting.pop(0)
        kind, moment, more = drawn(number, KINDS)
        loss = Loss(number, kind, moment, KINDS[kind].bound)
        before = bench.log
        bench.losses.append(loss)
        try:
            bare_case(bench, loss, more)
        except (AssertionError, OSError, KeyError) as error:
            loss.said = f"{type(error).__name__}: {error}"[:300]
        dead = bench.console.process.poll() is not None
        ended = not dead and (len(bench.losses) >= A_SESSION or not waiting or bench.watcher.state["phase"] == "idle")
        if before not in ("", bench.log):  # another session began with it
            raise RuntimeError(f"cases of {before} were not judged before {bench.log}")
        if dead or ended or loss.said:
            take = None if dead else (lambda: BarePage(bench))
            yield from flushed(bench, take)
            bench.log = ""
        if dead or loss.said:
            return


def kept_cases(part: str, wanted: int) -> list[list[Any]]:
    """`COLUMNS` of the first cases of a part; those that were done already are not done again."""
    kept = Kept(f"console_kills-{part}")
    there = {row[0] for row in kept.rows()}
    return kept.filled(PARTS[part]([n for n in range(wanted) if n not in there]), wanted)[:wanted]


def figures(share: float) -> tuple[list[Figure], str]:
    """Figures of all cases, and how they were made."""
    rows = [row for part, most in COUNTS.items() for row in kept_cases(part, max(4, round(share * most)))]
    return shown([dict(zip(COLUMNS, row, strict=True)) for row in rows])


def _chromium_cases(numbers: Iterable[int]) -> Iterator[list[Any]]:
    from console_browser_kills import chromium_cases

    return chromium_cases(numbers)


PARTS: dict[str, Callable[[Iterable[int]], Iterator[list[Any]]]] = {"bare": bare_cases, "chromium": _chromium_cases}


def shown(rows: list[dict[str, Any]]) -> tuple[list[Figure], str]:
    """The figures of cases."""
    found, lines = [], []
    for kind, about in {**KINDS, **BROWSER_KINDS}.items():
        cases = [row for row in rows if row["kind"] == kind and not row["before"]]
        if not cases:
            continue
        began = np.array([row["began"] for row in cases])
        late = [one for one, row in zip(began, cases, strict=True) if one > row["bound"]]
        said = f"{1e3 * np.median(began):.0f} ms in the median, {1e3 * began.max():.0f} ms at most, {len(began)} times"
        target = f"≤ {1e3 * about.bound:.0f} ms"
        found.append(Figure(f"{kind} ({about.said}): release begins after", said, target, not late))
        lines += [row for row in cases if row["began"] > row["bound"] or row["again"]]
    before = [row for row in rows if row["before"]]
    again = [row for row in rows if row["again"]]
    good = len(rows) - len(before)
    found += [
        Figure(f"moved again by itself, of {good}", str(len(again)), "0", not again),
        Figure("under power when it was lost", f"{good} of {len(rows)}", "–"),
    ]
    for row in (*lines, *before):
        print(json.dumps(row))
    load = [row["load"] for row in rows if row["load"]]
    took = 1e3 * max((row["took"] for row in rows), default=0.0)
    return found, (
        f"- {len(rows)} cases at moments drawn from {EARLIEST:g} to {LATEST:g} s after arming. The loss by the clock "
        "of the process that makes it, the release by the run's log, both of one monotonic clock; from the beginning "
        f"of what takes it away, which lasted up to {took:.0f} ms. What was taken away comes back after "
        f"{BACK[0]:g} to {BACK[1]:g} s, and the run is looked at for {STILL:g} s more.\n"
        f"- `console_lease_s` {LEASE:g} s, `operator_age_s` {OPERATOR:g} s. Load of the machine (one minute) "
        f"{min(load, default=0.0):.1f} to {max(load, default=0.0):.1f}, median {np.median(load or [0.0]):.1f}, on "
        f"{os.cpu_count()} processors."
    )


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("part", choices=[*PARTS])
    parser.add_argument("--count", type=int, default=8)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    numbers = range(given.first, given.first + given.count)
    for row in PARTS[given.part](numbers):
        print(json.dumps(dict(zip(COLUMNS, row, strict=True))), flush=True)
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
