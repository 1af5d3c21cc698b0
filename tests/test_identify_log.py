"""Reading a cable's log: what is understood, what is mended, and one clear line for what is refused."""

import gzip
import math
import sys
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.io import savemat

import bowden
from bowden.core.errors import BowdenError, LogError, ParameterError
from bowden.identify.log.angles import angle_units
from bowden.identify.log.clock import even_clock, held_rows
from bowden.identify.log.columns import find_columns, split_name
from bowden.identify.log.read import checked_rate, read_log
from bowden.models.cable.prandtl_ishlinskii import plays
from bowden.records.trace import Trace

Array = NDArray[np.float64]

TIME = np.arange(400) / 100.0
MOTOR = 0.5 * np.sin(3.0 * TIME)
JOINT = 0.9 * MOTOR + 0.1
LINES = [f"{t:.6f},{m:.6f},{j:.6f}" for t, m, j in zip(TIME, MOTOR, JOINT, strict=True)]
HEADER = "time_s,motor_rad,joint_rad"


def text(lines: list[str] | None = None, header: str = HEADER) -> str:
    return "\n".join([header, *(LINES if lines is None else lines)]) + "\n"


def rows(*columns: Array, separator: str = ",") -> list[str]:
    return [separator.join(f"{value:.7f}" for value in row) for row in zip(*columns, strict=True)]


def put(lines: list[str], at: int, line: str) -> list[str]:
    """The log with line `at`, counted from 1 with the header, replaced."""
    return [*lines[: at - 2], line, *lines[at - 1 :]]


Write = Callable[..., Path]


@pytest.fixture
def write(tmp_path: Path) -> Write:
    def to(content: str | bytes, name: str = "log.csv") -> Path:
        path = tmp_path / name
        path.write_bytes(content.encode() if isinstance(content, str) else content)
        return path

    return to


DEGREES = [TIME, np.degrees(MOTOR), np.degrees(JOINT)]

UNDERSTOOD: dict[str, str | bytes] = {
    "radians": text(),
    "degrees": text(rows(*DEGREES), "time_s,motor_deg,joint_deg"),
    "gzipped": gzip.compress(text().encode()),
    "titles above": "My rig\nRate 100 Hz\n\n# a note\n" + text(),
    "units below": text(["s,deg,deg", *rows(*DEGREES)], "t,phi_in,phi_out"),
    "units in brackets": text(rows(1e3 * TIME, *DEGREES[1:]), "Time (ms),Motor angle [deg],Elbow [°]"),
    "semicolons": text(rows(*DEGREES, separator=";"), "time;input_deg;output_deg"),
    "decimal commas": text([r.replace(".", ",") for r in rows(*DEGREES, separator=";")], "t;motor_deg;joint_deg"),
    "tabs": text(rows(*DEGREES, separator="\t"), "time\tspindle_deg\tjaw_deg"),
    "spaces and a hash": text(rows(TIME, MOTOR, JOINT, separator="  "), "# time_s motor_rad joint_rad"),
    "byte order mark": b"\xef\xbb\xbf" + text().encode(),
    "windows": text().replace("\n", "\r\n"),
    "latin": text(rows(*DEGREES), "time,motor [°],joint [°]").encode("latin-1"),
    "quotes": text(header='"time_s","motor_rad","joint_rad"'),
    "other columns": text([f"{i},ok,{r}" for i, r in enumerate(LINES)], f"n,state,{HEADER}"),
    "other order": text(rows(JOINT, TIME, MOTOR), "distal_rad,timestamp,proximal_rad"),
    "comments": "# above\n"
    + text(["# below", *LINES[:9], "", "# inside", *LINES[9:30], LINES[30] + " # on it", *LINES[31:]]),
    "a field left empty": text(put(LINES, 17, LINES[15] + ",")),
    "fields left empty": text([line + "," for line in LINES]),
    "a name left empty": text(header=HEADER + ","),
    "UTF-16": text().encode("utf-16"),
    "blank lines": text([line + "\n" for line in LINES]),
    "a leading percent": text(header="% " + HEADER),
    "names and numbers above": "type,begin,rate\nrecord,0.0,1000\n\n" + text(),
    "empty columns": text([line + ",,," for line in LINES], HEADER + ",,,"),
    "turns": text(rows(TIME, MOTOR / math.tau, JOINT / math.tau), "time_s,motor_turns,joint_turns"),
    "nanoseconds": text(
        [f"{round(1e9 * t)},{m:.7f},{j:.7f}" for t, m, j in zip(TIME, MOTOR, JOINT, strict=True)],
        "stamp_ns,motor_rad,joint_rad",
    ),
}


