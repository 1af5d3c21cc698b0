"""The loop by EMG on a clock of the tests': a contraction moves the joint, a lost stream releases, the log replays."""

from pathlib import Path

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.core.clock import SECOND
from bowden.cycle.one_cycle import Filters, TargetSource
from bowden.hardware.emg import intent_block
from bowden.hardware.emg.course import EmgCourse
from bowden.hardware.emg.intent_block import EmgLoss, IntentReader, IntentWriter, StreamReading
from bowden.live.ended import Ended
from bowden.live.mcap_read import Recording
from bowden.live.preflight import Preflight
from bowden.live.replay import replay
from bowden.live.script import Script
from bowden.live.stops import run_stops
from bowden.safety.faults import Fault
from bowden.safety.limits import Limits
from bowden.safety.release import longest_release
from bowden.safety.state import Mode
from bowden.sensing.course import CourseSettings
from bowden.sensing.intent import Intent, IntentSettings
from loop_rig import LoopRig, twin_bench
from support.simulated_drive import SimulatedDrive

LAW, LIMITS = LAWS["adaptive"], Limits(uses_emg=True)
SETTINGS = CourseSettings(IntentSettings(0.0, 1.0, 1.0))
CYCLES = 3000


def run(
    folder: Path,
    contracts: int,
    lasts: int,
    begins: int = 0,
    stalls: int = -1,
    dies: int = 99_999,
    *,
    reader: int = 99_999,
) -> tuple[Ended, Recording]:
    """A run by EMG: the muscle contracts `contracts` cycles after the law has the motor, never if that is 0; the stream
    begins after `begins` cycles, and is gone `lasts` cycles after the law has the motor; after `stalls` of them the
    computer stalls once; after `dies` of them the electrodes are dead, after `reader` of them the process that reads.
    """
    intent_block.create(folder / "intent")
    stream, said = IntentWriter(folder / "intent"), [StreamReading()]

    def between(rig: LoopRig) -> None:
        if rig.led == stalls:
            rig.time += 8 * SECOND // 1000
        if rig.sleeps >= begins and rig.led < reader:
            active = float(0 < contracts <= rig.led)
            active, trouble = (0.0, 1.0) if rig.led >= dies else (active, 0.0)
            onset = rig.time if active else 0
            if rig.led < lasts:
                said[0] = StreamReading(newest=rig.time, onset=onset, flexor=active, share=0.5, trouble=trouble)
            stream.write(said[0]._replace(looked=rig.time))

    course = EmgCourse(SETTINGS, IntentReader(folder / "intent"), 0, CYCLES, 0.04)
    script = Script(np.zeros((1, 3)), 0.0, 0.5, Preflight(), 1e-3, course)
    arms, quits = (10, begins + 50) if begins else (10,), begins + 200
    drive = SimulatedDrive(twin_bench())
    return LoopRig(folder, LAW, LIMITS, drive, script, between, arms=arms, quits=quits, course=course).run()


def test_a_contraction_moves_the_joint_in_the_cycle_in_which_it_comes(tmp_path: Path) -> None:
    ended, log = run(tmp_path, 1200, 99_999)
    assert (ended.mode, ended.faults) == (Mode.STOPPED, 0), "the run comes to its end, and that is no fault"
    seen = int(np.argmax(log["emg.flexor"]))
    assert log["emg.intent"][seen] == Intent.FLEX
    assert log["reference_velocity"][seen] == 0.0
    assert log["reference_velocity"][seen + 1] > 0.0
    led = log["source"] >= TargetSource.LAW_BEGINS
    assert CYCLES <= led.sum() <= CYCLES + 1
    assert log["reference"][led][-1] == 1.0
    assert abs(log["joint"][led][-1] - 1.0) < 0.03
    assert np.isnan(log["emg.onset"][: seen - 1]).all()
    assert log["emg.onset"][seen] == pytest.approx(log["time"][seen], abs=0.002)


def test_a_motion_goes_on_where_it_was_after_cycles_that_were_skipped(tmp_path: Path) -> None:
    ended, log = run(tmp_path, 1200, 99_999, stalls=1700)
    assert (ended.mode, ended.faults) == (Mode.STOPPED, 0)
    assert ended.overruns >= 7
    moves = np.diff(log["reference"][log["source"] == TargetSource.LAW][1100:])
    assert moves.max() == pytest.approx(1.875e-3, rel=1e-3), "15/8 of the mean speed, a cycle after the other"


