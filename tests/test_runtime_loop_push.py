"""The wearer's push in the loop, on a clock of the tests': as in the simulation, in the log, in replay, and lost."""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.admittance.push import Push, push_source
from bowden.control.admittance.virtual_elbow import Admittance
from bowden.control.reference import PointToPoint
from bowden.control.source import Measurement
from bowden.core.clock import SECOND
from bowden.core.errors import LogError
from bowden.core.signals import DriveReading, Reference
from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import Filters, TargetSource
from bowden.cycle.torque_offset import TorqueOffset
from bowden.design.felt import felt
from bowden.hardware.twin.suit import TwinSuit
from bowden.live.ended import Ended
from bowden.live.mcap_read import Recording
from bowden.live.preflight import Preflight, Reason
from bowden.live.replay import replay
from bowden.live.run_settings import plain, source_of
from bowden.live.script import Script
from bowden.models.cable.sheath_path import constant_bend
from bowden.models.drive.geared_motor import GearedMotor
from bowden.models.suit.suit_angle import spool_map
from bowden.plants.pushing import behind, friction_of, push_of
from bowden.plants.suit_parts import Suit
from bowden.safety.faults import Fault
from bowden.safety.state import Mode
from bowden.sim.run import simulate
from loop_rig import SUIT_LIMITS, LoopRig
from support.pushed_suit import swinging
from support.simulated_drive import SimulatedDrive

LAW, MIDDLE, CYCLES = LAWS["uncompensated"], 45.0 * RADIANS, 6000
SUIT = Suit(motor=GearedMotor(friction_feedforward=2.79), wearer=swinging(25.0 * RADIANS))
SETTINGS = push_of(SUIT, LAW, Admittance(high=100.0 * RADIANS), estimated=True)
SOURCE = push_source(SETTINGS)


class Losing(SimulatedDrive):
    """A drive of which one measurement is lost from a cycle on, or is off by something in that cycle."""

    lost, missing, off = "", False, math.nan

    def read(self, now: float) -> DriveReading:
        found = super().read(now)
        if not self.missing:
            return found
        wrong, self.off = self.off, self.off if math.isnan(self.off) else 0.0
        return found._replace(**{self.lost: getattr(found, self.lost) + wrong})


def run_of(
    folder: Path, lost: str = "", after: int = 0, suit: Suit = SUIT, off: float = math.nan, cycles: int = CYCLES
) -> tuple[Ended, Recording, list[float]]:
    """A run of so many cycles, and the torques that the wearer felt under the law [N·m].

    The measurement of that name is `lost` so many cycles `after` the law has the motor, or `off` once.
    """
    plant, pushes = TwinSuit(suit, constant_bend(suit.sheath.bend), 1.0, 1, MIDDLE, 1.0), list[float]()
    drive = Losing(plant)
    drive.lost, drive.off = lost, off

    def between(rig: LoopRig) -> None:
        if rig.led > len(pushes):
            if not pushes:
                plant.start_scenario(rig.time / SECOND)
            pushes.append(plant.interaction)
        drive.missing = bool(lost) and rig.led > after

    checks = Preflight(first=20.0 * RADIANS, settle=0.6, noise=0.03, follows=0.25, moved=1.5 * RADIANS, light=5.5)
    script = Script(np.tile([MIDDLE, 0.0, 0.0], (cycles, 1)), MIDDLE, 0.5, checks, 1e-3)
    push = TorqueOffset(suit.motor.friction_feedforward, suit.substeps, spool_map(suit.geometry, suit.spool_radius))
    rig = LoopRig(folder, LAW, SUIT_LIMITS, drive, script, between, arms=(100,), quits=300, source=SOURCE, push=push)
    return *rig.run(), pushes


@pytest.fixture(scope="module")
def followed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Ended, Recording, list[float]]:
    return run_of(tmp_path_factory.mktemp("push"))


