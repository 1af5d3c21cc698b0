"""One cycle between host and drive: what acts when, what is told of it, and how it ends."""

import math
import random
from collections import deque

import can
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden.core.signals import DriveState
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.canopen_drive import MOST_DUE, CanopenDrive
from bowden.hardware.drives.checklist import Found
from bowden.hardware.drives.families.cia402 import DriveParameters, joint_scale
from bowden.hardware.drives.scale import motor_limits, motor_scale
from bowden.hardware.ports import Drive, Power
from bowden.hardware.twin.bench import TwinBench
from bowden.hardware.twin.injection import parse
from bowden.identify.servo import identify_servo
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.servo import ServoState, prepare, servo_step
from support.memory_bus import DriverLoop, bench_at

DRIVE = DriveParameters(answer_timeout=0.05)
CYCLE = 1e-3


def exact_bench(now: float) -> TwinBench:
    return bench_at(now, Encoder(0.0, 0.0))


class SyncBus(DriverLoop):
    """A bus on which the drive's time comes with the frames alone: it is late with everything else."""

    def pass_time(self) -> None:
        self.time += CYCLE


def enabled() -> tuple[Drive, SyncBus]:
    bus = SyncBus(DRIVE, plant=exact_bench)
    bus.up()
    return bus.drive, bus


@pytest.mark.parametrize("ticks", [True, False])
def test_a_target_acts_from_its_sync_on_and_not_before(ticks: bool) -> None:
    drive, bus = enabled()
    servo = bus.node.bench.bench.servo
    seen = []
    for target in (0.1, 0.1, 0.3, 0.3, 0.3):
        seen.append(drive.read(bus.time).motor)
        drive.write(target, Power.ON, bus.time)
        bus.advance(CYCLE) if ticks else bus.pass_time()
    count = abs(2.0 * math.pi / (DRIVE.motor_counts_per_turn * DRIVE.needs.gear))
    sent = round(0.3 / count) * count
    state, step = ServoState(seen[3], 0.0, 0.0), prepare(servo, 1e-4)
    for _ in range(10):
        state = servo_step(state, sent, step)
    assert seen[3] == pytest.approx(seen[2], abs=count), "sampled at the very SYNC at which the target is taken"
    assert seen[4] == pytest.approx(state.position, abs=2.0 * count)
    assert seen[4] - seen[3] > 3.0 * count


@pytest.mark.parametrize("ticks", [True, False])
def test_a_recorded_motion_shows_the_delay_of_one_cycle(ticks: bool) -> None:
    drive, bus = enabled()
    rows = []
    for k in range(3000):
        reading = drive.read(bus.time)
        t = k * CYCLE
        target = 0.1 + 0.1 * math.sin(2.0 * math.pi * (0.5 + 2.0 * t) * t)
        drive.write(target, Power.ON, bus.time)
        rows.append((t, target, reading.motor))
        bus.advance(CYCLE) if ticks else bus.pass_time()
    found = identify_servo(*np.array(rows).T)
    assert found.delay.value == pytest.approx(CYCLE, abs=0.1 * CYCLE)


def test_of_several_emergencies_in_a_cycle_the_first_is_told() -> None:
    drive, bus = enabled()
    drive.read(bus.time)
    for code in (0x4210, 0x8130, 0):
        bus.put(frames.EMERGENCY + 1, frames.pack_emergency(code, 1))
    assert drive.read(bus.time).emergency == 0x4210
    bus.put(frames.EMERGENCY + 1, frames.pack_emergency(0, 0))
    assert drive.read(bus.time).emergency == 0.0
    bus.put(frames.EMERGENCY + 2, frames.pack_emergency(0x4210, 1))
    assert drive.read(bus.time).emergency == 0.0, "another node's"


def test_no_power_before_a_position_is_known() -> None:
    bus = DriverLoop(DRIVE)
    bus.node.state = DriveState.SWITCHED_ON  # as another master has left it
    bus.drive.bring_up()
    for _ in range(5):
        bus.drive.write(0.1, Power.ON, bus.time)
        bus.advance(CYCLE)
        assert bus.node.state is not DriveState.OPERATION_ENABLED


class SlowServer(DriverLoop):
    """A drive whose SDO server takes some milliseconds."""

    def __init__(self, drive: DriveParameters) -> None:
        self._asked: deque[tuple[float, int, bytes]] = deque()
        super().__init__(drive)

    def send(self, msg: can.Message, timeout: float | None = None) -> None:
        if msg.arbitration_id == frames.SDO_REQUEST + 1:
            self._asked.append((self.time + 5e-3, msg.arbitration_id, bytes(msg.data)))
        else:
            super().send(msg, timeout)

    def advance(self, span: float) -> None:
        super().advance(span)
        while self._asked and self._asked[0][0] <= self.time:
            _, cob_id, data = self._asked.popleft()
            self.node.receive(cob_id, data, self.time)


