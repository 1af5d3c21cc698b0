"""Limits that follow: they go together on every rig, what is written rules and is judged, and such rigs run."""

import math
import re
import warnings
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import random_rigs
from bowden import run
from bowden.app import main
from bowden.control import LAWS
from bowden.control.reference import PeriodicMinimumJerk
from bowden.core.errors import ParameterError
from bowden.core.units import RADIANS
from bowden.design.forecast import foreseen
from bowden.design.objections import objections
from bowden.hardware.drives.families.cia402 import FAMILY
from bowden.live.preflight import Preflight
from bowden.models.cable.bouc_wen import BoucWen
from bowden.operations.check import check
from bowden.plants.suit_settings import SuitSettings
from bowden.rig.declaration import items_of
from bowden.rig.families import longest_silence
from bowden.rig.rig import Rig
from bowden.rig.sections import FOLLOWING, USUAL
from bowden.safety.limits import Limits
from live_runs import SHARED_LIMITS, tries

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


SLOW_LOOPS = random_rigs.numbers({1e-3: 1, 2e-3: 1, 5e-3: 3, 10e-3: 10, 20e-3: 15})
"""Thirty, most of which take a fifth of a second."""


@pytest.mark.parametrize(
    "numbers", [SLOW_LOOPS, pytest.param(range(66), marks=pytest.mark.long)], ids=["slow loops", "all"]
)
def test_random_rigs_run_on_the_twin_and_end_normally(numbers: Iterable[int]) -> None:
    assert {number: why for number in numbers if (why := random_rigs.outcome(number))} == {}


@pytest.mark.live
@pytest.mark.parametrize("dt", [10e-3, pytest.param(20e-3, marks=pytest.mark.long)])
def test_three_random_rigs_run_live_in_one_loop(dt: float, tmp_path: Path) -> None:
    motors: list[tuple[str, Rig]] = []
    shared = {name: value for name, value in SHARED_LIMITS.items() if name != "reading_age"}
    for number in random_rigs.numbers({dt: 9}):
        if random_rigs.drawn(number)[0] in ("bench", "by hand") and len(motors) < 3:
            rig = random_rigs.rig_of(number).replace(duration=1.0, drive={"node_id": len(motors) + 1})
            motors.append((f"cable_{number}", rig.replace(limits=rig.limits._replace(**shared))))
    for _ in tries():
        with warnings.catch_warnings(record=True), run(Rig(motors=tuple(motors)), twin=True, out=tmp_path) as session:
            done = session.complete()
        if done:
            break
    assert session.outcome == "ended as asked"


def test_a_laws_own_slope_goes_with_a_cable_by_hand() -> None:
    for name, law in LAWS.items():
        taken = [gain for gain, what in law.from_rig.items() if what == "slope"]
        own, steep = (rig_of(slope, 1e-3, 0.0).fitted(name).gains for slope in (Rig().slope, 4.0 * Rig().slope))
        assert all(getattr(own, gain) == getattr(law.default_gains, gain) for gain in taken), "of the paper's bench"
        assert all(getattr(steep, gain) == pytest.approx(4.0 * getattr(law.default_gains, gain)) for gain in taken)


@pytest.mark.parametrize("dt", random_rigs.SAMPLE_TIMES)
def test_a_target_goes_no_further_in_a_slow_cycle_than_the_motor_can(dt: float) -> None:
    limits = rig_of(1.0, dt, 0.0).supervisor_limits
    leap, motor = USUAL.target_speed * random_rigs.SAMPLE_TIMES[0], limits.motor_speed * dt
    assert limits.target_speed * dt <= max(leap + motor, 2.0 * rig_of(1.0, dt, 0.0).basis.width)


def test_a_suit_has_room_for_what_its_cables_lose() -> None:
    suits = [Rig(suit=SuitSettings(worn=True, play=play), limits={"play": 0.35}) for play in (0.002, 0.005, 0.008)]
    usual, wider, _ = (suit.supervisor_limits for suit in suits)
    assert wider.motor_high > usual.motor_high
    assert [bool(objections(suit)) for suit in suits] == [False, False, True]
    assert "suit.play_mm" in objections(suits[-1])[0]
    assert not objections(suits[-1].replace(limits={})), "the advice mends it"


