"""The suit under two readings of its drive: PD, and with the integral that position regulators one buys have.

The paper states its PD loop for the bench. On a drive with an integral spool and target agree but for moments, and the
30° without compensation have to be the play's alone: the second calibration (`benchmarks/calibrate_suit.py`). The
compensated rows are predicted under each, with the adaptive law's gains by the same rule on the loop of each.
"""

import numpy as np

from bowden.control import LAWS
from bowden.control.law import Law
from bowden.core.metrics import delay
from bowden.models.suit.geometry import flexor_extension
from bowden.paper.claims import number
from bowden.paper.fig18_clinic import Clinic, clinic
from bowden.report.page import Page
from bowden.rig.presets.suit import (
    SuitCalibration,
    energies,
    largest_errors,
    run_suit,
    suit,
    suit_adaptive,
    suit_adaptive_integral,
    suit_calibration,
    suit_ours,
)

ROWS = (
    ("suit: energy without compensation [J]", 380.5, True),
    ("suit: largest error without compensation [deg]", 30.0, True),
    ("suit: delay without compensation [s]", 3.0, True),
    ("suit: energy, adaptive [J]", 520.7, False),
    ("suit: largest error, adaptive, five flexions [deg]", 5.0, False),
    ("suit: largest error, adaptive, fifth flexion [deg]", 5.0, False),
    ("suit: largest error after the first second of seven EMG motions, adaptive [deg]", 5.0, False),
    ("suit: from detection to motion, adaptive, median [s]", 0.2, False),
)
"""Quantity, published figure, whether the calibrations were fitted to it."""


def predictions(fit: SuitCalibration, law: Law, with_emg: Clinic) -> list[float]:
    """The figures of `ROWS` under a calibration and a law."""
    plain = LAWS["uncompensated"]
    free, slow = run_suit(plain, count=2, fit=fit), run_suit(plain, count=2, period=fit.period, fit=fit)
    late = delay(slow.time, slow["reference"], slow["joint"])
    five = run_suit(law, fit=fit)
    _, begun, error = with_emg.go(law, fit=fit)
    worst = largest_errors(five)
    return [
        float(energies(free)[1]),
        float(largest_errors(free)[1]),
        float("nan") if late is None else late,
        float(energies(five).mean()),
        float(worst.max()),
        float(worst[-1]),
        float(error.max()),
        float(np.median(begun)),
    ]


def table() -> list[dict[str, object]]:
    """Each row of `ROWS` with what both calibrations give."""
    made = clinic()
    main = predictions(suit_calibration(), suit_adaptive(), made)
    second = predictions(suit_calibration("second"), suit_adaptive_integral(), made)
    return [
        {"quantity": name, "published": published, "fitted": fitted, "main": a, "second": b}
        for (name, published, fitted), a, b in zip(ROWS, main, second, strict=True)
    ]


def stated_stiffness_energy() -> float:
    """What the second reading's play costs in cables of the stated stiffness, without any friction at the spool [J]."""
    fit = SuitCalibration(0.0, 0.01081, 25.0, drive_integral=suit_calibration("second").drive_integral)
    return float(energies(run_suit(LAWS["uncompensated"], count=2, fit=fit))[1])


def section(page: Page, rows: list[dict[str, object]]) -> None:
    """Both readings on the page, and why the first one is the main one."""
    main, second = suit_calibration(), suit_calibration("second")
    geometry = suit().geometry
    travel = flexor_extension(0.0, geometry) - flexor_extension(0.5 * np.pi, geometry)
    ours = largest_errors(run_suit(suit_ours(), fit=second))
    page.heading("Two readings of the suit's drive")
    page.text(
        "The paper states its PD loop for the bench only. Main: the suit's drive is PD too. Second: it is a position "
        "regulator with an integral, as drives that one buys have. Each was calibrated on the rows without "
        "compensation. The second finds no friction that meets both rows: a play that makes 30° by itself "
        f"(±10.8 mm) costs {stated_stiffness_energy():.0f} J in cables of {main.cable_stiffness / 1e3:g} kN/m even "
        "without friction at the spool, so that the cable's stiffness had to become an unknown. "
        f"It needs {2e3 * second.half_width:.0f} mm of play, {100.0 * 2.0 * second.half_width / travel:.0f} % of the "
        f"cable's travel, where the first needs {2e3 * main.half_width:.1f} mm "
        f"({100.0 * 2.0 * main.half_width / travel:.0f} %) and the bench's 5° of 70° (the paper’s Fig. 15) are 7 %. "
        f"Its premises "
        "are the weaker ones, and it stands beside the first. "
        f"Our law learns dead zones of up to 0.5 rad of the joint and does not carry this one: {ours.max():.0f}°."
    )
    page.table(
        ["quantity", "published", "main: PD", "second: integral", "use"],
        [
            [
                str(row["quantity"]).removeprefix("suit: ").replace("[deg]", "[°]"),
                *(number(row[key]) for key in ("published", "main", "second")),
                "fitted" if row["fitted"] else "predicted",
            ]
            for row in rows
        ],
    )
    page.table(
        ["calibration", "friction [N·m]", "play ± [m]", "period [s]", "cable [N/m]", "drive's integral [1/s]"],
        [
            [name, *(f"{value:.4g}" for value in vars(fit).values())]
            for name, fit in (("main", main), ("second", second))
        ],
        caption="The fitted values, as rig/presets/paper.toml has them.",
    )
