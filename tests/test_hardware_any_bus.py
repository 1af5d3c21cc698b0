"""Any bus of python-can will do: drive and twin on its `virtual` one, and every interface fails in one line."""

import tempfile
import time
from collections.abc import Iterator

import can
import pytest

from bowden.core.errors import DriveError
from bowden.core.signals import DriveState
from bowden.hardware.buses.opening import open_bus
from bowden.hardware.buses.place import BusPlace
from bowden.hardware.drives.canopen_drive import CanopenDrive
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.hardware.ports import Power
from bowden.hardware.twin.control import TwinControl
from bowden.hardware.twin.twin import Twin
from support.played import Played

DRIVE = DriveParameters(interface="virtual", channel="any-bus", bitrate=500_000)


@pytest.fixture
def twin(monkeypatch: pytest.MonkeyPatch) -> Iterator[Twin]:
    with tempfile.TemporaryDirectory() as short:  # a socket's name may have some 100 characters
        monkeypatch.setenv("XDG_RUNTIME_DIR", short)
        with Played(DRIVE) as played:
            yield played.twin


@pytest.mark.live
def test_a_drive_on_another_bus_than_ours(twin: Twin) -> None:
    drive = CanopenDrive(DRIVE)
    assert "bowden digital twin" in drive.bring_up()
    with TwinControl(twin.path) as control:
        states = set()
        for _ in range(2000):
            now = time.monotonic()
            reading = drive.read(now)
            states.add(int(reading.drive_state))
            if DriveState.OPERATION_ENABLED in states:
                break
            drive.write(0.1, Power.ON, now)
            time.sleep(1e-3)
        assert DriveState.OPERATION_ENABLED in states
        assert abs(reading.motor - 0.1) < 0.01
        assert reading.bus_errors == 0.0
        drive.close()
        assert not control.status()["torque"]
        ends = time.monotonic() + 2.0
        while control.status()["nmt"] != 4:  # the last frame is on its way
            assert time.monotonic() < ends


@pytest.mark.parametrize("interface", sorted(can.VALID_INTERFACES - {"virtual", "udp_multicast", "bowden_unix"}))
def test_an_interface_that_is_not_there_is_said_in_a_line(interface: str) -> None:
    with pytest.raises(DriveError, match=f"cannot open the bus nothing7 .{interface}.: .+; ") as refused:
        open_bus(BusPlace(interface, "nothing7", 1_000_000))
    assert "\n" not in str(refused.value)


def test_a_kernel_without_can_is_told_from_an_interface_that_is_down(monkeypatch: pytest.MonkeyPatch) -> None:
    for number, said in (
        (97, "this kernel has no CAN"),
        (19, "try: ip link set can0 up"),
        (100, "ip link set can0 up"),
    ):

        def fail(*_: object, number: int = number, **__: object) -> None:
            raise OSError(number, "what the kernel says")

        monkeypatch.setattr(can, "Bus", fail)
        with pytest.raises(DriveError, match=said):
            open_bus(BusPlace("socketcan", "can0", 1_000_000))
