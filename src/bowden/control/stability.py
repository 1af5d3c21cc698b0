"""Margins of the sampled loop: a linear law around the servo, its delay and one slope of the cable.

The loop is opened at the command. With the servo held over each cycle (exact zero-order hold), the command delayed by d
cycles and the joint moving by `slope` per motor motion,

    L(z) = slope·G(z)·z⁻ᵈ·C(z),    C: from the measured joint to minus the command

All functions are pure and need numpy only.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.laws.adaptive import AdaptiveGains
from bowden.models.drive.servo import Servo, prepare

Array = NDArray[np.float64]

_AT_A_TIME = 256
"""Frequencies at which a long system is solved together, so that its matrices fit into a few megabytes."""


class StateSpace(NamedTuple):
    """x⁺ = A·x + B·u, y = C·x + D·u in discrete time, one input and one output."""

    a: Array
    """(k, k)."""
    b: Array
    """(k, 1)."""
    c: Array
    """(1, k)."""
    d: float


@dataclass(frozen=True)
class Margins:
    """How far a closed loop is from instability."""

    stable: bool
    """True if every closed-loop pole is inside the unit circle."""
    gain_margin_db: float | None
    """Smallest increase of gain that makes the loop unstable [dB]; None where there is none, or it is unstable."""
    phase_margin_deg: float | None
    """Smallest phase margin over the gain crossovers [deg]; None where |L| never crosses one."""
    delay_margin_s: float | None
    """Smallest extra delay that makes the loop unstable [s]; None where |L| never crosses one."""
    largest_pole: float
    """Largest magnitude of a closed-loop pole."""

    def share(self, gain_db: float, phase_deg: float) -> float:
        """The nearer of both limits over what is wanted of it; infinite where there is none, minus the largest pole of
        an unstable loop."""
        if not self.stable:
            return -self.largest_pole
        pairs = (self.gain_margin_db, gain_db), (self.phase_margin_deg, phase_deg)
        return min((value / wanted for value, wanted in pairs if value is not None), default=math.inf)


def servo_model(servo: Servo, dt: float, delay: int, slope: float) -> StateSpace:
    """From command to joint: the held servo behind `delay` cycles, times the cable's slope."""
    held = prepare(servo, dt)
    size = 2 + delay
    a, b, c = np.zeros((size, size)), np.zeros((size, 1)), np.zeros((1, size))
    a[:2, :2] = [[held.xx, held.xv], [held.vx, held.vv]]
    into = np.array([1.0 - held.xx, -held.vx])
    if delay:
        a[:2, 2] = into
        a[np.arange(2, size - 1), np.arange(3, size)] = 1.0
        b[-1, 0] = 1.0
    else:
        b[:2, 0] = into
    c[0, 0] = slope
    return StateSpace(a, b, c, 0.0)


def servo_response(servo: Servo, dt: float, delay: int, omega: Array) -> NDArray[np.complex128]:
    """Of `servo_model` with a slope of 1 at `omega` (n,) [rad/s]; a delay, however long, needs no states here."""
    return response(servo_model(servo, dt, 0, 1.0), omega, dt) * np.exp(-1j * omega * dt * delay)


def adaptive_model(gains: AdaptiveGains, dt: float, slope_inverse: float, bound: float) -> StateSpace:
    """The adaptive law near s = 0 with frozen estimates, from measured joint to minus the command.

    The tanh acts as its slope 1/ε. States: ∫e dt, the last joint angle, the filtered joint rate.

    Args:
        gains: of the law.
        dt: sample time [s].
        slope_inverse: the frozen β̂.
        bound: the frozen D̂m [rad].
    """
    follow = dt / (gains.derivative_time + dt)
    on_s = gains.feedback_gain + slope_inverse * bound / gains.smoothing
    on_rate = slope_inverse * gains.error_gain
    a = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, -follow / dt, 1.0 - follow]])
    b = np.array([[dt], [1.0], [follow / dt]])
    c = np.array([[on_s, 0.0, 0.0]]) + on_rate * a[2]
    return StateSpace(a, b, c, float(on_s * (gains.error_gain + dt) + on_rate * b[2, 0]))


