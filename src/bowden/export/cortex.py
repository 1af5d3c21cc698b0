"""What exported code costs on a Cortex-M4F: built with Debian's cross compiler, run on QEMU's MPS2 board (AN386).

QEMU counts instructions, not clock cycles: with ``-icount shift=0`` its clock moves on by 1 ns for each, and the core's
own timer by one tick for every 40. A step's stack is what it has overwritten of a known pattern.
"""

import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

COMPILER, SIZE, EMULATOR = "arm-none-eabi-gcc", "arm-none-eabi-size", "qemu-system-arm"
FLAGS = (
    *("-mcpu=cortex-m4", "-mthumb", "-mfloat-abi=hard", "-mfpu=fpv4-sp-d16", "-O2", "-ffp-contract=off"),
    *("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-ffunction-sections"),
)
PER_TICK = 40
"""Instructions in one tick of the core's timer, at 25 MHz."""
_PATIENCE = 120.0
"""Longest time that the emulator is given [s]."""


@dataclass(frozen=True)
class Cost:
    """What one law costs, and what it said."""

    code_bytes: int
    """Its own functions and constants, without those of the C library."""
    state_bytes: int
    stack_bytes: int
    """Most that a step needs below its caller, the library's functions included."""
    instructions_mean: float
    """Of a cycle; without the first, which also starts the law."""
    instructions_max: float
    """To within one tick."""
    commands: Sequence[float]
    """Of every cycle [rad]."""


def tools() -> list[str]:
    """What is missing to measure."""
    return [tool for tool in (COMPILER, SIZE, EMULATOR) if shutil.which(tool) is None]


def measure(prefix: str, texts: Mapping[str, str], rows: Sequence[Sequence[float]], dt: float) -> Cost:
    """Run a law over samples and references.

    Args:
        prefix: of the law's code.
        texts: its header and its source, by file name.
        rows: joint, motor, reference, its velocity and acceleration of each cycle.
        dt: length of a cycle [s].

    Raises:
        subprocess.SubprocessError: the code does not compile, or does not end.
        ValueError: what came from the emulator is no result.
    """
    with tempfile.TemporaryDirectory(prefix="bowden-cortex-") as made:
        folder = Path(made)
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
        numbers = ",\n".join("{" + ", ".join(float(value).hex() for value in row) + "}" for row in rows)
        main = _MAIN.replace("@NAME@", prefix).replace("@ROWS@", numbers).replace("@DT@", float(dt).hex())
        (folder / "main.c").write_text(main)
        (folder / "board.ld").write_text(_BOARD)
        _run([COMPILER, *FLAGS, "-c", f"{prefix}.c"], folder)
        _run(
            [COMPILER, *FLAGS, "-nostartfiles", "--specs=nosys.specs", "-Wl,--gc-sections,--no-warn-rwx-segments"]
            + ["-T", "board.ld", "main.c", f"{prefix}.o", "-lm", "-o", "image.elf"],
            folder,
        )
        said = _run(
            [EMULATOR, "-machine", "mps2-an386", "-kernel", "image.elf", "-icount", "shift=0", "-display", "none"]
            + ["-monitor", "none", "-serial", "none", "-semihosting-config", "enable=on,target=native"],
            folder,
        )
        size = _run([SIZE, f"{prefix}.o"], folder).splitlines()[1].split()
    words = [line.split() for line in said.splitlines()]
    bits = [int(word[1], 16) for word in words if word and word[0] == "command"]
    found = {word[0]: int(word[1], 16) for word in words if len(word) == 2 and word[0] != "command"}
    if len(bits) != len(rows) or not {"ticks", "longest", "stack", "state"} <= set(found):
        raise ValueError(f"the emulator said {said[:200]!r}")
    return Cost(
        code_bytes=int(size[0]),
        state_bytes=found["state"],
        stack_bytes=found["stack"],
        instructions_mean=PER_TICK * found["ticks"] / (len(rows) - 1),
        instructions_max=float(PER_TICK * found["longest"]),
        commands=np.array(bits, dtype=np.uint64).view(np.float64).tolist(),
    )


def _run(command: list[str], folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=_PATIENCE)
    if done.returncode != 0:
        raise subprocess.SubprocessError(f"{command[0]}: {done.stderr.strip()[-500:]}")
    return done.stdout + done.stderr


