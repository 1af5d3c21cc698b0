"""The paper's laws, each alone, with nothing else around it."""

import json
import math
from dataclasses import replace
from typing import Any, NamedTuple

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from bowden.control import LAWS
from bowden.control.law import Law
from bowden.control.laws.adaptive import AdaptiveState
from bowden.control.laws.observer import ObserverGains
from bowden.control.laws.observer import start as observer_start
from bowden.control.laws.observer import step as observer_step
from bowden.control.reference import PeriodicMinimumJerk
from bowden.control.stability import adaptive_model, response
from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled, kernel
from bowden.core.nested import flat
from bowden.core.signals import Reference, Sample
from bowden.core.units import RADIANS
from bowden.models.cable.bouc_wen import BoucWen, advance, joint_angle

DT = 1e-3
STILL = Reference(0.0, 0.0, 0.0)
numbers = st.floats(-3.0, 3.0)


@kernel
def quasi_static(gains: Any, cable: Any, references: Any, follow: float, errors: Any) -> None:
    """The observer on a motor that takes up `follow` of the distance to its command in each cycle."""
    motor, h, joint = 0.0, 0.0, cable.offset
    state = observer_start(gains, Sample(joint, motor))
    for k in range(len(references)):
        reference = Reference(references[k, 0], references[k, 1], references[k, 2])
        state, command = observer_step(gains, state, Sample(joint, motor), reference, 1e-3)
        travel = follow * (command - motor)
        h, motor = advance(h, travel, cable), motor + travel
        joint = joint_angle(motor, h, cable)
        errors[k] = joint - references[k, 0]


def quasi_static_error(gains: ObserverGains, cable: BoucWen, follow: float) -> float:
    """RMS of joint − reference [rad] over two slow strokes, without the first second."""
    references = PeriodicMinimumJerk(0.0, 70.0 * RADIANS, 20.0).sample(np.arange(0.0, 40.0, DT))
    errors = np.empty(len(references))
    compiled(quasi_static)(gains, cable, references, follow, errors)
    return float(np.sqrt(np.mean(np.square(errors[1000:]))))


@pytest.mark.parametrize("name", LAWS)
def test_a_law_is_a_pure_function_with_a_state_of_numbers(name: str) -> None:
    law = LAWS[name]
    state = law.start(Sample(0.1, 0.2))
    arguments = (state, Sample(0.11, 0.21), Reference(0.3, 0.1, -0.2), DT)
    first, second = law.step(*arguments), law.step(*arguments)
    assert first == second
    after, command = first
    assert type(after) is type(state)
    assert all(isinstance(float(value), float) for value in (*flat(after), command))
    json.dumps(law.gains._asdict())


def commands(law: Law, way: float, motor_way: float) -> NDArray[np.float64]:
    """Of a law on a noisy motion with a play of 0.1 rad, the joint's and the motor's angles each counted one `way`."""
    time, random, given = np.arange(1500) * DT, np.random.default_rng(2), []
    motion = np.array([0.6 * np.sin(3.0 * time), 1.8 * np.cos(3.0 * time), -5.4 * np.sin(3.0 * time)])
    late, state = 0.6 * np.sin(3.0 * time - 0.1), law.start(Sample(0.0, motor_way * 0.05))
    for k, (off, more) in enumerate(random.normal(0.0, 1e-3, (1500, 2))):
        motor = late[k] / 0.9 + 0.05 * math.copysign(1.0, motion[1, k]) + more
        sample = Sample(way * float(late[k] + off), motor_way * float(motor))
        state, command = law.step(state, sample, Reference(*(way * motion[:, k]).tolist()), DT)
        given.append(command)
    return np.array(given)


