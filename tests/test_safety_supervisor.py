"""The supervisor cycle by cycle: modes, reactions, and each detector alone."""

import ast
import itertools
import math
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from bowden.core.nested import flat, names
from bowden.core.signals import DriveReading
from bowden.hardware.ports import Power
from bowden.models.drive.thermal import ThermalState, cold, rested, warm
from bowden.safety import faults
from bowden.safety.faults import AT_ONCE, EVENTUALLY, LATCHING, Fault, Reaction, bits_of, of, worst_reaction
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Observed, PreflightResult, Request, SupervisorState, Verdict
from bowden.safety.supervisor import begin, supervise

DT = 1e-3
LIMITS = Limits(measures_tension=True, measures_torque=True, measures_temperature=True, uses_emg=True)
READING = DriveReading(0.5, 0.45, 2.0, 20.0, 40.0, 0.0, 0.0, 0.01, 4.0, 0.0, 0.0, 0.0, 0.0, 3.0)
OBSERVED = Observed(READING, 0.0, DT, Request.NONE, 0.1, True, PreflightResult.PASSED, 0.02)
COLD = cold(LIMITS.thermal)
LOOSE = LIMITS._replace(tracking=9.0)
"""For a motor that does not move while the cable is let out."""
NAN = math.nan


def seen(*, request: float = 0.0, observed: Observed = OBSERVED, **changes: float) -> Observed:
    """What is observed in a rig in order, with changes by the names of its fields."""
    if math.isfinite(changes.get("motor", NAN)):  # the cable pulls more, the further the motor is
        changes = {"tension": observed.reading.tension + changes["motor"] - observed.reading.motor, **changes}
    reading = observed.reading._replace(**{k: float(v) for k, v in changes.items() if k in DriveReading._fields})
    rest = {k: type(getattr(observed, k))(v) for k, v in changes.items() if k not in DriveReading._fields}
    return observed._replace(reading=reading, request=Request(int(request)), **rest)


@cache
def running(limits: Limits = LIMITS, thermal: ThermalState = COLD, motor: float = 0.5) -> SupervisorState:
    """A supervisor that lets the law lead, for some cycles already."""
    state = begin(limits, READING._replace(motor=motor, joint=0.9 * motor), thermal)
    for request in (Request.ARM, Request.NONE, Request.RUN, *([Request.NONE] * 9)):
        state, verdict = supervise(limits, state, seen(request=request, motor=motor, joint=0.9 * motor), motor, DT)
    assert verdict == Verdict(motor, Power.ON, Mode.RUNNING, Reaction.NONE, 0)
    return state


Cycle = tuple[Observed, float]


def follow(
    cycles: Iterator[Cycle] | list[Cycle], limits: Limits = LIMITS, state: SupervisorState | None = None
) -> list[Verdict]:
    state = running(limits) if state is None else state
    verdicts = []
    for observed, requested_target in cycles:
        state, verdict = supervise(limits, state, observed, requested_target, DT)
        verdicts.append(verdict)
    return verdicts


def lasting(cycles: int, requested_target: float = 0.5, **changes: float) -> list[Cycle]:
    return [(seen(**changes), requested_target)] * cycles


def test_it_begins_where_the_motor_is_as_warm_as_it_was_left_and_knows_nothing_else() -> None:
    state = begin(LIMITS, READING, ThermalState(50.0, 40.0, 3.0))
    places = (
        "target",
        "decided.previous_target",
        "servo.position",
        "motor.value",
        "stuck_joint.motor",
        "stuck_load.motor",
    )
    known = dict.fromkeys(places, 0.5)
    known |= {
        "joint.value": 0.45,
        "stuck_joint.reading": 0.45,
        "stuck_joint.previous_reading": 0.45,
        "decided.joint_at_release": 0.45,
        "decided.motor_at_release": 0.5,
    }
    known |= {"heat.winding": 50.0, "heat.housing": 40.0, "heat.i2t": 3.0}
    assert dict(zip(names(state), flat(state), strict=True)) == dict.fromkeys(names(state), 0.0) | known


def test_r1_holds_the_last_target_and_gives_the_motor_back() -> None:
    verdicts = follow(lasting(4, requested_target=NAN) + lasting(10, requested_target=0.501))
    assert [v.mode for v in verdicts[:4]] == [Mode.BRIDGING] * 4
    assert {v.target for v in verdicts[:4]} == {0.5}
    assert {v.reaction for v in verdicts[:4]} == {1.0}
    assert [v.mode for v in verdicts[4:]] == [Mode.RUNNING] * 10
    assert verdicts[-1].faults == 0.0


