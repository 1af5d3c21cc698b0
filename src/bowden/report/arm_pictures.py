"""Pictures of the suit on the arm: a row of postures with the tensions that hold them, for a page or a file."""

import base64
import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from bowden.core.errors import BowdenError
from bowden.core.files import whole_file
from bowden.core.units import DEGREES, RADIANS
from bowden.drawing.style import new_figure
from bowden.models.suit.arm import Arm
from bowden.models.suit.geometry import SuitGeometry
from bowden.report.arm_renderer import EXTENSOR, FLEXOR, ArmRenderer, Image, Pose, cable_colour
from bowden.sim.mujoco_arm import MujocoArm

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

ANGLES = tuple(angle * RADIANS for angle in (0.0, 30.0, 60.0, 90.0))
"""Postures of the row [rad]."""


class HeldPosture(NamedTuple):
    """One posture and what holds it still, by MuJoCo: one cable pulls, the other is slack."""

    angle: float
    """[rad]"""
    flexor: float
    """Tension [N]."""
    extensor: float
    """Tension [N]."""


def holding(geometry: SuitGeometry, arm: Arm, angles: Sequence[float] = ANGLES) -> list[HeldPosture]:
    """What holds the arm against gravity and the passive elbow at each angle [rad].

    Raises:
        BowdenError: MuJoCo is not installed.
        ParameterError: geometry or arm cannot be built.
    """
    model, found = MujocoArm(geometry, arm), []
    for angle in angles:
        torque, (_, (flexor, extensor)) = model.holding_torque(angle), model.cables(angle)
        found.append(HeldPosture(angle, max(float(torque / flexor), 0.0), max(float(torque / extensor), 0.0)))
    return found


def series_figure(geometry: SuitGeometry, arm: Arm, angles: Sequence[float] = ANGLES, pixels: int = 600) -> "Figure":
    """The arm at each angle [rad], angle and tensions written on the picture, tension as the cables' colour.

    Raises:
        BowdenError: MuJoCo, or a way to draw without a screen, is missing.
        ParameterError: geometry or arm cannot be built.
    """
    postures = holding(geometry, arm, angles)
    full = _round_up(max(max(one.flexor, one.extensor) for one in postures))
    with ArmRenderer(geometry, pixels, pixels) as renderer:
        images = [renderer.draw(Pose(one.angle, None, one.flexor / full, one.extensor / full)) for one in postures]
    figure, axes = new_figure(1, len(postures), width=2.75 * len(postures) + 0.9, height=2.9)
    for axis, image, one in zip(axes, images, postures, strict=True):
        _panel(axis, image, one)
    _scale(figure, axes, full)
    return figure


def arm_data_uri(geometry: SuitGeometry, arm: Arm, angles: Sequence[float] = ANGLES) -> str | None:
    """The row of postures as a PNG in a ``data:`` address for a page's ``<img src=…>``.

    Returns:
        The address; None where MuJoCo or a way to draw is missing, since a page can do without its picture.
    """
    try:
        return "data:image/png;base64," + base64.b64encode(_png(series_figure(geometry, arm, angles))).decode("ascii")
    except BowdenError:
        return None


def write_series(path: Path | str, geometry: SuitGeometry, arm: Arm, angles: Sequence[float] = ANGLES) -> None:
    """The row of postures as a PNG file.

    Raises:
        BowdenError: as `series_figure`.
        OutputError: the file cannot be written.
    """
    content = _png(series_figure(geometry, arm, angles))
    with whole_file(path) as part:
        part.write_bytes(content)


def _png(figure: "Figure") -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=150, metadata={"Software": None})
    return buffer.getvalue()


def _panel(axes: "Axes", image: Image, held: HeldPosture) -> None:
    height, width = image.shape[:2]
    axes.imshow(image[: int(0.99 * height), int(0.04 * width) :], interpolation="lanczos")
    axes.set_axis_off()
    write: dict[str, Any] = {"transform": axes.transAxes, "ha": "right", "va": "top"}
    axes.text(0.97, 0.97, f"{held.angle * DEGREES:.0f}°", fontsize=17.0, fontweight="bold", color="#222222", **write)
    for place, name, tension, colour in (
        (0.83, "flexor", held.flexor, FLEXOR),
        (0.755, "extensor", held.extensor, EXTENSOR),
    ):
        said = f"{name} {tension:.0f} N" if tension > 0.0 else f"{name} slack"
        axes.text(0.97, place, said, fontsize=8.5, color=tuple(cable_colour(colour, 1.0 if tension else 0.25)), **write)


def _scale(figure: "Figure", axes: "Sequence[Axes]", full: float) -> None:
    """Two colour bars, one a cable, on one scale."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    for name, colour in (("extensor", EXTENSOR), ("flexor", FLEXOR)):  # each next one stands left of those before
        ramp = ListedColormap([tuple(cable_colour(colour, share)) for share in np.linspace(0.0, 1.0, 128)], name)
        scale = ScalarMappable(Normalize(0.0, full), ramp)
        bar = figure.colorbar(scale, ax=axes, fraction=0.012, pad=0.006, aspect=22, shrink=0.8)
        bar.outline.set_visible(False)
        last = name == "extensor"
        bar.ax.tick_params(length=0.0, labelsize=8.0, labelright=last)
        bar.set_label("tension [N]" if last else "", fontsize=8.5)


def _round_up(value: float) -> float:
    """The next of 1, 2, 2.5, 5, 10, … that is not below."""
    if value <= 0.0:
        return 1.0
    unit = 10.0 ** math.floor(math.log10(value))
    return unit * min(step for step in (1.0, 2.0, 2.5, 3.0, 4.0, 5.0, 7.5, 10.0) if step * unit >= value)
