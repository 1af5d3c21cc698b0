"""The rig.toml that ``bowden init --model`` writes: a bench round an identified cable, within what its log covered."""

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import NamedTuple

import numpy as np

from bowden.core.errors import ParameterError
from bowden.core.toml_text import quoted
from bowden.core.units import DEGREES, RADIANS
from bowden.plants.counting import Counting, Covered
from bowden.plants.identified import IdentifiedCable
from bowden.plants.presets.bench import default_bench
from bowden.plants.recounted import fitted_range
from bowden.rig.sections import DEFAULT_CABLE
from bowden.safety.limits import Limits

NOT_YOURS = "[servo]  # of the paper's bench: put your own here; bowden identify-servo --into finds it from a log"
"""Head of a section that ``bowden init`` writes, until there is a log."""

_INSIDE = 0.1
"""Share of the joint's covered motion that the reference keeps away from its ends."""
_LEAST_SPAN = 1.0
"""Of the joint's covered motion, from which on a rig is made of it [deg]: a dozen counts of its encoder."""
_ROOM = 15.0
"""What motor and joint may go beyond the covered motion [deg]: a law crosses the play, and overshoots."""

TEXT = """\
# {name}: a bench with your cable. Next: bowden simulate {name}
# What is not here is as on the paper's bench; `bowden init OTHER.toml` writes every key, docs/rig.md explains them.

[cable]
model = {model}
model_hash = "{digest}"  # of that model: another one in its file is refused
{counting}
[bench]  # the loop's own clock, whatever the rate of the log
sample_time_ms = {cycle:.1f}  # [ms] one control cycle
delay_cycles = {delay}      # cycles from a sample to its command at the servo{late}; change it with the cycle

{servo}
natural_frequency_hz = {frequency:.4g}  # [Hz] it decides how much gain a law may have
damping = {damping:.1f}                 # ratio; 1 is critical
{motor}
[encoder.joint]  # {joint_whose}
resolution_deg = {joint_count:.11g}  # [°] one count
noise_deg = {noise:.2f}                # [°] standard deviation

[encoder.motor]  # at the spool; {motor_whose}
resolution_deg = {motor_count:.11g}  # [°] one count
noise_deg = {noise:.2f}                # [°] standard deviation

[control]
law = {law}  # {why}
{gains}
[reference]  # {within}
kind = "periodic_minimum_jerk"
low_deg = {low}    # [°] lower end
high_deg = {high}  # [°] upper end
period_s = 10.0  # [s] there and back

[scenario]
duration_s = 60.0  # [s]

[limits]  # of bowden run; what is not here follows from the cable, this range and the cycle (docs/safety.md)
joint_low_deg = {joint_low:<7.1f}  # [°] smallest angle of the joint: {limited}
joint_high_deg = {joint_high:<6.1f}  # [°] largest
"""


_LOGS, _PAPERS = "the count is the log's, the noise of the paper's bench", "of the paper's bench: put your own here"


class Chosen(NamedTuple):
    """The law that is written, and why."""

    law: str
    why: str
    gains: Mapping[str, float] = MappingProxyType({})
    """Name → value of those that are not the law's own."""


def with_stroke(cable: IdentifiedCable) -> IdentifiedCable:
    """The cable with the motion that its log covered; where its file does not say that, with its models' own.

    Raises:
        ParameterError: its file says neither, though its angles cannot be counted as they are; or it is too small.
    """
    if cable.covered is None and (ends := _own_ends(cable)) is not None:
        joint = cable.model().joint_angle(np.concatenate([np.linspace(*ends, 200), np.linspace(*ends[::-1], 200)]))
        cable = replace(cable, covered=Covered(*ends, float(joint.min()), float(joint.max())))
    seen, where = cable.covered, cable.file or "the model"
    if seen is None:
        offset = cable.models.get("bouc_wen", {}).get("offset", 0.0)
        if cable.bouc_wen.slope < 0.0 or abs(offset) > 0.5 * Limits().play:
            raise ParameterError(
                f"{where} does not say what motion its log covered, so that no zeros and limits follow from it",
                expected="what bowden identify writes",
                do="identify the log again",
            )
    elif (span := (seen.joint_high - seen.joint_low) * DEGREES) < _LEAST_SPAN:
        raise ParameterError(
            f"{where}: its log covered {span:.2g}° of the joint",
            expected=f"{_LEAST_SPAN:g}° or more, for a reference within it",
            do="identify a log with more motion",
        )
    return cable


def _own_ends(cable: IdentifiedCable) -> tuple[float, float] | None:
    """Ends of the motor's motion that all models with such ends have [rad]; None where none has."""
    ends = [found for one in cable.models.values() if (found := fitted_range(one)) is not None]
    return (max(one[0] for one in ends), min(one[1] for one in ends)) if ends else None