@pytest.mark.parametrize("name", LAWS)
def test_a_law_knows_neither_side_nor_which_way_its_cable_runs(name: str) -> None:
    """Mirrored, and with its motor counted the other way on a slope below zero: the same commands, mirrored."""
    law = LAWS[name]
    plain = commands(law, 1.0, 1.0)
    assert np.ptp(plain) > 1.0
    np.testing.assert_allclose(commands(law, -1.0, -1.0), -plain, rtol=0.0, atol=1e-12)
    given = law.gains._asdict()
    turned = {key: -given[key] for key in ("slope", "hysteresis_gain") if key in given}
    if "lowest_slope" in given:
        turned |= {"lowest_slope": -given["highest_slope"], "highest_slope": -given["lowest_slope"]}
    if "slope" in turned:
        backwards = replace(law, gains=law.gains._replace(**turned))
        np.testing.assert_allclose(commands(backwards, 1.0, -1.0), -plain, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", LAWS)
def test_unknown_gains_and_presets_are_refused(name: str) -> None:
    with pytest.raises(ParameterError, match=f"law '{name}' has no gain 'kapa'; expected one of "):
        LAWS[name].with_gains(kapa=1.0)
    with pytest.raises(ParameterError, match=f"law '{name}' has no preset"):
        LAWS[name].preset("best")


class Part(NamedTuple):
    first: float = 1.0
    second: float = 2.0


class Whole(NamedTuple):
    slope: float = 1.0
    part: Part = Part()


def test_a_gain_of_a_nested_part_is_changed_by_its_dotted_name() -> None:
    law = replace(LAWS["uncompensated"], gains=Whole(), from_rig={})
    assert law.with_gains(**{"part.second": 3.0}).gains == Whole(1.0, Part(1.0, 3.0))
    assert law.with_gains(**{"slope": 0.5, "part.first": 4.0}).gains == Whole(0.5, Part(4.0, 2.0))
    with pytest.raises(ParameterError, match=r"no gain 'part\.third'"):
        law.with_gains(**{"part.third": 3.0})


@given(numbers, numbers, numbers, numbers)
def test_uncompensated_is_the_identity(joint: float, motor: float, wanted: float, rate: float) -> None:
    law = LAWS["uncompensated"]
    state = law.start(Sample(joint, motor))
    assert state.command == motor
    assert law.step(state, Sample(joint, motor), Reference(wanted, rate, 0.0), DT)[1] == wanted
    reversed_cable = law.with_gains(slope=-2.0)
    assert reversed_cable.step(state, Sample(joint, motor), Reference(wanted, rate, 0.0), DT)[1] == -0.5 * wanted


@pytest.mark.parametrize(
    ("cable", "follow"), [(BoucWen(), 0.05), (BoucWen(rate=5.0), 1.0), (BoucWen(slope=-0.9, offset=0.3), 0.05)]
)
def test_observer_takes_a_known_hysteresis_away(cable: BoucWen, follow: float) -> None:
    """With exact parameters; where the cable is monotone, on a motor that follows at once, else on a slow one."""
    exact = ObserverGains(*cable)
    uncompensated = quasi_static_error(exact._replace(hysteresis_gain=0.0), cable, follow)
    assert uncompensated > 2.0 * RADIANS
    assert quasi_static_error(exact, cable, follow) < 0.1 * uncompensated


def test_observer_driven_by_the_reference_does_not_look_at_the_sensors() -> None:
    law = LAWS["observer"].with_gains(from_reference=1.0)
    commands = []
    for noise in (0.0, 1.0):
        random = np.random.default_rng(0)
        state, record = law.start(Sample(0.0, 0.0)), []
        for k in range(300):
            sample = Sample(*(noise * random.normal(0.0, 1.0, 2)).tolist())
            state, command = law.step(state, sample, Reference(0.5 * math.sin(0.01 * k), 0.0, 0.0), DT)
            record.append(float(command))
        commands.append(record)
    assert commands[0] == commands[1]


@given(numbers, numbers, numbers, numbers, st.floats(0.0, 2.0), st.floats(0.0, 0.5), numbers)
def test_adaptive_is_eqs_9_to_14(
    joint: float, before: float, wanted: float, rate: float, beta: float, bound: float, integral: float
) -> None:
    """One step, written out from PAPER.md's notation."""
    law = LAWS["adaptive"].preset("paper")
    e = joint - wanted
    integral_after = integral + e * DT
    s = 2.0 * e + integral_after
    switch = math.tanh(s / 0.01)
    phi = wanted - 2.0 * ((joint - before) / DT - rate) - bound * switch
    state = AdaptiveState(integral, beta, bound, before, 0.0, 0.0)
    after, command = law.step(state, Sample(joint, 0.0), Reference(wanted, rate, 0.0), DT)
    close: Any = {"rel": 1e-10, "abs": 1e-10}
    assert command == pytest.approx(beta * phi - 10.0 * s, **close)
    assert (after.slope_inverse - beta) / DT == pytest.approx(-2.0 * phi * s - 2.0 * 0.005 * beta, rel=1e-8, abs=1e-6)
    assert (after.bound - bound) / DT == pytest.approx(
        2.0 * beta * switch * s - 2.0 * 0.005 * bound, rel=1e-8, abs=1e-6
    )
    assert after.filtered_error == pytest.approx(s, **close)


def pid(gains: Any, beta: float, bound: float) -> control.TransferFunction:
    """The PID that the law's documentation names, from measured joint to minus the command, written in z.

    κλ and κ act on e and its sum, β̂λ on its difference through a first-order low-pass with time constant τ; the frozen
    D̂m adds β̂·D̂m/ε to κ.
    """
    z = control.tf([1.0, 0.0], [1.0], DT)
    stiffness = gains.feedback_gain + beta * bound / gains.smoothing
    pole = gains.derivative_time / (gains.derivative_time + DT)
    derivative = (1.0 - pole) / DT * (z - 1.0) / (z - pole)
    return stiffness * (gains.error_gain + DT * z / (z - 1.0)) + beta * gains.error_gain * derivative


@pytest.mark.parametrize("preset", ["default", "paper"])
@pytest.mark.parametrize("bound", [0.0, 0.08])
def test_frozen_it_is_the_pid_that_is_claimed(preset: str, bound: float) -> None:
    """Adaptation off, β̂ = 1/αφ, s far below ε: against python-control on a random measurement."""
    beta = 1.0 / 0.938
    law = LAWS["adaptive"] if preset == "default" else LAWS["adaptive"].preset(preset)
    law = law.with_gains(slope_adaptation=0.0, bound_adaptation=0.0, smoothing=0.1)
    joint = np.cumsum(np.random.default_rng(0).normal(0.0, 1e-7, 2000))
    state, commands = AdaptiveState(0.0, beta, bound, 0.0, 0.0, 0.0), []
    for angle in joint.tolist():
        state, command = law.step(state, Sample(angle, 0.0), STILL, DT)
        commands.append(float(command))
    expected = -control.forced_response(pid(law.gains, beta, bound), np.arange(2000) * DT, joint).outputs
    np.testing.assert_allclose(commands, expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())
    assert (state.slope_inverse, state.bound) == (beta, bound)


@pytest.mark.parametrize("preset", ["default", "paper"])
@pytest.mark.parametrize("bound", [0.0, 0.08])
def test_the_margins_rest_on_the_same_pid(preset: str, bound: float) -> None:
    law = LAWS["adaptive"] if preset == "default" else LAWS["adaptive"].preset(preset)
    omega = np.geomspace(0.1, 3000.0, 60)
    modelled = response(adaptive_model(law.gains, DT, 1.07, bound), omega, DT)
    expected = pid(law.gains, 1.07, bound)(np.exp(1j * omega * DT))
    np.testing.assert_allclose(modelled, expected, rtol=1e-6)


@pytest.mark.parametrize("bad", [0, 1, 2, 3])
def test_a_reference_that_is_no_number_for_a_cycle_leaves_none_in_our_law(bad: int) -> None:
    law, broken = LAWS["bowden"], [0.2, 0.0, 0.0]
    broken = [math.nan] * 3 if bad == 3 else [math.nan if i == bad else x for i, x in enumerate(broken)]
    state = law.start(Sample(0.1, 0.1))
    for k in range(40):
        reference = Reference(*broken) if k == 30 else Reference(0.1 + 0.001 * k, 0.5, 0.0)
        state, command = law.step(state, Sample(0.1, 0.1), reference, DT)
        assert math.isfinite(command) or k == 30
    assert all(math.isfinite(x) for x in flat(state))
