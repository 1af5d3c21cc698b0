"""A learned inverse of the cable as feed-forward, on unseen cells: ``python benchmarks/learned_inverse.py``.

For each cell a network is trained on a log of that cell's own cable, 40 s on the bench before anybody wears it: no
other law knows as much. Networks of this kind are trained with a memory in time (Park, Jang, Park, Bae and Hwang, IEEE
RA-L 9(7), 2024: a temporal convolution); friction remembers reversals and no times, so that the memory is a bank of
play operators here (Serpico and Visone, IEEE Trans. Magnetics 34(3), 1998), which forgets nothing at rest:

    f_i = (φ − play_i(φ))/r_i,  φ the joint angle            what of the half width r_i is taken up, −1…1
    o   = c + Σ_i l_i·f_i + Σ_j v_j·tanh(b_j + Σ_i w_ji·f_i)     motor − φ/α̂ of a cable that is engaged

The last f is the angle itself, −1…1. α̂, l and c are found by least squares, the rest by descent (Adam) on what is left;
each sample weighs by the way that the joint has gone: while the motor crosses the dead zone it tells nothing. The law
around it is `disturbance_observer`, with o in the place of its inverse play. Only development cells are looked at.
"""

import argparse
import math
import time
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import unseen
from bowden.control import LAWS
from bowden.control.knowledge import configured
from bowden.control.law import Law
from bowden.control.law_parts import (
    CONTACT,
    Filtered,
    clamp,
    compensate_lag,
    crossing_rate,
    invert_servo,
    lowpass,
    lowpass_rate_limited,
    lowpass_second_order,
)
from bowden.control.laws.disturbance_observer import jump_bandwidth
from bowden.control.reference import PointToPoint
from bowden.core.kernel import kernel, tanh
from bowden.core.signals import Reference, Sample
from bowden.models.cable.backlash import push
from bowden.models.cable.sheath_path import constant_bend
from bowden.sim.many import simulate_many
from bowden.sim.run import simulate
from unseen_cells import DURATION, Cell, case_of, draw
from unseen_rig import Worn

Array = NDArray[np.float64]
HALF_WIDTHS = (0.004, 0.01, 0.025, 0.06, 0.15)
"""Of the play operators, of joint travel [rad]."""
INPUTS, HIDDEN = len(HALF_WIDTHS) + 1, 8
LOGGED, KEPT_EVERY, STEPS, RATE = 40.0, 0.01, 2000, 0.01
"""Length of the log and its spacing [s], steps of the descent and their first size."""
MOST = 0.6
"""Largest offset that is sent [rad]."""


class Network(NamedTuple):
    """What was learned; with the defaults nothing."""

    middle: float = 0.0
    """Of the joint's range [rad]."""
    half: float = 1.0
    """Half of it [rad]."""
    inner: tuple[float, ...] = (0.0,) * (HIDDEN * (INPUTS + 1))
    """w and b, one hidden unit after another."""
    outer: tuple[float, ...] = (0.0,) * HIDDEN
    """v [rad]."""
    linear: tuple[float, ...] = (0.0,) * (INPUTS + 1)
    """l and c [rad]."""


class LearnedGains(NamedTuple):
    """Those of `disturbance_observer`, and the network."""

    slope: float = 0.938
    natural_frequency: float = 53.58
    damping: float = 1.0
    delay: float = 0.0015
    bandwidth: float = 190.0
    rate_limit: float = 2.679
    jump_bandwidth: float = 107.16
    lead: float = 0.0388
    lead_square: float = 4.05e-4
    network: Network = Network()


class Plays(NamedTuple):
    """Where each play operator is [rad]."""

    a: float
    b: float
    c: float
    d: float
    e: float


class LearnedState(NamedTuple):
    """What the law remembers."""

    observed: float
    disturbance: Filtered
    jump: Filtered
    plays: Plays


@kernel
def pushed(plays: Plays, angle: float) -> Plays:
    """The play operators, moved on to an angle."""
    return Plays(
        push(plays.a, angle, HALF_WIDTHS[0]),
        push(plays.b, angle, HALF_WIDTHS[1]),
        push(plays.c, angle, HALF_WIDTHS[2]),
        push(plays.d, angle, HALF_WIDTHS[3]),
        push(plays.e, angle, HALF_WIDTHS[4]),
    )


