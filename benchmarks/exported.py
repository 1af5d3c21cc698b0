"""A cycle of each law and a sample of the detector: interpreted, compiled, exported, on a Cortex-M4F."""

import argparse
import ctypes
import subprocess
import sys
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control import LAWS
from bowden.control.conditioning import condition_start, condition_step
from bowden.control.law import Law, law_start, law_step
from bowden.core.kernel import kernel, specialise
from bowden.core.signals import Reference, Sample
from bowden.export.files import FLAGS, files
from bowden.export.modules import emg_modules, law_module
from bowden.export.unit import Module
from bowden.models.cable.sheath_path import constant_bend
from bowden.plants.presets import paper
from bowden.plants.presets.bench import default_bench
from bowden.sensing.detectors import DEFAULT
from bowden.sensing.onset import Onset, OnsetState, onset_start, onset_step, prepare_onset
from bowden.sim.emg import contractions
from bowden.sim.run import inputs_of, simulate
from hand_c import compiler
from measure import by_turns, machine, table, write_rows

sys.path.append(str(Path(__file__).parents[1] / "tests"))
from support import cortex

Array = NDArray[np.float64]
TIMED, INTERPRETED, ON_CHIP, ROUNDS = 20_000, 1_000, 2_000, 15
DT = 1e-3
RATES = (1000.0, 2000.0)
"""Of the detector [Hz]."""
COLUMNS = (
    *("what", "interpreted", "compiled", "exported (smallest)", "in `float`", "interpreted/exported"),
    *("compiled/exported", "lines of C", "Cortex-M4F in `float`: instructions, mean (most)", "code", "stack"),
    "in `double`",
)

LAW_LOOP = """
#include "@NAME@.h"
void steps(const double *rows, long count, double *out);
void steps(const double *rows, long count, double *out)
{
    const @NAME@_Sample first = {(@NAME@_real)rows[1], (@NAME@_real)rows[2], 0, 0};
    @NAME@_LawState state;
    @NAME@_start(&state, &first);
    for (long k = 0; k < count; ++k, rows += 7) {
        const @NAME@_Sample sample = {(@NAME@_real)rows[1], (@NAME@_real)rows[2], 0, 0};
        const @NAME@_Reference reference = {(@NAME@_real)rows[3], (@NAME@_real)rows[4], (@NAME@_real)rows[5]};
        out[k] = (double)@NAME@_step(&state, &sample, &reference);
    }
}
"""
DETECTOR_LOOP = """
#include "onset.h"
void steps(const double *values, long count, double *out);
void steps(const double *values, long count, double *out)
{
    static onset_OnsetState state;
    onset_Trouble trouble;
    onset_start(&state);
    for (long k = 0; k < count; ++k)
        out[k] = (double)onset_step(&state, (onset_real)values[k], &trouble);
}
"""
AS_A_LAW = {
    "detector.h": """
#include "onset.h"
typedef onset_real detector_real;
typedef onset_OnsetState detector_LawState;
typedef struct { detector_real value, unused, none, neither; } detector_Sample;
typedef struct { detector_real one, two, three; } detector_Reference;
void detector_start(detector_LawState *state, const detector_Sample *sample);
detector_real detector_step(
    detector_LawState *state, const detector_Sample *sample, const detector_Reference *reference);
""",
    "detector.c": """
#include "onset.c"
#include "detector.h"
void detector_start(detector_LawState *state, const detector_Sample *sample)
{
    (void)sample;
    onset_start(state);
}
detector_real detector_step(
    detector_LawState *state, const detector_Sample *sample, const detector_Reference *reference)
{
    onset_Trouble trouble;
    (void)reference;
    return onset_step(state, sample->value, &trouble);
}
""",
}
"""What `support.cortex` measures is a law: the first number of its sample is the signal here."""


