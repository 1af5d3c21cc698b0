"""MATLAB files as logs: vectors of one length, at the top or inside a struct.

SciPy reads them, in a process of its own: some damaged files end the process that reads them, and others unpack without
end, so that its memory is bounded.
"""

import io
import os
import resource
import subprocess
import sys
import warnings
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.bounded import MOST_DATA
from bowden.core.errors import LogError
from bowden.identify.log.columns import LogColumn, find_columns

Array = NDArray[np.float64]


def is_matlab(path: Path, head: bytes) -> bool:
    """Whether a file is MATLAB's, by its first bytes or its ending.

    Raises:
        LogError: it is one of version 7.3, which is HDF5 inside.
    """
    if head.startswith(b"MATLAB 7.3") or head.startswith(b"\x89HDF"):
        raise LogError(f"{path} is a MATLAB file of version 7.3 (HDF5)", do="save it in MATLAB with save(…, '-v7')")
    return head.startswith(b"MATLAB 5.0") or path.suffix.lower() == ".mat"


def read_matlab(
    path: Path, given: Mapping[str, str | None], known: Mapping[str, Sequence[str]], optional: Collection[str] = ()
) -> tuple[dict[str, LogColumn], dict[str, Array], Callable[[int], str]]:
    """The columns of a MATLAB file of version 4 to 7; see `find_columns`.

    Raises:
        LogError: not such a file, no such variables, or vectors of different lengths.
    """
    content = _read(path)
    vectors = {name: value for name, value in content.items() if value.ndim == 1}
    if len(vectors) < len(known) - len(optional):
        for name, value in content.items():
            if value.ndim == 2:
                raise LogError(
                    f"{path}: {name!r} is a matrix of {value.shape[0]} × {value.shape[1]}",
                    expected=f"a vector each for {', '.join(known)}",
                    do="save its columns under names of their own",
                )
    if not vectors:
        raise LogError(
            f"{path}: no vector of numbers in it",
            expected=f"vectors for {', '.join(known)}",
            do="save them under those names",
        )
    columns = find_columns(list(vectors), given, str(path), known, optional)
    for column in columns.values():
        if np.iscomplexobj(vectors[column.name]):
            raise LogError(f"{path}: {column.name!r} is complex", expected="real numbers", do="save its real part")
    values = {role: vectors[column.name] for role, column in columns.items()}
    if len({len(vector) for vector in values.values()}) > 1:
        lengths = ", ".join(f"{columns[role].name} has {len(vector)}" for role, vector in values.items())
        raise LogError(
            f"{path}: the vectors differ in length ({lengths})", expected="one length", do="save those of one run"
        )
    return columns, values, lambda sample: f"{path}, sample {sample + 1}"


def _read(path: Path) -> dict[str, NDArray[Any]]:
    """Name → vector or matrix of numbers.

    Raises:
        LogError: it cannot be read.
    """
    command = [sys.executable, "-P", "-m", __name__, str(path.absolute())]
    done = subprocess.run(command, capture_output=True, check=False, env={**os.environ, "OPENBLAS_NUM_THREADS": "1"})
    if done.returncode:
        said = done.stderr.decode(errors="replace").strip().rpartition("\n")[2] or "it is damaged"
        raise LogError(
            f"{path} cannot be read as a MATLAB file: {said}", do="save it in MATLAB with save(…, '-v7'), or as CSV"
        )
    with np.load(io.BytesIO(done.stdout)) as found:
        return {name.removeprefix("_"): found[name] + 0.0 for name in found.files}


def _main(path: str) -> None:
    """Write the numbers of a MATLAB file to standard output, as NPZ."""
    from scipy.io import loadmat

    resource.setrlimit(resource.RLIMIT_AS, (8 * MOST_DATA, 8 * MOST_DATA))
    found: dict[str, NDArray[Any]] = {}
    todo: list[tuple[str, Any]] = list(loadmat(path, simplify_cells=True).items())
    for name, value in todo:
        if isinstance(value, dict):
            todo += value.items()
        elif isinstance(value, np.ndarray) and value.dtype.kind in "fiuc" and value.size > 1:
            found[f"_{name}"] = value  # not to be one of the arguments of `savez`
    np.savez(sys.stdout.buffer, **found)  # type: ignore[arg-type]


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    try:
        _main(sys.argv[1])
    except Exception as error:
        sys.exit(" ".join(str(error).split())[:200])
