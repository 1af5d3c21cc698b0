"""What an experiment of the paper hands on."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class PageTable:
    """A table of plain text on the page."""

    header: list[str]
    rows: list[list[str]]
    caption: str


@dataclass(frozen=True)
class Finding:
    """The outcome of one experiment."""

    title: str
    values: dict[str, float | None]
    """Claim id → computed figure, in the claim's unit."""
    details: dict[str, float] = field(default_factory=dict)
    """Further figures, by the names that the claims' reasons use."""
    intervals: dict[str, tuple[float, float]] = field(default_factory=dict)
    """Claim id → range over the readings that the text allows."""
    figures: list[tuple["Figure", str]] = field(default_factory=list)
    """Figures with their captions."""
    tables: list["PageTable"] = field(default_factory=list)
    text: str = ""
    """What there is to say, as HTML."""


Experiment = Callable[[], Finding]
