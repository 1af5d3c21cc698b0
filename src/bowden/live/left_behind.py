"""What a run leaves when its operator's process is killed, and that whoever of it ends last, or the next run, removes.

Everything that a run makes outside its output folder is named after its operator's process: blocks of shared memory,
and the folder of the bus that a run with a twin of its own has. A number alone names no process: another one may have
it later, and containers that share this memory have it at the same time. So the name has the process' namespace and
beginning as well, and of another namespace nothing is removed: whether its processes live cannot be seen from here.
"""

import contextlib
import os
import re
import shutil
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

from bowden.core.clock import SECOND, MonotonicClock, TimeSource
from bowden.core.errors import DriveError
from bowden.live.ring import FOLDER

TWIN = "bowden-twin"
"""Begins the name of such a bus' folder, in the place for temporary files."""
_ENDED = ("Z", "X")
"""States of a process that has ended (proc_pid_stat)."""
_KINDS = (".ring", ".block", ".intent")
_BLOCK = re.compile(r"/bowden-(\d+)-(\w+)-\w+\.block\b")
"""The control block of a run, in the list of what a process has mapped; its loop maps it, and its operator."""
ENDS = 10.0
"""A loop without its operator has let go of its drive after this: of a bring-up the rest, or a release [s]."""
_LOOK = 0.05
"""Between two looks whether it has [s]."""


def name_of_this() -> str:
    """A name that nothing else has, and that says whose it is."""
    return f"bowden-{_owner(os.getpid())}-{os.urandom(3).hex()}"


@contextlib.contextmanager
def bus_of_this() -> Iterator[Path]:
    """A folder for a bus, until the end of the block."""
    with tempfile.TemporaryDirectory(prefix=f"{TWIN}-{_owner(os.getpid())}-") as folder:
        yield Path(folder)


def sweep() -> None:
    """Remove what runs left whose operator is gone. A process that still has a block open keeps it; a bus on which
    somebody lives is left alone.
    """
    for path in FOLDER.glob("bowden-*-*-*.*"):
        if path.suffix in _KINDS and _gone(*path.name.split("-")[1:3]):
            with contextlib.suppress(OSError):
                path.unlink()
    for bus in Path(tempfile.gettempdir()).glob(f"{TWIN}-*-*-*"):
        nodes = (node.name.split("-")[0] for node in bus.rglob("*.node"))
        if _gone(*bus.name.split("-")[2:4]) and not any(Path(f"/proc/{node}").exists() for node in nodes):
            shutil.rmtree(bus, ignore_errors=True)


MAPS = "[0-9]*/maps"
"""Of the processes that may be a loop without its operator, below /proc."""


def await_host(
    claim: Callable[[], Callable[[], None]], tell: Callable[[str], None], clock: TimeSource | None = None
) -> None:
    """See that nobody is host of a drive's bus; the loop of a run whose operator was killed is waited for.

    Args:
        claim: claims the host's part, and gives what lets go of it.
        tell: called with what is waited for.
        clock: to go by, in place of this computer's.

    Raises:
        DriveError: another run has it, or that loop still has it after `ENDS`.
    """
    clock, told = clock or MonotonicClock(), False
    until, loops = clock.now() + round(ENDS * SECOND), [*Path("/proc").glob(MAPS)]
    while True:
        try:
            claim()()
            return
        except DriveError as error:
            again = told and bool(loops)  # the last of them may have ended just now
            loops = [maps for maps in loops if _is_loop_without_operator(maps)]
            if clock.now() >= until or not (loops or again):
                raise
            if not told:
                tell(f"{error.what}: waiting up to {ENDS:g} s for the loop of a run whose operator was killed to end")
        told = True
        clock.sleep_until(clock.now() + round(_LOOK * SECOND))


def _is_loop_without_operator(maps: Path) -> bool:
    """True if a process has the block of a run whose operator is gone, by its maps; the file may have been removed."""
    with contextlib.suppress(OSError):  # it has ended, or is another user's
        return any(_gone(*owner) for owner in _BLOCK.findall(maps.read_text(errors="replace")))
    return False


def _owner(number: int | str) -> str:
    """A process of this namespace: its number, and namespace and beginning.

    Raises:
        OSError: it is there no more, or has ended and waits for its parent to ask how.
    """
    said = Path(f"/proc/{number}/stat").read_text(encoding="ascii", errors="replace").rpartition(")")[2].split()
    if said[0] in _ENDED:
        raise ProcessLookupError(f"process {number} has ended")
    return f"{number}-{_namespace()}t{said[19]}"


def _namespace() -> int:
    return os.stat("/proc/self/ns/pid").st_ino


def _gone(number: str, which: str) -> bool:
    """True if a process of that number, namespace and beginning was one of this namespace, and is there no more."""
    if not number.isdigit() or which.partition("t")[0] != str(_namespace()):
        return False
    try:
        return _owner(number) != f"{number}-{which}"
    except OSError:
        return True
