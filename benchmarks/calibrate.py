"""Fit what the paper does not say to its rows without the adaptive law; the result is frozen in paper.toml.

Four unknowns, four published figures, each found in turn by bracketing, because each hardly touches the ones before:

    servo's natural frequency   ←  Fig. 16, the observer's bandwidth
    gap of the sheath           ←  Fig. 9, the uncompensated dead zone
    observer's share of αh      ←  Table 1, observer, constant bend
    loss of slope with bend     ←  Table 1, observer, varying bend

Run it with ``python benchmarks/calibrate.py``.
"""

from collections.abc import Callable
from dataclasses import asdict, replace

from scipy.optimize import brentq

from bowden.control import LAWS
from bowden.core.units import DEGREES
from bowden.paper.bench import observer, run_bench, run_chirp
from bowden.paper.claims import claims
from bowden.paper.figures_of_merit import closed_loop_bandwidth, dead_zone_deg
from bowden.plants.presets import bench as paper
from bowden.plants.presets.bench import Calibration
from bowden.records.metrics import rmse

START = Calibration(natural_frequency=54.4, gap=0.9, observer_share=1.0, loss=0.2, period=10.0)
"""Where the fit begins."""


def calibrate(start: Calibration = START, exact_observer: bool = False, rounds: int = 2) -> Calibration:
    """The calibration at the start's period, or, with an observer that knows the cable, the one that finds the period.

    Args:
        start: first guess.
        exact_observer: the observer has the cable's true parameters and the period is the unknown instead.
        rounds: how often the first three unknowns are gone through; each starts from guesses of the later ones.
    """
    published = {claim.id: claim.published for claim in claims() if claim.published is not None}
    fit = start
    third, bracket = ("period", (2.0, 12.0)) if exact_observer else ("observer_share", (0.0, 1.0))
    for _ in range(rounds):
        fit = _solve(fit, "gap", _dead_zone, published["fig9.deadzone"], (0.3, 3.0))
        fit = _solve(fit, "natural_frequency", _bandwidth, published["fig16.observer.bandwidth"], (35.0, 90.0))
        fit = _solve(fit, third, _observer_constant, published["table1.observer.constant"], bracket)
    return _solve(fit, "loss", _observer_varying, published["table1.observer.varying"], (0.0, 0.6))


def _solve(
    fit: Calibration, name: str, figure: Callable[[Calibration], float], wanted: float, bracket: tuple[float, float]
) -> Calibration:
    """The calibration with one unknown set so that a figure comes out as wanted."""

    def miss(value: float) -> float:
        return figure(replace(fit, **{name: value})) - wanted

    return replace(fit, **{name: brentq(miss, *bracket, xtol=1e-4)})


def _dead_zone(fit: Calibration) -> float:
    return dead_zone_deg(run_bench(LAWS["uncompensated"], fit=fit))


def _observer_constant(fit: Calibration) -> float:
    return rmse(run_bench(observer(fit), fit=fit).error) * DEGREES


def _observer_varying(fit: Calibration) -> float:
    return rmse(run_bench(observer(fit), moved=True, fit=fit).error) * DEGREES


def _bandwidth(fit: Calibration) -> float:
    found = closed_loop_bandwidth(run_chirp(observer(fit), fit), paper.chirp())
    return 125.0 if found is None else found  # above the chirp's end


if __name__ == "__main__":
    for name, found in (("main", calibrate()), ("second", calibrate(exact_observer=True))):
        print(f"[calibration.{name}]")
        for key, value in asdict(found).items():
            print(f"{key} = {value:.4f}")
