"""The exported loop on a simulated board: the cycle of `bowden run`, nothing that moves by itself, and its releases."""

import ctypes
import math
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import bowden
from bowden.core.signals import DriveState, Reference
from bowden.cycle.one_cycle import Cycle, Plan, TargetSource
from bowden.export.files import FLAGS
from bowden.hardware.ports import Power
from bowden.live.row import NOTHING_READ
from bowden.models.drive.thermal import cold
from bowden.operations.export import limits_of
from bowden.rig.counts import Counts, counts_of, joint_angle, motor_angle, motor_counts
from bowden.rig.joint_sensor import motor_reach
from bowden.rig.settings import JointSensor
from bowden.safety.faults import Fault, Reaction
from bowden.safety.state import Mode, Observed, PreflightResult, Request
from bowden.sensing.joint_angle import track_start, track_step
from loop_rig import twin_bench
from support.simulated_drive import SimulatedDrive

pytestmark = pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
DT = 1e-3
LOW, HIGH, WAY = 0.1, 0.9, 1.5
RIG = bowden.Rig(reference=bowden.MinimumJerk.periodic(LOW, HIGH, 2.0 * WAY), duration=6.0)
SENSED = RIG.replace(joint_sensor=JointSensor(source="imu", stream="udp:5005", delay=0.0))
REQUESTS = {5: Request.ARM, 800: Request.RUN}
GIVEN = ("motor", "joint", "current", "drive_state", "request", "may_move", "preflight", "emg", "stopped", "wanted")
TOLD = ("counts", "power", "joint", "motor", "position", "velocity", "acceleration", "requested", "source")
VERDICT = ("target", "power", "mode", "reaction", "faults")
BOARD = """
#include <math.h>
#include "loop.h"
void cycle(const double *in, double lateness, double elapsed, double *out);
void begin(const double *in);
static const double *given;
static double counts;
static bool powered;
static const loop_Cycle *got;
void board_begin(void) {}
double board_motor(double *age) { (void)age; return given[0]; }
double board_joint(double *age) { (void)age; return given[1]; }
void board_observe(safety_Observed *observed)
{
    observed->reading.current = given[2];
    observed->reading.drive_state = given[3];
    observed->request = (safety_Request)given[4];
    observed->reference = given[9];
}
bool board_emergency_stop(void) { return given[8] != 0.0; }
bool board_may_move(void) { return given[5] != 0.0; }
safety_PreflightResult board_preflight(double seconds, const safety_DriveReading *reading, double *target)
{
    (void)reading;
    *target += seconds < 0.5 ? 0.02 * (1.0 - cos(12.566370614359172 * seconds)) : 0.0;
    return seconds < 0.5 ? SAFETY_PREFLIGHT_RESULT_PENDING : (safety_PreflightResult)given[6];
}
void board_record(const loop_Cycle *made) { got = made; }
void board_send(double target, bool power) { counts = target; powered = power; }
void begin(const double *in) { given = in; loop_begin(); }
void cycle(const double *in, double lateness, double elapsed, double *out)
{
    given = in;
    EMG
    loop_cycle(lateness, elapsed);
    const double values[] = {
        counts, powered, (double)got->seen.joint, (double)got->seen.motor, (double)got->reference.position,
        (double)got->reference.velocity, (double)got->reference.acceleration, got->requested_target, got->source,
        got->verdict.target, got->verdict.power, got->verdict.mode, got->verdict.reaction, (double)got->verdict.faults
    };
    for (unsigned i = 0; i < sizeof values / sizeof *values; ++i) out[i] = values[i];
}
"""


