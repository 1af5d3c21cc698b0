"""What others wrote for ODrive boards, against ours: PyPI's `odrive-can`, its mock, and the official DBC file in it."""

import asyncio
import logging
import math
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from bowden.core.errors import DriveError
from bowden.core.signals import DriveState
from bowden.hardware.buses.link import Links
from bowden.hardware.buses.unix_bus import UnixBus
from bowden.hardware.drives import driver, odrive_drive
from bowden.hardware.drives import odrive_frames as frames
from bowden.hardware.drives.checklist import Found
from bowden.hardware.drives.families.odrive import OdriveParameters
from bowden.hardware.drives.odrive_drive import OdriveDialogue, OdriveDrive
from bowden.hardware.drives.odrive_endpoints import endpoints_of
from bowden.hardware.drives.odrive_frames import ERRORS, AxisState, Beat, Cmd, Target
from bowden.hardware.drives.scale import motor_limits, motor_scale
from bowden.hardware.ports import Power
from bowden.rig.rig import Rig
from support.own_loop import in_a_thread
from support.played import Played

odrive_can = pytest.importorskip("odrive_can", reason="the extra `partners` is not installed: odrive-can")
pytestmark = [  # its thread hands frames to a loop that has ended
    pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore:coroutine 'Queue.put' was never awaited:RuntimeWarning"),
]
DBC: Any = odrive_can.get_dbc()
SCALES = 1000.0, 1000.0


def decoded(name: str, data: bytes) -> dict[str, Any]:
    found: dict[str, Any] = DBC.get_message_by_name(f"Axis1_{name}").decode(data, decode_choices=False)
    return found


def test_every_command_has_the_number_and_the_length_of_the_official_file() -> None:
    known = {message.frame_id & 0x1F: message.name for message in DBC.messages if message.name.startswith("Axis1_")}
    assert {cmd.value: f"axis1_{cmd.name.lower()}" for cmd in Cmd} == {
        number: name.lower().replace("rxsdo", "rx_sdo").replace("txsdo", "tx_sdo") for number, name in known.items()
    }
    assert frames.identifier_of(1, Cmd.SET_INPUT_POS) == DBC.get_message_by_name("Axis1_Set_Input_Pos").frame_id


def test_every_frame_is_that_of_the_official_file() -> None:
    for cmd in sorted({*frames.FIELDS} - {Cmd.SET_INPUT_POS}):
        fields = tuple(range(2, 2 + len(frames.FIELDS[cmd].unpack(bytes(frames.FIELDS[cmd].size)))))
        name = next(one.name for one in DBC.messages if one.frame_id == 1 << 5 | cmd).removeprefix("Axis1_")
        said = decoded(name, frames.pack(cmd, *fields))
        signals = sorted(DBC.get_message_by_name(f"Axis1_{name}").signals, key=lambda one: one.start)
        assert tuple(said[one.name] for one in signals)[: len(fields)] == fields, name
    target = decoded("Set_Input_Pos", frames.pack_target(Target(-3.25, 1.5, -0.75), SCALES))
    assert (target["Input_Pos"], target["Vel_FF"], target["Torque_FF"]) == pytest.approx((-3.25, 1.5, -0.75))
    question = decoded("RxSdo", frames.pack_sdo(0x1234) + bytes(4))
    assert (question["Opcode"], question["Endpoint_ID"]) == (frames.READ, 0x1234)
    assert decoded("TxSdo", frames.pack_sdo(7, bytes(4)))["Endpoint_ID"] == 7


def test_what_the_official_file_encodes_is_read_here() -> None:
    def encoded(name: str, **values: Any) -> bytes:
        return bytes(DBC.get_message_by_name(f"Axis1_{name}").encode(values))

    beat = encoded("Heartbeat", Axis_Error=512, Axis_State=8, Procedure_Result=3, Trajectory_Done_Flag=1)
    assert frames.unpack_beat(beat) == Beat(512, 8)
    assert frames.unpack(Cmd.GET_ERROR, encoded("Get_Error", Active_Errors=1, Disarm_Reason=2)) == (1, 2)
    assert frames.unpack(Cmd.GET_IQ, encoded("Get_Iq", Iq_Setpoint=1.0, Iq_Measured=-2.0)) == (1.0, -2.0)
    said = encoded("Set_Input_Pos", Input_Pos=2.0, Vel_FF=-1.0, Torque_FF=0.5)
    assert frames.unpack_target(said, SCALES) == Target(2.0, -1.0, 0.5)


def test_errors_and_states_have_the_names_of_the_official_file() -> None:
    beat = DBC.get_message_by_name("Axis1_Heartbeat")
    errors = beat.get_signal_by_name("Axis_Error").choices
    assert {flag: name for flag, (name, _) in ERRORS.items()} == {k: str(v) for k, v in errors.items() if k}
    states = {int(k): str(v) for k, v in beat.get_signal_by_name("Axis_State").choices.items()}
    assert {state.value: state.name for state in AxisState} == {k: v for k, v in states.items() if k != 5}


