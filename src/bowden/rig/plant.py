"""What moves in a rig and how: its plant, its reference and the bend of its sheath over a run."""

import math
from typing import Any, cast

import numpy as np

from bowden.control.reference import PeriodicMinimumJerk, Trajectory
from bowden.core.errors import ParameterError
from bowden.models.cable.bouc_wen import BoucWen, upright
from bowden.models.cable.sheath import Sheath
from bowden.models.cable.sheath_path import BendPath
from bowden.plants import plant_file
from bowden.plants.bench import Bench
from bowden.plants.cables import plant_of_model
from bowden.plants.counting import NOT_SAID, Encoders
from bowden.plants.estimated import Estimated
from bowden.plants.identified import IdentifiedCable
from bowden.plants.plant import Plant
from bowden.plants.predicted import SCHEDULED
from bowden.plants.pushing import Pushing, pushing_of
from bowden.plants.suit_parts import Suit
from bowden.plants.user_plant import UserPlant
from bowden.plants.worn_suit import elbow_dead_zone, suit_of
from bowden.rig import emg_run as emg_runs
from bowden.rig.emg_run import EmgRun
from bowden.rig.joint_sensor import model_of
from bowden.rig.rig import Rig
from bowden.sensing.joint_angle import JointModel

_LOOKED_AT, INSTANTS = 60.0, 601
"""Of a reference: for how long it is looked at [s], and how often."""


def turned(rig: Rig) -> bool:
    """True if motor angles are counted the other way round, because the joint falls when the motor rises."""
    if rig.suit.worn:  # the motor is counted in the joint's coordinate
        return False
    return plain_cable(rig).slope < 0.0 if rig.plant is None else rig.own_plant.turned


def plain_cable(rig: Rig) -> BoucWen:
    """The cable in its plain Bouc–Wen form, of a scheduled one at the bend at which the run begins."""
    if isinstance(rig.cable, IdentifiedCable) and scheduled_by_bend(rig):
        begun = rig.bend.path(rig.sheath, rig.duration, rig.seed)(np.zeros(1))
        return rig.cable.with_parameters({"bend": float(np.ravel(begun)[0])}).bouc_wen
    return rig.cable if isinstance(rig.cable, BoucWen) else rig.cable.bouc_wen  # type: ignore[union-attr]


def scheduled_by_bend(rig: Rig) -> bool:
    """True if the scenario's bend is what schedules the cable, and not the bend among its parameters."""
    return (
        isinstance(rig.cable, IdentifiedCable)
        and rig.cable.best == SCHEDULED
        and "bend_low" in rig.cable.model().parameters
    )


def bench(rig: Rig) -> Bench:
    """The bench, with the cable's plain Bouc–Wen model; one of a negative slope is turned round."""
    return Bench(
        cable=upright(plain_cable(rig)),
        sheath=Sheath(rig.sheath.bend, (1.0 if rig.plant else rig.width) * rig.sheath.gap, rig.sheath.loss),
        servo=rig.servo,
        motor=rig.motor,
        joint_encoder=rig.joint_encoder,
        motor_encoder=rig.motor_encoder,
        sample_time=rig.sample_time,
        delay=rig.delay,
        substeps=rig.substeps,
    )


def worn(rig: Rig) -> Suit | None:
    """The suit on an arm in place of the bench; None where none is worn.

    Raises:
        ParameterError: a wearer or a part that cannot be.
    """
    if not rig.suit.worn:
        return None
    identified = rig.cable if isinstance(rig.cable, IdentifiedCable) else None
    return suit_of(rig.suit, rig.wearer, rig.bench, rig.sheath.gap, identified)


def own_plant(rig: Rig) -> UserPlant:
    """The user's plant, with the parts that it defines itself.

    Raises:
        ParameterError: the rig has none, or its file cannot be used.
    """
    if rig.plant is None or isinstance(rig.plant, str):  # never text once the rig is made
        raise ParameterError(f"{rig.origin}: the rig has no plant of its own", do="name one in cable.plant")
    return plant_file.loaded(rig.plant)


