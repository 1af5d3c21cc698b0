"""Masters that others wrote, against our twins; skipped where their packages are missing."""

import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from bowden.hardware.buses.unix_bus import UnixBus
from bowden.hardware.drives.families.ak_mit import FAMILY, AkParameters
from bowden.hardware.twin.bench import TwinBench
from bowden.models.cable.sheath_path import constant_bend
from bowden.plants.presets.bench import bench
from bowden.rig.families import DriveNeeds

AK80_6 = AkParameters(
    model="AK80-6", node_id=3, stiffness=20.0, damping=1.0, watchdog=0.1, needs=DriveNeeds(6.0, 0.091)
)


@pytest.fixture
def twin(tmp_path: Path) -> Iterator[tuple[TwinBench, str]]:
    """The bench behind an AK80-6, whose twin runs in a thread, and its bus."""
    rig, channel = bench(), str(tmp_path / "bus")
    plant = TwinBench(rig, constant_bend(rig.sheath.bend), 1.0, 0, 0.0, time.monotonic())
    running: Any = FAMILY.twin(AK80_6._replace(channel=channel), plant, time.monotonic, ())
    thread = threading.Thread(target=running.run, daemon=True)
    thread.start()
    yield plant, channel
    running.stop()
    thread.join(5.0)


def test_a_master_of_another_lab_moves_an_ak(twin: tuple[TwinBench, str], monkeypatch: pytest.MonkeyPatch) -> None:
    reason = "motor-python, an AK master of another lab, is not installed (pip install motor-python)"
    motors = pytest.importorskip("motor_python.cube_mars_motor_can", reason=reason)
    plant, channel = twin
    monkeypatch.setattr(motors.can.interface, "Bus", lambda **_: UnixBus(channel))  # unmodified but for the bus
    healthy = {"state": "ERROR-ACTIVE", "tx_err": 0, "rx_err": 0}
    monkeypatch.setattr(motors, "get_can_state", lambda _: healthy)
    motor = motors.CubeMarsAK806v2CAN(motor_can_id=3)
    try:
        motor.enable_mit_mode()
        motor.set_position(20.0)
        time.sleep(1.0)
        moved, feedback = plant.motor, motor.get_status()
        motor.stop()
    finally:
        motor.close()
    assert moved == pytest.approx(0.35, abs=0.06)
    assert feedback is not None
