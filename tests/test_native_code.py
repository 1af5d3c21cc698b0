"""Kernels that are called without Numba: the same bits, the same errors, and Numba where there is no other way."""

import hashlib
import importlib
import subprocess
import sys
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pytest

from bowden.app import main
from bowden.control import LAWS
from bowden.core import kernel as kernel_module
from bowden.core import kernel_cache, native_code
from bowden.core.kernel import compiled, kernel, program, specialise, stand_in, tanh


class Inner(NamedTuple):
    a: float
    b: int


class Outer(NamedTuple):
    first: Inner
    second: tuple[float, float]
    flag: bool


@kernel
def mixed(given: Outer, rows: Any, strided: Any, scale: float, count: int, out: Any) -> float:
    """Takes something of every kind."""
    total = given.first.a * given.first.b + given.second[1]
    for i in range(rows.shape[0]):
        for j in range(rows.shape[1]):
            total += tanh(rows[i, j] * scale) * strided[j]
        out[i] = total if given.flag else -total
    return total / count


@kernel
def curved(x: float) -> float:
    return np.sin(x)


@kernel
def around(x: float) -> float:
    return np.sin(x) * np.cos(x)


@kernel
def counted(values: Any) -> int:
    return values.size


@kernel
def longer(values: Any) -> Any:
    return np.concatenate((values, values))


@kernel
def pair(x: float) -> Any:
    return x, 2.0 * x


@kernel
def refuses(x: float) -> float:
    if x < 0.0:
        raise ValueError("no root of this")
    return np.sqrt(x)


@kernel
def refuses_with(x: float) -> float:
    if x < 0.0:
        raise ValueError(x)
    return np.sqrt(x)


class NamedError(Exception):
    def __init__(self, what: str) -> None:
        super().__init__(what)


@kernel
def refuses_nothing(x: float) -> float:
    if x < 0.0:
        raise NamedError
    return np.sqrt(x)


@stand_in
def part(x: float) -> float:
    raise NotImplementedError


@kernel
def whole(x: float) -> float:
    return part(x) + 1.0


@kernel
def halved(x: float) -> float:
    return 0.5 * x


