"""Many closed loops at once: what `bowden.sim.batch` needs, put together from plants, laws and seeds."""

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control import user_law
from bowden.control.law import Law
from bowden.control.reference import Trajectory
from bowden.control.source import TABLE, Source
from bowden.core.kernel import specialise
from bowden.core.nested import form_of, numbers_of
from bowden.models.cable.sheath_path import BendPath
from bowden.plants.plant import Dynamics, Plant, SheathPath, sheath_path
from bowden.records import metrics
from bowden.records.metrics import LATE
from bowden.records.trace import Trace
from bowden.sim.batch import FIGURES, ROWS, BatchInputs, BatchLimits, One, run_batch
from bowden.sim.injected import SensorFault
from bowden.sim.run import check_clock, edges_of, initial_angle, placeholders, simulate

Array = NDArray[np.float64]

MEMORY = 24e6
"""Bytes that the normal numbers, references and sheaths of the runs of one compiled call may take."""


class Case(NamedTuple):
    """One plant with all that happens to it, and the laws that are set against it with the same noise."""

    plant: Plant
    laws: tuple[Law, ...]
    """As many, and of the same kernels, in all cases of one call."""
    reference: Trajectory
    bend: BendPath
    seed: int
    """Of the sensors' noise, as `bowden.sim.run.simulate` takes it."""
    initial_motor: float | None = None
    """As `bowden.sim.run.simulate` takes it [rad]."""
    fault: SensorFault | None = None
    """Of a sensor; None where none can fail, which is compiled without."""
    sources: tuple[Source, ...] = ()
    """What makes the reference, one for each law, of the same kernels in all cases of one call; the table of
    `reference` itself where there are none."""

    def source_of(self, i: int) -> Source:
        """What makes the reference of law i."""
        return self.sources[i] if self.sources else TABLE

    def trace(self, i: int, duration: float) -> Trace:
        """The run of law i, with its trace, for `duration` [s].

        Raises:
            ParameterError: a duration or a part of the plant that cannot be.
        """
        return simulate(
            self.plant,
            self.laws[i],
            self.reference,
            duration=duration,
            bend=self.bend,
            seed=self.seed,
            initial_motor=self.initial_motor,
            source=self.source_of(i),
            fault=self.fault,
        )


class Outcome(NamedTuple):
    """What came of one run; NaN where a figure does not exist."""

    cycles: float
    """How many it lasted."""
    ended: float
    """1 where it reached its end, 0 where it ran away: a command beyond 1000 rad or not a number."""
    stable: float
    """1 where the joint was never further from the reference than the reference's whole stroke (5° at least), too."""
    rmse: float
    """From rest [rad]."""
    rmse_after_10s: float
    """[rad]"""
    peak: float
    """Largest |e| [rad]."""
    lag: float
    """−∫e·v dt / ∫v² dt with the reference's velocity v: the delay that explains most of a small error [s]."""
    command_travel: float
    """Total variation of the command [rad]."""
    largest_command: float
    """Largest |command| [rad]."""
    mechanical_energy: float
    """∫Pm dt, Eq. 18 [J]."""
    electrical_energy: float
    """∫Pe dt, Eq. 18 [J]."""


def simulate_many(cases: Iterable[Case], duration: float) -> Iterator[tuple[Outcome, ...]]:
    """Run all laws of every case for `duration` [s]; an outcome for each law of each case, in their order.

    The runs are those of `bowden.sim.run.simulate` to the last bit, without their traces: RMSE, peak and
    energies equal those of the trace's metrics. Cases are taken from the iterable as they are needed.

    Raises:
        ParameterError: a duration or setting that cannot be.
    """
    group: list[Ready] = []
    size = 0.0
    for case in cases:
        ready = Ready(case, duration, group[-1] if group else None)
        if group and (size + ready.size > MEMORY or not group[0].goes_with(ready)):
            yield from _run(group)
            group, size = [], 0.0
        group.append(ready)
        size += ready.size
    if group:
        yield from _run(group)


