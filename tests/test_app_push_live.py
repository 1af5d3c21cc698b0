"""`bowden run` by the wearer's push, the whole of it, on the rig of docs/day_one_suit.md: its own twin, and any bus."""

import json
import time
from pathlib import Path

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import TargetSource
from bowden.live.mcap_read import read
from bowden.live.twin_process import running_twin
from live_runs import assert_replays, finished, finished_well, on_a_shared_computer, pushed_rig, started, tries

pytestmark = [pytest.mark.live, pytest.mark.usefixtures("state")]


@pytest.fixture
def rig(tmp_path: Path) -> Path:
    path = tmp_path / "pushed.toml"
    path.write_text(on_a_shared_computer(pushed_rig()), encoding="utf-8")
    return path


def test_the_suit_follows_a_wearer_who_swings_and_the_log_has_how(rig: Path, tmp_path: Path) -> None:
    found = finished_well(rig, tmp_path, "--twin", "--duration", "5")
    assert 0.0 < found["interaction"]["rms_nm"] < 1.2, "4.9 of a suit that does not follow"
    assert found["emg"] is None
    assert_replays(found["log"], pushed=True)
    log = read(Path(found["log"]))
    assert {"admittance.virtual.position", "admittance.push.torque", "admittance.estimate.torque"} <= set(log.columns)
    led = log["source"] == TargetSource.LAW
    settled = log["joint"][led][2500:]
    assert np.ptp(settled) == pytest.approx(50.0 * RADIANS, abs=4.0 * RADIANS)
    assert (log["reference"][led] == log["admittance.virtual.position"][led]).all(), LAWS["uncompensated"].name
    assert log["reference"][led].max() <= 100.0 * RADIANS + 1e-12


@pytest.mark.long
def test_a_lost_joint_angle_releases_on_any_bus(rig: Path, tmp_path: Path) -> None:
    for number in tries():  # each with a twin of its own: a wearer as stiff lets no run begin where another one ended
        with running_twin(rig, tmp_path / f"b{number}") as twin:
            process = started(rig, tmp_path / f"out{number}", "--channel", twin.channel, "--duration", "60")
            deadline, moved = time.monotonic() + 60.0, False
            while process.poll() is None and not moved and time.monotonic() < deadline:
                status = twin.control.status()
                moved = status["torque"] and abs(status["joint"] - 45.0 * RADIANS) > 20.0 * RADIANS
                time.sleep(0.02)
            if moved:
                twin.control.inject("encoder_nan joint")
            found = finished(process)
        if "joint angle missing or impossible" in found["faults"]:
            break
    assert not found["ended_well"]
    assert "joint angle missing or impossible" in found["faults"], json.dumps(found)
    assert_replays(found["log"], pushed=True)
    log = read(Path(found["log"]))
    gone = int(np.argmax(np.abs(log["joint"]) > 100.0))  # the counts that stand for none
    assert log["source"][gone] == TargetSource.LAW
    assert np.isfinite(log["admittance.estimate.torque"][gone - 1])
    assert np.isnan(log["admittance.estimate.torque"][gone])
    assert (log["power"][gone + 3300 :] == 0.0).all(), "an arm is let down within 3.1 s"
    assert log["power"][-1] == 0.0
