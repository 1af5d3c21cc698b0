"""What a kernel's source means in Python it means in C, under the same names; what C is not made of is refused."""

import ast
import importlib.util
import inspect
import itertools
import math
import re
import shutil
import subprocess
import sys
import textwrap
from enum import IntEnum
from pathlib import Path
from typing import Annotated, NamedTuple

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.control.law import Law
from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled, cos, exp, floor, kernel, log, power, sin, sqrt, tanh
from bowden.core.nested import flat
from bowden.core.quantity import Quantity, texts_of
from bowden.export.files import files
from bowden.export.modules import begun, emg_modules, law_module, safety_module
from bowden.export.source import origin
from bowden.export.unit import Module, identifier
from bowden.safety.limits import Limits
from bowden.sensing.envelope import PLAIN_THRESHOLD
from support.exported_c import COMPILER, Exported, bits

EXTREMES = [0.0, -0.0, 5e-324, -2e-310, 0.3, 1.0, -1.0, 2.5, 1e16, -1e308, math.inf, -math.inf, math.nan]

LARGEST = 2.0
"""A bound [rad]."""


class Mode(IntEnum):
    OFF = 0
    ON = 1
    LOST = 5


class Pair(NamedTuple):
    first: Annotated[float, Quantity("the first of them", "rad")]
    second: float = LARGEST


class Memory(NamedTuple):
    past: tuple[float, ...]
    pair: Pair
    mode: Mode
    seen: bool
    faults: int
    total: float


FAULTS = 1 << 40 | 1


@kernel
def sorted_pair(pair: Pair) -> tuple[Pair, bool]:
    """The smaller one first."""
    if pair.second < pair.first:
        return Pair(pair.second, pair.first), True
    return pair, False


@kernel
def share(x: float, of: float = LARGEST) -> float:
    return 0.0 if of == 0.0 else x / of


@kernel
def next_mode(mode: Mode, x: float) -> Mode:
    if math.isnan(x):
        return Mode.LOST
    if mode == Mode.LOST and not -1.0 <= x <= 1.0:
        return mode
    return Mode.ON if x > 0.0 else Mode.OFF


@kernel
def everything(count: int, state: Memory, x: float, y: float) -> tuple[Memory, float]:
    """One of each thing that kernels are made of."""
    pair, swapped = sorted_pair(Pair(first=x, second=y))
    least, most = min(x, y, LARGEST), max(x, PLAIN_THRESHOLD)
    mode = next_mode(state.mode, x)
    total, last = 0.0, state.total
    total, last = last * 0.5, 0.0
    # a comment of its own
    for i in range(count):
        if i == 0:
            left_behind = 0.25 * y
        total += left_behind
        if i == 1:
            total += state.past[i] * i
        else:
            total = total - share(state.past[i + 1])
    if mode == Mode.LOST or not math.isfinite(total):
        total, seen = 0.0, False
    elif swapped and (x > y or state.seen):
        kept = x + y
        seen = kept != 0.0 and not state.seen
    else:
        kept = x - y
        seen = kept != 0.0
    faults = state.faults | FAULTS if seen else state.faults & ~1
    faults = faults ^ (1 << mode.value)
    order = (x + y) + 0.1 - (x - (y - 0.1)) / 3.0 * (x / (y * 3.0) if y != 0.0 else -x)
    libm = tanh(x) + exp(0.1 * y) + sin(0.3) + cos(0.3 * x) + log(abs(x)) + sqrt(y) + floor(x) + power(abs(y), 1.7)
    signed = math.copysign(y, x) + float(mode.value) + seen - (-x) * +y
    past = (x,) + state.past[:-1]  # noqa: RUF005 - Numba takes no star in a tuple
    after = Memory(past, pair, mode, seen, faults, total)
    return after, least + most + last if faults & FAULTS == FAULTS and total > -1e9 else order + libm - signed


EVERYTHING = everything, Memory((0.0,) * 4, Pair(0.0), Mode.OFF, False, 0, 0.0)


def module_of_everything() -> Module:
    step, state = EVERYTHING
    functions = {"start": (begun, "state"), "step": (step, "state return")}
    return Module("all", "", functions, {"count": (3, ""), "begin": (state, "")}, state)


