"""Logs as laboratories have them: whatever the layout, units and clocks, one motion is read, and one model found."""

import datetime
import gzip
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.io import savemat

import bowden
from bowden.core.errors import LogError
from bowden.identify.log.quaternions import angle_of
from bowden.identify.log.read import read_log
from bowden.models.cable.prandtl_ishlinskii import plays

Array = NDArray[np.float64]

TIME = np.arange(1200) / 50.0
RADIUS = 15.0


def motion(time: Array) -> Array:
    return 0.5 * np.sin(1.9 * time) + 0.2 * np.sin(4.3 * time + 0.5)


def cable(motor: Array) -> Array:
    return 0.9 * plays(motor, np.array([0.06]))[:, 0] + 0.1


MOTOR = motion(TIME)
JOINT = cable(MOTOR)

ABOVE = ("", "My rig\n\n", "# a note\n", "type,begin,rate\nrecord,0.0,1000\n\n", "Version 3\nSubject\tA 7\n***End***\n")
ANGLES = {
    "rad": (1.0, 7, {}),
    "deg": (math.degrees(1.0), 5, {}),
    "turns": (1.0 / math.tau, 8, {}),
    "mrad": (1e3, 4, {}),
    "counts": (16384.0 / math.tau, 0, {"counts_per_turn": 16384}),
    "mm": (RADIUS, 5, {"spool_radius_mm": RADIUS}),
}
CLOCKS = {
    "time_s": lambda t: f"{t:.4f}",
    "Time (ms)": lambda t: f"{1e3 * t:.1f}",
    "ms": lambda t: f"{(60_000 + round(1e3 * t)) % 2**16}",
    "t_us": lambda t: f"{1e6 * t:.0f}",
    "time_us": lambda t: f"{(2**32 - 9_000_000 + round(1e6 * t)) % 2**32}",
    "timestamp_ns": lambda t: f"{1_700_000_000_000_000_000 + round(1e9 * t)}",
    "stamp": lambda t: f"{1.7e9 + t:.3f}",
    "timestamp": lambda t: datetime.datetime.fromtimestamp(1.7e9 + t, datetime.UTC).isoformat(),
    "clock": lambda t: datetime.datetime.fromtimestamp(86390.0 + t, datetime.UTC).strftime("%H:%M:%S.%f"),
}


@st.composite
def layouts(draw: st.DrawFn) -> dict[str, Any]:
    return {
        "above": draw(st.sampled_from(ABOVE)),
        "separator": draw(st.sampled_from([",", ";", "\t", " "])),
        "comma": draw(st.booleans()),
        "clock": draw(st.sampled_from([*CLOCKS])),
        "units": (draw(st.sampled_from([*ANGLES])), draw(st.sampled_from(["rad", "deg", "turns"]))),
        "order": draw(st.permutations([0, 1, 2, 3])),
        "tail": draw(st.integers(0, 2)),
        "lost": draw(st.sampled_from(["none", "bursts", "in turn", "repeated"])),
        "encoding": draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"])),
        "packed": draw(st.booleans()),
        "mark": draw(st.sampled_from(["", "%", "# "])),
    }


def written(layout: dict[str, Any], random: np.random.Generator) -> tuple[bytes, dict[str, Any]]:
    """A log of that layout, and the options that it needs."""
    separator, spaced = layout["separator"], layout["separator"] == " "
    lost = "none" if spaced and layout["lost"] != "repeated" else layout["lost"]  # no field is empty between spaces
    (of_motor, digits, options), (of_joint, more, _) = (ANGLES[unit] for unit in layout["units"])
    motor, joint = (
        [f"{of * v:.{n}f}" for v in values] for of, n, values in ((of_motor, digits, MOTOR), (of_joint, more, JOINT))
    )
    time = [CLOCKS[layout["clock"]](t) for t in TIME]
    if lost == "bursts":
        for start in range(100, 1100, 100):
            for row in range(start, start + int(random.integers(1, 4))):
                motor[row] = ""
    elif lost == "in turn":
        motor[::2], joint[1::2] = [""] * 600, [""] * 600
    columns = [[layout["clock"], *time], [f"motor_{layout['units'][0]}", *motor]]
    columns += [[f"joint_{layout['units'][1]}", *joint], ["state", *["ok"] * len(TIME)]]
    if spaced:
        columns[0][0] = columns[0][0].replace(" (", "_").rstrip(")")
    rows = [list(row) for row in zip(*(columns[k] for k in layout["order"]), strict=True)]
    if lost == "repeated":
        rows = [one for number, row in enumerate(rows) for one in [row] * (1 + (number > 0 and number % 40 == 0))]
    if layout["comma"] and separator != ",":
        rows[1:] = [[cell.replace(".", ",") for cell in row] for row in rows[1:]]
    tail = "" if spaced else separator * layout["tail"]
    lines = [separator.join(row) + tail for row in rows]
    content = (layout["above"] + layout["mark"] + "\n".join(lines) + "\n").encode(layout["encoding"])
    return gzip.compress(content) if layout["packed"] else content, options


@given(layout=layouts(), seed=st.integers(0, 2**16))
@settings(max_examples=60, derandomize=True, deadline=None)
def test_whatever_the_layout_the_motion_is_read(
    tmp_path_factory: pytest.TempPathFactory, layout: Any, seed: int
) -> None:
    content, options = written(layout, np.random.default_rng(seed))
    path = tmp_path_factory.getbasetemp() / "drawn.csv"
    path.write_bytes(content)
    log = read_log(path, **options)
    time = log.time - log.time[0]
    began = min((0.0, 0.02), key=lambda shift: float(np.abs(log.motor - motion(time + shift)).max()))
    assert np.sqrt(np.mean((log.motor - motion(time + began)) ** 2)) < 0.005 * np.ptp(MOTOR)
    assert np.sqrt(np.mean((log.joint - np.interp(time + began, TIME, JOINT)) ** 2)) < 0.02 * np.ptp(JOINT)


