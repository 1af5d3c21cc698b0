"""A console with a real run on a twin: who may stop it, what a lost sign of life does and how soon, and its end."""

import contextlib
import json
import os
import re
import resource
import subprocess
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from bowden.live.log_facts import NEEDED, facts
from bowden.live.mcap_read import read
from bowden.safety.faults import Fault
from bowden.safety.state import Mode
from bowden.views.log import lines
from console_client import RIG, STRANGE, Page, RunningConsole, await_answer, half_open, running_console
from live_runs import COMMAND, tries

pytestmark = [pytest.mark.live]

LEASE, AGE, MORE = 0.5, 1.0, 0.25
"""Limit of the lease, and of the operator here; how much later a release may begin [s]."""


@pytest.fixture(scope="module")
def console(tmp_path_factory: pytest.TempPathFactory) -> Iterator[RunningConsole]:
    """One with a name and notes that a browser must not take for HTML."""
    folder = tmp_path_factory.mktemp("console")
    (folder / "rig<b>.toml").write_text(RIG)
    with running_console(folder / "rig<b>.toml", folder / "out", "--twin") as running:
        yield running


@pytest.fixture
def page(console: RunningConsole) -> Iterator[Page]:
    found = console.page().open().take()
    found.until(lambda state: state["phase"] == "idle", 60.0, "idle")
    yield found
    if found.state["phase"] == "live" and not found.closed.is_set():
        found.take().post("/api/request", request="stop")
        found.post("/api/request", request="end")
        found.until(lambda state: state["phase"] == "idle", 30.0, "the end")
    found.close()


def released(log: Path) -> tuple[float, float]:
    """When the last release of a run began by its log, on the monotonic clock, and when the power was off [s]."""
    found = read(log, ("time", "mode"))
    mode, start = found["mode"], int(found.about["start_monotonic_ns"]) * 1e-9
    began = np.flatnonzero((mode[1:] == Mode.RELEASING) & (mode[:-1] != Mode.RELEASING))[-1] + 1
    off = began + int(np.flatnonzero(np.isin(mode[began:], (Mode.STOPPED, Mode.LATCHED)))[0])
    return start + float(found["time"][began]), start + float(found["time"][off])


def ended(page: Page, console: RunningConsole) -> Path:
    """End the session; its log."""
    name = page.state["run"]["log"]
    page.take()
    assert page.post("/api/request", request="end") == ""
    page.until(lambda state: state["phase"] == "idle", 30.0, "the end")
    return console.out / f"{name}.mcap"


def whole_run(page: Page, console: RunningConsole) -> Path:
    """A run that is watched, stopped by a viewer and by its page, and armed anew each time; its log."""
    page.start()
    assert page.state["rig"]["name"] == "rig<b>.toml"
    assert page.state["rig"]["drive"] == "twin"
    columns = [one["name"] for one in page.state["run"]["columns"]][:8]
    page.say(
        '{"view": {"columns": ["' + '", "'.join(columns) + '"], "seconds": 10, "pixels": 900, "xy": true, "number": 3}}'
    )
    page.run()
    rate = max(frames_in_a_second(page), frames_in_a_second(page))  # whatever else this computer does
    print(f"{rate:.0f} frames a second")
    assert rate > 30.0
    assert {frame[0] for frame in page.frames} == {1, 2, 3}

    viewer = console.page().open()
    viewer.until(lambda state: state["run"], 5.0, "the run")
    assert not viewer.state["you"]["controls"]
    for request in ("arm", "run", "acknowledge", "end"):
        assert "this page does not control" in viewer.post("/api/request", request=request)
    viewer.say('{"stop": true}')
    viewer.until(lambda state: state["run"]["mode"] == "stopped", 5.0, "the stop")
    viewer.close()
    seen, late = page.seen, time.monotonic() + 0.7
    page.until(lambda state: state["run"]["mode"] == "stopped" and page.seen > seen + 2, 5.0, "the stop")
    assert page.post("/api/request", request="run") == "it is not armed: arm it first"
    time.sleep(max(0.0, late - time.monotonic()))
    for request in ("arm", "run"):  # sent before the stop, held up on its way
        assert "too late" in page.post("/api/request", request=request, seen=seen)
        assert "does not say" in page.post("/api/request", request=request, seen=None)
        assert "none of this console" in page.post("/api/request", request=request, seen=1)
    page.run()  # whoever was stopped by somebody arms anew
    seen = page.seen
    page.say('{"stop": true}')
    assert "there was a stop" in page.post("/api/request", request="arm", seen=seen)
    page.until(lambda state: state["run"]["mode"] == "stopped", 5.0, "the stop")
    page.run()
    assert page.post("/api/request", request="stop") == ""
    page.until(lambda state: state["run"]["mode"] == "stopped", 5.0, "the stop")
    return ended(page, console)


