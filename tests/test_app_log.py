"""``bowden log``: a run through the live cycle is recorded, told, exported, drawn, replayed, and saved from damage."""

import io
import json
import math
import os
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden.app import main
from bowden.app.console import trusting
from bowden.control import LAWS, law_file
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core import own_file
from bowden.core.errors import LogError
from bowden.core.signals import DriveReading, Reference, Sample
from bowden.cycle.one_cycle import HOLD, LAW, LAW_BEGINS, NOWHERE, Cycle, Filters, Plan, TargetSource
from bowden.hardware.drives.families.ak_mit import AkParameters
from bowden.identify.log.read import read_log
from bowden.live import live_run as live_run_of
from bowden.live.events import Changes
from bowden.live.gain_ramp import GainRamp
from bowden.live.log_facts import facts
from bowden.live.log_rig import UnknownCodeError, rig_of_log
from bowden.live.mcap_log import LogFile, about
from bowden.live.mcap_read import read
from bowden.live.preflight import Reason
from bowden.live.row import CYCLE, columns, description
from bowden.live.run_settings import run_settings
from bowden.models.drive.thermal import cold
from bowden.records.trace import Trace
from bowden.rig.families import family_of
from bowden.rig.rig import Rig
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Observed, PreflightResult, Request, Verdict
from bowden.sensing.intent import Intent
from bowden.views.log import lines
from support.command import Command

pytestmark = pytest.mark.usefixtures("undrawn")

CYCLES, DT = 3000, 1e-3
LAW_USED = LAWS["adaptive"].with_gains(feedback_gain=4.0)


def live_run() -> np.ndarray:
    """Rows of a run: armed, run, a joint angle that is missing twice, stopped; the motor is a first-order lag."""
    limits, filters = Limits(), Filters(joint=600.0)
    cycle = Cycle(LAW_USED, limits, filters, DT)
    gains = GainRamp(LAW_USED, cycle.gains, DT)
    noise = np.random.default_rng(2).normal(0.0, 1e-4, (CYCLES, 3))
    motor, drive, mode, target, rows = 0.1, 1.0, 0.0, 0.1, []
    motion = PeriodicMinimumJerk(0.0, 0.6, 2.0).sample(DT * np.arange(CYCLES))
    begun, ran = False, 0
    for k in range(CYCLES):
        joint = math.nan if k in (1500, 1501) else 0.93 * motor - 0.02 + noise[k, 0]
        reading = DriveReading(
            motor, joint, 0.1 + noise[k, 0], math.nan, 35.0, 0.0, 0.0, 0.01, drive, 0.0, 0.0, 0.0, 0.0
        )
        if not begun:
            cycle.begin(reading, cold(limits.thermal))
            begun, target = True, cycle.state.supervisor.target
        request = {50: Request.ARM, 200: Request.RUN, 2600: Request.STOP}.get(k, Request.NONE)
        running = mode in (Mode.RUNNING, Mode.BRIDGING)
        source = HOLD if not running else LAW_BEGINS if ran == 0 else LAW
        reference = Reference(*map(float, motion[ran])) if running else NOWHERE
        ran += running
        lateness, elapsed = abs(noise[k, 1]) * 0.1, DT + noise[k, 2] * 0.1
        observed = Observed(reading, lateness, elapsed, request, 0.05, True, PreflightResult(int(k > 150)), 0.0)
        requested_target, verdict = cycle.step(observed, Plan(source, target, reference))
        mode, target, state = verdict.mode, verdict.target, cycle.recorded()
        rows.append(
            (
                *(k * DT, *reference, *reading, *state.sample[:2], requested_target),
                *(*verdict, source, lateness, elapsed, 0.0, float(request), 0.05, 1.0, observed.preflight, 0.0),
                *(math.nan, 8e-5),
                *(*state.law, *state.conditioned, *state.supervisor, *gains.recorded),
            )
        )
        drive = min(drive + 1.0, 4.0) if verdict.power > 2.5 else 1.0
        motor += (target - motor) * DT / 0.02 if drive == 4.0 else 0.0
    return np.array(rows)


