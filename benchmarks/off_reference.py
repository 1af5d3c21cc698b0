"""`JOINT_OFF_REFERENCE`: how near runs in order come to its limit, and how soon it and the others find what is wrong.

    PYTHONPATH=tests python benchmarks/off_reference.py [COUNT]

In order are laws on benches and wearers that are not the ones they were simulated on, `COUNT` draws each. What is wrong
begins at four moments of a run of script, law and supervisor on the twin's bench in simulated time. The tables stand in
docs/background/safety.md.
"""

import sys
from collections.abc import Callable

import numpy as np

from bowden.control import LAWS, Law
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.signals import DriveReading
from bowden.core.units import DEGREES, RADIANS
from bowden.cycle.one_cycle import Cycle, WishSource
from bowden.design.forecast import HALF_AGAIN, lasting_error, off_reference
from bowden.face.identify import identify
from bowden.face.init import init
from bowden.hardware.emg.recorded import EmgMotion
from bowden.hardware.ports import Power
from bowden.hardware.twin.bench import TwinBench
from bowden.live.live_run import live_run
from bowden.live.row import NOTHING_READ
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.drive.thermal import cold
from bowden.plants.bends import RandomBend
from bowden.plants.presets.suit import suit
from bowden.plants.suit_parts import Suit
from bowden.rig.rig import Rig
from bowden.safety.faults import of
from bowden.safety.state import Mode, Observed, Request
from bowden.sim.one_run import run_of
from bowden.sim.run import simulate
from bowden.sim.suit_runs import suit_adaptive_integral, suit_ours
from releases import written_suit
from suit_wearers import worn_suit
from support.simulated_drive import SimulatedDrive
from test_off_reference import TIRED
from twelve_cables import LOGS
from wearers import PERIOD, random_wearer

TIME = 1.0
"""`off_reference_time` [s]."""
SUIT_PLAY = 20.0 * RADIANS
"""`play` as ``bowden init --suit`` writes it [rad]."""
BEGINS, LAST = (3.0, 4.0, 5.5, 7.5), 25.0
"""Of what is wrong, after the law has begun, and of a run that nothing stops [s]."""

Wrong = Callable[[float, float, float], float]
"""Joint's reading, that at the beginning, time since [rad, rad, s] → the reading [rad]."""
WRONG: dict[str, Wrong] = {
    "law gives up: its command stays": lambda joint, begun, time: joint,
    "limb is held": lambda joint, begun, time: begun + 1e-3 * np.sin(90.0 * time),
    "spool slips by 10°/s of the joint": lambda joint, begun, time: joint - 10.0 * RADIANS * time,
    "cable leaves its pulley: half of the slope after 1 s": lambda joint, begun, time: (
        (1.0 - 0.5 * min(time, 1.0)) * joint
    ),
    "joint's encoder drifts by 5°/s": lambda joint, begun, time: joint + 5.0 * RADIANS * time,
}


def other_bench(rig: Rig, number: int) -> Rig:
    """A bench that the rig's law is not told of: slope ±20 % where nobody has identified it, gap of 0.5–2 times, servo
    ±25 %, up to two more cycles of delay, and sheaths that move all the time."""
    random = np.random.default_rng([number, 77])
    sheath, servo, cable, bend = rig.sheath, rig.servo, rig.cable, rig.sheath.bend
    slope = float(random.uniform(0.8, 1.2))
    return rig.replace(
        sheath=sheath._replace(loss=float(random.uniform(0.0, 0.25)), gap=float(sheath.gap * random.uniform(0.5, 2.0))),
        servo=servo._replace(natural_frequency=float(servo.natural_frequency * random.uniform(0.8, 1.25))),
        cable=cable._replace(slope=slope * cable.slope) if isinstance(cable, BoucWen) else cable,
        delay=int(rig.delay + random.integers(0, 3)),
        bend=RandomBend(0.7 * bend, 1.6 * bend, float(random.uniform(2.0, 6.0))),
        seed=number,
        duration=40.0,
    )


def row(what: str, limit: float, errors: list[float]) -> str:
    """Of a table: the limit, the largest error that lasts, and the share that it is of the limit."""
    return f"| {what} | {limit * DEGREES:.1f}° | {max(errors) * DEGREES:.1f}° | {max(errors) / limit:.2f} |"


def benches(count: int) -> list[str]:
    """Every law on benches that it was not told of."""
    rows = []
    for name in LAWS:
        rig = Rig(law=name)
        law = rig.fitted()
        traces = [run_of(other_bench(rig, number), law) for number in range(count)]
        errors = [lasting_error(trace.error, rig.sample_time, TIME) for trace in traces]
        rows.append(row(f"`{name}`, {count} benches", off_reference(rig, law), errors))
    return rows


def cables(count: int) -> list[str]:
    """Laws on the recorded cables, in the rigs that ``bowden init`` makes of them."""
    rows = []
    made = [init(identify(log)).rig for log in sorted(LOGS.glob("*.csv.gz"))]
    for name in LAWS:
        found = []
        for own in made:
            rig = own.with_law(name)
            law = rig.fitted()
            errors = [run_of(other_bench(rig, number), law).error for number in range(count)]
            largest = max(lasting_error(error, rig.sample_time, TIME) for error in errors)
            found.append((off_reference(rig, law), largest))
        limit, largest = max(found, key=lambda pair: pair[1] / pair[0])
        rows.append(row(f"`{name}`, {len(made)} cables, {count} draws each", limit, [largest]))
    return rows


