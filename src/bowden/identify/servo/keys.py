"""What a servo's fit gives a rig: its keys in a rig.toml, and its delay in whole cycles."""

import math
from typing import Any

from bowden.core.units import HERTZ, RADIANS
from bowden.identify.servo.fit import ServoEstimate, ServoFit

_NO_CYCLE = 0.05
"""Share of a cycle by which a measured delay may be beyond whole ones before it is rounded up [–]."""


def document_of(found: ServoFit, sample_time_ms: float) -> dict[str, Any]:
    """A fit as the command says it, in the units of a rig.toml.

    Args:
        found: of the log.
        sample_time_ms: control cycle of the rig, for its delay in whole cycles [ms].
    """
    delay_ms = found.delay.value * 1e3
    return {
        "natural_frequency_hz": _in(found.natural_frequency, HERTZ),
        "damping": _in(found.damping, 1.0),
        "delay_s": _in(found.delay, 1.0),
        "delay_cycles": max(0, math.ceil(delay_ms / sample_time_ms - _NO_CYCLE)),
        "sample_time_ms": sample_time_ms,
        "speed_limit_deg_per_s": _in(found.speed_limit, RADIANS),
        "acceleration_limit_deg_per_s2": _in(found.acceleration_limit, RADIANS),
        "residual_deg": found.residual / RADIANS,
        "unexplained": found.share,
    }


def _in(estimate: ServoEstimate | None, unit: float) -> dict[str, float] | None:
    if estimate is None:
        return None
    return {"value": estimate.value / unit, "uncertainty": estimate.uncertainty / unit}


def keys_of(document: dict[str, Any], name: str) -> str:
    """The keys of a rig.toml that a fit gives, as the text of servo.toml.

    Args:
        document: of the fit.
        name: of the log.
    """
    frequency, damping, delay = (document[key] for key in ("natural_frequency_hz", "damping", "delay_s"))
    speed, acceleration = document["speed_limit_deg_per_s"], document["acceleration_limit_deg_per_s2"]
    lines = [
        f"# Identified from {name}; {document['residual_deg']:.3g}° of the motor's motion are left, root mean square.",
        "",
        "[bench]",
        f"delay_cycles = {document['delay_cycles']}  # {1e3 * delay['value']:.3g} ± {1e3 * delay['uncertainty']:.1g} ms"
        f" rounded up at {document['sample_time_ms']:g} ms a cycle",
        "",
        "[servo]",
        f"natural_frequency_hz = {frequency['value']:.5g}  # ± {frequency['uncertainty']:.1g}",
        f"damping = {damping['value']:.4g}  # ± {damping['uncertainty']:.1g}",
    ]
    if speed:
        lines.append(f"speed_limit_deg_per_s = {speed['value']:.5g}  # ± {speed['uncertainty']:.1g}")
    if acceleration:
        said = f"{acceleration['value']:.4g} ± {acceleration['uncertainty']:.1g}"
        lines.append(
            f"# largest acceleration {said} °/s²; rig.toml has it by [motor] current_limit_a and inertia_kg_m2"
        )
    return "\n".join(lines) + "\n"
