"""The preflight on a motor and a cable with play, and limits that cannot go together."""

import itertools
import math
import re
from collections.abc import Callable
from pathlib import Path

import pytest

from bowden.core.errors import ParameterError, SafetyError
from bowden.core.signals import DriveReading
from bowden.core.units import RADIANS
from bowden.live.preflight import REASONS, Preflight, PreflightState, Reason, begin, contradictions, require, step
from bowden.plants.identified import IdentifiedCable
from bowden.rig.declaration import items_of
from bowden.rig.rig import Rig
from bowden.safety.limits import Limits

DT = 1e-3
SETTINGS = Preflight(listen=0.05)


def reading(motor: float, joint: float, state: float = 4.0, current: float = 0.0) -> DriveReading:
    return DriveReading(motor, joint, current, math.nan, 40.0, 0.0, 0.0, 0.01, state, 0.0, 0.0, 0.0, 0.0)


def play_through(
    *,
    play: float = 0.0,
    slope: float = 0.9,
    gain: float = 1.0,
    state: float = 4.0,
    missing: bool = False,
    shakes: float = 0.0,
    load: float = 1.0,
    friction: float = 2.0,
    stuck: bool = False,
    count: float = 0.0,
    settings: Preflight = SETTINGS,
    cell: Callable[[int, float], dict[str, float]] = lambda k, through: {},
) -> tuple[Reason, list[float], PreflightState]:
    """A motor that follows its target after a cycle, and a joint behind a play [rad]."""
    motor = through = before = 0.0
    now, requested = begin(settings, reading(0.0, 0.0, state)), []
    for k in range(200_000):
        through = min(max(through, motor - 0.5 * play), motor + 0.5 * play)
        joint = math.nan if missing else slope * through + (shakes if k % 2 else 0.0)
        way, before = motor - before, motor
        current = 0.0 if stuck else load + math.copysign(friction, way) * (way != 0.0)
        current = current if count == 0.0 else count * round(motor / count)
        told = reading(motor, joint, state, current)._replace(**cell(k, through))
        now, requested_target, outcome = step(settings, now, told, DT)
        requested.append(requested_target)
        motor = gain * requested_target
        if outcome.result != 0.0:
            return Reason(int(outcome.reason)), requested, now
    raise AssertionError("the preflight does not end")


@pytest.mark.parametrize("play_deg", [0.0, 5.0, 14.0, 25.0])
def test_the_motion_grows_until_the_joint_follows_and_comes_back(play_deg: float) -> None:
    reason, requested, _ = play_through(play=play_deg * RADIANS)
    assert reason == Reason.NONE
    assert max(requested) >= 0.5 * play_deg * RADIANS
    assert max(requested) <= max(2.0 * RADIANS, 2.0 * (play_deg + 2.0) * RADIANS)
    assert abs(requested[-1]) < 1e-9
    steps = [abs(b - a) for a, b in itertools.pairwise(requested)]
    assert max(steps) <= 1.9 * SETTINGS.speed * DT  # a minimum-jerk motion peaks at 1.875 times its mean speed


@pytest.mark.parametrize(
    ("wrong", "reason"),
    [
        ({"slope": 0.0}, Reason.JOINT_STILL),
        ({"play": 2.0}, Reason.JOINT_STILL),
        ({"slope": -0.9}, Reason.JOINT_WRONG_WAY),
        ({"gain": 0.0}, Reason.MOTOR_STILL),
        ({"gain": -1.0}, Reason.MOTOR_WRONG_WAY),
        ({"state": 3.0}, Reason.NOT_ENABLED),
        ({"missing": True}, Reason.SENSORS),
        ({"shakes": 0.1}, Reason.RESTLESS),
        ({"stuck": True}, Reason.CURRENT_STILL),
        ({"load": -1.0}, Reason.SLACK_WRONG_WAY),
        ({"load": -0.5, "play": 0.1}, Reason.SLACK_WRONG_WAY),
    ],
)
def test_what_is_wrong_is_named(wrong: dict[str, float], reason: Reason) -> None:
    found, _, _ = play_through(**wrong)  # type: ignore[arg-type]
    assert found == reason
    assert REASONS[reason]


