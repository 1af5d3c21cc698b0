"""Cells that no law has seen: a rig, its sheath's path, what is asked of it and what the laws know, from a number.

Every cell is drawn from its set's key and its number alone. Each of its parts belongs to a family of `FAMILIES`; the
parts are drawn independently, so that a judging set has combinations that nobody thought of.
"""

import itertools
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bowden.control.knowledge import IDENTIFIED, Knowledge
from bowden.control.reference import PeriodicMinimumJerk, PointToPoint, Trajectory
from bowden.core.units import RADIANS
from bowden.models.cable.bouc_wen import BoucWen, saturation
from bowden.models.cable.capstan import Tendon
from bowden.models.cable.sheath import Sheath
from bowden.models.cable.sheath_path import BendPath, constant_bend, scripted_bend
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.servo import Servo
from bowden.models.minimum_jerk import minimum_jerk_over
from bowden.plants.bench import Bench
from bowden.plants.cable import Cable
from bowden.plants.friction_cables import sliding
from bowden.plants.knowledge_of import knowledge_of
from bowden.sim.run import Case
from unseen_rig import OPERATORS, PUSHES, Worn, WornCable, WornRig, worn_cable

Array = NDArray[np.float64]

SETS = {"development": 1, "validation": 2, "judging": 3}
"""Set → its key, which goes into every draw: no two sets share a seed."""
DURATION = 20.0
"""Of a cell [s]."""

FAMILIES: dict[str, dict[str, float]] = {
    "cable": {
        "play": 3,
        "rounded": 2,
        "soft": 2,
        "dips": 3,  # the printed Bouc–Wen cable, whose joint first runs the wrong way
        "wedge": 2,
        "stribeck": 2,
        "capstan": 2,
        "slack": 2,
    },
    "load": {"follows": 4, "lagging": 2, "swinging": 1},
    "sheath": {
        "still": 3,
        "moved slowly": 2,
        "moved fast": 2,
        "moved at once": 1,
        "moved at rest": 2,
        "moved at turns": 2,
    },
    "servo": {"as known": 5, "under-damped": 2, "wrongly known": 2},
    "reference": {
        "periodic": 3,
        "point to point": 3,
        "stop and reverse": 3,
        "tiny": 2,
        "slow": 2,
        "fast": 2,
        "stepped": 1,
        "noisy velocity": 1,
        "no derivatives": 1,
        "held": 1,  # given anew 20 to 100 times a second, without derivatives
    },
    "wearer": {"none": 5, "pushes": 2, "tremor": 2, "walking": 2, "breathing": 1},
    "knowledge": {"nothing of the cable": 5, "slope": 4, "identified": 1},
    # what follows is on top, each with its own probability
    "creep": {"no": 9, "creep": 1},
    "stop": {"no": 19, "stop": 1},
    "link": {"whole": 11, "losses": 1},
    "sensor": {"prompt": 9, "lagging sensor": 1},
    "drive": {"free": 10, "saturated": 1, "sticking": 1},
    "geometry": {"even": 8, "curved": 1},
}
"""Part → its families with their weights."""


@dataclass(frozen=True)
class Cell:
    """A drawn cell."""

    number: int
    families: dict[str, str]
    """Part → family."""
    rig: WornRig
    bend: BendPath
    reference: Trajectory
    known: Knowledge
    """What every law knows."""
    initial_motor: float
    """[rad]"""
    allowed: float
    """Largest error of a run that counts as stable: the stroke, 5° at least, and what the wearer alone may do [rad]."""

    @property
    def special(self) -> str:
        """The families that are not the part's first."""
        return ", ".join(name for part, name in self.families.items() if name != next(iter(FAMILIES[part])))


def random_of(set_name: str, number: int) -> np.random.Generator:
    """The random numbers of a cell."""
    return np.random.default_rng([16, SETS[set_name], number])


