"""[admittance] on the command line: what the wearer feels, and one line for what cannot be rendered."""

import json
from pathlib import Path

import pytest

from bowden.app import main
from bowden.control import LAWS
from bowden.control.admittance.virtual_elbow import Admittance
from bowden.control.source import TABLE
from bowden.core.errors import ParameterError
from bowden.core.units import RADIANS
from bowden.hardware.twin.plant import FOLLOW
from bowden.hardware.twin.suit import TwinSuit
from bowden.live.live_run import live_run
from bowden.models.cable.sheath_path import constant_bend
from bowden.models.drive.geared_motor import GearedMotor
from bowden.plants import pushing
from bowden.plants.pushing import behind, push_of
from bowden.plants.suit_parts import Suit
from bowden.records.trace import Trace
from bowden.rig.rig import Rig
from support.command import Command
from support.pushed_suit import MIDDLE

pytestmark = pytest.mark.usefixtures("undrawn")

RIG = """
[suit]
worn = true
[wearer]
share = 1.0
resisting_nm_per_rad = 100.0
resisting_nms_per_rad = 3.0
resisting_at_deg = 45.0
swing_deg = 20.0
[control]
law = "uncompensated"
[reference]
kind = "point_to_point"
times_s = [0.0, 1.0]
positions_deg = [45.0, 45.0]
[scenario]
duration_s = 6.0
[admittance]
enabled = true
"""


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("rig.toml").write_text(RIG)
    return tmp_path


@pytest.mark.drawn
def test_the_push_makes_the_reference(command: Command) -> None:
    document = command.document("simulate rig.toml --out out")
    (run,) = document["runs"]
    assert run["interaction"]["rms_nm"] < 1.0
    assert run["interaction"]["rms_nm"] < run["interaction"]["peak_nm"]
    trace = Trace.read("out/uncompensated.npz")
    assert trace.units["admittance.push.torque"] == "N·m"
    assert trace.units["admittance.virtual.velocity"] == "rad/s"
    assert "Push of the wearer" in Path("out/simulate.html").read_text()


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("virtual_inertia = 0.001", "an inertia of at least 0.0"),
        ("virtual_inertia = -1.0", "admittance.virtual_inertia is -1"),
        ("virtual_inertia = 0.0\nvirtual_damping = 0.0", "inertia and damping are both 0"),
        ("low_deg = 90.0\nhigh_deg = 10.0", "the range is"),
        ('torque = "guess"', "admittance.torque is 'guess'"),
        ("virtual_mass = 1.0", "unknown key 'virtual_mass'"),
    ],
)
def test_what_cannot_be_rendered_is_one_line(keys: str, said: str, command: Command) -> None:
    Path("rig.toml").write_text(f"{RIG}{keys}\n")
    printed = command("simulate rig.toml --json", code=2)
    assert printed.out == ""
    assert said in printed.err
    assert printed.err.count("\n") == 1
    assert not Path("out").exists() or not list(Path("out").rglob("*.html"))


PUSH, ESTIMATE = (
    ("worn = true", "worn = true\nfriction_feedforward_nm = 2.79"),
    ("true\n", 'true\ntorque = "estimate"\n'),
)


