"""The paper's bench as a rig, and its runs: what anybody can do with `bowden.Rig` and `bowden.simulate`."""

import warnings

import bowden
from bowden.models.cable.bouc_wen import BoucWen, saturation
from bowden.rig.bends import ScriptedBend
from bowden.rig.presets.bench import Calibration, bench, calibration, chirp, document, minimum_jerk

CHIRP_DURATION = 150.0
"""Of Fig. 16's reference [s]."""


def rig(fit: Calibration | None = None) -> bowden.Rig:
    """The bench with a calibration, under Table 1's reference for a minute; with the main one it is the default rig."""
    fit, plain, chosen = fit or calibration(), bowden.Rig(), document()["chosen"]
    return plain.replace(
        servo=plain.servo._replace(natural_frequency=fit.natural_frequency),
        width=fit.gap,
        sheath=plain.sheath._replace(loss=fit.loss),
        reference=minimum_jerk(fit),
        duration=chosen["duration_s"],
        seed=chosen["seed"],
    )


def observer(fit: Calibration | None = None) -> bowden.Law:
    """The observer, knowing the cable but for its share of α̂h."""
    fit, cable = fit or calibration(), BoucWen()
    return bowden.LAWS["observer"].with_gains(
        hysteresis_gain=fit.observer_share * cable.hysteresis_gain * fit.gap, rate=cable.rate / fit.gap
    )


def adaptive() -> bowden.Law:
    """The adaptive law with its own gains, chosen for this bench, whatever a calibration says of the servo."""
    law = bowden.LAWS["adaptive"]
    return law.with_gains(**law.gains._asdict())


def run_bench(
    law: bowden.Law, *, moved: bool = False, fit: Calibration | None = None, duration: float | None = None
) -> bowden.Trace:
    """One of Table 1's runs from rest, of a minute where no `duration` [s] is given; `moved`: with Fig. 15's sheath."""
    given = rig(fit)
    given = given.replace(bend=ScriptedBend()) if moved else given
    return _run(given if duration is None else given.replace(duration=duration), law)


def run_chirp(law: bowden.Law, fit: Calibration | None = None) -> bowden.Trace:
    """Fig. 16's run."""
    return _run(rig(fit).replace(reference=chirp(), duration=CHIRP_DURATION), law)


def _run(given: bowden.Rig, law: bowden.Law) -> bowden.Trace:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of gains that do not hold: what the paper printed is run as it is
        return bowden.simulate(given, law, force=True)


def true_bound(fit: Calibration | None = None) -> float:
    """The true Dm, height of the cable's hysteresis |αh|·gap·max|h| [rad]."""
    plant = bench(fit)
    return abs(plant.cable.hysteresis_gain) * plant.sheath.gap * float(saturation(plant.cable))