class Ready:
    """A case with its inputs over time; those that it shares with the case before are not made again."""

    def __init__(self, case: Case, duration: float, before: "Ready | None") -> None:
        self.case, plant = case, case.plant
        check_clock(plant, duration)
        self.dynamics: Dynamics = plant.dynamics()
        old = before if before is not None and before.case.plant.sample_time == plant.sample_time else None
        self.edges: Array = edges_of(plant, duration) if old is None else old.edges
        if old is not None and old.case.reference is case.reference:
            self.reference: Array = old.reference
        else:
            self.reference = np.ascontiguousarray(case.reference.sample(self.edges[:-1]).T)
        if old is not None and old.case.bend is case.bend and old.case.plant.sheath == plant.sheath:
            self.sheath: SheathPath = old.sheath
        else:
            self.sheath = sheath_path(plant.sheath, case.bend(self.edges))
        self.ones = [self.one(law.gains, law.conditioning, case.source_of(i)) for i, law in enumerate(case.laws)]
        self.numbers = [numbers_of(one) for one in self.ones]
        self.forms = [form_of(one) for one in self.ones]

    @property
    def size(self) -> float:
        """Bytes of the inputs, at most."""
        return 8.0 * (6 + self.dynamics.normals) * len(self.edges)

    def one(self, gains: Any, conditioning: Any, source: Source) -> One:
        """The numbers of a run with these gains, and this conditioning of the reference."""
        case, plant = self.case, self.case.plant
        return One(
            gains=gains,
            conditioning=conditioning,
            source=source.settings,
            plant=self.dynamics.plant,
            resistance=float(plant.motor.resistance),
            constant=float(plant.motor.torque_constant * plant.motor.gear),
            initial_motor=initial_angle(self.dynamics, case.initial_motor, self.reference),
            dt=float(plant.sample_time),
            delay=int(plant.delay),
            fault=case.fault or SensorFault(),
        )

    def goes_with(self, other: "Ready") -> bool:
        """True if one compiled call can run both."""
        mine, its = self.dynamics, other.dynamics
        fails = self.case.fault is not None
        alike = mine.kernels() == its.kernels() and fails == (other.case.fault is not None)
        return alike and self.edges is other.edges and self.forms == other.forms


def _run(group: Sequence[Ready]) -> Iterator[tuple[Outcome, ...]]:
    given, first = Given(group), group[0]
    found = np.empty((len(first.ones), len(group), len(FIGURES)))
    for j, law in enumerate(first.case.laws):
        numbers = np.array([ready.numbers[j] for ready in group])
        given.run(law, first.case.source_of(j), first.ones[j], numbers, given.rows, BatchLimits(), found[j])
    for i, ready in enumerate(group):
        outcomes = tuple(Outcome(*found[j, i].tolist()) for j in range(len(found)))
        for j, outcome in enumerate(outcomes):
            _refuse_no_number(ready, j, outcome, len(ready.reference[0]) * float(ready.case.plant.sample_time))
        yield outcomes


def _refuse_no_number(ready: Ready, number: int, outcome: Outcome, duration: float) -> None:
    """Run the law of that number again with a trace, where it or the plant, a user's own, may have given no number.

    Raises:
        ParameterError: it did.
    """
    own = ready.dynamics.file or user_law.is_own(ready.case.laws[number])
    if not own or (outcome.ended and math.isfinite(outcome.rmse)):
        return
    ready.case.trace(number, duration)


class Given:
    """What the runs of a group are given over time, ready for compiled calls, and the memory that these work in."""

    def __init__(self, group: Sequence[Ready]) -> None:
        cycles = len(group[0].edges) - 1
        references, which = _distinct([ready.reference for ready in group], id)
        sheaths, bent = _distinct([ready.sheath for ready in group], id)
        noises, noise = _distinct(group, _noise)
        normals = np.empty((len(noises), cycles, group[0].dynamics.normals))
        for row, ready in zip(normals, noises, strict=True):
            ready.case.plant.draw(ready.case.seed, row)
        self._inputs = BatchInputs(
            np.stack(references),
            np.stack([path.bends for path in sheaths]),
            np.stack([path.widths for path in sheaths]),
            np.stack([path.slope_factors for path in sheaths]),
            normals,
        )
        self._dynamics, self._fails = group[0].dynamics, group[0].case.fault is not None
        self.rows = np.array([[cycles, which[i], bent[i], noise[i]] for i in range(len(group))], dtype=np.int64)
        """Of each run, as `bowden.sim.batch.run_batch` takes them."""
        self.scratch: Array = np.empty((ROWS, cycles))

    def run(
        self,
        law: Law,
        source: Source,
        like: One,
        numbers: Array,
        rows: NDArray[np.int64],
        limits: BatchLimits,
        found: Array,
    ) -> None:
        """`bowden.sim.batch.run_batch` for a law and a source; fills `found`."""
        with self._dynamics.explained():
            compiled_batch(self._dynamics, law, source, fails=self._fails)(
                like, numbers, rows, self._inputs, limits, self.scratch, found
            )


