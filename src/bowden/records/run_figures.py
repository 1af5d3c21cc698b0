"""The figures of merit of a run, as they are printed as JSON too."""

from dataclasses import dataclass

from bowden.core.documented import Documented
from bowden.core.guesses import answering


@answering({}, "they are those of one run")
@dataclass(frozen=True)
class Metrics(Documented):
    """The figures of one run; None where a figure does not exist (an unstable run, a motion too short)."""

    rmse_deg: float | None
    """Root of the mean square of joint - reference, from rest [deg]."""
    rmse_after_10s_deg: float | None
    """The same without the first ten seconds; null for a run no longer than that [deg]."""
    peak_deg: float | None
    """Largest size of the error [deg]."""
    delay_s: float | None
    """The shift of the reference that agrees best with the joint; null where nothing moves [s]."""
    hysteresis_width_deg: float | None
    """Height of the loop of joint over reference at mid-stroke; null without a loop [deg]."""
    mechanical_energy_j: float | None
    """Integral of the mechanical power, Eq. 18; null of two motors on one joint [J]."""
    electrical_energy_j: float | None
    """Integral of the electrical power, Eq. 18; null of two motors on one joint [J]."""

    def shown(self) -> dict[str, tuple[float | None, str]]:
        """Name of each figure → its value and unit, as people read it."""
        delay = None if self.delay_s is None else 1e3 * self.delay_s
        return {
            "RMSE": (self.rmse_deg, "°"),
            "after 10 s": (self.rmse_after_10s_deg, "°"),
            "peak": (self.peak_deg, "°"),
            "delay": (delay, "ms"),
            "hysteresis width": (self.hysteresis_width_deg, "°"),
            "mechanical energy": (self.mechanical_energy_j, "J"),
            "electrical energy": (self.electrical_energy_j, "J"),
        }


NO_FIGURES = Metrics(None, None, None, None, None, None, None)
"""Of a run that ran away."""
