"""The paper's bench and its runs."""

from functools import cache

import bowden
from bowden.control.knowledge import configured
from bowden.models.cable.bouc_wen import BoucWen, saturation
from bowden.paper.calibration import bench_fit, gains
from bowden.plants.knowledge_of import knowledge_of
from bowden.plants.presets.bench import bench
from bowden.plants.presets.paper import Calibration, chirp, document, minimum_jerk, moved_sheath
from bowden.sim.run import simulate

CHIRP_DURATION = 150.0
"""Of Fig. 16's reference [s]."""


def observer(fit: Calibration | None = None) -> bowden.Law:
    """The observer, knowing the cable but for its share of α̂h."""
    fit, cable = fit or bench_fit(), BoucWen()
    return bowden.LAWS["observer"].with_gains(
        hysteresis_gain=fit.observer_share * cable.hysteresis_gain * fit.gap, rate=cable.rate / fit.gap
    )


def adaptive(**chosen: float) -> bowden.Law:
    """The adaptive law with the gains that have the margins on this bench, or `chosen` ones."""
    law = bowden.LAWS["adaptive"]
    return law.with_gains(**(law.gains._asdict() | (chosen or gains("bench"))))


def ours(fit: Calibration | None = None) -> bowden.Law:
    """Our law with what a rig of this bench tells it."""
    return configured(bowden.LAWS["bowden"], knowledge_of(bench(fit or bench_fit())))


def run_bench(
    law: bowden.Law, *, moved: bool = False, fit: Calibration | None = None, duration: float | None = None
) -> bowden.Trace:
    """One of Table 1's runs from rest, of a minute where no `duration` [s] is given; `moved`: with Fig. 15's sheath."""
    fit, chosen = fit or bench_fit(), document()["chosen"]
    return simulate(
        bench(fit),
        law,
        minimum_jerk(fit),
        duration=chosen["duration_s"] if duration is None else duration,
        bend=moved_sheath(fit) if moved else None,
        seed=chosen["seed"],
    )


def run_chirp(law: bowden.Law, fit: Calibration | None = None, duration: float = CHIRP_DURATION) -> bowden.Trace:
    """Fig. 16's run, or its beginning of a `duration` [s]."""
    return simulate(bench(fit or bench_fit()), law, chirp(), duration=duration, seed=document()["chosen"]["seed"])


_LAWS = {
    "uncompensated": lambda: bowden.LAWS["uncompensated"],
    "observer": observer,
    "adaptive": adaptive,
    "ours": ours,
}


@cache
def bench_run(law: str, *, moved: bool = False) -> bowden.Trace:
    """`run_bench` of the law of that name, made once."""
    return run_bench(_LAWS[law](), moved=moved)


@cache
def chirp_run(law: str) -> bowden.Trace:
    """`run_chirp` of the law of that name, made once."""
    return run_chirp(_LAWS[law]())


def true_bound(fit: Calibration | None = None) -> float:
    """The true Dm, height of the cable's hysteresis |αh|·gap·max|h| [rad]."""
    cable, sheath = bench(fit or bench_fit())[:2]
    assert isinstance(cable, BoucWen)
    return abs(cable.hysteresis_gain) * sheath.gap * float(saturation(cable))
