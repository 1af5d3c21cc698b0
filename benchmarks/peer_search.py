"""Two libraries' global searches for a cable's parameters against ours, on the same logs and the same kernel.

A genetic algorithm is the paper's way; differential evolution is what SciPy offers for such a problem.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path as File
from typing import Any

import numpy as np
import pygad
from numpy.typing import NDArray
from scipy.optimize import differential_evolution

import bowden
from bowden.control import LAWS
from bowden.control.reference import Multisine
from bowden.core.kernel import compiled, kernel
from bowden.core.units import DEGREES
from bowden.identify.cable.bouc_wen import BoucWenCable
from bowden.identify.cable.path import Path, build_path
from bowden.identify.cable.turns import find_turns, motor_noise
from bowden.identify.log.read import read_log
from bowden.models.cable.bouc_wen import BoucWen, saturation, travel_step
from bowden.models.cable.bouc_wen_sensitivity import hysteresis
from bowden.plants.predicted import bouc_wen
from bowden.plants.presets import bench as paper
from bowden.sim import run
from measure import Row, Timing, by_turns

Array = NDArray[np.float64]
BUDGET, SEEDS, CLOSE = 6.0, (1, 2, 3), 1.05
"""Seconds of each search, its seeds, and how near to our error counts as reaching it."""
NODES, THIN, JUDGED = 2500, 150, 600
"""Nodes of the path in our fine and global stage, and in the searches' cost."""
REAL = File(__file__).parents[2] / "shared" / "data" / "cable" / "R_5_20.csv.gz"

LOW = np.array([-2.0, -1.0, np.log(0.5), np.log(0.04), 1.0])
HIGH = np.array([2.0, 1.0, np.log(300.0), np.log(50.0), 6.0])
"""Bounds of the genes: αφ, αh, ln ρ, ln(σ − ½), n. The logarithms are a help: on ρ and σ themselves it does worse."""


@dataclass(frozen=True)
class HalfLog:
    """A log, of which the first half is fitted and the second judges."""

    name: str
    time: Array
    motor: Array
    joint: Array

    @property
    def split(self) -> int:
        return len(self.time) // 2

    def path(self, nodes: int, *, whole: bool = False) -> Path:
        """The first half, or the whole, thinned and freed of the motor's noise."""
        part = slice(0, len(self.time) if whole else self.split)
        turns = find_turns(self.motor[part], motor_noise(self.motor[part]))
        return build_path(self.time[part], self.motor[part], self.joint[part], turns, nodes)

    def test_rms(self, parameters: dict[str, float]) -> float:
        """Error on the second half, simulated from the log's start [rad]."""
        path = self.path(2 * NODES, whole=True)
        unseen = path.with_weight(np.where(path.time > self.time[self.split], path.weight, 0.0))
        return error_on(unseen, bouc_wen(parameters, path.motor))


@dataclass(frozen=True)
class Search:
    """One run of a search."""

    reached: float | None
    """When it came as near as `CLOSE` to the error to reach [s]."""
    error: float
    """At the end of the budget, on the path [rad]."""
    test_rms: float
    generations: int


def simulated_log() -> HalfLog:
    """The bench under a multisine without compensation, as its encoders show it."""
    motion = Multisine((0.11, 0.37), (0.45, 0.2), (0.0, 1.0), centre=0.6)
    trace = run.simulate(paper.bench(), LAWS["uncompensated"], motion, duration=20.0, seed=5)
    return HalfLog("simulated bench", trace.time, trace["motor_measured"], trace["joint_measured"])


def logs() -> list[HalfLog]:
    """The simulated log, and a measured one where it is at hand."""
    found = [simulated_log()]
    if REAL.is_file():
        real = read_log(REAL)
        found.append(HalfLog(f"measured cable {REAL.name.split('.')[0]}", real.time, real.motor, real.joint))
    return found


def ours(log: HalfLog) -> dict[str, float]:
    """Bouc–Wen as `identify` fits it: global stage on few nodes, gradient stage on many."""
    return BoucWenCable(log.path(THIN), 0).fit(log.path(NODES)).parameters


