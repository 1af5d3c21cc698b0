"""Who is on a CANopen bus: listened to, and then asked, nothing written and no order given."""

from bowden.hardware.buses.link import BusPlace, Links
from bowden.hardware.drives.canopen_dialogue import dialogue
from bowden.hardware.drives.canopen_setup import LISTENING, check_alone, identity
from bowden.hardware.drives.cia402 import decode
from bowden.hardware.drives.parameters import DriveParameters
from bowden.rig.families import FoundDevice

PROFILES = {401: "inputs and outputs", 402: "servo drive", 404: "measuring device", 406: "encoder"}
"""Lower half of 1000h → what such a device is; the number is that of its CiA profile (CiA 301, 1000h)."""
_SERVO = 402


def probe(drive: DriveParameters, links: Links) -> list[FoundDevice]:
    """Who answers on the bus.

    Args:
        drive: with the bus, and the numbers of the rig's drive and of this computer.
        links: the buses of this process.

    Raises:
        DriveError: the bus cannot be used, or another host is on it.
    """
    place = BusPlace(drive.interface, drive.channel, drive.bitrate)
    port = links.join(place, f"node {drive.node_id}", lambda _: True)
    try:
        with dialogue(port.bus, drive.node_id, drive.host_id, drive.answer_timeout) as node:
            node.waits(LISTENING, lambda: node.listener.foreign is not None)
            check_alone(node, drive)
            there = [drive.node_id] * node.answers() + node.others()
        found = []
        for number in sorted(there):
            with dialogue(port.bus, number, drive.host_id, drive.answer_timeout) as node:
                kind = (node.read_if_there(0x1000) or 0) & 0xFFFF
                what = f"{PROFILES.get(kind, 'device')} (CiA {kind})" if kind else "CANopen device"
                state = decode(node.read_if_there(0x6041) or 0) if kind == _SERVO else None
                found.append(FoundDevice(number, what, identity(node, state), "" if state is None else state.name))
        return found
    finally:
        port.leave()
