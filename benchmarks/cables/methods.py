"""Methods that learn a cable from a recording: published models of hysteresis, methods that know no cable, and ours.

Networks are as published as far as that is printed: histories and LSTM by Wang et al. (arXiv 2404.07168), the temporal
convolutional network by Bai, Kolter and Koltun (arXiv 1803.01271), which Park et al. (arXiv 2402.11319) found best of
four on a cable-driven manipulator.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numba
import numpy as np
from numpy.typing import NDArray
from recordings import Recording
from scipy.optimize import differential_evolution, least_squares, minimize_scalar

import bowden
from bowden.identify.cable.path import build_path
from bowden.identify.cable.turns import find_turns, motor_noise, reversals
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.bouc_wen_sensitivity import hysteresis
from bowden.models.cable.prandtl_ishlinskii import plays

Array = NDArray[np.float64]
MEMORY = 3
"""Reversals that are told to boosting, beside the way since the last one."""
TAPS, SPACING = 20, 10
"""Of a network's history: samples of the motor, and how far apart; two seconds in all."""
UNITS, EPOCHS, BATCH, STEP = 64, 100, 64, 1e-3
"""Units of a layer, passes through the data, samples of a step, Adam's step."""
CHANNELS, KERNEL, LEVELS, PASSES = 32, 3, 6, 500
"""Of the convolutional network: it sees 2.5 s; passes through the whole sequence."""
OPERATORS = 10
"""Plays of the generalised Prandtl–Ishlinskii model."""


class Learned(NamedTuple):
    """A method that has seen a recording."""

    predict: Callable[[Recording], Array]
    """Joint at every sample, from time and motor alone (n,) [rad]."""
    parameters: int


def ours(given: Recording) -> Learned:
    """`bowden.identify` with what it recommends."""
    fit = bowden.identify(given.time, given.motor, given.joint, unit="rad")

    def predict(asked: Recording) -> Array:
        path = build_path(asked.time, asked.motor, asked.joint, find_turns(asked.motor), len(asked.time))
        return path.at(asked.time, fit.best.joint_angle(path.motor))

    return Learned(predict, fit.chosen.fitted_count)


def line(given: Recording) -> Learned:
    """A straight line by least squares."""
    slope, offset = np.polyfit(given.motor, given.joint, 1)
    return Learned(lambda asked: np.asarray(slope * asked.motor + offset), 2)


def play(given: Recording) -> Learned:
    """Backlash: width by a bounded search, slope and offset by least squares."""

    def fitted(half_width: float) -> tuple[Array, float]:
        z = plays(given.motor, np.array([half_width]))[:, 0]
        found = np.polyfit(z, given.joint, 1)
        return found, float(np.mean((np.polyval(found, z) - given.joint) ** 2))

    most = 0.5 * float(np.ptp(given.motor))
    width = float(minimize_scalar(lambda half: fitted(half)[1], bounds=(0.0, 0.9 * most), method="bounded").x)
    found = fitted(width)[0]
    return Learned(lambda asked: np.polyval(found, plays(asked.motor, np.array([width]))[:, 0]), 3)


def bouc_wen(given: Recording) -> Learned:
    """The paper's cable by SciPy's differential evolution, all seven numbers at once, h at the start among them."""
    slope, offset = np.polyfit(given.motor, given.joint, 1)
    height = float(np.ptp(given.joint))
    bounds = [
        (0.5 * slope, 1.5 * slope) if slope > 0 else (1.5 * slope, 0.5 * slope),
        (-height, height),  # αh
        (0.1, 100.0),  # ρ
        (0.51, 20.0),  # σ
        (1.0, 8.0),  # n
        (offset - height, offset + height),
        (-1.0, 1.0),  # h at the start
    ]

    def joint(values: Array, motor: Array) -> Array:
        cable = BoucWen(*values[:6])
        return np.asarray(cable.slope * motor + cable.hysteresis_gain * hysteresis(motor, values[6], cable) + values[5])

    def error(values: Array) -> float:
        return float(np.mean((joint(values, given.motor) - given.joint) ** 2))

    found = differential_evolution(error, bounds, seed=0, maxiter=300).x
    return Learned(lambda asked: joint(found, asked.motor), len(bounds))


