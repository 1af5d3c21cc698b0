"""How far the forecast of an identification can be trusted: the inverse of the recommended model drives another cable.

The other cable is the richest family beside the recommended one, identified from the same log: it bends and loops in a
way that the model does not know. The joint shall move as the straight line has it for the log's motor, so that the
motion is the log's. Forecast for that cable is the model's error along the log's motor, weighted as
`bowden.identify.cable.forecast` has it; found is what the joint errs by when the motor goes where the model's inverse
tells it. Both on the log's second half.

    python benchmarks/identify_forecast.py
"""

import math
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

import results
from bowden.core.units import DEGREES
from bowden.identify.cable.fit import Fit, identify_log
from bowden.identify.cable.forecast import forecast
from bowden.identify.log.read import read_log
from bowden.plants.cable_plant import Cable
from bowden.plants.cables import identified
from bowden.records.metrics import rmse

TITLE = "The forecast of an identification"

Array = NDArray[np.float64]
DATA = Path(__file__).parents[2] / "shared" / "data" / "cable"
NODES = 1200
"""Of a log: the cables do not depend on time, and a degree and a half between two of them shows the loop."""


class Found(NamedTuple):
    """Errors of the joint on the second half of a log [rad]."""

    log: str
    model: str
    plant: str
    stated: float
    """The forecast that the identification states, which knows the real cable's log."""
    forecast: float
    """The same with the other cable as the plant."""
    compensated: float
    """With the model's inverse, on that plant."""
    uncompensated: float
    """With the straight line's."""


class Walk:
    """A cable, moved from angle to angle."""

    def __init__(self, cable: Cable, motor: float) -> None:
        self._cable, self._motor = cable, motor
        self._memory = cable.start(cable.prepared, motor, 1.0, 1.0)

    def joint(self, motor: float) -> float:
        """Where the joint would be [rad]."""
        return float(self._cable.look(self._cable.prepared, self._after(motor), motor, 1.0, 1.0).joint)

    def go(self, motor: float) -> float:
        """Move there; the joint [rad]."""
        joint, self._memory = self.joint(motor), self._after(motor)
        self._motor = motor
        return joint

    def to(self, joint: float) -> float:
        """Move to where the joint is there; the motor [rad]."""
        step = 1e-3
        while (self.joint(self._motor - step) - joint) * (self.joint(self._motor + step) - joint) > 0.0:
            step *= 2.0
        there = brentq(lambda one: self.joint(one) - joint, self._motor - step, self._motor + step, xtol=1e-7)
        self.go(float(there))
        return self._motor

    def _after(self, motor: float) -> Any:
        kept = [np.array(part) if isinstance(part, np.ndarray) else part for part in self._memory]
        return self._cable.advance(self._cable.prepared, type(self._memory)(*kept), self._motor, motor, 1.0, 1.0, 1e-3)


def found(path: Path) -> Found:
    """Forecast and simulation of one log."""
    fit = identify_log(read_log(path))
    model, plant = fit.best.name, richest_beside(fit)
    line = fit.models["line"].parameters
    turned = math.copysign(1.0, line["slope"])
    at = np.linspace(0, fit.samples - 1, NODES).astype(int)
    motor, judged = turned * fit.log.motor[at], at >= fit.split
    reference = abs(line["slope"]) * motor + line["offset"]
    model_walk, plant_walk, inverse, driven = (
        Walk(identified(name, fit.models[name].parameters), float(motor[0])) for name in (model, plant, model, plant)
    )
    model_joint, plant_joint = (np.array([walk.go(one) for one in motor]) for walk in (model_walk, plant_walk))
    compensated = np.array([driven.go(inverse.to(one)) for one in reference])
    first = int(np.argmax(judged))
    seen = replace(fit.chosen, test_rms=rmse((plant_joint - model_joint)[judged]))
    said = forecast(replace(fit.log, motor=motor, joint=plant_joint), first, model_joint, seen, fit.models["line"])
    left, without = (rmse((one - reference)[judged]) for one in (compensated, plant_joint))
    return Found(path.name.split(".")[0], model, plant, fit.forecast.compensated, said.compensated, left, without)


def richest_beside(fit: Fit) -> str:
    """The family of most fitted parameters, the recommended one left out; one that a plant can be made of."""
    sizes = {name: fitted.fitted_count for name, fitted in fit.models.items() if name not in ("line", fit.best.name)}
    return max(sizes, key=lambda name: sizes[name])


def text(rows: list[Found]) -> str:
    """The section of the page."""
    ratios = np.array([row.compensated / row.forecast for row in rows])
    without = np.array([row.uncompensated / row.compensated for row in rows])
    lines = [
        "The inverse of each recommended model drives another cable: the richest other family that was identified from "
        "the same recording. *Stated* is the forecast that the identification prints, which is of the real cable; "
        "*forecast* is the same figure for that other cable as the plant, and *found* what the simulation leaves with "
        "the model's inverse commanded. All are ° RMS at the joint, on the second half of the recording.",
        "",
        "| recording | model | plant | stated | forecast | found | found / forecast | without |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row, ratio in zip(rows, ratios, strict=True):
        errors = [f"{one * DEGREES:.3f}" for one in (row.stated, row.forecast, row.compensated)]
        cells = [row.log, row.model, row.plant, *errors, f"{ratio:.2f}", f"{row.uncompensated * DEGREES:.2f}"]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(
        [
            *lines,
            "",
            f"Found over forecast: {np.median(ratios):.2f} in the median, {ratios.min():.2f} to {ratios.max():.2f}. "
            f"Compensation divides the error by {np.median(without):.1f} in the median. The servo is left out.",
        ]
    )


def main() -> None:
    """All recordings, and the section of the page."""
    rows = [found(path) for path in sorted(DATA.glob("*.csv.gz"))]
    section = text(rows)
    print(section)
    results.write(TITLE, section)


if __name__ == "__main__":
    main()
