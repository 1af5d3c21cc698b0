"""No equation knows in which unit time, angle, length or mass is counted: the same comes out, in the new unit."""

import itertools
import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bowden.control import LAWS
from bowden.control.admittance.interaction import Doubt
from bowden.control.admittance.push import Push, Rest, push_start, push_step
from bowden.control.admittance.virtual_elbow import Admittance
from bowden.control.conditioning import Conditioning, condition_start, condition_step
from bowden.control.knowledge import Knowledge, informed
from bowden.control.law import Law
from bowden.control.source import Measurement
from bowden.core.kernel import compiled
from bowden.core.nested import flat, numbers_of
from bowden.core.signals import Reference, Sample
from bowden.models.cable.backlash import Play
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.bouc_wen_static import StaticTerms
from bowden.models.cable.capstan import Tendon
from bowden.models.cable.generalised_play import Branches
from bowden.models.cable.lumped_cable import LumpedTendon
from bowden.models.drive.geared_motor import GearedMotor
from bowden.models.drive.servo import Servo
from bowden.models.suit.arm import Wearer
from bowden.models.suit.suit_cable import KINDS, SuitCable
from bowden.plants import bench_body, cables
from bowden.plants.bench import Bench
from bowden.plants.cable import BentCable, bouc_wen
from bowden.plants.friction_cables import lumped, sliding
from bowden.plants.knowledge_of import knowledge_of
from bowden.plants.plant import SheathState
from bowden.plants.pushing import chain_of, ports_of, push_of
from bowden.plants.suit_linear import linear_suit
from bowden.plants.suit_parts import Suit
from bowden.plants.suit_plant import worn_advance, worn_rest
from bowden.sensing.intent import IntentSettings, intent_start, intent_step, proportional
from bowden.sensing.joint_angle import JointModel, estimate_start, estimate_step
from support.units import Units

DT = 1e-3
TIME_OR_ANGLE = pytest.mark.parametrize("units", [Units(s=0.5), Units(rad=2.0)], ids=["time", "angle"])


def courses(law: Law, units: Units) -> tuple[NDArray[np.float64], list[float]]:
    """Commands along three noisy strokes with a play of 0.1 rad, and the law's last state, each as SI would have it."""
    time, random = np.arange(1500) * DT, np.random.default_rng(2)
    late, commands = 0.3 * np.sin(12.0 * time - 0.1), []
    law = replace(law, gains=units.counted(law.gains))
    state = law.start(units.counted(Sample(0.0, 0.05)))
    for k, (off, more) in enumerate(random.normal(0.0, 1e-3, (1500, 2)).tolist()):
        swing, rate = 0.3 * math.sin(12.0 * time[k]), 3.6 * math.cos(12.0 * time[k])
        sample = units.counted(Sample(float(late[k]) + off, float(late[k]) / 0.9 + math.copysign(0.05, rate) + more))
        reference = units.counted(Reference(swing, rate, -144.0 * swing))
        state, command = law.step(state, sample, reference, units.factor("s") * DT)
        commands.append(command / units.factor("rad"))
    return np.array(commands), flat(units.back.counted(state))