def wearers(count: int) -> list[str]:
    """Laws on the suit, on wearers that were not simulated."""
    rows, motion = [], PeriodicMinimumJerk(0.0, 90.0 * RADIANS, PERIOD)
    suits: list[tuple[str, Law, Suit]] = [
        ("`bowden`", suit_ours(), worn_suit()),
        ("`adaptive`", suit_adaptive_integral(), worn_suit()),
        ("`uncompensated`", LAWS["uncompensated"], worn_suit()),
        ("`uncompensated`, the paper's drive", LAWS["uncompensated"], suit()),
    ]
    for name, law, worn in suits:
        dt = worn.sample_time
        forecast = lasting_error(simulate(worn, law, motion, duration=2.0 * PERIOD).error, dt, TIME)
        errors = []
        for number in range(count):
            drawn = random_wearer(number, worn)
            found = simulate(drawn.suit, law, motion, duration=2.0 * PERIOD, bend=drawn.bend, seed=number)
            errors.append(lasting_error(found.error, dt, TIME))
        rows.append(row(f"{name}, {count} wearers of the suit", SUIT_PLAY + HALF_AGAIN * forecast, errors))
    return rows


def by_emg(count: int) -> list[str]:
    """Runs by EMG on wearers that were not simulated: contractions of 0.2 to 3 s with 0.2 to 6 s between them, so that
    motions are reversed half-way."""
    rows = []
    own = written_suit().with_emg("lsl:EMG")
    run, dt, seconds = own.emg_run, own.sample_time, 2.0 * PERIOD
    assert run is not None
    for name in ("bowden", "adaptive"):
        rig = own.with_law(name)
        law, errors = rig.fitted(), []
        for number in range(count):
            drawn, random = random_wearer(number, worn_suit()), np.random.default_rng([number, 78])
            edges = np.cumsum(random.uniform([0.2, 0.2], [6.0, 3.0], (200, 2)).ravel())
            active = (np.searchsorted(edges, np.arange(round(seconds / dt)) * dt) % 2).astype(float)
            motion = EmgMotion(run, active, np.zeros_like(active), active, dt)
            found = simulate(drawn.suit, law, motion, duration=seconds, bend=drawn.bend, seed=number)
            errors.append(lasting_error(found.error, dt, TIME))
        rows.append(row(f"`{name}`, {count} wearers of the suit by EMG", off_reference(rig, law), errors))
    return rows


def stopped(name: str, what: str, begins: float) -> tuple[float, str, float]:
    """Time from its beginning to R2 or R3 [s], by what, and how far the joint then was off the reference [rad]."""
    rig = Rig(law=name, duration=40.0)
    live = live_run(rig)
    law = TIRED.with_gains(last=round(begins / rig.sample_time)) if what.startswith("law") else live.law
    limits = live.limits._replace(off_reference=off_reference(rig, live.law))
    cycle, script = Cycle(law, limits, live.rig.filters, rig.sample_time), live.script()
    drive = SimulatedDrive(TwinBench(rig.bench, rig.bend_path, rig.duration, rig.seed, rig.start_motor, 0.0))
    cycle.begin(NOTHING_READ, cold(limits.thermal))
    mode, target, begun, led = Mode.STOPPED, cycle.state.supervisor.target, np.nan, 0
    for k in range(1, 100_000):
        reading: DriveReading = drive.read(k * cycle.period)
        true, since = reading.joint, led * cycle.period - begins
        if since >= 0.0:
            begun = true if np.isnan(begun) else begun
            reading = reading._replace(joint=WRONG[what](true, begun, since))
        ready = mode == Mode.PREFLIGHT and script.outcome == 1.0
        request = Request.ARM if k == 20 else Request.RUN if ready else Request.NONE
        plan = script.plan(mode, target, reading, 1)
        observed = Observed(reading, 0.0, cycle.period, request, 0.0, True, script.outcome, 0.0)
        _, verdict = cycle.step(observed, plan)
        mode, target = verdict.mode, verdict.target
        drive.write(target, Power(int(verdict.power)), k * cycle.period)
        led += plan.source >= WishSource.LAW_BEGINS
        if verdict.reaction >= 2.0:
            off = reading.joint - cycle.reference.position
            return since, ", ".join(f"`{fault.name}`" for fault in of(verdict.faults)), abs(off)
        if led * cycle.period > LAST:
            return np.inf, "nothing", abs(true - cycle.reference.position)
    raise AssertionError("the run came to no end")


def wrongs() -> list[str]:
    """What is wrong, and how soon it is stopped."""
    rows = []
    for what in WRONG:
        for name in ("uncompensated", "bowden"):
            found = [stopped(name, what, begins) for begins in BEGINS]
            times = ", ".join(f"{time:.1f}" for time, _, _ in found)
            causes = ", ".join(dict.fromkeys(cause for _, cause, _ in found))
            furthest = max(off for _, _, off in found) * DEGREES
            rows.append(f"| {what} | `{name}` | {times} s | {causes} | {furthest:.0f}° |")
    return rows


if __name__ == "__main__":
    draws = int(sys.argv[1]) if sys.argv[1:] else 40
    print("| in order | limit | largest error that lasts | share |\n|---|---|---|---|")
    for part in (benches, cables, wearers, by_emg):
        print("\n".join(part(draws)), flush=True)
    print("\n| wrong | law | R2 after | by | off by, at most |\n|---|---|---|---|---|")
    print("\n".join(wrongs()))
