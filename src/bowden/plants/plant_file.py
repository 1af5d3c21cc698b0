"""The plant of one's own that a rig names: a user's file with its bytes, or a `UserPlant` of Python's."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, ClassVar, Self

from bowden.core import user_file
from bowden.core.errors import ParameterError, article, near
from bowden.core.kernel_content import code_of
from bowden.core.own_file import OwnFile, split
from bowden.plants import user_plant
from bowden.plants.user_plant import UserPlant

PARTS = ("sheath", "servo", "motor", "joint_encoder", "motor_encoder", "sample_time", "delay")
"""Parts that a rig gives any plant, and that a plant may have of its own."""

_DIGITS = 1e-12
"""A number that went through a file's units and back may differ by this much of itself."""


@dataclass(frozen=True)
class PlantFile(OwnFile):
    """A plant in a file of the user's."""

    changed: tuple[tuple[str, float], ...] = ()
    """Parameters that differ from the file's, by name and in their order."""
    what: ClassVar[str] = "plant"

    def load(self) -> UserPlant:
        """See `OwnFile.load`."""
        found = self._own
        if not self.changed:
            return found
        return found._replace(parameters=found.parameters._replace(**dict(self.changed)))

    @property
    def _own(self) -> UserPlant:
        """The plant as its file has it."""
        return _load(replace(self, changed=()))

    @classmethod
    def seen(cls, name: str, folder: Path | None = None) -> Self:
        """See `OwnFile.seen`; a name that is no Python file's is refused as that."""
        if not split(name)[0].endswith(".py"):
            expected = "my_plant.py, or my_plant.py:NAME"
            raise ParameterError(f"the plant {name!r} is not a Python file", expected=expected, do="name its file")
        return super().seen(name, folder)

    def with_parameters(self, given: Mapping[str, float]) -> "PlantFile":
        """The plant with these parameters in place of its file's, and all others as its file has them.

        Raises:
            ParameterError: no such parameter, or one that is no number.
        """
        own = self._own.parameters._asdict()
        for name in given:
            if name not in own:
                raise ParameterError(f"the plant {self.name!r} has no parameter {name!r}", expected=near(name, own))
            if not isinstance(own[name], float):
                raise ParameterError(
                    f"the parameter {name!r} of the plant {self.name!r} is {own[name]!r} in its file",
                    expected="one that is a float there",
                    do="change it in the file",
                )
        changed = tuple((k, float(given[k])) for k in own if k in given and given[k] != own[k])
        return replace(self, changed=changed)

    @property
    def parameters(self) -> dict[str, float]:
        """Its parameters that are numbers, by name."""
        return {name: one for name, one in self.load().parameters._asdict().items() if isinstance(one, float)}


@lru_cache(64)
def _load(file: PlantFile) -> UserPlant:
    """The plant, made once in a process: what a file prints is printed once."""
    return user_plant.load_file(file.restored())


def load(name: str, folder: Path | None = None) -> UserPlant:
    """The plant that ``FILE.py:NAME`` or ``FILE.py`` names; see `OwnFile.found`."""
    return PlantFile.found(name, folder).load()


def held(given: Any) -> UserPlant | PlantFile | None:
    """The form in which a rig holds a plant: one from a file as that file, so that other processes have it too.

    Raises:
        ParameterError: it is no plant of one's own.
    """
    if isinstance(given, str):
        return PlantFile.found(given)
    if not isinstance(given, UserPlant):
        if given is None or isinstance(given, PlantFile):
            return given
        raise ParameterError(
            f"Rig: plant is {article(type(given).__name__)}",
            expected='"my_plant.py:NAME" or a UserPlant of bowden.plants.user_plant',
            do="write it into a file and name that (docs/own_law.md)",
        )
    given.dynamics()
    return _in_file(given) or given


def as_file(given: UserPlant | PlantFile) -> PlantFile:
    """The plant as its file.

    Raises:
        ParameterError: a plant that stands in no file.
    """
    if isinstance(given, UserPlant):
        raise ParameterError(
            f"the plant {given.name!r} is not in a file, so that it cannot be used in another process",
            do=user_file.elsewhere(given.advance, "plant"),
        )
    return given


def loaded(given: UserPlant | PlantFile) -> UserPlant:
    """The plant with what it says of itself.

    Raises:
        ParameterError: a user's file that cannot be used.
    """
    return given if isinstance(given, UserPlant) else given.load()


def said_by(plant: UserPlant) -> list[str]:
    """The `PARTS` of which a plant says something itself."""
    return [name for name in PARTS if getattr(plant, name) != UserPlant._field_defaults[name]]


def agreed(plant: UserPlant, own: dict[str, Any], default: dict[str, Any]) -> dict[str, Any]:
    """The parts of a rig round a plant: what the plant says of itself, and else what the rig says.

    Args:
        plant: a part of which it says nothing is as `UserPlant` has it.
        own: the rig's `PARTS`.
        default: those of a rig that says nothing.

    Raises:
        ParameterError: both say something, and not the same.
    """
    found = {}
    for name in said_by(plant):
        said, mine = getattr(plant, name), own[name]
        if _alike(said, mine):
            continue
        if not _alike(mine, default[name]):
            raise ParameterError(
                f"the plant {plant.name!r} has its own {name}, and the rig has another",
                expected="one of them",
                do="leave it out in one place",
            )
        found[name] = said
    return found


def _alike(one: Any, other: Any) -> bool:
    pairs = zip(one, other, strict=True) if isinstance(one, tuple) else [(one, other)]
    return all(a == b or math.isclose(a, b, rel_tol=_DIGITS) for a, b in pairs)


def _in_file(plant: UserPlant) -> PlantFile | None:
    for found in PlantFile.around(plant.advance, UserPlant, plant.name):
        changed = _changed(plant, found.load())
        if changed is not None:
            return replace(found, changed=changed)
    return None


def _changed(plant: UserPlant, known: UserPlant) -> tuple[tuple[str, float], ...] | None:
    """The parameters in which a plant differs from the file's; None where it differs in more than numbers."""
    kernels = ("rest", "advance", "observe", "effort")
    code = [code_of(*(getattr(one, kernel) for kernel in kernels)) for one in (plant, known)]
    kinds = [type(one.parameters).__name__ for one in (plant, known)]
    same = all(getattr(plant, name) == getattr(known, name) for name in PARTS)
    if plant.name != known.name or code[0] is None or code[0] != code[1] or kinds[0] != kinds[1] or not same:
        return None
    found = []
    for name, value in plant.parameters._asdict().items():
        if user_plant.same_values(value, getattr(known.parameters, name)):
            continue
        if not isinstance(value, float):
            return None
        found.append((name, value))
    return tuple(found)
