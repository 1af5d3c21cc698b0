"""What a twin of a rig moves: the suit where one is worn, a plant of the user's own, or the bench round its cable."""

from collections import deque
from typing import Any, cast

from bowden.hardware.drives.of_rig import cell_place
from bowden.hardware.twin.bench import SharedJoint, TwinBench
from bowden.hardware.twin.plant import FOLLOW, TwinPlant
from bowden.hardware.twin.suit import TwinSuit
from bowden.hardware.twin.user import TwinUser
from bowden.plants.user_plant import UserPlant
from bowden.rig.families import TwinProcess
from bowden.rig.joints import RigJoint
from bowden.rig.rig import Rig


def attach_load_cell(running: TwinProcess, rig: Rig) -> None:
    """Put the twin of the rig's load cell beside that of its drive, where it is a device of its own.

    Raises:
        DriveError: its bus cannot be used.
    """
    cell = rig.load_cell
    if not cell.enabled:
        return
    from bowden.hardware.twin.sensor_node import LoadCellNode

    place, shared = cell_place(rig.drive_parameters, cell)
    running.attach(lambda plant, faults, send: LoadCellNode(cell, plant, faults, send), None if shared else place)


def played(joint: RigJoint, now: float) -> list[tuple[Any, TwinPlant]]:
    """The drives of a joint's motors, their parameters whole, with what is behind them; of several one joint that all
    their cables pull.

    A cable that pulls downwards is played in the coordinate in which its motor pulls upwards.

    Args:
        joint: of a rig.
        now: what the time is [s].

    Raises:
        ParameterError: a plant that cannot be.
    """
    if not joint.shared:
        return [(joint.first.drive_parameters, twin_plant_of(joint.first, now))]
    drives, benches, signs = [], [], []
    for place, one in enumerate(joint.motors):
        rig, sign = one.rig, -one.rig.limits.slack_sign
        cabled = rig.cabled
        assert not isinstance(cabled, UserPlant)  # which such a joint refuses
        bench = TwinBench(cabled, rig.bend_path, rig.duration, rig.seed + place, sign * rig.start_motor, now)
        benches.append(bench)
        signs.append(sign)
        drives.append(rig.drive_parameters if sign > 0.0 else mirrored(rig.drive_parameters))
    SharedJoint(benches, signs, joint.settings.stiffness)
    each = zip(drives, benches, joint.motors, strict=True)
    return [(drive, late(bench, _delay(one.rig))) for drive, bench, one in each]


def _delay(rig: Rig) -> float:
    """Of a command beyond the cycle that sampling, computing and sending take anyhow [s]."""
    return (rig.delay - 1) * rig.sample_time


def twin_plant_of(rig: Rig, now: float) -> TwinPlant:
    """The rig's plant in real time, at rest where a run begins; the joint's spring is at its rest where the rig's is.

    Args:
        rig: any.
        now: what the time is [s].

    Raises:
        ParameterError: a plant that cannot be.
    """
    return late(_at_rest(rig, (rig.bend_path, rig.duration, rig.seed, rig.start_motor, now)), _delay(rig))


def _at_rest(rig: Rig, rest: tuple[Any, ...]) -> TwinPlant:
    if rig.worn is not None:
        return TwinSuit(rig.worn._replace(brake=rig.brake), *rest)
    plant = rig.cabled
    if isinstance(plant, UserPlant):
        return TwinUser(plant, *rest)
    motor = plant.motor._replace(pretension=plant.motor.pretension - plant.motor.spring * rig.home)
    return TwinBench(plant._replace(motor=motor), *rest)


_TURNED = ("motor_direction", "motor_home", "motor_hint", "joint_direction", "joint_home")


def mirrored(drive: Any) -> Any:
    """A drive's parameters whose angles have the other sign, and whose counts are the same.

    Args:
        drive: parameters of a family, whole.
    """
    turned = {name: -getattr(drive, name) for name in _TURNED if hasattr(drive, name)}
    low, high = -drive.needs.highest_motor, -drive.needs.lowest_motor
    return drive._replace(**turned, needs=drive.needs._replace(lowest_motor=low, highest_motor=high))


def late(plant: TwinPlant, delay: float) -> TwinPlant:
    """The plant, whose motor begins to follow each target a time after it was set.

    Args:
        plant: behind the twin's drive.
        delay: what the loop itself does not make [s]; with none the plant is as it was.
    """
    return cast(TwinPlant, _Late(plant, delay)) if delay > 0.0 else plant


class _Late:
    """All of a plant but for when its targets count. Power and brake act at once, and forget what is on its way."""

    def __init__(self, plant: TwinPlant, delay: float) -> None:
        self.__dict__.update(_plant=plant, _delay=delay, _now=0.0, _followed=False, _coming=deque())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._plant, name)

    def __setattr__(self, name: str, value: Any) -> None:
        if name != "command" or not self._followed:
            setattr(self._plant, name, value)
        elif value != (self._coming[-1][1] if self._coming else self._plant.command):
            self._coming.append((self._now + self._delay, value))

    def advance(self, now: float) -> None:
        """See `TwinPlant.advance`: each target from when it counts."""
        plant, coming = self._plant, self._coming
        while coming and (coming[0][0] <= now or plant.doing != FOLLOW):
            due, target = coming.popleft()
            plant.advance(min(due, now))
            plant.command = target
        plant.advance(now)
        self.__dict__.update(_now=now, _followed=plant.doing == FOLLOW)