def cabled(rig: Rig) -> Bench | UserPlant:
    """What is moved where no suit is worn: a plant of the user's own, or the bench round its cable.

    The cable is the model that an identification recommends; a straight line is no cable with hysteresis, and the
    plain Bouc–Wen model stands for it.

    Raises:
        ParameterError: a part that cannot be.
    """
    if rig.plant is not None:
        return rig.own_plant._replace(**{name: getattr(rig.bench, name) for name in plant_file.PARTS})
    if not isinstance(rig.cable, IdentifiedCable) or rig.cable.simulated == "bouc_wen":
        return rig.bench
    return plant_of_model(rig.cable.best, rig.cable.model().parameters, rig.bench)


def slope(rig: Rig) -> float:
    """Joint motion per motor motion where no suit is worn; 1 of one's own plant that does not say [rad/rad]."""
    if rig.plant is None:
        return rig.bench.cable.slope
    return rig.own_plant.slope if rig.own_plant.slope > 0.0 else 1.0


def moved(rig: Rig) -> Bench | UserPlant | Suit:
    """What is moved: the suit where one is worn, and else `cabled`.

    Raises:
        ParameterError: a part that cannot be.
    """
    return rig.worn or rig.cabled


def simulated_plant(rig: Rig) -> Plant:
    """The plant with what stands round it: the drive's brake, under the wearer's push its load cell, and where no
    encoder measures the joint its estimate.
    """
    plant: Any = rig.cabled if rig.worn is None else rig.worn._replace(brake=rig.brake)
    if rig.worn is not None and rig.pushing is not None:
        plant = plant._replace(load_cell=rig.pushing.cell)
    return cast(Plant, Estimated(plant, rig.joint_model)) if rig.joint_sensor.estimated else plant


def joint_model(rig: Rig) -> JointModel:
    """Knowledge of cable and sensor for the estimate of the joint's angle, where no encoder measures it."""
    if rig.worn is not None:  # the motor is counted in the joint's coordinate
        return model_of(rig.joint_sensor, 1.0, 0.0, 0.5 * elbow_dead_zone(rig.worn.flexor.half_width))
    zero = 0.0 if math.isnan(rig.knowledge.motor_zero) else rig.knowledge.motor_zero
    return model_of(rig.joint_sensor, rig.slope, zero, 0.5 * rig.basis.width * rig.slope)


def pushing(rig: Rig) -> Pushing | None:
    """In place of the reference, where the wearer's push makes it.

    Raises:
        ParameterError: a virtual elbow that cannot be, or one without a suit.
    """
    return pushing_of(rig.admittance, rig.worn)


def emg_run(rig: Rig) -> EmgRun | None:
    """In place of the reference, where EMG makes it.

    Raises:
        ParameterError: settings that do not fit one another.
        StreamError: what names no source.
    """
    return emg_runs.emg_run(rig.emg)


def trajectory(rig: Rig) -> Trajectory:
    """Where the joint shall be; by EMG, the largest motion that it can ask for, unless the rig is `offline`."""
    run = rig.emg_run
    if run is None or hasattr(rig.reference, "content"):
        return rig.reference
    intent = run.course.intent  # there and back without a rest: what a law is checked with
    return PeriodicMinimumJerk(intent.low, intent.high, 2.0 * intent.duration)


def reference_ends(rig: Rig) -> tuple[float, float]:
    """Least and largest angle of the reference [rad]."""
    path = rig.trajectory.sample(np.linspace(0.0, min(rig.duration, _LOOKED_AT), INSTANTS))[:, 0]
    return float(path.min()), float(path.max())


def begin(rig: Rig) -> float:
    """Where the trajectory starts [rad]."""
    return float(rig.trajectory.sample(np.zeros(1))[0, 0])


def bend_path(rig: Rig) -> BendPath:
    """How the sheath is bent over the run."""
    return rig.bend.path(rig.bench.sheath, rig.duration, rig.seed)


def start_motor(rig: Rig) -> float:
    """Motor angle at which a run begins [rad]."""
    if rig.initial_motor is not None:
        return (-1 if rig.turned else 1) * rig.initial_motor
    if rig.suit.worn:  # the motor is counted in the joint's coordinate
        return rig.begin
    return rig.cabled.resting_motor(rig.begin, float(rig.bend_path(np.zeros(1))[0]))


def encoders(rig: Rig) -> Encoders:
    """How the encoders of the cable's log read; as if nobody said it on a suit, whose joint has another sensor."""
    own = isinstance(rig.cable, IdentifiedCable) and rig.worn is None
    return rig.cable.encoders if own else NOT_SAID  # type: ignore[union-attr]
