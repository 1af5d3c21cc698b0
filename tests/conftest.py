"""What the tests share."""

import contextlib
import gc
import os
import signal
import sys
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings

pytest.register_assert_rewrite("live_runs", "loop_rig")

os.environ.pop("SSH_CONNECTION", None)  # over ssh no real drive is moved
os.environ["COLUMNS"] = "120"  # what is shown is folded to the width of the terminal
os.environ["LSLAPICFG"] = str(Path(__file__).parent / "lsl_api.cfg")  # liblsl reads it once, when it is first used
settings.register_profile("bowden", deadline=None, derandomize=True)  # compilation is slow, and a run repeats another
settings.load_profile("bowden")

gc.set_threshold(100_000, 20, 20)  # as the command has it; a tenth of a compilation would be searches for garbage

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # a shell starts what runs in its background deaf to interruptions, and every child of it too
    signal.signal(signal.SIGINT, signal.default_int_handler)


def pytest_addoption(parser: pytest.Parser) -> None:
    """Pictures of the console for docs/console.md."""
    parser.addoption("--pictures", default="", help="folder for the pictures that tests/browser makes")


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """The folder of recordings that lies beside the project, where it is there."""
    folder = Path(__file__).parents[2] / "shared" / "data"
    if not folder.is_dir():
        pytest.skip("the recordings in ../shared/data are not here")
    return folder


@pytest.fixture(autouse=True)
def little_listening(monkeypatch: pytest.MonkeyPatch) -> None:
    """A bring-up within the tests' process listens for other masters for an instant; a rig's does for a second."""
    for family in ("ak", "canopen", "moteus", "odrive", "servo"):
        module = f"bowden.hardware.drives.{family}_drive"
        if module in sys.modules or "support.memory_bus" in sys.modules:
            monkeypatch.setattr(f"{module}.LISTENING", 0.03)


@pytest.fixture(scope="session")
def lsl() -> Any:
    """The library of LSL, where it loads and streams are found on this machine."""
    from bowden.core.errors import StreamError
    from bowden.hardware.emg.lsl_info import library
    from bowden.hardware.emg.lsl_outlet import LslOutlet

    name = f"probe-{os.getpid()}"
    try:
        found = library()
        outlet = LslOutlet(name, 1000.0, ["a"], "mV", name)
    except StreamError as error:
        pytest.skip(str(error))
    there = found.resolve_byprop("name", name, 1, 5.0)
    outlet.close()
    return found if there else pytest.skip("LSL finds no stream on this machine: no multicast, no unicast on 127.0.0.1")


@pytest.fixture
def small_search(monkeypatch: pytest.MonkeyPatch) -> None:
    """`tune` in one process and of a quarter of its size, where it matters that it searches and not what it finds."""
    monkeypatch.setattr("bowden.study.tune_law.two_workers", lambda *_, **__: contextlib.nullcontext(map))
    monkeypatch.setattr("bowden.design.tune._DRAWS", 100)
    monkeypatch.setattr("bowden.design.tune._SIMULATED", 20)
    monkeypatch.setattr("bowden.design.tune._MEMBERS", 8)


@pytest.fixture
def undrawn(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages with an empty element for each figure, whose drawing takes longest of all; not for tests marked `drawn`."""
    if request.node.get_closest_marker("drawn") is None:
        monkeypatch.setattr("bowden.drawing.style.svg", lambda figure, prefix: "<svg></svg>")


@pytest.fixture
def command(capsys: pytest.CaptureFixture[str]) -> Any:
    """Runs command lines in this process, see `support.command.Command`."""
    from support.command import Command

    return Command(capsys)


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder, which is the current one."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The folder in which commands keep what they know of a motor; the test's own, and not the user's."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state"