@pytest.mark.parametrize(
    ("changes", "options", "said"),
    [
        (
            [],
            [],
            'torque is "load_cell"; expected a load cell that measures the joint\'s torque in a live run',
        ),
        ([ESTIMATE], [], "suit.friction_feedforward_nm is 0 in a live run by [admittance]; expected at least "),
        (
            [ESTIMATE, ("worn = true", "worn = true\nfriction_feedforward_nm = 0.1")],
            [],
            "suit.friction_feedforward_nm is 0.1 in a live run by [admittance]; expected at least ",
        ),
        ([ESTIMATE, PUSH], ["--emg", "lsl:EMG"], "admittance.enabled is true in a run by EMG; expected one source"),
        (
            [ESTIMATE, PUSH, ("worn = true", "worn = true\ndrive_integral_per_s = 40.0")],
            [],
            "suit.drive_integral_per_s is 40 under [admittance], where the loop of most wearers oscillates; expected 0",
        ),
        (
            [ESTIMATE, PUSH, ("true\n", "true\nlow_deg = 90.0\n")],
            [],
            "low_deg is 90 and high_deg 120; expected some of it 5° or more inside the joint's limits, -28.65 to 85.94",
        ),
        (
            [ESTIMATE, PUSH, ('"estimate"\n', '"estimate"\nlow_deg = 50.0\n[limits]\nmotor_high_deg = 40.0\n')],
            [],
            "low_deg is 50 and high_deg 120; expected some of it inside the motor's limits, -17.19 to 40; correct",
        ),
        (
            [
                *(ESTIMATE, PUSH),
                (
                    '"estimate"\n',
                    '"estimate"\n[limits]\njoint_high_deg = 30.0\nmotor_low_deg = 26.0\nmotor_high_deg = 60.0\n',
                ),
            ],
            [],
            "some of it 5° or more inside the joint's limits, -28.65 to 30 and inside the motor's limits, 26 to 60",
        ),
    ],
)
def test_what_no_live_run_can_render_is_one_line(
    changes: list[tuple[str, str]], options: list[str], said: str, command: Command
) -> None:
    text = RIG
    for old, new in changes:
        head, _, tail = text.rpartition(old)
        text = head + new + tail
    Path("rig.toml").write_text(text)
    printed = command("run", "rig.toml", "--twin", "--auto", *options, code=2).err
    assert said in printed
    assert printed.count("\n") == 1
    assert not Path("out").exists()


def test_beyond_the_limit_nothing_runs_live(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    class Beyond:
        def refuse(self, settings: Admittance) -> None:
            raise ParameterError(f"an inertia of {settings.inertia:g} swings up")

    monkeypatch.setattr(pushing, "limit_for", lambda suit: Beyond())
    Path("rig.toml").write_text(RIG.replace(*PUSH) + 'torque = "estimate"\n')
    assert main.run(["run", "rig.toml", "--twin", "--auto"]) == 2
    assert capsys.readouterr().err == (
        "bowden: an inertia of 0.012 swings up; change [admittance] in rig.toml, or run it anyway with --force\n"
    )


def test_a_live_reference_is_held_inside_the_supervisors_limits() -> None:
    text = RIG.replace("worn = true", "worn = true\nfriction_feedforward_nm = 2.79")
    Path("rig.toml").write_text(f'{text}torque = "estimate"\n[limits]\njoint_high_deg = 80.0\njoint_low_deg = -1.0\n')
    live = live_run(Rig.read("rig.toml"))
    virtual = live.source().settings.admittance
    assert (virtual.low, virtual.high) == pytest.approx((4.0 * RADIANS, 75.0 * RADIANS))
    held, tracked = live.notes
    assert held == "the reference of [admittance] is held within 4° to 75°, inside [limits]"
    assert tracked.startswith("limits.tracking_deg is 5.73; where a motion turns, friction leaves the motor 28° behind")
    assert live.settings()["admittance"]["estimated"] == 1.0
    assert live_run(Rig.read("rig.toml"), measure=True).source() is TABLE


def test_a_law_is_led_no_further_than_joint_and_motor_may_go_live() -> None:
    text = RIG.replace(*PUSH) + 'torque = "estimate"\n[limits]\njoint_high_deg = 95.0\n'
    for motor_high, room in ((120.0, 5.0), (92.0, 2.0), (80.0, 0.0)):
        Path("rig.toml").write_text(f"{text}motor_high_deg = {motor_high}\n")
        settings = live_run(Rig.read("rig.toml").with_law("adaptive")).source().settings
        assert settings.under.room == pytest.approx(room * RADIANS)
        assert settings.admittance.high == pytest.approx(min(90.0, motor_high) * RADIANS)


@pytest.mark.parametrize(
    ("friction", "made_up", "said"),
    [
        (2.3, 0.0, "refused"),
        (2.3, 0.3, "refused"),
        (2.3, 1.5, "noted"),
        (2.3, 2.79, ""),
        (6.0, 2.79, "refused"),
        (0.2, 0.0, ""),
    ],
)
def test_the_friction_that_is_left_decides_whether_a_live_motor_can_move(
    friction: float, made_up: float, said: str
) -> None:
    keys = f"friction_nm = {friction}\nfriction_feedforward_nm = {made_up}\n"
    Path("rig.toml").write_text(RIG.replace("worn = true\n", f"worn = true\n{keys}") + 'torque = "estimate"\n')
    rig = Rig.read("rig.toml")
    if said == "refused":
        with pytest.raises(ParameterError, match=f"friction_feedforward_nm is {made_up:g} in a live run"):
            live_run(rig)
    else:
        notes = [note for note in live_run(rig).notes if "friction_feedforward_nm" in note]
        assert len(notes) == (said == "noted")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ("friction_feedforward_nm = 0.3", "set it, to 2.79 on the paper's suit (docs/day_one_suit.md)"),
        ("friction_nm = 4.0\nfriction_feedforward_nm = 0.3", "set it (docs/day_one_suit.md)"),
        (
            "friction_nm = 6.0\nfriction_feedforward_nm = 2.79",
            "the suit cannot run live with this drive; use a stronger drive, or reduce the friction",
        ),
    ],
)
def test_the_advice_on_friction_can_be_followed(keys: str, said: str) -> None:
    Path("rig.toml").write_text(RIG.replace("worn = true\n", f"worn = true\n{keys}\n") + 'torque = "estimate"\n')
    with pytest.raises(ParameterError) as refused:
        live_run(Rig.read("rig.toml"))
    assert refused.value.do == said
    least = refused.value.expected.removeprefix("at least ")
    if said.startswith("set it"):
        given = "friction_feedforward_nm = " + least.partition(":")[0]
        Path("rig.toml").write_text(Path("rig.toml").read_text().replace("friction_feedforward_nm = 0.3", given))
        live_run(Rig.read("rig.toml"))
    else:
        assert least.startswith("5.34, and this drive has 4.175 at most: ")


