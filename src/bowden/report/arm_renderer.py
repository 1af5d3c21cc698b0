"""Draws the arm of `bowden.report.arm_scene` without a screen, through EGL or, where that is missing, OSMesa."""

import functools
import importlib
import math
import os
import subprocess
import sys
from types import TracebackType
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.errors import BowdenError
from bowden.models.suit.geometry import SuitGeometry
from bowden.report.arm_scene import CAMERA, scene_xml
from bowden.sim.mujoco_arm import load_mujoco

Image = NDArray[np.uint8]

_PROBE = "from mujoco.{0} import GLContext; context = GLContext(16, 16); context.make_current(); context.free()"
"""Asked in a process of its own: a driver that fails may end it, and OpenGL's platform is chosen once in a process."""

_PALE = np.array([0.62, 0.64, 0.68])
FLEXOR, EXTENSOR = np.array([0.84, 0.20, 0.02]), np.array([0.0, 0.33, 0.70])
"""Colours of the two cables under full tension; slack ones are pale."""


class Pose(NamedTuple):
    """What one picture shows."""

    angle: float
    """Of the elbow [rad]."""
    reference: float | None = None
    """Angle of the ghost [rad]; no ghost where it is None or not finite."""
    flexor: float = 1.0
    """Tension as a share of the full one, 0 to 1."""
    extensor: float = 1.0
    """Likewise."""


@functools.cache
def gl_backend() -> str:
    """``egl`` or ``osmesa``: the first with which this computer can draw; MUJOCO_GL, where it is set, decides.

    Raises:
        BowdenError: MuJoCo is not installed, or neither works.
    """
    load_mujoco()
    wanted = os.environ.get("MUJOCO_GL", "").strip().lower()
    backends = [wanted] if wanted in ("egl", "osmesa") else ["egl", "osmesa"]
    said = []
    for backend in backends:
        surroundings = {name: value for name, value in os.environ.items() if name != "PYOPENGL_PLATFORM"}
        command = [sys.executable, "-P", "-c", _PROBE.format(backend)]
        try:
            done = subprocess.run(command, env=surroundings, capture_output=True, text=True, timeout=60.0)
        except subprocess.TimeoutExpired:
            said.append(f"{backend}: no answer in 60 s")
            continue
        if done.returncode == 0:
            return backend
        said.append(f"{backend}: {(done.stderr.strip().splitlines() or [f'ended with {done.returncode}'])[-1]}")
    raise BowdenError(
        f"no way to draw without a screen ({'; '.join(said)})",
        do="install EGL (Debian: libegl1, libgl1-mesa-dri) or OSMesa (libosmesa6); bowden arm check needs neither",
    )


def cable_colour(full: NDArray[np.float64], share: float) -> NDArray[np.float64]:
    """Red, green, blue from pale at 0 to `full` at 1, (3,)."""
    part = min(max(share, 0.0), 1.0) if math.isfinite(share) else 0.0
    return _PALE + (full - _PALE) * part**0.7  # small tensions, too, must look unlike none


class ArmRenderer:
    """Draws poses; to be closed, or used in a ``with``.

    Args:
        geometry: the suit's.
        width: of the pictures [pixels], at most 1920.
        height: of the pictures [pixels], at most 1440.

    Raises:
        BowdenError: MuJoCo or a way to draw is missing.
        ParameterError: the geometry cannot be built.
    """

    def __init__(self, geometry: SuitGeometry, width: int = 960, height: int = 960) -> None:
        mujoco = self._mujoco = load_mujoco()
        module = importlib.import_module(f"mujoco.{gl_backend()}")
        self._model: Any = mujoco.MjModel.from_xml_string(scene_xml(geometry))
        self._data: Any = mujoco.MjData(self._model)
        self._context: Any = module.GLContext(width, height)
        self._context.make_current()
        self._drawing: Any = mujoco.MjrContext(self._model, mujoco.mjtFontScale.mjFONTSCALE_100.value)
        mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN.value, self._drawing)
        self._scene: Any = mujoco.MjvScene(self._model, maxgeom=2000)
        self._rectangle: Any = mujoco.MjrRect(0, 0, width, height)
        self._camera: Any = mujoco.MjvCamera()
        self._camera.type = mujoco.mjtCamera.mjCAMERA_FIXED.value
        self._camera.fixedcamid = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_CAMERA.value, CAMERA)
        ghost = mujoco.mj_name2id(self._model, mujoco.mjtObj.mjOBJ_BODY.value, "ghost")
        self._ghost = self._model.geom_bodyid == ghost
        self._alpha = self._model.geom_rgba[self._ghost, 3].copy()
        self._pixels = np.empty((height, width, 3), np.uint8)

    def draw(self, pose: Pose) -> Image:
        """One picture, (height, width, 3), red, green, blue."""
        mujoco, model, data = self._mujoco, self._model, self._data
        seen = pose.reference is not None and math.isfinite(pose.reference)
        model.geom_rgba[self._ghost, 3] = self._alpha if seen else 0.0
        data.qpos[:] = pose.angle, pose.reference if seen else 0.0
        for cable, (colour, share) in enumerate(((FLEXOR, pose.flexor), (EXTENSOR, pose.extensor))):
            model.tendon_rgba[cable, :3] = cable_colour(colour, share)
        mujoco.mj_forward(model, data)
        mujoco.mjv_updateScene(
            model, data, mujoco.MjvOption(), None, self._camera, mujoco.mjtCatBit.mjCAT_ALL.value, self._scene
        )
        self._context.make_current()
        mujoco.mjr_render(self._rectangle, self._scene, self._drawing)
        mujoco.mjr_readPixels(self._pixels, None, self._rectangle, self._drawing)
        return self._pixels[::-1].copy()

    def close(self) -> None:
        """Give the drawing's memory back."""
        if self._context is not None:
            self._context.make_current()
            self._drawing.free()
            self._context.free()
            self._context = None

    def __enter__(self) -> "ArmRenderer":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
