"""MATLAB files as logs: vectors of one length, at the top or inside a struct."""

import zlib
from collections.abc import Callable, Collection, Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bowden.core.bounded import read_whole
from bowden.core.errors import LogError
from bowden.identify.log.columns import LogColumn, find_columns
from bowden.identify.log.mat_bytes import content_of
from bowden.identify.log.mat_bytes import vectors as vectors_of

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
    data = read_whole(path, unpack=False)
    try:
        content = content_of(data)
    except (ValueError, zlib.error) as error:
        raise LogError(
            f"{path} cannot be read as a MATLAB file: {error}", do="save it in MATLAB with save(…, '-v7'), or as CSV"
        ) from None
    vectors = dict(vectors_of(content))
    if len(vectors) < len(known) - len(optional):
        for name, value in content.items():
            if isinstance(value, np.ndarray) and value.ndim == 2:
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
