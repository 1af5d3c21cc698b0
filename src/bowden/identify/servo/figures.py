"""Figures of a servo, as they are printed as JSON too."""

from dataclasses import dataclass

from bowden.core.documented import Documented


@dataclass(frozen=True)
class FittedValue(Documented):
    """A value and its uncertainty."""

    value: float
    uncertainty: float
    """Standard uncertainty."""


@dataclass(frozen=True)
class ServoFigures(Documented):
    """A servo, as a rig.toml has it."""

    natural_frequency_hz: FittedValue
    """Natural frequency under the position loop [Hz]."""
    damping: FittedValue
    """Damping ratio."""
    delay_s: FittedValue
    """Between the logged command and the moment it acts, fractions of a sample included [s]."""
    delay_cycles: int
    """The same in cycles of the rig, rounded up, with those of the joint's sensor."""
    joint_late_s: float
    """How late the rig's joint sensor is, by the log of its cable; 0 without `into` [s]."""
    sample_time_ms: float
    """One cycle of the rig [ms]."""
    speed_limit_deg_per_s: FittedValue | None
    """Largest speed; null where the log does not reach it [deg/s]."""
    acceleration_limit_deg_per_s2: FittedValue | None
    """Largest acceleration; null where the log does not reach it [deg/s²]."""
    residual_deg: float
    """Root mean square of motor - model [deg]."""
    unexplained: float
    """The same as a share of the motor's motion."""
