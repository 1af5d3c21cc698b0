"""Bring-up of an ODrive board: finding it, asking what it is and how it is set, all without power.

Written are the mode and the two limits that a run needs, all of which are read back and lost with the supply: nothing
is saved. The watchdog is the owner's to set; it is read, and then tried by saying nothing for its time.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

from bowden.core.errors import DriveError
from bowden.core.signals import DriveState
from bowden.hardware.buses.link import BusPort, Links
from bowden.hardware.buses.unix_bus import REMOTE
from bowden.hardware.drives import odrive_endpoints as settings
from bowden.hardware.drives import odrive_frames as frames
from bowden.hardware.drives.checklist import (
    LISTENING,
    TRIES,
    Conversation,
    DriveLimit,
    Found,
    Said,
    Setting,
    check_limits,
    check_settings,
    is_about,
    joined,
    refuse_torque,
)
from bowden.hardware.drives.families.odrive import OdriveParameters, motor_scale
from bowden.hardware.drives.limited_range import nearest
from bowden.hardware.drives.odrive_endpoints import Endpoints
from bowden.hardware.drives.odrive_frames import WATCHDOG, AxisState, Beat, Cmd, errors_text, identifier_of, unpack
from bowden.hardware.drives.on_can import place
from bowden.hardware.drives.scale import MotorLimits, motor_limits
from bowden.rig.families import FoundDevice

OLDEST, NEWEST = (0, 6, 9), (0, 7, 0)
"""Firmwares from the first to before the second are spoken to: with Get_Version and Clear_Errors as they are here."""
STILL = 0.05
"""A motor that turns by less between two questions stands still [turns]."""
SAME = 1e-5
"""Share by which two numbers may differ that are one, as f32 [–]."""
CONSTANT = 0.05
"""Share by which the torque constants of board and rig may differ [–]."""
_LATE = 0.05
"""That this computer may be late in seeing what the trial of the watchdog waits for [s]."""


def is_foreign(node: int, identifier: int, data: bytes) -> bool:
    """Whether a frame is one that only the board's host may send: an order, or a question for what it tells."""
    plain = identifier & ~REMOTE
    number, cmd = plain >> 5, plain & 0x1F
    if plain > frames.HIGHEST_ID or number not in (node, frames.BROADCAST):
        return False
    if number == frames.BROADCAST:
        return cmd not in (*frames.TOLD, Cmd.ADDRESS)  # which a board without a number sends
    return cmd not in frames.TOLD or bool(identifier & REMOTE) or not data


def state_of(beat: Beat, errors: int) -> DriveState:
    """What a heartbeat is to the supervisor.

    Args:
        beat: the heartbeat.
        errors: those of it that count.
    """
    if beat.state == AxisState.CLOSED_LOOP_CONTROL:
        return DriveState.OPERATION_ENABLED
    if beat.state == AxisState.IDLE:
        return DriveState.FAULT if errors else DriveState.SWITCH_ON_DISABLED
    if beat.state in list(AxisState) and beat.state > AxisState.STARTUP_SEQUENCE:
        return DriveState.QUICK_STOP_ACTIVE  # torque, but nothing that we asked for is followed
    return DriveState.NOT_READY_TO_SWITCH_ON


