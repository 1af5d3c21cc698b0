"""Reasons to refuse a real drive power: a limb may be there that nothing would release or see."""

import shlex
from collections.abc import Iterable, Iterator

from bowden.core.errors import SafetyError
from bowden.rig.families import family_of
from bowden.rig.rig import Rig
from bowden.rig.settings import JointSensor


def unseen_watch(rig: Rig) -> str:
    """What the user should know of a drive that may keep its torque without its host; empty of others."""
    unseen = family_of(rig.drive).unseen_watch(rig.drive)
    if not unseen:
        return ""
    return (
        f"{unseen}; so such a drive is powered on a bare bench alone (no_limb = true in [drive]), with no suit, EMG or "
        "admittance"
    )


def limb_of(rigs: Iterable[Rig]) -> str:
    """What in these rigs means that a limb is there; empty if nothing does."""
    there = tuple(rigs)
    limbs = {
        "a suit": any(one.worn is not None for one in there),
        "EMG": any(one.emg_run is not None for one in there),
        "admittance": any(one.pushing is not None for one in there),
    }
    return next((what for what, means in limbs.items() if means), "")


def unpowered(rig: Rig, beside: Iterable[Rig] = ()) -> Iterator[SafetyError]:
    """Why a motor gets no power; nothing of one on a twin.

    Args:
        rig: of the motor.
        beside: rigs of the other motors, on which there may be a limb.
    """
    family, sensor = family_of(rig.drive), rig.joint_sensor
    if family.simulated(rig.drive):
        return
    unseen, limb = family.unseen_watch(rig.drive), limb_of((rig, *beside))
    if unseen and limb:
        yield SafetyError(
            f"{limb} means a limb, and {unseen}",
            expected="a drive whose watch over its host is tried or read back at every start",
            do="take a drive of another family for a limb; this one is for a bare bench",
        )
    elif unseen and not family.no_limb(rig.drive):
        yield SafetyError(
            f"nobody has said that no limb is in this rig, and {unseen}",
            expected="no_limb = true in [drive], for a bare bench alone",
            do="see to it as docs/drives.md says for this drive, try it by hand, and then say so",
        )
    if sensor.source == "motor" and (limb or not family.no_limb(rig.drive)):
        yield SafetyError(
            "joint_sensor.source = 'motor' does not see the joint: a torn cable looks whole, and "
            + (f"{limb} means a limb" if limb else "nobody has said that no limb is in this rig"),
            expected="an encoder, an IMU or a stretch sensor at the joint; on a bare bench no_limb = true in [drive]",
            do="fit one, or run it on a twin",
        )
    mounting, unknown = (sensor.axis, sensor.zero), JointSensor()
    if sensor.source == "imu" and sensor.gives != "angle" and mounting == (unknown.axis, unknown.zero):
        yield SafetyError(
            "axis and zero of [joint_sensor] are the default ones: where the IMU sits is not known",
            expected="those that a calibration gives",
            do=shlex.join(["bowden", "calibrate", "joint", rig.origin]),
        )


def require_power(rig: Rig, beside: Iterable[Rig] = ()) -> None:
    """Refuse what `unpowered` finds.

    Raises:
        SafetyError: the first of it.
    """
    for error in unpowered(rig, beside):
        raise error
