"""A sample of the detector of contractions interpreted, compiled and exported, and on a Cortex-M4F: ``make bench``.

The signal is made up: rest, hum, contractions, a signal that is lost and one that stands still. Before anything is
timed, what is found is compared bit for bit in all three forms.
"""

import ctypes
import os
import subprocess
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import results
from bowden.core.kernel import kernel, specialise
from bowden.core.nested import flat
from bowden.export import cortex
from bowden.export.kinds import Style
from bowden.export.parts import emg_modules
from bowden.export.readme import FLAGS
from bowden.export.unit import Module, files
from bowden.sensing.detectors import DEFAULT
from bowden.sensing.onset import Onset, OnsetState, onset_start, onset_step, prepare_onset
from bowden.sim.emg import contractions
from hand_c import compiler
from measure import by_turns, machine

Array = NDArray[np.float64]
RATES = (1000.0, 2000.0)
"""[Hz]"""
SAMPLES, INTERPRETED, ON_CHIP, ROUNDS = 100_000, 1_000, 2_000, 15
TITLE = "A sample of the detector"

LOOP = """
#include "onset.h"
void run(const double *values, long count, double *out);
void run(const double *values, long count, double *out)
{
    static onset_OnsetState state;
    onset_start(&state, (onset_real)values[0]);
    for (long k = 0; k < count; ++k) {
        onset_real trouble;
        out[2 * k] = (double)onset_step(&state, (onset_real)values[k], &trouble);
        out[2 * k + 1] = (double)trouble;
    }
}
"""
AS_A_LAW = {
    "detector.h": """
#include "onset.h"
typedef onset_real detector_real;
typedef onset_OnsetState detector_LawState;
typedef struct { detector_real value, unused; } detector_Sample;
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
    onset_start(state, sample->value);
}
detector_real detector_step(
    detector_LawState *state, const detector_Sample *sample, const detector_Reference *reference)
{
    onset_real trouble;
    (void)reference;
    return onset_step(state, sample->value, &trouble);
}
""",
}
"""What `bowden.export.cortex` measures is a law: the first number of its sample is the signal here."""


@kernel
def compiled_samples(onset: Onset, state: OnsetState, values: Array, out: Array) -> None:
    for k in range(len(values)):
        state, out[k, 0], out[k, 1] = onset_step(onset, state, values[k])


def interpreted_samples(onset: Onset, values: Array, out: Array) -> None:
    state = onset_start(onset, float(values[0]))
    for k, value in enumerate(values.tolist()):
        state, out[k, 0], out[k, 1] = DEFAULT.step(onset, state, value)


