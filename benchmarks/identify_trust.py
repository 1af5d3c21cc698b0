"""Families found, and trust given, on logs drawn at random.

python benchmarks/identify_trust.py families development 0 40
"""

import argparse
import math
import time as clock
from typing import Any

import numpy as np
from numpy.typing import NDArray

import bowden
from bowden.core.units import DEGREES, RADIANS
from bowden.models.cable.bouc_wen import BoucWen, saturation
from bowden.models.cable.bouc_wen_sensitivity import hysteresis
from bowden.models.cable.generalised_play import Branches, joint_angle

Array = NDArray[np.float64]

SETS = {"development": 1, "judging": 2}
FAMILIES = ("play", "prandtl_ishlinskii", "bouc_wen", "bouc_wen_static", "generalised_play")
NODES = 401


def moved(random: np.random.Generator, family: str, motor: Array) -> Array:
    """The joint of a cable of that family, drawn, along a motion (n,) [rad]."""
    low, high = float(motor.min()), float(motor.max())
    slope, offset = float(random.choice([-1.0, 1.0]) * random.uniform(0.6, 1.1)), float(random.uniform(-0.3, 0.3))
    width = float(random.uniform(0.02, 0.12)) * (high - low)
    bends, gaps = np.zeros(NODES), np.full(NODES, abs(slope) * width)
    u = np.linspace(-1.0, 1.0, NODES)
    if family in ("bouc_wen_static", "generalised_play"):
        shapes = [random.normal() / k**2 * np.polynomial.chebyshev.Chebyshev.basis(k)(u) for k in range(2, 5)]
        bends = np.asarray(sum(shapes))
        steepest = float(np.abs(np.diff(bends)).max()) * (NODES - 1) / (high - low)
        bends *= float(random.uniform(0.2, 0.4)) * abs(slope) / steepest
    if family.startswith("bouc_wen"):
        shape, exponent = float(random.uniform(0.7, 3.0)), float(random.uniform(1.0, 4.0))
        cable = BoucWen(slope=slope, hysteresis_gain=1.0, rate=1.0, shape=shape, exponent=exponent, offset=offset)
        bound = float(saturation(cable))
        cable = cable._replace(rate=float(random.uniform(0.4, 0.95)) * bound / width)
        h = hysteresis(motor, float(random.uniform(-1.0, 1.0)) * bound, cable) / bound
        mean = slope * motor + offset + np.interp(motor, np.linspace(low, high, NODES), bends)
        return np.asarray(mean - np.sign(slope) * gaps[0] * h)
    if family == "generalised_play":
        gaps = gaps * (1.0 + float(random.uniform(0.1, 0.4)) * np.cos(0.5 * np.pi * (u + 1.0) + random.uniform(0, 6)))
    count = 1 if family == "play" else 4
    shares = random.dirichlet([2.0] * count)
    reaches = np.sort(random.uniform(0.3, 1.7, count)) if count > 1 else np.ones(1)
    reaches = reaches / float(shares @ reaches)
    lag = float(random.uniform(-1.0, 1.0)) * width
    return joint_angle(motor, lag, Branches(slope, bends, gaps, low, high, reaches, shares, offset, 0.0))


def motion(random: np.random.Generator, seconds: float, rate: float) -> tuple[Array, Array]:
    """Times [s], and a motor that goes back and forth by sines, of one amplitude or of several (n,) [rad]."""
    time = np.arange(round(seconds * rate)) / rate
    half, frequency = float(random.uniform(20.0, 60.0)) * RADIANS, math.exp(random.uniform(*np.log([0.25, 0.6])))
    if seconds > 120.0:
        frequency = math.exp(random.uniform(*np.log([0.05, 0.6])))
    phase = 2.0 * np.pi * (frequency * time + float(random.uniform()))
    swing = np.ones_like(time)
    if random.uniform() < 0.4:
        swing = 0.8 + 0.2 * np.sin(2.0 * np.pi * float(random.uniform(0.02, 0.08)) * time + random.uniform(0.0, 6.0))
    return time, float(random.uniform(-0.3, 0.3)) + half * swing * np.sin(phase)


def read(random: np.random.Generator, angle: Array) -> Array:
    """As an encoder reads it (n,) [rad]."""
    step = 2.0 * np.pi / 2.0 ** int(random.integers(12, 17))
    noise = float(random.uniform(0.2, 1.0)) * step + 0.002 * RADIANS
    return np.asarray(step * np.round((angle + noise * random.standard_normal(len(angle))) / step))


def family_row(set_name: str, number: int, most: float) -> list[Any]:
    """What is found of the log of that number."""
    random = np.random.default_rng([33, SETS[set_name], number])
    family = FAMILIES[number % len(FAMILIES)]
    seconds = math.exp(random.uniform(*np.log([20.0, 7200.0])))
    rate = float(random.choice([r for r in (50.0, 100.0, 200.0, 500.0, 1000.0) if seconds * r < most or r == 50.0]))
    time, motor = motion(random, seconds, rate)
    joint = moved(random, family, motor)
    motor, joint = read(random, motor), read(random, joint)
    begun = clock.process_time()
    fit = bowden.identify(time, motor, joint)
    own = fit.models[family].test_rms
    return [
        number,
        family,
        round(seconds),
        rate,
        fit.best.name,
        round(fit.chosen.test_rms * DEGREES, 4),
        round(own * DEGREES, 4),
        round(fit.chosen.test_rms / own, 3),
        fit.trust.level,
        round(clock.process_time() - begun, 1),
        fit.cycles.whole,
    ]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what")
    parser.add_argument("set", choices=SETS)
    parser.add_argument("first", type=int)
    parser.add_argument("stop", type=int)
    parser.add_argument("--most", type=float, default=1e7)
    given = parser.parse_args()
    for number in range(given.first, given.stop):
        row = family_row(given.set, number, given.most)
        print("OK " if row[7] <= 1.05 or row[1] == row[4] else "BAD", *row, flush=True)


if __name__ == "__main__":
    main()
