"""`read_trace`: the record of a run, from whatever file bowden keeps it in."""

from pathlib import Path

from bowden.core import arguments
from bowden.core.bounded import open_file, reason
from bowden.core.errors import LogError
from bowden.records.trace import Trace

_MCAP = b"\x89MCAP0\r\n"


def read_trace(path: str | Path) -> Trace:
    """Read a trace: what ``bowden simulate`` and `Trace.write` wrote, or the MCAP log of a live run.

    If a log is cut short or damaged, the readable part is read, and nothing is guessed.

    Args:
        path: of the file; its contents decide how it is read, not the end of its name.

    Raises:
        LogError: no such file, or not a file of bowden.

    >>> import pathlib, tempfile
    >>> import numpy as np
    >>> file = pathlib.Path(tempfile.mkdtemp()) / "run.csv"
    >>> Trace({"time": np.arange(3.0)}, {"time": "s"}).write(file)
    >>> read_trace(file).time
    array([0., 1., 2.])
    """
    file = arguments.path_of(path, "read_trace: path")
    try:
        with open_file(file) as opened:
            head = opened.read(len(_MCAP))
    except OSError as error:
        raise LogError(f"cannot read {file}: {reason(error)}", expected="a trace or log of bowden") from None
    if head == _MCAP:
        from bowden.live.mcap_read import read

        return read(file).trace()
    return Trace.read(file)