class OdriveDialogue:
    """Questions and answers with one board.

    Args:
        port: of its bus, while no cycle runs.
        drive: which board.
        endpoints: where its settings are.
    """

    def __init__(self, port: BusPort, drive: OdriveParameters, endpoints: Endpoints) -> None:
        self._drive, self._endpoints = drive, endpoints
        self.beat: Beat | None = None
        node = drive.node_id
        self.bus = Conversation(port, node, lambda identifier, data: is_foreign(node, identifier, data))
        self.name = self.bus.name

    def _matching(self, matches: Callable[[int, bytes], Said | None]) -> Callable[[int, bytes], Said | None]:
        """What a frame of the board says, by its command and data; heartbeats are kept."""

        def looked_at(identifier: int, data: bytes) -> Said | None:
            if identifier >> 5 != self._drive.node_id or is_foreign(self._drive.node_id, identifier, data):
                return None
            if identifier & 0x1F == Cmd.HEARTBEAT:
                self.beat = frames.unpack_beat(data) or self.beat
            return matches(identifier & 0x1F, data)

        return looked_at

    def beats(self, span: float, wanted: Callable[[Beat], bool]) -> bool:
        """Whether a heartbeat as wanted comes within a time [s]."""

        def looked_at(cmd: int, data: bytes) -> bool | None:
            beat = frames.unpack_beat(data) if cmd == Cmd.HEARTBEAT else None
            return True if beat is not None and wanted(beat) else None

        return self.bus.wait(span, self._matching(looked_at)) is not None

    def ask(self, cmd: Cmd) -> tuple[Any, ...]:
        """The fields of what the board tells when it is asked.

        Raises:
            DriveError: no answer.
        """
        question = identifier_of(self._drive.node_id, cmd) | REMOTE, bytes(8)
        answered = self._matching(lambda told, data: unpack(cmd, data) if told == cmd else None)
        said = self.bus.ask(question, self._drive.answer_timeout, answered)
        if said is not None:
            return said
        raise DriveError(
            f"{self.name} does not answer {cmd.name}",
            expected="an ODrive board with firmware 0.6.9 or later, and an adapter that sends remote frames",
            do="load a later firmware with its maker's tool; check the cable and its termination",
        )

    def serial(self) -> str:
        """Its serial number, bytes 1 to 6 of its frame Address; empty of a firmware that does not tell it."""
        address = identifier_of(self._drive.node_id, Cmd.ADDRESS)
        told = self.bus.ask(
            (address | REMOTE, bytes(8)),
            self._drive.answer_timeout,
            lambda identifier, data: data if identifier == address and len(data) == 8 else None,
            tries=1,
        )
        return "" if told is None else told[1:7].hex()

    def tell(self, cmd: Cmd, data: bytes) -> None:
        """An order."""
        self.bus.port.send_now(identifier_of(self._drive.node_id, cmd), data)

    def setting(self, name: str) -> float:
        """A value of the board's configuration.

        Raises:
            DriveError: no answer.
        """
        endpoint = self._endpoints.where[name]

        def answered(cmd: int, data: bytes) -> float | None:
            answer = frames.unpack_sdo(data) if cmd == Cmd.TX_SDO else None
            return None if answer is None or answer[1] != endpoint.number else endpoint.unpack(answer[2])

        question = identifier_of(self._drive.node_id, Cmd.RX_SDO), frames.pack_sdo(endpoint.number)
        value = self.bus.ask(question, self._drive.answer_timeout, self._matching(answered))
        if value is not None:
            return value
        raise DriveError(
            f"{self.name} does not tell its setting {name} (endpoint {endpoint.number})",
            expected="an answer (TxSdo)",
            do="check that drive.endpoints names the list of its firmware",
        )

    def set(self, cmd: Cmd, values: Mapping[str, float]) -> None:
        """Settings that are the fields of a command, and read back.

        Raises:
            DriveError: one has another value afterwards.
        """
        self.tell(cmd, frames.pack(cmd, *values.values()))
        for name, value in values.items():
            found = self.setting(name)
            if not abs(found - value) <= SAME * abs(value):
                raise DriveError(f"{self.name} has {name} {found:g} after {value:g} was written", expected=f"{value:g}")


def set_up(port: BusPort, drive: OdriveParameters, endpoints: Endpoints) -> Found:
    """Find, check and configure the board; it has no torque before, meanwhile and after.

    Args:
        port: of its bus, read by nobody else.
        drive: what the rig says of it.
        endpoints: where its settings are.

    Raises:
        DriveError: no answer, another firmware than the list's, a board that runs, a watchdog that is off or another
            than the rig's, settings that a run cannot have, or limits narrower than the rig's.
    """
    board = OdriveDialogue(port, drive, endpoints)
    board.beats(LISTENING, lambda _: False)
    board.bus.check_alone()
    if board.beat is None:
        raise DriveError(
            f"no ODrive board is heard as {board.name}",
            expected=f"its heartbeat, every {1e3 * drive.heartbeat:g} ms",
            do="switch it on; check node_id and bitrate in [drive], cable and termination, and heartbeat_msg_rate_ms",
        )
    who = _check_version(board, endpoints)
    _check_idle(board)
    active, disarmed = board.ask(Cmd.GET_ERROR)
    failed = (active | disarmed) & ~WATCHDOG
    voltage, _ = board.ask(Cmd.GET_BUS_VOLTAGE_CURRENT)
    check_settings(board.name, board.setting, _settings(drive))
    _check_encoder(board)
    motor = motor_scale(drive, _turns_at_home(board, drive))
    limits = motor_limits(drive, motor)
    _check_range(board, limits)
    modes = {settings.CONTROL_MODE: frames.POSITION_CONTROL, settings.INPUT_MODE: frames.PASSTHROUGH}
    board.set(Cmd.SET_CONTROLLER_MODE, modes)
    _set_limits(board, limits)
    tried = not failed and _try_watchdog(board, drive)
    board.bus.check_alone()
    identity = f"ODrive board at {board.name}, {who}, supply {voltage:.1f} V; watchdog of {1e3 * drive.watchdog:g} ms, "
    identity += "tried" if tried else "read back and not tried: it does not run while the board is idle"
    state = DriveState.SWITCH_ON_DISABLED
    if failed:
        identity, state = f"{identity}; in fault, {errors_text(failed)}", DriveState.FAULT
    return Found(identity, motor, None, limits, state, failed, board.serial())


