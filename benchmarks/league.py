"""Every law on named plants, simulated and from recordings: ``python benchmarks/league.py``.

Each law has one set of gains for all cells (a plant in a scenario), and knows of a rig the servo and the delay, not the
cable. These cells were known while some laws were made; `unseen.py` draws cells that nobody chose, and its table is
this one's. "Late" is the run without its first ten seconds. The plants from real cables and the scenario ``elbow`` need
recordings (``--data``); without them there are fewer cells.
"""

import argparse
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import unseen
from bowden.control import LAWS, user_law
from bowden.control.knowledge import configured
from bowden.control.law import Law
from bowden.control.recorded_motion import RecordedFile, read_motion
from bowden.control.reference import PeriodicMinimumJerk, PointToPoint, Trajectory
from bowden.core.units import RADIANS
from bowden.identify.cable.identification import identify
from bowden.identify.log.read import read_log
from bowden.models.cable.capstan import Tendon
from bowden.models.cable.lumped_cable import LumpedTendon
from bowden.models.cable.sheath import Sheath
from bowden.models.cable.sheath_path import BendPath, constant_bend, scripted_bend
from bowden.models.drive.encoder import Encoder
from bowden.plants.bench import Bench
from bowden.plants.cable_plant import Cable, CablePlant
from bowden.plants.cables import as_cable_plant, identified, play
from bowden.plants.friction_cables import lumped, sliding
from bowden.plants.knowledge_of import knowledge_of
from bowden.plants.pose_cable import poses
from bowden.plants.presets.bench import default_bench, moved_sheath
from bowden.sim.many import Case, simulate_many
from kept import progress

DATA = Path(__file__).parents[2] / "shared" / "data"
STROKE = 70.0 * RADIANS
"""Of the bench's joint (Section 3.1) and of every plant that has no range of its own [rad]."""
MARGIN = 0.05
"""Share of a logged stroke that is left out at each end: a model is used where it was fitted."""
POSES = ("L_Pitch_1_000", "L_Pitch_5_000")
"""Logs of one tool at two wrist poses, pitch +60° and −60°."""
WAY_POINTS = (0.0, 0.5, 0.5, 1.0, 1.0, 0.8, 0.8, 0.9, 0.9, 0.3, 0.3, 0.4, 0.4, 0.4, 0.0, 0.0, 0.7, 0.7)
"""Shares of the stroke, every two seconds: moves of 10 to 70 %, some on, some back."""


@dataclass(frozen=True)
class LeaguePlant:
    """A plant with what its sheath does while it runs."""

    name: str
    plant: CablePlant
    bend: BendPath
    stroke: float = STROKE
    """Largest joint angle that is asked of it; the smallest is 0 [rad]."""