def draw(set_name: str, number: int, rate: float = 0.0) -> Cell:
    """The cell of that number in that set; where a rate is given, with that clock and the same delay [Hz]."""
    random = random_of(set_name, number)
    families = {part: _one_of(random, weights) for part, weights in FAMILIES.items()}
    dt = float(random.choice([4e-3, 2e-3, 1e-3, 5e-4], p=[0.15, 0.2, 0.45, 0.2]))
    delay = int(random.integers(1, 9))
    if rate:
        dt, delay = 1.0 / rate, max(1, round(delay * dt * rate))
    stroke = float(random.uniform(20.0, 90.0)) * RADIANS
    motion = _motion(random, families, stroke)
    path, physical = _sheath_path(random, families["sheath"], motion), families["cable"] in ("capstan", "slack")
    loss = 0.0 if physical else float(random.uniform(0.0, 0.15))
    frequency = math.exp(random.uniform(math.log(15.0), math.log(120.0)))
    damping = float(random.uniform(0.3, 0.55) if families["servo"] == "under-damped" else random.uniform(0.7, 1.2))
    saturated = families["drive"] == "saturated"
    resolution = 2.0 * math.pi / 2.0 ** int(random.integers(12, 18))
    encoder = Encoder(resolution, float(random.uniform(0.2, 1.0)) * resolution + 0.002 * RADIANS)
    inner = Bench(
        cable=drawn_cable(random, families),
        sheath=Sheath(bend=1.0, gap=1.0, loss=loss),
        servo=Servo(frequency, damping, speed_limit=float(random.uniform(1.5, 4.0)) if saturated else math.inf),
        joint_encoder=encoder,
        motor_encoder=encoder,
        sample_time=dt,
        delay=delay,
        load_lag=float(random.uniform(0.005, 0.06)) if families["load"] == "lagging" else 0.0,
    )
    rig = WornRig(inner, _worn(random, families, motion))
    asked = motion.asked.sample(np.linspace(0.0, DURATION, 2001))[:, 0]
    start, allowed = float(asked[0]), max(float(np.ptp(asked)), 5.0 * RADIANS) + _by_the_wearer(rig.worn)
    motor = inner.resting_motor(start, float(path(np.zeros(1))[0]))
    return Cell(number, families, rig, path, motion.asked, _known(random, families, rig), motor, allowed)


def case_of(cell: Cell, laws: Any) -> Case:
    """The cell for `bowden.sim.many.simulate_many`, with laws that know what is known."""
    return Case(cell.rig, laws, cell.reference, cell.bend, cell.number, cell.initial_motor)


def _one_of(random: np.random.Generator, weights: dict[str, float]) -> str:
    shares = np.array(list(weights.values()))
    return str(list(weights)[int(random.choice(len(shares), p=shares / shares.sum()))])


def drawn_cable(random: np.random.Generator, families: dict[str, str]) -> Cable:
    """A cable of the families of `cable` and `geometry`."""
    kind = families["cable"]
    if kind in ("capstan", "slack"):
        slack = float(random.uniform(0.0003, 0.0015)) if kind == "slack" else 0.0
        pretension = 0.0 if kind == "slack" else float(random.uniform(0.05, 0.2))
        friction, bend = float(random.uniform(0.08, 0.2)), float(random.uniform(1.5, 4.0))
        return sliding(Tendon(friction=friction, bend=bend, pretension=pretension, slack=slack))
    slope = float(random.uniform(0.7, 1.15))
    half = math.exp(random.uniform(math.log(1.0), math.log(6.0))) * RADIANS
    halves, weights, height, rate = [half] * OPERATORS, [1.0 / OPERATORS] * OPERATORS, 0.0, 1.0
    printed = BoucWen()
    if kind == "rounded":
        halves = [share * half for share in (0.4, 0.8, 1.2, 1.6)]
        weights = random.dirichlet([2.0] * OPERATORS).tolist()
    elif kind in ("soft", "dips"):
        halves = [0.0] * OPERATORS
        height = -slope * half / float(saturation(printed))
        steep = 1.27 if kind == "dips" else float(random.uniform(0.4, 0.95))
        rate = steep * slope / abs(height)
    cable = WornCable(
        slope=slope,
        half_widths=tuple(halves),
        weights=tuple(weights),
        height=height,
        rate=rate,
        curve=float(random.choice([-1.0, 1.0]) * random.uniform(0.1, 0.3)) if families["geometry"] == "curved" else 0.0,
        wedge=float(random.uniform(0.3, 1.0)) if kind == "wedge" else 0.0,
        stribeck=float(random.uniform(0.3, 1.0)) if kind == "stribeck" else 0.0,
        stribeck_speed=float(random.uniform(0.03, 0.3)),
        place=float(random.uniform(-1.0, 1.0)),
    )
    return worn_cable(cable)


