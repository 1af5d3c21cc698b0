"""Our law: what it reaches on the bench, what it learns, and that plants nobody tuned for do not throw it."""

from collections.abc import Callable

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk, PointToPoint
from bowden.core.kernel import compiled, kernel
from bowden.core.metrics import rmse
from bowden.core.signals import Reference, Sample
from bowden.core.trace import Trace
from bowden.core.units import DEGREES, RADIANS
from bowden.models.cable.backlash import Play
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.sheath import Sheath
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.servo import Servo, ServoState, ServoStep, prepare, servo_step
from bowden.plants.cable_plant import CablePlant
from bowden.plants.cables import bouc_wen, play
from bowden.plants.friction_cables import lumped
from bowden.rig.presets import bench as paper
from bowden.sim.run import simulate
from drawn_plants import run_random_plant
from support import bench_runs


def error_deg(trace: Trace) -> float:
    return rmse(trace.error) * DEGREES


@pytest.fixture(scope="module")
def moved() -> Trace:
    return bench_runs.run(LAWS["bowden"], moved=True)


def test_bench_from_rest_knowing_nothing(moved: Trace) -> None:
    assert error_deg(bench_runs.run(LAWS["bowden"])) <= 0.10
    assert error_deg(moved) <= 0.20


def test_it_beats_the_papers_adaptive_law_where_that_was_tuned(moved: Trace) -> None:
    assert error_deg(bench_runs.run(LAWS["bowden"])) < 0.5 * error_deg(bench_runs.run(LAWS["adaptive"]))
    assert error_deg(moved) < 0.6 * error_deg(bench_runs.run(LAWS["adaptive"], moved=True))


def test_estimates_end_at_the_cables_parameters(moved: Trace) -> None:
    cable, constant = paper.bench().cable, bench_runs.run(LAWS["bowden"])
    for trace in (constant, moved):
        for name in ("law.slopes.up", "law.slopes.down"):
            assert trace[name][-1] == pytest.approx(trace["slope"][-1], rel=0.02)
        crossing = crossing_width(trace["width"][-1], trace["slope"][-1] / cable.slope)
        assert trace["law.crossing.width"][-1] == pytest.approx(crossing, rel=0.1)


def crossing_width(width: float, factor: float) -> float:
    """Motor travel after a turn until the bench's joint is back where it was [rad]."""
    cable = bouc_wen(paper.bench().cable)
    memory = cable.start(cable.prepared, 0.0, width, factor)
    memory = cable.advance(cable.prepared, memory, 0.0, 1.0, width, factor, 1.0)
    turn, motor, step = cable.look(cable.prepared, memory, 1.0, width, factor).joint, 1.0, 2e-4
    while motor > 0.98 or cable.look(cable.prepared, memory, motor, width, factor).joint > turn:
        memory = cable.advance(cable.prepared, memory, motor, motor - step, width, factor, 1.0)
        motor -= step
    return 1.0 - motor


def test_a_cable_that_runs_the_other_way_is_the_same_cable() -> None:
    one, other = (
        simulate(CablePlant(cable=play(Play(sign * 0.9, 0.05))), law, paper.minimum_jerk(), duration=20.0)
        for sign, law in ((1.0, LAWS["bowden"]), (-1.0, LAWS["bowden"].with_gains(slope=-1.0)))
    )
    np.testing.assert_allclose(one["joint"], other["joint"], atol=1e-12)
    np.testing.assert_allclose(one["motor"], -other["motor"], atol=1e-12)


def test_a_model_spares_the_learning() -> None:
    plant = CablePlant(cable=play(Play(0.7, 0.06)), servo=paper.bench().servo)
    informed_laws = LAWS["bowden"].with_gains(slope=0.7, width=0.12, doubt=0.1)
    first = [
        rmse(simulate(plant, law, paper.minimum_jerk(), duration=10.0).error) for law in (LAWS["bowden"], informed_laws)
    ]
    assert first[1] < 0.5 * first[0]


