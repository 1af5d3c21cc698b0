"""The guided path's step identify-servo, without a run: from servo.csv to the rig that goes on."""

from pathlib import Path

import numpy as np
import pytest

from bowden.app.works import identified_servo
from bowden.console.guided import STEPS, GuidedPath
from bowden.console.jobs import Jobs
from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled
from bowden.live.measured import HEADER
from bowden.models.drive.servo import Servo, prepare
from bowden.rig.rig import Rig
from bowden.sim.samples.cable import follow


def test_the_servo_is_identified_and_goes_into_the_rig(tmp_path: Path) -> None:
    servo = Servo(2.0 * np.pi * 5.0, 0.8)
    time = np.arange(3000) * 1e-3
    command = 0.3 * ((time > 0.3) * 1.0 - (time > 1.5) * 0.5)
    motor = np.empty(len(time))
    compiled(follow)(command, 2.4, prepare(servo, 2e-5), 50, motor)
    rows = np.column_stack([time, command, motor + 2e-4 * np.random.default_rng(0).standard_normal(3000), motor])
    np.savetxt(tmp_path / "servo.csv", rows, "%.9g", ",", header=HEADER, comments="")
    said: list[str] = []
    found = identified_servo(lambda what, share: said.append(what), Rig().document(), str(tmp_path))
    made = Rig.unpack(found["rig"])
    assert made.servo.natural_frequency == pytest.approx(servo.natural_frequency, rel=0.01)
    assert made.servo.damping == pytest.approx(servo.damping, rel=0.01)
    assert made.delay == 3
    assert made.cable == Rig().cable
    assert found["files"] == ["servo.toml", "servo/rig.toml"]
    assert Rig.read(tmp_path / "servo" / "rig.toml").delay == 3
    hertz = made.servo.natural_frequency / (2.0 * np.pi)
    assert f"natural_frequency_hz = {hertz:.5g}" in (tmp_path / "servo.toml").read_text()
    assert found["said"].startswith(f"natural frequency {hertz:.4g}")
    assert said == ["fitting the servo"]


def test_the_path_asks_for_the_measurement_first(tmp_path: Path) -> None:
    path = GuidedPath(tmp_path, Jobs())
    assert STEPS == ("measure", "identify", "identify-servo", "tune", "run")
    for step in ("identify", "identify-servo"):
        with pytest.raises(ParameterError, match="nothing was measured"):
            path.require(step)
    with pytest.raises(ParameterError, match="there is no such step"):
        path.require("run")
    path.folder.mkdir()
    (path.folder / "servo.csv").touch()
    assert path.require("identify-servo") == "identify-servo"
