"""A CiA 402 drive over CANopen as the live loop's `Drive`: packed and parsed by hand, no thread, never waiting.

A cycle sends RPDO 1 and then the SYNC at which the drive takes it and samples TPDO 1 and 2, which the next cycle reads.
Our heartbeat goes out from within `write` alone: a loop that hangs is a host that is gone, and the drive acts on it.

Object numbers are those of CiA 301 (1xxxh) and CiA 402 (6xxxh); 3001h is maxon's (EPOS4 Firmware Specification).
"""

import contextlib
import math
from collections.abc import Iterator

from bowden.core.errors import DriveError
from bowden.core.signals import EMERGENCY_STOP, DriveState
from bowden.hardware.buses.link import BusPort, Links
from bowden.hardware.buses.opening import UNIX
from bowden.hardware.buses.place import REMOTE
from bowden.hardware.drives import canopen_frames as frames
from bowden.hardware.drives import checklist
from bowden.hardware.drives.canopen_dialogue import NO_REMOTE, Dialogue
from bowden.hardware.drives.checklist import DriveLimit, Found, refuse_torque
from bowden.hardware.drives.cia402 import CYCLIC_SYNCHRONOUS_POSITION, WITH_TORQUE, Controlword, controlword, decode
from bowden.hardware.drives.driver import Driver
from bowden.hardware.drives.emergencies import HEARTBEAT_LOST, SAFE_TORQUE_OFF, emergency_text
from bowden.hardware.drives.families.cia402 import DriveParameters, joint_scale, load_of
from bowden.hardware.drives.findings import UNWATCHED, WATCH_EVERY
from bowden.hardware.drives.on_can import place
from bowden.hardware.drives.scale import Scale, SuitScale, bounded_torque, motor_limits, motor_scale
from bowden.hardware.ports import Power, TorqueLeft
from bowden.rig.families import FoundDevice

FAULT_SIGNAL = 1
"""6007h, abort connection option code: a lost heartbeat is a fault, and so it is latched."""
DISABLE_VOLTAGE = 2
"""6007h for a drive that refuses the former: torque off, and `Driver` keeps it off."""
DISABLE = 0
"""605Eh fault reaction, 605Bh shutdown, 605Ch disable operation: torque off at once."""
SLOW_DOWN_AND_DISABLE = 2
"""605Ah, quick stop option code: down the quick stop ramp, then torque off."""
RPM = 2.0 * math.pi / 60.0
"""rad/s in one turn a minute, the unit of 607Fh and 6080h unless 60A9h has a power of ten of it."""
TURNS_A_MINUTE = 0xB44700
"""That unit in 60A9h, below the byte with the power of ten (CiA 303-2)."""
LISTENING = 1.0
"""So long the bus is listened to before anything is said on it: another master gives its signs of life in it [s]."""
_SAME_SCALE = 1e-3
"""Two scales that differ by less are the same, but for a rounding [–]."""
UNCHANGED = 1
"""1029h:1, error behaviour: a lost heartbeat leaves the drive operational, so that it still reports its state."""


OUTPUTS = 0x60FE
"""Digital outputs: bit 0 of sub-index 1 is the brake's, sub-index 2 says which bits are the host's (CiA 402-2)."""


def check_alone(node: Dialogue, drive: DriveParameters) -> None:
    """No other device may send what only a host sends.

    Raises:
        DriveError: one has.
    """
    cob_id = node.foreign
    if cob_id is not None:
        who = (
            f"a node {drive.host_id}, which is the number of this computer,"
            if cob_id > frames.HEARTBEAT
            else "another master"
        )
        raise DriveError(
            f"{who} is on the bus already (a frame {cob_id:03X}h)",
            expected="one host",
            do="end the other run or program first, or correct host_id in [drive]",
        )


def _start(node: Dialogue) -> None:
    """Operational; and all settings as written, of which one that has started again meanwhile has nothing left."""
    node.command(frames.NMT_START)
    if not node.reaches(frames.OPERATIONAL):
        raise DriveError(f"{node.name} does not become operational", expected="NMT state 5 in its heartbeat")
    node.keeps_all()


