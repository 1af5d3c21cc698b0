"""Rigs round random cables: made by `init`, judged as `check` does it, run for some seconds on the twin, and ended.

Each is drawn from its number: a cable of any slope, play, direction and zeros, or a suit, and a sample time. Loop,
preflight and supervisor are those of a live run, on a clock of their own.
"""

import math
import sys
from collections import Counter
from collections.abc import Mapping
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.errors import BowdenError
from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import Cycle
from bowden.design.forecast import foreseen, off_reference, own_run
from bowden.design.objections import objections
from bowden.design.verdict import chosen_law, verdicts
from bowden.hardware.ports import Power
from bowden.hardware.twin.of_rig import twin_plant_of
from bowden.live.live_run import live_run
from bowden.live.preflight import REASONS, Reason, require
from bowden.live.row import NOTHING_READ
from bowden.models.cable.bouc_wen import BoucWen, saturation
from bowden.models.drive.thermal import cold
from bowden.operations.init import init
from bowden.plants.counting import Covered
from bowden.plants.identified import IdentifiedCable
from bowden.plants.suit_settings import SuitSettings
from bowden.plants.worn_suit import elbow_dead_zone
from bowden.rig.rig import Rig
from bowden.safety.faults import of
from bowden.safety.state import Mode, Observed, Request
from releases import written_suit

sys.path.append(str(Path(__file__).parents[1] / "tests"))  # where the simulated drive is

from support.simulated_drive import SimulatedDrive

COUNT = 1000
SECONDS = 5.0
"""Of the run, after the way to its beginning."""
LONGEST = 120.0
"""A run that has not ended by then does not end [s]."""
ARMED = 100
"""Cycle in which it is armed."""
SAMPLE_TIMES = (1e-3, 2e-3, 5e-3, 10e-3, 20e-3)
SUITS, BY_HAND = 0.15, 0.25
"""Share of the rigs that are suits, and of suits and others that `init` has not made round an identified cable."""


def cable(random: np.random.Generator, *, suit: bool = False) -> IdentifiedCable:
    """What an identification of a pure play says, with the motion of its log in the log's own angles.

    For a suit, play and motion are of its straight elbow, whatever its log's joint was: there they are those of the
    motor, whose spool is the suit's.
    """
    slope = math.exp(random.uniform(math.log(0.02), math.log(50.0)))
    elbow = slope / elbow_dead_zone(0.5 * SuitSettings().spool_radius) if suit else 1.0
    lost = math.exp(random.uniform(math.log(0.1), math.log(20.0))) * RADIANS * elbow  # of the joint, at a reversal
    span = random.uniform(40.0, 90.0) * RADIANS * elbow
    direction = 1.0 if random.random() < 0.5 else -1.0
    low = random.choice([0.0, -0.5 * span, random.uniform(-200.0, 200.0) * RADIANS])
    middle = random.choice([0.5 * (span + lost) / slope, 0.0, random.uniform(-20.0, 20.0)])
    half = 0.5 * (span + lost) / slope
    offset = low + 0.5 * span - direction * slope * middle
    usual = BoucWen()
    bouc_wen = {
        "slope": direction * slope,
        "offset": offset,
        "hysteresis_gain": -direction * 0.5 * lost / saturation(usual),
        "rate": 4.0 * slope / lost * saturation(usual),
        "shape": usual.shape,
        "exponent": usual.exponent,
        "initial_h": 0.0,
    }
    play = {"slope": direction * slope, "offset": offset, "half_width": 0.5 * lost / slope, "initial_lag": 0.0}
    covered = Covered(middle - half, middle + half, low, low + span)
    return IdentifiedCable("play", {"play": play, "bouc_wen": bouc_wen}, covered=covered)


def by_hand(random: np.random.Generator) -> dict[str, Any]:
    """Parts of a rig whose cable is written by hand, and whose joint has its zero anywhere in its range."""
    slope = math.exp(random.uniform(math.log(0.02), math.log(50.0)))
    lost = math.exp(random.uniform(math.log(0.1), math.log(20.0))) * RADIANS
    low, span = random.uniform(-70.0, 20.0) * RADIANS, random.uniform(30.0, 70.0) * RADIANS
    usual, bench = BoucWen(), Rig()
    gain = -0.5 * lost / saturation(usual)
    return {
        "cable": BoucWen(slope, gain, random.uniform(0.2, 0.9) * slope / abs(gain), usual.shape, usual.exponent),
        "motor": bench.motor._replace(gear=bench.motor.gear * max(1.0, slope / bench.slope)),
        "reference": PeriodicMinimumJerk(low, low + span, random.uniform(6.0, 12.0)),
        "limits": {"joint_low": low - 0.3, "joint_high": low + span + 0.3},
    }


