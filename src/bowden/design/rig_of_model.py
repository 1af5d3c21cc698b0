"""The rig.toml that ``bowden init --model`` writes: a bench round an identified cable, within what its log covered."""

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np

from bowden.core.errors import ParameterError
from bowden.core.units import DEGREES, HERTZ, RADIANS
from bowden.design.rig_of_bench import own_text
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

_HEAD = """\
# {name}: a bench with your cable. Next: bowden simulate {name}
# What is not here is as on the paper's bench; `bowden init OTHER.toml` writes every key, docs/rig.md explains them.
"""
_NOTES = {
    "cable.model_hash": "of that model: another one in its file is refused",
    "cable.direction": "the joint falls as the log's motor rises: the motor is counted the other way here",
    "cable.motor_zero_deg": "of the log, zero here: the lower end of its motion stands for where the cable is taut",
    "cable.joint_zero_deg": "of the log, zero here",
    "bench": "the loop's own clock, whatever the rate of the log",
    "servo": NOT_YOURS.removeprefix("[servo]  # "),
    "servo.natural_frequency_hz": "it decides how much gain a law may have",
    "motor": "put your own here; the drive counts the motor before this gear, and all angles are behind it",
    "limits": "of bowden run; what is not here follows from the cable, this range and the cycle (docs/safety.md)",
}
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
    slope = counted.bouc_wen.slope / DEFAULT_CABLE.slope  # the motor is as strong at the joint as on the bench
    noise, encoders = round(bench.joint_encoder.noise * DEGREES, 2), cable.encoders
    steps = {"joint": bench.joint_encoder.resolution, "motor": bench.motor_encoder.resolution}
    each = {side: getattr(encoders, side) or step for side, step in steps.items()}
    given = {
        "cable": {"model": model, "model_hash": cable.digest} | _counting_keys(counting),
        "bench": {
            "sample_time_ms": round(1e3 * bench.sample_time, 1),
            "delay_cycles": bench.delay + encoders.late_cycles(bench.sample_time),
        },
        "servo": {
            "natural_frequency_hz": _short(bench.servo.natural_frequency / HERTZ, 4),
            "damping": round(bench.servo.damping, 1),
        },
        "motor": {"gear": _short(bench.motor.gear * max(slope, 1.0), 4)},
        **{
            f"encoder.{side}": {"resolution_deg": _short(step * DEGREES, 11), "noise_deg": noise}
            for side, step in each.items()
        },
        "control": {"law": chosen.law},
        "control.gains": dict(chosen.gains),
        "reference": {"kind": "periodic_minimum_jerk", "low_deg": low, "high_deg": high, "period_s": 10.0},
        "scenario": {"duration_s": 60.0},
        "limits": {
            "joint_low_deg": float(math.floor(ends.joint_low * DEGREES - room)),
            "joint_high_deg": float(math.ceil(ends.joint_high * DEGREES + room)),
        },
    }
    late = f"; of them {1e3 * encoders.joint_late:.3g} ms of the joint's sensor" if encoders.joint_late else ""
    limited = f"{_ROOM:g}° beyond what the log covered" if seen else "of the paper's bench: put your own here"
    whose = "as strong at the joint as on the bench" if slope > 1.0 else "of the paper's bench"
    notes = _NOTES | {
        "bench.delay_cycles": f"cycles from a sample to its command at the servo{late}; change it with the cycle",
        "motor.gear": f"motor turns per spool turn: {whose}",
        "encoder.joint": _LOGS if encoders.joint else _PAPERS,
        "encoder.motor": f"at the spool; {_LOGS if encoders.motor else _PAPERS}",
        "control.law": chosen.why,
        "reference": within,
        "limits.joint_low_deg": f"smallest angle of the joint: {limited}",
    }
    return own_text(_HEAD.format(name=name), given, notes)


def _counting_keys(counting: Counting) -> dict[str, Any]:
    keys: dict[str, Any] = {"direction": -1} if counting.direction < 0 else {}
    if (counting.motor_zero, counting.joint_zero) != (0.0, 0.0):
        for name in ("motor_zero", "joint_zero"):
            keys[f"{name}_deg"] = round(getattr(counting, name) * DEGREES, 1)
    return keys


def _short(number: float, digits: int) -> float:
    return float(f"{number:.{digits}g}")


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
