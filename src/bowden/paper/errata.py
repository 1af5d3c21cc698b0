"""Charges against the printed text: the cable's model, the adaptive law's symbols, gains and bound, and the chirp."""

from dataclasses import replace

import numpy as np

from bowden.control.law import Law
from bowden.control.laws.adaptive import PRINTED, ultimate_bounds
from bowden.control.stability import adaptive_model, closed_loop_poles, servo_model
from bowden.core.kernel import compiled
from bowden.core.units import DEGREES, RADIANS
from bowden.drawing.style import COLOURS, legend, new_figure, thin
from bowden.models.cable.bouc_wen import BoucWen, advance, joint_angle, saturation, slope_of_h
from bowden.models.cable.sheath import width
from bowden.models.drive.encoder import Encoder
from bowden.paper.bench import adaptive, bench_run, observer, run_bench, true_bound
from bowden.paper.calibration import bench_fit, gains
from bowden.paper.experiment import Finding
from bowden.paper.readings import BETA_ABSORBED, COMMAND_IN_EQ14, self_fed
from bowden.plants.bench import Bench
from bowden.plants.presets import paper
from bowden.plants.presets.bench import bench
from bowden.records.metrics import rmse
from bowden.records.trace import Trace
from bowden.sim.run import simulate


def cable_errata() -> Finding:
    """Points 5, 6 and 8 of docs/background/theory.md, on the cable with the printed parameters."""
    cable = BoucWen()
    top = float(saturation(cable))
    slopes = [cable.slope + cable.hysteresis_gain * float(-slope_of_h(h, -1.0, cable)) for h in (0.0, top)]
    travel = np.linspace(0.0, 0.4, 2001)
    h = np.array([compiled(advance)(top, -x, cable) for x in travel])
    joint = np.array([joint_angle(-x, value, cable) for x, value in zip(travel, h, strict=True)])
    wrong_way = float(np.max(joint) - joint[0]) * DEGREES
    figure, (axes,) = new_figure(width=8.6, height=3.4)
    axes.plot(travel * DEGREES, (joint - joint[0]) * DEGREES, color=COLOURS["joint"])
    axes.plot(travel * DEGREES, -cable.slope * travel * DEGREES, ":", color=COLOURS["reference"])
    axes.set(xlabel="motor travel after the reversal [°]", ylabel="joint motion [°]", xlim=(0, 15), ylim=(-10, 2))
    sheath = bench(bench_fit()).sheath
    exact = exact_observer()
    clean = _observer_deg(exact, 0.0)
    silent = bench(bench_fit())._replace(motor_encoder=Encoder(), joint_encoder=Encoder())
    fed, quiet = (simulate(silent, law, paper.minimum_jerk(), duration=20.0) for law in (self_fed(exact), exact))
    return Finding(
        title="The cable as printed: its unit, its reversals, its gap",
        values={
            "erratum.units": 2.0 * abs(cable.hysteresis_gain) * top * DEGREES,
            "erratum.monotone.slope": min(slopes),
            "erratum.monotone.wrong_way": wrong_way,
            "erratum.monotone.noise": _observer_deg(exact, 0.1) - clean,
            "erratum.monotone.self_fed": _jump_deg(fed),
            "erratum.gap": width(sheath.bend, sheath._replace(gap=2.0)) / width(sheath.bend, sheath._replace(gap=1.0)),
        },
        intervals={
            "erratum.units": (2.0 * abs(cable.hysteresis_gain) * top, 2.0 * abs(cable.hysteresis_gain) * top * DEGREES)
        },
        details={
            "degrees": 2.0 * abs(cable.hysteresis_gain) * top,
            "slope_at_zero": slopes[0],
            "noise_small": _observer_deg(exact, 0.05) - clean,
            "exact_rmse": clean,
            "jump": _jump_deg(quiet),
            "self_fed_rmse": rmse(fed.error) * DEGREES,
            "quiet_rmse": rmse(quiet.error) * DEGREES,
        },
        figures=[
            (
                figure,
                "Joint over motor after a reversal with the printed parameters: the joint first moves the wrong way "
                "(solid). Dotted: the slope alone.",
            )
        ],
    )


def exact_observer() -> Law:
    """The observer that knows the bench's cable exactly."""
    return observer(replace(bench_fit(), observer_share=1.0))


def _observer_deg(law: Law, noise_deg: float) -> float:
    encoder = Encoder(resolution=0.0, noise=noise_deg * RADIANS)
    plant = bench(bench_fit())._replace(motor_encoder=encoder, joint_encoder=encoder)
    return rmse(simulate(plant, law, paper.minimum_jerk(), duration=20.0, seed=1).error) * DEGREES


def _jump_deg(trace: Trace) -> float:
    """Largest change of the command within one cycle [deg]."""
    return float(np.nanmax(np.abs(np.diff(trace["command"])))) * DEGREES


def law_errata() -> Finding:
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


def chirp_errata() -> Finding:
    """sin(2π·f(t)) beside the chirp with the integrated phase."""
    chirp = paper.chirp()
    time = np.arange(0.0, chirp.duration, 1e-3)
    f = chirp.f0 + (chirp.f1 - chirp.f0) / chirp.duration * time
    printed = np.sin(2.0 * np.pi * f)
    crossings = np.flatnonzero(np.signbit(printed[:-1]) != np.signbit(printed[1:]))
    tone = 0.5 * (len(crossings) - 1) / float(time[crossings[-1]] - time[crossings[0]])
    figure, (axes,) = new_figure(width=8.6, height=2.8)
    part = time <= 20.0
    meant = chirp.sample(time[part])[:, 0] / chirp.amplitude
    axes.plot(*thin(time[part], meant, most=1500), color=COLOURS["data"], linewidth=0.7, label="integrated phase")
    axes.plot(time[part][::20], printed[part][::20], color=COLOURS["error"], label="as printed")
    axes.set(xlabel="time [s]", ylabel="φd / S₀ [–]")
    legend(axes)
    return Finding(
        title="The chirp of Eq. 17",
        values={"erratum.chirp": tone},
        figures=[(figure, "Eq. 17 as printed, and with the integral of the frequency as phase.")],
    )