def error_on(path: Path, joint: Array) -> float:
    """Weighted RMS error of a predicted joint (n,) [rad]."""
    return float(np.sqrt(np.average((joint - path.joint) ** 2, weights=path.weight)))


@kernel
def errors(motor: Array, joint: Array, weight: Array, genes: Array) -> Array:
    """RMS error (m,) of each candidate of `genes` (m, 5), the offset solved exactly, h zero at the start.

    The paper's equations in Runge–Kutta steps exact to about 1e-5, left out once h is saturated: as accurate as the
    search needs and several times faster than `hysteresis`.
    """
    found, total = np.empty(genes.shape[0]), np.sum(weight)
    for i in range(genes.shape[0]):
        n, shape = genes[i, 4], 0.5 + np.exp(genes[i, 3])
        cable = BoucWen(genes[i, 0], genes[i, 1], np.exp(genes[i, 2]), shape, n, 0.0)
        bound = saturation(cable)
        piece = 0.2 / (cable.rate * (1.0 + n / bound * max(1.0, 1.0 / (2.0 * shape - 1.0))))
        h, first, second = 0.0, 0.0, 0.0
        for k in range(motor.size):
            travel = motor[k] - motor[k - 1] if k > 0 else 0.0
            direction, left = np.sign(travel), np.abs(travel)
            while left > 0.0 and np.abs(direction * bound - h) > 1e-6 * bound:
                h = travel_step(h, direction * min(left, piece), cable)
                left -= piece
            error = cable.slope * motor[k] + cable.hysteresis_gain * h - joint[k]
            first += weight[k] * error
            second += weight[k] * error * error
        found[i] = np.sqrt(max(0.0, second / total - (first / total) ** 2))
    return found


class Budget:
    """Counts a search's generations and says when its time is over; the clock starts at the first cost."""

    def __init__(self, path: Path) -> None:
        self._path, self._cost = path, compiled(errors)
        self.best: list[tuple[float, float, Array]] = []
        self.cost(np.zeros((1, 5)))  # compiled before the clock starts
        self._start = time.process_time()

    def cost(self, genes: Array) -> Array:
        """Errors (m,) of candidates (m, 5) [rad]."""
        path = self._path
        return self._cost(path.motor, path.joint, path.weight, np.ascontiguousarray(genes, dtype=np.float64))

    def over(self, genes: Array, error: float) -> bool:
        """Take down a generation's best; whether the budget is spent."""
        seconds = time.process_time() - self._start
        self.best.append((seconds, error, np.array(genes, dtype=np.float64)))
        return seconds > BUDGET


def genetic(budget: Budget, seed: int) -> None:
    """The paper's five parameters by pygad."""

    def fitness(algorithm: Any, genes: Array, index: Any) -> Array:
        return -budget.cost(genes)

    def after_generation(algorithm: Any) -> str | None:
        genes, value, _ = algorithm.best_solution(algorithm.last_generation_fitness)
        return "stop" if budget.over(genes, -float(value)) else None

    pygad.GA(
        num_generations=1_000_000,
        sol_per_pop=60,
        num_parents_mating=30,
        num_genes=5,
        gene_space=[{"low": low, "high": high} for low, high in zip(LOW, HIGH, strict=True)],
        fitness_func=fitness,
        fitness_batch_size=60,
        parent_selection_type="tournament",
        crossover_type="sbx",
        mutation_type="polynomial",
        mutation_probability=0.2,
        keep_elitism=2,
        on_generation=after_generation,
        random_seed=seed,
        suppress_warnings=True,
    ).run()


def evolution(budget: Budget, seed: int) -> None:
    """The same five by SciPy's differential evolution, a generation's candidates in one call."""

    def after_generation(intermediate_result: Any) -> None:
        if budget.over(intermediate_result.x, float(intermediate_result.fun)):
            raise StopIteration

    differential_evolution(
        lambda genes: budget.cost(genes.T),
        list(zip(LOW, HIGH, strict=True)),
        popsize=12,
        maxiter=1_000_000,
        tol=0.0,
        atol=0.0,
        polish=False,
        vectorized=True,
        updating="deferred",
        callback=after_generation,
        rng=np.random.default_rng(seed),
    )


