"""References: where the joint should be, with exact velocity and acceleration.

Every trajectory here has a formula (a recorded one, the formula of its spline), and is differentiated by hand, not by
differences. Angles in radians, times in seconds.
"""

import math
from dataclasses import asdict, dataclass
from typing import Annotated, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import ParameterError, check_positive
from bowden.core.guesses import answering_fields
from bowden.core.kernel import compiled, floor, kernel
from bowden.core.quantity import Quantity
from bowden.models.minimum_jerk import minimum_jerk, minimum_jerk_over

Array = NDArray[np.float64]


class Trajectory(Protocol):
    """A reference over time."""

    def sample(self, time: Array) -> Array:
        """Position, velocity, acceleration at `time` (n,): (n, 3) [rad, rad/s, rad/s²]."""
        ...

    def describe(self) -> dict[str, Any]:
        """Description of this trajectory, as JSON values."""
        ...


def _minimum_jerk(start: float | Array, end: float | Array, duration: float | Array, time: Array) -> Array:
    """`minimum_jerk_over` as one table, (n, 3)."""
    return np.stack(minimum_jerk_over(start, end, duration, time)).T


def _finite(what: str, **values: float | tuple[float, ...]) -> None:
    for name, value in values.items():
        if not np.isfinite(value).all():
            raise ParameterError(f"{what}: {name} is {value}", expected="finite numbers", do="correct it")


@kernel
def fill_periodic(low: float, high: float, period: float, time: Array, motion: Array) -> None:
    """Fill `motion` (3, n) with a `PeriodicMinimumJerk` at each `time` (n,); most runs have it, for each cycle."""
    half = 0.5 * period
    for k in range(time.size):
        until_top = half - (time[k] - period * floor(time[k] / period))  # below zero on the way back
        shown = minimum_jerk(low, high, half, half - abs(until_top))  # the way back mirrors the way up
        motion[0, k] = shown.position
        motion[1, k] = shown.velocity * math.copysign(1.0, until_top)
        motion[2, k] = shown.acceleration


@answering_fields
@dataclass(frozen=True)
class PeriodicMinimumJerk:
    """Minimum jerk from `low` to `high` in the first half of each period, and back in the second (Fig. 9)."""

    low: Annotated[float, Quantity("lower end", "rad", ge=-720.0, le=720.0)]
    high: Annotated[float, Quantity("upper end", "rad", ge=-720.0, le=720.0)]
    period: Annotated[float, Quantity("there and back", "s", gt=0.0, le=1e5)]

    def __post_init__(self) -> None:
        check_positive("periodic minimum jerk", period=self.period)
        _finite("periodic minimum jerk", low=self.low, high=self.high)

    def sample(self, time: Array) -> Array:
        """See `Trajectory.sample`."""
        motion = np.empty((3, len(time)))
        compiled(fill_periodic)(self.low, self.high, self.period, np.ascontiguousarray(time, dtype=np.float64), motion)
        return motion.T

    def describe(self) -> dict[str, Any]:
        """See `Trajectory.describe`."""
        return {"kind": "periodic_minimum_jerk", **asdict(self)}


@answering_fields
@dataclass(frozen=True)
class PointToPoint:
    """Minimum-jerk motions through way points, with holds where two following ones are equal."""

    times: Annotated[tuple[float, ...], Quantity("when each point is reached, increasing", "s")]
    """(k,)"""
    positions: Annotated[tuple[float, ...], Quantity("joint angle at each", "rad", ge=-720.0, le=720.0)]
    """(k,)"""

    def __post_init__(self) -> None:
        at = np.asarray(self.times)
        if len(at) < 2 or len(at) != len(self.positions) or not np.all(np.diff(at) > 0):
            raise ParameterError(
                f"point to point: times {self.times}, positions {self.positions}",
                expected="two lists of one length (two points or more), times increasing",
            )
        _finite("point to point", times=self.times, positions=self.positions)

    def sample(self, time: Array) -> Array:
        """See `Trajectory.sample`."""
        at, to = np.asarray(self.times), np.asarray(self.positions)
        i = np.clip(np.searchsorted(at, time, side="right") - 1, 0, len(at) - 2)
        return _minimum_jerk(to[i], to[i + 1], at[i + 1] - at[i], time - at[i])

    def describe(self) -> dict[str, Any]:
        """See `Trajectory.describe`."""
        return {"kind": "point_to_point", "times": list(self.times), "positions": list(self.positions)}