@pytest.fixture(scope="module")
def rows() -> np.ndarray:
    return live_run()


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, rows: np.ndarray, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    settings = run_settings(LAW_USED, Limits(), Filters(joint=600.0), DT) | {"seed": 2, "unset": math.nan}
    write(Path("run.mcap"), rows, settings)
    return tmp_path


def write(path: Path, rows: np.ndarray, settings: dict[str, Any], *, close: bool = True) -> None:
    told = description(columns(LAW_USED), settings, 1_700_000_000 * 10**9, 5)
    changes = Changes(told)
    with path.open("xb") as opened:
        file = LogFile(opened.fileno(), about(told, {"software": "bowden 1", "host": "rig"}))
        for first in range(0, len(rows), 100):
            part = np.arange(first, min(first + 100, len(rows)))
            events, changes = changes.find(part, rows[part])
            file.write(part, rows[part], events)
        if close:
            file.finish({"lost": "0", "dropped": "0"})


def test_the_columns_are_in_the_order_in_which_the_loop_fills_them() -> None:
    names = list(CYCLE)
    assert tuple(names[4:21]) == DriveReading._fields
    assert tuple(name.removesuffix("_seen") for name in names[21:23]) == Sample._fields[:2]
    assert ("target", *names[25:29]) == Verdict._fields


def test_info_tells_what_the_log_holds(rows: np.ndarray, command: Command) -> None:
    told = command.document("log info run.mcap")
    assert (told["cycles"], told["missing"], told["closed"], told["whole"]) == (CYCLES, 0, True, True)
    assert told["duration_s"] == pytest.approx(2.999)
    mode = rows[:, list(told["columns"]).index("mode")]
    assert told["running_s"] == rows[int(np.argmax(mode == Mode.RUNNING)), 0]
    assert told["start_utc"] == "2023-11-14T22:13:20+00:00"
    assert (told["law"], told["seed"], told["sample_time_s"]) == ("adaptive", 2, pytest.approx(1e-3))
    lateness = rows[:, list(told["columns"]).index("lateness")]
    assert told["lateness"]["p999_us"] == pytest.approx(1e6 * np.percentile(lateness, 99.9))
    assert told["lateness"]["max_us"] == 1e6 * lateness.max()
    assert told["settings"]["gains"]["feedback_gain"] == 4.0
    assert told["settings"]["unset"] is None
    texts = [event["text"] for event in told["events"]]
    changes = {
        "mode: stopped → preflight",
        "mode: preflight → running",
        "source: hold → law_begins",
        "fault: joint_lost",
    }
    changes |= {"mode: running → bridging", "mode: bridging → running", "power: on → off"}
    assert changes <= set(texts)
    printed = command("log info run.mcap")
    assert "3000 cycles" in printed.out
    assert "closed properly  yes" in printed.out
    assert f"running          from {told['running_s'] - told['begin_s']:.3f} s on" in printed.out
    assert printed.err == ""


def test_motions_and_the_doubt_of_an_estimated_joint_are_told() -> None:
    log = read(Path("run.mcap"))
    led = int(np.flatnonzero(log["source"] >= TargetSource.LAW_BEGINS)[0])
    intent = np.repeat([Intent.REST, Intent.FLEX, Intent.HOLD, Intent.EXTEND], [led + 10, 20, 30, CYCLES - led - 60])
    doubt = np.where(np.arange(CYCLES) < led, math.nan, math.radians(0.5))
    rows = np.column_stack([log.rows, intent])
    rows[:, log.columns.index("joint_std")] = doubt
    of_emg = {**log.settings, "emg": {"course": {"proportional": False}}}
    log = replace(log, columns=(*log.columns, "emg.intent"), rows=rows, settings=of_emg)
    found = facts(log)
    assert [(one.time_s, one.text) for one in found.motions] == [
        (log["time"][led + 10], "flex"),
        (log["time"][led + 60], "extend"),
    ]
    assert found.estimate_std_deg == pytest.approx(0.5)
    told = dict(lines(found))
    assert told["joint"] == "estimated; 1 σ 0.500° RMS under the law"
    assert told["motion"].endswith(" s: extend")
    of_emg["emg"]["course"]["proportional"] = True
    assert facts(log).motions == ()


