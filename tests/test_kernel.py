"""One source: a kernel gives the same bits interpreted and compiled."""

import itertools
import math
import re
from typing import Any, NamedTuple

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.law import Law
from bowden.core.errors import ParameterError
from bowden.core.kernel import (
    compiled,
    cos,
    exp,
    floor,
    kernel,
    log,
    placeholder,
    power,
    sin,
    specialise,
    sqrt,
    tanh,
)
from bowden.core.nested import flat
from bowden.core.signals import Reference, Sample
from bowden.models import plausible
from bowden.models.cable import backlash, bouc_wen, friction, sheath
from bowden.models.drive import encoder, geared_motor, motor, servo, thermal
from bowden.models.suit import arm, flex_sensor, geometry, load_cell, suit_angle, suit_cable
from support.states import floated

EXTREMES = [0.0, -0.0, 5e-324, -5e-324, 1e-300, 1.0, -1.0, 1e16, 1e154, -1e308, math.inf, -math.inf, math.nan]


def bits(values: Any) -> list[int]:
    """The values' bit patterns, every NaN with the same one."""
    array = np.concatenate([np.ravel(np.array(part, dtype=np.float64)) for part in flat(values)])
    array[np.isnan(array)] = np.nan
    return array.view(np.int64).tolist()


def a_law_with_its_gains() -> list[Any]:
    return [
        pytest.param(law if preset is None else law.preset(preset), id=f"{name}-{preset or 'default'}")
        for name, law in LAWS.items()
        for preset in (None, *law.presets)
    ] + [pytest.param(LAWS["observer"].with_gains(from_reference=1.0), id="observer-from-reference")]


def ticks(count: int, seed: int) -> list[tuple[Sample, Reference]]:
    """A noisy motion, with a wild input now and then."""
    random = np.random.default_rng(seed)
    moves = []
    for k in range(count):
        phase = 3.0 * k * 1e-3
        values = [
            math.sin(phase - 0.1),
            1.07 * math.sin(phase),
            math.sin(phase),
            3 * math.cos(phase),
            -9 * math.sin(phase),
        ]
        values = [float(value + random.normal(0.0, 1e-3)) for value in values]
        if k % 10 == 9:
            values[random.integers(5)] = float(random.choice(EXTREMES))
        moves.append((Sample(*values[:2]), Reference(*values[2:])))
    return moves


@pytest.mark.parametrize("law", a_law_with_its_gains())
def test_interpreted_and_compiled_law_agree_bit_for_bit(law: Law) -> None:
    """Over runs with noise and extreme inputs; a state that has become NaN begins afresh."""
    fast_start, fast_step = compiled(law.start_kernel), compiled(law.step_kernel)
    state = law.start(Sample(0.1, 0.2))
    assert bits(state) == bits(fast_start(law.gains, Sample(0.1, 0.2)))
    survived = 0
    with np.errstate(all="ignore"):
        for sample, reference in ticks(2000, seed=1):
            after, command = law.step(state, sample, reference, 1e-3)
            fast_after, fast_command = fast_step(law.gains, state, sample, reference, 1e-3)
            assert bits((after, command)) == bits((fast_after, fast_command))
            finite = bool(np.isfinite(flat((after, command))).all())
            survived += finite
            state = floated(after) if finite else law.start(Sample(0.0, 0.0))
    assert survived > 1750  # all of them where a law refuses what is not finite