@pytest.mark.parametrize("content", UNDERSTOOD.values(), ids=UNDERSTOOD)
def test_logs_that_are_understood(content: str | bytes, write: Write) -> None:
    with warnings.catch_warnings(action="error"):  # NumPy's would be lines of Python on the user's screen
        log = read_log(write(content))
    assert log.time == pytest.approx(TIME, abs=1e-5)
    assert log.motor == pytest.approx(MOTOR, abs=1e-6)
    assert log.joint == pytest.approx(JOINT, abs=1e-6)
    assert log.warnings == ()
    assert log.name == "log.csv"


def test_our_own_trace(tmp_path: Path) -> None:
    columns = {"time": TIME, "motor": 9.0 + MOTOR, "joint": JOINT, "motor_measured": MOTOR, "joint_measured": JOINT}
    units = {name: "s" if name == "time" else "rad" for name in columns}
    Trace(columns, units).write(tmp_path / "trace.csv")
    log = read_log(tmp_path / "trace.csv")
    assert np.array_equal(log.motor, MOTOR)  # what the encoder read, not what a simulation knows
    assert log.warnings == ()


def test_matlab(tmp_path: Path) -> None:
    path = tmp_path / "log.mat"
    savemat(path, {"time": TIME, "motor_deg": np.degrees(MOTOR), "joint_deg": np.degrees(JOINT)[:, None], "note": "x"})
    assert read_log(path).joint == pytest.approx(JOINT)
    savemat(path, {"run": {"t": TIME, "phi_in": MOTOR, "phi_out": JOINT}}, format="5")
    assert read_log(path, unit="rad").motor == pytest.approx(MOTOR)
    savemat(path, {"t": TIME, "phi_in": MOTOR, "phi_out": JOINT[:-1]})
    with pytest.raises(LogError, match="columns differ in length"):
        read_log(path)


def test_matlab_that_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "log.mat"
    savemat(path, {"t": TIME, "phi_in": MOTOR + 1e-3j, "phi_out": JOINT})
    with pytest.raises(LogError, match="'phi_in' is complex; expected real numbers; save its real part"):
        read_log(path)
    savemat(path, {"data": np.stack([TIME, MOTOR, JOINT], axis=1)})
    with pytest.raises(LogError, match=r"no time column .* among 'data 1', 'data 2', 'data 3'"):
        read_log(path)


def test_columns_and_units_can_be_given(write: Write) -> None:
    path = write(text(rows(*DEGREES), "a,b,c"))
    log = read_log(path, time="a", motor="b", joint="C", unit="deg")
    assert log.joint == pytest.approx(JOINT, abs=1e-6)
    with pytest.raises(ParameterError, match="expected deg, mdeg, rad, mrad, turns, counts, mm or cm"):
        read_log(path, unit="grad")
    assert np.array_equal(read_log(path, time="a", motor="b", joint="c", unit="DEG").joint, log.joint)
    with pytest.raises(LogError, match="no column 'd' for the joint among 'a', 'b', 'c'"):
        read_log(path, time="a", motor="b", joint="d")
    with pytest.raises(LogError, match="one column is taken twice"):
        read_log(path, time="a", motor="b", joint="b")


def test_a_guess_is_not_silent(write: Write) -> None:
    of_time, of_angles = (one.reasons[0] for one in read_log(write(text(header="time,motor,joint"))).doubts)
    assert "no unit is named for the times (taken as s)" in of_time
    assert "no unit is named for 'motor' (taken as rad) and 'joint' (taken as rad)" in of_angles
    (_, mixed) = (one.reasons[0] for one in read_log(write(text(rows(*DEGREES), "time,motor_deg,joint"))).doubts)
    assert "'joint' (taken as deg)" in mixed
    against = read_log(write(text(header="time,motor_deg,joint_deg")), unit="rad").warnings
    assert all("names deg, but rad was given" in warning for warning in against)


def jittered(size: float) -> str:
    random = np.random.default_rng(0)
    return text(rows(TIME + size * 0.01 * random.uniform(-1.0, 1.0, len(TIME)), MOTOR, JOINT))