@pytest.mark.parametrize("kind", ["parquet", "csv"])
def test_an_export_is_a_trace_with_every_number(kind: str, rows: np.ndarray, command: Command) -> None:
    told = command.document("log", "export", "run.mcap", "--out", f"run.{kind}")
    assert told["files"] == [f"run.{kind}"]
    trace = Trace.read("run.parquet") if kind == "parquet" else Trace.read("run.csv")
    assert np.array_equal(np.stack(list(trace.columns.values()), axis=1), rows, equal_nan=True)
    assert trace.units["motor"] == "rad"
    assert trace.seed == 2
    assert trace.settings["gains"]["feedback_gain"] == 4.0
    assert trace.settings["log"]["host"] == "rig"


def test_some_of_the_columns_are_the_same_as_in_the_whole(rows: np.ndarray) -> None:
    whole, some = read(Path("run.mcap")), read(Path("run.mcap"), ("joint", "time", "none"))
    assert some.columns == ("time", "joint")
    assert some.units == ("s", "rad")
    for name in some.columns:
        assert np.array_equal(some[name], whole[name], equal_nan=True)
    assert (some.events, some.numbers.tolist()) == (whole.events, whole.numbers.tolist())


def test_a_log_that_is_exported_in_parts_is_the_same(
    rows: np.ndarray, monkeypatch: pytest.MonkeyPatch, command: Command
) -> None:
    monkeypatch.setattr("bowden.live.mcap_read._TRACE", 1000)
    for kind in ("parquet", "csv"):
        command.document("log", "export", "run.mcap", "--out", f"a.{kind}")
    for trace in (Trace.read("a.parquet"), Trace.read("a.csv")):
        assert np.array_equal(np.stack(list(trace.columns.values()), axis=1), rows, equal_nan=True)


def test_identify_reads_an_export_of_a_run(rows: np.ndarray) -> None:
    assert main.run(["log", "export", "run.mcap"]) == 0
    log = read_log(Path("run.csv"))
    assert "2 rows without a number in 1 place were left out" in log.warnings
    beginning = rows[:1500].copy()
    joint = list(read(Path("run.mcap")).columns).index("joint")
    beginning[:2, joint - 1 : joint + 1] = math.nan  # a live run begins before the drive's first answer
    write(Path("begins.mcap"), beginning, {"law": "adaptive"})
    assert main.run(["log", "export", "begins.mcap"]) == 0
    log = read_log(Path("begins.csv"))
    assert np.array_equal(log.joint, rows[2:1500, joint])
    assert "the first 2 rows, in which no angle had been read yet, were left out" in log.warnings
    write(Path("clean.mcap"), rows[:1500], {"law": "adaptive"})
    assert main.run(["log", "export", "clean.mcap"]) == 0
    log = read_log(Path("clean.csv"))
    columns = list(read(Path("clean.mcap")).columns)
    assert np.array_equal(log.motor, rows[:1500, columns.index("motor")])
    assert np.array_equal(log.joint, rows[:1500, columns.index("joint")])


@pytest.mark.drawn
def test_a_page_is_drawn(command: Command) -> None:
    assert command.document("log plot run.mcap")["files"] == ["run.html"]
    page = Path("run.html").read_text(encoding="utf-8")
    for wanted in ("Modes, reactions and faults", "How punctual the loop was", "fault: joint_lost", "Inside the law"):
        assert wanted in page
    assert page.count("<figure>") == 6
    assert main.run(["log", "plot", "run.mcap", "--out", "run.mcap"]) == 2


def test_a_replay_of_the_same_law_gives_the_very_numbers(command: Command) -> None:
    told = command.document("log replay run.mcap")
    assert (told["law"], told["same_law"]) == ("adaptive", True)
    assert (told["cycles"], told["beginnings"]) == (CYCLES - 1, 1)
    assert told["law_cycles"] > 2000
    assert (
        told["requested_target_largest"],
        told["requested_target_rms"],
        told["verdicts_differing"],
        told["command_largest"],
    ) == (0, 0, 0, 0)
    assert told["first_difference"] is None
    assert told["first_other_verdict"] is None


