"""Control laws, one file each; `LAWS` names them."""

from collections.abc import Mapping

from bowden.control.law import Law
from bowden.control.laws.active_disturbance_rejection import ACTIVE_DISTURBANCE_REJECTION
from bowden.control.laws.adaptive import ADAPTIVE
from bowden.control.laws.backlash_inverse import BACKLASH_INVERSE
from bowden.control.laws.cascaded_pid import CASCADED_PID
from bowden.control.laws.hysteresis_model import HYSTERESIS_MODEL
from bowden.control.laws.observer import OBSERVER
from bowden.control.laws.offset_inverse import OFFSET_INVERSE
from bowden.control.laws.uncompensated import UNCOMPENSATED
from bowden.control.our_law.law import BOWDEN

LAWS: Mapping[str, Law] = {
    law.name: law
    for law in (
        UNCOMPENSATED,
        OBSERVER,
        ADAPTIVE,
        OFFSET_INVERSE,
        HYSTERESIS_MODEL,
        CASCADED_PID,
        BACKLASH_INVERSE,
        ACTIVE_DISTURBANCE_REJECTION,
        BOWDEN,
    )
}
"""Every law by its name, with default gains for the paper's bench."""

__all__ = ["LAWS", "Law"]
