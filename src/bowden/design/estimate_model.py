"""The estimate of a joint's angle as a linear system in front of a law, where no encoder measures the joint.

With the play taken up the cable's model moves by s for each motor motion, and the estimate is

    s·motor + E(z)·(joint − s·motor)

E is the filter of `bowden.sensing.joint_angle` with the gains of one time (`bowden.plants.settled_estimate`). A value
acts spread over the sensor's period, and is late by the sensor's delay in Padé's form of second order.
"""

import numpy as np

from bowden.control.stability import StateSpace
from bowden.design.linearise import LawModel
from bowden.sensing.joint_angle import JointModel


def behind_estimate(law: LawModel, model: JointModel, gains: tuple[float, float], dt: float) -> LawModel:
    """The law from the true joint and the motor on, the estimate being a part of it.

    Args:
        law: near rest.
        model: of cable and sensor.
        gains: of the model's errors and of the sensor's for a value, see `SettledEstimate`.
        dt: length of a cycle [s].
    """
    late, filtered = _delayed(model.delay, dt), _filter(model, gains, dt)
    count, own = len(late.a), len(filtered.a)
    a = np.zeros((count + own + len(law.a),) * 2)
    a[:count, :count], a[count : count + own, count : count + own] = late.a, filtered.a
    a[count : count + own, :count] = filtered.b @ late.c
    shown = np.hstack([filtered.d * late.c, filtered.c])  # E's output by its states
    a[count + own :, : count + own], a[count + own :, count + own :] = law.b[:, :1] @ shown, law.a
    joint_less_motor, slope = np.array([[1.0, -model.slope]]), np.array([0.0, model.slope])
    seen = filtered.d * late.d * joint_less_motor[0] + slope  # of the estimate, without a state
    into_law = law.b[:, :1] @ seen[None, :] + law.b[:, 1:] @ np.array([[0.0, 1.0]])
    b = np.vstack([late.b @ joint_less_motor, filtered.b * late.d @ joint_less_motor, into_law])
    return LawModel(a, b, np.hstack([law.d[0] * shown, law.c]), law.d[0] * seen + np.array([0.0, law.d[1]]))


def _filter(model: JointModel, gains: tuple[float, float], dt: float) -> StateSpace:
    """E without its delay: all errors, which share what a value shows by their gains, and what is shown of the model's;
    what is forgotten in ten seconds and more is left out."""
    whole = sum(gains)
    if not whole:  # of the motor alone
        return StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 0.0)
    part = min(1.0, dt / max(dt, model.period))
    share, taken = part * gains[0] / whole, part * whole
    a = np.array([[1.0 - taken, 0.0], [share * (1.0 - taken), 1.0 - part]])
    return StateSpace(a, np.array([[taken], [share * taken]]), a[1:], share * taken)


def _delayed(delay: float, dt: float) -> StateSpace:
    """Padé's form of a delay, by the bilinear rule."""
    if delay == 0.0:
        return StateSpace(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), 1.0)
    a, b = np.array([[0.0, 1.0], [-12.0 / delay**2, -6.0 / delay]]), np.array([[0.0], [1.0]])
    c, inverse = np.array([[0.0, -12.0 / delay]]), np.linalg.inv(np.eye(2) - 0.5 * dt * a)
    through = 1.0 + float((c @ inverse @ b)[0, 0]) * 0.5 * dt
    return StateSpace(inverse @ (np.eye(2) + 0.5 * dt * a), dt * inverse @ b, c @ inverse, through)
