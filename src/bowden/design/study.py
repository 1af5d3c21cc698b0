"""How far the check can be trusted: its verdicts against long simulations of random rigs.

The truth is defined without the check, from runs that it does not see (other motions, lengths and seeds):

- *stable*: 50 s of motion and rest end, and in the last 10 s of rest the joint's span is within twice the dead zone and
  1°. The play may swing a joint that far; a loop that is unstable swings it further, or runs away.
- *stable with margin*: stable, and without the play (αh = 0, so that its hunting is not taken for the loop's) still so
  with twice the cable's slope (6 dB), and with a further delay worth 45° (what tuned gains keep) at the frequency at
  which the loop rings just before it is unstable.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from bowden.control import LAWS
from bowden.control.law import Law
from bowden.control.reference import PointToPoint
from bowden.core.trace import Trace
from bowden.core.units import RADIANS
from bowden.design.check import VerdictName, check
from bowden.design.trial import dead_zone, slope_at
from bowden.models.servo import Servo
from bowden.sim.closed_loop import simulate
from bowden.sim.plant import Bench

_TIMES = (*(2.5 * k for k in range(14)), 35.0, 50.0)
_POSITIONS = (*(70.0 * RADIANS * (k % 2) for k in range(14)), 20.0 * RADIANS, 20.0 * RADIANS)
_JUDGED = 40.0
_PHASE = 45.0
"""[deg]"""
_LONGEST = 256
"""Cycles of further delay up to which a loop is tried."""


@dataclass(frozen=True)
class Case:
    """One random rig: what the check says, and what simulations show."""

    bench: Bench
    law: Law
    verdict: VerdictName
    stable: bool
    with_margin: bool


@dataclass(frozen=True)
class Study:
    """All cases, and the shares that matter."""

    cases: tuple[Case, ...]

    @property
    def agreement(self) -> float:
        """Share of cases in which `does_not_hold` goes with an unstable run, the others with a stable one."""
        return float(np.mean([(case.verdict == "does_not_hold") is not case.stable for case in self.cases]))

    @property
    def unsafe(self) -> int:
        """Cases with the verdict `holds` that are unstable."""
        return sum(case.verdict == "holds" and not case.stable for case in self.cases)

    @property
    def little_margin(self) -> float:
        """Share of the verdict `little_margin`."""
        return float(np.mean([case.verdict == "little_margin" for case in self.cases]))

    @property
    def recognised(self) -> float:
        """Share of the rigs that are stable with margin that get `holds`."""
        return float(np.mean([case.verdict == "holds" for case in self.cases if case.with_margin]))


def study(bench: Bench, count: int, seed: int = 0) -> Study:
    """Judge random rigs by the check and by long simulations."""
    cases = []
    for rig, law in random_rigs(bench, count, seed):
        stable = is_stable(rig, law)
        cases.append(Case(rig, law, check(rig, law).verdict, stable, stable and has_margin(rig, law)))
    return Study(tuple(cases))


def random_rigs(bench: Bench, count: int, seed: int) -> Iterator[tuple[Bench, Law]]:
    """Servo 2–20 Hz, damping 0.5–1.2, delay 0–3 cycles, slope 0.6–1.2, λ 0.003–3 s and κ 2–200 1/s.

    Frequency and gains are even on a logarithmic scale.
    """
    random = np.random.default_rng(seed)
    for _ in range(count):
        servo = Servo(
            natural_frequency=2.0 * np.pi * float(np.exp(random.uniform(np.log(2.0), np.log(20.0)))),
            damping=float(random.uniform(0.5, 1.2)),
            speed_limit=bench.servo.speed_limit,
        )
        rig = bench._replace(
            servo=servo,
            delay=int(random.integers(0, 4)),
            cable=bench.cable._replace(slope=float(random.uniform(0.6, 1.2))),
        )
        yield (
            rig,
            LAWS["adaptive"].with_gains(
                error_gain=float(np.exp(random.uniform(np.log(0.003), np.log(3.0)))),
                feedback_gain=float(np.exp(random.uniform(np.log(2.0), np.log(200.0)))),
            ),
        )


def is_stable(bench: Bench, law: Law) -> bool:
    """See the module: a run of 50 s that comes to rest."""
    return _at_rest(bench, _run(bench, law))


def has_margin(bench: Bench, law: Law) -> bool:
    """See the module: without play, stable with twice the slope, and with a delay of 45°."""
    bench = bench._replace(cable=bench.cable._replace(hysteresis_gain=0.0))
    if not is_stable(bench._replace(cable=bench.cable._replace(slope=2.0 * bench.cable.slope)), law):
        return False
    holding, failing = 0, 1  # cycles of further delay
    while _at_rest(bench, _run(bench._replace(delay=bench.delay + failing), law)):
        holding, failing = failing, 2 * failing
        if failing > _LONGEST:
            return True
    while failing - holding > max(1, holding // 8):
        middle = (holding + failing) // 2
        fine = _at_rest(bench, _run(bench._replace(delay=bench.delay + middle), law))
        holding, failing = (middle, failing) if fine else (holding, middle)
    period = _period(_run(bench._replace(delay=bench.delay + holding), law))
    return bool(360.0 * holding * bench.sample_time / period >= _PHASE)


def _run(bench: Bench, law: Law) -> Trace:
    reference = PointToPoint(_TIMES, _POSITIONS)
    start = -bench.cable.offset / slope_at(bench, bench.sheath.bend)
    return simulate(bench, law, reference, duration=_TIMES[-1], seed=7, initial_motor=start)


def _at_rest(bench: Bench, trace: Trace) -> bool:
    joint = trace.columns["joint"][trace.columns["time"] >= _JUDGED]
    return trace.stable and float(np.ptp(joint)) <= 2.0 * dead_zone(bench, bench.sheath.bend) + 1.0 * RADIANS


def _period(trace: Trace) -> float:
    """Of the strongest line in what is left of the joint's motion at rest [s]."""
    rest = trace.columns["joint"][trace.columns["time"] >= _JUDGED]
    power = np.abs(np.fft.rfft((rest - np.mean(rest)) * np.hanning(len(rest))))
    dt = float(trace.columns["time"][1] - trace.columns["time"][0])
    return len(rest) * dt / float(max(1, int(np.argmax(power))))