def test_friction_of_another_cable_is_said_not_to_be_foreseen() -> None:
    keys = 'cable = "capstan"\ncapstan_friction = 1.0\nfriction_nm = 0.2\n'
    Path("rig.toml").write_text(RIG.replace("worn = true\n", f"worn = true\n{keys}") + 'torque = "estimate"\n')
    notes = live_run(Rig.read("rig.toml")).notes
    assert sum("friction of its sheath is not foreseen" in note for note in notes) == 1


def test_what_the_drive_makes_up_for_is_not_made_up_for_twice() -> None:
    for given, left in ((0.0, 1.0), (1.0, None), (100.0, 0.0)):
        suit = Suit(motor=GearedMotor(friction_feedforward=given))
        friction = push_of(suit, LAWS["uncompensated"], Admittance()).under.friction
        whole = push_of(Suit(), LAWS["uncompensated"], Admittance()).under.friction
        assert friction == pytest.approx(whole * left if left is not None else whole - given)


def test_friction_leaves_a_motor_without_an_integral_about_so_far_behind() -> None:
    plant = TwinSuit(Suit(), constant_bend(Suit().sheath.bend), 1.0, 1, MIDDLE, 0.0)
    plant.doing, plant.command, began, left = FOLLOW, MIDDLE, plant.motor, behind(Suit())
    for k in range(1, 1001):
        plant.command = MIDDLE + left * min(1.0, k / 500.0)
        plant.advance(1e-3 * k)
    assert plant.motor - began < 0.5 * left
    for k in range(1001, 2001):
        plant.command = MIDDLE + 2.0 * left
        plant.advance(1e-3 * k)
    assert plant.motor - began > 0.5 * left


def test_no_push_without_a_suit(command: Command) -> None:
    Path("rig.toml").write_text(RIG.replace("worn = true", "worn = false"))
    assert "[admittance] is enabled without a suit; expected suit.worn = true" in command.refused("simulate rig.toml")


def test_beyond_the_limit_runs_when_forced_and_says_so(command: Command) -> None:
    Path("rig.toml").write_text(f"{RIG}virtual_inertia = 0.005\n")
    printed = command("simulate rig.toml --force --json")
    assert json.loads(printed.out)["runs"][0]["interaction"] is not None
    assert "swings up" in printed.err
    assert "it runs because of --force" in printed.err