def _try_watch(node: Dialogue, drive: DriveParameters, state: DriveState) -> None:
    """Whether the drive does notice that its host has fallen silent: one heartbeat of ours, and then none.

    All that happens when this computer dies rests on it, so it is not taken on trust. The motor has no torque. A fault
    that comes of it is reset again; one that was there before stays, and where that is of a lost host, it is the proof.
    """
    if state is DriveState.FAULT and node.read_if_there(0x603F) == HEARTBEAT_LOST:
        return
    node.emergencies.clear()
    node.send(frames.HEARTBEAT + drive.host_id, bytes((frames.OPERATIONAL,)))
    if not node.waits(drive.heartbeat_timeout + drive.answer_timeout, lambda: HEARTBEAT_LOST in node.emergencies):
        raise DriveError(
            f"{node.name} does not notice that its host is silent",
            expected=f"an emergency 0x{HEARTBEAT_LOST:X} {1e3 * drive.heartbeat_timeout:g} ms after our last heartbeat",
            do="take a drive or firmware that watches its host (1016h, 6007h): this one would keep its torque",
        )
    signals = node.read(0x6007) == FAULT_SIGNAL
    reached = decode(node.read(0x6041))
    if signals and reached not in (DriveState.FAULT, DriveState.FAULT_REACTION_ACTIVE):
        raise DriveError(
            f"{node.name} is in {reached.name.lower().replace('_', ' ')} after its host fell silent",
            expected="fault, as 6007h wants it",
            do="take a drive or firmware that acts on 6007h",
        )
    if not node.reaches(frames.OPERATIONAL, 1):
        _start(node)  # one without 1029h leaves operational when its host is lost
    if state is not DriveState.FAULT and signals:
        _reset(node, drive)


def _reset(node: Dialogue, drive: DriveParameters) -> None:
    """Reset the fault of a lost host."""
    for word in (Controlword.DISABLE_VOLTAGE, Controlword.FAULT_RESET, Controlword.DISABLE_VOLTAGE):
        push = (0,) if drive.needs.torque_offset > 0.0 else ()
        node.send(frames.RPDO1 + drive.node_id, frames.ORDER.pack(word, 0, *push))
        node.send(frames.SYNC, b"")
    if not node.waits(drive.answer_timeout, lambda: decode(node.read(0x6041)) is not DriveState.FAULT):
        raise DriveError(
            f"{node.name} stays in fault after the trial of its watch over the host",
            expected="a fault reset by 6040h bit 7",
            do="reset it with its maker's tool",
        )


def _check_profile(node: Dialogue) -> None:
    """Device type 1000h: profile number in the low word, 2 for a servo drive in the high word (CiA 402-1)."""
    device_type = node.device_type(
        "drive", "a CANopen drive", "correct node_id in [drive]", "cable, bit rate and termination"
    )
    profile, kind = device_type & 0xFFFF, device_type >> 16 & 0xFF
    if profile != 402:
        raise DriveError(
            f"{node.name} has device profile {profile} (1000h is 0x{device_type:08X})",
            expected="402, a drive",
            do="correct node_id in [drive]",
        )
    if not kind & 0x02:
        raise DriveError(
            f"{node.name} is a drive of type {kind} (1000h is 0x{device_type:08X})",
            expected="type 2, a servo drive",
            do="correct node_id in [drive]",
        )


def _check_torque_free(node: Dialogue) -> DriveState:
    """Whoever finds the motor under torque must not touch it."""
    state = decode(node.read(0x6041))
    if state in WITH_TORQUE:
        do = "end the master that holds it, or switch the drive off"
        raise refuse_torque(node.name, state.name.lower().replace("_", " "), do)
    return state


