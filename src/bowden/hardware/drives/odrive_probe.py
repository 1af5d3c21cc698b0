"""Which ODrive boards are on a bus: their heartbeats, and what they answer to questions; no order is given."""

from bowden.hardware.buses.link import Links
from bowden.hardware.drives import odrive_frames as frames
from bowden.hardware.drives.checklist import LISTENING, Conversation, send_now
from bowden.hardware.drives.host_end import classic_frame, joined
from bowden.hardware.drives.odrive_faults import WATCHDOG, errors_text
from bowden.hardware.drives.odrive_frames import Beat, BoardVersion, Cmd, identifier_of
from bowden.hardware.drives.odrive_parameters import OdriveParameters
from bowden.hardware.drives.odrive_setup import state_of
from bowden.hardware.drives.on_can import place
from bowden.rig.families import FoundDevice


def probe(drive: OdriveParameters, links: Links) -> list[FoundDevice]:
    """Which boards there are.

    Args:
        drive: with the bus.
        links: the buses of this process.

    Raises:
        DriveError: the bus cannot be used.
    """
    beats: dict[int, Beat] = {}
    versions: dict[int, BoardVersion] = {}

    def looked_at(identifier: int, data: bytes) -> None:
        node, cmd = identifier >> 5, identifier & 0x1F
        if identifier <= frames.HIGHEST_ID and len(data) == 8:
            if cmd == Cmd.HEARTBEAT and (beat := frames.unpack_beat(data)) is not None:
                beats[node] = beat
            elif cmd == Cmd.GET_VERSION and node in beats and (version := frames.unpack_version(data)) is not None:
                versions[node] = version

    with joined(place(drive), drive.node_id, links) as port:
        bus = Conversation(port, drive.node_id, lambda identifier, data: False)  # other masters do not matter here
        bus.wait(LISTENING, looked_at)
        for node in sorted(beats):
            send_now(port.bus, classic_frame(identifier_of(node, Cmd.GET_VERSION), 8, remote=True))
        bus.wait(drive.answer_timeout, looked_at)
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
