"""The page of ``bowden arm check``: what our equations and MuJoCo's model of the same arm say, side by side."""

from typing import TYPE_CHECKING

from bowden.core.units import DEGREES
from bowden.drawing.style import CYCLE, legend, new_figure, thin
from bowden.models.suit.arm import Arm
from bowden.models.suit.geometry import SuitGeometry
from bowden.report.arm_pictures import arm_data_uri
from bowden.report.page import Page
from bowden.sim.arm_agreement import Agreement
from bowden.sim.arm_check import EXCURSION_LIMIT, MOMENT_ARM_LIMIT, MOTION_LIMIT

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_MM = 1e3


def arm_page(geometry: SuitGeometry, arm: Arm, found: Agreement) -> Page:
    """The page; its picture is left out where nothing can draw it.

    Args:
        geometry: the suit's.
        arm: the wearer's.
        found: what was compared.
    """
    page = Page(
        "The suit on the arm, checked by MuJoCo",
        "Eqs 1–2 of Dinh 2017 and our equation of the elbow, compared with a model that uses neither: two tendons "
        "through the anchor points, a cylinder at the joint, and a body on a hinge.",
    )
    for reason in found.reasons:
        page.notice(f"Not in agreement: {reason}.")
    picture = arm_data_uri(geometry, arm)
    if picture is not None:
        page.text(
            '<div class="wide card"><img src="{picture}" alt="The arm at four angles" style="width: 100%"></div>'
            "<p>Drawn by MuJoCo, with the tension that holds the arm at each angle.</p>",
            picture=picture,
        )
    page.heading("Cables")
    _cables(page, geometry, found)
    page.heading("Motion")
    page.table(
        ["motion", "duration [s]", "largest difference [°]", "allowed [°]"],
        [
            [one.name, f"{one.time[-1]:.0f}", f"{one.error * DEGREES:.2g}", f"{MOTION_LIMIT * DEGREES:g}"]
            for one in found.motions
        ],
        "MuJoCo with its RK4 at 1 ms. The first three motions are compared with our equation, solved by SciPy; the "
        "others with the simulated suit: its tensions pull MuJoCo's arm, which starts again from the suit's every 2 s.",
    )
    page.figure(
        motion_figure(found),
        "Above: elbow angle by both, one over the other. Below: size of their difference; dashed: what is allowed.",
    )
    page.figure(
        convergence_figure(found),
        "Largest difference over MuJoCo's time step; dotted: what is allowed. A tension is constant during a step, so "
        "RK4 is of second order where cables pull and of fourth order where none does; Euler is of first order.",
    )
    return page


def motion_figure(found: Agreement) -> "Figure":
    """Each motion above, the difference below."""
    count = len(found.motions)
    figure, axes = new_figure(2, count, width=2.3 * count, height=4.2, share_x=True)
    for above, below, motion in zip(axes[:count], axes[count:], found.motions, strict=True):
        above.plot(*thin(motion.time, motion.ours * DEGREES), color=CYCLE[0], linewidth=3.0, alpha=0.45, label="ours")
        above.plot(*thin(motion.time, motion.mujoco * DEGREES), color=CYCLE[1], linewidth=1.0, label="MuJoCo")
        above.set_title(motion.name)
        below.semilogy(*thin(motion.time, abs(motion.mujoco - motion.ours) * DEGREES + 1e-12), color=CYCLE[7])
        below.axhline(MOTION_LIMIT * DEGREES, color=CYCLE[6], linestyle="--", linewidth=1.0)
        below.set(xlabel="time [s]", ylim=(1e-12, 3.0))
    axes[0].set_ylabel("elbow [°]")
    axes[count].set_ylabel("difference [°]")
    legend(axes[0], 1)
    return figure


def convergence_figure(found: Agreement) -> "Figure":
    """The largest difference of each motion over MuJoCo's step, by integrator."""
    figure, (axes,) = new_figure(width=8.6, height=3.6)
    marks = {"Euler": "--", "RK4": "-"}
    names = list(dict.fromkeys(name for name, _ in found.convergences))
    for name, one in found.convergences:
        axes.loglog(
            [_MM * step for step in one.steps],
            [error * DEGREES for error in one.errors],
            marks[one.integrator],
            marker="o",
            markersize=3.5,
            color=CYCLE[names.index(name)],
            label=f"{name}, {one.integrator}",
        )
    axes.axhline(MOTION_LIMIT * DEGREES, color=CYCLE[6], linewidth=1.0, linestyle=":")
    axes.set(xlabel="MuJoCo's step [ms]", ylabel="difference [°]")
    axes.set_xticks([1, 2, 4, 8], ["1", "2", "4", "8"], minor=False)
    axes.minorticks_off()
    legend(axes, 3)
    return figure


def _cables(page: Page, geometry: SuitGeometry, found: Agreement) -> None:
    cables = found.cables
    page.table(
        [
            "cable",
            "travel 0–90° [mm]",
            "difference [mm]",
            "allowed [mm]",
            "moment arm: difference [mm]",
            "allowed [mm]",
        ],
        [
            [
                name,
                f"{_MM * travel:.2f}",
                f"{_MM * error:.1e}",
                f"{_MM * EXCURSION_LIMIT:g}",
                f"{_MM * lever:.1e}",
                f"{_MM * MOMENT_ARM_LIMIT:g}",
            ]
            for name, travel, error, lever in (
                ("flexor, Eq. 1", cables.flexor_travel, cables.flexor, cables.flexor_arm),
                ("extensor, Eq. 2", cables.extensor_travel, cables.extensor, cables.extensor_arm),
            )
        ],
        "MuJoCo's tendons compared with Eqs 1–2 and their derivatives, largest differences; travels are MuJoCo's.",
    )
    page.text(
        "Anchors {b} mm from the joint, {a} mm off the axis; cylinder of {radius} mm. The extensor lies on the "
        "cylinder, and Eq. 2 holds, from {lowest}° on.",
        a=f"{_MM * geometry.half_width:g}",
        b=f"{_MM * geometry.anchor_distance:g}",
        radius=f"{_MM * geometry.joint_radius:g}",
        lowest=f"{cables.lowest * DEGREES:.1f}",
    )