@dataclass(frozen=True)
class _Motion:
    """What is asked for, and when it rests and turns."""

    asked: Trajectory
    holds: list[tuple[float, float]]
    turns: list[float]


@dataclass(frozen=True)
class Steps:
    """Set points that jump; their velocity is given as 0."""

    times: tuple[float, ...]
    positions: tuple[float, ...]

    def sample(self, time: Array) -> Array:
        """See `Trajectory.sample`."""
        at = np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, len(self.positions) - 1)
        found = np.zeros((len(time), 3))
        found[:, 0] = np.asarray(self.positions)[at]
        return found

    def describe(self) -> dict[str, Any]:
        """See `Trajectory.describe`."""
        return {"kind": "steps", "times": list(self.times), "positions": list(self.positions)}


@dataclass(frozen=True)
class Blended:
    """Speeds of an intent that goes, stops and turns: piecewise constant, each reached by minimum jerk."""

    times: tuple[float, ...]
    speeds: tuple[float, ...]
    blend: float
    """[s]"""

    def sample(self, time: Array) -> Array:
        """See `Trajectory.sample`; the position is the speed's sum over steps of 0.5 ms."""
        fine = np.arange(0.0, DURATION + 1e-3, 5e-4)
        speed, gain = (self._speeds(fine, column) for column in (0, 1))
        position = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]) * 5e-4)])
        return np.stack([np.interp(time, fine, values) for values in (position, speed, gain)], axis=1)

    def _speeds(self, time: Array, column: int) -> Array:
        speeds = np.asarray(self.speeds)
        at = np.clip(np.searchsorted(self.times, time, side="right") - 1, 0, len(speeds) - 1)
        before = np.where(at > 0, speeds[at - 1], 0.0)
        since = np.minimum(time - np.asarray(self.times)[at], self.blend)
        return np.asarray(minimum_jerk_over(before, speeds[at], self.blend, since)[column])

    def describe(self) -> dict[str, Any]:
        """See `Trajectory.describe`."""
        return {"kind": "blended", "times": list(self.times), "speeds": list(self.speeds), "blend": self.blend}


@dataclass(frozen=True)
class PoorSource:
    """A motion as a poor source gives it: with a noisy velocity, without derivatives, or held between its ticks."""

    motion: Trajectory
    noise: float
    """Standard deviation of the velocity, in each cycle anew [rad/s]."""
    derivatives: bool
    tick: float
    """Time between two values; 0 for each cycle [s]."""
    seed: int

    def sample(self, time: Array) -> Array:
        """See `Trajectory.sample`."""
        found = self.motion.sample(np.floor(time / self.tick) * self.tick if self.tick > 0.0 else time)
        if not self.derivatives:
            found[:, 1:] = 0.0
        if self.noise > 0.0:
            found[:, 1] += self.noise * np.random.default_rng(self.seed).standard_normal(len(time))
        return found

    def describe(self) -> dict[str, Any]:
        """See `Trajectory.describe`."""
        return {"kind": "poor_source", "motion": self.motion.describe(), "noise": self.noise, "tick": self.tick}


def _motion(random: np.random.Generator, families: dict[str, str], stroke: float) -> _Motion:
    kind = families["reference"]
    if kind in ("noisy velocity", "no derivatives", "held"):
        inner = _moves(random, families, stroke, str(random.choice(["periodic", "point to point"])))
        noise = float(random.uniform(0.5, 5.0)) * RADIANS if kind == "noisy velocity" else 0.0
        tick = 1.0 / float(random.uniform(20.0, 100.0)) if kind == "held" else 0.0
        seed = int(random.integers(0, 2**31))
        return _Motion(PoorSource(inner.asked, noise, kind == "noisy velocity", tick, seed), inner.holds, inner.turns)
    return _moves(random, families, stroke, kind)


