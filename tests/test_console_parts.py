"""Parts of the console without a server: the lease, the thread that holds a run, what is cut out of rows, settings."""

import json
import sys
import threading
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden.console.earlier import EarlierRuns
from bowden.console.jobs import Jobs
from bowden.console.lease import Lease, Stamps
from bowden.console.runs import TAKEN, RunOwner, TerminalRun
from bowden.console.settings import RunSettings
from bowden.console.stream import CURVES, WHOLE, Cursor, Watch, columns_of, reduced, taken
from bowden.control import LAWS
from bowden.core.clock import SECOND, MonotonicClock
from bowden.core.errors import ParameterError, SafetyError
from bowden.live.live_run import live_run
from bowden.live.ring import Batch, RingReader, RingWriter, create
from bowden.live.row import AT, columns, description
from bowden.rig.rig import Rig
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Request


def at(seconds: float) -> int:
    return round(seconds * SECOND)


def test_a_lease_lives_by_signs_that_are_new_and_its_holders_own() -> None:
    lease = Lease(0.5)
    assert not lease.look(0).fresh
    lease.take("a", at(1.0))
    assert lease.look(at(1.5)).fresh
    assert not lease.look(at(1.501)).fresh
    lease.sign("b", 1, at(1.4))
    lease.sign("", 1, at(1.4))
    assert not lease.look(at(1.6)).fresh
    lease.sign("a", 7, at(1.4))
    assert lease.look(at(1.9)).fresh
    for count in (7, 6, -1):
        lease.sign("a", count, at(1.9))
    assert not lease.look(at(2.0)).fresh, "a repetition is no sign of life"


def test_a_lease_that_is_lost_or_taken_over_comes_back_by_being_taken_alone() -> None:
    lease = Lease(0.5)
    lease.take("a", 0)
    lease.take("b", at(0.1))
    lease.sign("a", 1, at(0.2))
    assert lease.look(at(0.2)) == ("b", at(0.1), True)
    assert not lease.give_back("a")
    lease.drop()
    lease.sign("b", 1, at(0.3))
    assert not lease.look(at(0.3)).fresh
    assert lease.look(at(0.3)).holder == ""
    lease.take("b", at(0.4))
    assert lease.look(at(0.4)).fresh
    assert lease.give_back("b")
    assert not lease.look(at(0.4)).fresh


class FakeRun:
    """A session whose loop obeys, or does not."""

    def __init__(self, *, obeys: bool = True) -> None:
        self.obeys, self.mode, self.running, self.ended, self.error = obeys, Mode.STOPPED, True, None, ""
        self.asked: list[Request] = []
        self.beats: list[float] = []
        self.recorder, self.still, self.logs = 1, 0.0, [Path("run-1.mcap")]
        limits = SimpleNamespace(losses=lambda: "the cable is let out", measure=False)
        self.live = limits
        self.description = SimpleNamespace(columns=tuple(AT))
        self.rows = SimpleNamespace(last=self.row, description=self.description)
        self.block, self.stops, self.stop_waits = self, 0, False

    def __enter__(self) -> "FakeRun":
        return self

    def __exit__(self, *_: object) -> None:
        self.running = False

    def row(self) -> Any:
        values = np.zeros(len(AT))
        values[AT["mode"]] = self.mode
        values[AT["preflight"]] = 1.0
        return values

    def row_of(self, row: Any) -> dict[str, float]:
        return dict(zip(AT, row.tolist(), strict=True))

    def judged(self, row: dict[str, float]) -> list[dict[str, float]]:
        return [row]

    def last(self) -> None:
        self.beats.append(time.monotonic())

    def remember(self, row: Any) -> None:
        pass

    def ask(self, request: Request, stops: int | None = None) -> None:
        assert stops in (None, self.stops)
        self.asked.append(request)
        self.stops += request == Request.STOP
        if request == Request.ARM:
            self.mode = Mode.PREFLIGHT
        if request == Request.RUN:
            self.mode = Mode.RUNNING
        if request == Request.STOP and self.obeys:
            self.mode = Mode.STOPPED