def _noise(ready: Ready) -> tuple[Any, ...]:
    """By what the normal numbers of runs are distinguished: the seed, and all of the plant that `draw` may look at."""
    plant = ready.case.plant
    return ready.case.seed, type(plant), plant.joint_encoder, getattr(plant, "motor_encoder", None)


def _distinct(values: Sequence[Any], name: Callable[[Any], Any]) -> tuple[list[Any], list[int]]:
    """Each of them once, distinguished by a name, and where each of the given ones is among them."""
    kept: dict[Any, Any] = {}
    for value in values:
        kept.setdefault(name(value), value)
    places = {key: i for i, key in enumerate(kept)}
    return list(kept.values()), [places[name(value)] for value in values]


def compiled_batch(dynamics: Dynamics, law: Law, source: Source = TABLE, *, fails: bool = False) -> Callable[..., None]:
    """`run_batch` with these kernels in it, compiled at the first call and cached on disk.

    Args:
        dynamics: of the plant.
        law: whose.
        source: of the reference.
        fails: whether a sensor may go wrong in it.
    """
    return specialise(run_batch, f"{law.name}_{dynamics.name}", **placeholders(dynamics, law, source, fails=fails))


_TENSIONS = ("flexor_tension", "flexor_motor_tension", "extensor_tension", "extensor_motor_tension")


class SuitOutcome(NamedTuple):
    """What came of one run of the suit; NaN where a figure does not exist."""

    run: Outcome
    """Of the elbow itself: the reference's error, the motor's energy, whether it ran away."""
    shown_rmse: float
    """Of the elbow as its sensor shows it to the law, from rest [rad]."""
    largest_tension: float
    """Of both cables, at the arm and at the spool [N]."""
    largest_torque: float
    """Of the suit on the elbow, |interaction torque| [N·m]."""
    hottest_winding: float
    """[°C]"""


def simulate_suits(cases: Iterable[Case], duration: float) -> Iterator[tuple[SuitOutcome, ...]]:
    """Run all laws of every case for `duration` [s]; an outcome for each law of each case, in their order.

    Each run is a trace of its own: a minute of the suit takes a hundred times what its trace does.

    Raises:
        ParameterError: a duration or a part of a suit that cannot be.
    """
    for case in cases:
        yield tuple(suit_outcome(case.trace(i, duration)) for i in range(len(case.laws)))


def suit_outcome(trace: Trace) -> SuitOutcome:
    """The figures of a suit's trace."""
    run, nothing = outcome_of(trace), float("nan")
    if not run.ended:
        return SuitOutcome(run, *[nothing] * 4)
    return SuitOutcome(
        run=run,
        shown_rmse=metrics.rmse(trace["joint_measured"] - trace["reference"]),
        largest_tension=float(max(trace[name].max() for name in _TENSIONS)),
        largest_torque=float(np.abs(trace["interaction_torque"]).max()),
        hottest_winding=float(trace["winding_temperature"].max()),
    )


def outcome_of(trace: Trace) -> Outcome:
    """The figures of a batch's run, of a trace."""
    lasted, nothing = int(np.isfinite(trace["joint"]).sum()), float("nan")
    if not trace.ended:
        return Outcome(float(lasted), 0.0, 0.0, *[nothing] * 8)
    time, error, velocity, commands = trace.time, trace.error, trace["reference_velocity"], trace["command"]
    late, moved = time >= LATE, float(np.sum(velocity * velocity))
    mechanical, electrical = (metrics.energy(time, power) for power in trace.power())
    # sums are NumPy's, not the dot product of a library whose order depends on its threads
    return Outcome(
        cycles=float(lasted),
        ended=1.0,
        stable=float(trace.stable),
        rmse=metrics.rmse(error),
        rmse_after_10s=metrics.rmse(error[late]) if late.any() else nothing,
        peak=float(np.max(np.abs(error))),
        lag=-float(np.sum(error * velocity)) / moved if moved > 0.0 else nothing,
        command_travel=float(np.abs(np.diff(commands, prepend=trace.settings["initial_motor"])).sum()),
        largest_command=float(np.abs(commands).max()),
        mechanical_energy=mechanical,
        electrical_energy=electrical,
    )