def test_a_replay_shows_what_was_changed(rows: np.ndarray, command: Command) -> None:
    columns = list(read(Path("run.mcap")).columns)
    changed = rows.copy()
    changed[2000, columns.index("requested_target")] += 1e-3
    changed[2100, columns.index("mode")] = 1.0
    settings = run_settings(LAW_USED, Limits(), Filters(joint=600.0), DT)
    write(Path("changed.mcap"), changed, settings)
    told = command.document("log replay changed.mcap", code=1)
    assert told["requested_target_largest"] == pytest.approx(1e-3)
    assert (told["first_difference"], told["first_other_verdict"]) == (2.0, 2.1)
    assert told["verdicts_differing"] == 1
    changed[2000, columns.index("requested_target")] = math.nan
    write(Path("nan.mcap"), changed, settings)
    told = command.document("log replay nan.mcap", code=1)
    assert (told["requested_target_largest"], told["first_difference"]) == (0, 2.0)
    changed = rows.copy()
    changed[2000, columns.index("command")] = math.nan
    write(Path("target.mcap"), changed, settings)
    told = command.document("log replay target.mcap", code=1)
    assert (told["verdicts_differing"], told["first_other_verdict"]) == (1, 2.0)
    gains = settings["gains"] | {"error_gain": 0.02}  # a live one goes by its column
    write(Path("gains.mcap"), rows, settings | {"gains": gains})
    assert command.document("log replay gains.mcap", code=1)["requested_target_largest"] > 1e-5


def test_another_law_is_fed_with_the_run(command: Command) -> None:
    told = command.document("log replay run.mcap --law uncompensated")
    assert (told["law"], told["same_law"]) == ("uncompensated", False)
    assert 1e-3 < told["requested_target_largest"] < 1.0
    assert "in place of the record's law" in command("log replay run.mcap --law uncompensated").out


def test_a_law_of_ones_own_is_found_again(rows: np.ndarray, command: Command) -> None:
    source = ["from dataclasses import replace", "from bowden.control import LAWS"]
    Path("my_law.py").write_text("\n".join([*source, "MINE = replace(LAWS['adaptive'], name='mine')"]))
    Path("rig.toml").write_text("[control]\nlaw = 'my_law.py:MINE'\n")
    rig = Rig.read("rig.toml")
    for asked in (rig, rig.with_law("my_law.py:MINE")):
        assert live_run_of.live_run(asked).settings()["law_file"] == f"{Path.cwd()}/my_law.py:MINE"
    told = live_run_of.live_run(rig).settings()
    settings = run_settings(LAW_USED, Limits(), Filters(joint=600.0), DT) | {
        "law": "mine",
        "law_file": told["law_file"],
    }
    write(Path("mine.mcap"), rows, settings)
    found = command.document("log replay mine.mcap")
    assert (found["law"], found["same_law"], found["requested_target_largest"]) == ("mine", True, 0)
    assert "law_file" not in live_run_of.live_run(rig.with_law("observer")).settings()


def test_a_log_alone_is_enough(rows: np.ndarray, tmp_path: Path, command: Command) -> None:
    source = ["from dataclasses import replace", "from bowden.control import LAWS"]
    Path("own.py").write_text("\n".join([*source, "MINE = replace(LAWS['adaptive'], name='mine')"]))
    angles = "\n".join(f"{0.01 * k},{20.0 * math.sin(0.02 * k)}" for k in range(300))
    Path("motion.csv").write_text(f"time_s,joint_deg\n{angles}\n")
    Path("rig.toml").write_text(
        "[control]\nlaw = 'own.py:MINE'\n[control.gains]\nfeedback_gain = 1.5\n[scenario]\nduration_s = 1.0\n"
        "[reference]\nkind = 'recorded'\nfile = 'motion.csv'\n"
    )
    rig = Rig.read("rig.toml")
    told = live_run_of.live_run(rig).settings()
    settings = run_settings(LAW_USED, Limits(), Filters(joint=600.0), DT) | json.loads(json.dumps(told))
    write(Path("alone.mcap"), rows, settings | {"law": "mine"})
    for name in ("own.py", "motion.csv", "rig.toml"):
        Path(name).unlink()
    assert rig_of_log(Path("alone.mcap")) == rig
    found = command.document("log replay alone.mcap")
    assert (found["law"], found["same_law"], found["requested_target_largest"], found["rig"]) == (
        "mine",
        True,
        0,
        rig.hash,
    )
    assert command.document("log info alone.mcap")["rig"] == rig.hash
    again = command.document("simulate", "alone.mcap", "--out", tmp_path / "again")
    assert (again["rig"], again["runs"][0]["law"]) == (rig.hash, "mine")