def _check_version(board: OdriveDialogue, endpoints: Endpoints) -> str:
    protocol, *numbers = board.ask(Cmd.GET_VERSION)
    own = tuple(numbers[3:6]), tuple(numbers[:3])
    firmware, hardware = (".".join(map(str, one)) for one in own)
    if protocol != frames.PROTOCOL or not OLDEST <= own[0] < NEWEST:
        raise DriveError(
            f"{board.name} has firmware {firmware} with version {protocol} of its protocol",
            expected=f"firmware 0.6.9 or later of 0.6, with version {frames.PROTOCOL}",
            do="load one of these with its maker's tool: what its frames mean is not known here",
        )
    if own != (endpoints.firmware, endpoints.hardware):
        listed = (".".join(map(str, one)) for one in (endpoints.firmware, endpoints.hardware))
        raise DriveError(
            f"{board.name} has firmware {firmware} on hardware {hardware}",
            expected="firmware {} on hardware {}, which drive.endpoints is for".format(*listed),
            do="name in drive.endpoints the maker's flat_endpoints.json for this board: in another its settings are "
            "others",
        )
    return f"hardware {hardware}, firmware {firmware}"


def _check_idle(board: OdriveDialogue) -> None:
    """Whoever finds the motor under torque must not touch it."""
    state = board.beat.state if board.beat is not None else -1
    if state != AxisState.IDLE:
        known = AxisState(state).name if state in list(AxisState) else "not known here"
        do = "end the program that runs it, or switch it off and on; it must not begin by itself "
        raise refuse_torque(
            board.name, f"axis state {state} ({known})", do + "(axis0.config.startup_closed_loop_control)"
        )


def _settings(drive: OdriveParameters) -> list[Setting]:
    """What a run needs, and nobody but the board's owner sets."""
    alike = [
        (settings.TIMEOUT, drive.watchdog, ", or correct drive.watchdog_ms"),
        (settings.BEAT_EVERY, 1e3 * drive.heartbeat, ", or correct drive.heartbeat_ms"),
        (settings.VELOCITY_SCALE, float(drive.velocity_scale), ", or correct drive.velocity_scale"),
        (settings.TORQUE_SCALE, float(drive.torque_scale), ", or correct drive.torque_scale"),
        (settings.CIRCULAR, 0.0, ""),
        (settings.VELOCITY_LIMITED, 1.0, ""),
        (settings.ABSOLUTE, float(drive.home != "here"), ', or set home = "here" in [drive]'),
    ]
    return [
        Setting(
            settings.ENABLED,
            is_about(1.0),
            "True",
            "keeps its torque when its host falls silent: its watchdog is off",
            f"in odrivetool: {settings.TIMEOUT} = {drive.watchdog:g}, {settings.ENABLED} = True, and save",
        ),
        *(
            Setting(name, is_about(value, SAME), f"{value:g}", do="set it with odrivetool" + key)
            for name, value, key in alike
            if name != settings.ABSOLUTE or value
        ),
        Setting(
            settings.TORQUE_CONSTANT,
            is_about(drive.needs.torque_constant, CONSTANT),
            f"{drive.needs.torque_constant:.4g} N·m/A, as the rig has it",
            "has another torque constant than the rig's motor",
            f"correct torque_constant_nm_per_a in [motor], or {settings.TORQUE_CONSTANT}",
        ),
    ]


def _check_encoder(board: OdriveDialogue) -> None:
    load, motor = board.setting(settings.LOAD_ENCODER), board.setting(settings.MOTOR_ENCODER)
    if load != motor:
        raise DriveError(
            f"{board.name} takes its position from encoder {load:g} and commutates by encoder {motor:g}",
            expected="one encoder for both, at the motor's shaft",
            do=f"set {settings.LOAD_ENCODER} to that of the motor with odrivetool",
        )


