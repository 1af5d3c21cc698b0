"""A servo found again from simulated logs, and logs that cannot tell it refused."""

import json
import tomllib
from dataclasses import replace
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from numpy.typing import NDArray

from bowden.app.main import run
from bowden.core.errors import LogError
from bowden.core.kernel import compiled
from bowden.core.units import RADIANS
from bowden.design.objections import refusals
from bowden.design.rig_of_bench import toml_text
from bowden.identify.servo import ServoEstimate, identify_servo, read_servo_log
from bowden.models.drive.servo import Servo, prepare
from bowden.operations.init import init
from bowden.operations.schema import json_schema
from bowden.plants.counting import Encoders
from bowden.rig.rig import Rig
from bowden.sim.samples.cable import follow
from random_rigs import cable

pytestmark = pytest.mark.usefixtures("undrawn")

Array = NDArray[np.float64]


def log(servo: Servo, delay: float, kind: str, seed: int = 0, dt: float = 1e-3) -> tuple[Array, Array, Array]:
    """Three seconds, 0.01° of noise and counts of 0.022°; the plant has 50 steps a sample and its own delay line."""
    time = np.arange(round(3.0 / dt)) * dt
    command = 20.0 * RADIANS * ((time > 0.3) * 1.0 - (time > 1.5) * 0.5)
    if kind == "chirp":
        command = 20.0 * RADIANS * np.sin(2.0 * np.pi * (0.2 * time + 14.8 * time**2 / 6.0))
    motor = np.empty(len(time))
    compiled(follow)(command, delay / dt, prepare(servo, dt / 50.0), 50, motor)
    noisy = motor + 0.01 * RADIANS * np.random.default_rng(seed).standard_normal(len(time))
    count = 0.022 * RADIANS
    return time, command, count * np.round(noisy / count)


def near(found: ServoEstimate | None, truth: float, relative: float) -> bool:
    return found is not None and abs(found.value - truth) <= relative * truth and found.uncertainty < relative * truth


@pytest.mark.parametrize(
    ("frequency", "damping", "delay", "kind"),
    [(8.5, 1.0, 0.0024, "step"), (3.0, 0.6, 0.0105, "step"), (18.0, 0.5, 0.0013, "chirp"), (8.5, 1.2, 0.001, "chirp")],
)
def test_frequency_damping_and_delay_are_found_again(frequency: float, damping: float, delay: float, kind: str) -> None:
    found = identify_servo(*log(Servo(2.0 * np.pi * frequency, damping), delay, kind))
    assert near(found.natural_frequency, 2.0 * np.pi * frequency, 0.01)
    assert near(found.damping, damping, 0.01)
    assert abs(found.delay.value - delay) < 1e-4  # a tenth of a sample
    assert (found.speed_limit, found.acceleration_limit) == (None, None)
    assert found.residual < 0.015 * RADIANS


def test_limits_are_found_where_the_log_reaches_them() -> None:
    omega = 2.0 * np.pi * 8.5
    slow = identify_servo(*log(Servo(omega, 0.7, speed_limit=2.0), 0.002, "step"))
    assert near(slow.speed_limit, 2.0, 0.01)
    assert slow.acceleration_limit is None
    weak = identify_servo(*log(Servo(omega, 0.7, acceleration_limit=60.0), 0.002, "step"))
    assert near(weak.acceleration_limit, 60.0, 0.01)
    both = identify_servo(*log(Servo(omega, 0.7, 3.0, 100.0), 0.002, "chirp"))
    assert near(both.speed_limit, 3.0, 0.01)
    assert near(both.acceleration_limit, 100.0, 0.01)
    assert near(both.natural_frequency, omega, 0.01)


def test_the_uncertainty_is_of_the_size_of_the_errors() -> None:
    truth = 2.0 * np.pi * 8.5
    fits = [identify_servo(*log(Servo(truth, 1.0), 0.002, "step", seed)) for seed in range(4)]
    errors = np.array([fit.natural_frequency.value - truth for fit in fits])
    claimed = np.mean([fit.natural_frequency.uncertainty for fit in fits])
    assert 0.2 < np.sqrt(np.mean(errors**2)) / claimed < 4.0


TIME = np.arange(3000) * 1e-3
SLOW = 30.0 * RADIANS * np.sin(2.0 * np.pi * 0.1 * TIME)
NOISE = 1e-4 * np.random.default_rng(1).standard_normal(3000)


@pytest.mark.parametrize(
    ("command", "motor", "said"),
    [
        (SLOW, SLOW + NOISE, "does not show the servo's frequency"),
        (0.0 * SLOW, NOISE, "no excitation: the command spans 0°"),
        (SLOW, NOISE, "the motor moves"),
        (SLOW, -SLOW + NOISE, "unexplained"),
    ],
)
def test_a_log_that_cannot_tell_is_refused(command: Array, motor: Array, said: str) -> None:
    with pytest.raises(LogError, match=said):
        identify_servo(TIME, command, motor)


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    columns = log(Servo(2.0 * np.pi * 6.0, 0.8), 0.0024, "step")
    values = np.stack([columns[0] * 1e3, columns[1] / RADIANS, columns[2] / RADIANS], axis=1)
    np.savetxt("step.csv", values, delimiter=",", header="time_ms,target_deg,motor_deg", comments="")
    return tmp_path


