"""What goes with exported code: the page, the Makefile, and the example for an Arduino core."""

import math
from collections.abc import Sequence

from bowden.export.cortex import COMPILER, FLAGS as CORTEX_FLAGS
from bowden.export.unit import Module, template
from bowden.rig.counts import Counts

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
    text = template("arduino.cpp").replace("@AMPLITUDE@", "0.2f")
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
    names = {part.prefix for part in parts}
    emg, gate = "onset" in names, "safety" in names
    sources = " ".join(f"{part.prefix}.c" for part in (law, *parts))
    rows = [f"| `{part.prefix}.h`, `{part.prefix}.c` | {part.title} |" for part in (law, *parts)]
    precision = _FLOAT if single else _DOUBLE
    if gate and single:
        precision += " The safety gate stays in `double`: its set of faults has more bits than a `float`."
    page = f"""# {law.title}

{said}

| file | what it is |
|---|---|
{chr(10).join(rows)}
| `arduino.cpp`, `platformio.ini` | the loop for a board with an Arduino core |
| `replay.c`, `recording.csv`, `Makefile` | the test bench: `make check` replays a recorded run and compares |

Each function of Python is a function of C with the same name, the same locals and the same comments; above it stands the
module that it comes from. So are the structs, whose names begin with those of their file. Nothing but `<math.h>` and
`<stdbool.h>` is needed, and no heap. On this computer, and for a Cortex-M4F, compile with

    cc {FLAGS} -c {sources}
    {COMPILER} {" ".join(CORTEX_FLAGS)} -c {sources}

and link with `-lm`. For another chip change the `-m…` options, and keep `-ffp-contract=off`; never use `-ffast-math`.
{precision}

Do not edit the constants: change the rig and export again. Angles are in radians, times in seconds.

{_angles(counts)}
## The loop

Every {sample_time * 1e3:g} ms, from a timer's interrupt: the cycle's length is a constant like the gains. `read_…` and
`write_…` are yours.

```c
#include "@NAME@.h"
{_includes(emg, gate)}
static @NAME@_LawState law;
static int running = 0;
static @NAME@_real time = 0;
{_states(emg, gate)}
{_LOOP_WITH_GATE if gate else _LOOP}```

Here the reference is a motion of minimum jerk by 0.2 rad in 2 s. `@NAME@_minimum_jerk_from` begins at any reference. A
reference of your own may have a velocity and acceleration that are zero, noisy or not a number, and its position may jump
or be held: what the law is shown is made of it within `@NAME@_step`, as in Python.
{_EMG if emg else ""}{_GATE if gate else ""}
A sample that is not a number does no harm to most laws, but some remember it: hand on the last good one, as `bowden run`
does. The interrupt must be able to use the FPU (`CPACR` is set before the first cycle).
"""
    if counts is None:
        for call, converted in (
            ("@NAME@_joint_angle(read_joint_counts())", "read_joint_angle()"),
            ("@NAME@_motor_angle(read_motor_counts())", "read_motor_angle()"),
            ("write_motor_counts(@NAME@_motor_counts(command))", "write_motor_target(command)"),
            ("write_drive(@NAME@_motor_counts(verdict.target),", "write_drive(verdict.target,"),
        ):
            page = page.replace(call, converted)
    return page.replace("@NAME@", law.prefix).replace("@PERIOD@", f"{sample_time!r}")


_FLOAT = """The law is in `float`, as is the hardware of the target. Its commands are not those of Python to the bit; `make check`
says how far they are from them."""
_DOUBLE = """In `double` the code does the operations of Python in their order, and gives the same bits where the library's `exp`,
`sin`, `pow`, … are the same."""


