"""A law from a user's own file: it runs beside the built-in ones, and what is wrong with it is said in one line."""

import math
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bowden.control import LAWS, user_law
from bowden.control.law_file import load
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.errors import ParameterError
from bowden.core.kernel import compiled
from bowden.core.signals import Reference, Sample
from bowden.core.units import RADIANS
from bowden.plants.presets.bench import default_bench
from bowden.sim.run import simulate

pytestmark = pytest.mark.usefixtures("undrawn")

EXAMPLE = Path(__file__).parents[1] / "examples" / "my_law.py"
SOURCE = EXAMPLE.read_text()
RETURN = "return State(integral), command"


def test_the_example_law_follows_better_than_no_compensation() -> None:
    law = load(str(EXAMPLE))
    assert law.name == "my_law"
    motion = PeriodicMinimumJerk(0.0, 70.0 * RADIANS, 4.0)
    own, none = (simulate(default_bench(), one, motion, duration=8.0) for one in (law, LAWS["uncompensated"]))
    assert own.stable
    assert np.sqrt(np.mean(own.error**2)) < 0.2 * np.sqrt(np.mean(none.error**2))
    assert own["law.integral"][-1] != 0.0


@pytest.mark.parametrize(
    ("at", "holds"),
    [
        ("return State(0.0)", "sample.joint > -9.0"),
        (RETURN, "reference.position > -9.0"),
        (RETURN, "reference.position > 1.0"),  # the law's first cycles are below
    ],
)
def test_a_law_that_never_returns_is_refused_with_its_name_and_line(at: str, holds: str, tmp_path: Path) -> None:
    loop = f"ahead = 0.0\n    while {holds}:\n        ahead = ahead + 1.0\n    "
    (tmp_path / "law.py").write_text(SOURCE.replace(at, loop + at))
    trace = sys.gettrace()
    with pytest.raises(ParameterError, match=r"law\.py:\d+: the law 'law' does not return from one cycle"):
        load("law.py", tmp_path)
    assert sys.gettrace() is trace


WITH_BRANCHES = """
import math
from enum import IntEnum
from typing import NamedTuple
from bowden import Reference, Sample, kernel

class Phase(IntEnum):
    REST = 0
    MOVING = 1

class Gains(NamedTuple):
    slope: float = 1.0

class State(NamedTuple):
    phase: Phase
    lost: bool

@kernel
def start(gains: Gains, sample: Sample) -> State:
    return State(Phase.REST, False)

@kernel
def step(gains: Gains, state: State, sample: Sample, reference: Reference, dt: float) -> tuple[State, float]:
    if math.isnan(sample.joint):
        return State(state.phase, True), sample.motor
    phase = Phase.MOVING if 1e-3 < abs(reference.velocity) else Phase.REST
    return State(phase, state.lost and phase == Phase.REST), reference.position / gains.slope
"""


def test_a_law_may_branch_and_remember_a_flag_and_a_phase(tmp_path: Path) -> None:
    (tmp_path / "law.py").write_text(WITH_BRANCHES)
    law = load("law.py", tmp_path)
    fast, state = compiled(law.step_kernel), law.start(Sample(0.0, 0.0))
    cycles = ((math.nan, 1.0, ((0, True), 0.5)), (0.0, 0.0, ((0, True), 1.0)), (0.0, 1.0, ((1, False), 1.0)))
    for joint, velocity, expected in cycles:
        given = (law.gains, state, Sample(joint, 0.5), Reference(1.0, velocity, 0.0), 1e-3)
        assert fast(*given) == law.step_kernel(*given) == expected
        state = fast(*given)[0]


def test_an_edited_law_is_not_met_by_its_old_code(tmp_path: Path) -> None:
    """Same file, same name, same length and the same second: only the content tells."""
    path = tmp_path / "law.py"
    motion = PeriodicMinimumJerk(0.0, 1.0, 1.0)
    for sign in ("+", "-"):
        path.write_text(SOURCE.replace("command = reference", f"command = {sign}1.0 + reference"))
        trace = simulate(default_bench(), load(str(path)), motion, duration=0.1)
        assert np.sign(trace["command"][0]) == float(f"{sign}1")


def test_a_law_object_is_found_by_its_name_or_alone(tmp_path: Path) -> None:
    source = "from bowden.control import LAWS\nSOFT = LAWS['adaptive'].with_gains(feedback_gain=5.0)\n"
    (tmp_path / "one.py").write_text(source)
    (tmp_path / "two.py").write_text(source + "HARD = LAWS['adaptive'].with_gains(feedback_gain=30.0)\n")
    for name, gain in (("one.py", 5.0), ("one.py:SOFT", 5.0), ("two.py:HARD", 30.0)):
        assert load(name, tmp_path).gains.feedback_gain == gain
    with pytest.raises(ParameterError, match=r"several of type Law: SOFT, HARD; .*say which: two.py:NAME"):
        load("two.py", tmp_path)
    with pytest.raises(ParameterError, match="has no 'WEAK'; expected one of SOFT, HARD"):
        load("two.py:WEAK", tmp_path)
    with pytest.raises(ParameterError, match=r"LAWS in .*two\.py is a Laws; expected a Law"):
        load("two.py:LAWS", tmp_path)


