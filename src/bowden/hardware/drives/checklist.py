"""The one checklist of bring-up, which each family fills with its frames and settings. Nothing in it has power.

1. Alone: the bus is listened to before anything is said on it, and to the end: another master refuses (`Conversation`).
2. Who is there: the drive answers by its number, and its firmware or profile is one that is known here.
3. Without torque: whoever finds the motor under torque must not touch it (`refuse_torque`).
4. What is set: settings without which a run is another than was checked (`check_settings`), and scales.
5. Where it is: the motor stands still, both angles are there, and home is as the rig has it.
6. Limits: the rig's are within the drive's own, which are never widened (`check_limits`).
7. The watchdog: set or read back, and tried where possible: all that happens when this computer dies rests on it.
8. Alone still, and of a drive in fault which one.
"""

import math
from collections.abc import Callable, Iterable
from typing import NamedTuple, TypeVar

from bowden.core.clock import SECOND
from bowden.core.errors import DriveError
from bowden.core.signals import DriveState
from bowden.core.units import DEGREES
from bowden.hardware.buses.link import BusPort
from bowden.hardware.buses.opening import Frame
from bowden.hardware.buses.place import EXTENDED
from bowden.hardware.drives.scale import MotorLimits, Scale, SuitScale

LISTENING = 0.5
"""So long the bus is listened to first, where a drive's watchdog is shorter: another master speaks in it [s]."""
MOST_LISTENED = 20_000
"""Frames after which a bus has been listened to for long enough: more than it carries in a second."""
TRIES = 3
"""Of a question, since a frame may get lost."""

Said = TypeVar("Said")


class Found(NamedTuple):
    """Result of a bring-up."""

    identity: str
    """Identity of the drive, in one line."""
    motor: Scale | SuitScale
    joint: Scale | None
    """Of the joint's encoder at the drive; None where it is a device of its own."""
    limits: MotorLimits
    state: DriveState
    error: int
    """Its error, 0 for none."""
    serial: str
    rated_torque: float = 0.0
    """Of which a CiA 402 drive tells thousandths, 6076h [N·m]."""


class Conversation:
    """Questions and answers with one drive; frames of other masters are noticed.

    Args:
        port: of its bus, while no cycle runs.
        node: the drive's number.
        is_foreign: whether a frame is one that only this host may send, or an answer to somebody else.
        timeout: how long an answer may take [s].
        others: programs that may be another master.
    """

    def __init__(
        self,
        port: BusPort,
        node: int,
        is_foreign: Callable[[int, bytes], bool],
        timeout: float = math.nan,
        others: str = "the other program",
    ) -> None:
        self.port, self.number, self.name, self._timeout = port, node, f"node {node}", timeout
        self._is_foreign, self._others = is_foreign, others
        self.foreign: int | None = None
        """Identifier of the first frame that nobody but this host may send; None where none has come."""

    def check_alone(self) -> None:
        """No other master may have been heard.

        Raises:
            DriveError: one has been.
        """
        if self.foreign is not None:
            raise DriveError(
                f"another master speaks to {self.name}, or it answers one (a frame {self.foreign & ~EXTENDED:03X}h)",
                expected="one host",
                do=f"end {self._others} first, or correct node_id in [drive]",
            )

    def listen(self, span: float) -> None:
        """Listen to the bus for a `span` [s], and say nothing.

        Raises:
            DriveError: another master speaks.
        """
        self.wait(span, lambda identifier, data: None)
        self.check_alone()

    def wait(self, span: float, matches: Callable[[int, bytes], Said | None]) -> Said | None:
        """What the first frame says that matches, of those that come within a `span` [s]; None of none.

        What waits at its end is looked at too: a computer that stalls is no silence.
        """
        clock = self.port.clock
        ends = clock.now() + round(span * SECOND)
        for _ in range(MOST_LISTENED):
            left = (ends - clock.now()) / SECOND
            frame = self.port.wait_for(lambda identifier, data: True, max(0.0, left))
            if frame is None:
                if left <= 0.0:
                    break
                continue
            if self.foreign is None and self._is_foreign(*frame):
                self.foreign = frame[0]
            said = matches(*frame)
            if said is not None:
                return said
        return None

    def ask(self, question: Frame, matches: Callable[[int, bytes], Said | None], tries: int = TRIES) -> Said | None:
        """The answer to a question, which is asked again where none comes in time; None of none."""
        for _ in range(tries):
            self.port.send_now(*question)
            said = self.wait(self._timeout, matches)
            if said is not None:
                return said
        return None


