"""The diagnostic console of the twin of a moteus board, and the configuration that it shows. Pure.

Source of commands and answers: mjbots/moteus, docs/protocol/diagnostic.md and docs/reference/configuration.md. The
values are those of a board that is set up for a rig: as it comes, but for the watchdog's reaction, the limits and the
joint's encoder.
"""

import math
from collections.abc import Callable

LONGEST_LINE = 128
"""Of what is kept of a line that does not end [bytes]."""


class MoteusConsole:
    """Takes bytes in and gives bytes out.

    Args:
        configuration: name → value.
        stop: what `d stop` does.
    """

    def __init__(self, configuration: dict[str, float], stop: Callable[[], object]) -> None:
        self.configuration, self._stop = configuration, stop
        self._heard, self._said = b"", b""

    def take(self, data: bytes) -> None:
        """Bytes from the host; each line is answered."""
        lines = (self._heard + data).replace(b"\r", b"\n").split(b"\n")
        self._heard = lines.pop()[-LONGEST_LINE:]
        for line in lines:
            if line.strip():
                self._said += self._answer(line.decode("latin-1").split()).encode() + b"\r\n"

    def give(self, most: int) -> bytes:
        """Bytes for the host, this many at most."""
        given, self._said = self._said[:most], self._said[most:]
        return given

    def _answer(self, words: list[str]) -> str:
        match words:
            case ["conf", "get", name]:
                value = self.configuration.get(name)
                return "ERR error reading" if value is None else _text(value)
            case ["conf", "set", name, value]:
                try:
                    number = float(value)
                except ValueError:
                    number = math.nan
                    if value != "nan":
                        return "ERR error setting"
                if name not in self.configuration:
                    return "ERR error setting"
                self.configuration[name] = number
                return "OK"
            case ["d", "stop"]:
                self._stop()
                return "OK"
            case ["tel", "stop" | "text"] | ["conf", "write"]:
                return "OK"
        return "ERR unknown command"


def _text(value: float) -> str:
    return f"{int(value)}" if math.isfinite(value) and value == int(value) else f"{value:f}"


def usual(*, source: int, ratio: float, low: float, high: float, speed: float, current: float) -> dict[str, float]:
    """The configuration of a board that is set up for a rig.

    Args:
        source: slot of the joint's encoder.
        ratio: of its output to the rotor.
        low: limit of its position; NaN for none [turns].
        high: the same [turns].
        speed: largest [turns/s].
        current: largest [A].
    """
    found = {
        "id.id": 1.0,
        "servo.timeout_mode": 0.0,
        "servo.default_timeout_s": 0.1,
        "servo.timeout_max_torque_Nm": 5.0,
        "servo.fixed_voltage_mode": 0.0,
        "servo.voltage_mode_control": 0.0,
        "servo.default_velocity_limit": math.nan,
        "servo.default_accel_limit": math.nan,
        "servo.pid_position.kp": 4.0,
        "servo.pid_position.ki": 1.0,
        "servo.pid_position.kd": 0.05,
        "servo.max_velocity": speed,
        "servo.max_current_A": current,
        "servo.fault_position_error": math.nan,
        "servo.fault_velocity_error": math.nan,
        "servo.fault_temperature": 75.0,
        "servopos.position_min": low,
        "servopos.position_max": high,
        "motor_position.rotor_to_output_ratio": ratio,
    }
    for slot in (1, 2):
        there = slot == source
        found[f"motor_position.sources.{slot}.aux_number"] = 2.0 if there else 1.0
        found[f"motor_position.sources.{slot}.type"] = 1.0 if there else 0.0
    return found
