"""What goes with exported code: the page, the Makefile, and the example for an Arduino core."""

import math
from collections.abc import Sequence

from bowden.export.cortex import COMPILER
from bowden.export.cortex import FLAGS as CORTEX_FLAGS
from bowden.export.counts import Counts
from bowden.export.unit import Module, rendered

FLAGS = "-std=c99 -pedantic -Wall -Wextra -Werror -O2 -ffp-contract=off"
"""Every operation rounds as in Python only where products are not fused with sums, and nothing is reordered."""

YOURS = ("board.cpp", "platformio.ini")
"""Files that the user fills in: an export leaves them as they are where they are there."""

TARGETS = {"host": False, "cortex-m4f": True, "cortex-m33": True, "cortex-m7": False, "esp32": True}
"""Target → whether its hardware has float alone; a Cortex-M7 is taken for one with double, as that of a Teensy 4."""


def pages(
    modules: Sequence[Module], counts: Counts | None, said: str, sample_time: float, *, single: bool
) -> dict[str, str]:
    """Name → text of how to build and call the code.

    Args:
        modules: the law's; then those of the EMG detector and of the safety gate, if they were asked for.
        counts: of the rig's encoders; None on a suit.
        said: what the code was made from.
        sample_time: of the rig [s].
        single: the law is in float.
    """
    name, names = modules[0].prefix, [one.prefix for one in modules]
    turns = [] if counts is None else [f"{2.0 * math.pi / one:.6g}" for one in (counts.motor_count, counts.joint_count)]
    words = {
        "title": modules[0].title,
        "said": said,
        "name": name,
        "modules": modules,
        "counts": counts,
        "flags": FLAGS,
        "chip": " ".join([COMPILER, *CORTEX_FLAGS]),
        "sources": " ".join(f"{one}.c" for one in names),
        "headers": " ".join(f"{one}.h" for one in names),
        "period": repr(sample_time),
        "ms": f"{sample_time * 1e3:g}",
        "microseconds": f"{sample_time * 1e6:.0f}",
        "emg": "onset" in names,
        "gate": "safety" in names,
        "single": single,
        "turns": " and ".join(turns),
        "joint": "read_joint_angle()" if counts is None else f"{name}_joint_angle(read_joint_counts())",
        "motor": "read_motor_angle()" if counts is None else f"{name}_motor_angle(read_motor_counts())",
    }
    return {file: rendered(file, **words) for file in ("arduino.cpp", *YOURS, "Makefile", "README.md")}
