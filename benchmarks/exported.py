"""A cycle of each law interpreted, compiled and exported, and exported laws on a Cortex-M4F: ``make bench``.

Before anything is timed, 100 000 cycles of each law, extreme inputs among them, are compared bit for bit in all three
forms. With names of laws only these are run, and nothing is written.
"""

import argparse
import ctypes
import math
import os
import subprocess
import tempfile
from collections import Counter
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
from bowden.core.nested import flat, rebuilt
from bowden.core.signals import Reference, Sample
from bowden.export import cortex
from bowden.export.kinds import Style
from bowden.export.law import law_module, state_of
from bowden.export.readme import FLAGS
from bowden.export.unit import files
from bowden.rig.presets import bench as paper
from bowden.sim.run import inputs_of, simulate
from bowden.sim.scenario import constant_bend
from hand_c import compiler
from measure import Timing, by_turns, machine

Array = NDArray[np.float64]
CYCLES, TIMED, INTERPRETED, ON_CHIP, ROUNDS = 100_000, 20_000, 1_000, 2_000, 15
DT = 1e-3
WILD = [0.0, -0.0, 5e-324, -2e-310, 1e-300, 1.0, -1.0, 1e16, 1e154, -1e308, math.inf, -math.inf, math.nan]
TITLE = "A cycle of each law"
MOST, OURS_MOST = 150e-9, 100e-9
"""What a step of an exported law, and of ours, may take [s]."""

LOOP = """
#include "@NAME@.h"
void steps(const double *rows, long count, double *commands);
void steps(const double *rows, long count, double *commands)
{
    const @NAME@_Sample first = {(@NAME@_real)rows[1], (@NAME@_real)rows[2]};
    @NAME@_CycleState state;
    @NAME@_start(&state, &first);
    for (long k = 0; k < count; ++k, rows += 7) {
        const @NAME@_Sample sample = {(@NAME@_real)rows[1], (@NAME@_real)rows[2]};
        const @NAME@_Reference reference = {(@NAME@_real)rows[3], (@NAME@_real)rows[4], (@NAME@_real)rows[5]};
        commands[k] = (double)@NAME@_step(&state, &sample, &reference);
    }
}
void run(const double *rows, long count, double *out);
void run(const double *rows, long count, double *out)
{
    @NAME@_CycleState state = {0};
    for (long k = 0; k < count; ++k, rows += 7) {
        const @NAME@_Sample sample = {(@NAME@_real)rows[1], (@NAME@_real)rows[2]};
        const @NAME@_Reference reference = {(@NAME@_real)rows[3], (@NAME@_real)rows[4], (@NAME@_real)rows[5]};
        const @NAME@_real *field = (const @NAME@_real *)&state;
        if (rows[0] != 0.0) {
            @NAME@_start(&state, &sample);
        }
        *out++ = (double)@NAME@_step(&state, &sample, &reference);
        for (unsigned long j = 0; j < sizeof state / sizeof field[0]; ++j) {
            *out++ = (double)field[j];
        }
    }
}
"""


@kernel
def compiled_rows(gains: Any, conditioning: Any, rows: Array, out: Array) -> None:
    state, conditioned = law_start(gains, Sample(0.0, 0.0)), condition_start(conditioning, Sample(0.0, 0.0))
    for k in range(len(rows)):
        sample = Sample(rows[k, 1], rows[k, 2])
        if rows[k, 0] != 0.0:
            state, conditioned = law_start(gains, sample), condition_start(conditioning, sample)
        reference = Reference(rows[k, 3], rows[k, 4], rows[k, 5])
        conditioned, shown = condition_step(conditioning, conditioned, reference, rows[k, 6])
        state, out[k, 0] = law_step(gains, state, sample, shown, rows[k, 6])
        numbers = flat((state, conditioned))
        for j in range(len(numbers)):
            out[k, j + 1] = numbers[j]


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


def interpreted_rows(law: Law, rows: Array, out: Array) -> None:
    nowhere = Sample(0.0, 0.0)
    state, conditioned = law.start(nowhere), condition_start(law.conditioning, nowhere)
    for k, (anew, joint, motor, position, velocity, acceleration, dt) in enumerate(rows.tolist()):
        sample = Sample(joint, motor)
        if anew:
            state, conditioned = law.start(sample), condition_start(law.conditioning, sample)
        reference = Reference(position, velocity, acceleration)
        conditioned, shown = condition_step(law.conditioning, conditioned, reference, dt)
        state, command = law.step(state, sample, shown, dt)
        state, conditioned = (rebuilt(part, lambda path, value: float(value)) for part in (state, conditioned))
        out[k, 0], out[k, 1:] = command, flat((state, conditioned))