def test_the_command_writes_keys_of_a_rig(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["identify-servo", "step.csv", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, json_schema("identify-servo"))
    assert document["natural_frequency_hz"]["value"] == pytest.approx(6.0, rel=0.01)
    assert document["delay_cycles"] == 3
    written = tomllib.loads((folder / "out/servo/servo.toml").read_text(encoding="utf-8"))
    assert written["servo"]["natural_frequency_hz"] == pytest.approx(6.0, rel=0.01)
    (folder / "rig.toml").write_text((folder / "out/servo/servo.toml").read_text(encoding="utf-8"))
    assert run(["check", "rig.toml", "--law", "uncompensated", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["verdict"] == "holds"


@pytest.mark.parametrize(
    "rig",
    ["", "# mine\n[servo]  # this one\ndamping = 0.9 # ζ\n[bench]\nsample_time_ms = 2.0\n[live]\ncpu = 1\n", None],
)
def test_the_values_go_into_a_rig_and_all_else_of_it_stays(
    folder: Path, capsys: pytest.CaptureFixture[str], rig: str | None
) -> None:
    rig = toml_text() if rig is None else rig
    (folder / "rig.toml").write_text(rig, encoding="utf-8")
    for _ in range(2):  # the second time changes nothing
        assert run(["identify-servo", "step.csv", "--into", "rig.toml", "--json"]) == 0
        document = json.loads(capsys.readouterr().out)
        made = (folder / "rig.toml").read_text(encoding="utf-8")
        left = [line for line in rig.splitlines() if "=" not in line or line.startswith("#")]
        assert [line for line in made.splitlines() if line in left] == left
        assert made.count("# bowden identify-servo: from step.csv") == 1
        before, after = Rig.of_tree(tomllib.loads(rig), folder / "rig.toml"), Rig.read(folder / "rig.toml")
        servo = before.servo._replace(natural_frequency=after.servo.natural_frequency, damping=after.servo.damping)
        assert after == before.replace(servo=servo, delay=document["delay_cycles"])
        assert after.servo.natural_frequency == pytest.approx(2.0 * np.pi * 6.0, rel=0.01)
        assert document["delay_cycles"] == np.ceil(2.4e-3 / before.sample_time)
    assert not (folder / "out").exists()
    assert run(["identify-servo", "step.csv", "--into", "rig.toml", "--sample-time-ms", "5"]) == 2
    assert "leave the option out" in capsys.readouterr().err


def test_the_servos_delay_is_beside_that_of_the_joints_sensor(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without the sensor's, `check` refuses the rig: what waits for a late joint is less stable than it looks."""
    late = replace(cable(np.random.default_rng(1)), encoders=Encoders(joint_late=7.9e-3))
    made = init(late).rig
    assert made.delay == 1 + 8
    made.write(folder / "rig.toml")
    assert run(["identify-servo", "step.csv", "--into", "rig.toml", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["delay_cycles"] == 3 + 8
    found = Rig.read(folder / "rig.toml")
    assert found.delay == 3 + 8
    assert refusals(found) == ()
    (refused,) = refusals(found.replace(delay=3))
    assert "delay_cycles is 3, of 1 ms; the joint's sensor alone is 7.9 ms late" in refused


def test_a_log_has_times_or_a_rate_and_repeated_times_are_dropped(tmp_path: Path) -> None:
    time, path = np.arange(300) / 1000.0, tmp_path / "log.csv"
    late = np.where(np.arange(300) % 10 == 5, time + 1e-3, time)
    signals = np.sin(9.0 * time), np.sin(9.0 * time - 0.1)
    for columns, names, rate in (((late, *signals), "time_s,u_rad,motor_rad", None), (signals, "u_rad,motor_rad", 1e3)):
        np.savetxt(path, np.column_stack(columns), fmt="%.6f", delimiter=",", header=names, comments="")
        (found, command, _), notes = read_servo_log(path, {}, rate=rate)
        assert found == pytest.approx(time, abs=1e-9)
        assert command == pytest.approx(signals[0], abs=0.01)
        assert bool(notes) == (rate is None)


def test_a_motor_that_comes_before_its_command_is_the_command() -> None:
    time, command, motor = log(Servo(2.0 * np.pi * 6.0, 0.8), 0.002, "step")
    with pytest.raises(LogError, match="exchange the two columns"):
        identify_servo(time, motor, command)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["none.csv"], "cannot read none.csv: no such file"),
        (
            ["step.csv", "--motor", "spool"],
            "no column 'spool' for the motor among 'time_ms', 'target_deg', 'motor_deg'",
        ),
        (["step.csv", "--command", "motor_deg"], "one column is taken twice"),
        (["step.csv", "--unit", "grad"], "--unit is 'grad'"),
        (["step.csv", "--unit", "rad"], "--unit is rad, and column 'target_deg' names deg"),
        (["plain.csv"], "does not say its unit"),
        (["empty.csv"], "empty.csv is empty"),
        (["step.csv", "--sample-time-ms", "0"], "--sample-time-ms is 0"),
    ],
)
def test_bad_input_is_one_line_and_code_2(
    folder: Path, capsys: pytest.CaptureFixture[str], words: list[str], said: str
) -> None:
    (folder / "plain.csv").write_text("time,command,motor\n0,1,2\n1,2,3\n")
    (folder / "empty.csv").write_text("")
    assert run(["identify-servo", *words]) == 2
    printed = capsys.readouterr()
    assert said in printed.err
    assert printed.err.count("\n") == 1
    assert not (folder / "out").exists()


def test_a_log_of_a_run_is_taken_from_its_first_reading_on(tmp_path: Path) -> None:
    time, command, motor = log(Servo(50.0, 0.9), 0.002, "step")
    unread = np.where(np.arange(len(time)) < 3, np.nan, motor)
    path = tmp_path / "run.csv"
    columns = np.column_stack([time, command, unread])
    np.savetxt(path, columns, header="time_s,command_rad,motor_rad", delimiter=",", comments="")
    (even, _, found), notes = read_servo_log(path, {})
    assert len(even) == len(time) - 3
    assert np.isfinite(found).all()
    assert "the first 3 rows" in notes[0]
