"""One run of a law on what a rig describes: the bench, or the suit where one is worn."""

from dataclasses import replace

from bowden.control.law import Law
from bowden.control.source import TABLE
from bowden.core.trace import Trace
from bowden.rig.rig import Rig
from bowden.sim.closed_loop import simulate
from bowden.sim.faulty import Fault
from bowden.sim.suit import simulate_suit


def run_of(rig: Rig, law: Law, fault: Fault | None = None) -> Trace:
    """The trace of one run, with the rig's hash in its settings.

    Args:
        rig: as it is to be simulated; one moved by EMG is taken `offline`.
        law: with the gains that the rig gives it.
        fault: of a sensor.

    Raises:
        ParameterError: a setting that cannot be.
        StreamError: a recording of EMG that cannot be used.
    """
    trace = _simulated(rig.offline(), law, fault)
    return replace(trace, settings={**trace.settings, "rig": rig.hash})


def _simulated(rig: Rig, law: Law, fault: Fault | None) -> Trace:
    if rig.worn is None:
        return simulate(
            rig.bench,
            law,
            rig.trajectory,
            duration=rig.duration,
            bend=rig.bend_path,
            seed=rig.seed,
            initial_motor=rig.start_motor,
            fault=fault,
        )
    push = rig.pushing
    return simulate_suit(
        rig.worn,
        law,
        rig.trajectory,
        duration=rig.duration,
        bend=rig.bend_path,
        seed=rig.seed,
        initial_motor=rig.start_motor,
        source=TABLE if push is None else push.source(law),
        cell=None if push is None else push.cell,
        fault=fault,
    )
