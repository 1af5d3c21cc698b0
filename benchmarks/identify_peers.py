"""Identification against methods that know nothing of cables, on the same halves of the same recordings.

Each method learns the joint from the motor on a recording's first half, and is judged on its second. Then on the
second half of another run of the same tool and pose, which it has not seen at all, and on smaller and larger strokes of
a cable that none of them has as its form: a tendon with friction all along its sheath, simulated.

Needs scikit-learn and torch: ``pip install --editable '.[bench]'``.

    python benchmarks/identify_peers.py         # all methods, and their table
    python benchmarks/identify_peers.py ours    # one anew, beside what out/bench keeps of the others
"""

import argparse
import importlib.util
import json
import time as clock
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

import bowden
from bowden.core.units import DEGREES, RADIANS
from bowden.identify.cable.one_log import follow
from bowden.identify.cable.path import build_path
from bowden.identify.cable.turns import find_turns, motor_noise, reversals
from bowden.plants.identified import CableModel
from bowden.records.metrics import rmse
from measure import table, write_rows

Array = NDArray[np.float64]
DATA = Path(__file__).parents[2] / "shared" / "data" / "cable"

RUNS = (("L_4_00", "L_4_24", "L_4_49"), ("L_Pitch_1_000", "L_Pitch_1_102"), ("L_Pitch_3_000", "L_Pitch_3_102"))
"""Runs of one tool in one pose."""
STROKES = (0.5, 0.75, 1.2)
"""Of the simulated cable, over the one that was learned from."""

KEPT = Path("out/bench/identify_peers.json")
WHAT = (
    "Errors [° RMS] of methods that learn from the first half of 12 recordings: on the second half (median, worst), on "
    "another run of the same tool and pose (median, worst; as it is, and with gain and offset fitted anew), and on "
    "strokes 0.5, 0.75 and 1.2 times as large of a simulated tendon"
)
HOW = (
    "Boosting and Gaussian process: scikit-learn's defaults. LSTM: as compared by Wang et al. (arXiv 2404.07168), "
    "20 samples in 2 s, 64 units, 100 passes, Adam at 0.001."
)
RATE = 100.0
"""Samples a second that the peers are given; the motions take 1 to 20 s a cycle."""
MEMORY = 3
"""Reversals that are told to boosting and Gaussian process, beside the way since the last one."""
POINTS = 600
"""That the Gaussian process learns from: its time grows with their cube."""
TAPS, SPACING = 20, 10
"""Of the network's history: samples of the motor, and how far apart; two seconds in all."""
UNITS, EPOCHS, BATCH, STEP = 64, 100, 64, 1e-3
"""Of the network: units of a layer, passes through the data, samples of a step, Adam's step (torch's default)."""


class Part(NamedTuple):
    """A stretch of motion, from the start of its log."""

    time: Array
    """(n,) [s]."""
    motor: Array
    """(n,) [rad]."""
    joint: Array
    """(n,) [rad]."""
    judged: NDArray[np.bool_]
    """Which samples are asked for (n,)."""


Predict = Callable[[Part], Array]
"""Joint angle at every sample of a part (n,) [rad]."""


class Learned(NamedTuple):
    """A method that has seen a first half."""

    predict: Predict
    test_rms: float | None
    """What it says of the second half itself [rad]; None where it is asked."""
    seconds: float


def ours(part: Part, log: Part) -> Learned:
    """`bowden.identify` with what it recommends; it halves the log itself."""
    begin = clock.process_time()
    fit = bowden.identify(log.time, log.motor, log.joint)
    taken = clock.process_time() - begin

    def predict(asked: Part) -> Array:
        turns = find_turns(asked.motor, motor_noise(asked.motor))
        path = build_path(asked.time, asked.motor, asked.joint, turns, len(asked.time))
        return follow(fit.best, path, asked.time)

    return Learned(predict, fit.chosen.test_rms, taken)


def memory(motor: Array) -> Array:
    """Motor, direction, way since the last reversal, and the last reversals' angles (n, 3 + MEMORY)."""
    turns = reversals(motor, max(8.0 * motor_noise(motor), 2e-3 * float(np.ptp(motor))))
    angles = np.concatenate([np.full(MEMORY, motor[0]), motor[turns]])
    passed = np.searchsorted(turns, np.arange(len(motor)), side="right") + MEMORY - 1
    last = np.stack([angles[passed - k] for k in range(MEMORY)], axis=1)
    way = motor - last[:, 0]
    return np.column_stack([motor, np.sign(way), way, last])


