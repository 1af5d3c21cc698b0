"""Many closed loops at once: what `bowden.sim.batch` needs, put together from benches, laws and seeds."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.law import Law
from bowden.control.reference import Trajectory
from bowden.core.kernel import specialise
from bowden.core.refill import form_of, numbers_of
from bowden.sim.batch import BENCH, FIGURES, ROWS, Inputs, One, run_batch, spring_current, torque_current
from bowden.sim.cable_body import Moving, cable_moved, cable_rest
from bowden.sim.cable_loop import check_cable
from bowden.sim.cable_plant import CablePlant, prepare_servo
from bowden.sim.closed_loop import check_clock, edges_of, sheath_over
from bowden.sim.faulty import Fault
from bowden.sim.plant import Bench, prepare_bench
from bowden.sim.scenario import BendPath

Array = NDArray[np.float64]

MEMORY = 24e6
"""Bytes that the normal numbers, references and sheaths of the runs of one compiled call may take."""
_SMALLEST_STROKE = np.radians(5.0)


class Case(NamedTuple):
    """One plant with all that happens to it, and the laws that are set against it with the same noise."""

    plant: Bench | CablePlant
    laws: tuple[Law, ...]
    """As many, and of the same kernels, in all cases of one call."""
    reference: Trajectory
    bend: BendPath
    seed: int
    """Of the encoders' noise, as `bowden.sim.closed_loop.simulate` takes it."""
    initial_motor: float
    """[rad]"""
    fault: Fault = Fault()


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

    The runs are those of `bowden.sim.closed_loop.simulate` to the last bit, without their traces: RMSE, peak and
    energies equal those of the trace's metrics. Cases are taken from the iterable as they are needed.

    Raises:
        ParameterError: a duration or setting that cannot be.
    """
    group: list[_Ready] = []
    size = 0.0
    for case in cases:
        ready = _Ready(case, duration, group[-1] if group else None)
        if group and (size + ready.size > MEMORY or not group[0].goes_with(ready)):
            yield from _run(group)
            group, size = [], 0.0
        group.append(ready)
        size += ready.size
    if group:
        yield from _run(group)


class _Ready:
    """A case with its inputs over time; those that it shares with the case before are not made again."""

    def __init__(self, case: Case, duration: float, before: "_Ready | None") -> None:
        self.case, plant = case, case.plant
        check_clock(plant, duration)
        if not isinstance(plant, Bench):
            check_cable(plant)
        old = before if before is not None and before.case.plant.sample_time == plant.sample_time else None
        self.edges: Array = edges_of(plant, duration) if old is None else old.edges
        if old is not None and old.case.reference is case.reference:
            self.reference: Array = old.reference
            self.stroke: float = old.stroke
        else:
            self.reference = np.ascontiguousarray(case.reference.sample(self.edges[:-1]).T)
            self.stroke = max(float(np.ptp(self.reference[0])), _SMALLEST_STROKE)
        if old is not None and old.case.bend is case.bend and old.case.plant.sheath == plant.sheath:
            self.sheath: tuple[Array, Array] = old.sheath
        else:
            self.sheath = sheath_over(plant, self.edges, case.bend)
        self.ones = [_numbers(case, law, self.stroke) for law in case.laws]
        self.numbers = [numbers_of(one) for one in self.ones]
        self.forms = [form_of(one) for one in self.ones]

    @property
    def size(self) -> float:
        """Bytes of the inputs, at most."""
        return 56.0 * len(self.edges)

    def goes_with(self, other: "_Ready") -> bool:
        """Whether one compiled call can run both."""
        return self.edges is other.edges and self.forms == other.forms


def _numbers(case: Case, law: Law, stroke: float) -> One:
    plant = case.plant
    return One(
        gains=law.gains,
        plant=prepare_bench(plant)
        if isinstance(plant, Bench)
        else Moving(plant.cable.prepared, prepare_servo(plant), plant.sample_time, float(plant.load_lag)),
        encoders=(plant.joint_encoder, plant.motor_encoder),
        motor=plant.motor,
        slope=float(plant.cable.slope),
        initial_motor=float(case.initial_motor),
        dt=float(plant.sample_time),
        delay=int(plant.delay),
        substeps=int(plant.substeps),
        stroke=stroke,
        fault=case.fault,
    )


def _run(group: Sequence[_Ready]) -> Iterator[tuple[Outcome, ...]]:
    cycles = len(group[0].edges) - 1
    references, which = _distinct([ready.reference for ready in group])
    sheaths, bent = _distinct([ready.sheath for ready in group])
    normals = np.zeros((len(group), cycles, 2))
    for row, ready in zip(normals, group, strict=True):
        plant = ready.case.plant
        if plant.joint_encoder.noise > 0.0 or plant.motor_encoder.noise > 0.0:
            np.random.default_rng(ready.case.seed).standard_normal(out=row)
    inputs = Inputs(
        np.stack(references), np.stack([w for w, _ in sheaths]), np.stack([factor for _, factor in sheaths]), normals
    )
    rows = np.array([[cycles, which[i], bent[i], i] for i in range(len(group))], dtype=np.int64)
    scratch, found = np.empty((ROWS, cycles)), np.empty((len(group[0].ones), len(group), len(FIGURES)))
    for j, law in enumerate(group[0].case.laws):
        like = group[0].ones[j]
        numbers = np.array([ready.numbers[j] for ready in group])
        compiled_batch(group[0].case.plant, law)(like, numbers, rows, inputs, scratch, found[j])
    for i in range(len(group)):
        yield tuple(Outcome(*found[j, i].tolist()) for j in range(len(found)))


def _distinct(values: list[Any]) -> tuple[list[Any], list[int]]:
    """Each of them once, and where each of the given ones is among them."""
    places = {id(value): i for i, value in reversed(list(enumerate(values)))}
    kept = sorted(set(places.values()))
    return [values[i] for i in kept], [kept.index(places[id(value)]) for value in values]


def compiled_batch(plant: Bench | CablePlant, law: Law) -> Callable[..., None]:
    """`run_batch` with the law's and the plant's kernels in it, compiled at the first call and cached on disk."""
    parts: dict[str, Callable[..., Any]] = {"law_start": law.start_kernel, "law_step": law.step_kernel}
    if isinstance(plant, Bench):
        return specialise(run_batch, f"{law.name}_bench", **parts | BENCH)
    cable = plant.cable
    return specialise(
        run_batch,
        f"{law.name}_{cable.advance.__name__}",
        **parts,
        plant_rest=cable_rest,
        plant_moved=cable_moved,
        plant_current=torque_current if cable.physical else spring_current,
        cable_start=cable.start,
        cable_advance=cable.advance,
        cable_look=cable.look,
    )
