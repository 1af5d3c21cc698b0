"""What families of drives share: encoders that wrap, readings made of replies, who may be switched on again."""

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden.core.errors import DriveError, ParameterError
from bowden.core.signals import DriveState
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.canopen_sensor import MOST_SILENCE
from bowden.hardware.drives.families.odrive import OdriveParameters
from bowden.hardware.drives.findings import INERT, InertWatch
from bowden.hardware.drives.joint_encoder import JointEncoder, check_beside
from bowden.hardware.drives.scale import LimitedRange, nearest
from bowden.hardware.twin.faults import Faults
from bowden.hardware.twin.injection import KINDS, parse
from bowden.hardware.twin.sensor_node import JointEncoderNode
from support.memory_bus import MemoryBus

ENABLED, DISABLED = DriveState.OPERATION_ENABLED, DriveState.SWITCH_ON_DISABLED


@given(st.lists(st.floats(-9.0, 9.0), max_size=60), st.floats(-12.0, 12.0))
@settings(max_examples=200, deadline=None)
def test_a_limited_range_is_followed_over_its_ends(moves: list[float], start: float) -> None:
    turns, true = LimitedRange(25.0), start
    assert turns.follow(start) == start
    for move in moves:
        true += move
        shown = (true + 12.5) % 25.0 - 12.5
        assert math.isnan(turns.follow(math.nan))  # which changes no turn
        assert turns.follow(shown) == pytest.approx(true, abs=1e-9)


@given(st.floats(-100.0, 100.0), st.floats(0.01, 10.0), st.floats(-100.0, 100.0))
def test_a_hint_tells_the_turn(angle: float, period: float, hint: float) -> None:
    found = nearest(angle, period, hint)
    assert abs(found - hint) <= 0.5 * period * (1.0 + 1e-9) + 1e-9
    assert (found - angle) / period == pytest.approx(round((found - angle) / period), abs=1e-6)


def test_an_inert_motor_is_seen_within_fifty_milliseconds_and_one_that_turns_or_holds_is_not() -> None:
    watch = InertWatch(0.002)
    seen = [watch.inert(0.3, 1e-3 * k, in_vain=True) for k in range(50)]
    assert seen.index(True) == 20
    watch.begin()
    assert not any(watch.inert(0.3 + 3e-4 * k, 1e-3 * k, in_vain=True) for k in range(200))
    assert not any(watch.inert(0.3, 1e-3 * k, in_vain=k % 15 != 0) for k in range(200))
    assert INERT < 65536


ENCODER = OdriveParameters(joint_home=0.1, answer_timeout=0.2)


def encoder_on(given_: OdriveParameters, overrides: object = None) -> tuple[JointEncoder, MemoryBus, list[float]]:
    """The driver's part, the bus and the true angle [rad]."""
    true, faults = [0.4], Faults()
    bus = MemoryBus()
    bus.faults = faults
    bus.attach(JointEncoderNode(given_, lambda: true[0], faults, bus.put, overrides))  # type: ignore[arg-type]
    return JointEncoder(given_), bus, true


def taken(encoder: JointEncoder, bus: MemoryBus) -> list[float]:
    """What the encoder makes of all frames that there are."""
    found = [encoder.take(message.arbitration_id, bytes(message.data), bus.time) for message in bus.drain()]
    return [angle for angle in found if angle is not None]


@pytest.mark.parametrize("synced", [True, False])
def test_an_encoder_of_its_own_tells_the_joints_angle_over_its_end(*, synced: bool) -> None:
    encoder, bus, true = encoder_on(ENCODER._replace(joint_sends="sync" if synced else "timer"))
    assert "16384 counts a turn" in encoder.bring_up(bus.port)
    taken(encoder, bus)
    for true[0] in (0.4, 0.2, -0.1, -0.6):
        if synced:
            bus.send_frame(frames.SYNC, b"")
        bus.advance(0.002)
        assert taken(encoder, bus)[-1] == pytest.approx(true[0], abs=2e-4)
    bus.close()


def test_an_encoder_is_found_home_where_it_stands() -> None:
    encoder, bus, true = encoder_on(ENCODER._replace(home="here", joint_home=0.0))
    encoder.bring_up(bus.port)
    true[0] = 0.55
    bus.send_frame(frames.SYNC, b"")
    assert taken(encoder, bus)[-1] == pytest.approx(0.15, abs=5e-4)
    bus.close()