def _check_scale(node: Dialogue, drive: DriveParameters) -> None:
    """The rig's counts a turn against the drive's own, where it reports them (CiA 402, "factor group").

    Positions must be in the motor encoder's counts: a wrong scale passes everything else that is checked here.
    """
    increments, turns = node.read_if_there(0x608F, 1), node.read_if_there(0x608F, 2)
    if increments and turns and abs(increments / turns / drive.motor_counts_per_turn - 1.0) > _SAME_SCALE:
        raise DriveError(
            f"drive.motor_counts_per_turn is {drive.motor_counts_per_turn:g}",
            expected=f"{increments / turns:g}, as {node.name} has it (608Fh), counts and not lines of the encoder",
            do="correct it in rig.toml, or 608Fh with its maker's tool",
        )
    motor, shaft = node.read_if_there(0x6091, 1), node.read_if_there(0x6091, 2)
    if motor and shaft and motor != shaft:
        raise DriveError(
            f"{node.name} counts its positions behind a gear of {motor}:{shaft} (6091h)",
            expected="1:1, so that they are the motor's; the rig's own gear is motor.gear",
            do="set 6091h to 1:1 with its maker's tool",
        )


def _check_rated(node: Dialogue, drive: DriveParameters, rated: float) -> None:
    """Whether thousandths of the `rated` current [A] can express the rig's: 16 bits must hold its largest finely."""
    most, least = 1e-3 * frames.INT16 * rated, 1e-3 * rated
    if drive.needs.current_limit > 0.0 and not 100.0 * least <= drive.needs.current_limit <= most:
        raise DriveError(
            f"{node.name} reports currents from {least:.3g} to {most:.3g} A by its rated torque (6076h) and the "
            f"motor's torque constant, and the rig's largest is {drive.needs.current_limit:g} A",
            expected="a rated torque of the motor's size, in µN·m",
            do="set the motor's data in the drive with its maker's tool, or correct the torque constant in [motor]",
        )


def _check_limits(node: Dialogue, drive: DriveParameters, motor: Scale | SuitScale) -> None:
    """The rig's limits against those in the drive, which are read and never changed."""
    low, high = node.read_if_there(0x607D, 1, signed=True), node.read_if_there(0x607D, 2, signed=True)
    if low is None or high is None or low >= high:
        if drive.interface != UNIX:
            raise DriveError(
                f"{node.name} has no limits of its position (607Dh is {low or 0}/{high or 0})",
                expected="the range that the rig may go to at most, in counts",
                do="set 607Dh with its maker's tool: it holds whatever this computer does, and whatever its scales are",
            )
        low, high = -frames.INT32, frames.INT32 - 1  # its counter's own
    ends = sorted((motor.angle(low), motor.angle(high)))
    needs = drive.needs
    spool = motor.steepest(needs.lowest_motor, needs.highest_motor)  # the drive's own limits are the spool's
    unit = _speed_unit(node) / needs.gear / spool
    window, current = abs(motor.step) / spool, 1e-3
    asked = (
        (checklist.SPEED, needs.speed_limit, (0x6080, 0), unit),
        (checklist.SPEED, needs.speed_limit, (0x607F, 0), unit),
        (checklist.REACH, needs.following_error, (0x6065, 0), window),
        (checklist.CURRENT, needs.current_limit, (0x3001, 2), current),
    )
    own = [(*limit, node.read_if_there(*limit[2])) for limit in asked]
    checklist.check_limits(
        (
            DriveLimit(checklist.LOWEST, needs.lowest_motor, ends[0], "607Dh"),
            DriveLimit(checklist.HIGHEST, needs.highest_motor, ends[1], "607Dh"),
            *(
                DriveLimit(of, rig, count * size, f"{at[0]:04X}h")
                for of, rig, at, size, count in own
                if count is not None
            ),
        ),
        "with its maker's tool",
    )


def _speed_unit(node: Dialogue) -> float:
    """One unit of 607Fh and 6080h [rad/s], by 60A9h where the drive has it."""
    unit = node.read_if_there(0x60A9)
    if unit is None:
        return RPM
    if unit & 0xFF_FFFF != TURNS_A_MINUTE:
        raise DriveError(
            f"{node.name} has speeds in a unit that is not known here (60A9h is 0x{unit:08X})",
            expected="turns a minute, 0x00B44700, or a power of ten of it",
            do="set 60A9h with its maker's tool",
        )
    power = unit >> 24
    return RPM * 10.0 ** (power - 256 if power > 127 else power)


