"""The page of ``bowden arm check``: what our equations and MuJoCo's model of the same arm say, side by side."""

from typing import TYPE_CHECKING

from bowden.core.style import CYCLE, legend, new_figure, thin
from bowden.core.units import DEGREES
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
        "Eqs 1–2 and the elbow's dynamics against a model that has neither: two tendons through the anchor points, a "
        "cylinder at the joint, and a body on a hinge.",
    )
    for reason in found.reasons:
        page.notice(f"Not in agreement: {reason}.")
    picture = arm_data_uri(geometry, arm)
    if picture is not None:
        page.text(
            '<div class="wide"><img src="{picture}" alt="The arm at four angles" style="width: 100%"></div>'
            "<p>Drawn by MuJoCo, with the tension that holds the arm at each angle.</p>",
            picture=picture,
        )
    page.heading("Cables")
    _cables(page, geometry, found)
    page.heading("Motion")
    page.table(
        ["motion", "lasts [s]", "largest difference [deg]", "allowed [deg]"],
        [
            [one.name, f"{one.time[-1]:.0f}", f"{one.error * DEGREES:.2g}", f"{MOTION_LIMIT * DEGREES:g}"]
            for one in found.motions
        ],
        "MuJoCo by its RK4 at 1 ms. The first three against our equation by SciPy; the others against the simulated "
        "suit: MuJoCo is pulled by its tensions, and begins anew every 2 s.",
    )
    page.figure(motion_figure(found), "Elbow by both, one over the other, and the size of their difference.")
    page.figure(
        convergence_figure(found),
        "Largest difference over MuJoCo's time step. A tension is constant through a step, so that RK4 is of second "
        "order where cables pull, and of fourth where none does; Euler is of first.",
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
    axes[0].set_ylabel("elbow [deg]")
    axes[count].set_ylabel("difference [deg]")
    axes[count - 1].legend(loc="lower center")
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
    axes.set(xlabel="MuJoCo's step [ms]", ylabel="difference [deg]")
    axes.set_xticks([1, 2, 4, 8], ["1", "2", "4", "8"], minor=False)
    axes.minorticks_off()
    legend(axes, 3)
    return figure


def _cables(page: Page, geometry: SuitGeometry, found: Agreement) -> None:
    cables = found.cables
    page.table(
        ["cable", "travel 0–90° [mm]", "largest difference [mm]", "moment arm, difference [mm]", "allowed [mm]"],
        [
            [
                name,
                f"{_MM * travel:.2f}",
                f"{_MM * error:.1e}",
                f"{_MM * lever:.1e}",
                f"{_MM * EXCURSION_LIMIT:g}, {_MM * MOMENT_ARM_LIMIT:g}",
            ]
            for name, travel, error, lever in (
                ("flexor, Eq. 1", cables.flexor_travel, cables.flexor, cables.flexor_arm),
                ("extensor, Eq. 2", cables.extensor_travel, cables.extensor, cables.extensor_arm),
            )
        ],
        "MuJoCo's tendons against Eqs 1–2 and their derivatives; travels are MuJoCo's own.",
    )
    page.text(
        "Anchors {b} mm from the joint, {a} mm off the axis; cylinder of {radius} mm. The extensor lies on the "
        "cylinder, and Eq. 2 holds, from {lowest}° on.",
        a=f"{_MM * geometry.half_width:g}",
        b=f"{_MM * geometry.anchor_distance:g}",
        radius=f"{_MM * geometry.joint_radius:g}",
        lowest=f"{cables.lowest * DEGREES:.1f}",
    )
