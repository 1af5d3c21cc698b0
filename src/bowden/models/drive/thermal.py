"""The motor's two-node thermal model and its I²t sum.

    Cw·dTw/dt = R·(1 + α·(Tw − 20 °C))·I² − (Tw − Th)/Rwh,    Ch·dTh/dt = (Tw − Th)/Rwh − (Th − Ta)/Rha

with winding w, housing h and surroundings a; the resistance of copper grows by α = 0.39 % a kelvin. The sum of I²t
bounds short peaks as a drive does: dS/dt = I² − Ic², S ≥ 0, for the continuous current Ic.
"""

from typing import Annotated, NamedTuple

from bowden.core.guesses import answering_fields
from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity

COPPER = 0.0039
"""Temperature coefficient of copper's resistance [1/K]."""


@answering_fields
class Thermal(NamedTuple):
    """A motor's thermal side; defaults are of the size that brushless motors of 40 mm and 70 W have: a stated choice.

    Put in the four figures of your motor's data sheet: both thermal resistances, and of both time constants
    C = τ/Rth.
    """

    resistance: Annotated[float, Quantity("of the winding at 20 °C", "Ω", symbol="R", key=None)] = 0.199
    winding_to_housing: Annotated[
        float, Quantity("thermal resistance from winding to housing", "K/W", symbol="Rwh", ge=0.0)
    ] = 0.8
    housing_to_ambient: Annotated[
        float, Quantity("thermal resistance from housing to surroundings", "K/W", symbol="Rha", ge=0.0)
    ] = 7.0
    winding_capacity: Annotated[float, Quantity("of the winding; τw = 12 s", "J/K", symbol="Cw", ge=0.0)] = 15.0
    housing_capacity: Annotated[float, Quantity("of the housing; τh = 770 s", "J/K", symbol="Ch", ge=0.0)] = 110.0
    ambient: Annotated[float, Quantity("temperature of the surroundings", "°C", symbol="Ta", ge=0.0, le=60.0)] = 25.0
    continuous_current: Annotated[
        float, Quantity("largest current that may last", "A", symbol="Ic", ge=0.0, le=1e4)
    ] = 6.0


class ThermalState(NamedTuple):
    """How warm the motor is."""

    winding: Annotated[float, Quantity("temperature of the winding", "°C", symbol="Tw")]
    housing: Annotated[float, Quantity("temperature of the housing", "°C", symbol="Th")]
    i2t: Annotated[float, Quantity("sum of I²t", "A²s", symbol="S")]


@kernel
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
        max(0.0, state.i2t + excess * dt),
    )


def rested(thermal: Thermal, state: ThermalState, seconds: float) -> ThermalState:
    """The motor after it has lain without current for `seconds`: how what one run leaves is handed to the next.

    A time that is negative or not a number (a clock that was set back) cools nothing.
    """
    steps = int(min(seconds, 36000.0) / 1.0) if seconds > 0.0 else 0
    for _ in range(steps):
        state = warm(thermal, state, 0.0, 1.0)
    return state
