"""What is kept on disk is found again, never stale, and nobody's folder is required."""

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from bowden.core import kernel as kernel_module
from bowden.core import kernel_cache

SCRIPT = """
from typing import NamedTuple
from bowden.core.kernel import kernel, specialise
from helper import gain

class Gains(NamedTuple):
    factor: float = FACTOR

@kernel
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


def run(folder: Path, factor: float, helper_gain: float) -> tuple[float, int]:
    """Write the user's two files and run them in a process of their own: (result, how often the cache served)."""
    (folder / "mine.py").write_text(SCRIPT.replace("FACTOR", repr(factor)))
    helper = f"from bowden.core.kernel import kernel\n\n@kernel\ndef gain(x):\n    return {helper_gain} * x\n"
    (folder / "helper.py").write_text(helper)
    environment = os.environ | {"BOWDEN_CACHE_DIR": str(folder / "cache")}
    command = [sys.executable, "-B", "-c", "import mine"]  # -B: bytecode is stamped in whole seconds
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=True)
    result, hits = done.stdout.split()
    return float(result), int(hits)


def test_a_second_process_finds_the_compiled_code_and_an_edit_in_either_file_is_noticed(tmp_path: Path) -> None:
    assert run(tmp_path, 2.0, 1.0) == (4.0, 0)
    assert run(tmp_path, 2.0, 1.0) == (4.0, 1)
    assert run(tmp_path, 3.0, 1.0) == (6.0, 0)
    assert run(tmp_path, 3.0, 5.0) == (30.0, 0)  # the helper alone has changed, and by its content only


CONSTANT = """
from bowden.core.kernel import compiled, kernel
from constants import K

@kernel
def times(x):
    return K * x

print(compiled(times)(1.0))
"""


def test_a_number_from_a_further_file_is_part_of_the_code(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(CONSTANT)
    environment = os.environ | {"BOWDEN_CACHE_DIR": str(tmp_path / "cache")}
    found = []
    for number in (2.0, 3.0):
        (tmp_path / "constants.py").write_text(f"K = {number}\n")
        command = [sys.executable, "-B", "-c", "import mine"]
        done = subprocess.run(command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True)
        found.append(float(done.stdout))
    assert found == [2.0, 3.0]


ONE = """
import sys
from typing import NamedTuple
from bowden.core.kernel import compiled
from bowden.sim.faulty import as_it_is

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
    environment = os.environ | {"BOWDEN_CACHE_DIR": str(tmp_path / "cache")}

    def said(module: str, given: str) -> str:
        command = [sys.executable, "-c", f"import {module}", given]
        return subprocess.run(
            command, cwd=tmp_path, env=environment, capture_output=True, text=True, check=True
        ).stdout.strip()

    assert said("mine", "own") == "True 0"
    assert said("mine", "own") == "True 1"
    (tmp_path / "mine.py").unlink()
    assert said("yours", "number") == "True 0"
    assert said("yours", "own") == "True 0"
    assert said("yours", "own") == "True 1"


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


def part(x: float) -> float:
    raise NotImplementedError


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
