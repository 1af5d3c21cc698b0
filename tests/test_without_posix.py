"""Without real time, as Windows and macOS are: what needs none runs without POSIX' own modules.

CI has neither, so that a process stands for one, in which these modules and names are missing.
"""

import subprocess
import sys
from pathlib import Path

import pytest

from bowden import Rig

BLOCKED = """
import importlib.abc, os, select, signal, socket, sys

MISSING = {"fcntl", "termios", "resource", "posix", "pwd", "grp", "tty", "pty", "syslog", "curses", "readline"}

class Windows(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name in MISSING:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

for name in MISSING:
    sys.modules.pop(name, None)
sys.meta_path.insert(0, Windows())
for module, names in (
    (socket, ("AF_UNIX",)),
    (select, ("epoll",)),
    (signal, ("SIGHUP", "SIGKILL", "pthread_sigmask")),
    (os, ("fork", "getuid", "geteuid", "openpty", "mkfifo", "killpg", "sched_getaffinity", "sched_setscheduler")),
):
    for name in names:
        delattr(module, name)
from bowden.app import main
import bowden.design.processes, bowden.study.tune_law

for line in sys.argv[1:]:
    code = main.run(line.split())
    print(f"{code}: {line}", flush=True)
"""


def without_posix(folder: Path, *commands: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-c", BLOCKED, *commands], cwd=folder, capture_output=True, text=True, check=False
    )


@pytest.mark.long
def test_a_cable_is_identified_simulated_checked_and_exported(tmp_path: Path) -> None:
    commands = (
        *("sample cable .", "identify log.csv", "init rig.toml --force"),
        *("simulate rig.toml --law uncompensated --duration 2", "check rig.toml --law uncompensated"),
        "export rig.toml --law uncompensated --to code",
    )
    done = without_posix(tmp_path, *commands)
    assert [line for line in done.stdout.splitlines() if line[1:2] == ":"] == [f"0: {one}" for one in commands], done


@pytest.mark.parametrize("command", ["doctor", "run rig.toml --twin", "twin rig.toml", "measure rig.toml --twin"])
def test_what_needs_real_time_is_refused_in_one_line(command: str, tmp_path: Path) -> None:
    Rig().write(tmp_path / "rig.toml")
    done = without_posix(tmp_path, command)
    assert done.stdout.splitlines()[-1] == f"2: {command}", done
    assert done.stderr.count("\n") == 1
    assert "Linux" in done.stderr
