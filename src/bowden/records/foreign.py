"""Recordings in the formats of other programs: MATLAB, HDF5, workbooks of Excel, TDMS of LabVIEW, bags of ROS 2.

A package reads each of them, in a process of its own: some damaged files end the process that reads them, and others
unpack without end, so that its memory is bounded.
"""

import contextlib
import datetime
import io
import os
import subprocess
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.core.bounded import MOST_DATA
from bowden.core.errors import LogError
from bowden.core.extras import extra_module

_MOST_MEMORY = 4 * MOST_DATA
"""Of the process that reads, all that it maps counted [bytes]."""
TEXT = "text"
"""What a workbook's rows are called, as one text in UTF-8."""
_STAMP = "time_s"
"""Times of TDMS channels that have a step, and of messages."""
_DEPTH = 4
"""Levels of a message in which numbers are looked for."""

Columns = dict[str, NDArray[Any]]


def _matlab(path: str) -> Columns:
    """Numbers of a file of version 4 to 7, at the top or inside a struct."""
    from scipy.io import loadmat

    found: dict[tuple[str, ...], NDArray[Any]] = {}
    todo: list[tuple[tuple[str, ...], Any]] = [((), loadmat(path, simplify_cells=True))]
    for within, value in todo:
        if isinstance(value, dict):
            todo += [((*within, name), one) for name, one in value.items()]
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiuc" and value.size > 1:
            found[within] = value + 0.0
    return _named(found)


def _named(found: Mapping[tuple[str, ...], NDArray[Any]]) -> Columns:
    """Columns by their names and those of what they stand in, but for what all stand in."""
    levels = [len(set(level)) == 1 for level in zip(*(within[:-1] for within in found), strict=False)]
    shared = [*levels, False].index(False)
    return {".".join(within[shared:]): values for within, values in found.items()}


def _hdf5(path: str) -> Columns:
    """Sets of numbers; MATLAB writes a matrix by its columns."""
    import h5py

    found: dict[tuple[str, ...], NDArray[Any]] = {}

    def visit(name: str, one: Any) -> None:
        if isinstance(one, h5py.Dataset) and one.dtype.kind in "fiu" and one.size > 1 and not name.startswith("#refs#"):
            found[tuple(name.split("/"))] = one[()].T + 0.0

    with h5py.File(path) as file:
        file.visititems(visit)
    return _named(found)


def _workbook(path: str) -> Columns:
    """The sheet with most rows as text, its cells between tabs."""
    import python_calamine

    sheets = python_calamine.CalamineWorkbook.from_path(path)
    read: list[list[list[Any]]] = [sheets.get_sheet_by_name(name).to_python() for name in sheets.sheet_names]
    rows = max(read, key=len, default=[])
    text = "\n".join("\t".join(map(_cell, row)) for row in rows)
    return {TEXT: np.frombuffer(text.encode(), dtype=np.uint8)}


def _cell(value: Any) -> str:
    if isinstance(value, datetime.datetime | datetime.time):
        return value.isoformat()
    if isinstance(value, datetime.timedelta):
        return repr(value.total_seconds())
    return repr(value) if isinstance(value, float) else " ".join(str(value).split())


def _tdms(path: str) -> Columns:
    """Channels of numbers by their names, with their units; a waveform's step gives the times."""
    import nptdms

    found: Columns = {}
    for group in nptdms.TdmsFile.read(path).groups():
        for channel in group.channels():
            values = channel[:]
            if values.dtype.kind not in "fiuM" or not values.size:
                continue
            unit = str(channel.properties.get("unit_string", ""))
            name = channel.name if channel.name not in found else f"{group.name}/{channel.name}"
            if channel.properties.get("wf_increment") and _STAMP not in found:
                found[_STAMP] = channel.time_track()
            if values.dtype.kind == "M":
                values = values.astype("datetime64[ns]").astype(np.int64) * 1e-9
            found[f"{name} [{unit}]" if unit else name] = values + 0.0
    return found