@pytest.mark.parametrize(
    ("text", "key", "mended"),
    [
        ("[bench]\nsample_time_ms = 1.5", "bench.sample_time_ms is 1.5", "[bench]\nsample_time_ms = 2.0"),
        (
            "[bench]\nsample_time_ms = 20\n[drive]\nheartbeat_timeout_ms = 40",
            "heartbeat_timeout_ms is 40; expected three cycles at least, 60 ms",
            "[bench]\nsample_time_ms = 20\n[drive]\nheartbeat_timeout_ms = 60",
        ),
        ("[drive]\nheartbeat_timeout_ms = 60", "heartbeat_timeout_ms is 60; expected above 0, at most 40 ms", ""),
        ("[limits]\nheartbeat_age_s = 0.001", "heartbeat_age_s = 0.001 is below two cycles", ""),
        ("[limits]\nreading_age = 11", "reading_age = 11.0 is more than 10 ms", ""),
    ],
)
def test_the_key_that_is_wrong_is_named_and_its_advice_mends_it(
    text: str, key: str, mended: str, tmp_path: Path
) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(text)
    assert any(key in one for one in objections(Rig.read(path)))
    path.write_text(mended)
    assert not objections(Rig.read(path))


def test_a_slope_below_zero_is_refused_by_its_key() -> None:
    with pytest.raises(ParameterError, match="slope_low"):
        Rig(limits={"slope_low": -5.0})


FAST = """
[control]
law = "{law}"
[scenario]
duration_s = 5.0
[reference]
{reference}
"""


@pytest.mark.parametrize("law", ["bowden", "adaptive"])
@pytest.mark.parametrize(
    ("reference", "said"),
    [
        ('kind = "periodic_minimum_jerk"\nlow_deg = 0.0\nhigh_deg = 70.0\nperiod_s = 0.5', "joint_speed_deg_per_s"),
        ('kind = "point_to_point"\ntimes_s = [0.0, 0.2, 1.0]\npositions_deg = [0.0, 60.0, 0.0]', "up to 562.5"),
        ('kind = "chirp"\namplitude_deg = 25.0\nstart_hz = 0.5\nend_hz = 4.0\nsweep_s = 2.0', "628.3°/s"),
        ('kind = "periodic_minimum_jerk"\nlow_deg = 0.0\nhigh_deg = 85.9\nperiod_s = 5.0', "beyond its range"),
    ],
)
def test_a_reference_that_the_supervisor_would_end_is_refused_with_one_that_it_does_not(
    law: str, reference: str, said: str, tmp_path: Path
) -> None:
    """All three commands ask `objections` and `foreseen`; what they advise is obeyed until they are content."""
    path, text, heard = tmp_path / "rig.toml", FAST.format(law=law, reference=reference), list[str]()
    for _ in range(3):
        path.write_text(text)
        rig = Rig.read(path)
        found = [*objections(rig)] or [one for one in [foreseen(rig, rig.fitted())] if one]
        if not found:
            break
        heard += found
        if inside := re.search(r"(\d+)° further inside", found[0]):
            text = text.replace("85.9", f"{85.9 - int(inside[1])}")
        else:
            line = re.search(r"write ((\w+) = .*) into \[reference\]", found[0])
            assert line, found
            text = re.sub(rf"^{line[2]} = .*", line[1], text, flags=re.MULTILINE)
    assert said in " ".join(heard)
    assert random_rigs.run(rig) == ""


def test_a_run_that_ends_while_its_reference_moves_ends_normally() -> None:
    rig = Rig(law="bowden", duration=2.0, reference=PeriodicMinimumJerk(0.0, 70.0 * RADIANS, 0.8))
    assert random_rigs.run(rig) == ""


def test_check_has_one_verdict(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path = tmp_path / "rig.toml"
    path.write_text(FAST.format(law="bowden", reference='kind = "periodic_minimum_jerk"\nperiod_s = 0.5'))
    assert main.run(["check", str(path)]) == 1
    out, err = capsys.readouterr()
    assert out.startswith("verdict       refused")
    assert "write period_s = 0.606 into [reference]" in err
    assert "write period_s" in " ".join(check(path).refusals)
