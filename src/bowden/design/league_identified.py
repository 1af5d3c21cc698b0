"""The league's plants round real cables: each a log's identified model, and one that changes its wrist's pose."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bowden.core.errors import LogError
from bowden.core.units import DEGREES
from bowden.design.league_cells import LeaguePlant
from bowden.identify.cable.fit import Fit, identify_log
from bowden.identify.log.read import Log, read_log
from bowden.models.cable.generalised_play import Branches
from bowden.models.cable.sheath import Sheath
from bowden.plants.cable_plant import Cable, CablePlant
from bowden.plants.cables import Bent, Stack, identified
from bowden.plants.pose_cable import poses
from bowden.sim.scenario import constant_bend, scripted_bend

POSES = ("L_Pitch_1_000", "L_Pitch_5_000")
"""Logs of one tool at two wrist poses, pitch +60° and −60°."""

POSES_NAME = "wrist_poses"
"""Name of the plant that goes between them."""

_MARGIN = 0.05
"""Share of the logged stroke that is left out at each end: the model is used where it was fitted."""

_TURNING = 4.0
"""Time from one pose to the other [s]."""


@dataclass(frozen=True)
class ZeroedCable:
    """An identified cable whose angles count from the lower end of its stroke."""

    cable: Cable
    stroke: float
    """Joint angle at the upper end [rad]."""
    error: float
    """Of the model on the half of the log that it was not fitted to [rad]."""


def names(logs: Mapping[str, Path]) -> list[str]:
    """The plants that these logs make, without reading them."""
    return [*logs, *([POSES_NAME] if set(POSES) <= set(logs) else [])]


def fitted(path: Path) -> tuple[Log, Fit]:
    """A log and what identification says of it.

    Raises:
        LogError: a log that cannot be read or fitted.
    """
    log = read_log(path)
    return log, identify_log(log)


def zeroed(log: Log, fit: Fit, model: str) -> ZeroedCable:
    """The cable of one of a fit's models, with motor and joint at zero where its stroke begins.

    A rig's encoders are zeroed where it starts; the zero of the recording says nothing of the cable.

    Raises:
        LogError: a straight line, which is no cable with hysteresis.
    """
    if model == "line":
        raise LogError(f"{log.name}: the model is a straight line", expected="a cable with hysteresis")
    cable = identified(model, fit.models[model].parameters)
    turned = -1.0 if fit.models["line"].parameters["slope"] < 0.0 else 1.0
    motor = turned * log.motor
    low, high = float(motor.min()), float(motor.max())
    low, high = low + _MARGIN * (high - low), high - _MARGIN * (high - low)
    at_rest = _resting_joint(cable, low)
    shifted = _shifted(cable, low, at_rest)
    error = fit.models[model].test_rms
    return ZeroedCable(shifted, _resting_joint(shifted, high - low), error)


def _resting_joint(cable: Cable, motor: float) -> float:
    return float(cable.look(cable.prepared, cable.start(cable.prepared, motor, 1.0, 1.0), motor, 1.0, 1.0).joint)


def _shifted(cable: Cable, motor: float, joint: float) -> Cable:
    """The same cable with both angles counted from these [rad]."""
    prepared = cable.prepared
    if isinstance(prepared, Stack):
        offset = prepared.offset + cable.slope * motor - joint
        return replace(cable, prepared=prepared._replace(offset=offset))
    if isinstance(prepared, Branches):
        offset, ends = prepared.offset + cable.slope * motor - joint, (prepared.low - motor, prepared.high - motor)
        return replace(cable, prepared=prepared._replace(offset=offset, low=ends[0], high=ends[1]))
    assert isinstance(prepared, Bent)  # `identified` makes no others
    offset = prepared.cable.offset + cable.slope * motor - joint
    return replace(
        cable,
        prepared=prepared._replace(
            cable=prepared.cable._replace(offset=offset),
            terms=prepared.terms._replace(centre=prepared.terms.centre - motor),
        ),
    )


def identified_plant(base: CablePlant, name: str, logs: Mapping[str, Path]) -> LeaguePlant:
    """The plant of that name, with the servo, motor and encoders of `base`.

    Args:
        base: the bench round any cable.
        name: a log's, or `POSES_NAME`.
        logs: name → file.

    Raises:
        LogError: a log that cannot be read or fitted.
    """
    sheath = Sheath(bend=np.pi)
    if name == POSES_NAME:
        log_fits = [fitted(logs[pose]) for pose in POSES]
        cables = [zeroed(log, fit, "bouc_wen_static") for log, fit in log_fits]
        cable = poses([one.cable for one in cables])
        times = _TURNING * np.arange(1.0, 41.0)
        bends = np.pi * np.tile([1.0, 1.0, 2.0, 2.0], 10)  # a pose is held as long as it takes to go to the other one
        return LeaguePlant(
            name,
            f"{POSES[0]} and {POSES[1]}, going from one to the other in {_TURNING:g} s and back all the time",
            base._replace(cable=cable, sheath=sheath),
            scripted_bend(times.tolist(), bends.tolist()),
            min(one.stroke for one in cables),
        )
    log, fit = fitted(logs[name])
    one = zeroed(log, fit, fit.best.name)
    return LeaguePlant(
        name,
        f"{fit.best.name} as identified from the log {log.name}, which it predicts to {one.error * DEGREES:.2f}° RMS",
        base._replace(cable=one.cable, sheath=sheath),
        constant_bend(sheath.bend),
        one.stroke,
    )