@pytest.mark.parametrize(
    ("overrides", "said"),
    [
        ({(0x1000, 0): 0x0002_0192}, "profile 402"),
        ({(0x1000, 0): 0x0001_0196}, ""),
        ({(0x1000, 0): 0x0003_0196}, "type 3"),
        ({(0x6501, 0): 8192}, "expected 8192"),
        ({(0x6000, 0): 4, (0x6001, 0): 4096}, "expected 4096"),
        ({(0x6503, 0): 1}, "alarm"),
        ({(0x1017, 0): None}, "1017h"),
        ({(0x1A00, 1): 0x6004_0010}, ""),
    ],
)
def test_an_encoder_that_does_not_fit_is_refused(overrides: dict[tuple[int, int], int | None], said: str) -> None:
    encoder, bus, _ = encoder_on(ENCODER, overrides)
    if not said:
        encoder.bring_up(bus.port)
    else:
        with pytest.raises(DriveError, match=said):
            encoder.bring_up(bus.port)
    bus.close()


def test_an_encoder_that_nobody_is_is_named_with_those_who_are() -> None:
    encoder, bus, _ = encoder_on(ENCODER)
    with pytest.raises(DriveError, match="there is node 32"):
        JointEncoder(ENCODER._replace(joint_node_id=33)).bring_up(bus.port)
    assert encoder.synced
    bus.close()


@pytest.mark.parametrize("fault", ["joint_silence", "encoder_frozen joint", "encoder_spike joint 30"])
def test_faults_of_the_joints_encoder_show_as_what_they_are(fault: str) -> None:
    encoder, bus, true = encoder_on(ENCODER)
    encoder.bring_up(bus.port)
    taken(encoder, bus)
    assert bus.faults is not None
    bus.faults.inject(parse(fault))
    angles = []
    for k in range(40):
        true[0] = 0.4 + 0.01 * k
        bus.send_frame(frames.SYNC, b"")
        bus.advance(0.001)
        angles.append(taken(encoder, bus))
    told = [angle[-1] for angle in angles if angle]
    if fault == "joint_silence":
        assert not told
    elif "frozen" in fault:
        assert max(told) - min(told) < 1e-9
    else:
        assert max(told[k] - 0.4 - 0.01 * k for k in range(40)) == pytest.approx(math.radians(30.0), abs=1e-3)
    bus.close()


def test_an_encoder_in_an_emergency_or_without_its_heartbeat_tells_nothing() -> None:
    encoder, bus, _ = encoder_on(ENCODER)
    encoder.bring_up(bus.port)
    taken(encoder, bus)
    reading = (frames.TPDO1 + 32, (4096).to_bytes(4, "little"))
    now = bus.time
    assert encoder.take(*reading, now) is not None
    encoder.take(frames.EMERGENCY + 32, frames.pack_emergency(0x1000, 1), now)
    assert encoder.take(*reading, now) is None
    encoder.take(frames.EMERGENCY + 32, frames.pack_emergency(0, 0), now)
    assert encoder.take(*reading, now) is not None
    assert encoder.take(*reading, now + 2.0 * MOST_SILENCE) is None
    encoder.take(frames.HEARTBEAT + 32, bytes((frames.PRE_OPERATIONAL,)), now + 2.0 * MOST_SILENCE)
    assert encoder.take(*reading, now + 2.0 * MOST_SILENCE) is None
    bus.close()


@given(st.integers(0, 0x7FF), st.binary(max_size=8))
@settings(max_examples=300, deadline=None)
def test_no_frame_breaks_the_encoder(identifier: int, data: bytes) -> None:
    angle = JointEncoder(ENCODER).take(identifier, data, 1.0)
    assert angle is None or math.isfinite(angle)


def test_frames_of_a_drive_that_are_canopens_are_refused_beside_an_encoder() -> None:
    check_beside(ENCODER._replace(joint="none"), {0: "reply_id"})
    check_beside(ENCODER, {5: "node_id"})
    with pytest.raises(ParameterError, match=r"drive\.reply_id makes frames 000h"):
        check_beside(ENCODER, {0: "reply_id"})


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "there is no fault ''"),
        ("encoder_spike", "is of an encoder"),
        ("encoder_spike elbow 3", "is of an encoder"),
        ("late_pdos much", "is not a number for it"),
        ("late_pdos nan", "is not a number for it"),
        ("silence 3", "is too much"),
        ("drive_fault 0x4210 now", "is too much"),
    ],
)
def test_faults_written_wrong_are_refused(text: str, said: str) -> None:
    with pytest.raises(ParameterError, match=said):
        parse(text)


@pytest.mark.parametrize("name", KINDS)
def test_faults_are_written_as_they_are_listed(name: str) -> None:
    kind = KINDS[name]
    side = "motor" if kind.side else ""
    found = parse(f"{name} {side}")
    assert (found.name, found.side) == (name, side)
    assert math.isnan(found.amount) if kind.amount is None else found.amount == kind.amount