def begun(run: FakeRun, lease: Lease) -> RunOwner:
    """An owner with this run, which is going, under the lease of tab a."""
    owner = RunOwner(lease, Stamps(0.5))
    owner.begin(lambda tell: run)  # type: ignore[arg-type, return-value]
    wait(lambda: owner.seen.phase == "live")
    with pytest.raises(SafetyError, match="a session goes on"):
        owner.begin(lambda tell: run)  # type: ignore[arg-type, return-value]
    lease.take("a", MonotonicClock().now())
    for request in (Request.ARM, Request.RUN):
        assert owner.ask("b", request).result(5.0) == "this page does not control: take the control first"
        seen = told(owner)
        lease.take("a", MonotonicClock().now())
        assert owner.ask("a", request, seen).result(5.0) == ""
    return owner


def told(owner: RunOwner) -> int:
    """Stamp of a state that a page is told now, after the thread has looked anew."""
    now = owner.clock.now()
    wait(lambda: owner.looked > now)
    return owner.stamps.issue(owner.looked)


def wait(holds: Any, seconds: float = 5.0) -> float:
    """Until it holds; the time that it took [s]."""
    begin = time.monotonic()
    while not holds():
        assert time.monotonic() - begin < seconds
        time.sleep(0.002)
    return time.monotonic() - begin


def test_a_lease_that_grows_old_under_power_is_a_stop() -> None:
    run, lease = FakeRun(), Lease(0.3)
    owner = begun(run, lease)
    took = wait(lambda: Request.STOP in run.asked)
    assert 0.1 < took < 0.55
    wait(lambda: owner.seen.lost)
    assert lease.look(MonotonicClock().now()).holder == ""
    lease.sign("a", 1, MonotonicClock().now())
    assert owner.ask("a", Request.ARM).result(5.0).startswith("this page does not control")
    lease.take("a", MonotonicClock().now())
    assert owner.ask("a", Request.ARM, told(owner)).result(5.0) == ""
    wait(lambda: not owner.seen.lost)
    owner.close()
    assert not run.running


def test_a_stop_that_does_not_take_ends_the_signs_of_life() -> None:
    """The loop then releases by itself; whether the lease was lost or somebody asked for the stop."""
    for asks in (True, False):
        run, lease = FakeRun(obeys=False), Lease(0.3)
        owner = begun(run, lease)
        if asks:
            stopped = owner.ask("", Request.STOP)
            assert stopped.result(5.0) == ""
        wait(lambda run=run: Request.STOP in run.asked)  # type: ignore[misc]
        begin = time.monotonic()
        while time.monotonic() - begin < 1.0:
            if asks:
                lease.take("a", MonotonicClock().now())
            time.sleep(0.05)
        assert max(run.beats) - begin < TAKEN + 0.15
        run.mode = Mode.LATCHED
        wait(lambda run=run: time.monotonic() - run.beats[-1] < 0.1)  # type: ignore[misc]
        owner.close()


def test_a_stop_is_handed_on_at_once_and_answered_when_the_loop_has_taken_it() -> None:
    run, lease = FakeRun(), Lease(30.0)
    owner = begun(run, lease)
    run.stop_waits = True
    answers = [owner.ask("", Request.STOP) for _ in range(2)]
    assert run.asked[-2:] == [Request.STOP] * 2, "by the thread that asks"
    looked = owner.clock.now()
    wait(lambda: owner.looked > looked)
    assert not any(answer.done() for answer in answers)
    run.stop_waits = False
    assert [answer.result(5.0) for answer in answers] == ["", ""]
    owner.close()


