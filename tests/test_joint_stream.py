"""What a joint's sensor sends: its lines, its angles, and a run on the twin by them."""

import json
import math
import os
import socket
import struct
import time
import tty
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bowden import Rig
from bowden.core.clock import SECOND
from bowden.core.errors import StreamError
from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import TargetSource
from bowden.hardware import joint_stream
from bowden.hardware.buses.place import EXTENDED
from bowden.hardware.buses.unix_bus import UnixBus
from bowden.hardware.joint_stream import JointSamples, Raw, line_of, of_twin, raw_of
from bowden.hardware.twin.faults import Faults
from bowden.hardware.twin.joint_stream import JointSensorTwin
from bowden.live.mcap_read import read
from bowden.live.twin_process import running_twin
from bowden.rig.settings import JointSensor
from bowden.safety.faults import Fault
from bowden.sensing.joint_sample import Quaternion, angle_about, axis_of, between, on_curve, orientation
from live_runs import SHARED_LIMITS, assert_replays, finished, finished_well, started, tries

ANGLES = st.floats(-3.0, 3.0)


def turn(axis: Any, angle: float) -> Quaternion:
    return Quaternion(math.cos(0.5 * angle), *(math.sin(0.5 * angle) * np.asarray(axis)))


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as one:
        one.bind(("127.0.0.1", 0))
        return int(one.getsockname()[1])


@given(st.tuples(ANGLES, ANGLES, ANGLES, ANGLES), st.floats(0.0, 6.0), st.floats(-1.0, 1.0))
@settings(deadline=None)
def test_the_angle_of_two_bodies_is_the_same_wherever_they_are(
    posed: tuple[float, float, float, float], heading: float, height: float
) -> None:
    """However both are mounted and carried, and about any axis."""
    level = math.sqrt(1.0 - height * height)
    axis = (level * math.cos(heading), level * math.sin(heading), height)
    carried, mounted = turn((0.0, 0.6, 0.8), posed[0]), turn((0.6, 0.0, 0.8), posed[1])
    first = carried.times(turn((1.0, 0.0, 0.0), posed[2]))
    second = first.times(turn(axis, posed[3])).times(mounted)
    assert angle_about(between([first, second]), mounted, axis) == pytest.approx(posed[3], abs=1e-9)


def test_the_axis_of_a_free_motion_is_found() -> None:
    axis = np.array([0.36, 0.48, 0.8])
    zero = turn((0.0, 1.0, 0.0), 0.7)
    motion = [turn(axis, angle).times(zero) for angle in 0.4 * (1.0 - np.cos(np.linspace(0.0, 6.0, 100)))]
    found, share = axis_of(motion)
    assert found == pytest.approx(axis, abs=1e-9)
    assert share == pytest.approx(1.0)


def test_an_orientation_of_no_length_is_no_number() -> None:
    assert math.isnan(orientation((0.0, 0.0, 0.0, 0.0)).w)
    assert orientation((1.02, 0.0, 0.0, 0.0)) == (1.0, 0.0, 0.0, 0.0)


@given(st.floats(-500.0, 1500.0))
def test_a_falling_curve_is_a_rising_one_read_backwards(value: float) -> None:
    """It goes through its poses, and straight on beyond them."""
    values, angles = (100.0, 400.0, 900.0), (0.0, 0.7, 1.5)
    assert on_curve(value, values, angles) == pytest.approx(on_curve(value, values[::-1], angles[::-1]))
    assert [on_curve(one, values, angles) for one in values] == pytest.approx(angles)


@given(st.floats(0.0, 1e4), st.lists(st.floats(-1e4, 1e4), min_size=1, max_size=12))
def test_a_line_is_read_as_it_was_sent(time: float, values: list[float]) -> None:
    found = raw_of(line_of(Raw(time, tuple(values))), len(values))
    assert found is not None
    assert (found.time, *found.values) == pytest.approx((time, *values), rel=1e-8)


@given(st.binary(max_size=80))
def test_what_is_no_line_is_left_out(line: bytes) -> None:
    found = raw_of(line, 3)
    assert found is None or all(map(math.isfinite, found.values))