def test_jitter_is_resampled_with_a_warning(write: Write) -> None:
    log = read_log(write(jittered(0.05)))
    assert np.ptp(np.diff(log.time)) < 1e-12
    assert log.motor == pytest.approx(MOTOR, abs=2e-3)
    assert "resampled" in log.warnings[0]


def test_an_even_clock_hides_no_count_of_an_encoder(write: Write) -> None:
    time = np.arange(2000) * 1e-3
    motor = np.round(np.degrees(0.5 * np.sin(3.0 * time)) / 0.1) * 0.1
    late = time + 5e-5 * np.random.default_rng(2).uniform(-1.0, 1.0, len(time))
    logs = [read_log(write(text(rows(one, motor, 0.9 * motor), "time_s,motor_deg,joint_deg"))) for one in (time, late)]
    assert "resampled" in logs[1].warnings[0]
    for log in logs:
        assert np.degrees(log.resolutions) == pytest.approx([0.1, 0.09], rel=1e-3)


@pytest.mark.parametrize(("time", "motor"), [(TIME, MOTOR), (np.arange(9000) / 1e3, np.sin(np.arange(9000) / 1e3))])
@pytest.mark.parametrize("long", [1, 2])
def test_readings_that_were_disturbed_are_filled_with_a_note(
    time: Array, motor: Array, long: int, write: Write
) -> None:
    joint = 0.9 * motor + 0.1 + 1e-3 * np.random.default_rng(1).standard_normal(len(time))
    there = read_log(write(text(rows(time, motor, joint))))
    assert not there.warnings
    struck = joint.copy()
    struck[200 : 200 + long] = 2.5
    log = read_log(write(text(rows(time, motor, struck))))
    (said,) = log.warnings
    assert "line 202: joint_rad is 2.5 rad, between" in said
    assert ("1 reading stands" if long == 1 else "2 readings stand") in said
    assert np.abs(log.joint - there.joint).max() < 0.02
    stepped = joint + np.where(time > 2.0, 0.3, 0.0)
    assert not read_log(write(text(rows(time, motor, stepped)))).warnings, "a joint that slips stays where it is"


def test_one_late_sample_is_no_gap(write: Write) -> None:
    late = TIME.copy()
    late[200:] += 0.004
    (warning,) = read_log(write(text(rows(late, MOTOR, JOINT)))).warnings
    assert "2 % RMS, 40 % at worst" in warning
    late[200:] += 0.002
    (warning,) = read_log(write(text(rows(late, MOTOR, JOINT)))).warnings
    assert warning == "time has 1 gap of up to 0.016 s, 0.016 s in all: bridged by straight lines"


@pytest.mark.parametrize("rows_lost", [3, 40])
def test_a_gap_is_bridged_where_little_moves_in_it(rows_lost: int, write: Write) -> None:
    time = 0.002 * np.arange(5000)
    kept = np.ones(len(time), bool)
    for begin in (700, 1900, 3300):
        kept[begin : begin + rows_lost] = False
    motor = np.sin(3.0 * time)
    path = write(text(rows(time[kept], motor[kept], 0.9 * motor[kept])))
    if rows_lost == 40:
        log = read_log(path)
        assert log.time == pytest.approx(time[3340:])
        assert np.abs(log.motor - motor[3340:]).max() < 1e-4
        assert log.warnings[0].startswith("time has 3 gaps of up to 0.082 s")
        assert "the longest stretch was taken, 3.318 of 9.998 s" in log.warnings[0]
        return
    log = read_log(path)
    assert log.time == pytest.approx(time)
    assert np.abs(log.motor - motor).max() < 1e-4
    assert log.warnings[0] == "time has 3 gaps of up to 0.008 s, 0.024 s in all: bridged by straight lines"


