"""Families found, trust given, clocks of two files aligned, and two moduli (c₁ ≠ c₂) found, on logs drawn at random.

python benchmarks/identify_trust.py families development 0 40
"""

import argparse
import math
import tempfile
import time as clock
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
from numpy.typing import NDArray

import bowden
from bowden.core.units import DEGREES, RADIANS
from bowden.identify.cable import generalised
from bowden.identify.cable.path import build_path
from bowden.identify.cable.turns import find_turns
from bowden.identify.log.align import aligned
from bowden.models.cable.bouc_wen import BoucWen, saturation
from bowden.models.cable.bouc_wen_sensitivity import hysteresis
from bowden.models.cable.generalised_play import Branches, joint_angle
from bowden.records.metrics import rmse
from kept import Kept

Array = NDArray[np.float64]

SETS = {"development": 1, "judging": 2}
"""Set → its key, which goes into every draw: no two sets share a seed."""
FAMILIES = ("play", "prandtl_ishlinskii", "bouc_wen", "bouc_wen_static", "generalised_play")
NODES = 401
WORSE = 1.05
"""Of the drawn family's error, up to which another one is as good."""
FAULTS = ("unit", "time", "held", "late", "drifting", "clipped", "noisy", "computed")


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


def motion(random: np.random.Generator, seconds: float, rate: float, faster: float = 1.0) -> tuple[Array, Array]:
    """Times [s], and a motor that goes back and forth by sines, of one amplitude or of several (n,) [rad].

    It becomes so many times `faster` over each tenth of the log: at one speed no log tells a delay from a wider loop.
    """
    time = np.arange(round(seconds * rate)) / rate
    half, frequency = float(random.uniform(20.0, 60.0)) * RADIANS, math.exp(random.uniform(*np.log([0.25, 0.6])))
    if seconds > 120.0:
        frequency = math.exp(random.uniform(*np.log([0.05, 0.6])))
    pace = 1.0 + (faster - 1.0) * np.abs(np.mod(10.0 * time / seconds, 2.0) - 1.0)
    phase = 2.0 * np.pi * (frequency * np.cumsum(pace) / rate + float(random.uniform()))
    swing = np.ones_like(time)
    if random.uniform() < 0.4:
        swing = 0.8 + 0.2 * np.sin(2.0 * np.pi * float(random.uniform(0.02, 0.08)) * time + random.uniform(0.0, 6.0))
    return time, float(random.uniform(-0.3, 0.3)) + half * swing * np.sin(phase)


def read(random: np.random.Generator, angle: Array) -> Array:
    """As an encoder reads it (n,) [rad]."""
    step = 2.0 * np.pi / 2.0 ** int(random.integers(12, 17))
    noise = float(random.uniform(0.2, 1.0)) * step + 0.002 * RADIANS
    return np.asarray(step * np.round((angle + noise * random.standard_normal(len(angle))) / step))


def family_row(set_name: str, number: int, most: float, longest: float = 7200.0) -> list[Any]:
    """What is found of the log of that number."""
    random = np.random.default_rng([33, SETS[set_name], number])
    family = FAMILIES[number % len(FAMILIES)]
    seconds = math.exp(random.uniform(*np.log([20.0, longest])))
    rate = float(
        random.choice([r for r in (20.0, 50.0, 100.0, 200.0, 500.0, 1000.0) if seconds * r < most or r == 20.0])
    )
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