def test_older_samples_and_other_lines_are_left_out() -> None:
    port = free_port()
    samples = JointSamples(JointSensor(source="imu", stream=f"udp:{port}"))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for line in (b"1.0 10.0", b"nonsense", b"2.0 nan", b"1.5, 20.0", b"1.2 30.0", b"1.6 1.0 2.0"):
            sender.sendto(line, ("127.0.0.1", port))
    assert samples.look() == pytest.approx(math.radians(20.0))
    assert math.isnan(samples.look())
    samples.close()


def test_a_sender_whose_clock_is_set_back_is_heard_once_the_newer_one_is_silent(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A new start, or one time far ahead, is no silence for ever; a second sender beside the first is none."""
    time = [0]
    monkeypatch.setattr(joint_stream, "MonotonicClock", lambda: SimpleNamespace(now=lambda: time[0]))
    port = free_port()
    samples = JointSamples(JointSensor(source="imu", stream=f"udp:{port}"))
    heard = []
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for seconds, line in ((0.0, b"1e9 20.0"), (0.5, b"5.1 30.0"), (1.5, b"5.2 40.0"), (1.6, b"5.3 50.0")):
            time[0] = round(seconds * SECOND)
            sender.sendto(line, ("127.0.0.1", port))
            heard.append(math.degrees(samples.look()))
    assert heard == pytest.approx([20.0, math.nan, 40.0, 50.0], nan_ok=True)
    samples.close()


def test_an_address_of_another_computer_is_refused_with_what_to_write() -> None:
    with pytest.raises(StreamError, match=r"192\.0\.2\.1.*0\.0\.0\.0"):
        JointSamples(JointSensor(source="imu", stream="udp:192.0.2.1:5005"))


def test_lines_of_a_serial_port_are_put_together_from_pieces() -> None:
    """What comes in halves is one sample; what is no line, or older, is none."""
    pytest.importorskip("serial")
    host, line = os.openpty()
    tty.setraw(line)
    samples = JointSamples(JointSensor(source="imu", stream=f"serial:{os.ttyname(line)}"))
    pieces = ((b"1.0 10", math.nan), (b".0\n", 10.0), (b"ready\n1.5, 20.0\r\n1.4 30.0\n1.6", 20.0), (b" 40\n", 40.0))
    for piece, angle in pieces:
        os.write(host, piece)
        assert samples.look() == pytest.approx(math.radians(angle), nan_ok=True)
    samples.close()
    os.close(host)
    os.close(line)


@pytest.mark.parametrize("bodies", [1, 2])
def test_frames_of_a_can_bus_are_the_orientations_of_bodies(bodies: int, tmp_path: Path) -> None:
    """Of two bodies a sample is whole with both frames; other identifiers and lengths are none."""
    stream, axis = f"can:{tmp_path}@0x321", (0.0, 1.0, 0.0)
    with UnixBus(str(tmp_path), create=True) as device:
        samples = JointSamples(JointSensor("imu", stream, "quaternion", bodies=bodies, axis=axis))
        for angle in (0.3, -0.6):
            posed = [turn(axis, 0.2), turn(axis, 0.2 + angle)] if bodies == 2 else [turn(axis, angle)]
            frames = [struct.pack("<4h", *(round(32767 * one) for one in body)) for body in posed]
            device.put(0x320, frames[0])
            device.put(0x321, frames[0][:6])
            for i, frame in enumerate(frames):
                assert math.isnan(samples.look())
                device.put(0x321 + i, frame)
            assert samples.look() == pytest.approx(angle, abs=2e-4)
        samples.close()


@pytest.mark.parametrize("lost", [0, 1])
def test_of_a_sample_with_a_lost_frame_nothing_goes_into_the_next(lost: int, tmp_path: Path) -> None:
    axis = (0.0, 1.0, 0.0)
    with UnixBus(str(tmp_path), create=True) as device:
        samples = JointSamples(JointSensor("imu", f"can:{tmp_path}@0x321", "quaternion", bodies=2, axis=axis))
        for moved in (0.0, 0.5):
            for i, angle in enumerate((moved, moved + 0.3)):
                if moved or i != lost:
                    device.put(0x321 + i, struct.pack("<4h", *(round(32767 * one) for one in turn(axis, angle))))
        assert samples.look() == pytest.approx(0.3, abs=2e-4)
        samples.close()


def test_a_frame_of_a_stretch_sensor_is_a_float(tmp_path: Path) -> None:
    sensor = JointSensor("stretch", f"can:{tmp_path}@0x18FF0021", curve_values=(0.0, 2.0), curve_angles=(0.0, 1.0))
    with UnixBus(str(tmp_path), create=True) as device:
        samples = JointSamples(sensor)
        for value, angle in ((1.5, 0.75), (math.nan, math.nan)):
            device.put(EXTENDED | 0x18FF0021, struct.pack("<f", value))
            assert samples.look() == pytest.approx(angle, nan_ok=True)
        samples.close()


def test_a_can_bus_that_is_not_there_is_refused() -> None:
    with pytest.raises(StreamError, match="bus no0"):
        JointSamples(JointSensor(source="imu", stream="can:no0@0x321"))


@pytest.mark.parametrize("stream", ["udp:5005", "serial:/dev/ttyACM9", "can:can0@0x321", "lsl:IMU"])
def test_a_twin_s_sensor_is_heard_beside_its_own_drive_alone(stream: str, tmp_path: Path) -> None:
    """On another bus, and on the same one; whatever the stream is."""
    sensor, twins, heard = JointSensor(source="imu", stream=stream, noise=1e-3, delay=0.0), [], []
    for bus, node, angle in (("one", 1, 0.2), ("two", 1, 0.9), ("two", 2, 0.5)):
        rig = Rig(joint_sensor=sensor, drive={"node_id": node}).on_bus(str(tmp_path / bus), "bowden_unix")
        (tmp_path / bus).mkdir(exist_ok=True)
        own = of_twin(rig.joint_sensor, rig.drive)
        twins.append(JointSensorTwin(own, lambda angle=angle: angle, Faults(), 0))  # type: ignore[misc]
        heard.append(JointSamples(own))
    for twin in twins:
        twin.tick(1.0)
    assert [one.look() for one in heard] == pytest.approx([0.2, 0.9, 0.5], abs=1e-2)
    for one in (*twins, *heard):
        one.close()


@pytest.mark.parametrize("stream", ["serial:/dev/null/none", "serial:/no/such/port@9600"])
def test_a_serial_port_that_is_not_there_is_refused(stream: str) -> None:
    pytest.importorskip("serial")
    with pytest.raises(StreamError, match=r"cannot be opened.*dialout"):
        JointSamples(JointSensor(source="imu", stream=stream))


def test_a_port_that_is_taken_is_refused() -> None:
    port = free_port()
    samples = JointSamples(JointSensor(source="imu", stream=f"udp:{port}"))
    with pytest.raises(StreamError, match="cannot be listened to"):
        JointSamples(JointSensor(source="imu", stream=f"udp:{port}"))
    samples.close()


def test_a_second_sender_at_a_port_is_not_heard_beside_the_first() -> None:
    """Of one computer too, as the twin of another run is."""
    port = free_port()
    samples = JointSamples(JointSensor(source="imu", stream=f"udp:{port}"))
    with (
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as first,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as second,
    ):
        for k, (sender, angle) in enumerate(((first, 10.0), (second, 60.0), (first, 11.0))):
            sender.sendto(line_of(Raw(1.0 + k, (angle,))), ("127.0.0.1", port))
            assert samples.look() == pytest.approx(math.nan if sender is second else math.radians(angle), nan_ok=True)
    samples.close()


def test_rates_that_no_body_has_are_left_out() -> None:
    pytest.importorskip("imufusion")
    port = free_port()
    samples = JointSamples(JointSensor(source="imu", stream=f"udp:{port}", gives="inertial", axis=(1.0, 0.0, 0.0)))
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for k, rate in enumerate((0.0, 1e30, 0.0)):
            sender.sendto(line_of(Raw(0.01 * k, (rate, 0.0, 0.0, 0.0, 0.0, 1.0))), ("127.0.0.1", port))
            assert math.isnan(samples.look()) is (rate > 0.0)
    samples.close()


def test_rates_and_accelerations_become_an_orientation() -> None:
    """A body that turns at 30°/s about a level axis for a second has turned by 30°."""
    pytest.importorskip("imufusion")
    port, rate = free_port(), 30.0
    sensor = JointSensor(source="imu", stream=f"udp:{port}", gives="inertial", axis=(1.0, 0.0, 0.0))
    samples, angle = JointSamples(sensor), math.nan
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for k in range(600):
            turned = math.radians(rate * max(0.0, 0.01 * (k - 500)))
            values = (rate if k > 500 else 0.0, 0.0, 0.0, 0.0, math.sin(turned), math.cos(turned))
            sender.sendto(line_of(Raw(0.01 * k, values)), ("127.0.0.1", port))
            angle = samples.look()
    samples.close()
    assert math.degrees(angle) == pytest.approx(29.7, abs=1.5)


def written(folder: Path, **given: Any) -> Path:
    """A rig with a joint's sensor that sends to a free port."""
    given = given if given["source"] == "motor" else {"stream": f"udp:{free_port()}", **given}
    Rig(law="bowden", joint_sensor=given, limits=SHARED_LIMITS).write(folder / "rig.toml")
    return folder / "rig.toml"


@pytest.mark.live
@pytest.mark.parametrize(
    "given",
    [
        {"source": "motor"},
        {"source": "imu"},
        {"source": "imu", "stream": "serial:/dev/ttyACM9"},
        {"source": "imu", "gives": "quaternion", "bodies": 2, "axis": (0.0, 1.0, 0.0)},
        {"source": "stretch", "curve_values": (900.0, 100.0), "curve_angles": (0.0, 1.5)},
    ],
    ids=["motor", "imu", "serial", "two bodies", "stretch"],
)
def test_a_run_on_the_twin_by_an_estimate(given: dict[str, Any], tmp_path: Path) -> None:
    """The joint is where it should be within a degree, and the log has what the sensor said."""
    found = finished_well(written(tmp_path, **given), tmp_path, "--twin", "--duration", "3")
    assert found["rmse_deg"] < 1.0
    assert_replays(found["log"])
    log = read(Path(found["log"]))
    came = np.isfinite(log["joint_sensor"])
    assert came.any() != (given["source"] == "motor")
    assert np.abs(log["joint_sensor"] - log["joint"])[came].max(initial=0.0) < 12.0 * RADIANS
    assert log["joint_std"][log["source"] == TargetSource.LAW].max() < 5.0 * RADIANS


@pytest.mark.live
def test_a_sensor_that_stops_releases(tmp_path: Path) -> None:
    """Within a second of its last value, by the limit of the standard deviation."""
    rig = written(tmp_path, source="imu")
    for number in tries():
        with running_twin(rig, tmp_path / f"b{number}") as twin:
            process = started(rig, tmp_path / f"out{number}", "--channel", twin.channel, "--duration", "30")
            deadline, moved = time.monotonic() + 60.0, False
            while process.poll() is None and not moved and time.monotonic() < deadline:
                moved = twin.control.status()["joint"] > 20.0 * RADIANS
                time.sleep(0.02)
            twin.control.inject("joint_silence")
            found = finished(process)
        if Fault.JOINT_UNSURE.meaning in found["faults"]:
            break
    assert Fault.JOINT_UNSURE.meaning in found["faults"], json.dumps(found)
    assert_replays(found["log"])
    log = read(Path(found["log"]))
    last, led = np.flatnonzero(np.isfinite(log["joint_sensor"]))[-1], np.flatnonzero(log["source"] == TargetSource.LAW)
    assert 0.3 < log["time"][led[-1]] - log["time"][last] < 1.0