def test_the_wearer_feels_of_the_live_suit_what_they_feel_of_the_simulated_one(followed: Any) -> None:
    ended, log, pushes = followed
    assert (ended.mode, ended.faults) == (Mode.STOPPED, 0)
    hold = PointToPoint((0.0, 1e6), (MIDDLE, MIDDLE))
    trace = simulate(SUIT, LAW, hold, duration=6.0, source=SOURCE)
    simulated, live = felt(trace, SUIT.arm).rms, np.array(pushes[3000:-1])
    rms = float(np.sqrt(np.mean(live**2)))
    assert rms == pytest.approx(simulated, rel=0.1)
    assert rms < 1.0
    joint = log["joint"][log["source"] == TargetSource.LAW][3000:]
    assert joint.min() == pytest.approx(20.0 * RADIANS, abs=2.0 * RADIANS)
    assert joint.max() == pytest.approx(70.0 * RADIANS, abs=2.0 * RADIANS)


def test_what_the_log_has_makes_the_same_reference_and_command_interpreted(followed: Any) -> None:
    _, log, _ = followed
    begins = int(np.argmax(log["source"] == TargetSource.LAW_BEGINS))
    names = ("joint_seen", "motor_seen", "current", "reference", "reference_velocity", "requested_target")
    rows = np.column_stack([log[name] for name in names])[begins : begins + 300].tolist()
    nothing, state = Reference(math.nan, math.nan, math.nan), None
    for joint, motor, current, position, velocity, requested_target in rows:
        measured = Measurement(joint, motor, current, math.nan)
        state = SOURCE.start(measured) if state is None else state
        state, made, added = SOURCE.step(state, measured, nothing, 1e-3)
        assert (made.position, made.velocity) == (position, velocity)
        assert made.position + added == requested_target


def test_the_log_replays_with_no_difference_across_a_gap_too(followed: Any) -> None:
    _, log, _ = followed
    keep = np.r_[0:6500, 6600 : len(log.rows)]
    found = replace(log, numbers=log.numbers[keep], rows=log.rows[keep])
    source = source_of({"admittance": plain(SETTINGS)})
    again = replay(found, LAW, SUIT_LIMITS, Filters(), 1e-3, same=True, source=source)
    assert (again.requested_target_largest, again.first_difference, again.verdicts_differing) == (0.0, None, 0)
    assert again.law_cycles > 5000
    assert again.beginnings == 2
    heavier = SETTINGS._replace(admittance=SETTINGS.admittance._replace(damping=0.23))
    other = replay(found, LAW, SUIT_LIMITS, Filters(), 1e-3, same=True, source=push_source(heavier))
    assert other.requested_target_largest


def test_a_torque_offset_that_is_no_number_is_a_difference(followed: Any) -> None:
    _, log, _ = followed
    spool = plain(spool_map(SUIT.geometry, SUIT.spool_radius))
    told = {"push": {"torque": SUIT.motor.friction_feedforward, "substeps": SUIT.substeps, "spool": spool}}
    source = source_of({"admittance": plain(SETTINGS)})
    for spoilt in (False, True):
        rows = log.rows[:3000].copy()
        if spoilt:
            rows[2000, log.columns.index("push.torque")] = math.nan
        found = replace(log, numbers=log.numbers[:3000], rows=rows, settings=told)
        again = replay(found, LAW, SUIT_LIMITS, Filters(), 1e-3, same=True, source=source)
        assert again.torque_largest == 0.0
        assert (again.verdicts_differing, again.deviates) == (spoilt, spoilt)


