"""Runs of what a rig describes: a bench, the suit where one is worn, or a joint with several motors."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bowden.control.law import Law
from bowden.control.source import TABLE
from bowden.plants.user_plant import UserPlant
from bowden.records.trace import Trace, Traces
from bowden.rig.joints import RigJoint
from bowden.rig.rig import Rig
from bowden.sim import ranges
from bowden.sim.injected import SensorFault
from bowden.sim.joint import CabledJoint, JointMotor, Range, simulate_joint
from bowden.sim.run import simulate


def run_of(rig: Rig, law: Law, fault: SensorFault | None = None) -> Trace:
    """The trace of one run, with the rig's hash in its settings.

    Args:
        rig: as it is to be simulated; one moved by EMG is taken `offline`.
        law: with the gains that the rig gives it.
        fault: of a sensor.

    Raises:
        ParameterError: a setting that cannot be.
        StreamError: a recording of EMG that cannot be used.
    """
    rig = rig.offline()
    trace = simulate(
        rig.simulated_plant,
        law,
        rig.trajectory,
        duration=rig.duration,
        bend=rig.bend_path,
        seed=rig.seed,
        initial_motor=rig.start_motor,
        source=TABLE if rig.pushing is None else rig.pushing.source(law),
        fault=fault,
    )
    trust = {} if rig.cable_trust is None else {"cable_trust": rig.cable_trust._asdict()}
    return replace(trace, settings={**trace.settings, "rig": rig.hash, **trust})


def cabled_joint_of(joint: RigJoint) -> CabledJoint:
    """All motors, their cables and the joint.

    Args:
        joint: that several motors share.

    Raises:
        ParameterError: a plant that cannot be.
    """
    motors = []
    for place, one in enumerate(joint.motors):
        cabled = one.rig.cabled
        assert not isinstance(cabled, UserPlant)  # which such a joint refuses
        motors.append(JointMotor(one.name, cabled, one.rig.bend_path, one.rig.seed + place, -one.rig.limits.slack_sign))
    return CabledJoint(tuple(motors), joint.settings.stiffness, joint.settings.co_contraction)


def joint_ranges(joint: RigJoint) -> tuple[tuple[Range, ...], Range]:
    """The bends of each motor's sheath, and the stroke of their joint [rad]."""
    return tuple(ranges.bends(one.rig) for one in joint.motors), ranges.stroke(joint.first)


def laws_of(joint: RigJoint) -> tuple[Law, ...]:
    """The laws of its motors, with the gains that the rig gives them."""
    return tuple(one.rig.fitted() for one in joint.motors)


def run_of_joint(joint: RigJoint, laws: Sequence[Law], rig_hash: str, *, whole: bool = False) -> Traces:
    """A run of all of its motors; the trace of each by its name.

    Args:
        joint: of a rig.
        laws: of each motor.
        rig_hash: of the whole rig, for the traces' settings.
        whole: see `Rig.offline`.

    Raises:
        ParameterError: a setting that cannot be, or motors that no one loop can have.
        StreamError: a recording of EMG that cannot be used.
    """
    leads = joint.first.offline(whole=whole)
    if not joint.shared:
        return Traces({joint.name: run_of(leads, laws[0])})
    plant = cabled_joint_of(joint)
    begin = float(leads.trajectory.sample(np.zeros(1))[0, 0])
    resting = plant.resting_motors(begin, [float(one.bend(np.zeros(1))[0]) for one in plant.motors])
    initial = [
        rest if one.rig.initial_motor is None else one.rig.start_motor
        for one, rest in zip(joint.motors, resting, strict=True)
    ]
    traces = simulate_joint(plant, laws, leads.trajectory, duration=leads.duration, initial_motors=initial)
    of = zip(joint.names, traces, strict=True)
    return Traces({name: replace(trace, settings={**trace.settings, "rig": rig_hash}) for name, trace in of})