def counting_of(cable: IdentifiedCable) -> Counting:
    """How a rig counts the angles of a cable's log.

    As the log does, where its joint rises with its motor and both are zero together, but for what play and sheath
    explain. Else the motor is counted so that the joint rises with it, and both from the lower end of the motion.
    """
    slope = cable.bouc_wen.slope
    direction, covered = (1 if slope > 0.0 else -1), cable.covered
    if covered is None:
        return Counting(1 if slope > 0.0 else -1)
    middle = 0.5 * (covered.joint_low + covered.joint_high - slope * (covered.motor_low + covered.motor_high))
    usual = Limits()
    if direction > 0 and abs(middle) < 0.5 * usual.play and covered.motor_low > usual.motor_low:
        return Counting()
    motor = covered.motor_low if direction > 0 else covered.motor_high
    return Counting(1 if direction > 0 else -1, _tenth(motor), _tenth(covered.joint_low))


def model_text(name: str, model: str, cable: IdentifiedCable, chosen: Chosen) -> str:
    """The rig.toml.

    Args:
        name: of the file, as it is typed.
        model: the path of model.toml, from the file's folder.
        cable: what is in it, as it was recorded.
        chosen: the law.
    """
    counting = counting_of(cable)
    counted = cable.counted(counting)
    bench, seen = default_bench(), counted.covered
    low, high, within = _reference(seen)
    ends, room = (Limits(), 0.0) if seen is None else (seen, _ROOM)
    late = cable.encoders.joint_late
    return TEXT.format(
        name=name,
        model=quoted(model),
        digest=cable.digest,
        counting=_counting_lines(counting),
        cycle=1e3 * bench.sample_time,
        delay=bench.delay + cable.encoders.late_cycles(bench.sample_time),
        late=f"; of them {1e3 * late:.3g} ms of the joint's sensor" if late else "",
        servo=NOT_YOURS,
        frequency=bench.servo.natural_frequency / (2.0 * math.pi),
        damping=bench.servo.damping,
        motor=_motor_lines(bench.motor.gear, counted.bouc_wen.slope / DEFAULT_CABLE.slope),
        joint_count=(cable.encoders.joint or bench.joint_encoder.resolution) * DEGREES,
        motor_count=(cable.encoders.motor or bench.motor_encoder.resolution) * DEGREES,
        joint_whose=_LOGS if cable.encoders.joint else _PAPERS,
        motor_whose=_LOGS if cable.encoders.motor else _PAPERS,
        noise=bench.joint_encoder.noise * DEGREES,
        law=quoted(chosen.law),
        why=chosen.why,
        gains=gain_lines(chosen.gains),
        within=within,
        low=low,
        high=high,
        joint_low=math.floor(ends.joint_low * DEGREES - room),
        joint_high=math.ceil(ends.joint_high * DEGREES + room),
        limited=f"{_ROOM:g}° beyond what the log covered" if seen else "of the paper's bench: put your own here",
    )


def _motor_lines(gear: float, slope: float) -> str:
    """The motor behind a gear that makes it as strong at the joint as on the bench, where the slope takes from that."""
    why = "as strong at the joint as on the bench" if slope > 1.0 else "of the paper's bench"
    return f"""
[motor]  # put your own here; the drive counts the motor before this gear, and all angles are behind it
gear = {gear * max(slope, 1.0):.4g}  # motor turns per spool turn: {why}
"""


def gain_lines(gains: Mapping[str, float]) -> str:
    """The section of a law's gains between two others; empty where there are none."""
    if not gains:
        return ""
    return "\n".join(["\n[control.gains]", *(f"{name} = {value!r}" for name, value in gains.items()), ""])


def _counting_lines(counting: Counting) -> str:
    if counting.as_recorded:
        return ""
    lines = []
    if counting.direction < 0:
        lines.append(
            "direction = -1  # the joint falls as the log's motor rises: the motor is counted the other way here"
        )
    if (counting.motor_zero, counting.joint_zero) != (0.0, 0.0):
        lines.append(
            "# The log does not count from where the cable is just taut; the lower end of its motion stands for that."
        )
        lines.append(f"motor_zero_deg = {counting.motor_zero * DEGREES:.1f}  # [°] of the log, zero here")
        lines.append(f"joint_zero_deg = {counting.joint_zero * DEGREES:.1f}  # [°] of the log, zero here")
    return "\n".join(lines) + "\n"


def _reference(seen: Covered | None) -> tuple[float, float, str]:
    """Both ends [deg], and what is said of them."""
    if seen is None:
        return 0.0, 70.0, "model.toml does not say what motion its log covered: check that this lies within it"
    low, high = seen.joint_low * DEGREES, seen.joint_high * DEGREES
    inside, digits = _INSIDE * (high - low), 0 if high - low > 20.0 else 2  # that no rounding leaves the motion
    scale = 10.0**digits
    ends = math.ceil(scale * (low + inside)) / scale, math.floor(scale * (high - inside)) / scale
    return *ends, f"within the motion that the log covered, {low:.4g} to {high:.4g}° at the joint"


def _tenth(angle: float) -> float:
    """An angle rounded to a tenth of a degree [rad]."""
    return round(angle * DEGREES, 1) * RADIANS
