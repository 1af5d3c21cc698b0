"""Knowledge of a rig, and the one rule by which a law gets it.

A rig supplies a `Knowledge`. A law declares in `Law.from_rig` which of it each of its gains takes:

    from_rig={"servo_frequency": "servo_frequency", "slope": "slope", "lead": lag}

a field of `Knowledge` (of a nested one ``cable.slope``), or a function of it. Only `informed` does this, and
`configured` puts a law's gains together for a rig:

1. the law's own gains;
2. what it knows of the rig;
3. the preset: what it changes stays as it has it, what it leaves as the law's own comes from the rig;
4. the gains that the rig itself gives.

Simulation, check, tuning, campaign, live run, export and replay all go this way. A study that gives laws something
wrong on purpose changes the `Knowledge`.
"""

import math
from collections.abc import Mapping
from dataclasses import replace
from operator import attrgetter
from typing import Any, NamedTuple

from bowden.control.conditioning import Conditioning
from bowden.control.law import Law
from bowden.core.errors import ParameterError, near
from bowden.models.cable.bouc_wen import BoucWen, saturation

IDENTIFIED = 0.1
"""`Knowledge.doubt` about an identified cable [–]."""
WIDEST = 0.5
"""Largest dead zone that is accepted of a preflight [rad]."""


class Knowledge(NamedTuple):
    """Knowledge of a rig; NaN is unknown, and is not passed on."""

    servo_frequency: float = math.nan
    """ω, natural frequency of the servo [rad/s]."""
    servo_damping: float = math.nan
    """ζ, damping ratio of the servo [–]."""
    delay: float = math.nan
    """τ = (d + ½)·Ts, from a sample to the middle of the time for which its command is held; d is the number of cycles
    from the sample to the moment its command reaches the servo [s]."""
    sample_time: float = math.nan
    """Ts, one control cycle [s]."""
    slope: float = math.nan
    """αφ of an identified cable: joint motion per motor motion once the play is taken up, positive [rad/rad]."""
    width: float = math.nan
    """Dead zone of an identified cable: motor travel that is lost at a reversal [rad]."""
    doubt: float = 1.0
    """About `slope` and `width`: 1 where nothing is known, 0.1 where they were identified [–]."""
    cable: BoucWen = BoucWen(*([math.nan] * len(BoucWen._fields)))
    """The cable that the rig has in its Bouc–Wen form, by hand or identified; its play is that of the bend at which it
    was identified."""
    motor_zero: float = math.nan
    """Motor angle at which the joint is at zero, with the hysteresis in its middle [rad]."""
    joint_step: float = math.nan
    """One count of the joint's encoder [rad]."""
    joint_noise: float = math.nan
    """Standard deviation of the joint's angle before it is counted [rad]."""
    motor_step: float = math.nan
    """One count of the motor's encoder [rad]."""
    motor_noise: float = math.nan
    """Standard deviation of the motor's angle before it is counted [rad]."""
    suit: bool = False
    """True if the joint is an arm in a suit, which swings; motor angles are in the joint's coordinate then."""
    relative_slope: float = 1.0
    """Slope of the cable over that of the paper's bench, for which the laws' own slopes are [–]."""
    servo_integral: float = math.nan
    """Integral of the drive's position loop; 0 of a PD loop [1/s]."""


def dead_zone(cable: BoucWen, gap: float) -> float:
    """Motor travel that a cable loses at a reversal, 2·|αh|·h_max/αφ times the `gap` [rad].

    Args:
        cable: Eqs 6-7 of the paper.
        gap: factor on its play, of the sheath as it lies.

    >>> round(dead_zone(BoucWen(), 1.0), 3)
    0.105
    """
    return float(2.0 * gap * abs(cable.hysteresis_gain) * saturation(cable) / abs(cable.slope))


