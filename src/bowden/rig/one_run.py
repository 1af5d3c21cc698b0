"""One run of a law on what a rig describes: the bench, or the suit where one is worn."""

from bowden.control.law import Law
from bowden.control.source import TABLE
from bowden.core.trace import Trace
from bowden.rig.compose import Setup
from bowden.sim.closed_loop import simulate
from bowden.sim.faulty import Fault
from bowden.sim.suit import simulate_suit


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
    if setup.suit is None:
        return simulate(
            setup.bench,
            law,
            setup.reference,
            duration=setup.duration,
            bend=setup.bend,
            seed=setup.seed,
            initial_motor=setup.initial_motor,
            fault=fault,
        )
    return simulate_suit(
        setup.suit,
        law,
        setup.reference,
        duration=setup.duration,
        bend=setup.bend,
        seed=setup.seed,
        initial_motor=setup.initial_motor,
        source=TABLE if push is None else push.source(law),
        cell=None if push is None else push.cell,
        fault=fault,
    )
