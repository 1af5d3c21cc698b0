"""The estimate of the joint's angle in a live run: it stands between the drive's reading and all that go by it."""

import math

from bowden.core.kernel import compiled
from bowden.core.signals import DriveReading
from bowden.hardware.joint_stream import JointSamples
from bowden.rig.rig import Rig
from bowden.sensing.joint_angle import JointEstimate, estimate_start, estimate_step

MOST_MISSED = 100
"""Cycles that one step makes up for at most."""


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
        self._samples = JointSamples(rig.joint_sensor) if rig.joint_sensor.sensed else None

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
        if self._state is None and math.isfinite(reading.motor):
            self._state = estimate_start(self._model, reading.motor)
        if self._state is None:
            return reading._replace(joint=math.nan, joint_age=reading.motor_age)
        missed = 1 if math.isnan(self._read) else max(1, min(MOST_MISSED, round((now - self._read) / self._period)))
        self._read = now
        for _ in range(missed - 1):
            self._state = self._step(self._model, self._state, reading.motor, math.nan, self._period)
        self._state = estimate = self._step(self._model, self._state, reading.motor, value, self._period)
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
