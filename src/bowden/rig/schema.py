"""The keys of rig.toml: name with unit, default, range, meaning, and the paper's symbol.

Everything else about the file (the commented default, ``docs/rig.md``, the JSON schema, the error messages) is made
from these classes. The defaults are those of the paper's bench as ``bowden reproduce`` runs it.
"""

import math
from typing import Annotated, Any, Literal

from pydantic import Field

from bowden.core.units import RADIANS
from bowden.rig.admittance_schema import AdmittanceSection
from bowden.rig.emg_schema import EmgSection
from bowden.rig.live_schema import DriveSection, LimitsSection, LiveSection
from bowden.rig.presets.bench import chirp, default_bench, document, minimum_jerk
from bowden.rig.section import Section
from bowden.rig.section import key as _key
from bowden.rig.suit_schema import SuitSection, WearerSection

HERTZ = 2.0 * math.pi
"""rad/s in one hertz."""
MILLISECONDS = 1e-3
"""Seconds in one millisecond."""


def in_unit(value: float, unit: float) -> float:
    """The shortest decimal x with x·unit = `value` exactly, if there is one; otherwise value/unit.

    >>> in_unit(0.3490658503988659, RADIANS)
    20.0
    """
    quotient = value / unit
    decimals = (float(f"{quotient:.{digits}g}") for digits in range(1, 18))
    return next((x for x in decimals if x * unit == value), quotient)


_ANGLE: dict[str, Any] = {"ge": -720.0, "le": 720.0}


def _degrees(default: float, meaning: str, symbol: str = "") -> Any:
    """An angle of either sign, at most two turns; the default is in radians."""
    return _key(in_unit(default, RADIANS), meaning, "°", symbol, **_ANGLE)


def _bend(default_deg: float, meaning: str, symbol: str = "") -> Any:
    return _key(default_deg, meaning, "°", symbol, gt=0.0, le=3600.0)


def _seconds(default: float, meaning: str) -> Any:
    return _key(default, meaning, "s", gt=0.0, le=1e5)


_Number = Annotated[float, Field(ge=-720.0, le=720.0)]
_Positive = Annotated[float, Field(gt=0.0, le=3600.0)]
_Gain = Annotated[float, Field(ge=-1e6, le=1e6)]
_BENCH, _CHOSEN, _PERIODIC, _CHIRP = default_bench(), document()["chosen"], minimum_jerk(), chirp()


class BenchSection(Section):
    """The control loop's clock."""

    sample_time_ms: float = _key(
        in_unit(_BENCH.sample_time, MILLISECONDS), "one control cycle", "ms", "Ts", ge=0.01, le=100.0
    )
    delay_cycles: int = _key(
        _BENCH.delay, "cycles between a sample and the moment its command reaches the servo", ge=0, le=1000
    )
    substeps: int = _key(_BENCH.substeps, "plant sub-steps in a cycle in which the servo meets a limit", ge=1, le=1000)


class ServoSection(Section):
    """The motor under its PD position loop, second order."""

    natural_frequency_hz: float = _key(
        in_unit(_BENCH.servo.natural_frequency, HERTZ), "natural frequency", "Hz", "ω/2π", gt=0.0, le=1000.0
    )
    damping: float = _key(_BENCH.servo.damping, "damping ratio; 1 is critical", symbol="ζ", gt=0.0, le=20.0)
    speed_limit_deg_per_s: float = _key(
        in_unit(_BENCH.servo.speed_limit, RADIANS), "largest speed at the spool", "°/s", gt=0.0, le=1e6
    )


class CableSection(Section):
    """The cable, joint = αφ·motor + αh·h + offset (Eqs 6-7), or the model that `bowden identify` wrote."""

    model: str | None = _key(None, "file of an identified cable, in place of all keys below", examples=["model.toml"])
    slope: float = _key(_BENCH.cable.slope, "joint motion per motor motion; not 0", "rad/rad", "αφ", ge=-20.0, le=20.0)
    hysteresis_gain_rad: float = _key(
        _BENCH.cable.hysteresis_gain, "joint motion per unit of h", "rad", "αh", ge=-10.0, le=10.0
    )
    rate_per_rad: float = _key(_BENCH.cable.rate, "how fast h follows the motor", "1/rad", "ρ", gt=0.0, le=1e4)
    shape: float = _key(_BENCH.cable.shape, "shape of the loop", symbol="σ", gt=0.5, le=1e4)
    exponent: float = _key(_BENCH.cable.exponent, "how sharply h saturates", symbol="n", ge=1.0, le=50.0)
    offset_deg: float = _degrees(_BENCH.cable.offset, "joint angle at motor angle 0 with h = 0")
    width: float = _key(
        _BENCH.sheath.gap, "factor on the play, fitted to the paper's dead zone; laws do not know it", gt=0.0, le=100.0
    )