SEARCHES: dict[str, Callable[[Budget, int], None]] = {"genetic": genetic, "differential evolution": evolution}


def searched(search: Callable[[Budget, int], None], log: HalfLog, target: float, seed: int) -> Search:
    """One run of a search, and what its best candidate is worth."""
    path = log.path(JUDGED)
    budget = Budget(path)
    search(budget, seed)
    slope, gain, log_rate, log_shape, exponent = budget.best[-1][2].tolist()
    cable = BoucWen(slope, gain, math.exp(log_rate), 0.5 + math.exp(log_shape), exponent)
    joint = cable.slope * path.motor + cable.hysteresis_gain * hysteresis(path.motor, 0.0, cable)
    offset = float(np.average(path.joint - joint, weights=path.weight))
    return Search(
        reached=next((seconds for seconds, error, _ in budget.best if error <= CLOSE * target), None),
        error=error_on(path, joint + offset),
        test_rms=log.test_rms({**cable._asdict(), "offset": offset, "initial_h": 0.0}),
        generations=len(budget.best),
    )


def rows(rounds: int = 5) -> tuple[list[Row], list[str]]:
    """The comparison's rows and notes."""
    found: list[Row] = []
    notes = [
        "Searches: the paper's five parameters (ρ and σ on a logarithmic scale), 60 individuals, "
        f"{BUDGET:g} s a run, seeds {', '.join(map(str, SEEDS))}; their compiled cost is the same equations' error "
        f"over {JUDGED} nodes of the first half, offset solved exactly. Genetic: pygad, tournament, SBX crossover, "
        "polynomial mutation. Differential evolution: SciPy, its default strategy, a generation in one call, no "
        f"polishing. A search has reached our error when it is within {100 * (CLOSE - 1):.0f} % of it on those nodes. "
        "Ours: path, global and gradient stage of Bouc–Wen, which also fits h at the start."
    ]
    for log in logs():
        parameters = ours(log)
        path = log.path(JUDGED)
        target = error_on(path, bouc_wen(parameters, path.motor))
        timing = by_turns(rounds, ours=lambda log=log: ours(log))["ours"]
        mine = log.test_rms(parameters)
        said = []
        what = f"Bouc–Wen from a log ({log.name})"
        for name, search in SEARCHES.items():
            runs = [searched(search, log, target, seed) for seed in SEEDS]
            reached = [run.reached for run in runs if run.reached is not None]
            within = f"{len(reached)} of {len(runs)} within {BUDGET:g} s"
            if len(reached) == len(runs):
                peer, ratio = f"{Timing(tuple(reached))}", f"{np.median(reached) / timing.median:.0f}"
            else:
                peer, ratio = within, f"> {BUDGET / timing.median:.0f}"
            theirs = float(np.median([run.test_rms for run in runs]))
            found += [
                Row(f"{what}, {name}: time to our error", timing, peer, ratio, "× faster", "–"),
                Row(
                    f"the same: error on the half not fitted, {name} after {BUDGET:g} s",
                    f"{mine * DEGREES:.4f}°",
                    f"{theirs * DEGREES:.4f}°",
                    f"{theirs / mine:.2f}",
                    "× ours",
                    "–",
                ),
            ]
            said.append(
                f"{name} {', '.join(f'{run.error * DEGREES:.4f}°' for run in runs)} after "
                f"{', '.join(str(run.generations) for run in runs)} generations, {within} at our error"
            )
        whole = bowden.identify(log.time, log.motor, log.joint)
        notes.append(
            f"{log.name} ({len(log.time)} samples): on the fitted half ours {target * DEGREES:.4f}°, "
            f"{'; '.join(said)}; all families with their comparison (`identify`) took {whole.seconds:.2f} s."
        )
    return found, notes
