"""Several drives of one process on one bus: each has its frames, and what is for the whole bus goes out once."""

import can
import pytest

from bowden.core.errors import DriveError
from bowden.hardware.buses.link import Links
from bowden.hardware.buses.place import EXTENDED, REMOTE, BusPlace
from bowden.hardware.buses.unix_bus import UnixBus
from bowden.hardware.drives.checklist import Conversation

PLACE = BusPlace("bowden_unix", "unused", 1_000_000)


class Loopback(can.BusABC):
    """A bus in memory: what is sent is kept, what is to be read is put in."""

    def __init__(self) -> None:
        self.sent: list[int] = []
        self.waiting: list[can.Message] = []
        self.broken = False
        super().__init__(channel="memory")

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if self.broken:
            raise can.CanOperationError("off")
        self.sent.append(msg.arbitration_id)

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        return (self.waiting.pop(0) if self.waiting else None), True


def frame(identifier: int) -> can.Message:
    return can.Message(arbitration_id=identifier, is_extended_id=False, data=b"\1")


def test_all_frames_of_a_drive_are_taken_at_once_and_no_more_than_a_cycle_may_read() -> None:
    bus = Loopback()
    links = Links(bus)
    one = links.join(PLACE, "node 1", lambda identifier: identifier & 0xF in (1, 0xF))
    bus.waiting = [frame(0x11)] * 100
    assert len(one.take_all()) == 64
    assert len(one.take_all()) == 36
    two = links.join(PLACE, "node 2", lambda identifier: identifier & 0xF in (2, 0xF))
    bus.waiting = [frame(identifier) for identifier in (0x12, 0x11, 0x1F, 0x21, 0x13, 0x22)]
    assert [identifier for identifier, _ in one.take_all()] == [0x11, 0x1F, 0x21]
    assert [identifier for identifier, _ in two.take_all()] == [0x12, 0x1F, 0x22]
    assert one.take_all() == two.take_all() == []
    two.leave()
    bus.waiting = [frame(0x12)]
    assert one.take_all() == [(0x12, b"\1")]


def test_a_bus_without_a_way_of_its_own_is_sent_messages() -> None:
    class Keeping(Loopback):
        kept: list[can.Message]

        def send(self, msg: can.Message, timeout: float | None = None) -> None:
            self.kept.append(can.Message(**{key: getattr(msg, key) for key in FIELDS}))

    bus = Keeping()
    bus.kept = []
    port = Links(bus).join(PLACE, "node 1", lambda _: True)
    port.send(0x201, b"\1\2")
    port.send(0x201, b"\3")
    port.send(REMOTE | 0x29, bytes(8))
    port.send(EXTENDED | 0x8001, b"")
    said = [(one.arbitration_id, one.is_extended_id, one.is_remote_frame, one.dlc, bytes(one.data)) for one in bus.kept]
    assert said == [
        (0x201, False, False, 2, b"\1\2"),
        (0x201, False, False, 1, b"\3"),
        (0x29, False, True, 8, b""),
        (0x8001, True, False, 0, b""),
    ]


FIELDS = ("arbitration_id", "is_extended_id", "is_remote_frame", "dlc", "data")


def test_what_is_for_the_whole_bus_follows_the_frames_of_all_drives_and_goes_out_once_a_cycle() -> None:
    bus = Loopback()
    links = Links(bus)
    ports = [links.join(PLACE, f"node {k}", lambda _: True, synced=True) for k in (1, 2, 3)]
    listener = links.join(PLACE, "node 4", lambda _: True)
    for _ in range(2):
        listener.send(0x204, b"\1")
        for k, port in enumerate(ports):
            port.send(0x201 + k, b"\1")
            port.sync(0x080)
    assert bus.sent == [0x204, 0x201, 0x202, 0x203, 0x080] * 2
    bus.sent.clear()
    ports[1].synced = False  # it is let go of alone
    ports[1].sync(0x080)
    ports[0].sync(0x080)
    assert bus.sent == [0x080]
    ports[2].sync(0x080)
    assert bus.sent == [0x080, 0x080]


class Talkative(can.BusABC):
    """A bus on which somebody says something every ten milliseconds; it is the clock as well."""

    def __init__(self, last: int = 0x701) -> None:
        self.time, self._last = 0, last
        super().__init__(channel="memory")

    def now(self) -> int:
        return self.time

    def sleep_until(self, deadline: int) -> None:
        raise NotImplementedError

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        raise NotImplementedError

    def _recv_internal(self, timeout: float | None) -> tuple[can.Message | None, bool]:
        if timeout == 0.0:  # what has waited
            identifier, self._last = self._last, 0
            return (frame(identifier) if identifier else None), True
        self.time += 10_000_000
        return frame(0x701), True


def test_heartbeats_of_others_do_not_make_the_listening_longer_and_what_waits_at_its_end_counts() -> None:
    def conversation(bus: Talkative) -> Conversation:
        port = Links(bus, bus).join(PLACE, "node 1", lambda _: True)
        return Conversation(port, 1, lambda identifier, _: identifier == 0x001)

    bus = Talkative()
    conversation(bus).listen(1.0)
    assert bus.time == 1_000_000_000
    with pytest.raises(DriveError, match="another master speaks"):
        conversation(Talkative(last=0x001)).listen(1.0)


def test_what_cannot_be_sent_is_counted_and_raises_nothing() -> None:
    bus = Loopback()
    port = Links(bus).join(PLACE, "node 1", lambda _: True)
    bus.broken = True
    port.send(1, b"\1")
    port.sync(2)
    assert port.errors == 2
    port.leave()
    port.leave()


def test_two_drives_of_one_number_on_one_bus_are_refused() -> None:
    links = Links(Loopback())
    links.join(PLACE, "node 1", lambda _: True)
    with pytest.raises(DriveError, match="two drives of this rig are node 1 of the bus unused; expected"):
        links.join(PLACE, "node 1", lambda _: True)
    links.join(PLACE._replace(channel="other"), "node 1", lambda _: True)


def test_one_bus_has_one_bit_rate_and_one_kind_of_frames() -> None:
    links = Links(Loopback())
    links.join(PLACE, "node 1", lambda _: True)
    with pytest.raises(DriveError, match=r"otherwise: 1000000 bit/s, 1000000 bit/s and 5000000 bit/s for data"):
        links.join(PLACE._replace(fd=True), "node 2", lambda _: True)


def test_a_bus_is_claimed_by_its_first_drive_and_free_after_its_last(tmp_path: object) -> None:
    place = PLACE._replace(channel=str(tmp_path))
    other = UnixBus(str(tmp_path))
    links = Links()
    one, two = (links.join(place, f"node {k}", lambda _: True) for k in (1, 2))
    with pytest.raises(DriveError, match="has a host already"):
        Links().join(place, "node 3", lambda _: True)
    one.leave()
    with pytest.raises(DriveError, match="has a host already"):
        Links().join(place, "node 3", lambda _: True)
    two.leave()
    Links().join(place, "node 3", lambda _: True).leave()
    links.join(place, "node 1", lambda _: True).leave()
    other.shutdown()