def history(motor: Array) -> Array:
    """The last samples of the motor at each one (n, TAPS), the oldest first."""
    padded = np.concatenate([np.full(TAPS * SPACING, motor[0]), motor])
    delays = SPACING * np.arange(TAPS - 1, -1, -1)
    return np.stack([padded[TAPS * SPACING - delay : len(padded) - delay] for delay in delays], axis=1)


Fitted = Callable[[Array], Array]
"""Features (n, k) → residual (n,)."""


def peer(features: Callable[[Array], Array], fit: Callable[[Array, Array], Fitted]) -> Callable[[Part, Part], Learned]:
    """A method on features of the motor that learns what the first half's straight line leaves.

    The line makes them go on sanely beyond the stroke; both sides are scaled to unit spread over the first half. The
    first stroke, from rest, runs off the loop: it is left out where three or more are left, as `identify` does too.
    """

    def learn(part: Part, log: Part) -> Learned:
        begin = clock.process_time()
        turns = reversals(part.motor, 0.05 * float(np.ptp(part.motor)))
        begun = int(turns[0]) if len(turns) >= 3 else 0
        motor, joint, seen = part.motor[begun:], part.joint[begun:], features(part.motor)[begun:]
        slope, offset = np.polyfit(motor, joint, 1)
        residual = joint - slope * motor - offset
        centre, spread, size = seen.mean(axis=0), seen.std(axis=0) + 1e-9, float(residual.std())
        learned = fit((seen - centre) / spread, residual / size)

        def predict(asked: Part) -> Array:
            left = learned((features(asked.motor) - centre) / spread)
            return np.asarray(slope * asked.motor + offset + size * left)

        return Learned(predict, None, clock.process_time() - begin)

    return learn


def boosting(seen: Array, residual: Array) -> Fitted:
    """scikit-learn's gradient boosting of histograms, its defaults."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    return HistGradientBoostingRegressor(random_state=0).fit(seen, residual).predict


def gaussian_process(seen: Array, residual: Array) -> Fitted:
    """Radial basis with a length of each feature, and noise; by marginal likelihood from scikit-learn's defaults."""
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel

    few = np.linspace(0, len(seen) - 1, min(POINTS, len(seen))).astype(int)
    kernel = ConstantKernel() * RBF(np.ones(seen.shape[1])) + WhiteKernel()
    return GaussianProcessRegressor(kernel, random_state=0).fit(seen[few], residual[few]).predict


def lstm(seen: Array, residual: Array) -> Fitted:
    """An LSTM over the history and a linear layer on its last output, by Adam on the mean square."""
    import torch

    torch.manual_seed(0)
    torch.set_num_threads(1)
    cell, last = torch.nn.LSTM(1, UNITS, batch_first=True), torch.nn.Linear(UNITS, 1)

    def output(given: Any) -> Any:
        return last(cell(given[:, :, None])[0][:, -1])

    inputs, wanted = (torch.tensor(one, dtype=torch.float32) for one in (seen, residual[:, None]))
    adam = torch.optim.Adam([*cell.parameters(), *last.parameters()], lr=STEP)
    for _ in range(EPOCHS):
        for some in torch.randperm(len(inputs)).split(BATCH):
            adam.zero_grad()
            torch.nn.functional.mse_loss(output(inputs[some]), wanted[some]).backward()
            adam.step()

    def predict(asked: Array) -> Array:
        with torch.no_grad():
            return np.asarray(output(torch.tensor(asked, dtype=torch.float32))[:, 0].numpy(), dtype=np.float64)

    return predict


METHODS: dict[str, tuple[str, Callable[[Part, Part], Learned]]] = {
    "ours": ("`bowden.identify`", ours),
    "boosting": ("gradient boosting on motor and reversals", peer(memory, boosting)),
    "gp": ("Gaussian process on the same", peer(memory, gaussian_process)),
    "lstm": ("LSTM on a history", peer(history, lstm)),
}


NEEDS = {"boosting": "sklearn", "gp": "sklearn", "lstm": "torch"}
"""Method → what it is made with, beside what bowden itself needs."""


def recording(path: Path) -> Part:
    """A recording, its second half to be judged."""
    log = bowden.read_log(path)
    half = 0.5 * (log.time[0] + log.time[-1])
    return Part(log.time, log.motor, log.joint, log.time >= half)


def first_half(part: Part) -> Part:
    """What may be learned from."""
    return Part(*(one[~part.judged] for one in part))


def thinned(part: Part) -> Part:
    """At the peers' rate."""
    step = max(1, round(1.0 / RATE / float(np.median(np.diff(part.time)))))
    return Part(*(one[::step] for one in part))


