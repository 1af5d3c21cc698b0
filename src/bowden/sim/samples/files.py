"""What a sample is made of: files of text, each with one line about it."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray


class SampleFile(NamedTuple):
    """One file of a sample."""

    text: str
    about: str
    """One line for the user."""


def csv_text(columns: Mapping[str, tuple[NDArray[np.float64], int]]) -> str:
    """A table of columns (n,), each with its number of decimals, under their names.

    >>> print(csv_text({"time_s": (np.array([0.0, 0.5]), 1), "motor": (np.array([3.0, 4.0]), 0)}), end="")
    time_s,motor
    0.0,3
    0.5,4
    """
    form = ",".join(f"%.{decimals}f" for _, decimals in columns.values())
    rows = (form % row for row in zip(*(values.tolist() for values, _ in columns.values()), strict=True))
    return "\n".join([",".join(columns), *rows]) + "\n"