def test_a_second_row_within_a_tick_is_dropped(write: Write) -> None:
    again = read_log(write(text([line for i, line in enumerate(LINES) for _ in range(2 if i in (5, 50, 51) else 1)])))
    assert np.array_equal(again.joint, read_log(write(text())).joint)
    assert again.warnings[0].startswith("3 of 403 rows repeat the time stamp")
    ticks = np.floor(np.arange(500) * 0.85 + 0.3) / 100.0  # rows come more often than the clock ticks
    motor = 0.5 * np.sin(0.6 * ticks)
    log = read_log(write(text(rows(ticks, motor, 0.9 * motor))))
    assert np.allclose(np.diff(log.time), 0.01)
    late = TIME.copy()
    late[100::20] += 0.01  # a row that comes within the next one's tick
    log = read_log(write(text(rows(late, MOTOR, JOINT))))
    assert len(log.time) == 400
    assert log.motor == pytest.approx(MOTOR, abs=0.03)
    assert [said.split()[0] for said in log.warnings] == ["15", "the"]


def test_a_log_without_times_takes_a_rate(write: Write, tmp_path: Path) -> None:
    savemat(tmp_path / "log.mat", {"motor_deg": np.degrees(MOTOR), "joint_deg": np.degrees(JOINT)})
    packed = gzip.compress(text(rows(MOTOR, JOINT), "motor_rad,joint_rad").encode())
    for path in (write(packed, "log.csv.gz"), tmp_path / "log.mat"):
        log = read_log(path, rate=100.0)
        assert log.time == pytest.approx(TIME)
        assert log.joint == pytest.approx(JOINT, abs=1e-6)
        with pytest.raises(LogError, match=r"no time column among .* give the rows' rate: --rate 1000"):
            read_log(path)
    path = write(text())
    assert "'time_s' was not read" in read_log(path, rate=100.0).warnings[0]
    with pytest.raises(ParameterError, match="a rate and times"):
        read_log(path, rate=100.0, time="time_s")
    with pytest.raises(ParameterError, match="the rate is 0"):
        read_log(path, rate=0.0)


COUNTED = np.round(1e6 + MOTOR * 8192.0 / math.tau), np.round(JOINT * 4000.0 / math.tau)


def test_counts_are_angles_once_their_turn_is_known(write: Write, tmp_path: Path) -> None:
    path = write(text(rows(TIME, *COUNTED), "t,motor,joint"))
    for unit, turns in (("counts", (8192, 4000)), (None, "8192, 4000")):
        log = read_log(path, unit=unit, counts_per_turn=turns)
        assert np.ptp(log.motor - MOTOR) < 1e-3
        assert log.joint == pytest.approx(JOINT, abs=1e-3)
        assert "motor begins at 1000000 counts; 122 whole turns were taken off" in log.warnings[0]
    savemat(tmp_path / "log.mat", {"t": TIME, "motor_counts": COUNTED[0].astype(np.int32), "joint_rad": JOINT})
    mixed = read_log(tmp_path / "log.mat", unit="counts,rad", counts_per_turn=8192)
    assert mixed.joint == pytest.approx(JOINT)
    with pytest.raises(LogError, match="'motor_counts' is in counts, and nothing says how many"):
        read_log(tmp_path / "log.mat")
    for bad in ((9, 9, 9), "few", 0):
        with pytest.raises(ParameterError, match="counts per turn"):
            read_log(path, counts_per_turn=bad)  # type: ignore[arg-type]


def test_counts_a_turn_that_look_exchanged_are_asked_about(write: Write) -> None:
    path = write(text(rows(TIME, *COUNTED), "time_s,motor,joint"))
    for turns, asked in (((8192, 4000), False), ((32768, 1000), True)):
        doubts = read_log(path, unit="counts", counts_per_turn=turns).doubts
        assert any("are the counts a turn of the two exchanged?" in str(one) for one in doubts) is asked


def test_counts_that_nobody_named_are_suspected(write: Write) -> None:
    counted = [np.round(angle / (2.0 * np.pi) * 8192.0) for angle in (MOTOR, JOINT)]
    with pytest.raises(LogError, match=r"look like counts of an encoder; .*--unit counts --counts-per-turn 8192"):
        read_log(write(text(rows(TIME, *counted), "time_s,motor,joint")))


def test_counts_per_turn_alone_leave_named_columns_as_they_are(write: Write) -> None:
    counted = np.round(MOTOR * 8192.0 / math.tau)
    log = read_log(write(text(rows(TIME, counted, np.degrees(JOINT)), "time_s,motor_counts,joint_deg")), **TURN)
    assert log.motor == pytest.approx(MOTOR, abs=1e-3)
    assert log.joint == pytest.approx(JOINT, abs=1e-6)
    assert not any("counts" in said for said in log.warnings)
    assert (log.encoders.motor, log.encoders.joint) == (math.tau / 8192.0, 0.0)


