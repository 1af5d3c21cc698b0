"""MuJoCo's model of the suit on the arm: an oracle for geometry and elbow that knows none of our equations."""

import json
import math
import re
import subprocess
import sys
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from bowden.app import main
from bowden.app.schema_command import json_schema
from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.errors import BowdenError, LogError, ParameterError
from bowden.core.trace import Trace
from bowden.core.units import DEGREES, RADIANS
from bowden.models.suit.arm import GRAVITY, Arm, arm_of, resting_angle
from bowden.models.suit.geometry import SuitGeometry
from bowden.plants.presets.suit import default_suit
from bowden.plants.suit_parts import Suit
from bowden.report import arm_pictures, arm_renderer
from bowden.report.arm_renderer import ArmRenderer, Pose
from bowden.report.arm_video import poses, write_video
from bowden.sim import arm_check, mujoco_arm
from bowden.sim.arm_agreement import Agreement
from bowden.sim.mujoco_arm import MujocoArm, arm_xml
from bowden.sim.run import simulate
from bowden.sim.suit_replay import parts_of, replay
from support.wearers import WEARERS

PAPER = SuitGeometry()


@pytest.fixture(autouse=True)
def _mujoco() -> None:
    pytest.importorskip("mujoco", reason="needs the extra bowden[mujoco]")


@pytest.fixture
def screen() -> None:
    """Skips where nothing can draw."""
    try:
        arm_renderer.gl_backend()
    except BowdenError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def run() -> Trace:
    return lifted(default_suit())


def lifted(suit: Suit) -> Trace:
    """The uncompensated suit, with a weak and trembling wearer, 0–90–0° in 8 s."""
    wearer, reference = WEARERS["weak"]._replace(tremor=0.2), PeriodicMinimumJerk(0.0, 0.5 * math.pi, 8.0)
    return simulate(suit._replace(wearer=wearer), LAWS["uncompensated"], reference, duration=8.0)


# Geometry.


@pytest.mark.parametrize(
    "geometry",
    [PAPER, SuitGeometry(0.045, 0.11, 0.05), SuitGeometry(0.03, 0.06, 0.03, flexor_length=0.7, extensor_length=0.6)],
)
def test_the_tendons_go_as_eqs_1_and_2_say(geometry: SuitGeometry) -> None:
    found = arm_check.compare_cables(geometry, count=46)
    assert max(found.flexor, found.extensor) < 1e-12  # asked for: 1e-4
    assert max(found.flexor_arm, found.extensor_arm) < 1e-12
    assert found.lowest < 0.0


def test_the_papers_travels_are_erratum_3s_and_not_the_papers() -> None:
    """MuJoCo's own tendons: the flexor moves more, not the extensor, and the mismatch is 20.7 mm, not 50."""
    found = arm_check.compare_cables(PAPER, count=46)
    assert found.flexor_travel == pytest.approx(-99.29e-3, abs=5e-6)
    assert found.extensor_travel == pytest.approx(78.54e-3, abs=5e-6)


def test_the_extensor_leaves_its_cylinder_where_geometry_says() -> None:
    """Its tangent points meet where 2·atan(a/b) + 2·acos(R/√(a²+b²)) − φ = π: −21.2° with the paper's a, b, R."""
    a, b, radius = PAPER.half_width, PAPER.anchor_distance, PAPER.joint_radius
    leaves = 2.0 * math.atan2(a, b) + 2.0 * math.acos(radius / math.hypot(a, b)) - math.pi
    model = MujocoArm(PAPER, Arm())
    assert model.cables(leaves + 1e-3)[1][1] == pytest.approx(-radius, abs=1e-12)
    assert model.cables(leaves - 0.02)[1][1] < -radius - 1e-4  # straight, and farther from the joint
    assert leaves * DEGREES == pytest.approx(-21.15, abs=0.01)


def test_a_joint_thinner_than_the_arm_is_seen_to_break_eq_2() -> None:
    """With R = 31.4 mm, less than the half width, the extensor lies on nothing at the straight arm."""
    found = arm_check.compare_cables(PAPER._replace(joint_radius=0.0314), count=46)
    assert found.extensor > arm_check.EXCURSION_LIMIT
    assert found.extensor_arm == pytest.approx(0.035 - 0.0314, abs=1e-6)  # at 0° it is straight, at the arm's width
    said = Agreement(found, [], []).reasons
    assert len(said) == 2
    assert all(text.startswith("the extensor's ") for text in said)


