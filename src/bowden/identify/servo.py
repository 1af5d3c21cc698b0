"""A servo from a log of its command and its motor: natural frequency, damping, delay and limits.

The model is that of `bowden.models.drive.servo`, driven by the command as it was `delay` seconds ago (a fraction of a
sample counts), plus a constant offset between command and motor:

    motor(t) = servo(command(t − delay)) + offset,   |speed| ≤ v,  |acceleration| ≤ a

All are fitted together by least squares; a limit is taken into the model only where it makes the residual a tenth
smaller, that is, where the log reaches it. Uncertainties are those of the least squares, with the residual's
correlation from one sample to the next counted.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import LogError, ParameterError
from bowden.core.kernel import compiled, kernel
from bowden.core.units import DEGREES, RADIANS
from bowden.identify.log.clock import check_length, even_clock
from bowden.identify.log.columns import FACTORS, TIMES, LogColumn
from bowden.identify.log.read import checked_rate, read_columns, seconds_of, with_both
from bowden.models.drive.servo import Servo, ServoState, ServoStep, prepare, servo_step
from bowden.records.metrics import sample_time

Array = NDArray[np.float64]

_SMALLEST_STEP = 0.5 * RADIANS
"""Span of the command below which nothing was asked of the servo [rad]."""
_LONGEST_DELAY = 0.2
"""[s]"""
_MOST = 500
"""How often the model is looked at at most."""
_PARTS = 3
"""Steps into which each part of a sample is divided, for the limits."""


class ServoEstimate(NamedTuple):
    """A figure with its standard uncertainty."""

    value: float
    uncertainty: float


@dataclass(frozen=True)
class ServoFit:
    """What the log says about the servo."""

    natural_frequency: ServoEstimate
    """ω [rad/s]."""
    damping: ServoEstimate
    """ζ [–]."""
    delay: ServoEstimate
    """Between the logged command and the moment it acts [s]."""
    speed_limit: ServoEstimate | None
    """[rad/s]; None where the log does not reach it."""
    acceleration_limit: ServoEstimate | None
    """[rad/s²]; None where the log does not reach it."""
    residual: float
    """Root mean square of motor − model [rad]."""
    share: float
    """Share of the motor's motion that the model leaves unexplained [–]."""
    model: Array
    """The model's motor angle (n,) [rad]."""


@kernel
def follow(
    command: Array, late: int, first: ServoStep, second: ServoStep, parts: int, start: float, out: Array
) -> None:
    """The motor at each sample, from rest at `start`, under the delayed command; fills `out` (n,).

    The delay is `late` samples and the fraction of one that `first` lasts: until then the command before counts.

    Args:
        command: held over each sample (n,) [rad].
        late: whole samples of the delay.
        first: the servo prepared for its part of the fraction's time.
        second: the same for the rest of the sample.
        parts: steps in each of the two.
        start: of the motor [rad].
        out: filled (n,) [rad].
    """
    state = ServoState(start, 0.0, 0.0)
    out[0] = start
    for k in range(1, len(command)):
        for _ in range(parts):
            state = servo_step(state, command[max(0, k - 2 - late)], first)
        for _ in range(parts):
            state = servo_step(state, command[max(0, k - 1 - late)], second)
        out[k] = state.position


def identify_servo(time: Array, command: Array, motor: Array) -> ServoFit:
    """Fit a servo to a log of a step or a chirp.

    Args:
        time: even, increasing (n,) [s].
        command: the motor's target angle (n,) [rad].
        motor: its measured angle (n,) [rad].

    Raises:
        LogError: too short or uneven, values that are not finite, a command that asks for too little, a motor that does
            not follow, or a log that does not show the servo's frequency.
    """
    dt = _checked(time, command, motor)
    if _follows(command, motor, dt):
        raise LogError(
            "the command comes after the motor",
            expected="the motor's target angle, and the angle that it then has",
            do="exchange the two columns",
        )
    fits = {limits: _fit(command, motor, dt, limits) for limits in ("", "v")}
    if _better(fits["v"], fits[""]):
        fits["va"] = _fit(command, motor, dt, "va", fits["v"])
    else:
        fits["a"] = _fit(command, motor, dt, "a")
    best = ""
    for limits in fits:
        if _better(fits[limits], fits[best]):
            best = limits
    return _result(fits[best], best, motor, dt)


class _Fit(NamedTuple):
    values: Array
    """ln ω, ln ζ, delay, offset, then ln of the limits."""
    covariance: Array
    residual: float
    model: Array


def _better(fit: _Fit, than: _Fit) -> bool:
    """By a tenth of the residual: a limit that the log does not reach explains nothing."""
    return fit.residual < 0.9 * than.residual