class SheathSection(Section):
    """How the sheath's bend sets the width and the slope of the cable's hysteresis."""

    bend_deg: float = _bend(in_unit(_BENCH.sheath.bend, RADIANS), "total bend at which the cable was identified", "θ₀")
    gap: float = _key(1.0, "gap in the sheath over the one at the identification", "–", "g/g₀", gt=0.0, le=100.0)
    loss: float = _key(_BENCH.sheath.loss, "share of the slope lost when the bend doubles", ge=0.0, lt=1.0)


class MotorSection(Section):
    """The geared motor and its load, for currents and energies (Eq. 18)."""

    torque_constant_nm_per_a: float = _key(
        _BENCH.motor.torque_constant, "torque constant", "N·m/A", "kτ", gt=0.0, le=100.0
    )
    resistance_ohm: float = _key(_BENCH.motor.resistance, "terminal resistance", "Ω", "R", gt=0.0, le=1e4)
    gear: float = _key(_BENCH.motor.gear, "motor turns per spool turn", gt=0.0, le=1e4)
    inertia_kg_m2: float = _key(_BENCH.motor.inertia, "rotor and load, at the spool", "kg·m²", gt=0.0, le=100.0)
    spring_nm_per_rad: float = _key(_BENCH.motor.spring, "stiffness of the joint's spring", "N·m/rad", ge=0.0, le=1e4)
    pretension_nm: float = _key(_BENCH.motor.pretension, "its torque at joint angle 0", "N·m", ge=0.0, le=1e4)
    current_limit_a: float = _key(_BENCH.motor.current_limit, "largest current of the drive", "A", gt=0.0, le=1e4)


class EncoderSection(Section):
    """One encoder."""

    resolution_deg: float = _key(
        in_unit(_BENCH.joint_encoder.resolution, RADIANS), "one count; 0 for an ideal encoder", "°", ge=0.0, le=90.0
    )
    noise_deg: float = _key(
        in_unit(_BENCH.joint_encoder.noise, RADIANS), "standard deviation, before counting", "°", ge=0.0, le=90.0
    )


class EncodersSection(Section):
    """The two encoders."""

    joint: EncoderSection = EncoderSection()
    motor: EncoderSection = EncoderSection()


class ControlSection(Section):
    """The law; `bowden simulate --law` puts others in its place."""

    law: str = _key("adaptive", 'name of a law, or your own as "file.py:NAME", found from this file')
    preset: str | None = _key(None, "a named set of gains of that law", examples=["paper"])
    gains: dict[str, _Gain] = _key({}, "gains of that law that differ from its own, in SI units and radians")


class PeriodicMinimumJerkSection(Section):
    """Minimum jerk from low to high in the first half of each period and back in the second (Fig. 9)."""

    kind: Literal["periodic_minimum_jerk"] = "periodic_minimum_jerk"
    low_deg: float = _degrees(_PERIODIC.low, "lower end")
    high_deg: float = _degrees(_PERIODIC.high, "upper end")
    period_s: float = _seconds(_PERIODIC.period, "there and back")


class PointToPointSection(Section):
    """Minimum-jerk motions through way points, with rests where two following ones are equal."""

    kind: Literal["point_to_point"] = "point_to_point"
    times_s: list[float] = _key([0.0, 2.0, 3.0, 5.0], "when each point is reached, increasing", "s")
    positions_deg: list[_Number] = _key([0.0, 70.0, 70.0, 0.0], "joint angle at each", "°")


class ChirpSection(Section):
    """A sine whose frequency rises linearly (Fig. 16, with the integrated phase)."""

    kind: Literal["chirp"] = "chirp"
    amplitude_deg: float = _degrees(_CHIRP.amplitude, "amplitude")
    start_hz: float = _key(_CHIRP.f0, "frequency at the start", "Hz", gt=0.0, le=1000.0)
    end_hz: float = _key(_CHIRP.f1, "frequency after sweep_s", "Hz", gt=0.0, le=1000.0)
    sweep_s: float = _seconds(_CHIRP.duration, "how long the sweep takes")


