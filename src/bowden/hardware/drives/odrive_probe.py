"""Which ODrive boards are on a bus: their heartbeats, and what they answer to questions; no order is given."""

import time

from bowden.hardware.buses.link import BusPort, Links
from bowden.hardware.drives import odrive_frames as frames
from bowden.hardware.drives.checklist import send_now
from bowden.hardware.drives.host_end import classic_frame, joined
from bowden.hardware.drives.odrive_faults import WATCHDOG, errors_text
from bowden.hardware.drives.odrive_frames import Beat, BoardVersion, Cmd, identifier_of
from bowden.hardware.drives.odrive_parameters import OdriveParameters
from bowden.hardware.drives.odrive_setup import state_of
from bowden.hardware.drives.on_can import place
from bowden.rig.families import FoundDevice

LISTENING = 0.5
"""So long heartbeats are listened to, which come every 0.1 s as boards come [s]."""


def probe(drive: OdriveParameters, links: Links) -> list[FoundDevice]:
    """Which boards there are.

    Args:
        drive: with the bus.
        links: the buses of this process.

    Raises:
        DriveError: the bus cannot be used.
    """
    with joined(place(drive), drive.node_id, links) as port:
        beats: dict[int, Beat] = {}
        versions: dict[int, BoardVersion] = {}
        _take(port, LISTENING, beats, versions)
        for node in sorted(beats):
            send_now(port.bus, classic_frame(identifier_of(node, Cmd.GET_VERSION), 8, remote=True))
        _take(port, drive.answer_timeout, beats, versions)
    found = []
    for node, beat in sorted(beats.items()):
        said = "ODrive board that tells no version (0.5?)"
        if node in versions:
            firmware, hardware = (".".join(map(str, one)) for one in (versions[node].firmware, versions[node].hardware))
            said = f"hardware {hardware}, firmware {firmware}"
        errors = beat.errors & ~WATCHDOG  # which runs out where nobody speaks
        if errors:
            said += f", {errors_text(errors)}"
        found.append(FoundDevice(node, "ODrive board (CANSimple)", said, state_of(beat, errors).name))
    return found


def _take(port: BusPort, span: float, beats: dict[int, Beat], versions: dict[int, BoardVersion]) -> None:
    """What comes within a time [s], by the number of the board."""

    def looked_at(identifier: int, data: bytes) -> bool:
        node, cmd = identifier >> 5, identifier & 0x1F
        if identifier <= frames.HIGHEST_ID and len(data) == 8:
            if cmd == Cmd.HEARTBEAT and (beat := frames.unpack_beat(data)) is not None:
                beats[node] = beat
            elif cmd == Cmd.GET_VERSION and node in beats and (version := frames.unpack_version(data)) is not None:
                versions[node] = version
        return False

    ends = time.monotonic() + span
    while (left := ends - time.monotonic()) > 0.0:
        port.wait_for(looked_at, left)