@pytest.mark.parametrize("clock", ["time_s", "clock"])
@pytest.mark.parametrize(("unit", "lost"), [("mm", "bursts"), ("counts", "in turn")])
def test_whatever_the_layout_one_model_is_found(tmp_path: Path, clock: str, unit: str, lost: str) -> None:
    layout = {"above": ABOVE[3], "separator": ";", "comma": True, "clock": clock, "units": (unit, "deg"), "tail": 1}
    layout |= {"order": [3, 1, 0, 2], "lost": lost, "encoding": "utf-8", "packed": True, "mark": ""}
    content, options = written(layout, np.random.default_rng(0))
    (tmp_path / "log.csv").write_bytes(content)
    fit = bowden.identify(tmp_path / "log.csv", **options)
    play = fit.models["play"].parameters
    assert play["slope"] == pytest.approx(0.9, rel=0.02)
    assert play["half_width"] == pytest.approx(0.06, rel=0.04)
    assert fit.trust.level != "no"


def test_columns_by_number_whatever_they_are_called(tmp_path: Path) -> None:
    rows = "\n".join(f"{j:.6f},{t:.2f},{m:.6f}" for t, m, j in zip(TIME, MOTOR, JOINT, strict=True))
    for header in ("", "a,b,c\n"):
        (tmp_path / "log.csv").write_text(header + rows)
        log = bowden.read_log(tmp_path / "log.csv", time=2, motor="3", joint="1", unit="rad")
        assert log.joint == pytest.approx(JOINT, abs=1e-5)
    savemat(tmp_path / "log.mat", {"data": np.stack([TIME, MOTOR, JOINT], axis=1)})
    log = bowden.read_log(tmp_path / "log.mat", time="data 1", motor="data 2", joint="data 3", unit="rad")
    assert log.motor == pytest.approx(MOTOR)
    np.save(tmp_path / "log.npy", np.stack([TIME, MOTOR, JOINT], axis=1))
    assert bowden.read_log(tmp_path / "log.npy", time=1, motor=2, joint=3, unit="rad").joint == pytest.approx(JOINT)


def test_of_two_files_that_name_no_side_the_motors_comes_first(tmp_path: Path) -> None:
    for name, angle in (("a", MOTOR), ("b", JOINT)):
        np.savetxt(tmp_path / name, np.c_[TIME, np.degrees(angle)], "%.6f", ",", header="time_s,angle_deg", comments="")
    fit = bowden.identify([tmp_path / "a", tmp_path / "b"])
    assert fit.models["play"].parameters["slope"] == pytest.approx(0.9, rel=0.01)


@pytest.mark.parametrize(("shift", "ppm", "column"), [(0.7, 50.0, "motor"), (-3.2, -200.0, "encoder")])
def test_the_clocks_of_two_files_are_aligned_by_the_motion(
    tmp_path: Path, shift: float, ppm: float, column: str
) -> None:
    noise = np.random.default_rng(1)
    fast = np.arange(0.0, 30.0, 0.002)
    slow = np.arange(0.5, 29.0, 0.01)
    joint = np.interp(slow, fast, cable(motion(fast)))
    for name, at, angle in (("motor", fast, motion(fast)), ("joint", (slow - shift) * (1.0 - 1e-6 * ppm), joint)):
        read = np.degrees(angle) + 0.02 * noise.standard_normal(len(at))
        named = f"time_s,{column if name == 'motor' else name}_deg"
        np.savetxt(tmp_path / f"{name}.csv", np.c_[at, read], "%.6f", ",", header=named, comments="")
    fit = bowden.identify([tmp_path / "joint.csv", tmp_path / "motor.csv"])
    (said,) = (one for one in fit.warnings if "aligned by the motion" in one)
    found = float(said.split("stands ")[1].split(" ")[0])
    assert found == pytest.approx(shift, abs=0.003)
    assert fit.models["play"].parameters["half_width"] == pytest.approx(0.06, rel=0.05)
    other = np.c_[fast, noise.standard_normal(len(fast))]
    np.savetxt(tmp_path / "motor.csv", other, "%.6f", ",", header="t_s,motor_rad", comments="")
    with pytest.raises(LogError, match="not of one motion"):
        bowden.identify([tmp_path / "motor.csv", tmp_path / "joint.csv"])


def test_quaternions_of_two_bodies_are_the_angle_between_them() -> None:
    axis, tilt = np.array([1.0, 2.0, -2.0]) / 3.0, np.array([0.9, 0.1, 0.4, 0.1])
    upper = np.repeat((tilt / np.linalg.norm(tilt))[:, None], len(TIME), axis=1)
    half = 0.5 * (JOINT - JOINT[0])
    turned = np.concatenate([np.cos(half)[None], axis[:, None] * np.sin(half)])
    w, x, y, z = upper[:, 0]
    left = np.array([[w, -x, -y, -z], [x, w, -z, y], [y, z, w, -x], [z, -y, x, w]])
    angle = angle_of([upper, left @ turned])
    assert np.abs(angle) == pytest.approx(np.abs(JOINT - JOINT[0]), abs=1e-9)