def _angles(counts: Counts | None) -> str:
    """In which angles the law works."""
    if counts is None:
        return """## Angles

On a suit the law has the motor's angle in the joint's coordinate, through the spool (docs/suit.md), and zero where the
cable is just taut. The conversion from counts is yours.
"""
    rows = "\n".join(f"    {signal:15} = {formula}" for signal, formula in counts.formulas())
    turns = " and ".join(f"{2.0 * math.pi / count:.6g}" for count in (counts.motor_count, counts.joint_count))
    return f"""## Angles

{counts.notes()}
From the counts of encoders that have the direction and the zero of the rig's log, as `@NAME@_motor_angle`,
`@NAME@_joint_angle` and `@NAME@_motor_counts` have it:

{rows}

One count is the resolution of `motor_encoder` and `joint_encoder` in the rig: {turns} counts a turn. Where yours have
others, or count otherwise, correct the rig and export again. Before you close the loop, move the joint by hand: both
angles must rise together, from zero where the cable is just taut. With a wrong sign the law drives the joint away.
"""


_BEGIN = """void timer_interrupt(void)
{
    const @NAME@_Sample sample = {@NAME@_joint_angle(read_joint_counts()), @NAME@_motor_angle(read_motor_counts())};
    const @NAME@_Reference reference = @NAME@_minimum_jerk(0, (@NAME@_real)0.2, 2, time);
"""

_LOOP = f"""{_BEGIN}    @NAME@_real command;

    if (!running) {{
        @NAME@_start(&law, &sample);
        running = 1;
    }}
    command = @NAME@_step(&law, &sample, &reference);
    time += (@NAME@_real)@PERIOD@;
    write_motor_counts(@NAME@_motor_counts(command));
}}
"""

_LOOP_WITH_GATE = f"""{_BEGIN}    const safety_Observed observed = observe(); /* reading, ages, lateness, the operator's request */
    const int moves = gate.decided.mode == SAFETY_MODE_RUNNING || gate.decided.mode == SAFETY_MODE_BRIDGING;
    safety_Verdict verdict;
    double command = gate.target; /* until the law may move the motor, it stays where the gate has it */

    if (moves) {{
        if (!running) {{
            @NAME@_start(&law, &sample);
        }}
        command = @NAME@_step(&law, &sample, &reference);
        time += (@NAME@_real)@PERIOD@;
    }}
    running = moves;
    safety_supervise(&gate, &observed, command, @PERIOD@, &verdict);
    write_drive(@NAME@_motor_counts((@NAME@_real)verdict.target), verdict.power == SAFETY_POWER_ON);
}}
"""


def _includes(emg: bool, gate: bool) -> str:
    return ('#include "onset.h"\n' if emg else "") + ('#include "safety.h"\n' if gate else "")


def _states(emg: bool, gate: bool) -> str:
    return ("static onset_OnsetState muscle;\n" if emg else "") + (
        "static safety_SupervisorState gate;\n" if gate else ""
    )


_EMG = """
The detector runs at the rate of the EMG, not of the loop: `onset_start(&muscle, first)` once, then for each sample
`active = onset_step(&muscle, value, &trouble)`. `envelope_step` gives the envelope.
"""

_GATE = """
The gate needs `safety_begin(&gate, &reading, &warmth)` once, with the warmth of the last run or that of
`safety_cold(&warmth)`. It starts stopped; what it observes, its modes and its faults are those of docs/safety.md, and
their numbers are in `safety.h`. `verdict.faults` is a sum of 2^fault: with `<stdint.h>`,
`(uint64_t)verdict.faults >> SAFETY_FAULT_LATE & 1` is 1 if the loop was too late.

The operator's requests go into `observed.request`, each for one cycle: `SAFETY_REQUEST_ARM`, `_RUN`, `_STOP` or
`_ACKNOWLEDGE`; else `SAFETY_REQUEST_NONE`. `observed.reference` is where the law is to have the joint, and `NAN` while
the law does not lead.

**The preflight is not exported.** In Python it moves the motor by some degrees after arming, and looks whether current,
motor and joint answer. Here you write it: in `SAFETY_MODE_PREFLIGHT` let the command make such small motions. Then set
`observed.preflight` to 1 if all of them answered, to −1 if not, and to 0 again when the gate has stopped. Until it is
1, `SAFETY_REQUEST_RUN` does nothing.

The gate replaces no emergency stop, and has not been certified by anyone.
"""