def test_the_model_knows_points_and_no_equation() -> None:
    root = ET.fromstring(arm_xml(PAPER, Arm()))
    sites = {site.get("name"): [float(x) for x in (site.get("pos") or "").split()] for site in root.iter("site")}
    assert sites["flexor_upper"] == [0.035, 0.0, 0.085]
    assert sites["flexor_lower"] == [0.035, 0.0, -0.085]
    assert "extension" not in Path(mujoco_arm.__file__).read_text(encoding="utf-8").replace("flexor_extension", "")
    assert "moment_arm" not in Path(mujoco_arm.__file__).read_text(encoding="utf-8")


# Motion.


@pytest.mark.parametrize("arm", [arm_of(), arm_of(45.0, 1.5), arm_of(120.0, 1.9, load=2.0)])
def test_the_elbow_moves_as_ours_within_a_thousandth_of_what_is_allowed(arm: Arm) -> None:
    for case in arm_check.cases(PAPER, arm):
        motion = arm_check.compare_motion(PAPER, arm, case._replace(duration=min(case.duration, 9.0)))
        assert motion.error < 1e-3 * arm_check.MOTION_LIMIT, case.name
        assert np.ptp(motion.mujoco) > 20.0 * RADIANS  # it did move
        assert motion.mujoco.max() < 95.0 * RADIANS


def test_a_raised_upper_arm_swings_alike() -> None:
    arm = arm_of(elevation=0.7)
    case = arm_check.ArmCase("swing", 1.2, lambda time: (0.0, 0.0), 4.0)
    assert arm_check.compare_motion(PAPER, arm, case).error < 1e-6


def test_the_error_falls_with_mujocos_step_as_its_integrators_do() -> None:
    swing, lift, _ = arm_check.cases(PAPER, Arm())
    for case, orders in ((swing._replace(duration=4.0), (1.0, 4.0)), (lift._replace(duration=8.0), (1.0, 2.0))):
        motion = arm_check.compare_motion(PAPER, Arm(), case)
        for integrator, order in zip(arm_check.INTEGRATORS, orders, strict=True):
            found = arm_check.convergence(PAPER, Arm(), case, motion, integrator)
            assert found.order == pytest.approx(order, abs=0.25)
            assert list(found.errors) == sorted(found.errors, reverse=True)


def test_an_arm_without_friction_keeps_its_energy_and_hangs_where_it_should() -> None:
    loose = Arm()._replace(stiffness=0.0, damping=0.0)
    angle = MujocoArm(PAPER, loose).move((1.0, 0.0), lambda time: (0.0, 0.0), 5000)
    rate = np.gradient(angle, 1e-3)
    energy = 0.5 * loose.inertia * rate**2 - loose.mass * GRAVITY * loose.centre * np.cos(angle)
    assert np.ptp(energy[5:-5]) < 1e-4 * np.abs(energy).max()
    damped = Arm()._replace(damping=1.0)
    rest = resting_angle(damped)
    assert MujocoArm(PAPER, damped).holding_torque(rest) == pytest.approx(0.0, abs=1e-9)
    settled = MujocoArm(PAPER, damped).move((0.0, 0.0), lambda time: (0.0, 0.0), 8000)
    assert settled[-1] == pytest.approx(rest, abs=1e-4)


def test_a_run_of_the_suit_is_the_same_in_mujoco(run: Trace, tmp_path: Path) -> None:
    motion = replay(run)
    assert np.ptp(motion.mujoco) > 30.0 * RADIANS
    assert motion.error < arm_check.MOTION_LIMIT
    run.to_parquet(tmp_path / "run.parquet")
    assert replay(Trace.from_parquet(tmp_path / "run.parquet")).error == motion.error
    heavier = parts_of(run)[1]
    other = dict(run.settings["plant"]) | {"arm": dict(heavier._replace(mass=1.05 * heavier.mass)._asdict())}
    wrong = Trace(run.columns, run.units, dict(run.settings) | {"plant": other}, run.seed)
    assert replay(wrong).error > arm_check.MOTION_LIMIT  # 80 g more are seen


# What cannot be.


@pytest.mark.parametrize(
    ("geometry", "arm", "said"),
    [
        (PAPER._replace(half_width=0.0), Arm(), "half_width is 0.0"),
        (PAPER._replace(joint_radius=math.nan), Arm(), "joint_radius is nan"),
        (PAPER._replace(joint_radius=0.095), Arm(), "anchors 0.09192 m from a joint of radius 0.095 m"),
        (PAPER, Arm()._replace(inertia=0.05), "inertia about the elbow is 0.05"),
        (PAPER, Arm()._replace(damping=-1.0), "damping is -1.0"),
        (PAPER, Arm()._replace(elevation=math.inf), "elevation is inf"),
    ],
)
def test_an_arm_that_cannot_be_is_refused(geometry: SuitGeometry, arm: Arm, said: str) -> None:
    with pytest.raises(ParameterError, match=re.escape(said)):
        arm_xml(geometry, arm)


