"""Our law: what it reaches on the bench, what it learns, and that plants nobody tuned for do not throw it."""

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.core.metrics import rmse
from bowden.core.signals import Reference, Sample
from bowden.core.trace import Trace
from bowden.core.units import DEGREES
from bowden.design.random_plants import run_random_plant
from bowden.models.backlash import Play
from bowden.paper import bench as paper
from bowden.sim.cable_plant import CablePlant
from bowden.sim.cables import bouc_wen, play
from bowden.sim.closed_loop import simulate


def error_deg(trace: Trace) -> float:
    return rmse(trace.error) * DEGREES


@pytest.fixture(scope="module")
def moved() -> Trace:
    return paper.run(LAWS["bowden"], moved=True)


def test_bench_from_rest_knowing_nothing(moved: Trace) -> None:
    assert error_deg(paper.run(LAWS["bowden"])) <= 0.10
    assert error_deg(moved) <= 0.20


def test_it_beats_the_papers_adaptive_law_where_that_was_tuned(moved: Trace) -> None:
    assert error_deg(paper.run(LAWS["bowden"])) < 0.5 * error_deg(paper.run(LAWS["adaptive"]))
    assert error_deg(moved) < 0.6 * error_deg(paper.run(LAWS["adaptive"], moved=True))


def test_estimates_end_at_the_cables_parameters(moved: Trace) -> None:
    cable, constant = paper.bench().cable, paper.run(LAWS["bowden"])
    for trace in (constant, moved):
        for name in ("law.slope_up", "law.slope_down"):
            assert trace[name][-1] == pytest.approx(trace["slope"][-1], rel=0.02)
        crossing = crossing_width(trace["width"][-1], trace["slope"][-1] / cable.slope)
        assert trace["law.width"][-1] == pytest.approx(crossing, rel=0.1)


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
    knowing = LAWS["bowden"].with_gains(slope=0.7, width=0.12, doubt=0.1)
    first = [rmse(simulate(plant, law, paper.minimum_jerk(), duration=10.0).error) for law in (LAWS["bowden"], knowing)]
    assert first[1] < 0.5 * first[0]


def test_estimates_stay_inside_their_bounds_whatever_is_measured() -> None:
    law, random = LAWS["bowden"], np.random.default_rng(5)
    state = law.start(Sample(0.0, 0.0))
    for _ in range(3000):
        sample = Sample(*(10.0 ** random.uniform(-3, 3, 2) * random.choice([-1.0, 1.0], 2)))
        state, command = law.step(state, sample, Reference(*random.normal(size=3)), 1e-3)
        assert 0.55 <= state.slope_up <= 1.3
        assert 0.55 <= state.slope_down <= 1.3
        assert -0.5 <= state.width <= 0.5
        assert -0.3 <= state.wedge <= 0.3
        assert -0.02 <= state.lag <= 0.1
        assert np.isfinite(command)


def test_three_hundred_random_plants_are_never_unstable() -> None:
    outcomes = [run_random_plant(LAWS["bowden"], number, duration=25.0) for number in range(300)]
    assert all(outcome.stable for outcome in outcomes)
    assert np.median([outcome.rmse_deg for outcome in outcomes]) < 1.0
    assert max(outcome.peak_deg for outcome in outcomes) < 90.0
