"""Runs of several motors on one joint in the loop's own process, as a rig has them, on twins of this rig or another."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from bowden.control.law import Law
from bowden.core.signals import DriveReading
from bowden.hardware.ports import Power, TorqueLeft
from bowden.hardware.twin.bench import TwinBench
from bowden.hardware.twin.of_rig import played
from bowden.live.live_run import live_run
from bowden.rig.rig import Rig
from motors_rig import MotorsRig
from support.simulated_drive import SimulatedDrive


class Mirror:
    """The drive of a cable that pulls downwards, as the loop knows it: of its own coordinate the other way round."""

    def __init__(self, drive: SimulatedDrive, shift: float, sign: float) -> None:
        self._drive, self._shift, self._sign = drive, shift, sign

    def bring_up(self) -> str:
        return self._drive.bring_up()

    def read(self, now: float) -> DriveReading:
        told, sign = self._drive.read(now), self._sign
        return told._replace(
            motor=sign * (told.motor - self._shift), joint=sign * told.joint, current=sign * told.current
        )

    def write(self, target: float, power: Power, now: float, torque: float = 0.0) -> None:
        self._drive.write(self._sign * target + self._shift, power, now)

    def reset_fault(self) -> None:
        self._drive.reset_fault()

    def close(self) -> TorqueLeft:
        return self._drive.close()


def mirrors(benches: Sequence[TwinBench], contraction: float) -> tuple[Mirror, ...]:
    """The drives of a joint's motors, with the co-contraction in their homes [rad]."""
    return tuple(Mirror(SimulatedDrive(one), contraction, one.sign) for one in benches)


def shared_run(
    folder: Path,
    rig: Rig,
    *,
    twins: Rig | None = None,
    laws: tuple[Law, ...] = (),
    between: Callable[[MotorsRig], None] = lambda run: None,
    **more: Any,
) -> MotorsRig:
    """A run of a rig with one joint, whose first motor pulls upwards.

    Args:
        folder: for what the run keeps.
        rig: with one joint that all of its motors share.
        twins: the rig that is played; the same where it is not given.
        laws: in place of the rig's, of each motor.
        between: called with the run between its cycles.
        more: for `MotorsRig`.
    """
    live = live_run(rig)
    (joint,) = (twins or rig).each_joint
    benches: Any = [plant for _, plant in played(joint, 1.0)]
    return MotorsRig(
        folder,
        live.law,
        live.names,
        benches=mirrors(benches, rig.joints[0].co_contraction),
        encoders=live.encoders,
        neighbours=live.neighbours,
        each=tuple(motor.limits for motor in live.motors),
        laws=laws or tuple(motor.law for motor in live.motors),
        scripts=tuple(motor.script() for motor in live.motors),
        between=between,
        **more,
    )