@TIME_OR_ANGLE
@pytest.mark.parametrize("name", LAWS)
def test_a_law_knows_no_unit(name: str, units: Units, monkeypatch: pytest.MonkeyPatch) -> None:
    expected = courses(LAWS[name], Units())
    units.count_constants(monkeypatch, "bowden.control")
    found = courses(LAWS[name], units)
    np.testing.assert_allclose(found[0], expected[0], rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(found[1], expected[1], rtol=1e-12)


def numbers(made: Any) -> list[float]:
    """All numbers of one NamedTuple or of several, without those of what is turned on or off."""
    return [x for one in (made if isinstance(made, list) else [made]) for x in numbers_of(one)]


KNOWN = Knowledge(
    *(40.0, 0.8, 3.5e-3, 1e-3, 0.9, 0.1, 0.5, BoucWen(slope=0.9, offset=0.1), 0.2),
    *(4e-4, 2e-4, 3e-4, 1e-4, False, 0.96, 2.0),
)


@TIME_OR_ANGLE
@pytest.mark.parametrize("quick", [True, False])
@pytest.mark.parametrize("name", [name for name in LAWS if name != "adaptive"])
def test_what_a_law_makes_of_a_rig_knows_no_unit(
    name: str, quick: bool, units: Units, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a quiet encoder and a short delay, and of others; `adaptive` scales the gains of the bench, in SI."""
    law, known = LAWS[name], KNOWN if quick else KNOWN._replace(delay=2e-2, joint_noise=3e-3, servo_frequency=90.0)
    expected = units.counted(informed(law, known).gains)
    units.count_constants(monkeypatch, "bowden.control")
    found = informed(replace(law, gains=units.counted(law.gains), default_gains=None), units.counted(known)).gains
    np.testing.assert_allclose(numbers(found), numbers(expected), rtol=1e-12)


@TIME_OR_ANGLE
def test_the_conditioner_knows_no_unit(units: Units, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a motion, of stairs and of a reference that jumps."""
    time = np.arange(2000) * DT
    given = 0.5 * np.sin(4.0 * time) + np.where(time > 1.0, np.floor(30.0 * time) / 30.0, 0.0) + (time > 0.5)

    def shown(units: Units) -> NDArray[np.float64]:
        settings, rows = units.counted(Conditioning()), []
        state = condition_start(settings, units.counted(Sample(0.0, 0.0)))
        for at, rate in zip(given.tolist(), (2.0 * np.cos(4.0 * time)).tolist(), strict=True):
            reference = units.counted(Reference(at, rate, -16.0 * (at % 1.0)))
            state, found = condition_step(settings, state, reference, units.factor("s") * DT)
            rows.append(units.back.counted(found))
        return np.array(rows)

    expected = shown(Units())
    units.count_constants(monkeypatch, "bowden.control")
    np.testing.assert_allclose(shown(units), expected, rtol=1e-9, atol=1e-9)


NODES = np.arange(12.0)
BENT = Branches(
    *(0.9, 0.01 * np.sin(NODES), 0.05 + 0.01 * np.cos(NODES), -0.3, 0.4),
    *(np.array([0.5, 1.5]), np.array([0.4, 0.6]), 0.1, 0.2),
)
TENDON = Tendon(elements=6, slack=1e-4, pretension=0.3)
CABLES = {
    "play": (Play(0.9, 0.05, 0.1), cables.play),
    "stack": (cables.Stack(0.4, np.array([0.01, 0.12]), np.array([0.2, 0.3]), 0.1), lambda one: cables.stack(*one)),
    "Bouc–Wen": (BoucWen(offset=0.1), bouc_wen),
    "static": (
        BentCable(BoucWen(), StaticTerms(np.array([0.01]), np.array([0.02]), 0.3, 0.8)),
        lambda one: bouc_wen(*one),
    ),
    "branches": (BENT, cables.generalised_play),
    "sliding": (TENDON, sliding),
    "lumped": (LumpedTendon(TENDON._replace(elements=4)), lumped),
    "Dahl": (LumpedTendon(TENDON._replace(elements=4), dahl=True, presliding=1e-4), lumped),
}
MECHANICAL = {"time": Units(s=0.5), "length": Units(m=2.0), "mass": Units(kg=4.0)}
COURSE = np.cumsum(np.random.default_rng(4).normal(0.0, 0.03, 200)).tolist()


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        *itertools.product(CABLES, MECHANICAL),
        *((name, "angle") for name, (one, _) in CABLES.items() if not isinstance(one, Tendon | LumpedTendon)),
    ],
)
def test_a_cable_knows_no_unit(name: str, unit: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A tendon's angles are lengths over radii: in radians."""
    parameters, make = CABLES[name]
    units = Units(rad=2.0) if unit == "angle" else MECHANICAL[unit]

    def moved(units: Units) -> NDArray[np.float64]:
        cable, motors = make(units.counted(parameters)), [units.factor("rad") * at for at in COURSE]
        memory, rows = cable.start(cable.prepared, motors[0], 1.2, 0.95), []
        for before, after in itertools.pairwise(motors):
            way, dt = (after - before) / 1.2, units.factor("s") * 0.01
            memory = cable.advance(cable.prepared, memory, before, after, way, 1.2, dt)
            seen = cable.look(cable.prepared, memory, after, 1.2, 0.95)
            rows.append((seen.joint / units.factor("rad"), seen.torque / units.factor("N·m"), seen.h))
        return np.array(rows)

    expected = moved(Units())
    units.count_constants(monkeypatch, "bowden.models", "bowden.plants")
    np.testing.assert_allclose(moved(units), expected, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("unit", ["time", "angle", "mass"])
@pytest.mark.parametrize("servo", [Servo(), Servo(speed_limit=2.0, acceleration_limit=200.0)], ids=["free", "limited"])
def test_the_bench_knows_no_unit(servo: Servo, unit: str, monkeypatch: pytest.MonkeyPatch) -> None:
    units = Units(rad=2.0) if unit == "angle" else MECHANICAL[unit]

    def moved(units: Units) -> NDArray[np.float64]:
        bench, rows = units.counted(Bench(servo=servo)).dynamics(), []
        for name, part in bench.parts.items():
            monkeypatch.setattr(bench_body, name, part)
        plant, sheath = bench.plant, SheathState(3.0, 1.0, 1.0)
        body = bench.rest(plant, 0.0, sheath)
        for k, at in enumerate(COURSE):
            after = SheathState(3.0, 1.0 + 0.2 * math.sin(k), 1.0 - 0.01 * math.sin(k))
            body = bench.advance(plant, body, units.factor("rad") * at, sheath, after)
            effort = 0.0 if unit == "angle" else bench.effort(plant, body, after)
            sheath = after
            seen = bench.look(plant, body)
            scales = ("rad", "rad", "rad/s", "rad/s²")
            rows.append([effort, seen.h, *(x / units.factor(of) for x, of in zip(seen[:4], scales, strict=True))])
        return np.array(rows)

    np.testing.assert_allclose(moved(units), moved(Units()), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("unit", MECHANICAL)
@pytest.mark.parametrize("kind", KINDS)
def test_the_suit_knows_no_unit(kind: str, unit: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """A wearer who trembles, holds and is held, against the stop of a joint, in a sheath that is bent."""
    units, wearer = MECHANICAL[unit], Wearer(0.3, 0.5, 5.0, 2.0, 0.7, 1.2, 1.5)
    suit = Suit(
        flexor=SuitCable(kind=kind), extensor=SuitCable(kind=kind), wearer=wearer, stops=(-0.1, 0.9), substeps=2
    )

    def moved(units: Units) -> NDArray[np.float64]:
        plant = units.counted(suit).dynamics().plant._replace(settling=2)
        sheath, body, rows = SheathState(3.0, 1.0, 1.0), worn_rest(plant, 0.5, SheathState(3.0, 1.0, 1.0)), []
        for k, at in enumerate(COURSE):
            body = worn_advance(plant, body, 0.9 + at, sheath, SheathState(3.0 + 0.1 * math.sin(k), 1.0, 1.0))
            now = units.back.counted(body.suit)
            rows.append(flat(now))
        return np.array(rows)

    expected = moved(Units())
    units.count_constants(monkeypatch, "bowden.models", "bowden.plants")
    np.testing.assert_allclose(moved(units), expected, rtol=1e-9, atol=1e-9)


def the_push(suit: Suit, units: Units) -> Push:
    """With what is no suit's counted too."""
    given, doubt = units.counted(Admittance()), units.counted(Doubt())
    made = push_of(suit, LAWS["observer"], given, doubt=doubt, carried=0.5)
    under = made.under._replace(speed=units.factor("rad/s") * made.under.speed)
    return made._replace(rest=units.counted(Rest()), under=under)


MADE_OF_A_SUIT = {
    "what laws know": lambda suit, units: knowledge_of(suit),
    "cables and motor": lambda suit, units: chain_of(suit),
    "the port": lambda suit, units: ports_of(suit),
    "the push": the_push,
}


@pytest.mark.parametrize("unit", MECHANICAL)
@pytest.mark.parametrize("name", MADE_OF_A_SUIT)
def test_what_is_made_of_a_suit_knows_no_unit(name: str, unit: str, monkeypatch: pytest.MonkeyPatch) -> None:
    units, make = MECHANICAL[unit], MADE_OF_A_SUIT[name]
    made = make(Suit(), Units())
    expected = [units.counted(one) for one in (made if isinstance(made, list) else [made])]
    units.count_constants(monkeypatch, "bowden.models", "bowden.plants", "bowden.control")
    np.testing.assert_allclose(numbers(make(units.counted(Suit()), units)), numbers(expected), rtol=1e-12)


@pytest.mark.parametrize("unit", MECHANICAL)
def test_the_poles_of_a_suit_are_those_of_its_cycle_whatever_the_unit(
    unit: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    units, suit = MECHANICAL[unit], Suit(delay=3, motor=GearedMotor(integral=5.0))
    expected = linear_suit(suit, 0.7)
    units.count_constants(monkeypatch, "bowden.models", "bowden.plants")
    found = linear_suit(units.counted(suit), 0.7)
    np.testing.assert_allclose(np.poly(found.a), np.poly(expected.a), atol=1e-9)
    assert found.slope == pytest.approx(expected.slope)


@TIME_OR_ANGLE
def test_the_estimate_of_the_joint_knows_no_unit(units: Units, monkeypatch: pytest.MonkeyPatch) -> None:
    """By a sensor of which two values are missing and one is far off."""
    model = JointModel(*(0.9, 0.1, 0.05, 0.05), *(0.01, 0.004, 0.03, 0.01, 0.001))

    def estimated(units: Units, step: Any = estimate_step) -> NDArray[np.float64]:
        counted, rad = units.counted(model), units.factor("rad")
        state, rows = estimate_start(counted, rad * COURSE[0]), []
        for k, motor in enumerate(COURSE):
            value = 0.9 * motor + (0.5 if k == 60 else 0.0) if k % 10 == 0 and not 100 < k < 125 else math.nan
            state = step(counted, state, rad * motor, rad * value, units.factor("s") * DT)
            rows.append((state.angle / rad, state.std / rad, state.age / units.factor("s")))
        return np.array(rows)

    expected = estimated(Units())
    np.testing.assert_allclose(estimated(Units(), compiled(estimate_step)), expected, rtol=1e-12)
    units.count_constants(monkeypatch, "bowden.sensing")
    np.testing.assert_allclose(estimated(units), expected, rtol=1e-9, atol=1e-12)


@TIME_OR_ANGLE
@pytest.mark.parametrize("muscles", [1, 2])
def test_an_intent_knows_no_unit(muscles: int, units: Units, monkeypatch: pytest.MonkeyPatch) -> None:
    contracts = np.repeat(np.random.default_rng(6).random((60, 2)) < 0.5, 50, axis=0).tolist()

    def shown(units: Units) -> NDArray[np.float64]:
        settings, dt = units.counted(IntentSettings(duration=0.4, muscles=muscles)), units.factor("s") * DT
        state, rows, by_size = intent_start(0.0), [], Reference(0.0, 0.0, 0.0)
        for flexes, extends in contracts:
            state, reference = intent_step(settings, state, flexes, extends, dt)
            by_size = proportional(settings, by_size, 0.7 * flexes, 1.0, dt)
            rows.append([*units.back.counted(reference), *units.back.counted(by_size)])
        return np.array(rows)

    expected = shown(Units())
    units.count_constants(monkeypatch, "bowden.sensing")
    np.testing.assert_allclose(shown(units), expected, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("unit", MECHANICAL)
@pytest.mark.parametrize("estimated", [0.0, 1.0], ids=["load cell", "estimated"])
def test_a_push_knows_no_unit(estimated: float, unit: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a wearer who pushes either way against a moving motor, and lets go."""
    units, measured = MECHANICAL[unit], Measurement(0.5, 0.5, 0.0, 0.0)

    def led(units: Units, step: Any = push_step) -> NDArray[np.float64]:
        settings, rows = the_push(units.counted(Suit()), units)._replace(estimated=estimated), []
        state = push_start(settings, units.counted(measured))
        for k in range(400):
            angle = 0.5 + 0.2 * math.sin(0.02 * k)
            now = Measurement(angle, angle + 0.01, 5.0 * math.sin(0.03 * k), 4.0 * math.sin(0.05 * k) * (k < 300))
            dt = units.factor("s") * DT
            state, reference, added = step(settings, state, units.counted(now), Reference(0.0, 0.0, 0.0), dt)
            rows.append([*units.back.counted(reference), added, state.push.torque / units.factor("N·m")])
        return np.array(rows)

    expected = led(Units())
    np.testing.assert_array_equal(led(Units(), compiled(push_step)), expected)
    units.count_constants(monkeypatch, "bowden.control", "bowden.models", "bowden.plants")
    np.testing.assert_allclose(led(units), expected, rtol=1e-9, atol=1e-12)
