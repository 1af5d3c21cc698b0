"""What a twin of a rig moves: the suit where one is worn, a plant of the user's own, or the bench round its cable."""

from bowden.hardware.drives.family import TwinProcess
from bowden.hardware.twin.bench import TwinBench
from bowden.hardware.twin.plant import TwinPlant
from bowden.hardware.twin.suit import TwinSuit
from bowden.hardware.twin.user import TwinUser
from bowden.plants.user_plant import UserPlant
from bowden.rig.drive import cell_place
from bowden.rig.rig import Rig


def attach_load_cell(running: TwinProcess, rig: Rig) -> None:
    """Put the twin of the rig's load cell beside that of its drive, where it is a device of its own.

    Raises:
        DriveError: its bus cannot be used.
    """
    cell = rig.load_cell
    if not cell.there:
        return
    from bowden.hardware.twin.load_cell_node import LoadCellNode
    from bowden.hardware.twin.twin import NodePlace  # with python-can

    place, shared = cell_place(rig.drive_parameters, cell)
    own = NodePlace(place.interface, place.channel, place.bitrate, cell.node_id)
    running.attach(lambda plant, faults, send: LoadCellNode(cell, plant, faults, send), None if shared else own)


def twin_plant_of(rig: Rig, now: float) -> TwinPlant:
    """The rig's plant in real time, at rest where a run begins.

    Args:
        rig: any.
        now: what the time is [s].

    Raises:
        ParameterError: a plant that cannot be.
    """
    rest = (rig.bend_path, rig.duration, rig.seed, rig.start_motor, now)
    if rig.worn is not None:
        return TwinSuit(rig.worn, *rest)
    plant = rig.cabled
    return TwinUser(plant, *rest) if isinstance(plant, UserPlant) else TwinBench(plant, *rest)
