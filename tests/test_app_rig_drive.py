"""The [drive] section of a rig.toml: whatever is in it, there is a drive, or one clear line."""

import contextlib
import json
import math
from pathlib import Path

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from bowden.core.errors import BowdenError, DriveError, ParameterError
from bowden.hardware.drives.canopen_drive import CanopenDrive
from bowden.hardware.drives.families.cia402 import DriveParameters
from bowden.hardware.ports import Power
from bowden.live.preflight import contradictions
from bowden.plants.presets.bench import default_bench
from bowden.rig.rig import Rig
from bowden.rig.sections import drive_part
from support.memory_bus import DriverLoop


def parameters(text: str, folder: Path) -> DriveParameters:
    rig = folder / "rig.toml"
    rig.write_text(text, encoding="utf-8")
    return Rig.read(rig).drive_parameters


def toml(value: object) -> str:
    if isinstance(value, float) and not math.isfinite(value):
        return "nan" if math.isnan(value) else "inf" if value > 0.0 else "-inf"
    return json.dumps(value, ensure_ascii=True).replace("\\u007f", "\\u007F")


NUMBERS = st.floats() | st.integers(-(2**70), 2**70) | st.sampled_from([0, 1, -1, 1e-300, 1e300, 0.5, 127, 1e9 - 1])
VALUES = NUMBERS | st.booleans() | st.text(st.characters(codec="utf-8"), max_size=12) | st.lists(NUMBERS, max_size=2)
LIKELY = {
    "node_id": st.integers(1, 126),
    "motor_counts_per_turn": st.floats(1e-3, 1e9, exclude_max=True),
    "joint_counts_per_turn": st.floats(1e-3, 1e9, exclude_max=True),
    "motor_direction": st.sampled_from([1, -1]),
    "joint_direction": st.sampled_from([1, -1]),
    "home": st.sampled_from(["counts", "here"]),
    "motor_home_deg": st.floats(-720.0, 720.0),
    "joint_home_deg": st.floats(-720.0, 720.0),
    "tension_n_per_mv": st.floats(-10.0, 10.0),
    "tension_zero_mv": st.floats(-1e4, 1e4),
    "heartbeat_ms": st.floats(0.1, 13.0),
    "heartbeat_timeout_ms": st.floats(0.1, 40.0),
    "drive_heartbeat_ms": st.floats(1.0, 30.0),
}


@settings(max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.dictionaries(st.sampled_from(sorted(drive_part("cia402").section.model_fields)), VALUES, max_size=4))
def test_any_values_give_a_drive_or_a_line(tmp_path: Path, given_: dict[str, object]) -> None:
    text = "[drive]\n" + "".join(f"{name} = {toml(value)}\n" for name, value in given_.items())
    with contextlib.suppress(BowdenError):
        CanopenDrive(parameters(text, tmp_path)).close()


@settings(max_examples=40, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.fixed_dictionaries({}, optional=LIKELY))
def test_any_drive_that_is_taken_can_be_brought_up_or_says_why(tmp_path: Path, given_: dict[str, object]) -> None:
    text = "[drive]\nanswer_timeout_ms = 50.0\n" + "".join(
        f"{name} = {toml(value)}\n" for name, value in given_.items()
    )
    try:
        drive = parameters(text, tmp_path)
    except ParameterError:
        return
    bus = DriverLoop(drive)
    try:
        bus.drive.bring_up()
    except DriveError:
        return
    reading = bus.run(12, Power.ON)[-1]
    assert all(math.isfinite(value) or math.isnan(value) for value in (reading.motor, reading.joint, reading.current))
    count = 2.0 * math.pi / float(given_.get("motor_counts_per_turn", math.inf))  # type: ignore[arg-type]
    assert abs(bus.node.bench.motor - 0.1) < 0.02 + count, "enabling moves nothing"
    bus.drive.close()


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("drive_heartbeat_ms = 30.0", "drive_heartbeat_ms is 30, and limits.heartbeat_age_s is 0.05"),
        ('channel = "a\\u0000b"', r"channel is 'a.x00b'"),
        ('channel = ".."', r"channel is '\.\.'"),
        ('channel = ""', "channel is ''"),
        ("heartbeat_ms = 13.0\nheartbeat_timeout_ms = 30.0", "third of heartbeat_timeout"),
    ],
)
def test_what_cannot_go_together_is_refused(text: str, said: str, tmp_path: Path) -> None:
    with pytest.raises(ParameterError, match=said):
        parameters("[drive]\n" + text, tmp_path)


def test_a_push_against_friction_beyond_its_bound_is_refused_by_its_key(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("[suit]\nworn = true\nfriction_feedforward_nm = 50.0\n", encoding="utf-8")
    read = Rig.read(rig)
    with pytest.raises(ParameterError, match=r"suit\.friction_feedforward_nm is 50") as refused:
        _ = read.drive_parameters
    assert "at most 4.175" in str(refused.value)


def test_slow_cycles_need_a_longer_watch(tmp_path: Path) -> None:
    text = "[bench]\nsample_time_ms = 5.0\n[drive]\nheartbeat_ms = 2.0\nheartbeat_timeout_ms = 6.0\n"
    rig = tmp_path / "rig.toml"
    rig.write_text(text)
    with pytest.raises(ParameterError, match="heartbeat_time"):
        _ = Rig.read(rig).drive_parameters


def test_another_bus_is_taken_or_refused() -> None:
    rig = Rig()
    assert rig.on_bus(None) is rig
    assert rig.on_bus("can1", "socketcan").drive_parameters[1:3] == ("socketcan", "can1")
    with pytest.raises(ParameterError, match="channel"):
        _ = rig.on_bus("").drive_parameters


def test_the_default_limits_go_together(tmp_path: Path) -> None:
    rig = tmp_path / "rig.toml"
    rig.write_text("")
    assert not contradictions(Rig.read(rig).supervisor_limits, default_bench().sample_time)
