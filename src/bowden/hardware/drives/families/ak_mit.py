"""CubeMars AK series in MIT mode: `bowden.hardware.drives.ak_drive`, played by `bowden.hardware.twin.ak_node`."""

import math
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

from bowden.hardware.drives import on_can
from bowden.hardware.drives.ak_parameters import AkParameters, check_parameters, completed, most_push
from bowden.hardware.drives.findings import FINDINGS
from bowden.hardware.drives.homing import zeroed
from bowden.rig.families import DriveFamily, FoundDevice, TwinProcess

if TYPE_CHECKING:
    from bowden.hardware.buses.link import Links
    from bowden.hardware.twin.plant import TwinPlant


def twin(
    parameters: AkParameters, plant: "TwinPlant", clock: Callable[[], float], options: Sequence[str]
) -> TwinProcess:
    """The digital twin; an option is an object of the joint's encoder that is otherwise, as ``6501:0=8192``.

    Raises:
        ParameterError: an option that is none.
        DriveError: the bus cannot be used, or has a twin already.
    """
    from bowden.hardware.twin.ak_node import AkNode
    from bowden.hardware.twin.twin import Twin

    check_parameters(parameters)
    overrides = dict(on_can.object_option(text) for text in options)
    place = on_can.node_place(parameters)
    return Twin(place, clock, lambda send, journal: AkNode(parameters, plant, send, journal, overrides))


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


def probe(parameters: AkParameters, links: "Links") -> Sequence[FoundDevice]:
    """All drives of this family on the bus."""
    from bowden.hardware.drives import ak_probe  # with python-can

    return ak_probe.probe(parameters, links)


FAMILY = DriveFamily(
    name="ak_mit",
    title="A drive of the CubeMars AK series in MIT mode, and the joint's encoder beside it; `bowden twin` plays both.",
    parameters=AkParameters(),
    completed=completed,
    open=on_can.opening("ak_drive.AkDrive"),
    twin=twin,
    moved=on_can.moved,
    address=on_can.address,
    control=on_can.control,
    claim=on_can.claim_host,
    watchdog=lambda parameters: parameters.watchdog or math.inf,
    most_push=on_can.pushing(most_push),
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
    probe=probe,
    zeroed=zeroed,
    zero_hint="An AK drive takes the present place for its own zero by its set-origin frame, or with its maker's tool; "
    "bowden does not send it. Zero the rig anew after that. Which turn of its rotor it is in after a restart is told "
    'by home = "hint".',
)
