"""`bowden run` by EMG: what is refused before anything is started, and what its figures are."""

from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from bowden.app.main import run
from bowden.core.errors import BowdenError
from bowden.hardware.emg.recorded import EmgMotion, columns
from bowden.hardware.ports import EmgChunk
from bowden.live.figures import DelaySpread
from bowden.live.live_run import Live, live_run
from bowden.live.preflight import Preflight, require
from bowden.live.screen import _emg, wearer
from bowden.live.summary import emg_figures
from bowden.rig.rig import Rig
from bowden.sensing.course import CourseSettings
from bowden.sensing.stream import EnvelopeFilter
from support.command import Command

pytestmark = pytest.mark.usefixtures("undrawn")

RATE = 1000.0
WEARER = '[emg]\nchannel = "{channel}"\nrest = {rest}\nmvc = {mvc}\nsource = "mvc.csv"\n'


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """13 s: a second of contraction every two seconds."""
    time_s = np.arange(round(13.0 * RATE)) / RATE
    loud = np.where(time_s % 2.0 >= 1.0, 20.0, 1.0)
    signal = 0.01 * loud * np.random.default_rng(1).standard_normal(len(time_s))
    path = tmp_path_factory.mktemp("emg") / "emg.csv"
    np.savetxt(path, np.column_stack([time_s, signal]), ["%.3f", "%.5f"], ",", header="time_s,biceps_mV", comments="")
    return path


def rig(folder: Path, keys: str = "", more: str = "") -> Path:
    path = folder / "rig.toml"
    path.write_text(
        f"[scenario]\nduration_s = 60.0\n[limits]\nreading_age = 10.0\n{more}\n[emg]\nhigh_deg = 60.0\n{keys}\n"
    )
    return path


def test_a_wearers_file_of_an_earlier_version_is_told(tmp_path: Path) -> None:
    path, text = rig(tmp_path, 'source = "lsl:EMG"\nwearer = "anna.toml"'), WEARER.format(channel="b", rest=1, mvc=9)
    for more, told in (("", 1), ("sigma = 0.4\n", 0)):
        (tmp_path / "anna.toml").write_text(text + more)
        assert sum("calibrate again" in note for note in Rig.read(path).notes) == told


def live_of(path: Path, emg: str | None = None) -> Live:
    """The run of a rig, as the command makes it."""
    rig = Rig.read(path)
    return live_run(rig if emg is None else rig.with_emg(emg))


class Stream:
    """A stream that says who it is, and nothing else."""

    rate, channels, unit = RATE, ("biceps", "triceps"), "mV"

    def open(self) -> str:
        return "a stream"

    def read(self, now: float) -> EmgChunk:
        return EmgChunk(np.zeros((0, 2)), np.zeros(0))

    def lost(self) -> str:
        return ""

    def close(self) -> None:
        pass


def refused(folder: Path, keys: str, source: str | None = "lsl:EMG") -> str:
    """What is said of a run with these keys in [emg], before or as its stream is opened."""
    try:
        live = live_of(rig(folder, keys), source)
        assert live.emg is not None
        columns(live.emg, Stream())
    except BowdenError as error:
        return str(error)
    pytest.fail("it is let through")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("low_deg = 60.0", "emg.low_deg is 60 and high_deg 60"),
        (
            "duration_s = 0.05",
            "emg.duration_s is 0.05, for 60°; expected at least 0.32 s, by 95 % of the joint's speed, l",
        ),
        (
            "mode = 'proportional'\nwearer = 'anna.toml'\nduration_s = 0.2",
            "for 60°; expected at least 0.26 s, by 95 %",
        ),
        ("low_deg = -40.0", "within the joint's limits, -28.6"),
        ("flexor = 'biceps'\nextensor = 'biceps'", "both 'biceps'"),
        ("flexor = 'deltoid'", "lsl:EMG has no channel 'deltoid'; expected one of 'biceps', 'triceps'"),
        ("mode = 'proportional'", "there is no emg.wearer"),
        ("wearer = 'nobody.toml'", "nobody.toml: No such file"),
        ("wearer = 'weak.toml'", "expected at least 1.5 times as much"),
        ("wearer = 'other.toml'", "was measured on 'deltoid' in mV, and lsl:EMG has 'biceps' in mV"),
        ("wearer = 'volts.toml'", "was measured on 'biceps' in V, and lsl:EMG has 'biceps' in mV"),
    ],
)
def test_what_cannot_be_is_one_line(tmp_path: Path, keys: str, said: str) -> None:
    for name, channel, low, high in (
        ("anna", "biceps_mV", 0.01, 0.2),
        ("weak", "biceps_mV", 0.15, 0.2),
        ("below", "biceps_mV", 0.2, 0.1),
        ("other", "deltoid_mV", 0.01, 0.2),
        ("volts", "biceps_V", 0.01, 0.2),
    ):
        (tmp_path / f"{name}.toml").write_text(WEARER.format(channel=channel, rest=low, mvc=high))
    found = refused(tmp_path, keys)
    assert said in found
    assert "\n" not in found