def test_a_program_that_a_log_brings_along_runs_only_once_its_user_says_so(
    rows: np.ndarray,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    command: Command,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    text = "from dataclasses import replace\nfrom pathlib import Path\nfrom bowden.control import LAWS\n"
    text += "Path('ran').touch()\nMINE = replace(LAWS['adaptive'], name='mine')\n"
    Path("own.py").write_text(text)
    Path("rig.toml").write_text("[control]\nlaw = 'own.py:MINE'\n")
    told = live_run_of.live_run(Rig.read("rig.toml")).settings()
    settings = run_settings(LAW_USED, Limits(), Filters(joint=600.0), DT) | json.loads(json.dumps(told))
    write(Path("theirs.mcap"), rows, settings | {"law": "mine"})
    named = Path("elsewhere.py").absolute()
    named.write_text(text + "# another\n")
    without = settings | {"law": "mine", "law_file": f"{named}:MINE", "rig": Rig().document()}
    write(Path("named.mcap"), rows, without)
    another = tmp_path / "another user's"
    another.mkdir()
    monkeypatch.setattr(own_file, "cache_folder", lambda: another)
    law_file._load.cache_clear()
    Path("ran").unlink()
    for words in (["log", "replay", "theirs.mcap"], ["simulate", "theirs.mcap"], ["log", "replay", "named.mcap"],
                  ["log", "replay", "theirs.mcap", "--law", f"{named}:MINE"]):  # fmt: skip
        said = command(*words, code=2).err
        assert "never run on this computer" in said
        assert Path("ran").exists() == ("--law" in words)  # what the user names runs; the log's own text does not
        Path("ran").unlink(missing_ok=True)
    found = command.document("log replay theirs.mcap --trust-law")
    assert (found["law"], found["same_law"]) == ("mine", True)
    assert command.document("log replay theirs.mcap")["law"] == "mine"  # it is remembered


def test_the_question_about_a_program_puts_no_orders_on_a_terminal(monkeypatch: pytest.MonkeyPatch) -> None:
    class Terminal(io.StringIO):
        def isatty(self) -> bool:
            return True

    def made() -> None:
        raise UnknownCodeError("a.mcap", [own_file.OwnFile("\x1b[2Jlaw.py\n", "", b"")])

    monkeypatch.setattr("sys.stdin", Terminal("n\n"))
    monkeypatch.setattr("sys.stderr", said := Terminal())
    with pytest.raises(UnknownCodeError):
        trusting(made)
    assert "·[2Jlaw.py·, which" in said.getvalue()
    assert said.getvalue().isprintable()


def test_the_rig_of_a_log_that_cannot_be_used_is_refused_in_a_line(rows: np.ndarray) -> None:
    settings = run_settings(LAW_USED, Limits(), Filters(joint=600.0), DT)
    document = json.loads(json.dumps(Rig(delay=2).document()))
    document["fields"]["servo"]["dampng"] = 1.0
    write(Path("other.mcap"), rows, settings | {"rig": document})
    write(Path("older.mcap"), rows, settings | {"rig": Rig().tree()})
    for name, said in (
        ("other.mcap", "servo.dampng: Extra inputs are not permitted"),
        ("run.mcap", "does not say with which rig it ran"),
        ("older.mcap", "has the format None"),
    ):
        with pytest.raises(LogError, match=said) as refused:
            rig_of_log(Path(name))
        assert "\n" not in str(refused.value)


def test_an_emergency_and_a_preflight_that_failed_are_events(rows: np.ndarray, command: Command) -> None:
    changed, names = rows[:100].copy(), list(read(Path("run.mcap")).columns)
    changed[50, names.index("emergency")] = 0x4210
    changed[60:, names.index("preflight_reason")] = float(Reason.JOINT_STILL)
    write(Path("changed.mcap"), changed, run_settings(LAW_USED, Limits(), Filters(), DT))
    events = {event.number: event.text for event in read(Path("changed.mcap")).events if event.number >= 50}
    assert events[50] == "emergency: 0x4210"
    assert "0.050 s: 0x4210: over-temperature of the power stage" in command("log info changed.mcap").out
    assert events[60] == "preflight_reason: none → joint_still"


def test_an_emergency_is_said_in_the_words_of_the_drive_s_family(rows: np.ndarray, command: Command) -> None:
    changed, names = rows[:100].copy(), list(read(Path("run.mcap")).columns)
    changed[50, names.index("emergency")] = 1.0
    rig = Rig(drive=AkParameters(), motor={"gear": 9.0})
    settings = run_settings(LAW_USED, Limits(), Filters(), DT) | {"rig": rig.document()}
    write(Path("ak.mcap"), changed, settings)
    assert family_of(rig.drive).explain(1) in command("log info ak.mcap").out


def test_gaps_begin_a_replay_anew(rows: np.ndarray, command: Command) -> None:
    data = bytearray(Path("run.mcap").read_bytes())
    gains = 2 * len(LAW_USED.live)  # the columns behind the supervisor's
    data[data.index(rows[1510, -20 - gains : -gains].tobytes())] ^= 1
    Path("hurt.mcap").write_bytes(data)
    told = command.document("log replay hurt.mcap")
    assert told["beginnings"] == 2
    assert (told["requested_target_largest"], told["verdicts_differing"]) == (0, 0)


def test_what_a_kill_left_is_told_and_recovered(rows: np.ndarray, command: Command) -> None:
    write(Path("killed run.mcap"), rows, {"law": "adaptive"}, close=False)
    os.truncate("killed run.mcap", Path("killed run.mcap").stat().st_size - 3)
    printed = command("log", "info", "killed run.mcap")
    assert "closed properly  no" in printed.out
    assert (
        printed.err
        == "bowden: note: killed run.mcap was not closed properly; see: bowden log recover 'killed run.mcap'\n"
    )
    told = command.document("log", "recover", "killed run.mcap")
    assert told["files"] == ["killed run.recovered.mcap"]
    assert (told["rows"], told["missing"], told["tail_seconds"]) == (CYCLES, 0, 0.2)
    assert command.document("log", "info", "killed run.recovered.mcap")["whole"]
    assert (
        "up to 0.2 s of the run may be missing"
        in command("log", "recover", "killed run.mcap", "--out", "again.mcap").out
    )
    assert main.run(["log", "recover", "killed run.mcap"]) == 2


@pytest.mark.parametrize("word", ["info", "recover", "export", "plot", "replay"])
@pytest.mark.parametrize(
    ("content", "said"),
    [(b"", "is empty"), (b"no log", "is no MCAP file"), (b"\x89MCAP0\r\n\0", "does not say"), (None, "cannot read")],
)
def test_bad_files_are_one_line(word: str, content: bytes | None, said: str, folder: Path, command: Command) -> None:
    if content is not None:
        (folder / "bad.mcap").write_bytes(content)
    before = sorted(folder.iterdir())
    assert said in command.refused("log", word, "bad.mcap")
    assert sorted(folder.iterdir()) == before


def test_a_replay_needs_what_it_compares(rows: np.ndarray, command: Command) -> None:
    settings = run_settings(LAW_USED, Limits(), Filters(), DT)
    for name, changes, said in (
        ("a", {"limits": {"motor_low": 0.0}}, "no limits that this version knows"),
        ("b", {"law": "none_such"}, "there is no law 'none_such'"),
        ("c", {"law": None}, "does not say which law"),
        ("d", {"gains": {"other": 1.0}}, "gains are not those of the law"),
        ("e", {"law": "observer", "gains": {}}, "no column law."),
    ):
        write(Path(f"{name}.mcap"), rows[:50], settings | changes)
        assert said in command.refused("log", "replay", f"{name}.mcap")
