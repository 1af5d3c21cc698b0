"""The bench round any cable: each is what its model says."""

import copy
import itertools
import json
import math
import re
from typing import Any

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled
from bowden.core.units import DEGREES, RADIANS
from bowden.models.cable import capstan
from bowden.models.cable.backlash import Play
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.bouc_wen_static import StaticTerms, joint_angle
from bowden.models.cable.capstan import Tendon
from bowden.models.cable.lumped_cable import LumpedTendon
from bowden.models.cable.sheath import Sheath, joint_in_sheath
from bowden.models.cable.sheath_path import constant_bend, scripted_bend
from bowden.models.cable.sliding_cable import advance_tendon, prepare_tendon, start_tendon, tendon_joint
from bowden.models.drive.motor import Motor
from bowden.models.drive.servo import Servo
from bowden.plants import bench_body, cables, friction_cables, predicted
from bowden.plants.bench import Bench
from bowden.plants.bench_body import lagged
from bowden.plants.cable import Cable, bouc_wen
from bowden.plants.cable_parameters import MOST_PARAMETERS, check_parameters
from bowden.plants.counting import Counting
from bowden.plants.identified import CableModel
from bowden.plants.plant import SheathState
from bowden.plants.recounted import recounted
from bowden.sim.run import simulate
from support.cable_models import MODELS
from support.sensors import PAPER_ENCODER

BENCH = Bench()
CURVES = [name for name in MODELS if name != "line"]
"""Models that a plant is made of; of a line it is made of the plain Bouc–Wen one."""
STROKE = PeriodicMinimumJerk(0.0, 70.0 * RADIANS, 10.0)
TERMS = StaticTerms(np.array([0.03, -0.01, 0.004]), np.array([0.02]), 0.6, 0.7)
CABLES = {
    "play": cables.play(),
    "stack": cables.stack(0.3, [0.02, 0.05, 0.1], [0.3, 0.2, 0.15]),
    "bouc_wen": bouc_wen(),
    "bouc_wen_static": bouc_wen(BoucWen(), TERMS),
    "sliding": friction_cables.sliding(),
    "slack": friction_cables.sliding(Tendon(pretension=0.0, slack=5e-4)),
}
TIMED = {
    "lumped_coulomb": friction_cables.lumped(),
    "lumped_dahl": friction_cables.lumped(LumpedTendon(dahl=True, presliding=1e-4)),
}
LONG = ("sliding", "lumped_dahl")
"""Of a kind that another one of the list shows in less time."""
shown_by_less = pytest.mark.parametrize(
    "cable", [pytest.param(c, id=n, marks=[pytest.mark.long] * (n in LONG)) for n, c in (CABLES | TIMED).items()]
)
every_cable = pytest.mark.parametrize("cable", list((CABLES | TIMED).values()), ids=list(CABLES | TIMED))


def noisy(plant: Any) -> Any:
    return plant._replace(joint_encoder=PAPER_ENCODER, motor_encoder=PAPER_ENCODER)


@pytest.mark.parametrize(("frequency", "law"), [(300.0, "adaptive"), (2500.0, "uncompensated")])
def test_a_quick_servo_goes_to_the_same_end_at_once_and_in_substeps(frequency: float, law: str) -> None:
    """A sheath that moves, however little, is gone through in sub-steps."""
    bench = Bench(servo=Servo(frequency), substeps=7)
    bends = constant_bend(bench.sheath.bend), scripted_bend([0.0, 6.0], [bench.sheath.bend, bench.sheath.bend + 1e-11])
    still, moving = (simulate(bench, LAWS[law], STROKE, duration=6.0, bend=bend).columns for bend in bends)
    for column in ("joint", "motor", "motor_velocity", "h"):
        np.testing.assert_allclose(still[column], moving[column], rtol=0, atol=1e-9, err_msg=column)
    np.testing.assert_allclose(still["motor_acceleration"], moving["motor_acceleration"], rtol=0, atol=1e-6)


@shown_by_less
def test_every_cable_runs_under_a_law_and_tells_what_made_it(cable: Cable) -> None:
    plant = noisy(Bench(cable, sheath=Sheath(bend=2.0)))
    run = lambda seed, duration: simulate(  # noqa: E731  # one call, three runs
        plant, LAWS["adaptive"], STROKE, duration=duration, bend=scripted_bend([1.0, 4.0], [2.0, 3.0]), seed=seed
    )
    trace, again, other = run(1, 6.0), run(1, 1.0), run(2, 1.0)
    assert trace.stable
    assert trace["joint"][:1000].tolist() == again["joint"].tolist()
    assert again["joint"].tolist() != other["joint"].tolist()
    assert np.isfinite(trace["current"]).all()
    assert np.sqrt(np.mean(trace.error[3000:] ** 2)) < 0.03
    settings = json.loads(json.dumps(dict(trace.settings)))
    assert settings["plant"]["cable"]["kind"] == cable.name
    assert len(settings["plant"]["cable"]) > 1
    assert settings["plant"]["sheath"]["bend"] == 2.0


