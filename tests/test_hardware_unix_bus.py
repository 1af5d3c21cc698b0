"""The bus between processes behaves as a CAN bus: all hear, nobody waits, the dead do no harm."""

import importlib
import os
import socket
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import can
import pytest

from bowden.core.errors import DriveError
from bowden.hardware.buses import opening
from bowden.hardware.buses.opening import claim, open_bus
from bowden.hardware.buses.place import ERROR, EXTENDED, REMOTE, BusPlace
from bowden.hardware.buses.unix_bus import UnixBus, bus_folder


def frame(cob_id: int, data: bytes = b"") -> can.Message:
    return can.Message(arbitration_id=cob_id, data=data, is_extended_id=False)


def heard(bus: UnixBus) -> list[int]:
    found = []
    while (message := bus.recv(0.0)) is not None:
        found.append(message.arbitration_id)
    return found


def test_every_frame_reaches_all_others_once_and_in_order(tmp_path: Path) -> None:
    buses = [UnixBus(tmp_path) for _ in range(4)]
    for i in range(100):
        buses[i % 4].send(frame(i))
    for k, bus in enumerate(buses):
        found = heard(bus)
        assert sorted(found) == [i for i in range(100) if i % 4 != k]
        for other in range(4):
            assert [i for i in found if i % 4 == other] == [i for i in range(100) if i % 4 == other and other != k]
    for bus in buses:
        bus.shutdown()


def message(identifier: int, data: bytes = b"", **more: Any) -> can.Message:
    """A frame of an identifier with the flags of the bus."""
    return can.Message(
        arbitration_id=identifier & 0x1FFF_FFFF,
        is_extended_id=bool(identifier & EXTENDED),
        is_remote_frame=bool(identifier & REMOTE),
        is_error_frame=bool(identifier & ERROR),
        data=data,
        **more,
    )


CLASSIC = [(0x181, bytes(range(8))), (0x80, b""), (EXTENDED | 0x1ABC_DEF0, b"\1\2\3"), (ERROR | 0x40, bytes(8))]
OF_FD = [(EXTENDED | 0x8001, bytes(range(length))) for length in (0, 8, 12, 48, 64)]


@pytest.mark.parametrize("put", [False, True], ids=["in a message", "by its bytes"])
@pytest.mark.parametrize(
    ("identifier", "data", "more"),
    [
        *((*one, {}) for one in CLASSIC),
        *((*one, {"is_fd": True, "bitrate_switch": switched}) for one in OF_FD for switched in (True, False)),
    ],
    ids=str,
)
def test_a_frame_arrives_as_it_was_sent(
    tmp_path: Path, identifier: int, data: bytes, more: dict[str, bool], *, put: bool
) -> None:
    fd = bool(more)
    sent = message(identifier, data, **(more | {"bitrate_switch": True} if put and fd else more))
    with UnixBus(tmp_path, fd=fd) as one, UnixBus(tmp_path, fd=fd) as two, UnixBus(tmp_path, fd=fd) as three:
        one.put(identifier, data) if put else one.send(sent)
        assert two.recv(1.0).equals(sent, timestamp_delta=None, check_channel=False, check_direction=False)
        assert three.take() == (identifier, data)


@pytest.mark.parametrize("put", [False, True])
def test_a_remote_frame_has_the_length_that_it_asks_for(tmp_path: Path, *, put: bool) -> None:
    with UnixBus(tmp_path) as one, UnixBus(tmp_path) as two:
        one.put(REMOTE | 0x29, bytes(8)) if put else one.send(message(REMOTE | 0x29, dlc=8))
        found = two.recv(1.0)
        assert found is not None
        assert (found.arbitration_id, found.is_remote_frame, found.dlc) == (0x29, True, 8)


