"""A cycle of each law interpreted, compiled and exported, and exported laws on a Cortex-M4F: ``make bench``.

That all three give the same is tests/test_export_law.py's. With names of laws only these are run, and nothing is
written.
"""

import argparse
import ctypes
import os
import subprocess
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import results
from bowden.control import LAWS
from bowden.control.conditioning import condition_start, condition_step
from bowden.control.law import Law, law_start, law_step
from bowden.core.kernel import kernel, specialise
from bowden.core.signals import Reference, Sample
from bowden.export import cortex
from bowden.export.kinds import Style
from bowden.export.law import law_module
from bowden.export.readme import FLAGS
from bowden.export.unit import files
from bowden.models.cable.sheath_path import constant_bend
from bowden.plants.presets import bench as paper
from bowden.sim.run import inputs_of, simulate
from hand_c import compiler
from measure import Timing, by_turns, machine

Array = NDArray[np.float64]
TIMED, INTERPRETED, ON_CHIP, ROUNDS = 20_000, 1_000, 2_000, 15
DT = 1e-3
TITLE = "A cycle of each law"
MOST, OURS_MOST = 150e-9, 100e-9
"""What a step of an exported law, and of ours, may take [s]."""

LOOP = """
#include "@NAME@.h"
void steps(const double *rows, long count, double *commands);
void steps(const double *rows, long count, double *commands)
{
    const @NAME@_Sample first = {(@NAME@_real)rows[1], (@NAME@_real)rows[2]};
    @NAME@_LawState state;
    @NAME@_start(&state, &first);
    for (long k = 0; k < count; ++k, rows += 7) {
        const @NAME@_Sample sample = {(@NAME@_real)rows[1], (@NAME@_real)rows[2]};
        const @NAME@_Reference reference = {(@NAME@_real)rows[3], (@NAME@_real)rows[4], (@NAME@_real)rows[5]};
        commands[k] = (double)@NAME@_step(&state, &sample, &reference);
    }
}
"""


@kernel
def compiled_steps(gains: Any, conditioning: Any, rows: Array, commands: Array) -> None:
    first = Sample(rows[0, 1], rows[0, 2])
    state, conditioned = law_start(gains, first), condition_start(conditioning, first)
    for k in range(len(rows)):
        reference = Reference(rows[k, 3], rows[k, 4], rows[k, 5])
        conditioned, shown = condition_step(conditioning, conditioned, reference, rows[k, 6])
        state, commands[k] = law_step(gains, state, Sample(rows[k, 1], rows[k, 2]), shown, rows[k, 6])


def interpreted_steps(law: Law, rows: Array, commands: Array) -> None:
    first = Sample(rows[0, 1], rows[0, 2])
    state, conditioned = law.start(first), condition_start(law.conditioning, first)
    for k, (_, joint, motor, position, velocity, acceleration, dt) in enumerate(rows.tolist()):
        reference = Reference(position, velocity, acceleration)
        conditioned, shown = condition_step(law.conditioning, conditioned, reference, dt)
        state, commands[k] = law.step(state, Sample(joint, motor), shown, dt)


def bench_rows(law: Law) -> Array:
    """What the law is handed in the closed loop on the paper's bench."""
    bench, motion, duration = paper.bench(), paper.minimum_jerk(), TIMED * DT
    trace = simulate(bench, law, motion, duration=duration, seed=1)
    references = inputs_of(bench, motion, duration, constant_bend(bench.sheath.bend), 1).references
    rows = np.column_stack([np.zeros(TIMED), trace["joint_measured"], trace["motor_measured"], *references])
    rows[0, 0] = 1.0
    return np.column_stack([rows, np.full(TIMED, DT)])