def _moves(random: np.random.Generator, families: dict[str, str], stroke: float, kind: str) -> _Motion:
    if families["sheath"] == "moved at rest" and kind in ("periodic", "slow", "fast"):
        kind = "point to point"  # there has to be a rest
    if kind in ("periodic", "slow", "fast"):
        low, high = {"periodic": (5.0, 12.0), "slow": (18.0, 30.0), "fast": (1.5, 3.0)}[kind]
        period = float(random.uniform(low, high))
        return _Motion(
            PeriodicMinimumJerk(0.0, stroke, period),
            [],
            [0.5 * period * k for k in range(1, int(2.0 * DURATION / period) + 1)],
        )
    if kind == "tiny":
        stroke = float(random.uniform(1.0, 5.0)) * RADIANS
    times, at, holds = [0.0], [0.0], []
    if kind == "stop and reverse":
        return _stop_and_reverse(random, stroke)
    while times[-1] < DURATION:
        goal = float(random.uniform(0.0, 1.0)) * stroke
        rest = float(random.uniform(0.2, 2.5))
        holds.append((times[-1], times[-1] + rest))
        times.append(times[-1] + rest)
        at.append(at[-1])
        if kind != "stepped":
            times.append(times[-1] + float(random.uniform(0.6, 2.5)))
            at.append(goal)
        else:
            jump = float(random.choice([-1.0, 1.0]) * random.uniform(1.0, 20.0)) * RADIANS
            at[-1] = float(np.clip(at[-2] + jump, 0.0, stroke))
    asked: Trajectory = Steps(tuple(times), tuple(at)) if kind == "stepped" else PointToPoint(tuple(times), tuple(at))
    steps = np.diff(at)
    moved = [k for k in range(len(steps)) if steps[k] != 0.0]
    turns = [times[k] for j, k in itertools.pairwise(moved) if steps[j] * steps[k] < 0.0]
    return _Motion(asked, holds, turns)


def _stop_and_reverse(random: np.random.Generator, stroke: float) -> _Motion:
    """Goes and stops within the stroke; a way of `speed` for `length` moves speed·length, since blends are even."""
    times, speeds, holds, turns, at, way = [0.0], [0.0], [], [], 0.0, 1.0
    blend, fastest = float(random.uniform(0.1, 0.4)), float(random.uniform(0.3, 1.0)) * stroke
    while times[-1] < DURATION:
        rest = 0.0 if random.uniform() < 0.3 else float(random.uniform(0.2, 1.5))  # some turn without a stop
        begin, length = times[-1] + blend + rest, blend + float(random.uniform(0.1, 1.6))
        if rest > 0.0:
            holds.append((times[-1] + blend, begin))
        else:
            begin = times[-1]
        turning = rest == 0.0 or random.uniform() < 0.5
        if (stroke - at if (way > 0.0) != turning else at) < 0.1 * stroke:
            turning = not turning
        way = -way if turning else way
        if turning:
            turns.append(begin)
        speed = min(float(random.uniform(0.3, 1.0)) * fastest, (stroke - at if way > 0.0 else at) / length)
        at += way * speed * length
        if begin > times[-1]:
            times, speeds = [*times, begin], [*speeds, way * speed]
        else:
            speeds[-1] = way * speed
        times, speeds = [*times, begin + length], [*speeds, 0.0]
    return _Motion(Blended(tuple(times), tuple(speeds), blend), holds, turns)


def _sheath_path(random: np.random.Generator, kind: str, motion: _Motion) -> BendPath:
    """How the sheath is moved: the width goes between 0.6 and 2.5 times what it was."""
    first = float(random.uniform(0.8, 1.6))
    if kind == "still":
        return constant_bend(first)
    if kind == "moved at rest":
        begins = [(float(a), max(0.15, 0.8 * (b - a))) for a, b in motion.holds]
    elif kind == "moved at turns":
        begins = [(max(0.05, t - 0.1), 0.3) for t in motion.turns]
    else:
        longest = {"moved slowly": (4.0, 12.0), "moved fast": (0.3, 1.0), "moved at once": (0.01, 0.05)}[kind]
        begins, time = [], float(random.uniform(0.5, 3.0))
        while time < DURATION:
            length = float(random.uniform(*longest))
            begins.append((time, length))
            time += length + float(random.uniform(0.5, 5.0))
    times, bends = [0.0], [first]
    for begin, length in begins:
        if begin > times[-1] + 1e-3 and random.uniform() < 0.8:
            times += [begin, begin + length]
            bends += [bends[-1], float(random.uniform(0.6, 2.5))]
    if len(times) < 2:
        return constant_bend(first)
    return scripted_bend(times, bends)


