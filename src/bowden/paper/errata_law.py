"""Errata of the adaptive law: Eq. 14's symbols, the printed gains on a sampled loop, the Lyapunov bound."""

import numpy as np

from bowden.control import LAWS
from bowden.control.laws.adaptive import PRINTED, ultimate_bounds
from bowden.control.stability import adaptive_model, closed_loop_poles, servo_model
from bowden.core.metrics import rmse
from bowden.core.units import DEGREES
from bowden.models.cable.backlash import Play
from bowden.paper.bench import run_bench, true_bound
from bowden.paper.experiment import Finding, Runs
from bowden.paper.readings import BETA_ABSORBED, COMMAND_IN_EQ14
from bowden.paper.static_plant import static_plant_run
from bowden.plants.bench import Bench
from bowden.rig.presets import bench as paper


def run(runs: Runs) -> Finding:
    """Errata 4, 7, 9 and 11."""
    plant = paper.bench()
    ours = rmse(runs.adaptive.error) * DEGREES
    others = [rmse(run_bench(law).error) * DEGREES for law in (COMMAND_IN_EQ14, BETA_ABSORBED)]
    printed = run_bench(LAWS["adaptive"].preset("paper"))
    bounds = {
        name: ultimate_bounds(gains, plant.cable.slope, true_bound())
        for name, gains in (("printed", PRINTED), ("default", LAWS["adaptive"].gains))
    }
    static = static_plant_run(
        PRINTED, Play(half_width=true_bound() / plant.cable.slope), paper.minimum_jerk(), 60.0, plant.sample_time
    )
    static_error = (static.joint - static.reference) * DEGREES
    return Finding(
        title="Errata 4, 7, 9 and 11: the adaptive law as printed",
        values={
            "erratum.eq14.command": others[0],
            "erratum.eq14.absorbed": others[1],
            "erratum.gains.pole": largest_pole(plant),
            "erratum.gains.fastest_servo": fastest_servo(plant),
            "erratum.gains.static": rmse(static_error),
            "erratum.gains.static_after_10s": rmse(static_error[static.time >= 10.0]),
            "erratum.lyapunov": bounds["printed"].error * DEGREES,
            "erratum.lyapunov.default": bounds["default"].error * DEGREES,
            "erratum.rmse": float(np.sqrt(np.sum((runs.adaptive.error * DEGREES) ** 2)) / len(runs.adaptive)),
        },
        details={
            "ours": ours,
            "criterion": PRINTED.error_gain / plant.cable.slope * plant.servo.natural_frequency**2 * plant.sample_time,
            "fastest_without_delay": fastest_servo(plant._replace(delay=0)),
            "printed_peak": float(np.nanmax(np.abs(printed.error))) * DEGREES,
            "peak": float(np.max(np.abs(runs.adaptive.error))) * DEGREES,
        },
        text="The printed gains hold on the paper's own static plant, where law and plant are solved together, and "
        "diverge in the sampled loop round a servo that is as fast as the paper’s Fig. 16 implies.",
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