def muscle(rate: float, count: int = SAMPLES) -> Array:
    """Rest, hum, contractions, a signal that is lost, and one that stands still (n,)."""
    random, time = np.random.default_rng(3), np.arange(count) / rate
    spans = [(t, t + 1.5, 0.3) for t in np.arange(3.0, time[-1] - 3.0, 4.0)]
    values = 0.2 + random.normal(0.0, 0.01, count) + contractions(rate, spans, count, seed=1)
    values += 0.05 * np.sin(2.0 * np.pi * 50.0 * time) * (time % 7.0 > 5.0)
    values[count // 2 : count // 2 + 100] = np.nan
    values[round(rate) : round(1.7 * rate)] = values[count // 3 : count // 3 + 300] = 0.4
    return values


def built(module: Module, folder: Path, cc: str, *, single: bool) -> Any:
    """The exported detector's loop over samples."""
    (folder / "loop.c").write_text(LOOP, encoding="utf-8")
    for name, text in files(module, Style(module.prefix, single), "for a benchmark").items():
        (folder / name).write_text(text, encoding="utf-8")
    library = folder / f"onset{'32' if single else ''}.so"
    command = [cc, *FLAGS.split(), "-fPIC", "-shared", "loop.c", "onset.c", "-o", str(library), "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    run = ctypes.CDLL(str(library)).run
    run.argtypes, run.restype = [ctypes.c_void_p, ctypes.c_long, ctypes.c_void_p], None
    return run


def measured(rate: float, cc: str) -> list[str]:
    """A rate's row of the table."""
    values, onset, module = muscle(rate), prepare_onset(rate), emg_modules(rate)[1]
    some, found = values[:INTERPRETED].copy(), [np.empty((SAMPLES, 2)) for _ in range(4)]
    compiled = specialise(compiled_samples, "onset")
    start = onset_start(onset, float(values[0]))
    with tempfile.TemporaryDirectory(prefix="bowden-detector-") as made:
        double, single = (built(module, Path(made), cc, single=kind) for kind in (False, True))
        double(values.ctypes.data, SAMPLES, found[0].ctypes.data)
        compiled(onset, start, values, found[1])
        interpreted_samples(onset, values, found[2])
        unequal = sum(int((found[0] != other).any(axis=1).sum()) for other in found[1:3])
        times = by_turns(
            ROUNDS,
            interpreted=lambda: interpreted_samples(onset, some, found[2]),
            compiled=lambda: compiled(onset, start, values, found[1]),
            exported=lambda: double(values.ctypes.data, SAMPLES, found[0].ctypes.data),
            in_float=lambda: single(values.ctypes.data, SAMPLES, found[3].ctypes.data),
        )
    nanoseconds = {key: f"{one.median / SAMPLES * 1e9:.0f} ns" for key, one in times.items()}
    return [
        f"{rate:g} Hz",
        f"{times['interpreted'].median / INTERPRETED * 1e6:.1f} µs",
        nanoseconds["compiled"],
        f"{nanoseconds['exported']} ({min(times['exported'].seconds) / SAMPLES * 1e9:.0f})",
        nanoseconds["in_float"],
        f"{unequal}",
        f"{len(flat(start))}",
        *_on_chip(module, values, rate),
    ]


def _on_chip(module: Module, values: Array, rate: float) -> list[str]:
    if cortex.tools():
        return ["–"] * 5
    begin = round(2.5 * rate)  # the middle of it holds the start of a contraction
    rows = [[float(value), *(0.0,) * 4] for value in values[begin : begin + ON_CHIP]]
    single, double = (
        cortex.measure("detector", files(module, Style("onset", kind), "for a benchmark") | AS_A_LAW, rows)
        for kind in (True, False)
    )
    return [
        f"{single.instructions_mean:.0f} ({single.instructions_max:.0f})",
        f"{single.code_bytes} B",
        f"{single.state_bytes} B",
        f"{single.stack_bytes} B",
        f"{double.instructions_mean:.0f}",
    ]


HEAD = (
    *("rate", "interpreted", "compiled", "exported (smallest)", "in `float`", "samples of 100 000 that differ"),
    *("numbers of state", "Cortex-M4F in `float`: instructions, mean (most)", "code", "state", "stack", "in `double`"),
)


def main() -> None:
    """The command."""
    cc = compiler()
    if cc is None:
        raise SystemExit("no C compiler; set CC")
    lines = [f"| {' | '.join(HEAD)} |", "|---" * len(HEAD) + "|"]
    lines += [f"| {' | '.join(measured(rate, cc))} |" for rate in RATES]
    notes = [
        *machine(),
        f"A sample on the processor, the median of {ROUNDS} rounds by turns over {SAMPLES} samples of made-up rest, "
        f"hum and contractions. Exported: gcc with {' '.join(FLAGS.split()[-2:])}.",
        f"Load of the machine meanwhile: {os.getloadavg()[0]:.1f} processes.",
        "Samples that differ: contraction and trouble, interpreted and compiled against exported in `double`.",
        f"Cortex-M4F: QEMU's MPS2 board, instructions (not clock cycles) of {ON_CHIP} samples, to within "
        f"{cortex.PER_TICK}; code without the C library's, stack with it.",
    ]
    text = "\n".join(lines) + "\n\n" + "\n".join(f"- {note}" for note in notes)
    print(text)
    results.write(TITLE, text)


if __name__ == "__main__":
    main()
