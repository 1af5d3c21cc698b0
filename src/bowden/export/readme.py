"""What goes with exported code: the page, the Makefile, and the example for an Arduino core."""

import math
import re
from collections.abc import Sequence

import jinja2

from bowden.export.cortex import COMPILER
from bowden.export.cortex import FLAGS as CORTEX_FLAGS
from bowden.export.counts import Counts
from bowden.export.unit import Module, template

FLAGS = "-std=c99 -pedantic -Wall -Wextra -Werror -O2 -ffp-contract=off"
"""Every operation rounds as in Python only where products are not fused with sums, and nothing is reordered."""

TARGETS = {"host": False, "cortex-m4f": True, "cortex-m33": True, "cortex-m7": False, "esp32": True}
"""Target → whether its hardware has float alone; a Cortex-M7 is taken for one with double, as that of a Teensy 4."""


def makefile(prefixes: Sequence[str]) -> str:
    """Builds the test bench and runs it.

    Args:
        prefixes: of all modules: what the replay does not call is built as well.
    """
    sources = " ".join(f"{prefix}.c" for prefix in prefixes)
    headers = " ".join(f"{prefix}.h" for prefix in prefixes)
    return (
        "# make check: does all code compile, and does the law give the recorded commands?\n\n"
        f"CFLAGS = {FLAGS}\n"
        f"SOURCES = {sources}\n\n"
        f"check: replay\n\t./replay recording.csv\n\n"
        f"replay: replay.c $(SOURCES) {headers}\n\t$(CC) $(CFLAGS) -o $@ replay.c $(SOURCES) -lm\n\n"
        ".PHONY: check\n"
    )


def arduino(name: str, counts: Counts | None, sample_time: float) -> dict[str, str]:
    """The example for boards with an Arduino core, and its project of PlatformIO."""
    texts = {
        "JOINT": f"{name}_joint_angle(read_joint_counts())",
        "MOTOR": f"{name}_motor_angle(read_motor_counts())",
        "COMMAND": f"{name}_motor_counts(command)",
    }
    if counts is None:
        texts = {
            "JOINT": "read_joint_counts() * 1e-3 /* yours: counts to the joint's angle [rad] */",
            "MOTOR": "read_motor_counts() * 1e-3 /* yours: counts to the motor's, through the spool [rad] */",
            "COMMAND": "command * 1e3 /* yours: back to counts */",
        }
    text = template("arduino.cpp")
    for key, value in (*texts.items(), ("MICROSECONDS", f"{sample_time * 1e6:.0f}"), ("NAME", name)):
        text = text.replace(f"@{key}@", value)
    project = (
        "; pio run; name your board: see https://docs.platformio.org\n[platformio]\nsrc_dir = .\n\n"
        "[env:board]\nplatform = teensy\nboard = teensy41\nframework = arduino\n"
        "build_flags = -ffp-contract=off\nbuild_src_filter = +<*> -<replay.c>\n"
    )
    return {"arduino.cpp": text, "platformio.ini": project}


def readme(
    law: Module, parts: Sequence[Module], counts: Counts | None, said: str, sample_time: float, *, single: bool
) -> str:
    """How to build and call the code.

    Args:
        law: the law's module.
        parts: the EMG detector and the safety gate, if they were asked for.
        counts: of the rig's encoders; None on a suit.
        said: what the code was made from.
        sample_time: of the rig [s].
        single: the law is in float.
    """
    modules, names = (law, *parts), {part.prefix for part in parts}
    formulas = [] if counts is None else [f"    {signal:15} = {formula}" for signal, formula in counts.formulas()]
    turns = [] if counts is None else [f"{2.0 * math.pi / one:.6g}" for one in (counts.motor_count, counts.joint_count)]
    page = jinja2.Template(
        template("readme.md"), variable_start_string="[[", variable_end_string="]]", trim_blocks=True
    )
    text = page.render(
        title=law.title,
        said=said,
        name=law.prefix,
        rows="\n".join(f"| `{one.prefix}.h`, `{one.prefix}.c` | {one.title} |" for one in modules),
        flags=FLAGS,
        chip=" ".join([COMPILER, *CORTEX_FLAGS]),
        sources=" ".join(f"{one.prefix}.c" for one in modules),
        period=repr(sample_time),
        ms=f"{sample_time * 1e3:g}",
        emg="onset" in names,
        gate="safety" in names,
        single=single,
        notes="" if counts is None else counts.notes(),
        formulas="\n".join(formulas),
        turns=" and ".join(turns),
    )
    if counts is None:
        text = text.replace(f"{law.prefix}_joint_angle(read_joint_counts())", "read_joint_angle()")
        text = text.replace(f"{law.prefix}_motor_angle(read_motor_counts())", "read_motor_angle()")
        text = re.sub(rf"write_motor_counts\({law.prefix}_motor_counts\((.*)\)\);", r"write_motor_target(\1);", text)
        text = re.sub(rf"{law.prefix}_motor_counts\((.*?verdict\.target)\)", r"\1", text)
    return f"{text.rstrip()}\n"
