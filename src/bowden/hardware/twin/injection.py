"""Faults that the twin can be given, and when each is there. Pure."""

import math
from typing import NamedTuple

from bowden.core.errors import ParameterError, near


class Kind(NamedTuple):
    """One kind of fault."""

    meaning: str
    side: bool = False
    """True if it is of one encoder, ``joint`` or ``motor``."""
    amount: float | None = None
    """How much when nothing is said; None where there is nothing to say."""
    unit: str = ""
    moment: bool = False
    """True if it happens once, rather than lasting."""
    least: float = 0.0
    """Smallest amount."""
    most: float = 1e6
    """Largest amount."""


KINDS: dict[str, Kind] = {
    "silence": Kind("the drive sends nothing"),
    "deaf": Kind("the drive receives nothing"),
    "late_pdos": Kind("the drive's PDOs arrive late", amount=5.0, unit="ms"),
    "dropped_pdos": Kind("a share of the drive's PDOs is lost", amount=0.3, unit="1", most=1.0),
    "doubled_pdos": Kind("a second device sends with the drive's number: each of its readings comes twice"),
    "watch_off": Kind("another device switches off the drive's watch over its host"),
    "bus_off": Kind("the drive's controller has left the bus"),
    "queue_full": Kind(
        "nothing goes over the bus any more: the host's queue takes this many frames, and refuses the next",
        amount=100.0,
        unit="frames",
    ),
    "commands_ignored": Kind("the drive answers on, and obeys no command"),
    "kick": Kind(
        "when it is enabled the drive pulls towards a target that it remembers, this far off, for 20 ms",
        amount=20.0,
        unit="deg",
        least=-1e6,
    ),
    "delayed_readings": Kind("the drive's PDOs carry what was measured before", amount=10.0, unit="cycles"),
    "drive_fault": Kind(
        "the drive goes into fault with this error code", amount=0x2310, unit="code", moment=True, least=1, most=0xFFFF
    ),
    "emergency_stop": Kind("the emergency stop is pressed: its input opens, and the torque goes"),
    "reboot": Kind("the drive loses its supply for a moment", moment=True),
    "encoder_frozen": Kind("an encoder keeps its value", side=True),
    "encoder_spike": Kind("an encoder jumps for one cycle in ten", side=True, amount=10.0, unit="deg", least=-1e6),
    "encoder_offset": Kind("an encoder is off by an angle", side=True, amount=400.0, unit="deg", least=-1e6),
    "encoder_flipped": Kind("an encoder counts the wrong way from here on", side=True),
    "encoder_zero": Kind("an encoder reads 0 counts, as one that has not begun", side=True),
    "encoder_nan": Kind("an encoder sends the number that means no value, −2³¹", side=True),
    "broken_cable": Kind("the cable is torn: the joint goes where its spring pulls it"),
    "slack_cable": Kind("the cable has slack, at the spool", amount=20.0, unit="deg"),
    "over_temperature": Kind("the power stage is this hot", amount=95.0, unit="°C", least=-273.15),
    "inert": Kind("the motor gives no torque and does not turn; the drive answers on, and reports no fault"),
    "mode_left": Kind("the drive leaves its mode by itself, without a fault", moment=True),
    "foreign_replies": Kind("frames of another drive's number come in between"),
    "saturated": Kind("the fields of the drive's replies stand at their ends, but for the position's"),
    "position_saturated": Kind(
        "the field of the motor's position stands at an end, 1 or -1", amount=1.0, unit="1", least=-1.0, most=1.0
    ),
    "turns_lost": Kind(
        "the drive loses count of its motor's turns, by so many: what it reports and what it controls jump together",
        amount=1.0,
        unit="turns",
        moment=True,
        least=-1000.0,
        most=1000.0,
    ),
    "short_frames": Kind("frames with readings are cut to this many bytes", amount=7.0, unit="bytes", most=63.0),
    "bit_errors": Kind(
        "a share of all frames is destroyed, as with a loosened ground: an error frame comes in their place",
        amount=0.01,
        unit="1",
        most=1.0,
    ),
    "joint_silence": Kind("the joint's encoder, where it is a device of its own, sends nothing"),
    "load_silence": Kind("the load cell, where it is a device of its own, sends nothing"),
    "load_stuck": Kind("the load cell keeps its value"),
    "load_saturated": Kind(
        "the load cell stands at an end of its range, 1 or -1", amount=1.0, unit="1", least=-1.0, most=1.0
    ),
    "load_sign": Kind("the load cell has the wrong sign from here on"),
    "load_drift": Kind("the load cell's zero drifts, in N or N·m a second", amount=10.0, unit="1/s", least=-1e6),
    "load_slow": Kind("the load cell measures and sends at this rate", amount=12.0, unit="Hz", least=0.1),
    "load_half": Kind("the load cell sends half the bytes of its frames"),
    "load_doubled": Kind("the load cell sends every frame twice"),
    "over_current": Kind("the motor draws this current", amount=30.0, unit="A", least=-1e6),
}

UNCOUNTED = "it answers questions, and what comes beyond its answers is not counted"
"""Why families without SYNC lack ``doubled_pdos``."""

OF_LOAD_CELL = tuple(name for name in KINDS if name.startswith("load_"))
"""Those of a load cell, which a rig may have or not."""

OF_CABLE = ("broken_cable", "slack_cable")
"""Those that change a cable's inside."""

SIDES = ("joint", "motor")


class Injection(NamedTuple):
    """A fault with its parameters, and the time from which to which it is there."""

    name: str
    side: str
    """``joint``, ``motor`` or nothing."""
    amount: float
    """In the kind's unit; NaN for none."""
    start: float = -math.inf
    """[s]"""
    end: float = math.inf
    """[s]"""

    def active(self, now: float) -> bool:
        """True if it is there at that time [s]."""
        return self.start <= now < self.end


def parse(text: str) -> Injection:
    """A fault as it is written: its name, the encoder where it is of one, and an amount where it has one.

    >>> parse("encoder_frozen joint")
    Injection(name='encoder_frozen', side='joint', amount=nan, start=-inf, end=inf)
    >>> parse("drive_fault 0x4210").amount == 0x4210
    True

    Raises:
        ParameterError: an unknown fault, a word too many or too few, an amount that is none or out of its range.
    """
    name, *words = text.split() or [""]
    kind = KINDS.get(name)
    if kind is None:
        raise ParameterError(
            f"there is no fault {name!r}", expected=near(name, KINDS), do="--inject list shows them all"
        )
    side = ""
    if kind.side:
        if not words or words[0] not in SIDES:
            raise ParameterError(f"{name} is of an encoder", expected=f"{name} joint, or {name} motor")
        side = words.pop(0)
    amount = math.nan if kind.amount is None else kind.amount
    if words and kind.amount is not None:
        word = words.pop(0)
        try:
            amount = float(int(word, 16)) if word.lower().startswith("0x") else float(word)
        except ValueError:
            amount = math.nan
        if not kind.least <= amount <= kind.most:
            expected = f"a number from {kind.least:g} to {kind.most:g} ({kind.unit})"
            raise ParameterError(f"{name}: {word!r} is not a number for it", expected=expected)
    if words:
        raise ParameterError(f"{name}: {' '.join(words)!r} is too much", expected=f"like {name} {side}".rstrip())
    return Injection(name, side, amount)
