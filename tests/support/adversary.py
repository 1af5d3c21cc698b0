"""Inputs of every kind against the supervisor: plausible, extreme, not a number, at a limit and just beside it."""

from typing import Any

import numpy as np

from bowden.core.kernel import compiled, kernel
from bowden.core.nested import flat
from bowden.core.signals import DriveReading, Power
from bowden.models.drive.thermal import ThermalState, cold
from bowden.safety.evidence import has_power
from bowden.safety.faults import Fault, Reaction
from bowden.safety.limits import Limits
from bowden.safety.state import Mode, Observed, PreflightResult, Request
from bowden.safety.supervisor import begin, supervise

FAULTS = len(Fault)


@kernel
def anything(random: np.random.Generator, usual: float, spread: float, low: float, high: float, wild: float) -> float:
    """A number about `usual`, or, with the probability `wild`, any other that a float can be."""
    if random.random() > wild:
        return usual + spread * (random.random() - 0.5)
    kind = random.integers(0, 12)
    edge = low if random.random() < 0.5 else high
    if kind == 0:
        return np.nan
    if kind == 1:
        return np.inf
    if kind == 2:
        return -np.inf
    if kind == 3:
        return 1.7e308 * (1.0 if random.random() < 0.5 else -1.0)
    if kind == 4:
        return 5e-324
    if kind == 5:
        return -0.0
    if kind == 6:
        return edge
    if kind == 7:
        return edge * (1.0 + 2.3e-16)
    if kind == 8:
        return edge * (1.0 - 2.3e-16)
    if kind == 9:
        return 10.0 ** (600.0 * random.random() - 300.0) * (1.0 if random.random() < 0.5 else -1.0)
    if kind == 10:
        return np.floor(20.0 * random.random()) - 10.0
    return usual + 10.0 * (random.random() - 0.5)


@kernel
def assault(
    limits: Limits, blank: DriveReading, thermal: ThermalState, cycles: int, random: np.random.Generator, dt: float
) -> Any:
    """So many cycles of anything; verdicts that must not be, cycles with power, cycles that the law led.

    How wild the inputs are changes every 500 cycles, between not at all, so that there is power, and always.
    """
    state = begin(limits, blank, thermal)
    target, wrong, powered, led, wild = state.target, 0, 0, 0, 0.0
    requested_target = 0.0
    for k in range(cycles):
        if k % 500 == 0:
            wild = 0.0 if random.random() < 0.5 else random.random() ** 4
            state = begin(limits, blank, thermal) if random.random() < 0.5 else state
            target = state.target
            requested_target = target
        near = state.target
        reading = DriveReading(
            anything(random, near, 0.001, limits.motor_low, limits.motor_high, wild),
            anything(random, 0.9 * near, 0.001, limits.joint_low, limits.joint_high, wild),
            anything(random, 2.0, 2.0, -limits.current_peak, limits.current_peak, wild),
            anything(random, 20.0, 5.0, limits.tension_low, limits.tension_high, wild),
            anything(random, 40.0, 5.0, 0.0, limits.drive_limit, wild),
            anything(random, 0.0, 0.0, 0.0, limits.reading_age, wild),
            anything(random, 0.0, 0.0, 0.0, limits.reading_age, wild),
            anything(random, 0.01, 0.01, 0.0, limits.heartbeat_age, wild),
            anything(random, 4.0, 0.0, 0.0, 7.0, wild),
            anything(random, 0.0, 0.0, 0.0, 1.0, wild),
            anything(random, 0.0, 0.0, 0.0, 1.0, wild),
            anything(random, 0.0, 0.0, 0.0, 1.0, wild),
            anything(random, 0.0, 0.0, 0.0, 1.0, wild),
            anything(random, 5.0, 1.0, -limits.torque_high, limits.torque_high, wild),
            anything(random, 0.01, 0.01, 0.0, 1.0, wild),
            anything(random, 0.02, 0.01, 0.0, limits.joint_std, wild),
            anything(random, 0.9 * near, 0.05, limits.joint_low, limits.joint_high, wild),
        )
        requested_target = near + 0.002 * (random.random() - 0.5)
        elapsed = anything(random, dt, 0.0, 0.0, limits.clock_gap, wild)
        request = Request.ACKNOWLEDGE if state.decided.mode == Mode.LATCHED else Request.ARM
        request = Request.RUN if request == Request.ARM and random.random() < 0.5 else request
        if random.random() < 0.003:
            request = Request.STOP if random.random() < 0.7 else Request.NONE
        preflight, others = PreflightResult.PASSED, Reaction.NONE
        if random.random() < wild:
            preflight = PreflightResult.PENDING if random.random() < 0.5 else PreflightResult.FAILED
            others = Reaction.R2 if random.random() < 0.5 else Reaction.R3
        observed = Observed(
            reading,
            anything(random, 0.0, 0.0, 0.0, limits.lateness, wild),
            elapsed,
            request,
            anything(random, 0.1, 0.0, 0.0, limits.operator_age, wild),
            random.random() >= wild,
            preflight,
            anything(random, 0.02, 0.01, 0.0, limits.emg_age, wild),
            others,
            anything(random, near, 0.2, -limits.sensor_span, limits.sensor_span, wild),
            anything(random, near, 0.2, -limits.off_reference, limits.off_reference, wild),
        )
        state, verdict = supervise(
            limits,
            state,
            observed,
            anything(random, requested_target, 0.0, limits.motor_low, limits.motor_high, wild),
            dt,
        )
        most = limits.target_speed * dt
        if elapsed > dt and elapsed <= limits.clock_gap:
            most = limits.target_speed * min(elapsed, 5.0 * dt)
        fine = np.isfinite(verdict.target) and limits.motor_low <= verdict.target <= limits.motor_high
        fine = fine and abs(verdict.target - target) <= most + 1e-15
        fine = fine and (verdict.power == Power.OFF or (verdict.power == Power.ON and has_power(verdict.mode)))
        fine = fine and verdict.faults >= 0 and verdict.faults < 1 << FAULTS
        for number in flat(state):
            fine = fine and np.isfinite(number)
        wrong += 0 if fine else 1
        powered += 1 if verdict.power == Power.ON else 0
        led += 1 if verdict.mode == Mode.RUNNING else 0
        target = verdict.target
    return wrong, powered, led


def attack(limits: Limits, cycles: int, seed: int, dt: float = 1e-3) -> tuple[int, int, int]:
    """`assault` compiled: violations, cycles with power, cycles that the law led."""
    blank = DriveReading(0.1, 0.09, 2.0, 20.0, 40.0, 0.0, 0.0, 0.01, 4.0, 0.0, 0.0, 0.0, 0.0)
    random = np.random.default_rng(seed)
    wrong, powered, led = compiled(assault)(limits, blank, cold(limits.thermal), cycles, random, dt)
    return int(wrong), int(powered), int(led)
