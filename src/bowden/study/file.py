"""A study's file: its keys, from which docs/campaign.md and the JSON schema are made, and how it is read."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from bowden.core.errors import ParameterError
from bowden.rig.config import dotted, explained, read_toml
from bowden.rig.declaration import Section
from bowden.rig.declaration import plain_key as _key
from bowden.study.distributions import KINDS, Distribution, Value

LONGEST = 1e5
"""Of a run [s]: a day and a quarter."""

_Number = float | int
_Word = float | int | str


class DistributionSection(Section):
    """Distribution of a parameter over the runs: one of the kinds; a plain number is short for fixed."""

    uniform: list[_Number] | None = _key(None, "[low, high], even between them", examples=[[0.6, 1.2]])
    log_uniform: list[_Number] | None = _key(None, "[low, high], even in the logarithm", examples=[[2.0, 20.0]])
    normal: list[_Number] | None = _key(
        None, "[mean, deviation], cut off at low and high, which must be given", examples=[[1.0, 0.1]]
    )
    low: _Number | None = _key(None, "smallest value of normal", examples=[0.8])
    high: _Number | None = _key(None, "largest value of normal", examples=[1.2])
    integer: list[int] | None = _key(None, "[low, high], whole numbers, both included", examples=[[0, 3]])
    choice: list[_Word] | None = _key(
        None, "one of these, all equally likely; named twice, twice as likely", examples=[[1, 2]]
    )
    fixed: _Word | None = _key(None, "always this", examples=[1.0])


class KnownSection(Section):
    """Wrong knowledge that the laws get of the rig of each run, as a factor on the true value."""

    servo_frequency: DistributionSection | None = _key(None, "natural frequency of the servo", examples=[{}])
    servo_damping: DistributionSection | None = _key(None, "damping ratio of the servo", examples=[{}])
    delay: DistributionSection | None = _key(
        None, "time from a sample to the middle of the time for which its command is held", examples=[{}]
    )


class FaultSection(Section):
    """A sensor that fails in each run; the law sees what it says, and no supervisor is there."""

    kind: DistributionSection | None = _key(None, "which, fixed or a choice; see below", examples=[{}])
    begin_s: DistributionSection | None = _key(None, "when it begins; 0 if left out", "s", examples=[{}])
    length_s: DistributionSection | None = _key(None, "how long it lasts; to the end if left out", "s", examples=[{}])


class StudyFile(Section):
    """A study for ``bowden campaign``."""

    rig: str | None = _key(None, "a rig.toml, found from this file; left out, the default bench", examples=["rig.toml"])
    laws: list[str] = _key(
        ["adaptive"], 'names of laws, or your own as "file.py:NAME", found from this file', min_length=1
    )
    runs: int = _key(1000, "how many plants are drawn; each law runs on all of them", ge=1, le=100_000_000)
    seed: int = _key(1, "of all that is drawn", ge=0, lt=2**63)
    duration_s: float | None = _key(
        None, "length of a run; left out, the rig's scenario.duration_s", "s", gt=0.0, le=LONGEST, examples=[60.0]
    )
    set: dict[str, Any] = _key({}, "keys of the rig, dotted, that differ from its file in all runs")
    vary: dict[str, DistributionSection] = _key(
        {}, "numeric keys of the rig, dotted, or control.gains.NAME, and how each is spread over the runs"
    )
    known: Annotated[KnownSection | None, Field(json_schema_extra={"unit": "–"})] = _key(
        None, "what the laws get as wrong knowledge of the rig of each run; left out, they get the true values"
    )
    fault: FaultSection | None = _key(None, "a sensor that fails; left out, none")


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
