"""The backlash observer: the inverse of an identified Bouc–Wen cable (Eq. 8).

    command = (reference − offset − α̂h·ĥ)/α̂φ,    ĥ from Eq. 7

Eq. 7 needs the motor's travel. Feeding it the command's own increments makes an algebraic loop that chatters or
diverges when it is stepped explicitly, because the fitted cable is not monotone (reading 6). ĥ is therefore driven by
the *measured* motor angle (the default), or by the reference divided by the slope, which needs no sensor and is free of
its noise.
"""

from typing import Annotated, NamedTuple

from bowden.control.law import Law
from bowden.core.kernel import kernel
from bowden.core.quantity import Quantity
from bowden.core.signals import Reference, Sample
from bowden.models.cable.bouc_wen import BoucWen, saturation, travel_step


class ObserverGains(NamedTuple):
    """The identified cable, and what drives its hysteresis."""

    slope: float = 0.938
    """α̂φ [rad/rad]."""
    hysteresis_gain: float = -0.129
    """α̂h [rad]."""
    rate: float = 9.256
    """ρ̂ [1/rad]."""
    shape: float = 9.427
    """σ̂ [–]."""
    exponent: float = 3.0
    """n̂ [–]."""
    offset: float = 0.0
    """Joint angle at motor angle zero with ĥ = 0 [rad]."""
    from_reference: float = 0.0
    """1: ĥ is driven by the reference; 0: by the measured motor angle [–]."""


class ObserverState(NamedTuple):
    """State of the law from one cycle to the next."""

    h: Annotated[float, Quantity("ĥ")]
    driver: Annotated[float, Quantity("last angle that drove ĥ", "rad")]


@kernel
def start(gains: ObserverGains, sample: Sample) -> ObserverState:
    """Begin with ĥ = 0, at the angle where the drive is now."""
    cable = BoucWen(gains.slope, gains.hysteresis_gain, gains.rate, gains.shape, gains.exponent, gains.offset)
    driver = sample.motor
    if gains.from_reference > 0.5:
        driver = (sample.joint - cable.offset) / cable.slope
    return ObserverState(0.0, driver)


@kernel
def step(
    gains: ObserverGains, state: ObserverState, sample: Sample, reference: Reference, dt: float
) -> tuple[ObserverState, float]:
    """Advance ĥ by the drive's travel and invert Eq. 6 at the reference."""
    cable = BoucWen(gains.slope, gains.hysteresis_gain, gains.rate, gains.shape, gains.exponent, gains.offset)
    wanted = (reference.position - cable.offset) / cable.slope
    driver = wanted if gains.from_reference > 0.5 else sample.motor
    piece = (driver - state.driver) / 4.0  # a tenth of a radian in one cycle, the chirp's fastest, is still stable
    h = state.h
    for _ in range(4):
        h = travel_step(h, piece, cable)
    bound = saturation(cable)
    h = max(-bound, min(bound, h))
    command = wanted - cable.hysteresis_gain * h / cable.slope
    return ObserverState(h, driver), command


TABLE_1 = ObserverGains(hysteresis_gain=0.566 * -0.129 * 0.8841, rate=9.256 / 0.8841)
"""Of Table 1: it knows the bench's cable, whose play is 0.8841 times the printed one's, but for its share of α̂h."""

LAW = Law(
    name="observer",
    gains=ObserverGains(),
    start_kernel=start,
    step_kernel=step,
    source="Dinh et al. 2017, Eq. 8; parameters of Section 5.1.1",
    presets={"paper": TABLE_1},
    from_rig={name: f"cable.{name}" for name in BoucWen._fields},
    feeds_back=frozenset({"motor"}),
    limits={"rate": (1e-6, 1e4), "shape": (0.5, 1e4), "exponent": (1.0, 50.0), "from_reference": (0.0, 1.0)},
)
