"""The closed loop: against python-control where it is linear, and exact about delay, seeds, sheath and failure."""

import json
import math
from dataclasses import dataclass, replace
from typing import Any

import control
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from bowden.control import LAWS
from bowden.control.laws.adaptive import AdaptiveState
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.errors import ParameterError
from bowden.core.kernel import kernel
from bowden.core.signals import Reference
from bowden.core.units import RADIANS
from bowden.models.cable.bouc_wen import BoucWen
from bowden.models.cable.sheath import Sheath
from bowden.models.cable.sheath_path import constant_bend, scripted_bend
from bowden.models.drive.encoder import Encoder
from bowden.models.drive.servo import Servo
from bowden.plants.bench import Bench
from bowden.records.trace import Trace
from bowden.sim.run import simulate
from support.sensors import PAPER_ENCODER

STROKE = PeriodicMinimumJerk(0.0, 70.0 * RADIANS, 10.0)
SLOPE, BETA, BOUND = 0.938, 1.0 / 0.938, 0.05
LINEAR = BoucWen(slope=SLOPE, hysteresis_gain=0.0)
NOISY = Bench(joint_encoder=PAPER_ENCODER, motor_encoder=PAPER_ENCODER)


@dataclass(frozen=True)
class Steps:
    """A jump to `height`, a ramp, and a wave."""

    height: float = 0.1

    def sample(self, time: np.ndarray) -> np.ndarray:
        position = self.height * (time > 0.0) + 0.2 * time + 0.1 * np.sin(3.0 * time)
        return np.stack((position, 0.2 + 0.3 * np.cos(3.0 * time), -0.9 * np.sin(3.0 * time)), axis=1)

    def describe(self) -> dict[str, Any]:
        return {"kind": "steps", "height": self.height}


@kernel
def start_at_the_truth(gains: Any, sample: Any) -> AdaptiveState:
    """β̂ and D̂m where they are to be frozen."""
    return AdaptiveState(0.0, 1.0 / 0.938, 0.05, sample.joint, 0.0, 0.0)


def frozen(**gains: float) -> Any:
    """The adaptive law with its estimates frozen and tanh as good as linear."""
    changes = {"slope_adaptation": 0.0, "bound_adaptation": 0.0, "smoothing": 1000.0} | gains
    return replace(LAWS["adaptive"].with_gains(**changes), start_kernel=start_at_the_truth)


def shown(trace: Trace) -> np.ndarray:
    """The reference that the law was shown (n, 3)."""
    return np.stack([trace[f"conditioned.{name}"] for name in Reference._fields], axis=1)


def linear_oracle(bench: Bench, gains: Any, references: np.ndarray) -> np.ndarray:
    """Joint angles of the same loop put together from python-control's parts.

    From the reference the law sees v = β̂·φd + β̂·λ·dφd/dt + PI(φd); from the joint −C(z), the PID; the plant is the held
    servo behind its delay.
    """
    dt = bench.sample_time
    omega, zeta = bench.servo.natural_frequency, bench.servo.damping
    servo = control.ss([[0.0, 1.0], [-(omega**2), -2.0 * zeta * omega]], [[0.0], [omega**2]], [[SLOPE, 0.0]], 0)
    plant = control.sample_system(servo, dt, method="zoh")
    one_cycle = control.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]], dt)
    for _ in range(bench.delay):
        plant = plant * one_cycle
    total = control.ss([[1.0]], [[dt]], [[1.0]], [[dt]], dt)  # Σ e·dt, this sample's included
    pole = gains.derivative_time / (gains.derivative_time + dt)
    gain = (1.0 - pole) / dt
    derivative = control.ss([[pole]], [[1.0]], [[gain * (pole - 1.0)]], [[gain]], dt)
    stiffness = gains.feedback_gain + BETA * BOUND / gains.smoothing
    pi = stiffness * (gains.error_gain + total)
    time = np.arange(len(references)) * dt
    ahead = BETA * references[:, 0] + BETA * gains.error_gain * references[:, 1]
    ahead = ahead + control.forced_response(pi, time, references[:, 0]).outputs
    loop = control.feedback(plant, pi + BETA * gains.error_gain * derivative)
    return np.asarray(control.forced_response(loop, time, ahead).outputs)


@pytest.mark.parametrize("delay", [0, 1, 5])
@pytest.mark.parametrize("damping", [0.6, 1.0, 1.5])
@pytest.mark.parametrize("derivative_time", [0.0, 0.005])
def test_linear_loop_against_python_control(delay: int, damping: float, derivative_time: float) -> None:
    law = frozen(error_gain=0.05, feedback_gain=15.0, derivative_time=derivative_time, smoothing=100.0)
    bench = Bench(cable=LINEAR, servo=Servo(30.0, damping), delay=delay)
    trace = simulate(bench, law, Steps(), duration=2.0)
    expected = linear_oracle(bench, law.gains, shown(trace))
    assert trace.stable
    assert np.ptp(trace["joint"]) > 0.3
    np.testing.assert_allclose(trace["joint"], expected, atol=1e-9)


