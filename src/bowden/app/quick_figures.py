"""matplotlib for a command, imported without the lists of properties that it writes into its docstrings.

They take a third of its import, and a command's user reads none of them. Who uses bowden from Python finds them whole.
A version of matplotlib without the private names that are set aside here is imported as it is.
"""

import importlib
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any


def import_figures() -> None:
    """Import `matplotlib.figure`; nothing where that has been done."""
    if "matplotlib.figure" in sys.modules:
        return
    artist: Any = importlib.import_module("matplotlib.artist")
    signed = "_update_set_signature_and_docstring"
    with (
        _instead(artist, "kwdoc", lambda artist: ""),
        _instead(artist.Artist, signed, classmethod(lambda artist: None)),
    ):
        importlib.import_module("matplotlib.figure")


@contextmanager
def _instead(owner: Any, name: str, value: Any) -> Iterator[None]:
    """Put a value in the place of an attribute for a while, where there is such a one."""
    if name not in vars(owner):
        yield
        return
    kept = vars(owner)[name]
    setattr(owner, name, value)
    try:
        yield
    finally:
        setattr(owner, name, kept)
