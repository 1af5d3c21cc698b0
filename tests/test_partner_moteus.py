"""A master that we did not write against our twin: PyPI's `moteus`, over the bus between processes."""

import asyncio
import math
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import can
import pytest

from bowden.hardware.buses.unix_bus import UnixBus
from bowden.hardware.drives import moteus_frames as frames
from bowden.hardware.drives.families.moteus import MoteusParameters
from bowden.rig.rig import Rig
from support.own_loop import in_a_thread
from support.played import Played

moteus = pytest.importorskip("moteus", reason="the extra `partners` is not installed: moteus of mjbots")
pytestmark = pytest.mark.live


class UnixTransport:
    """The package's commands over our bus: the part that its own fdcanusb or SocketCAN transport has."""

    def __init__(self, channel: str) -> None:
        self._bus = UnixBus(channel, create=False, fd=True)

    async def cycle(self, commands: list[Any], **_: Any) -> list[Any]:
        """Send commands, and take the reply to each that wants one."""
        found = []
        for command in commands:
            identifier = (0x8000 if command.reply_required else 0) | command.source << 8 | int(command.destination)
            identifier |= command.can_prefix << 16
            self._bus.send(
                can.Message(
                    arbitration_id=identifier,
                    is_extended_id=identifier > frames.STANDARD_ID,
                    is_fd=True,
                    bitrate_switch=True,
                    data=frames.padded(bytes(command.data)),
                )
            )
            if command.reply_required:
                found += await self._reply(command)
        return found

    async def write(self, command: Any) -> None:
        """Send one command."""
        await self.cycle([command])

    async def read(self) -> Any:
        """Nothing comes that was not asked for."""
        await asyncio.sleep(10.0)

    async def _reply(self, command: Any) -> list[Any]:
        ends = time.monotonic() + 2.0
        while time.monotonic() < ends:
            message = self._bus.recv(0.0)
            if message is None:
                await asyncio.sleep(1e-4)
                continue
            if message.arbitration_id >> 8 & 0x7F == command.destination and (
                command.reply_filter is None or command.reply_filter(message)
            ):
                return [command.parse(message)]
        return []

    def close(self) -> None:
        """Leave the bus."""
        self._bus.shutdown()


@pytest.fixture
def played(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[Played]:
    drive = Rig(drive=MoteusParameters(can_prefix=getattr(request, "param", 0))).drive_parameters
    with Played(drive, tmp_path / "bus") as twin:
        yield twin


def test_its_position_command_moves_our_twin(played: Played) -> None:
    """The loop of its public example: stop, then a position command with a query, every 20 ms."""
    transport = UnixTransport(played.channel)
    seen: list[Any] = []

    async def main() -> None:
        c = moteus.Controller(id=1, transport=transport)
        await c.set_stop()
        start = (await c.query()).values[moteus.Register.POSITION]
        for k in range(100):
            state = await c.set_position(position=start + 0.005 * k, velocity=0.25, query=True)
            seen.append(state)
            await asyncio.sleep(0.02)
        await c.set_stop()
        seen.append(await c.query())

    in_a_thread(main())
    transport.close()
    values = [state.values for state in seen]
    assert values[-1][moteus.Register.MODE] == moteus.Mode.STOPPED
    assert values[50][moteus.Register.MODE] == moteus.Mode.POSITION
    moved = values[99][moteus.Register.POSITION] - values[0][moteus.Register.POSITION]
    assert moved == pytest.approx(0.495, abs=0.1)
    assert played.plant.motor == pytest.approx(2.0 * math.pi * values[99][moteus.Register.POSITION] / 5.0, abs=0.1)
    assert values[50][moteus.Register.FAULT] == 0


def test_its_watchdog_its_types_and_its_console_are_understood(played: Played) -> None:
    transport = UnixTransport(played.channel)
    kinds = moteus.QueryResolution()
    kinds.position, kinds.velocity, kinds.torque = moteus.INT16, moteus.INT16, moteus.INT8
    kinds.motor_temperature, kinds.q_current = moteus.INT16, moteus.INT32
    kinds._extra = {moteus.Register.ENCODER_1_POSITION: moteus.F32}

    async def main() -> tuple[Any, Any, bytes, bytes]:
        c = moteus.Controller(id=1, transport=transport, query_resolution=kinds)
        await c.set_stop()
        for _ in range(5):
            state = await c.set_position(position=math.nan, watchdog_timeout=0.05, query=True)
            await asyncio.sleep(0.01)
        await asyncio.sleep(0.2)
        after = await c.query()
        stream = moteus.Stream(c, use_flow_control=False)
        reaction = await stream.command(b"conf get servo.timeout_mode", allow_any_response=True)
        answer = await stream.command(b"tel stop")
        return state, after, reaction, answer

    state, after, reaction, answer = in_a_thread(main())
    transport.close()
    assert abs(state.values[moteus.Register.POSITION]) < 3.3
    assert math.isnan(state.values[moteus.Register.MOTOR_TEMPERATURE])
    assert 0.0 <= state.values[moteus.Register.ENCODER_1_POSITION] <= 1.0
    assert after.values[moteus.Register.MODE] == moteus.Mode.TIMEOUT
    assert reaction.strip() == b"0"
    assert answer == b""


@pytest.mark.parametrize("played", [0x123], indirect=True)
def test_its_prefix_is_ours(played: Played) -> None:
    transport = UnixTransport(played.channel)

    async def main() -> tuple[Any, Any]:
        with_it = await moteus.Controller(id=1, transport=transport, can_prefix=0x123).query()
        return with_it, await moteus.Controller(id=1, transport=transport).query()

    found, without = in_a_thread(main())
    transport.close()
    assert found.values[moteus.Register.MODE] == moteus.Mode.STOPPED
    assert without is None
