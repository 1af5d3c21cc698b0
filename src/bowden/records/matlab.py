"""Numbers in MATLAB files of version 4 to 7, at the top or inside a struct.

SciPy reads them, in a process of its own: some damaged files end the process that reads them, and others unpack without
end, so that its memory is bounded.
"""

import io
import os
import resource
import subprocess
import sys
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.core.bounded import MOST_DATA
from bowden.core.errors import LogError

_MOST_MEMORY = 4 * MOST_DATA
"""Of the process that reads, all that it maps counted [bytes]."""


def read_matlab(path: Path) -> dict[str, NDArray[Any]]:
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

    resource.setrlimit(resource.RLIMIT_AS, (_MOST_MEMORY, _MOST_MEMORY))
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
