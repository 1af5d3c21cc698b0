"""Laws on an estimate of the joint's angle in place of an encoder: on unseen cells and on random wearers.

    python benchmarks/run.py joint_angle

The estimate knows of a cell's cable what an identification would say: slope and dead zone, each wrong by up to 15 %,
and where it was homed; of a suit the usual slope and play. Ratios are of the RMSE over that with the encoder, or a
suit's flex sensor, run by run. A release is false where a sensor in order would have led to one: a standard deviation
beyond its limit, or a jump, by the supervisor's rules on what the law was shown.
"""

import math
from collections.abc import Iterable, Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np

from bowden.control import LAWS
from bowden.control.knowledge import configured
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.kernel import compiled, kernel
from bowden.core.units import DEGREES, RADIANS
from bowden.plants.estimated import Estimated
from bowden.plants.presets.suit import suit
from bowden.plants.worn_suit import USUAL_DEAD_ZONE
from bowden.rig.joint_sensor import model_of
from bowden.rig.settings import JointSensor
from bowden.safety.evidence import DOUBT
from bowden.safety.limits import Limits
from bowden.sensing.joint_angle import JointModel, estimate_start, estimate_step
from bowden.sim.many import simulate_many
from bowden.sim.run import Case, simulate
from bowden.sim.suit_runs import DRIVE_INTEGRAL, FRICTION_FEEDFORWARD, knowing_drive, suit_ours
from measure import Figure, Found
from unseen_cells import DURATION, Cell, draw
from wearers import random_wearer

IMU = JointSensor(source="imu")
SENSORS = {
    "IMU (100 Hz, 10 ms late, 2°, 1°/min)": IMU,
    "stretch sensor (3° wrong, 0.5°)": JointSensor(
        source="stretch", noise=0.5 * RADIANS, offset=3.0 * RADIANS, drift=0.0
    ),
    "motor alone": JointSensor(source="motor"),
}
"""What takes the encoder's place."""
WITHOUT = {
    "IMU without its delay": IMU._replace(delay=0.0),
    "IMU without its drift": IMU._replace(drift=0.0),
    "IMU without its noise": IMU._replace(noise=0.01 * RADIANS),
    "IMU at 1 kHz": IMU._replace(period=1e-3),
    "IMU at 1 kHz, with neither": IMU._replace(period=1e-3, delay=0.0, drift=0.0, noise=0.01 * RADIANS),
}
"""Which part of it costs how much: on cells, of our law."""
OURS = "bowden"
CELLS, WEARERS = range(9100, 9160), range(61_000, 61_200)
"""Fresh draws, looked at once."""
PERIOD, FLEXIONS = 25.0, 2
_WRONG = 0.15


class Errors(NamedTuple):
    """RMSE of one law in one draw [deg]; NaN of a run that was not stable."""

    encoder: float
    sensors: tuple[float, ...]


def model_in(sensor: JointSensor, cell: Cell) -> JointModel:
    """What the estimate knows in a cell."""
    random = np.random.default_rng([cell.number, 40])
    off = 1.0 + random.uniform(-_WRONG, _WRONG, 2)
    slope, cable = cell.rig.inner.cable.slope * off[0], cell.rig.inner
    start = float(cell.reference.sample(np.zeros(1))[0, 0])
    made = cable.cable.parameters
    halves = getattr(made, "half_widths", (0.05,))
    lost = sum(half * weight for half, weight in zip(halves, getattr(made, "weights", (1.0,)), strict=True))
    return model_of(sensor, slope, cell.initial_motor - start / slope, abs(slope) * lost * off[1])


def in_cells(numbers: range, sensors: Iterable[JointSensor], law_names: Sequence[str]) -> Iterator[dict[str, Errors]]:
    """Law → its errors, cell by cell."""
    cells = [draw("judging", number) for number in numbers]
    cells.sort(key=lambda cell: (cell.rig.inner.cable.name, cell.rig.sample_time, cell.number))

    def cases(sensor: JointSensor | None) -> Iterator[Case]:
        for cell in cells:
            plant: Any = cell.rig if sensor is None else Estimated(cell.rig, model_in(fitting(sensor, cell), cell))
            laws = tuple(configured(LAWS[name], cell.known) for name in law_names)
            yield Case(plant, laws, cell.reference, cell.bend, cell.number, cell.initial_motor)

    played = [simulate_many(cases(sensor), DURATION) for sensor in (None, *sensors)]
    for cell, *outcomes in zip(cells, *played, strict=True):
        found = {}
        for place, name in enumerate(law_names):
            runs = [one[place] for one in outcomes]
            rmse = [run.rmse * DEGREES if run.ended and run.peak <= cell.allowed else math.nan for run in runs]
            found[name] = Errors(rmse[0], tuple(rmse[1:]))
        yield found


def fitting(sensor: JointSensor, cell: Cell) -> JointSensor:
    """The sensor with a period that is no shorter than the cell's cycle."""
    return sensor._replace(period=max(sensor.period, cell.rig.sample_time))


