"""Live data for Foxglove, read by a client that we did not write."""

import asyncio
import socket
import struct
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from bowden.app import main
from bowden.control import LAWS
from bowden.core.errors import ParameterError
from bowden.live import foxglove_process, ring
from bowden.live.foxglove_process import served
from bowden.live.mcap_log import Packing, topics
from bowden.live.ring import RingWriter
from bowden.live.row import AT, columns, description
from support.own_loop import in_a_thread

ABOUT = description(columns(LAWS["adaptive"]), {}, 1_700_000_000 * 10**9, 5)


@pytest.fixture
def rows(tmp_path: Path) -> Iterator[Path]:
    """A ring into which a row goes each millisecond; its columns are their own numbers, but for the time."""
    path = tmp_path / "a.ring"
    ring.create(path, ABOUT, 4096)
    writer, over = RingWriter(path), threading.Event()

    def write() -> None:
        row, k = np.arange(len(ABOUT.columns), dtype=np.float64), 0
        while not over.wait(1e-3):
            row[AT["time"]] = 1e-3 * k
            writer.write(row)
            k += 1

    thread = threading.Thread(target=write)
    thread.start()
    try:
        yield path
    finally:
        over.set()
        thread.join()


def test_a_message_is_the_logs_without_its_head() -> None:
    packing = Packing(topics(ABOUT.columns, ABOUT.units))
    given = np.random.default_rng(1).normal(size=(3, packing.width))
    (one, two, three) = packing.messages(0, given)
    at = packing.topics[0].columns
    assert one[:4] == b"\x00\x01\x00\x00"
    assert np.frombuffer(three[4:], "<f8").tolist() == given[2, at].tolist()
    whole = packing.pack(np.arange(3), given, np.arange(3))
    assert one in whole
    assert two in whole


@pytest.mark.live
def test_a_client_that_we_did_not_write_reads_every_cycle(rows: Path) -> None:
    pytest.importorskip("foxglove", reason="needs the extra foxglove")
    bridge = pytest.importorskip("robo_ws_bridge", reason="needs the extra partners")

    async def read(address: str) -> tuple[dict[str, str], list[tuple[int, bytes]]]:
        client = bridge.WebSocketBridgeClient(address, subprotocol="foxglove.sdk.v1")
        got: list[tuple[int, bytes]] = []
        client.on_message(lambda channel, stamp, data: got.append((stamp, bytes(data))))
        await client.connect()
        end = time.monotonic() + 20.0
        while "/cycle" not in {one["topic"] for one in client.channels.values()} and time.monotonic() < end:
            await asyncio.sleep(0.05)
        schemas = {one["topic"]: one["schema"] for one in client.channels.values()}
        await client.subscribe("/cycle")
        while len(got) < 500 and time.monotonic() < end:
            await asyncio.sleep(0.05)
        await client.disconnect()
        return schemas, got

    with served(rows, 0) as address:
        schemas, got = in_a_thread(read(address))
    assert {"/cycle", "/law", "/supervisor"} <= set(schemas)
    lines = schemas["/cycle"].splitlines()
    assert lines[AT["time"]] == "float64 time  # [s]"
    assert len(got) >= 500
    values = np.array([struct.unpack(f"<{len(lines)}d", data[4:]) for _, data in got])
    steps = np.diff(values[:, AT["time"]])
    assert steps == pytest.approx(1e-3), "no cycle is left out"
    assert values[0, 5] == 5.0
    stamps = np.array([stamp for stamp, _ in got])
    assert stamps - ABOUT.start_utc_ns == pytest.approx(1e9 * values[:, 0], abs=2.0)


@pytest.mark.live
def test_a_port_that_is_taken_is_said(rows: Path) -> None:
    pytest.importorskip("foxglove", reason="needs the extra foxglove")
    seen: list[float] = []
    with served(rows, 0, lambda: seen.append(time.monotonic())) as address:
        assert np.diff(seen).max() < 0.2, "whoever waits for it can give signs of life"
        port = int(address.rpartition(":")[2])
        with pytest.raises(ParameterError, match=f"cannot serve live data at port {port}: "), served(rows, port):
            pass


def test_what_cannot_be_served_is_one_line_before_anything_begins(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "rig.toml"
    path.write_text("")
    assert main.run(["run", str(path), "--twin", "--auto", "--foxglove", "70000"]) == 2
    assert capsys.readouterr().err == "bowden: --foxglove is 70000; expected a port from 0 to 65535; correct it\n"
    monkeypatch.setattr(foxglove_process, "find_spec", lambda name: name)
    with socket.socket() as taken:
        taken.bind((foxglove_process.HOST, 0))
        taken.listen()
        port = str(taken.getsockname()[1])
        words = ["run", str(path), "--twin", "--auto", "--out", str(tmp_path / "out"), "--foxglove", port]
        assert main.run(words) == 2
    printed = capsys.readouterr().err
    assert printed.startswith(f"bowden: cannot serve live data at port {port}: Address already in use; name another")
    assert printed.count("\n") == 1
    assert not (tmp_path / "out").exists()
    monkeypatch.setattr(foxglove_process, "find_spec", lambda name: None)
    assert main.run(["run", str(path), "--twin", "--auto", "--foxglove", "0"]) == 2
    assert "pip install 'bowden[foxglove]'" in capsys.readouterr().err
