"""MATLAB files as logs: vectors of one length, at the top or inside a struct."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

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
    path: Path, given: Mapping[str, str | None], known: Mapping[str, Sequence[str]]
) -> tuple[dict[str, LogColumn], dict[str, Array], Callable[[int], str]]:
    """The columns of a MATLAB file of version 4 to 7; see `find_columns`.

    Raises:
        LogError: not such a file, no such variables, or vectors of different lengths.
    """
    from scipy.io import loadmat

    try:
        content: dict[str, Any] = loadmat(path, squeeze_me=True, struct_as_record=True)
    except OSError:
        raise
    except Exception as error:  # SciPy raises whatever its parser stumbles over
        raise LogError(
            f"{path} cannot be read as a MATLAB file: {error}", do="save it in MATLAB with save(…, '-v7'), or as CSV"
        ) from error
    vectors = dict(_vectors(content))
    if len(vectors) < len(known):
        for name, value in content.items():
            if isinstance(value, np.ndarray) and value.ndim == 2 and value.dtype.kind in "fiuc":
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
    columns = find_columns(list(vectors), given, str(path), known)
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


def _vectors(content: Mapping[str, Any]) -> Iterator[tuple[str, NDArray[Any]]]:
    """Name → vector, for every vector of numbers at the top or one struct down."""
    for name, value in content.items():
        if name.startswith("__") or not isinstance(value, np.ndarray | np.void):
            continue
        fields = value.dtype.names
        if fields:
            yield from _vectors({field: _unpacked(value[field]) for field in fields})
        elif value.ndim == 1 and value.dtype.kind in "fiuc" and value.size > 1:
            yield name, np.asarray(value, dtype=np.complex128 if value.dtype.kind == "c" else np.float64)


def _unpacked(value: Any) -> Any:
    """What MATLAB wrapped in an array of one object."""
    return value.item() if isinstance(value, np.ndarray) and value.dtype == object and value.size == 1 else value
