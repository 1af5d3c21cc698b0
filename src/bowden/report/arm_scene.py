"""What the arm's model looks like: skin, sleeves, anchors, sheaths, a ghost for the reference; no number needs it."""

import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bowden.core.extras import extra_module
from bowden.models.suit.arm import Arm
from bowden.models.suit.geometry import SuitGeometry
from bowden.sim.mujoco_arm import arm_xml

Array = NDArray[np.float64]

_SKIN, _SHIRT, _TORSO = "0.93 0.76 0.64 1", "0.76 0.82 0.88 1", "0.74 0.78 0.82 1"
_FABRIC, _METAL, _SHEATH, _BOX = "0.24 0.28 0.34 1", "0.72 0.74 0.77 1", "0.17 0.18 0.20 1", "0.32 0.36 0.42 1"
_GHOST = "0.30 0.38 0.50 0.25"

CAMERA = "side"
"""Name of the camera, on the wearer's right."""

_ARM = ((0.0, 0.94, 0.92), (0.06, 0.93, 0.92), (0.14, 1.12, 1.08), (0.22, 1.2, 1.15), (0.28, 1.0, 1.0))
"""Upper arm: height over the elbow [m], half-widths forward and sideways [half-widths of the arm]."""
_FOREARM = (
    (0.02, 0.86, 0.84), (0.0, 0.92, 0.9), (-0.05, 0.96, 0.95), (-0.1, 0.96, 0.93), (-0.16, 0.84, 0.78),
    (-0.21, 0.69, 0.58), (-0.245, 0.66, 0.5), (-0.27, 0.86, 0.5), (-0.3, 1.08, 0.48), (-0.335, 1.1, 0.42),
    (-0.35, 0.98, 0.34),
)  # fmt: skip
"""Forearm and palm, likewise."""
_FINGERS = ((0.027, 0.072, 9.0), (0.0095, 0.088, 9.4), (-0.0085, 0.08, 9.0), (-0.026, 0.06, 8.0))
"""Place forward, length [m], radius [mm] of each, from the knuckles at −0.345."""


def scene_xml(geometry: SuitGeometry) -> str:
    """The model with all that is only to be seen, and a second forearm called ``ghost`` on a hinge of its own.

    Raises:
        ParameterError: as `bowden.sim.mujoco_arm.arm_xml`.
    """
    a, b = geometry.half_width, geometry.anchor_distance
    root = ET.fromstring(arm_xml(geometry, Arm()))
    world = _child(root, "worldbody")
    for element in (*world.iter("site"), *world.iter("geom")):  # points and cylinder of the model itself
        element.set("rgba", "0 0 0 0")
    for element in root.iter("spatial"):
        element.set("width", "0.0042")
    forearm = _child(world, "body")
    _add(root, _look())
    _add(root, f"<asset>{_loft('upper_arm', _ARM, a)}{_loft('forearm', _FOREARM, a)}{_sheaths(a, b)}</asset>")
    _add(world, _surroundings() + _skin_elbow(geometry, 1.0) + _brace(a, b))
    _add(forearm, _hand(_SKIN) + _skin_elbow(geometry, 0.96) + _brace(a, -b))
    # the ghost stands a little behind, so that the arm is not grey where both are at one place
    inertial = '<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>'
    _add(
        world, f'<body name="ghost" pos="0 0.045 0"><joint name="ghost" axis="0 -1 0"/>{inertial}{_hand(_GHOST)}</body>'
    )
    return ET.tostring(root, encoding="unicode")


def _look() -> str:
    return f"""<visual>
        <global offwidth="1920" offheight="1440"/>
        <headlight ambient="0.52 0.52 0.52" diffuse="0.28 0.28 0.28" specular="0.04 0.04 0.04"/>
        <quality shadowsize="2048" offsamples="4" numslices="40" numstacks="20"/>
      </visual>
      <statistic center="0.1 0 -0.05" extent="0.5"/>
      <asset><texture type="skybox" builtin="flat" rgb1="1 1 1" width="64" height="64"/>
        <material name="torso" rgba="{_TORSO}" emission="0.22" specular="0" shininess="0"/>
      </asset>"""


def _surroundings() -> str:
    """Light, camera, the wearer's body behind the arm, and the actuator on the back."""
    return f"""<light pos="-0.6 -1.6 1.6" dir="0.35 0.75 -0.75" diffuse="0.45 0.45 0.45" specular="0.1 0.1 0.1"/>
      <camera name="{CAMERA}" pos="0.10 -2.9 -0.045" xyaxes="1 0 0 0 0 1" fovy="15.5"/>
      <geom type="capsule" fromto="-0.01 0.22 0.18 -0.01 0.22 -0.9" size="0.115" material="torso"/>
      <geom type="mesh" mesh="upper_arm" rgba="{_SKIN}"/>
      <geom type="mesh" mesh="flexor_sheath" rgba="{_SHEATH}"/>
      <geom type="mesh" mesh="extensor_sheath" rgba="{_SHEATH}"/>
      <geom type="capsule" fromto="-0.006 0 0.27 -0.003 0 0.205" size="0.05" rgba="{_SHIRT}"/>
      <geom type="box" pos="-0.165 0.12 0.14" size="0.035 0.05 0.075" rgba="{_BOX}"/>
      <geom type="cylinder" pos="-0.165 0.066 0.165" size="0.026 0.008" zaxis="0 1 0" rgba="{_METAL}"/>
      <geom type="cylinder" pos="-0.165 0.066 0.107" size="0.022 0.008" zaxis="0 1 0" rgba="{_METAL}"/>"""


