"""Calibrations of the paper's bench and suit that fit its rows without the adaptive law, and what each predicts.

    fit            the fitted parameters of the main calibration, for src/bowden/paper/calibration.toml
    gains          the adaptive law's gains by margin, for the same file
    draw OMEGA N   N sets whose servo has that ω [rad/s], appended to src/bowden/paper/plausible_sets.csv

A set is drawn evenly over the plausible ranges of the stated choices, N = 20 for each ω of 60, 70, … 140 rad/s. Then
what is fitted is fitted: speed limit, observer's share and loss on the bench, friction and play of the suit and the
period of Fig. 6. 180 such sets are in the file with a feeder without drag (`feeder_drag` 0), as they were first drawn;
the others are some of the same draws with the drag drawn too, and the suit refitted: the bench does not feel it. The
paper's report keeps a set where each of the fitted rows comes out within 5 %. Gains are by margin at the set's ω, all
else as in the main calibration. The motors of a set's bench and suit are one motor.
"""

import csv
import sys
import time
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from bowden.control import LAWS
from bowden.control.law import Law
from bowden.core.units import DEGREES
from bowden.paper.bench import adaptive, observer, run_bench, run_chirp
from bowden.paper.calibration import bench_fit, parameters, suit_fit, values
from bowden.paper.claims import claims
from bowden.paper.figures_of_merit import closed_loop_bandwidth
from bowden.paper.gain_choice import choose_gains
from bowden.paper.suit_rows import five_flexions, motions_of, uncompensated
from bowden.plants.presets import bench as paper
from bowden.plants.presets.suit import suit
from bowden.records.metrics import rmse
from bowden.sim.suit_runs import DRIVE_INTEGRAL
from suit_gains import choose_suit_gains

DATA = Path(__file__).parents[1] / "src" / "bowden" / "paper" / "plausible_sets.csv"
PUBLISHED = {claim.id: claim.published for claim in claims() if claim.published is not None}
CHIRP = 60.0
"""Of the chirp's 150 s, to 8 Hz: what shows a bandwidth up to 49 rad/s [s]."""


def secant(
    miss: Callable[[float], float], at: float, low: float, high: float, close: float = 0.01, most: int = 7
) -> float:
    """Where a relative miss is within `close` of zero, by the secant rule between `low` and `high`; the best seen."""

    def known(value: float) -> float:
        found = miss(value)
        return found if np.isfinite(found) else 1.0

    seen = [(at, known(at))]
    following = np.clip(at * 1.05, low, high)
    while abs(seen[-1][1]) > close and len(seen) < most:
        seen.append((following, known(following)))
        (x0, y0), (x1, y1) = seen[-2:]
        following = float(np.clip(x1 - y1 * (x1 - x0) / (y1 - y0) if y1 != y0 else x1 * 1.1, low, high))
    return float(min(seen, key=lambda one: abs(one[1]))[0])


def bandwidth(p: dict[str, float]) -> float:
    """Of the observer [rad/s]; NaN where it is beyond the chirp's part."""
    return _bandwidth(p, observer(bench_fit(p)))


def _bandwidth(p: dict[str, float], law: Law) -> float:
    found = closed_loop_bandwidth(run_chirp(law, bench_fit(p), CHIRP), paper.chirp())
    return float("nan") if found is None else found


def observer_deg(p: dict[str, float], moved: bool) -> float:
    """RMSE of the observer [deg]."""
    fit = bench_fit(p)
    return rmse(run_bench(observer(fit), moved=moved, fit=fit).error) * DEGREES


def fit(p: dict[str, float], close: float = 0.01) -> dict[str, float]:
    """The parameters with those that are fitted set by their rows."""
    known, p = parameters(), dict(p)

    def solve(name: str, claim: str, figure: Callable[[dict[str, float]], float]) -> None:
        def miss(value: float) -> float:
            return figure(p | {name: value}) / PUBLISHED[claim] - 1.0

        p[name] = secant(miss, p[name], known[name].low, known[name].high, close)

    solve("observer_share", "table1.observer.constant", lambda q: observer_deg(q, False))
    solve("speed_limit", "fig16.observer.bandwidth", bandwidth)
    solve("loss", "table1.observer.varying", lambda q: observer_deg(q, True))
    for _ in range(3):
        figures = uncompensated(suit_fit(p))
        if abs(figures.energy / 380.5 - 1) < close and abs(figures.error / 30.0 - 1) < close:
            break
        solve("play", "fig17.uncompensated.error", lambda q: uncompensated(suit_fit(q)).error)
        solve("friction", "fig17.uncompensated.energy", lambda q: uncompensated(suit_fit(q)).energy)
    solve("fig6_period", "fig6.delay", lambda q: uncompensated(suit_fit(q), q["fig6_period"]).delay)
    return p