def test_r1_lasts_5_ms_at_most_and_counts_what_came_before() -> None:
    modes = [v.mode for v in follow(lasting(8, requested_target=NAN))]
    assert modes == [Mode.BRIDGING] * 5 + [Mode.RELEASING] * 3
    every_third = (lasting(1, requested_target=NAN) + lasting(2)) * 10
    assert Mode.RELEASING in [v.mode for v in follow(every_third)]
    seldom = (lasting(1, requested_target=NAN) + lasting(100)) * 10
    assert Mode.RELEASING not in [v.mode for v in follow(seldom)]


@pytest.mark.parametrize("case", list(itertools.product((-1.0, 1.0), ("operator", "force"))))
def test_r2_lets_the_joint_down_at_its_speed_until_the_cable_is_taut_and_is_off_and_latched(
    case: tuple[float, str],
) -> None:
    """The motor follows its target, on a rig whose cable is just taut 0.4 rad from where the motor begins."""
    sign, cause = case
    limits = LOOSE._replace(slack_sign=sign, lowering=0.7, taut=0.5 + 0.4 * sign, target_reach=2.0)
    speed = (limits.force_release if cause == "force" else limits.lowering) / limits.slope_high
    state, motor, verdicts = running(limits), 0.5, []
    for k in range(900):
        rows = {"current": limits.current_peak} if cause == "force" and k < 60 else {"operator_age": 9.0}
        joint = READING.joint + limits.slope_low * (motor - 0.5)
        state, verdict = supervise(limits, state, seen(motor=motor, joint=joint, **rows), 0.5, DT)
        motor = verdict.target
        verdicts.append(verdict)
    paying = [v for v in verdicts if v.mode == Mode.RELEASING]
    for a, b in itertools.pairwise(paying):
        assert a.power == Power.ON
        assert 0.0 <= sign * (b.target - a.target) <= speed * DT + 1e-9
    assert 0.35 / speed < len(paying) * DT < 0.4 / speed + limits.release_time
    assert abs(paying[-1].target - limits.taut) < 0.1
    assert {v.reaction for v in paying} == {2.0}
    assert (verdicts[-1].mode, verdicts[-1].power, verdicts[-1].reaction) == (Mode.LATCHED, Power.OFF, 3.0)


def test_an_operators_stop_releases_and_does_not_latch() -> None:
    rows = [*lasting(1, request=Request.STOP), *lasting(199), *lasting(100, drive_state=1.0, current=0.0)]
    verdicts = follow(rows, LOOSE._replace(taut=0.5))
    assert verdicts[0].mode == Mode.RELEASING
    assert (verdicts[-1].mode, verdicts[-1].power, verdicts[-1].faults) == (Mode.STOPPED, Power.OFF, 0.0)


@pytest.mark.parametrize("keeps", [(4.0, 2.0), (4.0, 0.0), (5.0, 0.0), (6.0, 0.0), (1.0, 1.3), (1.0, -2.0)])
def test_a_drive_that_keeps_its_torque_is_found_in_every_mode_without_power(keeps: tuple[float, float]) -> None:
    drive_state, current = keeps
    stopped = begin(LIMITS, READING, COLD)
    on = lasting(60, drive_state=drive_state, current=current)
    off = lasting(1, drive_state=1.0, current=0.0, request=Request.ACKNOWLEDGE)
    verdicts = follow(on, LIMITS, stopped)
    assert [v.mode for v in verdicts].index(Mode.LATCHED) in (49, 50, 51)
    assert [Fault.NOT_DISABLED in of(v.faults) for v in verdicts].index(True) in (49, 50, 51)
    again = follow(
        [*on, *lasting(1, request=Request.ACKNOWLEDGE, drive_state=drive_state, current=current)], LIMITS, stopped
    )
    assert again[-1].mode == Mode.LATCHED, "no word leads out of it while it lasts"
    assert follow([*on, *off], LIMITS, stopped)[-1].mode == Mode.STOPPED
    gone = follow([*on, *lasting(9, drive_state=1.0, current=0.0)], LIMITS, stopped)[-1]
    assert (gone.mode, of(gone.faults)[-1]) == (Mode.LATCHED, Fault.NOT_DISABLED), "it is held until acknowledged"
    latched = follow([*lasting(1, emergency=1.0), *on])
    assert [Fault.NOT_DISABLED in of(v.faults) for v in latched].index(True) in (50, 51, 52)
    decaying = [(seen(drive_state=1.0, current=5.0 * 0.93**i), 0.5) for i in range(99)]
    for innocent in (decaying, lasting(60, drive_state=1.0, current=0.3)):
        assert {v.faults for v in follow(innocent, LIMITS, stopped)} == {0.0}


