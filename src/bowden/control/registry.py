"""The laws by their names: each is a file of `bowden.control.laws` that ends with its `LAW`."""

import pkgutil
from collections.abc import Iterator, Mapping
from functools import cached_property
from importlib import import_module

from bowden.control.law import Law
from bowden.core.errors import UnknownNameError, near

_FOLDER = "bowden.control.laws"


class Laws(Mapping[str, Law]):
    """Name → law with its own gains. A law's file is imported when the law is asked for.

    >>> LAWS["uncompensated"].name
    'uncompensated'
    >>> LAWS["adaptiv"]
    Traceback (most recent call last):
    ...
    bowden.core.errors.UnknownNameError: there is no law 'adaptiv'; expected adaptive (did you mean this?), ...
    """

    @cached_property
    def _names(self) -> tuple[str, ...]:
        return tuple(sorted(module.name for module in pkgutil.iter_modules(import_module(_FOLDER).__path__)))

    def __getitem__(self, name: str) -> Law:
        """The law of that name.

        Raises:
            UnknownNameError: there is none, a `ParameterError` and a `KeyError`.
        """
        if name not in self._names:
            do = "or name a file: my_law.py:NAME"
            raise UnknownNameError(f"there is no law {name!r}", expected=near(str(name), self), do=do)
        law: Law = import_module(f"{_FOLDER}.{name}").LAW
        return law

    def __iter__(self) -> Iterator[str]:
        """Names in alphabetical order."""
        return iter(self._names)

    def __len__(self) -> int:
        """How many there are."""
        return len(self._names)

    def __repr__(self) -> str:
        """The names."""
        return f"LAWS({', '.join(self)})"


LAWS = Laws()
"""Every law by its name, with default gains for the paper's bench."""