def spoilt(
    random: np.random.Generator, kind: str, log: tuple[Array, Array, Array], height: float
) -> tuple[str, Array, Array, Array]:
    """The same log with a fault: the header of its file, and its columns. `height` is its loop's [rad]."""
    time, motor, joint = log
    head, rate = "time_s,motor_rad,joint_rad", 1.0 / float(time[1])
    fastest = float(np.quantile(np.abs(np.diff(joint)), 0.95)) * rate
    strength = float(random.uniform(0.5, 2.0))  # of what is lost, over the loop's height
    if kind == "unit":
        named = str(random.choice(["no name", "degrees as rad", "rad as degrees", "mm"]))
        if named == "no name":
            head, motor, joint = "time_s,motor,joint", motor * DEGREES, joint * DEGREES
        elif named == "degrees as rad":
            motor, joint = motor * DEGREES, joint * DEGREES
        elif named == "rad as degrees":
            head = "time_s,motor_deg,joint_deg"
        else:
            head, motor = "time_s,motor_mm,joint_rad", float(random.uniform(5.0, 40.0)) * motor
    elif kind == "time":
        head = str(random.choice(["time_ms,motor_rad,joint_rad", head]))
        time = time if head.startswith("time_ms") else 1e3 * time
    elif kind == "held":
        rows = max(2, round(strength * height / fastest * rate))
        gaps = rows + (random.integers(-(rows // 3), rows // 3 + 1, len(time)) if random.uniform() < 0.5 else 0)
        new = np.unique(np.minimum(np.cumsum(np.broadcast_to(gaps, len(time))), len(time) - 1))
        joint = joint[new[np.clip(np.searchsorted(new, np.arange(len(time)), "right") - 1, 0, None)]]
        joint = joint + float(random.choice([0.0, 0.02, 0.1])) * height * random.standard_normal(len(time))
    elif kind == "late":
        joint = np.interp(time - 0.5 * strength * height / fastest, time, joint)
    elif kind == "drifting":
        joint = joint + float(random.choice([-1.0, 1.0])) * strength * height * time / time[-1]
    elif kind == "clipped":
        cut = float(random.uniform(0.1, 0.3)) * float(np.ptp(joint))
        joint = np.minimum(joint, joint.max() - cut) if random.uniform() < 0.5 else np.maximum(joint, joint.min() + cut)
    elif kind == "noisy":
        joint = joint + 0.5 * strength * height * random.standard_normal(len(joint))
    elif kind == "computed":
        u = (motor - motor.mean()) / float(np.ptp(motor))
        bent = u + float(random.uniform(0.0, 0.4)) * u**2 + float(random.uniform(0.0, 0.4)) * u**3
        joint = read(random, float(np.ptp(joint)) * bent) if random.uniform() < 0.5 else float(np.ptp(joint)) * bent
    return head, time, motor, joint


def trust_rows(set_name: str, number: int) -> list[list[Any]]:
    """The level of a good log, and of the same one with a fault; the fault's loop over the good one's, and its why."""
    random = np.random.default_rng([34, SETS[set_name], number])
    seconds, rate = float(random.uniform(20.0, 90.0)), float(random.choice([50.0, 100.0, 200.0, 500.0]))
    family, kind = FAMILIES[number % len(FAMILIES)], FAULTS[number % len(FAULTS)]
    time, motor = motion(random, seconds, rate, 3.0 if kind == "late" else 1.0)
    joint = moved(random, family, motor)
    log = time, read(random, motor), read(random, joint)
    good = bowden.identify(*log, unit="rad")
    height = abs(good.chosen.loop.height) if good.chosen.loop else 0.0
    head, *columns = spoilt(random, kind, log, height)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "log.csv"
        np.savetxt(file, np.column_stack(columns), fmt="%.7f", delimiter=",", header=head, comments="")
        try:
            bad = bowden.identify(file)
            ratio = abs(bad.chosen.loop.height) / height if bad.chosen.loop else math.nan
            row = [bad.trust.level, round(ratio, 2), bad.trust.reasons[0][:90]]
        except bowden.BowdenError as error:
            row = ["refused", math.nan, str(error)[-90:]]
    return [
        [number, family, "good", good.trust.level, 1.0, good.trust.reasons[0][:90]],
        [number, family, kind, *row],
    ]


def clock_row(set_name: str, number: int) -> tuple[int, str, float]:
    """By how much [ms] the offset of two files' clocks is missed, which are 0.7 s and 50 ppm apart."""
    random = np.random.default_rng([37, SETS[set_name], number])
    seconds, family = float(random.uniform(15.0, 60.0)), FAMILIES[number % len(FAMILIES)]
    time, motor = motion(random, seconds, float(random.choice([200.0, 500.0, 1000.0])), 3.0)
    joint, step = moved(random, family, motor), 1.0 / float(random.choice([50.0, 100.0, 200.0]))
    at = np.arange(float(random.uniform(0.0, 1.0)), seconds - float(random.uniform(0.0, 1.0)), step)
    shown = (at - 0.7) * (1.0 - 50e-6)
    both = aligned((time, read(random, motor)), (shown, read(random, np.interp(at, time, joint))))
    found = float(both.said.split("stands ")[1].split(" ")[0])
    return number, family, 1e3 * (found - float(at[0] - shown[0]))


def moduli_row(set_name: str, number: int) -> list[Any]:
    """Errors on the second half, over that of the cable itself: of two straight branches, of free ones, of one line."""
    random = np.random.default_rng([38, SETS[set_name], number])
    time, motor = motion(random, float(random.uniform(20.0, 60.0)), float(random.choice([100.0, 200.0, 500.0])))
    low, high = float(motor.min()), float(motor.max())
    slope, offset = float(random.choice([-1.0, 1.0]) * random.uniform(0.6, 1.1)), float(random.uniform(-0.3, 0.3))
    gap = abs(slope) * float(random.uniform(0.02, 0.12)) * (high - low)
    opening = float(random.choice([-1.0, 1.0]) * random.uniform(0.2, 0.9))
    gaps, one = gap * (1.0 + opening * np.linspace(-1.0, 1.0, NODES)), np.ones(1)
    lag = float(random.uniform(-1.0, 1.0)) * gap
    cable = Branches(slope, 0.0 * gaps, gaps, low, high, one, one, offset, 0.0)
    seen, joint = read(random, motor), read(random, joint_angle(motor, lag, cable))
    fit = bowden.identify(time, seen, joint)
    own, play = fit.models["generalised_play"], fit.models["play"]
    with mock.patch.object(generalised, "_straightened", return_value=None):
        free = bowden.identify(time, seen, joint).models["generalised_play"]
    path = build_path(time, seen, joint, find_turns(seen), len(time))
    least = rmse((path.at(time, joint_angle(path.motor, lag, cable)) - joint)[fit.logs[0].split :])
    change = 2.0 * gap * abs(opening) / (0.5 * (high - low)) / abs(slope)
    errors = [round(one.test_rms / least, 3) for one in (own, free, play)]
    return [number, round(change, 3), fit.best.name, "gap_4" not in own.parameters, *errors]


def main() -> None:
    """The rows of a range of draws, and their count."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=["families", "trust", "clocks", "moduli"])
    parser.add_argument("set", choices=SETS)
    parser.add_argument("first", type=int)
    parser.add_argument("stop", type=int)
    parser.add_argument("--most", type=float, default=1e7, help="samples of a log at most")
    given = parser.parse_args()
    numbers = range(given.first, given.stop)
    if given.what == "families":
        kept = Kept(f"families-{given.set}-{given.first}-{given.most:g}")
        done = len(kept.rows())
        rows = kept.filled((family_row(given.set, n, given.most) for n in numbers[done:]), len(numbers))
        for row in rows:
            print("as good" if row[7] <= WORSE or row[1] == row[4] else "WORSE  ", *row)
        print(sum(row[7] <= WORSE or row[1] == row[4] for row in rows), "of", len(rows))
        return
    if given.what == "clocks":
        rows = [clock_row(given.set, number) for number in numbers]
        off = np.abs([row[2] for row in rows])
        print(
            *rows, f"median {np.median(off):.2f}, 95 % {np.quantile(off, 0.95):.2f}, most {max(off):.2f} ms", sep="\n"
        )
        return
    if given.what == "moduli":
        rows = [moduli_row(given.set, number) for number in numbers]
        print(*rows, f"straight branches in {sum(row[3] for row in rows)} of {len(rows)}", sep="\n")
        for name, column in (("two lines", 4), ("free", 5), ("one line", 6)):
            print(name, *(f"{part:.3f}" for part in np.quantile([row[column] for row in rows], (0.5, 0.95, 1.0))))
        return
    kept = Kept(f"trust-{given.set}-{given.first}")
    done = len(kept.rows()) // 2
    rows = kept.filled((row for n in numbers[done:] for row in trust_rows(given.set, n)), 2 * len(numbers))
    for row in sorted(rows, key=lambda one: (one[2], one[3])):
        print(*row)
    for kind in ("good", *FAULTS):
        levels = [row[3] for row in rows if row[2] == kind]
        print(kind, {level: levels.count(level) for level in sorted(set(levels))})


if __name__ == "__main__":
    main()
