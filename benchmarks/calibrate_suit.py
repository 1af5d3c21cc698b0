"""Fit what the paper does not say of its suit to its rows without compensation, for plants/presets/paper.toml.

Three unknowns, three published figures, of the second flexion of a run without compensation, which has forgotten the
first:

    friction at the spool      ←  Fig. 17, electrical energy of one flexion and extension (25 s)
    play of the cables         ←  Fig. 17, largest error
    period of Fig. 6           ←  Fig. 6, delay

Friction makes the current and, since the drive's loop is PD, leaves the spool behind its target both ways; the rest of
the error is the play's. A delay of 3 s at the period of Fig. 17 would be an error of up to 1.875·90°/12.5 s·3 s = 40°,
more than the 30° that are published; Fig. 6 names no period, so that it is the unknown there.

On a drive with an integral (``second``) friction leaves no error behind, so that the 30° are the play's alone. A play
so wide in cables of 8 kN/m costs 540 J by itself, more than the published 380.5 J; so the cable's stiffness, which
turns play into force, takes the place of friction, which is 0: the least that the choice of 8 kN/m has to be changed.

Run it with ``python benchmarks/calibrate_suit.py``.
"""

from collections.abc import Callable
from dataclasses import asdict, replace

from scipy.optimize import brentq

from bowden.control import LAWS
from bowden.core.metrics import delay
from bowden.core.trace import Trace
from bowden.paper.claims import claims
from bowden.plants.presets.suit import SuitCalibration, suit_calibration
from bowden.sim.suit_runs import energies, largest_errors, run_suit

START = SuitCalibration(friction=2.2, half_width=0.002, period=35.0)
"""Where the fit begins."""


def uncompensated(fit: SuitCalibration, period: float | None = None) -> Trace:
    """Two flexions without compensation."""
    return run_suit(LAWS["uncompensated"], count=2, period=period, fit=fit)


def calibrate_suit(start: SuitCalibration = START, rounds: int = 3) -> SuitCalibration:
    """The calibration; the first two unknowns touch one another's figures and are gone through `rounds` times."""
    published = {claim.id: claim.published for claim in claims() if claim.published is not None}
    fit = start
    for _ in range(rounds):
        fit = _solve(fit, "friction", _energy, published["fig17.uncompensated.energy"], (1.0, 3.5))
        fit = _solve(fit, "half_width", _error, published["fig17.uncompensated.error"], (0.0005, 0.005))
    return _solve(fit, "period", _delay, published["fig6.delay"], (25.0, 60.0))


def calibrate_second(rounds: int = 6) -> SuitCalibration:
    """The same on a drive with an integral, without friction at the spool, the cable's stiffness as an unknown."""
    published = {claim.id: claim.published for claim in claims() if claim.published is not None}
    fit = replace(suit_calibration("second"), friction=0.0)
    for _ in range(rounds):
        fit = _solve(fit, "half_width", _error, published["fig17.uncompensated.error"], (0.011, 0.014))
        fit = _solve(fit, "cable_stiffness", _energy, published["fig17.uncompensated.energy"], (4000.0, 8000.0))
    return _solve(fit, "period", _delay, published["fig6.delay"], (25.0, 60.0))


def _solve(
    fit: SuitCalibration,
    name: str,
    figure: Callable[[SuitCalibration], float],
    wanted: float,
    bracket: tuple[float, float],
) -> SuitCalibration:
    def miss(value: float) -> float:
        return figure(replace(fit, **{name: value})) - wanted

    return replace(fit, **{name: brentq(miss, *bracket, xtol=1e-6, rtol=1e-5)})


def _energy(fit: SuitCalibration) -> float:
    return float(energies(uncompensated(fit))[1])


def _error(fit: SuitCalibration) -> float:
    return float(largest_errors(uncompensated(fit))[1])


def _delay(fit: SuitCalibration) -> float:
    trace = uncompensated(fit, fit.period)
    found = delay(trace.time, trace["reference"], trace["joint"])
    return float("nan") if found is None else found


if __name__ == "__main__":
    for name, found in (("main", calibrate_suit()), ("second", calibrate_second())):
        print(f"[suit.calibration.{name}]")
        for key, value in asdict(found).items():
            print(f"{key} = {value:.6g}")
