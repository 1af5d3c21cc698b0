"""What a servo's fit gives a rig: its keys in a rig.toml, and its delay in whole cycles."""

import math

from bowden.core.toml_text import with_keys
from bowden.core.units import HERTZ, RADIANS
from bowden.identify.servo.figures import FittedValue, ServoFigures
from bowden.identify.servo.fit import ServoEstimate, ServoFit
from bowden.plants.counting import NOT_SAID, Encoders

_NO_CYCLE = 0.05
"""Share of a cycle by which a measured delay may be beyond whole ones before it is rounded up [–]."""


def figures_of(found: ServoFit, sample_time_ms: float, encoders: Encoders = NOT_SAID) -> ServoFigures:
    """A fit as the command says it, in the units of a rig.toml.

    Args:
        found: of the log.
        sample_time_ms: control cycle of the rig, for its delay in whole cycles [ms].
        encoders: of the rig; the loop waits for a joint's sensor that is late as well.
    """
    delay_ms = found.delay.value * 1e3
    return ServoFigures(
        natural_frequency_hz=_in(found.natural_frequency, HERTZ),
        damping=_in(found.damping, 1.0),
        delay_s=_in(found.delay, 1.0),
        delay_cycles=max(0, math.ceil(delay_ms / sample_time_ms - _NO_CYCLE))
        + encoders.late_cycles(1e-3 * sample_time_ms),
        joint_late_s=encoders.joint_late,
        sample_time_ms=sample_time_ms,
        speed_limit_deg_per_s=found.speed_limit and _in(found.speed_limit, RADIANS),
        acceleration_limit_deg_per_s2=found.acceleration_limit and _in(found.acceleration_limit, RADIANS),
        residual_deg=found.residual / RADIANS,
        unexplained=found.share,
    )


def _in(estimate: ServoEstimate, unit: float) -> FittedValue:
    return FittedValue(estimate.value / unit, estimate.uncertainty / unit)


def keys_of(found: ServoFigures, name: str) -> str:
    """The keys of a rig.toml that a fit gives, as the text of servo.toml.

    Args:
        found: of the fit.
        name: of the log.
    """
    return into("", found, name, "servo.toml")


def into(text: str, found: ServoFigures, name: str, where: str) -> str:
    """The text of a rig.toml with the values of a fit, and what is known of them as comments; all else as it stands.

    Args:
        text: of the file.
        found: of the fit, for the cycle of that rig.
        name: of the log.
        where: the file, for messages.

    Raises:
        OutputError: a section that cannot be changed line by line.
    """
    delay, cycle = found.delay_s, found.sample_time_ms
    said = f"{1e3 * delay.value:.3g} ± {1e3 * delay.uncertainty:.1g} ms rounded up at {cycle:g} ms a cycle"
    if found.joint_late_s:
        said += f", and {1e3 * found.joint_late_s:.3g} ms of the joint's sensor"
    cycles = {"delay_cycles": str(found.delay_cycles)}
    text = with_keys(text, "bench", cycles, where, [f"{_MARK}delay_cycles is {said}"])
    keys: dict[str, FittedValue] = {key: one for key in _SERVO if (one := getattr(found, key))}
    values = {key: f"{one.value:.5g}" for key, one in keys.items()}
    spread = ", ".join(f"{key} ± {one.uncertainty:.1g}" for key, one in keys.items())
    left = f"{found.residual_deg:.3g}° of the motor's motion are left, root mean square"
    evidence = [f"{_MARK}from {name}; {left}", f"{_MARK}{spread}"]
    if fastest := found.acceleration_limit_deg_per_s2:
        most = f"{fastest.value:.4g} ± {fastest.uncertainty:.1g} °/s²"
        own = "rig.toml has it by [motor] current_limit_a and inertia_kg_m2"
        evidence.append(f"{_MARK}largest acceleration {most}; {own}")
    return with_keys(text.replace(NOT_YOURS, "[servo]"), "servo", values, where, evidence)


_MARK = "bowden identify-servo: "
_SERVO = ("natural_frequency_hz", "damping", "speed_limit_deg_per_s")
NOT_YOURS = "[servo]  # of the paper's bench: put your own here; bowden identify-servo --into finds it from a log"
"""Head of a section that ``bowden init`` writes, until there is a log."""
