"""A rig's pair as a simulation has it: two motors with their cables on one joint, and one run of them."""

from dataclasses import replace

import numpy as np

from bowden.control.law import Law
from bowden.plants.user_plant import UserPlant
from bowden.records.trace import Trace
from bowden.records.traces import Traces
from bowden.rig import ranges
from bowden.rig.rig import Rig
from bowden.sim.pair import PairPlant, PairSide, simulate_pair
from bowden.sim.parting import Parting, Range, parting_of


def pair_plant_of(rig: Rig) -> PairPlant:
    """Both motors, their cables and the joint.

    Args:
        rig: with a pair.

    Raises:
        ParameterError: a plant that cannot be.
    """
    sides = []
    for place, name in enumerate(rig.pair.names):
        axis = rig.axis(name)
        cabled = axis.cabled
        assert not isinstance(cabled, UserPlant)  # which a pair refuses
        sides.append(PairSide(name, cabled, axis.bend_path, axis.seed + place, -axis.limits.slack_sign))
    return PairPlant(sides[0], sides[1], rig.pair.stiffness, rig.pair.co_contraction)


def agonist_of(rig: Rig, *, whole: bool = False) -> Rig:
    """The rig of the agonist, whose reference and duration are the pair's.

    Args:
        rig: with a pair.
        whole: see `Rig.offline`.
    """
    return rig.axis(rig.pair.agonist).offline(whole=whole)


def pair_ranges(rig: Rig) -> tuple[tuple[Range, Range], Range]:
    """The bends of both sheaths, the agonist's first, and the stroke of their joint [rad].

    Args:
        rig: with a pair.
    """
    one, other = (rig.axis(name) for name in rig.pair.names)
    return (ranges.bends(one), ranges.bends(other)), ranges.stroke(one)


def parting_in_run(rig: Rig) -> Parting:
    """How far its motors may part in a run, and by what that is seen.

    Args:
        rig: with a pair.

    Raises:
        ParameterError: a plant that cannot be, or that does not follow its motor.
    """
    return parting_of(pair_plant_of(rig), *pair_ranges(rig))


def run_of_pair(rig: Rig, laws: tuple[Law, Law], *, whole: bool = False) -> Traces:
    """A run of both; the trace of each by the name of its axis, with the rig's hash in its settings.

    Args:
        rig: with a pair.
        laws: the agonist's first.
        whole: see `Rig.offline`.

    Raises:
        ParameterError: a setting that cannot be, or sides that no one loop can have.
        StreamError: a recording of EMG that cannot be used.
    """
    pair, leads = pair_plant_of(rig), agonist_of(rig, whole=whole)
    begin = float(leads.trajectory.sample(np.zeros(1))[0, 0])
    bends = tuple(float(side.bend(np.zeros(1))[0]) for side in pair.sides)
    resting = pair.resting_motors(begin, (bends[0], bends[1]))
    given = [rig.axis(name) for name in rig.pair.names]
    initial = [
        rest if axis.initial_motor is None else axis.start_motor for axis, rest in zip(given, resting, strict=True)
    ]
    traces = simulate_pair(
        pair, laws, leads.trajectory, duration=leads.duration, initial_motors=(initial[0], initial[1])
    )
    found: dict[str, Trace] = {
        name: replace(trace, settings={**trace.settings, "rig": rig.hash})
        for name, trace in zip(rig.pair.names, traces, strict=True)
    }
    return Traces(found)
