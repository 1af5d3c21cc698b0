"""Samples of a joint's sensor: lines of text by UDP or a serial line, CAN frames, or from the Lab Streaming Layer.

    time v₁ … vₙ

numbers apart by blanks or commas: when the sample was taken, by the sender's own clock [s], and what the sensor gives
(docs/drives.md). What is no such line, comes from another sender while the first one is heard, or is older than the
last one is left out; after a second of silence another sender, or a clock that is set back, is followed. A frame has
the values alone: one as a float, a quaternion as four int16 of 1/32767, low bytes first, of a second body with the next
identifier. Nothing here waits once it is open.
"""

import contextlib
import errno
import math
import socket
import struct
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple, Protocol

import can

from bowden.core.clock import SECOND, MonotonicClock, TimeSource
from bowden.core.errors import DriveError, StreamError
from bowden.core.extras import extra_module
from bowden.hardware.buses.opening import UNIX, open_bus, received
from bowden.hardware.buses.place import EXTENDED, BusPlace
from bowden.hardware.buses.unix_bus import bus_folder
from bowden.hardware.emg.lsl_info import library
from bowden.rig.families import family_of
from bowden.rig.joint_sensor import address_of
from bowden.rig.settings import JointSensor
from bowden.sensing.joint_sample import (
    Quaternion,
    angle_about,
    between,
    in_degrees,
    numbers_in,
    on_curve,
    orientation,
)

MOST = 64
"""Samples taken in one look."""
SET_BACK = 1.0
"""Beyond which an older time is no datagram that was overtaken, but a sender that was started again; and how long its
clock before must have been silent then: else there are two senders [s]."""
MOST_MEASURED = 1e5
"""Rate [°/s] or acceleration [g] beyond which there is none."""
LONGEST = 1024
"""Of a datagram [bytes]."""
WAIT = 5.0
"""How long the first sample is waited for [s]."""
FRAMES = {1: struct.Struct("<f"), 4: struct.Struct("<4h"), 8: struct.Struct("<4h")}
"""Numbers of a sample → a frame of it."""
INT16 = 32767.0
"""Count that is 1 in a quaternion's frame."""


class Raw(NamedTuple):
    """One sample as it was sent."""

    time: float
    """By the sender's clock [s]."""
    values: tuple[float, ...]


def line_of(raw: Raw) -> bytes:
    """A sample as it is sent."""
    return (" ".join(f"{one:.9g}" for one in (raw.time, *raw.values)) + "\n").encode()


def raw_of(line: bytes, numbers: int) -> Raw | None:
    """The sample of a line; None of what is none."""
    try:
        time, *values = map(float, line.decode("ascii").replace(",", " ").split())
    except ValueError:
        return None
    if len(values) != numbers or not all(map(math.isfinite, (time, *values))):
        return None
    return Raw(time, tuple(values))


def _seconds() -> float:
    return MonotonicClock().now() / SECOND


class _Newer:
    """Lets the samples pass that are newer than the last one."""

    def __init__(self) -> None:
        self._last, self._came = -math.inf, -math.inf

    @property
    def silent(self) -> bool:
        """True before the first sample, and so long after the last one that another sender may begin."""
        return _seconds() - self._came > SET_BACK

    def accept(self, found: Iterable[Raw | None]) -> list[Raw]:
        """Those of them that are."""
        newer = []
        for raw in found:
            if raw is not None and (raw.time > self._last or (raw.time <= self._last - SET_BACK and self.silent)):
                self._last, self._came = raw.time, _seconds()
                newer.append(raw)
        return newer


class _Stream(Protocol):
    def look(self) -> list[Raw]:
        """What has come since the last look."""

    def close(self) -> None:
        """Leave it."""