@pytest.mark.parametrize("servo", [Servo(54.4, 0.8), Servo(54.4, 0.8, 1.0, 200.0)], ids=["free", "limited"])
@pytest.mark.parametrize("cable", CABLES)
def test_a_cycle_is_its_parts(cable: str, servo: Servo, monkeypatch: pytest.MonkeyPatch) -> None:
    """Any part of a cycle is a cycle, whether the motor turns in it, meets its limits, or the sheath moves under it."""
    plant = Bench(CABLES[cable], servo=servo, substeps=20)
    whole = plant.dynamics()
    fine = plant._replace(sample_time=plant.sample_time / 20).dynamics().plant
    for name, part in whole.parts.items():
        monkeypatch.setattr(bench_body, name, part)
    random, exact = np.random.default_rng(1), 1e-9 if servo.speed_limit == math.inf else 1e-6
    moving = exact if "bouc_wen" in cable else 2e-5
    sheath, body = SheathState(1.0, 1.0, 1.0), whole.rest(whole.plant, 0.1, SheathState(1.0, 1.0, 1.0))
    turned = 0
    for k in range(100):
        grown = 1.0 if k < 50 else 1.0 + 0.02 * random.standard_normal()  # it stands still at first
        moved = SheathState(1.0, min(1.5, max(0.7, sheath.width * grown)), 0.5 + 0.5 / grown)
        applied, parts = float(body.motor.position + random.normal(0.0, 0.02)), copy.deepcopy(body)
        edges = [SheathState(*(a + (b - a) * i / 20 for a, b in zip(sheath, moved, strict=True))) for i in range(21)]
        after = whole.advance(whole.plant, body, applied, sheath, moved)
        for one, other in itertools.pairwise(edges):
            parts = whole.advance(fine, parts, applied, one, other)
        turned += body.motor.velocity * after.motor.velocity < 0.0
        assert after.motor[:2] == pytest.approx(parts.motor[:2], abs=1e-12)
        assert after.joint == pytest.approx(parts.joint, abs=1e-12 if k < 50 else moving)
        body, sheath = after, moved
    assert turned > 10


