"""Exported code on a Cortex-M4F, in an emulator: the numbers of Python, and what they cost."""

import subprocess

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.conditioning import Conditioned
from bowden.control.law import Law
from bowden.core.nested import flat
from bowden.core.signals import Reference, Sample
from bowden.export.files import files
from bowden.export.modules import law_module
from support import cortex

pytestmark = pytest.mark.skipif(bool(cortex.tools()), reason=f"not installed: {', '.join(cortex.tools())}")
DT, CYCLES = 1e-3, 600


def rows() -> list[list[float]]:
    phase = 6e-3 * np.arange(CYCLES)
    noise = np.random.default_rng(2).normal(0.0, 1e-4, (CYCLES, 2))
    measured = np.column_stack([np.sin(phase - 0.1), 1.07 * np.sin(phase)]) + noise
    return np.column_stack([measured, np.sin(phase), 6.0 * np.cos(phase), -36.0 * np.sin(phase)]).tolist()


def commands(law: Law) -> list[float]:
    found = []
    state = law.start(Sample(*rows()[0][:2]))
    for row in rows():
        state, command = law.step(state, Sample(*row[:2]), Reference(*row[2:]), DT)
        found.append(float(command))
    return found


def measured(law: Law, *, single: bool) -> cortex.Cost:
    module = law_module(law, DT)
    return cortex.measure(module.prefix, files(module, "for a test", single=single), rows())


@pytest.mark.parametrize("name", ["adaptive", "bowden"])
def test_a_law_in_double_gives_the_numbers_of_python(name: str) -> None:
    cost = measured(LAWS[name], single=False)
    if name == "adaptive":
        assert cost.commands == commands(LAWS[name])
    else:  # the compiler works its e^(−κ·Ts) out, and rounds it in its own way
        assert cost.commands == pytest.approx(commands(LAWS[name]), abs=1e-12)
    assert cost.state_bytes == 8 * (len(flat(LAWS[name].start(Sample(0.0, 0.0)))) + len(Conditioned._fields))


@pytest.mark.parametrize("name", ["adaptive", "bowden"])
def test_a_law_in_float_is_cheap(name: str) -> None:
    cost = measured(LAWS[name], single=True)
    assert cost.commands == pytest.approx(commands(LAWS[name]), abs=1e-3)
    assert 20 < cost.instructions_mean <= cost.instructions_max < 4000  # 24 µs at 168 MHz, were each one clock cycle
    assert 16 <= cost.stack_bytes < 1024
    assert 100 < cost.code_bytes < 16384


def test_code_that_does_not_compile_is_told() -> None:
    with pytest.raises(subprocess.SubprocessError, match="arm-none-eabi-gcc"):
        cortex.measure("wrong", {"wrong.h": "", "wrong.c": "int f(void) { return }"}, rows())