def wild_rows() -> Array:
    """Noisy motions that begin anew each second, with wild inputs after 0.6 s."""
    random, phase = np.random.default_rng(11), 3e-3 * np.arange(CYCLES)
    columns = [0.0 * phase, np.sin(phase - 0.1), 1.07 * np.sin(phase), np.sin(phase), 3.0 * np.cos(phase)]
    rows = np.column_stack([*columns, -9.0 * np.sin(phase), np.full(CYCLES, DT)])
    rows[:, 1:6] += random.normal(0.0, 1e-3, (CYCLES, 5))
    within = np.arange(CYCLES) % 1000
    rows[within == 0, 0] = 1.0
    wild = np.flatnonzero((within > 600) & (random.random(CYCLES) < 0.05))
    rows[wild, random.integers(1, 6, len(wild))] = random.choice(WILD, len(wild))
    return rows


def bench_rows(law: Law) -> Array:
    """What the law is handed in the closed loop on the paper's bench."""
    bench, motion, duration = paper.bench(), paper.minimum_jerk(), TIMED * DT
    trace = simulate(bench, law, motion, duration=duration, seed=1)
    references = inputs_of(bench, motion, duration, constant_bend(bench.sheath.bend), 1).references
    rows = np.column_stack([np.zeros(TIMED), trace["joint_measured"], trace["motor_measured"], *references])
    rows[0, 0] = 1.0
    return np.column_stack([rows, np.full(TIMED, DT)])


def built(law: Law, folder: Path, cc: str, *, single: bool) -> Any:
    """The exported law's loops over rows: `run` keeps commands and states, `steps` the commands."""
    module = law_module(law, DT)
    texts = files(module, Style(module.prefix, single), "for a benchmark")
    for name, text in (texts | {"loop.c": LOOP.replace("@NAME@", module.prefix)}).items():
        (folder / name).write_text(text, encoding="utf-8")
    library = folder / f"{module.prefix}{'32' if single else ''}.so"
    sources = ["loop.c", f"{module.prefix}.c"]
    command = [cc, *FLAGS.split(), "-fPIC", "-shared", *sources, "-o", str(library), "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    loaded = ctypes.CDLL(str(library))
    for function in (loaded.run, loaded.steps):
        function.argtypes, function.restype = [ctypes.c_void_p, ctypes.c_long, ctypes.c_void_p], None
    return loaded


def differing(law: Law, exported: Any) -> int:
    """Cycles in which the three forms do not agree to the bit."""
    rows = wild_rows()
    width = 1 + len(flat(state_of(law)))
    found = [np.empty((CYCLES, width)) for _ in range(3)]
    exported.run(rows.ctypes.data, CYCLES, found[0].ctypes.data)
    specialise(compiled_rows, law.name, law_start=law.start_kernel, law_step=law.step_kernel)(
        law.gains, law.conditioning, rows, found[1]
    )
    with np.errstate(all="ignore"):
        interpreted_rows(law, rows, found[2])
    for one in found:
        one[np.isnan(one)] = np.nan
    whole = [one.view(np.int64) for one in found]
    return int(((whole[0] != whole[1]) | (whole[0] != whole[2])).any(axis=1).sum())


def measured(law: Law, cc: str) -> list[str]:
    """A law's row of the table."""
    rows = bench_rows(law)
    some, out = rows[:INTERPRETED].copy(), np.empty(TIMED)
    compiled = specialise(compiled_steps, law.name, law_start=law.start_kernel, law_step=law.step_kernel)
    with tempfile.TemporaryDirectory(prefix="bowden-exported-") as made:
        double, single = (built(law, Path(made), cc, single=kind) for kind in (False, True))
        unequal, data = differing(law, double), (rows.ctypes.data, TIMED, out.ctypes.data)
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
        f"{unequal}",
        counted(law),
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


def counted(law: Law) -> str:
    """Comparisons, selections and constants of a step as it is written in C, its conditioner included.

    ``fmin`` and ``fmax`` compare and select twice each, for NaN's sake.
    """
    step = law_module(law, DT).functions[1]
    graph, known = written(step)
    kinds = Counter(one.kind for one in graph.operations)
    both = 2 * (kinds["fmin"] + kinds["fmax"])
    compared, chosen = sum(kinds[kind] for kind in ("lt", "le", "eq", "ne")) + both, kinds["sel"] + both
    constants = {one.leaf for one in graph.operations if one.leaf.startswith("literal ") or one.leaf in known}
    return f"{compared}, {chosen}, {len(constants)}"


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
        "cycles of 100 000 that differ",
        "comparisons, selections, constants",
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
        "Cycles that differ: interpreted, compiled and exported in `double`, command and every field of the state "
        "compared bit for bit (any NaN equals any NaN); noisy motions with infinities, NaN, denormals, huge numbers.",
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