def _worn(random: np.random.Generator, families: dict[str, str], motion: _Motion) -> Worn:
    worn = Worn()
    if families["load"] == "swinging":
        frequency, damping = float(random.uniform(12.0, 50.0)), float(random.uniform(0.08, 0.5))
        worn = worn._replace(load_frequency=frequency, load_damping=damping)
    kind = families["wearer"]
    if kind == "pushes":
        times = np.sort(random.uniform(1.0, DURATION, PUSHES)).tolist()
        for i, (begin, _) in enumerate(motion.holds[: PUSHES // 2]):
            times[i] = begin + 0.1  # some at rest
        worn = worn._replace(
            push_times=tuple(times),
            push_lengths=tuple(random.uniform(0.1, 1.5, PUSHES).tolist()),
            push_sizes=tuple(
                (random.choice([-1.0, 1.0], PUSHES) * random.uniform(0.5, 5.0, PUSHES) * RADIANS).tolist()
            ),
        )
    elif kind != "none":
        slowest, fastest, least, most = {
            "tremor": (4.0, 12.0, 0.1, 1.0),
            "walking": (0.7, 2.2, 0.3, 3.0),
            "breathing": (0.15, 0.4, 0.3, 2.0),
        }[kind]
        frequency, size = float(random.uniform(slowest, fastest)), float(random.uniform(least, most))
        worn = worn._replace(tremor=size * RADIANS, tremor_frequency=frequency)
    if families["creep"] == "creep":
        way = float(random.choice([-1.0, 1.0]) * random.uniform(0.5, 4.0)) * RADIANS
        worn = worn._replace(creep=way, creep_time=float(random.uniform(3.0, 20.0)))
    if families["stop"] == "stop":
        asked = motion.asked.sample(np.linspace(0.0, DURATION, 2001))[:, 0]
        worn = worn._replace(stop=float(asked.min() + np.ptp(asked) * random.uniform(0.85, 0.99)))
    if families["sensor"] == "lagging sensor":
        worn = worn._replace(sensor_lag=float(random.uniform(0.003, 0.02)))
    if families["link"] == "losses":
        every = float(random.uniform(0.3, 3.0))
        worn = worn._replace(lost=float(random.uniform(0.005, 0.05)), lost_every=every)
    if families["drive"] == "sticking":
        worn = worn._replace(stick=float(random.uniform(0.05, 0.3)) * RADIANS)
    return worn


def _by_the_wearer(worn: Worn) -> float:
    """How far pushes, tremor and creep may move an uncontrolled joint, in its resonance as well [rad]."""
    moved = max(map(abs, worn.push_sizes)) + worn.tremor + abs(worn.creep)
    return 2.0 * moved * (max(1.0, 0.5 / worn.load_damping) if worn.load_frequency > 0.0 else 1.0)


def _known(random: np.random.Generator, families: dict[str, str], rig: WornRig) -> Knowledge:
    """What every law knows: servo and clock, wrongly at times; of the cable nothing, its slope, or also its width."""
    known, wrong = knowledge_of(rig), families["servo"] == "wrongly known"
    off = [float(value) for value in random.uniform(0.75, 1.3, 4)]
    late, slope = float(random.integers(-1, 2)), rig.inner.cable.slope
    if wrong:
        known = known._replace(
            servo_frequency=known.servo_frequency * off[0],
            servo_damping=known.servo_damping * off[1],
            delay=max(0.5, rig.delay + 0.5 + late) * rig.sample_time,
        )
    if families["knowledge"] == "nothing of the cable":
        return known
    known = known._replace(slope=slope * (1.0 + 0.5 * (off[2] - 1.0)))
    made = rig.inner.cable.parameters
    if families["knowledge"] == "slope" or not isinstance(made, WornCable):
        return known
    lost = 2.0 * sum(half * weight for half, weight in zip(made.half_widths, made.weights, strict=True))
    lost += 2.0 * abs(made.height) * float(saturation(BoucWen())) / made.slope
    return known._replace(width=lost * (1.0 + 0.5 * (off[3] - 1.0)), doubt=IDENTIFIED)