class Board:
    """A bench of the twin behind an exported loop, which sees counts and says counts."""

    def __init__(self, folder: Path, *, emg: bool = False, rig: bowden.Rig = RIG) -> None:
        bowden.export(rig, folder, "adaptive", emg=emg)
        heard = "for (int i = 0; i < 2; ++i) if (given[7] == given[7]) loop_emg(0, given[7]);" if emg else ""
        (folder / "board.c").write_text(BOARD.replace("EMG", heard))
        sources = [*sorted(path.name for path in folder.glob("*.c") if path.name != "replay.c")]
        command = ["cc", *FLAGS.split(), "-fPIC", "-shared", *sources, "-o", "loop.so", "-lm"]
        subprocess.run(command, cwd=folder, check=True)
        self.c = ctypes.CDLL(str(folder / "loop.so"))
        for name in ("begin", "cycle"):
            getattr(self.c, name).restype = None
        self.drive, self.k, self.out = SimulatedDrive(twin_bench()), 0, np.zeros(14)
        counts = counts_of(RIG)
        assert isinstance(counts, Counts)
        self.encoders = counts
        self.given = dict.fromkeys(GIVEN, 0.0) | {"wanted": math.nan}
        self._read()
        self.c.begin(self._values())

    def _read(self) -> None:
        reading, encoders = self.drive.read(self.k * DT), self.encoders
        self.given["motor"] = round(motor_counts(encoders, reading.motor))
        self.given["joint"] = round((reading.joint + encoders.joint_zero) / encoders.joint_count)
        self.given |= {"current": reading.current, "drive_state": reading.drive_state}

    def _values(self) -> Any:
        self._kept = np.array([self.given[name] for name in GIVEN])  # which C goes on reading
        return self._kept.ctypes.data_as(ctypes.c_void_p)

    def step(self, request: Request = Request.NONE, **given: float) -> dict[str, float]:
        """One cycle: what the loop said."""
        self._read()
        self.given |= {
            "request": float(request),
            "may_move": 1.0,
            "preflight": 1.0,
            "stopped": 0.0,
            "wanted": math.nan,
            **given,
        }
        self.c.cycle(
            self._values(), ctypes.c_double(0.0), ctypes.c_double(DT), self.out.ctypes.data_as(ctypes.c_void_p)
        )
        told = dict(zip((*TOLD, *(f"verdict_{name}" for name in VERDICT)), self.out.tolist(), strict=True))
        target = motor_angle(self.encoders, told["counts"])
        self.drive.write(target, Power.ON if told["power"] else Power.OFF, (self.k + 1) * DT)
        self.k += 1
        return told

    def run(self, cycles: int, **given: float) -> Iterator[dict[str, float]]:
        """Armed at once, and to the law when the preflight has passed."""
        for k in range(cycles):
            yield self.step(REQUESTS.get(k, Request.NONE), **given)


@pytest.fixture
def board(tmp_path: Path) -> Board:
    return Board(tmp_path / "code")


def modes(rows: list[dict[str, float]]) -> list[Mode]:
    """Those that the supervisor went through."""
    found = [Mode(int(row["verdict_mode"])) for row in rows]
    return [one for k, one in enumerate(found) if k == 0 or one != found[k - 1]]


def test_its_commands_and_verdicts_are_those_of_the_cycle_in_python(board: Board) -> None:
    """To the bit, over a preflight, a motion there and back, two lost readings that are bridged, and a release."""
    law = RIG.fitted(bowden.LAWS["adaptive"])
    python = Cycle(law, limits_of(RIG, law), RIG.filters, DT)
    first = motor_angle(board.encoders, board.given["motor"]), joint_angle(board.encoders, board.given["joint"])
    python.begin(NOTHING_READ._replace(motor=first[0], joint=first[1]), cold(python.limits.thermal))
    preflight, age, led, armed = PreflightResult.PENDING, 0.0, 0, 0
    for k in range(5000):
        lost = {"joint": math.nan} if k in (1500, 1501) else {}
        request = {**REQUESTS, 4500: Request.STOP}.get(k, Request.NONE)
        told = board.step(request, **lost)
        age = age + 1.0 if lost else 0.0
        seen = motor_angle(board.encoders, board.given["motor"]), joint_angle(board.encoders, board.given["joint"])
        known = {"motor": seen[0], "joint": seen[1], "joint_age": age, "drive_state": board.given["drive_state"]}
        reading = NOTHING_READ._replace(**known, current=board.given["current"])
        source = TargetSource(int(told["source"]))
        if source == TargetSource.HOLD:
            preflight, armed = PreflightResult.PENDING, 0
        elif source == TargetSource.MOTION:
            preflight = PreflightResult.PASSED if armed * DT >= 0.5 else preflight
            armed += 1
        observed = Observed(reading, 0.0, DT, request, 0.0, True, preflight, 0.0, Reaction.NONE, 0.0)
        reference = Reference(told["position"], told["velocity"], told["acceleration"])
        requested, verdict = python.step(observed, Plan(source, told["requested"], reference))
        assert told["requested"] == requested, k
        assert [told[f"verdict_{name}"] for name in VERDICT] == [float(one) for one in verdict], k
        led += source >= TargetSource.LAW_BEGINS
    assert led > 3000
    assert Mode(int(told["verdict_mode"])) == Mode.STOPPED


