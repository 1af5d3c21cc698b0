"""The motor's two-node thermal model and its I²t sum.

    Cw·dTw/dt = R·(1 + α·(Tw − 20 °C))·I² − (Tw − Th)/Rwh,    Ch·dTh/dt = (Tw − Th)/Rwh − (Th − Ta)/Rha

with winding w, housing h and surroundings a; the resistance of copper grows by α = 0.39 % a kelvin. The sum of I²t
bounds short peaks as a drive does: dS/dt = I² − Ic², S ≥ 0, for the continuous current Ic.
"""

from typing import Annotated, NamedTuple

import numpy as np

from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity

COPPER = 0.0039
"""Temperature coefficient of copper's resistance [1/K]."""


class Thermal(NamedTuple):
    """A motor's thermal side; defaults are of the size that brushless motors of 40 mm and 70 W have: a stated choice.

    Put in the four figures of your motor's data sheet: both thermal resistances, and of both time constants
    C = τ/Rth.
    """

    resistance: float = 0.199
    """R, of the winding at 20 °C [Ω]."""
    winding_to_housing: float = 0.8
    """Rwh [K/W]."""
    housing_to_ambient: float = 7.0
    """Rha [K/W]."""
    winding_capacity: float = 15.0
    """Cw [J/K]; τw = 12 s."""
    housing_capacity: float = 110.0
    """Ch [J/K]; τh = 770 s."""
    ambient: float = 25.0
    """Ta [°C]."""
    continuous_current: float = 6.0
    """Ic [A]."""


class ThermalState(NamedTuple):
    """How warm the motor is."""

    winding: Annotated[float, Quantity("temperature of the winding", "°C", symbol="Tw")]
    housing: Annotated[float, Quantity("temperature of the housing", "°C", symbol="Th")]
    i2t: Annotated[float, Quantity("sum of I²t", "A²s", symbol="S")]


def cold(thermal: Thermal) -> ThermalState:
    """A motor that has stood long enough to be as warm as its surroundings."""
    return ThermalState(thermal.ambient, thermal.ambient, 0.0)


@kernel
def warm(thermal: Thermal, state: ThermalState, current: float, dt: float) -> ThermalState:
    """The motor `dt` [s] later under a `current` [A]; one explicit step, so that dt must be short against τw."""
    heat = thermal.resistance * (1.0 + COPPER * (state.winding - 20.0)) * current * current
    inward = (state.winding - state.housing) / thermal.winding_to_housing
    outward = (state.housing - thermal.ambient) / thermal.housing_to_ambient
    excess = current * current - thermal.continuous_current * thermal.continuous_current
    return ThermalState(
        state.winding + dt * (heat - inward) / thermal.winding_capacity,
        state.housing + dt * (inward - outward) / thermal.housing_capacity,
        np.fmax(0.0, state.i2t + excess * dt),
    )


def rested(thermal: Thermal, state: ThermalState, seconds: float) -> ThermalState:
    """The motor after it has lain without current for `seconds`: how what one run leaves is handed to the next.

    A time that is negative or not a number (a clock that was set back) cools nothing.
    """
    steps = int(min(seconds, 36000.0) / 1.0) if seconds > 0.0 else 0
    for _ in range(steps):
        state = warm(thermal, state, 0.0, 1.0)
    return state
