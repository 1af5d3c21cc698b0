"""The estimate of the joint's angle in a live run: it stands between the drive's reading and all that go by it."""

import math
import statistics
from collections import deque

from bowden.core.kernel import compiled
from bowden.core.signals import DriveReading
from bowden.hardware.joint_stream import JointSamples, of_twin
from bowden.rig.rig import Rig
from bowden.rig.settings import JointSensor
from bowden.sensing.joint_angle import LATE, JointEstimate, estimate_start, estimate_step

MOST_MISSED = 100
"""Cycles that one step makes up for at most."""
RESTING = 1.0
"""Over which a joint that is held still is read by its sensor [s]."""


class LiveEstimate:
    """Of one joint; it is compiled when it is made.

    Args:
        rig: of the motor, whose joint has no encoder.

    Raises:
        StreamError: the sensor's stream cannot be opened.
        MissingExtraError: see `JointSamples`.
    """

    def __init__(self, rig: Rig) -> None:
        self._model, self._period = rig.joint_model, rig.sample_time
        self._step = compiled(estimate_step)
        self._step(self._model, estimate_start(self._model, 0.0), 0.0, 0.0, self._period)
        self._state: JointEstimate | None = None
        self._read = math.nan
        limits = rig.supervisor_limits
        self._speed, self._jump, self._span = limits.motor_speed, limits.jump, limits.sensor_span
        self._motor, self._motor_time, self._suspect = math.nan, 0.0, math.nan
        sensor = of_twin(rig.joint_sensor, rig.drive)
        self._samples = JointSamples(sensor) if sensor.sensed else None

    def wait(self) -> None:
        """Wait for the sensor's first sample.

        Raises:
            StreamError: none comes.
        """
        if self._samples is not None:
            self._samples.wait()

    def shown(self, reading: DriveReading, now: float) -> DriveReading:
        """The drive's reading at `now` [s] with the estimate in place of the joint's angle; as old as the motor's."""
        value = math.nan if self._samples is None else self._samples.look()
        motor = self._credible(reading, now)
        if self._state is None and math.isfinite(motor):
            self._state = estimate_start(self._model, motor)
        if self._state is None:
            return reading._replace(joint=math.nan, joint_age=reading.motor_age)
        missed = 1 if math.isnan(self._read) else max(1, min(MOST_MISSED, round((now - self._read) / self._period)))
        self._read = now
        for _ in range(missed - 1):
            self._state = self._step(self._model, self._state, motor, math.nan, self._period)
        self._state = estimate = self._step(self._model, self._state, motor, value, self._period)
        return reading._replace(
            joint=estimate.angle,
            joint_age=reading.motor_age,
            joint_sensor_age=estimate.age,
            joint_std=estimate.std,
            joint_sensor=value,
        )

    def _credible(self, reading: DriveReading, now: float) -> float:
        """The motor's angle; NaN of one that no motor can have reached: it would move the joint's estimate with it.

        A second one beside it is believed: the first of all may have been the spike.
        """
        motor, suspect = reading.motor, self._suspect
        if not abs(motor) <= self._span:
            return math.nan
        self._suspect = math.nan
        far = abs(motor - self._motor) > self._jump + self._speed * (now - self._motor_time)
        if far and not abs(motor - suspect) <= self._jump + self._speed * self._period:
            self._suspect = motor
            return math.nan
        if reading.motor_age == 0.0:
            self._motor, self._motor_time = motor, now
        return motor

    def close(self) -> None:
        """Leave the sensor's stream."""
        if self._samples is not None:
            self._samples.close()


class RestingSensor:
    """A joint's sensor beside a drive's reading while somebody holds the joint still.

    Args:
        sensor: of the rig, with a stream.
        period: of a cycle [s].

    Raises:
        StreamError: its stream cannot be opened, or nothing comes.
        MissingExtraError: see `JointSamples`.
    """

    def __init__(self, sensor: JointSensor, period: float) -> None:
        self._samples = JointSamples(sensor)
        try:
            self._values = deque([self._samples.wait()], maxlen=max(1, round(RESTING / sensor.period)))
        except BaseException:
            self._samples.close()
            raise
        self._silent, self._late = 0, LATE * sensor.period / period

    def shown(self, reading: DriveReading) -> DriveReading:
        """The reading with the median of the sensor's last second as the joint's angle; none while it is silent."""
        value = self._samples.look()
        if math.isfinite(value):
            self._values.append(value)
            self._silent = 0
        else:
            self._silent += 1
        there = self._silent <= self._late
        return reading._replace(joint=statistics.median(self._values) if there else math.nan, joint_age=0.0)

    def close(self) -> None:
        """Leave the sensor's stream."""
        self._samples.close()
