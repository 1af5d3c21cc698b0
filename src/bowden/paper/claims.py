"""Claims: published numbers beside computed ones, with a verdict."""

import tomllib
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any

from bowden.core.errors import ParameterError


@cache
def _document() -> dict[str, Any]:
    """claims.toml as it stands."""
    return tomllib.loads((resources.files("bowden.paper") / "claims.toml").read_text(encoding="utf-8"))


@dataclass(frozen=True)
class Claim:
    """One published number, as claims.toml has it."""

    id: str
    """Its name, such as ``table1.adaptive.constant``."""
    source: str
    """Figure, table or equation."""
    quantity: str
    """What it is."""
    unit: str
    published: float | None = None
    """The printed number; None where the paper prints none."""
    tolerance: float = 0.1
    """Relative difference up to which it counts as the same."""
    fitted: bool = False
    """Whether the calibration used it."""
    erratum: bool = False
    """Whether PAPER's list of errata shows that it cannot be taken as printed."""
    better: str = ""
    """``lower`` or ``higher`` where a figure beyond the published one is an improvement."""
    why: str = ""
    """Why the computed figure differs; may name the experiment's details in braces."""


@dataclass(frozen=True)
class Result:
    """A claim with the figure that we computed."""

    claim: Claim
    computed: float | None
    why: str

    @property
    def verdict(self) -> str:
        """``fitted``, ``reproduced``, ``better``, ``differs`` or ``erratum``; see `judge`."""
        return judge(self.claim, self.computed)

    def json(self) -> dict[str, Any]:
        """The claim as the command line prints it."""
        claim = self.claim
        return {
            "id": claim.id,
            "source": claim.source,
            "quantity": claim.quantity,
            "published": claim.published,
            "computed": self.computed,
            "unit": claim.unit,
            "verdict": self.verdict,
            "fitted": claim.fitted,
            "why": self.why,
        }


def claims() -> list[Claim]:
    """Every claim of claims.toml, in its order."""
    return [Claim(**entry) for entry in _document()["claims"]]


def judge(claim: Claim, computed: float | None) -> str:
    """The verdict: only what was not fitted can count as reproduced.

    >>> judge(Claim("x", "", "", "deg", 1.0, better="lower"), 0.5)
    'better'
    """
    if claim.erratum:
        return "erratum"
    if computed is None or claim.published is None:
        return "differs"
    if abs(computed - claim.published) <= claim.tolerance * abs(claim.published):
        return "fitted" if claim.fitted else "reproduced"
    beyond = {"lower": computed < claim.published, "higher": computed > claim.published}
    return "better" if not claim.fitted and beyond.get(claim.better, False) else "differs"


def select(only: list[str]) -> list[Claim]:
    """The claims whose id begins with one of `only` (all of them where it is empty).

    Raises:
        ParameterError: a name that no claim begins with.
    """
    everything = claims()
    for wanted in only:
        if not any(_matches(claim.id, wanted) for claim in everything):
            known = sorted({claim.id.split(".")[0] for claim in everything})
            raise ParameterError(
                f"--only {wanted}: no such claim", expected=f"the id of a claim or its beginning: {', '.join(known)}"
            )
    return [claim for claim in everything if not only or any(_matches(claim.id, wanted) for wanted in only)]


def _matches(identity: str, wanted: str) -> bool:
    return identity == wanted or identity.startswith(wanted.rstrip(".") + ".")


def number(value: object) -> str:
    """A figure for a table: four significant digits, a dash where there is none."""
    return f"{value:.4g}" if isinstance(value, float | int) else "–"
