"""Cables of elastic tendon with friction along their sheath, for a bench."""

import numpy as np

from bowden.core.kernel import kernel
from bowden.models.cable import capstan
from bowden.models.cable.capstan import Tendon
from bowden.models.cable.lumped_cable import (
    LumpedMemory,
    LumpedTendon,
    PreparedLumped,
    advance_lumped,
    lumped_pull,
    prepare_lumped,
    start_lumped,
)
from bowden.models.cable.sliding_cable import (
    PreparedTendon,
    TendonMemory,
    advance_tendon,
    motor_tension,
    prepare_tendon,
    start_tendon,
    tendon_joint,
)
from bowden.plants.cable import Cable, Seen


@kernel
def sliding_start(cable: PreparedTendon, motor: float, width: float, slope_factor: float) -> TendonMemory:
    """At rest with one tension all along."""
    return start_tendon(cable, motor, width)


@kernel
def sliding_advance(
    cable: PreparedTendon,
    memory: TendonMemory,
    before: float,
    after: float,
    scaled: float,
    width: float,
    dt: float,
) -> TendonMemory:
    """See `bowden.models.cable.sliding_cable`; in place."""
    return advance_tendon(cable, memory, after, width)


@kernel
def sliding_look(cable: PreparedTendon, memory: TendonMemory, motor: float, width: float, slope_factor: float) -> Seen:
    """The joint, and the tendon's pull on the spool."""
    torque = cable.motor_radius * motor_tension(cable, memory)
    return Seen(tendon_joint(cable, memory), torque, np.nan)


def sliding(tendon: Tendon | None = None) -> Cable:
    """The partially moving, partially sticking tendon; with the defaults of `Tendon` where nothing is given.

    Raises:
        ParameterError: a tendon that cannot be.
    """
    tendon = tendon or Tendon()
    prepared = prepare_tendon(tendon)
    slope = capstan.slope(tendon, pulling=True)
    return Cable("sliding", tendon, prepared, sliding_start, sliding_advance, sliding_look, slope, physical=True)


@kernel
def lumped_start(cable: PreparedLumped, motor: float, width: float, slope_factor: float) -> LumpedMemory:
    """At rest with one tension all along."""
    return start_lumped(cable, motor, width)


@kernel
def lumped_advance(
    cable: PreparedLumped,
    memory: LumpedMemory,
    before: float,
    after: float,
    scaled: float,
    width: float,
    dt: float,
) -> LumpedMemory:
    """See `bowden.models.cable.lumped_cable`; in place."""
    return advance_lumped(cable, memory, before, after, width, dt)


@kernel
def lumped_look(cable: PreparedLumped, memory: LumpedMemory, motor: float, width: float, slope_factor: float) -> Seen:
    """The joint, and the tendon's pull on the spool."""
    torque = cable.tendon.motor_radius * lumped_pull(cable, memory, width)
    return Seen(memory.moved[-1] / cable.tendon.joint_radius, torque, np.nan)


def lumped(parameters: LumpedTendon | None = None) -> Cable:
    """The lumped-mass tendon; Coulomb friction and the defaults of `LumpedTendon` where nothing is given.

    Raises:
        ParameterError: a tendon that cannot be.
    """
    parameters = parameters or LumpedTendon()
    prepared = prepare_lumped(parameters)
    slope = capstan.slope(parameters.tendon, pulling=True)
    name = "lumped_dahl" if parameters.dahl else "lumped_coulomb"
    return Cable(name, parameters, prepared, lumped_start, lumped_advance, lumped_look, slope, physical=True)