@cache
def bench_gains(omega: float) -> dict[str, float]:
    """λ and κ on the bench, by margin."""
    found = choose_gains(paper.bench(bench_fit(values() | {"natural_frequency": omega}))).gains
    return {"error_gain": found.error_gain, "feedback_gain": found.feedback_gain}


@cache
def suit_gains(omega: float, integral: float = 0.0) -> dict[str, float]:
    """λ, κ and ε on the suit, by margin."""
    made = suit(suit_fit(values() | {"natural_frequency": omega}))
    found = choose_suit_gains(made._replace(motor=made.motor._replace(integral=integral))).gains
    return {name: getattr(found, name) for name in ("error_gain", "feedback_gain", "smoothing")}


def predictions(p: dict[str, float]) -> dict[str, float]:
    """The rows of the adaptive law, and those that were fitted."""
    omega = p["natural_frequency"]
    on_bench, law, fitted = bench_fit(p), adaptive(**bench_gains(omega)), suit_fit(p)
    free = uncompensated(fitted)
    suit_law = LAWS["adaptive"].with_gains(**(LAWS["adaptive"].gains._asdict() | suit_gains(omega)))
    five = five_flexions(suit_law, fit=fitted)
    motions = motions_of(suit_law, p["motion_time"], fit=fitted)
    return {
        "table1.observer.constant": observer_deg(p, False),
        "table1.observer.varying": observer_deg(p, True),
        "fig16.observer.bandwidth": bandwidth(p),
        "fig17.uncompensated.energy": free.energy,
        "fig17.uncompensated.error": free.error,
        "fig6.delay": uncompensated(fitted, p["fig6_period"]).delay,
        "table1.adaptive.constant": rmse(run_bench(law, fit=on_bench).error) * DEGREES,
        "table1.adaptive.varying": rmse(run_bench(law, moved=True, fit=on_bench).error) * DEGREES,
        "fig16.adaptive.bandwidth": _bandwidth(p, law),
        "fig17.adaptive.energy": five.energy,
        "fig17.adaptive.error": five.mean,
        "fig17.adaptive.error.worst": five.worst,
        "fig17.adaptive.error.last": five.last,
        "fig19.error": motions.error,
        "fig19.delay": motions.current,
        "fig19.delay.shift": motions.shift,
        "fig19.delay.moved": motions.moved,
    }


def draw(omega: float, number: int) -> dict[str, float]:
    """The stated choices of a set, evenly over their ranges."""
    random, p = np.random.default_rng((round(omega), number)), values()
    for name, one in parameters().items():
        if not one.fitted_to or name == "half_width":
            p[name] = float(random.uniform(one.low, one.high))
    return p | {"natural_frequency": omega}


def main(arguments: list[str]) -> None:
    """See above."""
    if arguments[0] == "fit":
        for name, value in fit(values(), 1e-3).items():
            print(f"{name} = {value:.5g}")
    elif arguments[0] == "gains":
        omega = values()["natural_frequency"]
        print(bench_gains(omega), suit_gains(omega), suit_gains(omega, DRIVE_INTEGRAL), sep="\n")
    else:
        omega, count = float(arguments[1]), int(arguments[2])
        for number in range(count):
            begun = time.perf_counter()
            p = fit(draw(omega, number), 0.02)
            row = p | predictions(p)
            new = not DATA.exists()
            with DATA.open("a", newline="", encoding="utf-8") as file:
                writer = csv.DictWriter(file, list(row), lineterminator="\n")
                if new:
                    writer.writeheader()
                writer.writerow({name: f"{value:.4g}" for name, value in row.items()})
            print(omega, number, f"{time.perf_counter() - begun:.0f} s", flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