@pytest.mark.parametrize(
    ("lost", "fault"),
    [
        ("current", Fault.CURRENT_LOST),
        ("joint", Fault.JOINT_LOST),
        pytest.param("motor", Fault.MOTOR_LOST, marks=pytest.mark.long),
    ],
)
def test_a_lost_measurement_releases_and_no_push_is_made_of_it(tmp_path: Path, lost: str, fault: Fault) -> None:
    ended, log, _ = run_of(tmp_path, lost, 1500, cycles=2500)
    assert ended.mode == Mode.LATCHED
    assert ended.faults & 2**fault
    gone = int(np.argmax(np.isnan(log[lost]) & (log["source"] == TargetSource.LAW)))
    ends = gone + int(np.argmax(log["mode"][gone:] >= Mode.RELEASING))
    assert ends - gone <= 8
    assert np.isnan(log["admittance.estimate.torque"][gone]), "a torque that is not known"
    speeds = np.abs(log["admittance.virtual.velocity"][gone - 1 : ends])
    assert (np.diff(speeds) <= 0.0).all(), "the reference comes to rest"
    assert np.isfinite(log["command"]).all()
    assert log["power"][-1] == 0.0


def test_a_reference_goes_no_further_than_its_range_whoever_pushes(tmp_path: Path) -> None:
    strong = SUIT._replace(wearer=swinging(60.0 * RADIANS, share=1.0))
    ended, log, _ = run_of(tmp_path, suit=strong)
    led_by = log["source"] >= TargetSource.LAW_BEGINS
    assert log["reference"][led_by].max() == pytest.approx(100.0 * RADIANS, abs=1e-9)
    assert log["reference"][led_by].min() == pytest.approx(0.0, abs=1e-9)
    assert log["requested_target"][led_by].min() >= SUIT_LIMITS.motor_low
    assert log["requested_target"][led_by].max() <= SUIT_LIMITS.motor_high
    assert not log["faults"][led_by].any()
    # a wearer who throws the arm down at 190°/s gets ahead of the release, which is seen as what it is
    assert ended.mode == Mode.STOPPED or ended.faults == 2**Fault.JOINT_MOTOR_MISMATCH


@pytest.mark.parametrize(
    ("reading", "off"),
    [("joint", 3.0), *(pytest.param(*other, marks=pytest.mark.long) for other in (("joint", -100.0), ("motor", 3.0)))],
)
def test_a_reading_that_the_supervisor_bridges_is_no_push(reading: str, off: float, tmp_path: Path) -> None:
    still = SUIT._replace(wearer=SUIT.wearer._replace(swing=0.0))
    ended, log, _ = run_of(tmp_path, reading, 1500, still, off, cycles=2500)
    led = np.flatnonzero(log["source"] == TargetSource.LAW)[1300:1900]
    assert ended.faults == 0
    assert np.abs(np.diff(log[reading][led])).max() > 2.0
    assert np.ptp(log["reference"][led]) < 1.0 * RADIANS  # without this 18° and more


@pytest.mark.parametrize(("left", "moves"), [(15.5, False), (7.0, True)])
def test_friction_that_leaves_a_motor_far_behind_holds_it_in_the_preflight(
    left: float, moves: bool, tmp_path: Path
) -> None:
    """15° of 20° is where `bowden run` refuses, beforehand; 7.5° where it says nothing."""
    made_up = friction_of(SUIT) * (1.0 - left * RADIANS / behind(SUIT))
    suit = SUIT._replace(motor=SUIT.motor._replace(friction_feedforward=made_up))
    assert behind(suit, made_up) == pytest.approx(left * RADIANS)
    _, log, pushes = run_of(tmp_path, suit=suit, cycles=500)
    assert (len(pushes) > 0) == moves
    assert log["preflight_reason"].max() == (Reason.NONE if moves else Reason.MOTOR_STILL)


def test_settings_of_another_version_are_one_line() -> None:
    told = plain(SETTINGS)
    assert source_of({"admittance": told}).settings == SETTINGS
    assert isinstance(source_of({"admittance": told}).settings, Push)
    for wrong in (1.0, {"under": 1.0}):
        with pytest.raises(LogError, match="no admittance that this version knows"):
            source_of({"admittance": wrong})
    del told["chain"]["sheath"]["gap"]
    with pytest.raises(LogError, match="no admittance that this version knows: they differ in gap"):
        source_of({"admittance": told})