@answering_fields
@dataclass(frozen=True)
class Chirp:
    """A sine whose frequency goes linearly from `f0` to `f1` [Hz] in `duration` [s], and then stays there.

        φ = amplitude·sin(2π·(f0·t + (f1 − f0)·t²/(2·duration)))

    The phase is the integral of the frequency. As Eq. 17 prints it, sin(2π·f(t)), it is a tone of constant frequency
    (f1 − f0)/duration (reading 1).
    """

    amplitude: Annotated[float, Quantity("amplitude", "rad", ge=-720.0, le=720.0)]
    f0: Annotated[float, Quantity("frequency at the start", "Hz", key="start_hz", gt=0.0, le=1000.0)]
    f1: Annotated[float, Quantity("frequency after sweep_s", "Hz", key="end_hz", gt=0.0, le=1000.0)]
    duration: Annotated[float, Quantity("how long the sweep takes", "s", key="sweep_s", gt=0.0, le=1e5)]

    def __post_init__(self) -> None:
        check_positive("chirp", duration=self.duration, f0=self.f0, f1=self.f1)
        _finite("chirp", amplitude=self.amplitude)

    def sample(self, time: Array) -> Array:
        """See `Trajectory.sample`."""
        rate = (self.f1 - self.f0) / self.duration
        swept = np.minimum(time, self.duration)
        phase = 2.0 * np.pi * (self.f0 * swept + 0.5 * rate * swept**2 + self.f1 * (time - swept))
        omega, growth = 2.0 * np.pi * (self.f0 + rate * swept), 2.0 * np.pi * rate * (time < self.duration)
        sine, cosine = np.sin(phase), np.cos(phase)
        columns = (sine, omega * cosine, growth * cosine - omega**2 * sine)
        return self.amplitude * np.stack(columns, axis=1)

    def describe(self) -> dict[str, Any]:
        """See `Trajectory.describe`."""
        return {"kind": "chirp", **asdict(self)}


@answering_fields
@dataclass(frozen=True)
class Multisine:
    """A sum of sines about `centre`, scaled to start at rest at the centre over the first `ramp` seconds."""

    frequencies: Annotated[tuple[float, ...], Quantity("frequency of each", "Hz", gt=0.0, le=3600.0, least=1)]
    """(k,)"""
    amplitudes: Annotated[tuple[float, ...], Quantity("amplitude of each", "rad", ge=-720.0, le=720.0, least=1)]
    """(k,)"""
    phases: Annotated[tuple[float, ...], Quantity("phase of each", "rad", ge=-720.0, le=720.0, least=1)]
    """(k,)"""
    centre: Annotated[float, Quantity("joint angle about which they swing", "rad", ge=-720.0, le=720.0)] = 0.0
    ramp: Annotated[float, Quantity("time in which the sines grow to their full size", "s", gt=0.0, le=1e5)] = 1.0

    def __post_init__(self) -> None:
        if not len(self.frequencies) == len(self.amplitudes) == len(self.phases) > 0:
            raise ParameterError(
                "multisine: lists of different lengths", expected="one amplitude and phase a frequency"
            )
        check_positive("multisine", ramp=self.ramp, lowest_frequency=min(self.frequencies))
        _finite("multisine", amplitudes=self.amplitudes, phases=self.phases, centre=self.centre)
        _finite("multisine", frequencies=self.frequencies)

    def sample(self, time: Array) -> Array:
        """See `Trajectory.sample`."""
        omega = 2.0 * np.pi * np.asarray(self.frequencies)
        angle = np.multiply.outer(time, omega) + np.asarray(self.phases)
        a = np.asarray(self.amplitudes)
        y, dy, ddy = np.sin(angle) @ a, np.cos(angle) @ (a * omega), -np.sin(angle) @ (a * omega**2)
        w, dw, ddw = _minimum_jerk(0.0, 1.0, self.ramp, time).T
        return np.stack((self.centre + w * y, w * dy + dw * y, w * ddy + 2.0 * dw * dy + ddw * y), axis=1)

    def describe(self) -> dict[str, Any]:
        """See `Trajectory.describe`."""
        return {
            "kind": "multisine",
            **{k: list(v) if isinstance(v, tuple) else v for k, v in asdict(self).items()},
        }