def _turns_at_home(board: OdriveDialogue, drive: OdriveParameters) -> float:
    """What the board's position is at home [turns]."""
    first, _ = board.ask(Cmd.GET_ENCODER_ESTIMATES)
    last, _ = board.ask(Cmd.GET_ENCODER_ESTIMATES)
    if not (math.isfinite(first) and abs(last - first) <= STILL):
        raise DriveError(
            f"the position of {board.name} is {first:g} and then {last:g} turns",
            expected="a motor that stands still, and whose encoder is calibrated",
            do="hold it, and calibrate it with odrivetool",
        )
    if drive.home == "here":
        return last
    if drive.home == "hint":
        return last - nearest(last, 1.0, motor_scale(drive).counts(drive.motor_hint))
    return 0.0


def _check_range(board: OdriveDialogue, limits: MotorLimits) -> None:
    for end in (limits.low, limits.high):
        if math.isfinite(end) and abs(end) > frames.MOST_TURNS:
            raise DriveError(
                f"the motor goes to {end:.4g} turns as {board.name} counts them now",
                expected=f"within ±{frames.MOST_TURNS:g}: beyond, its position is too coarse",
                do="set the board's position anew (Set_Absolute_Position, or switch it off and on)",
            )


def _set_limits(board: OdriveDialogue, limits: MotorLimits) -> None:
    """The rig's limits, which the board keeps from here on; its own must not be narrower."""
    own = [board.setting(name) for name in (settings.VELOCITY_LIMIT, settings.CURRENT_LIMIT)]
    again = "with odrivetool; where another rig ran before, switch the board off and on: its limits hold until then"
    check_limits(
        (
            DriveLimit("speed limit", limits.speed / (1.0 + SAME), own[0], "turns/s", settings.VELOCITY_LIMIT),
            DriveLimit("current limit", limits.current / (1.0 + SAME), own[1], "A", settings.CURRENT_LIMIT),
        ),
        again,
    )
    kept = (min(limits.speed, own[0]), min(limits.current, own[1]))
    board.set(Cmd.SET_LIMITS, dict(zip((settings.VELOCITY_LIMIT, settings.CURRENT_LIMIT), kept, strict=True)))


def _try_watchdog(board: OdriveDialogue, drive: OdriveParameters) -> bool:
    """Whether the board says that its watchdog runs out when nothing is said; not of one that watches in a run alone.

    Raises:
        DriveError: it says so while we speak, too.
    """
    for _ in range(TRIES):
        board.tell(Cmd.SET_AXIS_STATE, frames.pack(Cmd.SET_AXIS_STATE, AxisState.IDLE))
        board.tell(Cmd.CLEAR_ERRORS, bytes(1))
        if board.beats(drive.heartbeat + _LATE, lambda beat: not beat.errors & WATCHDOG):
            return board.beats(
                drive.watchdog + 2.0 * drive.heartbeat + _LATE, lambda beat: bool(beat.errors & WATCHDOG)
            )
    raise DriveError(
        f"the watchdog of {board.name} runs out although it is fed",
        expected=f"{1e3 * drive.watchdog:g} ms of time",
        do="load another firmware with its maker's tool",
    )


def probe(drive: OdriveParameters, links: Links) -> list[FoundDevice]:
    """Which boards there are: their heartbeats, and what they answer to questions; no order is given.

    Args:
        drive: with the bus.
        links: the buses of this process.

    Raises:
        DriveError: the bus cannot be used.
    """
    beats: dict[int, Beat] = {}
    versions: dict[int, tuple[Any, ...]] = {}

    def looked_at(identifier: int, data: bytes) -> None:
        node, cmd = identifier >> 5, identifier & 0x1F
        if identifier <= frames.HIGHEST_ID and len(data) == 8:
            if cmd == Cmd.HEARTBEAT and (beat := frames.unpack_beat(data)) is not None:
                beats[node] = beat
            elif cmd == Cmd.GET_VERSION and node in beats and (version := unpack(cmd, data)) is not None:
                versions[node] = version

    with joined(place(drive), drive.node_id, links) as port:
        bus = Conversation(port, drive.node_id, lambda identifier, data: False)  # other masters do not matter here
        bus.wait(LISTENING, looked_at)
        for node in sorted(beats):
            port.send_now(identifier_of(node, Cmd.GET_VERSION) | REMOTE, bytes(8))
        bus.wait(drive.answer_timeout, looked_at)
    found = []
    for node, beat in sorted(beats.items()):
        said = "ODrive board that tells no version (0.5?)"
        if node in versions:
            firmware, hardware = (".".join(map(str, one)) for one in (versions[node][4:7], versions[node][1:4]))
            said = f"hardware {hardware}, firmware {firmware}"
        errors = beat.errors & ~WATCHDOG  # which runs out where nobody speaks
        if errors:
            said += f", {errors_text(errors)}"
        found.append(FoundDevice(node, "ODrive board (CANSimple)", said, state_of(beat, errors).name))
    return found