@pytest.mark.parametrize("source", ["foo", "lsl:", "file:", "usb:1", "trigno:host:port"])
def test_what_is_no_source_is_one_line_for_every_command(source: str, tmp_path: Path, command: Command) -> None:
    path = rig(tmp_path, f"source = '{source}'")
    for name in ("simulate", "check"):
        assert f"{source!r} is not a source of EMG; expected lsl:NAME" in command.refused(name, path)
    assert f"{source!r} is not a source of EMG" in refused(tmp_path, "", source)


def test_the_suits_rig_that_init_writes_can_run(tmp_path: Path, command: Command) -> None:
    path = tmp_path / "suit.toml"
    assert f"bowden run {path} --twin" in command("init", path, "--suit").out
    live = live_of(path, "lsl:EMG")
    require(live.limits, live.rig.sample_time, "little_margin")
    assert live.rig.worn is not None
    assert live.needs.spool is not None
    assert live.needs.gear == live.rig.worn.motor.gear == 25.0
    assert live.rig.worn.motor.integral == 40.0
    assert live.script()._checks.noise > Preflight().noise
    assert run(["init", str(path), "--suit"]) == 2


def test_a_rig_without_a_source_runs_by_its_reference_and_with_one_by_emg(tmp_path: Path) -> None:
    path = rig(tmp_path)
    live = live_of(path)
    assert live.emg is None
    assert live.limits.uses_emg == 0.0
    by_emg = live_of(path, "lsl:EMG")
    assert by_emg.emg is not None
    assert by_emg.limits.uses_emg == 1.0
    assert by_emg.settings()["emg"]["source"] == "lsl:EMG"
    assert live_of(rig(tmp_path, "source = 'lsl:A'"), "lsl:B").emg.source == "lsl:B"  # type: ignore[union-attr]


def test_a_wearer_of_the_channel_is_taken_and_the_unit_may_stand_in_the_name_or_beside_it(tmp_path: Path) -> None:
    (tmp_path / "anna.toml").write_text(WEARER.format(channel="triceps_mV", rest=0.01, mvc=0.3))
    live = live_of(rig(tmp_path, "wearer = 'anna.toml'\nflexor = 'triceps'"), "lsl:EMG")
    assert live.emg is not None
    assert columns(live.emg, Stream()) == (1, None)


def test_a_recording_is_found_from_the_rig_and_simulated_as_it_would_run(tmp_path: Path, recording: Path) -> None:
    (tmp_path / "emg.csv").write_bytes(recording.read_bytes())
    made = Rig.read(rig(tmp_path, "source = 'file:emg.csv'\nduration_s = 0.6")).offline()
    assert isinstance(made.reference, EmgMotion)
    assert made.duration == made.reference.duration == pytest.approx(13.0, abs=0.01), (
        "the recording's, of 60 s asked for"
    )
    path = made.reference.sample(np.arange(13_000) * 1e-3)
    turns = np.flatnonzero(np.diff(np.sign(path[:, 1])))
    assert len(turns) >= 10, "six contractions, a motion for each"
    assert path[:, 0].max() == pytest.approx(np.pi / 3.0)
    assert path[:, 0].min() == 0.0
    checked = Rig.read(rig(tmp_path, "source = 'file:emg.csv'"))
    assert checked.trajectory.sample(np.linspace(0.0, 4.0, 100))[:, 0].max() == pytest.approx(np.pi / 3.0, abs=1e-2)
    stream = Rig.read(rig(tmp_path, "source = 'lsl:EMG'")).offline()
    assert "lsl:EMG is live" in stream.notes[-1]