CABLE, SUIT = bouc_wen.BoucWen(exponent=1.7), geometry.SuitGeometry()
SERVO = servo.prepare(servo.Servo(speed_limit=2.0, acceleration_limit=50.0), 1e-4)
SPOOL = suit_angle.spool_map(SUIT, 0.025)
GEARED = geared_motor.GearedMotor(integral=3.0, friction_feedforward=1.5)
TURNING = geared_motor.SpoolState(0.1, 2.0, 3.0, 0.01, 0.2, 0.5, 0.3)
FLEX = flex_sensor.FlexSensor(0.1, 0.2, 0.01, 0.02, 60.0, 0.03, 1e-3)
PULLED = {
    kind: suit_cable.prepare_suit_cable(suit_cable.SuitCable(kind=kind), suit_cable.Fabric(stiffening=2e5), 3.0, 25.0)
    for kind in suit_cable.KINDS
}
WHERE = suit_cable.SuitCableMemory(0.001, 0.1), 0.002
SWINGING = arm.Wearer(0.2, 0.5, 5.0, 5.0, 1.0, 0.3, 0.1, 0.4, 0.5)
KERNELS_OF_TWO = [
    (arm.gravity_torque, lambda x, y: (arm.Arm(), x)),
    (arm.passive_torque, lambda x, y: (arm.Arm(), x, y)),
    (arm.wearer_torque, lambda x, y: (SWINGING, arm.Arm(), x, y, x)),
    (flex_sensor.flex_start, lambda x, y: (x,)),
    (flex_sensor.flex_step, lambda x, y: (FLEX, flex_sensor.FlexState(0.1, 0.2), x, y, y, 1e-3)),
    (friction.coulomb, lambda x, y: (x, y, 0.1)),
    (friction.coulomb_slope, lambda x, y: (x, y, 0.1)),
    (friction.dahl, lambda x, y: (x, y, 0.1)),
    (friction.dahl_slope, lambda x, y: (x, y, 0.1)),
    (geared_motor.turn_push, lambda x, y: (geared_motor.FrictionPush(x, 0.5), x + 0.01 * y, 1e-3)),
    (geared_motor.drive_motor, lambda x, y: (GEARED, TURNING._replace(position=x, velocity=y), 0.1, 1e-3)),
    (geared_motor.turn_spool, lambda x, y: (GEARED, TURNING._replace(velocity=x), y, 10.0, 1e-3)),
    (load_cell.cell_reading, lambda x, y: (load_cell.LoadCell(), x, y)),
    (suit_angle.flexor_arm, lambda x, y: (x, SPOOL)),
    (suit_angle.flexor_travel, lambda x, y: (x, SPOOL)),
    (suit_angle.motor_of, lambda x, y: (x, SPOOL)),
    (suit_angle.spool_of, lambda x, y: (x, SPOOL)),
    (suit_cable.fabric_tension, lambda x, y: (0.01 * x, PULLED["play"].fabric)),
    (suit_cable.give, lambda x, y: (30.0 * abs(x), PULLED["play"].fabric)),
    (suit_cable.start_suit_cable, lambda x, y: (PULLED["play"], 0.01 * x, 0.01 * y, 0.9)),
    (suit_cable.taken_up, lambda x, y: (0.01 * x, 1.3, PULLED["play"])),
    *(
        (suit_cable.pull_suit_cable, lambda x, y, kind=kind: (PULLED[kind], *WHERE, 0.01 * x, 0.01 * y, 1.2, 0.9))
        for kind in suit_cable.KINDS
    ),
    (backlash.push, lambda x, y: (x, y, 0.05)),
    (backlash.joint_angle, lambda x, y: (x, backlash.Play(offset=0.1))),
    (bouc_wen.saturation, lambda x, y: (CABLE,)),
    (bouc_wen.slope_of_h, lambda x, y: (0.3 * math.tanh(x), 1.0 if y > 0 else -1.0, CABLE)),
    (bouc_wen.travel_step, lambda x, y: (0.3 * math.tanh(x), 1e-3 * y, CABLE)),
    (bouc_wen.advance, lambda x, y: (0.3 * math.tanh(x), 0.2 * math.tanh(y), CABLE)),
    (bouc_wen.advance, lambda x, y: (0.3 * math.tanh(x), 0.2 * math.tanh(y), bouc_wen.BoucWen())),
    (bouc_wen.prepare_cable, lambda x, y: (CABLE,)),
    (bouc_wen.advance_prepared, lambda x, y: (0.3 * math.tanh(x), 0.2 * math.tanh(y), bouc_wen.prepare_cable(CABLE))),
    (bouc_wen.joint_angle, lambda x, y: (x, y, CABLE)),
    (encoder.reading, lambda x, y: (x, y, encoder.Encoder(1e-3, 1e-4))),
    (encoder.reading, lambda x, y: (x, y, encoder.Encoder())),
    (geometry.flexor_extension, lambda x, y: (x, SUIT)),
    (geometry.extensor_extension, lambda x, y: (x, SUIT)),
    (geometry.flexor_moment_arm, lambda x, y: (x, SUIT)),
    (geometry.extensor_moment_arm, lambda x, y: (x, SUIT)),
    (geometry.spool_angle, lambda x, y: (x, 0.01 + abs(y))),
    (motor.acceleration_limit, lambda x, y: (motor.Motor(),)),
    (motor.current, lambda x, y: (x, y, 0.9, motor.Motor())),
    (plausible.outside, lambda x, y: (x, y, y + 1.0)),
    (plausible.beyond, lambda x, y: (x, y)),
    (plausible.persistence_time, lambda x, y: (x > 0.0, y, 1e-3)),
    (plausible.follow, lambda x, y: (plausible.SensorState(x, y, 0.0), y, True, 1e-3, 2.0, 0.02, 15.0, 0.005)),
    (servo.servo_approach, lambda x, y: (x, 0.5 * y, SERVO)),
    (servo.servo_step, lambda x, y: (servo.ServoState(x, 0.5 * y, 0.0), y, SERVO)),
    (servo.servo_acceleration, lambda x, y: (x, 0.5 * y, SERVO)),
    (servo.servo_is_free, lambda x, y: (0.01 * x, 0.05 * y, SERVO)),
    (servo.servo_turn, lambda x, y: (-abs(x) - 1e-9, 0.5 * abs(y), SERVO)),
    (servo.servo_turn, lambda x, y: (abs(x) + 1e-9, -0.5 * abs(y), servo.prepare(servo.Servo(damping=0.6), 1e-3))),
    (servo.servo_turn, lambda x, y: (x or 1.0, -(x or 1.0), servo.prepare(servo.Servo(damping=1.6), 1e-3))),
    (servo.servo_predict, lambda x, y: (x, 0.5 * y, y, 53.6, 0.9, 1e-3)),
    (sheath.width, lambda x, y: (x, sheath.Sheath(gap=1.3))),
    (sheath.slope_factor, lambda x, y: (x, sheath.Sheath(loss=0.2))),
    (sheath.advance_in_sheath, lambda x, y: (0.3 * math.tanh(x), 0.2 * math.tanh(y), 1.4, CABLE)),
    (sheath.joint_in_sheath, lambda x, y: (x, y, 1.4, 0.9, CABLE)),
    (thermal.cold, lambda x, y: (thermal.Thermal(ambient=x),)),
    (thermal.warm, lambda x, y: (thermal.Thermal(), thermal.ThermalState(40.0 + x, 30.0 + y, abs(y)), 9.0 * x, 1e-3)),
]


