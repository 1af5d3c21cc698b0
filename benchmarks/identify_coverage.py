"""How often two stated standard deviations hold the true value: identification of logs of cables drawn at random.

A drawn cable is the mean of its two branches, half the distance between them, and a memory that says how the joint goes
over from one to the other (one play, a stack of plays, or Bouc–Wen's h):

    joint = a(motor) + b(motor)·memory,   −1 ≤ memory ≤ 1

a is a line, perhaps bent, b constant or not. The loop has a true slope, offset, height and curve, whatever the family
that is fitted; parameters have true values where the drawn cable is of their family. Half of the logs wander from
stroke to stroke, as recordings of cables do.

    python benchmarks/identify_coverage.py development 0 100
"""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple
from unittest import mock

import numpy as np
from numpy.typing import NDArray

import bowden
from bowden.core.units import RADIANS
from bowden.identify.cable import fit as fitting
from bowden.identify.cable.loop import HysteresisLoop, loop_of
from bowden.identify.cable.path import Path
from bowden.models.cable.bouc_wen import BoucWen, saturation
from bowden.models.cable.bouc_wen_sensitivity import hysteresis
from bowden.models.cable.generalised_play import Branches, joint_angle
from drawn_logs import SETS, asked

Array = NDArray[np.float64]

RATE, SECONDS = 500.0, 20.0
"""Of a log [Hz, s]."""
FINE = 401
"""Nodes of a drawn branch."""


class Drawn(NamedTuple):
    """A log and the cable that made it."""

    kind: str
    wandering: bool
    """Whether its strokes lie beside one another."""
    time: Array
    motor: Array
    joint: Array
    """As the encoders read them (n,) [rad]."""
    clean: Array
    """The joint without noise, counts and wandering (n,) [rad]."""
    mean: Callable[[Array], Array]
    """a, of a motor angle [rad]."""
    gap: Callable[[Array], Array]
    """b, of a motor angle [rad]."""
    parameters: dict[str, dict[str, float]]
    """Family → its true parameters, where the cable is one of it."""


def draw(set_name: str, number: int) -> Drawn:
    """The log of that number in that set."""
    random = np.random.default_rng([18, SETS[set_name], number])
    memory = str(random.choice(["play", "stack", "bouc_wen"]))
    bend = str(random.choice(["straight", "bent", "rippled"]))
    even = bool(random.uniform() < 0.5) or bend == "straight"
    slope = float(random.choice([-1.0, 1.0]) * random.uniform(0.6, 1.1))
    offset, half = float(random.uniform(-0.3, 0.3)), float(random.uniform(20.0, 60.0)) * RADIANS
    centre = float(random.uniform(-0.3, 0.3))
    width = min(math.exp(random.uniform(math.log(1.0), math.log(6.0))) * RADIANS, 0.15 * half)
    time = np.arange(int(RATE * SECONDS)) / RATE
    phase = 2.0 * np.pi * (float(random.uniform(0.1, 0.6)) * time + float(random.uniform()))
    swing = np.ones_like(time)
    if random.uniform() < 0.4:
        swing = 0.8 + 0.2 * np.sin(2.0 * np.pi * float(random.uniform(0.02, 0.08)) * time + random.uniform(0.0, 6.0))
    motor = centre + half * swing * np.sin(phase)
    low, high = float(motor.min()), float(motor.max())
    place = np.linspace(low, high, FINE)
    bends = _bends(random, bend, np.linspace(-1.0, 1.0, FINE), slope, high - low)
    gaps = np.full(FINE, abs(slope) * width)
    if not even:
        gaps = gaps * (
            1.0 + float(random.uniform(0.1, 0.4)) * np.cos(np.linspace(0.0, np.pi, FINE) + random.uniform(0, 6))
        )

    def mean(at: Array) -> Array:
        return np.asarray(slope * at + offset + np.interp(at, place, bends))

    def gap(at: Array) -> Array:
        return np.asarray(np.interp(at, place, gaps))

    found: dict[str, dict[str, float]] = {}
    if memory == "bouc_wen":
        cable = BoucWen(slope=slope, hysteresis_gain=1.0, rate=1.0, shape=1.0, exponent=1.0, offset=offset)
        shape, exponent = float(random.uniform(0.7, 3.0)), float(random.uniform(1.0, 4.0))
        cable = cable._replace(shape=shape, exponent=exponent)
        bound = float(saturation(cable))
        steep = float(random.uniform(0.4, 0.95))  # share of the slope that h takes at h = 0
        cable = cable._replace(rate=steep * bound / width)
        start = float(random.uniform(-1.0, 1.0)) * bound
        h = hysteresis(motor, start, cable) / bound
        clean = mean(motor) - np.sign(slope) * gap(motor) * h
        if bend == "straight":
            gain = -slope * width / bound
            found["bouc_wen"] = dict(cable._replace(hysteresis_gain=gain)._asdict()) | {"initial_h": start}
    else:
        count = 1 if memory == "play" else 4
        shares = random.dirichlet([2.0] * count)
        reaches = np.sort(random.uniform(0.3, 1.7, count)) if count > 1 else np.ones(1)
        reaches = reaches / float(shares @ reaches)
        cable_of = Branches(slope, bends, gaps, low, high, reaches, shares, offset, 0.0)
        lag = float(random.uniform(-1.0, 1.0)) * width
        clean = joint_angle(motor, lag, cable_of)
        if bend == "straight" and memory == "play":
            found["play"] = {"slope": slope, "half_width": width, "offset": offset, "initial_lag": lag}
        if bend == "straight" and memory == "stack":
            found["prandtl_ishlinskii"] = {"offset": offset}
    joint, wandering = clean, bool(random.uniform() < 0.5)
    if wandering:
        turns = np.flatnonzero(np.diff(np.sign(np.diff(motor))) != 0) + 1
        at = np.concatenate([[0.0], time[turns], [time[-1]]])
        joint = joint + np.interp(
            time, at, float(random.uniform(0.01, 0.05)) * RADIANS * random.standard_normal(len(at))
        )
    step = 2.0 * np.pi / 2.0 ** int(random.integers(12, 17))
    noise = float(random.uniform(0.2, 1.0)) * step + 0.002 * RADIANS
    seen = [step * np.round((one + noise * random.standard_normal(len(one))) / step) for one in (motor, joint)]
    kind = f"{memory}, {bend}, {'even' if even else 'uneven'}{', wandering' * wandering}"
    return Drawn(kind, wandering, time, seen[0], seen[1], clean, mean, gap, found)


