"""The bench under given commands by SciPy's `solve_ivp`, as exact as it goes: an oracle, not a peer."""

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from bowden.plants.bench import Bench
from bowden.records.trace import Trace


def joint(bench: Bench, trace: Trace) -> NDArray[np.float64]:
    """Joint angles [rad] under a trace's commands, in a sheath that is still."""
    cable, servo, dt = bench.cable, bench.servo, bench.sample_time
    omega, zeta, power, shape = servo.natural_frequency, servo.damping, cable.exponent, cable.shape
    width, slope = float(trace["width"][0]), float(trace["slope"][0])
    commands = [0.0] * bench.delay + trace["command"].tolist()

    def rates(_: float, y: NDArray[np.float64], command: float) -> list[float]:
        u, h, size = y[1] / width, y[2], abs(y[2])
        bent = shape * abs(u) * size ** (power - 1.0) * h + (shape - 1.0) * u * size**power
        return [y[1], omega**2 * (command - y[0]) - 2.0 * zeta * omega * y[1], cable.rate * (u - bent)]

    y, found = np.zeros(3), np.empty(len(trace))
    for k, command in enumerate(commands[: len(trace)]):
        found[k] = slope * y[0] + width * cable.hysteresis_gain * y[2] + cable.offset
        y = solve_ivp(rates, (0.0, dt), y, "DOP853", args=(command,), rtol=1e-12, atol=1e-14).y[:, -1]
    return found