class Subject(NamedTuple):
    """What is measured: three forms of one loop over the same inputs."""

    name: str
    module: Module
    loop: str
    inputs: Array
    interpreted: Callable[[Array, Array], None]
    compiled: Callable[[Array, Array], None]
    chip: str
    """Prefix of what runs on the chip."""
    chip_files: Mapping[str, str]
    """Beside the exported ones."""
    chip_rows: list[list[float]]


@kernel
def law_cycles(gains: Any, conditioning: Any, rows: Array, out: Array) -> None:
    first = Sample(rows[0, 1], rows[0, 2])
    state, conditioned = law_start(gains, first), condition_start(conditioning, first)
    for k in range(len(rows)):
        reference = Reference(rows[k, 3], rows[k, 4], rows[k, 5])
        conditioned, shown = condition_step(conditioning, conditioned, reference, rows[k, 6])
        state, out[k] = law_step(gains, state, Sample(rows[k, 1], rows[k, 2]), shown, rows[k, 6])


def subject_of_law(law: Law) -> Subject:
    """A law in the closed loop on the paper's bench."""
    bench, motion, duration = default_bench(), paper.minimum_jerk(), TIMED * DT
    trace = simulate(bench, law, motion, duration=duration, seed=1)
    references = inputs_of(bench, motion, duration, constant_bend(bench.sheath.bend), 1).references
    columns = [np.zeros(TIMED), trace["joint_measured"], trace["motor_measured"], *references, np.full(TIMED, DT)]
    rows = np.column_stack(columns)
    rows[0, 0] = 1.0
    compiled = specialise(law_cycles, law.name, law_start=law.start_kernel, law_step=law.step_kernel)

    def interpreted(rows: Array, out: Array) -> None:
        first = Sample(rows[0, 1], rows[0, 2])
        state, conditioned = law.start(first), condition_start(law.conditioning, first)
        for k, (_, joint, motor, position, velocity, acceleration, dt) in enumerate(rows.tolist()):
            reference = Reference(position, velocity, acceleration)
            conditioned, shown = condition_step(law.conditioning, conditioned, reference, dt)
            state, out[k] = law.step(state, Sample(joint, motor), shown, dt)

    module = law_module(law, DT)
    return Subject(
        *(f"`{law.name}`", module, LAW_LOOP.replace("@NAME@", module.prefix), rows, interpreted),
        lambda rows, out: compiled(law.gains, law.conditioning, rows, out),
        *(module.prefix, {}, rows[:ON_CHIP, 1:6].tolist()),
    )


@kernel
def detector_samples(onset: Onset, state: OnsetState, values: Array, out: Array) -> None:
    for k in range(len(values)):
        state, out[k], _ = onset_step(onset, state, values[k])


