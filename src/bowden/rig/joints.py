"""Joints that several motors move, each by a cable that pulls it one way: what is known of one, and what one needs."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Any, NamedTuple

from bowden.core.errors import ParameterError, near
from bowden.core.quantity import Quantity
from bowden.core.toml_text import quoted
from bowden.core.units import RADIANS


class JointSettings(NamedTuple):
    """A joint that several motors move: each names it by its key `joint`, and all follow its one reference."""

    name: Annotated[
        str, Quantity("of the joint, which its motors name; the first of them has its encoder", example="elbow")
    ] = ""
    co_contraction: Annotated[
        float,
        Quantity(
            "how much further each motor pulls than where its cable would just be taut; below 0 it hangs slack",
            "rad",
            ge=-20.0,
            le=45.0,
        ),
    ] = 0.0
    stiffness: Annotated[
        float, Quantity("of each cable with what it pulls at, at the joint", "N·m/rad", gt=0.0, le=1e4)
    ] = 10.0


class RigJoint(NamedTuple):
    """A joint of a rig, with its motors."""

    settings: JointSettings
    motors: tuple[Any, ...]
    """Each a `RigMotor`; the drive of the first has the joint's encoder."""

    @property
    def name(self) -> str:
        """The joint's own or, of a joint with one motor, that motor's."""
        return self.settings.name if self.shared else str(self.motors[0].name)

    @property
    def said(self) -> str:
        """The joint in messages, or its one motor; empty of a rig with one motor."""
        return f"{'joint' if self.shared else 'motor'} {quoted(self.name)}" if self.name else ""

    @property
    def shared(self) -> bool:
        """True if several motors move it."""
        return len(self.motors) > 1

    @property
    def names(self) -> tuple[str, ...]:
        """Of its motors."""
        return tuple(one.name for one in self.motors)

    @property
    def first(self) -> Any:
        """The rig of the motor whose drive has the joint's encoder."""
        return self.motors[0].rig

    def against(self, rig: Any) -> bool:
        """True if a motor, by its rig, pulls against the first one."""
        return bool(rig.limits.slack_sign != self.first.limits.slack_sign)


_ROOM = 0.8
"""Of the distance that the supervisor allows between joint and motor [–]."""


def joints_of(motors: Sequence[Any], joints: Sequence[JointSettings], where: str) -> tuple[RigJoint, ...]:
    """The joints of a rig in the order of their first motors.

    Raises:
        ParameterError: a motor names a joint that there is not, or nobody names one that there is.
    """
    known = {one.name: one for one in joints}
    if len(known) < len(joints):
        raise ParameterError(f"{where}: two joints have one name", expected="a name of its own for each")
    moved: dict[tuple[str, str], list[Any]] = {}
    for one in motors:
        if one.joint and one.joint not in known:
            raise ParameterError(
                f"{where}: motor {quoted(one.name)} names the joint {quoted(one.joint)}",
                expected=near(one.joint, known) if known else "a [[joint]] of that name",
                do="correct it there",
            )
        moved.setdefault((one.joint, "" if one.joint else one.name), []).append(one)
    for name in known:
        if (name, "") not in moved:
            raise ParameterError(
                f"{where}: no motor moves the joint {quoted(name)}",
                expected=f"joint = {quoted(name)} in a [[motor]]",
                do="write it there, or delete the joint",
            )
    return tuple(RigJoint(known.get(name, JointSettings()), tuple(found)) for (name, _), found in moved.items())


def check_joints(joints: Sequence[RigJoint], independent: bool, where: str) -> None:
    """Refuse joints whose motors do not go together.

    Raises:
        ParameterError: see above.
    """
    for joint in joints:
        for problem, expected in _problems(joint, independent) if joint.shared else ():
            raise ParameterError(f"{where}: joint {quoted(joint.name)}: {problem}", expected=expected, do=_CORRECT)


_CORRECT = "correct it there"


def _problems(joint: RigJoint, independent: bool) -> Iterator[tuple[str, str]]:
    first, rigs = joint.first, [one.rig for one in joint.motors]
    names = " and ".join(map(quoted, joint.names))
    contraction = joint.settings.co_contraction
    if independent:
        yield "independent is true", "false: of several cables on one joint none goes on alone"
    if any(rig.reference != first.reference for rig in rigs):
        yield f"{names} have references of their own", "one: leave it to the common part"
    if any(rig.emg != first.emg for rig in rigs):
        yield f"{names} have [emg] of their own", "one: leave it to the common part"
    signs = [rig.limits.slack_sign for rig in rigs]
    if {*signs} != {-1.0, 1.0}:
        yield (
            f"limits.slack_sign of {names} are {' and '.join(f'{sign:g}' for sign in signs)}",
            "1 and -1: where one pulls, the other lets out",
        )
    limits = [rig.supervisor_limits for rig in rigs]
    if any(abs(contraction) * one.slope_high > _ROOM * one.play for one in limits):
        yield (
            f"co_contraction_deg is {contraction / RADIANS:g}",
            f"{_ROOM:g} of limits.play_deg at most, or joint and motor seem to disagree before the cables are tight",
        )
    for rig in rigs:
        if rig.suit.worn:
            yield "a suit is worn", "motors without [suit], whose one motor has both cables"
        if not hasattr(rig.drive, "motor_home"):
            yield (
                "a drive has no motor_home_deg",
                "families that have one, by which the co-contraction is set",
            )
        if rig.plant is not None:
            yield "a motor has a plant of your own", "cables, which the twin can put on one joint"
        elif rig.turned:
            yield (
                "a motor has a cable whose slope is negative",
                "joint angles that grow with each motor's, as a run needs them: direction = -1 below an identified "
                "model in [cable], if the log counted the motor the other way round than this drive does",
            )
