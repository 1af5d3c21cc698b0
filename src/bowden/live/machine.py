"""What a machine can do for the live loop: its kernel, clock, processors and buses, read from /proc and /sys."""

import os
import platform
import re
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bowden.live.figures import Lateness
from bowden.live.lateness import figures


@dataclass(frozen=True)
class Machine:
    """What there is."""

    release: str
    """The kernel's."""
    preemption: str
    """``PREEMPT_RT``, ``PREEMPT_DYNAMIC``, … or ``none``, as the kernel's version says."""
    clock_source: str
    """The clock of the kernel; ``tsc`` is the quick one on a PC."""
    processors: list[int]
    """That this process may run on."""
    isolated: list[int]
    """Processors that the kernel keeps free of other work."""
    can: dict[str, str]
    """CAN interface → its state."""
    can_known: bool
    """Whether the kernel has CAN sockets at all."""

    @property
    def real_time(self) -> bool:
        """Whether the kernel is a PREEMPT_RT one."""
        return self.preemption == "PREEMPT_RT"


ARPHRD_CAN = 280
"""The kernel's number for CAN among the types of network interfaces (linux/if_arp.h)."""


def look(root: Path = Path("/")) -> Machine:
    """Read all of it; `root` stands in for / in the tests."""
    version = platform.version() if root == Path("/") else _text(root / "proc/sys/kernel/version")
    preemption = re.search(r"PREEMPT\w*", version)
    interfaces = sorted((root / "sys/class/net").glob("*"))
    can = {each.name: _text(each / "operstate") for each in interfaces if _text(each / "type") == str(ARPHRD_CAN)}
    return Machine(
        release=platform.release() if root == Path("/") else _text(root / "proc/sys/kernel/osrelease"),
        preemption=preemption[0] if preemption else "none",
        clock_source=_text(root / "sys/devices/system/clocksource/clocksource0/current_clocksource") or "unknown",
        processors=sorted(os.sched_getaffinity(0)),
        isolated=_numbers(_text(root / "sys/devices/system/cpu/isolated")),
        can=can,
        can_known=bool(can) or re.search(r"^CAN", _text(root / "proc/net/protocols"), re.MULTILINE) is not None,
    )


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8").strip()
    except OSError:
        return ""


def _numbers(text: str) -> list[int]:
    """What the kernel's list of numbers names.

    >>> _numbers("1,4-6")
    [1, 4, 5, 6]
    """
    ends = [part.split("-") for part in text.split(",") if part]
    return [number for end in ends for number in range(int(end[0]), int(end[-1]) + 1)]


def cyclictest(seconds: float, period: float, priority: int, cpu: int | None) -> Lateness | None:
    """The lateness that cyclictest of rt-tests measures with the same settings; None where it is not installed.

    Args:
        seconds: how long [s].
        period: between two deadlines [s].
        priority: SCHED_FIFO's.
        cpu: the processor to stay on; None for any.
    """
    program = shutil.which("cyclictest")
    if program is None or priority < 1:
        return None
    loops = max(1, round(seconds / period))
    words = [program, "-q", "-m", "-p", str(priority), "-i", str(round(1e6 * period)), "-l", str(loops), "-h", "20000"]
    words += ["-a", str(cpu)] if cpu is not None else []
    done = subprocess.run(words, capture_output=True, text=True, check=False, timeout=2.0 * seconds + 30.0)
    return read_cyclictest(done.stdout)


def read_cyclictest(text: str) -> Lateness | None:
    """The percentiles in what ``cyclictest -q -h N`` prints; None where it printed no histogram.

    >>> read_cyclictest("# Histogram\\n000010 000003\\n000020 000001\\n# Max Latencies: 00031\\n").max_us
    31.0
    """
    counts = [(int(at), int(n)) for at, n in re.findall(r"^(\d+)\s+(\d+)\s*$", text, re.MULTILINE)]
    late = np.repeat([1e-6 * at for at, _ in counts], [n for _, n in counts]) if counts else np.zeros(0)
    if not len(late):
        return None
    worst = re.search(r"# Max Latencies:\s*(\d+)", text)
    if worst and int(worst[1]) > 1e6 * late[-1] + 0.5:  # beyond the histogram
        late = np.append(late, 1e-6 * int(worst[1]))
    return figures(late)
