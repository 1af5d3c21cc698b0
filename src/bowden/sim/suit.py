"""The closed loop round the suit: a run of a law on it, with its trace."""

from typing import Any

import numpy as np

from bowden import __version__
from bowden.control.law import Law
from bowden.control.reference import Trajectory
from bowden.control.source import TABLE, Source
from bowden.core.trace import Trace
from bowden.models.cable.sheath import slope_factor as slope_factor_at
from bowden.models.cable.sheath import width as width_at
from bowden.models.suit.arm import Wearer
from bowden.models.suit.load_cell import LoadCell
from bowden.plants.suit_parts import PreparedSuit, Suit
from bowden.sim.faulty import Fault
from bowden.sim.scenario import BendPath
from bowden.sim.suit_loop import RECORDED, run_suit, state_fields, suit_inputs


def simulate_suit(
    suit: Suit,
    law: Law,
    reference: Trajectory,
    *,
    duration: float,
    bend: BendPath | None = None,
    wearer: Wearer | None = None,
    seed: int = 0,
    initial_motor: float | None = None,
    source: Source = TABLE,
    cell: LoadCell | None = None,
    powered: bool = True,
    fault: Fault | None = None,
) -> Trace:
    """Run a law on the suit.

    Args:
        suit: with the arm that wears it.
        law: the control law with its gains.
        reference: the elbow's desired motion.
        duration: length of the run [s].
        bend: total bend of the sheaths over time, but for what the posture adds; constant where it is not given.
        wearer: what their muscles do; the suit's own wearer where it is not given.
        seed: of the sensors' noise and drift.
        initial_motor: motor angle before the start, in the joint's coordinate; where the reference begins if it is not
            given [rad].
        source: what makes the reference, cycle by cycle; the table of `reference` itself if nothing else is given.
        cell: the load cell that the source hears; the default one where it is not given.
        powered: False: the drive is switched off when the run begins, and the wearer drives the suit back.
        fault: of the elbow's or the motor's sensor; the measured columns have what law and source were shown.

    Returns:
        The trace, with the columns of `bowden.sim.closed_loop.simulate` that a suit has and those of `RECORDED`; of a
        run that ran away the rest is NaN.

    Raises:
        ParameterError: a duration, a part of the suit or a wearer that cannot be.
    """
    suit = suit._replace(wearer=wearer or suit.wearer)
    inputs = suit_inputs(suit, reference, duration, bend, seed, initial_motor)
    time, references = inputs.edges[:-1], inputs.references
    fields, asked = state_fields(law, source)
    block = np.empty((len(RECORDED) + len(fields) + len(asked), len(time)))
    fields += [] if source is TABLE else asked  # which remembers nothing that is worth a column
    record, states = block[: len(RECORDED)], block[len(RECORDED) :]
    lasted = run_suit(inputs, law, references, record, states, source=source, cell=cell, powered=powered, fault=fault)
    block[:, lasted:] = np.nan
    if source is not TABLE:
        references[:, lasted:] = np.nan
    values = {"time": time, "reference": references[0], "reference_velocity": references[1]}
    values |= dict(zip(RECORDED, record, strict=True))
    whole: Any = inputs.bends[:-1] + suit.posture * values["joint"]
    values |= {"bend": whole, "width": width_at(whole, suit.sheath), "slope": slope_factor_at(whole, suit.sheath)}
    values |= dict(zip(fields, states, strict=False))
    units = {"time": "s", "reference": "rad", "reference_velocity": "rad/s"} | RECORDED
    units |= {"bend": "rad", "width": "1", "slope": "rad/rad"}
    units |= law.columns() | ({} if source is TABLE else source.columns())
    return Trace(values, units, _settings(suit, inputs.prepared, law, reference, source), seed)


def _settings(suit: Suit, prepared: PreparedSuit, law: Law, reference: Trajectory, source: Source) -> dict[str, Any]:
    own = {} if source is TABLE else {source.name: _plain(source.settings)}
    return {
        "bowden": __version__,
        "law": law.name,
        "gains": dict(law.gains._asdict()),
        "reference": reference.describe(),
        "plant": _plain(suit) | {"extensor_spool_radius": prepared.extensor_radius},
        "sample_time": suit.sample_time,
        "motor_resistance": suit.motor.resistance,
        "torque_constant": suit.motor.torque_constant * suit.motor.gear,
        **own,
    }


def _plain(value: Any) -> Any:
    """NamedTuples as objects, tuples as lists, for JSON."""
    if hasattr(value, "_asdict"):
        return {name: _plain(part) for name, part in value._asdict().items()}
    return [_plain(part) for part in value] if isinstance(value, tuple) else value
