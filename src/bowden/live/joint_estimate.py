"""The estimate of the joint's angle in a live run: it stands between the drive's reading and all that go by it."""

import math
import statistics
from collections import deque

from bowden.core.kernel import compiled
from bowden.core.signals import DriveReading
from bowden.hardware.joint_stream import JointSamples, of_twin
from bowden.rig.joint_sensor import motor_reach
from bowden.rig.rig import Rig
from bowden.rig.settings import JointSensor
from bowden.sensing.joint_angle import LATE, track_start, track_step

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
        self._model, self._reach, self._period = rig.joint_model, motor_reach(rig.supervisor_limits), rig.sample_time
        self._step, self._state = compiled(track_step), track_start(self._model)
        self._step(self._model, self._reach, self._state, 0.0, 0.0, 0.0, 0.0, self._period)
        self._read = math.nan
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
        elapsed = 0.0 if math.isnan(self._read) else now - self._read
        self._read, known = now, (self._model, self._reach)
        self._state = self._step(*known, self._state, reading.motor, reading.motor_age, value, elapsed, self._period)
        estimate = self._state.estimate
        if math.isnan(estimate.angle):
            return reading._replace(joint=math.nan, joint_age=reading.motor_age)
        return reading._replace(
            joint=estimate.angle,
            joint_age=reading.motor_age,
            joint_sensor_age=estimate.age,
            joint_std=estimate.std,
            joint_sensor=value,
        )

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
