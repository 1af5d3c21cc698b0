"""Reading a study's file: every mistake becomes one line that names the key and what to write instead."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from bowden.core.errors import ParameterError
from bowden.rig.config import dotted, explained, read_toml
from bowden.study.distributions import KINDS, Distribution, Value
from bowden.study.schema import DistributionSection, FaultSection, KnownSection, StudyFile

_CORRECT = "correct it there"


def read_study(path: Path) -> tuple[StudyFile, dict[str, Distribution]]:
    """A study's file, and how each of its parameters is spread: dotted key, ``known.NAME`` or ``fault.NAME``.

    Raises:
        ParameterError: no such file, not TOML, an unknown key, a value or a distribution that cannot be.
    """
    raw = read_toml(path, do="docs/campaign.md shows one")
    for name, is_section in _IS_SECTION.items():
        if isinstance(raw.get(name), dict):
            raw[name] = dotted(raw[name], f"{path}: {name}", is_section)
    for name in ("vary", "known", "fault"):
        section = raw.get(name)
        if isinstance(section, dict):
            raw[name] = {key: {"fixed": v} if isinstance(v, int | float | str) else v for key, v in section.items()}
    try:
        study = StudyFile.model_validate(raw)
    except ValidationError as error:
        raise explained(error, path, StudyFile) from error
    given: dict[str, DistributionSection | None] = dict(study.vary)
    given |= _section("known", study.known) | _section("fault", study.fault)
    return study, {key: _spread(key, one, path) for key, one in given.items() if one is not None}


_IS_SECTION: dict[str, Callable[[Mapping[str, Any]], bool]] = {
    "set": lambda table: "kind" not in table,
    "vary": lambda table: all(isinstance(one, dict) for one in table.values()),
}
"""Section whose keys are keys of a rig → whether a table in it is a section of the rig, and not a value."""


def _section(name: str, section: KnownSection | FaultSection | None) -> dict[str, Any]:
    return {f"{name}.{key}": value for key, value in section or ()}


def _spread(key: str, given: DistributionSection, path: Path) -> Distribution:
    where = key if key.startswith(("known.", "fault.")) else f'vary."{key}"'
    kinds = [kind for kind in KINDS if getattr(given, kind) is not None]
    if len(kinds) != 1:
        raise ParameterError(
            f"{path}: {where} has {' and '.join(kinds) or 'no kind'}",
            expected=f"one of {', '.join(KINDS)}",
            do=_CORRECT,
        )
    kind = kinds[0]
    stands = getattr(given, kind)
    values: list[Value] = list(stands) if isinstance(stands, list) else [stands]
    bounds = [given.low, given.high]
    if kind == "normal":
        missing = [name for name, bound in zip(("low", "high"), bounds, strict=True) if bound is None]
        if missing:
            raise ParameterError(
                f"{path}: {where} is normal without {' and '.join(missing)}",
                expected="both: beyond some value no parameter makes sense",
                do="add what is missing",
            )
        values += [bound for bound in bounds if bound is not None]
    elif bounds != [None, None]:
        raise ParameterError(
            f"{path}: {where} is {kind} with low or high", expected="these with normal alone", do="delete them"
        )
    try:
        return Distribution(kind, tuple(values))
    except ParameterError as error:
        raise ParameterError(f"{path}: {where}: {error.what}", expected=KINDS[kind], do=_CORRECT) from error
