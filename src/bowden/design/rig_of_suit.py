"""The rig.toml that ``bowden init --suit`` writes: the suit on an arm, moved by EMG, live against its twin."""

import math

from bowden.core.errors import ParameterError
from bowden.core.toml_text import quoted
from bowden.core.units import DEGREES, RADIANS
from bowden.design.rig_of_model import Chosen, gain_lines
from bowden.plants.identified import IdentifiedCable
from bowden.plants.presets.bench import default_bench
from bowden.plants.suit_settings import SuitSettings
from bowden.plants.worn_suit import USUAL_DEAD_ZONE, elbow_dead_zone
from bowden.rig.consistent import CROSSING, PLAYS

_TEXT = """\
# {name}: a suit on an arm, moved by EMG. Keys that are not here have their defaults: docs/rig.md.
#
#   bowden run {name} --twin --auto --emg file:RECORDING.csv      # a recording, against the twin
#   bowden run {name} --twin --emg lsl:NAME                       # a stream

{cable}[suit]
worn = true
# friction_feedforward_nm = 2.79  # [N·m] 0.7 of the friction at the spool; the drive has to map object 60B2h
drive_integral_per_s = 40.0  # [1/s] without an integral a drive does not follow its target against this friction

[motor]  # put your own here: the drive counts the motor before this gear and the next, all angles are behind both
gear = {gear:g}  # motor turns per turn of the second stage, suit.second_gear = {second:g} turns of which turn the spool

[wearer]
mass_kg = 75.0    # [kg] of the body
height_m = 1.75   # [m] of the body
share = 0.0       # share of the arm's weight that the wearer carries

{encoder}[control]
law = {law}  # {why}
{gains}
[scenario]
duration_s = 60.0  # [s] a run by a recording ends with it

[limits]
motor_low_deg = {low:<19.1f}  # [°] room for the law below the straight arm
motor_margin_deg = 8.0               # [°] the drive's integral overshoots its target by this in a release
play_deg = {play:<24.1f}  # [°] fabric gives way, and the arm falls behind a cable that is let out
tracking_deg = 15.0                  # [°] the servo's model knows no friction: gears hold the motor as it turns
thermal_continuous_current_a = 12.0  # [A] the paper's flexion draws 10 A for 25 s, more than its motor's 6 A

[emg]
# source = "lsl:EMG"       # or trigno:HOST, file:PATH; or bowden run --emg
# wearer = "wearer.toml"   # of bowden emg calibrate; for the envelope in % MVC
# flexor = "biceps"        # the first channel if left out
# extensor = "triceps"     # left out, one muscle takes turns: flex, extend, flex, …
low_deg = 0.0
high_deg = 60.0
duration_s = 2.0           # [s] of the whole motion
"""
_CABLE = """\
[cable]  # both cables lose what this one does, as a length at the spool; what the elbow does is the suit's geometry
model = {}
model_hash = "{}"  # of that model: another one in its file is refused

"""
_OWN = Chosen("bowden", "begins with its gains for a suit")


_ENCODER = """\
[encoder.motor]  # of the log
resolution_deg = {:.11g}  # [°] one count, at the spool

"""


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
    return _TEXT.format(
        name=name,
        cable="" if model is None or cable is None else _CABLE.format(quoted(model), cable.digest),
        encoder=_ENCODER.format(count * DEGREES) if count else "",
        law=quoted(chosen.law),
        why=chosen.why,
        gains=gain_lines(chosen.gains),
        gear=default_bench().motor.gear,
        second=SuitSettings().second_gear,
        low=math.floor(_LOW - CROSSING * more),
        play=math.ceil(_PLAY + PLAYS * more),
    )
