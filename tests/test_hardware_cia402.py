"""The power state machine: its table is complete, both sides agree, and a fault is never left by itself."""

import itertools

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bowden.hardware.drives import cia402
from bowden.hardware.drives.cia402 import (
    CONTROL,
    STATUS,
    WITH_TORQUE,
    Controlword,
    State,
    controlword,
    decode,
    encode,
    fell,
)
from bowden.hardware.drives.emergencies import emergency_text
from bowden.hardware.ports import Power

STARTING = {State.NOT_READY_TO_SWITCH_ON, State.FAULT_REACTION_ACTIVE}


def climb(state: State, power: Power, cycles: int = 10) -> list[State]:
    """What the drive's side makes of our side's words, cycle by cycle."""
    states, before = [state], 0
    for _ in range(cycles):
        control = controlword(states[-1], power)
        states.append(cia402.step(states[-1], control, bool(control & 0x80 and not before & 0x80)))
        before = control
    return states


def test_every_state_and_every_wish_have_a_word() -> None:
    assert set(CONTROL) == set(itertools.product(State, Power))


@pytest.mark.parametrize(
    ("word", "state"),
    [
        (0x0000, State.NOT_READY_TO_SWITCH_ON),
        (0x0250, State.SWITCH_ON_DISABLED),
        (0x0231, State.READY_TO_SWITCH_ON),
        (0x0233, State.SWITCHED_ON),
        (0x1637, State.OPERATION_ENABLED),
        (0x0217, State.QUICK_STOP_ACTIVE),
        (0x021F, State.FAULT_REACTION_ACTIVE),
        (0x0218, State.FAULT),
        (0x0238, State.FAULT),
    ],
)
def test_statuswords_as_drives_send_them(word: int, state: State) -> None:
    assert decode(word) is state


@given(st.integers(0, 0xFFFF))
def test_a_statusword_has_one_state_at_most(word: int) -> None:
    fits = [state for state, (mask, value) in STATUS.items() if word & mask == value]
    assert len(fits) <= 1
    assert decode(word) is (fits[0] if fits else State.NOT_READY_TO_SWITCH_ON)


@pytest.mark.parametrize("state", State)
def test_a_statusword_goes_there_and_back(state: State) -> None:
    assert decode(encode(state)) is state


@pytest.mark.parametrize("state", set(State) - STARTING - {State.FAULT, State.QUICK_STOP_ACTIVE})
@pytest.mark.parametrize(
    ("power", "goal"),
    [
        (Power.OFF, State.SWITCH_ON_DISABLED),
        (Power.READY, State.SWITCHED_ON),
        (Power.ON, State.OPERATION_ENABLED),
    ],
)
def test_every_wish_is_reached_and_held(state: State, power: Power, goal: State) -> None:
    states = climb(state, power)
    assert states[-1] is goal
    assert states[4] is goal, "in no more than four steps"


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("power", [power for power in Power if power is not Power.ON])
def test_only_the_wish_for_power_gives_torque(state: State, power: Power) -> None:
    for before, after in itertools.pairwise(climb(state, power)):
        assert after is not State.OPERATION_ENABLED or before is State.OPERATION_ENABLED


@pytest.mark.parametrize("power", Power)
@pytest.mark.parametrize("state", [State.FAULT, *STARTING])
def test_a_fault_is_never_left_by_itself(state: State, power: Power) -> None:
    assert set(climb(state, power)) == {state}
    assert controlword(state, power) == Controlword.DISABLE_VOLTAGE


def test_a_quick_stop_is_let_go_to_its_end_and_then_stays_off() -> None:
    states = climb(State.OPERATION_ENABLED, Power.QUICK_STOP)
    assert states[1:] == [State.QUICK_STOP_ACTIVE] * 10
    assert climb(State.SWITCH_ON_DISABLED, Power.QUICK_STOP)[-1] is State.SWITCH_ON_DISABLED
    for power in (Power.OFF, Power.READY, Power.ON):
        assert climb(State.QUICK_STOP_ACTIVE, power)[1] not in WITH_TORQUE


@pytest.mark.parametrize("state", State)
@pytest.mark.parametrize("power", Power)
def test_a_reset_is_sent_in_fault_and_nowhere_else(state: State, power: Power) -> None:
    sent = controlword(state, power, reset=True)
    assert (sent == Controlword.FAULT_RESET) == (state is State.FAULT)


def test_a_reset_works_on_its_edge_and_only_when_the_cause_is_gone() -> None:
    assert cia402.step(State.FAULT, Controlword.FAULT_RESET, edge=True) is State.SWITCH_ON_DISABLED
    assert cia402.step(State.FAULT, Controlword.FAULT_RESET, edge=False) is State.FAULT
    assert cia402.step(State.FAULT, Controlword.FAULT_RESET, edge=True, fault_gone=False) is State.FAULT


@given(st.sampled_from(State), st.integers(0, 0xFFFF), st.booleans(), st.booleans())
def test_no_word_gives_torque_but_enable_operation_from_switched_on(
    state: State, control: int, edge: bool, gone: bool
) -> None:
    after = cia402.step(state, control, edge, gone)
    if after is State.OPERATION_ENABLED and state is not State.OPERATION_ENABLED:
        assert state is State.SWITCHED_ON
        assert control & 0x0F == 0x0F


def test_a_drive_that_fell_is_not_switched_on_again_before_off_was_wanted() -> None:
    enabled, down, word = State.OPERATION_ENABLED, State.SWITCH_ON_DISABLED, int(Controlword.ENABLE_OPERATION)
    assert fell(enabled, down, word, False, Power.ON)
    assert fell(down, down, word, True, Power.ON)
    assert fell(down, down, word, True, Power.READY)
    assert not fell(down, down, word, True, Power.OFF)
    assert not fell(enabled, enabled, word, False, Power.ON)
    assert not fell(enabled, State.SWITCHED_ON, int(Controlword.SWITCH_ON), False, Power.READY), "it was asked to"


@given(st.integers(-1, 0x1_FFFF))
def test_every_emergency_has_a_text(code: int) -> None:
    assert len(emergency_text(code)) > 8
    assert "unknown" not in emergency_text(code & 0xFF | 0x8100)


def test_known_emergencies() -> None:
    assert "heartbeat" in emergency_text(0x8130)
    assert "temperature" in emergency_text(0x4299)
    assert "unknown" in emergency_text(0xB000)
