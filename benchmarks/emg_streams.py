"""EMG streams in real time: 16 channels at 2 kHz from another process by LSL and by the Trigno protocol.

    python benchmarks/emg_streams.py [lsl trigno] [--minutes 5]

The last channel counts the samples, so that each is known by its content. A sample is taken at its place in the
sender's clock, which is this computer's; latency is from there to when the detector's output for it is there, of two
channels of made-up EMG. The reader looks once a millisecond, as the live loop does. Writes its section of
``benchmarks/RESULTS.md`` where both streams have run for five minutes.
"""

import argparse
import json
import os
import subprocess
import sys
import threading
import time
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import results
from bowden.core.clock import SECOND, MonotonicClock
from bowden.hardware.emg.lsl_outlet import LslOutlet
from bowden.hardware.emg.sources import open_source
from bowden.hardware.emg.trigno_server import TrignoServer
from bowden.sensing.stream import OnsetDetector
from bowden.sim.emg import background, contractions
from measure import Figure, table

Array = NDArray[np.float64]

RATE, CHANNELS = 2000.0, 16
TITLE = "EMG streams"
KINDS = ("lsl", "trigno")
PUSH = 0.002
"""How often the LSL stream's sender sends [s]."""
UNIT = 1e-3
"""What the counter goes up by with each sample [mV]."""
LOOPBACK = Path(__file__).parents[1] / "tests" / "lsl_api.cfg"
"""Keeps LSL on this machine."""


def recording(seconds: float) -> Array:
    """Two muscles that contract once in six seconds, noise, and the counter (n, 16) [mV]."""
    count = round(seconds * RATE)
    random = np.random.default_rng(1)
    values = np.empty((count, CHANNELS))
    for k in range(CHANNELS - 1):
        values[:, k] = background(RATE, count, random)
    for k in range(2):
        spans = [(begin, begin + 1.5, 0.5) for begin in np.arange(2.0 + 3.0 * k, seconds - 2.0, 6.0)]
        values[:, k] += contractions(RATE, spans, count, k)
    values[:, -1] = UNIT * np.arange(count)
    return values


def send(kind: str, seconds: float) -> None:
    """The other process: says when sample 0 was taken, in its first line of output."""
    values, clock = recording(seconds), MonotonicClock()
    if kind == "lsl":
        _send_lsl(values, clock)
        return
    server = TrignoServer(values, RATE)
    print(json.dumps({"source": f"trigno:127.0.0.1:{server.ports.command}:{server.ports.emg}"}), flush=True)
    told: list[int] = []

    def tell(played: float) -> None:
        if server.started is not None and not told:
            told.append(server.started)
            print(json.dumps({"start": server.started / SECOND}), flush=True)

    until = threading.Event()
    threading.Thread(target=lambda: (sys.stdin.read(), until.set()), daemon=True).start()
    server.serve(until.is_set, tell)
    server.close()