def test_a_length_is_asked_for_where_the_joint_moves_too_far_for_an_angle(write: Write) -> None:
    path = write(text(rows(TIME, -25.0 * MOTOR, np.degrees(JOINT)), "time_s,motor,joint"))  # [mm] at 25 mm
    (doubt,) = read_log(path, unit="deg").doubts
    assert "is that a length in mm?" in doubt.reasons[0]
    assert doubt.reasons[0].endswith("--unit deg,deg or --unit rad,deg")
    assert not read_log(path, unit="deg,deg").doubts


def test_names_of_time_and_motor_that_are_exchanged_are_told(write: Write) -> None:
    exchanged = rows(TIME, np.degrees(MOTOR), np.degrees(JOINT))
    with pytest.raises(LogError, match="exchange the names 'time_s' and 'motor_deg'"):
        read_log(write(text(exchanged, "motor_deg,time_s,joint_deg")))


@pytest.mark.parametrize("names", ["time_s,motor_deg,joint_deg", "time_s,motor,joint"])
def test_counts_per_turn_of_a_log_in_degrees_are_its_encoders(names: str, write: Write) -> None:
    path = write(text(rows(TIME, np.degrees(MOTOR), np.degrees(JOINT)), names))
    turns: dict[str, Any] = {"counts_per_turn": (8192, 4000)}
    log = read_log(path, unit="deg", **turns)
    assert log.motor == pytest.approx(MOTOR, abs=1e-6)
    assert log.encoders == pytest.approx((math.tau / 8192.0, math.tau / 4000.0, 0.0))
    assert not [said for said in log.warnings if "counts" in said]
    with pytest.raises(LogError, match=r"taken as counts, and has .*; expected whole numbers; .*--unit deg"):
        read_log(path, unit="counts", **turns)


TURN: dict[str, Any] = {"counts_per_turn": 8192}


def test_numbers_of_numpy_are_numbers() -> None:
    assert angle_units("counts", np.array([8192, 4000])) == angle_units("counts", (8192, 4000))
    assert angle_units("counts", np.int64(8192)) == angle_units("counts", 8192)
    for rate in (np.int64(100), np.float32(100.0)):
        checked_rate(rate)
    with pytest.raises(ParameterError, match="the rate is"):
        checked_rate(np.bool_(True))
    with pytest.raises(ParameterError, match="counts per turn"):
        angle_units("counts", np.full((2, 2), 4000))


