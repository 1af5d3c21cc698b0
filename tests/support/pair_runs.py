"""Runs of two motors on one joint in the loop's own process, as a rig has them, on twins of this rig or of another."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from axes_rig import AxesRig
from bowden.control.law import Law
from bowden.core.signals import DriveReading
from bowden.hardware.ports import Power, TorqueLeft
from bowden.hardware.twin.bench import TwinBench
from bowden.hardware.twin.of_rig import twin_pair_of
from bowden.live.live_run import live_run
from bowden.rig.rig import Rig
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


def mirrors(benches: Sequence[TwinBench], contraction: float) -> tuple[Mirror, Mirror]:
    """Both drives of a pair, the one that pulls upwards first, with the co-contraction in their homes [rad]."""
    up, down = (Mirror(SimulatedDrive(one), contraction, sign) for one, sign in zip(benches, (1.0, -1.0), strict=True))
    return up, down


def pair_run(
    folder: Path,
    rig: Rig,
    *,
    twins: Rig | None = None,
    laws: tuple[Law, ...] = (),
    between: Callable[[AxesRig], None] = lambda run: None,
    **more: Any,
) -> AxesRig:
    """A run of a rig whose agonist pulls upwards.

    Args:
        folder: for what the run keeps.
        rig: with a pair, and no other axes.
        twins: the rig that is played; the same where it is not given.
        laws: in place of the rig's, the agonist's first.
        between: called with the run between its cycles.
        more: for `AxesRig`.
    """
    live = live_run(rig)
    played = twin_pair_of(twins or rig, 1.0)
    return AxesRig(
        folder,
        live.law,
        live.names,
        benches=mirrors([one.plant for one in played], rig.pair.co_contraction),  # type: ignore[misc]
        joints=live.joints,
        pair=live.paired,
        each=tuple(axis.limits for axis in live.axes),
        laws=laws or tuple(axis.law for axis in live.axes),
        scripts=tuple(axis.script() for axis in live.axes),
        between=between,
        **more,
    )