@numba.njit(cache=True)
def _generalised(motor: Array, up: Array, down: Array, density: Array, sum_: Array) -> None:
    """Weighted plays between the envelopes c₀·tanh(c₁·v + c₂) + c₃ less and more their thresholds, into `sum_`."""
    for j in range(OPERATORS):
        threshold = density[2] * j
        weight = density[0] * np.exp(-density[1] * j)
        z = 0.0
        for k in range(motor.size):
            highest = down[0] * np.tanh(down[1] * motor[k] + down[2]) + down[3] + threshold
            lowest = up[0] * np.tanh(up[1] * motor[k] + up[2]) + up[3] - threshold
            z = max(lowest, min(highest, z))
            sum_[k] += weight * z


def generalised(given: Recording) -> Learned:
    """Generalised Prandtl–Ishlinskii (Al Janaideh, Rakheja and Su 2011), by nonlinear least squares, scaled motion."""
    slope, offset = np.polyfit(given.motor, given.joint, 1)
    centre, spread = float(given.motor.mean()), float(given.motor.std())
    size = float(given.joint.std())

    def joint(values: Array, motor: Array) -> Array:
        sum_ = np.zeros(motor.size)
        _generalised((motor - centre) / spread, values[:4], values[4:8], values[8:11], sum_)
        return np.asarray(slope * centre + offset + size * np.sign(slope) * (sum_ + values[11]))

    start = np.array([3.0, 0.33, 0.0, 0.0, 3.0, 0.33, 0.0, 0.0, 0.3, 0.3, 0.02, 0.0])
    found = least_squares(
        lambda values: (joint(values, given.motor) - given.joint) / size, start, x_scale="jac", max_nfev=200
    ).x
    return Learned(lambda asked: joint(found, asked.motor), len(start))


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


Fitted = tuple[Callable[[Array], Array], int]
"""Features (n, k) → residual (n,), and how many parameters it has."""


def black_box(
    features: Callable[[Array], Array], fit: Callable[[Array, Array], Fitted]
) -> Callable[[Recording], Learned]:
    """A method on features of the motor that learns what a straight line leaves.

    The line makes it go on sanely beyond the stroke; both sides are scaled to unit spread. The first stroke, from rest,
    runs off the loop: it is left out where three or more are left, as `identify` does too.
    """

    def learn(given: Recording) -> Learned:
        turns = reversals(given.motor, 0.05 * float(np.ptp(given.motor)))
        begun = int(turns[0]) if len(turns) >= 3 else 0
        motor, joint, seen = given.motor[begun:], given.joint[begun:], features(given.motor)[begun:]
        slope, offset = np.polyfit(motor, joint, 1)
        residual = joint - slope * motor - offset
        centre, spread, size = seen.mean(axis=0), seen.std(axis=0) + 1e-9, float(residual.std())
        learned, count = fit((seen - centre) / spread, residual / size)

        def predict(asked: Recording) -> Array:
            left = learned((features(asked.motor) - centre) / spread)
            return np.asarray(slope * asked.motor + offset + size * left)

        return Learned(predict, 2 + count)

    return learn


def boosting(seen: Array, residual: Array) -> Fitted:
    """scikit-learn's gradient boosting of histograms, its defaults; its parameters are its leaves."""
    from sklearn.ensemble import HistGradientBoostingRegressor

    model = HistGradientBoostingRegressor(random_state=0).fit(seen, residual)
    return model.predict, sum(tree.get_n_leaf_nodes() for (tree,) in model._predictors)