def _bag(path: str) -> Columns:
    """Numbers of all messages by topic and field; each topic has rows of its own, in which the others are NaN.

    A row's time is its header's stamp, or where there is none when it was received.
    """
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    times: list[int] = []  # ns; those from 1970 are too large for the digits of a float
    found: dict[str, list[tuple[int, float]]] = {}
    with AnyReader([Path(path)], default_typestore=get_typestore(Stores.LATEST)) as reader:
        for connection, received, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            stamp = getattr(getattr(message, "header", None), "stamp", None)
            at = stamp.sec * 10**9 + stamp.nanosec if stamp is not None and stamp.sec else received
            for name, value in _numbers(message, connection.topic, _DEPTH):
                found.setdefault(name, []).append((len(times), value))
            times.append(at)
    order = np.argsort(times, kind="stable")
    row = np.empty(len(times), dtype=np.intp)
    row[order] = np.arange(len(times))
    columns: Columns = {_STAMP: 1e-9 * (np.array(times, dtype=np.int64) - min(times, default=0))[order]}
    for name, values in found.items():
        columns[name] = np.full(len(times), np.nan)
        columns[name][row[[at for at, _ in values]]] = [value for _, value in values]
    return columns


def _numbers(message: Any, name: str, depth: int) -> Iterator[tuple[str, float]]:
    """Fields of a message that are numbers; those of joints (sensor_msgs/JointState) by the joints' names."""
    called = getattr(message, "name", None)
    for key, value in vars(message).items():
        if key in ("header", "name") or key.startswith("__"):
            continue
        at = f"{name}/{key}"
        if isinstance(value, bool | int | float):
            yield at, float(value)
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiu":
            named = called if isinstance(called, list) and len(called) == len(value) else range(len(value))
            yield from ((f"{at}/{one}", float(number)) for one, number in zip(named, value, strict=True))
        elif hasattr(value, "__dict__") and depth:
            yield from _numbers(value, at, depth - 1)


class Format(NamedTuple):
    """A format that a package reads."""

    what: str
    """For messages."""
    read: Callable[[str], Columns]
    module: str
    """That reads it."""
    extra: str
    """That brings the module; empty where it is always there."""
    do: str
    """What helps where it cannot be read."""


FORMATS = {
    "matlab": Format("a MATLAB file", _matlab, "scipy", "", "save it in MATLAB with save(…, '-v7'), or as CSV"),
    "hdf5": Format("HDF5 (MATLAB 7.3)", _hdf5, "h5py", "hdf5", "save it in MATLAB with save(…, '-v7'), or as CSV"),
    "workbook": Format("a workbook of Excel", _workbook, "python_calamine", "xlsx", "save it as CSV"),
    "tdms": Format("TDMS of LabVIEW", _tdms, "nptdms", "tdms", "export it as CSV"),
    "bag": Format("a bag of ROS 2", _bag, "rosbags", "rosbag", "export its topics: ros2 topic echo --csv"),
}
"""By the name that the reading process is called with."""


def read_foreign(path: Path, kind: str) -> Columns:
    """Name → vector or matrix of numbers; of a workbook `TEXT`.

    Args:
        path: of the file; of a bag, of its folder.
        kind: one of `FORMATS`.

    Raises:
        LogError: it cannot be read.
        MissingExtraError: the package that reads it is not installed.
    """
    of = FORMATS[kind]
    if of.extra:
        extra_module(of.module, of.extra, f"reading {path}, {of.what},")
    command = [sys.executable, "-P", "-m", __name__, kind, str(path.absolute())]
    done = subprocess.run(command, capture_output=True, check=False, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"})
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip().rpartition("\n")[2] or "it is damaged"
        raise LogError(f"{path} cannot be read as {of.what}: {said}", do=of.do)
    with np.load(io.BytesIO(done.stdout)) as found:
        return dict(zip(found["names"].tolist(), (found[f"arr_{i}"] for i in range(len(found.files) - 1)), strict=True))


def _main(kind: str, path: str) -> None:
    """Write the numbers of a file to standard output, as NPZ."""
    __import__(FORMATS[kind].module)
    with contextlib.suppress(ImportError):  # Windows has no such bound
        import resource

        resource.setrlimit(resource.RLIMIT_AS, (_MOST_MEMORY, _MOST_MEMORY))
    found = FORMATS[kind].read(path)
    np.savez(sys.stdout.buffer, *found.values(), names=np.array([*found], dtype=str))


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    try:
        _main(*sys.argv[1:])
    except BaseException as error:  # a panic of a package's compiled part is no Exception
        sys.exit(" ".join(str(error).split())[:200] or type(error).__name__)
