"""The files of an export: C from kernels, and what goes with it, made from `templates`."""

import itertools
import math
import textwrap
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

import jinja2
import numpy as np

from bowden.core.nested import leaves, name_of
from bowden.core.signals import EMERGENCY_STOP
from bowden.export.function import called
from bowden.export.source import comments, description
from bowden.export.unit import LONGEST, Kind, Module, Unit, identifier, is_number, kind_of, numbers, within
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


def files(module: Module, preamble: str, *, single: bool = False) -> dict[str, str]:
    """Name → text of a module's header and source, in double or in float.

    Raises:
        ParameterError: a kernel leaves the subset; the message names the line.
    """
    unit, functions = Unit(module, single=single), []
    header = {unit.type(enum) for enum in module.enums}
    for one, (kernel, _) in module.functions.items():
        shown = [kind for name, kind in module.arguments(kernel).items() if name not in module.constants]
        header |= {unit.type(part) for kind in (*shown, *results_of(unit, one)[1]) for _, part in within(kind)}
        functions.append(_public(unit, one))
    types = [[text for name, text in unit.types.items() if (name in header) is public] for public in (True, False)]
    parts = {"h": types[0], "c": [*types[1], "\n\n".join(unit.constants.values())]}
    words = {"module": module, "preamble": preamble, "unit": unit, "functions": functions}
    texts = {f"{module.prefix}.{end}": rendered(f"module.{end}", **words, parts=some) for end, some in parts.items()}
    return {name: "\n".join(row for line in text.split("\n") for row in broken(line)) for name, text in texts.items()}


def rendered(file: str, /, **words: Any) -> str:
    """A file of `templates` with what is to be filled in."""
    text = (Path(__file__).parent / "templates" / file).read_text(encoding="utf-8")
    page = jinja2.Template(text, variable_start_string="[[", variable_end_string="]]", trim_blocks=True)
    return f"{page.render(**words).rstrip()}\n"


def results_of(unit: Unit, one: str) -> tuple[str, list[Kind], Kind]:
    """The name of the kernel of a public function, and the kinds of its results, apart and as a whole."""
    kernel, results = unit.module.functions[one]
    name, result = called(unit, kernel, tuple(unit.module.arguments(kernel).values()))
    return name, [kind for _, kind in result.fields] if " " in results else [result], result


def _public(unit: Unit, one: str) -> dict[str, str]:
    """Comment, head and body of a function that others call: the state, then what is read, then what is written."""
    (name, kinds, result), (kernel, results) = results_of(unit, one), unit.module.functions[one]
    read, given, several = list[str](), list[str](), len(kinds) > 1
    for argument, kind in unit.module.arguments(kernel).items():
        text, mark = identifier(argument), "" if is_number(kind) else "*"
        if argument in unit.module.constants:
            text = f"{mark and '&'}{unit.constant('', argument, *unit.module.constants[argument])}"
        elif argument != "state":
            read.append(f"const {unit.type(kind)} {mark}{text}")
        given.append(text)
    call, returned, last = f"{name}({', '.join(given)})", "void", list[str]()
    lines = [f"const {unit.type(result)} result = {call};", ""] if several else []
    first, written = list[str](), list[str]()
    for to, kind, part in zip(results.split(), kinds, getattr(result, "fields", "?"), strict=False):
        source = f"result.{part[0]}" if several else call
        if to == "return":
            returned, last = unit.type(kind), [f"return {source};"]
            continue
        (first if to == "state" else written).append(f"{unit.type(kind)} *{to}")
        if to == "state" and several:  # number by number, so that the compiler keeps them in registers
            ways = dict.fromkeys(way.partition(".at[")[0] for way, _ in numbers(kind))
            lines += [f"state->{way[1:]} = {source}{way};" for way in ways]
        else:
            lines.append(f"*{to} = {source};")
    signature = ", ".join([*first, *read, *written]) or "void"
    body = "\n".join(f"    {line}" if line else "" for line in (*lines, *last))
    said = "\n".join(comments(description(kernel)))
    return {"comment": said, "head": f"{returned} {unit.prefix}_{one}({signature})", "body": body}


def broken(line: str) -> list[str]:
    """A line of C as several, where it is too long: an item a line of the longest bracket that it ends with."""
    if len(line) <= LONGEST or line.lstrip().startswith(("/*", "*", "#")):
        return [line]
    pad = line[: len(line) - len(line.lstrip())]
    opened: list[list[int]] = []
    cuts: list[int] = []
    for k, c in enumerate(line):
        if c in "({[":
            opened.append([k])
        elif c == "," and opened:
            opened[-1].append(k)
        elif c in ")}]" and opened and len(found := [*opened.pop(), k]) > 2 and len(line) - k < 4:
            cuts = max(cuts, found, key=lambda one: one[-1] - one[0] if one else 0)
    if not cuts:
        deeper = f"{pad}    "
        return textwrap.wrap(line, LONGEST, subsequent_indent=deeper, break_long_words=False, break_on_hyphens=False)
    items = [f"{pad}    {line[a + 1 : b].strip()}," for a, b in itertools.pairwise(cuts)]
    items[-1] = items[-1].removesuffix(",")
    return [*broken(line[: cuts[0] + 1]), *(row for one in items for row in broken(one)), f"{pad}{line[cuts[-1] :]}"]


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
    memory, detector = kind_of(modules[0].state), modules[-1] if modules[-1].prefix not in ("safety", "joint") else None
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
        "detector_state": detector and kind_of(detector.state).name,
        "limits": rig.supervisor_limits,
        "emergency_stop": EMERGENCY_STOP,
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
        "ways": [way for way, _ in numbers(memory)],
        "header": ",".join(name_of(way) for way, _ in leaves(modules[0].state)),
    }
    return {file: rendered(file, **words) for file in FILES}
