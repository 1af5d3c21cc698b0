"""The wearer's push as a rig describes it."""

from typing import Annotated, Literal, NamedTuple

from bowden.control.admittance.virtual_elbow import FRICTION_SHARE, Admittance
from bowden.core.guesses import answering_fields
from bowden.core.quantity import Quantity
from bowden.models.suit.load_cell import LoadCell

_OWN, _CELL = Admittance(), LoadCell()


@answering_fields
class AdmittanceSettings(NamedTuple):
    """The wearer's push makes the reference, on a suit (suit.worn); [reference] then only says where it begins."""

    enabled: Annotated[bool, Quantity("true: the push makes the reference; false: [reference] does")] = False
    torque: Annotated[
        Literal["load_cell", "estimate"],
        Quantity(
            "source of the interaction torque: measured by [load_cell], or estimated from current, angles and the "
            "cables' model"
        ),
    ] = "load_cell"
    virtual_inertia: Annotated[
        float,
        Quantity("of the elbow that the wearer feels", "kg·m²", symbol="M", key="virtual_inertia", ge=0.0, le=100.0),
    ] = _OWN.inertia
    virtual_damping: Annotated[
        float, Quantity("likewise", "N·m·s/rad", symbol="B", key="virtual_damping", ge=0.0, le=1e3)
    ] = _OWN.damping
    virtual_stiffness: Annotated[
        float,
        Quantity("likewise, towards rest_deg", "N·m/rad", symbol="K", key="virtual_stiffness", ge=0.0, le=1e4),
    ] = _OWN.stiffness
    rest: Annotated[float, Quantity("where the virtual spring rests", "rad", symbol="q0", ge=-180.0, le=180.0)] = (
        _OWN.rest
    )
    dead_band: Annotated[
        float,
        Quantity("torque that moves nothing; at rest more (docs/day_one_suit.md)", "N·m", symbol="w", ge=0.0, le=20.0),
    ] = _OWN.dead_band
    carried: Annotated[float, Quantity("share of forearm and hand that the suit holds up", ge=0.0, le=2.0)] = 0.0
    low: Annotated[float, Quantity("smallest reference", "rad", ge=-180.0, le=180.0)] = _OWN.low
    high: Annotated[float, Quantity("largest reference", "rad", ge=-180.0, le=180.0)] = _OWN.high
    speed_limit: Annotated[float, Quantity("of the reference", "rad/s", gt=0.0, le=1e4)] = _OWN.speed_limit
    friction_share: Annotated[
        float,
        Quantity(
            "of the friction of drive, gears and sheaths that is compensated, with suit.friction_feedforward_nm",
            ge=0.0,
            le=1.0,
        ),
    ] = FRICTION_SHARE
    cell_noise: Annotated[float, Quantity("of the load cell, standard deviation", "N·m", ge=0.0, le=10.0)] = _CELL.noise
    cell_offset: Annotated[float, Quantity("error of its zero", "N·m", ge=-10.0, le=10.0)] = _CELL.offset
