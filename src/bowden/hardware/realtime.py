"""What the system is asked for so that the loop is woken in time, and what it grants."""

import ctypes
import gc
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bowden.core.documented import Documented
from bowden.core.errors import ParameterError

_MCL_CURRENT, _MCL_FUTURE = 1, 2
_M_TRIM_THRESHOLD, _M_MMAP_MAX = -1, -4
_CAP_SYS_NICE, _CAP_IPC_LOCK = 23, 14


@dataclass(frozen=True)
class Settings:
    """Requested privileges."""

    priority: int = 80
    """SCHED_FIFO's, 1 to 99; 0 to stay with the ordinary scheduler."""
    cpu: int | None = None
    """The processor to stay on; None for any."""
    lock_memory: bool = True
    """Keep all pages in memory."""
    reserve: int = 8 << 20
    """Memory touched beforehand, which the interpreter then has for itself [bytes]."""


@dataclass(frozen=True)
class Grant(Documented):
    """One thing asked for."""

    name: str
    granted: bool
    detail: str
    """Privilege in force, or the reason for which it was refused."""
    remedy: str = ""
    """What to change; empty where it was granted."""


def become_realtime(settings: Settings) -> list[Grant]:
    """Ask for everything; nothing here raises, since the loop runs without it too, only later.

    To be called last, when all is imported and compiled: what is garbage by then is collected, the rest is frozen, and
    from here on nothing is collected at all.
    """
    grants = []
    if settings.priority:
        grants.append(_asked("scheduler", _fifo, settings.priority, _REMEDY_PRIORITY))
        grants.append(_asked("sleep states", _stay_awake, 0, _REMEDY_AWAKE))
    if settings.cpu is not None:
        grants.append(_asked("processor", _pin, settings.cpu, "name one of this machine's in [live] cpu"))
    if settings.lock_memory:
        grants.append(_asked("memory", _lock, settings.reserve, _REMEDY_MEMORY))
    gc.collect()
    gc.freeze()
    gc.disable()
    return grants


_REMEDY_PRIORITY = "allow it: add `USER - rtprio 95` to /etc/security/limits.conf and log in again"
_REMEDY_AWAKE = "allow it: let this user write to /dev/cpu_dma_latency (a udev rule), or run as root"
_REMEDY_MEMORY = "allow it: add `USER - memlock unlimited` to /etc/security/limits.conf and log in again"


def _asked(name: str, ask: Callable[[int], str], value: int, remedy: str) -> Grant:
    try:
        return Grant(name, True, ask(value))
    except OSError as error:
        return Grant(name, False, f"refused: {(error.strerror or str(error)).lower()}", remedy)


def _fifo(priority: int) -> str:
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))
    return f"SCHED_FIFO, priority {priority}"


def _stay_awake(latency: int) -> str:
    """Ask the kernel's PM QoS for processors that wake at once; the request holds while the file is open."""
    os.write(os.open("/dev/cpu_dma_latency", os.O_WRONLY | os.O_CLOEXEC), latency.to_bytes(4, "little"))
    return f"processors wake within {latency} µs" if latency else "processors stay awake"


def _pin(cpu: int) -> str:
    os.sched_setaffinity(0, {cpu})
    return f"on processor {cpu}"


def _lock(reserve: int) -> str:
    """Lock what is there and what comes, and have the allocator keep what it has been given."""
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.mlockall(_MCL_CURRENT | _MCL_FUTURE) != 0:
        number = ctypes.get_errno()
        raise OSError(number, os.strerror(number))
    libc.mallopt(_M_TRIM_THRESHOLD, 2**31 - 1)
    libc.mallopt(_M_MMAP_MAX, 0)
    bytearray(reserve)  # touches its pages and frees them, which now stay with the allocator
    return "locked"


def check_processor(cpu: int | None, name: str) -> None:
    """Refuse a processor that this process may not run on; `name` is of what was given.

    Raises:
        ParameterError: so it is, or there is no real time here.
    """
    if not hasattr(os, "sched_getaffinity"):
        raise ParameterError(
            "this system has no real-time priorities",
            expected="Linux for live runs, their twins and the doctor; all else works here",
            do="use Linux, or WSL 2 to try them",
        )
    allowed = sorted(os.sched_getaffinity(0))
    if cpu is not None and cpu not in allowed:
        raise ParameterError(
            f"{name} is {cpu}", expected=f"one of {', '.join(map(str, allowed))}", do="correct it, or leave it out"
        )


def privileges() -> list[Grant]:
    """What this process may ask for, without asking."""
    import resource  # which Windows has not, where recordings of runs are read too

    soft, hard = resource.getrlimit(resource.RLIMIT_RTPRIO)
    locked, _ = resource.getrlimit(resource.RLIMIT_MEMLOCK)
    nice, lock = (_capable(number) for number in (_CAP_SYS_NICE, _CAP_IPC_LOCK))
    priority = (
        "any, by CAP_SYS_NICE" if nice else f"up to {soft} of 99" + (f" ({hard} if asked for)" if hard > soft else "")
    )
    room = "any amount" if lock or locked == resource.RLIM_INFINITY else f"{locked >> 10} KiB"
    enough = lock or locked == resource.RLIM_INFINITY or locked >= 1 << 30
    return [
        Grant("real-time priority", nice or soft >= 50, priority, "" if nice or soft >= 50 else _REMEDY_PRIORITY),
        Grant("locked memory", enough, room, "" if enough else _REMEDY_MEMORY),
    ]


def _capable(number: int) -> bool:
    lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
    effective = next((int(line.split()[1], 16) for line in lines if line.startswith("CapEff:")), 0)
    return bool(effective >> number & 1)