def test_a_gap_is_one_where_every_row_is_doubled() -> None:
    time = np.repeat(np.arange(2000) * 0.002, 2)
    even_clock(time, [time], str)
    left = time[(time < 1.0) | (time > 1.036)]
    with pytest.raises(LogError, match="time has a gap"):
        even_clock(left, [np.sin(40.0 * left)], str)
    late = np.delete(time, [0, 2])
    late = np.sort(np.concatenate([late[(late < 1.001) | (late > 1.003)], np.full(2, 1.004)]))  # of a late tick
    assert len(even_clock(late, [late], str)[0]) == 2000


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("rows", [1, 4])
def test_only_a_reading_that_is_repeated_is_held(seed: int, rows: int) -> None:
    """A joint that turns by a few counts a row, with noise of half of one, is new in each."""
    random = np.random.default_rng(seed)
    count = math.tau / 16384.0
    time = np.arange(0.0, 20.0, 0.004)
    speed = np.radians(random.uniform(5.0, 60.0))
    joint = speed * np.sin(time) + random.uniform(0.0, 0.5) * count * random.standard_normal(time.size)
    read = np.round(joint / count)[np.arange(time.size) // rows * rows] * count
    assert held_rows(read)[0] == rows


@pytest.mark.parametrize(("turn", "unit"), [(360.0, "deg"), (math.tau, "rad"), (8192.0, "counts")])
def test_an_angle_that_wraps_is_unwrapped(turn: float, unit: str, write: Write) -> None:
    motor = 3.0 * np.sin(3.0 * TIME)  # almost half a turn, to and fro
    recorded = [angle * turn / math.tau for angle in (np.mod(motor, math.tau), JOINT)]
    count = math.tau / turn if unit == "counts" else 1e-5
    path = write(text(rows(TIME, *(np.round(one) if unit == "counts" else one for one in recorded)), "t,motor,joint"))
    log = read_log(path, unit=unit, counts_per_turn=8192 if unit == "counts" else None)
    assert np.ptp(log.motor - motor) <= 1.01 * count
    assert "motor wraps at a turn 3 times" in log.warnings[0]


def test_a_motor_may_make_many_turns_where_its_unit_is_known(write: Write) -> None:
    turns = 100.0 * MOTOR  # ±8 turns
    log = read_log(write(text(rows(TIME, turns, JOINT))))
    assert log.motor == pytest.approx(turns, abs=1e-6)
    assert log.warnings[0].startswith("the motor moves 111 times as far as the joint, as before a gear")
    with pytest.raises(LogError, match=r"look like degrees, or a length; .*; of a motor of many turns, say rad"):
        read_log(write(text(rows(TIME, turns, JOINT), "t,motor,joint")))
    degrees = text(rows(TIME, 57.3 * np.degrees(MOTOR), np.degrees(JOINT)), "t,motor_deg,joint_deg")
    with pytest.raises(LogError, match=r"looks like degrees beside radians; .*\(--unit deg,deg"):
        read_log(write(degrees))
    assert np.ptp(read_log(write(degrees), unit="deg,deg").motor) == pytest.approx(57.3 * np.ptp(MOTOR), rel=1e-6)


@pytest.mark.parametrize(
    ("factor", "level", "said"),
    [
        (1e3, "no", "is time in ms?"),  # rows are seconds apart as well
        (60.0, "with care", "is time in ms?"),
        (1.0, None, ""),
        (1e-3, "no", "check the unit of time"),
    ],
)
def test_time_in_another_unit_is_noticed(factor: float, level: str | None, said: str, write: Write) -> None:
    doubts = read_log(write(text(rows(factor * TIME, MOTOR, JOINT), "time_s,motor_rad,joint_rad"))).doubts
    assert [one.level for one in doubts] == [level] * (level is not None)
    assert all(said in one.reasons[0] for one in doubts)


@pytest.mark.parametrize(
    ("motor", "joint"),
    [
        ("spool_enc_rad", "elbow_enc_rad"),
        ("Winch Angle [rad]", "right knee"),
        ("pulley_rad", "finger_pos_rad"),
        ("elbow motor (rad)", "elbow joint angle (rad)"),
    ],
)
def test_words_in_the_names_say_which_column_is_which(motor: str, joint: str, write: Write) -> None:
    file = write(text(rows(TIME, MOTOR, JOINT, JOINT, JOINT), f"time_s,{motor},{joint},elbow_torque_nm,motor_vel"))
    found = read_log(file)
    assert found.joint == pytest.approx(JOINT, abs=1e-5)
    assert found.warnings[:2] == tuple(
        f"{side} is column {name!r}, by a word in it" for side, name in (("motor", motor), ("joint", joint))
    )


@pytest.mark.parametrize(
    "names", ["header.stamp,winch/encoder [rad],arm/elbow [rad]", "a.time,a.motor.angle,a.joint.pos"]
)
def test_names_within_others_are_known_by_their_ends(names: str, write: Write) -> None:
    assert read_log(write(text(header=names)), unit="rad").motor == pytest.approx(MOTOR, abs=1e-5)


def test_units_say_which_column_is_the_time_and_which_the_other_angle(write: Write) -> None:
    log = read_log(write(text(["ms,rad,rad", *rows(1e3 * TIME, MOTOR, JOINT)], "Zeit,Motor,Ellenbogen")))
    for found, true in ((log.time, TIME), (log.motor, MOTOR), (log.joint, JOINT)):
        assert found == pytest.approx(true, abs=1e-5)


REFUSED: dict[str, tuple[str | bytes, str]] = {
    "missing column": (text(header="time_s,torque,joint_rad"), "no motor column among 'time_s', 'torque', 'joint_rad'"),
    "a name twice": (text(rows(TIME, MOTOR, JOINT, JOINT), HEADER + ",motor_rad"), "2 columns are called 'motor_rad'"),
    "no word for any": (text(header="time_s,count,value_rad"), "no motor column and no joint column among"),
    "two missing": (text(header="a,b,joint_rad"), "no time column and no motor column among"),
    "text in a number": (text(put(LINES, 17, "0.15,abc,0.2")), "line 17: motor_rad is 'abc'"),
    "text in the first row": (text(put(LINES, 2, "0.0,abc,0.2")), "line 2: motor_rad is 'abc'"),
    "no names": ("\n".join(LINES), "no time column and no motor column and no joint column among '1', '2', '3'"),
    "rows without order": (text([*LINES[200:], *LINES[:200]]), "time goes back (3.99 s, then 0 s), in 1 place"),
    "hardly any numbers": (text([f"{t:.2f},,0.1" for t in TIME]), "400 of 400 rows lack a number"),
    "a row cut off": (text([*LINES, "4.00,0.1"]), "line 402: 2 fields where there are 3 columns"),
    "no clock": (text(rows(np.floor(TIME / 0.03) * 0.03, MOTOR, JOINT)), "line 3: time repeats (0 s); 266 of 400 rows"),
    "a still motor": (text(rows(TIME, 0.0 * MOTOR + 0.3, JOINT)), "motor_rad is 0.3 rad in every sample"),
    "a still motor in degrees": (
        text(rows(TIME, 0.0 * MOTOR + 30.0, JOINT), "time_s,motor_deg,joint_deg"),
        "motor_deg is 30 deg in every sample",
    ),
    "beyond any cable": (
        text(put(rows(*DEGREES), 17, "0.15,4000.0,0.2"), "time_s,motor_deg,joint_deg"),
        "line 17: motor_deg is 4000°; expected an angle within ±1146° (more of a motor that moves without jumps",
    ),
    "a still joint": (text(rows(TIME, MOTOR, 0.0 * JOINT)), "joint_rad is 0 rad in every sample"),
    "too short": (text(LINES[:30]), "30 samples are too short"),
    "degrees as radians": (text(rows(*DEGREES)), "declared as radians; angles beyond ±20 rad look like degrees"),
    "degrees unsaid": (text(rows(*DEGREES), "t,motor,joint"), "without a unit in its name"),
    "empty": ("", "is empty"),
    "blank": ("\n\n\n", "is empty"),
    "names only": (HEADER + "\n", "no row of numbers found"),
    "prose": ("This is no log.\nIt has lines.\n" * 40, "no time column"),
    "binary": (bytes(range(256)) * 20, "is binary"),
    "a field too many": (text(put(LINES, 17, "0.15,0,3,0.2")), "line 17: 4 fields where there are 3 columns"),
    "a quoted field too many": (text(put(LINES, 17, '0.15,"0,1",0.2,1')), "line 17: 4 fields where there are 3"),
    "two empty fields too many": (text(put(LINES, 17, LINES[15] + ",,")), "line 17: 5 fields where there are 3"),
    "decimal commas throughout": (text([line.replace(".", ",") for line in LINES]), "semicolons or tabs between"),
    "damaged gzip": (gzip.compress(text().encode())[:-400], "is damaged"),
    "gzip in name only": (b"\x1f\x8bnot a gzip file at all", "is damaged"),
}


@pytest.mark.parametrize(("content", "said"), REFUSED.values(), ids=REFUSED)
def test_logs_that_are_refused(content: str | bytes, said: str, write: Write) -> None:
    path = write(content)
    with pytest.raises(LogError) as refused:
        read_log(path)
    message = str(refused.value)
    assert said in message
    assert path.name in message
    assert "\n" not in message
    assert "; " in message  # what is wrong, and what was expected or what to do


def test_files_that_cannot_be_opened(tmp_path: Path, write: Write) -> None:
    with pytest.raises(LogError, match="no such file; check the path"):
        read_log(tmp_path / "none.csv")
    with pytest.raises(LogError, match="is a folder; expected a log file"):
        read_log(tmp_path)
    with pytest.raises(LogError, match="cannot be read as a MATLAB file"):
        read_log(write("hello" * 100, "log.mat"))


def test_a_trace_in_parquet_is_a_log(tmp_path: Path, write: Write) -> None:
    wanted = read_log(write(text()))
    columns = {"time": wanted.time, "motor": np.degrees(wanted.motor), "joint": np.degrees(wanted.joint)}
    Trace(columns, {"time": "s", "motor": "deg", "joint": "deg"}).write(tmp_path / "trace.parquet")
    found = read_log(tmp_path / "trace.parquet")
    assert found.warnings == ()
    for name in ("time", "motor", "joint"):
        np.testing.assert_allclose(getattr(found, name), getattr(wanted, name), atol=1e-12)


def test_a_file_that_may_not_be_read(write: Write) -> None:
    path = write(text())
    path.chmod(0)
    try:
        path.open("rb").close()
    except PermissionError:
        with pytest.raises(LogError, match=r"cannot read .*: Permission denied"):
            read_log(path)
    else:
        pytest.skip("this user may read everything")


def test_more_rows_than_the_memory_should_hold(write: Write, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bowden.records.table.MOST_CELLS", 1199)
    with pytest.raises(LogError, match=r"has 1203 fields; expected 1199 at most; shorten it"):
        read_log(write(text()))


@given(st.binary(max_size=300))
def test_whatever_the_bytes_the_answer_is_one_line(tmp_path_factory: pytest.TempPathFactory, content: bytes) -> None:
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_bytes(content)
    with pytest.raises(BowdenError) as refused:
        read_log(path)
    assert len(str(refused.value).splitlines()) == 1


@given(st.text(alphabet='0123456789.,;\t eE+-naif#"\n', max_size=400))
def test_whatever_the_numbers_the_answer_is_one_line(tmp_path_factory: pytest.TempPathFactory, content: str) -> None:
    path = tmp_path_factory.getbasetemp() / "any.csv"
    path.write_text(HEADER + "\n" + content)
    with pytest.raises(BowdenError):
        read_log(path)


@pytest.mark.parametrize(
    ("name", "found"),
    [
        ("motor", ("motor", None)),
        ("Motor Angle (deg)", ("motor_angle", "deg")),
        ("time [ms]", ("time", "ms")),
        ("phi_in_rad", ("phi_in", "rad")),
        ("joint/°", ("joint", "deg")),
        ("deg", ("deg", None)),
        ("speed (rad/s)", ("speed_rad_s", None)),
    ],
)
def test_names_and_their_units(name: str, found: tuple[str, str | None]) -> None:
    assert split_name(name) == found


def test_a_measured_column_goes_before_a_true_one() -> None:
    none: dict[str, Any] = {}
    found = find_columns(["joint", "motor", "t", "joint_measured", "motor_measured"], none, "log")
    assert [found[role].index for role in ("time", "motor", "joint")] == [2, 4, 3]


def test_what_a_log_takes_to_read_grows_with_its_length_and_no_faster(write: Write) -> None:
    calls = []
    for n in (100, 2000, 20_000):  # the first one imports
        t = np.arange(n) / 1000.0
        path = write(text(rows(t, 0.5 * np.sin(t), 0.4 * np.sin(t))))
        calls.append(0)

        def called(frame: object, event: str, argument: object) -> None:
            calls[-1] += 1

        sys.setprofile(called)
        try:
            log = read_log(path)
        finally:
            sys.setprofile(None)
        assert len(log.time) == n
        assert math.isclose(log.time[-1], t[-1])
    assert calls[2] < 1.2 * 10 * calls[1]


def test_no_trust_in_a_log_whose_columns_look_swapped() -> None:
    """The far end of a cable lags, whichever way it is counted; one without play says nothing."""
    t = np.arange(0.0, 20.0, 0.01)
    motor = np.sin(2.0 * t)
    late = plays(motor, np.array([0.05]))[:, 0]
    for slope in (0.9, -0.9):
        assert bowden.identify(t, motor, slope * late).trust.level == "yes"
        swapped = bowden.identify(t, slope * late, motor).trust
        assert swapped.level == "no"
        assert "look swapped" in swapped.reasons[0]
    for whole, joint in ((2000, 0.9 * motor), (100, motor**2)):  # no loop is closed by the second
        assert "look swapped" not in str(bowden.identify(t[:whole], motor[:whole], joint[:whole]).trust)
    few = bowden.identify(t, np.rad2deg(0.15 * motor), np.rad2deg(0.15 * late))  # ±8.6°, without a unit
    assert few.trust.level == "no"
    assert "is it in degrees" in few.trust.reasons[0]
    for unit, level in (("deg", "no"), ("deg,deg", "with care")):
        small = bowden.identify(t, motor, late, unit=unit)
        assert small.trust.level == level
        assert "is it in radians" in small.trust.reasons[0]
