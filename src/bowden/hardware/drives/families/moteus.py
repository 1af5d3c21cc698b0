"""mjbots moteus boards over CAN-FD: `hardware.drives.moteus_drive`, played by `hardware.twin.moteus_node`."""

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from bowden.core.errors import ParameterError
from bowden.hardware.drives import on_can
from bowden.hardware.drives.homing import zeroed
from bowden.hardware.drives.moteus_faults import fault_text
from bowden.hardware.drives.moteus_parameters import LOOK, MoteusParameters, check_parameters, completed
from bowden.rig.families import DriveFamily, FoundDevice, TwinProcess

if TYPE_CHECKING:
    from bowden.hardware.buses.link import Links
    from bowden.hardware.twin.plant import TwinPlant


def twin(
    parameters: MoteusParameters, plant: "TwinPlant", clock: Callable[[], float], options: Sequence[str]
) -> TwinProcess:
    """The digital twin; an option is a register or a setting that is otherwise, as ``0x102=4``.

    Raises:
        ParameterError: an option that is none.
        DriveError: the bus cannot be used, or has a twin already.
    """
    from bowden.hardware.twin.moteus_node import MoteusNode
    from bowden.hardware.twin.twin import Twin

    check_parameters(parameters)
    overrides = dict(_override(text) for text in options)
    place = on_can.node_place(parameters)._replace(fd=True, data_bitrate=parameters.data_bitrate)
    return Twin(place, clock, lambda send, journal: MoteusNode(parameters, plant, send, journal, overrides))


def _override(text: str) -> tuple[int | str, float | None]:
    """``0x102=4``, ``servo.timeout_mode=12``; ``none`` takes it away."""
    name, equals, said = text.partition("=")
    try:
        value = None if said == "none" else float(said)
        key: int | str = int(name, 16) if name.startswith("0x") else name
    except ValueError:
        equals = ""
    if not equals or not name:
        raise ParameterError(f"--object is {text!r}", expected="like 0x102=4, or servo.timeout_mode=12")
    return key, value


def scales(parameters: MoteusParameters) -> tuple[float, ...]:
    """What makes angles of both positions."""
    return (
        *(parameters.output_ratio, parameters.motor_direction),
        *(float(parameters.joint_source), parameters.joint_direction),
    )


def probe(parameters: MoteusParameters, links: "Links") -> Sequence[FoundDevice]:
    """All drives of this family on the bus."""
    from bowden.hardware.drives import moteus_probe  # with python-can

    return moteus_probe.probe(parameters, links)


FAMILY = DriveFamily(
    name="moteus",
    title="A mjbots moteus board on CAN-FD, with the joint's encoder at its auxiliary port; `bowden twin` plays it.",
    parameters=MoteusParameters(),
    completed=completed,
    open=on_can.opening("moteus_drive.MoteusDrive"),
    twin=twin,
    moved=on_can.moved,
    address=on_can.address,
    control=on_can.control,
    claim=on_can.claim_host,
    watchdog=lambda parameters: parameters.watchdog + LOOK,
    most_push=on_can.pushing(),
    measures_tension=lambda _: False,
    scales=scales,
    homed=lambda parameters: parameters.home == "counts",
    simulated=on_can.simulated,
    explain=fault_text,
    probe=probe,
    zeroed=zeroed,
    zero_hint="A moteus board knows its place after a loss of its supply only by an encoder at its output (off-board "
    "source); otherwise tell it where it is with tview, d exact TURNS, after each start, or set "
    'home = "here".',
)