@pytest.mark.parametrize(("function", "arguments"), KERNELS_OF_TWO)
def test_interpreted_and_compiled_models_agree_bit_for_bit(function: Any, arguments: Any) -> None:
    """On drawn numbers and on extreme ones, on which plain Python must not raise."""
    fast = compiled(function)
    random = np.random.default_rng(3)
    drawn = random.normal(0.0, 1.0, (300, 2)).tolist()
    with np.errstate(all="ignore"):
        for x, y in drawn + list(itertools.product(EXTREMES, EXTREMES)):
            assert bits(function(*arguments(x, y))) == bits(fast(*arguments(x, y))), (x, y)


def test_every_model_kernel_is_compared_above() -> None:
    """A kernel that is added must be added to the table as well."""
    modules = (
        *(arm, backlash, bouc_wen, encoder, flex_sensor, friction, geared_motor, geometry, load_cell, motor, plausible),
        *(servo, sheath, suit_angle, suit_cable, thermal),
    )
    named = {
        value
        for module in modules
        for name, value in vars(module).items()
        if hasattr(value, "__kernel__") and value.__module__ == module.__name__ and not name.startswith("_")
    }
    assert named == {function for function, _ in KERNELS_OF_TWO}


@kernel
def _of_one(x: float) -> tuple[float, ...]:
    return tanh(x), exp(x), sin(x), cos(x), log(x), sqrt(x), floor(x)


def test_functions_agree_on_every_kind_of_number() -> None:
    twin = compiled(_of_one)  # a function of libm compiles inside a kernel only
    for x in EXTREMES + np.random.default_rng(4).normal(0.0, 30.0, 500).tolist():
        assert bits(_of_one(x)) == bits(twin(x)), x