def _send_lsl(values: Array, clock: MonotonicClock) -> None:
    names = [f"emg{k}" for k in range(CHANNELS)]
    outlet = LslOutlet("bowden-benchmark", RATE, names, "mV", f"bowden-benchmark-{os.getpid()}")
    print(json.dumps({"source": "lsl:bowden-benchmark"}), flush=True)
    while not outlet.has_readers():
        clock.sleep_until(clock.now() + SECOND // 100)
    start, sent = clock.now(), 0
    print(json.dumps({"start": start / SECOND}), flush=True)
    tick = start
    while sent < len(values):
        tick += int(PUSH * SECOND)
        clock.sleep_until(tick)
        now = clock.now()
        due = min(len(values), int((now - start) / SECOND * RATE) + 1)
        if due > sent:
            outlet.push(values[sent:due], (now - start) / SECOND - (due - 1) / RATE)
            sent = due
    sys.stdin.read()


def receive(kind: str, seconds: float) -> dict[str, Any]:
    """Read one stream to its end; its figures."""
    os.environ["LSLAPICFG"] = str(LOOPBACK)
    words = [sys.executable, __file__, "--send", kind, "--minutes", str(seconds / 60.0)]
    sender = subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert sender.stdout is not None
    try:
        OnsetDetector(RATE).feed(np.zeros(10))  # compiled before anything comes
        source = open_source(json.loads(sender.stdout.readline())["source"])
        print(source.open(), file=sys.stderr)
        found = _read(source, seconds)
        start = json.loads(sender.stdout.readline())["start"]
    finally:
        sender.communicate("")
    counts, taken_at, given, done = found.pop("raw")
    # a frame of the Trigno server is complete when its last sample has been taken, a period after the sample's begin
    taken = start + (taken_at + (1.0 if kind == "trigno" else 0.0)) / RATE
    looked = taken > found.pop("begin")  # what came while the stream was opened had to wait
    late, off = 1e3 * (done - taken)[looked], 1e3 * (given - taken)[looked]
    return found | {
        "samples": len(counts),
        "lost": int(counts[-1] - counts[0] + 1 - len(counts)),
        "latency_ms": [float(np.quantile(late, q)) for q in (0.5, 0.99, 1.0)],
        "time_error_ms": [float(np.quantile(off, q)) for q in (0.01, 0.5, 0.99)],
    }


def _read(source: Any, seconds: float) -> dict[str, Any]:
    detectors = [OnsetDetector(RATE) for _ in range(2)]
    clock = MonotonicClock()
    counters, times, done, looks, onsets = [], [], [], [], 0
    lost, before = "", np.zeros(2)
    tick, begin, busy = clock.now(), clock.now(), time.process_time()
    last = round(seconds * RATE) - 1
    while clock.now() - begin < (seconds + 20.0) * SECOND:
        tick = max(tick + SECOND // 1000, clock.now() - SECOND // 1000)
        clock.sleep_until(tick)
        looked = clock.now()
        chunk = source.read(looked / SECOND)
        looks.append((clock.now() - looked) / 1e6)
        if not len(chunk.times):
            lost = lost or source.lost()
            continue
        for k, detector in enumerate(detectors):
            active = detector.feed(chunk.values[:, k]).active
            onsets += int(np.sum(np.diff(active, prepend=before[k]) > 0.5))
            before[k] = active[-1]
        counters.append(chunk.values[:, -1])
        times.append(chunk.times)
        done.append((len(chunk.times), clock.now() / SECOND))
        if round(chunk.values[-1, -1] / UNIT) >= last - 50:
            break
    wall = (clock.now() - begin) / SECOND
    busy = time.process_time() - busy
    source.close()
    counts = np.round(np.concatenate(counters) / UNIT)
    given = np.concatenate(times)
    finished = np.concatenate([np.full(count, at) for count, at in done])
    ordered = bool(np.all(np.diff(counts) == 1.0)) and bool(np.all(np.diff(given) > 0.0))
    return {
        "raw": (counts, counts, given, finished),
        "begin": begin / SECOND,
        "in_order": ordered,
        "onsets": onsets,
        "look_ms": [float(np.quantile(looks, q)) for q in (0.5, 0.99, 1.0)],
        "lost_said": lost,
        "processor_share": busy / wall,
        "seconds": wall,
    }


def figures(minutes: float, kinds: list[str]) -> tuple[list[Figure], str]:
    """Run each stream; the section's table and what is to be said about it."""
    rows = []
    for kind in kinds:
        found = receive(kind, 60.0 * minutes)
        print(json.dumps({kind: found}), file=sys.stderr)
        name = {"lsl": "LSL", "trigno": "Trigno"}[kind]
        p50, p99, most = found["latency_ms"]
        early, middle, late = found["time_error_ms"]
        rows += [
            Figure(
                f"{name}: samples of {CHANNELS} channels, lost",
                f"{found['samples']}, {found['lost']}",
                "0 lost",
                found["lost"] == 0,
            ),
            Figure(
                f"{name}: each once, in order, with increasing times",
                "yes" if found["in_order"] else "no",
                "yes",
                found["in_order"],
            ),
            Figure(f"{name}: sample to detector, p50, p99, max", f"{p50:.1f}, {p99:.1f}, {most:.0f} ms", "–"),
            Figure(
                f"{name}: time given, less when it was taken, p1, p50, p99",
                f"{early:.2f}, {middle:.2f}, {late:.2f} ms",
                "–",
            ),
            Figure(f"{name}: one look, p50, p99, max", "{:.3f}, {:.3f}, {:.1f} ms".format(*found["look_ms"]), "–"),
            Figure(
                f"{name}: the reader's share of a processor, two detectors included",
                f"{100.0 * found['processor_share']:.0f} %",
                "–",
            ),
        ]
    note = (
        f"- {minutes:g} minutes each at {RATE:g} Hz, from another process over 127.0.0.1. LSL's sender sends every "
        f"{1e3 * PUSH:g} ms; a Trigno server sends frames of 13.5 ms, so that a sample waits up to so long before it "
        "leaves. The reader looks every millisecond. Load of the machine at the end: "
        f"{os.getloadavg()[1]:.0f} on {os.cpu_count()} processors."
    )
    return rows, note


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("kinds", nargs="*", choices=[[], *KINDS], help="run only these")
    parser.add_argument("--minutes", type=float, default=5.0)
    parser.add_argument("--send", choices=KINDS, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.send:
        send(given.send, 60.0 * given.minutes)
        return 0
    rows, note = figures(given.minutes, given.kinds or list(KINDS))
    text = f"{table(rows)}\n\n{note}"
    print(text)
    if not given.kinds and given.minutes >= 5.0:
        results.write(TITLE, text)
    return 0 if all(row.held for row in rows) else 1


if __name__ == "__main__":
    sys.exit(main())
