"""The keys of rig.toml that make the reference follow the wearer's push: [admittance]."""

from typing import Literal

from bowden.control.admittance.virtual_elbow import Admittance
from bowden.core.units import DEGREES
from bowden.models.suit.load_cell import LoadCell
from bowden.rig.section import Section, key
from bowden.sim.suit_sources import FRICTION_SHARE

_OWN, _CELL = Admittance(), LoadCell()


def _degrees(value: float) -> float:
    return float(f"{value * DEGREES:.10g}")


class AdmittanceSection(Section):
    """The wearer's push makes the reference, on a suit (suit.worn); [reference] then only says where it begins."""

    enabled: bool = key(False, "true: the push makes the reference; false: [reference] does")
    torque: Literal["load_cell", "estimate"] = key(
        "load_cell",
        "whence the interaction torque: measured, or estimated from current, angles and the cables' model; "
        "bowden run has the estimate alone",
    )
    virtual_inertia: float = key(_OWN.inertia, "of the elbow that the wearer feels", "kg·m²", "M", ge=0.0, le=100.0)
    virtual_damping: float = key(_OWN.damping, "likewise", "N·m·s/rad", "B", ge=0.0, le=1e3)
    virtual_stiffness: float = key(_OWN.stiffness, "likewise, towards rest_deg", "N·m/rad", "K", ge=0.0, le=1e4)
    rest_deg: float = key(_degrees(_OWN.rest), "where the virtual spring rests", "°", "q0", ge=-180.0, le=180.0)
    dead_band_nm: float = key(
        _OWN.dead_band, "torque that moves nothing; at rest more (docs/admittance.md)", "N·m", "w", ge=0.0, le=20.0
    )
    carried: float = key(0.0, "share of forearm and hand that the suit holds up", ge=0.0, le=2.0)
    low_deg: float = key(_degrees(_OWN.low), "smallest reference", "°", ge=-180.0, le=180.0)
    high_deg: float = key(_degrees(_OWN.high), "largest reference", "°", ge=-180.0, le=180.0)
    speed_limit_deg_per_s: float = key(_degrees(_OWN.speed_limit), "of the reference", "°/s", gt=0.0, le=1e4)
    friction_share: float = key(
        FRICTION_SHARE,
        "of the friction of drive, gears and sheaths that is made up for, with suit.friction_feedforward_nm",
        ge=0.0,
        le=1.0,
    )
    cell_noise_nm: float = key(_CELL.noise, "of the load cell, standard deviation", "N·m", ge=0.0, le=10.0)
    cell_offset_nm: float = key(_CELL.offset, "error of its zero", "N·m", ge=-10.0, le=10.0)