def drawn(number: int) -> tuple[str, Any, float]:
    """Kind, what of it is drawn, and sample time of that number."""
    random = np.random.default_rng(number)
    dt = float(random.choice(SAMPLE_TIMES))
    if random.random() < SUITS:
        motion = PeriodicMinimumJerk(0.0, random.uniform(30.0, 75.0) * RADIANS, random.uniform(6.0, 12.0))
        return (
            ("suit", motion, dt)
            if random.random() < BY_HAND
            else ("suit of a log", (cable(random, suit=True), motion), dt)
        )
    if random.random() < BY_HAND:
        return "by hand", by_hand(random), dt
    return "bench", cable(random), dt


def numbers(counts: Mapping[float, int]) -> list[int]:
    """The first numbers with these sample times, so many of each."""
    return [n for dt, count in counts.items() for n in islice((n for n in range(COUNT) if drawn(n)[2] == dt), count)]


def rig_of(number: int) -> Rig:
    """The rig of that number.

    Raises:
        BowdenError: none can be made.
    """
    kind, given, dt = drawn(number)
    if kind == "suit":
        return written_suit().replace(sample_time=dt, reference=given, duration=SECONDS)
    if kind == "suit of a log":
        model, motion = given
        return init(model, suit=True, sample_time=dt).rig.replace(reference=motion, duration=SECONDS)
    if kind == "by hand":
        rig = Rig(**given, sample_time=dt, duration=SECONDS)
        chosen = chosen_law(rig)
        return rig.with_law(chosen.law).replace(gains=chosen.gains)
    return init(given, sample_time=dt).rig.replace(duration=SECONDS)


def outcome(number: int) -> str:
    """What is wrong with the rig of that number or its run; empty if nothing is."""
    try:
        rig = rig_of(number)
        return run(rig)
    except BowdenError as error:
        return f"refused: {error}"


def run(rig: Rig) -> str:
    """How a run of a rig ends, where that is not as it should; empty otherwise.

    Raises:
        BowdenError: it is refused.
    """
    if found := objections(rig):
        return f"objected: {'; '.join(found)}"
    live = live_run(rig)
    (joint,) = rig.each_joint
    verdict = verdicts(joint, [(live.law,)], "rig.toml", force=True)[0]
    own = own_run(rig, live.law)
    if said := foreseen(rig, live.law, own):
        return f"objected: {said}"
    require(live.limits, rig.sample_time, verdict.name or "holds", opposed=live.opposed)
    live = live.following([off_reference(rig, live.law, own)])
    cycle, script = live.cycle(), live.script()
    drive = SimulatedDrive(twin_plant_of(rig, 0.0))
    cycle.begin(NOTHING_READ, cold(live.limits.thermal))
    return _run(cycle, script, drive, live.push())


def _run(cycle: Cycle, script: Any, drive: SimulatedDrive, push: Any) -> str:
    mode, target = Mode.STOPPED, cycle.state.supervisor.target
    asked_to_end = False
    for k in range(1, round(LONGEST / cycle.period)):
        now = k * cycle.period
        reading = drive.read(now)
        request = Request.ARM if k == ARMED else Request.NONE
        if mode == Mode.PREFLIGHT and script.outcome == 1.0:
            request = Request.RUN
        elif script.done and mode == Mode.RUNNING:
            request, asked_to_end = Request.STOP, True
        plan = script.plan(mode, target, reading, 1)
        observed = Observed(reading, 0.0, cycle.period, request, 0.0, True, script.outcome, 0.0)
        _, verdict = cycle.step(observed, plan)
        mode, target = verdict.mode, verdict.target
        torque = 0.0 if push is None else push.step(target, verdict, cycle.period)
        drive.write(target, Power(int(verdict.power)), now, torque)
        if verdict.faults and k > ARMED:
            faults = ", ".join(fault.name for fault in of(verdict.faults))
            why = REASONS[Reason(int(script.reason))] if script.reason else ""
            return f"fault: {faults} {'at the end' if asked_to_end else f'in {Mode(int(mode)).name}'} {why}".strip()
        if asked_to_end and mode == Mode.STOPPED:
            return ""
    return "the run does not end"


def main(first: int, stop: int) -> None:
    """Print how many rigs of a range of numbers pass, and what is wrong with each of the others."""
    found = {number: outcome(number) for number in range(first, stop)}
    wrong = {number: why for number, why in found.items() if why}
    for number, why in wrong.items():
        print(number, drawn(number)[0], why[:300])
    print(Counter(why[:45] for why in wrong.values()).most_common())
    print(f"{len(found) - len(wrong)} of {len(found)} pass")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
