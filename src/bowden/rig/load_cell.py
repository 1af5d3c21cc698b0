"""A load cell on a CAN bus, as a rig describes it."""

from typing import Annotated, Any, Literal, NamedTuple

from bowden.core.errors import ParameterError
from bowden.core.quantity import Quantity
from bowden.core.registry import resolve

ROOM = 0.95
"""Of what a cell can tell: the largest load allowed is no more, so that it is seen before the cell saturates [–]."""


class LoadCellParameters(NamedTuple):
    """A load cell on a CAN bus; one at a drive's own input is [drive]'s.

    value = scale · (counts − zero). `bowden drive tare` finds the zero.
    """

    source: Annotated[
        Literal["none", "cia404", "can"],
        Quantity(
            "none: there is no such device; cia404: a CANopen measuring device (CiA 404); can: one that sends plain "
            "frames"
        ),
    ] = "none"
    measures: Annotated[
        Literal["tension", "torque"],
        Quantity(
            "tension of the cable, pulling positive [N]; or torque of the suit on the joint, flexing positive [N·m]"
        ),
    ] = "tension"
    interface: Annotated[
        str | None, Quantity("python-can's name of its bus; left out, the drive's", example="socketcan")
    ] = None
    channel: Annotated[str | None, Quantity("its bus; left out, the drive's", example="can1")] = None
    bitrate: Annotated[int | None, Quantity("of its bus; left out, the drive's", "bit/s", gt=0, example=1_000_000)] = (
        None
    )
    scale: Annotated[
        float, Quantity("N, or N·m, of one count; below 0 where counts fall with the load", ge=-1e6, le=1e6)
    ] = 0.01
    zero: Annotated[float, Quantity("counts without load", ge=-2147483648.0, le=4294967295.0)] = 0.0
    full_scale: Annotated[
        float,
        Quantity("load at which cell or amplifier saturate, in N or N·m; it has to be said", ge=0.0, le=1e5),
    ] = 0.0
    silence: Annotated[
        float, Quantity("age of a reading from which on it is none", "s", shown="ms", ge=1.0, le=50.0)
    ] = 10e-3
    node_id: Annotated[int, Quantity("cia404: its number on the bus", ge=1, le=126)] = 33
    input: Annotated[int, Quantity("cia404: which of its inputs", ge=1, le=199)] = 1
    sends: Annotated[
        Literal["sync", "timer"],
        Quantity("cia404: it sends at our SYNC of each cycle, or every millisecond by a timer of its own"),
    ] = "sync"
    identifier: Annotated[int, Quantity("can: of its frames", ge=1, le=0x1FFF_FFFF)] = 0x1F0
    extended: Annotated[bool, Quantity("can: whether that is one of 29 bits")] = False
    first_byte: Annotated[int, Quantity("can: where the number begins in the frame", ge=0, le=7)] = 0
    bytes: Annotated[int, Quantity("can: length of the number", ge=1, le=4)] = 2
    byte_order: Annotated[
        Literal["little", "big"], Quantity("can: which byte comes first, the low or the high one")
    ] = "little"
    signed: Annotated[bool, Quantity("can: whether the number may be below 0")] = True

    @property
    def enabled(self) -> bool:
        """True if there is such a device."""
        return self.source != "none"

    @property
    def unit(self) -> str:
        """Of its readings."""
        return "N" if self.measures == "tension" else "N·m"

    def value(self, counts: float) -> float:
        """Counts to a load [N or N·m]."""
        return self.scale * (counts - self.zero)

    def counts(self, value: float) -> float:
        """A load [N or N·m] to counts, not rounded."""
        return value / self.scale + self.zero

    @property
    def ends(self) -> tuple[int, int]:
        """Smallest and largest number that its frames can carry."""
        bits = 8 * self.bytes if self.source == "can" else 32
        if self.source == "can" and not self.signed:
            return 0, (1 << bits) - 1
        return -(1 << bits - 1), (1 << bits - 1) - 1


def check_cell(cell: LoadCellParameters, sample_time: float, most: float, key: str) -> None:
    """Refuse what makes no sense, before a bus is opened.

    Args:
        cell: of the rig.
        sample_time: of a cycle [s].
        most: largest load that the supervisor allows [N or N·m].
        key: of [limits] that says so.

    Raises:
        ParameterError: with the key and what was expected.
    """
    end = max(cell.value(count) for count in cell.ends) if cell.scale else 0.0
    rules = (
        ("scale", cell.scale != 0.0, "another number than 0"),
        ("full_scale", cell.full_scale > 0.0, f"the load at which it saturates, in {cell.unit}"),
        (
            "full_scale",
            most <= ROOM * cell.full_scale,
            f"at least {most / ROOM:.4g} {cell.unit}, above limits.{key}, or a smaller limit: beyond its range it "
            "would not see too much load",
        ),
        (
            "scale",
            end >= ROOM * cell.full_scale,
            f"numbers that reach full_scale, {cell.full_scale:g} {cell.unit}; the largest is {end:.4g}",
        ),
        ("silence", cell.silence >= 3.0 * sample_time, "three cycles at least, so that one lost frame does no harm"),
        (
            "bytes",
            cell.first_byte + cell.bytes <= 8,
            f"a number that ends within 8 bytes, from byte {cell.first_byte} on",
        ),
        ("identifier", cell.extended or cell.identifier <= 0x7FF, "at most 2047, or extended = true"),
        ("channel", cell.channel is None or bool(cell.channel.strip(".")), "the name of a bus"),
    )
    for name, fine, expected in rules:
        if not fine:
            value = 1e3 * cell.silence if name == "silence" else getattr(cell, name)
            shown = f"{value:g}" if isinstance(value, float) else repr(value)
            raise ParameterError(
                f"load_cell.{name}{'_ms' if name == 'silence' else ''} is {shown}",
                expected=expected,
                do="correct it in [load_cell]",
            )


def moved_cell(cell: LoadCellParameters, channel: str | None, interface: str | None) -> LoadCellParameters:
    """The same load cell on another bus, where one is given; one with a bus of its own stays on one of its own."""
    if not cell.enabled or cell.channel is None:
        return cell if interface is None or cell.interface is None else cell._replace(interface=interface)
    if channel is not None and not cell.channel.endswith(BESIDE):
        inside = "/" if "/" in channel else "-"  # of a folder, or a bare name
        cell = cell._replace(channel=f"{channel}{inside}{BESIDE}")
    return cell if interface is None else cell._replace(interface=interface)


def devices(drive: Any, cell: LoadCellParameters) -> list[Any]:
    """What `collision` compares: the drive's parameters and, where there is one on a bus, its load cell."""
    return [drive, resolve("hardware.drives.of_rig:device_of")(drive, cell)] if cell.enabled else [drive]


def collision(one: Any, other: Any) -> str:
    """What keeps two of the `devices` from being on one bus, where they are; empty of others."""
    said: str = resolve("hardware.drives.on_can:collision")(one, other)
    return said


BESIDE = "load-cell"
"""Ending of the name of a twin's bus for a load cell alone."""
