"""A run as a video: the arm with its cables beside elbow and tensions over time, H.264 in an MP4 that browsers play."""

import math
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import numpy as np

from bowden.core.errors import BowdenError, LogError, ParameterError
from bowden.core.files import whole_file
from bowden.models.suit.geometry import SuitGeometry
from bowden.records.trace import Trace
from bowden.report.arm_frame import HEIGHT, WIDTH, Frame
from bowden.report.arm_renderer import ArmRenderer, Image, Pose

_ENCODING = ("-crf", "20", "-preset", "medium", "-movflags", "+faststart", "-f", "mp4")


def write_video(
    path: Path | str,
    trace: Trace,
    geometry: SuitGeometry,
    *,
    fps: float = 25.0,
    speed: float = 1.0,
    progress: Callable[[str, float], None] | None = None,
) -> int:
    """Write a run as a video; the reference is a ghost, and the cables' colours are the tensions, where they are known.

    Args:
        path: of the MP4.
        trace: with time and joint; reference, flexor_tension and extensor_tension are shown where they are there.
        geometry: of the suit that is drawn.
        fps: frames a second.
        speed: how many seconds of the run pass in one of the video.
        progress: called with what is done now, and the share that is done.

    Returns:
        How many frames it has.

    Raises:
        BowdenError: MuJoCo, imageio-ffmpeg or a way to draw without a screen is missing, or the encoder fails.
        LogError: the trace has no elbow that is finite.
        ParameterError: `fps` or `speed` out of range, or a geometry that cannot be built.
        OutputError: the file cannot be written.
    """
    if not (1.0 <= fps <= 60.0 and 0.05 <= speed <= 100.0):
        raise ParameterError(f"video: {fps:g} frames a second, speed {speed:g}", expected="1 to 60, and 0.05 to 100")
    start, end = _span(trace)
    times = start + np.arange(max(1, math.floor((end - start) / speed * fps) + 1)) * speed / fps
    encoder = _load_encoder()
    with whole_file(path) as part, ArmRenderer(geometry, HEIGHT, HEIGHT) as renderer:
        writer = encoder.write_frames(
            str(part),
            (WIDTH, HEIGHT),
            fps=fps,
            codec="libx264",
            quality=None,
            output_params=list(_ENCODING),
            ffmpeg_log_level="error",
        )
        try:
            writer.send(None)
            for done, picture in enumerate(_frames(trace, times.tolist(), Frame(trace, (start, end), speed), renderer)):
                writer.send(picture.tobytes())
                if progress is not None:
                    progress("drawing the video", (done + 1) / len(times))
        except OSError as error:
            raise BowdenError(f"the video's encoder failed: {' '.join(str(error).split())[:200]}") from error
        finally:
            writer.close()
    return len(times)


def poses(trace: Trace, times: list[float]) -> Iterator[Pose]:
    """What the arm looks like at each time [s]: rounded, so that an arm at rest gives equal poses."""
    tensions = [trace.columns.get(f"{cable}_tension") for cable in ("flexor", "extensor")]
    full = max((float(np.nanmax(one)) for one in tensions if one is not None and np.isfinite(one).any()), default=0.0)

    def at(now: float, name: str, unit: float = 1.0) -> float | None:
        column = trace.columns.get(name)
        return None if column is None else round(float(np.interp(now, trace.time, column)) / unit, 3)

    for now in times:
        flexor, extensor = (at(now, f"{cable}_tension", full or 1.0) for cable in ("flexor", "extensor"))
        yield Pose(
            angle=at(now, "joint") or 0.0,
            reference=at(now, "reference"),
            flexor=1.0 if flexor is None else flexor,
            extensor=1.0 if extensor is None else extensor,
        )


def _frames(trace: Trace, times: list[float], frame: Frame, renderer: ArmRenderer) -> Iterator[Image]:
    drawn: Image | None = None
    before: Pose | None = None
    for now, pose in zip(times, poses(trace, times), strict=True):
        if drawn is None or pose != before:
            drawn, before = renderer.draw(pose), pose
        yield frame.compose(drawn, pose, now)


def _span(trace: Trace) -> tuple[float, float]:
    """First time, and the last one at which the elbow is still finite [s]."""
    if not {"time", "joint"} <= set(trace.columns):
        raise LogError(f"no video of a trace with the columns {', '.join(trace.columns)}", expected="time and joint")
    finite = np.flatnonzero(np.isfinite(trace["joint"]))
    if not len(finite) or finite[0] != 0:
        raise LogError("no video of a run that has no elbow angle at its start", expected="a run that lasts")
    return float(trace.time[0]), float(trace.time[finite[-1]])


def _load_encoder() -> ModuleType:
    try:
        import imageio_ffmpeg
    except ImportError as error:
        raise BowdenError(
            f"a video needs the package imageio-ffmpeg ({error})", do='pip install "bowden[mujoco]"'
        ) from error
    return imageio_ffmpeg
