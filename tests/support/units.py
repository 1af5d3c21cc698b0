"""Quantities counted in other units, as their declarations name these: no equation knows the second or the radian."""

import ast
import re
import sys
from collections.abc import Iterator
from math import prod
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden.core.quantity import meanings, texts_of

DERIVED = {"N": "kg·m/s²", "J": "kg·m²/s²", "Hz": "1/s", "W": "kg·m²/s³", "V": "kg·m²/(s³·A)", "Ω": "kg·m²/(s³·A²)"}
UNSCALED = {"–", "1", "°C", "cycles", "% MVC"}
SPELT = {"A²s": "A²·s"}
POWERS = {"²": 2, "³": 3}
FREQUENCIES = re.compile("frequency|bandwidth|cutoff")
"""Names of what is in rad/s and counts no angle of a motor or a joint."""


class Units:
    """So many of the new unit are one of SI, ``Units(s=2.0, rad=0.5)``; powers of two, so that nothing is rounded."""

    def __init__(self, **of: float) -> None:
        self.of = of

    @property
    def back(self) -> "Units":
        """The units from which these were counted."""
        return Units(**{unit: 1.0 / factor for unit, factor in self.of.items()})

    def factor(self, unit: str, name: str = "") -> float:
        """One of a `unit` in the new units; of ``rad/s`` by the name of what is in it."""
        unit = SPELT.get(unit, unit)
        if unit in UNSCALED:
            return 1.0
        if unit == "rad/s" and FREQUENCIES.search(name.lower()):
            unit = "1/s"
        above, _, below = unit.partition("/")
        return prod(
            self._base(one.rstrip("²³")) ** (sign * POWERS.get(one[-1], 1))
            for part, sign in ((above, 1), (below.strip("()"), -1))
            for one in part.split("·")
            if one
        )

    def _base(self, unit: str) -> float:
        return self.factor(DERIVED[unit]) if unit in DERIVED else 1.0 if unit == "1" else self.of.get(unit, 1.0)

    def counted(self, value: Any) -> Any:
        """A NamedTuple, and those in it, counted in the new units."""
        said = meanings(type(value))
        return value._replace(**{name: self._part(getattr(value, name), name, said) for name in value._fields})

    def _part(self, part: Any, name: str, said: Any) -> Any:
        if hasattr(part, "_fields"):
            return self.counted(part)
        if isinstance(part, float | tuple | np.ndarray) and not isinstance(part, bool):
            factor = self.factor(unit_of(said[name]), name)
            return tuple(factor * one for one in part) if isinstance(part, tuple) else factor * part
        return part

    def count_constants(self, monkeypatch: pytest.MonkeyPatch, *packages: str) -> None:
        """Count every number that a module of these packages names with its unit in the new units."""
        loaded = [one for name, one in sys.modules.items() if name.startswith("bowden.")]
        for module in [one for one in loaded if one.__name__.startswith(packages)]:
            for name, unit in constants(Path(str(module.__file__))):
                value = vars(module).get(name)
                if type(value) is float:
                    for user in loaded:
                        if vars(user).get(name) is value:
                            monkeypatch.setattr(user, name, value * self.factor(unit, name))


def unit_of(text: str) -> str:
    """The unit that ends the text of a declaration, ``[N·m/rad]``."""
    found = re.findall(r"\[([^\]]*)\]", text)
    assert found, f"no unit in {text!r}"
    return str(found[-1])


def constants(file: Path) -> Iterator[tuple[str, str]]:
    """Numbers that a module names, each with its unit; of several on a line the units have commas between."""
    source = file.read_text(encoding="utf-8")
    texts = texts_of(ast.parse(source).body, source)
    for name, text in texts.items():
        if "[" in text:
            together = [other for other in texts if texts[other] == text]
            units = re.split(r", |\], \[", unit_of(text) if text.count("[") == 1 else text[text.index("[") + 1 :])
            yield name, units[min(together.index(name), len(units) - 1)].split("]")[0]
