"""What a machine can do for the live loop: its kernel, clock, processors and buses, read from /proc and /sys."""

import os
import platform
import re
from pathlib import Path

from bowden.live.figures import Machine

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
