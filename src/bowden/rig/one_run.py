"""One run of a law on what a rig describes: the bench, or the suit where one is worn."""

from bowden.control.law import Law
from bowden.control.source import TABLE
from bowden.core.trace import Trace
from bowden.plants.plant import Plant
from bowden.rig.compose import Setup
from bowden.sim.faulty import Fault
from bowden.sim.run import simulate


def run_of(setup: Setup, law: Law, fault: Fault | None = None) -> Trace:
    """The trace of one run.

    Args:
        setup: of the rig.
        law: with the gains that the rig gives it.
        fault: of a sensor.

    Raises:
        ParameterError: a setting that cannot be.
    """
    push = setup.pushing
    plant: Plant = setup.bench
    if setup.suit is not None:
        plant = setup.suit if push is None else setup.suit._replace(load_cell=push.cell)
    return simulate(
        plant,
        law,
        setup.reference,
        duration=setup.duration,
        bend=setup.bend,
        seed=setup.seed,
        initial_motor=setup.initial_motor,
        source=TABLE if push is None else push.source(law),
        fault=fault,
    )
