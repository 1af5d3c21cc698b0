"""One frame of the arm's video: the picture on the left, figures and a chart with a cursor on the right."""

import io
import math
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bowden.core.units import DEGREES
from bowden.drawing.style import COLOURS, drawing, finish, legend, new_figure, thin
from bowden.records.trace import Trace
from bowden.report.arm_renderer import EXTENSOR, FLEXOR, Image, Pose

if TYPE_CHECKING:
    from PIL.ImageFont import FreeTypeFont

WIDTH, HEIGHT = 1280, 720
"""Of a frame [pixels]; the arm's picture is a square on the left."""

_HEAD, _DPI = 190, 100
_INK, _QUIET, _CURSOR = "#222222", "#5f6b76", "#d55e00"


class Frame:
    """Everything of a run's frames that stays the same.

    Args:
        trace: with time and joint, and reference and tensions where they are known.
        span: first and last time that is shown [s].
        speed: seconds of the run in one of the video, said where it is not 1.
    """

    def __init__(self, trace: Trace, span: tuple[float, float], speed: float) -> None:
        self._span, self._speed = span, speed
        self._blank, self._left, self._right, self._edges = _chart(trace, span)
        self._large, self._middle, self._small = _font(64, "-Bold"), _font(20), _font(16)

    def compose(self, arm: Image, pose: Pose, now: float) -> Image:
        """The frame at a time [s], (720, 1280, 3)."""
        from PIL import Image as pillow
        from PIL import ImageDraw

        frame = pillow.fromarray(self._blank)
        frame.paste(pillow.fromarray(arm), (0, 0))
        pen = ImageDraw.Draw(frame)
        left = HEIGHT + 30
        pen.text((left, 30), f"{pose.angle * DEGREES:.0f}°", _INK, self._large)
        pen.text((left + 4, 108), "elbow", _QUIET, self._middle)
        if pose.reference is not None and math.isfinite(pose.reference):
            pen.text((left + 170, 62), f"{pose.reference * DEGREES:.0f}°", _QUIET, self._middle)
            pen.text((left + 170, 108), "reference, the grey arm", _QUIET, self._middle)
        pace = "" if self._speed == 1.0 else f"   {self._speed:g} × as fast"
        pen.text((left + 4, 148), f"{now - self._span[0]:.1f} s{pace}", _QUIET, self._small)
        start, end = self._span
        place = self._left + (self._right - self._left) * (now - start) / (end - start if end > start else 1.0)
        for upper, lower in self._edges:
            pen.line([(place, upper), (place, lower)], fill=_CURSOR, width=2)
        return np.asarray(frame)


def _chart(trace: Trace, span: tuple[float, float]) -> tuple[Image, float, float, list[tuple[float, float]]]:
    """The white frame with elbow and tensions over the whole run; columns of its ends; upper and lower edge of each."""
    pulled = [(cable, trace.columns.get(f"{cable}_tension")) for cable in ("flexor", "extensor")]
    known = [(name, values) for name, values in pulled if values is not None]
    figure, axes = new_figure(
        2 if known else 1, 1, width=(WIDTH - HEIGHT - 16) / _DPI, height=(HEIGHT - _HEAD) / _DPI, share_x=True
    )
    with drawing():
        if "reference" in trace.columns:
            line = thin(trace.time, trace["reference"] * DEGREES)
            axes[0].plot(*line, color=COLOURS["reference"], linestyle="--", linewidth=1.1, label="reference")
        axes[0].plot(*thin(trace.time, trace["joint"] * DEGREES), color=COLOURS["joint"], label="elbow")
        axes[0].set_ylabel("angle [deg]")
        for name, values in known:
            colour = tuple(FLEXOR if name == "flexor" else EXTENSOR)
            axes[-1].plot(*thin(trace.time, values), color=colour, label=name, linewidth=1.1)
            axes[-1].set_ylabel("tension [N]")
        axes[-1].set(xlabel="time [s]", xlim=span if span[1] > span[0] else None)
        for one in axes:
            legend(one)
        finish(figure)
        figure.set_dpi(_DPI)
        buffer = io.BytesIO()
        figure.savefig(buffer, format="rgba", dpi=_DPI)
    blank = np.full((HEIGHT, WIDTH, 3), 255, np.uint8)
    drawn = np.frombuffer(buffer.getvalue(), np.uint8).reshape(HEIGHT - _HEAD, -1, 4)
    blank[_HEAD:, HEIGHT : HEIGHT + drawn.shape[1]] = drawn[:, :, :3]
    boxes = [one.get_window_extent() for one in axes]
    edges = [(HEIGHT - box.y1, HEIGHT - box.y0) for box in boxes]
    return blank, HEIGHT + boxes[0].x0, HEIGHT + boxes[0].x1, edges


def _font(size: int, style: str = "") -> "FreeTypeFont":
    """The font of the figures, which matplotlib brings along."""
    import matplotlib
    from PIL import ImageFont

    return ImageFont.truetype(Path(matplotlib.get_data_path()) / "fonts" / "ttf" / f"DejaVuSans{style}.ttf", size)
