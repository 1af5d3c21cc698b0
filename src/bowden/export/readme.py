"""What goes with exported code: the page, the Makefile, a run that is replayed, the example for an Arduino core."""

from collections.abc import Sequence

import numpy as np

from bowden.control.law import Law
from bowden.core.nested import leaves, name_of
from bowden.export.files import rendered
from bowden.export.kinds import reached
from bowden.export.law import state_of
from bowden.export.module import Module
from bowden.models.minimum_jerk import PEAK_SPEED
from bowden.models.suit.suit_angle import SpoolMap
from bowden.rig.counts import Counts
from bowden.rig.emg_run import course_of
from bowden.rig.rig import Rig

FLAGS = "-std=c99 -pedantic -Wall -Wextra -Werror -O2 -ffp-contract=off"
"""Every operation rounds as in Python only where products are not fused with sums, and nothing is reordered."""

CHIP = (
    "arm-none-eabi-gcc -mcpu=cortex-m4 -mthumb -mfloat-abi=hard -mfpu=fpv4-sp-d16 -O2 -ffp-contract=off "
    "-std=c99 -pedantic -Wall -Wextra -Werror -ffunction-sections"
)
"""Compiler and options for a Cortex-M4F."""
FILES = ("loop.h", "loop.c", "board.cpp", "arduino.cpp", "platformio.ini", "replay.c", "Makefile", "README.md")
"""Beside the modules and the recording."""
YOURS = ("board.cpp", "platformio.ini")
"""Files that the user fills in: an export leaves them as they are where they are there."""

TARGETS = {"host": False, "cortex-m4f": True, "cortex-m33": True, "cortex-m7": False, "esp32": True}
"""Target → whether its hardware has float alone; a Cortex-M7 is taken for one with double, as that of a Teensy 4."""

_WATCHED = 600.0
"""For so long a reference is looked at, for its range and its largest speed [s]."""
COLUMNS = (
    *("joint_seen", "motor_seen", "reference", "reference_velocity", "reference_acceleration"),
    *("requested_target", "source"),
)
"""Columns of a recording, named as in the log of a live run: ``bowden log export run.mcap`` gives one."""


def pages(
    rig: Rig, law: Law, modules: Sequence[Module], encoders: Counts | SpoolMap, said: str, rate: float, *, single: bool
) -> dict[str, str]:
    """Name → text of the loop, of the board's part of it, and of a C program that replays a recorded run of the law.

    Args:
        rig: with the reference, and the wearer's EMG.
        law: with its gains.
        modules: the law's; then those of the supervisor and of EMG.
        encoders: the rig's, or the suit's spool.
        said: what the code was made from.
        rate: samples of EMG a second [Hz].
        single: the law is in float, and its commands are not expected to be the recorded ones to the bit.
    """
    name, names, period = modules[0].prefix, [one.prefix for one in modules], rig.sample_time
    ways, course, levels = [way for way, _ in leaves(state_of(law))], course_of(rig.emg), rig.emg.levels
    detector = names[-1] if "course" in names else ""
    suit, real = isinstance(encoders, SpoolMap), f"{name}_real"
    position, velocity, _ = rig.trajectory.sample(np.linspace(0.0, min(rig.duration, _WATCHED), 200_001)).T
    low, high, fastest = position.min(), position.max(), np.abs(velocity).max()
    words = {
        "title": modules[0].title,
        "said": said,
        "name": name,
        "modules": modules,
        "counts": None if suit else encoders,
        "flags": FLAGS,
        "chip": CHIP,
        "sources": " ".join(f"{one}.c" for one in (*names, "loop")),
        "headers": " ".join(f"{one}.h" for one in (*names, "loop")),
        "period": repr(period),
        "microseconds": f"{period * 1e6:.0f}",
        "detector": detector,
        "detector_state": f"{detector}_{modules[-1].functions[-1].kinds['state'].name}" if detector else "",
        "limits": rig.supervisor_limits,
        "emg_rate": repr(rate),
        "muscles": course.intent.muscles,
        "proportional": course.proportional and levels is not None,
        "levels": levels,
        "low": repr(course.intent.low if detector else float(f"{low:.7g}")),
        "high": f"{high:.7g}",
        "duration": f"{PEAK_SPEED * (high - low) / fastest:.6g}" if fastest > 0.0 else "2",
        "single": single,
        "exact": int(not single),
        "values": "".join(f",\n                (double)state{reached(way)}" for way in ways),
        "header": ",".join(map(name_of, ways)),
        "unit": "spool" if suit else "counts",
        "of_motor": f"{name}_motor_angle(({real})motor)",
        "of_joint": "joint" if suit else f"{name}_joint_angle(({real})joint)",
        "target": f"{name}_{'spool_angle' if suit else 'motor_counts'}(({real})cycle.verdict.target)",
    }
    return {file: rendered(file, **words) for file in FILES}
