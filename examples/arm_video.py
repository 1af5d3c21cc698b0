"""A run of the suit as a video: ``python examples/arm_video.py out/simulate/bowden.npz arm.mp4``.

The forearm turns as the run's joint, a grey one as its reference; the flexor is drawn the redder, and the extensor the
bluer, the more it pulls. Needs ``pip install mujoco imageio-ffmpeg``. Without a screen set ``MUJOCO_GL=egl`` or
``osmesa``.
"""

import sys
from pathlib import Path

import imageio_ffmpeg
import mujoco
import numpy as np

from bowden import Trace

SIZE, FRAMES_A_SECOND = 480, 25
FOREARM = """<joint name="{0}" axis="0 -1 0"/>
  <geom type="capsule" fromto="0 0 0 0 0 -0.28" size="0.035" rgba="{1}"/>
  <site name="{0}_flexor" pos="0.035 0 -0.085"/><site name="{0}_extensor" pos="-0.035 0 -0.085"/>"""
SCENE = f"""<mujoco>
  <visual><global offwidth="{SIZE}" offheight="{SIZE}"/></visual>
  <asset><texture type="skybox" builtin="flat" rgb1="1 1 1" rgb2="1 1 1" width="8" height="8"/></asset>
  <worldbody>
    <light pos="0.5 -1 1.5" dir="-0.3 0.7 -1"/>
    <camera name="side" pos="0.1 -1.1 0" xyaxes="1 0 0 0 0 1"/>
    <geom type="capsule" fromto="0 0 0.3 0 0 0" size="0.04" rgba="0.76 0.82 0.88 1"/>
    <geom name="elbow" type="cylinder" size="0.05 0.03" zaxis="0 1 0" rgba="0.93 0.76 0.64 1"/>
    <site name="flexor" pos="0.035 0 0.085"/><site name="extensor" pos="-0.035 0 0.085"/>
    <site name="outside" pos="-0.1 0 0" rgba="0 0 0 0"/>
    <body>{FOREARM.format("joint", "0.93 0.76 0.64 1")}</body>
    <body pos="0 0.08 0">{FOREARM.format("reference", "0.4 0.4 0.4 0.3")}</body>
  </worldbody>
  <tendon>
    <spatial name="flexor" width="0.004"><site site="flexor"/><site site="joint_flexor"/></spatial>
    <spatial name="extensor" width="0.004">
      <site site="extensor"/><geom geom="elbow" sidesite="outside"/><site site="joint_extensor"/>
    </spatial>
  </tendon>
</mujoco>"""
COLOURS = {"flexor": (0.84, 0.2, 0.02), "extensor": (0.0, 0.33, 0.7)}


def main(run: str, film: str) -> None:
    """Read a run, Parquet or CSV, and write it as an MP4."""
    trace = Trace.from_csv(run) if Path(run).suffix == ".csv" else Trace.from_parquet(run)
    times = np.arange(trace.time[0], trace.time[-1], 1.0 / FRAMES_A_SECOND)
    angles = {name: np.interp(times, trace.time, trace[name]) for name in ("joint", "reference")}
    pulls = {name: np.interp(times, trace.time, trace[f"{name}_tension"]) for name in COLOURS}
    most = max(float(pull.max()) for pull in pulls.values())
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    writer = imageio_ffmpeg.write_frames(film, (SIZE, SIZE), fps=FRAMES_A_SECOND)
    writer.send(None)
    with mujoco.Renderer(model, SIZE, SIZE) as renderer:
        for k in range(len(times)):
            for name, angle in angles.items():
                data.joint(name).qpos[0] = angle[k]
            for name, colour in COLOURS.items():
                share = pulls[name][k] / most
                model.tendon_rgba[model.tendon(name).id, :3] = share * np.array(colour) + (1.0 - share) * 0.7
            mujoco.mj_forward(model, data)
            renderer.update_scene(data, "side")
            writer.send(renderer.render())
    writer.close()


if __name__ == "__main__":
    main(*sys.argv[1:])