def test_a_stamp_is_good_while_it_is_young_and_no_stop_came_after_it() -> None:
    stamps = Stamps(0.5)
    first = stamps.issue(at(1.0))
    assert stamps.why_not(first, at(1.5)) == ""
    assert "too late" in stamps.why_not(first, at(1.51))
    second = stamps.issue(at(2.0))
    assert second > first
    for none in (None, True, 1.0, str(second), [second]):
        assert "does not say" in stamps.why_not(none, at(2.0))
    for strange in (first - 1, second + 1, -1, 0, 2**60):
        assert "none of this console" in stamps.why_not(strange, at(2.0))
    assert "too late" in stamps.why_not(first, at(2.0))
    assert Stamps(0.5).why_not(second, at(2.0)), "of another console"
    stamps.stop(at(2.1))
    assert "there was a stop" in stamps.why_not(second, at(2.2))
    stamps.stop(at(1.0))
    assert "there was a stop" in stamps.why_not(stamps.issue(at(2.1)), at(2.2))
    assert stamps.why_not(stamps.issue(at(2.15)), at(2.2)) == ""


@pytest.mark.parametrize("by", ["a viewer", "the run itself", "a lost lease"])
@pytest.mark.parametrize("request_", [Request.ARM, Request.ACKNOWLEDGE])
def test_what_was_sent_before_a_stop_and_comes_after_it_gives_no_power(by: str, request_: Request) -> None:
    run, lease = FakeRun(), Lease(0.4 if by == "a lost lease" else 30.0)
    owner = begun(run, lease)
    seen = told(owner)
    if by == "a viewer":
        assert owner.ask("", Request.STOP).result(5.0) == ""
    elif by == "the run itself":
        run.mode = Mode.LATCHED if request_ == Request.ACKNOWLEDGE else Mode.STOPPED
    wait(lambda: owner.seen.mode in (Mode.STOPPED, Mode.LATCHED))
    wait(lambda: not lease.look(MonotonicClock().now()).holder or by != "a lost lease")
    lease.take("a", MonotonicClock().now())
    before = [one for one in run.asked if one == request_]
    said = owner.ask("a", request_, seen).result(5.0)
    assert "there was a stop" in said or "too late" in said
    assert [one for one in run.asked if one == request_] == before
    assert "does not say" in owner.ask("a", request_).result(5.0)
    if request_ == Request.ARM:
        seen = told(owner)
        lease.take("a", MonotonicClock().now())
        assert owner.ask("a", request_, seen).result(5.0) == ""
    owner.close()


def test_a_session_that_cannot_begin_says_why() -> None:
    def fails(tell: Any) -> Any:
        raise SafetyError("no drive", do="switch it on")

    owner = RunOwner(Lease(0.5), Stamps(0.5))
    owner.begin(fails)
    wait(lambda: owner.seen.error is not None)
    assert owner.seen.phase == "idle"
    assert owner.ask("a", Request.ARM).result(1.0).startswith("there is no session")
    owner.close()


