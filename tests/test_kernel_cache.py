"""What is kept on disk is found again, never stale, and nobody's folder is required."""

import os
import subprocess
import sys
import textwrap
from pathlib import Path
from types import FunctionType

import pytest

from bowden.app import main
from bowden.control import LAWS
from bowden.core import kernel as kernel_module
from bowden.core import kernel_cache
from bowden.core.kernel_content import content_of

SCRIPT = """
from typing import NamedTuple
from bowden.core.kernel import kernel, specialise, placeholder
from helper import gain

class Gains(NamedTuple):
    factor: float = FACTOR

@placeholder
def part(gains, x):
    raise NotImplementedError

@kernel
def own(gains, x):
    return gains.factor * gain(x)

@kernel
def template(gains, x):
    return part(gains, x)

twin = specialise(template, "any", part=own)
print(twin(Gains(), 2.0), sum(twin.stats.cache_hits.values()))
"""


def write(folder: Path, factor: float, helper_gain: float, further: float) -> None:
    """The user's three files, each of which calls a kernel of the next."""
    head = "from bowden.core.kernel import kernel\n"
    (folder / "mine.py").write_text(SCRIPT.replace("FACTOR", repr(factor)))
    (folder / "helper.py").write_text(
        f"{head}from further import base\n\n@kernel\ndef gain(x):\n    return {helper_gain} * base(x)\n"
    )
    (folder / "further.py").write_text(f"{head}\nK = {further}\n\n@kernel\ndef base(x):\n    return K * x\n")


def run(folder: Path, *numbers: float) -> tuple[float, int]:
    """Write the files and run them in a process of their own: (result, how often the cache served)."""
    write(folder, *numbers)
    result, hits = said(folder, "import mine").split()  # bytecode is stamped in whole seconds, so none is written
    return float(result), int(hits)


def test_a_second_process_finds_the_compiled_code_and_an_edit_in_any_file_is_noticed(tmp_path: Path) -> None:
    assert run(tmp_path, 2.0, 1.0, 1.0) == (4.0, 0)
    assert run(tmp_path, 2.0, 1.0, 1.0) == (4.0, 1)
    assert run(tmp_path, 3.0, 1.0, 1.0) == (6.0, 0)
    assert run(tmp_path, 3.0, 5.0, 1.0) == (30.0, 0)  # the helper alone has changed, and by its content only
    assert run(tmp_path, 3.0, 5.0, 7.0) == (210.0, 0)  # a global two files away


def test_two_processes_at_once_get_what_is_right_and_leave_what_a_third_can_use(tmp_path: Path) -> None:
    write(tmp_path, 2.0, 1.0, 1.0)
    environment = os.environ | {"BOWDEN_CACHE_DIR": str(tmp_path / "cache")}
    command = [sys.executable, "-B", "-c", "import mine"]
    both = [
        subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.PIPE, text=True) for _ in range(2)
    ]
    assert [one.communicate()[0].split()[0] for one in both] == ["4.0", "4.0"]
    assert run(tmp_path, 2.0, 1.0, 1.0) == (4.0, 1)


CONSTANT = """
import constants
from constants import ALL, ARRAY, K
from bowden.core.kernel import compiled, kernel

@kernel
def imported(x):
    return K * x

@kernel
def of_a_module(x):
    return constants.K * x

@kernel
def of_a_tuple(x):
    return ALL.k * x

@kernel
def of_an_array(x):
    return ARRAY[1] * x

print(*(compiled(one)(1.0) for one in (imported, of_a_module, of_a_tuple, of_an_array)))
"""


def test_a_number_from_a_further_file_is_part_of_the_code(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(CONSTANT)
    found = []
    for number in (2.0, 3.0):
        made = f"class All(NamedTuple):\n    k: float\n\nALL = All({number})\nARRAY = np.array([0.0, {number}])\n"
        (tmp_path / "constants.py").write_text(
            f"from typing import NamedTuple\nimport numpy as np\n\nK = {number}\n\n{made}"
        )
        found.append(said(tmp_path, "import mine").split())
    assert found == [["2.0"] * 4, ["3.0"] * 4]


def said(folder: Path, program: str, *arguments: str) -> str:
    """What a program prints in a process of its own, with a cache of its own."""
    environment = os.environ | {"BOWDEN_CACHE_DIR": str(folder / "cache")}
    command = [sys.executable, "-B", "-c", program, *arguments]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=True).stdout