def test_a_cable_that_runs_the_other_way_passes_with_its_sign() -> None:
    assert play_through(slope=-0.9, settings=SETTINGS._replace(slope_sign=-1.0))[0] == Reason.NONE
    assert play_through(settings=SETTINGS._replace(pull_sign=-1.0), load=-1.0)[0] == Reason.NONE
    assert play_through(settings=SETTINGS._replace(pull_sign=-1.0))[0] == Reason.SLACK_WRONG_WAY


@pytest.mark.parametrize("load", [0.0, -0.2])
def test_a_cable_that_carries_nothing_says_nothing_of_where_it_pulls(load: float) -> None:
    assert play_through(load=load)[0] == Reason.NONE


def test_a_current_of_coarse_counts_is_judged_by_a_motion_that_changes_it() -> None:
    """Here 6077h tells a spring's pull in counts of which the smallest motion is less than half."""
    reason, requested, _ = play_through(count=6.0 * RADIANS)
    assert reason == Reason.NONE
    assert 3.0 * RADIANS < max(requested) <= SETTINGS.largest


@pytest.mark.parametrize(
    ("gain", "noise", "reason"),
    [
        (40.0, 0.0, Reason.NONE),
        (-40.0, 0.0, Reason.LOAD_WRONG_WAY),
        (0.0, 0.0, Reason.LOAD_STILL),
        (0.01, 1.0, Reason.LOAD_STILL),
        (math.nan, 0.0, Reason.LOAD_MISSING),
    ],
)
@pytest.mark.parametrize("kind", ["tension", "torque"])
def test_a_load_cell_must_rise_while_the_cable_is_pulled(kind: str, gain: float, noise: float, reason: Reason) -> None:
    settings = SETTINGS._replace(**{kind: 1.0})
    column = "tension" if kind == "tension" else "joint_torque"

    def cell(k: int, through: float) -> dict[str, float]:
        return {column: 5.0 + gain * through + (noise if k % 2 else 0.0)}

    found, requested, _ = play_through(play=5.0 * RADIANS, settings=settings, cell=cell)
    assert found == reason
    if reason != Reason.NONE:
        assert requested[-1] == pytest.approx(0.0, abs=1e-9), "it ends where it began"


def test_a_gap_in_motion_is_left_to_the_supervisor() -> None:
    state = begin(SETTINGS, reading(0.0, 0.0))
    for k in range(120):
        state, requested_target, outcome = step(SETTINGS, state, reading(math.nan if k == 100 else 0.0, 0.0), DT)
        assert math.isfinite(requested_target)
        assert outcome.result == 0.0


@pytest.mark.parametrize("start", [-0.34, -0.3001, 2.04])
def test_a_motor_that_a_release_left_beyond_its_targets_is_never_asked_to_stay_there(start: float) -> None:
    settings = SETTINGS._replace(low=-0.3, high=2.0, pull_sign=1.0 if start < 0.0 else -1.0)
    motor, state, outcome = start, begin(settings, reading(start, 0.9 * start, 3.0)), None
    for k in range(20_000):
        current = settings.pull_sign + 0.1 * motor
        told = reading(motor, 0.9 * motor, 4.0 if k > 50 else 3.0, current)
        state, requested_target, outcome = step(settings, state, told, DT)
        assert settings.low <= requested_target <= settings.high
        if outcome.result != 0.0:
            break
        motor += 0.05 * (requested_target - motor) if k > 50 else 0.0
    assert outcome is not None
    assert Reason(int(outcome.reason)) == Reason.NONE
    assert outcome.result == 1.0