@pytest.mark.parametrize("delay", [1, 2, 7])
def test_a_command_arrives_exactly_delay_cycles_later(delay: int) -> None:
    prompt, late = (
        simulate(Bench(delay=d), LAWS["uncompensated"], Steps(), duration=1.0, initial_motor=0.1) for d in (0, delay)
    )
    assert late["command"].tolist() == prompt["command"].tolist()
    assert late["motor"][: delay + 1].tolist() == [0.1] * (delay + 1)
    assert late["motor"][delay:].tolist() == prompt["motor"][:-delay].tolist()
    assert late["joint"][delay:].tolist() == prompt["joint"][:-delay].tolist()


def test_the_same_seed_gives_the_same_run() -> None:
    first, again, other = (simulate(NOISY, LAWS["adaptive"], STROKE, duration=2.0, seed=seed) for seed in (1, 1, 2))
    assert first.seed == 1
    for name in first.columns:
        np.testing.assert_array_equal(first[name], again[name])
    assert (first["joint"] != other["joint"]).any()


def tight(bench: Bench, trace: Trace, bend: Any) -> np.ndarray:
    """Oracle: joint angles of the plant under the trace's commands, its differential equations integrated tightly."""
    cable, servo, dt = bench.cable, bench.servo, bench.sample_time
    omega, zeta = servo.natural_frequency, servo.damping
    power, shape = cable.exponent, cable.shape
    commands = np.concatenate(([0.0] * bench.delay, trace["command"])).tolist()
    bends, y, joints = bend(np.arange(len(trace) + 1) * dt) / bench.sheath.bend, np.zeros(3), []
    for k in range(len(trace)):
        slope = cable.slope * (1.0 - bench.sheath.loss * (bends[k] - 1.0))
        joints.append(slope * y[0] + bends[k] * cable.hysteresis_gain * y[2] + cable.offset)

        def rates(t: float, y: np.ndarray, k: int = k) -> list[float]:
            u = y[1] / (bends[k] + (bends[k + 1] - bends[k]) * t / dt)
            h, size = y[2], abs(y[2])
            bent = shape * abs(u) * size ** (power - 1.0) * h + (shape - 1.0) * u * size**power
            return [y[1], omega**2 * (commands[k] - y[0]) - 2.0 * zeta * omega * y[1], cable.rate * (u - bent)]

        y = solve_ivp(rates, (0.0, dt), y, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]
    return np.array(joints)


@pytest.mark.parametrize("damping", [0.4, 1.0, 1.7])
@pytest.mark.parametrize("sheath", ["still", "moved"])
def test_against_a_tight_solution_of_the_differential_equations(damping: float, sheath: str) -> None:
    """Through turns in mid-cycle and with a sheath that doubles its bend in a second: 1e-9 rad."""
    bench = Bench(cable=BoucWen(offset=0.05), servo=Servo(54.4, damping), sheath=Sheath(bend=1.0, loss=0.2))
    bend = constant_bend(1.0) if sheath == "still" else scripted_bend([0.0, 1.0], [1.0, 2.0])
    trace = simulate(bench, LAWS["adaptive"], PeriodicMinimumJerk(0.0, 0.5, 0.4), duration=0.8, bend=bend)
    assert (np.diff(np.sign(trace["motor_velocity"][50:])) != 0.0).sum() >= 3
    np.testing.assert_allclose(trace["joint"], tight(bench, trace, bend), rtol=0.0, atol=1e-9)


def test_a_run_that_ran_away_says_so() -> None:
    """Erratum 7: the printed gains at 1 kHz around the bench's servo."""
    trace = simulate(Bench(), LAWS["adaptive"].preset("paper"), STROKE, duration=30.0)
    assert not trace.stable
    finite = np.isfinite(trace["joint"])
    last = int(np.argmin(finite))
    assert 0 < last < len(trace)
    assert finite[:last].all()
    assert not finite[last:].any()
    assert np.isfinite(trace.time).all()
    assert set(vars(trace.metrics()).values()) == {None}


def test_a_trace_knows_what_made_it() -> None:
    bench = Bench(servo=Servo(damping=0.9), joint_encoder=Encoder(1e-3))
    trace: Trace = simulate(bench, LAWS["adaptive"], STROKE, duration=1.0)
    settings = json.loads(json.dumps(dict(trace.settings), allow_nan=True))
    assert settings["law"] == "adaptive"
    assert settings["gains"] == LAWS["adaptive"].gains._asdict()
    assert settings["reference"] == STROKE.describe()
    assert settings["plant"]["servo"]["damping"] == 0.9
    assert settings["sample_time"] == 1e-3
    assert len(trace) == 1000
    np.testing.assert_allclose(np.diff(trace.time), 1e-3)
    assert {"reference", "joint", "motor", "command", "current", "law.slope_inverse"} <= set(trace.columns)
    assert set(trace.units) == set(trace.columns)


@pytest.mark.parametrize(
    ("bench", "duration"),
    [
        (Bench(), 0.0),
        (Bench(), math.nan),
        (Bench(), math.inf),
        (Bench(sample_time=0.0), 1.0),
        (Bench(sample_time=-1e-3), 1.0),
        (Bench(delay=-1), 1.0),
        (Bench(substeps=0), 1.0),
        (Bench(servo=Servo(natural_frequency=-1.0)), 1.0),
    ],
)
def test_absurd_runs_are_refused(bench: Bench, duration: float) -> None:
    with pytest.raises(ParameterError, match="expected"):
        simulate(bench, LAWS["uncompensated"], STROKE, duration=duration)