@pytest.fixture
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder for compiled code, and no program that this process knows already."""
    kernel_module._program.cache_clear()
    monkeypatch.setattr(kernel_cache, "cache_folder", lambda: tmp_path)
    return tmp_path


GIVEN = Outer(Inner(1.25, -3), (0.5, np.float64(0.1)), True)


@pytest.mark.parametrize("given", [GIVEN, GIVEN._replace(flag=False), GIVEN._replace(flag=np.bool_(True))])
def test_a_program_gives_the_bits_that_numba_gives(cache: Path, given: Outer) -> None:
    rng = np.random.default_rng(1)
    for rows in (
        rng.normal(size=(40, 7)),
        np.asfortranarray(rng.normal(size=(40, 7))),
        rng.normal(size=(80, 14))[::2, ::2],
    ):
        strided = rng.normal(size=21)[::3]
        one, other = np.empty(40), np.empty(40)
        found = program(mixed)(given, rows, strided, 0.7, 3, one)
        assert found == compiled(mixed)(given, rows, strided, 0.7, 3, other)
        np.testing.assert_array_equal(one, other)
    assert len(list(cache.glob("mixed*.program"))) == 3  # a layout of memory each


def test_stand_ins_are_replaced(cache: Path) -> None:
    assert program(whole, "halved", part=halved)(3.0) == specialise(whole, "halved", part=halved)(3.0) == 2.5


def test_what_is_kept_is_called_and_a_torn_file_is_compiled_anew(cache: Path) -> None:
    values = np.zeros(5)
    native = native_code.flattened((values,))
    assert native is not None
    assert program(counted)(values) == 5
    (kept,) = cache.glob("counted*.program")
    again = native_code.loaded(kept.read_bytes())
    assert again is not None
    assert again(native[2]) == 5
    for torn in (kept.read_bytes()[:-100], b"", b"x" * 200):
        assert native_code.loaded(torn) is None


@pytest.mark.parametrize("system", ["x86_64-unknown-linux-gnu", "aarch64-linux-gnu", "arm64-apple-darwin"])
def test_what_machine_code_calls_is_read_from_it(system: str) -> None:
    """An instruction and an intrinsic that become calls, and what is defined in it."""
    llvm: Any = importlib.import_module("llvmlite.binding")
    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    module = llvm.parse_assembly(
        """declare double @sin(double)
        declare double @llvm.powi.f64.i32(double, i32)
        define double @own(double %x, i32 %n) {
          %a = frem double %x, 3.0
          %b = call double @sin(double %a)
          %c = call double @llvm.powi.f64.i32(double %b, i32 %n)
          ret double %c
        }"""
    )
    target = llvm.Target.from_triple(system)
    module.triple = system
    code = target.create_target_machine(codemodel="jitdefault", jit=True).emit_object(module)
    assert native_code.called_by(code) == {"sin", "fmod", "__powidf2"}
    assert native_code.called_by(b"MZ" + code) is None


def test_code_that_calls_what_is_not_there_is_not_called(cache: Path) -> None:
    """LLVM would end the process."""
    assert program(curved)(0.5) == compiled(curved)(0.5)
    (kept,) = cache.glob("curved*.program")
    content = kept.read_bytes()
    whole = content[native_code._DIGEST :]
    assert b"\0sin\0" in whole
    changed = whole.replace(b"\0sin\0", b"\0nis\0")
    assert native_code.loaded(content) is not None
    assert native_code.loaded(hashlib.sha256(changed).digest() + changed) is None


@pytest.mark.parametrize(
    ("function", "arguments"), [(longer, (np.arange(3.0),)), (pair, (1.5,)), (refuses_with, (4.0,))]
)
def test_what_cannot_be_called_without_numba_is_called_with_it(
    cache: Path, monkeypatch: pytest.MonkeyPatch, function: Any, arguments: tuple[Any, ...]
) -> None:
    """One that asks for memory, one that gives back more than a number, one that makes its error as it runs."""
    np.testing.assert_array_equal(program(function)(*arguments), compiled(function)(*arguments))
    (kept,) = cache.glob("*.program")
    assert native_code.loaded(kept.read_bytes()) is None
    again = kernel_cache.Program("again", "", bare=lambda: pytest.fail("compiled"), whole=lambda: compiled(function))
    monkeypatch.setattr(again, "_path", lambda kinds: kept)
    np.testing.assert_array_equal(again(*arguments), compiled(function)(*arguments))


def test_sine_and_cosine_of_one_angle_become_one_call_and_need_no_numba(cache: Path) -> None:
    assert program(around)(0.3) == compiled(around)(0.3)
    (kept,) = cache.glob("*.program")
    assert native_code.loaded(kept.read_bytes()) is not None


def test_an_argument_that_only_numba_knows_goes_through_it(cache: Path) -> None:
    assert program(halved)(np.float32(3.0)) == 1.5
    assert not list(cache.glob("*.program"))


def test_what_a_kernel_raises_is_raised_with_its_file_and_line(cache: Path) -> None:
    import traceback

    assert program(refuses)(4.0) == 2.0
    with pytest.raises(ValueError, match="no root of this") as caught:
        program(refuses)(-4.0)
    last = traceback.extract_tb(caught.value.__traceback__)[-1]
    assert (Path(last.filename).name, last.name) == (Path(__file__).name, "refuses")
    assert "no root of this" in (Path(last.filename).read_text().splitlines()[(last.lineno or 0) - 1])
    with pytest.raises(TypeError, match="missing 1 required") as other:  # what Python says of it
        program(refuses_nothing)(-4.0)
    last = traceback.extract_tb(other.value.__traceback__)[-1]
    assert (Path(last.filename).name, last.name) == (Path(__file__).name, "refuses_nothing")
    assert list(cache.glob("refuses*.program"))


WITHOUT = """
import sys
from bowden.app.main import run

laws = sys.argv[1:]
for law in laws:
    assert run(["check", "rig.toml", "--law", law]) in (0, 1, 2), law
assert run(["simulate", "rig.toml", *(f"--law={law}" for law in laws), "--duration=12", "--force"]) == 0
print("numba" in sys.modules)
"""


@pytest.mark.parametrize(
    "laws", [["uncompensated", "adaptive"], pytest.param([*LAWS], marks=pytest.mark.long)], ids=len
)
def test_a_warm_check_and_simulation_do_without_numba_whatever_the_law(tmp_path: Path, laws: list[str]) -> None:
    """The first call may need it: it fills what the tests keep."""
    assert main.run(["init", str(tmp_path / "rig.toml")]) == 0
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", WITHOUT, *laws], cwd=tmp_path, capture_output=True, text=True, check=False
        )
        assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.splitlines()[-1] == "False"
