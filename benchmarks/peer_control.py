"""The same loop as one continuous nonlinear system in python-control, against one minute of ours."""

import math
import time
from typing import Any

import control
import numpy as np
from numpy.typing import NDArray

from bowden.control import LAWS
from bowden.models.cable.sheath import width as width_at
from bowden.models.drive.encoder import Encoder
from bowden.plants.presets import paper
from bowden.plants.presets.bench import bench
from bowden.records.metrics import rmse
from bowden.sim.run import simulate
from measure import Row, Timing, by_turns

Array = NDArray[np.float64]
DURATION, TRIAL = 60.0, 5.0
REPEATS = 20
"""Of ours in a round, averaged: a run takes milliseconds and python-control's a second."""
METHODS = ("RK45", "RK23", "DOP853", "LSODA", "BDF", "Radau")
TOLERANCES = (1e-3, 1e-4, 1e-5)
AGREEMENT = 0.03
"""Largest relative difference of the RMSE from ours: sampling and its delay are all that differ."""

BENCH = bench()._replace(joint_encoder=Encoder(), motor_encoder=Encoder())
LAW, REFERENCE = LAWS["adaptive"], paper.minimum_jerk()


def system() -> control.NonlinearIOSystem:
    """Servo, cable and law as one system, with the plainest and fastest right-hand side that Python allows.

    States: motor, its velocity, h, ∫e dt, β̂, D̂m, and the joint behind the derivative's filter.
    """
    gains, cable, servo = LAW.gains, BENCH.cable, BENCH.servo
    width = float(width_at(BENCH.sheath.bend, BENCH.sheath))
    slope, height, n = cable.slope, width * cable.hysteresis_gain, cable.exponent
    rate, shape = cable.rate / width, cable.shape
    stiffness, friction = servo.natural_frequency**2, 2.0 * servo.damping * servo.natural_frequency

    def update(t: float, x: Array, u: Array, params: dict[str, Any]) -> list[float]:
        motor, velocity, h, integral, slope_inverse, bound, filtered = x.tolist()
        position, position_rate = u.tolist()
        joint = slope * motor + height * h
        error, joint_rate = joint - position, (joint - filtered) / gains.derivative_time
        s = gains.error_gain * error + integral
        switch = math.tanh(s / gains.smoothing)
        wanted = position - gains.error_gain * (joint_rate - position_rate) - bound * switch
        command = slope_inverse * wanted - gains.feedback_gain * s
        size = abs(h) ** n
        return [
            velocity,
            stiffness * (command - motor) - friction * velocity,
            rate * (velocity - shape * abs(velocity) * math.copysign(size, h) - (shape - 1.0) * velocity * size),
            error,
            -gains.slope_adaptation * (wanted * s + gains.slope_leakage * slope_inverse),
            gains.bound_adaptation * (slope_inverse * switch * s - gains.bound_leakage * bound),
            joint_rate,
        ]

    def output(t: float, x: Array, u: Array, params: dict[str, Any]) -> list[float]:
        return [slope * x[0] + height * x[2]]

    return control.nlsys(update, output, inputs=["position", "rate"], outputs=["joint"], states=7, name="bench")


def joint(duration: float, every: float, method: str, tolerance: float) -> tuple[Array, Array]:
    """Reference and joint (n,), recorded `every` so many seconds."""
    time = np.arange(round(duration / every) + 1) * every
    motion = REFERENCE.sample(time)
    options = {"rtol": tolerance, "atol": 1e-3 * tolerance}
    response = control.input_output_response(
        system(), time, motion[:, :2].T, 0.0, solve_ivp_method=method, solve_ivp_kwargs=options
    )
    return motion[:, 0], np.ravel(response.outputs)


def rows(rounds: int = 3) -> tuple[list[Row], str]:
    """Ours against its fastest settings, and against its default ones."""
    fine, coarse = (_fastest(every) for every in (1e-3, 1e-2))
    timings = by_turns(
        rounds,
        ours=_ours,
        fine=lambda: joint(DURATION, 1e-3, *fine[:2]),
        default=lambda: joint(DURATION, 1e-3, "RK45", 1e-3),
        coarse=lambda: joint(DURATION, 1e-2, *coarse[:2]),
    )
    ours = Timing(tuple(seconds / REPEATS for seconds in timings["ours"].seconds))
    wanted = {
        "fine": ("a minute against python-control, its fastest settings, recorded at 1 kHz", "≥ 150"),
        "default": ("its default settings (RK45, rtol 1e-3), recorded at 1 kHz", "≥ 150"),
        "coarse": ("its fastest settings, recorded at 100 Hz only (ours at 1 kHz)", "–"),
    }
    return [
        Row(what, ours, timings[name], f"{timings[name].over(ours)} × faster", target)
        for name, (what, target) in wanted.items()
    ], (
        "python-control: `input_output_response` of one `nlsys` of seven states in plain Python, without encoders; the "
        f"quickest setting whose RMSE is within {100 * AGREEMENT:g} % of ours: {_settings(*fine)} at 1 kHz, "
        f"{_settings(*coarse)} at 100 Hz."
    )


def _ours() -> None:
    for _ in range(REPEATS):
        simulate(BENCH, LAW, REFERENCE, duration=DURATION)


def _fastest(every: float) -> tuple[str, float, float]:
    """Method, tolerance and RMSE's relative difference of the quickest setting that agrees with ours."""
    trace = simulate(BENCH, LAW, REFERENCE, duration=TRIAL)
    found: list[tuple[float, str, float, float]] = []
    for method in METHODS:
        for tolerance in TOLERANCES:
            start = time.process_time()
            wanted, reached = joint(TRIAL, every, method, tolerance)
            seconds = time.process_time() - start
            difference = rmse(reached - wanted) / rmse(trace.error) - 1.0
            if abs(difference) <= AGREEMENT:
                found.append((seconds, method, tolerance, difference))
    return min(found)[1:]


def _settings(method: str, tolerance: float, difference: float) -> str:
    return f"{method}, rtol {tolerance:g} (RMSE {100 * difference:+.1f} %)"
