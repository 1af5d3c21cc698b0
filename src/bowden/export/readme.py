"""What goes with exported code: the page, the Makefile, a run that is replayed, the example for an Arduino core."""

import math
from collections.abc import Sequence

from bowden.control.law import Law
from bowden.core.nested import leaves, name_of
from bowden.export.cortex import COMPILER
from bowden.export.cortex import FLAGS as CORTEX_FLAGS
from bowden.export.counts import Counts
from bowden.export.files import rendered
from bowden.export.kinds import reached
from bowden.export.law import state_of
from bowden.export.module import Module

FLAGS = "-std=c99 -pedantic -Wall -Wextra -Werror -O2 -ffp-contract=off"
"""Every operation rounds as in Python only where products are not fused with sums, and nothing is reordered."""

YOURS = ("board.cpp", "platformio.ini")
"""Files that the user fills in: an export leaves them as they are where they are there."""

TARGETS = {"host": False, "cortex-m4f": True, "cortex-m33": True, "cortex-m7": False, "esp32": True}
"""Target → whether its hardware has float alone; a Cortex-M7 is taken for one with double, as that of a Teensy 4."""


COLUMNS = (
    *("joint_seen", "motor_seen", "reference", "reference_velocity", "reference_acceleration"),
    *("requested_target", "source"),
)
"""Columns of a recording, named as in the log of a live run: ``bowden log export run.mcap`` gives one."""


def pages(
    modules: Sequence[Module], law: Law, counts: Counts | None, said: str, sample_time: float, *, single: bool
) -> dict[str, str]:
    """Name → text of how to build and call the code, and of a C program that replays a recorded run of the law.

    Args:
        modules: the law's; then those of the EMG detector and of the safety gate, if they were asked for.
        law: with its gains.
        counts: of the rig's encoders; None on a suit.
        said: what the code was made from.
        sample_time: of the rig [s].
        single: the law is in float, and its commands are not expected to be the recorded ones to the bit.
    """
    name, names = modules[0].prefix, [one.prefix for one in modules]
    turns = [] if counts is None else [f"{2.0 * math.pi / one:.6g}" for one in (counts.motor_count, counts.joint_count)]
    ways = [way for way, _ in leaves(state_of(law))]
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
        "exact": int(not single),
        "values": "".join(f",\n                (double)state{reached(way)}" for way in ways),
        "header": ",".join(map(name_of, ways)),
        "turns": " and ".join(turns),
        "joint": "read_joint_angle()" if counts is None else f"{name}_joint_angle(read_joint_counts())",
        "motor": "read_motor_angle()" if counts is None else f"{name}_motor_angle(read_motor_counts())",
    }
    return {file: rendered(file, **words) for file in ("replay.c", "arduino.cpp", *YOURS, "Makefile", "README.md")}
