"""Which AK drives are on a bus: each number is told to leave motor mode, without torque, and who replies is there.

Such a drive says nothing of itself before it is told something, so that there is no question without an order; this is
the one with which nothing can move. It is not given where somebody uses these identifiers already: an AK drive under
another master, or devices of another protocol.
"""

import time

from bowden.core.errors import DriveError
from bowden.hardware.buses.link import Links
from bowden.hardware.drives.ak_frames import EXIT, AkReply, error_text, unpack_reply
from bowden.hardware.drives.ak_parameters import AkParameters, model_of, reply_id
from bowden.hardware.drives.checklist import send_now
from bowden.hardware.drives.host_end import classic_frame, joined
from bowden.hardware.drives.on_can import place
from bowden.rig.families import FoundDevice

LISTENING = 1.0
"""So long the bus is listened to first [s]."""
HIGHEST = 0x7F
"""Numbers that are tried; on a bus with CANopen they are nobody's."""
BETWEEN = 2e-3
"""From one to the next [s]."""


def probe(drive: AkParameters, links: Links) -> list[FoundDevice]:
    """Which drives there are.

    Args:
        drive: with the bus; its model's ranges are taken for all, and its `reply_id` where it has one.
        links: the buses of this process.

    Raises:
        DriveError: the bus cannot be used, or somebody uses these identifiers.
    """
    model, common, found = model_of(drive), reply_id(drive), dict[int, AkReply]()

    def looked_at(identifier: int, data: bytes) -> bool:
        reply = unpack_reply(data, model)
        if reply is not None and 0 < reply.number <= HIGHEST and identifier in (reply.number, common) and data != EXIT:
            found[reply.number] = reply
        return False

    with joined(place(drive), drive.node_id, links) as port:
        ends = time.monotonic() + LISTENING
        while (left := ends - time.monotonic()) > 0.0:
            used = port.wait_for(lambda identifier, data: 0 < identifier <= HIGHEST, left)
            if used is not None:
                raise DriveError(
                    f"somebody uses the identifiers of AK drives already (a frame {used[0]:03X}h)",
                    expected="a bus on which nobody commands them",
                    do="end the other program first, or give devices of another protocol a bus of their own",
                )
        for number in range(1, HIGHEST + 1):
            message = classic_frame(number, 8)
            message.data = bytearray(EXIT)
            send_now(port.bus, message)
            port.wait_for(looked_at, BETWEEN)
        port.wait_for(looked_at, drive.answer_timeout)
    return [
        FoundDevice(
            number,
            "AK drive in MIT mode",
            f"at {reply.position:.3f} rad of its range, " + (error_text(reply.error) if reply.error else "no error"),
            "FAULT" if reply.error else "SWITCH_ON_DISABLED",
        )
        for number, reply in sorted(found.items())
    ]
