"""An ODrive board on classic CAN as the live loop's `Drive`: packed and parsed by hand, no thread, never waiting.

A cycle sends one order and two questions, remote frames for the position and for the current, now and then for the
temperature in its place; the next cycle reads the answers, which are as old as the cycle. What the axis does stands in
the board's heartbeat alone, whose age is its sign of life.

- Orders feed the board's watchdog: a loop that hangs is a host that is gone, and the board goes to idle with an error.
- Before the first order with power that error is cleared by itself: nobody speaks to a board between its bring-up and
  the first cycle. Afterwards an operator's word alone clears it, like any other.
- Closed loop is asked for once, and again only after a while: a board that is asked while it is in it might begin anew.
- Power off is idle, in every cycle; a board that stays in closed loop for all that is sent its emergency stop.
- A silence of its own may be a restart, after which its limits and its position are others: it is brought up again.

Bring-up writes the mode and the two limits that a run needs, all of which are read back and lost with the supply:
nothing is saved. The watchdog is the owner's to set; it is read, and then tried by saying nothing for its time.
"""

import math
from collections.abc import Callable, Mapping
from typing import Any

from bowden.core.errors import DriveError
from bowden.core.signals import EMERGENCY_STOP, DriveState
from bowden.hardware.buses.link import BusPort, Links
from bowden.hardware.buses.place import REMOTE
from bowden.hardware.drives import checklist
from bowden.hardware.drives import odrive_endpoints as settings
from bowden.hardware.drives import odrive_frames as frames
from bowden.hardware.drives.checklist import LISTENING, Conversation, DriveLimit, Found, Said, Setting
from bowden.hardware.drives.driver import Driver
from bowden.hardware.drives.families.odrive import OdriveParameters, target_of
from bowden.hardware.drives.findings import LEFT, UNWATCHED, WATCH_EVERY
from bowden.hardware.drives.odrive_endpoints import ENABLED, TIMEOUT, Endpoints, endpoints_of
from bowden.hardware.drives.odrive_frames import WATCHDOG, AxisState, Beat, Cmd, errors_text, identifier_of, unpack
from bowden.hardware.drives.on_can import place
from bowden.hardware.drives.scale import MotorLimits, Scale, SuitScale, found_scale, motor_limits
from bowden.hardware.ports import Power
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
    """True if a frame is one that only the board's host may send: an order, or a question for what it tells."""
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