def frames_in_a_second(page: Page) -> float:
    before, began = len(page.frames), time.monotonic()
    time.sleep(1.0)
    return (len(page.frames) - before) / (time.monotonic() - began)


def test_a_whole_run(console: RunningConsole) -> None:
    """Refused without a check; 30 frames a second; stopped by a viewer; armed anew; in the list; its page, as CSV."""
    page = console.in_control()
    assert page.post("/api/settings", subject="P-1", session="7", notes=STRANGE)["settings"]["notes"] == STRANGE
    assert "check the settings first" in page.post("/api/request", request="start")
    page.close()
    log = console.carried_through(whole_run)
    about = read(log, ("time",)).settings["about"]
    assert about == {"subject": "P-1", "session": "7", "notes": STRANGE}
    assert ("subject", "P-1") in lines(facts(read(log, NEEDED)))

    (listed,) = (one for one in page.get_json("/api/runs?search=p-1") if one["id"] == log.stem)
    assert listed["notes"] == STRANGE
    assert 0.0 < listed["rmse_deg"] < 30.0
    assert page.get_json("/api/runs?search=nobody") == []
    details = page.get_json(f"/api/runs/{listed['id']}")
    assert details["how"] == "ended as asked", details
    status, headers, text = page.get(f"/api/runs/{listed['id']}/page.html")
    assert status == 200
    assert headers["content-security-policy"].startswith("sandbox;")
    assert b"<script" not in text
    for kind, begin in (("mcap", b"\x89MCAP"), ("csv", b""), ("parquet", b"PAR1")):
        status, headers, content = page.get(f"/api/runs/{listed['id']}/log.{kind}")
        assert status == 200
        assert content.startswith(begin)
        assert "attachment" in headers["content-disposition"]
    status, _, frame = page.get(
        f"/api/runs/{listed['id']}/curves?columns=joint_deg,error_deg&from=0&to={details['to']}&pixels=300"
    )
    assert status == 200
    values = np.frombuffer(frame[24:], "<f4").reshape(2, 300, 2)
    assert np.nanmax(values[0]) > 5.0


def test_a_page_without_a_sign_of_life_has_the_run_released_in_time(page: Page, console: RunningConsole) -> None:
    """Frozen (its socket is there) and closed; whoever comes back finds a stopped run, to be armed anew."""
    page.start()
    late = []
    for how in ("frozen", "closed"):
        page.run()
        if how == "frozen":
            page.alive.clear()
        else:
            page.close()
        gone = time.monotonic()
        watcher = console.page().open()
        watcher.until(lambda state: state["run"] and state["run"]["mode"] == "stopped", 5.0, "the release")
        assert watcher.state["run"]["lost"]
        assert watcher.state["you"]["controller"] is None
        late.append(gone)
        assert "does not control" in watcher.post("/api/request", request="arm")
        page.alive.set()
        time.sleep(0.3)
        watcher.until(lambda state: state["run"]["mode"] == "stopped", 1.0, "staying stopped")
        assert watcher.state["you"]["controller"] is None  # a sign of life gives nothing back
        if how == "frozen":
            page.take()
            watcher.close()
        else:
            page = watcher.take()
    log = console.out / f"{page.state['run']['log']}.mcap"
    ended(page, console)
    found = read(log, ("time", "mode", "operator_age"))
    mode, start = found["mode"], int(found.about["start_monotonic_ns"]) * 1e-9
    began = np.flatnonzero((mode[1:] == Mode.RELEASING) & (mode[:-1] != Mode.RELEASING)) + 1
    times = start + found["time"][began]
    for how, gone, at in zip(("frozen", "closed"), late, times, strict=True):
        print(f"{how}: release began {1e3 * (at - gone):.0f} ms after the page was gone")
        assert at - gone < LEASE + MORE
    page.close()