@kernel
def offset(network: Network, plays: Plays, angle: float) -> float:
    """What the motor is to be ahead of φ/α̂ by [rad]."""
    inputs = (
        (angle - plays.a) / HALF_WIDTHS[0],
        (angle - plays.b) / HALF_WIDTHS[1],
        (angle - plays.c) / HALF_WIDTHS[2],
        (angle - plays.d) / HALF_WIDTHS[3],
        (angle - plays.e) / HALF_WIDTHS[4],
        (angle - network.middle) / network.half,
    )
    found = network.linear[INPUTS]
    for i in range(INPUTS):
        found = found + network.linear[i] * inputs[i]
    for j in range(HIDDEN):
        total = network.inner[j * (INPUTS + 1) + INPUTS]
        for i in range(INPUTS):
            total = total + network.inner[j * (INPUTS + 1) + i] * inputs[i]
        found = found + network.outer[j] * tanh(total)
    return max(-MOST, min(MOST, found))


@kernel
def start(gains: LearnedGains, sample: Sample) -> LearnedState:
    """Begin with the motor held where it is."""
    held = Filtered(sample.motor - sample.joint / gains.slope, 0.0, 0.0)
    at = sample.joint
    return LearnedState(held.value, held, Filtered(0.0, 0.0, 0.0), Plays(at, at, at, at, at))


@kernel
def step(
    gains: LearnedGains, state: LearnedState, sample: Sample, reference: Reference, dt: float
) -> tuple[LearnedState, float]:
    """Observe what the network does not say, and ask the servo for both."""
    moved = state.jump.value - gains.delay * state.jump.rate
    contact = clamp(sample.motor - sample.joint / gains.slope - moved, -1e3, 1e3, state.observed)
    observed = lowpass(state.observed, contact, gains.bandwidth, dt)
    disturbance = lowpass_rate_limited(state.disturbance, observed, gains.bandwidth, gains.rate_limit, dt)
    seen_ahead = compensate_lag(reference, gains.lead, gains.lead_square)
    plays = pushed(state.plays, seen_ahead)
    jump = lowpass_second_order(state.jump, offset(gains.network, plays, seen_ahead), gains.jump_bandwidth, dt)
    command = seen_ahead / gains.slope
    command = command + invert_servo(disturbance, gains.natural_frequency, gains.damping)
    command = command + invert_servo(jump, gains.natural_frequency, gains.damping)
    return LearnedState(observed, disturbance, jump, plays), command


LAW = Law(
    name="learned_inverse",
    gains=LearnedGains(),
    start_kernel=start,
    step_kernel=step,
    source="benchmarks/learned_inverse.py",
    from_rig={**CONTACT, "delay": "delay", "rate_limit": crossing_rate, "jump_bandwidth": jump_bandwidth},
    compensates_lag=True,
)


def logged(cell: Cell) -> tuple[Array, Array]:
    """Joint and motor of the cell's own cable, without its wearer and with its sheath as at first [rad]."""
    random = np.random.default_rng([19, cell.number])
    asked = cell.reference.sample(np.linspace(0.0, DURATION, 2001))[:, 0]
    low, high = float(asked.min()), float(asked.max())
    lengths = random.uniform(0.8, 2.0, int(LOGGED))
    at = random.uniform(low, high, len(lengths) + 1)
    at[1:-1:2], at[2:-1:2] = np.maximum(at[1:-1:2], 0.5 * (low + high)), np.minimum(at[2:-1:2], 0.5 * (low + high))
    at[0], at[3], at[4] = asked[0], high, low
    path = PointToPoint((0.0, *np.cumsum(lengths)), tuple(float(value) for value in at))
    worn = cell.rig.worn
    rig = cell.rig._replace(worn=Worn(load_frequency=worn.load_frequency, load_damping=worn.load_damping))
    run = simulate(
        rig,
        configured(LAWS["uncompensated"], cell.known),
        path,
        duration=LOGGED,
        bend=constant_bend(float(cell.bend(np.zeros(1))[0])),
        seed=cell.number,
        initial_motor=cell.initial_motor,
    )
    every = max(1, round(KEPT_EVERY / rig.sample_time))
    return run["joint_measured"][::every], run["motor_measured"][::every]


