"""The cable's model: its units, its wrong-way motion, and what that does to the observer."""

from dataclasses import replace

import numpy as np

from bowden.control.law import Law
from bowden.core.kernel import compiled
from bowden.core.units import DEGREES, RADIANS
from bowden.drawing.style import COLOURS, new_figure
from bowden.models.cable.bouc_wen import BoucWen, advance, joint_angle, saturation, slope_of_h
from bowden.models.cable.sheath import width
from bowden.models.drive.encoder import Encoder
from bowden.paper.bench import observer
from bowden.paper.calibration import bench_fit
from bowden.paper.experiment import Finding
from bowden.paper.readings import self_fed
from bowden.plants.presets import paper
from bowden.plants.presets.bench import bench
from bowden.records.metrics import rmse
from bowden.records.trace import Trace
from bowden.sim.run import simulate


def run() -> Finding:
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
