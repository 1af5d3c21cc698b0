"""Whether the joint lags behind in time, which no rate-independent model can show.

A lag τ adds −τ·d(joint)/dt to the joint. A fitted model takes part of that for hysteresis; what it cannot take is the
part of the joint's speed that lies outside all its sensitivities, v⊥, and the residual is then −τ·v⊥.
"""

from dataclasses import replace

import numpy as np

from bowden.identify.cable.family import Estimate
from bowden.identify.cable.path import Path
from bowden.identify.cable.projection import solve_linear
from bowden.identify.log.read import Log
from bowden.plants.trust import Trust


def time_lag(path: Path, estimate: Estimate) -> tuple[float, float]:
    """The lag τ [s] that explains most of what a model leaves, and the share of the squared residual that it explains.

    At one speed alone a lag and a wider loop are the same: the share is then small.
    """
    counted = path.weight > 0
    weight, time = path.weight[counted], path.time[counted]
    speed = np.gradient(estimate.fitted[counted], time)
    sensitivities = np.stack([slope[counted] for slope in estimate.slopes.values()], axis=1)
    absorbed, _ = solve_linear(sensitivities, speed, weight)
    outside = speed - np.einsum("np,p->n", sensitivities, absorbed)
    residual = (path.joint - estimate.fitted)[counted]
    power = float(weight @ outside**2)
    if power <= 1e-9 * float(weight @ speed**2):
        return 0.0, 0.0
    along = float(weight @ (residual * outside))
    return -along / power, along**2 / (power * max(float(weight @ residual**2), 1e-300))


def earlier(log: Log, late: float) -> Log:
    """A log whose joint is read so much later than its motor, with both at one time; `late` may be below zero [s]."""
    kept = (log.time + late >= log.time[0]) & (log.time + late <= log.time[-1])
    time, motor = log.time[kept], log.motor[kept]
    joint = np.interp(time + late, log.time, log.joint)
    why = f"the joint was {1e3 * late:.3g} ms late; taken out, the loop is not wider by it"
    if late > 0.0:
        why += ": a controller that reads this sensor has that delay as well, and init writes it as delay_cycles"
    doubts, encoders = (*log.doubts, Trust("with care", (why,))), log.encoders._replace(joint_late=max(0.0, late))
    return replace(log, time=time, motor=motor, joint=joint, doubts=doubts, counts=log.resolutions, encoders=encoders)
