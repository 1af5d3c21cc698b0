"""The adaptive law: Eq. 14's symbols, the printed gains on a sampled loop, the Lyapunov bound."""

import numpy as np

from bowden.control.laws.adaptive import PRINTED, ultimate_bounds
from bowden.control.stability import adaptive_model, closed_loop_poles, servo_model
from bowden.core.units import DEGREES
from bowden.paper.bench import adaptive, bench_run, run_bench, true_bound
from bowden.paper.calibration import bench_fit, gains
from bowden.paper.experiment import Finding
from bowden.paper.readings import BETA_ABSORBED, COMMAND_IN_EQ14
from bowden.plants.bench import Bench
from bowden.plants.presets.bench import bench
from bowden.records.metrics import rmse


def run() -> Finding:
    """Points 4, 7, 9 and 11 of docs/background/theory.md."""
    plant = bench(bench_fit())
    chosen = adaptive().gains._asdict()
    others = [rmse(run_bench(law.with_gains(**chosen)).error) * DEGREES for law in (COMMAND_IN_EQ14, BETA_ABSORBED)]
    bounds = {
        name: ultimate_bounds(of, plant.cable.slope, true_bound())
        for name, of in (("printed", PRINTED), ("default", PRINTED._replace(**gains("bench"))))
    }
    return Finding(
        title="The adaptive law: readings of Eq. 14, the printed gains on a sampled loop, the Lyapunov bound",
        values={
            "erratum.eq14.command": others[0],
            "erratum.eq14.absorbed": others[1],
            "erratum.gains.pole": largest_pole(plant),
            "erratum.gains.fastest_servo": fastest_servo(plant),
            "erratum.lyapunov": bounds["printed"].error * DEGREES,
            "erratum.lyapunov.default": bounds["default"].error * DEGREES,
            "erratum.rmse": float(
                np.sqrt(np.sum((bench_run("adaptive").error * DEGREES) ** 2)) / len(bench_run("adaptive"))
            ),
        },
        details={
            "ours": rmse(bench_run("adaptive").error) * DEGREES,
            "omega": plant.servo.natural_frequency,
            "criterion": PRINTED.error_gain / plant.cable.slope * plant.servo.natural_frequency**2 * plant.sample_time,
            "fastest_without_delay": fastest_servo(plant._replace(delay=0)),
            "peak": float(np.max(np.abs(bench_run("adaptive").error))) * DEGREES,
        },
        text="The printed gains hold on the paper's own static plant, where law and plant are solved together, and "
        "diverge in a sampled loop round a servo as fast as ours. What servo, delay and filter the authors had is not "
        "printed.",
    )


def largest_pole(plant: Bench) -> float:
    """Largest closed-loop pole of the printed gains with β̂ at its true value."""
    law = adaptive_model(PRINTED, plant.sample_time, 1.0 / plant.cable.slope, 0.0)
    loop = servo_model(plant.servo, plant.sample_time, plant.delay, plant.cable.slope)
    return float(np.max(np.abs(closed_loop_poles(loop, law))))


def fastest_servo(plant: Bench) -> float:
    """Natural frequency up to which the printed gains are stable round the servo, β̂ at its true value [rad/s]."""
    low, high = 1.0, 200.0
    while high - low > 1e-3:
        middle = 0.5 * (low + high)
        stable = largest_pole(plant._replace(servo=plant.servo._replace(natural_frequency=middle))) < 1.0
        low, high = (middle, high) if stable else (low, middle)
    return low
