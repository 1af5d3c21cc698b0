"""The rig.toml that ``bowden init --suit`` writes: the suit on an arm, moved by EMG, live against its twin."""

from bowden.core.toml_text import quoted
from bowden.core.units import DEGREES
from bowden.rig.model_rig import Chosen, gain_lines

_TEXT = """\
# {name}: a suit on an arm, moved by EMG. What is not here is as bowden init writes it; docs/live.md says why.
#
#   bowden run {name} --twin --auto --emg file:RECORDING.csv      # a recording, against the twin
#   bowden run {name} --twin --emg lsl:NAME                       # a stream

{cable}[suit]
worn = true
# friction_feedforward_nm = 2.79  # [N·m] 0.7 of what identify.suit_friction reads; the drive has to map object 60B2h
drive_integral_per_s = 40.0  # [1/s] without an integral a drive does not follow its target against this friction

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
motor_low_deg = -12.0                # [°] room for the law below the straight arm
motor_margin_deg = 8.0               # [°] the drive's integral overshoots its target by this in a release
play_deg = 20.0                      # [°] fabric gives way, and the arm falls behind a cable that is let out
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

"""
_OWN = Chosen("bowden", "begins with its gains for a suit")


_ENCODER = """\
[encoder.motor]  # of the log
resolution_deg = {:.11g}  # [°] one count, at the spool

"""


def suit_text(name: str, model: str | None = None, chosen: Chosen = _OWN, count: float = 0.0) -> str:
    """The rig.toml.

    Args:
        name: of the file, as it is typed.
        model: the path of a model.toml, from the file's folder, where the cables are identified.
        chosen: the law.
        count: of the motor's encoder, where it is known [rad].
    """
    cable = "" if model is None else _CABLE.format(quoted(model))
    gains = gain_lines(chosen.gains)
    encoder = _ENCODER.format(count * DEGREES) if count else ""
    return _TEXT.format(name=name, cable=cable, encoder=encoder, law=quoted(chosen.law), why=chosen.why, gains=gains)
