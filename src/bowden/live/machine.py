"""What a machine can do for the live loop: kernel, clock, processors and buses from /proc and /sys; how late it wakes a
process.
"""

import json
import os
import platform
import re
import subprocess
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.core.clock import SECOND, MonotonicClock, next_deadline
from bowden.core.errors import BowdenError
from bowden.hardware.realtime import Grant, Settings, become_realtime
from bowden.live.figures import Lateness, Machine

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
        preemption=(kind := preemption[0] if preemption else "none"),
        real_time=kind == "PREEMPT_RT",
        clock_source=_text(root / "sys/devices/system/clocksource/clocksource0/current_clocksource") or "unknown",
        processors=tuple(sorted(os.sched_getaffinity(0))),
        isolated=_numbers(_text(root / "sys/devices/system/cpu/isolated")),
        can=can,
        can_known=bool(can) or re.search(r"^CAN", _text(root / "proc/net/protocols"), re.MULTILINE) is not None,
    )


def _text(path: Path) -> str:
    try:
        return path.read_text(encoding="utf-8").strip()
    except OSError:
        return ""


def _numbers(text: str) -> tuple[int, ...]:
    """What the kernel's list of numbers names.

    >>> _numbers("1,4-6")
    (1, 4, 5, 6)
    """
    ends = [part.split("-") for part in text.split(",") if part]
    return tuple(number for end in ends for number in range(int(end[0]), int(end[-1]) + 1))


EDGES_US = (5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1000.0, 2000.0, 5000.0)
"""Upper edges of the histogram [µs]; what lies above the last is counted apart."""


def figures(late: NDArray[np.float64]) -> Lateness:
    """The percentiles of `late` (n,) [s]."""
    p50, p99, p999, most = (float(1e6 * q) for q in np.quantile(late, (0.5, 0.99, 0.999, 1.0)))
    return Lateness(p50, p99, p999, most, len(late))


def histogram(late: NDArray[np.float64]) -> list[int]:
    """Cycles of `late` (n,) [s] up to each of `EDGES_US`, and above the last."""
    edges = np.array([-np.inf, *EDGES_US, np.inf])
    return [int(count) for count in np.histogram(1e6 * late, edges)[0]]


def bare_loop(seconds: float, period: float, settings: Settings) -> tuple[NDArray[np.float64], list[Grant]]:
    """Sleep from deadline to deadline and do nothing else, as the live loop is set up; for a process of its own.

    Args:
        seconds: how long [s].
        period: between two deadlines [s].
        settings: what to ask the system for; this process keeps it.

    Returns:
        How late each waking was [s], and what the system granted.
    """
    step, cycles = round(period * SECOND), max(1, round(seconds / period))
    late = np.zeros(cycles)
    clock = MonotonicClock()
    grants = become_realtime(settings)
    deadline = clock.now() + step
    for k in range(cycles):
        clock.sleep_until(deadline)
        late[k] = (clock.now() - deadline) * 1e-9
        deadline, _ = next_deadline(deadline, clock.now(), step)
    return late, grants


def bare_loop_apart(seconds: float, period: float, settings: Settings) -> tuple[NDArray[np.float64], list[Grant]]:
    """`bare_loop` in a process of its own, since what a process asks the system for it keeps.

    Raises:
        BowdenError: the process failed.
    """
    given = json.dumps([seconds, period, asdict(settings)])
    done = subprocess.run([sys.executable, "-P", "-m", __name__, given], capture_output=True, text=True, check=False)
    if done.returncode != 0:
        raise BowdenError(f"the bare loop failed: {done.stderr.strip()[-300:]}")
    late, grants = json.loads(done.stdout)
    return np.array(late), [Grant(**grant) for grant in grants]


def _main() -> None:
    seconds, period, settings = json.loads(sys.argv[1])
    late, grants = bare_loop(seconds, period, Settings(**settings))
    json.dump([late.tolist(), [asdict(grant) for grant in grants]], sys.stdout)


if __name__ == "__main__":
    _main()
