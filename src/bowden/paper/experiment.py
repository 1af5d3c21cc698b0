"""What an experiment of the paper hands on, and the runs that several of them share."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from bowden.control import LAWS
from bowden.paper.bench import adaptive, observer, ours, run_bench, run_chirp
from bowden.paper.suit_rows import DRIVES, Five, five_flexions, laws_on
from bowden.records.trace import Trace

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


class Runs:
    """The simulated runs of the paper's bench, each made once and when it is first wanted."""

    @cached_property
    def uncompensated(self) -> Trace:
        """Fig. 9."""
        return run_bench(LAWS["uncompensated"])

    @cached_property
    def observer(self) -> Trace:
        """Fig. 12."""
        return run_bench(observer())

    @cached_property
    def observer_moved(self) -> Trace:
        """Fig. 15A."""
        return run_bench(observer(), moved=True)

    @cached_property
    def adaptive(self) -> Trace:
        """Fig. 13 and 14."""
        return run_bench(adaptive())

    @cached_property
    def adaptive_moved(self) -> Trace:
        """Fig. 15B."""
        return run_bench(adaptive(), moved=True)

    @cached_property
    def observer_chirp(self) -> Trace:
        """Fig. 16, observer."""
        return run_chirp(observer())

    @cached_property
    def adaptive_chirp(self) -> Trace:
        """Fig. 16, adaptive."""
        return run_chirp(adaptive())

    @cached_property
    def ours(self) -> Trace:
        """Our law on the bench of Fig. 13."""
        return run_bench(ours())

    @cached_property
    def ours_moved(self) -> Trace:
        """Our law on the bench of Fig. 15."""
        return run_bench(ours(), moved=True)

    @cached_property
    def suit_uncompensated(self) -> Five:
        """Fig. 17 without compensation."""
        return five_flexions(LAWS["uncompensated"])

    @cached_property
    def suit(self) -> dict[tuple[str, str], Five]:
        """Fig. 17, by drive and law: PD and integral, the adaptive law and ours."""
        return {
            (drive, name): five_flexions(law, integral)
            for drive, integral in DRIVES.items()
            for name, law in laws_on(drive).items()
        }


Experiment = Callable[[Runs], Finding]