@kernel
def watch(model: JointModel, limits: Limits, motor: Any, value: Any, dt: float) -> tuple[float, float]:
    """Largest standard deviation after the first second [rad], and the cycles with a jump."""
    state, worst, jumps = estimate_start(model, motor[0]), 0.0, 0.0
    for k in range(motor.size):
        before = state.angle
        state = estimate_step(model, state, motor[k], value[k], dt)
        if k * dt > 1.0:
            worst = max(worst, state.std)
            allowed = max(limits.jump, DOUBT * state.std) + limits.joint_speed * dt
            jumps += 1.0 if abs(state.angle - before) > allowed else 0.0
    return worst, jumps


def on_wearers(numbers: range) -> Iterator[tuple[Errors, int]]:
    """Our law's errors on a wearer, and in how many of the sensors a release would have been false."""
    made = suit()
    made = made._replace(motor=made.motor._replace(integral=DRIVE_INTEGRAL, friction_feedforward=FRICTION_FEEDFORWARD))
    motion, limits = PeriodicMinimumJerk(0.0, 90.0 * RADIANS, PERIOD), Limits(estimates_joint=True)
    for number in numbers:
        drawn = random_wearer(number, made)
        law, rmse, false = knowing_drive(suit_ours(), made.motor.integral), [], 0
        for sensor in (None, *SENSORS.values()):
            model = None if sensor is None else model_of(sensor, 1.0, 0.0, 0.5 * USUAL_DEAD_ZONE)
            plant: Any = drawn.suit if model is None else Estimated(drawn.suit, model)
            run = simulate(plant, law, motion, duration=PERIOD * FLEXIONS, bend=drawn.bend, seed=number)
            rmse.append(float(np.sqrt(np.mean(run.error[run.time >= 1.0] ** 2))) * DEGREES if run.ended else math.nan)
            if sensor is not None and model is not None:
                dt, value = made.sample_time, np.full(len(run.time), np.nan)
                if sensor.sensed:
                    every, late = round(model.period / dt), round(model.delay / dt)
                    random = np.random.default_rng([number, 41])
                    shown = run["joint"] + model.offset * random.standard_normal() * np.cos(2.0 * run["joint"])
                    came = np.arange(late, len(value), every)
                    value[came] = shown[came - late] + model.noise * random.standard_normal(len(came))
                worst, jumps = compiled(watch)(model, limits, run["motor_measured"], value, dt)
                false += worst > limits.joint_std or jumps > 0.0
        yield Errors(rmse[0], tuple(rmse[1:])), false


def _row(where: str, law: str, errors: list[Errors], sensors: Iterable[str] = SENSORS) -> list[list[str]]:
    """A row for each sensor."""
    rows = []
    for place, sensor in enumerate(sensors):
        both = [(one.encoder, one.sensors[place]) for one in errors if not math.isnan(one.encoder)]
        lost = sum(math.isnan(mine) for _, mine in both)
        kept = np.array([pair for pair in both if not math.isnan(pair[1])])
        ratios = kept[:, 1] / kept[:, 0]
        low, high = np.percentile(ratios, [50.0, 95.0])
        error = f"{np.median(kept[:, 0]):.2f}° to {np.median(kept[:, 1]):.2f}°"
        rows.append([where, f"`{law}`", sensor, error, f"{low:.2f}, {high:.2f}", f"{lost} of {len(both)}"])
    return rows


def figures(share: float) -> Found:
    """Cells and wearers."""
    cells, wearers = (one[: max(2, round(share * len(one)))] for one in (CELLS, WEARERS))
    played = list(in_cells(cells, SENSORS.values(), list(LAWS)))
    rows = [row for law in LAWS for row in _row("cells", law, [one[law] for one in played])]
    parts = [one[OURS] for one in in_cells(cells, WITHOUT.values(), [OURS])]
    rows += _row("cells", OURS, parts, WITHOUT)
    worn = list(on_wearers(wearers))
    errors, false = [one for one, _ in worn], sum(number for _, number in worn)
    rows += _row("wearers", OURS, errors)
    ratios = [one.sensors[0] / one.encoder for one in errors]
    of_cells = np.nanmedian([one[OURS].sensors[0] / one[OURS].encoder for one in played])
    found = [
        Figure("our law by IMU on cells: median RMSE over the encoder's", f"{of_cells:.2f}", "1.5",
               bool(of_cells <= 1.5)),
        Figure("our law by IMU on wearers: median RMSE over the flex sensor's", f"{np.median(ratios):.2f}", "1.5",
               bool(np.median(ratios) <= 1.5)),
        Figure("false releases, of all wearers and sensors", f"{false} of {len(worn) * len(SENSORS)}", "0", false == 0),
    ]  # fmt: skip
    columns = ("draws", "law", "sensor", "RMSE, median: encoder to sensor", "ratio: median, 95 %", "lost")
    seeds = f"cells {cells.start}:{cells.stop} of the judging set, wearers {wearers.start}:{wearers.stop}"
    how = f"Seeds: {seeds}; {FLEXIONS} flexions of {PERIOD:g} s."
    return Found(found, how, columns, rows)