@settings(max_examples=60)
@given(n=st.integers(0, 400), pixels=st.integers(1, 60), first=st.integers(0, 30), seed=st.integers(0, 99))
def test_a_pixel_has_the_extremes_of_its_rows(n: int, pixels: int, first: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    step = 0.011
    times = np.sort(random.uniform(0.0, 0.7, n))
    values = random.standard_normal((n, 2)).astype(np.float32)
    values[random.random(n) < 0.1] = np.nan
    found = reduced(times, values, values, first, pixels, step)
    place = np.floor(times / step + 1e-9).astype(int)
    for pixel in range(pixels):
        rows = values[place == first + pixel]
        for column in range(2):
            known = rows[np.isfinite(rows[:, column]), column]
            low, high = found[column, pixel]
            assert (np.isnan(low) and np.isnan(high)) if not len(known) else (low, high) == (known.min(), known.max())


class FakeReader:
    """Rows of a run at 1 kHz, as many as are asked for."""

    def __init__(self) -> None:
        self.description = description(columns(LAWS["adaptive"]), {"limits": Limits()._asdict()}, 0, 0)
        self.count, self.next = 0, 0

    def read(self) -> Batch:
        numbers = np.arange(self.next, self.count)
        rows = np.zeros((len(numbers), len(self.description.columns)))
        rows[:, AT["time"]] = 5.0 + 1e-3 * numbers
        rows[:, AT["joint"]] = np.sin(1e-3 * numbers)
        rows[:, AT["motor"]] = np.sin(1e-3 * numbers + 0.1)
        self.next = self.count
        return Batch(numbers, rows)


@pytest.mark.parametrize(("seconds", "pixels"), [(2.0, 2000), (10.0, 900), (30.0, 700), (60.0, 900), (300.0, 500)])
def test_frames_follow_one_another_without_gap_or_overlap(seconds: float, pixels: int) -> None:
    reader: Any = FakeReader()
    watch = Watch(reader, 1e-3)
    view = watch.view(["joint_deg", "nothing", "error_deg"], seconds, pixels, loop=True)
    assert len(view.columns) == 2
    cursor, random, next_pixel, seen = Cursor(view, 5), np.random.default_rng(1), None, []
    while reader.count < 70_000:
        reader.count += int(random.integers(1, 400))
        watch.look()
        frame = watch.frame(cursor)
        if frame is None:
            continue
        kind, columns, count = frame[0], frame[1], int.from_bytes(frame[2:4], "little")
        assert int.from_bytes(frame[4:8], "little") == 5
        begin, step = np.frombuffer(frame[8:24], "<f8")
        assert kind == (WHOLE if next_pixel is None else CURVES)
        assert columns == 2
        values = np.frombuffer(frame[24:], "<f4").reshape(2, count, 2)
        assert step == view.step
        number = round(begin / step)
        assert next_pixel in (None, number)
        next_pixel = number + count
        if not count:  # a window before its first pixel is complete
            continue
        assert np.isfinite(values).all()
        middle = (number + np.arange(count) + 0.5) * step
        wanted = np.rad2deg(np.sin(middle))
        assert np.abs(values[0].mean(axis=1) - wanted).max() < 60.0 * max(step, 0.04)
        assert (values[0, :, 0] <= values[0, :, 1]).all()
        seen.append(count)
    assert sum(seen) >= (70_000 * 1e-3) / view.step * 0.98 - 1
    loop = watch.loop_frame(cursor, 0.1)
    assert loop is not None
    assert loop[0] == 3
    pairs = np.frombuffer(loop[12:], "<f4").reshape(-1, 2)
    assert len(pairs) == int.from_bytes(loop[8:12], "little")
    assert watch.loop_frame(cursor, 0.1) is None


WEARER = '[emg]\nchannel = "biceps_mV"\nrest = 0.02\nmvc = 0.9\nsigma = 0.01\nsource = "mvc.csv"\n'


@pytest.mark.parametrize("known", [True, False])
def test_emg_is_shown_with_its_wearers_levels_and_what_was_detected(tmp_path: Path, known: bool) -> None:
    """From the settings as the ring has them, and as a log has them: an earlier run shows the same curves."""
    (tmp_path / "anna.toml").write_text(WEARER)
    wearer = "wearer = 'anna.toml'" if known else ""
    (tmp_path / "rig.toml").write_text(f"[scenario]\nduration_s = 60.0\n[emg]\nsource = 'lsl:EMG'\n{wearer}\n")
    run = live_run(Rig.read(tmp_path / "rig.toml"))
    made = {"limits": run.limits._asdict(), **run.settings()}
    about = description(columns(run.law, emg=True), made, 0, 0)
    found = columns_of(about.columns, about.units, about.settings)
    assert found == columns_of(about.columns, about.units, json.loads(json.dumps(made)))
    emg = {one.name: one for one in found if one.group == "emg"}
    assert list(emg) == ["emg_level", "emg_flexor", "emg_extensor", "emg_intent"]
    assert (emg["emg_level"].low, emg["emg_level"].high) == ((0.02, 0.9) if known else (None, None))
    rows = np.zeros((3, len(about.columns)))
    said = {"emg.level": [0.02, 0.5, 0.1], "emg.flexor": [0.0, 1.0, 0.0], "emg.extensor": [0.0, 0.0, 1.0]}
    said["emg.intent"] = [0.0, 2.0, 1.0]
    for name, values in said.items():
        rows[:, about.columns.index(name)] = values
    assert np.allclose(taken(list(emg.values()), about.columns, rows).T, [*said.values()])
    without = description(columns(run.law), made, 0, 0)
    assert not [one for one in columns_of(without.columns, without.units, made) if one.group == "emg"]


@pytest.mark.parametrize(
    "settings", [{}, {"limits": None, "emg": 3}, {"emg": {"wearer": "x"}, "limits": {"current_peak": "x"}}]
)
def test_settings_of_a_strange_log_give_curves_without_limits(settings: dict[str, Any]) -> None:
    about = description(columns(LAWS["adaptive"], emg=True), {}, 0, 0)
    assert all(one.low is None and one.high is None for one in columns_of(about.columns, about.units, settings))


def test_a_viewer_that_fell_behind_gets_the_whole_window_anew() -> None:
    reader: Any = FakeReader()
    watch = Watch(reader, 1e-3)
    cursor = Cursor(watch.view(["joint_deg"], 2.0, 200, loop=False), 1)
    reader.count = 1000
    watch.look()
    assert (watch.frame(cursor) or b" ")[0] == WHOLE
    for _ in range(5):
        reader.count += 1000
        watch.look()
    frame = watch.frame(cursor) or b" "
    assert frame[0] == WHOLE
    assert int.from_bytes(frame[2:4], "little") == 200


def test_a_terminals_rows_are_read_by_a_reader_for_each_thread_and_pages_change_no_gain(tmp_path: Path) -> None:
    """The terminal's own reads on while pages are told: a barrier is a lock, which no two threads may share."""
    about = description(columns(LAWS["adaptive"]), {"limits": {}}, 0, 0)
    create(tmp_path / "a.ring", about, 64)
    writer, rows = RingWriter(tmp_path / "a.ring"), RingReader(tmp_path / "a.ring")
    seen = {"recorder": 1, "row_of": lambda row: {"mode": row[0]}}
    session: Any = SimpleNamespace(rows=rows, logs=[tmp_path / "a.mcap"], **seen)
    run, failed, over = TerminalRun(session, []), [], threading.Event()

    def told() -> None:
        try:
            while not over.is_set():
                assert run.seen.phase == "live"
        except RuntimeError as error:
            failed.append(error)

    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    thread = threading.Thread(target=told)
    thread.start()
    try:
        for _ in range(3000):
            writer.write(np.zeros(len(about.columns)))
            assert len(rows.read().rows) == 1
            rows.last()
    finally:
        over.set()
        thread.join()
        sys.setswitchinterval(before)
    assert failed == []
    assert run.ask_gain("a", "bandwidth", 4.0).result(1.0) == "the terminal controls this run"
    asked = list[Request]()
    session.block = SimpleNamespace(ask=asked.append)
    for request in (Request.RUN, Request.STOP):
        assert (run.ask("a", request).result(1.0) == "") == (request == Request.STOP)
    assert asked == [Request.STOP]


def test_settings_make_the_rig_that_runs() -> None:
    rig = Rig(law="adaptive")
    made = RunSettings(rig).changed({"gains": {"feedback_gain": 30.0}, "duration": 7, "subject": "S\x1b[2J"})
    assert made.rig.duration == 7.0
    assert made.fitted.numbers["feedback_gain"] == 30.0
    assert made.about["subject"] == "S[2J"
    again = made.changed({"law": "bowden"})
    assert again.rig.law_name == "bowden"
    assert not again.rig.gains
    assert again.changed({"law": "adaptive"}).rig.hash == made.rig.replace(gains={}).hash
    chirp = made.changed({"reference": {"kind": "multisine"}}).document(locked=False)["reference"]
    assert chirp["kind"] == "multisine"
    with pytest.raises(ParameterError, match="no setting"):
        made.changed({"out": "/"})


def test_the_preset_and_gains_of_a_rig_are_where_settings_begin_and_return_to() -> None:
    rig = Rig(law="adaptive", preset="suit", gains={"feedback_gain": 31.0})
    begin = RunSettings(rig)
    assert begin.rig.hash == rig.hash
    assert begin.changed({"duration": 7}).rig.hash == rig.replace(duration=7.0).hash
    shown = begin.document(locked=False)
    assert shown["gains"]["feedback_gain"]["value"] == 31.0
    assert shown["preset"] == ""
    assert shown["presets"][0] == {"name": "", "title": "of the rig: preset suit, 1 of its own"}
    assert [one["name"] for one in shown["presets"]] == ["", None, "paper", "suit"]

    away = begin.changed({"law": "bowden"})
    assert away.document(locked=False)["preset"] is None
    assert "" not in [one["name"] for one in away.document(locked=False)["presets"]]
    with pytest.raises(ParameterError, match="preset is"):
        away.changed({"preset": ""})
    assert away.changed({"law": "adaptive"}).rig.hash == rig.hash

    for other in (None, "paper", "suit"):
        made = begin.changed({"preset": other})
        assert made.rig.hash == rig.replace(preset=other, gains={}).hash
        assert made.document(locked=False)["preset"] == other
        assert made.changed({"preset": ""}).rig.hash == rig.hash
    edited = begin.changed({"gains": {"feedback_gain": 20.0}})
    assert edited.document(locked=False)["edited"] == ["feedback_gain"]
    assert edited.changed({"preset": ""}).rig.hash == rig.hash, "what was edited is taken back"
    plain = RunSettings(Rig(law="adaptive")).changed({"preset": None})
    assert plain.document(locked=False)["preset"] == "" == plain.document(locked=False)["presets"][0]["name"]


def test_one_field_of_a_reference_leaves_the_others() -> None:
    rig = Rig.of_tree(
        {"reference": {"kind": "periodic_minimum_jerk", "low_deg": 5.0, "high_deg": 42.0, "period_s": 3.0}}, Path()
    )
    fields = {"low_deg": 5.0, "high_deg": 42.0, "period_s": 3.0}

    def values(made: RunSettings) -> dict[str, float]:
        shown = made.document(locked=False)["reference"]["fields"]
        return {name: one["value"] for name, one in shown.items()}

    begin = RunSettings(rig)
    for kind in ({}, {"kind": "periodic_minimum_jerk"}):
        made = begin.changed({"reference": {**kind, "high_deg": 40.0}})
        assert values(made) == fields | {"high_deg": 40.0}
        made = made.changed({"reference": {**kind, "period_s": 4.0}})
        assert values(made) == fields | {"high_deg": 40.0, "period_s": 4.0}
    away = begin.changed({"reference": {"kind": "multisine"}})
    assert values(away.changed({"reference": {"kind": "periodic_minimum_jerk"}})) == fields, "the rig's own comes back"


def test_a_recorded_reference_of_the_rig_can_be_returned_to(tmp_path: Path) -> None:
    times = np.arange(0.0, 4.0, 0.01)
    rows = "\n".join(f"{t:.2f},{20.0 - 20.0 * np.cos(1.5 * t):.4f}" for t in times)
    (tmp_path / "motion.csv").write_text(f"time_s,joint_deg\n{rows}\n")
    (tmp_path / "rig.toml").write_text("[reference]\nkind = 'recorded'\nfile = 'motion.csv'\n")
    begin = RunSettings(Rig.read(tmp_path / "rig.toml"))
    away = begin.changed({"reference": {"kind": "multisine"}})
    assert "recorded" in away.document(locked=False)["reference"]["kinds"]
    assert away.changed({"reference": {"kind": "recorded"}}).rig.hash == begin.rig.hash
    with pytest.raises(ParameterError, match="reference is"):
        away.changed({"reference": {"kind": "recorded", "file": "/etc/passwd"}})
    with pytest.raises(ParameterError, match="reference is"):
        RunSettings(Rig()).changed({"reference": {"kind": "recorded"}})


def test_a_log_that_is_removed_while_the_list_is_made_is_left_out(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = EarlierRuns(tmp_path / "out", Jobs(), lambda: ())
    assert runs._files() == {}, "there is no folder"
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "kept.mcap").touch()
    there = [tmp_path / "out" / name for name in ("removed.mcap", "kept.mcap")]
    monkeypatch.setattr(Path, "glob", lambda *_: iter(there))
    assert list(runs._files()) == ["kept"]
    runs.close()
