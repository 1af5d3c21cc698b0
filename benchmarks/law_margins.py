"""How far our law's frozen loop is from instability: ``python benchmarks/law_margins.py``.

On 81 rigs of a grid; with ``--check``, on the 500 rigs that `bowden check` is judged on (`check_study.py`), on whose
cables' slopes nobody has told the law anything. See docs/background/our_law.md.

The law follows (no jump, no hold, κ whole), its innovation is far above the noise and its correction below its largest
speed, so that it is linear. Its matrices are read off the law's own kernels, one column a state, so that no equation
stands here a second time. What the law is told stays; what the rig really is, is changed.

Two loops are looked at:

- opened **at the command**: gain, phase and delay margin;
- opened **at the observer's step** ψ(x), the one place where the law is not linear. Noise, largest speed and a slower κ
  keep ψ(x)/x between 0 and its linear value, whenever they change, so that by the circle criterion the loop stays
  bounded where Re L(e^{jωTs}) > −1 at all frequencies. It suffices; a loop that misses it may still be bounded.
"""

import argparse
import itertools
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from typing import NamedTuple

import numpy as np
from scipy.linalg import expm

from bowden.control import LAWS
from bowden.control.knowledge import configured
from bowden.control.law_parts import Filtered, invert_servo
from bowden.control.our_law.gains import BowdenGains
from bowden.control.our_law.law import UNKNOWN_LAG
from bowden.control.our_law.observer import Observer, correct, derived_rates, propagate_correction
from bowden.control.stability import Array, StateSpace, frequencies, margins, response
from bowden.plants.knowledge_of import knowledge_of
from bowden.plants.presets.bench import default_bench
from check_study import COUNT, SEED
from study import random_rigs

FREQUENCIES, DAMPINGS = (15.0, 53.6, 120.0), (0.4, 1.0, 1.2)
"""Of the servos [rad/s, –]."""
SAMPLE_TIMES, DELAYS = (0.0005, 0.001, 0.004), (1, 3, 8)
"""[s], and in cycles."""
NOISE = 0.0002
"""Of the joint's reading, as on the paper's bench [rad]."""
ROUNDING = 1e-7
"""By which the pole of an integrator may seem to differ from one."""


class Told(NamedTuple):
    """A rig as the law believes it, and its true slope."""

    frequency: float
    damping: float
    dt: float
    delay: int
    noise: float = NOISE
    slope: float = 1.0
    """True one, over the one that the law is given [–]."""


class Change(NamedTuple):
    """By what the rig differs."""

    slope: float = 1.0
    """Factor on the slope."""
    servo: float = 1.0
    """Factor on ω."""
    cycles: int = 0
    """Delay more than told."""
    lag: float = 0.0
    """Of the joint behind the cable [s]."""
    told: float = 0.0
    """Of it, what the law knows [s]."""
    swing: float = 0.0
    """Frequency of a load that swings with a damping of 0.15; 0 for none [Hz]."""
    learned: float = 0.0
    """Of it, what the law has learned [Hz]."""


CHANGES = {
    "as told": (Change(),),
    "slope × 0.6": (Change(slope=0.6),),
    "slope × 1.3": (Change(slope=1.3),),
    "slope × 1.7": (Change(slope=1.7),),
    "servo −25 % or +25 %": (Change(servo=0.75), Change(servo=1.25)),
    "a cycle less or more": (Change(cycles=-1), Change(cycles=1)),
    "servo, cycle at once, slope × 1.3": tuple(
        Change(slope=1.3, servo=servo, cycles=cycles) for servo in (0.75, 1.25) for cycles in (-1, 1)
    ),
    "servo, cycle at once, slope × 1.7": tuple(
        Change(slope=1.7, servo=servo, cycles=cycles) for servo in (0.75, 1.25) for cycles in (-1, 1)
    ),
    "servo, cycle at once": tuple(Change(servo=servo, cycles=cycles) for servo in (0.75, 1.25) for cycles in (-1, 1)),
    "joint lags by 5 ms, untold": (Change(lag=0.005),),
    "by 10 ms, untold": (Change(lag=0.01),),
    "by 20 ms, untold": (Change(lag=0.02),),
    "by 50 ms, untold": (Change(lag=0.05),),
    "by 20 ms, told": (Change(lag=0.02, told=0.02),),
    "by 50 ms, told": (Change(lag=0.05, told=0.05),),
    "by 50 ms, told, slope × 1.3": (Change(slope=1.3, lag=0.05, told=0.05),),
    "load swings at 2 Hz": (Change(swing=2.0),),
    "load swings at 3 Hz": (Change(swing=3.0),),
    "load swings at 8 Hz": (Change(swing=8.0),),
    "at 3 Hz, learned": (Change(swing=3.0, learned=3.0),),
    "at 8 Hz, learned": (Change(swing=8.0, learned=8.0),),
    "at 3 Hz, learned as 2.6 Hz": (Change(swing=3.0, learned=2.6),),
    "at 8 Hz, learned as 7 Hz": (Change(swing=8.0, learned=7.0),),
    "at 8 Hz, learned as 9 Hz": (Change(swing=8.0, learned=9.0),),
}
"""What is looked at: a row of the table each; the worst of a row's changes counts."""

