"""Where the settings of an ODrive board are: the numbers of its endpoints, which differ from firmware to firmware.

The maker publishes for every firmware and hardware a file ``flat_endpoints.json``, with the version of both in it. A
rig names it, and bring-up refuses a board of another version: the same number would be another setting.
"""

import json
import struct
from collections.abc import Mapping
from pathlib import Path
from typing import NamedTuple

from bowden.core import bounded
from bowden.core.errors import ParameterError

FORMATS: Mapping[str, str] = {
    **{"bool": "?", "uint8": "B", "int8": "b", "uint16": "H", "int16": "h", "uint32": "I", "int32": "i"},
    "float": "f",
}
"""Type of an endpoint → how `struct` has it; those that a frame can carry."""

ENABLED, TIMEOUT = "axis0.config.enable_watchdog", "axis0.config.watchdog_timeout"
BEAT_EVERY = "axis0.config.can.heartbeat_msg_rate_ms"
VELOCITY_SCALE, TORQUE_SCALE = "axis0.config.can.input_vel_scale", "axis0.config.can.input_torque_scale"
CONTROL_MODE, INPUT_MODE = "axis0.controller.config.control_mode", "axis0.controller.config.input_mode"
VELOCITY_LIMIT = "axis0.controller.config.vel_limit"
VELOCITY_LIMITED = "axis0.controller.config.enable_vel_limit"
CIRCULAR, ABSOLUTE = "axis0.controller.config.circular_setpoints", "axis0.controller.config.absolute_setpoints"
CURRENT_LIMIT = "axis0.config.motor.current_soft_max"
TORQUE_CONSTANT = "axis0.config.motor.torque_constant"
LOAD_ENCODER, MOTOR_ENCODER = "axis0.config.load_encoder", "axis0.config.commutation_encoder"

USED: Mapping[str, str] = {
    **{ENABLED: "bool", TIMEOUT: "float", BEAT_EVERY: "uint32", VELOCITY_SCALE: "uint32", TORQUE_SCALE: "uint32"},
    **{CONTROL_MODE: "uint8", INPUT_MODE: "uint8", VELOCITY_LIMIT: "float", VELOCITY_LIMITED: "bool"},
    **{CIRCULAR: "bool", ABSOLUTE: "bool", CURRENT_LIMIT: "float", TORQUE_CONSTANT: "float"},
    **{LOAD_ENCODER: "uint8", MOTOR_ENCODER: "uint8"},
}
"""What bring-up reads → its type in the twin's list."""

TWIN = "twin"
"""``endpoints`` of a rig that names no file: those of the twin, whose hardware 0.0.0 no board has."""


class Endpoint(NamedTuple):
    """One setting."""

    number: int
    type: str

    def pack(self, value: float) -> bytes:
        """A value as it goes over the bus."""
        whole = FORMATS[self.type] not in "?f"
        return struct.pack("<" + FORMATS[self.type], int(value) if whole else value)

    def unpack(self, data: bytes) -> float | None:
        """A value as it came; None of bytes that are too few."""
        form = struct.Struct("<" + FORMATS[self.type])
        return float(form.unpack(data[: form.size])[0]) if len(data) >= form.size else None


class Endpoints(NamedTuple):
    """The settings of one firmware on one hardware."""

    firmware: tuple[int, int, int]
    hardware: tuple[int, int, int]
    where: Mapping[str, Endpoint]
    """Name → where it is."""


def endpoints_of(name: str) -> Endpoints:
    """What the key ``endpoints`` of [drive] names.

    Raises:
        ParameterError: no such file, or one that is not the maker's.
    """
    if name == TWIN:
        numbered = {path: Endpoint(number, kind) for number, (path, kind) in enumerate(USED.items(), 1)}
        return Endpoints((0, 6, 10), (0, 0, 0), numbered)
    try:
        tree = json.loads(bounded.read_text(Path(name)))
        where = {path: Endpoint(int(tree["endpoints"][path]["id"]), tree["endpoints"][path]["type"]) for path in USED}
        firmware, hardware = _version(tree["fw_version"]), _version(tree["hw_version"])
    except OSError as error:
        raise ParameterError(f"drive.endpoints: cannot read {name}: {bounded.reason(error)}", do=_DO) from error
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError) as error:
        raise ParameterError(
            f"drive.endpoints: {name} is not the maker's flat_endpoints.json ({type(error).__name__}: {error})", do=_DO
        ) from error
    for path, endpoint in where.items():
        if endpoint.type not in FORMATS or not 0 <= endpoint.number <= 0xFFFF:
            raise ParameterError(
                f"drive.endpoints: {name} has {path} as number {endpoint.number} of type {endpoint.type!r}", do=_DO
            )
    return Endpoints(firmware, hardware, where)


_DO = "take the flat_endpoints.json of the board's firmware and hardware from its maker's pages"


def _version(text: str) -> tuple[int, int, int]:
    """``0.6.10-1`` as numbers."""
    major, minor, revision = (int(part) for part in text.partition("-")[0].split("."))
    return major, minor, revision
