"""The same sampled loop with SciPy's `solve_ivp` between the samples, against one minute of ours."""

import math
import time

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from bowden.core.signals import Reference, Sample
from bowden.records.metrics import rmse
from bowden.sim.run import simulate
from measure import Row, Timing, by_turns
from peer_control import BENCH, LAW, REFERENCE

Array = NDArray[np.float64]
DURATION, TRIAL = 60.0, 1.0
PIECE = 4.0
"""`solve_ivp` is given so much of the minute, and its time counts for all of it [s]."""
REPEATS = 20
METHODS = ("RK45", "RK23", "LSODA")
AGREEMENT = 0.03
"""Largest relative difference of the RMSE from ours."""


def joint(duration: float, method: str, tolerance: float) -> Array:
    """Joint angle of every cycle, without encoders (n,)."""
    cable, servo, dt = BENCH.cable, BENCH.servo, BENCH.sample_time
    height, rate, shape, power = cable.hysteresis_gain * BENCH.sheath.gap, cable.rate, cable.shape, cable.exponent
    omega, zeta, width = servo.natural_frequency, servo.damping, BENCH.sheath.gap

    def rates(_: float, x: Array, command: float) -> list[float]:
        motor, velocity, h = x.tolist()
        u, size = velocity / width, abs(h) ** power
        bent = shape * abs(u) * math.copysign(size, h) + (shape - 1.0) * u * size
        return [velocity, omega**2 * (command - motor) - 2.0 * zeta * omega * velocity, rate * (u - bent)]

    references = REFERENCE.sample(np.arange(round(duration / dt)) * dt).tolist()
    x, state, applied, found = np.zeros(3), LAW.start(Sample(0.0, 0.0)), [0.0] * BENCH.delay, []
    for reference in references:
        angle = cable.slope * x[0] + height * x[2]
        found.append(angle)
        state, command = LAW.step(state, Sample(angle, x[0]), Reference(*reference), dt)
        applied.append(float(command))
        given = (applied.pop(0),)
        x = solve_ivp(rates, (0.0, dt), x, method, args=given, rtol=tolerance, atol=1e-3 * tolerance).y[:, -1]
    return np.array(found)


def rows(rounds: int = 3) -> tuple[list[Row], list[str]]:
    """The comparison's row and note."""
    method, tolerance, difference = _fastest()
    timings = by_turns(rounds, ours=_ours, peer=lambda: joint(PIECE, method, tolerance))
    ours = Timing(tuple(seconds / REPEATS for seconds in timings["ours"].seconds))
    peer = Timing(tuple(seconds * DURATION / PIECE for seconds in timings["peer"].seconds))
    note = (
        "SciPy: one call of `solve_ivp` for the three states of the plant from sample to sample, the law interpreted; "
        f"{PIECE:g} s of the minute, times {DURATION / PIECE:g}. {method}, rtol {tolerance:g} is the fastest of "
        f"{', '.join(METHODS)} at rtol 1e-3 and 1e-5 that comes within {100 * AGREEMENT:g} % of our RMSE "
        f"({100 * difference:+.1f} %)."
    )
    what = "a minute against SciPy's solve_ivp from sample to sample"
    return [Row(what, ours, peer, peer.over(ours), "× faster", "–")], [note]


def _ours() -> None:
    for _ in range(REPEATS):
        simulate(BENCH, LAW, REFERENCE, duration=DURATION)


def _fastest() -> tuple[str, float, float]:
    trace, found = simulate(BENCH, LAW, REFERENCE, duration=TRIAL), []
    for method in METHODS:
        for tolerance in (1e-3, 1e-5):
            start = time.process_time()
            reached = joint(TRIAL, method, tolerance)
            seconds = time.process_time() - start
            difference = rmse(reached - trace["reference"]) / rmse(trace.error) - 1.0
            if abs(difference) <= AGREEMENT:
                found.append((seconds, method, tolerance, difference))
    return min(found)[1:]