def _model(values: Array, limits: str, command: Array, start: float, dt: float) -> Array:
    bounds = dict(zip(limits, np.exp(values[4:]), strict=True))
    servo = Servo(
        float(np.exp(values[0])),
        float(np.exp(values[1])),
        float(bounds.get("v", np.inf)),
        float(bounds.get("a", np.inf)),
    )
    whole = max(0.0, float(values[2])) / dt
    late = int(np.floor(whole))
    fraction = min(max(whole - late, 1e-6), 1.0 - 1e-6)
    out = np.empty(len(command))
    first, second = (prepare(servo, part * dt / _PARTS) for part in (fraction, 1.0 - fraction))
    compiled(follow)(command, late, first, second, _PARTS, start - float(values[3]), out)
    return out + float(values[3])


def _fit(command: Array, motor: Array, dt: float, limits: str, near: _Fit | None = None) -> _Fit:
    speed = _slopes(motor, dt)
    first_limits = {"v": float(np.max(np.abs(speed))), "a": float(np.max(np.abs(_slopes(speed, dt))))}
    tail = [np.log(max(first_limits[limit], 1e-6)) for limit in limits]

    from scipy.optimize import least_squares

    def residuals(values: Array) -> Array:
        return _model(values, limits, command, float(motor[0]), dt) - motor

    grid = [
        np.array([np.log(2.0 * np.pi * f), np.log(zeta), delay, 0.0, *tail])
        for f in np.geomspace(0.5, 80.0, 15)
        for zeta in (0.3, 0.7, 1.2)
        for delay in (0.0, 0.003, 0.01, 0.04)
    ]
    if near is not None:
        grid += [np.array([*near.values, tail[-1] - k]) for k in (0.0, 0.5, 1.0, 2.0)]
    start = min(grid, key=lambda values: float(np.sum(residuals(values) ** 2)))
    span = float(np.ptp(command))
    low = np.array([np.log(0.1), np.log(0.02), 0.0, -span, *(np.log(1e-6) for _ in limits)])
    high = np.array([np.log(1e4), np.log(20.0), _LONGEST_DELAY, span, *(np.log(1e9) for _ in limits)])
    scale = np.array([0.1, 0.1, dt, 0.01 * span, *(0.1 for _ in limits)])

    def slopes(values: Array) -> Array:
        """∂residuals/∂values (n, k); SciPy's own steps are shares of a value, which a delay of zero has none of."""
        here, step = residuals(values), 1e-5 * np.maximum(np.abs(values), scale)
        step = np.where(values + step < high, step, -step)
        return np.stack([residuals(values + change) - here for change in np.diag(step)], axis=1) / step

    found = least_squares(
        residuals,
        np.clip(start, low + 1e-9, high - 1e-9),
        jac=slopes,
        bounds=(low, high),
        x_scale=scale,
        xtol=1e-8,
        ftol=1e-8,
        gtol=1e-14,
        max_nfev=_MOST,
    )
    left, jacobian = np.asarray(found.fun), np.asarray(found.jac)
    n = len(left)
    near_one = float(np.sum(left[1:] * left[:-1]) / max(float(np.sum(left**2)), 1e-300))
    independent = n * max(1.0 - near_one, 1e-3) / (1.0 + max(near_one, 0.0))
    variance = float(np.sum(left**2)) / max(n - len(start), 1) * n / independent
    covariance = variance * np.linalg.pinv(jacobian.T @ jacobian)
    return _Fit(
        found.x,
        np.asarray(covariance, dtype=np.float64),
        float(np.sqrt(np.mean(left**2))),
        left + motor,
    )


def _follows(command: Array, motor: Array, dt: float) -> bool:
    """True if the command is nearer to the motor of some time before than the motor is to any earlier command."""
    n = len(motor)
    shifts = np.unique(np.geomspace(1.0, min(0.25 * n, max(2.0, _LONGEST_DELAY / dt)), 30).astype(int))
    after, before = (
        min(float(np.std(late[k:] - early[: n - k])) for k in shifts)
        for late, early in ((motor, command), (command, motor))
    )
    return before < 0.5 * after