class Recorded:
    """A recorded motion: a quintic spline through the recording after a zero-phase low-pass filter.

    The spline's own derivatives are the velocity and acceleration. Before the recording the reference rests at its
    first value and after it at its last.

    Args:
        time: (n,) evenly spaced [s].
        position: (n,) [rad].
        cutoff: of the fourth-order filter (second order run both ways) [Hz]; zero, or a frequency that the samples
            cannot hold anyway, for none. 6 Hz keeps human motion.
        name: where it comes from, for the record.

    Raises:
        ParameterError: uneven time, not enough samples, values that are not finite, a negative cut-off.
    """

    def __init__(self, time: Array, position: Array, *, cutoff: float = 6.0, name: str = "recorded") -> None:
        from scipy import interpolate, signal  # a second, which only a recorded motion need wait for

        if np.ndim(time) != 1 or len(time) < 16 or np.shape(time) != np.shape(position):
            given = f"times of shape {np.shape(time)}, positions of shape {np.shape(position)}"
            raise ParameterError(f"{name}: {given}", expected="at least 16 times and one position for each")
        if not (np.isfinite(time).all() and np.isfinite(position).all()):
            raise ParameterError(f"{name}: has values that are not numbers", do="remove or fill them first")
        if not 0.0 <= cutoff < np.inf:
            raise ParameterError(f"{name}: cut-off {cutoff} Hz", expected="zero or a positive number")
        steps = np.diff(time)
        if not np.ptp(steps) < 0.1 * float(np.mean(steps)):
            raise ParameterError(f"{name}: steps from {steps.min():g} to {steps.max():g} s", expected="even time")
        rate = 1.0 / float(np.mean(steps))
        smooth = np.asarray(position, dtype=float)
        if 0.0 < cutoff < 0.5 * rate:
            padding = min(len(smooth) - 1, int(3 * rate / cutoff))
            smooth = signal.sosfiltfilt(signal.butter(2, cutoff, fs=rate, output="sos"), smooth, padlen=padding)
        thin = max(1, int(rate / max(20.0 * cutoff, 100.0))) if cutoff > 0.0 else 1  # knots far above the cut-off
        index = np.unique(np.append(np.arange(0, len(time), thin), len(time) - 1))
        self._start, self._end = float(time[0]), float(time[-1])
        self.time, self.position = np.asarray(time, dtype=float), np.asarray(position, dtype=float)
        self.name, self.cutoff = name, cutoff
        self._spline = interpolate.make_interp_spline(self.time[index], smooth[index], k=5)

    @property
    def duration(self) -> float:
        """Length of the recording [s]."""
        return self._end - self._start

    def sample(self, time: Array) -> Array:
        """See `Trajectory.sample`; `time` counts from the start of the recording."""
        t = np.clip(time + self._start, self._start, self._end)
        moving = ((time >= 0.0) & (time <= self.duration)).astype(float)
        p, v, a = (self._spline(t, derivative) for derivative in range(3))
        return np.stack((p, v * moving, a * moving), axis=1)

    def describe(self) -> dict[str, Any]:
        """See `Trajectory.describe`."""
        return {"kind": "recorded", "name": self.name, "cutoff": self.cutoff, "duration": self.duration}