def _network(build: Callable[[Any], Any], passes: int, batch: int) -> Callable[[Array, Array], Fitted]:
    """A torch network that `build` makes, features (n, k) → (n, 1), trained by Adam on the mean square."""

    def fit(seen: Array, residual: Array) -> Fitted:
        import torch

        torch.manual_seed(0)
        torch.set_num_threads(1)
        network = build(torch)
        inputs, wanted = (torch.tensor(one.tolist(), dtype=torch.float32) for one in (seen, residual[:, None]))
        adam = torch.optim.Adam(network.parameters(), lr=STEP)
        for _ in range(passes):
            parts = torch.randperm(len(inputs)).split(batch) if batch else [slice(None)]
            for some in parts:
                adam.zero_grad()
                torch.nn.functional.mse_loss(network(inputs[some]), wanted[some]).backward()
                adam.step()

        def predict(asked: Array) -> Array:
            with torch.no_grad():
                return np.array(network(torch.tensor(asked.tolist(), dtype=torch.float32))[:, 0].tolist())

        return predict, sum(one.numel() for one in network.parameters())

    return fit


def _feed_forward(torch: Any) -> Any:
    """Two layers over the history."""
    nn = torch.nn
    return nn.Sequential(nn.Linear(TAPS, UNITS), nn.ReLU(), nn.Linear(UNITS, UNITS), nn.ReLU(), nn.Linear(UNITS, 1))


def _lstm(torch: Any) -> Any:
    """An LSTM over the history, and a linear layer on its last output."""

    class Network(torch.nn.Module):  # type: ignore[misc, name-defined]
        def __init__(self) -> None:
            super().__init__()
            self.cell = torch.nn.LSTM(1, UNITS, batch_first=True)
            self.last = torch.nn.Linear(UNITS, 1)

        def forward(self, given: Any) -> Any:
            return self.last(self.cell(given[:, :, None])[0][:, -1])

    return Network()


def _convolutional(torch: Any) -> Any:
    """Residual blocks of two dilated causal convolutions with normed weights, over the whole sequence of the motor."""
    nn = torch.nn

    class Block(nn.Module):  # type: ignore[misc, name-defined]
        def __init__(self, inputs: int, dilation: int) -> None:
            super().__init__()
            self.past = (KERNEL - 1) * dilation
            self.layers = nn.ModuleList(
                nn.utils.parametrizations.weight_norm(nn.Conv1d(many, CHANNELS, KERNEL, dilation=dilation))
                for many in (inputs, CHANNELS)
            )
            self.through = nn.Conv1d(inputs, CHANNELS, 1) if inputs != CHANNELS else nn.Identity()

        def forward(self, given: Any) -> Any:
            found = given
            for layer in self.layers:
                found = torch.relu(layer(nn.functional.pad(found, (self.past, 0), "replicate")))
            return torch.relu(found + self.through(given))

    class Network(nn.Module):  # type: ignore[misc, name-defined]
        def __init__(self) -> None:
            super().__init__()
            self.blocks = nn.Sequential(*(Block(CHANNELS if k else 1, 2**k) for k in range(LEVELS)))
            self.last = nn.Conv1d(CHANNELS, 1, 1)

        def forward(self, given: Any) -> Any:
            return self.last(self.blocks(given.T[None]))[0].T

    return Network()


def _alone(motor: Array) -> Array:
    """The motor (n, 1)."""
    return motor[:, None]


METHODS: dict[str, tuple[str, Callable[[Recording], Learned]]] = {
    "ours": ("`bowden.identify`", ours),
    "line": ("straight line", line),
    "play": ("play", play),
    "bouc_wen": ("Bouc–Wen by differential evolution", bouc_wen),
    "generalised": ("generalised Prandtl–Ishlinskii", generalised),
    "boosting": ("gradient boosting on motor and reversals", black_box(memory, boosting)),
    "fnn": ("feed-forward network on a history", black_box(history, _network(_feed_forward, EPOCHS, BATCH))),
    "lstm": ("LSTM on the same history", black_box(history, _network(_lstm, EPOCHS, BATCH))),
    "tcn": ("temporal convolutional network", black_box(_alone, _network(_convolutional, PASSES, 0))),
}
NEEDS = {"boosting": "sklearn", "fnn": "torch", "lstm": "torch", "tcn": "torch"}
"""Method → what it is made with, beside what bowden itself needs."""