def _configure(node: Dialogue, drive: DriveParameters) -> None:
    """Mode, reactions, PDOs and both heartbeats; the last, so that the drive watches us only once all is set."""
    node.write(0x6060, 0, CYCLIC_SYNCHRONOUS_POSITION, 1)
    if not node.becomes(0x6061, 0, CYCLIC_SYNCHRONOUS_POSITION):
        raise DriveError(
            f"{node.name} stays in mode {node.read(0x6061, signed=True)} (6061h)",
            expected=f"{CYCLIC_SYNCHRONOUS_POSITION}, cyclic synchronous position, as written to 6060h",
            do="see with its maker's tool what keeps it there",
        )
    node.write(0x60C2, 1, round(1e3 * drive.needs.sample_time), 1)
    node.write(0x60C2, 2, -3, 1)
    try:
        node.write(0x6007, 0, FAULT_SIGNAL, 2)
    except DriveError:
        node.write(0x6007, 0, DISABLE_VOLTAGE, 2)
    if node.read_if_there(0x1029, 1) is not None:
        node.write(0x1029, 1, UNCHANGED, 1)
    node.write(0x605A, 0, SLOW_DOWN_AND_DISABLE, 2)
    for index in (0x605B, 0x605C, 0x605E):
        node.write(index, 0, DISABLE, 2)
    node.switch_off((0x1401, 0x1402, 0x1403, 0x1802, 0x1803))
    _map_orders(node, drive)
    node.map_pdo(0x1800, NO_REMOTE | frames.TPDO1 + drive.node_id, frames.MOTION.mapping)
    try:
        node.map_pdo(0x1801, NO_REMOTE | frames.TPDO2 + drive.node_id, frames.SENSORS.mapping)
    except DriveError:  # older EPOS4 cannot map 3201h, the power stage's temperature
        node.map_pdo(0x1801, NO_REMOTE | frames.TPDO2 + drive.node_id, frames.SENSORS.mapping[:2])
    _map_inputs(node, drive)
    _release_brake(node, drive)
    node.write(0x1017, 0, round(1e3 * drive.drive_heartbeat_time), 2)
    node.write(0x1016, 1, heartbeat_consumer(drive), 4)


def brake_bits(drive: DriveParameters, *, engaged: bool) -> int:
    """60FEh:1 with which the brake is engaged, or released."""
    return int(engaged == (drive.brake_output == "set"))


def _release_brake(node: Dialogue, drive: DriveParameters) -> None:
    """The brake's output is the host's from now on, and releases it; other bits of the outputs are not ours."""
    if drive.brake_output == "none":
        return
    with _wanted(
        f"{node.name} lets nobody drive its brake's output",
        "a drive with object 60FEh, digital outputs, and its mask 60FEh:2",
        'set drive.brake_output = "none" and delete [brake]',
    ):
        node.write(OUTPUTS, 1, brake_bits(drive, engaged=False), 4)
        node.write(OUTPUTS, 2, 1, 4)


def heartbeat_consumer(drive: DriveParameters) -> int:
    """1016h: whose heartbeat the drive waits for, and for how long [ms]."""
    return drive.host_id << 16 | math.ceil(round(1e3 * drive.heartbeat_timeout, 6))


def _map_orders(node: Dialogue, drive: DriveParameters) -> None:
    """RPDO 1, with the torque offset where the rig has one; elsewhere what somebody has left in 60B2h is taken out."""
    cob_id = frames.RPDO1 + drive.node_id
    if drive.needs.torque_offset == 0.0:
        if node.read_if_there(0x60B2):
            node.write(0x60B2, 0, 0, 2)
        node.map_pdo(0x1400, cob_id, frames.ORDER.mapping[:2])
        return
    said = f"{node.name} takes no torque offset beside its target"
    with _wanted(said, "a drive that maps object 60B2h", "set suit.friction_feedforward_nm to 0"):
        node.map_pdo(0x1400, cob_id, frames.ORDER.mapping)


def _map_inputs(node: Dialogue, drive: DriveParameters) -> None:
    """TPDO 3, where one of the digital inputs is the emergency stop's."""
    if drive.emergency_stop_input < 0:
        return
    said = f"{node.name} does not send its digital inputs in every cycle"
    with _wanted(said, "a drive that maps object 60FDh", "set drive.emergency_stop_input to -1"):
        node.map_pdo(0x1802, NO_REMOTE | frames.TPDO3 + drive.node_id, frames.INPUTS.mapping)


