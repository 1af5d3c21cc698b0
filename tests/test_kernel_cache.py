"""What is kept on disk is found again, never stale, and nobody's folder is required."""

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import pytest

from bowden.core import kernel as kernel_module

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
    monkeypatch.setattr(kernel_module.tempfile, "gettempdir", lambda: str(tmp_path))
    folder = kernel_module.cache_folder.__wrapped__()
    assert folder.parent == tmp_path / f"bowden-{os.getuid()}"
    assert folder.is_dir()
    assert folder.parent.stat().st_mode & 0o077 == 0

    folder.parent.chmod(0o777)  # somebody else could have put code there: do not run it
    monkeypatch.setattr(kernel_module.tempfile, "mkdtemp", lambda prefix: str(tmp_path))
    assert kernel_module.cache_folder.__wrapped__().parent == tmp_path


def test_only_kernels_compile() -> None:
    with pytest.raises(TypeError, match="decorate it with @kernel"):
        kernel_module.compiled(textwrap.dedent)
