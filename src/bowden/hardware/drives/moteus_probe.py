"""Which moteus boards are on a bus: all are asked at once who they are and what they do; nothing is written."""

from bowden.hardware.buses.link import BusPlace, Links
from bowden.hardware.drives import moteus_frames as frames
from bowden.hardware.drives.checklist import LISTENING, send_now
from bowden.hardware.drives.host_end import joined
from bowden.hardware.drives.moteus_frames import NumberKind, Register
from bowden.hardware.drives.moteus_parameters import MoteusParameters
from bowden.hardware.drives.moteus_setup import MoteusDialogue, message, state_of
from bowden.rig.families import FoundDevice


def probe(drive: MoteusParameters, links: Links) -> list[FoundDevice]:
    """Which boards there are.

    Args:
        drive: with the bus, and this computer's number.
        links: the buses of this process.

    Raises:
        DriveError: the bus cannot be used, or another master is on it.
    """
    place = BusPlace(drive.interface, drive.channel, drive.bitrate, fd=True, data_bitrate=drive.data_bitrate)
    everybody = drive._replace(node_id=frames.BROADCAST)
    question = frames.subframe(frames.READ, NumberKind.INT8, Register.MODE, 1)
    question += frames.subframe(frames.READ, NumberKind.INT32, Register.MODEL, 3)
    found: dict[int, FoundDevice] = {}
    with joined(place, drive.node_id, links) as port:
        bus = MoteusDialogue(port, drive).bus
        bus.listen(LISTENING)

        def looked_at(identifier: int, data: bytes) -> None:
            node, receiver = identifier >> 8 & 0x7F, identifier & 0xFF
            ours = receiver == drive.host_id and frames.prefix_of(identifier) == drive.can_prefix
            told, failed, _ = frames.replied(data)
            if ours and Register.MODE in told and not failed and Register.MODEL in told:
                firmware = int(told.get(Register.FIRMWARE, 0.0))
                version = f"{firmware >> 16 & 0xFF}.{firmware >> 8 & 0xFF}.{firmware & 0xFF}"
                said = f"model 0x{int(told[Register.MODEL]) & 0xFFFF_FFFF:X}, firmware {version}"
                found[node] = FoundDevice(node, "moteus board", said, state_of(int(told[Register.MODE])).name)

        send_now(port.bus, message(everybody, question, reply=True))
        bus.wait(drive.answer_timeout, looked_at)
    return [found[node] for node in sorted(found)]