def test_dead_electrodes_hold_no_limb_and_end_no_rest(tmp_path: Path) -> None:
    """They send zeros as freshly as any; one that never moved is left where it is."""
    for contracts, ends in ((300, Mode.LATCHED), (0, Mode.STOPPED)):
        folder = tmp_path / str(contracts)
        folder.mkdir()
        ended, log = run(folder, contracts, 99_999, dies=1500)
        assert (ended.mode, ended.faults) == (ends, 2**Fault.EMG_LOST if contracts else 0)
        led = log["source"] >= TargetSource.LAW_BEGINS
        assert led.sum() == pytest.approx(2502 if contracts else CYCLES, abs=3)


@pytest.mark.parametrize("contracts", [300, 1600])
def test_a_lost_stream_releases_and_no_new_motion_begins(tmp_path: Path, contracts: int) -> None:
    ended, log = run(tmp_path, contracts, 1500)
    assert ended.mode == Mode.LATCHED
    assert ended.faults == 2**Fault.EMG_LOST
    mode = log["mode"]
    released = int(np.argmax(mode == Mode.RELEASING))
    age = log["emg.age"]
    assert age[released] > 0.2 >= age[released - 1]
    assert (log["power"][released:] == 0.0).sum() > 0
    assert np.flatnonzero(log["power"][released:] == 0.0)[0] <= 1000 * longest_release(LIMITS) + 2
    late = age[:released] > 0.02
    assert (log["emg.intent"][:released][late & (log["source"][:released] >= 2)] != Intent.FLEX).all()
    moving = log["reference_velocity"][:released][late]
    assert contracts == 300 or not moving[np.isfinite(moving)].any()
    same = replay(log, LAW, LIMITS, Filters(), 1e-3, same=True)
    assert (same.verdicts_differing, same.requested_target_largest, same.command_largest) == (0, 0.0, 0.0)


def test_a_reader_that_is_gone_is_known_sooner_than_a_stream_that_pauses(tmp_path: Path) -> None:
    ended, log = run(tmp_path, 300, 99_999, reader=1500)
    assert (ended.mode, ended.faults) == (Mode.LATCHED, 2**Fault.EMG_LOST)
    led = np.flatnonzero(log["source"] >= TargetSource.LAW_BEGINS)
    gone = led[1500]
    released = int(np.argmax(log["mode"] == Mode.RELEASING))
    assert released - gone <= 42
    assert np.flatnonzero(log["power"][gone:] == 0.0)[0] <= 1000 * longest_release(LIMITS) + 50


@pytest.mark.parametrize(
    ("what", "loss", "says", "never"),
    [
        ({"reader": 1500}, EmgLoss.READER, "process that reads the stream stalled", "look at the electrodes"),
        ({"lasts": 1500}, EmgLoss.STREAM, "no new samples came", "look at the electrodes"),
        ({"dies": 1500}, EmgLoss.DEAD, "look at the electrodes", "no new samples came"),
    ],
    ids=["reader", "stream", "electrodes"],
)
def test_a_stalled_reader_a_silent_sender_and_a_dead_electrode_are_told_apart(
    tmp_path: Path, what: dict[str, int], loss: EmgLoss, says: str, never: str
) -> None:
    ended, log = run(tmp_path, 300, **{"lasts": 99_999, **what})
    assert ended.faults == 2**Fault.EMG_LOST
    (stop,) = run_stops(log, LIMITS._asdict(), twin=False)
    assert log["emg.loss"][int(np.argmax(log["mode"] == Mode.RELEASING))] == loss
    assert says in stop.remedies[0]
    assert never not in stop.remedies[0]


def test_without_a_stream_it_cannot_be_armed_until_there_is_one(tmp_path: Path) -> None:
    ended, log = run(tmp_path, 0, 99_999, begins=400)
    before = log["time"] - 1.0 < 0.4
    assert (log["mode"][before] == Mode.STOPPED).all()
    assert (log["power"][before] == 0.0).all()
    assert (log["faults"][10:300] == 2**Fault.EMG_LOST).all()
    assert ended.mode == Mode.STOPPED
    assert (log["source"] >= TargetSource.LAW_BEGINS).sum() >= CYCLES
    assert not log["reference"][log["source"] == TargetSource.LAW][1500:].any(), "nobody contracts, nothing moves"
