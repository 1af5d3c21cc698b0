"""Exported laws give the bits of the interpreted and of the compiled law, also on extreme numbers; float is near."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from bowden.control import LAWS
from bowden.control.conditioning import condition_start, condition_step
from bowden.control.law import Law, law_start, law_step
from bowden.core.kernel import kernel, specialise
from bowden.core.nested import flat
from bowden.core.signals import Reference, Sample
from bowden.export.modules import law_module
from support.exported_c import COMPILER, Exported, bits
from support.states import floated

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")
CYCLES = 100_000
INTERPRETED = 1_000
EXTREMES = [0.0, -0.0, 5e-324, -2e-310, 1e-300, 1.0, -1.0, 1e16, 1e154, -1e308, math.inf, -math.inf, math.nan]
DT = 1e-3
Array = NDArray[np.float64]

VARIANTS = [
    *(pytest.param(law, id=name) for name, law in LAWS.items()),
    *(pytest.param(law.preset(key), id=f"{name}-{key}") for name, law in LAWS.items() for key in law.presets),
    pytest.param(LAWS["observer"].with_gains(from_reference=1.0, exponent=1.7), id="observer-from-reference"),
]


def inputs(count: int) -> Array:
    """Rows as `replay --binary` reads them, and dt: noisy motions that begin anew each second, then wild inputs too."""
    random = np.random.default_rng(1)
    phase = 3e-3 * np.arange(count)
    columns = [0.0 * phase, np.sin(phase - 0.1), 1.07 * np.sin(phase), np.sin(phase), 3 * np.cos(phase)]
    rows = np.column_stack([*columns, -9.0 * np.sin(phase), np.full(count, DT)])
    rows[:, 1:6] += random.normal(0.0, 1e-3, (count, 5))
    within = np.arange(count) % 1000
    rows[within == 0, 0] = 1.0
    wild = np.flatnonzero((within > 600) & (random.random(count) < 0.05))
    rows[wild, random.integers(1, 6, len(wild))] = random.choice(EXTREMES, len(wild))
    return rows


@kernel
def run_rows(gains: Any, conditioning: Any, rows: Array, out: Array) -> None:
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


def interpreted(law: Law, rows: Array) -> Array:
    out, state, conditioned = [], law.start(Sample(0.0, 0.0)), condition_start(law.conditioning, Sample(0.0, 0.0))
    with np.errstate(all="ignore"):
        for anew, *values, dt in rows.tolist():
            sample, reference = Sample(*values[:2]), Reference(*values[2:])
            if anew:
                state, conditioned = law.start(sample), condition_start(law.conditioning, sample)
            conditioned, shown = condition_step(law.conditioning, conditioned, reference, dt)
            state, command = law.step(state, sample, shown, dt)
            state, conditioned = floated(state), floated(conditioned)
            out.append([float(command), *flat((state, conditioned))])
    return np.array(out)


@pytest.mark.parametrize("law", VARIANTS)
def test_exported_law_gives_the_numbers_of_python(law: Law, tmp_path: Path) -> None:
    """To 1e-12; to the bit where the compiler has nothing of libm to work out, which it rounds in its own way."""
    rows = inputs(CYCLES)
    module = law_module(law, DT)
    found = Exported(module, "step", f"{module.prefix}_start(&state, &sample)", tmp_path).over(
        np.insert(rows[:, :-1], [3, 3], math.nan, axis=1)  # a joint with an encoder: no age, no deviation
    )
    compiled = np.empty_like(found)
    specialise(run_rows, law.name, law_start=law.start_kernel, law_step=law.step_kernel)(
        law.gains, law.conditioning, rows, compiled
    )
    found = np.column_stack([found[:, -1], found[:, :-1]])
    assert np.isfinite(found).all(axis=1).mean() > 0.6
    assert (np.isnan(found) == np.isnan(compiled)).all()
    assert (bits(found) == bits(compiled)).all()
    assert (bits(found[:INTERPRETED]) == bits(interpreted(law, rows[:INTERPRETED]))).all()
