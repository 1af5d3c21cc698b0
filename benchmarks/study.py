"""How far `bowden check` can be trusted: its verdicts against long simulations of random rigs.

The truth is defined without the check, from runs that it does not see (other motions, longer, another seed):

- *stable*: after ten minutes of motion the loop comes to rest, and in the last 10 s of it the joint's span is within
  twice the dead zone and 1°. The play may swing a joint that far; a loop that is unstable swings it further, or runs
  away. Estimates that drift can take minutes to do so.
- *calm at rest*: that span is within the dead zone, in which play leaves a joint without a law, too.
- *margin in simulation*: the stable loop without the play (αh = 0, so that its hunting is not taken for the loop's) is
  given twice the cable's slope (6 dB), and more and more delay, each for 35 s of motion; the longest delay at which it
  comes to rest counts as a phase at the frequency at which it then rings. *With margin* is 45°, what tuned gains keep.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bowden.control import LAWS
from bowden.control.law import Law
from bowden.control.reference import PointToPoint
from bowden.core.units import RADIANS
from bowden.design.check import STROKE, check
from bowden.design.check_result import VerdictName
from bowden.models.drive.servo import Servo
from bowden.plants.bench import Bench
from bowden.plants.presets.bench import default_bench
from bowden.plants.transmission import transmission
from bowden.records.trace import Trace
from bowden.sim.run import simulate
from kept import Kept
from measure import Figure, Found

COUNT, SEED, SEED_OF_TRIES = 500, 20261122, 0

_MOTION = 2.5
"""Time of one motion, up or down [s]."""
_LONG, _SHORT = 240, 14
"""Motions of a run for the truth, and of one with less margin."""
_REST, _JUDGED = 15.0, 10.0
"""The rest that follows, and the last part of it that is judged [s]."""
ENOUGH_PHASE = 45.0
"""[deg]"""
_LONGEST = 256
"""Cycles of further delay up to which a loop is tried."""


@dataclass(frozen=True)
class Case:
    """One random rig: what the check says, and what simulations show."""

    number: int
    """Of the rig among those of its seed."""
    verdict: VerdictName
    stable: bool
    calm: bool
    """At rest; never where the run is not stable."""
    phase_margin_deg: float
    """In simulation; 0 where the run is not stable, or is not with twice the slope."""

    @property
    def with_margin(self) -> bool:
        """See the module."""
        return self.phase_margin_deg >= ENOUGH_PHASE


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
        """Share of the rigs with margin, calm at rest, that get `holds`; others are to get `limit_cycle`."""
        return float(np.mean([case.verdict == "holds" for case in self.cases if case.with_margin and case.calm]))


def study(bench: Bench, count: int, seed: int = 0, skip: int = 0) -> Iterator[Case]:
    """Judge random rigs by the check and by long simulations, one after the other.

    Args:
        bench: whose cable, encoders and sheath the rigs have.
        count: how many rigs.
        seed: of the draw.
        skip: how many of them are known already and left out.
    """
    for number, (rig, law) in enumerate(random_rigs(bench, count, seed)):
        if number >= skip:
            trace = _run(rig, law, _LONG)
            stable = _at_rest(rig, trace)
            calm = stable and _span(trace) <= _dead_zone(rig)
            yield Case(number, check(rig, law).verdict, stable, calm, simulated_margin(rig, law) if stable else 0.0)


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
    """See the module: ten minutes that end at rest."""
    return _at_rest(bench, _run(bench, law, _LONG))


def simulated_margin(bench: Bench, law: Law) -> float:
    """See the module: the phase that is left [deg], infinite where a quarter of a second of delay takes none of it."""
    bench = bench._replace(cable=bench.cable._replace(hysteresis_gain=0.0))

    def run(delay: int, slope: float = 1.0) -> Trace:
        cable = bench.cable._replace(slope=slope * bench.cable.slope)
        return _run(bench._replace(delay=bench.delay + delay, cable=cable), law, _SHORT)

    def holds(delay: int, slope: float = 1.0) -> bool:
        return _at_rest(bench, run(delay, slope))

    if not (holds(0) and holds(0, 2.0)):
        return 0.0
    holding, failing = 0, 1  # cycles of further delay
    while holds(failing):
        holding, failing = failing, 2 * failing
        if failing > _LONGEST:
            return np.inf
    while failing - holding > max(1, holding // 8):
        middle = (holding + failing) // 2
        holding, failing = (middle, failing) if holds(middle) else (holding, middle)
    return 360.0 * holding * bench.sample_time / _period(run(holding))


def _run(bench: Bench, law: Law, motions: int) -> Trace:
    times = [_MOTION * k for k in range(motions + 1)]
    positions = [70.0 * RADIANS * (k % 2) for k in range(motions)] + 2 * [20.0 * RADIANS]
    reference = PointToPoint((*times, times[-1] + _REST), tuple(positions))
    start = bench.resting_motor(0.0)
    return simulate(bench, law, reference, duration=times[-1] + _REST, seed=7, initial_motor=start)


def _at_rest(bench: Bench, trace: Trace) -> bool:
    return trace.ended and _span(trace) <= 2.0 * _dead_zone(bench) + 1.0 * RADIANS


def _span(trace: Trace) -> float:
    """Of the joint in the last part of the rest [rad]."""
    return float(np.ptp(_rest(trace)))


def _dead_zone(bench: Bench) -> float:
    return transmission(bench, bench.sheath.bend, STROKE).dead_zone


def _rest(trace: Trace) -> NDArray[np.float64]:
    """The joint in the last part of the rest."""
    time = trace.columns["time"]
    return trace.columns["joint"][time >= time[-1] - _JUDGED]


def _period(trace: Trace) -> float:
    """Of the strongest line in what is left of the joint's motion at rest [s]."""
    rest = _rest(trace)
    power = np.abs(np.fft.rfft((rest - np.mean(rest)) * np.hanning(len(rest))))
    dt = float(trace.columns["time"][1] - trace.columns["time"][0])
    return len(rest) * dt / float(max(1, int(np.argmax(power))))


def figures(share: float) -> Found:
    """The shares, beside what is wanted of them; fewer rigs are of another seed."""
    count, seed = round(share * COUNT), SEED if share == 1.0 else SEED_OF_TRIES
    kept = Kept(f"study_{seed}")
    missing = study(default_bench(), count, seed, skip=len(kept.rows()))
    rows = kept.filled(([c.number, c.verdict, c.stable, c.calm, c.phase_margin_deg] for c in missing), count)
    found = Study(tuple(Case(*row) for row in rows[:count]))
    verdicts = [case.verdict for case in found.cases]
    return Found(
        [
            Figure(
                "agreement: unstable rigs get `does_not_hold`, the others do not", f"{found.agreement:.1%}", "≥ 98 %"
            ),
            Figure("unsafe: `holds`, and unstable", f"{found.unsafe} of {verdicts.count('holds')}", "0"),
            Figure("`little_margin`", f"{found.little_margin:.1%}", "≤ 10 %"),
            Figure("`holds`, of the rigs calm at rest with 6 dB and 45°", f"{found.recognised:.1%}", "≥ 95 %"),
        ],
        f"{count} rigs of seed {seed}, {sum(case.stable for case in found.cases)} stable in ten minutes of motion.",
    )
