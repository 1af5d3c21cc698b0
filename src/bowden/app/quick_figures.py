"""matplotlib for a command, imported without what no command needs.

These are the lists of properties that it writes into its docstrings, a third of its import, and a table of glyphs for
TeX, an eighth. Who uses bowden from Python finds the docstrings whole. A version of matplotlib without the private
names that are set aside here is imported as it is.
"""

import importlib
import importlib.util
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
    _when_used("fontTools", "agl")
    with (
        _instead(artist, "kwdoc", lambda artist: ""),
        _instead(artist.Artist, signed, classmethod(lambda artist: None)),
    ):
        importlib.import_module("matplotlib.figure")


def _when_used(package: str, name: str) -> None:
    """Import a package's module as soon as something of it is used; nothing where there is no such module.

    An import of it is no use, as it is for Python's own `importlib.util.LazyLoader`.
    """
    whole = f"{package}.{name}"
    spec = importlib.util.find_spec(whole) if importlib.util.find_spec(package) else None
    loader = spec.loader if spec else None
    if whole in sys.modules or spec is None or loader is None:
        return
    module: Any = importlib.util.module_from_spec(spec)

    def found(attribute: str) -> Any:
        if attribute.startswith("__"):
            raise AttributeError(attribute)
        del module.__getattr__
        loader.exec_module(module)
        return getattr(module, attribute)

    module.__getattr__ = found
    sys.modules[whole] = module
    setattr(sys.modules[package], name, module)


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