def test_estimates_stay_inside_their_bounds_whatever_is_measured() -> None:
    law, random = LAWS["bowden"], np.random.default_rng(5)
    state = law.start(Sample(0.0, 0.0))
    for _ in range(3000):
        sample = Sample(*(10.0 ** random.uniform(-3, 3, 2) * random.choice([-1.0, 1.0], 2)))
        state, command = law.step(state, sample, Reference(*random.normal(size=3)), 1e-3)
        assert 0.55 <= state.slopes.up <= 1.3
        assert 0.55 <= state.slopes.down <= 1.3
        assert -0.5 <= state.crossing.width <= 0.5
        assert -0.3 <= state.crossing.wedge <= 0.3
        assert -0.02 <= state.slopes.lag <= 0.1
        assert np.isfinite(command)


@pytest.mark.long
def test_three_hundred_random_plants_are_never_unstable() -> None:
    outcomes = [run_random_plant(LAWS["bowden"], number, duration=25.0) for number in range(300)]
    assert all(outcome.stable for outcome in outcomes)
    assert np.median([outcome.rmse_deg for outcome in outcomes]) < 1.0
    assert max(outcome.peak_deg for outcome in outcomes) < 90.0


SLOPE, HALF_WIDTH, FAST = 0.9, 0.05, Servo(speed_limit=100.0)


Seen = Callable[[int, float, float], tuple[float, float]]


def unspoilt(_tick: int, joint: float, motor: float) -> tuple[float, float]:
    return joint, motor


@kernel
def ten_ticks(state: ServoState, target: float, servo: ServoStep) -> ServoState:
    for _ in range(10):
        state = servo_step(state, target, servo)
    return state


def played(reference: np.ndarray, seen: Seen = unspoilt, start: float = 0.0) -> np.ndarray:
    """Error and command [rad] (2, n) on a pure play behind a servo, with samples that `seen` may spoil."""
    law, servo, state = LAWS["bowden"], prepare(FAST, 1e-4), ServoState(0.0, 0.0, 0.0)
    step, servo_cycle, applied, tendon = compiled(law.step_kernel), compiled(ten_ticks), start, 0.0
    memory, told = compiled(law.start_kernel)(law.gains, Sample(*seen(0, 0.0, start))), []
    for tick, wanted in enumerate(reference):
        sample = Sample(*map(float, seen(tick, SLOPE * tendon, start + state.position)))
        memory, command = step(law.gains, memory, sample, Reference(*map(float, wanted)), 1e-3)
        told.append((SLOPE * tendon - wanted[0], command))
        state = servo_cycle(state, applied - start, servo)
        applied = command
        tendon = min(max(tendon, state.position - HALF_WIDTH), state.position + HALF_WIDTH)
    return np.array(told).T


STROKES = PeriodicMinimumJerk(0.0, 70.0 * RADIANS, 10.0)
MINUTE = STROKES.sample(np.arange(0.0, 25.0, 1e-3))


@pytest.mark.parametrize(
    "spoilt", [np.nan, 10.0, *(pytest.param(other, marks=pytest.mark.long) for other in (np.inf, -np.inf, 1e9))]
)
@pytest.mark.parametrize("encoder", ["joint", "motor"])
def test_a_bad_sample_is_not_followed_nor_learned_from(encoder: str, spoilt: float) -> None:
    def seen(tick: int, joint: float, motor: float) -> tuple[float, float]:
        bad = tick % 4000 == 2500
        return (spoilt if bad and encoder == "joint" else joint), (spoilt if bad and encoder == "motor" else motor)

    error, command = played(MINUTE, seen)
    assert np.all(np.isfinite(command))
    assert np.abs(error[2000:]).max() * DEGREES < 0.7
    assert rmse(error[20000:]) * DEGREES < 0.02


def test_half_a_second_without_samples_is_driven_through() -> None:
    error, _ = played(MINUTE, lambda tick, joint, motor: (np.nan if 16500 <= tick < 17000 else joint, motor))
    assert np.abs(error[15000:]).max() * DEGREES < 1.5
    assert rmse(error[20000:]) * DEGREES < 0.02


@pytest.mark.parametrize("rest", [0.0, 0.3])
def test_a_torn_cable_is_not_pulled_on_for_ever(rest: float) -> None:
    _, command = played(MINUTE, lambda tick, joint, motor: (rest, motor))
    assert np.abs(command).max() < 3.0