def test_what_was_loaded_counts_and_not_what_the_file_has_become(tmp_path: Path) -> None:
    """An edit between a file's import and its first call: the old code runs, and is not kept as the new one's."""
    text = "from bowden.core.kernel import compiled, kernel\n\n@kernel\ndef f(x):\n    return {} * x\n"
    edited, call = text.format("3.0"), "print(mine.compiled(mine.f)(1.0))"
    (tmp_path / "mine.py").write_text(text.format("2.0"))
    assert said(tmp_path, f"import mine; open('mine.py', 'w').write({edited!r}); {call}") == "2.0\n"
    assert said(tmp_path, f"import mine; {call}") == "3.0\n"


def test_a_file_that_was_torn_is_compiled_anew(tmp_path: Path) -> None:
    program = "from bowden.sim import injected; from bowden.core.kernel import compiled; "
    program += "f = compiled(injected.as_it_is); print(f(0.0, 5.0, 0.0, 0), sum(f.stats.cache_hits.values()))"
    assert said(tmp_path, program) == "5.0 0\n"
    (kept,) = (tmp_path / "cache").rglob("as_it_is*.kernel")
    kept.write_bytes(kept.read_bytes()[:1000])
    assert said(tmp_path, program) == "5.0 0\n"
    assert said(tmp_path, program) == "5.0 1\n"


def test_where_a_function_stands_is_not_what_it_is() -> None:
    def made(lines: int, by: float):  # type: ignore[no-untyped-def]  # a function made of text has no type
        namespace: dict[str, object] = {"__name__": "made"}
        exec(compile("\n" * lines + f"def f(x):\n    return {by} * x", "made.py", "exec"), namespace)
        return namespace["f"]

    assert content_of(made(0, 2.0)) == content_of(made(7, 2.0)) != content_of(made(0, 3.0))


WATCH = """
import importlib.abc, importlib.util, os, sys

class Watch(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name != "numba.core.event":
            return None
        sys.meta_path.remove(self)
        spec = importlib.util.find_spec(name)
        load = spec.loader.exec_module
        def loaded(module):
            load(module)
            class Count(module.Listener):
                def on_start(self, event):
                    with open(os.environ["COMPILED"], "a") as file:
                        file.write(event.data["dispatcher"].py_func.__qualname__ + "\\n")
                def on_end(self, event):
                    pass
            module.register("numba:compile", Count())
        spec.loader.exec_module = loaded
        return spec

sys.meta_path.insert(0, Watch())
"""
"""Put at the start of every process, those of workers and of a live run too: writes down whatever Numba compiles."""


def compiled_by(folder: Path, *commands: list[str], fine: tuple[int, ...] = (0,)) -> list[str]:
    """What the second of two goes through some commands compiles, each in a process of its own.

    ``{round}`` in a command is the number of the round.
    """
    (folder / "sitecustomize.py").write_text(WATCH)
    found = folder / "compiled.txt"
    path = os.pathsep.join([str(folder), *filter(None, [os.environ.get("PYTHONPATH")])])
    environment = os.environ | {"PYTHONPATH": path, "COMPILED": str(found)}
    for number in range(2):
        found.write_text("")
        for command in commands:
            words = [word.format(round=number) for word in command]
            line = [sys.executable, "-c", "from bowden.app.main import main; main()", *words]
            done = subprocess.run(line, cwd=folder, env=environment, capture_output=True, text=True, check=False)
            assert done.returncode in fine, done.stdout + done.stderr
    return sorted(set(found.read_text().splitlines()))


SOME_OR_ALL = pytest.mark.parametrize("laws", [["uncompensated", "adaptive"], [*LAWS]], ids=len)