@pytest.mark.long  # a stop beside viewers is in every run of the page; this many come from nobody
def test_a_stop_passes_beside_130_requests_without_an_end_and_viewers_that_never_read(
    page: Page, console: RunningConsole
) -> None:
    """From a browser that comes then, without a stream of its own; the page in control loses nothing meanwhile."""
    page.start()
    page.run()
    late = console.page()
    with contextlib.ExitStack() as stack:
        for _ in range(8):
            deaf = console.page(late.cookie, reads=False)
            stack.callback(deaf.close)
            deaf.open()
        stack.enter_context(half_open(page, 130))
        time.sleep(1.0)
        assert page.mode == "running", page.state["run"]["events"]
        began = time.monotonic()
        assert late.post("/api/stop") == ""
        taken = time.monotonic() - began
        page.until(lambda state: state["run"]["mode"] == "stopped", 5.0, "the stop")
        print(f"stop taken in {1e3 * taken:.0f} ms, power off in {1e3 * (time.monotonic() - began):.0f} ms")
        assert taken < 1.0
    ended(page, console)


def priority(pid: int) -> int:
    """Scheduler of a process' first thread."""
    return os.sched_getscheduler(pid) & ~os.SCHED_RESET_ON_FORK


def prompt_where_allowed(page: Page, console: RunningConsole) -> None:
    """Signs of life come through a prompt thread; what the console starts to compute has the ordinary priority."""
    pid = console.process.pid
    try:
        os.sched_setscheduler(0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(1))
    except OSError:
        allowed = os.SCHED_OTHER
    else:
        os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
        allowed = os.SCHED_RR
    time.sleep(0.2)
    assert priority(pid) == allowed
    listing = threading.Thread(target=page.get_json, args=("/api/runs",))
    (console.out / "other.mcap").write_bytes(b"\x89MCAP")
    listing.start()
    seen: list[int] = []
    while listing.is_alive():
        for one in Path(f"/proc/{pid}/task/{pid}/children").read_text().split():
            with contextlib.suppress(OSError):
                if "job_process" in Path(f"/proc/{one}/cmdline").read_text():
                    seen.append(priority(int(one)))
    listing.join()
    (console.out / "other.mcap").unlink()
    assert set(seen) == {os.SCHED_OTHER}


def test_the_first_fault_and_its_remedy(page: Page, console: RunningConsole) -> None:
    assert priority(console.process.pid) == os.SCHED_OTHER
    page.start()
    prompt_where_allowed(page, console)
    page.run()
    assert page.post("/api/inject", fault="encoder_frozen joint") == ""
    page.until(lambda state: state["run"]["first_fault"], 10.0, "the fault")
    assert page.state["run"]["first_fault"]["name"] == "joint_frozen"
    assert page.state["run"]["first_fault"]["remedy"] == Fault.JOINT_FROZEN.remedy
    page.until(lambda state: state["run"]["mode"] == "latched", 10.0, "latched")
    deadline = time.monotonic() + 5.0
    while "then press again" in (said := page.post("/api/request", request="arm")) and time.monotonic() < deadline:
        time.sleep(0.05)  # the page has not yet said that it saw the stop
    assert said == "acknowledge the fault first"
    assert page.post("/api/inject", fault="none") == ""
    assert page.post("/api/request", request="acknowledge") == ""
    page.until(lambda state: state["run"]["mode"] == "stopped", 5.0, "acknowledged")
    page.run()
    assert page.post("/api/inject", fault="of nothing") != ""
    ended(page, console)
    time.sleep(0.2)
    assert priority(console.process.pid) == os.SCHED_OTHER