def built(law: Law, folder: Path, cc: str, *, single: bool) -> Any:
    """The exported law's loops over rows: `steps` keeps the commands."""
    module = law_module(law, DT)
    texts = files(module, Style(module.prefix, single), "for a benchmark")
    for name, text in (texts | {"loop.c": LOOP.replace("@NAME@", module.prefix)}).items():
        (folder / name).write_text(text, encoding="utf-8")
    library = folder / f"{module.prefix}{'32' if single else ''}.so"
    sources = ["loop.c", f"{module.prefix}.c"]
    command = [cc, *FLAGS.split(), "-fPIC", "-shared", *sources, "-o", str(library), "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    loaded = ctypes.CDLL(str(library))
    loaded.steps.argtypes, loaded.steps.restype = [ctypes.c_void_p, ctypes.c_long, ctypes.c_void_p], None
    return loaded


def measured(law: Law, cc: str) -> list[str]:
    """A law's row of the table."""
    rows = bench_rows(law)
    some, out = rows[:INTERPRETED].copy(), np.empty(TIMED)
    compiled = specialise(compiled_steps, law.name, law_start=law.start_kernel, law_step=law.step_kernel)
    with tempfile.TemporaryDirectory(prefix="bowden-exported-") as made:
        double, single = (built(law, Path(made), cc, single=kind) for kind in (False, True))
        data = (rows.ctypes.data, TIMED, out.ctypes.data)
        times = by_turns(
            ROUNDS,
            interpreted=lambda: interpreted_steps(law, some, out),
            compiled=lambda: compiled(law.gains, law.conditioning, rows, out),
            exported=lambda: double.steps(*data),
            in_float=lambda: single.steps(*data),
        )
    c = times["exported"]
    ratios = [
        Timing(tuple(s / n for s in times[key].seconds))
        for key, n in (("interpreted", INTERPRETED / TIMED), ("compiled", 1))
    ]
    return [
        f"`{law.name}`",
        f"{times['interpreted'].median / INTERPRETED * 1e6:.1f} µs",
        f"{times['compiled'].median / TIMED * 1e9:.0f} ns",
        f"{c.median / TIMED * 1e9:.0f} ns ({min(c.seconds) / TIMED * 1e9:.0f})",
        f"{times['in_float'].median / TIMED * 1e9:.0f} ns",
        f"{ratios[0].over(c).median:.0f} ×",
        f"{ratios[1].over(c).median:.2f} ×",
        lines_of(law),
        *_on_chip(law, rows),
    ]


def _on_chip(law: Law, rows: Array) -> list[str]:
    if cortex.tools():
        return ["–"] * 4
    module = law_module(law, DT)
    costs = [
        cortex.measure(module.prefix, files(module, Style(module.prefix, kind), "for a benchmark"), given)
        for kind in (True, False)
        for given in [rows[:ON_CHIP, 1:6].tolist()]
    ]
    cost = costs[0]
    return [
        f"{cost.instructions_mean:.0f} ({cost.instructions_max:.0f})",
        f"{cost.code_bytes} B",
        f"{cost.stack_bytes} B",
        f"{costs[1].instructions_mean:.0f}",
    ]


def lines_of(law: Law) -> str:
    """Lines of the law's source file."""
    module = law_module(law, DT)
    text = files(module, Style(module.prefix), "for a benchmark")[f"{module.prefix}.c"]
    return f"{text.count(chr(10))}"


HEAD = (
    *(
        "law",
        "interpreted",
        "compiled",
        "exported (smallest)",
        "in `float`",
        "interpreted/exported",
        "compiled/exported",
    ),
    *(
        "lines of C",
        "Cortex-M4F in `float`: instructions, mean (most)",
        "code",
        "stack",
        "in `double`",
    ),
)


def section(laws: Sequence[Law], cc: str) -> str:
    """The table and its notes."""
    lines = [f"| {' | '.join(HEAD)} |", "|---" * len(HEAD) + "|"]
    for law in laws:
        print(f"{law.name} …", flush=True)
        lines.append(f"| {' | '.join(measured(law, cc))} |")
    notes = [
        *machine(),
        f"A cycle on the processor, the median of {ROUNDS} rounds by turns over a closed loop of {TIMED * DT:g} s on "
        "the paper's bench. Exported: gcc with "
        f"{' '.join(FLAGS.split()[-2:])}. Asked for: at most {MOST * 1e9:g} ns exported, of ours {OURS_MOST * 1e9:g}.",
        f"Load of the machine meanwhile: {os.getloadavg()[0]:.0f} processes; the smallest time is the least disturbed.",
        f"Cortex-M4F: QEMU's MPS2 board, instructions (not clock cycles) of {ON_CHIP} cycles of the same closed loop, "
        f"to within {cortex.PER_TICK}; code without the C library's, stack with it.",
    ]
    return "\n".join(lines) + "\n\n" + "\n".join(f"- {note}" for note in notes)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("laws", nargs="*", choices=[[], *LAWS], help="only these")
    names = parser.parse_args().laws
    cc = compiler()
    if cc is None:
        raise SystemExit("no C compiler; set CC")
    text = section([LAWS[name] for name in names or LAWS], cc)
    print(f"\n{text}")
    if not names:
        results.write(TITLE, text)


if __name__ == "__main__":
    main()