def test_the_joint_follows_the_rigs_reference(board: Board) -> None:
    rows = list(board.run(8000))
    assert modes(rows) == [Mode.STOPPED, Mode.PREFLIGHT, Mode.RUNNING]
    led = np.array([[row["joint"], row["position"]] for row in rows if row["source"] >= TargetSource.LAW_BEGINS])
    assert led[:, 1].min() == pytest.approx(0.0, abs=0.01)  # from where the joint is
    assert led[round(WAY / DT), 1] == pytest.approx(LOW, abs=1e-6)
    assert led[round(2.0 * WAY / DT), 1] == pytest.approx(HIGH, abs=1e-6)
    assert np.sqrt(np.mean((led[:, 0] - led[:, 1]) ** 2)) < np.radians(2.0)


def test_as_exported_nothing_moves(board: Board, tmp_path: Path) -> None:
    """Whatever is asked for: it is never armed, and the drive gets no power."""
    text = (tmp_path / "code" / "board.cpp").read_text()
    assert "bool board_may_move(void)\n{\n    return false;\n}" in text
    requests = list(Request)
    rows = [board.step(requests[k % len(requests)], may_move=0.0) for k in range(2000)]
    assert {row["power"] for row in rows} == {0.0}
    assert Mode.PREFLIGHT not in modes(rows)


def test_a_board_that_says_no_in_mid_motion_lets_the_joint_down(board: Board) -> None:
    list(board.run(2000))
    rows = [board.step(may_move=0.0) for _ in range(3000)]
    assert modes(rows) == [Mode.RELEASING, Mode.STOPPED]
    assert rows[-1]["power"] == 0.0


def test_a_pressed_emergency_stop_takes_the_power_off_at_once(board: Board) -> None:
    list(board.run(2000))
    rows = [board.step(stopped=1.0) for _ in range(3)]
    assert rows[0]["power"] == 0.0
    assert modes(rows) == [Mode.LATCHED]
    assert int(rows[-1]["verdict_faults"]) >> Fault.EMERGENCY_STOP & 1


def test_the_rigs_motion_goes_on_from_where_the_boards_reference_ended(board: Board) -> None:
    rows = [*board.run(2500)]
    here = rows[-1]["position"]
    for k in range(2000):
        rows.append(board.step(wanted=here - 0.1 * min(k * DT, 1.0)))
    rows += [board.step() for _ in range(500)]
    assert modes(rows)[-1] == Mode.RUNNING
    assert np.abs(np.diff([row["position"] for row in rows[2501:]])).max() < 2e-3


def test_a_board_of_another_units_does_not_compile(board: Board, tmp_path: Path) -> None:
    code = tmp_path / "code"
    (code / "Arduino.h").write_text("")
    for defined, compiles in (("LOOP_IN_COUNTS", True), ("LOOP_IN_SPOOL", False)):
        text = (code / "loop.h").read_text().replace("LOOP_IN_COUNTS", defined)
        (code / "other").mkdir(exist_ok=True)
        (code / "other" / "loop.h").write_text(text)
        (code / "other" / "board.cpp").write_text((code / "board.cpp").read_text())
        done = subprocess.run(["c++", "-c", "-I..", "board.cpp"], cwd=code / "other", capture_output=True, text=True)
        assert (done.returncode == 0) is compiles, done.stderr


def test_a_joint_reading_that_stays_away_releases(board: Board) -> None:
    list(board.run(2000))
    rows = [board.step(joint=math.nan) for _ in range(3000)]
    assert modes(rows) == [Mode.BRIDGING, Mode.RELEASING, Mode.LATCHED]
    assert int(rows[-1]["verdict_faults"]) >> Fault.JOINT_LOST & 1
    assert rows[-1]["power"] == 0.0


