"""What a rig says of itself to a law that asks for it, and rigs that are easier than it is."""

from collections.abc import Iterable

import numpy as np

from bowden.control.law import Law
from bowden.plants.plant import Plant, changed


def told(law: Law, bench: Plant) -> Law:
    """The law with what the rig says of itself in the gains that are named so; one that is zero was switched off."""
    omega, damping = bench.servo.natural_frequency, bench.servo.damping
    dead = (bench.delay + 0.5) * bench.sample_time
    known = {
        ("lead", "lead_square"): (
            2.0 * damping / omega + dead,
            omega**-2 + 2.0 * damping / omega * dead + 0.5 * dead**2,
        ),
        ("natural_frequency", "damping"): (omega, damping),
        ("servo_frequency", "servo_damping", "delay"): (omega, damping, dead),
    }
    found: dict[str, float] = {}
    for names, values in known.items():
        if set(names) <= set(law.gains._fields):
            found |= {n: v for n, v in zip(names, values, strict=True) if getattr(law.gains, n) != 0.0}
    inside = {n: float(np.clip(float(f"{v:.3g}"), *law.limits.get(n, (-np.inf, np.inf)))) for n, v in found.items()}
    return law.with_gains(**inside)


def easier(bench: Plant, factor: float) -> Iterable[tuple[str, Plant]]:
    """The bench with a shorter delay, with more damping, and with a faster servo, each as its key of rig.toml."""
    omega, damping = bench.servo.natural_frequency, bench.servo.damping
    if bench.delay:
        delay = int(bench.delay / factor)
        yield f"delay_cycles = {delay}", changed(bench, delay=delay)
    if damping < 1.0:
        more = min(factor * damping, 1.0)
        yield f"damping = {more:.3g}", changed(bench, servo=bench.servo._replace(damping=more))
    hertz = factor * omega / (2.0 * np.pi)
    faster = changed(bench, servo=bench.servo._replace(natural_frequency=factor * omega))
    yield f"natural_frequency_hz = {hertz:.3g}", faster