def test_a_simulation_is_moved_by_a_recording_in_place_of_the_rigs_reference(
    tmp_path: Path, recording: Path, command: Command
) -> None:
    bench, source = tmp_path / "bench.toml", f"file:{recording}"
    bench.write_text("[scenario]\nduration_s = 2.0\n")
    found = command.document("simulate", bench, "--emg", source, "--out", tmp_path / "out")
    assert found["rig"] == Rig.read(bench).with_emg(source).hash != Rig.read(bench).hash
    assert f"write file:{recording}" in command.refused("simulate", bench, "--emg", recording)


def test_a_simulated_joint_follows_no_envelope_while_either_electrode_is_in_trouble(tmp_path: Path) -> None:
    random, time_s = np.random.default_rng(1), np.arange(8000) / RATE
    biceps = 0.01 * np.where(time_s > 2.0, 20.0, 1.0) * random.standard_normal(8000)
    triceps = 0.01 * random.standard_normal(8000) + np.sin(100.0 * np.pi * time_s) * (abs(time_s - 5.0) < 1.0)
    table, header = np.column_stack([time_s, biceps, triceps]), "time_s,biceps_mV,triceps_mV"
    np.savetxt(tmp_path / "emg.csv", table, ["%.3f", "%.5f", "%.5f"], ",", header=header, comments="")
    (tmp_path / "me.toml").write_text(WEARER.format(channel="biceps_mV", rest=0.008, mvc=0.2))
    keys = ("source = 'file:emg.csv'", "mode = 'proportional'", "wearer = 'me.toml'", "extensor = 'triceps_mV'")
    made = Rig.read(rig(tmp_path, "\n".join([*keys, "duration_s = 0.5"]))).offline()
    calm, before, within, after = made.reference.sample(np.array([1.5, 3.9, 5.8, 7.4]))[:, 0]
    assert calm == pytest.approx(0.0, abs=0.05)
    assert min(before, after) > 0.5
    assert within == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("file:nowhere.csv", "nowhere.csv"),
        ("carrier:pigeon", "is not a source of EMG"),
        ("file:empty.csv", "empty.csv"),
    ],
)
def test_a_source_that_cannot_be_used_is_told_before_anything_is_started(
    tmp_path: Path, source: str, said: str, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def never(*given: object, **named: object) -> None:
        raise AssertionError("something was started")

    for name in ("session.Session", "twin_process.own_twin"):
        monkeypatch.setattr(f"bowden.live.{name}", never)
    (tmp_path / "empty.csv").write_text("time_s,emg_mV\n")
    source = source.replace("file:", f"file:{tmp_path}/")
    code = run(["run", str(rig(tmp_path)), "--twin", "--auto", "--emg", source, "--out", str(tmp_path / "out")])
    err = capsys.readouterr().err
    assert code == 2
    assert said in err
    assert err.count("\n") == 1
    assert list((tmp_path / "out").glob("*")) == []


def test_the_screen_shows_envelope_muscles_trouble_and_age() -> None:
    row = {"emg.share": 0.5, "emg.level": 0.1234, "emg.flexor": 1.0, "emg.extensor": 0.0, "emg.trouble": 0.0}
    row |= {"emg.age": 0.0042, "emg.intent": 1.0}
    assert _emg(row, "mV", "") == "flex: ██████████░░░░░░░░░░ 50 % MVC, [bold]flexor contracts[/bold], 4 ms old"
    row |= {"emg.share": float("nan"), "emg.flexor": 0.0, "emg.trouble": 2.0}
    shown = _emg(row, "mV", "it has gone")
    assert shown == "flex: 0.123 mV, at rest, [red]movement or mains[/red], [red]it has gone[/red]"
    assert _emg(row, "[blink]", "").startswith(r"flex: 0.123 \[blink]"), "a unit is text and no markup"
    assert "-" not in _emg(row | {"emg.share": -0.3}, "mV", "").split("%")[0].split(" ")[1]


def test_the_wearer_is_shown_before_arming_and_kept_in_the_log(tmp_path: Path) -> None:
    """And a rest that is another one's is told until the law has the motor; one's own swings by less."""
    (tmp_path / "[anna].toml").write_text(WEARER.format(channel="biceps_mV", rest=0.01, mvc=0.5))
    live = live_of(rig(tmp_path, 'wearer = "[anna].toml"'), "lsl:EMG")
    assert live.emg is not None
    assert live.settings()["emg"]["wearer_file"] == "[anna].toml"
    row = {"emg.level": 0.012, "emg.flexor": 0.0, "emg.trouble": 0.0, "source": 0.0}
    told = r"\[anna].toml: biceps_mV at rest 0.01, at most 0.5"
    assert wearer(live.emg, row) == told
    for level in (0.05, 0.002):
        said = f"{told}, [red]and rests at {level:.3g} now: another wearer's file, or electrodes elsewhere?[/red]"
        assert wearer(live.emg, row | {"emg.level": level}) == said
        for other in ({"source": 3.0}, {"emg.flexor": 1.0}, {"emg.trouble": 1.0}):
            assert wearer(live.emg, row | {"emg.level": level} | other) == told
    unknown = live_of(rig(tmp_path), "lsl:EMG")
    assert unknown.emg is not None
    assert "not known" in wearer(unknown.emg, row)
    envelope = EnvelopeFilter(RATE).feed(np.random.default_rng(1).normal(size=60_000)).envelope[500:]
    assert 0.5 * envelope.mean() < envelope.min()
    assert envelope.max() < 2.0 * envelope.mean()


def test_figures_are_of_motions_and_their_delays() -> None:
    """Two motions on a made-up log: the second one's joint never moves."""
    time_s = np.arange(6000) * 1e-3
    intent = np.select([time_s < 1.0, time_s < 3.0, time_s < 4.0, time_s < 5.0], [0.0, 1.0, 2.0, 3.0], 0.0)
    joint = np.where(time_s < 1.5, 0.0, 0.5)
    log = {
        "time": time_s,
        "source": np.where(time_s < 0.5, 0.0, 3.0),
        "emg.intent": intent,
        "emg.onset": np.where(time_s < 4.0, 0.99, 3.98),
        "emg.age": np.full(6000, 0.004),
        "emg.samples": time_s * 1e3,
        "emg.lost": np.full(6000, 2.0),
        "command": np.where(time_s < 1.2, 0.0, np.where(time_s < 4.1, 1.0, 0.0)),
        "joint": joint,
        "reference": np.where(time_s < 2.5, joint, joint + np.radians(3.0)),
    }
    run_by, emg_process = (
        SimpleNamespace(source="lsl:EMG", course=CourseSettings(), where="anna.toml"),
        SimpleNamespace(stream="LSL", lost=""),
    )
    found = emg_figures(log, run_by, emg_process)  # type: ignore[arg-type]
    assert (found.motions, found.wearer) == (2, "anna.toml")
    assert found.onset_to_cycle_ms == DelaySpread(15.0, 19.9, 20.0)
    assert found.onset_to_command_ms is not None
    assert found.onset_to_command_ms.max == pytest.approx(210.0)
    assert found.onset_to_joint_ms == DelaySpread(510.0, 510.0, 510.0)
    assert found.peak_after_first_second_deg == pytest.approx(3.0)
    assert (found.samples, found.lost, found.age_ms and found.age_ms.p50) == (5999, 2, 4.0)
    run_by.course = CourseSettings(proportional=True)
    follows = emg_figures(log, run_by, emg_process)  # type: ignore[arg-type]
    told = ("motions", "onset_to_cycle_ms", "onset_to_command_ms", "onset_to_joint_ms", "peak_after_first_second_deg")
    assert [getattr(follows, name) for name in told] == [None] * 5


def test_emg_of_a_rig_is_none_without_a_source(tmp_path: Path) -> None:
    assert Rig.read(rig(tmp_path)).emg_run is None
