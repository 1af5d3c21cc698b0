"""`doctor`: whether this machine is fast enough for live runs, and what to change."""

from dataclasses import dataclass
from typing import Annotated, Any

from bowden.core.documented import Documented
from bowden.hardware.realtime import Grant
from bowden.live.figures import Lateness, Machine
from bowden.operations.support.operation import Operation, Switch
from bowden.operations.support.results import Result

_PERIOD = 1e-3
_EMG_WAIT = 1.0
"""How long streams of EMG are looked for [s]."""


@dataclass(frozen=True)
class LatenessBucket(Documented):
    """A bar of the histogram of lateness."""

    up_to_us: float | None
    """Upper edge; null for what lies above the last."""
    cycles: int


@dataclass(frozen=True)
class EmgStreamFound(Documented):
    """A stream of EMG."""

    name: str
    source_id: str
    host: str
    channels: int
    rate_hz: float
    """0 where it is irregular."""
    problem: str
    """Why it cannot be used; empty where it can."""


@dataclass(frozen=True)
class EmgFound(Documented):
    """Streams of EMG on the network."""

    installed: bool
    streams: tuple[EmgStreamFound, ...]
    problem: str
    """Why no streams can be seen; empty where they can."""


@dataclass(frozen=True)
class Diagnosis(Result["Diagnosis"]):
    """What this machine can do."""

    machine: Machine
    """Kernel, clock, processors and CAN, read from /proc and /sys."""
    privileges: tuple[Grant, ...]
    granted: tuple[Grant, ...]
    period_ms: float
    lateness: Lateness
    histogram: tuple[LatenessBucket, ...]
    emg: EmgFound
    advice: tuple[str, ...]


def doctor(
    *,
    time: Annotated[float, Switch(name="--seconds")] = 5.0,
    priority: int = 80,
    cpu: int | None = None,
) -> Diagnosis:
    """Measure whether this computer keeps time at 1 kHz, and name what to change.

    It measures how late a loop is woken, and looks up permissions and missing parts.

    Args:
        time: how long lateness is measured [s].
        priority: priority under SCHED_FIFO, as in [live]; 0 for the ordinary scheduler.
        cpu: processor to measure on; any by default.

    Raises:
        ParameterError: a number that cannot be.

    Examples:
        bowden doctor
        bowden doctor --seconds 60 --cpu 1 --json
    """
    from bowden.core.caller import argument
    from bowden.hardware.emg.lsl_info import which
    from bowden.hardware.realtime import Settings, check_processor, privileges
    from bowden.live import machine
    from bowden.live.machine import EDGES_US, bare_loop_apart, figures, histogram
    from bowden.operations.support.given import check_number

    check_number("time", time, 0.1, 3600.0)
    check_number("priority", priority, 0, 99)
    check_processor(cpu, argument("cpu").rstrip("="))
    late, grants = bare_loop_apart(time, _PERIOD, Settings(priority=priority, cpu=cpu))
    measured = figures(late)
    here, may, emg = machine.look(), privileges(), _emg()
    advice = _advice(here, measured, [*may, *grants])
    sources: dict[str, list[str]] = {}
    for one in emg.streams:
        sources.setdefault(one.name, []).append(one.source_id)
    for name, ids in sorted(sources.items()):
        if len(ids) > 1:
            advice.append(f"{len(ids)} LSL streams are named {name!r}: {which(name, ids)}")
    counts = zip((*EDGES_US, None), histogram(late), strict=True)
    return Diagnosis(
        machine=here,
        privileges=tuple(may),
        granted=tuple(grants),
        period_ms=1e3 * _PERIOD,
        lateness=measured,
        histogram=tuple(LatenessBucket(edge, count) for edge, count in counts),
        emg=emg,
        advice=tuple(advice),
    )


def _emg() -> EmgFound:
    """Streams of EMG on the network by the Lab Streaming Layer."""
    from bowden.core.errors import StreamError
    from bowden.hardware.emg.lsl_info import check_info, library

    try:
        found = library().resolve_byprop("type", "EMG", 0, _EMG_WAIT)
    except StreamError as error:
        return EmgFound(False, (), str(error))
    streams = []
    for info in sorted(found, key=lambda one: (one.name(), one.source_id())):
        problem = ""
        try:
            check_info(info, info.name())
        except StreamError as error:
            problem = str(error)
        streams.append(
            EmgStreamFound(
                info.name(), info.source_id(), info.hostname(), info.channel_count(), info.nominal_srate(), problem
            )
        )
    return EmgFound(True, tuple(streams), "")


def _advice(here: Machine, measured: Lateness, grants: list[Any]) -> list[str]:
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
    return advice


OPERATIONS = (Operation("doctor", doctor, 70),)
