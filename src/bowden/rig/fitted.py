"""A law with the gains that a rig gives it."""

from collections.abc import Mapping

from bowden.control import Law
from bowden.control.laws.uncompensated import UncompensatedGains
from bowden.core.errors import ParameterError
from bowden.models.cable.bouc_wen import BoucWen
from bowden.plants.bench import Bench
from bowden.rig.known_cable import knowing

_SUIT = "suit"
"""Name of the gains that a law has for a suit; it begins with them where the rig names no others."""


def fitted(
    law: Law, bench: Bench, *, identified: bool, worn: bool, preset: str | None, gains: Mapping[str, float]
) -> Law:
    """A law with its own gains, given those that the rig gives it.

    A law that carries a model of the cable (its gains have all the fields of `BoucWen`) is given the rig's, and the
    uncompensated one the motor angle at which the joint is at zero: encoders zeroed apart are no backlash. One that
    learns slope and dead zone begins with those of an identified model. Then comes the preset, and the rig's own gains
    last.

    Args:
        law: as it comes.
        bench: with the cable as the laws know it.
        identified: whether that cable comes from an identification.
        worn: whether a suit takes the bench's place.
        preset: a named set of the law's gains.
        gains: the rig's own.

    Raises:
        ParameterError: an unknown preset or gain.
    """
    if set(BoucWen._fields) <= set(law.gains._fields):
        law = law.with_gains(**bench.cable._asdict())
    elif isinstance(law.gains, UncompensatedGains):
        law = law.with_gains(motor_zero=0.0 - bench.cable.offset / bench.cable.slope)
    elif identified and not worn:
        law = knowing(law, bench.cable, bench.sheath.gap)
    if worn and preset is None and not gains and _SUIT in law.presets:
        law = law.preset(_SUIT)
    if preset is not None:
        law = law.preset(preset)
    try:
        return law.with_gains(**gains)
    except ParameterError as error:
        do = error.do or "correct it there"
        raise ParameterError(f"the rig's control.gains: {error.what}", expected=error.expected, do=do) from error