def _skin_elbow(geometry: SuitGeometry, width: float) -> str:
    """A ball that reaches from the arm's inside out to the cylinder round which the extensor runs."""
    inside, outside = 0.94 * geometry.half_width, geometry.joint_radius - 0.0015
    size = 0.5 * (inside + outside)
    return (
        f'<geom type="ellipsoid" pos="{inside - size} 0 0" size="{size} {width * 0.97 * size} {size}" rgba="{_SKIN}"/>'
    )


def _brace(a: float, height: float) -> str:
    blocks = "".join(
        f'<geom type="box" pos="{side * a} 0 {height}" size="0.005 0.008 0.009" rgba="{_METAL}"/>' for side in (1, -1)
    )
    return f'<geom type="cylinder" pos="0 0 {height}" size="{a + 0.0008} 0.021" rgba="{_FABRIC}"/>{blocks}'


def _hand(rgba: str) -> str:
    fingers = "".join(
        f'<geom type="capsule" fromto="{x} 0 -0.345 {0.9 * x} -0.003 {-0.345 - length}" size="{1e-3 * radius}" '
        f'rgba="{rgba}"/>'
        for x, length, radius in _FINGERS
    )
    thumb = f'<geom type="capsule" fromto="0.026 -0.004 -0.285 0.06 -0.01 -0.345" size="0.0102" rgba="{rgba}"/>'
    return f'<geom type="mesh" mesh="forearm" rgba="{rgba}"/>{fingers}{thumb}'


def _sheaths(a: float, b: float) -> str:
    """From the upper arm's anchors over the shoulder to the actuator, smooth through a few points each."""
    flexor = [
        (a, 0.0, b + 0.008), (a + 0.005, -0.004, b + 0.05), (0.054, -0.034, 0.2), (0.03, -0.066, 0.265),
        (-0.05, -0.07, 0.315), (-0.12, 0.0, 0.28), (-0.165, 0.066, 0.19),
    ]  # fmt: skip
    extensor = [
        (-a, 0.0, b + 0.008), (-a - 0.006, -0.002, b + 0.05), (-0.07, 0.0, 0.185), (-0.115, 0.02, 0.185),
        (-0.165, 0.066, 0.13),
    ]  # fmt: skip
    return _tube("flexor_sheath", flexor, 0.0042) + _tube("extensor_sheath", extensor, 0.0042)


def _tube(name: str, through: Sequence[tuple[float, float, float]], radius: float) -> str:
    """A round tube, smooth through points; it must not run along the y axis."""
    interpolate = extra_module("scipy.interpolate", "mujoco", "the arm's scene")
    points = np.array(through)
    along = np.r_[0.0, np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
    curve, at = interpolate.CubicSpline(along, points), np.linspace(0.0, along[-1], 56)
    tangent = curve(at, 1)
    first = np.cross(tangent, (0.0, 1.0, 0.0))
    first /= np.linalg.norm(first, axis=1)[:, None]
    second = np.cross(tangent, first)
    second /= np.linalg.norm(second, axis=1)[:, None]
    turn = np.linspace(0.0, 2.0 * np.pi, 12, endpoint=False)[None, :, None]
    return _mesh(name, curve(at)[:, None] + radius * (first[:, None] * np.cos(turn) + second[:, None] * np.sin(turn)))


def _loft(name: str, sections: Sequence[tuple[float, float, float]], unit: float) -> str:
    """A closed mesh through ellipses across the z axis, smooth between them."""
    interpolate = extra_module("scipy.interpolate", "mujoco", "the arm's scene")
    table = np.array(sorted(sections))
    heights = np.linspace(table[0, 0], table[-1, 0], 44)
    widths = interpolate.PchipInterpolator(table[:, 0], table[:, 1:])(heights) * unit
    turn = np.linspace(0.0, 2.0 * np.pi, 40, endpoint=False)
    around = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    rings = np.concatenate([widths[:, None] * around, np.broadcast_to(heights[:, None, None], (44, 40, 1))], axis=2)
    return _mesh(name, rings)


def _mesh(name: str, rings: Array) -> str:
    """A closed mesh through rings of points (rings, points of each, 3), which turn left seen from the last one."""
    count, around, _ = rings.shape
    points = np.vstack([rings.reshape(-1, 3), rings[0].mean(axis=0), rings[-1].mean(axis=0)])
    first = np.arange(around)
    following = (first + 1) % around
    faces = []
    for low in range(0, (count - 1) * around, around):
        high = low + around
        faces.append(np.column_stack([low + first, low + following, high + following]))
        faces.append(np.column_stack([low + first, high + following, high + first]))
    last = (count - 1) * around
    faces.append(np.column_stack([following, first, np.full(around, len(points) - 2)]))
    faces.append(np.column_stack([last + first, last + following, np.full(around, len(points) - 1)]))
    vertex = " ".join(f"{value:.5f}" for value in points.ravel())
    face = " ".join(map(str, np.vstack(faces).ravel().tolist()))
    return f'<mesh name="{name}" smoothnormal="true" vertex="{vertex}" face="{face}"/>'


def _child(parent: ET.Element, tag: str) -> ET.Element:
    found = parent.find(tag)
    assert found is not None
    return found


def _add(parent: ET.Element, xml: str) -> None:
    parent.extend(ET.fromstring(f"<parts>{xml}</parts>"))