@contextlib.contextmanager
def _wanted(said: str, expected: str, do: str) -> Iterator[None]:
    """What a rig wants of a drive that not every one can: a refused setting is said in its words."""
    try:
        yield
    except DriveError as error:
        do = f"{do}, or take another drive or firmware"
        raise DriveError(f"{said}: {error.what}", expected=expected, do=do) from error


def identity(node: Dialogue, state: DriveState | None) -> tuple[str, str]:
    """Who a device is, in one line, and vendor, product and serial number (1018h), empty where it tells no such number;
    `state` is None of one that is no drive.
    """
    vendor, product, revision, serial = (node.read_if_there(0x1018, sub) or 0 for sub in (1, 2, 3, 4))
    name = node.text(0x1008) or ("device" if state is None else "CiA 402 drive")
    who = f"{name} at {node.name}, vendor 0x{vendor:X}, product 0x{product:X}, "
    who += f"revision 0x{revision:X}, serial number {serial}"
    supply = None if state is None else node.read_if_there(0x6079)
    if supply:
        who += f", supply {1e-3 * supply:.1f} V"
    if state is DriveState.FAULT:
        who += f"; in fault, {emergency_text(node.read_if_there(0x603F) or 0)}"
    return who, f"{vendor:X}-{product:X}-{serial}" if serial else ""


PROFILES = {401: "inputs and outputs", 402: "servo drive", 404: "measuring device", 406: "encoder"}
"""Lower half of 1000h → what such a device is; the number is that of its CiA profile (CiA 301, 1000h)."""


def probe(drive: DriveParameters, links: Links) -> list[FoundDevice]:
    """Who answers on the bus, which is listened to and then asked; nothing is written, and no order given.

    Args:
        drive: with the bus, and the numbers of the rig's drive and of this computer.
        links: the buses of this process.

    Raises:
        DriveError: the bus cannot be used, or another host is on it.
    """
    with links.join(place(drive), f"node {drive.node_id}", lambda _: True) as port:
        node = Dialogue(port, drive.node_id, drive.host_id, drive.answer_timeout)
        node.waits(LISTENING, lambda: node.foreign is not None)
        check_alone(node, drive)
        found = []
        for number in sorted([drive.node_id] * node.answers() + node.others()):
            node = Dialogue(port, number, drive.host_id, drive.answer_timeout)
            kind = (node.read_if_there(0x1000) or 0) & 0xFFFF
            what = f"{PROFILES.get(kind, 'device')} (CiA {kind})" if kind else "CANopen device"
            state = decode(node.read_if_there(0x6041) or 0) if kind == 402 else None
            found.append(FoundDevice(number, what, identity(node, state)[0], "" if state is None else state.name))
        return found


MOST_INPUTS_AGE = 10
"""Cycles for which the digital inputs may be missing; after that the emergency stop counts as pressed, by a node that
sends the rest: one that sends nothing is not there, which its age shows."""
MOST_ANGLES_AGE = 5
"""Cycles in which a node that is there has sent both angles."""

MOST_DUE = 64
"""TPDO 1 of this drive that may still come, at most, but for those of a stall that goes on or has just ended: later
ones are stale by every limit."""
SPARE, REFILL = 8.0, 0.05
"""TPDO 1 that may come beyond one for each SYNC, as after a bit error at a frame's end, whose repetition is received
twice; and how soon these are forgiven, a cycle. A second device that sends as often is found within nine cycles."""
WATCH = ((0x1016, 1), (0x6007, 0))
"""What the watch over us rests on: the heartbeat consumer, and what the drive does without one; asked for by turns."""

REPEAT = 10e-3
"""Until the drive has confirmed an order to its brake it is repeated so often [s]."""