def line_of(source: str, part: str) -> int:
    return source[: source.index(part)].count("\n") + 1


@pytest.mark.parametrize(
    ("old", "new", "at", "said"),
    [
        ("return State(0.0)", "return State(0.0", "return State(0.0", "was never closed"),
        ("return State(0.0)", "return State(0)", "@kernel\ndef start", "integral in the state from start is 0 (int)"),
        ("return State(0.0)", "return 0.0", "@kernel\ndef start", "the state from start is a float; expected a NamedT"),
        ("return State(0.0)", "return State(False)", "@kernel\ndef step", "(float); expected a bool, as from start"),
        (RETURN, "return command", "@kernel\ndef step", "step returns"),
        (
            RETURN,
            "return (integral,), command",
            "@kernel\ndef step",
            "the state from step is a tuple; expected a State",
        ),
        (RETURN, f"{RETURN} * float('nan')", "@kernel\ndef step", "the command is nan; expected a finite number"),
        (RETURN, "return State(float('inf')), command", "@kernel\ndef step", "integral in the state from step is inf"),
        ("@kernel\ndef step", "def step", "def step", "not a kernel; put @kernel"),
        ("ahead = 0.5", "ahead = gains.nothing", "ahead = gains.nothing", "AttributeError: 'Gains' object has no"),
        ("gains.blend)", "0.0)", "ahead = 0.5", "ZeroDivisionError"),
        ("from typing", "import nothing_of_that_name\nfrom typing", "import nothing", "ModuleNotFoundError"),
    ],
)
def test_what_is_wrong_is_said_with_file_and_line(tmp_path: Path, old: str, new: str, at: str, said: str) -> None:
    source = SOURCE.replace(old, new)
    assert source != SOURCE
    path = tmp_path / "law.py"
    path.write_text(source)
    with pytest.raises(ParameterError) as caught:
        load(str(path))
    assert said in str(caught.value)
    assert f"{path}, line {line_of(source, at)}:" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("source", "said"),
    [
        ("", "no Law and no Gains, start, step"),
        (SOURCE.replace("def step", "def move"), "no Law and no step"),
        (
            SOURCE.replace("slope: float = 0.938", "slope: float")
            .replace("= 0.09", "")
            .replace("= 0.02", "")
            .replace("= 5.0", ""),
            "TypeError",
        ),
        (SOURCE.replace("= 0.938", "= 'much'"), "slope in gains is 'much' (str); expected a float"),
    ],
)
def test_what_is_missing_is_said(tmp_path: Path, source: str, said: str) -> None:
    (tmp_path / "law.py").write_text(source)
    with pytest.raises(ParameterError, match=r"law\.py") as caught:
        load("law.py", tmp_path)
    assert said in str(caught.value)


def test_a_law_of_python_is_tried_and_named_by_the_file_of_its_step() -> None:
    law = LAWS["uncompensated"]
    user_law.check_law(law)
    with pytest.raises(ParameterError, match=r"uncompensated\.py: the law's name is 'a b'; expected letters"):
        user_law.check_law(replace(law, name="a b"))


def test_a_file_that_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match="no such file"):
        load("nothing.py:LAW", tmp_path)


@pytest.mark.parametrize(
    ("old", "new", "at", "said"),
    [
        ("ahead = 0.5", "ahead = helper(0.5)", "ahead = helper", "Untyped global name 'helper'"),
        ("ahead = 0.5", "ahead = len(str([1, '', {}])) * 0.0 + 0.5", "ahead = len", "the law 'law' cannot be compiled"),
    ],
)
def test_what_does_not_compile_is_said_with_file_and_line(
    tmp_path: Path, old: str, new: str, at: str, said: str
) -> None:
    helper = "def helper(x: float) -> float:\n    return x\n\n\n@kernel\ndef start"
    source = SOURCE.replace("@kernel\ndef start", helper).replace(old, new)
    path = tmp_path / "law.py"
    path.write_text(source)
    law = load(str(path))
    with pytest.raises(ParameterError) as caught, user_law.explained(law):
        simulate(default_bench(), law, PeriodicMinimumJerk(0.0, 1.0, 1.0), duration=0.1)
    assert said in str(caught.value)
    assert f"{path}, line {line_of(source, at)}:" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_failures_that_are_not_the_compilers_pass_through() -> None:
    with pytest.raises(ZeroDivisionError), user_law.explained(LAWS["adaptive"]):
        raise ZeroDivisionError


def test_names_of_laws_and_of_files_are_told_apart() -> None:
    assert [user_law.is_file(name) for name in ("adaptive", "law.py", "a/law.py:MINE", "C:\\a\\law.py:MINE")] == [
        False,
        True,
        True,
        True,
    ]