def test_the_preflight_moves_nothing_before_the_drive_is_enabled(board: Board) -> None:
    """A drive that takes 0.4 s to enable is not sent the middle of the motion at once."""
    waiting = {"drive_state": float(DriveState.SWITCH_ON_DISABLED)}
    rows = [board.step(REQUESTS.get(k, Request.NONE), **(waiting if k < 400 else {})) for k in range(700)]
    motion = [row["requested"] for row in rows if row["source"] == TargetSource.MOTION]
    assert np.ptp(motion[:390]) < 1e-3  # where the motor is, in counts
    assert np.ptp(motion) > 0.03
    assert np.abs(np.diff(motion)).max() < 1e-3


def test_a_preflight_that_failed_never_runs(board: Board) -> None:
    assert Mode.RUNNING not in modes(list(board.run(2000, preflight=-1.0)))


def test_a_contraction_flexes_the_joint(tmp_path: Path) -> None:
    board, random = Board(tmp_path / "code", emg=True), np.random.default_rng(2)
    size = np.where(np.arange(9000) // 500 == 10, 20.0, 1.0)  # a contraction of half a second, after the way to rest
    told = [board.step(REQUESTS.get(k, Request.NONE), emg=size[k] * random.normal()) for k in range(9000)]
    position = np.array([row["position"] for row in told])
    assert np.nanmax(position[:5000]) == pytest.approx(RIG.emg.low, abs=0.01)
    assert position[-1] == pytest.approx(RIG.emg.high, abs=1e-6)
    assert told[-1]["joint"] == pytest.approx(RIG.emg.high, abs=np.radians(2.0))


def test_emg_that_falls_silent_stops_after_its_limit(tmp_path: Path) -> None:
    board, random = Board(tmp_path / "code", emg=True), np.random.default_rng(1)
    begun = [board.step(REQUESTS.get(k, Request.NONE), emg=random.normal()) for k in range(2000)]
    assert modes(begun)[-1] == Mode.RUNNING
    silent = [board.step(emg=math.nan) for _ in range(3000)]
    running = sum(row["verdict_mode"] == Mode.RUNNING for row in silent)
    assert running * DT == pytest.approx(RIG.supervisor_limits.emg_age, abs=2 * DT)
    assert modes(silent)[1:] == [Mode.RELEASING, Mode.LATCHED]
    assert int(silent[-1]["verdict_faults"]) >> Fault.EMG_LOST & 1


@pytest.fixture
def estimating(tmp_path: Path) -> Board:
    return Board(tmp_path / "code", rig=SENSED)


def sensed(board: Board, true: float) -> dict[str, float]:
    """What an IMU says in a cycle: every tenth the joint's angle, 2° noisy."""
    noise = 2.0 * np.radians(np.random.default_rng(board.k).standard_normal())
    return {"joint": true + noise if board.k % 10 == 0 else math.nan}


def test_a_joint_without_an_encoder_is_followed_by_its_estimate(estimating: Board) -> None:
    """It is the estimate of a live run, to the bit; a sensor that stops lets the joint down."""
    reach, state = motor_reach(SENSED.supervisor_limits), track_start(SENSED.joint_model)
    first, rows = {"motor": estimating.given["motor"], "joint": 0.0}, []
    for k in range(7000):
        true = estimating.drive.read(estimating.k * DT).joint
        given = sensed(estimating, true) if k < 6000 else {"joint": math.nan}
        told = estimating.step(REQUESTS.get(k, Request.NONE), **given)
        for motor, value in ((first["motor"], first["joint"]), (estimating.given["motor"], given["joint"]))[k > 0 :]:
            angle = motor_angle(estimating.encoders, motor)
            state = track_step(SENSED.joint_model, reach, state, angle, 0.0, value, DT, DT)
        if k < 6000:
            assert told["joint"] == state.estimate.angle, k
        rows.append({**told, "true": true})
    led = np.array([[row["true"], row["position"]] for row in rows if row["source"] >= TargetSource.LAW_BEGINS])
    assert len(led) > 4000
    assert np.sqrt(np.mean((led[:, 0] - led[:, 1]) ** 2)) < np.radians(3.0)
    assert modes(rows)[-2:] == [Mode.RUNNING, Mode.RELEASING]
    assert int(rows[-1]["verdict_faults"]) >> Fault.JOINT_UNSURE & 1


def test_without_emg_from_the_beginning_nothing_is_armed(tmp_path: Path) -> None:
    board = Board(tmp_path / "code", emg=True)
    assert modes(list(board.run(1000, emg=math.nan))) == [Mode.STOPPED]