class CanopenDrive(Driver):
    """The drive of one motor."""

    _drive: DriveParameters
    synced = True
    most_counts = frames.INT32 - 1.0

    def _prepare(self) -> None:
        parameters = self._drive
        node, host = parameters.node_id, parameters.host_id
        self._pushed = parameters.needs.torque_offset > 0.0
        self._has_stop = parameters.emergency_stop_input >= 0
        self._tpdo1, self._tpdo2, self._tpdo3 = frames.TPDO1 + node, frames.TPDO2 + node, frames.TPDO3 + node
        self._beats, self._emergencies = frames.HEARTBEAT + node, frames.EMERGENCY + node
        self._rpdo, self._heartbeat = frames.RPDO1 + node, frames.HEARTBEAT + host
        self._answers, self._questions = frames.SDO_ANSWER + node, frames.SDO_REQUEST + node
        self._watched = WATCH if parameters.brake_output == "none" else (*WATCH, (OUTPUTS, 1))
        self._watch_as_set = {
            0x1016: (heartbeat_consumer(parameters),),
            0x6007: (FAULT_SIGNAL, DISABLE_VOLTAGE),
        }
        self._ours = frames.of_the_host(node, host)

    def _find(self, port: BusPort) -> Found:
        drive = self._drive
        node = Dialogue(port, drive.node_id, drive.host_id, drive.answer_timeout)
        node.waits(LISTENING, lambda: node.foreign is not None)
        check_alone(node, drive)
        node.booted = False  # one that has just been switched on
        if not node.answers():  # an end of ours has stopped it: only then may it be written to before it is known
            node.command(frames.NMT_PRE_OPERATIONAL)
        _check_profile(node)
        state = _check_torque_free(node)
        node.command(frames.NMT_PRE_OPERATIONAL)
        modes = node.read(0x6502)
        if not modes >> CYCLIC_SYNCHRONOUS_POSITION - 1 & 1:
            raise DriveError(
                f"{node.name} does not know cyclic synchronous position (6502h is 0x{modes:X})",
                expected="bit 7 set",
                do="take another drive or firmware",
            )
        _check_scale(node, drive)
        motor, joint = motor_scale(drive), joint_scale(drive)
        if drive.home == "here":
            motor = motor_scale(drive, node.read(0x6064, signed=True))
            joint = joint_scale(drive, node.read(0x60E4, 2, signed=True))
        _check_limits(node, drive, motor)
        _configure(node, drive)
        rated_torque = 1e-6 * node.read(0x6076)
        if rated_torque == 0.0:
            raise DriveError(
                f"{node.name} has a rated torque (6076h) of 0",
                expected="the motor's, in µN·m",
                do="set the motor's data in the drive with its maker's tool",
            )
        _check_rated(node, drive, rated_torque / drive.needs.torque_constant)
        said, serial = identity(node, state)
        _start(node)
        _try_watch(node, drive, state)
        check_alone(node, drive)
        if node.booted:
            raise DriveError(
                f"{node.name} has restarted during its bring-up",
                expected="a drive that stays on",
                do="check its supply, and start again",
            )
        port.disturbed()
        return Found(said, motor, joint, motor_limits(drive, motor), state, 0, serial, rated_torque)

    def _restore(self) -> None:
        """Bring it back where it has missed our heartbeat while another drive on its bus was tried: both get it.

        Raises:
            DriveError: it does not answer, or stays in fault.
        """
        drive = self._drive
        if self._port is None or self._found is None or self._found.state is DriveState.FAULT:
            return
        node = Dialogue(self._port, drive.node_id, drive.host_id, drive.answer_timeout)
        if node.read_if_there(0x603F) != HEARTBEAT_LOST:
            return
        if not node.reaches(frames.OPERATIONAL, 1):
            _start(node)
        if decode(node.read(0x6041)) is DriveState.FAULT:
            _reset(node, drive)

    def _concerns(self, identifier: int) -> bool:
        return identifier & 0x7F == self._drive.node_id or identifier in self._ours

    def _is_foreign(self, identifier: int, data: bytes) -> bool:
        return identifier & ~REMOTE in self._ours

    def _begin(self, found: Found | None) -> None:
        self._statusword_state, self._operational = self._state, found is not None
        self._sent = int(Controlword.DISABLE_VOLTAGE)
        self._counts = 0  # the motor's position, as it came last
        self._stop_released, self._inputs_age = True, 0
        self._heartbeat_sent = -math.inf
        self._due, self._most = SPARE, float(MOST_DUE)  # TPDO 1 that may come, and how many they may become
        self._questioned, self._questioned_at = 0, -math.inf  # about the watch
        self._unwatched: set[int] = set()  # objects that are not as they were set
        self._brake = False  # whether it is to hold; bring-up has released it
        self._brake_confirmed, self._brake_at = True, -math.inf

    def _least_current(self, found: Found) -> float:
        return abs(self._current(1, found))

    def _current(self, torque: int, found: Found) -> float:
        """Of a torque in thousandths of the rated one [A]."""
        drive = self._drive
        return drive.motor_direction * torque * 1e-3 * found.rated_torque / drive.needs.torque_constant

    def _take(self, cob_id: int, data: bytes, now: float) -> bool:
        readings, drive, found = self._readings, self._drive, self._found
        if found is None or found.joint is None:
            return False
        if cob_id == self._tpdo1 and (motion := frames.MOTION.unpack(data)) is not None:
            statusword, self._counts, torque = motion
            self._statusword_state, current = decode(statusword), self._current(torque, found)
            readings.moved(found.motor.angle(self._counts), current, readings.temperature, self._written)
            self._due -= 1.0
            if self._due < 0.0:  # not the drive's: it sends one for each SYNC
                self._due = 0.0
                readings.foreign += 1.0
        elif cob_id == self._tpdo2 and (sensors := frames.SENSORS.unpack(data) or frames.SENSORS.unpack(data, 2)):
            readings.turned(found.joint.angle(sensors[0]))
            readings.temperature = 0.1 * sensors[2] if len(sensors) > 2 else math.nan
            if drive.tension_scale != 0.0:
                readings.tension = load_of(drive, sensors[1])
            elif drive.torque_scale != 0.0:
                readings.joint_torque = load_of(drive, sensors[1])
        elif cob_id == self._beats and (state := frames.unpack_heartbeat(data)) is not None:
            readings.replied_at = now
            self._operational = self._operational and state == frames.OPERATIONAL
        elif cob_id == self._emergencies and (code := frames.unpack_emergency(data)):
            readings.found(EMERGENCY_STOP if code == SAFE_TORQUE_OFF else code)
        elif cob_id == self._tpdo3 and (inputs := frames.INPUTS.unpack(data)) is not None and self._has_stop:
            self._stop_released, self._inputs_age = bool(inputs[0] >> drive.emergency_stop_input & 1), 0
        elif cob_id == self._answers and (said := frames.unpack_sdo_answer(data)) is not None:
            self._see_watch(*said)
        else:
            return False
        return True

    def _check_silence(self, now: float) -> None:
        """One that has started again says so in its heartbeat."""

    def _standing(self) -> DriveState:
        return self._statusword_state if self._operational else DriveState.NOT_READY_TO_SWITCH_ON

    def _judge(self, now: float) -> None:
        readings = self._readings
        there = max(readings.motor_age, readings.joint_age) <= MOST_ANGLES_AGE
        missing = self._inputs_age > MOST_INPUTS_AGE and there
        if self._has_stop and (missing or not self._stop_released):
            readings.emergency = EMERGENCY_STOP
        self._inputs_age += 1
        if self._unwatched and self._operational:
            readings.found(UNWATCHED)
        readings.sampled = self._written

    def _see_watch(self, index: int, value: int | None) -> None:
        """What the drive says of an object of its watch over us, or that an order to its brake has been taken; one that
        has started again says it at bring-up.
        """
        if index == OUTPUTS:
            as_told = self._brake_confirmed and value == brake_bits(self._drive, engaged=self._brake)
            self._brake_confirmed = value is None or as_told
        if index in self._watch_as_set and value is not None and self._operational:
            (self._unwatched.discard if value in self._watch_as_set[index] else self._unwatched.add)(index)

    def _can_lead(self) -> bool:
        return True  # to where it may be led

    def _lead(self, found: Found, counts: float, target: float, torque: float, now: float) -> None:
        led = self._state is DriveState.OPERATION_ENABLED
        self._target, self._led = (target, self._led + 1) if led else (math.nan, 0)
        self._command(Power.ON, round(counts) if led else self._counts, torque if led else 0.0)

    def _relax(self, power: Power, now: float) -> None:
        """See `Driver._relax`; power that waits for a position alone is ready."""
        off = self._fell or (power is Power.ON and math.isfinite(self._readings.motor))
        wanted = Power.OFF if off else min(power, Power.READY)
        self._command(wanted, self._counts)
        if wanted is Power.OFF and not self._fell:
            self.set_brake(False)

    def _command(self, power: Power, counts: int, torque: float = 0.0) -> None:
        """The controlword that leads to a power; a fault is reset by an edge."""
        self._sent = controlword(self._state, power, self._reset and self._sent != Controlword.FAULT_RESET)
        if self._sent == Controlword.FAULT_RESET or self._state is not DriveState.FAULT:
            self._reset = False
        self._order(self._sent, counts, torque)

    def _ask(self, now: float) -> None:
        """How many TPDO 1 may come; the brake, the watch over us, and our heartbeat."""
        due = self._due + (1.0 + REFILL if self._due < SPARE else 1.0)
        age = self._readings.motor_age  # a drive that stalls answers all that was asked at once, later
        self._most = max(self._most - REFILL, MOST_DUE + age if SPARE < age < math.inf else MOST_DUE)
        self._due = min(due, self._most)
        if not self._brake_confirmed and now - self._brake_at >= REPEAT:
            self._brake_at = now
            self._send(self._questions, brake_order(self._drive, engaged=self._brake))
        elif now - self._questioned_at >= WATCH_EVERY:  # after the SYNC, which it does not delay
            self._questioned, self._questioned_at = self._questioned + 1, now
            self._send(self._questions, frames.pack_sdo_read(*self._watched[self._questioned % len(self._watched)]))
        if now - self._heartbeat_sent >= self._drive.heartbeat_time - 0.5 * self._drive.needs.sample_time:
            self._heartbeat_sent = now
            self._send(self._heartbeat, _OPERATIONAL)

    def _order(self, control: int, counts: int, torque: float = 0.0) -> None:
        """RPDO 1 and the SYNC at which it is taken; the torque is at the spool [N·m]."""
        drive, share = self._drive, tuple[int, ...]()
        if self._pushed and self._found is not None:
            most = drive.needs.gear * self._found.rated_torque
            thousandths = round(1e3 * drive.motor_direction * bounded_torque(torque, drive) / most)
            share = (max(-frames.INT16, min(frames.INT16 - 1, thousandths)),)
        self._send(self._rpdo, frames.ORDER.pack(control, counts, *share))
        self._sync()

    @property
    def brake_confirmed(self) -> bool:
        """See `hardware.ports.BrakedDrive.brake_confirmed`."""
        return self._brake_confirmed

    def set_brake(self, engaged: bool) -> None:
        """See `hardware.ports.BrakedDrive.set_brake`."""
        if engaged != self._brake and self._drive.brake_output != "none":
            self._brake, self._brake_confirmed, self._brake_at = engaged, False, -math.inf

    def _tell_off(self, number: int) -> None:
        if number == 0 and self._brake:
            self._send(self._questions, brake_order(self._drive, engaged=False))
        self._order(Controlword.DISABLE_VOLTAGE, self._counts)

    def _torque_told(self, identifier: int, data: bytes) -> bool | None:
        motion = frames.MOTION.unpack(data) if identifier == self._tpdo1 else None
        return None if motion is None else decode(motion[0]) in WITH_TORQUE

    def _let_go(self, left: TorqueLeft) -> None:
        """It stops watching our heartbeat only once it has said that it has no torque; and it is stopped."""
        if left is TorqueLeft.OFF and self._port is not None:
            self._send(self._questions, frames.pack_sdo_write(0x1016, 1, 0, 4))
            answered = self._port.wait_for  # not by a node that NMT has stopped
            answered(lambda cob_id, _: cob_id == self._answers, self._drive.answer_timeout)
        self._send(frames.NMT, bytes((frames.NMT_STOP, self._drive.node_id)))


def brake_order(drive: DriveParameters, *, engaged: bool) -> bytes:
    """The SDO download that engages or releases the brake."""
    return frames.pack_sdo_write(OUTPUTS, 1, brake_bits(drive, engaged=engaged), 4)


_OPERATIONAL = bytes((frames.OPERATIONAL,))