def simulated(stroke: float, seed: int) -> Part:
    """A tendon with friction along its sheath: sines of 30° times a stroke, noise, and the recordings' counts."""
    time = np.arange(round(20.0 * RATE)) / RATE
    motor = 30.0 * RADIANS * (1.0 + stroke * np.sin(2.0 * np.pi * 0.4 * time - 0.5 * np.pi))
    joint = CableModel("sliding", {}).joint_angle(motor)
    random = np.random.default_rng(seed)
    counts = (2.0 * np.pi / 8192.0, 2.0 * np.pi / 4000.0)
    seen = (
        count * np.round((one + 0.01 * RADIANS * random.standard_normal(len(one))) / count)
        for one, count in zip((motor, joint), counts, strict=True)
    )
    return Part(time, *seen, time >= 10.0)


class Figures(NamedTuple):
    """Errors of a method [rad]."""

    halves: list[float]
    runs: list[float]
    moved: list[float]
    """Other runs, with gain and offset of the prediction fitted anew."""
    strokes: list[float]
    seconds: list[float]


def figures(learn: Callable[[Part, Part], Learned], logs: dict[str, Part]) -> Figures:
    """All that is asked of a method."""
    found = Figures([], [], [], [], [])
    own = learn is ours
    given = logs if own else {name: thinned(log) for name, log in logs.items()}
    learned = {name: learn(first_half(log), log) for name, log in given.items()}
    for name, log in given.items():
        said = learned[name].test_rms
        found.halves.append(errors(learned[name], log)[0] if said is None else said)
        found.seconds.append(learned[name].seconds)
    for group in RUNS:
        for here, there in ((a, b) for a in group for b in group if a != b and a in given and b in given):
            whole, moved = errors(learned[here], given[there])
            found.runs.append(whole)
            found.moved.append(moved)
    taught = simulated(1.0, 0)
    one = learn(first_half(taught), taught)
    found.strokes.extend(errors(one, simulated(stroke, 1 + k))[0] for k, stroke in enumerate(STROKES))
    return found


def errors(learned: Learned, log: Part) -> tuple[float, float]:
    """Root mean square on the judged half, and the same with gain and offset of the prediction fitted to it [rad]."""
    said, joint = learned.predict(log)[log.judged], log.joint[log.judged]
    gain, offset = np.polyfit(said, joint, 1)
    return rmse(said - joint), rmse(gain * said + offset - joint)


COLUMNS = ("method", "median", "worst", "below ours", "other run, as it is", "anew", "other strokes", "s")


def row(name: str, one: Figures, ours: Figures) -> list[str]:
    """A row of the table [deg]: of other runs the median and the worst."""
    better = "–" if name == "ours" else f"{sum(np.less(one.halves, ours.halves))} of {len(one.halves)}"
    cells = [METHODS[name][0], degrees([np.median(one.halves)]), degrees([max(one.halves)]), better]
    cells += [f"{degrees([np.median(found)])} ({degrees([max(found)])})" for found in (one.runs, one.moved)]
    return [*cells, degrees(one.strokes), f"{np.median(one.seconds):.2g}"]


def degrees(values: Iterable[Any]) -> str:
    """Angles with three places, in °."""
    return " / ".join(f"{float(value) * DEGREES:.3f}" for value in values)


def main() -> None:
    """All methods, or those that are named; the result file once all have figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("methods", nargs="*", default=list(METHODS), metavar="METHOD", help=", ".join(METHODS))
    chosen = parser.parse_args().methods
    logs = {path.name.split(".")[0]: recording(path) for path in sorted(DATA.glob("*.csv.gz"))}
    there = json.loads(KEPT.read_text()) if KEPT.is_file() else {}
    wanted = {NEEDS[name] for name in chosen if name in NEEDS}
    missing = sorted(one for one in wanted if importlib.util.find_spec(one) is None)
    if missing:
        raise SystemExit(f"{' and '.join(missing)} missing: pip install --editable '.[bench]', or name other methods")
    for name in chosen:
        there[name] = figures(METHODS[name][1], logs)._asdict()
        print(f"{name}: {degrees(there[name]['halves'])}", flush=True)
        KEPT.parent.mkdir(parents=True, exist_ok=True)
        KEPT.write_text(json.dumps(there))
    found = {name: Figures(**there[name]) for name in METHODS if name in there}
    if "ours" in found:
        rows = [row(name, one, found["ours"]) for name, one in found.items()]
        print(table(COLUMNS, rows))
        if len(found) == len(METHODS):
            write_rows("identification_peers", WHAT, "python benchmarks/identify_peers.py", COLUMNS, rows, HOW)


if __name__ == "__main__":
    main()