OF_CHECK = (
    *("as told", "slope × 1.3", "servo −25 % or +25 %", "a cycle less or more", "servo, cycle at once"),
    *("joint lags by 5 ms, untold", "by 20 ms, untold", "by 50 ms, untold", "at 3 Hz, learned as 2.6 Hz"),
)
"""What is looked at on the rigs of the check, whose slopes differ already."""


def grid() -> list[Told]:
    """All servos, clocks and delays with one another."""
    return list(itertools.starmap(Told, itertools.product(FREQUENCIES, DAMPINGS, SAMPLE_TIMES, DELAYS)))


def rigs_of_check(count: int) -> list[Told]:
    """The rigs of the study of `bowden check`, as our law would be told of them."""
    told = []
    for rig, _ in random_rigs(default_bench(), count, SEED):
        gains = configured(LAWS["bowden"], knowledge_of(rig)).gains
        servo = rig.servo
        told.append(
            Told(
                servo.natural_frequency,
                servo.damping,
                rig.sample_time,
                rig.delay,
                gains.noise,
                rig.cable.slope / gains.slope,
            )
        )
    return told


def law_model(told: Told, lag: float, learned: float, share: float = 1.0) -> StateSpace:
    """The frozen law from joint to minus command, for a lag [s], a load's frequency [Hz] and a share of κ.

    The motor misses nothing: the motions are small.
    """
    gains = BowdenGains(told.frequency, told.damping, (told.delay + 0.5) * told.dt, noise=told.noise, lag=lag)
    rates = derived_rates(gains, 1.0, told.dt)
    kappa = share * rates.kappa
    time = 1.0 / (2.0 * np.pi * learned) if learned else 0.0

    expected = lag + (0.0 if learned else UNKNOWN_LAG / told.frequency)

    def after(numbers: Array, joint: float) -> Array:
        before = Observer(*numbers.tolist())
        arrived = propagate_correction(before, 0.0, gains.delay, expected, time, np.inf, told.dt)
        seen = joint - arrived.position
        now, acceleration = correct(before, seen, 0.0, arrived, kappa, rates, 0.0, np.inf, told.dt)
        wanted = Filtered(now.sent, now.sent_rate, acceleration)
        return np.array([*now, -invert_servo(wanted, gains.servo_frequency, gains.servo_damping)])

    count = len(Observer._fields)
    columns = np.array([*(after(row, 0.0) for row in np.eye(count)), after(np.zeros(count), 1.0)]).T
    return StateSpace(columns[:-1, :-1], columns[:-1, -1:], columns[-1:, :-1], float(columns[-1, -1]))


def plant_model(told: Told, change: Change) -> StateSpace:
    """From the command to the joint: delay, servo, and a load that lags or swings, held over each cycle."""
    omega = told.frequency * change.servo
    a, b = np.array([[0.0, 1.0], [-omega * omega, -2.0 * told.damping * omega]]), np.array([[0.0], [omega * omega]])
    c = np.array([[told.slope * change.slope, 0.0]])
    if change.lag > 0.0:
        a = np.block([[a, np.zeros((2, 1))], [c / change.lag, np.array([[-1.0 / change.lag]])]])
        b, c = np.vstack([b, [[0.0]]]), np.array([[0.0, 0.0, 1.0]])
    if change.swing > 0.0:
        own = 2.0 * np.pi * change.swing
        load = np.array([[0.0, 1.0], [-own * own, -0.3 * own]])
        a = np.block([[a, np.zeros((2, 2))], [np.vstack([np.zeros((1, 2)), own * own * c]), load]])
        b, c = np.vstack([b, [[0.0], [0.0]]]), np.array([[0.0, 0.0, 1.0, 0.0]])
    size, delay = len(a), max(told.delay + change.cycles, 0)
    held = expm(np.block([[a, b], [np.zeros((1, size + 1))]]) * told.dt)
    whole, into = np.zeros((size + delay, size + delay)), np.zeros((size + delay, 1))
    whole[:size, :size] = held[:size, :size]
    if delay:
        whole[:size, size] = held[:size, size]
        whole[np.arange(size, size + delay - 1), np.arange(size + 1, size + delay)] = 1.0
        into[-1, 0] = 1.0
    else:
        into[:size, 0] = held[:size, size]
    return StateSpace(whole, into, np.hstack([c, np.zeros((1, delay))]), 0.0)


