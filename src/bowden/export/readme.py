"""What goes with exported code: the page, the Makefile, a run that is replayed, the example for an Arduino core."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bowden.core.nested import leaves, name_of
from bowden.export.files import rendered
from bowden.export.kinds import numbers
from bowden.export.unit import Module
from bowden.models.minimum_jerk import PEAK_SPEED
from bowden.models.suit.suit_angle import SpoolMap
from bowden.rig.counts import Counts
from bowden.rig.emg_run import course_of
from bowden.rig.rig import Rig

FLAGS = "-std=c99 -pedantic -Wall -Wextra -Werror -O2 -ffp-contract=off"
"""Every operation rounds as in Python only where products are not fused with sums, and nothing is reordered."""

ARM = "arm-none-eabi-gcc -mthumb -mfloat-abi=hard"


class Hardware(NamedTuple):
    """A kind of hardware."""

    single: bool
    """True if it has `float` alone; a Cortex-M7 is taken for one with `double`, as that of a Teensy 4."""
    compiler: str
    """With the options of its processor."""
    platform: str
    """Of PlatformIO; likewise `board`, one with this processor."""
    board: str


TARGETS = {
    "cortex-m4f": Hardware(True, f"{ARM} -mcpu=cortex-m4 -mfpu=fpv4-sp-d16", "ststm32", "nucleo_f446re"),
    "cortex-m33": Hardware(True, f"{ARM} -mcpu=cortex-m33 -mfpu=fpv5-sp-d16", "ststm32", "nucleo_l552ze_q"),
    "cortex-m7": Hardware(False, f"{ARM} -mcpu=cortex-m7 -mfpu=fpv5-d16", "teensy", "teensy41"),
    "esp32": Hardware(True, "xtensa-esp32-elf-gcc -mlongcalls", "espressif32", "esp32dev"),
}
TARGETS["host"] = TARGETS["cortex-m7"]
FILES = ("loop.h", "loop.c", "board.cpp", "arduino.cpp", "platformio.ini", "replay.c", "Makefile", "README.md")
"""Beside the modules and the recording."""
YOURS = ("board.cpp", "platformio.ini")
"""Files that the user fills in: an export leaves them as they are where they are there."""

_WATCHED = 600.0
"""For so long a reference is looked at, for its range and its largest speed [s]."""
COLUMNS = (
    *("joint_seen", "motor_seen", "reference", "reference_velocity", "reference_acceleration"),
    *("requested_target", "source"),
)
"""Columns of a recording, named as in the log of a live run: ``bowden log export run.mcap`` gives one."""


def pages(
    rig: Rig,
    modules: Sequence[Module],
    encoders: Counts | SpoolMap,
    preamble: str,
    rate: float,
    target: Hardware,
    *,
    single: bool,
) -> dict[str, str]:
    """Name → text of the loop, of the board's part of it, and of a C program that replays a recorded run of the law.

    Args:
        rig: with the reference, and the wearer's EMG.
        modules: the law's; then those of the supervisor and of EMG.
        encoders: the rig's, or the suit's spool.
        preamble: what the code was made from.
        rate: samples of EMG a second [Hz].
        target: on which it is to run.
        single: the law is in float, and its commands are not expected to be the recorded ones to the bit.
    """
    step, detector = modules[0].functions[1], modules[-1] if modules[-1].prefix not in ("safety", "joint") else None
    position, velocity, _ = rig.trajectory.sample(np.linspace(0.0, min(rig.duration, _WATCHED), 200_001)).T
    low, high, fastest = position.min(), position.max(), np.abs(velocity).max()
    course = course_of(rig.emg)
    width = math.degrees(rig.basis.width)
    words = {
        "title": modules[0].title,
        "preamble": preamble,
        "name": modules[0].prefix,
        "modules": modules,
        "sensor": rig.joint_sensor if rig.joint_sensor.estimated else None,
        "counts": encoders if isinstance(encoders, Counts) else None,
        "unit": "counts" if isinstance(encoders, Counts) else "spool",
        "flags": FLAGS,
        "target": target,
        "pulls": f"{2.0 * width:.0f}° or more, twice the cable's play," if width > 1.0 else "some degrees",
        "step": math.degrees(rig.supervisor_limits.target_speed * rig.sample_time),
        "period": rig.sample_time,
        "detector": detector and detector.prefix,
        "detector_state": detector and detector.functions[1].kinds["state"].name,
        "limits": rig.supervisor_limits,
        "emg_rate": rate,
        "muscles": course.intent.muscles,
        "proportional": course.proportional and rig.emg.levels is not None,
        "levels": rig.emg.levels,
        "low": course.intent.low if detector else float(f"{low:.7g}"),
        "high": f"{high:.7g}",
        "low_deg": math.degrees(course.intent.low if detector else low),
        "high_deg": math.degrees(high),
        "duration": f"{PEAK_SPEED * (high - low) / fastest:.6g}" if fastest > 0.0 else "2",
        "single": single,
        "ways": [way for way, _ in numbers(step.kinds["state"])],
        "header": ",".join(name_of(way) for way, _ in leaves(step.given["state"])),
    }
    return {file: rendered(file, **words) for file in FILES}
