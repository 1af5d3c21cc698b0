"""Laws exported in float close the loop on the bench as well as in double."""

import ctypes
import subprocess
from typing import Any, NamedTuple

import pytest

from bowden.control import LAWS
from bowden.control.law import Law
from bowden.core.kernel import kernel
from bowden.core.signals import Reference, Sample
from bowden.export.files import FLAGS
from bowden.export.modules import law_module
from bowden.plants.presets import paper
from bowden.plants.presets.bench import default_bench
from bowden.sim.run import simulate
from support.exported_c import COMPILER, write

DURATION = 30.0

GLUE = """
static {name}_LawState {name}_kept;
static double {name}_glue(double anew, double joint, double motor, double p, double v, double a)
{{
    const {name}_Sample sample = {{.joint = ({name}_real)joint, .motor = ({name}_real)motor}};
    const {name}_Reference reference = {{({name}_real)p, ({name}_real)v, ({name}_real)a}};
    if (anew != 0.0) {{
        {name}_start(&{name}_kept, &sample);
        return 0.0;
    }}
    return (double){name}_step(&{name}_kept, &sample, &reference);
}}
"""


class Which(NamedTuple):
    number: float


class Nothing(NamedTuple):
    state: float


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Law:
    """One law that is every law in float, told apart by a number, so that its loop is compiled once."""
    if COMPILER is None:
        pytest.skip("no C compiler")
    folder = tmp_path_factory.mktemp("float")
    glue = [f'#include "{name}.h"' for name in LAWS] + [GLUE.format(name=name) for name in LAWS]
    cases = "\n".join(f"    case {i}: return {name}_glue(n, j, m, p, v, a);" for i, name in enumerate(LAWS))
    signature = "double step(double law, double n, double j, double m, double p, double v, double a)"
    glue.append(
        f"{signature};\n{signature}\n{{\n    switch ((int)law) {{\n{cases}\n    default: return 0.0;\n    }}\n}}\n"
    )
    (folder / "glue.c").write_text("\n".join(glue))
    for law in LAWS.values():
        write(law_module(law, default_bench().sample_time), folder, single=True)
    sources = ["glue.c", *(f"{name}.c" for name in LAWS)]
    command = [COMPILER, *FLAGS.split(), "-fPIC", "-shared", *sources, "-o", "laws.so", "-lm"]
    subprocess.run(command, cwd=folder, check=True)
    step_in_c = ctypes.CDLL(str(folder / "laws.so")).step
    step_in_c.argtypes, step_in_c.restype = [ctypes.c_double] * 7, ctypes.c_double

    @kernel
    def start(gains: Which, sample: Sample) -> Nothing:
        return Nothing(step_in_c(gains.number, 1.0, sample.joint, sample.motor, 0.0, 0.0, 0.0))

    @kernel
    def step(gains: Which, state: Nothing, sample: Sample, reference: Reference, dt: float) -> tuple[Any, float]:
        command = step_in_c(
            gains.number,
            0.0,
            sample.joint,
            sample.motor,
            reference.position,
            reference.velocity,
            reference.acceleration,
        )
        return state, command

    return Law("exported", Which(0.0), start, step, "")


USUAL = ("uncompensated", "observer", "adaptive", "bowden")


@pytest.mark.parametrize("name", [n if n in USUAL else pytest.param(n, marks=pytest.mark.long) for n in LAWS])
def test_rmse_in_float_is_that_in_double(name: str, exported: Law) -> None:
    bench, motion = default_bench(), paper.minimum_jerk()
    double = simulate(bench, LAWS[name], motion, duration=DURATION).metrics().rmse_deg
    law = exported.with_gains(number=float(list(LAWS).index(name)))
    single = simulate(bench, law, motion, duration=DURATION).metrics().rmse_deg
    assert double is not None
    assert single == pytest.approx(double, rel=0.01)
    assert single != double or name == "uncompensated"  # else it would not be float
