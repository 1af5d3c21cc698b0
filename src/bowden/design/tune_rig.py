"""Rigs that are easier than a rig is."""

from collections.abc import Iterable

import numpy as np

from bowden.models.drive.servo import Servo
from bowden.plants.plant import Plant, changed
from bowden.plants.suit_parts import Suit

SHORTEST = 1e-3
"""Cycle that a rig is sent to, which the live loop keeps on a common computer [s]."""


def easier(bench: Plant, factor: float) -> Iterable[tuple[str, Plant]]:
    """The bench with a shorter delay, a shorter cycle, more damping and a faster servo, each as its key of rig.toml."""
    omega, damping = bench.servo.natural_frequency, bench.servo.damping
    if bench.delay:
        delay = int(bench.delay / factor)
        yield f"delay_cycles = {delay}", changed(bench, delay=delay)
    if bench.sample_time > SHORTEST:
        cycle = max(float(f"{bench.sample_time / factor:.3g}"), SHORTEST)
        yield f"sample_time_ms = {1e3 * cycle:.3g}", changed(bench, sample_time=cycle)
    if damping < 1.0:
        more = min(factor * damping, 1.0)
        yield f"damping = {more:.3g}", _with_servo(bench, bench.servo._replace(damping=more))
    hertz = factor * omega / (2.0 * np.pi)
    yield (
        f"natural_frequency_hz = {hertz:.3g}",
        _with_servo(bench, bench.servo._replace(natural_frequency=factor * omega)),
    )


def _with_servo(bench: Plant, servo: Servo) -> Plant:
    """The plant with another servo; a suit's is its motor's."""
    if isinstance(bench, Suit):
        return bench._replace(motor=bench.motor._replace(servo=servo))
    return changed(bench, servo=servo)
