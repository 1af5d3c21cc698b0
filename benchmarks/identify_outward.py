"""How identified models go on outward: strokes larger than any in the log, of cables drawn at random.

A log of 15 s of a sine is identified. Then the same cable makes the same sine 1.1, 1.2 and 1.3 times as large, and the
recommended model follows. Where that is ``generalised_play``, its error stands beside that of the model that would have
been recommended without it: the other family with the least error on left-out stretches.

    python benchmarks/identify_outward.py development 0 48
    python benchmarks/identify_outward.py judging 96 144        # and the section of the page
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import bowden
import results
from bowden.core.units import DEGREES, RADIANS
from bowden.identify.cable.fit import Fit, follow
from bowden.identify.cable.path import path_of
from bowden.plants.cable_plant import Cable
from bowden.records.metrics import rmse
from drawn_logs import SETS, asked
from unseen_cells import drawn_cable

Array = NDArray[np.float64]

TITLE = "Strokes larger than the log's"
KINDS = ("play", "rounded", "soft", "wedge", "stribeck", "capstan")
STROKES = (1.0, 1.1, 1.2, 1.3)
"""Over the log's; the first is the log's own motion."""
RATE, SECONDS = 200.0, 15.0
"""Of a log [Hz, s]."""
WORSE = 1.1
"""Error over that of the best other family from which on a case counts as worse."""


class Drawn(NamedTuple):
    """A cable's log, and where it is on other strokes."""

    kind: str
    time: Array
    motor: Array
    """(n,) as read [rad]."""
    joint: Array
    """(n,) as read [rad]."""
    motors: Array
    """(strokes, n) of the strokes of `STROKES`, without noise [rad]."""
    joints: Array
    """(strokes, n) [rad]."""


def draw(set_name: str, number: int) -> Drawn:
    """The log of that number in that set."""
    random = np.random.default_rng([31, SETS[set_name], number])
    kind, bent = str(random.choice(KINDS)), bool(random.uniform() < 0.5)
    cable = drawn_cable(random, {"cable": kind, "geometry": "curved" if bent else "even"})
    half, frequency = float(random.uniform(12.0, 45.0)) * RADIANS, float(random.uniform(0.2, 0.6))
    time = np.arange(int(RATE * SECONDS)) / RATE
    sine = np.sin(2.0 * np.pi * frequency * time - 0.5 * np.pi)
    motors = np.array([half * (1.0 + stroke * sine) for stroke in STROKES])
    joints = np.array([moved(cable, motor) for motor in motors])
    step = 2.0 * np.pi / 2.0 ** int(random.integers(12, 17))
    noise = float(random.uniform(0.2, 1.0)) * step + 0.002 * RADIANS
    motor, joint = (
        step * np.round((one[0] + noise * random.standard_normal(len(time))) / step) for one in (motors, joints)
    )
    return Drawn(f"{kind}{', bent' * bent}", time, motor, joint, motors, joints)


def moved(cable: Cable, motor: Array) -> Array:
    """The joint along a motion from rest (n,) [rad]."""
    memory, joints = cable.start(cable.prepared, float(motor[0]), 1.0, 1.0), np.empty(len(motor))
    for i, after in enumerate(motor.tolist()):
        memory = cable.advance(cable.prepared, memory, float(motor[max(i - 1, 0)]), after, 1.0, 1.0, 1.0 / RATE)
        joints[i] = cable.look(cable.prepared, memory, after, 1.0, 1.0).joint
    return joints


class Case(NamedTuple):
    """Errors of a drawn cable [°], a stroke each."""

    kind: str
    number: int
    best: str
    other: str
    """The family that would have been recommended without ``generalised_play``."""
    errors: tuple[float, ...]
    """Of ``generalised_play``."""
    others: tuple[float, ...]
    """Of the other one."""

    def ratio(self, k: int) -> float:
        """Of both, on a stroke."""
        return self.errors[k] / self.others[k]


def case(drawn: Drawn, number: int) -> Case:
    """Identify and follow."""
    fit = bowden.identify(drawn.time, drawn.motor, drawn.joint)
    other = min(
        (name for name in fit.models if name != "generalised_play"), key=lambda name: fit.models[name].left_out_rms
    )
    both = (errors_of(fit, name, drawn) for name in ("generalised_play", other))
    return Case(drawn.kind, number, fit.best.name, other, *both)


def errors_of(fit: Fit, name: str, drawn: Drawn) -> tuple[float, ...]:
    """Of a model, on the second half of each stroke's motion [°]."""
    found, judged = [], drawn.time >= 0.5 * SECONDS
    for motor, joint in zip(drawn.motors, drawn.joints, strict=True):
        said = follow(fit.models[name].model, path_of(drawn.time, motor, joint, len(motor)), drawn.time)
        found.append(rmse((said - joint)[judged]) * DEGREES)
    return tuple(found)


def table(cases: Sequence[Case]) -> str:
    """Of the cases in which ``generalised_play`` is recommended: errors and ratios, a line for each stroke."""
    own = [one for one in cases if one.best == "generalised_play"]
    lines = [
        f"`generalised_play` is recommended in {len(own)} of {len(cases)} draws. Errors of the joint [°]: median and "
        "largest; the ratio's geometric mean and largest.",
        "",
        "| stroke, of the log's | generalised play | best other family | ratio | more than 10 % worse | better |",
        "|---|---|---|---|---|---|",
    ]
    for k, stroke in enumerate(STROKES):
        errors, others, ratios = (
            np.array(values)
            for values in (
                [one.errors[k] for one in own],
                [one.others[k] for one in own],
                [one.ratio(k) for one in own],
            )
        )
        lines.append(
            f"| {stroke:g} | {np.median(errors):.3f}, {errors.max():.3f} | {np.median(others):.3f}, {others.max():.3f} "
            f"| {np.exp(np.log(ratios).mean()):.2f}, {ratios.max():.2f} | {(ratios > WORSE).sum()} of {len(own)} "
            f"| {(ratios < 1.0 / WORSE).sum()} of {len(own)} |"
        )
    return "\n".join(lines)


def main() -> None:
    """The table of a range of draws."""
    set_name, numbers = asked(__doc__)
    found = table([case(draw(set_name, number), number) for number in numbers])
    print(found)
    if set_name == "judging":
        results.write(TITLE, f"{found}\n\nJudging draws {numbers[0]} to {numbers[-1]}, looked at once.")


if __name__ == "__main__":
    main()
