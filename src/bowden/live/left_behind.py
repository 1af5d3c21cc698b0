"""What a run leaves when its operator's process is killed, and that whoever of it ends last, or the next run, removes.

Everything that a run makes outside its output folder is named after its operator's process: blocks of shared memory,
and the folder of the bus that a run with a twin of its own has.
"""

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from bowden.live.ring import FOLDER

TWIN = "bowden-twin"
"""Begins the name of such a bus' folder, in the place for temporary files."""
_KINDS = (".ring", ".block", ".intent")


def name_of_this() -> str:
    """A name that nothing else has, and that says whose it is."""
    return f"bowden-{os.getpid()}-{os.urandom(3).hex()}"


@contextlib.contextmanager
def bus_of_this() -> Iterator[Path]:
    """A folder for a bus, until the end of the block."""
    with tempfile.TemporaryDirectory(prefix=f"{TWIN}-{os.getpid()}-") as folder:
        yield Path(folder)


def sweep() -> None:
    """Remove what runs left whose operator is gone. A process that still has a block open keeps it; a bus on which
    somebody lives is left alone.
    """
    for path in FOLDER.glob("bowden-*-*.*"):
        if path.suffix in _KINDS and _gone(path.name.split("-")[1]):
            with contextlib.suppress(OSError):
                path.unlink()
    for bus in Path(tempfile.gettempdir()).glob(f"{TWIN}-*-*"):
        if _gone(bus.name.split("-")[2]) and all(_gone(node.name.split("-")[0]) for node in bus.glob("*.node")):
            shutil.rmtree(bus, ignore_errors=True)


def _gone(number: str) -> bool:
    """Whether a process of that number is there no more."""
    return number.isdigit() and not Path(f"/proc/{number}").exists()