@pytest.fixture
def played(tmp_path: Path) -> Iterator[Played]:
    """A board as it comes, with its watchdog off: the partner's examples do not feed it while they wait."""
    drive = Rig(drive=OdriveParameters()).drive_parameters
    with Played(drive, tmp_path / "bus", ("axis0.config.enable_watchdog=0",)) as twin:
        yield twin


@pytest.mark.live
def test_its_own_example_moves_our_twin(played: Played, monkeypatch: pytest.MonkeyPatch) -> None:
    """`examples/position_control.py`, unmodified but for the bus, with one turn in place of forty."""
    from odrive_can import odrive
    from odrive_can.examples import position_control

    bench = played.plant
    monkeypatch.setattr(odrive, "get_can_bus", lambda: UnixBus(played.channel))
    goal, reached = 2.0 * math.pi / 5.0, []

    async def main() -> None:
        example = asyncio.create_task(position_control.main(1, "POS_FILTER", 1.0))
        ends = time.monotonic() + 20.0
        while time.monotonic() < ends and abs(bench.motor - goal) > 0.05 and not example.done():
            await asyncio.sleep(0.05)
        reached.append(bench.motor)
        example.cancel()
        await asyncio.gather(example, return_exceptions=True)

    in_a_thread(main())
    position_control.udp._sock.close()
    assert reached[0] == pytest.approx(goal, abs=0.06)


@pytest.mark.live
def test_its_questions_are_answered(played: Played) -> None:

    async def main() -> tuple[Any, ...]:
        drive = odrive_can.ODriveCAN(1, UnixBus(played.channel))
        await drive.start()
        drive.ignore_message(odrive_can.odrive.CommandId.ENCODER_ESTIMATE)
        told = await drive.get_bus_voltage_current(), await drive.get_iq(), drive.axis_state
        drive.stop()
        return told

    voltage, current, state = in_a_thread(main())
    assert voltage["Bus_Voltage"] == 24.0
    assert current["Iq_Measured"] == 0.0
    assert state == "IDLE"


@pytest.mark.live
def test_our_master_moves_its_mock_as_far_as_it_goes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The mock answers every question with zeros, and bring-up refuses it; told what it does not tell, we move it."""
    from odrive_can.mock import ODriveCANMock

    logging.getLogger("odrive.mock.1").setLevel(logging.ERROR)
    channel = str(tmp_path / "bus")
    drive = OdriveParameters(channel=channel, joint="none", answer_timeout=0.5)
    ready, over, mocks = threading.Event(), threading.Event(), []

    async def played() -> None:
        mocks.append(ODriveCANMock(1, UnixBus(channel)))
        tasks = [
            asyncio.create_task(one)
            for one in (
                mocks[0].heartbeat_loop(0.01), mocks[0].encoder_loop(0.005), mocks[0].message_handler()
            )
        ]  # fmt: skip
        ready.set()
        while not over.is_set():
            await asyncio.sleep(0.02)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    other = UnixBus(channel)  # so that the mock is not alone before we come
    thread = threading.Thread(target=lambda: asyncio.run(played()))
    thread.start()
    ready.wait(10.0)
    try:
        ours = OdriveDrive(drive)
        with pytest.raises(DriveError, match=r"firmware 0\.0\.0 with version 0 of its protocol"):
            ours.bring_up()

        def told(ours: OdriveDrive, port: Any) -> Found:
            board = OdriveDialogue(port, drive, endpoints_of("twin"))
            board.tell(Cmd.SET_CONTROLLER_MODE, frames.pack(Cmd.SET_CONTROLLER_MODE, 3, 1))
            scale = motor_scale(drive)
            return Found("mock", scale, None, motor_limits(drive, scale), DriveState.SWITCH_ON_DISABLED, 0, "")

        monkeypatch.setattr(OdriveDrive, "_find", told)
        monkeypatch.setattr(driver, "LOST", 10.0)
        monkeypatch.setattr(odrive_drive, "AGAIN", 10.0)  # it takes half a second for each request
        ours = OdriveDrive(drive, Links())
        ours.bring_up()
        ends = time.monotonic() + 15.0
        while time.monotonic() < ends and abs(mocks[0].odrive.position - 0.5) > 0.02:
            now = time.monotonic()
            ours.read(now)
            ours.write(2.0 * math.pi / drive.needs.gear * 0.5, Power.ON, now)
            time.sleep(5e-3)
        assert mocks[0].odrive.axis_state == "CLOSED_LOOP_CONTROL"
        assert mocks[0].odrive.position == pytest.approx(0.5, abs=0.02)
        ours.close()
    finally:
        over.set()
        thread.join()
        other.shutdown()
