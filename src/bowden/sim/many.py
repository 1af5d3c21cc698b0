"""Many closed loops at once: what `bowden.sim.batch` needs, put together from benches, laws and seeds."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from bowden.control.law import Law
from bowden.control.reference import Trajectory
from bowden.core.kernel import specialise
from bowden.core.nested import form_of, numbers_of
from bowden.plants.bench import Bench, prepare_bench
from bowden.plants.cable_body import Moving, cable_moved, cable_rest
from bowden.plants.cable_plant import CablePlant, prepare_servo
from bowden.sim.batch import BENCH, FIGURES, ROWS, Inputs, Limits, One, run_batch, spring_current, torque_current
from bowden.sim.cable_loop import check_cable
from bowden.sim.closed_loop import check_clock, edges_of, sheath_over
from bowden.sim.faulty import Fault, faulty
from bowden.sim.scenario import BendPath

Array = NDArray[np.float64]

MEMORY = 24e6
"""Bytes that the normal numbers, references and sheaths of the runs of one compiled call may take."""
SMALLEST_STROKE = np.radians(5.0)
"""What counts as the stroke of a reference that moves less [rad]."""


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
    fault: Fault | None = None
    """Of a sensor of the bench; None where none can fail, which is compiled without."""


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


class Shown(NamedTuple):
    """What came of one run, and its course; the arrays are the next run's as well."""

    outcome: Outcome
    time: Array  # (n,) [s]
    reference: Array  # (n,) [rad]
    joint: Array  # (n,) [rad]; behind the last cycle of a run that did not end, another's


def simulate_each(case: Case, duration: float) -> Iterator[Shown]:
    """The laws of one case, each run when it is asked for.

    Raises:
        ParameterError: a duration or setting that cannot be.
    """
    ready = Ready(case, duration, None)
    given, figures = Given([ready]), np.empty((1, len(FIGURES)))
    for law, one, numbers in zip(case.laws, ready.ones, ready.numbers, strict=True):
        given.run(law, one, np.array([numbers]), given.rows, Limits(), figures)
        yield Shown(Outcome(*figures[0].tolist()), ready.edges[:-1], ready.reference[0], given.scratch[1])


class Ready:
    """A case with its inputs over time; those that it shares with the case before are not made again."""

    def __init__(self, case: Case, duration: float, before: "Ready | None") -> None:
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
            self.stroke = max(float(np.ptp(self.reference[0])), SMALLEST_STROKE)
        if old is not None and old.case.bend is case.bend and old.case.plant.sheath == plant.sheath:
            self.sheath: tuple[Array, Array] = old.sheath
        else:
            self.sheath = sheath_over(plant, self.edges, case.bend)
        noisy = plant.joint_encoder.noise > 0.0 or plant.motor_encoder.noise > 0.0
        self.noise = case.seed if noisy else None
        self.ones = [one_of(case, law.gains, self.stroke) for law in case.laws]
        self.numbers = [numbers_of(one) for one in self.ones]
        self.forms = [form_of(one) for one in self.ones]

    @property
    def size(self) -> float:
        """Bytes of the inputs, at most."""
        return 56.0 * len(self.edges)

    def goes_with(self, other: "Ready") -> bool:
        """Whether one compiled call can run both."""
        fails = self.case.fault is not None
        return self.edges is other.edges and self.forms == other.forms and fails == (other.case.fault is not None)


def one_of(case: Case, gains: Any, stroke: float) -> One:
    """The numbers of a run with these gains; `stroke` is its reference's [rad]."""
    plant = case.plant
    return One(
        gains=gains,
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
        fault=case.fault or Fault(),
    )


def _run(group: Sequence[Ready]) -> Iterator[tuple[Outcome, ...]]:
    given = Given(group)
    found = np.empty((len(group[0].ones), len(group), len(FIGURES)))
    for j, law in enumerate(group[0].case.laws):
        numbers = np.array([ready.numbers[j] for ready in group])
        given.run(law, group[0].ones[j], numbers, given.rows, Limits(), found[j])
    for i in range(len(group)):
        yield tuple(Outcome(*found[j, i].tolist()) for j in range(len(found)))


class Given:
    """What the runs of a group are given over time, ready for compiled calls, and the memory that these work in."""

    def __init__(self, group: Sequence[Ready]) -> None:
        cycles = len(group[0].edges) - 1
        references, which = _distinct([ready.reference for ready in group], id)
        sheaths, bent = _distinct([ready.sheath for ready in group], id)
        noises, heard = _distinct([ready.noise for ready in group], lambda seed: seed)
        normals = np.zeros((len(noises), cycles, 2))
        for row, seed in zip(normals, noises, strict=True):
            if seed is not None:
                np.random.default_rng(seed).standard_normal(out=row)
        self._inputs = Inputs(
            np.stack(references),
            np.stack([w for w, _ in sheaths]),
            np.stack([factor for _, factor in sheaths]),
            normals,
        )
        self._plant, self._fails = group[0].case.plant, group[0].case.fault is not None
        self.rows = np.array([[cycles, which[i], bent[i], heard[i]] for i in range(len(group))], dtype=np.int64)
        """Of each run, as `bowden.sim.batch.run_batch` takes them."""
        self.scratch: Array = np.empty((ROWS, cycles))

    def run(self, law: Law, like: One, numbers: Array, rows: NDArray[np.int64], limits: Limits, found: Array) -> None:
        """`bowden.sim.batch.run_batch` for a law; fills `found`."""
        compiled_batch(self._plant, law, fails=self._fails)(
            like, numbers, rows, self._inputs, limits, self.scratch, found
        )


def _distinct(values: list[Any], name: Callable[[Any], Any]) -> tuple[list[Any], list[int]]:
    """Each of them once, told apart by a name, and where each of the given ones is among them."""
    kept: dict[Any, Any] = {}
    for value in values:
        kept.setdefault(name(value), value)
    places = {key: i for i, key in enumerate(kept)}
    return list(kept.values()), [places[name(value)] for value in values]


def compiled_batch(plant: Bench | CablePlant, law: Law, *, fails: bool = False) -> Callable[..., None]:
    """`run_batch` with the law's and the plant's kernels in it, compiled at the first call and cached on disk.

    Args:
        plant: whose.
        law: whose.
        fails: whether a sensor may go wrong in it.
    """
    parts: dict[str, Callable[..., Any]] = {"law_start": law.start_kernel, "law_step": law.step_kernel}
    if fails:
        parts["as_it_is"] = faulty
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
