"""What is traced means in C what it means in Python, and what leaves the portable subset is refused with its line."""

import itertools
import math
import shutil
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from bowden.control import user_law
from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled, cos, exp, kernel, log, power, sel, sin, tanh
from bowden.export.checked import Argument, Function
from bowden.export.code import Style
from bowden.export.law import law_module
from bowden.export.layout import identifier
from bowden.export.module import Module, files
from bowden.export.readme import FLAGS

pytest.importorskip("casadi", reason="casadi, of the extra export, is not installed")
COMPILER = shutil.which("cc")
EXTREMES = [0.0, -0.0, 5e-324, -2e-310, 0.3, 1.0, -1.0, 2.5, 1e16, -1e308, math.inf, -math.inf, math.nan]


class Found(NamedTuple):
    """One of each operation, and what is easily got wrong."""

    choice: float
    nested: float
    refused: float
    flags: float
    share: float
    difference: float
    product: float
    smaller: float
    larger: float
    signs: float
    rest: float
    signed: float
    minus: float
    libm: float
    powers: float
    order: float
    zero: float
    settled: float


@kernel
def everything(x: float, y: float, exponent: float) -> Found:
    return Found(
        choice=sel(x < y, x, y),
        nested=sel(x == y, 1.0, sel(x != x, -1.0, sel(x >= y, 1.0 / y, np.sqrt(x)))),
        refused=sel((x >= -1.0) * (x <= 1.0), x, -0.0),
        flags=((x > y) + (x < 0.0) > 0.0) * 2.0 - (x > 0.0) * (y > 0.0),
        share=sel((x > 0.0) * x, 3.0, y),
        difference=x - x,
        product=0.0 * x,
        smaller=np.fmin(x, y) + 0.0,  # which zero fmin and fmax give of 0.0 and -0.0 is left open by IEEE 754
        larger=np.fmax(x, y) + 0.0,
        signs=np.sign(x) + 0.0,
        rest=x - np.floor(x),
        signed=np.copysign(y, x),
        minus=0.0 - x,
        libm=tanh(x) + exp(0.1 * y) + sin(0.3 * exponent) + cos(0.3) + log(2.0),
        powers=power(np.abs(x), exponent),
        order=(x + y) + 0.1 - (x - (y - 0.1)) / 3.0 * (x / (y * 3.0)),
        zero=-0.0,
        settled=sel(exponent == 3.0, x, power(y, exponent)),
    )


def bits(values: object) -> list[int]:
    array = np.array(values, dtype=np.float64)
    array[np.isnan(array)] = np.nan
    return array.view(np.int64).tolist()


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_every_operation_gives_the_bits_of_python(tmp_path: Path) -> None:
    arguments = (Argument("x", 0.0), Argument("y", 0.0), Argument("exponent", 3.0, constant=True))
    module = Module("all", "", (Function("step", everything, arguments, ("found",), ""),))
    for name, text in files(module, Style("all"), "").items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    (tmp_path / "main.c").write_text(
        '#include <stdio.h>\n#include "all.h"\n'
        "int main(void) { double row[2]; all_found found; while (fread(row, 8, 2, stdin) == 2) {\n"
        "all_step(row[0], row[1], &found); fwrite(&found, sizeof found, 1, stdout); } return 0; }\n"
    )
    command = [str(COMPILER), *FLAGS.split(), "all.c", "main.c", "-o", "all", "-lm"]
    subprocess.run(command, cwd=tmp_path, check=True)
    pairs = list(itertools.product(EXTREMES, EXTREMES)) + np.random.default_rng(1).normal(0, 2, (500, 2)).tolist()
    done = subprocess.run([tmp_path / "all"], input=np.array(pairs).tobytes(), capture_output=True, check=True)
    rows = np.frombuffer(done.stdout).reshape(len(pairs), -1)
    twin = compiled(everything)
    for (x, y), row in zip(pairs, rows, strict=True):
        with np.errstate(all="ignore"):
            assert bits(row) == bits(everything(np.float64(x), np.float64(y), 3.0)) == bits(twin(x, y, 3.0)), (x, y)


def test_constants_of_libm_and_settled_choices_are_worked_out() -> None:
    arguments = (Argument("x", 0.0), Argument("y", 0.0), Argument("exponent", 3.0, constant=True))
    module = Module("all", "", (Function("step", everything, arguments, ("found",), ""),))
    text = files(module, Style("all"), "")["all.c"]
    assert f"= {math.sin(0.3 * 3.0)!r}; /* sin(0.3 * ALL_EXPONENT) */" in text
    assert "pow(y" not in text
    assert "pow(fabs(x), ALL_EXPONENT)" in text