def test_power_is_that_of_c() -> None:
    """Where Python raises, C99 (7.12.7.4, F.10.4.4) returns an infinity or a NaN."""
    twin = compiled(_power)
    random = np.random.default_rng(5).normal(0.0, 3.0, (500, 2)).tolist()
    odd = [-3.0, -2.0, -1.0, 0.5, 2.0, 3.0, 7.0, 1e3 + 1]
    for x, y in [(x, y) for x in EXTREMES + odd for y in EXTREMES + odd] + random:
        assert bits(power(x, y)) == bits(twin(x, y)), (x, y)
    assert power(-0.0, -3.0) == -math.inf
    assert power(-8.0, 1.0 / 3.0) != power(-8.0, 1.0 / 3.0)


def test_a_plain_function_stays_plain_and_is_not_compiled() -> None:
    def plain(x: float) -> float:
        return x

    with pytest.raises(TypeError, match="is not a kernel"):
        compiled(plain)
    marked = kernel(plain)
    assert marked is plain
    assert marked(1.5) == compiled(marked)(1.5) == 1.5


def test_specialise_puts_other_kernels_in() -> None:
    twins = [specialise(_outer, name, _inner=inner) for name, inner in (("twice", _twice), ("thrice", _thrice))]
    assert [twin(Pair(1.0, 2.0)) for twin in twins] == [5.0, 7.0]
    assert _outer(Pair(1.0, 2.0)) == 3.0


def test_only_stand_ins_are_replaced() -> None:
    """A law's own helper keeps its place, whatever its name."""
    twin = specialise(_outer, "by_name", _inner=_calls_a_helper)
    assert twin(Pair(1.0, 2.0)) == 1.0 + 2.0 * 7.0
    with pytest.raises(ParameterError, match=r"_outer reaches no placeholder '_helper'; expected _inner"):
        specialise(_outer, "by_name", _inner=_calls_a_helper, _helper=_twice)


def test_a_misspelt_stand_in_gets_the_one_that_was_meant() -> None:
    with pytest.raises(ParameterError, match=r"no placeholder '_iner'; expected _inner \(did you mean this\?\)"):
        specialise(_outer, "misspelt", _iner=_twice)


def test_a_kernel_that_calls_itself_is_refused_with_its_line() -> None:
    for function, by in ((_itself, ""), (_there, ", by '_back'")):
        where = (
            f"{__file__}, line {function.__code__.co_firstlineno}: the kernel {function.__name__!r} calls itself{by}"
        )
        with pytest.raises(ParameterError, match=re.escape(where)):
            compiled(function)


@kernel
def _itself(x: float) -> float:
    return _itself(x - 1.0)


@kernel
def _there(x: float) -> float:
    return _back(x)


@kernel
def _back(x: float) -> float:
    return _there(x)


class Pair(NamedTuple):
    a: float
    b: float


@kernel
def _helper(x: float) -> float:
    return 7.0 * x


@kernel
def _calls_a_helper(x: float) -> float:
    return _helper(x)


@placeholder
def _inner(x: float) -> float:
    return x


@kernel
def _twice(x: float) -> float:
    return 2.0 * x


@kernel
def _thrice(x: float) -> float:
    return 3.0 * x


@kernel
def _outer(pair: Pair) -> float:
    return pair.a + _inner(pair.b)


@kernel
def _smaller(x: float, y: float) -> float:
    return min(x, y)


@kernel
def _larger(x: float, y: float) -> float:
    return max(x, y)


@pytest.mark.parametrize(("function", "decides"), [(_smaller, lambda x, y: y < x), (_larger, lambda x, y: y > x)])
def test_min_and_max_keep_their_first_argument_unless_the_second_is_beyond_it(function: Any, decides: Any) -> None:
    twin = compiled(function)
    for x, y in [(x, y) for x in EXTREMES for y in EXTREMES]:
        assert bits(function(x, y)) == bits(twin(x, y)) == bits(y if decides(x, y) else x), (x, y)


@kernel
def _power(x: float, y: float) -> float:
    return power(x, y)