def test_the_drive_has_stopped_watching_us_before_it_is_stopped() -> None:
    bus = SlowServer(DRIVE._replace(answer_timeout=0.2))
    bus.drive.bring_up()
    bus.journal.clear()  # of the trial of the drive's watch over us
    bus.run(20, Power.ON)
    bus.drive.close()
    bus.advance(1.0)
    assert bus.node.objects[0x1016, 1] == 0
    assert bus.node.nmt == frames.STOPPED
    assert bus.node.state is DriveState.SWITCH_ON_DISABLED
    assert "fault" not in [event for _, event, _ in bus.journal]


_TAPPED: list[DriverLoop] = []


@settings(max_examples=200, deadline=None)
@given(
    st.text(max_size=30)
    | st.builds(
        "{} {}".format,
        st.sampled_from(
            [
                "late_pdos",
                "delayed_readings",
                "dropped_pdos",
                "over_temperature",
                "over_current",
                "slack_cable",
                "encoder_offset motor",
                "encoder_spike joint",
            ]
        ),
        st.floats(),
    )
)
def test_any_fault_that_is_taken_leaves_the_twin_alive(text: str) -> None:
    from bowden.core.errors import ParameterError

    if not _TAPPED:
        _TAPPED.append(DriverLoop(DRIVE))
        _TAPPED[0].drive.bring_up()
    bus = _TAPPED[0]
    try:
        injection = parse(text)
    except ParameterError:
        return
    bus.node.faults.inject(injection._replace(start=bus.time))
    for _ in range(3):
        bus.node.receive(frames.SYNC, b"", bus.time)
        bus.advance(CYCLE)
    bus.node.faults.clear()
    bus._frames.clear()


class Port:
    """A bus in which a drive answers each SYNC by TPDO 1, in order: late, lost or received twice by chance.

    Args:
        seed: of the chance.
        losses: share of the SYNCs, and of the answers, that are lost.
        twice: share of the answers that are received twice, as after a bit error in the last bit of a frame.
        stall: longest stall of the drive, after which all that it has to say comes at once [cycles].
    """

    errors = 0

    def __init__(self, seed: int, losses: float, twice: float, stall: int) -> None:
        self._chance, self._losses, self._twice, self._stall = random.Random(seed), losses, twice, stall
        self._waiting: deque[float] = deque()
        self.now, self.doubled = 0.0, False

    def sync(self, _: int) -> None:
        chance = self._chance
        if chance.random() >= self._losses:
            late = chance.expovariate(1.0) + (chance.random() < 0.02) * chance.uniform(0.0, self._stall)
            at = max(self._waiting[-1] if self._waiting else 0.0, self.now + late)
            self._waiting.extend([at] * ((chance.random() >= self._losses) + (chance.random() < self._twice)))
            self._waiting.extend([at] * self.doubled)

    def take_all(self) -> list[tuple[int, bytes]]:
        found = []
        while self._waiting and self._waiting[0] <= self.now:
            self._waiting.popleft()
            found.append((0x181, frames.MOTION.pack(0x1237, 0, 0)))
        return found

    def send(self, *_: object) -> None:
        pass


@given(
    st.integers(0, 2**32),
    st.sampled_from([0.0, 0.01, 0.3]),
    st.sampled_from([0.0, 0.01]),
    st.sampled_from([0, 10, 50, 100]),
)
@settings(max_examples=15)
def test_no_drive_is_wronged_for_late_frames_and_a_second_one_of_its_number_is_found(
    seed: int, losses: float, twice: float, stall: int
) -> None:
    """Jitter of a cycle, lost SYNCs, stalls of the drive; then each SYNC has two answers."""
    port, drive = Port(seed, losses, twice, stall), CanopenDrive(DRIVE)
    drive._port, drive._up = port, True  # type: ignore[assignment]
    drive._found = Found(
        "",
        motor_scale(DRIVE),
        joint_scale(DRIVE),
        motor_limits(DRIVE, motor_scale(DRIVE)),
        DriveState.SWITCH_ON_DISABLED,
        0,
        "",
        0.2,
    )
    port._waiting.extend([0.0] * 4)  # to the SYNCs of the bring-up
    foreign = []
    for cycle in range(2000):
        port.now, port.doubled = float(cycle), cycle >= 1300
        foreign.append(drive.read(1e-3 * cycle).foreign)
        drive.write(0.0, Power.OFF, 1e-3 * cycle)
    assert sum(foreign[:1300]) == 0.0
    excess = (1.0 - losses) * (2.0 - losses) - 1.05
    within = 25 + 4 * stall if losses == 0.0 else MOST_DUE / excess + 60 + 4 * stall
    assert sum(foreign[1300 : 1300 + math.ceil(within)]) > 0.0
