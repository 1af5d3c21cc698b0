"""``bowden doctor``: whether this machine is fast enough for live runs, and what to change."""

import shutil
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import print_json, seconds
from bowden.core.errors import ParameterError, StreamError, counted

if TYPE_CHECKING:
    from bowden.live.lateness import Lateness
    from bowden.live.machine import Machine

_PERIOD = 1e-3
_EMG_WAIT = 1.0
"""How long streams of EMG are looked for [s]."""


def doctor(
    time: Annotated[float, typer.Option("--seconds", help="How long lateness is measured.")] = 5.0,
    priority: Annotated[int, typer.Option(help="SCHED_FIFO's, as in [live]; 0 for the ordinary scheduler.")] = 80,
    cpu: Annotated[int | None, typer.Option(help="Processor to measure on; any by default.")] = None,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Measure how late this machine wakes a loop at 1 kHz, and say what it may do, what is missing, what to change."""
    from bowden.hardware.emg.lsl_info import which
    from bowden.hardware.realtime import Settings, check_processor, privileges
    from bowden.live import machine
    from bowden.live.lateness import EDGES_US, bare_loop_apart, figures, histogram

    if not 0.1 <= time <= 3600.0:
        raise ParameterError(f"--seconds is {time:g}", expected="a number from 0.1 to 3600")
    if not 0 <= priority <= 99:
        raise ParameterError(f"--priority is {priority}", expected="a number from 0 to 99")
    check_processor(cpu, "--cpu")
    late, grants = bare_loop_apart(time, _PERIOD, Settings(priority=priority, cpu=cpu))
    measured, other = figures(late), machine.cyclictest(time, _PERIOD, priority, cpu)
    here = machine.look()
    document: dict[str, Any] = {
        "kernel": {"release": here.release, "preemption": here.preemption, "real_time": here.real_time},
        "clock_source": here.clock_source,
        "processors": here.processors,
        "isolated_processors": here.isolated,
        "privileges": [asdict(grant) for grant in privileges()],
        "granted": [asdict(grant) for grant in grants],
        "period_ms": 1e3 * _PERIOD,
        "lateness": asdict(measured),
        "histogram": [
            {"up_to_us": edge, "cycles": count} for edge, count in zip((*EDGES_US, None), histogram(late), strict=True)
        ],
        "cyclictest": asdict(other) if other else None,
        "can": {"kernel": here.can_known, "interfaces": here.can},
        "emg": _emg(),
    }
    advice = _advice(here, measured, [*privileges(), *grants])
    sources: dict[str, list[str]] = {}
    for one in document["emg"]["streams"]:
        sources.setdefault(one["name"], []).append(one["source_id"])
    for name, ids in sorted(sources.items()):
        if len(ids) > 1:
            advice.append(f"{len(ids)} LSL streams are named {name!r}: {which(name, ids)}")
    if json:
        print_json(document | {"advice": advice, "seconds": seconds()})
    else:
        _print(document, advice)


def _emg() -> dict[str, Any]:
    """Streams of EMG on the network by the Lab Streaming Layer."""
    from bowden.hardware.emg.lsl_info import check_info
    from bowden.hardware.emg.lsl_library import library

    try:
        found = library().resolve_byprop("type", "EMG", 0, _EMG_WAIT)
    except StreamError as error:
        return {"installed": False, "streams": [], "problem": str(error)}
    streams = []
    for info in sorted(found, key=lambda one: (one.name(), one.source_id())):
        problem = ""
        try:
            check_info(info, info.name())
        except StreamError as error:
            problem = str(error)
        streams.append(
            {
                "name": info.name(),
                "source_id": info.source_id(),
                "host": info.hostname(),
                "channels": info.channel_count(),
                "rate_hz": info.nominal_srate(),
                "problem": problem,
            }
        )
    return {"installed": True, "streams": streams, "problem": ""}


def _advice(here: "Machine", measured: "Lateness", grants: list[Any]) -> list[str]:
    """What to change, the most important first."""
    advice = list(dict.fromkeys(grant.remedy for grant in grants if not grant.granted))
    period = 1e6 * _PERIOD
    if measured.p999_us > 0.5 * period:
        advice.append("one cycle in a thousand begins half a period late: close other programs, or run more slowly")
    if measured.max_us > period and not here.real_time:
        advice.append(
            "single cycles were skipped: a PREEMPT_RT kernel on a real computer, not a virtual machine, skips fewer"
        )
    if here.clock_source not in ("tsc", "arch_sys_counter"):
        advice.append(f"the kernel's clock is {here.clock_source}, which is slow: see whether it can use tsc")
    if len(here.processors) > 1 and not here.isolated:
        advice.append("keep a processor for the loop: isolcpus=N on the kernel's command line, [live] cpu = N")
    if not here.can:
        advice.append("no CAN interface: plug one in and set it up, or use bowden twin")
    if shutil.which("cyclictest") is None:
        advice.append("to compare with cyclictest, install rt-tests")
    return advice


def _print(document: dict[str, Any], advice: list[str]) -> None:
    kernel, late = document["kernel"], document["lateness"]
    print(f"kernel      {kernel['release']}, {kernel['preemption']}")
    print(f"clock       {document['clock_source']}; processors {', '.join(map(str, document['processors']))}")
    for grant in (*document["privileges"], *document["granted"]):
        print(f"{'may' if grant['granted'] else 'MAY NOT':11} {grant['name']}: {grant['said']}")
    print(f"\nlateness of {late['cycles']} wakings, one in {document['period_ms']:g} ms")
    rows = [("bare loop", late)] + ([("cyclictest", document["cyclictest"])] if document["cyclictest"] else [])
    for name, row in rows:
        print(
            f"  {name:10}  p50 {row['p50_us']:.0f}  p99 {row['p99_us']:.0f}  p99.9 {row['p999_us']:.0f}"
            f"  max {row['max_us']:.0f} µs"
        )
    if not document["cyclictest"]:
        print("  cyclictest  not installed, or no real-time priority")
    most = max(bucket["cycles"] for bucket in document["histogram"])
    for bucket in document["histogram"]:
        if bucket["cycles"]:
            edge = "above" if bucket["up_to_us"] is None else f"≤ {bucket['up_to_us']:g}"
            print(f"  {edge:>7} µs {bucket['cycles']:8d} {'█' * max(1, round(40 * bucket['cycles'] / most))}")
    can, emg = document["can"], document["emg"]
    print(f"\nCAN         {', '.join(f'{name} ({state})' for name, state in can['interfaces'].items()) or 'none'}")
    count = len(emg["streams"])
    print(f"EMG         {emg['problem'] or ('no stream' if not count else f'{count} of LSL')}")
    for one in emg["streams"]:
        said = one["problem"] or f"{counted(one['channels'], 'channel')}, {one['rate_hz']:g} Hz"
        print(f"            lsl:{one['name']}#{one['source_id']} of {one['host']}: {said}")
    print("\nWhat to change:" if advice else "\nNothing to change.")
    for line in advice:
        print(f"- {line}")


COMMANDS = (
    Command(
        "doctor",
        doctor,
        "Say whether this machine keeps time at 1 kHz, and what to change.",
        (
            "bowden doctor",
            "bowden doctor --seconds 60 --cpu 1 --json",
        ),
        place=70,
    ),
)
