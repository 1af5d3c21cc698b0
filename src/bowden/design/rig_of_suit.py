"""The rig.toml that ``bowden init --suit`` writes: the suit on an arm, moved by EMG, live against its twin."""

import math
from typing import Any

from bowden.core.errors import ParameterError
from bowden.core.units import DEGREES, RADIANS
from bowden.design.rig_of_bench import own_text
from bowden.design.rig_of_model import Chosen
from bowden.plants.identified import IdentifiedCable
from bowden.plants.presets.bench import default_bench
from bowden.plants.suit_settings import SuitSettings
from bowden.plants.worn_suit import USUAL_DEAD_ZONE, elbow_dead_zone
from bowden.rig.consistent import CROSSING, PLAYS

_HEAD = """\
# {name}: a suit on an arm, moved by EMG. Keys that are not here have their defaults: docs/rig.md.
#
#   bowden run {name} --twin --auto --emg file:RECORDING.csv      # a recording, against the twin
#   bowden run {name} --twin --emg lsl:NAME                       # a stream
"""
_NOTES = {
    "cable": "both cables lose what this one does, as a length at the spool; the elbow's motion is the suit's geometry",
    "cable.model_hash": "of that model: another one in its file is refused",
    "suit.friction_feedforward_nm": "0.7 of the friction at the spool; the drive has to map object 60B2h",
    "suit.drive_integral_per_s": "without an integral a drive does not follow its target against this friction",
    "motor": "put your own here: the drive counts the motor before this gear and the next, all angles are behind both",
    "wearer.share": "share of the arm's weight that the wearer carries",
    "encoder.motor": "of the log, at the spool",
    "scenario.duration_s": "a run by a recording ends with it",
    "limits.motor_low_deg": "room for the law below the straight arm",
    "limits.motor_margin_deg": "the drive's integral overshoots its target by this in a release",
    "limits.play_deg": "fabric gives way, and the arm falls behind a cable that is let out",
    "limits.tracking_deg": "the servo's model knows no friction: gears hold the motor as it turns",
    "limits.thermal_continuous_current_a": "the paper's flexion draws 10 A for 25 s, more than its motor's 6 A",
    "emg.source": "or trigno:HOST, file:PATH; or bowden run --emg",
    "emg.wearer": "of bowden emg calibrate; for the envelope in % MVC",
    "emg.flexor": "the first channel if left out",
    "emg.extensor": "left out, one muscle takes turns: flex, extend, flex, …",
    "emg.duration_s": "of the whole motion",
}
_OWN = Chosen("bowden", "begins with its gains for a suit")

_LOW, _PLAY = -12.0, 20.0
"""Limits of the usual suit [deg]; one that loses more has more room, as on the bench."""
MOST_LOST = 20.0 * RADIANS
"""Of the straight elbow at a reversal: with a fifth more the motor's current lasts too long [rad]."""


def suit_text(name: str, model: str | None = None, chosen: Chosen = _OWN, cable: IdentifiedCable | None = None) -> str:
    """The rig.toml.

    Args:
        name: of the file, as it is typed.
        model: the path of a model.toml, from the file's folder, where the cables are identified.
        chosen: the law.
        cable: what is in it.

    Raises:
        ParameterError: the cable loses more than a suit can bear.
    """
    more, count = 0.0, 0.0
    if cable is not None:
        half_width, count = cable.lost * SuitSettings().spool_radius, cable.encoders.motor
        lost = elbow_dead_zone(half_width)
        if lost > MOST_LOST:
            most = 1e3 * half_width * MOST_LOST / lost
            raise ParameterError(
                f"{model}: on the suit's spool this cable loses ±{1e3 * half_width:.3g} mm",
                expected=f"at most ±{most:.3g} mm, {MOST_LOST * DEGREES:g}° of the elbow",
                do="take a cable that loses less; if the log's motor turned another spool, leave --model out, and set "
                "suit.play_mm in the file",
            )
        more = max(0.0, lost - USUAL_DEAD_ZONE) * DEGREES
    second = SuitSettings().second_gear
    given: dict[str, dict[str, Any]] = {
        "cable": {} if cable is None else {"model": model, "model_hash": cable.digest},
        "suit": {"worn": True, "# friction_feedforward_nm": 2.79, "drive_integral_per_s": 40.0},
        "motor": {"gear": default_bench().motor.gear},
        "wearer": {"mass_kg": 75.0, "height_m": 1.75, "share": 0.0},
        "encoder.motor": {"resolution_deg": float(f"{count * DEGREES:.11g}")} if count else {},
        "control": {"law": chosen.law},
        "control.gains": dict(chosen.gains),
        "scenario": {"duration_s": 60.0},
        "limits": {
            "motor_low_deg": float(math.floor(_LOW - CROSSING * more)),
            "motor_margin_deg": 8.0,
            "play_deg": float(math.ceil(_PLAY + PLAYS * more)),
            "tracking_deg": 15.0,
            "thermal_continuous_current_a": 12.0,
        },
        "emg": {
            **{"# source": "lsl:EMG", "# wearer": "wearer.toml", "# flexor": "biceps", "# extensor": "triceps"},
            **{"low_deg": 0.0, "high_deg": 60.0, "duration_s": 2.0},
        },
    }
    gear = f"motor turns per turn of the second stage, suit.second_gear = {second:g} turns of which turn the spool"
    return own_text(_HEAD.format(name=name), given, _NOTES | {"motor.gear": gear, "control.law": chosen.why})
