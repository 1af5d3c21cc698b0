"""Limits that follow: they go together on every rig, what is written rules and is judged, and such rigs run."""

import math
from typing import Any

import numpy as np
import pytest

import random_rigs
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.units import RADIANS
from bowden.hardware.drives.families.cia402 import FAMILY
from bowden.hardware.drives.family import longest_silence
from bowden.live.preflight import Preflight
from bowden.models.cable.bouc_wen import BoucWen
from bowden.rig.consistent import FOLLOWING, USUAL
from bowden.rig.declaration import items_of
from bowden.rig.objections import objections
from bowden.rig.rig import Rig
from bowden.rig.settings import SuitSettings
from bowden.safety.limits import Limits

KEYS = {item.path[0]: item.key for item in items_of(Limits)}


def rig_of(slope: float, dt: float, low: float, **parts: Any) -> Rig:
    """A rig whose joint goes over 60° from `low` [°] on, and whose motor is as strong there as the bench's."""
    motor, ends = Rig().motor, (low * RADIANS, (low + 60.0) * RADIANS)
    given = {
        "cable": BoucWen(slope=slope),
        "motor": motor._replace(gear=motor.gear * max(1.0, slope / Rig().slope)),
        "reference": PeriodicMinimumJerk(*ends, 10.0),
        "limits": {"joint_low": ends[0] - 0.25, "joint_high": ends[1] + 0.25},
        "sample_time": dt,
    }
    return Rig(**given | parts)


@pytest.mark.parametrize("low", [-100.0, -60.0, -30.0, 0.0, 40.0])
@pytest.mark.parametrize("dt", random_rigs.SAMPLE_TIMES)
@pytest.mark.parametrize("slope", np.geomspace(0.02, 50.0, 7))
def test_what_follows_goes_together(slope: float, dt: float, low: float) -> None:
    rig = rig_of(slope, dt, low)
    assert not objections(rig)
    limits, checks = rig.supervisor_limits, Preflight().on_cable(rig.basis, rig.motor_encoder)
    assert limits.bridge_time == max(5e-3, dt), "R1 at most 5 ms, or one cycle"
    assert FAMILY.watchdog(rig.drive_parameters) <= longest_silence(dt) <= max(0.05, 3.5 * dt)
    assert checks.first * slope <= 10.0 * RADIANS, "the joint moves little"
    assert checks.largest <= limits.motor_high - limits.motor_low


def test_on_the_bench_and_a_suit_it_is_what_it_was() -> None:
    for rig in (Rig(), Rig(suit=SuitSettings(worn=True))):
        own = rig.supervisor_limits
        assert all(getattr(own, name) == getattr(USUAL, name) for name in FOLLOWING)
        assert all(math.isnan(getattr(rig.limits, name)) for name in FOLLOWING)


@pytest.mark.parametrize(
    ("written", "said"),
    [
        ({"motor_high": 0.2}, "motor_high_deg = "),
        ({"sensor_span": 0.5}, "sensor_span_deg = "),
        ({"target_reach": 0.05}, "target_reach_deg = "),
        ({"heartbeat_age": 1e-3}, "heartbeat_age_s = "),
        ({"bridge_time": 0.1}, "bridge_time_s = "),
        ({"disable_time": 1e-3}, "disable_time_s = "),
        ({"motor_margin": 1.0}, "motor_margin_deg = "),
        ({"tracking": 1.0, "target_reach": 2.0}, "tracking_deg = "),
        ({"frozen_travel": 3.0}, "frozen_travel_deg = "),
        ({"slope_low": 2.0, "slope_high": 3.0}, "slope_low = 2"),
    ],
)
def test_what_is_written_rules_and_is_judged_by_its_own_key(written: dict[str, float], said: str) -> None:
    rig = Rig(limits=written)
    assert all(getattr(rig.supervisor_limits, name) == value for name, value in written.items())
    found = objections(rig)
    assert any(said in one for one in found)
    others = [key for name, key in KEYS.items() if name in FOLLOWING - written.keys()]
    assert not any(f"{key} = " in one for one in found for key in others), "no key that is not in the file"


def test_no_detector_is_made_meaningless_by_what_follows() -> None:
    assert any("the play that follows" in one for one in objections(Rig(width=20.0)))
    assert any("sample_time_ms = 100" in one for one in objections(Rig(sample_time=0.1)))
    suit = Rig(suit=SuitSettings(worn=True), limits={"slope_low": 0.05, "slope_high": 0.1})
    assert any("slope_high = 0.1" in one for one in objections(suit))


def test_a_weak_motor_and_other_zeros_are_said_with_what_mends_them() -> None:
    weak = rig_of(20.0, 1e-3, 0.0, motor=Rig().motor)
    (said,) = objections(weak)
    gear = float(said.partition("now, ")[2].partition(" would")[0])
    assert not objections(weak.replace(motor=weak.motor._replace(gear=gear)))
    (said,) = objections(rig_of(1.0, 1e-3, 0.0, cable=BoucWen(slope=1.0, offset=1.0)))
    assert "offset in [cable]" in said


@pytest.mark.parametrize(
    "numbers", [range(6), pytest.param(range(6, 66), marks=pytest.mark.long)], ids=["some", "more"]
)
def test_random_rigs_run_on_the_twin_and_end_normally(numbers: range) -> None:
    assert {number: why for number in numbers if (why := random_rigs.outcome(number))} == {}