LAW = '''
import math
import random
import numpy as np
from typing import NamedTuple
from bowden.core.kernel import kernel, sel

class Gains(NamedTuple):
    gain: float = 2.0
    """[1/s]"""

class State(NamedTuple):
    total: float

@kernel
def start(gains, sample):
    return State(0.0)

@kernel
def step(gains, state, sample, reference, dt):
    x = sample.joint - reference.position
    LINE
    return State(state.total + gains.gain * x * dt), x
'''
AT = LAW[: LAW.index("LINE")].count("\n") + 1


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("x = math.tanh(x)", "math"),
        ("x = 1.0 * math.floor(x)", "rounding"),
        ("x = float(x)", "float()"),
        ("x = x if x > 0.0 else 0.0", "use sel(condition, a, b)"),
        ("x = 1.0 * ((x > 0.0) and (x < 1.0))", "and"),
        ("x = (not x) * 1.0", "not"),
        ("x = max(x, 0.0)", "max"),
        ("x = 1.0 * (0.0 < x < 1.0)", "chain of comparisons"),
        ("while x > 1.0: x = x - 1.0", "while"),
        ("x = sum(x for _ in range(int(1.0 + x * x)))", "loop"),
        ("x = 1.0 * np.where(x > 0.0, x, 0.0)", "use sel(condition, a, b)"),
        ("x = np.clip(x, -1.0, 1.0)", "use np.fmax(low, np.fmin(high, x))"),
        ("x = np.round(x)", "np.round"),
        ("x = round(x, 3)", "rounding"),
        ("x = np.isnan(x) * 1.0", "np.isnan"),
        ("x = np.tanh(x)", "use tanh(x) of bowden.core.kernel"),
        ("x = np.maximum(x, 0.0)", "np.maximum"),
        ("x = np.array([x, 1.0]).sum()", "an array"),
        ("x = x ** 2", "power(x, y) of bowden.core.kernel"),
        ("x = x % 1.0", "//"),
        ("x = x * (1, 2)[int(x > 0.0)]", "index"),
        ("x = x * {0.0: 1.0}.get(x, 1.0)", "looking a value up"),
        ("x = x + sample.elbow if False else x.real", "AttributeError"),
    ],
)
def test_what_leaves_the_subset_is_refused_with_its_line(line: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(LAW.replace("LINE", line))
    law = user_law.load(str(path))
    with pytest.raises(ParameterError) as caught:
        files(law_module(law, 1e-3), Style("mine"), "")
    assert f"mine.py, line {AT}: " in str(caught.value)
    assert said in str(caught.value)
    assert "docs/kernels.md" in str(caught.value)


def test_a_law_that_is_not_a_function_of_its_arguments_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(LAW.replace("LINE", "x = x + random.random()"))
    with pytest.raises(ParameterError, match=r"mine\.py, line \d+: step is not the same when it is traced twice"):
        files(law_module(user_law.load(str(path)), 1e-3), Style("mine"), "")


def test_a_refusal_that_the_law_catches_is_a_refusal_still(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(LAW.replace("LINE", "try: x = math.exp(x)\n    except Exception: x = 0.0"))
    with pytest.raises(ParameterError, match=f"mine.py, line {AT}: math"):
        files(law_module(user_law.load(str(path)), 1e-3), Style("mine"), "")


@pytest.mark.parametrize("line", ["x = x if isinstance(x, float) else 0.0", "x = 2.0 * x if type(x) is float else x"])
def test_a_law_that_does_something_else_with_symbols_is_refused(line: str, tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    path.write_text(LAW.replace("LINE", line))
    with pytest.raises(ParameterError, match=r"mine\.py, line \d+: step behaves differently with symbols"):
        files(law_module(user_law.load(str(path)), 1e-3), Style("mine"), "")


def test_whole_gains_may_count_a_loop_and_names_become_those_of_c(tmp_path: Path) -> None:
    path = tmp_path / "mine.py"
    text = LAW.replace("LINE", "x = sum((x for _ in range(gains.default)), 0.0)").replace("total", "β_int")
    path.write_text(text.replace("gain: float = 2.0", "gain: float = 2.0\n    default: int = 3"))
    written = files(law_module(user_law.load(str(path)), 1e-3), Style("mine"), "")
    assert "#define MINE_DEFAULT_ 3" in written["mine.h"]
    assert "    mine_real beta_int;" in written["mine.h"]
    assert identifier("new") == "new_"


def test_without_casadi_the_error_says_what_to_install(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setitem(sys.modules, "casadi", None)
    path = tmp_path / "mine.py"
    path.write_text(LAW.replace("LINE", "pass"))
    with pytest.raises(ParameterError, match=r'pip install "bowden\[export\]"'):
        files(law_module(user_law.load(str(path)), 1e-3), Style("mine"), "")
