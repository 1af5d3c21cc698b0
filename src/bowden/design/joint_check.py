"""The motors that share a joint, as the check judges them: all as one."""

import itertools
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bowden.core.units import DEGREES, RADIANS
from bowden.design.check import Array, Bends, Complex, Laws, LinearLoop, Visited, check_motors, largest_change, usable
from bowden.design.check_result import Check, Point
from bowden.design.joint_loops import MotorLoop, cases, joint_margins, reaches
from bowden.design.limit_cycle import AMPLITUDES, MEASURED, describing_function
from bowden.design.linear_plant import slopes_of
from bowden.design.linearise import linearise
from bowden.design.trial import AFTER, Bounds, Trial, judged, motion
from bowden.models.cable.shared_joint import shares
from bowden.plants.bench import Bench
from bowden.plants.plant import Plant, changed
from bowden.plants.transmission import transmission
from bowden.records.trace import Trace
from bowden.sim.joint import CabledJoint, Range, simulate_joint
from bowden.sim.parting import asked_by, parting_of


@dataclass(frozen=True)
class _SeveralMotors:
    """Several motors on one joint (`bowden.design.check.Subject`)."""

    joint: CabledJoint
    laws: Laws
    bends: Sequence[Range]
    stroke: Range

    @property
    def plants(self) -> Sequence[Plant]:
        return tuple(one.bench for one in self.joint.motors)

    def trial(self, bends: Bends, moving: float, later: int) -> tuple[Sequence[Trial], float]:
        motors = (one._replace(bench=changed(one.bench, delay=one.bench.delay + later)) for one in self.joint.motors)
        joint = self.joint._replace(motors=tuple(motors)) if later else self.joint
        traces = simulate_joint(
            joint.at_bends(bends),
            self.laws,
            motion(self.stroke, moving),
            duration=moving + AFTER,
            initial_motors=joint.resting_motors(self.stroke[0], bends),
        )
        length = abs(self.stroke[1] - self.stroke[0])
        bounds = Bounds(length, 2.0 * self.dead_zone(bends) + RADIANS, 0.0)
        return [judged(one, length, moving, bounds) for one in traces], _went_apart(joint, bends, self.stroke, traces)

    def linear(
        self, ends: Sequence[Bends], estimates: Sequence[Visited], width: float, *, reversals: bool
    ) -> list[LinearLoop]:
        motors, dt, found = self.joint.motors, self.joint.first.sample_time, list[LinearLoop]()
        said = ["all cables taut", *(f"{one.name} alone taut" for one in motors)]
        for values in estimates:
            models = [
                linearise(law, dt, width=width, estimates=one) for law, one in zip(self.laws, values, strict=True)
            ]
            jump = max(largest_change(model) for model in models) * self.joint.first.joint_encoder.resolution
            own = dict(values[0])
            for one, more in zip(motors[1:], values[1:], strict=True):
                own |= {f"{one.name}: {name}": value for name, value in more.items()}
            for bends in ends:
                others = " and ".join(f"{bend * DEGREES:.0f}°" for bend in bends[1:])
                beside = "" if len({*bends}) == 1 else f", with other bends of {others}"
                each = [
                    slopes_of(one.bench, bend, one.own_stroke(self.stroke))
                    for one, bend in zip(motors, bends, strict=True)
                ]
                for slopes in itertools.product(*each):
                    loops = [
                        MotorLoop(one.bench.servo, one.bench.delay, slope, model)
                        for one, slope, model in zip(motors, slopes, models, strict=True)
                    ]
                    for taut, at in zip(cases(len(motors)), said, strict=True):
                        margins = joint_margins(loops, self.joint.load, taut, dt)
                        reach = float(np.sum(reaches(loops, self.joint.load, taut)))
                        point = Point(bends[0], reach, own, margins.joint, at + beside, jump)
                        found.append(LinearLoop(point, bends, at, margins.apart))
        return found

    def response(self, bends: Bends) -> tuple[Array, Complex]:
        motors = self.joint.motors
        amplitudes = AMPLITUDES if all(isinstance(one.bench, Bench) for one in motors) else MEASURED
        share = shares(self.joint.load, (True,) * len(motors))
        gains = sum(
            part * describing_function(one.bench, bend, one.own_stroke(self.stroke), amplitudes)[1]
            for part, one, bend in zip(share, motors, bends, strict=True)
        )
        return amplitudes, np.asarray(gains)  # what all motors make of it that go alike

    def dead_zone(self, bends: Bends) -> float:
        each = zip(self.joint.motors, bends, strict=True)
        found = [(one.sign, transmission(one.bench, bend, one.own_stroke(self.stroke))) for one, bend in each]
        ways = [max(one.slope for way, one in found if way == sign) for sign in (1.0, -1.0)]
        return max(one.dead_zone for _, one in found) + max(0.0, -self.joint.co_contraction) * sum(ways)

    def most_apart(self) -> float:
        each_two = itertools.combinations(range(len(self.laws)), 2)
        return min(parting_of(self.joint, self.bends, self.stroke, i, j).most for i, j in each_two)


def check_joint(joint: CabledJoint, laws: Laws, *, bends: Sequence[Range], stroke: Range, seed: int = 1) -> Check:
    """Judge laws on one joint: `check_motors` of all its motors.

    The linear loops of all motors are one (`bowden.design.joint_loops`), for all cables taut and for each alone.

    Args:
        joint: with its motors.
        laws: of each motor.
        bends: smallest and largest of each motor's sheath [rad]; every one is tried with every one of the others, since
            it is where they differ most that the cables disagree most.
        stroke: ends of the trials' motion [rad].
        seed: of the encoders' noise.

    Raises:
        ParameterError: gains that are not finite, bends or a stroke that cannot be, motors that no one loop can have,
            or whose cables do not follow them.
    """
    each = [usable(law, own, stroke) for law, own in zip(laws, bends, strict=True)]
    return check_motors(_SeveralMotors(joint.seeded(seed), laws, bends, stroke), tuple(itertools.product(*each)))


def _went_apart(joint: CabledJoint, bends: Bends, stroke: Range, traces: Sequence[Trace]) -> float:
    """How much further, or less far, motors came to pull against each other than joint and co-contraction ask [rad].

    Each by its own cable (`bowden.sim.parting`): motors that go alike behind cables of two slopes pull ever further, or
    let go.
    """
    off = []
    for one, bend, trace in zip(joint.motors, bends, traces, strict=True):
        asked = asked_by(one, bend, stroke)
        off.append(trace["motor"] - asked.offset - asked.way * trace["joint"])
    apart = 0.5 * (np.max(off, axis=0) - np.min(off, axis=0))
    return float(np.max(apart, initial=0.0, where=np.isfinite(apart)))