@pytest.mark.parametrize("plant", [Bench(), Bench(cables.play())], ids=["bench", "cable"])
def test_no_command_moves_a_motor_faster_or_harder_than_it_may(plant: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    run, sheath = plant._replace(servo=Servo(54.4, 0.8, 1.0, 200.0)).dynamics(), SheathState(1.0, 1.0, 1.0)
    for name, part in run.parts.items():
        monkeypatch.setattr(bench_body, name, part)
    for offset, speed in np.random.default_rng(5).uniform(-1.0, 1.0, (200, 2)).tolist():
        body = run.rest(run.plant, 0.1, sheath)
        body = body._replace(motor=body.motor._replace(velocity=speed))
        motor = run.advance(run.plant, body, 0.1 + offset, sheath, sheath).motor
        assert abs(motor.velocity) <= 1.0 + 1e-9
        assert abs(motor.velocity - speed) <= 200.0 * plant.sample_time + 1e-9


@pytest.mark.parametrize("plant", [Bench(cable=BoucWen(slope=0.8)), Bench(cables.play(Play(0.8)))])
def test_the_current_is_what_spool_and_spring_need_through_the_slope_that_is_left(
    plant: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    """And within its limit: the servo's own, or the lower one of the current."""
    motor = Motor(gear=4.0, current_limit=3.0)
    plant = plant._replace(motor=motor, servo=Servo(54.4, 1.0, math.inf, 1e5))
    run, sheath = plant.dynamics(), SheathState(1.0, 1.0, 0.9)
    for name, part in run.parts.items():
        monkeypatch.setattr(bench_body, name, part)
    body = run.rest(run.plant, 0.5, sheath)
    body = body._replace(motor=body.motor._replace(acceleration=200.0))
    torque = motor.inertia * 200.0 + 0.9 * 0.8 * (motor.pretension + motor.spring * body.joint)
    assert run.effort(run.plant, body, sheath) == pytest.approx(torque / (4.0 * motor.torque_constant))
    for limit in (1e5, 1500.0):
        steps = plant._replace(servo=Servo(54.4, 1.0, math.inf, limit)).dynamics().plant.servo
        most = 3.0 * 4.0 * motor.torque_constant / motor.inertia
        assert steps.substep.acceleration_limit == pytest.approx(min(limit, most))


@pytest.mark.parametrize("servo", [Servo(54.4, 0.6), Servo(54.4, 0.6, 4.0, 300.0)], ids=["free", "limited"])
@pytest.mark.parametrize(
    "plant",
    [Bench(CABLES[name]) for name in ("play", "stack", "bouc_wen")],
    ids=lambda plant: plant.dynamics().name,
)
def test_a_cable_that_pulls_both_ways_alike_knows_no_side(plant: Any, servo: Servo) -> None:
    """Mirrored commands move the joint to the mirrored angles, through turns and at the servo's limits."""
    there, back = (
        simulate(
            plant._replace(servo=servo, substeps=7),
            LAWS["uncompensated"],
            PeriodicMinimumJerk(0.0, way * 0.8, 0.4),
            duration=2.0,
        )
        for way in (1.0, -1.0)
    )
    for column in ("joint", "motor"):
        np.testing.assert_allclose(back[column], -there[column], rtol=0.0, atol=1e-12)
    assert np.ptp(there["joint"]) > 0.1


def test_a_wider_sheath_widens_the_play() -> None:
    sheath = Sheath(bend=1.0)
    narrow, wide = (
        simulate(Bench(cables.play(), sheath=sheath), LAWS["uncompensated"], STROKE, duration=20.0, bend=bend)
        for bend in (None, scripted_bend([0.0, 1.0], [2.0, 2.0]))
    )
    late = narrow.time > 5.0
    lost = Play().slope * 2.0 * Play().half_width
    assert np.ptp(narrow["joint"][late]) - np.ptp(wide["joint"][late]) == pytest.approx(lost, rel=1e-6)


def test_static_terms_are_chebyshev_polynomials_that_go_on_along_their_tangents() -> None:
    """Against NumPy's own Chebyshev series and its derivative."""
    cable, h, width, factor = BoucWen(offset=0.02), 0.3, 1.4, 0.9
    series = np.polynomial.Chebyshev([0.0, 0.0, *TERMS.static])
    heights = np.polynomial.Chebyshev([cable.hysteresis_gain, *TERMS.heights])
    for motor in np.linspace(-1.0, 2.2, 81).tolist():
        u = (motor - TERMS.centre) / TERMS.half_range
        inside = min(1.0, max(-1.0, u))
        static = series(inside) + series.deriv()(inside) * (u - inside)
        expected = factor * (cable.slope * motor + static) + width * heights(inside) * h + cable.offset
        given = joint_angle(motor, h, width, factor, cable, TERMS)
        assert given == pytest.approx(expected, abs=1e-12)
        assert given == compiled(joint_angle)(motor, h, width, factor, cable, TERMS)
        none = StaticTerms(np.zeros(0), np.zeros(0), 0.0, 1.0)
        plain = joint_in_sheath(motor, h, width, factor, cable)
        assert joint_angle(motor, h, width, factor, cable, none) == pytest.approx(plain, abs=1e-15)


@pytest.mark.parametrize("name", CURVES)
def test_an_identified_cable_that_runs_backwards_is_turned_round(name: str) -> None:
    """Turned or written forwards, one joint; and it is reachable from the start."""
    backwards, ahead = (
        cables.identified(name, MODELS[name]),
        cables.identified(name, recounted(name, MODELS[name], Counting(-1))),
    )
    assert backwards.slope == pytest.approx(ahead.slope)
    assert ahead.slope > 0.7
    start = Bench(backwards).resting_motor(0.1)
    one, other = (
        simulate(Bench(cable), LAWS["adaptive"], STROKE, duration=5.0, initial_motor=start)
        for cable in (backwards, ahead)
    )
    assert one["joint"][0] == pytest.approx(0.1, abs=1e-9)
    assert one["joint"].tolist() == other["joint"].tolist()


@pytest.mark.parametrize("name", CURVES)
def test_a_model_that_lacks_a_parameter_is_refused(name: str) -> None:
    lost = "knot_step" if name == "scheduled" else "offset"
    with pytest.raises(ParameterError, match=f"'{lost}' is missing"):
        cables.identified(name, {key: value for key, value in MODELS[name].items() if key != lost})
    with pytest.raises(ParameterError, match="'line' is missing"):
        cables.identified("line", MODELS[name])


@pytest.mark.parametrize("name", [*MODELS, "sliding", "lumped_coulomb"])
def test_no_model_looks_ahead(name: str) -> None:
    """Where the joint is now hangs on where the motor has been, and not on where it will go."""
    parameters = MODELS.get(name, {"friction": 0.1, "elements": 6.0})
    motor = 0.5 + 0.4 * np.sin(np.linspace(0.0, 9.0, 60))
    joint = CableModel(name, parameters).joint_angle(motor)
    for count in (1, 2, 31):
        other = np.concatenate((motor[:count], motor[count:] + 0.3))
        assert CableModel(name, parameters).joint_angle(other)[:count] == pytest.approx(joint[:count], abs=1e-12)
    assert np.ptp(joint) > 0.3


def test_a_tendon_is_predicted_as_its_equations_move_it() -> None:
    motor, tendon = 0.5 + 0.4 * np.sin(np.linspace(0.0, 9.0, 60)), prepare_tendon(Tendon(elements=6))
    memory = start_tendon(tendon, float(motor[0]), 1.0)
    moved = [tendon_joint(tendon, advance_tendon(tendon, memory, angle, 1.0)) for angle in motor.tolist()]
    assert CableModel("sliding", {"elements": 6.0}).joint_angle(motor) == pytest.approx(moved, abs=1e-12)


def test_a_lagging_load_follows_the_cable_as_a_first_order_system() -> None:
    """Against a run without the lag, filtered; open loop, so that both have one motor."""
    prompt, late = (
        simulate(Bench(cables.play(), load_lag=lag), LAWS["uncompensated"], STROKE, duration=8.0) for lag in (0.0, 0.03)
    )
    assert late["motor"].tolist() == prompt["motor"].tolist()
    time, inner = prompt.time, prompt["joint"]
    from scipy.signal import lsim

    expected = lsim(([1.0], [0.03, 1.0]), inner, time)[1]
    np.testing.assert_allclose(late["joint"], expected, atol=1e-9)
    assert np.abs(late["joint"] - inner).max() * DEGREES > 0.5


def test_lag_in_one_step_or_two_is_the_same() -> None:
    half = lagged(0.3, 1.0, 1.5, 0.01, 0.02)
    assert lagged(half, 1.5, 2.0, 0.01, 0.02) == pytest.approx(lagged(0.3, 1.0, 2.0, 0.02, 0.02), abs=1e-14)
    assert lagged(0.3, 1.0, 1.5, 0.01, 0.0) == 1.5
    assert compiled(lagged)(0.3, 1.0, 1.5, 0.01, 0.02) == half


def test_the_sliding_cable_loses_its_dead_zone_in_the_loop() -> None:
    """Motor travel between the turn and the joint's first motion, and the current of the tendon's pull."""
    tendon = Tendon(elements=40)
    plant = Bench(friction_cables.sliding(tendon))
    trace = simulate(plant, LAWS["uncompensated"], STROKE, duration=10.0)
    top = int(np.argmax(trace["motor"]))
    resting = trace["joint"][top]
    moves = top + int(np.argmax(trace["joint"][top:] < resting - 1e-6))
    lost = trace["motor"][top] - trace["motor"][moves]
    assert lost == pytest.approx(capstan.dead_zone(tendon, resting), rel=0.01)
    up = int(np.argmin(np.abs(trace.time - 2.5)))
    pull = (0.1 + 0.2 * trace["joint"][up]) * math.exp(0.15 * math.pi)
    torque = trace["current"] * plant.motor.gear * plant.motor.torque_constant
    assert torque[up] - plant.motor.inertia * trace["motor_acceleration"][up] == pytest.approx(pull, rel=1e-9)


@shown_by_less
def test_a_run_that_ran_away_says_so(cable: Cable) -> None:
    trace = simulate(Bench(cable), LAWS["adaptive"].preset("paper"), STROKE, duration=30.0)
    assert not trace.stable
    assert np.isfinite(trace["joint"][0])
    assert np.isnan(trace["joint"][-1])


@pytest.mark.parametrize(
    "change",
    [
        {"sample_time": 0.0},
        {"delay": -1},
        {"substeps": 0},
        {"load_lag": -1e-3},
        {"load_lag": math.nan},
        {"servo": Servo(natural_frequency=-1.0)},
    ],
)
def test_absurd_plants_are_refused(change: dict[str, Any]) -> None:
    with pytest.raises(ParameterError, match="expected"):
        simulate(Bench(cables.play())._replace(**change), LAWS["uncompensated"], STROKE, duration=1.0)


@every_cable
def test_a_cable_rests_where_it_is_told(cable: Cable) -> None:
    plant = Bench(cable, sheath=Sheath(bend=2.0))
    for joint in (0.05, 0.7):
        start = plant.resting_motor(joint, 2.2)
        memory = cable.start(cable.prepared, start, 1.1, 1.0)
        assert cable.look(cable.prepared, memory, start, 1.1, 1.0).joint == pytest.approx(joint, abs=1e-9)


def test_a_joint_cannot_rest_beyond_its_springs_end() -> None:
    with pytest.raises(ParameterError, match="cannot rest with its joint at -1 rad"):
        Bench(CABLES["sliding"]).resting_motor(-1.0)


def test_absurd_cables_are_refused() -> None:
    with pytest.raises(ParameterError, match="two lists of one length"):
        cables.stack(0.5, [0.1], [0.2, 0.3])
    with pytest.raises(ParameterError, match="half-widths not below 0"):
        cables.stack(0.5, [-0.1], [0.2])
    with pytest.raises(ParameterError, match="half_range"):
        bouc_wen(terms=TERMS._replace(half_range=0.0))
    plant = Bench(friction_cables.sliding(), sheath=Sheath(loss=0.1))
    with pytest.raises(ParameterError, match="computes what its sheath loses"):
        simulate(plant, LAWS["uncompensated"], STROKE, duration=1.0)


@pytest.mark.parametrize("name", CURVES)
def test_the_plant_of_a_model_is_the_bench_round_the_cable_that_identification_predicts(name: str) -> None:
    """Where the log's start is at rest; a cable that runs backwards has its motor counted the other way."""
    bench = BENCH._replace(sheath=Sheath(bend=3.0, loss=0.2), substeps=1, sample_time=5e-3)
    model = {key: 0.0 if key.startswith("initial_") else value for key, value in MODELS[name].items()}
    plant = cables.plant_of_model(name, model, bench)
    assert plant[2:] == bench[2:]
    for bend in (3.0, 2.5) if "bend" in model else (3.0,):
        trace = simulate(plant, LAWS["uncompensated"], STROKE, duration=12.0, bend=constant_bend(bend))
        predicted = CableModel(name, model | ({"bend": bend} if "bend" in model else {})).joint_angle(-trace["motor"])
        np.testing.assert_allclose(trace["joint"], predicted, atol=1e-9)
    assert plant.sheath == (bench.sheath._replace(loss=0.0) if "bend" in model else bench.sheath)


@pytest.mark.parametrize("name", predicted.DISTRIBUTED)
def test_the_plant_of_a_tendon_leaves_to_it_what_the_sheath_loses(name: str) -> None:
    plant = cables.plant_of_model(name, {"friction": 0.2, "elements": 7.0}, BENCH._replace(sheath=Sheath(loss=0.2)))
    assert plant.sheath == Sheath()
    assert cables.distributed_parameters(name)["friction"] == 0.15
    shown = plant.describe()["cable"]
    tendon = shown if name == "sliding" else shown["tendon"]
    assert (tendon["friction"], tendon["elements"]) == (0.2, 7)
    with pytest.raises(ParameterError, match="no parameter 'frictoin'"):
        cables.identified(name, {"frictoin": 0.2})


@pytest.mark.parametrize("name", [*MODELS, *predicted.DISTRIBUTED])
def test_a_parameter_that_no_cable_has_is_refused_by_its_name(name: str) -> None:
    model = MODELS.get(name) or cables.distributed_parameters(name)
    check_parameters(name, model, "here")
    lengths = r"half_width|gap_|reach_|share_|rate|exponent|.*_step|.*half_range|friction|stiffness|length|elements"
    for key in model:
        never = [math.nan, math.inf, -1e12, 1e12, True, "1", None] + [-1.0] * bool(re.match(lengths, key))
        for value in never:
            with pytest.raises(ParameterError, match=f"here: {key} of {name} is "):
                check_parameters(name, model | {key: value}, "here")
    check_parameters(name, {f"share_{k}": 0.0 for k in range(MOST_PARAMETERS)}, "here")
    with pytest.raises(ParameterError, match="at most 1000"):
        check_parameters(name, {f"share_{k}": 0.0 for k in range(MOST_PARAMETERS + 1)}, "here")
    if "bend_low" in model:
        check_parameters(name, model | {"bend": 0.0}, "here")