def test_the_motor_may_count_from_anywhere() -> None:
    near, far = (played(MINUTE, start=start) for start in (0.0, 1500.0))
    np.testing.assert_allclose(far[0], near[0], atol=1e-6)
    np.testing.assert_allclose(far[1] - 1500.0, near[1], atol=1e-6)


@pytest.mark.parametrize(("resolution_deg", "noise_deg"), [(0.02, 0.1), (0.2, 0.0667), (0.2, 0.0), (0.0, 0.05)])
def test_a_minute_at_rest_is_quiet(resolution_deg: float, noise_deg: float) -> None:
    encoder = Encoder(resolution_deg * RADIANS, noise_deg * RADIANS)
    plant = CablePlant(cable=bouc_wen(BoucWen()), joint_encoder=encoder, motor_encoder=encoder)
    moves = PointToPoint((0.0, 1.0, 61.0, 62.0, 122.0), (0.0, 0.8, 0.8, 0.3, 0.3))
    trace = simulate(plant, LAWS["bowden"], moves, duration=122.0)
    for begin in (5.0, 66.0):
        held = (trace.time > begin) & (trace.time < begin + 55.0)
        assert np.ptp(trace["command"][held]) * DEGREES < 0.5
        assert np.abs(trace.error[held]).max() * DEGREES < 0.4


def test_an_error_at_rest_does_not_hunt_before_the_first_motion() -> None:
    still = PointToPoint((0.0, 60.0), (0.0, 0.0))
    encoder = Encoder(0.02 * RADIANS, 0.007 * RADIANS)
    plant = CablePlant(cable=bouc_wen(BoucWen()), joint_encoder=encoder, motor_encoder=encoder, servo=FAST)
    trace = simulate(plant, LAWS["bowden"], still, duration=60.0)
    assert np.abs(trace.error[30000:]).max() * DEGREES < 0.15
    assert np.ptp(trace["command"][30000:]) * DEGREES < 0.1


def test_positions_without_velocities_are_followed() -> None:
    positions = MINUTE * (1.0, 0.0, 0.0)
    error, _ = played(positions)
    assert rmse(error[10000:]) * DEGREES < 0.06


def test_a_step_is_not_made_up_for_twice() -> None:
    steps = np.zeros((12000, 3))
    steps[:, 0] = 0.5 * (np.arange(12000) // 2000 % 2)
    _, command = played(steps)
    assert command.max() < 0.5 / SLOPE + 2.0 * HALF_WIDTH + 0.3


@pytest.mark.parametrize(("number", "most_deg"), [(5516, 2.4), (5580, 1.8), (5078, 2.4)])
def test_a_dead_zone_that_shrinks_is_noticed_by_the_jumps_that_go_too_far(number: int, most_deg: float) -> None:
    assert run_random_plant(LAWS["bowden"], number, duration=40.0).rmse_deg < most_deg


def test_doubt_stays_bounded_over_hours() -> None:
    strokes = PeriodicMinimumJerk(0.0, 60.0 * RADIANS, 1.0)
    trace = simulate(CablePlant(cable=play(Play(SLOPE, HALF_WIDTH))), LAWS["bowden"], strokes, duration=300.0)
    assert trace["law.crossing.w33"].max() < 6e-4


def test_a_joint_that_runs_the_wrong_way_is_told_from_one_that_rests(moved: Trace) -> None:
    error = simulate(CablePlant(cable=play(Play(SLOPE, HALF_WIDTH))), LAWS["bowden"], STROKES, duration=15.0)
    assert error["law.crossing.dip"][-1] < 0.001 + 0.07 * error["law.crossing.width"][-1]
    after = moved["law.crossing.dip"][moved.time > 7.0]
    assert np.all(after > 0.001 + 0.07 * moved["law.crossing.width"][moved.time > 7.0])


def test_masses_that_swing_are_calmed() -> None:
    strokes = PeriodicMinimumJerk(0.0, 70.0 * RADIANS, 2.0)
    trace = simulate(
        CablePlant(cable=lumped(), sheath=Sheath(gap=1.0, loss=0.0)), LAWS["bowden"], strokes, duration=12.0
    )
    assert trace["law.feedback.calm"][-1] < 0.7
    assert error_deg(trace) < 0.7
    quiet = bench_runs.run(LAWS["bowden"])
    assert quiet["law.feedback.calm"].min() == 1.0
