"""Packages that only some of the work needs, and how to install them."""

import importlib
from typing import Any

from bowden.core.errors import MissingExtraError


def extra_module(name: str, extra: str, what: str) -> Any:
    """A module of a package that comes with one of bowden's extras.

    Args:
        name: of the module, as ``pyarrow.parquet``.
        extra: which brings it, as ``parquet``.
        what: needs it, for the message.

    Raises:
        MissingExtraError: it cannot be imported.

    >>> extra_module("no_such_module", "parquet", "a campaign")
    Traceback (most recent call last):
    ...
    bowden.core.errors.MissingExtraError: a campaign needs the package no_such_module, which is not installed; \
pip install "bowden[parquet]"
    """
    package = name.partition(".")[0]
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if (error.name or "").partition(".")[0] != package:
            why = f"which cannot be imported ({error})"
        else:
            why = "which is not installed"
    except ImportError as error:
        why = f"which cannot be imported ({' '.join(str(error).split())[:120]})"
    raise MissingExtraError(f"{what} needs the package {package}, {why}", do=f'pip install "bowden[{extra}]"')
