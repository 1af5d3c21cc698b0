"""The loop on a clock of the tests': overruns skip and never burst, a run follows the simulation, its ends release."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.clock import next_deadline
from bowden.core.signals import DriveReading
from bowden.cycle.one_cycle import TargetSource
from bowden.hardware.ports import Power, TorqueLeft
from bowden.hardware.twin.bench import TwinBench
from bowden.live.ended import Ended
from bowden.live.mcap_read import Recording
from bowden.live.preflight import Preflight
from bowden.live.row import NOTHING_READ
from bowden.live.script import Script
from bowden.plants.presets.bench import default_bench
from bowden.safety.faults import Fault
from bowden.safety.limits import Limits
from bowden.safety.release import longest_release
from bowden.safety.state import Mode
from bowden.sim.run import simulate
from loop_rig import PERIOD, LoopRig, twin_bench
from support.simulated_drive import SimulatedDrive

REFERENCE = PeriodicMinimumJerk(0.0, 1.0, 4.0)
SECONDS = 6.0


class Watched:
    """Remembers what it was told."""

    def __init__(self, bench: TwinBench) -> None:
        self.told: list[tuple[float, Power, float]] = []
        self.closed = 0
        self._drive = SimulatedDrive(bench)

    def bring_up(self) -> str:
        return self._drive.bring_up()

    def read(self, now: float) -> DriveReading:
        return self._drive.read(now)

    def reset_fault(self) -> None:
        self._drive.reset_fault()

    def write(self, target: float, power: Power, now: float, torque: float = 0.0) -> None:
        self.told.append((now, power, target))
        self._drive.write(target, power, now, torque)

    def close(self) -> TorqueLeft:
        self.closed += 1
        return self._drive.close()


def rig_of(folder: Path, between: Callable[[LoopRig], None], **asks: Any) -> LoopRig:
    table = REFERENCE.sample(np.arange(round(1000 * SECONDS)) * 1e-3)
    script = Script(table, 0.0, 0.5, Preflight(), 1e-3)
    return LoopRig(folder, LAWS["adaptive"], Limits(), Watched(twin_bench()), script, between, **asks)


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory) -> tuple[LoopRig, Ended, Recording]:
    def between(rig: LoopRig) -> None:
        rig.time += 40_000

    rig = rig_of(tmp_path_factory.mktemp("run"), between)
    return rig, *rig.run()


def test_a_run_is_as_good_as_its_simulation(whole: tuple[LoopRig, Ended, Recording]) -> None:
    _, ended, rows = whole
    assert Mode(ended.mode) == Mode.STOPPED
    assert ended.faults == 0
    led = rows["source"] >= TargetSource.LAW_BEGINS
    error = (rows["joint"] - rows["reference"])[led]
    pure = simulate(default_bench(), LAWS["adaptive"], REFERENCE, duration=SECONDS, seed=1)
    wanted = np.sqrt(np.mean(pure.error**2))
    assert len(error) >= 1000 * SECONDS - 2
    assert np.sqrt(np.mean(error**2)) == pytest.approx(wanted, rel=0.1)


def test_it_ends_in_a_release_and_the_power_stays_off(whole: tuple[LoopRig, Ended, Recording]) -> None:
    rig, _, rows = whole
    modes = [Mode(int(mode)) for mode in rows["mode"][np.flatnonzero(np.diff(rows["mode"], prepend=-1.0))]]
    assert modes == [Mode.STOPPED, Mode.PREFLIGHT, Mode.RUNNING, Mode.RELEASING, Mode.STOPPED]
    off = np.flatnonzero(rows["mode"] == Mode.RELEASING)[-1] + 1
    assert all(power == Power.OFF for _, power, _ in rig.drive.told[off:])
    assert rig.drive.closed == 1
    assert rig.reader.closed


def test_every_cycle_is_a_row(whole: tuple[LoopRig, Ended, Recording]) -> None:
    rig, ended, rows = whole
    assert ended.cycles == len(rows["time"]) == len(rig.drive.told)
    assert np.all(rows["overruns"] == 0.0)
    assert rows["lateness"] == pytest.approx(4e-5)
    assert rows["elapsed"][1:] == pytest.approx(1e-3)


@pytest.mark.parametrize(("gone", "unattended"), [(True, True), (False, False)])
def test_a_run_whose_operator_is_not_seen_before_it_is_armed_did_not_end_as_asked(
    gone: bool, unattended: bool, tmp_path: Path
) -> None:
    def between(rig: LoopRig) -> None:
        rig.operator = not gone or rig.sleeps < 20

    ended, _ = rig_of(tmp_path, between, arms=(), quits=1e9 if gone else 200).run()
    assert Mode(ended.mode) == Mode.STOPPED
    assert (ended.unattended > Limits().operator_age) == unattended
    assert unattended or ended.unattended == 0.0


def test_a_run_that_came_to_its_end_needs_nobody_afterwards(tmp_path: Path) -> None:
    def between(rig: LoopRig) -> None:
        rig.operator = not rig.drive.told or rig.drive.told[-1][1] != Power.OFF or rig.led < 1000 * SECONDS - 2

    ended, rows = rig_of(tmp_path, between, quits=1e9).run()
    assert Mode(ended.mode) == Mode.STOPPED
    assert (rows["source"] >= TargetSource.LAW_BEGINS).sum() >= 1000 * SECONDS - 2
    assert ended.unattended == 0.0


def test_an_overrun_skips_and_never_bursts(tmp_path: Path) -> None:
    stalls = {50: 3_400_000, 51: 0, 80: 12_900_000, 120: 990_000}

    def between(rig: LoopRig) -> None:
        rig.time += stalls.get(rig.sleeps, 0)

    rig = rig_of(tmp_path, between, arms=())
    ended, rows = rig.run()
    assert ended.overruns == 3 + 12 + 0
    assert rows["overruns"][[51, 81]].tolist() == [3.0, 12.0]
    sent = np.array([round(now * 1e9) for now, _, _ in rig.drive.told])
    deadlines = sent - np.round(1e9 * rows["lateness"]).astype(int)
    assert np.all((deadlines - deadlines[0]) % PERIOD == 0), "deadlines leave their grid"
    assert np.diff(deadlines).min() >= PERIOD, "two cycles for one deadline"
    assert np.abs(rows["time"] - sent * 1e-9).max() < 1e-6


class Paused(SimulatedDrive):
    """Samples when it is written to, by the rig's clock, while the loop's process may have stood still before."""

    rig: LoopRig
    pauses: dict[int, int]
    """Number of the sleep before → how long the process stands still between reading and writing [ns]."""

    def read(self, now: float) -> DriveReading:
        reading = super().read(now)
        self.rig.time += self.pauses.get(self.rig.sleeps, 0)
        return reading

    def write(self, target: float, power: Power, now: float, torque: float = 0.0) -> None:
        super().write(target, power, self.rig.time * 1e-9, torque)
        self._sampled = now


def test_a_process_that_stands_still_within_a_cycle_is_no_jump_of_an_angle(tmp_path: Path) -> None:
    """In a release, where the motor is fast: what is sampled after the pause is judged by the time that it took."""
    table, drive = REFERENCE.sample(np.arange(round(1000 * SECONDS)) * 1e-3), Paused(twin_bench())
    drive.pauses = {4000 + 20 * number: 15_000_000 for number in range(1, 6)}

    def between(rig: LoopRig) -> None:
        if rig.sleeps == 4000:
            rig.loop.quit()

    script = Script(table, 0.0, 0.5, Preflight(), 1e-3)
    drive.rig = LoopRig(tmp_path, LAWS["adaptive"], Limits(), drive, script, between, quits=np.inf)
    _, rows = drive.rig.run()
    assert np.abs(np.diff(rows["motor"][4000:4120])).max() > 0.02
    seen = {fault for fault in Fault if np.any(rows["faults"].astype(np.uint64) >> np.uint64(fault) & np.uint64(1))}
    assert not seen & {Fault.MOTOR_JUMP, Fault.JOINT_JUMP}


@pytest.mark.parametrize("late", [0, 1, 999_999, 1_000_000, 1_000_001, 7_300_000])
def test_the_next_deadline_is_the_first_that_is_to_come(late: int) -> None:
    following, skipped = next_deadline(5 * PERIOD, 5 * PERIOD + late, PERIOD)
    assert following % PERIOD == 0
    assert 0 < following - (5 * PERIOD + late) <= PERIOD
    assert following == (6 + skipped) * PERIOD


def test_an_operator_that_is_gone_ends_the_run(tmp_path: Path) -> None:
    def between(rig: LoopRig) -> None:
        rig.operator = rig.sleeps < 1500

    rig = rig_of(tmp_path, between, quits=np.inf)
    ended, rows = rig.run()
    gone = 1500
    released = np.flatnonzero(rows["mode"] == Mode.RELEASING)
    assert 275 <= released[0] - gone <= 285
    assert len(released) <= 1000 * longest_release(Limits()) + 5
    assert Mode(ended.mode) in (Mode.LATCHED, Mode.STOPPED)
    assert rig.drive.told[-1][1] == Power.OFF


def test_quitting_in_mid_run_releases_first(tmp_path: Path) -> None:
    def between(rig: LoopRig) -> None:
        rig.time += 40_000
        if rig.sleeps == 4000:
            rig.loop.quit()

    ended, rows = rig_of(tmp_path, between, quits=np.inf).run()
    assert Mode(int(rows["mode"][3999])) == Mode.RUNNING
    assert Mode(int(rows["mode"][4001])) == Mode.RELEASING
    assert Mode(ended.mode) == Mode.STOPPED
    assert ended.faults == 0


def test_what_is_bridged_goes_on_where_it_was() -> None:
    table = REFERENCE.sample(np.arange(1000) * 1e-3)
    script = Script(table, 0.0, 0.5, Preflight(), 1e-3)
    still = NOTHING_READ._replace(motor=0.0, joint=0.0, drive_state=4.0)
    for mode in (Mode.PREFLIGHT, Mode.BRIDGING, Mode.PREFLIGHT):
        assert script.plan(float(mode), 0.0, still, 1).source == TargetSource.MOTION
    sources, places = [], []
    for mode in (Mode.RUNNING, Mode.RUNNING, Mode.BRIDGING, Mode.RUNNING):
        plan = script.plan(float(mode), 0.0, still, 1)
        sources.append(plan.source)
        places.append(plan.reference.position)
    assert sources == [TargetSource.LAW_BEGINS, TargetSource.LAW, TargetSource.LAW, TargetSource.LAW]
    assert places == [row[0] for row in table[:4]]


@pytest.mark.parametrize("aside", [0.05, -0.05])
def test_the_law_begins_where_the_joint_is_and_is_on_its_reference_a_second_later(aside: float) -> None:
    table = REFERENCE.sample(np.arange(2000) * 1e-3)
    script = Script(table, 0.0, 0.5, Preflight(), 1e-3)
    off = NOTHING_READ._replace(motor=0.0, joint=aside, drive_state=4.0)
    heard = np.array([script.plan(float(Mode.RUNNING), 0.0, off, 1).reference for _ in range(1500)])
    assert heard[0, 0] == aside
    np.testing.assert_array_equal(heard[1000:], table[1000:1500])
    np.testing.assert_allclose(np.gradient(heard[:, 0], 1e-3)[1:-1], heard[1:-1, 1], atol=1e-4)  # no step anywhere


def test_a_joint_that_is_far_off_or_unknown_is_not_blended_away() -> None:
    table = REFERENCE.sample(np.arange(100) * 1e-3)
    for joint in (1.0, float("nan")):
        script = Script(table, 0.0, 0.5, Preflight(), 1e-3)
        told = NOTHING_READ._replace(motor=0.0, joint=joint, drive_state=4.0)
        assert script.plan(float(Mode.RUNNING), 0.0, told, 1).reference.position == table[0, 0]