class OdriveDialogue(Conversation):
    """Questions and answers with one board.

    Args:
        port: of its bus, while no cycle runs.
        drive: which board.
        endpoints: where its settings are.
    """

    def __init__(self, port: BusPort, drive: OdriveParameters, endpoints: Endpoints) -> None:
        super().__init__(port, drive.node_id, lambda *frame: is_foreign(drive.node_id, *frame), drive.answer_timeout)
        self._endpoints = endpoints
        self.beat: Beat | None = None

    def _matching(self, matches: Callable[[int, bytes], Said | None]) -> Callable[[int, bytes], Said | None]:
        """What a frame of the board says, by its command and data; heartbeats are kept."""

        def looked_at(identifier: int, data: bytes) -> Said | None:
            if identifier >> 5 != self.number or is_foreign(self.number, identifier, data):
                return None
            if identifier & 0x1F == Cmd.HEARTBEAT:
                self.beat = frames.unpack_beat(data) or self.beat
            return matches(identifier & 0x1F, data)

        return looked_at

    def beats(self, span: float, wanted: Callable[[Beat], bool]) -> bool:
        """True if a heartbeat as wanted comes within a time [s]."""

        def looked_at(cmd: int, data: bytes) -> bool | None:
            beat = frames.unpack_beat(data) if cmd == Cmd.HEARTBEAT else None
            return True if beat is not None and wanted(beat) else None

        return self.wait(span, self._matching(looked_at)) is not None

    def answered(self, cmd: Cmd) -> tuple[Any, ...]:
        """The fields of what the board tells when it is asked.

        Raises:
            DriveError: no answer.
        """
        question = identifier_of(self.number, cmd) | REMOTE, bytes(8)
        said = self.ask(question, self._matching(lambda got, data: unpack(cmd, data) if got == cmd else None))
        if said is not None:
            return said
        raise DriveError(
            f"{self.name} does not answer {cmd.name}",
            expected="an ODrive board with firmware 0.6.9 or later, and an adapter that sends remote frames",
            do="load a later firmware with its maker's tool; check the cable and its termination",
        )

    def serial(self) -> str:
        """Its serial number, bytes 1 to 6 of its frame Address; empty of a firmware that does not tell it."""
        address = identifier_of(self.number, Cmd.ADDRESS)
        reply = self.ask(
            (address | REMOTE, bytes(8)),
            lambda identifier, data: data if identifier == address and len(data) == 8 else None,
            tries=1,
        )
        return "" if reply is None else reply[1:7].hex()

    def tell(self, cmd: Cmd, data: bytes) -> None:
        """An order."""
        self.port.send_now(identifier_of(self.number, cmd), data)

    def setting(self, name: str) -> float:
        """A value of the board's configuration.

        Raises:
            DriveError: no answer.
        """
        endpoint = self._endpoints.where[name]

        def answered(cmd: int, data: bytes) -> float | None:
            answer = frames.unpack_sdo(data) if cmd == Cmd.TX_SDO else None
            return None if answer is None or answer[1] != endpoint.number else endpoint.unpack(answer[2])

        question = identifier_of(self.number, Cmd.RX_SDO), frames.pack_sdo(endpoint.number)
        value = self.ask(question, self._matching(answered))
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