def test_who_joins_a_bus_of_two_is_heard_in_the_next_look(tmp_path: Path) -> None:
    with UnixBus(tmp_path) as one, UnixBus(tmp_path) as two:
        assert one.take() is None
        with UnixBus(tmp_path) as three:
            three.put(0x12, b"\1")
            two.put(0x11, b"\2")
            assert {one.take(), one.take()} == {(0x11, b"\2"), (0x12, b"\1")}
            assert one.take() is None
        assert one.take() is None


def test_data_of_can_fd_has_one_of_its_lengths(tmp_path: Path) -> None:
    with UnixBus(tmp_path, fd=True) as one, UnixBus(tmp_path, fd=True) as two:
        one.send(can.Message(arbitration_id=1, is_fd=True, data=b"\x50" * 41))
        assert two.take() == (EXTENDED | 1, b"\x50" * 41 + bytes(7))
        with pytest.raises(can.CanOperationError, match="64 bytes at most, not 65"):
            one.send(can.Message(arbitration_id=1, is_fd=True, data=bytes(65)))


def test_a_node_of_classic_can_hears_its_frames_between_those_of_can_fd_and_sends_none(tmp_path: Path) -> None:
    long = can.Message(arbitration_id=2, is_fd=True, is_extended_id=False, data=bytes(48))
    with UnixBus(tmp_path, fd=True) as one, UnixBus(tmp_path) as classic, UnixBus(tmp_path, fd=True) as two:
        for i in range(40):
            one.send(long)
            one.send(frame(0x100 + i, b"\1"))
        assert heard(classic) == [0x100 + i for i in range(40)]
        assert len(heard(two)) == 80
        for _ in range(200):
            one.send(long)
        assert classic.take() is None
        with pytest.raises(can.CanOperationError, match="classic CAN"):
            classic.send(long)
        classic.send(frame(5))
        assert heard(one) == [5]


