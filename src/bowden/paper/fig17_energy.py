"""Fig. 17: five flexions and extensions of the suit, their error, power and energy (Eq. 18)."""

import numpy as np

from bowden.control import LAWS
from bowden.core.units import DEGREES
from bowden.drawing.style import COLOURS, legend, new_figure, thin
from bowden.paper.claims import interval
from bowden.paper.experiment import Finding, PageTable
from bowden.paper.suit_rows import BRAKE, DRIVES, RESTS, five_flexions, laws_on, rested, suit_fives, suit_uncompensated
from bowden.records.trace import Trace
from bowden.sim.suit_runs import NO_BRAKE, each_flexion, energies, largest_errors, suit_adaptive


def run() -> Finding:
    """Without compensation (fitted), and under the adaptive law and ours, each on both drives (predicted)."""
    free, five = suit_uncompensated(), suit_fives()
    adaptive = five["PD", "adaptive"]
    figure, panels = new_figure(rows=3, width=8.6, height=6.0, share_x=True)
    drawn = (
        (free, "uncompensated", "uncompensated, PD", "-"),
        (adaptive, "adaptive", "adaptive, PD", "-"),
        (five["integral", "adaptive"], "adaptive", "adaptive, integral", ":"),
        (five["integral", "ours"], "bowden", "ours, integral", ":"),
    )
    parts = each_flexion(free.trace)
    time = free.trace.time[parts[0]]
    for one, colour, name, style in drawn:
        mechanical, electrical = one.trace.power()
        for axes, values in zip(panels, (mechanical, electrical, one.trace["joint"] * DEGREES), strict=True):
            mean = np.mean([values[part] for part in parts], axis=0)
            axes.plot(*thin(time, mean, most=1200), style, color=COLOURS[colour], label=name, lw=1.0)
    reference = free.trace["reference"][parts[0]] * DEGREES
    panels[2].plot(*thin(time, reference), color=COLOURS["reference"], ls="--", label="desired")
    for axes, label in zip(panels, ("$P_m$ [W]", "$P_e$ [W]", "elbow [°]"), strict=True):
        axes.set(ylabel=label)
    panels[0].set(ylim=(-10.0, 30.0))
    panels[1].set(ylim=(-10.0, 60.0))
    panels[2].set(xlabel="time [s]")
    legend(panels[2])
    last = interval("fig17.adaptive.error.last") or (np.nan, np.nan)
    heat = _heat(adaptive.trace) / (len(parts) * adaptive.energy)
    return Finding(
        title="Five flexions of the suit (Dinh 2017, Fig. 17)",
        values={
            "fig17.uncompensated.error": float(largest_errors(free.trace)[1]),
            "fig17.uncompensated.energy": float(energies(free.trace)[1]),
            "fig17.adaptive.energy": adaptive.energy,
            "fig17.adaptive.error": adaptive.mean,
        },
        details={
            "spread": adaptive.spread,
            "preset_energy": five_flexions(suit_adaptive()).energy,
            "error_first": adaptive.first,
            "error_last": adaptive.last,
            "last_low": last[0],
            "last_high": last[1],
            "heat_share": 100.0 * heat,
        },
        figures=[
            (
                figure,
                "Mechanical and electrical power of the motor and the elbow's angle, means of five flexions and "
                "extensions. The jumps by which our law crosses the play leave the upper panels.",
            )
        ],
        tables=[
            PageTable(
                ["law", "drive", "energy [J]", "mean of five [°]", "first [°]", "fifth [°]", "worst [°]"],
                [
                    [name, drive, f"{one.energy:.0f} ± {one.spread:.0f}"]
                    + [f"{value:.1f}" for value in (one.mean, one.first, one.last, one.worst)]
                    for (drive, name), one in [(("PD", "uncompensated"), free), *five.items()]
                ],
                "Energy of a flexion and extension, and largest errors after the first second: of the mean profile, "
                "as the paper’s Fig. 17 shows it, and of single flexions. Each law on the same drives: PD, as the "
                f"paper’s, and with an integral of {DRIVES['integral']:g} 1/s, as drives that one buys.",
            ),
            _braked(),
        ],
        text="The paper shows the mean of five flexions. The first begins with estimates at zero and is the worst. "
        "Friction leaves a PD drive’s spool behind its target, which each law has to make up for; an integral in the "
        "drive does that by itself, so that laws can be compared on one drive only.",
    )


def _braked() -> PageTable:
    """The outlook's clutch (Section 6): what it saves, and what it takes."""
    rows = []
    for drive, name in (("PD", "uncompensated"), ("PD", "adaptive"), ("integral", "ours")):
        law = laws_on(drive).get(name, LAWS["uncompensated"])
        for rest in RESTS:
            free, held = (rested(law, DRIVES[drive], rest, brake) for brake in (NO_BRAKE, BRAKE))
            saved = (free.motor - held.motor) / held.released
            joules = [f"{value:.0f}" for value in (rest, free.motor, held.motor, held.brake)]
            rows.append([name, drive, *joules, f"{max(0.0, saved):.1f}", f"{free.error:.1f}", f"{held.error:.1f}"])
    return PageTable(
        [
            *("law", "drive", "rest at 90° [s]", "motor without [J]", "motor with [J]", "brake itself [J]"),
            *("pays below [W]", "error without [°]", "error with [°]"),
        ],
        rows,
        "The outlook’s clutch: energy of a flexion and extension, mean of five, without and with a holding brake of "
        f"{BRAKE.holding_torque:g} N·m at the motor that holds without current and takes {BRAKE.released_power:g} W "
        f"while it is released; it engages once the motor’s target has rested for {BRAKE.rest_time:g} s. It pays if "
        "it takes less than the power named. The paper’s Fig. 17 has no rests. Under the adaptive law the target "
        "never rests: the law goes on adapting. Errors are the largest of the last three flexions.",
    )


def _heat(trace: Trace) -> float:
    """∫R·I² dt of a run [J]."""
    return float(np.trapezoid(float(trace.settings["motor_resistance"]) * trace["current"] ** 2, trace.time))