class Datagrams:
    """Datagrams at a UDP port; without one, at the path of a twin's.

    Raises:
        StreamError: the port cannot be used.
    """

    def __init__(self, host: str, port: int, numbers: int) -> None:
        self._numbers, self._newer = numbers, _Newer()
        self._sender: Any = None
        self._path = None if port else Path(host)
        self._socket = socket.socket(socket.AF_INET if port else socket.AF_UNIX, socket.SOCK_DGRAM)
        try:
            if self._path is not None:
                self._path.unlink(missing_ok=True)  # of a run that was killed
            self._socket.bind((host, port) if port else host)
        except OSError as error:
            self._socket.close()
            taken = error.errno == errno.EADDRINUSE
            raise StreamError(
                f"udp:{host}:{port} cannot be listened to: {error.strerror or error}",
                expected="a free port of this computer" if taken else "an address of this computer, or 0.0.0.0 for all",
                do="end the other program there, or choose another port in [joint_sensor]"
                if taken
                else "correct joint_sensor.stream",
            ) from None
        self._socket.setblocking(False)

    def look(self) -> list[Raw]:
        """What has come since the last look."""
        found: list[Raw | None] = []
        for _ in range(MOST):
            try:
                line, sender = self._socket.recvfrom(LONGEST)
            except OSError:  # nothing is there
                break
            raw = raw_of(line, self._numbers)
            if raw is not None and self._newer.silent:
                self._sender = sender
            found += [raw] if sender == self._sender else []
        return self._newer.accept(found)

    def close(self) -> None:
        """Leave the port."""
        self._socket.close()
        if self._path is not None:
            self._path.unlink(missing_ok=True)


class SerialLines:
    """Lines of text from a serial port, as of a microcontroller at the sensor.

    Raises:
        StreamError: the port cannot be used.
        MissingExtraError: without pyserial.
    """

    def __init__(self, device: str, baud: int, numbers: int) -> None:
        serial = extra_module("serial", "serial", f"joint_sensor.stream = 'serial:{device}'")
        self._numbers, self._begun, self._newer = numbers, b"", _Newer()
        try:
            self._port = serial.Serial(device, baud, timeout=0, exclusive=True)
        except (OSError, ValueError) as error:
            raise StreamError(
                f"serial:{device}@{baud} cannot be opened: {str(error).partition('] ')[2] or error}",
                do="look at joint_sensor.stream and the cable, be in the group dialout, end the other program there",
            ) from None

    def look(self) -> list[Raw]:
        """What has come since the last look."""
        with contextlib.suppress(OSError):  # unplugged: the silence shows
            self._begun += self._port.read(MOST * LONGEST)
        *lines, begun = self._begun.split(b"\n")
        self._begun = begun[-LONGEST:]
        return self._newer.accept(raw_of(line, self._numbers) for line in lines[-MOST:])

    def close(self) -> None:
        """Leave the port."""
        self._port.close()


