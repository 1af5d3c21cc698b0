"""The twin of a joint's sensor that is no encoder: what it sends, and when, of the plant behind a drive's twin.

It samples once a period, and sends a sample when it is as old as [joint_sensor] says, with noise, a systematic error
and a drift as in simulation. With the fault ``joint_silence`` nothing is sent, with ``encoder_offset joint`` it lies.
"""

import contextlib
import math
import socket
from collections import deque
from collections.abc import Callable
from typing import Any

import numpy as np

from bowden.core.errors import StreamError
from bowden.hardware.joint_stream import Raw, line_of
from bowden.hardware.twin.faults import Faults
from bowden.plants.estimated import BENDS
from bowden.rig.joint_sensor import address_of
from bowden.rig.settings import JointSensor
from bowden.sensing.joint_sample import Quaternion, on_curve


class JointSensorTwin:
    """The device.

    Args:
        sensor: as the rig has it.
        joint: what it measures [rad].
        faults: those of the drive's twin, of which those of the joint are its own.
        seed: of its noise.

    Raises:
        StreamError: a stream that a twin on such a bus has not.
    """

    def __init__(self, sensor: JointSensor, joint: Callable[[], float], faults: Faults, seed: int) -> None:
        self._sensor, self._joint, self._faults = sensor, joint, faults
        self._random = np.random.default_rng(seed)
        self._wrong = sensor.offset * self._random.standard_normal(2)
        self._drift = math.copysign(sensor.drift if sensor.source == "imu" else 0.0, self._random.standard_normal())
        self._coming: deque[tuple[float, Raw]] = deque()
        self._began, self._next = math.nan, -math.inf
        kind, (host, port) = address_of(sensor)
        if kind not in ("udp", "twin"):
            raise StreamError(
                f"a twin on a CAN interface plays no sensor by {sensor.stream}",
                expected="joint_sensor.stream by udp, or the interface bowden_unix",
                do="choose one of them",
            )
        self._to: Any = (host if host != "0.0.0.0" else "127.0.0.1", port) if port else host
        self._socket = socket.socket(socket.AF_INET if port else socket.AF_UNIX, socket.SOCK_DGRAM)
        self._socket.setblocking(False)

    def close(self) -> None:
        """Send no more."""
        self._socket.close()

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
                with contextlib.suppress(OSError):  # nobody listens yet
                    self._socket.sendto(line_of(raw), self._to)

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
