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

from bowden.export.files import FLAGS as CHECKED
from bowden.export.files import TARGETS

SIZE, EMULATOR = "arm-none-eabi-size", "qemu-system-arm"
COMPILER, *FLAGS = f"{TARGETS['cortex-m4f'].compiler} {CHECKED} -ffunction-sections".split()
_LINK = ("-nostartfiles", "--specs=nosys.specs", "-Wl,--gc-sections,--no-warn-rwx-segments", "-T", "board.ld")
_BOARD = (
    *("-machine", "mps2-an386", "-icount", "shift=0", "-display", "none", "-monitor", "none", "-serial", "none"),
    *("-semihosting-config", "enable=on,target=native"),
)
_HERE = Path(__file__).parent
BOARD = (_HERE / "cortex.c").read_text(encoding="utf-8")
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


def measure(prefix: str, texts: Mapping[str, str], rows: Sequence[Sequence[float]]) -> Cost:
    """Run a law over samples and references.

    Args:
        prefix: of the law's code.
        texts: its header and its source, by file name.
        rows: joint, motor, reference, its velocity and acceleration of each cycle.

    Raises:
        subprocess.SubprocessError: the code does not compile, or does not end.
        ValueError: what came from the emulator is no result.
    """
    with tempfile.TemporaryDirectory(prefix="bowden-cortex-") as made:
        folder = Path(made)
        for name, text in texts.items():
            (folder / name).write_text(text, encoding="utf-8")
        numbers = ",\n".join("{" + ", ".join(float(value).hex() for value in row) + "}" for row in rows)
        (folder / "main.c").write_text(BOARD.replace("[[name]]", prefix).replace("[[rows]]", numbers))
        shutil.copy(_HERE / "cortex.ld", folder / "board.ld")
        _run([COMPILER, *FLAGS, "-c", f"{prefix}.c"], folder)
        _run([COMPILER, *FLAGS, *_LINK, "main.c", f"{prefix}.o", "-lm", "-o", "image.elf"], folder)
        said = _run([EMULATOR, *_BOARD, "-kernel", "image.elf"], folder)
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
