"""The power state machine: its table is complete, both sides agree, and a fault is never left by itself."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.core.signals import DriveState
from bowden.hardware.drives import cia402
from bowden.hardware.drives.cia402 import CONTROL, STATUS, WITH_TORQUE, Controlword, controlword, decode, encode
from bowden.hardware.drives.emergencies import emergency_text
from bowden.hardware.ports import Power

STARTING = {DriveState.NOT_READY_TO_SWITCH_ON, DriveState.FAULT_REACTION_ACTIVE}


def climb(state: DriveState, power: Power, cycles: int = 10) -> list[DriveState]:
    """What the drive's side makes of our side's words, cycle by cycle."""
    states, before = [state], 0
    for _ in range(cycles):
        control = controlword(states[-1], power)
        states.append(cia402.step(states[-1], control, bool(control & 0x80 and not before & 0x80)))
        before = control
    return states


def test_every_state_and_every_request_have_a_word() -> None:
    assert set(CONTROL) == set(itertools.product(DriveState, Power))


@pytest.mark.parametrize(
    ("word", "state"),
    [
        (0x0000, DriveState.NOT_READY_TO_SWITCH_ON),
        (0x0250, DriveState.SWITCH_ON_DISABLED),
        (0x0231, DriveState.READY_TO_SWITCH_ON),
        (0x0233, DriveState.SWITCHED_ON),
        (0x1637, DriveState.OPERATION_ENABLED),
        (0x0217, DriveState.QUICK_STOP_ACTIVE),
        (0x021F, DriveState.FAULT_REACTION_ACTIVE),
        (0x0218, DriveState.FAULT),
        (0x0238, DriveState.FAULT),
    ],
)
def test_statuswords_as_drives_send_them(word: int, state: DriveState) -> None:
    assert decode(word) is state


@given(st.integers(0, 0xFFFF))
def test_a_statusword_has_one_state_at_most(word: int) -> None:
    fits = [state for state, (mask, value) in STATUS.items() if word & mask == value]
    assert len(fits) <= 1
    assert decode(word) is (fits[0] if fits else DriveState.NOT_READY_TO_SWITCH_ON)


@pytest.mark.parametrize("state", DriveState)
def test_a_statusword_goes_there_and_back(state: DriveState) -> None:
    assert decode(encode(state)) is state


@pytest.mark.parametrize("state", set(DriveState) - STARTING - {DriveState.FAULT, DriveState.QUICK_STOP_ACTIVE})
@pytest.mark.parametrize(
    ("power", "goal"),
    [
        (Power.OFF, DriveState.SWITCH_ON_DISABLED),
        (Power.READY, DriveState.SWITCHED_ON),
        (Power.ON, DriveState.OPERATION_ENABLED),
    ],
)
def test_every_request_is_reached_and_held(state: DriveState, power: Power, goal: DriveState) -> None:
    states = climb(state, power)
    assert states[-1] is goal
    assert states[4] is goal, "in no more than four steps"


@pytest.mark.parametrize("state", DriveState)
@pytest.mark.parametrize("power", [power for power in Power if power is not Power.ON])
def test_only_the_request_for_power_gives_torque(state: DriveState, power: Power) -> None:
    for before, after in itertools.pairwise(climb(state, power)):
        assert after is not DriveState.OPERATION_ENABLED or before is DriveState.OPERATION_ENABLED


@pytest.mark.parametrize("power", Power)
@pytest.mark.parametrize("state", [DriveState.FAULT, *STARTING])
def test_a_fault_is_never_left_by_itself(state: DriveState, power: Power) -> None:
    assert set(climb(state, power)) == {state}
    assert controlword(state, power) == Controlword.DISABLE_VOLTAGE


def test_a_quick_stop_is_let_go_to_its_end_and_then_stays_off() -> None:
    states = climb(DriveState.OPERATION_ENABLED, Power.QUICK_STOP)
    assert states[1:] == [DriveState.QUICK_STOP_ACTIVE] * 10
    assert climb(DriveState.SWITCH_ON_DISABLED, Power.QUICK_STOP)[-1] is DriveState.SWITCH_ON_DISABLED
    for power in (Power.OFF, Power.READY, Power.ON):
        assert climb(DriveState.QUICK_STOP_ACTIVE, power)[1] not in WITH_TORQUE


@pytest.mark.parametrize("state", DriveState)
@pytest.mark.parametrize("power", Power)
def test_a_reset_is_sent_in_fault_and_nowhere_else(state: DriveState, power: Power) -> None:
    sent = controlword(state, power, reset=True)
    assert (sent == Controlword.FAULT_RESET) == (state is DriveState.FAULT)


def test_a_reset_works_on_its_edge_and_only_when_the_cause_is_gone() -> None:
    assert cia402.step(DriveState.FAULT, Controlword.FAULT_RESET, edge=True) is DriveState.SWITCH_ON_DISABLED
    assert cia402.step(DriveState.FAULT, Controlword.FAULT_RESET, edge=False) is DriveState.FAULT
    assert cia402.step(DriveState.FAULT, Controlword.FAULT_RESET, edge=True, fault_gone=False) is DriveState.FAULT


@given(st.sampled_from(DriveState), st.integers(0, 0xFFFF), st.booleans(), st.booleans())
def test_no_word_gives_torque_but_enable_operation_from_switched_on(
    state: DriveState, control: int, edge: bool, gone: bool
) -> None:
    after = cia402.step(state, control, edge, gone)
    if after is DriveState.OPERATION_ENABLED and state is not DriveState.OPERATION_ENABLED:
        assert state is DriveState.SWITCHED_ON
        assert control & 0x0F == 0x0F


@given(st.integers(-1, 0x1_FFFF))
def test_every_emergency_has_a_text(code: int) -> None:
    assert len(emergency_text(code)) > 8
    assert "unknown" not in emergency_text(code & 0xFF | 0x8100)


def test_known_emergencies() -> None:
    assert "heartbeat" in emergency_text(0x8130)
    assert "temperature" in emergency_text(0x4299)
    assert "unknown" in emergency_text(0xB000)