def test_a_constant_s_text_is_that_of_the_file_that_names_it_first(tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text("from bowden.models.drive.servo import LONGEST_CYCLE as LONGEST, Servo\n")
    file, text = origin(str(tmp_path / "own.py"), "LONGEST")
    assert (Path(file).name, text[:8]) == ("servo.py", "ω·Ts up ")


def test_what_a_name_is_stands_below_it_or_behind_it() -> None:
    source = 'a = 1.0  # one [m]\nb: float = 2.0\n"""Two\n[s]."""\nc = d = 3.0\n4.0\n'
    assert texts_of(ast.parse(source).body, source) == {"a": "one [m]", "b": "Two [s].", "c": "", "d": ""}


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_every_statement_and_operation_gives_the_bits_of_python(tmp_path: Path) -> None:
    step, state = EVERYTHING
    pairs = list(itertools.product(EXTREMES, EXTREMES)) + np.random.default_rng(1).normal(0, 2, (500, 2)).tolist()
    rows = np.column_stack([np.arange(len(pairs)) == 0, pairs])
    found = Exported(module_of_everything(), "step", "all_start(&state)", tmp_path).over(rows)
    twin, other = compiled(step), state
    for (x, y), row in zip(pairs, found, strict=True):
        with np.errstate(all="ignore"):
            state, value = step(3, state, x, y)
        other, same = twin(3, other, x, y)
        assert (bits([*flat(state), value]) == bits(row)).all(), (x, y)
        assert (bits([*flat(other), same]) == bits(row)).all(), (x, y)


def locals_of(function: str) -> set[str]:
    """The names that a function of C declares: its arguments, and what it declares within."""
    code = re.sub(r"/\*.*?\*/|\[[^]]*\]", "", function, flags=re.DOTALL)
    kinds = r"(?:const )?(?:double|float|bool|int|int64_t|\w+_result|[a-z]\w*_[A-Z]\w*|\w*row\d+) \*?"
    return set(re.findall(rf"(?:^|[(\s,]){kinds}(\w+)(?= =|;|,|\)|\n)", code))


def functions_of(text: str) -> dict[tuple[str, str], str]:
    """Module of Python and name → text, of all functions that have a kernel."""
    pattern = r"^/\* ([\w.]+)(?::(?:(?!\*/).)*)? \*/\nstatic inline \w+ (\w+)\((.*?)^}"
    found = re.finditer(pattern, text, re.DOTALL | re.MULTILINE)
    return {(one[1], one[2]): f"({one[3]}" for one in found}


def modules() -> list[Module]:
    laws = [law_module(law, 1e-3) for law in LAWS.values()]
    return [*laws, *emg_modules(2000.0), safety_module(Limits()), module_of_everything()]


@pytest.mark.parametrize("module", modules(), ids=lambda module: module.prefix)
def test_every_function_and_every_local_of_the_c_has_its_name_in_python(module: Module) -> None:
    """What several values are unpacked from is called by all their names."""
    text = files(module, "")[f"{module.prefix}.c"]
    functions = functions_of(text)
    assert len(functions) == text.count("\nstatic inline ") - len(
        re.findall(r"static inline \w+ (?:\w*min|\w*max|np_sign|\w+_shifted|\w+_int)_?\(", text)
    )
    seen = 0
    for (where, name), body in functions.items():
        there = {identifier(key): value for key, value in vars(sys.modules[where]).items()}
        bare = name.rstrip("_")
        called = (name, bare, bare.removeprefix(f"{where.rpartition('.')[2]}_"))
        kernel_ = next(there[one] for one in called if one in there)
        tree = ast.parse(textwrap.dedent(inspect.getsource(kernel_)))
        names = {identifier(one.id) for one in ast.walk(tree) if isinstance(one, ast.Name)}
        names |= {identifier(one.arg) for one in ast.walk(tree) if isinstance(one, ast.arg)}
        tuples = [one for one in ast.walk(tree) if isinstance(one, ast.Tuple) and isinstance(one.ctx, ast.Store)]
        names |= {"_".join(identifier(part.id) for part in one.elts if isinstance(part, ast.Name)) for one in tuples}
        assert locals_of(body) <= names, name
        seen += len(locals_of(body))
    assert seen > 2 * len(functions) - 3


def test_constants_comments_and_units_go_along() -> None:
    written = files(module_of_everything(), "")
    assert "static const double LARGEST = 2.0; /* A bound [rad]. */" in written["all.c"]
    assert "PLAIN_THRESHOLD = 0.2; /* Share of the MVC's envelope" in written["all.c"]
    assert "/* a comment of its own */" in written["all.c"]
    assert "    double first; /* the first of them [rad] */" in written["all.h"]
    assert "    ALL_MODE_LOST = 5" in written["all.h"]
    assert f"/* {__name__}: The smaller one first. */\nstatic inline sorted_pair_result" in written["all.c"]
    assert "const double least = min(min(x, y), LARGEST);" in written["all.c"]
    single = files(module_of_everything(), "", single=True)
    assert "expf(0.1f * y)" in single["all.c"]
    assert "tanhf(x)" in single["all.c"]


LAW = '''
import math
import random
import numpy as np
from enum import IntEnum
from typing import NamedTuple
from bowden.core.kernel import kernel, tanh

class Mode(IntEnum):
    ON = 1

class Gains(NamedTuple):
    gain: float = 2.0
    """[1/s]"""

class State(NamedTuple):
    total: float

def plain(x):
    return x

@kernel
def again(x: float) -> float:
    return again(x)

@kernel
def open_end(x: float) -> float:
    if x > 0.0:
        return x

@kernel
def start(gains, sample):
    return State(0.0)

@kernel
def step(gains, state, sample, reference, dt):
    x = sample.joint - reference.position
    LINE
    return State(state.total + gains.gain * x * dt), x
'''


def law_of(text: str, folder: Path) -> Law:
    """The law of a file, which nobody has tried."""
    (folder / "mine.py").write_text(text)
    spec = importlib.util.spec_from_file_location("mine", folder / "mine.py")
    assert spec is not None
    assert spec.loader is not None
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return Law("mine", made.Gains(), made.start, made.step, "a test")


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("while x > 1.0: x = x - 1.0", "for i in range(n)"),
        ("try: x = 1.0 / x\n    except ZeroDivisionError: x = 0.0", "test with an if before"),
        ("assert x > 0.0", "take it out"),
        ("raise ValueError", "no exceptions"),
        ("x = [x, 1.0][0]", "use a NamedTuple"),
        ("x = sum([x for _ in range(3)])", "add the terms up"),
        ("x = {0: x}[0]", "use a NamedTuple"),
        ("name = 'x'", "use numbers"),
        ("name = f'{x}'", "texts"),
        ("x = np.where(x > 0.0, x, 0.0)", "use a if condition else b"),
        ("x = np.clip(x, -1.0, 1.0)", "np.clip()"),
        ("x = math.tanh(x)", "import tanh from bowden.core.kernel"),
        ("x = math.floor(x)", "import floor from bowden.core.kernel"),
        ("x = round(x, 3)", "round()"),
        ("x = x + random.random()", "random.random()"),
        ("x = plain(x)", "mark plain with @kernel"),
        ("x = again(x)", "again calls itself"),
        ("x = open_end(x)", "add a return at its end"),
        ("x = x ** 2", "power(a, b)"),
        ("x = x % 1.0", "floor(a/b)"),
        ("x = x // 1.0", "floor(a/b)"),
        ("x = 1.0 if x is None else x", "None"),
        ("for i in range(int(x)): x = x + 1.0", "which gives a float"),
        ("for y in state: x = x + y", "for i in range(n)"),
        ("for i in range(3):\n        if x > i: break", "use an if within the loop"),
        ("for i in range(3): pass\n    x = x + i", "read before it is set"),
        ("i = 1\n    for i in range(3): x = x + i", "give it another name"),
        ("x, state.total = dt, x", "keep to the subset"),
        ("state.total += x", "keep to the subset"),
        ("x = State(*state).total", "one by one"),
        ("if x: x = 1.0", "x != 0.0"),
        ("x = True", "first float and then bool"),
        ("x = Mode.ON if x > 0.0 else state", "Mode and State"),
        ("x = 1.0 if state else x", "compare numbers"),
        ("x = x if x and dt else 0.0", "x != 0.0"),
        ("x = sample.elbow", "joint, motor"),
        ("x = unknown(x)", "which is not defined"),
        ("x = y", "which is not defined"),
        ("state = state._replace(total=x)", "call its class with all fields"),
        ("state = State(x)", "give it another name"),
        ("state = State(total=x, other=x)", "correct the call"),
        ("x, dt = dt, x", "lines of their own"),
        ("x = tanh(state)", "expected float"),
        ("x = lambda: x", "write a kernel"),
        ("def inner(): return x", "a kernel of its own"),
        ("x = isinstance(x, float)", "isinstance"),
    ],
)
def test_what_leaves_the_subset_is_refused_with_its_line(line: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(ParameterError) as caught:
        files(law_module(law_of(LAW.replace("LINE", line), tmp_path), 1e-3), "")
    assert re.search(r"mine\.py, line \d+: ", str(caught.value))
    assert said in str(caught.value)


ADVICE = [
    ("x = power(x, 2.0)", "from bowden.core.kernel import power"),
    ("x = x - 1.0 * floor(x / 1.0)", "from bowden.core.kernel import floor"),
    ("x = 1.0 if x > 0.0 else 0.0", ""),
    ("for i in range(3): x = x + 1.0", ""),
    ("x = 1.0 / x if x != 0.0 else 0.0", ""),
]


@pytest.mark.parametrize(("line", "needs"), ADVICE)
def test_what_a_refusal_advises_is_taken(line: str, needs: str, tmp_path: Path) -> None:
    law = law_of(f"{needs}\n{LAW.replace('LINE', line)}", tmp_path)
    assert "mine_step(" in files(law_module(law, 1e-3), "")["mine.h"]


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_names_become_those_of_c_and_whole_gains_count_a_loop(tmp_path: Path) -> None:
    line = "for i in range(gains.default): x = x + conditioning"
    text = LAW.replace("LINE", line).replace("total", "β_int").replace("def plain", "conditioning = 0.5\n\ndef plain")
    law = law_of(text.replace("gain: float = 2.0", "gain: float = 2.0\n    default: int = 3"), tmp_path)
    written = files(law_module(law, 1e-3), "")
    assert ".default_ = 3," in written["mine.c"]
    assert "for (int i = 0; i < gains->default_; ++i) {" in written["mine.c"]
    assert "    double beta_int;" in written["mine.h"]
    assert "static const double MINE_CONDITIONING = 0.5;" in written["mine.c"]
    assert "&conditioning, state," in written["mine.c"]
    for name, content in written.items():
        (tmp_path / name).write_text(content)
    subprocess.run(["cc", "-std=c99", "-Wall", "-Wextra", "-Werror", "-c", "mine.c"], cwd=tmp_path, check=True)