def with_cable(known: Knowledge, cable: BoucWen, gap: float, *, identified: bool) -> Knowledge:
    """The same with a cable; slope and dead zone are known of an identified one only.

    Args:
        known: of the rest.
        cable: with a positive slope.
        gap: factor on its play, of the sheath as it lies.
        identified: from a log, and not written by hand.
    """
    known = known._replace(cable=cable, motor_zero=0.0 - cable.offset / cable.slope)
    if not identified:
        return known
    return known._replace(slope=cable.slope, width=dead_zone(cable, gap), doubt=IDENTIFIED)


def configured(
    law: Law, known: Knowledge, *, preset: str | None = None, gains: Mapping[str, float] | None = None
) -> Law:
    """The law as a rig runs it; see the module.

    Args:
        law: as it comes, or with gains that were chosen for it.
        known: of the rig.
        preset: of the law; on a suit, the law's own for a suit where neither this nor `gains` are given, and no gains
            of the law were chosen.
        gains: those that the rig gives it.

    Raises:
        ParameterError: no such preset or gain, a gain outside its limits, or a declaration that cannot be.
    """
    preset = preset_of(law, known, preset=preset, gains=gains)
    if preset is not None:
        law = law.preset(preset)
    return informed(law.with_gains(**(gains or {})), known)


def preset_of(
    law: Law, known: Knowledge, *, preset: str | None = None, gains: Mapping[str, float] | None = None
) -> str | None:
    """The preset with which `configured` begins; None where it takes the law as it comes."""
    if preset is None and not gains and not law.overridden_gains and known.suit:
        return law.suit_preset
    return preset


def informed(law: Law, known: Knowledge) -> Law:
    """The law with what it and its conditioner take of the knowledge, in place of what it knew before.

    What was chosen for it stays; what is not known is as the law's own, a slope times `relative_slope`. A value is kept
    inside the gain's limits. A law that has a gain for the doubt about its first guesses gets `slope`, `width` and
    `doubt` only where the knowledge is in no more doubt.

    Raises:
        ParameterError: the law declares something that there is not.
    """
    own = {gain: getattr(law.default_gains, gain) for gain in law.from_rig if gain not in law.overridden_gains}
    return _with_known(replace(law, gains=law.gains._replace(**own)), known)


def _with_known(law: Law, known: Knowledge) -> Law:
    """`informed`, with what is not known as it is."""
    taken = {gain for gain, what in law.from_rig.items() if what in _GUESSES} if _own_is_better(law, known) else set()
    values = {}
    parts = {name: getattr(known, name) for name in Conditioning._fields}
    conditioning = law.conditioning._replace(**{name: value for name, value in parts.items() if not math.isnan(value)})
    law = replace(law, conditioning=conditioning)
    for gain in law.from_rig:
        value = _value(law, gain, known)
        if gain not in law.overridden_gains and gain not in taken and not math.isnan(value):
            low, high = law.limits.get(gain, (-math.inf, math.inf))
            values[gain] = min(max(value, low), high)
    return replace(law, gains=law.gains._replace(**values)) if values else law


_GUESSES = ("slope", "width", "doubt")
_CABLE = "cable."


def _own_is_better(law: Law, known: Knowledge) -> bool:
    """True if the law's own guesses are less uncertain than the knowledge's."""
    return any(what == "doubt" and getattr(law.gains, gain) < known.doubt for gain, what in law.from_rig.items())


def _value(law: Law, gain: str, known: Knowledge) -> float:
    what: Any = law.from_rig[gain]
    if what == "slope" and math.isnan(known.slope):
        return float(getattr(law.gains, gain)) * known.relative_slope
    if callable(what):
        return float(what(known))
    try:
        return float(attrgetter(what)(known))
    except (AttributeError, TypeError):
        names = [*(f for f in Knowledge._fields if f != "cable"), *(_CABLE + f for f in BoucWen._fields)]
        raise ParameterError(
            f"gain {gain} of law {law.name!r} takes {what!r} from the rig",
            expected=near(str(what), names),
            do="correct it",
        ) from None
