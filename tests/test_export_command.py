"""``bowden export``: what it writes compiles, runs and says the recorded commands; what is wrong is one line."""

import contextlib
import io
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

import bowden
from bowden.app import main
from bowden.control.conditioning import Conditioned
from bowden.core.signals import EMERGENCY_STOP, DriveState
from bowden.export.files import FLAGS
from bowden.hardware.ports import Power
from bowden.operations.schema import json_schema
from bowden.plants.counting import Counting
from bowden.plants.identified import CableModel
from bowden.rig.rig import Rig
from bowden.safety.faults import Fault
from bowden.safety.state import Mode, Request

COMPILER, MAKE, CPP = (shutil.which(name) for name in ("cc", "make", "c++"))
RIG = "[reference]\nkind = 'periodic_minimum_jerk'\nperiod_s = 2.0\n[scenario]\nduration_s = 3.0\n"
ARDUINO = """#include <math.h>
#include <stdint.h>
unsigned long micros(void);
"""


needs_cc = pytest.mark.skipif(COMPILER is None, reason="no C compiler")


def quiet(*command: str, cwd: Path) -> None:
    """A command that says nothing: a compiler without a warning."""
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, ""), command


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("rig.toml").write_text(RIG)
    return tmp_path


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, Any]]:
    """Law and detector in float, the supervisor in double, and what the command said of them."""
    place = tmp_path_factory.mktemp("export")
    (place / "rig.toml").write_text(RIG)
    words = f"export {place}/rig.toml --to {place}/code --emg --target cortex-m4f --json"
    with contextlib.redirect_stdout(io.StringIO()) as said:
        assert main.run(words.split()) == 0
    return place / "code", json.loads(said.getvalue())


def test_the_document_names_what_was_written(exported: tuple[Path, dict[str, Any]]) -> None:
    place, document = exported
    jsonschema.validate(document, json_schema("export"))
    assert document["modules"] == ["adaptive", "safety", "course", "envelope", "onset"]
    assert document["precision"] == "float"
    assert sorted(document["files"]) == sorted(str(path) for path in place.iterdir())
    assert "typedef float adaptive_real;" in (place / "adaptive.h").read_text()
    assert "typedef double safety_real;" in (place / "safety.h").read_text()