def test_a_frozen_joint_shows_by_what_an_identified_cable_explains() -> None:
    by_hand = Rig().cable
    measured, tight = (
        IdentifiedCable("bouc_wen", {"bouc_wen": one._asdict()})
        for one in (by_hand, by_hand._replace(hysteresis_gain=-1e-3))
    )
    assert Rig().supervisor_limits.frozen_travel == pytest.approx(0.4, abs=1e-4), "nobody has measured this cable"
    assert Rig(limits=Limits(frozen_travel=0.6)).supervisor_limits.frozen_travel == 0.6
    known, wider = Rig(cable=measured), Rig(cable=measured, limits=Limits(frozen_travel=0.6))
    assert known.supervisor_limits.frozen_travel == pytest.approx(2.5 * 0.10524, rel=1e-3)
    assert wider.supervisor_limits.frozen_travel == known.supervisor_limits.frozen_travel
    assert not known.notes
    assert "frozen_travel_deg is 34.38; the identified cable explains no more than 15.1" in wider.notes[0]
    assert Rig(cable=measured, limits=Limits(frozen_travel=0.15)).supervisor_limits.frozen_travel == 0.15
    assert Rig(cable=tight).supervisor_limits.frozen_travel == 0.1


def test_default_limits_agree() -> None:
    assert contradictions(Limits(), DT) == []
    require(Limits(), DT, "holds")
    require(Limits(), DT, "little_margin")


@pytest.mark.parametrize(
    "wrong",
    [
        {"motor_low": 3.0},
        {"joint_low": 2.0},
        {"slope_low": 2.0},
        {"motor_speed": math.nan},
        {"release_time": -1.0},
        {"sensor_span": 2.0},
        {"joint_high": 4.0},
        {"tracking": 1.0},
        {"target_speed": 1e4},
        {"reading_age": 50.0},
        {"heartbeat_age": 0.001},
        {"lateness": 0.1},
        {"current_peak": 5.0},
        {"housing_limit": 200.0},
        {"slack_sign": 0.0},
        {"slack_sign": 1.0},
        {"measures_temperature": 0.5},
    ],
)
def test_contradictions_are_named_and_refuse_the_run(wrong: dict[str, float]) -> None:
    limits = Limits()._replace(**wrong)  # type: ignore[arg-type]
    found = contradictions(limits, DT)
    keys = [key for item in items_of(Limits) for key in [item.key] if item.path[0] in wrong]
    assert all(any(f"{key} = " in one for one in found) for key in keys), (
        "each is named as rig.toml does, with its value"
    )
    assert all(re.search(r" = \S", one) for one in found)
    with pytest.raises(SafetyError, match="contradict"):
        require(limits, DT, "holds")


@pytest.mark.parametrize(
    "wrong", [{"winding_capacity": 0.0}, {"housing_to_ambient": math.nan}, {"winding_capacity": 0.1}]
)
def test_a_motor_without_a_thermal_model_is_refused(wrong: dict[str, float]) -> None:
    limits = Limits()._replace(thermal=Limits().thermal._replace(**wrong))
    with pytest.raises(SafetyError, match="thermal"):
        require(limits, DT, "holds")


@pytest.mark.parametrize("verdict", ["does_not_hold", "", "unknown"])
def test_gains_that_do_not_hold_are_refused(verdict: str) -> None:
    with pytest.raises(SafetyError, match="bowden check"):
        require(Limits(), DT, verdict)


@pytest.mark.parametrize(
    "key",
    [
        *("operator_age_s", "winding_limit_c", "heartbeat_age_s", "lateness_s", "tension_high_n", "joint_high_deg"),
        *(
            "joint_speed_deg_per_s",
            "motor_speed_deg_per_s",
            "motor_high_deg",
            "sensor_span_deg",
            "jump_deg",
            "play_deg",
        ),
        *("tracking_deg", "target_reach_deg", "frozen_travel_deg", "acceleration_deg_per_s2", "lowering_deg_per_s"),
        *("target_speed_deg_per_s", "reading_age", "joint_still_deg", "slope_high"),
        *("slope_low", "bridge_time_s", "release_time_s", "slack_sign", "tension_low_n"),
        *("thermal_ambient_c", "thermal_continuous_current_a"),
    ],
)
def test_a_limit_has_a_ceiling(key: str, tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text(f"[limits]\n{key} = 1e50\n")
    with pytest.raises(ParameterError, match=f"{key} is 1e.50; expected a number not above"):
        Rig.read(rig)
