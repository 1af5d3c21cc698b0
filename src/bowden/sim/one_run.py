"""One run of a law on what a rig describes: the bench, or the suit where one is worn."""

from dataclasses import replace

from bowden.control.law import Law
from bowden.control.source import TABLE
from bowden.records.trace import Trace
from bowden.rig.rig import Rig
from bowden.sim.faulty import SensorFault
from bowden.sim.run import simulate


def run_of(rig: Rig, law: Law, fault: SensorFault | None = None) -> Trace:
    """The trace of one run, with the rig's hash in its settings.

    Args:
        rig: as it is to be simulated; one moved by EMG is taken `offline`.
        law: with the gains that the rig gives it.
        fault: of a sensor.

    Raises:
        ParameterError: a setting that cannot be.
        StreamError: a recording of EMG that cannot be used.
    """
    rig = rig.offline()
    trace = simulate(
        rig.simulated_plant,
        law,
        rig.trajectory,
        duration=rig.duration,
        bend=rig.bend_path,
        seed=rig.seed,
        initial_motor=rig.start_motor,
        source=TABLE if rig.pushing is None else rig.pushing.source(law),
        fault=fault,
    )
    trust = {} if rig.cable_trust is None else {"cable_trust": rig.cable_trust._asdict()}
    return replace(trace, settings={**trace.settings, "rig": rig.hash, **trust})