class MultisineSection(Section):
    """A sum of sines about a centre, at rest there at the start."""

    kind: Literal["multisine"] = "multisine"
    frequencies_hz: list[_Positive] = _key([0.05, 0.13, 0.31], "frequency of each", "Hz", min_length=1)
    amplitudes_deg: list[_Number] = _key([25.0, 12.0, 6.0], "amplitude of each", "°", min_length=1)
    phases_deg: list[_Number] = _key([0.0, 90.0, 200.0], "phase of each", "°", min_length=1)
    centre_deg: float = _degrees(35.0 * RADIANS, "joint angle about which they swing")
    ramp_s: float = _seconds(2.0, "time in which the sines grow to their full size")


class RecordedSection(Section):
    """A recorded motion, smoothed by a zero-phase low-pass filter."""

    kind: Literal["recorded"] = "recorded"
    file: str = _key(..., "CSV, csv.gz or Parquet file, found from this file", examples=["motion.csv"])
    time_column: str = _key("time_s", "its column of times, in seconds")
    position_column: str = _key("joint_deg", "its column of joint angles")
    unit: Literal["deg", "rad"] = _key("deg", "unit of the angles")
    cutoff_hz: float = _key(6.0, "cut-off of the filter; 0 for none", "Hz", ge=0.0, le=1000.0)


class ConstantBendSection(Section):
    """A sheath that nobody moves."""

    kind: Literal["constant"] = "constant"
    bend_deg: float | None = _key(
        None, "total bend; sheath.bend_deg where it is left out", "°", "θ", gt=0.0, le=3600.0, examples=[180.0]
    )


class ScriptedBendSection(Section):
    """A sheath moved through way points, with minimum jerk between them (Fig. 15)."""

    kind: Literal["scripted"] = "scripted"
    times_s: list[float] = _key([_CHOSEN["moved_from_s"], _CHOSEN["moved_to_s"]], "when each bend is reached", "s")
    bends_deg: list[_Positive] = _key([_CHOSEN["bend_deg"], _CHOSEN["moved_bend_deg"]], "total bend at each", "°", "θ")


class RandomBendSection(Section):
    """A sheath moved at random, smoothly; the scenario's seed decides how."""

    kind: Literal["random"] = "random"
    low_deg: float = _bend(_CHOSEN["bend_deg"], "smallest total bend", "θ")
    high_deg: float = _bend(_CHOSEN["moved_bend_deg"], "largest total bend", "θ")
    fastest_s: float = _seconds(2.0, "shortest time of one move; the longest is three times it")


REFERENCES: dict[str, type[Section]] = {
    "periodic_minimum_jerk": PeriodicMinimumJerkSection,
    "point_to_point": PointToPointSection,
    "chirp": ChirpSection,
    "multisine": MultisineSection,
    "recorded": RecordedSection,
}
"""What [reference] may be, by its kind."""
BENDS: dict[str, type[Section]] = {
    "constant": ConstantBendSection,
    "scripted": ScriptedBendSection,
    "random": RandomBendSection,
}
"""What [scenario.bend] may be, by its kind."""

ReferenceSection = Annotated[
    PeriodicMinimumJerkSection | PointToPointSection | ChirpSection | MultisineSection | RecordedSection,
    Field(discriminator="kind"),
]
BendSection = Annotated[ConstantBendSection | ScriptedBendSection | RandomBendSection, Field(discriminator="kind")]


class ScenarioSection(Section):
    """How long the run lasts, its random numbers, and how the sheath is bent meanwhile."""

    duration_s: float = _seconds(_CHOSEN["duration_s"], "length of the run")
    seed: int = _key(_CHOSEN["seed"], "seed of the encoders' noise and of a random bend", ge=0, lt=2**63)
    initial_motor_deg: float | None = _key(
        None,
        "motor angle before the start; left out, the joint is where the reference starts",
        "°",
        examples=[0.0],
        **_ANGLE,
    )
    bend: BendSection = ConstantBendSection()


class Rig(Section):
    """A rig.toml: a bench or a suit, its law, the joint's reference, the scenario, and what the live loop needs."""

    bench: BenchSection = BenchSection()
    servo: ServoSection = ServoSection()
    cable: CableSection = CableSection()
    sheath: SheathSection = SheathSection()
    motor: MotorSection = MotorSection()
    encoder: EncodersSection = EncodersSection()
    suit: SuitSection = SuitSection()
    wearer: WearerSection = WearerSection()
    admittance: AdmittanceSection = AdmittanceSection()
    control: ControlSection = ControlSection()
    reference: ReferenceSection = PeriodicMinimumJerkSection()
    scenario: ScenarioSection = ScenarioSection()
    drive: DriveSection = DriveSection()
    limits: LimitsSection = LimitsSection()  # type: ignore[valid-type]  # made from the supervisor's own
    live: LiveSection = LiveSection()
    emg: EmgSection = EmgSection()
