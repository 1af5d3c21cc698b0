"""The source of a run's reference that the wearer's push makes."""

from dataclasses import dataclass

from bowden.control.admittance.push import ROOM, push_source
from bowden.control.admittance.virtual_elbow import Admittance, check_admittance
from bowden.control.law import Law
from bowden.control.source import Source
from bowden.core.errors import ParameterError
from bowden.models.suit.load_cell import LoadCell
from bowden.plants.push_settings import AdmittanceSettings
from bowden.plants.suit_parts import Suit
from bowden.plants.suit_push import limit_for, push_of


@dataclass(frozen=True)
class Pushing:
    """The wearer's push as a rig describes it."""

    admittance: Admittance
    suit: Suit
    section: AdmittanceSettings
    room: float = ROOM
    """How far beyond its range the reference of a law that feeds the joint back may be led [rad]."""

    @property
    def cell(self) -> LoadCell:
        """The load cell, as far off as the rig says."""
        return LoadCell(self.section.cell_noise, self.section.cell_offset)

    def source(self, law: Law) -> Source:
        """The source above a law."""
        estimated, carried = self.section.torque == "estimate", self.section.carried
        return push_source(
            push_of(
                self.suit,
                law,
                self.admittance,
                estimated=estimated,
                carried=carried,
                friction_share=self.section.friction_share,
                room=self.room,
            )
        )

    def refuse_integral(self) -> None:
        """Refuse a drive with an integral: it is beyond the limit, which knows none, and most wearers swing with it.

        Raises:
            ParameterError: it has one.
        """
        given = self.suit.motor.integral
        if given > 0.0:
            said = (
                f"suit.drive_integral_per_s is {given:g} under [admittance], where the loop of most wearers oscillates"
            )
            raise ParameterError(said, expected="0", do="set it to 0")

    def notes(self, laws: list[Law], *, force: bool) -> list[str]:
        """Notes for the user; a virtual elbow beyond the limit is refused unless forced.

        Raises:
            ParameterError: a virtual elbow that the suit cannot render.
        """
        notes = []
        for refuse, do in (
            (self.refuse_integral, "set it to 0"),
            (lambda: limit_for(self.suit).refuse(self.admittance), "change [admittance]"),
        ):
            try:
                refuse()
            except ParameterError as error:
                if not force:
                    do = f"{do} in rig.toml, or run it anyway with --force"
                    raise ParameterError(error.what, expected=error.expected, do=do) from None
                notes.append(f"{error.what}; it runs because of --force")
        others = [law.name for law in laws if law.feeds_back]
        if others:
            notes.append(
                "the limit of [admittance] holds for a law that feeds nothing back, such as uncompensated; "
                f"{', '.join(others)}: the run itself shows"
            )
        return notes


def pushing_of(given: AdmittanceSettings, suit: Suit | None) -> Pushing | None:
    """The wearer's push; None where the reference is the rig's own.

    Raises:
        ParameterError: a virtual elbow that cannot be, or one without a suit.
    """
    if not given.enabled:
        return None
    if suit is None:
        raise ParameterError(
            "[admittance] is enabled without a suit",
            expected="suit.worn = true",
            do="set suit.worn = true, or disable it",
        )
    settings = Admittance(
        inertia=given.virtual_inertia,
        damping=given.virtual_damping,
        stiffness=given.virtual_stiffness,
        rest=given.rest,
        dead_band=given.dead_band,
        low=given.low,
        high=given.high,
        speed_limit=given.speed_limit,
    )
    return Pushing(check_admittance(settings), suit, given)
