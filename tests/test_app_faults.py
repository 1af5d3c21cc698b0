"""What goes wrong while a command runs: nothing half-written stays, and it is said in one line."""

import errno
import os
import resource
import signal
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden.app.main import run
from bowden.core.errors import OutputError
from bowden.core.files import whole_file, whole_files
from bowden.design import trial  # noqa: F401  # takes the loop by name, before a test puts another in its place
from bowden.records.trace import Trace
from bowden.sim import rig_runs
from support.command import Command

pytestmark = pytest.mark.usefixtures("undrawn")

SHORT = "[reference]\nkind = 'periodic_minimum_jerk'\nperiod_s = 4.0\n[scenario]\nduration_s = 1.0\n"
TWO_LAWS = ["simulate", "rig.toml", "--law", "uncompensated", "--law", "observer"]
LAW = (Path(__file__).parents[1] / "examples" / "my_law.py").read_text()


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty current folder with a short rig in it."""
    monkeypatch.chdir(tmp_path)
    Path("rig.toml").write_text(SHORT)
    return tmp_path


@pytest.fixture
def small_files() -> Iterator[None]:
    """No file may grow beyond 60 kB, as on a disk that is nearly full: a short trace fits, its page does not."""
    assert run([*TWO_LAWS, "--duration", "0.2", "--out", "before", "--json"]) == 0  # compiled code is larger than that
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (60_000, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_FSIZE, before)


def tree() -> dict[str, bytes | None]:
    """Everything below the current folder, with the contents of files."""
    return {str(path): path.read_bytes() if path.is_file() else None for path in sorted(Path().rglob("*"))}


def write_log(name: str) -> None:
    time = np.arange(800) / 100.0
    motor = 20.0 * np.sin(1.4 * time) + 12.0 * np.sin(3.9 * time)
    lines = [f"{t:.2f},{m:.6f},{0.9 * m + 1.0:.6f}" for t, m in zip(time, motor, strict=True)]
    Path(name).write_text("\n".join(["time_s,motor_deg,joint_deg", *lines]) + "\n")


def write(folder: Path, *names: str) -> None:
    with whole_files(folder) as stage:
        for name in names:
            (stage / name).write_text("new")


def test_files_take_their_places_together_or_not_at_all(folder: Path) -> None:
    (folder / "old.txt").write_text("old")
    before = tree()
    with pytest.raises(OutputError, match="No such file"):
        write(folder / "deep" / "er", "new.txt", "none/new.txt")
    assert tree() == before

    write(folder, "new.txt", "old.txt")
    assert tree() == before | {"new.txt": b"new", "old.txt": b"new"}


def test_what_was_moved_already_is_moved_back(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("a", "c"):
        Path(name).write_text(f"old {name}")
    before = tree()
    rename = Path.replace

    def fail_at_c(path: Path, target: Path) -> Path:
        if path.parent.name.startswith(".bowden-") and path.name == "c":
            raise OSError(errno.EIO, "Input/output error")
        return rename(path, target)

    monkeypatch.setattr(Path, "replace", fail_at_c)
    with pytest.raises(OutputError, match="Input/output error"):
        write(folder, "a", "b", "c")
    assert tree() == before


def test_a_file_that_is_called_like_a_temporary_one_is_left_alone(folder: Path) -> None:
    (folder / "a.txt.part").write_text("mine")
    with whole_file("a.txt") as part:
        part.write_text("new")
    assert Path("a.txt.part").read_text() == "mine"
    assert Path("a.txt").read_text() == "new"


@pytest.mark.drawn
@pytest.mark.usefixtures("small_files")
def test_a_disk_that_fills_up_leaves_nothing_of_a_simulation(command: Command) -> None:
    for there in (False, True):
        if there:
            Path("deep/er").mkdir(parents=True)
            Path("deep/er/observer.npz").write_text("from before")
        before = tree()
        said = "cannot write deep/er/simulate.html: File too large; choose another place or make room there"
        refused = command.refused(*TWO_LAWS, "--duration", "0.2", "--out", "deep/er", "--json")
        assert refused == f"bowden: {said}\n"
        assert tree() == before


def test_a_disk_that_is_full_leaves_nothing_of_a_simulation(monkeypatch: pytest.MonkeyPatch, command: Command) -> None:
    def no_room(*_: Any, **__: Any) -> None:
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr("csv.writer", no_room)  # the NPZ file before it fits
    before = tree()
    said = command.refused("simulate rig.toml --csv --out deep/er", figures=True)
    assert "cannot write deep/er/adaptive.csv: No space left on device; choose another place" in said
    assert tree() == before


@pytest.mark.parametrize(
    ("arguments", "name"),
    [
        (["simulate", "rig.toml", "--csv"], "adaptive.csv"),
        (["simulate", "rig.toml"], "simulate.html"),
        (["identify", "log.csv"], "model.toml"),
        (["reproduce", "--only", "fig4"], "reproduce.html"),
    ],
)
def test_a_folder_where_a_file_should_go_is_left_alone(command: Command, arguments: list[str], name: str) -> None:
    write_log("log.csv")
    Path("o", name, "mine").mkdir(parents=True)
    before = tree()
    said = command.refused(*arguments, "--out", "o", figures=True)
    assert said == f"bowden: cannot write o/{name}: it is a folder; remove it or choose another place\n"
    assert tree() == before


@pytest.mark.parametrize("words", [["simulate", "rig.toml"], ["identify", "log.csv"], ["reproduce", "--only", "fig4"]])
@pytest.mark.parametrize(
    ("out", "said"),
    [
        ("x" * 300, "xxx…: File name too long; choose another one with --out"),
        ("deep/" + "x" * 300, "File name too long; choose another one with --out"),
        ("", "--out is ''; expected the name of a folder; use --out . for this one"),
        ("a\0b", "expected the name of a folder"),
    ],
)
def test_an_out_that_is_no_folders_name(command: Command, words: list[str], out: str, said: str) -> None:
    write_log("log.csv")
    before = tree()
    assert said in command.refused(*words, "--out", out)
    assert tree() == before


@pytest.mark.parametrize("name", ["x" * 300, "x" * 300 + ".toml"])
def test_init_to_a_name_that_is_too_long(command: Command, name: str) -> None:
    assert "File name too long; choose another name" in command.refused("init", name)


def test_a_failure_of_the_system_that_nobody_foresaw_is_one_line(
    monkeypatch: pytest.MonkeyPatch, command: Command
) -> None:
    def gone(*_: Any, **__: Any) -> None:
        raise OSError(errno.EIO, "Input/output error", "disk")

    monkeypatch.setattr(rig_runs, "simulate", gone)
    said = "bowden: Input/output error (disk); check the paths and the room on their disk\n"
    assert command.refused("simulate rig.toml") == said


@pytest.mark.parametrize("done", [0, 1, 2])
def test_an_interrupted_simulation_keeps_the_laws_that_are_done(
    monkeypatch: pytest.MonkeyPatch, command: Command, done: int
) -> None:
    simulate, calls = rig_runs.simulate, []

    def interrupted_later(*arguments: Any, **settings: Any) -> Trace:
        calls.append(1)
        if len(calls) > done:
            raise KeyboardInterrupt
        return simulate(*arguments, **settings)

    monkeypatch.setattr(rig_runs, "simulate", interrupted_later)
    before = tree()
    said = command.refused(*TWO_LAWS, "--law", "adaptive", "--out", "o", code=130)
    if done == 0:
        assert said == "bowden: interrupted\n"
        assert tree() == before
        return
    laws = ["uncompensated", "observer"][:done]
    assert said == f"bowden: interrupted; {', '.join(laws)} (of 3 laws) done and written to o\n"
    assert {path.name for path in Path("o").iterdir()} == {"simulate.html", *(f"{law}.npz" for law in laws)}
    assert len(Trace.read("o/uncompensated.npz")) == 1000


@pytest.mark.parametrize("arguments", [["reproduce"], [*TWO_LAWS, "--duration", "10000"]])
def test_an_interruption_from_the_keyboard_leaves_nothing_half_written(arguments: list[str]) -> None:
    command = Path(sys.executable).with_name("bowden")
    process = subprocess.Popen(
        [command, *arguments, "--out", "deep/er"], stdout=subprocess.PIPE, stderr=subprocess.PIPE
    )
    time.sleep(2.5)
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 130, err
    assert out == b""
    assert err.startswith(b"bowden: interrupted")
    assert err.count(b"\n") == 1
    assert not list(Path().rglob(".bowden-*"))
    assert Path("deep").exists() == (b"written" in err)


def test_an_own_law_runs_and_what_it_prints_stays_out_of_the_document(command: Command) -> None:
    Path("law.py").write_text("print('hello')\n" + LAW)
    found, said = command.whole("simulate rig.toml --law law.py --csv --out o")
    (figures,) = found["runs"]
    assert said == "hello\n"
    binary, text = Trace.read("o/law.npz"), Trace.read("o/law.csv")
    assert figures["rmse_deg"] == binary.metrics().rmse_deg == text.metrics().rmse_deg
    assert (binary.units, binary.settings, binary.seed) == (text.units, text.settings, text.seed)
    for name, values in binary.columns.items():
        assert np.array_equal(values, text[name]), name


RETURN = "return State(integral), command"


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        (RETURN, "raise ValueError('not\\ntoday')", "ValueError: not today; correct it there"),
        ("from typing", "raise SystemExit(0)\nfrom typing", "line 12: SystemExit: 0; correct it there"),
        (LAW, "\0", "null bytes"),
    ],
)
def test_an_own_law_that_is_wrong_is_one_line(command: Command, old: str, new: str, said: str) -> None:
    source = LAW.replace(old, new)
    assert source != LAW
    Path("law.py").write_text(source)
    before = tree()
    printed = command.refused("simulate rig.toml --law law.py")
    assert said in printed
    assert "law.py" in printed
    assert tree() == before


def test_an_own_law_that_runs_away_later_is_an_unstable_run(command: Command) -> None:
    Path("law.py").write_text(LAW.replace(RETURN, "return State(integral + 2.0), command + 1e-2 * integral * integral"))
    said = command.refused("simulate rig.toml --law law.py")
    assert "law fails the check on rig.toml: the linear loop is stable, but in the trial it runs away" in said
    (figures,) = command.document("simulate rig.toml --law law.py --force")["runs"]
    assert figures["stable"] is False
    assert figures["rmse_deg"] is None


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (
            ["--duration", "1e300"],
            "expected a duration that makes 2 to 10000000 of them; change the duration",
        ),
        (["--seed", "-1"], "the seed is -1; expected a whole number from 0 to 2⁶³ − 1; give another seed"),
        (["--law", ""], "there is no law ''"),
        (["--law", "a\0.py"], "embedded null byte"),
        (["--law", "x" * 300 + ".py"], "file name too long; expected a Python file; check the path"),
    ],
)
def test_an_option_that_makes_no_sense(command: Command, arguments: list[str], said: str) -> None:
    before = tree()
    assert said in command.refused("simulate", "rig.toml", *arguments)
    assert tree() == before
