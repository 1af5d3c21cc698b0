"""Claims: published numbers beside computed ones, with a verdict."""

import csv
import math
import tomllib
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import Any, Literal

from bowden.core.documented import Documented
from bowden.core.errors import ParameterError

Verdict = Literal["fitted", "reproduced", "better", "not determined", "differs", "misprint"]


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
    spread: float = 0.0
    """The standard deviation printed with it."""
    fitted: bool = False
    """True if the calibration used it."""
    readings: bool = False
    """True if the interval is over readings that the text allows, so that one of its ends may give the figure."""
    misprint: bool = False
    """True if one corrected value or word mends it; `why` names it and what else it mends."""
    better: str = ""
    """``lower`` or ``higher`` where a figure beyond the published one is an improvement."""
    why: str = ""
    """Why the computed figure differs; may name the experiment's details in braces."""


@dataclass(frozen=True)
class JudgedClaim(Documented):
    """A published number and ours."""

    id: str
    """Such as table1.adaptive.constant."""
    source: str
    """Figure, table or equation of the paper."""
    quantity: str
    """What it is, in words."""
    published: float | None
    """Null where the paper prints no number."""
    computed: float | None
    """Null where no such figure exists."""
    interval: tuple[float, float] | None
    """Range of the figure over plausible calibrations, or over the readings that the text allows; null where there is
    one value."""
    unit: str
    verdict: Verdict
    fitted: bool
    """True if the calibration used this number."""
    why: str
    """Why the figures differ; given unless the verdict is fitted or reproduced."""

    @property
    def remark(self) -> bool:
        """True if it is a figure of ours on the paper's equations, with nothing printed beside it."""
        return self.published is None and self.verdict != "misprint"


def claims() -> list[Claim]:
    """Every claim of claims.toml, in its order."""
    return [Claim(**entry) for entry in _document()["claims"]]


WIDE = 0.25
"""Half of an interval's width over the published value from which on the paper does not determine the figure [–]."""


def judge(claim: Claim, computed: float | None, interval: tuple[float, float] | None = None) -> Verdict:
    """The verdict: only what was not fitted can count as reproduced, and only what is determined.

    >>> judge(Claim("x", "", "", "deg", 1.0, better="lower"), 0.5)
    'better'
    >>> judge(Claim("x", "", "", "deg", 1.0), 0.5, (0.4, 1.2))
    'not determined'
    """
    if claim.misprint:
        return "misprint"
    if computed is None or claim.published is None:
        return "not determined"
    close = abs(computed - claim.published) <= claim.tolerance * abs(claim.published)
    if claim.fitted:
        return "fitted" if close else "differs"
    low, high = interval or (computed, computed)
    inside = low - claim.spread <= claim.published <= high + claim.spread
    near = min(abs(low - claim.published), abs(high - claim.published)) <= claim.tolerance * abs(claim.published)
    if claim.readings and (inside or near):
        return "not determined"
    if inside and high - low > 2.0 * WIDE * abs(claim.published):
        return "not determined"
    if close or inside:
        return "reproduced"
    beyond = {"lower": high < claim.published, "higher": low > claim.published}
    return "better" if beyond.get(claim.better, False) else "differs"


@cache
def plausible_sets() -> list[dict[str, float]]:
    """The calibrations of plausible_sets.csv that fit every fitted row within 5 %, with what each predicts.

    A set is drawn evenly over the plausible ranges of the stated choices, 20 for each servo of 60, 70, … 140 rad/s.
    Then speed limit, observer's share and loss on the bench, friction and play of the suit and the period of Fig. 6 are
    fitted to their rows; gains are by margin. 180 of the sets have a feeder without drag. The motors of a set's bench
    and suit are one motor. Drawn on 28 November 2026 by benchmarks/plausible_sets.py, last in commit e0697250.
    """
    text = (resources.files("bowden.paper") / "plausible_sets.csv").read_text(encoding="utf-8")
    rows = [{name: float(value) for name, value in row.items()} for row in csv.DictReader(text.splitlines())]
    published = {one.id: one.published for one in claims() if one.fitted and one.published}
    fitted = {name: value for name, value in published.items() if name in rows[0]}
    return [row for row in rows if all(abs(row[name] / value - 1.0) <= 0.05 for name, value in fitted.items())]


def interval(row: str) -> tuple[float, float] | None:
    """The range of a figure over `plausible_sets`; None of one that they do not have."""
    values = [one[row] for one in plausible_sets() if row in one and math.isfinite(one[row])]
    return (min(values), max(values)) if values else None


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


def span(interval: tuple[float, float] | None) -> str:
    """An interval for a table, three significant digits."""
    return "–" if interval is None else f"{interval[0]:.3g} to {interval[1]:.3g}"