@dataclass(frozen=True)
class Scaled:
    """A trajectory times a number."""

    motion: Trajectory
    factor: float

    def sample(self, time: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `Trajectory.sample`."""
        return self.factor * self.motion.sample(time)

    def describe(self) -> dict[str, Any]:
        """See `Trajectory.describe`."""
        return {"kind": "scaled", "factor": self.factor, "motion": self.motion.describe()}


@dataclass(frozen=True)
class Scenario:
    """What a joint is asked to do."""

    name: str
    duration: float
    """[s]"""
    motion: Trajectory
    """For the stroke of the bench."""

    def reference(self, stroke: float) -> Trajectory:
        """The motion, scaled to a plant's stroke [rad]."""
        return self.motion if stroke == STROKE else Scaled(self.motion, stroke / STROKE)


def scenarios(data: Path | None = None) -> list[Scenario]:
    """Every scenario; that of a person's elbow where `data` has its recording."""
    times, angles = zip(*((2.0 * i, share * STROKE) for i, share in enumerate(WAY_POINTS)), strict=True)
    found = [
        Scenario("periodic", 60.0, PeriodicMinimumJerk(0.0, STROKE, 10.0)),
        Scenario("slow", 50.0, PeriodicMinimumJerk(0.0, STROKE, 25.0)),
        Scenario("fast", 20.0, PeriodicMinimumJerk(0.0, STROKE, 2.0)),
        Scenario("point_to_point", 36.0, PointToPoint(times, angles)),
    ]
    for file in sorted(data.glob("elbow/*.csv.gz"))[:1] if data else ():
        elbow = read_motion(RecordedFile(file.name, position_column="elbow_deg"), file.parent).motion
        found.append(Scenario("elbow", elbow.duration, elbow))
    return found


def plants(bench: Bench) -> list[LeaguePlant]:
    """The plants that need no data: servo, motor and encoders are the bench's where nothing else is said."""
    base, still = as_cable_plant(bench), constant_bend(bench.sheath.bend)
    own_loss = bench.sheath._replace(gap=1.0, loss=0.0)  # these cables compute their own
    cables = {
        "play": play(),
        "coulomb": lumped(),
        "dahl": lumped(LumpedTendon(dahl=True, presliding=1e-4)),
        "capstan": sliding(),
        "slack": sliding(Tendon(pretension=0.0, slack=0.001)),
    }
    encoders = {
        "coarse_encoder": Encoder(0.09 * RADIANS, 0.0),
        "noise": base.joint_encoder._replace(noise=0.05 * RADIANS),
    }
    late = base._replace(delay=max(1, round(3e-3 / base.sample_time)))
    return [
        LeaguePlant("bench", base, still),
        LeaguePlant("moved_sheath", base, moved_sheath()),
        *(LeaguePlant(name, base._replace(sheath=own_loss, cable=one), still) for name, one in cables.items()),
        *(
            LeaguePlant(name, base._replace(joint_encoder=one, motor_encoder=one), still)
            for name, one in encoders.items()
        ),
        LeaguePlant("delay_3ms", late, still),
    ]


def real_plants(bench: Bench, logs: Mapping[str, Path], wanted: Sequence[str]) -> Iterator[LeaguePlant]:
    """The bench round the recommended model of each log, and round a cable that goes between two of them."""
    base = as_cable_plant(bench)._replace(sheath=Sheath(bend=np.pi))
    for name in wanted:
        if name != "wrist_poses":
            cable, stroke = zeroed(logs[name])
            yield LeaguePlant(name, base._replace(cable=cable), constant_bend(np.pi), stroke)
            continue
        ends = [zeroed(logs[pose], "bouc_wen_static") for pose in POSES]
        turning = np.pi * np.tile([1.0, 1.0, 2.0, 2.0], 10)  # each pose is held as long as the way to the other takes
        path = scripted_bend((4.0 * np.arange(1.0, 41.0)).tolist(), turning.tolist())
        cable = poses([cable for cable, _ in ends])
        yield LeaguePlant(name, base._replace(cable=cable), path, min(stroke for _, stroke in ends))


def zeroed(path: Path, model: str | None = None) -> tuple[Cable, float]:
    """A log's cable, of the recommended model without `model`, and the joint's stroke [rad].

    Both angles count from the lower end of the stroke, since a rig's encoders are zeroed where it starts.
    """
    log = read_log(path)
    turned = np.sign(np.polyfit(log.motor, log.joint, 1)[0]) * log.motor  # the joint follows in the same direction
    low, stroke = turned.min() + MARGIN * np.ptp(turned), (1.0 - 2.0 * MARGIN) * np.ptp(turned)
    fit = identify([replace(log, motor=turned - low)])
    name = model or fit.best.name
    parameters = dict(fit.models[name].parameters)
    parameters["offset"] -= resting_joint(identified(name, parameters), 0.0)
    cable = identified(name, parameters)
    return cable, resting_joint(cable, float(stroke))


def resting_joint(cable: Cable, motor: float) -> float:
    """The joint with the motor at rest there [rad]."""
    return float(cable.look(cable.prepared, cable.start(cable.prepared, motor, 1.0, 1.0), motor, 1.0, 1.0).joint)


def runs(laws: Sequence[Law], found: Sequence[LeaguePlant], motions: Iterable[Scenario]) -> Iterator[unseen.Run]:
    """Every law on every plant in every scenario, from rest, with the same noise for all laws."""
    number = 0
    for scenario in motions:
        for one, outcomes in zip(found, simulate_many(cases(laws, found, scenario), scenario.duration), strict=True):
            number += 1
            for law, outcome in zip(laws, outcomes, strict=True):
                yield unseen.run_of(number, f"{one.name}, {scenario.name}", one.stroke, law.name, outcome)


def cases(laws: Sequence[Law], found: Iterable[LeaguePlant], scenario: Scenario) -> Iterator[Case]:
    """The plants in a scenario, with laws that know of each what a rig says."""
    for one in found:
        reference, known = scenario.reference(one.stroke), knowledge_of(one.plant)
        start = float(reference.sample(np.zeros(1))[0, 0])
        initial = one.plant.resting_motor(start, float(one.bend(np.zeros(1))[0]))
        yield Case(one.plant, tuple(configured(law, known) for law in laws), reference, one.bend, 1, initial)


def main() -> None:
    """The command."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--laws", default="", help="names and files, with commas; all without it, as in what follows")
    parser.add_argument("--plants", default="")
    parser.add_argument("--scenarios", default="")
    parser.add_argument("--data", type=Path, default=DATA, help="folder with cable/*.csv.gz and elbow/*.csv.gz")
    parser.add_argument("--cells", action="store_true", help="the RMSE of every law in every cell, too")
    given = parser.parse_args()
    logs = {file.name.removesuffix(".csv.gz"): file for file in sorted(given.data.glob("cable/*.csv.gz"))}
    laws = [user_law.load(name) if user_law.is_file(name) else LAWS[name] for name in asked(given.laws, LAWS)]
    motions, bench = {one.name: one for one in scenarios(given.data)}, default_bench()
    simulated, real = {one.name: one for one in plants(bench)}, [*logs, *["wrist_poses"] * (set(POSES) <= set(logs))]
    wanted = asked(given.plants, [*simulated, *real])
    found = [simulated[name] for name in wanted if name in simulated]
    found += real_plants(bench, logs, [name for name in wanted if name not in simulated])
    chosen = [motions[name] for name in asked(given.scenarios, motions)]
    played: list[unseen.Run] = list(
        progress(runs(laws, found, chosen), len(laws) * len(found) * len(chosen), "runs of the league")
    )
    cells: dict[str, list[unseen.Run]] = {}
    for run in played:
        cells.setdefault(run.families, []).append(run)
    print(unseen.table(unseen.standings(played)))
    least = Counter(min(row, key=lambda run: run.rmse_deg).law for row in cells.values())
    print(f"\nLeast error in, of {len(cells)} cells: " + ", ".join(f"{n} `{law}`" for law, n in least.most_common()))
    for name, row in cells.items() if given.cells else ():
        print(f"- {name}: " + ", ".join(f"{run.rmse_deg:.3f}° `{run.law}`" for run in row))


def asked(text: str, known: Iterable[str]) -> list[str]:
    """The names in a text with commas; all that are known of an empty one."""
    return text.split(",") if text else list(known)


if __name__ == "__main__":
    main()
