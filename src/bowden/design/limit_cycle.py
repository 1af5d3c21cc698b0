"""The limit cycle that backlash can cause: the cable's describing function against the sampled loop.

Driven by motor = A·sin ωt, the cable's hysteresis answers at ω with the complex gain N(A), which does not depend on ω.
With G the servo, its delay and hold, and C₁, C₂ the law from joint and motor to minus the command, a cycle is where

    1 + G·C₂ + N(A)·G·C₁ = 0

and lasts where the loop is stable at a larger amplitude and unstable at a smaller one (Loeb's criterion: the sign with
which the left side winds around the root). Sources: Gelb and Vander Velde, *Multiple-Input Describing Functions*, 1968.
"""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from bowden.control.stability import response, servo_response
from bowden.core.kernel import compiled, kernel
from bowden.design.linearise import LawModel
from bowden.models.cable.bouc_wen import PreparedCable, advance_prepared, prepare_cable
from bowden.models.cable.sheath import slope_factor, width
from bowden.models.drive.servo import Servo
from bowden.plants.bench import Bench
from bowden.plants.estimated import measured_plant
from bowden.plants.plant import Plant
from bowden.plants.transmission import measured_response

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

AMPLITUDES = np.geomspace(2e-4, 2.0, 100)
"""Of the motor, searched [rad]."""
MEASURED = np.geomspace(1e-3, 1.0, 31)
"""Where the describing function has to be measured [rad]."""

_POINTS = 128
_CYCLES = 3


@dataclass(frozen=True)
class LimitCycle:
    """An oscillation that lasts."""

    amplitude: float
    """Half of its span at the joint [rad]."""
    period: float
    """[s]"""


@kernel
def hysteresis_response(amplitudes: Array, cable: PreparedCable, points: int, cycles: int, gains: Complex) -> None:
    """h at the frequency of motor = A·sin: its complex gain for each amplitude (k,) [1/rad], filled into `gains`.

    The last of several cycles is taken, in which h no longer knows where it began.
    """
    for i in range(len(amplitudes)):
        h, before, total = 0.0, 0.0, 0.0 + 0.0j
        for k in range(1, cycles * points + 1):
            angle = 2.0 * np.pi * k / points
            motor = amplitudes[i] * np.sin(angle)
            h = advance_prepared(h, motor - before, cable)
            before = motor
            if k > (cycles - 1) * points:
                total += h * (np.sin(angle) + 1j * np.cos(angle))
        gains[i] = 2.0 * total / (points * amplitudes[i])


def describing_function(
    plant: Plant, bend: float, stroke: tuple[float, float], amplitudes: Array | None = None
) -> tuple[Array, Complex]:
    """Amplitudes of the motor (k,) [rad], and N of the plant's cable at each of them (k,) [rad/rad].

    Args:
        plant: any; of the bench N is calculated, and else measured.
        bend: total bend of its sheath [rad].
        stroke: of the joint [rad].
        amplitudes: `AMPLITUDES`, or `MEASURED`, where they are not given.
    """
    plant = measured_plant(plant)
    cable = plant.formula if isinstance(plant, Bench) else None
    if cable is None:
        amplitudes = MEASURED if amplitudes is None else amplitudes
        return amplitudes, measured_response(plant, bend, stroke, amplitudes)
    amplitudes = AMPLITUDES if amplitudes is None else amplitudes
    wide, factor = float(width(bend, plant.sheath)), float(slope_factor(bend, plant.sheath))
    of_h = _response_of_h(prepare_cable(cable), tuple((amplitudes / wide).tolist()))
    return amplitudes, np.asarray(factor * cable.slope + cable.hysteresis_gain * of_h)


@lru_cache(16)
def _response_of_h(cable: PreparedCable, amplitudes: tuple[float, ...]) -> Complex:
    """Kept, since many laws are tried on one cable."""
    gains = np.empty(len(amplitudes), np.complex128)
    compiled(hysteresis_response)(np.array(amplitudes), cable, _POINTS, _CYCLES, gains)
    return gains


def predict(gains: Complex, servo: Servo, delay: int, law: LawModel, dt: float, amplitudes: Array) -> LimitCycle | None:
    """The largest stable limit cycle, or None where the describing function shows none.

    Args:
        gains: N at each amplitude (k,).
        servo: from command to motor.
        delay: of the command [cycles].
        law: near rest.
        dt: sample time [s].
        amplitudes: of the motor (k,) [rad].
    """
    omega = np.geomspace(0.05, 0.9 * np.pi / dt, 900)
    moved = servo_response(servo, dt, delay, omega)
    direct, through = (1.0 + moved * response(law.by_motor, omega, dt)), moved * response(law.by_joint, omega, dt)
    left = direct[None, :] + gains[:, None] * through[None, :]  # (amplitude, frequency)
    angle = np.angle(left)
    along, across = _turned(np.diff(angle, axis=0)), _turned(np.diff(angle, axis=1))
    turns = along[:, :-1] + across[1:] - along[:, 1:] - across[:-1]  # once round each cell of the grid
    lasting = np.argwhere(turns > np.pi)
    if not len(lasting):
        return None
    i, j = lasting[-1]
    amplitude = np.sqrt(amplitudes[i] * amplitudes[i + 1]) * abs(gains[i] + gains[i + 1]) / 2.0
    return LimitCycle(float(amplitude), float(2.0 * np.pi / np.sqrt(omega[j] * omega[j + 1])))


def _turned(difference: Array) -> Array:
    """A difference of two angles, brought to within half a turn."""
    return np.asarray(difference - 2.0 * np.pi * np.rint(difference / (2.0 * np.pi)))