class CanFrames:
    """Frames of a device at a CAN bus, which others read too.

    Raises:
        StreamError: the bus cannot be used.
    """

    def __init__(self, channel: str, identifier: int, numbers: int) -> None:
        self._frame, bodies = FRAMES[numbers], max(1, numbers // 4)
        self._at = {
            one | (EXTENDED if one > 0x7FF else 0): i for i, one in enumerate(range(identifier, identifier + bodies))
        }
        self._parts: dict[int, tuple[float, ...]] = {}
        try:
            self._bus = open_bus(BusPlace(UNIX if "/" in channel else "socketcan", channel, 0))
        except DriveError as error:
            raise StreamError(error.what, do="see to the bus, or correct joint_sensor.stream") from None
        self._bus.set_filters([{"can_id": one & ~EXTENDED, "can_mask": 0x1FFF_FFFF} for one in self._at])

    def look(self) -> list[Raw]:
        """What has come since the last look."""
        found = []
        with contextlib.suppress(can.CanError, OSError):  # unplugged: the silence shows
            for _ in range(MOST):
                frame = received(self._bus, 0.0)
                if frame is None:
                    break
                place = self._at.get(frame[0])
                if place is not None and len(frame[1]) == self._frame.size:
                    if place == 0:  # what is left is of a sample whose other frame was lost
                        self._parts = {}
                    self._parts[place] = self._frame.unpack(frame[1])
                    if len(self._parts) == len(self._at):
                        values = [one for _, part in sorted(self._parts.items()) for one in part]
                        self._parts = {}
                        scale = 1.0 if self._frame.size == 4 else INT16
                        found.append(Raw(_seconds(), tuple(one / scale for one in values)))
        return [one for one in found if all(map(math.isfinite, one.values))]

    def close(self) -> None:
        """Leave the bus."""
        self._bus.shutdown()


class LslSamples:
    """A stream of the Lab Streaming Layer, whose channels are the line's values.

    Raises:
        StreamError: there is no such stream, or it has another number of channels.
    """

    def __init__(self, name: str, numbers: int) -> None:
        lsl = library()
        found = lsl.resolve_byprop("name", name, 1, WAIT)
        if not found:
            raise StreamError(f"there is no LSL stream {name!r}", do="start its sender, or correct joint_sensor.stream")
        if found[0].channel_count() != numbers:
            raise StreamError(
                f"the LSL stream {name!r} has {found[0].channel_count()} channels",
                expected=f"{numbers}, by [joint_sensor]",
                do="correct source, gives or bodies there",
            )
        self._inlet: Any = lsl.StreamInlet(found[0], max_buflen=1)
        self._newer = _Newer()

    def look(self) -> list[Raw]:
        """What has come since the last look."""
        values, times = self._inlet.pull_chunk(timeout=0.0, max_samples=MOST)
        found = [Raw(time, tuple(row)) for time, row in zip(times, values, strict=True)]
        return self._newer.accept(one for one in found if all(map(math.isfinite, one.values)))

    def close(self) -> None:
        """Leave the stream."""
        with contextlib.suppress(RuntimeError):
            self._inlet.close_stream()


def of_twin(sensor: JointSensor, drive: Any) -> JointSensor:
    """The sensor beside a drive: a twin's sends within the folder of its bus, where no other twin is heard."""
    family = family_of(drive)
    if not (sensor.sensed and family.simulated(drive)):
        return sensor
    place = family.address(drive)
    return sensor._replace(stream=f"twin:{bus_folder(place['channel']) / 'joint'}-{place['node']}")


_STREAMS: dict[str, Callable[[str, int, int], _Stream]] = {
    "udp": Datagrams,
    "twin": Datagrams,
    "serial": SerialLines,
    "can": CanFrames,
    "lsl": lambda name, _, numbers: LslSamples(name, numbers),
}


class JointSamples:
    """Angles of a joint by its sensor.

    Args:
        sensor: of the rig, with a stream.

    Raises:
        StreamError: the stream cannot be opened.
        MissingExtraError: samples of rates and accelerations, without imufusion.
    """

    def __init__(self, sensor: JointSensor) -> None:
        self._sensor = sensor
        numbers = numbers_in(sensor.source, sensor.gives, sensor.bodies)
        self._fused: list[Any] = []
        if sensor.source == "imu" and sensor.gives == "inertial":
            fusion = extra_module("imufusion", "imu", 'joint_sensor.gives = "inertial"')
            self._fused = [fusion.Ahrs() for _ in range(sensor.bodies)]
        self._before = math.nan
        kind, where = address_of(sensor)
        self._stream = _STREAMS[kind](*where, numbers)

    def look(self) -> float:
        """The newest angle that has come since the last look; NaN where none has [rad]."""
        angle = math.nan
        for raw in self._stream.look():
            angle = self._angle(raw)
        return angle

    def raw(self) -> list[Sequence[float]]:
        """What has come since the last look, for a calibration: a reading, or the orientation of `between`."""
        return [self._oriented(one) if self._sensor.source == "imu" else one.values for one in self._stream.look()]

    def wait(self, clock: TimeSource | None = None) -> float:
        """Wait for the first sample: its angle [rad].

        Raises:
            StreamError: none comes.
        """
        time = MonotonicClock() if clock is None else clock
        end = time.now() + round(WAIT * SECOND)
        while math.isnan(angle := self.look()):
            if time.now() > end:
                raise StreamError(
                    f"no sample of the joint's sensor has come by {self._sensor.stream} within {WAIT:g} s",
                    expected="its time and its values, as docs/drives.md has them",
                    do="look at the sensor, its program and [joint_sensor]",
                )
            time.sleep_until(time.now() + SECOND // 200)
        return angle

    def close(self) -> None:
        """Leave the stream."""
        self._stream.close()

    def _angle(self, raw: Raw) -> float:
        sensor = self._sensor
        if sensor.source == "stretch":
            return on_curve(raw.values[0], sensor.curve_values, sensor.curve_angles)
        if sensor.gives == "angle":
            return in_degrees(raw.values[0])
        return angle_about(self._oriented(raw), sensor.zero, sensor.axis)

    def _oriented(self, raw: Raw) -> Quaternion:
        if not self._fused:
            return between([orientation(raw.values[i : i + 4]) for i in range(0, len(raw.values), 4)])
        import numpy as np

        if max(map(abs, raw.values)) > MOST_MEASURED:
            return Quaternion(math.nan, math.nan, math.nan, math.nan)
        elapsed, self._before = raw.time - self._before, raw.time
        for i, one in enumerate(self._fused):
            rates, pull = (np.array(raw.values[6 * i + 3 * k : 6 * i + 3 * k + 3]) for k in (0, 1))
            one.set_sample_period(elapsed if 0.0 < elapsed < 1.0 else self._sensor.period)
            one.update_no_magnetometer(rates, pull)
        return between([orientation(one.get_quaternion()) for one in self._fused])