@pytest.mark.long
def test_a_console_that_is_stopped_leaves_a_loop_that_releases_at_once(tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(RIG)
    with running_console(tmp_path / "rig.toml", tmp_path / "out", "--twin") as console:
        page = console.page().open().take()
        page.until(lambda state: state["phase"] == "idle")
        page.start()
        page.run()
        log, gone = console.out / f"{page.state['run']['log']}.mcap", time.monotonic()
        console.process.terminate()
        console.process.wait(30.0)
        assert released(log)[0] - gone < MORE
        page.close()


@contextlib.contextmanager
def hanging(folder: Path, method: str) -> Iterator[tuple[RunningConsole, Page, Path]]:
    """A console whose run goes on, its page, and the run's log; a method hangs as soon as there is a file ``hang``."""
    module, owner, name = method.rsplit(".", 2)
    hangs = f"import {module} as m, time, os\n"
    hangs += f"before = m.{owner}.{name}\n"
    hangs += f"def hung(self, one):\n    before(self, one)\n    if os.path.exists({str(folder / 'hang')!r}):\n"
    hangs += "        time.sleep(1e3)\n"
    hangs += f"m.{owner}.{name} = hung\n"
    (folder / "rig.toml").write_text(RIG)
    with running_console(folder / "rig.toml", folder / "out", "--twin", prelude=hangs, ends=False) as console:
        page = console.page().open().take()
        page.until(lambda state: state["phase"] == "idle")
        page.start()
        page.run()
        yield console, page, console.out / f"{page.state['run']['log']}.mcap"


def test_an_event_loop_that_hangs_stops_the_run(tmp_path: Path) -> None:
    """Through it come the signs of life: without it the lease grows old, and the thread of the run sees that."""
    with hanging(tmp_path, "bowden.console.console.Console.tick") as (console, _, log):
        (tmp_path / "hang").touch()
        gone = time.monotonic()
        time.sleep(2.0)
        console.process.kill()
        time.sleep(3.0)
        began, _ = released(log)
        print(f"hung event loop: release began {1e3 * (began - gone):.0f} ms after")
        assert began - gone < LEASE + MORE


@pytest.mark.long
def test_a_thread_of_the_run_that_hangs_is_a_dead_operator(tmp_path: Path) -> None:
    """The page's signs of life go on, and help nothing: the loop hears none, and the page has no news any more."""
    with hanging(tmp_path, "bowden.console.runs.RunOwner._see") as (console, page, log):
        (tmp_path / "hang").touch()
        gone = time.monotonic()
        time.sleep(LEASE + 0.3)
        seen = page.seen
        time.sleep(1.5)
        assert page.seen == seen, "no stamp comes: the page says that it has no news"
        assert not page.closed.is_set()
        console.process.kill()
        time.sleep(3.0)
        began, _ = released(log)
        print(f"hung thread of the run: release began {1e3 * (began - gone):.0f} ms after")
        assert began - gone < AGE + MORE


@pytest.mark.long
def test_what_three_viewers_cost(page: Page, console: RunningConsole) -> None:
    """Eight curves of 1 kHz over 10 s for three viewers: processor time of the process of the console itself."""
    page.start()
    columns = [one["name"] for one in page.state["run"]["columns"]][:8]
    pages = [page, *(console.page().open() for _ in range(2))]
    for one in pages:
        one.say(json.dumps({"view": {"columns": columns, "seconds": 10, "pixels": 900, "xy": True, "number": 1}}))
    page.run()

    def used() -> float:
        words = Path(f"/proc/{console.process.pid}/stat").read_text().rpartition(")")[2].split()
        return (int(words[11]) + int(words[12])) / os.sysconf("SC_CLK_TCK")

    before, began, frames = used(), time.monotonic(), [len(one.frames) for one in pages]
    time.sleep(5.0)
    seconds = time.monotonic() - began
    share, sent = (used() - before) / seconds, [len(one.frames) - n for one, n in zip(pages, frames, strict=True)]
    print(f"{100.0 * share:.1f} % of a core; {min(sent) / seconds:.0f} frames a second")
    for one in pages[1:]:
        one.close()
    ended(page, console)
    assert share < 0.4, "a fifth of a core on a computer of its own; this one is shared"
    assert min(sent) / seconds > 25.0


def test_a_terminals_run_has_a_page_that_may_stop_it(tmp_path: Path) -> None:
    """`bowden run --console`: the terminal, here --auto, is the operator; nobody else takes the control."""
    (tmp_path / "rig.toml").write_text(RIG)
    options = ["--twin", "--auto", "--console", "--out", str(tmp_path / "out")]
    words = [*COMMAND, "run", str(tmp_path / "rig.toml"), *options]
    for _ in tries():
        process = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        assert process.stderr is not None
        lines: list[str] = []
        for line in process.stderr:
            lines.append(line)
            if found := re.search(r":(\d+)/\?token=(\S+)", line):
                break
        else:
            process.communicate()
            continue  # a computer that stalls has not let it begin
        await_answer(int(found[1]))
        page = Page(int(found[1]), found[2]).open()
        before = ("stopped", "preflight", "ready")
        page.until(lambda state: state["run"] and state["run"]["mode"] not in before, 30.0, "the run")  # noqa: B023
        assert page.post("/api/control", take=True) == "the terminal controls this run"
        assert "the terminal controls" in page.post("/api/request", request="run")
        assert page.state["settings"]["locked"]
        time.sleep(1.0)
        faulty = page.state["run"]["first_fault"]
        assert page.post("/api/request", request="stop") == ""
        began = time.monotonic()
        said, errors = process.communicate(timeout=60.0)
        page.close()
        assert "Traceback" not in errors
        if faulty is None and "fault" not in said:
            assert process.returncode == 0, said + errors
            assert time.monotonic() - began < 30.0, "not to its end, after 60 s"
            break
    else:
        raise AssertionError("".join(lines))


def recorder_of(console: int) -> int:
    """The process that records a console's run."""
    for thread in Path(f"/proc/{console}/task").iterdir():
        for child in (thread / "children").read_text().split():
            if "live.recorder" in Path(f"/proc/{child}/cmdline").read_text():
                return int(child)
    raise AssertionError("nobody records")


def test_a_disk_that_is_full_hinders_no_stop_and_a_killed_console_leaves_a_loop_that_releases(tmp_path: Path) -> None:
    """The run goes on and is stopped as ever; no other one is armed; what cannot be written says why.

    The console of the next run is killed: the loop releases by `operator_age`.
    """
    (tmp_path / "rig.toml").write_text(RIG)
    with running_console(tmp_path / "rig.toml", tmp_path / "out", "--twin") as console:
        page = console.page().open().take()
        page.until(lambda state: state["phase"] == "idle")
        page.start()
        page.run()
        assert page.state["run"]["recorder"] == "ok"
        log = console.out / f"{page.state['run']['log']}.mcap"
        full = log.stat().st_size + 1000
        _, most = resource.prlimit(console.process.pid, resource.RLIMIT_FSIZE)
        resource.prlimit(recorder_of(console.process.pid), resource.RLIMIT_FSIZE, (full, most))
        resource.prlimit(console.process.pid, resource.RLIMIT_FSIZE, (20_000, most))
        page.until(lambda state: state["run"]["recorder"] != "ok", 20.0, "the recorder's word")
        said = page.state["run"]["recorder"]
        assert "full" in said, said
        assert page.mode == "running"
        assert page.post("/api/request", request="stop") == ""
        page.until(lambda state: state["run"]["mode"] == "stopped", 10.0, "the stop")
        assert page.post("/api/request", request="arm") != ""
        page.post("/api/request", request="end")
        page.until(lambda state: state["phase"] == "idle", 60.0, "the end")

        (listed,) = page.get_json("/api/runs")
        details = page.get_json(f"/api/runs/{listed['id']}")
        assert details["events"]
        for kind in ("csv", "parquet"):
            status, _, content = page.get(f"/api/runs/{listed['id']}/log.{kind}")
            assert status >= 400
            assert set(json.loads(content)["error"]) == {"what", "expected", "do"}
        page.get(f"/api/runs/{listed['id']}/page.html")
        assert page.post("/api/request", request="start") == ""
        page.until(lambda state: state["error"] and state["phase"] == "idle", 60.0, "why nothing begins")
        print(said, "|", page.state["error"])
        resource.prlimit(console.process.pid, resource.RLIMIT_FSIZE, (most, most))
        assert page.get(f"/api/runs/{listed['id']}/log.csv")[0] == 200
        assert page.post("/api/request", request="start") == ""
        page.until(lambda state: state["phase"] == "live" and state["run"], 60.0, "a session")
        assert page.state["error"] is None
        page.run()
        log, gone = console.out / f"{page.state['run']['log']}.mcap", time.monotonic()
        console.process.kill()
        time.sleep(AGE + 3.0)
        assert released(log)[0] - gone < AGE + MORE
        page.close()


@pytest.mark.long
def test_the_guided_path(tmp_path: Path) -> None:
    """Measure on the twin, identify, tune: each step's files are there, and the rig goes on with them."""
    (tmp_path / "rig.toml").write_text(RIG)
    with running_console(tmp_path / "rig.toml", tmp_path / "out", "--twin") as console:
        page = console.page().open().take()
        page.until(lambda state: state["phase"] == "idle")
        before = page.state["rig"]["hash"]
        for step in ("identify", "identify-servo"):
            assert page.post("/api/path", step=step) == "nothing was measured"
        for number in tries():
            page.until(lambda state: state["phase"] == "idle", 60.0, "idle")
            assert page.post("/api/path", step="measure")["path"]["running"]
            page.until(lambda state: state["phase"] == "live" and state["run"], 180.0, "the session")
            page.run()
            page.until(lambda state: state["run"]["mode"] in ("stopped", "latched"), 240.0, "the end of the motion")
            assert page.post("/api/request", request="end") == ""
            page.until(lambda state: state["phase"] == "idle", 60.0, "the end")
            page.until(lambda state: not state["path"]["running"], 60.0, "the files")
            print(number, page.state["path"]["steps"][0])
            if page.state["path"]["steps"][0]["state"] == "done":
                break
        assert {"path-1/cable.csv", "path-1/servo.csv"} <= {*page.state["path"]["steps"][0]["files"]}
        steps = ("measure", "identify", "identify-servo", "tune")
        for step, seconds in (("identify", 300.0), ("identify-servo", 120.0), ("tune", 1500.0)):
            assert page.post("/api/path", step=step)["phase"] == "step"
            at = steps.index(step)
            page.until(lambda state, at=at: state["path"]["steps"][at]["state"] in ("done", "failed"), seconds, step)  # type: ignore[misc]
            found = page.state["path"]["steps"][at]
            print(found)
            assert found["state"] == "done", found
            assert all((console.out / name).is_file() for name in found["files"])
        status, headers, text = page.get("/api/path/identify.html")
        assert status == 200
        assert headers["content-security-policy"].startswith("sandbox;")
        assert b"<script" not in text
        assert page.state["rig"]["hash"] != before
        assert page.state["path"]["next"].startswith("check")
        page.close()