def closed(plant: StateSpace, law: StateSpace) -> Array:
    """Matrix of the closed loop."""
    top = np.hstack([plant.a - plant.b @ plant.c * law.d, -plant.b @ law.c])
    return np.vstack([top, np.hstack([law.b @ plant.c, law.a])])


def meets_circle_criterion(plant: StateSpace, law: StateSpace, still: StateSpace, dt: float) -> bool:
    """Whether the loop is bounded for every ψ(x)/x between 0 and its linear value.

    The closed loop differs from the one whose correction stands still by one product u·w, and
    1 + L = det(zI − A)/det(zI − A₀).
    """
    without = closed(plant, still)
    left, sizes, right = np.linalg.svd(closed(plant, law) - without)
    step = StateSpace(without, left[:, :1] * sizes[0], -right[:1], 0.0)
    poles = np.sort(np.abs(np.linalg.eigvals(without)))
    if poles[-1] > 1.0 + ROUNDING or poles[-2] >= 1.0:  # one integrator, all else stable
        return False
    return bool(np.min(response(step, frequencies(dt), dt).real) > -1.0)


def growth(plant: StateSpace, law: StateSpace, dt: float) -> float:
    """By what the swing that grows most grows in half a period: at most 1 where the loop is stable [–]."""
    poles = np.linalg.eigvals(closed(plant, law))
    poles = poles[poles.imag > ROUNDING]
    return float(np.max(np.exp(np.pi * np.log(np.abs(poles)) / np.angle(poles)), initial=0.0))


@dataclass(frozen=True)
class Row:
    """What was found over all rigs; margins are those of the rigs that are stable."""

    change: str
    stable: float
    """Share [–]."""
    bounded: float
    """Share that meets the circle criterion [–]."""
    gain_db: float | None
    """Least gain margin [dB]."""
    phase_deg: float | None
    """Least phase margin [deg]."""
    delay_cycles: float | None
    """Least delay margin [–]."""
    median_db: float | None
    median_deg: float | None
    growth: float
    """Largest growth of a swing in half a period, over all rigs [–]."""


def row(name: str, changes: tuple[Change, ...], rigs: Sequence[Told]) -> Row:
    """Every rig under the worst of the changes."""
    stable, bounded, gains, phases, delays, grown = [], [], [], [], [], []
    for told in rigs:
        found, circles = [], []
        for change in changes:
            plant, law = plant_model(told, change), law_model(told, change.told, change.learned)
            found.append(margins(plant, law, told.dt))
            grown.append(growth(plant, law, told.dt))
            circles.append(
                meets_circle_criterion(plant, law, law_model(told, change.told, change.learned, 0.0), told.dt)
            )
        stable.append(all(m.stable for m in found))
        bounded.append(all(circles))
        if stable[-1]:
            gains.append(min(m.gain_margin_db or np.inf for m in found))
            phases.append(min(m.phase_margin_deg or np.inf for m in found))
            delays.append(min(m.delay_margin_s or np.inf for m in found) / told.dt)
    if not gains:
        return Row(name, 0.0, 0.0, None, None, None, None, None, max(grown))
    middle = (float(np.median(gains)), float(np.median(phases)))
    least = (float(min(gains)), float(min(phases)), float(min(delays)))
    return Row(name, float(np.mean(stable)), float(np.mean(bounded)), *least, *middle, max(grown))


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--json", action="store_true", help="one JSON document, nothing else")
    parser.add_argument("--check", action="store_true", help="the rigs that `bowden check` is judged on")
    parser.add_argument("--count", type=int, default=COUNT, help="of them, for a try")
    asked = parser.parse_args()
    rigs = rigs_of_check(asked.count) if asked.check else grid()
    rows = [row(name, changes, rigs) for name, changes in CHANGES.items() if not asked.check or name in OF_CHECK]
    if asked.json:
        print(json.dumps([asdict(one) for one in rows]))
        return
    print(
        "| the rig beside what was told | stable | circle criterion | least margins: gain, phase, delay | medians | "
        "most growth in a half-wave |"
    )
    print("|---|---|---|---|---|---|")
    for one in rows:
        least = medians = "–"
        if one.gain_db is not None:
            least = f"{one.gain_db:.1f} dB, {one.phase_deg:.0f}°, {one.delay_cycles:.1f} cycles"
            medians = f"{one.median_db:.1f} dB, {one.median_deg:.0f}°"
        print(f"| {one.change} | {one.stable:.0%} | {one.bounded:.0%} | {least} | {medians} | {one.growth:.2f} |")


if __name__ == "__main__":
    main()
