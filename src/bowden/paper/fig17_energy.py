"""Fig. 17: five flexions and extensions of the suit, their error, power and energy (Eq. 18)."""

import numpy as np

from bowden.core.style import COLOURS, legend, new_figure, thin
from bowden.core.trace import Trace
from bowden.core.units import DEGREES
from bowden.models.suit.geometry import flexor_moment_arm
from bowden.paper.experiment import Finding, Runs
from bowden.rig.presets.suit import each_flexion, energies, largest_errors, suit


def run(runs: Runs) -> Finding:
    """Without compensation (fitted), under the adaptive law (predicted), and under ours on a drive with an integral."""
    free, adaptive, ours = runs.suit_uncompensated, runs.suit_adaptive, runs.suit_ours
    made = suit()
    motor = made.motor
    band = motor.friction / motor.efficiency / (motor.inertia * motor.servo.natural_frequency**2)
    levers = [flexor_moment_arm(angle, made.geometry) for angle in (0.0, 0.25 * np.pi)]
    heat = [_heat(free, each_flexion(free)[1]), _heat(adaptive, each_flexion(adaptive)[-1])]
    figure, panels = new_figure(rows=3, width=8.6, height=6.0, share_x=True)
    runs_drawn = (
        (free, 1, "uncompensated", "uncompensated"),
        (adaptive, 4, "adaptive", "adaptive"),
        (ours, 4, "bowden", "ours"),
    )
    for trace, flexion, colour, name in runs_drawn:
        part = each_flexion(trace)[flexion]
        time = trace.time[part] - trace.time[part][0]
        mechanical, electrical = trace.power()
        for axes, values in zip(
            panels, (mechanical[part], electrical[part], trace["joint"][part] * DEGREES), strict=True
        ):
            axes.plot(*thin(time, values, most=1200), color=COLOURS[colour], label=name, lw=1.0)
    panels[2].plot(
        *thin(time, trace["reference"][part] * DEGREES), color=COLOURS["reference"], ls="--", label="desired"
    )
    for axes, label in zip(panels, ("$P_m$ [W]", "$P_e$ [W]", "elbow [°]"), strict=True):
        axes.set(ylabel=label)
    panels[2].set(xlabel="time [s]")
    legend(panels[2])
    errors, of_ours = largest_errors(adaptive), largest_errors(ours)
    return Finding(
        title="Five flexions of the suit (Dinh 2017, Fig. 17)",
        values={
            "fig17.uncompensated.error": float(largest_errors(free)[1]),
            "fig17.uncompensated.energy": float(energies(free)[1]),
            "fig17.adaptive.energy": float(energies(adaptive).mean()),
            "fig17.adaptive.error": float(errors.max()),
        },
        details={
            "spread": float(energies(adaptive).std()),
            "ours_energy": float(energies(ours).mean()),
            "error_first": float(errors[0]),
            "error_last": float(errors[-1]),
            "ours_error": float(of_ours.max()),
            "ours_last": float(of_ours[-1]),
            "band_low": band * made.spool_radius / levers[0] * DEGREES,
            "band_middle": band * made.spool_radius / levers[1] * DEGREES,
            "heat_share": 100.0 * heat[1] / float(energies(adaptive)[-1]),
        },
        figures=[
            (
                figure,
                "Mechanical and electrical power of the motor and the elbow's angle in one flexion and extension: "
                "without compensation, under the adaptive law (its fifth), and our law's fifth with an integral in the "
                "drive.",
            )
        ],
        text=f"Largest error after the first second of each of the five: adaptive {_list(errors)}°, "
        f"ours {_list(of_ours)}°. Energy of each: adaptive {_list(energies(adaptive), 0)} J, "
        f"ours {_list(energies(ours), 0)} J. Nearly all of it is heat in the winding, ∫R·I² dt: {heat[0]:.0f} of "
        f"{energies(free)[1]:.0f} J without compensation, {heat[1]:.0f} of {energies(adaptive)[-1]:.0f} J with it.",
    )


def _heat(trace: Trace, part: slice) -> float:
    """∫R·I² dt [J]."""
    resistance = float(trace.settings["motor_resistance"])
    return float(np.trapezoid(resistance * trace["current"][part] ** 2, trace.time[part]))


def _list(values: np.ndarray, digits: int = 1) -> str:
    return ", ".join(f"{value:.{digits}f}" for value in values)
