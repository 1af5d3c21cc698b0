"""What an experiment of the paper hands on, and the runs that several of them share."""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING

from bowden.control import LAWS
from bowden.core.trace import Trace
from bowden.paper.bench import adaptive, observer, run_bench, run_chirp
from bowden.rig.presets.suit import DRIVE_INTEGRAL, run_suit, suit_adaptive, suit_ours

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True)
class Finding:
    """The outcome of one experiment."""

    title: str
    values: dict[str, float | None]
    """Claim id → computed figure, in the claim's unit."""
    details: dict[str, float] = field(default_factory=dict)
    """Further figures, by the names that the claims' reasons use."""
    figures: list[tuple["Figure", str]] = field(default_factory=list)
    """Figures with their captions."""
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
    def suit_uncompensated(self) -> Trace:
        """Fig. 17, two flexions; every one after the first is like the second."""
        return run_suit(LAWS["uncompensated"], count=2)

    @cached_property
    def suit_adaptive(self) -> Trace:
        """Fig. 17, five flexions."""
        return run_suit(suit_adaptive())

    @cached_property
    def suit_ours(self) -> Trace:
        """Fig. 17 with our law and a drive that has an integral."""
        return run_suit(suit_ours(), drive_integral=DRIVE_INTEGRAL)


Experiment = Callable[[Runs], Finding]