def test_a_cable_cannot_push() -> None:
    with pytest.raises(ParameterError, match="tensions of -1"):
        MujocoArm(PAPER, Arm()).move((0.0, 0.0), lambda time: (-1.0, 0.0), 3)


def test_only_a_whole_run_of_the_suit_is_replayed(run: Trace) -> None:
    bare = {"time": run.time, "joint": run["joint"], "reference": run["reference"]}
    with pytest.raises(LogError, match="does not say its suit's SuitGeometry"):
        replay(Trace(bare, run.units))
    with pytest.raises(LogError, match="without joint_velocity"):
        replay(Trace(bare, run.units, run.settings))
    broken = dict(run.columns) | {"joint": np.where(run.time > 5.0, np.nan, run["joint"])}
    with pytest.raises(LogError, match="not finite to its end"):
        replay(Trace(broken, run.units, run.settings))
    with pytest.raises(LogError, match="is mostly at its stops"):
        replay(Trace(dict(run.columns) | {"joint": run["joint"] + 3.0}, run.units, run.settings))


def test_mujoco_waits_where_the_elbow_is_at_its_stops(run: Trace) -> None:
    at_stop = (run.time > 3.0) & (run.time < 3.5)
    pushed = np.where(at_stop, -0.1, run["joint"])
    motion = replay(Trace(dict(run.columns) | {"joint": pushed}, run.units, run.settings))
    assert np.array_equal(np.isnan(motion.mujoco), at_stop)
    assert motion.error < arm_check.MOTION_LIMIT


def test_the_suits_difference_from_mujoco_is_its_own_sub_step(run: Trace) -> None:
    """Sub-steps of the suit are of first order: a quarter of their length leaves a quarter of the difference."""
    fine = replay(lifted(default_suit()._replace(substeps=4 * default_suit().substeps)))
    assert fine.error == pytest.approx(0.25 * replay(run).error, rel=0.1)
    assert fine.error < 0.15 * arm_check.MOTION_LIMIT


