"""How far a model is to be trusted: a value that goes with it, from its log into each rig that is made of it."""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

from bowden.core.errors import ParameterError
from bowden.core.toml_text import quoted

Level = Literal["yes", "with care", "no"]
LEVELS: tuple[Level, ...] = get_args(Level)
QUARTER = 0.25
"""Share of a straight line's error that a model leaves at most, if it is to be trusted: its loop is then known to a
quarter."""


class Trust(NamedTuple):
    """Trust in a model."""

    level: Level
    """``yes`` for motions like the log's."""
    reasons: tuple[str, ...]
    """The gravest first."""

    def __str__(self) -> str:
        return f"{self.level}: {'; '.join(self.reasons)}"


def least(found: Iterable[Trust]) -> Trust:
    """The lowest of these, with the reasons of all that are not *yes*, or else of all.

    >>> print(least([Trust("yes", ("well fitted",)), Trust("with care", ("one cycle",)), Trust("no", ("in mm",))]))
    no: in mm; one cycle
    """
    ordered = sorted(found, key=lambda one: -LEVELS.index(one.level))
    doubts = [one for one in ordered if one.level != "yes"] or ordered
    return Trust(ordered[0].level, tuple(reason for one in doubts for reason in one.reasons))


def trust_lines(trust: Trust | None) -> list[str]:
    """The section of model.toml; none where nothing is known."""
    if trust is None:
        return []
    reasons = (" ".join("".join(c if c.isprintable() else " " for c in one).split()) for one in trust.reasons)
    return [
        "",
        "[trust]  # in the recommended model; each command on a rig that is made of it says so, where it is not yes",
        f"level = {quoted(trust.level)}",
        "reasons = [" + "".join(f"\n  {quoted(reason)}," for reason in reasons) + "\n]",
    ]


def trust_of(document: dict[str, Any], file: Path) -> Trust | None:
    """Trust that a model.toml states; None where it states none.

    Raises:
        ParameterError: another level than these three, or reasons that are no list of texts.
    """
    said = document.get("trust")
    if said is None:
        return None
    level, reasons = (said.get(key) if isinstance(said, dict) else None for key in ("level", "reasons"))
    if level not in LEVELS or not isinstance(reasons, list) or not all(isinstance(one, str) for one in reasons):
        raise ParameterError(
            f"{file}: [trust] is {said!r}",
            expected=f"level, one of {', '.join(LEVELS)}, and reasons, a list of texts",
            do="identify the log again",
        )
    return Trust(level, tuple(reasons))