def test_an_interface_of_classic_can_is_refused_where_can_fd_is_asked_for(monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(DriveError, match=r"virtual.*carries classic CAN alone.*fd=True"):
        open_bus(BusPlace("virtual", "x", 1_000_000, fd=True))
    monkeypatch.setattr(opening, "_longest_frame", lambda channel: 16)
    with pytest.raises(DriveError, match="can0 carries classic CAN alone") as refused:
        open_bus(BusPlace("socketcan", "can0", 1_000_000, fd=True))
    assert "bitrate 1000000 dbitrate 5000000 fd on" in str(refused.value)


def test_who_does_not_read_is_never_waited_for(tmp_path: Path) -> None:
    with UnixBus(tmp_path) as one, UnixBus(tmp_path) as deaf, UnixBus(tmp_path) as two:
        got = 0
        for i in range(3000):
            one.send(frame(i % 0x7FF))
            got += len(heard(two))
        assert got == 3000
        assert 0 < len(heard(deaf)) < 3000


def test_what_a_node_said_before_it_left_is_heard(tmp_path: Path) -> None:
    with UnixBus(tmp_path) as one, UnixBus(tmp_path) as third:
        two = UnixBus(tmp_path)
        two.send(frame(5))
        two.shutdown()
        one.send(frame(6))
        assert heard(one) == [5]
        assert sorted(heard(third)) == [5, 6]
        one.send(frame(7))
        assert heard(third) == [7]


def test_alone_nobody_acknowledges(tmp_path: Path) -> None:
    with UnixBus(tmp_path) as one:
        with pytest.raises(can.CanOperationError, match="acknowledges"):
            one.send(frame(1))
        with UnixBus(tmp_path) as two:
            one.send(frame(2))
            assert heard(two) == [2]
        with pytest.raises(can.CanOperationError):
            one.send(frame(3))


def test_what_the_dead_leave_is_cleared_away(tmp_path: Path) -> None:
    code = (
        "import os, sys; from bowden.hardware.buses.unix_bus import UnixBus;"
        "bus = UnixBus(sys.argv[1]); print('up', flush=True); os.kill(os.getpid(), 9)"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=False, capture_output=True, timeout=60)
    assert len(list(tmp_path.glob("*.node"))) == 1
    with UnixBus(tmp_path) as one, UnixBus(tmp_path) as two:
        one.send(frame(9))
        assert heard(two) == [9]
        assert len(list(tmp_path.glob("*.node"))) == 2
    assert not list(tmp_path.glob("*.node"))


def test_strangers_at_the_door_do_no_harm(tmp_path: Path) -> None:
    with UnixBus(tmp_path) as one, socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as stranger:
        stranger.connect(str(next(tmp_path.glob("*.node"))))
        for size in (1, 71, 100):
            stranger.send(b"\xff" * size)
        with UnixBus(tmp_path) as two:
            two.send(frame(3))
            assert heard(one) == [3]


def test_no_bus_and_bad_places_are_said_in_a_line(tmp_path: Path) -> None:
    with pytest.raises(DriveError, match="there is no such bus"):
        open_bus(BusPlace("bowden_unix", str(tmp_path / "none"), 1_000_000))
    with pytest.raises(DriveError, match="too long"):
        open_bus(BusPlace("bowden_unix", str(tmp_path / ("x" * 120)), 1_000_000), create=True)
    with pytest.raises(DriveError, match="no CAN interface 'nonsense'"):
        open_bus(BusPlace("nonsense", "can0", 1_000_000))
    file = tmp_path / "file"
    file.write_text("")
    with pytest.raises(DriveError, match="cannot open the bus"):
        open_bus(BusPlace("bowden_unix", str(file), 1_000_000), create=True)


@pytest.mark.skipif(sys.platform != "linux", reason="SocketCAN is Linux'")
def test_a_socketcan_interface_that_is_not_there_is_said_in_a_line() -> None:
    with pytest.raises(DriveError, match="cannot open the bus nocan7"):
        open_bus(BusPlace("socketcan", "nocan7", 1_000_000))


def test_a_part_is_played_by_one_process_and_free_when_it_dies(tmp_path: Path) -> None:
    first = claim("bowden_unix", str(tmp_path), "host")
    with pytest.raises(DriveError, match="has a host already"):
        claim("bowden_unix", str(tmp_path) + os.sep, "host")
    claim("bowden_unix", str(tmp_path), "node 1").close()
    claim("bowden_unix", str(tmp_path / "other"), "host").close()
    first.close()
    claim("bowden_unix", str(tmp_path), "host").close()
    code = (
        "import os, sys; from bowden.hardware.buses.opening import claim;"
        "held = claim('bowden_unix', sys.argv[1], 'host'); os.kill(os.getpid(), 9)"
    )
    subprocess.run([sys.executable, "-c", code, str(tmp_path)], check=False, capture_output=True, timeout=60)
    claim("bowden_unix", str(tmp_path), "host").close()


def test_python_can_is_told_of_it() -> None:
    project = tomllib.loads((Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    module, name = project["entry-points"]["can.interface"]["bowden_unix"].split(":")
    assert getattr(importlib.import_module(module), name) is UnixBus


@pytest.mark.parametrize("channel", ["rig", "some/folder"])
def test_a_bare_name_is_a_bus_of_this_user(channel: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    folder = bus_folder(channel)
    assert folder == (Path(channel) if "/" in channel else tmp_path / f"bowden-{os.getuid()}" / channel)


def test_a_place_of_a_bare_name_is_this_users_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path))
    place = tmp_path / f"bowden-{os.getuid()}"
    UnixBus("a").shutdown()
    assert place.stat().st_mode & 0o777 == 0o700
    place.chmod(0o755)
    with pytest.raises(can.CanInitializationError, match="belongs to other users too"):
        UnixBus("a")
    (place / "a" / "door.lock").unlink()
    (place / "a").rmdir()
    place.rmdir()
    place.symlink_to(tmp_path / "elsewhere")
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    with pytest.raises(can.CanInitializationError, match="belongs to other users too"):
        UnixBus("a")
