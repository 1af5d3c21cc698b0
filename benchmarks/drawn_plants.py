"""Random plants that nobody tuned for, and what a law makes of them.

Each plant is drawn from its number alone: a servo of 2–20 Hz and damping 0.5–1.2, of which the law knows the frequency
to ± 20 %, a delay of 0–3 cycles, a cable whose slope drifts within 0.6–1.2 and whose dead zone within 0–15° in 5–60 s,
encoders of 0.02–0.2°, a load that lags by up to 30 ms.
"""

import math
from collections.abc import Iterable, Iterator
from itertools import tee
from typing import NamedTuple

import numpy as np

from bowden.control.knowledge import Knowledge, informed
from bowden.control.law import Law
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.units import DEGREES, RADIANS
from bowden.models.cable.bouc_wen import BoucWen, saturation
from bowden.models.cable.sheath import Sheath
from bowden.models.cable.sheath_path import BendPath, scripted_bend
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.servo import Servo
from bowden.plants.cable_plant import CablePlant
from bowden.plants.cables import bouc_wen
from bowden.sim.many import Case, simulate_many


class RandomPlant(NamedTuple):
    """A drawn plant, how its sheath moves, what it is asked to do, and what the law is told of its servo."""

    plant: CablePlant
    bend: BendPath
    reference: PeriodicMinimumJerk
    servo_frequency: float
    """What the law believes [rad/s]."""
    delay: float
    """From a sample to the middle of the time for which its command is held [s]."""


class Outcome(NamedTuple):
    """What came of one run."""

    number: int
    stable: bool
    rmse_deg: float
    """NaN of a run that ran away."""
    peak_deg: float


def random_plant(number: int, duration: float) -> RandomPlant:
    """The plant of that number, for a run of `duration` [s]."""
    random = np.random.default_rng(number)
    frequency = 2.0 * math.pi * math.exp(random.uniform(math.log(2.0), math.log(20.0)))
    delay, resolution = int(random.integers(0, 4)), random.uniform(0.02, 0.2) * RADIANS
    monotone = random.uniform(0.3, 1.0)  # αh·ρ over αφ; the printed cable has 1.27
    printed = BoucWen()
    rate = printed.rate if random.integers(0, 2) else monotone * printed.slope / abs(printed.hysteresis_gain)
    dead_zones = np.sort(random.uniform(0.0, 15.0, 2)) * RADIANS
    slopes = random.permutation(np.sort(random.uniform(0.6, 1.2, 2)))
    # the bend runs from 1 to 2; slope and dead zone at both ends are the ones drawn
    cable = printed._replace(slope=float(slopes[0]), rate=rate)
    height = 2.0 * abs(printed.hysteresis_gain) * float(saturation(printed)) / cable.slope
    share = max(float(dead_zones[1] / max(dead_zones[0], 1e-3)), 1.0 + 1e-6)
    top = min(share, 50.0)
    sheath = Sheath(
        bend=1.0,
        gap=float(dead_zones[1]) / top / height,
        loss=(1.0 - float(slopes[1] / slopes[0])) / (top - 1.0 + 1e-9),
    )
    times, bends = [0.0], [random.uniform(1.0, top)]
    while times[-1] < duration:
        times.append(times[-1] + random.uniform(5.0, 60.0))
        bends.append(random.uniform(1.0, top))
    period = math.exp(random.uniform(math.log(2.0 if frequency > 20.0 else 4.0), math.log(25.0)))
    encoder = Encoder(resolution, resolution / 3.0)
    plant = CablePlant(
        cable=bouc_wen(cable),
        sheath=sheath,
        servo=Servo(frequency, random.uniform(0.5, 1.2), speed_limit=100.0),
        joint_encoder=encoder,
        motor_encoder=encoder,
        delay=delay,
        load_lag=random.uniform(0.0, 0.03),
    )
    return RandomPlant(
        plant=plant,
        bend=scripted_bend(times, bends),
        reference=PeriodicMinimumJerk(0.0, random.uniform(20.0, 90.0) * RADIANS, period),
        servo_frequency=frequency * random.uniform(0.8, 1.2),
        delay=(delay + 0.5) * 1e-3,
    )


def run_random_plants(law: Law, numbers: Iterable[int], duration: float = 40.0) -> Iterator[Outcome]:
    """One run of a law on each of these plants; it knows the servo's frequency and the delay only."""
    numbers, again = tee(numbers)
    cases = (_case(law, number, duration) for number in again)
    for number, (found,) in zip(numbers, simulate_many(cases, duration), strict=True):
        if found.ended:
            yield Outcome(number, True, found.rmse * DEGREES, found.peak * DEGREES)
        else:
            yield Outcome(number, False, math.nan, math.nan)


def run_random_plant(law: Law, number: int, duration: float = 40.0) -> Outcome:
    """`run_random_plants` for one of them."""
    return next(run_random_plants(law, [number], duration))


def _case(law: Law, number: int, duration: float) -> Case:
    drawn = random_plant(number, duration)
    informed_law = informed(law, Knowledge(servo_frequency=drawn.servo_frequency, delay=drawn.delay))
    return Case(drawn.plant, (informed_law,), drawn.reference, drawn.bend, number, 0.0)
