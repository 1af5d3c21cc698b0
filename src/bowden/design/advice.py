"""Which number to change, and to what, so that a loop holds."""

import math

import numpy as np

from bowden.control.law import Law
from bowden.core.units import DEGREES
from bowden.design.check import STROKE, check
from bowden.design.check_result import ENOUGH_DB, ENOUGH_DEG, Check
from bowden.design.linear_plant import LinearPlant, linear_plant
from bowden.design.linearise import linearise
from bowden.plants.plant import Plant, changed
from bowden.plants.transmission import transmission

FACTORS = tuple(10.0 ** (-k / 6.0) for k in range(1, 19))
"""By which a gain is tried smaller (and, inverted, larger), the nearest first."""
_TRIED = 16
"""Candidates that are checked in full."""


def advise(
    bench: Plant,
    law: Law,
    found: Check,
    *,
    bends: tuple[float, float] | None = None,
    stroke: tuple[float, float] = STROKE,
) -> str:
    """A sentence or two on what to change; empty where there is nothing to mend.

    The smallest change of one gain that makes the loop hold is looked for and checked in full; where there is none,
    the delay is.
    """
    parts = []
    if found.verdict != "holds":
        parts.append(_remedy(bench, law, found, bends, stroke))
    reversal = transmission(bench, (bends or (bench.sheath.bend,))[0], stroke).reversal
    if found.verdict != "does_not_hold" and found.cycle_confirmed and found.swing is not None:
        parts.append(
            f"at rest the play makes the joint swing by ±{found.swing * DEGREES:.2g}°: "
            + (
                "after a reversal this model of the cable moves the joint the wrong way; record small motions and "
                "identify again, to see whether the cable does so too; if it does, only a law that feeds nothing back "
                "at rest does not swing"
                if reversal < 0.0
                else "lower the gain that acts on the integral of the error"
            )
        )
    return "; ".join(parts)


def mending_gain(
    bench: Plant,
    law: Law,
    found: Check,
    *,
    bends: tuple[float, float] | None = None,
    stroke: tuple[float, float] = STROKE,
) -> tuple[str, float] | None:
    """The smallest change of one gain that makes the loop hold: its name and new value; None where there is none."""
    linear = linear_plant(bench, bends or (bench.sheath.bend,), stroke)
    for name, value in _candidates(bench, linear, law, found)[:_TRIED]:
        if check(bench, law.with_gains(**{name: value}), bends=bends, stroke=stroke).verdict == "holds":
            return name, value
    return None


def _remedy(
    bench: Plant, law: Law, found: Check, bends: tuple[float, float] | None, stroke: tuple[float, float]
) -> str:
    gain = mending_gain(bench, law, found, bends=bends, stroke=stroke)
    if gain is not None:
        name, value = gain
        return f"set {name} to {value:.3g} (now {law.numbers[name]:.3g})"
    holding, failing = -1, bench.delay  # the longest delay known to hold lies between the two
    while failing - holding > 1:
        delay = (holding + failing) // 2 if holding >= 0 else 0
        held = check(changed(bench, delay=delay), law, bends=bends, stroke=stroke).verdict == "holds"
        if not held and delay == 0:
            break
        holding, failing = (delay, failing) if held else (holding, delay)
    if holding >= 0:
        return f"shorten the delay to {holding} cycles (now {bench.delay})"
    return "no single gain and no shorter delay mends it: find gains with bowden tune"


def _candidates(bench: Plant, linear: LinearPlant, law: Law, found: Check) -> list[tuple[str, float]]:
    """Changes of one gain that give the linear loops their margins, the smallest first."""
    visited = [point.estimates for point in found.points]
    bounded = all(trial.bounded for trial in found.trials)
    estimates = [visited[0], visited[-1]] if bounded else [visited[0]]  # a run that ran away shows no usual estimates
    passing: list[tuple[int, str, float]] = []
    for name in gains_that_matter(law, bench.sample_time, estimates[-1], switches=True):
        for changes in _changes(law, name):
            fine = [k for k, changed in changes if _has_margins(bench, linear, changed, estimates)]
            passing += [(k, name, dict(changes)[k].numbers[name]) for k in (fine[:1] if bounded else fine[::3])]
    return [(name, value) for _, name, value in sorted(passing)]


def gains_that_matter(law: Law, dt: float, estimates: dict[str, float], *, switches: bool = False) -> list[str]:
    """The gains with which the linear law changes, of those that are a choice (`Law.tunable`).

    Args:
        law: with its gains.
        dt: sample time [s].
        estimates: name of a state → the value at which it is frozen.
        switches: whether those that are zero and may be one count too.
    """
    numbers = law.numbers
    return [name for name in law.choices if (switches or numbers[name] != 0.0) and _matters(law, name, dt, estimates)]


def _changes(law: Law, name: str) -> list[list[tuple[int, Law]]]:
    """The law with one gain smaller, and with it larger, step by step; a switch that is off, on."""
    value = law.numbers[name]
    if value == 0.0:
        return [[(0, law.with_gains(**{name: 1.0}))]] if law.limits.get(name) == (0.0, 1.0) else []
    sides = [[(k, _with(law, name, value * f**sign)) for k, f in enumerate(FACTORS)] for sign in (1, -1)]
    return [[(k, changed) for k, changed in side if changed is not None] for side in sides]


def _with(law: Law, name: str, value: float) -> Law | None:
    """The law with that gain rounded to three digits; None where its limits forbid it."""
    low, high = law.limits.get(name, (-math.inf, math.inf))
    rounded = float(f"{value:.3g}")
    return law.with_gains(**{name: rounded}) if low <= rounded <= high else None


def _matters(law: Law, name: str, dt: float, estimates: dict[str, float]) -> bool:
    """True if the linear law changes with that gain at all."""
    changes = [side[0][1] for side in _changes(law, name) if side]
    if not changes:
        return False
    before, after = (linearise(each, dt, estimates=estimates) for each in (law, changes[0]))
    return any(
        old.shape != new.shape or not np.allclose(old, new, rtol=1e-6, atol=0.0)
        for old, new in zip(before, after, strict=True)
    )


def _has_margins(bench: Plant, linear: LinearPlant, law: Law, estimates: list[dict[str, float]]) -> bool:
    for values in estimates:
        model = linearise(law, bench.sample_time, width=bench.joint_encoder.resolution or 1e-6, estimates=values)
        if any(found.share(ENOUGH_DB, ENOUGH_DEG) < 1.0 for found in linear.margins(model)):
            return False
    return True