def refuse_torque(name: str, state: str, do: str) -> DriveError:
    """Error for a drive that already has torque, in a `state`."""
    return DriveError(f"{name} runs already: it is in {state}", expected="a drive without torque", do=do)


class Setting(NamedTuple):
    """Requirement on a setting of the drive."""

    name: str
    fine: Callable[[float], bool]
    expected: str
    why: str = ""
    """Consequence of another value."""
    do: str = ""


def is_about(value: float, same: float = 0.0) -> Callable[[float], bool]:
    """Test that a setting equals a value within a relative tolerance `same`."""
    return lambda found: abs(found - value) <= same * abs(value)


def check_settings(name: str, read: Callable[[str], float], settings: Iterable[Setting]) -> None:
    """See that a drive is set up as a run needs it.

    Raises:
        DriveError: the first setting that is otherwise.
    """
    for setting in settings:
        found = read(setting.name)
        if not setting.fine(found):
            raise DriveError(
                f"{name} {setting.why or 'is set otherwise'} ({setting.name} is {found:g})",
                expected=setting.expected,
                do=setting.do,
            )


class LimitKey(NamedTuple):
    """The key of rig.toml that sets a limit which the drive has too."""

    name: str
    """Of the limit, as a message has it."""
    key: str
    section: str
    unit: str
    """In the file."""
    factor: float = DEGREES
    """From radians, or amperes, to that unit."""
    lower: bool = False
    """True for a lower end."""


LOWEST = LimitKey("lowest motor angle", "motor_low_deg", "limits", "°", lower=True)
HIGHEST = LimitKey("highest motor angle", "motor_high_deg", "limits", "°")
SPEED = LimitKey("speed limit", "motor_speed_deg_per_s", "limits", "°/s")
REACH = LimitKey("following error", "target_reach_deg", "limits", "°")
CURRENT = LimitKey("current limit", "current_limit_a", "motor", " A", 1.0)


class DriveLimit(NamedTuple):
    """A limit of the rig against the drive's own; beyond it where it is larger, of a lower end where it is smaller."""

    of: LimitKey
    rig: float
    """At the spool, on a suit in the joint's coordinate; NaN, or infinite, of a rig that asks for none [rad, rad/s,
    A]."""
    own: float
    """Likewise."""
    where: str
    """Object or setting that says the drive's."""


def check_limits(limits: Iterable[DriveLimit], do: str) -> None:
    """See that a rig is within the drive's own limits.

    Args:
        limits: in the order in which they are looked at.
        do: how the drive's are extended.

    Raises:
        DriveError: the first that is beyond, with the key of rig.toml and a value of it that is within.
    """
    for of, rig, own, where in limits:
        if abs(rig) < math.inf and not (rig >= own if of.lower else rig <= own):
            do = f"extend the drive's {do}"
            if own > 0.0 or of in (LOWEST, HIGHEST):
                fits = f"{of.key} = {_rounded(of.factor * own, up=of.lower):g}"
                do = f"write {fits} into [{of.section}], and let bowden check say what else has to follow; or {do}"
            raise DriveError(
                f"the rig's {of.name} is {of.factor * rig:.6g}{of.unit}, beyond the drive's own "
                f"{of.factor * own:.6g}{of.unit} ({where})",
                expected="a rig within the drive's limits",
                do=do,
            )


def _rounded(value: float, *, up: bool) -> float:
    """The value in four digits, rounded up or down.

    >>> _rounded(599.9999, up=False), _rounded(-0.123456, up=True), _rounded(0.0, up=True)
    (599.9, -0.1234, 0.0)
    """
    size = 10.0 ** (3 - math.floor(math.log10(abs(value)))) if value else 1.0
    return (math.ceil if up else math.floor)(value * size) / size