@needs_cc
def test_all_of_it_compiles_without_a_warning_also_for_programs_in_cpp(
    exported: tuple[Path, Any], folder: Path
) -> None:
    place, document = exported
    for name in document["modules"]:
        includes = re.findall(r"#include (.*)", (place / f"{name}.c").read_text())
        assert set(includes) <= {"<math.h>", f'"{name}.h"'}
        strict = (*FLAGS.split(), "-Wfloat-conversion", "-Wdouble-promotion")
        quiet("cc", *strict, "-c", f"{name}.c", "-o", f"{folder}/{name}.o", cwd=place)
        if CPP:
            quiet("c++", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-x", "c++", f"{name}.h", cwd=place)
    (folder / "Arduino.h").write_text(ARDUINO)
    for name in ("arduino.cpp", "board.cpp") if CPP else ():
        quiet("c++", "-Wall", "-Wextra", "-Werror", f"-I{folder}", "-c", name, "-o", f"{folder}/a.o", cwd=place)
    assert "static const uint32_t PERIOD = 1000;" in (place / "arduino.cpp").read_text()


@pytest.mark.skipif(COMPILER is None or MAKE is None, reason="no C compiler or no make")
def test_what_the_readme_says_to_type_works(exported: tuple[Path, dict[str, Any]], folder: Path) -> None:
    place, document = exported
    code = shutil.copytree(place, folder / "copy")
    page = (code / "README.md").read_text()
    for line in re.findall(r"^    (\S+ .* -c .*)$", page, re.MULTILINE):  # for the host, and for the chip
        if shutil.which(line.split()[0]):
            quiet(*line.split(), cwd=code)
            objects = {f"{name}.o" for name in (*document["modules"], "loop")}
            assert objects == {path.name for path in code.glob("*.o")}
            for name in objects:
                (code / name).unlink()
    (code / "envelope.c").write_text("#error of a file that the replay does not call\n")
    assert subprocess.run(["make", "-s", "check"], cwd=code, capture_output=True).returncode != 0


@needs_cc
def test_the_gate_is_called_with_names_for_its_numbers(exported: tuple[Path, dict[str, Any]], folder: Path) -> None:
    enums = {"REQUEST": Request, "MODE": Mode, "DRIVE_STATE": DriveState, "POWER": Power, "FAULT": Fault}
    named = {f"SAFETY_{kind}_{one.name}": int(one) for kind, enum in enums.items() for one in enum}
    named["SAFETY_EMERGENCY_STOP"] = int(EMERGENCY_STOP)
    checks = "\n".join(f"typedef char check_{name}[(int){name} == {value} ? 1 : -1];" for name, value in named.items())
    (folder / "names.c").write_text(f'#include "loop.h"\n{checks}\n')
    quiet("cc", "-std=c99", f"-I{exported[0]}", "-fsyntax-only", "names.c", cwd=folder)


def test_what_is_the_users_stays_and_the_gate_of_an_export_with_emg_watches_it(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ["export", "rig.toml", "--law", "uncompensated", "--to", "board"]
    assert main.run(words) == 0
    assert "uses_emg = false" in (folder / "board" / "safety.c").read_text()
    (folder / "board" / "board.cpp").write_text("/* mine */")
    assert main.run(["export", "rig.toml", "--law", "adaptive", "--to", "other", "--emg"]) == 0
    assert "uses_emg = true" in (folder / "other" / "safety.c").read_text()
    capsys.readouterr()
    assert main.run(words) == 0
    assert (folder / "board" / "board.cpp").read_text() == "/* mine */"
    assert "board.cpp and platformio.ini in board stay as they are" in capsys.readouterr().err


@pytest.mark.skipif(COMPILER is None or MAKE is None, reason="no C compiler or no make")
def test_make_check_replays_the_recorded_run(capsys: pytest.CaptureFixture[str], folder: Path) -> None:
    assert main.run(["export", "rig.toml", "--law", "uncompensated", "--to", "deep/code"]) == 0
    assert "uncompensated in double" in capsys.readouterr().out
    code = folder / "deep" / "code"
    done = subprocess.run(["make", "-s", "check"], cwd=code, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stderr == "passed: 3000 cycles, 0 commands differ, by 0 rad at most\n"
    table = subprocess.run(["./replay", "recording.csv", "--print"], cwd=code, capture_output=True, text=True)
    assert table.stdout.splitlines()[0] == "time,command,law.command," + ",".join(
        f"conditioned.{name}" for name in Conditioned._fields
    )
    assert len(table.stdout.splitlines()) == 3001
    (code / "board.c").write_text("of one's own")
    before = {path.name: path.read_bytes() for path in code.iterdir()}
    assert main.run(["export", "rig.toml", "--law", "uncompensated", "--to", "deep/code"]) == 0
    assert before == {path.name: path.read_bytes() for path in code.iterdir()}
    capsys.readouterr()
    assert main.run(["export", "rig.toml", "--law", "cascaded_pid", "--to", "deep/code"]) == 2
    assert "deep/code holds another export: uncompensated.c and 1 more" in capsys.readouterr().err
    lines = (code / "recording.csv").read_text().splitlines()
    cells = lines[1000].split(",")
    cells[6] = "0.5"
    wrong = "\n".join([*lines[:1000], ",".join(cells), *lines[1001:]])
    for recording, code_, said in (
        (wrong, 1, "failed: 3000 cycles, 1 commands differ"),
        (lines[0] + "\n", 2, "replay: no law ran in this recording\n"),
        ("time,joint_seen\n0,1\n", 2, "replay: the recording has no column motor_seen\n"),
    ):
        (code / "recording.csv").write_text(recording)
        done = subprocess.run(["./replay", "recording.csv"], cwd=code, capture_output=True, text=True)
        assert done.returncode == code_
        assert done.stderr.startswith(said)


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--law", "adaptiv"], "there is no law 'adaptiv'"),
        (["--law", "mine.py"], "mine.py, line 19: math.tanh()"),
        (["--target", "cortex-m9"], "cortex-m7"),
        (["--preset", "paper"], "adaptive fails the check on rig.toml"),
        (["--preset", "printed"], "has no preset 'printed'"),
        (["--emg", "--emg-rate", "100"], "the EMG's rate is 100 Hz"),
        (["--to", "rig.toml"], "rig.toml is not a folder"),
        (["--to", "full"], "full holds other files: README.md and 1 more"),
        (["--to", ""], "--to is ''"),
    ],
)
def test_what_cannot_be_is_one_line_and_nothing_is_written(
    arguments: list[str], said: str, capsys: pytest.CaptureFixture[str], folder: Path
) -> None:
    (folder / "full").mkdir()
    for name in ("README.md", "a.txt"):
        (folder / "full" / name).write_text("precious")
    (folder / "mine.py").write_text(MINE)
    assert main.run(["export", "rig.toml", "--to", "code", *arguments]) == 2
    printed = capsys.readouterr()
    assert said in printed.err
    assert printed.err.count("\n") == 1
    assert not printed.out
    assert not (folder / "code").exists()
    assert sorted(path.name for path in (folder / "full").iterdir()) == ["README.md", "a.txt"]


def test_a_joint_without_an_encoder_is_exported_with_its_estimate(folder: Path) -> None:
    (folder / "rig.toml").write_text(RIG + '[joint_sensor]\nsource = "motor"\n')
    assert main.run(["export", "rig.toml", "--law", "uncompensated", "--to", "code"]) == 0
    assert {"joint.c", "joint.h"} < {path.name for path in (folder / "code").iterdir()}


MINE = """
import math
from typing import NamedTuple
from bowden.core.kernel import kernel

class Gains(NamedTuple):
    gain: float = 2.0

class State(NamedTuple):
    total: float

@kernel
def start(gains, sample):
    return State(0.0)

@kernel
def step(gains, state, sample, reference, dt):
    # of Python's module, which raises where C does not
    return State(math.tanh(state.total)), reference.position
"""


COUNTING_C = """
#include <stdio.h>
#include "uncompensated.h"

int main(void)
{
    double motor, joint;
    while (scanf("%lf %lf", &motor, &joint) == 2) {
        const double angle = uncompensated_motor_angle(motor);
        printf("%.17g %.17g %.17g\\n", angle, uncompensated_joint_angle(joint), uncompensated_motor_counts(angle));
    }
    return 0;
}
"""


@needs_cc
@pytest.mark.filterwarnings("ignore:bowden run will refuse this rig")  # its zeros are anywhere
def test_in_c_the_counts_of_a_log_lie_on_the_cable_of_the_rig() -> None:
    """Of a cable whose joint falls as its motor rises, and whose zeros are anywhere; commands become counts again."""
    shape = {"hysteresis_gain": 0.05, "rate": 9.0, "shape": 8.0, "exponent": 2.0, "initial_h": 0.1}
    log = CableModel("bouc_wen", {"slope": -0.9, "offset": 1.5} | shape)
    rig = Rig(cable=log.identified().counted(Counting(-1, 0.7, 0.4)), duration=2.0)
    steps = np.array([rig.motor_encoder.resolution, rig.joint_encoder.resolution])
    motor = 0.4 + 0.4 * np.sin(np.linspace(0.0, 9.0, 300))
    counts = np.round(np.column_stack([motor, log.joint_angle(motor)]) / steps)
    with pytest.warns(UserWarning, match="16384 counts a turn of motor and joint are guessed"):
        bowden.export(rig, "code", "uncompensated", force=True)
    assert "Beware: the 16384 counts" in Path("code/uncompensated.h").read_text()
    Path("code/main.c").write_text(COUNTING_C)
    subprocess.run(["cc", *FLAGS.split(), "main.c", "uncompensated.c", "-o", "main", "-lm"], cwd="code", check=True)
    fed = "\n".join(f"{one:.0f} {other:.0f}" for one, other in counts)
    said = subprocess.run(["code/main"], input=fed, capture_output=True, text=True, check=True).stdout
    angle, joint, back = np.array([line.split() for line in said.splitlines()], float).T
    assert np.allclose(angle, -(counts[:, 0] * steps[0] - 0.7), rtol=0.0, atol=1e-12)
    assert np.allclose(rig.cable.model().joint_angle(angle), joint, rtol=0.0, atol=2.0 * steps.max())
    assert np.allclose(back, counts[:, 0], rtol=0.0, atol=1e-6)
    assert "motor [rad]     = -(0.000383495·counts - 0.7)" in Path("code/README.md").read_text()
    assert "the other way round than its encoder; zero is at 40.11°" in Path("code/uncompensated.h").read_text()


def test_a_rig_that_a_run_refuses_is_exported_by_force_alone(capsys: pytest.CaptureFixture[str]) -> None:
    Path("rig.toml").write_text(f"{RIG}\n[limits]\njoint_low_deg = 90.0\njoint_high_deg = 80.0\n")
    words = ["export", "rig.toml", "--to", "code", "--law", "uncompensated"]
    said = "bowden run will refuse this rig: joint_low_deg = 90.0 is not below joint_high_deg = 80.0"
    assert main.run(words) == 2
    assert said in capsys.readouterr().err
    assert not Path("code").exists()
    assert main.run([*words, "--force"]) == 0
    assert f"note: {said}" in capsys.readouterr().err