def test_a_late_cycle_is_judged_by_when_its_sample_was_taken() -> None:
    """Cycle 100 is 6 ms late: it reads what was sampled in time, and the next one what was sampled 7 ms later."""
    speed = 0.9 * LIMITS.joint_speed
    times = [k * DT + (6e-3 if k == 100 else 0.0) for k in range(101)] + [(k + 6) * DT for k in range(101, 150)]
    rows = []
    for k in range(1, 150):
        way = 0.5 + speed * max(0.0, times[k - 1] - 0.03)
        ages = {"sample_age": times[k] - times[k - 1], "elapsed": times[k] - times[k - 1]}
        rows.append((seen(motor=way, joint=0.9 * way, **ages), 0.5))
    loose = LIMITS._replace(tracking=9.0, target_reach=9.0, motor_high=9.0, joint_high=9.0, sensor_span=9.0)
    judged = follow(rows, loose, running(loose))
    assert {v.faults for v in judged} == {0.0}
    unknown = [
        (o._replace(reading=o.reading._replace(sample_age=0.0)), requested_target) for o, requested_target in rows
    ]
    assert {fault for v in follow(unknown, loose, running(loose)) for fault in of(v.faults)} == {
        Fault.JOINT_JUMP,
        Fault.MOTOR_JUMP,
    }, "what it is without the sample's age"


def strokes(degrees: float, cycles: int = 3000) -> list[Cycle]:
    """The motor swings to and fro by so much in all, the joint's encoder stands still."""
    rows, half = [], 0.5 * math.radians(degrees)
    for k in range(cycles):
        way = 0.5 + half * math.sin(10.0 * k * DT)
        rows.append((seen(motor=way, joint=0.45, current=2.0 + way), way))
    return rows


def test_an_encoder_that_is_frozen_is_found_in_strokes_longer_than_the_dead_zone() -> None:
    limits = LIMITS._replace(frozen_travel=0.2326, tracking=9.0)
    for degrees, found in ((12.0, True), (10.0, False)):
        verdicts = follow(strokes(degrees), limits, running(limits))
        assert any(Fault.JOINT_FROZEN in of(v.faults) for v in verdicts) is found


def test_the_table_of_faults_holds_together() -> None:
    assert len(Fault) <= 52, "a row of a log keeps them as a float"
    assert [int(fault) for fault in Fault] == list(range(len(Fault)))
    for fault in Fault:
        bit = bits_of([fault])
        assert worst_reaction(bit, AT_ONCE) == fault.at_once
        assert worst_reaction(bit, EVENTUALLY) == fault.then
        assert bool(bit & LATCHING) == fault.latched
    assert [fault for fault in Fault if not fault.latched] == [Fault.RECORDER_LOST]
    assert of(bits_of([Fault.SLACK, Fault.EMERGENCY])) == [Fault.EMERGENCY, Fault.SLACK]
    assert all(f.meaning and f.detector and f.remedy and f.at_once <= f.then for f in Fault)
    assert all(0.002 <= f.within <= 0.02 for f in Fault if f.at_once == Reaction.R3)


def test_the_layer_is_without_input_or_output() -> None:
    folder = Path(faults.__file__).parent
    for path in folder.glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.ImportFrom):
                module = node.module or ""
                assert module.split(".")[:2] in (
                    ["enum"],
                    ["typing"],
                    ["collections", "abc"],
                    *(["bowden", x] for x in ("core", "models", "safety")),
                )


def test_a_motor_warms_cools_and_remembers() -> None:
    thermal = LIMITS.thermal
    state = COLD
    for _ in range(20_000):
        state = warm(thermal, state, 6.0, 1.0)
    heat = thermal.resistance * (1.0 + 0.0039 * (state.winding - 20.0)) * 36.0
    assert state.housing - thermal.ambient == pytest.approx(heat * thermal.housing_to_ambient, rel=1e-3)
    assert state.winding - state.housing == pytest.approx(heat * thermal.winding_to_housing, rel=1e-3)
    after = rested(thermal, ThermalState(100.0, 50.0, 30.0), 60.0)
    assert 25.0 < after.housing < after.winding < 60.0
    assert after.i2t == 0.0
    for seconds in (-5.0, NAN):
        assert rested(thermal, state, seconds) == state
    assert rested(thermal, state, 1e9).winding == pytest.approx(thermal.ambient, abs=0.1)