def _result(fit: _Fit, limits: str, motor: Array, dt: float) -> ServoFit:
    spread = np.sqrt(np.diag(fit.covariance))
    relative = float(spread[0])
    share = fit.residual / float(np.std(motor))
    if share > 0.3:
        raise LogError(
            f"a second-order servo leaves {100.0 * share:.0f} % of the motor's motion unexplained",
            expected="the motor's own command, in the same unit and direction",
            do="look at the columns, the units and the direction",
        )
    if not relative < 0.25 or fit.values[0] > np.log(0.5 * np.pi / dt):
        raise LogError(
            "the log does not show the servo's frequency: the motor follows the command without a visible lag",
            expected="a step, or a chirp up to beyond the servo's frequency",
            do="look at the unit of the times; or log one, with samples that are short against the servo's rise",
        )
    shown = {
        name: ServoEstimate(float(np.exp(v)), float(np.exp(v) * s))
        for name, v, s in zip(limits, fit.values[4:], spread[4:], strict=True)
    }
    omega, zeta = (float(np.exp(v)) for v in fit.values[:2])
    return ServoFit(
        natural_frequency=ServoEstimate(omega, omega * relative),
        damping=ServoEstimate(zeta, zeta * float(spread[1])),
        delay=ServoEstimate(float(fit.values[2]), float(spread[2])),
        speed_limit=shown.get("v"),
        acceleration_limit=shown.get("a"),
        residual=fit.residual,
        share=share,
        model=fit.model,
    )


def _slopes(values: Array, dt: float) -> Array:
    """Mean rate over windows of a hundredth of the log, ten samples at least, fifty at most [1/s]."""
    window = int(np.clip(len(values) // 100, 10, 50))
    return np.asarray((values[window:] - values[:-window]) / (window * dt))


def _checked(time: Array, command: Array, motor: Array) -> float:
    """The sample time of a log that can be fitted; its reader has seen that it is one [s]."""
    dt = sample_time(time)
    span, answered = float(np.ptp(command)), float(np.ptp(motor))
    if span < _SMALLEST_STEP:
        raise LogError(
            f"no excitation: the command spans {span * DEGREES:.2g}°",
            expected=f"a step or a chirp of {_SMALLEST_STEP * DEGREES:g}° at least",
        )
    if answered < 0.05 * span:
        raise LogError(
            f"the motor moves {answered * DEGREES:.2g}° for a command of {span * DEGREES:.2g}°",
            expected="a motor that follows",
            do="look at the columns, and whether the drive was on",
        )
    return dt


_SERVO: Mapping[str, Sequence[str]] = {
    "time": TIMES,
    "command": (
        *("command", "cmd", "target", "setpoint", "reference", "desired", "demand", "motor_command", "input", "u"),
    ),
    "motor": (
        *("motor_measured", "motor", "motor_angle", "motor_position", "actual", "measured", "position", "output"),
        *("spool", "spindle", "winch", "drum", "actuator"),
    ),
}
"""Role → common names, the likeliest first."""


def read_servo_log(
    path: Path, given: Mapping[str, str | None], unit: str | None = None, rate: float | None = None
) -> tuple[tuple[Array, Array, Array], list[str]]:
    """Time [s], command and motor [rad], each (n,), on an even clock; and what was mended.

    Args:
        path: a log as `bowden.identify.log.read.read_log` takes it.
        given: role (time, command, motor) → column, or None to guess.
        unit: of both angles, ``deg`` or ``rad``; from the columns' names where it is not given.
        rate: rows a second of a log without times; a time column is then not read [Hz].

    Raises:
        LogError: the file cannot be read, has no such column, a field is not a number, or its times are no clock.
        ParameterError: an unknown unit, a rate that cannot be, a rate beside a time column's name.
    """
    if unit not in (None, "deg", "rad"):
        raise ParameterError(f"--unit is {unit!r}", expected="deg or rad")
    checked_rate(rate, given.get("time"))
    raw, left_out = with_both(read_columns(path, given, _SERVO, () if rate is None else ("time",)), rate)
    factors = {role: _factor(raw.columns[role], unit, path) for role in ("command", "motor")}
    check_length(len(raw.values["motor"]), str(path))
    time, notes, named = seconds_of(raw, rate, path)
    if not named:
        notes.append(f"no unit is named for {raw.columns['time'].name!r} (taken as s): end the name in _s or _ms")
    angles = [raw.values[role] * factor for role, factor in factors.items()]
    even, (command, motor), warnings = even_clock(time - time[0], angles, raw.place)
    return (even, command, motor), [*left_out, *notes, *warnings]


def _factor(column: LogColumn, unit: str | None, path: Path) -> float:
    if unit is not None and column.unit not in (None, unit):
        raise LogError(
            f"{path}: --unit is {unit}, and column {column.name!r} names {column.unit}",
            do="leave --unit out, or correct the name",
        )
    wanted = unit or column.unit
    if wanted is None:
        raise LogError(f"{path}: column {column.name!r} does not say its unit", do="give --unit deg or --unit rad")
    if wanted not in ("deg", "rad"):
        raise LogError(f"{path}: column {column.name!r} is in {wanted}", expected="deg or rad", do="convert it first")
    return FACTORS[wanted]