def response(model: StateSpace, omega: Array, dt: float) -> NDArray[np.complex128]:
    """Frequency response (n,) at `omega` [rad/s]."""
    z = np.exp(1j * omega * dt)
    if not len(model.a):
        return np.full(len(z), complex(model.d))
    if len(model.a) > 8:  # the coefficients of so long a polynomial would lose the digits of poles near one
        return _response_one_by_one(model, z)
    poles = np.poly(model.a)  # det(zI − A); the numerator follows by the matrix determinant lemma
    zeros = np.poly(model.a - model.b @ model.c) + (model.d - 1.0) * poles
    return np.asarray(np.polyval(zeros, z) / np.polyval(poles, z))


def _response_one_by_one(model: StateSpace, z: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """C·(zI − A)⁻¹·B + D, solved for each z."""
    answer = np.empty(len(z), dtype=np.complex128)
    for begin in range(0, len(z), _AT_A_TIME):
        part = slice(begin, begin + _AT_A_TIME)
        x = np.linalg.solve(z[part, None, None] * np.eye(len(model.a)) - model.a, model.b.astype(np.complex128))
        answer[part] = x[..., 0] @ model.c[0]
    return answer + model.d


def closed_loop_poles(plant: StateSpace, law: StateSpace) -> NDArray[np.complex128]:
    """Poles of the loop of a strictly causal plant and a law in negative feedback."""
    top = np.hstack([plant.a - plant.b @ plant.c * law.d, -plant.b @ law.c])
    return np.linalg.eigvals(np.vstack([top, np.hstack([law.b @ plant.c, law.a])]))


def frequencies(dt: float) -> Array:
    """Where `margins` looks: 4000 logarithmic frequencies from 0.01 rad/s to the Nyquist frequency (4000,) [rad/s]."""
    return np.geomspace(1e-2, np.pi / dt * (1.0 - 1e-9), 4000)


def margins(
    plant: StateSpace, law: StateSpace, dt: float, plant_response: NDArray[np.complex128] | None = None
) -> Margins:
    """Gain, phase and delay margin of the loop, and whether it is stable at all.

    Crossings are found on `frequencies` and interpolated.

    Args:
        plant: strictly causal.
        law: in negative feedback.
        dt: sample time [s].
        plant_response: of the plant at `frequencies`, where many laws are tried on one plant.
    """
    poles = closed_loop_poles(plant, law)
    omega = frequencies(dt)
    answer = response(plant, omega, dt) if plant_response is None else plant_response
    return margins_of(answer * response(law, omega, dt), poles, dt)


def margins_of(loop: NDArray[np.complex128], poles: NDArray[np.complex128], dt: float) -> Margins:
    """Margins of a loop that is to be kept from −1, and whether the whole is stable.

    Args:
        loop: its answer at `frequencies`; of one without feedback 0 throughout.
        poles: of the closed loop.
        dt: sample time [s].
    """
    omega, largest = frequencies(dt), float(np.max(np.abs(poles)))
    if not np.any(loop):  # a law without feedback
        return Margins(largest < 1.0, None, None, None, largest)
    gain, phase = np.log(np.abs(loop)), np.unwrap(np.angle(loop))
    margin_gains = []
    for turn in np.arange(np.floor(phase.min() / np.pi), np.ceil(phase.max() / np.pi) + 1):
        if turn % 2:  # the loop is real and negative
            for i, f in _crossings(phase - turn * np.pi):
                margin_gains.append(-(gain[i] + f * (gain[i + 1] - gain[i])))
    phases = [
        (
            float(np.mod(phase[i] + f * (phase[i + 1] - phase[i]) + np.pi, 2.0 * np.pi)),
            omega[i] + f * (omega[i + 1] - omega[i]),
        )
        for i, f in _crossings(gain)
    ]
    upward = [m for m in margin_gains if m > 0.0]
    stable = largest < 1.0
    signed = [p if p <= np.pi else p - 2.0 * np.pi for p, _ in phases]
    return Margins(
        stable=stable,
        gain_margin_db=float(min(upward) * 20.0 / np.log(10.0)) if upward and stable else None,
        phase_margin_deg=float(np.degrees(min(signed, key=abs))) if signed else None,
        delay_margin_s=float(min(p / w for p, w in phases)) if phases and stable else None,
        largest_pole=largest,
    )


def _crossings(values: Array) -> list[tuple[int, float]]:
    """Where `values` passes zero: the index before it, and the fraction of the step."""
    index = np.flatnonzero(np.signbit(values[:-1]) != np.signbit(values[1:]))
    return [(int(i), float(values[i] / (values[i] - values[i + 1]))) for i in index]
