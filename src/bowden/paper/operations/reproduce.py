"""`reproduce`: the paper's bench, claim by claim."""

from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any, Literal

from bowden.core.documented import Documented
from bowden.operations.support.operation import GivenProgress, Operation
from bowden.operations.support.results import Result

if TYPE_CHECKING:
    from bowden.paper.reproduce import Reproduction


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
    verdict: Literal["fitted", "reproduced", "better", "not determined", "differs", "misprint"]
    fitted: bool
    """True if the calibration used this number."""
    why: str
    """Why the figures differ; given unless the verdict is fitted or reproduced."""


@dataclass(frozen=True)
class EquationRemark(Documented):
    """A figure of ours on the paper's equations."""

    id: str
    source: str
    quantity: str
    computed: float | None
    unit: str
    why: str


@dataclass(frozen=True)
class Reproduced(Result["Reproduction"]):
    """Published and computed figures."""

    claims: tuple[JudgedClaim, ...]
    """One entry a published number, or a misprint."""
    remarks: tuple[EquationRemark, ...]
    """Figures of ours on the paper's equations, without a published one."""
    calibrations: tuple[dict[str, Any], ...]
    """What two earlier calibrations predict, by claim; empty where only a part was asked for."""
    _: KW_ONLY
    made: "Reproduction"


def reproduce(*, only: list[str] | None = None, progress: GivenProgress = None) -> Reproduced:
    """Reproduce the paper's bench, claim by claim: published and computed figures, and a report with every figure.

    Args:
        only: only this claim or figure: fig16, table1.adaptive, fig17.adaptive, … May be repeated.

    Raises:
        ParameterError: an id that no claim has.

    Examples:
        bowden reproduce
        bowden reproduce --only table1 --only fig16
        bowden reproduce --json
    """
    from bowden.operations.support.progress import reported
    from bowden.paper.reproduce import reproduce as run

    with reported(progress, "reproduce") as report:
        outcome = run(only or [], report)
    said = outcome.json()
    claims, remarks = (JudgedClaim(**one) for one in said["claims"]), (EquationRemark(**one) for one in said["remarks"])
    return Reproduced(tuple(claims), tuple(remarks), tuple(said["calibrations"]), made=outcome)


OPERATIONS = (Operation("reproduce", reproduce, 140),)
