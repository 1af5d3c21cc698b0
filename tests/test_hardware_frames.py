"""Bytes on the bus: round trips, and that no bytes whatever do harm."""

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives.families.cia402 import FAMILY, DriveParameters, joint_scale
from bowden.hardware.drives.scale import motor_scale
from bowden.rig.families import DriveNeeds

I16, I32, U16 = st.integers(-(2**15), 2**15 - 1), st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**16 - 1)


@pytest.mark.parametrize("pdo", [frames.ORDER, frames.MOTION, frames.SENSORS, frames.INPUTS])
@given(st.data())
def test_a_pdo_goes_there_and_back_whole_or_without_its_last_object(pdo: frames.Pdo, data: st.DataObject) -> None:
    values = tuple(data.draw({"H": U16, "i": I32, "h": I16, "I": st.integers(0, 2**32 - 1)}[one]) for one in pdo.form)
    for count in range(max(1, len(values) - 1), len(values) + 1):
        told = pdo.pack(*values[:count])
        assert pdo.unpack(told, count) == values[:count]
        assert 8 * len(told) == sum(entry & 0xFF for entry in pdo.mapping[:count])
        assert (pdo.unpack(told) is None) == (count < len(values))


@given(U16, st.integers(0, 255))
def test_emergencies_go_there_and_back(code: int, register: int) -> None:
    assert frames.unpack_emergency(frames.pack_emergency(code, register)) == code


@given(st.binary(max_size=64))
def test_no_bytes_do_harm(data: bytes) -> None:
    whole = (frames.ORDER.unpack, frames.MOTION.unpack, frames.SENSORS.unpack, frames.INPUTS.unpack)
    for unpack in (*whole, frames.unpack_emergency, frames.unpack_heartbeat):
        unpack(data)
        unpack(bytearray(data))


def test_a_download_is_as_in_the_standard() -> None:
    assert frames.pack_sdo_write(0x1017, 0, 1000, 2).hex() == "2b171000e8030000"
    assert frames.pack_sdo_write(0x1016, 1, 0, 4).hex() == "2316100100000000"


@given(
    st.integers(-(2**31), 2**31 - 1),
    st.sampled_from([1, -1]),
    st.floats(100.0, 1e6),
    st.floats(0.1, 500.0),
    st.floats(-10.0, 10.0),
    st.integers(-(2**20), 2**20),
)
def test_counts_and_angles_go_there_and_back(
    counts: int, direction: int, per_turn: float, gear: float, home: float, at_home: int
) -> None:
    drive = DriveParameters(
        motor_direction=direction,
        joint_direction=direction,
        motor_counts_per_turn=per_turn,
        joint_counts_per_turn=per_turn,
        needs=DriveNeeds(gear=gear),
        motor_home=home,
        joint_home=home,
    )
    for scale in (motor_scale(drive, at_home), joint_scale(drive, at_home)):
        assert round(scale.counts(scale.angle(counts))) == counts
        assert math.isclose(scale.angle(at_home), home, abs_tol=1e-6)


def test_the_watch_of_a_slow_loop_follows_its_cycle_and_may_be_longer_than_one_that_is_written() -> None:
    needs = DriveNeeds(5.0, 16.7e-3, 0.05, -1.0, 1.0, 5.0, 1.0, 5.0, 0.0, None, heartbeat_age=0.2)
    left_out = DriveParameters(heartbeat_timeout=math.nan, heartbeat_time=10e-3)
    assert FAMILY.completed(left_out, needs).heartbeat_timeout == pytest.approx(0.15)