def trained(joint: Array, motor: Array, seed: int) -> tuple[float, Network, float]:
    """The slope, the network, and its error on the last quarter, which it is not trained on [rad]."""
    middle, half = 0.5 * float(joint.max() + joint.min()), max(0.02, 0.5 * float(np.ptp(joint)))
    columns = []
    for width in HALF_WIDTHS:
        at, play = joint[0], np.empty(len(joint))
        for k, angle in enumerate(joint):
            at = min(max(at, angle - width), angle + width)
            play[k] = at
        columns.append((joint - play) / width)
    given = np.column_stack([*columns, (joint - middle) / half, np.ones(len(joint))])
    weights = np.abs(np.gradient(np.convolve(joint, np.full(3, 1.0 / 3.0), "same"))) + 1e-7
    weights[:3] = weights[-3:] = 0.0
    known = np.arange(len(joint)) < 0.75 * len(joint)
    root = np.sqrt(weights * known)
    straight = np.linalg.lstsq(root[:, None] * given, root * motor, rcond=1e-6)[0]
    inverse = float(straight[INPUTS - 1]) / half
    linear = straight.copy()
    linear[INPUTS - 1], linear[INPUTS] = 0.0, straight[INPUTS] - inverse * middle
    wanted = motor - inverse * joint - given @ linear
    scale = max(1e-4, math.sqrt(float(np.average(wanted**2, weights=weights * known))))
    share = weights * known / float(np.sum(weights[known]))
    random = np.random.default_rng(seed)
    inner = random.normal(0.0, 0.5, (HIDDEN, INPUTS + 1))
    outer = random.normal(0.0, 0.1, HIDDEN)
    moments = [np.zeros_like(part) for part in (inner, inner, outer, outer)]
    for k in range(STEPS):
        units = np.tanh(given @ inner.T)
        miss = units @ outer - wanted / scale
        pull = share * miss
        to_outer = units.T @ pull
        to_inner = (pull[:, None] * outer * (1.0 - units**2)).T @ given
        size = RATE * 0.5 * (1.0 + math.cos(math.pi * k / STEPS))
        for part, slope, first, second in ((inner, to_inner, *moments[:2]), (outer, to_outer, *moments[2:])):
            first += 0.1 * (slope - first)
            second += 0.001 * (slope**2 - second)
            bias = math.sqrt(1.0 - 0.999 ** (k + 1)) / (1.0 - 0.9 ** (k + 1))
            part -= size * bias * first / (np.sqrt(second) + 1e-12)
    miss = scale * (np.tanh(given @ inner.T) @ outer) - wanted
    rest = weights * ~known
    error = math.sqrt(float(np.sum(rest * miss**2) / np.sum(rest)))
    made = (inner.ravel(), scale * outer, linear)
    return 1.0 / inverse, Network(middle, half, *(tuple(part.tolist()) for part in made)), error


def learned(cell: Cell) -> tuple[Law, float]:
    """The law with the cell's own network, and that network's error [rad]."""
    slope, network, error = trained(*logged(cell), cell.number)
    return configured(LAW.with_gains(slope=slope, network=network), cell.known), error


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seeds", type=int, default=60, help="development cells, from the first on")
    cells = [draw("development", number) for number in range(parser.parse_args().seeds)]
    begun = time.process_time()
    made = {cell.number: learned(cell) for cell in cells}
    took = time.process_time() - begun
    beside = [LAWS[name] for name in (unseen.OURS, unseen.BASELINE, "disturbance_observer")]
    order = sorted(cells, key=lambda cell: (cell.rig.inner.cable.name, cell.rig.sample_time, cell.number))
    cases = [case_of(cell, (made[cell.number][0], *(configured(law, cell.known) for law in beside))) for cell in order]
    names = [LAW.name, *(law.name for law in beside)]
    runs = [
        unseen.run_of(cell.number, cell.special, cell.allowed, name, outcome)
        for cell, outcomes in zip(order, simulate_many(cases, DURATION), strict=True)
        for name, outcome in zip(names, outcomes, strict=True)
    ]
    print(unseen.table(unseen.standings(runs)))
    print(f"\nA log and a network for each of {len(cells)} cells: {took / len(cells):.1f} s of processor time each.")
    for one in unseen.worst(runs, LAW.name, 5):
        print(f"- {one['number']}: {one['ratio']:.2f} × `{one['best']}`: {one['families']}")
    of = {(run.number, run.law): run for run in runs}
    for part in ("sheath", "cable", "load"):
        for family in sorted({cell.families[part] for cell in cells}):
            numbers = [cell.number for cell in cells if cell.families[part] == family]
            pairs = [[of[n, name].rmse_deg for name in names] for n in numbers]
            kept = np.array([pair for pair in pairs if all(map(math.isfinite, pair))])
            if len(kept):
                over = np.exp(np.mean(np.log(kept[:, :1] / kept[:, 1:]), axis=0))
                said = ", ".join(f"{value:.2f} × {name}" for value, name in zip(over, names[1:], strict=True))
                print(f"- {family} ({len(kept)} of {len(numbers)} cells): {said}")


if __name__ == "__main__":
    main()
