"""The twin of a joint's sensor that is no encoder: what it sends, and when, of the plant behind a drive's twin.

It samples once a period, and sends a sample when it is as old as [joint_sensor] says, with noise, a systematic error
and a drift as in simulation. With the fault ``joint_silence`` nothing is sent, with ``encoder_offset joint`` it lies.
"""

import contextlib
import math
import os
import socket
import tty
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from bowden.hardware.emg.lsl_info import library
from bowden.hardware.joint_stream import Raw, line_of
from bowden.hardware.twin.faults import Faults
from bowden.plants.estimated import BENDS
from bowden.rig.joint_sensor import address_of
from bowden.rig.settings import JointSensor
from bowden.sensing.joint_sample import Quaternion, numbers_in, on_curve


def serial_line(port: Path) -> tuple[Callable[[Raw], None], Callable[[], None]]:
    """How to send over a pseudo terminal to which `port` is a link, and how to take it away."""
    host, line = os.openpty()
    tty.setraw(line)
    os.set_blocking(host, False)
    port.unlink(missing_ok=True)
    port.symlink_to(os.ttyname(line))

    def send(raw: Raw) -> None:
        with contextlib.suppress(BlockingIOError):  # nobody reads
            os.write(host, line_of(raw))

    def close() -> None:
        port.unlink(missing_ok=True)
        os.close(host)
        os.close(line)

    return send, close


class JointSensorTwin:
    """The device.

    Args:
        sensor: as the rig has it.
        joint: what it measures [rad].
        faults: those of the drive's twin, of which those of the joint are its own.
        seed: of its noise.

    Raises:
        StreamError: liblsl is not there.
    """

    def __init__(self, sensor: JointSensor, joint: Callable[[], float], faults: Faults, seed: int) -> None:
        self._sensor, self._joint, self._faults = sensor, joint, faults
        self._random = np.random.default_rng(seed)
        self._wrong = sensor.offset * self._random.standard_normal(2)
        self._drift = math.copysign(sensor.drift if sensor.source == "imu" else 0.0, self._random.standard_normal())
        self._coming: deque[tuple[float, Raw]] = deque()
        self._began, self._next = math.nan, -math.inf
        self._send, self.close = self._opened()

    def _opened(self) -> tuple[Callable[[Raw], None], Callable[[], None]]:
        kind, where = address_of(self._sensor)
        if kind == "lsl":
            lsl, sensor = library(), self._sensor
            count = numbers_in(sensor.source, sensor.gives, sensor.bodies)
            info = lsl.StreamInfo(where[0], "joint", count, 1.0 / sensor.period, "double64", "bowden twin")
            outlet: Any = lsl.StreamOutlet(info)
            return lambda raw: outlet.push_sample(list(raw.values)), lambda: None
        host, port = where
        if kind == "serial":
            return serial_line(Path(host))
        to = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        to.setblocking(False)

        def send(raw: Raw) -> None:
            try:
                to.sendto(line_of(raw), ("127.0.0.1" if host == "0.0.0.0" else host, port))
            except OSError:  # nobody listens yet
                return

        return send, to.close

    def tick(self, now: float) -> None:
        """Let time pass: sample, and send what is old enough."""
        sensor = self._sensor
        if now >= self._next:
            self._began = now if math.isnan(self._began) else self._began
            self._next = max(self._next + sensor.period, now)
            self._coming.append((now + sensor.delay, Raw(now, self._values(now))))
        while self._coming and self._coming[0][0] <= now:
            raw = self._coming.popleft()[1]
            if not self._faults.active("joint_silence", now):
                self._send(raw)

    def _values(self, now: float) -> tuple[float, ...]:
        """What it sends of the joint's angle."""
        sensor, true = self._sensor, self._joint()
        angle = true + sensor.noise * self._random.standard_normal() + self._drift * (now - self._began)
        angle += float(self._wrong @ (math.cos(BENDS * true), math.sin(BENDS * true)))
        angle = self._faults.encoder("joint", angle, 1.0, now)
        if sensor.source == "stretch":
            return (on_curve(angle, sensor.curve_angles, sensor.curve_values),)
        if sensor.gives == "angle":
            return (math.degrees(angle),)
        about = (math.sin(0.5 * angle) * one for one in sensor.axis)
        turned = Quaternion(math.cos(0.5 * angle), *about).times(Quaternion(*sensor.zero))
        return turned if sensor.bodies == 1 else (1.0, 0.0, 0.0, 0.0, *turned)
