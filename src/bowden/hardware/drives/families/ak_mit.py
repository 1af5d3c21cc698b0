"""CubeMars AK series in MIT mode: `bowden.hardware.drives.ak_drive`, played by `bowden.hardware.twin.ak_node`."""

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from bowden.hardware.drives import on_can
from bowden.hardware.drives.ak_parameters import AkParameters, check_parameters, completed, most_push
from bowden.hardware.drives.family import DriveFamily, DriveNeeds, TwinProcess
from bowden.hardware.drives.findings import FINDINGS
from bowden.hardware.ports import Drive

if TYPE_CHECKING:
    from bowden.hardware.buses.link import Links
    from bowden.hardware.twin.plant import TwinPlant


def open_drive(parameters: AkParameters, links: "Links") -> Drive:
    """The drive on its bus."""
    from bowden.hardware.drives.ak_drive import AkDrive  # with python-can

    return AkDrive(parameters, links)


def twin(
    parameters: AkParameters, plant: "TwinPlant", clock: Callable[[], float], options: Sequence[str]
) -> TwinProcess:
    """The digital twin; an option is an object of the joint's encoder that is otherwise, as ``6501:0=8192``.

    Raises:
        ParameterError: an option that is none.
        DriveError: the bus cannot be used, or has a twin already.
    """
    from bowden.hardware.twin.ak_node import AkNode
    from bowden.hardware.twin.twin import NodePlace, Twin

    check_parameters(parameters)
    overrides = dict(on_can.object_option(text) for text in options)
    place = NodePlace(parameters.interface, parameters.channel, parameters.bitrate, parameters.node_id)
    return Twin(place, clock, lambda send, journal: AkNode(parameters, plant, send, journal, overrides))


def largest_push(parameters: AkParameters, needs: DriveNeeds) -> float:
    """Half of what the largest current gives [N·m]."""
    return most_push(
        parameters._replace(gear=needs.gear, torque_constant=needs.torque_constant, current_limit=needs.current_limit)
    )


def scales(parameters: AkParameters) -> tuple[object, ...]:
    """Model and directions."""
    return (
        *(parameters.model, parameters.motor_direction, parameters.joint),
        *(parameters.joint_counts_per_turn, parameters.joint_direction),
    )


def explain(code: int) -> str:
    """What the code of an emergency means."""
    from bowden.hardware.drives.ak_frames import error_text

    return FINDINGS.get(code) or error_text(code)


FAMILY = DriveFamily(
    name="ak_mit",
    title="A drive of the CubeMars AK series in MIT mode, and the joint's encoder beside it; `bowden twin` plays both.",
    parameters=AkParameters(),
    completed=completed,
    open=open_drive,
    twin=twin,
    moved=on_can.moved,
    address=on_can.address,
    control=on_can.control,
    claim=on_can.claim_host,
    watchdog=lambda parameters: parameters.watchdog or math.inf,
    most_push=largest_push,
    measures_tension=lambda _: False,
    scales=scales,
    homed=lambda parameters: parameters.home != "here",
    simulated=on_can.simulated,
    explain=explain,
    measures_joint=lambda parameters: parameters.joint != "none",
    unseen_watch=lambda parameters: (
        f"the CAN timeout of an {parameters.model} is set with its maker's tool, and no frame shows whether it is"
    ),
    no_limb=lambda parameters: parameters.no_limb,
)
