"""Figures of a campaign, and of gains that are judged by a study, as they are printed as JSON too."""

from dataclasses import dataclass

from bowden.core.documented import Documented


@dataclass(frozen=True)
class FigureSpread(Documented):
    """Spread of a figure over the runs that have it."""

    count: int
    """Runs that have it."""
    least: float
    q05: float
    """Quantile at 5 %."""
    median: float
    q90: float
    q99: float
    most: float


@dataclass(frozen=True)
class WorstRun(Documented):
    """A run that was among the worst."""

    number: int
    """By which it is run again."""
    value: float | None
    """RMSE from rest [deg]; null where it ran away."""
    drawn: dict[str, float | str]
    """Parameter -> its value in the unit of its name."""


@dataclass(frozen=True)
class ParameterShare(Documented):
    """Effect of a drawn parameter on the error."""

    parameter: str
    rank_correlation: float | None
    """Spearman's; null where it does not exist: of a word, and where either does not vary [1]."""
    variance_share: float | None
    """Of the variance, between the means of bins of the parameter; null where the law has no such gain [1]."""
    chance_share: float | None
    """Share below which 95 % of the parameters stay that change nothing, with as many runs; null likewise [1]."""
    above_chance: bool
    """True if the share is more than that."""

    @property
    def share(self) -> float:
        """`variance_share`; 0 where the law has no such gain."""
        return self.variance_share or 0.0


@dataclass(frozen=True)
class LawCampaign(Documented):
    """Figures of one law over all plants."""

    law: str
    """Its name."""
    runs: int
    ran_away: int
    """Runs that did not reach their end: a command beyond 1000 rad, or no number."""
    unstable: int
    """Those, and runs in which the joint was further from the reference than its whole stroke (5 deg at least)."""
    unstable_interval: tuple[float, ...]
    """Wilson's 95 % interval of the share of unstable runs [1]."""
    oscillating: int | None
    """Runs whose command travelled more than five times as far as the reference, or that ran away; null where runs
    differ in the reference, in a suit and under admittance."""
    worse_than_uncompensated: int | None
    """Runs with a larger RMSE than the law uncompensated on the same plant; null of that law, and where it did not
    run."""
    figures: dict[str, FigureSpread]
    """Figure of merit (a column of the rows, with its unit in the name) -> how it is spread over the runs that have
    it."""
    worst: tuple[WorstRun, ...]
    """The runs with the largest RMSE from rest, the worst first; those that ran away before all others."""
    sensitivity: tuple[ParameterShare, ...]
    """What the RMSE from rest depends on, the parameter that matters most first; of ranks."""


@dataclass(frozen=True)
class PlantsSpread(Documented):
    """Figures of gains over plants."""

    runs: int
    unstable: int
    """As in bowden campaign."""
    unstable_interval: tuple[float, ...]
    """Wilson's 95 % interval of their share [1]."""
    rmse_median_deg: float | None
    """From rest; null where that run did not end [deg]."""
    rmse_90_deg: float | None
    """Of nine runs in ten [deg]."""
    rmse_worst_deg: float | None


@dataclass(frozen=True)
class JudgedByStudy(Documented):
    """Gains judged by a study."""

    name: str
    """Of the study."""
    tuned_on: int
    """Plants that the gains were tuned against, its first runs."""
    before: PlantsSpread
    """Over the runs of the study that follow those; a run that did not end counts as the largest RMSE."""
    after: PlantsSpread
    """The same of the gains that were found."""
