"""The exact inverse of a cable puts its joint on the reference, and moves the motor as much as a closed form says."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from bowden.control.reference import PeriodicMinimumJerk, PointToPoint, Trajectory
from bowden.core.units import RADIANS
from bowden.design.league_exact import STEP, exact_motor, exact_travel
from bowden.models.cable.backlash import Play
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.capstan import Tendon
from bowden.models.cable.lumped_cable import LumpedTendon
from bowden.models.cable.sheath import Sheath
from bowden.models.drive.servo import Servo
from bowden.plants import cables, friction_cables
from bowden.plants.cable_plant import Cable, CablePlant
from bowden.plants.pose_cable import poses
from bowden.sim.scenario import constant_bend, scripted_bend

STROKE = PeriodicMinimumJerk(0.0, 70.0 * RADIANS, 4.0)
CONSTANT = constant_bend(np.pi)
CABLES = {
    "play": cables.play(),
    "stack": cables.stack(0.3, [0.02, 0.05, 0.1], [0.3, 0.2, 0.15]),
    "not_monotone": cables.bouc_wen(),
    "soft": cables.bouc_wen(BoucWen(rate=5.0)),
    "poses": poses([cables.bouc_wen(), cables.bouc_wen(BoucWen(slope=0.8))]),
    "capstan": friction_cables.sliding(),
}


def joint_along(cable: Cable, path: Any) -> Any:
    """The joint when the motor goes from point to point, at a width of 1."""
    memory = cable.start(cable.prepared, float(path[0]), 1.0, 1.0)
    joint = [cable.look(cable.prepared, memory, float(path[0]), 1.0, 1.0).joint]
    for before, after in pairwise(path):
        memory = cable.advance(cable.prepared, memory, float(before), float(after), 1.0, 1.0, 1.0)
        joint.append(cable.look(cable.prepared, memory, float(after), 1.0, 1.0).joint)
    return np.array(joint)


def path_of(plant: CablePlant, reference: Trajectory, duration: float) -> tuple[Any, Any]:
    return exact_motor(plant, reference, duration=duration, bend=CONSTANT, initial_motor=plant.resting_motor(0.0))


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.long) if n == "capstan" else n for n in CABLES])
def test_the_exact_path_puts_the_joint_on_the_reference(name: str) -> None:
    motion = PointToPoint((0.0, 1.0, 2.0, 3.0, 4.0, 5.0), (0.0, 1.2, 1.2, 0.7, 0.9, 0.1))
    path, samples = path_of(CablePlant(CABLES[name]), motion, 5.0)
    assert np.abs(joint_along(CABLES[name], path) - samples[:, 0]).max() < 1e-6


@pytest.mark.parametrize("dahl", [False, pytest.param(True, marks=pytest.mark.long)])
def test_masses_and_damping_do_not_show(dahl: bool) -> None:
    """The lumped tendon's path is the quasi-static one on the same grid; Dahl's presliding rounds its corners."""
    tendon = Tendon(elements=10)
    lumped = friction_cables.lumped(LumpedTendon(tendon, dahl=dahl, presliding=1e-4 if dahl else 1e-7))
    ours, _ = path_of(CablePlant(lumped), STROKE, 8.0)
    theirs, _ = path_of(CablePlant(friction_cables.sliding(tendon)), STROKE, 8.0)
    travels = [np.abs(np.diff(path)).sum() for path in (ours, theirs)]
    assert travels[0] == pytest.approx(travels[1], rel=2e-3)
    assert np.mean(np.abs(ours - theirs) > 2e-3) < (0.2 if dahl else 1e-9)


def test_travel_of_pure_play_is_the_closed_form() -> None:
    """A stroke of the joint over the slope, and the slot's whole width at each reversal, half of it at the start."""
    slope, half, period, duration = 0.9, 0.05, 4.0, 10.0
    plant = CablePlant(cables.play(Play(slope, half)), servo=Servo(natural_frequency=1e6))
    travel = exact_travel(plant, STROKE, duration=duration, bend=CONSTANT, initial_motor=0.0)
    strokes = duration / (0.5 * period)
    wanted = strokes * 70.0 * RADIANS / slope + half + (strokes - 1.0) * 2.0 * half
    assert travel == pytest.approx(wanted, rel=1e-3)


def test_the_servos_lag_is_in_it() -> None:
    """Without any play the command is the reference through the inverse servo."""
    plant = CablePlant(cables.stack(0.8, [], []), servo=Servo(natural_frequency=30.0, damping=0.7))
    travel = exact_travel(plant, STROKE, duration=8.0, bend=CONSTANT, initial_motor=0.0)
    p, v, a = STROKE.sample(np.arange(0.0, 8.0, STEP)).T
    command = (p + 2.0 * 0.7 / 30.0 * v + a / 900.0) / 0.8
    assert travel == pytest.approx(np.abs(np.diff(command, prepend=0.0)).sum(), rel=2e-3)


def test_a_sheath_that_moves_does_not_make_it_chatter() -> None:
    """While the joint is held, a growing play is followed in steps of 0.1°, not in every sample."""
    plant = CablePlant(cables.bouc_wen(), sheath=Sheath(loss=0.16))
    still = PointToPoint((0.0, 2.0, 12.0), (0.0, 1.0, 1.0))
    bend = scripted_bend((3.0, 8.0), (np.pi, 2.0 * np.pi))
    moved = exact_travel(plant, still, duration=12.0, bend=bend, initial_motor=0.0)
    unmoved = exact_travel(plant, still, duration=12.0, bend=CONSTANT, initial_motor=0.0)
    assert unmoved < moved < unmoved + 0.6


def test_what_cannot_be_reached_leaves_the_motor_where_it_is() -> None:
    slack = friction_cables.sliding(Tendon(pretension=0.0))
    below = PointToPoint((0.0, 1.0, 2.0), (0.0, 0.5, -0.2))
    path, samples = exact_motor(CablePlant(slack), below, duration=2.5, bend=CONSTANT, initial_motor=0.0)
    under = samples[:, 0] < -1e-3
    assert under.any()
    assert np.ptp(path[under]) == 0.0
    assert np.isfinite(path).all()


def test_it_does_not_change_the_plant() -> None:
    plant = CablePlant(friction_cables.sliding())
    again = replace(plant.cable)
    first, second = (path_of(plant._replace(cable=cable), STROKE, 4.0)[0] for cable in (plant.cable, again))
    assert np.array_equal(first, second)