_BOARD = """MEMORY { FLASH : ORIGIN = 0x00000000, LENGTH = 4M  RAM : ORIGIN = 0x20000000, LENGTH = 4M }
ENTRY(reset)
SECTIONS
{
    .text : { KEEP(*(.vectors)) *(.text*) *(.rodata*) } > FLASH
    .ARM.exidx : { *(.ARM.exidx*) } > FLASH
    .data : { *(.data*) } > RAM
    .bss : { *(.bss*) *(COMMON) } > RAM
    end = .;
    stack_bottom = ORIGIN(RAM) + LENGTH(RAM) - 64K;
    stack_top = ORIGIN(RAM) + LENGTH(RAM);
}
"""

_MAIN = r"""#include <stdint.h>
#include <string.h>

#include "@NAME@.h"

#define REGISTER(address) (*(volatile uint32_t *)(address))
#define PATTERN 0x5aa5c33cu

extern uint32_t stack_bottom, stack_top;
void reset(void);

/* the emulator puts code and data in their places, so that there is nothing to copy */
__attribute__((section(".vectors"), used)) static const struct {
    uint32_t *stack;
    void (*reset)(void);
} VECTORS = {&stack_top, reset};

static const double ROWS[][5] = {
@ROWS@
};

static uint32_t semihost(uint32_t what, const void *with)
{
    register uint32_t r0 __asm__("r0") = what;
    register const void *r1 __asm__("r1") = with;

    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

static void tell(const char *name, uint64_t value)
{
    char line[40];
    size_t at = strlen(name);

    memcpy(line, name, at);
    line[at++] = ' ';
    for (int shift = 60; shift >= 0; shift -= 4) {
        line[at++] = "0123456789abcdef"[(value >> shift) & 15u];
    }
    line[at++] = '\n';
    line[at] = '\0';
    semihost(0x04, line);
}

static uint32_t now(void)
{
    return REGISTER(0xe000e018); /* SysTick counts down */
}

int main(void)
{
    static @NAME@_state state;
    static double commands[sizeof ROWS / sizeof ROWS[0]];
    const size_t count = sizeof ROWS / sizeof ROWS[0];
    uint32_t ticks = 0, longest = 0, *at, *top;

    REGISTER(0xe000e014) = 0xffffff; /* SysTick: the longest period, the core's clock, no interrupt */
    REGISTER(0xe000e018) = 0;
    REGISTER(0xe000e010) = 5;
    __asm__ volatile("mov %0, sp" : "=r"(top));
    for (at = &stack_bottom; at < top; ++at) {
        *at = PATTERN;
    }
    for (size_t k = 0; k < count; ++k) {
        const @NAME@_sample sample = {(@NAME@_real)ROWS[k][0], (@NAME@_real)ROWS[k][1]};
        const @NAME@_reference reference = {
            (@NAME@_real)ROWS[k][2], (@NAME@_real)ROWS[k][3], (@NAME@_real)ROWS[k][4]
        };
        uint32_t begin, took;
        @NAME@_real command;

        if (k == 0) {
            @NAME@_start(&state, &sample);
        }
        begin = now();
        command = @NAME@_step(&state, &sample, &reference, (@NAME@_real)@DT@);
        took = (begin - now()) & 0xffffffu;
        commands[k] = (double)command;
        if (k > 0) {
            ticks += took;
            longest = took > longest ? took : longest;
        }
    }
    for (at = &stack_bottom; at < top && *at == PATTERN; ++at) {
    }
    for (size_t k = 0; k < count; ++k) {
        uint64_t bits;
        memcpy(&bits, &commands[k], sizeof bits);
        tell("command", bits);
    }
    tell("ticks", ticks);
    tell("longest", longest);
    tell("stack", (uint64_t)((char *)top - (char *)at));
    tell("state", sizeof state);
    return 0;
}

void reset(void)
{
    REGISTER(0xe000ed88) |= 0xfu << 20; /* CPACR: the FPU may be used */
    __asm__ volatile("dsb\n isb");
    main();
    semihost(0x18, (const void *)0x20026); /* the program has ended, and all is well */
    for (;;) {
    }
}
"""