def _bends(random: np.random.Generator, kind: str, u: Array, slope: float, span: float) -> Array:
    """How far the mean lies from its line (n,) [rad], at places −1 … 1; it stays clear of running backwards."""
    if kind == "straight":
        return np.zeros_like(u)
    if kind == "bent":
        bends = sum(float(random.normal()) / k**2 * np.polynomial.chebyshev.Chebyshev.basis(k)(u) for k in range(2, 6))
        size = float(random.uniform(0.2, 0.5))
    else:
        waves = [float(random.uniform(0.1, 0.4)) for _ in range(3)]
        bends = sum(wave * np.sin(2.0 * np.pi * u / (2.0 * wave) + random.uniform(0.0, 6.0)) for wave in waves)
        size = float(random.uniform(0.1, 0.3))
    steepest = float(np.abs(np.diff(bends)).max()) * (len(u) - 1) / span
    return np.asarray(size * abs(slope) / steepest * bends)


class Score(NamedTuple):
    """How far off something stated is, in deviations that are stated with it."""

    what: str
    deviations: float
    wandering: bool
    cell: int


def scores(set_name: str, number: int) -> list[Score]:
    """Of the loops of the recommended model and of the free branches, and of the parameters of the drawn family."""
    drawn = draw(set_name, number)
    paths: dict[int, Path] = {}

    def remembered(path: Path, fitted: Array) -> HysteresisLoop | None:
        loop = loop_of(path, fitted)
        paths[id(loop)] = path
        return loop

    with mock.patch.object(fitting, "loop_of", remembered):
        fit = bowden.identify(drawn.time, drawn.motor, drawn.joint)
    found: list[tuple[str, float]] = []
    for of, one in (("recommended", fit.chosen), ("generalised_play", fit.models["generalised_play"])):
        loop, path = one.loop, paths[id(one.loop)]
        true = loop_of(path, np.interp(path.time, drawn.time, drawn.clean))
        if loop is None or true is None:
            continue
        found.append((f"loop of {of}: slope", (loop.slope - true.slope) / loop.slope_error))
        found.append((f"loop of {of}: offset", (loop.offset - true.offset) / loop.offset_error))
        found.append((f"loop of {of}: height", (loop.height - true.height) / loop.height_error))
        for side in ("rising", "falling"):
            off = np.subtract(getattr(loop, side), getattr(true, side)) / getattr(loop, f"{side}_error")
            found.extend((f"loop of {of}: curve", float(value)) for value in off if not math.isnan(value))
    for family, parameters in drawn.parameters.items():
        of_family = fit.models[family]
        for name, value in parameters.items():
            error = of_family.uncertainty[name]
            if math.isfinite(error):
                found.append((f"{family}: {name}", (of_family.parameters[name] - value) / error))
    return [Score(what, off, drawn.wandering, number) for what, off in found]


def table(found: Sequence[Score]) -> str:
    """How many of what lies within two deviations, and beyond four."""
    lines = ["| what | how many | within 2 | steady logs | wandering logs | beyond 4 |", "|---|---|---|---|---|---|"]
    for what in sorted({one.what for one in found}):
        own = [one for one in found if one.what == what]
        cells = [
            share(own),
            share([one for one in own if not one.wandering]),
            share([one for one in own if one.wandering]),
        ]
        beyond = sum(abs(one.deviations) > 4.0 for one in own) / len(own)
        lines.append(f"| {what} | {len(own)} | {' | '.join(cells)} | {100.0 * beyond:.1f} % |")
    return "\n".join(lines)


def share(found: Sequence[Score]) -> str:
    """How many lie within two deviations."""
    return f"{100.0 * np.mean([abs(one.deviations) < 2.0 for one in found]):.0f} %" if found else "–"


def main() -> None:
    """The table of a range of draws."""
    set_name, numbers = asked(__doc__)
    print(table([score for number in numbers for score in scores(set_name, number)]))


if __name__ == "__main__":
    main()
