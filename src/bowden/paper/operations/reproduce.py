"""`reproduce`: the paper's bench, claim by claim."""

from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any

from bowden.core.documented import Documented
from bowden.operations.support.operation import GivenProgress, Operation
from bowden.operations.support.results import Result, filled
from bowden.paper.claims import JudgedClaim

if TYPE_CHECKING:
    from bowden.paper.reproduce import Reproduction


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
    from bowden.paper.sensitivity import ROWS

    with reported(progress, "reproduce") as report:
        outcome = run(only or [], report)
    calibrations = (
        {"id": claim, **{name: found[claim] for name, found in outcome.earlier.items()}}
        for claim in (ROWS if outcome.earlier else ())
    )
    return Reproduced(
        tuple(one for one in outcome.results if not one.remark),
        tuple(filled(EquationRemark, one) for one in outcome.results if one.remark),
        tuple(calibrations),
        made=outcome,
    )


OPERATIONS = (Operation("reproduce", reproduce, 140),)