@pytest.mark.long
@SOME_OR_ALL
def test_the_second_call_compiles_nothing_whatever_the_law(tmp_path: Path, laws: list[str]) -> None:
    """The first may: it fills what the tests keep. So a kernel that cannot be kept, or not whole, is found."""
    assert main.run(["init", str(tmp_path / "rig.toml")]) == 0
    chosen = [f"--law={law}" for law in laws]
    checks = [["check", "rig.toml", "--law", law] for law in laws]
    assert compiled_by(tmp_path, *checks, fine=(0, 1, 2)) == []
    columns = ["--motor", "motor", "--joint", "joint", "--unit", "rad"]
    commands = [
        ["simulate", "rig.toml", *chosen, "--duration=12", "--csv", "--force"],
        ["identify", "out/simulate/uncompensated.csv", *columns],
    ]
    assert compiled_by(tmp_path, *commands) == []


@pytest.mark.long
@SOME_OR_ALL
def test_a_second_campaign_compiles_nothing_whatever_the_law(tmp_path: Path, laws: list[str]) -> None:
    quoted = ", ".join(f'"{law}"' for law in laws)
    study = f'laws = [{quoted}]\nruns = 4\nduration_s = 0.5\n[vary]\n"cable.slope" = {{ uniform = [0.8, 1.0] }}\n'
    (tmp_path / "study.toml").write_text(study)
    campaign = ["campaign", "study.toml", "--workers", "2", "--out", "campaign-{round}"]
    assert compiled_by(tmp_path, campaign) == []


@pytest.mark.long
@pytest.mark.parametrize("law", ["adaptive", "cascaded_pid"])
def test_a_second_tuning_compiles_nothing(tmp_path: Path, law: str) -> None:
    assert main.run(["init", str(tmp_path / "rig.toml")]) == 0
    rig = (tmp_path / "rig.toml").read_text()
    (tmp_path / "rig.toml").write_text(rig.replace('law = "adaptive"', f'law = "{law}"'))
    assert compiled_by(tmp_path, ["tune", "rig.toml", "--dry-run"]) == []


@pytest.mark.long
@pytest.mark.live
def test_a_second_run_compiles_nothing(tmp_path: Path) -> None:
    """None of its processes; that a machine is late, and the supervisor stops the run, is another matter."""
    assert main.run(["init", str(tmp_path / "rig.toml")]) == 0
    runs = [["run", "rig.toml", "--law", law, "--twin", "--auto", "--duration", "1"] for law in LAWS]
    assert compiled_by(tmp_path, *runs, fine=(0, 1, 2, 3)) == []


ONE = """
import sys
from typing import NamedTuple
from bowden.core.kernel import compiled
from bowden.sim.injected import as_it_is

class Mine(NamedTuple):
    value: float

class Other(NamedTuple):
    own: Mine

look = compiled(as_it_is)  # the package's; gives back its second argument, whatever it is
given = Other(Mine(1.0)) if sys.argv[1] == "own" else 1.0
print(look(0.0, given, 0.0, 0) == given, sum(look.stats.cache_hits.values()))
"""


def test_what_is_kept_for_a_type_of_one_file_can_be_read_by_who_does_not_know_it(tmp_path: Path) -> None:
    """A package's kernel that is given a user's type is found again by that file, and by others without it."""
    (tmp_path / "mine.py").write_text(ONE)
    (tmp_path / "yours.py").write_text(ONE.replace("Mine", "Yours"))
    assert said(tmp_path, "import mine", "own") == "True 0\n"
    assert said(tmp_path, "import mine", "own") == "True 1\n"
    (tmp_path / "mine.py").unlink()
    assert said(tmp_path, "import yours", "number") == "True 0\n"
    assert said(tmp_path, "import yours", "own") == "True 0\n"
    assert said(tmp_path, "import yours", "own") == "True 1\n"


def test_functions_made_by_functions_are_told_apart() -> None:
    @kernel_module.kernel
    def template(x: float) -> float:
        return part(x)

    def scale(by: float):  # type: ignore[no-untyped-def]  # a decorated closure has no nameable type
        @kernel_module.kernel
        def scaled(x: float) -> float:
            return by * x

        return scaled

    twins = [kernel_module.specialise(template, "same", part=scale(by)) for by in (2.0, 3.0)]
    assert [twin(1.0) for twin in twins] == [2.0, 3.0]


@kernel_module.placeholder
def part(x: float) -> float:
    raise NotImplementedError


