"""From a log to a running law, each command being the one that the last line of the one before names."""

import importlib
import re
import shlex
import subprocess
import tomllib
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import bowden
from bowden import read_trace
from bowden.app.main import run
from bowden.control import LAWS, Law
from bowden.core.units import DEGREES
from bowden.design.check import at_rest
from bowden.design.objections import objections
from bowden.design.trial import Trial
from bowden.design.tune import NoGainsError
from bowden.design.verdict import OtherLaw, mended_law, other_law
from bowden.plants.presets.bench import default_bench
from bowden.rig.families import names as families
from bowden.rig.rig import Rig
from bowden.views.check import _say_next_of
from bowden.views.text import Call
from live_runs import COMMAND, on_a_shared_computer, tries
from support.command import Command

pytestmark = pytest.mark.usefixtures("undrawn")

CABLES = ["R_5_20", "L_4_00"]
BOUC_WEN = (
    'best = "bouc_wen"\n[models.bouc_wen.parameters]\nslope = 0.938\nhysteresis_gain = -0.114\nrate = 10.5\n'
    "shape = 9.4\nexponent = 3.0\noffset = 0.0\ninitial_h = 0.0\n"
)
"""A model of a cable."""
MOST_DEG = 0.3
"""RMSE of a recorded cable in simulation, with the gains that were found [deg]."""


def followed(log: Path, capsys: pytest.CaptureFixture[str]) -> tuple[list[str], list[str]]:
    """The names of the commands from a log to the one that runs its law, and that one."""
    words, done = ["identify", str(log)], []
    while words[0] != "run":
        done.append(words[0])
        assert run(words) == 0, capsys.readouterr().err
        name, *words = shlex.split(capsys.readouterr().out.splitlines()[-1].removeprefix("Next: "), comments=True)
        assert name == "bowden"
    return done, words