def muscle(rate: float, count: int = TIMED) -> Array:
    """Rest, hum, contractions, a signal that is lost, and one that stands still (n,)."""
    random, time = np.random.default_rng(3), np.arange(count) / rate
    spans = [(t, t + 1.5, 0.3) for t in np.arange(3.0, time[-1] - 3.0, 4.0)]
    values = 0.2 + random.normal(0.0, 0.01, count) + contractions(rate, spans, count, seed=1)
    values += 0.05 * np.sin(2.0 * np.pi * 50.0 * time) * (time % 7.0 > 5.0)
    values[count // 2 : count // 2 + 100] = np.nan
    values[round(rate) : round(1.7 * rate)] = values[count // 3 : count // 3 + 300] = 0.4
    return values


def subject_of_detector(rate: float) -> Subject:
    """The detector at a rate [Hz]."""
    values, onset = muscle(rate), prepare_onset(rate)
    compiled = specialise(detector_samples, "onset")

    def interpreted(values: Array, out: Array) -> None:
        state = onset_start(onset, float(values[0]))
        for k, value in enumerate(values.tolist()):
            state, out[k], _ = DEFAULT.step(onset, state, value)

    begin = round(2.5 * rate)  # the middle of it holds the start of a contraction
    rows = [[float(value), *(0.0,) * 4] for value in values[begin : begin + ON_CHIP]]
    return Subject(
        *(f"EMG detector at {rate:g} Hz", emg_modules(rate)[1], DETECTOR_LOOP, values, interpreted),
        lambda values, out: compiled(onset, onset_start(onset, float(values[0])), values, out),
        *("detector", AS_A_LAW, rows),
    )


def built(one: Subject, folder: Path, cc: str, *, single: bool) -> Any:
    """The exported loop over inputs."""
    texts = files(one.module, "for a benchmark", single=single) | {"loop.c": one.loop}
    for name, text in texts.items():
        (folder / name).write_text(text, encoding="utf-8")
    library = folder / f"{one.module.prefix}{'32' if single else ''}.so"
    sources = ["loop.c", f"{one.module.prefix}.c"]
    command = [cc, *FLAGS.split(), "-fPIC", "-shared", *sources, "-o", str(library), "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    steps = ctypes.CDLL(str(library)).steps
    steps.argtypes, steps.restype = [ctypes.c_void_p, ctypes.c_long, ctypes.c_void_p], None
    return steps


def measured(one: Subject, cc: str) -> list[str]:
    """A row of the table."""
    count, some, out = len(one.inputs), one.inputs[:INTERPRETED].copy(), np.empty(len(one.inputs))
    data = (one.inputs.ctypes.data, count, out.ctypes.data)
    with tempfile.TemporaryDirectory(prefix="bowden-exported-") as made:
        double, single = (built(one, Path(made), cc, single=kind) for kind in (False, True))
        times = by_turns(
            ROUNDS,
            interpreted=lambda: one.interpreted(some, out),
            compiled=lambda: one.compiled(one.inputs, out),
            exported=lambda: double(*data),
            in_float=lambda: single(*data),
        )
    seconds = {key: np.array(timing.seconds) / count for key, timing in times.items()}
    seconds["interpreted"] *= count / INTERPRETED
    middle = {key: float(np.median(values)) for key, values in seconds.items()}
    ratios = [float(np.median(seconds[key] / seconds["exported"])) for key in ("interpreted", "compiled")]
    text = files(one.module, "for a benchmark")[f"{one.module.prefix}.c"]
    return [
        *(one.name, f"{middle['interpreted'] * 1e6:.1f} µs", f"{middle['compiled'] * 1e9:.0f} ns"),
        f"{middle['exported'] * 1e9:.0f} ns ({seconds['exported'].min() * 1e9:.0f})",
        *(f"{middle['in_float'] * 1e9:.0f} ns", f"{ratios[0]:.0f} ×", f"{ratios[1]:.2f} ×", f"{text.count(chr(10))}"),
        *_on_chip(one),
    ]


def _on_chip(one: Subject) -> list[str]:
    if cortex.tools():
        return ["–"] * 4
    single, double = (
        cortex.measure(one.chip, files(one.module, "", single=kind) | dict(one.chip_files), one.chip_rows)
        for kind in (True, False)
    )
    mean = f"{single.instructions_mean:.0f} ({single.instructions_max:.0f})"
    return [mean, f"{single.code_bytes} B", f"{single.stack_bytes} B", f"{double.instructions_mean:.0f}"]


def main() -> None:
    """The command."""
    makers: dict[str, Callable[[], Subject]] = {name: lambda law=law: subject_of_law(law) for name, law in LAWS.items()}
    makers |= {f"detector-{rate:g}": lambda rate=rate: subject_of_detector(rate) for rate in RATES}
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", choices=[[], *makers], help="only these")
    names = parser.parse_args().names
    cc = compiler()
    if cc is None:
        raise SystemExit("no C compiler; set CC")
    rows = [measured(makers[name](), cc) for name in names or makers]
    print(table(COLUMNS, rows))
    if not names:
        what = "One cycle of each law and one sample of the detector: interpreted, compiled, exported, on a Cortex-M4F"
        how = f"{machine()} Median of {ROUNDS} rounds by turns. Cortex-M4F: instructions in QEMU, not clock cycles."
        write_rows("export_laws", what, "python benchmarks/exported.py", COLUMNS, rows, how)


if __name__ == "__main__":
    main()