def test_without_the_extra_the_message_says_what_to_install(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    monkeypatch.setitem(sys.modules, "mujoco", None)
    monkeypatch.chdir(tmp_path)
    arm_renderer.gl_backend.cache_clear()
    assert main.run(["arm", "check"]) == 2
    said = capsys.readouterr().err
    assert 'pip install "bowden[mujoco]"' in said
    assert said.count("\n") == 1
    assert arm_pictures.arm_data_uri(PAPER, Arm()) is None
    assert main.run(["arm", "render"]) == 2
    assert list(tmp_path.iterdir()) == []


def test_without_a_way_to_draw_the_message_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(arm_renderer, "_PROBE", "raise SystemExit('{0} is not there')")
    arm_renderer.gl_backend.cache_clear()
    with pytest.raises(BowdenError, match=r"egl: egl is not there; osmesa: osmesa is not there.*; install EGL"):
        arm_renderer.gl_backend()
    assert arm_pictures.arm_data_uri(PAPER, Arm()) is None
    arm_renderer.gl_backend.cache_clear()


# Pictures.


@pytest.mark.usefixtures("screen")
def test_the_picture_shows_the_arm_where_it_is() -> None:
    """The forearm's pixels turn with the elbow; a taut cable is coloured and a slack one is not; the ghost appears."""
    with ArmRenderer(PAPER, 240, 240) as renderer:
        straight, bent = renderer.draw(Pose(0.0)), renderer.draw(Pose(90.0 * RADIANS))
        again = renderer.draw(Pose(0.0))
        slack = renderer.draw(Pose(90.0 * RADIANS, None, 0.0, 0.0))
        ghost = renderer.draw(Pose(0.0, 90.0 * RADIANS))
    assert np.array_equal(straight, again)
    assert (straight[2, -2] > 250).all()  # a light background

    def skin(picture: Any) -> tuple[float, float]:
        red, green, blue = (picture[:, :, i].astype(float) for i in range(3))
        rows, columns = np.nonzero((red - blue > 40.0) & (green - blue > 10.0))
        return float(rows.max()), float(columns.max())

    assert skin(straight)[0] > skin(bent)[0] + 60.0  # the hand comes up
    assert skin(bent)[1] > skin(straight)[1] + 60.0  # and forward

    def red(picture: Any) -> int:
        one = picture.astype(float)
        return int(((one[:, :, 0] > 120.0) & (one[:, :, 1] < 100.0) & (one[:, :, 2] < 100.0)).sum())

    assert red(bent) > 20
    assert red(slack) == 0
    assert np.abs(ghost.astype(float) - straight).sum(axis=2)[:, 160:].max() > 30.0


def test_what_holds_the_arm_is_its_torque_over_the_lever() -> None:
    first, *_, last = arm_pictures.holding(PAPER, Arm())
    assert (first.flexor, last.extensor) == (0.0, 0.0)
    assert first.extensor == pytest.approx(0.75 * 73.0 * RADIANS / 0.05)  # the passive elbow wants to bend
    weight = 1.65 * GRAVITY * 0.174251 + 0.75 * 17.0 * RADIANS
    assert last.flexor == pytest.approx(weight / ((0.085 + 0.035) * math.sqrt(0.5)))


def test_poses_are_the_trace_at_the_frames(run: Trace) -> None:
    first, middle = poses(run, [0.0, 4.0])
    assert middle.angle == pytest.approx(run["joint"][4000], abs=1e-3)
    assert middle.reference == pytest.approx(0.5 * math.pi, abs=1e-3)
    assert middle.flexor == pytest.approx(
        run["flexor_tension"][4000] / max(run["flexor_tension"].max(), run["extensor_tension"].max()), abs=1e-3
    )
    assert 0.0 <= first.flexor < middle.flexor <= 1.0


@pytest.mark.usefixtures("screen")
def test_a_run_becomes_a_video_that_browsers_play(
    run: Trace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="needs the extra bowden[mujoco]").get_ffmpeg_exe()
    monkeypatch.chdir(tmp_path)
    run.to_parquet("run.parquet")
    assert main.run(["arm", "render", "run.parquet", "--fps", "2", "--speed", "8", "--json", "--out", "film"]) == 0
    found = json.loads(capsys.readouterr().out)
    jsonschema.validate(found, json_schema("arm render"))
    assert found["files"] == [str(Path("film") / "arm.png"), str(Path("film") / "run.mp4")]
    assert found["frames"] == 2
    assert Path("film/arm.png").read_bytes()[1:4] == b"PNG"
    said = subprocess.run([ffmpeg, "-i", "film/run.mp4", "-f", "null", "-"], capture_output=True, text=True)
    assert said.returncode == 0
    assert re.search(r"Video: h264 .*yuv420p.* 1280x720", said.stderr)
    assert re.search(r"frame=\s*2\b", said.stderr)
    content = Path("film/run.mp4").read_bytes()
    assert content.index(b"moov") < content.index(b"mdat")  # plays before it is there whole


def test_a_run_without_an_elbow_has_no_video(run: Trace, tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no video of a trace with the columns time"):
        write_video(tmp_path / "a.mp4", Trace({"time": run.time}, {"time": "s"}), PAPER)
    nothing = {"time": run.time, "joint": np.full(len(run), np.nan)}
    with pytest.raises(LogError, match="no elbow angle at its start"):
        write_video(tmp_path / "a.mp4", Trace(nothing, run.units), PAPER)
    with pytest.raises(ParameterError, match="0 frames a second"):
        write_video(tmp_path / "a.mp4", run, PAPER, fps=0.0)
    assert list(tmp_path.iterdir()) == []


# The command.


@pytest.mark.long
def test_check_says_that_all_agrees(
    run: Trace, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("bowden.report.arm_page.arm_data_uri", lambda *_: None)  # a picture takes long,
    monkeypatch.setattr("bowden.sim.arm_agreement.simulate", lambda *_, **__: run)  # and so does another law
    short = lambda *given: [case._replace(duration=4.0) for case in arm_check.cases(*given)]  # noqa: E731
    monkeypatch.setattr("bowden.sim.arm_agreement.cases", short)
    assert main.run(["arm", "check", "--json"]) == 0
    printed = capsys.readouterr()
    assert printed.err == ""
    found = json.loads(printed.out)
    jsonschema.validate(found, json_schema("arm check"))
    assert (found["verdict"], found["reasons"]) == ("agrees", [])
    assert [one["name"] for one in found["motions"]][-2:] == ["suit, uncompensated", "suit, adaptive"]
    page = Path("out/arm/check.html").read_text()
    assert "Not in agreement" not in page
    assert page.count("<svg") == 2


@pytest.mark.parametrize("options", [["--mass-kg", "0"], ["--joint-radius-mm", "95"], ["--height-m", "5"]])
def test_an_impossible_wearer_is_refused_in_one_line(
    options: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main.run(["arm", "check", *options]) == 2
    printed = capsys.readouterr()
    assert printed.out == ""
    assert printed.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