@pytest.mark.usefixtures("small_search")
@pytest.mark.parametrize("cable", [CABLES[0], pytest.param(CABLES[1], marks=pytest.mark.long)])
def test_each_command_names_the_next_one(
    cable: str, shared_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """All but the live run; a recorded cable whose joint falls as its motor rises, and whose zeros are anywhere."""
    monkeypatch.chdir(tmp_path)
    steps = ["identify", "init", "simulate", "check"]
    done, words = followed(shared_data / "cable" / f"{cable}.csv.gz", capsys)
    assert done in ([*steps, "tune"], steps), "gains that hold are run, others are tuned first"
    assert words == ["run", "rig.toml", "--twin", "--auto"]
    rig = tomllib.loads(Path("rig.toml").read_text())
    assert rig["control"]["law"] == "bowden"
    assert rig["control"].get("gains", {}).keys() <= {"bandwidth"}  # smaller where margins ask it
    assert rig["cable"]["direction"] == -1
    covered = tomllib.loads(Path("out/identify/model.toml").read_text())["covered"]["joint_deg"]
    joint = [end - rig["cable"]["joint_zero_deg"] for end in covered]
    assert joint[0] < rig["reference"]["low_deg"] < rig["reference"]["high_deg"] < joint[1]
    assert rig["limits"]["joint_low_deg"] < joint[0] < joint[1] < rig["limits"]["joint_high_deg"]
    assert run(["export", "rig.toml", "--to", "firmware/bowden"]) == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("Next: make -C firmware/bowden check")


@pytest.mark.long
@pytest.mark.live
def test_every_recorded_cable_ends_with_a_running_law(
    shared_data: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    logs = sorted((shared_data / "cable").glob("*.csv.gz"))
    assert len(logs) >= 12
    for log in logs:
        (tmp_path / log.name).mkdir()
        monkeypatch.chdir(tmp_path / log.name)
        _, words = followed(log, capsys)
        assert run(["simulate", "rig.toml", "--out", "tuned"]) == 0
        assert (read_trace(next(Path("tuned").glob("*.npz"))).metrics().rmse_deg or np.inf) <= MOST_DEG, log
        assert run(["export", "rig.toml", "--to", "firmware"]) == 0
        subprocess.run(["make", "-C", "firmware", "check"], check=True, capture_output=True)
        Path("rig.toml").write_text(on_a_shared_computer(Path("rig.toml").read_text()))
        for _ in tries():
            if subprocess.run([*COMMAND, *words, "--duration", "3"], capture_output=True, check=False).returncode == 0:
                break
        else:
            pytest.fail(f"{log.name} does not run")


def test_a_model_that_does_not_say_what_its_log_covered(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], command: Command
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("model.toml").write_text(BOUC_WEN)
    printed = command("init --model model.toml")
    assert "Reference: 0 to 70°, the model does not say what its log covered" in printed.out
    falling = Path("model.toml").read_text().replace("0.938", "-0.938")
    Path("falling.toml").write_text(falling)
    assert run(["init", "--model", "falling.toml", "other.toml"]) == 2
    assert "falling.toml does not say what motion its log covered" in (said := capsys.readouterr().err)
    assert "identify the log again" in said


@pytest.mark.parametrize("family", [*families(), "moteus on a suit"])
def test_a_rig_of_a_model_has_the_drive_that_is_asked_for(
    family: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And nothing for which a run refuses it; off a suit its gains hold."""
    monkeypatch.chdir(tmp_path)
    Path("model.toml").write_text(BOUC_WEN)
    name, _, suit = family.partition(" on a ")
    words = ["init", "rig.toml", "--drive", name, "--model", "model.toml", *(["--suit"] if suit else [])]
    assert run(words) == 0
    rig = Rig.read("rig.toml")
    assert rig.drive.family == name
    assert objections(rig) == ()
    assert suit or bowden.check(rig).verdict == "holds"


def test_a_suit_with_a_drive_that_no_limb_may_have_is_not_written(tmp_path: Path, command: Command) -> None:
    assert "a suit means a limb" in command.refused("init", tmp_path / "suit.toml", "--suit", "--drive", "ak_mit")
    assert not (tmp_path / "suit.toml").exists()


@pytest.mark.parametrize(("span", "code"), [(0.3, 2), (1.9, 0)])
def test_a_log_of_a_small_motion(span: float, code: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Path("model.toml").write_text(
        f'best = "bouc_wen"\n[covered]\nmotor_deg = [0.0, {span}]\njoint_deg = [0.07, {span}]\n'
        "[models.bouc_wen.parameters]\nslope = 0.938\nhysteresis_gain = -0.001\nrate = 10.5\n"
        "shape = 9.4\nexponent = 3.0\noffset = 0.0\ninitial_h = 0.0\n"
    )
    assert run(["init", "--model", "model.toml"]) == code
    if not code:
        reference = tomllib.loads(Path("rig.toml").read_text())["reference"]
        assert (reference["low_deg"], reference["high_deg"]) == (0.26, 1.71)


@pytest.mark.parametrize(
    ("swing", "zone", "confirmed", "verdict", "said"),
    [
        (0.8, 5.0, True, "holds", "at rest the joint swings by ±0.8° in a limit cycle, within the ±2.5°"),
        (0.8, 5.0, False, "holds", "as it was"),
        (2.7, 5.0, True, "limit_cycle", "swings by ±2.7° in a limit cycle, more than the ±2.5°"),
        (0.4, 0.0, False, "holds", "as it was"),
        (0.6, 0.0, False, "limit_cycle", "±0.6°"),
    ],
)
def test_a_swing_at_rest_counts_from_what_the_play_leaves_on(
    swing: float, zone: float, confirmed: bool, verdict: str, said: str
) -> None:
    trial = Trial(40.0, True, "", float(np.radians(swing)), 1.0, 0.0, 0.0, ())
    found = at_rest([trial], [float(np.radians(zone))], "holds", "as it was", confirmed=confirmed)
    assert found[0] == verdict
    assert said in found[1]
    little = at_rest([trial], [float(np.radians(zone))], "little_margin", "as it was", confirmed=confirmed)
    assert little[0] == verdict.replace("holds", "little_margin")
    assert little[1].startswith("as it was")


@pytest.mark.parametrize(
    ("own", "other", "said", "following"),
    [
        (0.2, 0.7, "write bandwidth = 2.32 into", "simulate rig.toml  # once these gains are in it"),
        (0.2, 0.1, "write law = 'adaptive' into", "simulate rig.toml --law adaptive"),
        (None, 0.7, "write law = 'adaptive' into", "simulate rig.toml --law adaptive"),
        (0.2, None, "write bandwidth = 2.32 into", "simulate rig.toml  # once these gains are in it"),
        (None, None, "no gains", "check rig.toml  # says what the loop lacks"),
    ],
)
def test_without_gains_the_law_that_follows_better_is_named(
    own: float | None,
    other: float | None,
    said: str,
    following: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    command: Command,
) -> None:
    def failed(*_: object, **__: object) -> None:
        raise NoGainsError("no gains")

    mended = None if own is None else OtherLaw("bowden", "holds", own, 20.0, {"bandwidth": 2.32})
    another = None if other is None else OtherLaw("adaptive", "holds", other, 20.0)
    module = importlib.import_module("bowden.study.tune_law")
    monkeypatch.setattr(module, "_narrower", failed)  # as if the check said of none that they hold
    for name, value in (("search", failed), ("mended_law", lambda *_: mended), ("other_law", lambda *_: another)):
        monkeypatch.setattr(module, name, value)
    monkeypatch.chdir(tmp_path)
    assert run(["init"]) == 0
    assert run(["tune", "rig.toml"]) == 2
    *error, last = capsys.readouterr().err.splitlines()
    assert said in " ".join(error).replace('"', "'")
    assert last == f"Next: bowden {following}"
    assert "Next" not in command("tune rig.toml --json", code=2).err


@pytest.fixture(scope="module")
def advised() -> OtherLaw | None:
    """Our law with the gain that the check advises, where commands reach the servo 100 ms late."""
    rig = Rig(law="bowden", delay=100)
    return mended_law(rig, rig.fitted())


def test_the_rigs_own_law_with_the_gain_that_the_check_advises(advised: OtherLaw | None) -> None:
    assert advised is not None
    assert list(advised.gains) == ["bandwidth"]
    rig = Rig(delay=100, duration=advised.seconds)
    assert advised.rmse_deg < 0.2 * bowden.simulate(rig, "uncompensated").metrics().rmse_deg


def test_it_follows_within_half_a_degree(advised: OtherLaw | None) -> None:
    assert advised is not None
    assert advised.rmse_deg < 0.5


def test_every_law_is_looked_at_however_long_the_others_took(monkeypatch: pytest.MonkeyPatch) -> None:
    last = [name for name in LAWS if LAWS[name].choices][-1]
    seen: list[str] = []

    def checked(rig: Rig, law: Law) -> SimpleNamespace:
        seen.append(law.name)
        monkeypatch.setattr("time.monotonic", lambda: 1e9 * len(seen))
        return SimpleNamespace(verdict="holds" if law.name == last else "does_not_hold")

    monkeypatch.setattr("bowden.design.verdict.check_rig", checked)
    found = other_law(Rig(duration=2.0), [])
    assert found is not None
    assert found.law == last == seen[-1]
    assert seen[0] == "bowden"


def test_check_does_not_name_itself(capsys: pytest.CaptureFixture[str]) -> None:
    advice = "shorten the delay to 2 cycles (now 80)"
    lost = SimpleNamespace(verdict="does_not_hold", holds=False, of_rig=False, instead="", advice=advice)
    call = Call({"rig": "rig.toml", "law": "adaptive", "preset": None}, {})
    _say_next_of(SimpleNamespace(checks={"": lost}), Rig(), "", ["--law", "adaptive"], call)  # type: ignore[arg-type]
    assert capsys.readouterr().out == "Next: change the rig as the advice says, then check it again\n"


def test_guessed_counts_are_named_until_the_keys_that_are_named_are_set(tmp_path: Path) -> None:
    time = np.arange(0.0, 20.0, 0.01)
    fit = bowden.identify(time, 0.6 - 0.6 * np.cos(2.0 * time), 0.5 - 0.5 * np.cos(2.0 * time - 0.05))
    fit.write(tmp_path / "model.toml")
    assert run(["init", str(tmp_path / "rig.toml"), "--model", str(tmp_path / "model.toml")]) == 0
    made = bowden.init(fit)
    (said,) = (note for note in made.notes if note.startswith("Encoders: "))
    text = (tmp_path / "rig.toml").read_text()
    for section in re.findall(r"encoder\.(\w+)\.resolution_deg", said):
        before, after = text.split(f"[encoder.{section}]")
        after = re.sub("resolution_deg = [0-9.]+", "resolution_deg = 0.09", after, count=1)
        text = f"{before}[encoder.{section}]{after}"
    (tmp_path / "rig.toml").write_text(text)
    assert replace(made, rig=bowden.Rig.read(tmp_path / "rig.toml")).notes == tuple(n for n in made.notes if n != said)


@pytest.mark.parametrize(("unit", "counts"), [("counts", (8192.0, 4000.0)), ("rad,counts", (None, 4000.0))])
def test_the_counts_of_a_turn_go_into_the_rig(
    unit: str, counts: tuple[float | None, float], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    time = np.arange(0.0, 20.0, 0.01)
    angles = 0.6 - 0.6 * np.cos(2.0 * time), 0.5 - 0.5 * np.cos(2.0 * time - 0.05)
    read = [one if n is None else np.round(one * n / (2.0 * np.pi)) for one, n in zip(angles, counts, strict=True)]
    given = [n for n in counts if n is not None]
    fit = bowden.identify(time, *read, unit=unit, counts_per_turn=given)
    fit.write("model.toml")
    wanted = [360.0 / n if n else default_bench().motor_encoder.resolution * DEGREES for n in counts]
    for suit in (False, True):
        assert run(["init", "rig.toml", "--model", "model.toml", "--force", *(["--suit"] if suit else [])]) == 0
        rig = bowden.Rig.read("rig.toml")
        assert rig.motor_encoder.resolution * DEGREES == pytest.approx(wanted[0])
        assert suit or rig.joint_encoder.resolution * DEGREES == pytest.approx(wanted[1])
        assert bowden.init(fit, suit=suit).rig.replace(origin="") == rig.replace(origin="")
        assert "motor" in tomllib.loads(Path("rig.toml").read_text()), "the gear that the drive's counts go through"
        before = rig.replace(drive={"motor_counts_per_turn": counts[0] or 4096.0}).notes
        assert any("--counts-per-turn" in note for note in before) == (counts[0] is not None)