@pytest.mark.parametrize(("module", "kept"), [("__main__", False), (__name__, True)])
def test_what_raises_an_exception_of_the_main_script_is_not_kept(module: str, kept: bool) -> None:
    """Numba keeps such a class as a whole: what is raised by kept code is of another one, which nobody catches."""
    raised = type("OwnError", (Exception,), {"__module__": module})
    around = {**globals(), "OwnError": raised}
    assert (content_of(FunctionType(raises_its_own.__code__, around, "raises_its_own")) is not None) is kept


@kernel_module.kernel
def raises_its_own(x: float) -> float:
    if x > 0.0:
        raise OwnError
    return x


OwnError = RuntimeError


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="ownership of folders is a matter of POSIX")
def test_a_home_that_cannot_be_written_is_replaced_by_a_private_temporary_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    blocked = tmp_path / "file"
    blocked.write_text("")
    monkeypatch.setenv("BOWDEN_CACHE_DIR", str(blocked))
    monkeypatch.setattr(kernel_cache.tempfile, "gettempdir", lambda: str(tmp_path))
    folder = kernel_cache.cache_folder.__wrapped__()
    assert folder.parent == tmp_path / f"bowden-{os.getuid()}"
    assert folder.is_dir()
    assert folder.parent.stat().st_mode & 0o077 == 0

    folder.parent.chmod(0o777)  # somebody else could have put code there: do not run it
    monkeypatch.setattr(kernel_cache.tempfile, "mkdtemp", lambda prefix: str(tmp_path))
    assert kernel_cache.cache_folder.__wrapped__().parent == tmp_path


def test_only_kernels_compile() -> None:
    with pytest.raises(TypeError, match="decorate it with @kernel"):
        kernel_module.compiled(textwrap.dedent)


LAW = """
import bowden
print("runs")
with open("ran.txt", "a") as file:
    file.write("x")
from typing import NamedTuple
class Gains(NamedTuple):
    slope: float = 1.0
class State(NamedTuple):
    x: float
@bowden.kernel
def start(gains, sample):
    return State(0.0)
@bowden.kernel
def step(gains, state, sample, reference, dt):
    return State(state.x + dt), reference.position / (gains.slope + ADDED)
law = bowden.Law("m", Gains(), start, step, source="me")
trace = bowden.simulate(bowden.Rig(law=law, duration=1.0))
print(round(float(trace["command"][500] / trace["reference"][500]), 6))
"""


ONE_STEP = """
from bowden.core.kernel import compiled
from bowden.core.signals import Reference, Sample
state = compiled(start)(Gains(), Sample(0.0, 0.0))
print(compiled(step)(Gains(), state, Sample(0.0, 0.0), Reference(1.0, 0.0, 0.0), 1e-3)[1])
"""


def test_scripts_that_define_a_law_of_the_same_names_do_not_meet_and_run_once(tmp_path: Path) -> None:
    """Numba keeps a copy of a type of the main script's: of another script's, or an edited cell's, it is not one."""
    answers = []
    for name, added in (("one.py", "0.0"), ("two.py", "1.0")):
        (tmp_path / name).write_text(LAW.replace("ADDED", added))
        command = [sys.executable, str(tmp_path / name)]
        done = subprocess.run(
            command, cwd=tmp_path, env=os.environ | {"BOWDEN_CACHE_DIR": str(tmp_path)}, capture_output=True, text=True
        )
        assert done.returncode == 0, done.stderr
        answers.append(done.stdout)
    assert answers == ["runs\n1.0\n", "runs\n0.5\n"]
    assert (tmp_path / "ran.txt").read_text() == "xx"


def test_a_cell_that_is_edited_and_run_again_compiles(tmp_path: Path) -> None:
    cell = LAW.partition("law = ")[0] + ONE_STEP
    cells = "\n".join(f"exec({cell.replace('ADDED', added)!r})" for added in ("0.0", "1.0", "0.0"))
    done = [
        subprocess.run(
            [sys.executable, "-c", cells],
            cwd=tmp_path,
            env=os.environ | {"BOWDEN_CACHE_DIR": str(tmp_path)},
            capture_output=True,
            text=True,
        )
        for _ in range(2)
    ]
    assert [one.stdout for one in done] == ["runs\n1.0\nruns\n0.5\nruns\n1.0\n"] * 2, done[0].stderr