def _check_version(board: OdriveDialogue, endpoints: Endpoints) -> str:
    protocol, *numbers = board.answered(Cmd.GET_VERSION)
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
        raise checklist.refuse_torque(
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
            checklist.is_about(1.0),
            "True",
            "keeps its torque when its host falls silent: its watchdog is off",
            f"in odrivetool: {settings.TIMEOUT} = {drive.watchdog:g}, {settings.ENABLED} = True, and save",
        ),
        *(
            Setting(name, checklist.is_about(value, SAME), f"{value:g}", do="set it with odrivetool" + key)
            for name, value, key in alike
            if name != settings.ABSOLUTE or value
        ),
        Setting(
            settings.TORQUE_CONSTANT,
            checklist.is_about(drive.needs.torque_constant, CONSTANT),
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


def _motor_scale(board: OdriveDialogue, drive: OdriveParameters) -> Scale | SuitScale:
    """Of the motor as it is found, which must stand still."""
    first, _ = board.answered(Cmd.GET_ENCODER_ESTIMATES)
    last, _ = board.answered(Cmd.GET_ENCODER_ESTIMATES)
    if not (math.isfinite(first) and abs(last - first) <= STILL):
        raise DriveError(
            f"the position of {board.name} is {first:g} and then {last:g} turns",
            expected="a motor that stands still, and whose encoder is calibrated",
            do="hold it, and calibrate it with odrivetool",
        )
    return found_scale(drive, last, 1.0)


def _check_range(board: OdriveDialogue, limits: MotorLimits) -> None:
    for end in (limits.low, limits.high):
        if math.isfinite(end) and abs(end) > frames.MOST_TURNS:
            raise DriveError(
                f"the motor goes to {end:.4g} turns as {board.name} counts them now",
                expected=f"within ±{frames.MOST_TURNS:g}: beyond, its position is too coarse",
                do="set the board's position anew (Set_Absolute_Position, or switch it off and on)",
            )


def _set_limits(board: OdriveDialogue, drive: OdriveParameters, limits: MotorLimits) -> None:
    """The rig's limits, which the board keeps from here on; its own must not be narrower."""
    own = [board.setting(name) for name in (settings.VELOCITY_LIMIT, settings.CURRENT_LIMIT)]
    again = "with odrivetool; where another rig ran before, switch the board off and on: its limits hold until then"
    speed = own[0] * drive.needs.speed_limit / limits.speed
    checklist.check_limits(
        (
            DriveLimit(checklist.SPEED, drive.needs.speed_limit / (1.0 + SAME), speed, settings.VELOCITY_LIMIT),
            DriveLimit(checklist.CURRENT, limits.current / (1.0 + SAME), own[1], settings.CURRENT_LIMIT),
        ),
        again,
    )
    kept = (min(limits.speed, own[0]), min(limits.current, own[1]))
    board.set(Cmd.SET_LIMITS, dict(zip((settings.VELOCITY_LIMIT, settings.CURRENT_LIMIT), kept, strict=True)))


def _try_watchdog(board: OdriveDialogue, drive: OdriveParameters) -> bool:
    """True if the board says that its watchdog runs out when nothing is said; not of one that watches in a run alone.

    Raises:
        DriveError: it says so while we speak, too.
    """
    for _ in range(checklist.TRIES):
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

    with links.join(place(drive), f"node {drive.node_id}", lambda _: True) as port:
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


TURN = (*(Cmd.GET_IQ,) * 7, Cmd.GET_TEMPERATURE)
"""What a cycle asks for beside the position, in turn."""
AGAIN = 0.1
"""Between two requests for closed loop [s]."""
REFUSED = 5
"""Requests in vain after which the board has refused."""
DISOBEYED = 6
"""Heartbeats with closed loop after it was told to be idle, after which its emergency stop is used."""
_EIGHT = bytes(8)
_IDLE = frames.pack(Cmd.SET_AXIS_STATE, AxisState.IDLE)
_CLOSED_LOOP = frames.pack(Cmd.SET_AXIS_STATE, AxisState.CLOSED_LOOP_CONTROL)


class OdriveDrive(Driver):
    """The drive of one motor; without a list of the board's endpoints there is none."""

    _drive: OdriveParameters
    turn = 1.0
    most_counts = frames.MOST_TURNS

    def _prepare(self) -> None:
        drive = self._drive
        self._endpoints, self._scales = endpoints_of(drive.endpoints), (drive.velocity_scale, drive.torque_scale)
        self._frames = drive.node_id << 5
        """Identifier of its frames, of command 0."""
        self._asks_position = self._frames | Cmd.GET_ENCODER_ESTIMATES | REMOTE
        self._asks = [self._frames | cmd | REMOTE for cmd in TURN]
        """Remote frames."""
        where = self._endpoints.where
        self._watch = {
            where[ENABLED].number: (where[ENABLED], 1.0),
            where[TIMEOUT].number: (where[TIMEOUT], drive.watchdog),
        }
        """Number → setting of the watchdog, and its value."""
        self._commands = {frames.identifier_of(drive.node_id, Cmd(cmd)): int(cmd) for cmd in frames.TOLD}
        """Identifier → command of what it tells."""

    def _find(self, port: BusPort) -> Found:
        drive, endpoints = self._drive, self._endpoints
        board = OdriveDialogue(port, drive, endpoints)
        board.beats(LISTENING, lambda _: False)
        board.check_alone()
        if board.beat is None:
            raise DriveError(
                f"no ODrive board is heard as {board.name}",
                expected=f"its heartbeat, every {1e3 * drive.heartbeat:g} ms",
                do="switch it on; check node_id and bitrate in [drive], cable and termination, and "
                "heartbeat_msg_rate_ms",
            )
        who = _check_version(board, endpoints)
        _check_idle(board)
        active, disarmed = board.answered(Cmd.GET_ERROR)
        failed = (active | disarmed) & ~WATCHDOG
        voltage, _ = board.answered(Cmd.GET_BUS_VOLTAGE_CURRENT)
        checklist.check_settings(board.name, board.setting, _settings(drive))
        _check_encoder(board)
        motor = _motor_scale(board, drive)
        limits = motor_limits(drive, motor)
        _check_range(board, limits)
        modes = {settings.CONTROL_MODE: frames.POSITION_CONTROL, settings.INPUT_MODE: frames.PASSTHROUGH}
        board.set(Cmd.SET_CONTROLLER_MODE, modes)
        _set_limits(board, drive, limits)
        tried = not failed and _try_watchdog(board, drive)
        board.check_alone()
        identity = (
            f"ODrive board at {board.name}, {who}, supply {voltage:.1f} V; watchdog of {1e3 * drive.watchdog:g} ms, "
        )
        identity += "tried" if tried else "read back and not tried: it does not run while the board is idle"
        state = DriveState.SWITCH_ON_DISABLED
        if failed:
            identity, state = f"{identity}; in fault, {errors_text(failed)}", DriveState.FAULT
        return Found(identity, motor, None, limits, state, failed, board.serial())

    def _concerns(self, identifier: int) -> bool:
        return identifier >> 5 in (self._drive.node_id, frames.BROADCAST)

    def _is_foreign(self, identifier: int, data: bytes) -> bool:
        return is_foreign(self._drive.node_id, identifier, data)

    def _begin(self, found: Found | None) -> None:
        errors = 0 if found is None else found.error
        self._beat = frames.Beat(errors, AxisState.IDLE)
        self._armed_with = 0  # errors that it had when it came to closed loop, of the time before
        self._untouched = True  # nothing with power has been ordered
        self._stopped = False  # by our own Estop
        self._asked_at, self._requests, self._disobeyed = -math.inf, 0, 0
        self._cycles = self._questions = 0
        self._asked_watch_at = -math.inf
        self._unwatched: set[int] = set()  # settings of the watchdog that are not as they were
        self._turns = self._before_turns = math.nan  # as read, as sent
        self._temperature = math.nan
        self._readings.failed(frames.code_of(errors))  # one that was there before is no news

    def _take(self, identifier: int, data: bytes, now: float) -> bool:
        cmd, found, readings = self._commands.get(identifier), self._found, self._readings
        if cmd is None or not data or found is None:
            return False
        if cmd == Cmd.HEARTBEAT and (beat := frames.unpack_beat(data)) is not None:
            readings.replied_at = now
            self._disobeyed = self._disobeyed + 1 if beat.state != AxisState.IDLE and not self._asked else 0
            if beat.state == AxisState.CLOSED_LOOP_CONTROL != self._beat.state:
                self._armed_with = beat.errors
            self._beat = beat
            self._lost = self._lost or beat.state == AxisState.UNDEFINED
        elif cmd == Cmd.GET_ENCODER_ESTIMATES and (values := frames.unpack(cmd, data)) is not None:
            self._check_turns(values[0], now)
            if not self._lost and abs(values[0]) <= 2.0 * frames.MOST_TURNS:
                self._turns = values[0]
                readings.moved(found.motor.angle(values[0]), readings.current, self._temperature, self._written)
        elif cmd == Cmd.GET_IQ and (values := frames.unpack(cmd, data)) is not None:
            readings.current = self._drive.motor_direction * values[1] if math.isfinite(values[1]) else math.nan
        elif cmd == Cmd.GET_TEMPERATURE and (values := frames.unpack(cmd, data)) is not None:
            self._temperature = values[0] if math.isfinite(values[0]) else math.nan
        elif cmd == Cmd.TX_SDO and (answer := frames.unpack_sdo(data)) is not None and answer[1] in self._watch:
            endpoint, wanted = self._watch[answer[1]]
            value = endpoint.unpack(answer[2])
            as_set = value is None or abs(value - wanted) <= SAME * wanted
            (self._unwatched.discard if as_set else self._unwatched.add)(endpoint.number)
        return True

    @property
    def _expired(self) -> bool:
        """True if the board's one error is that nobody spoke to it before the first order with power."""
        return self._untouched and self._beat.errors == frames.WATCHDOG

    def _counting_errors(self) -> int:
        """Those that count: of a board in closed loop those that came in it."""
        if self._expired:
            return 0
        if self._beat.state == AxisState.CLOSED_LOOP_CONTROL:
            return self._beat.errors & ~self._armed_with
        return self._beat.errors

    def _standing(self) -> DriveState:
        if self._found is None or self._lost:
            return DriveState.NOT_READY_TO_SWITCH_ON
        return state_of(self._beat, self._counting_errors())

    def _judge(self, now: float) -> None:
        readings, led = self._readings, self._state is DriveState.OPERATION_ENABLED
        errors = 0 if self._lost else self._counting_errors()
        pressed = errors & frames.ESTOP and not self._stopped
        readings.failed(int(EMERGENCY_STOP) if pressed else frames.code_of(errors))
        if self._asked and self._before is DriveState.OPERATION_ENABLED and not led and not readings.error:
            readings.found(LEFT)
        if self._asked and not led and self._requests > REFUSED:
            readings.found(frames.UNTOLD)
        if self._unwatched and not self._lost:
            readings.found(UNWATCHED)

    def _can_lead(self) -> bool:
        return self._state in (DriveState.SWITCH_ON_DISABLED, DriveState.OPERATION_ENABLED) and not self._expired

    def _lead(self, found: Found, counts: float, target: float, torque: float, now: float) -> None:
        self._untouched = False
        led = self._state is DriveState.OPERATION_ENABLED
        if not self._asked:
            self._requests, self._asked_at = 0, -math.inf
        if not led and now - self._asked_at >= AGAIN:
            self._requests, self._asked_at = self._requests + 1, now
            self._order(Cmd.SET_AXIS_STATE, _CLOSED_LOOP)
        if led:
            self._requests = 0
            sent = target_of(self._drive, found.limits, counts, self._before_turns, torque)
            self._target, self._before_turns, self._led = target, counts, self._led + 1
        else:
            sent = frames.Target(self._turns, 0.0, 0.0)
        self._order(Cmd.SET_INPUT_POS, frames.pack_target(sent, self._scales))

    def _relax(self, power: Power, now: float) -> None:
        """See `Driver._relax`; its quick stop is its emergency stop, an error until an operator's word."""
        self._requests, self._before_turns = 0, math.nan
        if self._disobeyed > DISOBEYED or (power is Power.QUICK_STOP and self._beat.state != AxisState.IDLE):
            self._disobeyed, self._stopped = 0, True
            self._order(Cmd.ESTOP, b"")
        self._order(Cmd.SET_AXIS_STATE, _IDLE)
        if self._expired or self._reset:
            self._order(Cmd.CLEAR_ERRORS, bytes(1))
            self._reset = self._stopped = False

    def _ask(self, now: float) -> None:
        self._send(self._asks_position, _EIGHT)
        if now - self._asked_watch_at >= WATCH_EVERY:
            self._questions, self._asked_watch_at = self._questions + 1, now
            self._order(Cmd.RX_SDO, frames.pack_sdo([*self._watch][self._questions % len(self._watch)]))
        else:
            self._send(self._asks[self._cycles % len(TURN)], _EIGHT)
        self._cycles += 1

    def _order(self, cmd: Cmd, data: bytes) -> None:
        self._send(self._frames | cmd, data)

    def reset_fault(self) -> None:
        """See `hardware.ports.Drive.reset_fault`; without effect where the board has no fault."""
        self._reset = self._state is DriveState.FAULT

    def _tell_off(self, number: int) -> None:
        """Idle; and where that does not help the emergency stop."""
        if number >= 2 * DISOBEYED:
            self._order(Cmd.ESTOP, b"")
        self._order(Cmd.SET_AXIS_STATE, _IDLE)

    def _torque_told(self, identifier: int, data: bytes) -> bool | None:
        if identifier != frames.identifier_of(self._drive.node_id, Cmd.HEARTBEAT):
            return None
        beat = frames.unpack_beat(data)
        return None if beat is None else beat.state != AxisState.IDLE
