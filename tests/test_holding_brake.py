"""The holding brake: its policy, what it holds and saves in simulation, live, over the bus, and who is refused one."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.control import LAWS
from bowden.control.reference import PointToPoint
from bowden.core.errors import DriveError, ParameterError
from bowden.core.signals import DriveState
from bowden.core.units import RADIANS
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.hardware.ports import Power
from bowden.hardware.twin.suit import TwinSuit
from bowden.live.brake_hold import BrakeHold
from bowden.live.preflight import Preflight
from bowden.live.script import Script
from bowden.models.cable.sheath_path import constant_bend
from bowden.models.drive.geared_motor import GearedMotor
from bowden.models.drive.holding_brake import (
    ENGAGING,
    FREE,
    HELD,
    RELEASING,
    HoldingBrake,
    brake_begin,
    brake_power,
    brake_step,
)
from bowden.models.suit.suit_angle import spool_map
from bowden.plants.suit_parts import Suit
from bowden.rig.families import DriveNeeds
from bowden.rig.rig import Rig
from bowden.safety.limits import ARM_LOWERING
from bowden.safety.supervisor import Mode
from bowden.sim.run import simulate
from loop_rig import SUIT_LIMITS, LoopRig
from support.memory_bus import DriverLoop
from support.simulated_drive import SimulatedDrive

BRAKE, DT, SPEED = HoldingBrake(holding_torque=0.15, rest_time=0.05), 1e-3, 3.0
SUIT = Suit(motor=GearedMotor(integral=40.0))
STEPS = st.tuples(st.integers(1, 120), st.sampled_from((0.0, 0.5, math.nan)), st.booleans(), st.booleans())


@given(st.lists(STEPS, max_size=12))
def test_the_brake_engages_after_a_rest_and_what_is_sent_stands_until_the_shaft_is_free_again(
    course: list[tuple[int, float, bool, bool]],
) -> None:
    """Whatever is asked, and however long: each phase lasts its delay, and who may not hold is let go of at once."""
    dt = 2.0**-10  # sums are exact
    brake = HoldingBrake(0.15, engage_delay=10 * dt, release_delay=40 * dt, rest_time=48 * dt)
    state, target, lasted, at = brake_begin(0.0), 0.0, 0.0, (0.0, 0.0)  # at rest there, of target and motor
    for cycles, motor, moves, may_hold in course:
        for _ in range(cycles):
            target += SPEED * dt * moves
            after, lasted = brake_step(brake, state, target, motor, may_hold, SPEED, dt), lasted + dt
            rests = all(abs(one - then) <= brake.still for one, then in zip((target, motor), at, strict=True))
            leaves, following = {
                FREE: (rests and may_hold and lasted >= brake.rest_time and after.sent == target, ENGAGING),
                ENGAGING: (not (rests and may_hold) or lasted >= brake.engage_delay, HELD),
                HELD: (not (rests and may_hold), RELEASING),
                RELEASING: (lasted >= brake.release_delay, FREE),
            }[state.phase]
            following = RELEASING if state.phase == ENGAGING and not (rests and may_hold) else following
            assert after.phase == (following if leaves else state.phase)
            way = max(-SPEED * dt, min(SPEED * dt, target - state.sent)) if state.phase == FREE else 0.0
            assert after.sent == pytest.approx(state.sent + way, abs=1e-12)
            if after.phase != state.phase or (state.phase == FREE and not (rests and may_hold)):
                lasted = 0.0
            if lasted == 0.0 and after.phase in (FREE, RELEASING):
                at = target, motor
            state = after


def test_at_rest_the_brake_holds_what_the_current_held_and_a_small_one_slips() -> None:
    rests = PointToPoint((0.0, 3.0, 9.0, 12.0, 13.0), (0.0, 1.4, 1.4, 0.0, 0.0))
    free, held, weak = (
        simulate(SUIT._replace(brake=brake), LAWS["uncompensated"], rests, duration=13.0)
        for brake in (HoldingBrake(), BRAKE, BRAKE._replace(holding_torque=0.001, rest_time=0.5))
    )
    assert "brake" not in free.columns
    on = held["brake"] == HELD
    assert np.mean(on[(held.time > 4.0) & (held.time < 9.0)]) > 0.9
    assert np.all(held["current"][on] == 0.0)
    saved = np.trapezoid(free.power()[1] - held.power()[1], free.time)
    assert saved > 0.9 * np.trapezoid(free.power()[1] * on, free.time) > 0.0
    assert np.max(np.abs(free.error)) == pytest.approx(np.max(np.abs(held.error)), abs=1.0 * RADIANS)
    resting = on & (held.time > 5.0) & (held.time < 9.0)
    assert np.ptp(held["joint"][resting]) < 0.5 * RADIANS
    assert np.count_nonzero(np.diff(weak["brake"]) == RELEASING - HELD) > 3, "it slips, and the motor takes over"
    assert brake_power(BRAKE, held["brake"])[on].max() == BRAKE.engaged_power < BRAKE.released_power


def test_live_it_holds_at_rest_and_a_release_begins_by_releasing_it(tmp_path: Path) -> None:
    suit, rest = SUIT._replace(brake=BRAKE), 45.0 * RADIANS
    plant = TwinSuit(suit, constant_bend(suit.sheath.bend), 1.0, 1, 0.0, 1.0)
    drive, seen = SimulatedDrive(plant), list[tuple[bool, float, float]]()

    def between(rig: LoopRig) -> None:
        seen.append((plant.brake_set, plant.current, plant.motor))

    checks = Preflight(first=8.0 * RADIANS, settle=0.6, noise=0.03, moved=1.5 * RADIANS, light=5.5)
    script = Script(np.tile([rest, 0.0, 0.0], (3000, 1)), rest, 0.5, checks, 1e-3)
    hold = BrakeHold(drive, BRAKE, SUIT_LIMITS, 1e-3)
    rig = LoopRig(
        tmp_path, LAWS["uncompensated"], SUIT_LIMITS, drive, script, between, arms=(100,), quits=300, brake=hold
    )
    ended, log = rig.run()
    assert (ended.mode, ended.faults) == (Mode.STOPPED, 0)
    phase, mode = log["brake.phase"], log["mode"]
    held = phase == HELD
    assert np.count_nonzero(held) > 2000
    assert np.all(mode[held] == Mode.RUNNING)
    off = held & np.roll(held, 1) & np.roll(held, 2)  # what is read was sampled before
    assert np.all(log["drive_state"][off] == DriveState.OPERATION_ENABLED)
    assert np.max(np.abs(log["current"][off])) < 1e-6
    release = np.flatnonzero((mode == Mode.RELEASING) & (log["power"] == Power.ON))
    assert phase[release[0] - 1] == HELD
    assert phase[release[0]] == RELEASING
    late = round(BRAKE.release_delay / DT)
    sent = log["brake.target"]
    assert np.ptp(sent[release[:late]]) == 0.0
    assert np.min(np.diff(sent[release[late:]])) >= -ARM_LOWERING * DT - 1e-9, "let down no faster for the wait"
    assert plant.joint < rest - 20.0 * RADIANS, "the arm was let down"
    assert not plant.brake_set


def over_the_bus(output: str, **changes: int | None) -> tuple[DriverLoop, Any, TwinSuit]:
    given_ = DriveParameters(
        needs=DriveNeeds(gear=SUIT.motor.gear, spool=spool_map(SUIT.geometry, SUIT.spool_radius)),
        brake_output=output,  # type: ignore[arg-type]
        answer_timeout=1.0,
    )
    plant = TwinSuit(SUIT._replace(brake=BRAKE), constant_bend(SUIT.sheath.bend), 1.0, 1, 0.0, 100.0)
    overrides = {(0x60FE, int(sub[-1])): value for sub, value in changes.items()}
    bus = DriverLoop(given_, overrides, lambda now: plant)
    return bus, bus.drive, plant


@pytest.mark.parametrize("output", ["set", "release"])
def test_over_the_bus_the_output_is_driven_confirmed_and_released_with_the_torque(output: str) -> None:
    bus, drive, plant = over_the_bus(output)
    assert plant.brake_set == (output == "release"), "without voltage"
    drive.bring_up()
    assert not plant.brake_set

    def told(engaged: bool, power: Power) -> tuple[bool, DriveState]:
        for _ in range(12):
            reading = drive.read(bus.time)
            drive.set_brake(engaged)
            drive.write(reading.motor, power, bus.time)
            bus.advance(1e-3)
        return plant.brake_set, DriveState(int(reading.drive_state))

    assert told(True, Power.ON) == (True, DriveState.OPERATION_ENABLED)
    assert told(True, Power.READY) == (True, DriveState.SWITCHED_ON)
    assert drive.brake_confirmed
    bus.node.objects.set_data(0x60FE, 1, (output == "release").to_bytes(4, "little"))  # somebody else's word
    assert not plant.brake_set
    assert [told(True, Power.READY)[0] for _ in range(40)][-1], "it is seen, and said again"
    assert told(True, Power.OFF)[0] is False
    told(True, Power.READY)
    drive.close()
    assert not plant.brake_set
    assert {what for _, event, what in bus.journal if event == "brake"} == {"engaged", "released"}


def test_a_drive_that_lets_nobody_drive_the_output_is_refused() -> None:
    _, drive, _ = over_the_bus("set", sub2=None)
    with pytest.raises(DriveError, match="60FEh"):
        drive.bring_up()
    drive.close()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[brake]\nholding_torque_nm = 0.1", "suit.worn = true"),
        ("[brake]\nrest_time_s = 1.0", "brake.holding_torque_nm above 0"),
        ("[suit]\nworn = true\n[brake]\nholding_torque_nm = 0.1", "drive.brake_output"),
        ('[suit]\nworn = true\n[drive]\nfamily = "moteus"\n[brake]\nholding_torque_nm = 0.1', "no output .* cia402"),
        ('[suit]\nworn = true\n[drive]\nbrake_output = "set"\n[brake]\nholding_torque_nm = 0.4', "at most 0.15"),
    ],
)
def test_a_brake_that_nothing_drives_or_that_could_trap_a_limb_is_refused(text: str, said: str, tmp_path: Path) -> None:
    (tmp_path / "rig.toml").write_text(text, encoding="utf-8")
    with pytest.raises(ParameterError, match=said):
        Rig.read(tmp_path / "rig.toml")
