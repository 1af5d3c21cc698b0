"""What EMG says on its way to the loop: a block that never tears, a listener equal to the offline chain, a course."""

import math
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bowden.core.clock import SECOND
from bowden.core.errors import LogError
from bowden.core.signals import Reference
from bowden.hardware.emg import intent_block
from bowden.hardware.emg.course import COLUMNS, EmgCourse
from bowden.hardware.emg.intent_block import IntentReader, IntentWriter, StreamReading
from bowden.hardware.emg.listener import Listener
from bowden.hardware.emg.recorded import EmgMotion
from bowden.hardware.ports import EmgChunk
from bowden.rig.emg_run import EmgRun
from bowden.sensing.course import CourseSettings, CourseState, course_step
from bowden.sensing.intent import Intent, IntentSettings, intent_start
from bowden.sensing.stream import EnvelopeFilter, OnsetDetector
from bowden.sensing.wearer_file import MuscleCalibration
from emg_sources import rest

RATE, DT = 1000.0, 0.001
INTENT = list(COLUMNS).index("emg.intent")
WRITER = """
import sys
from pathlib import Path
from bowden.hardware.emg.intent_block import IntentWriter, StreamReading
writer = IntentWriter(Path(sys.argv[1]))
for k in range(1, 60_001):
    writer.write(StreamReading(k, k, k, k, k, k, float(k), float(k), float(k), float(k), float(k)))
"""


@pytest.fixture
def block(tmp_path: Path) -> Path:
    intent_block.create(tmp_path / "intent")
    return tmp_path / "intent"


def contraction(seconds: float, spans: list[tuple[float, float]], seed: int = 1) -> np.ndarray:
    """Rest with bursts of broadband noise, ten times as large."""
    random = np.random.default_rng(seed)
    signal = 0.01 * random.standard_normal(round(seconds * RATE))
    for begin, end in spans:
        signal[round(begin * RATE) : round(end * RATE)] *= 20.0
    return signal


def chunks(signal: np.ndarray, cuts: list[int]) -> list[EmgChunk]:
    times = np.arange(len(signal)) / RATE
    return [EmgChunk(signal[a:b], times[a:b]) for a, b in zip([0, *cuts], [*cuts, len(signal)], strict=True)]


def test_words_come_back_as_they_were_written(block: Path) -> None:
    reader, writer = IntentReader(block), IntentWriter(block)
    assert reader.read() == StreamReading()
    told = StreamReading(7 * SECOND, 6 * SECOND, 12, 3, 0, 5 * SECOND, 1.0, 0.0, 0.25, 0.1, 2.0)
    writer.write(told)
    assert reader.read() == told
    assert [type(word) for word in reader.read()] == [int] * 6 + [float] * 5


def test_words_that_are_being_written_are_not_read(block: Path) -> None:
    reader, writer = IntentReader(block), IntentWriter(block)
    writer.write(StreamReading(1, 1, 1, 1))
    first = reader.read()
    writer._sequence[0] += 1  # as a writer that has died in the middle leaves it
    writer._memory[8] = 99
    assert reader.read() == first


def test_a_reader_beside_a_writer_sees_words_of_one_moment_only(block: Path) -> None:
    reader, seen = IntentReader(block), set()
    process = subprocess.Popen([sys.executable, "-c", WRITER, str(block)])
    try:
        while process.poll() is None:
            for _ in range(200):
                heard = reader.read()
                assert len(set(heard)) == 1, heard
                seen.add(heard.newest)
    finally:
        process.kill()
        process.wait()
    assert process.returncode == 0
    assert reader.read().newest == 60_000
    assert len(seen) > 10


def test_no_block_is_told(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="start the run first"):
        IntentReader(tmp_path / "none")


@pytest.mark.parametrize("seed", range(3))
def test_a_stream_in_pieces_says_what_the_whole_recording_does(seed: int) -> None:
    signal = contraction(4.0, [(1.5, 2.5)])
    cuts = sorted(np.random.default_rng(seed).choice(np.arange(1, len(signal)), 40, replace=False).tolist())
    active = OnsetDetector(RATE).feed(signal).active
    envelope = EnvelopeFilter(RATE).feed(signal).envelope
    listener = Listener(RATE, 0, wearer=MuscleCalibration(0.01, 0.21, "", ""))
    for chunk, end in zip(chunks(signal[:, None], cuts), [*cuts, len(signal)], strict=True):
        heard = listener.take(chunk, 100.0)
        assert (heard.flexor, heard.level) == (active[end - 1], envelope[end - 1])
        assert heard.share == pytest.approx((envelope[end - 1] - 0.01) / 0.2, abs=1e-12)
        assert heard.newest == round((end - 1) / RATE * SECOND)
    onset = int(np.flatnonzero(np.diff(active) > 0.5)[0]) + 1
    assert heard.onset == round(onset / RATE * SECOND)
    assert (heard.samples, heard.lost) == (4000, 0)


def test_a_missing_sample_is_counted_makes_nothing_new_and_no_envelope_that_is_none() -> None:
    signal = contraction(3.0, [])[:, None]
    signal[2000:] = np.nan
    listener = Listener(RATE, 0)
    for chunk in chunks(signal, [1000, 2000, 2500]):
        heard = listener.take(chunk, 100.0)
    assert (heard.samples, heard.lost) == (3000, 1000)
    assert heard.newest == round(1.999 * SECOND), "the newest sample that there is"
    assert (heard.flexor, heard.trouble) == (0.0, 1.0)
    assert math.isfinite(heard.level)
    assert math.isnan(heard.share)


def test_a_first_sample_that_is_missing_is_no_jump_from_nothing_to_the_offset() -> None:
    signal = 0.4 + contraction(3.0, [])[:, None]
    signal[:5] = np.nan
    listener = Listener(RATE, 0, wearer=MuscleCalibration(0.01, 0.21, "", ""))
    shares = [listener.take(chunk, 100.0).share for chunk in chunks(signal, list(range(2, 3000, 7)))]
    assert np.nanmax(np.abs(shares)) < 0.1


def test_a_wearers_rest_is_not_taken_for_a_contraction_after_a_start_that_was_muted() -> None:
    signal = contraction(20.0, [(15.0, 16.0)])
    sigma = float(OnsetDetector(RATE).feed(signal).rest[10_000])
    signal[:2000] *= 0.1
    for wearer, begins in ((None, 2.0), (MuscleCalibration(0.008, 0.2, "", "", sigma), 15.0)):
        listener = Listener(RATE, 0, wearer=wearer)
        heard = [listener.take(chunk, 100.0) for chunk in chunks(signal[:, None], list(range(10, 20_000, 10)))]
        first = next(one.onset for one in heard if one.onset)
        assert begins < first / SECOND < begins + 0.15


def test_a_sample_of_the_future_counts_from_now_on() -> None:
    listener = Listener(RATE, 0)
    heard = listener.take(EmgChunk(np.zeros((2, 1)), np.array([5.0, 5.001])), 4.0)
    assert heard.newest == 4 * SECOND
    assert listener.take(EmgChunk(np.zeros((0, 1)), np.zeros(0)), 9.0) == heard


def test_two_muscles_each_have_their_channel() -> None:
    values = np.column_stack([contraction(3.0, []), contraction(3.0, [(1.5, 3.0)], 2), np.zeros(3000)])
    listener = Listener(RATE, 0, 1)
    for chunk in chunks(values, [1000, 2000]):
        heard = listener.take(chunk, 100.0)
    assert (heard.flexor, heard.extensor, heard.trouble) == (0.0, 1.0, 0.0), (
        "a channel that is not used is not looked at"
    )


def test_rest_says_nothing_for_a_minute() -> None:
    signal, _ = rest(RATE, 60.0, 3)
    assert Listener(RATE, 0).take(*chunks(signal[:, None], []), 99.0).onset == 0


SETTINGS = CourseSettings(IntentSettings(0.1, 1.2, 1.5))


def course(block: Path, settings: CourseSettings = SETTINGS) -> tuple[EmgCourse, IntentWriter]:
    return EmgCourse(settings, IntentReader(block), 0, 5000, 0.04), IntentWriter(block)


def test_a_motion_begins_in_the_cycle_in_which_the_contraction_is_seen(block: Path) -> None:
    led, writer = course(block)
    led.begin()
    for _ in range(5):
        led.look(SECOND)
        assert led.step(DT) == (0.1, 0.0, 0.0)
    writer.write(StreamReading(newest=SECOND, looked=SECOND, onset=SECOND, flexor=1.0))
    led.look(SECOND)
    led.step(DT)
    assert led.row()[INTENT] == Intent.FLEX
    led.look(SECOND)
    assert led.step(DT).velocity > 0.0
    for _ in range(1600):
        led.look(SECOND)
        reference = led.step(DT)
    assert reference == (1.2, 0.0, 0.0)
    assert led.row()[INTENT] == Intent.HOLD, "one contraction is one motion, however long it lasts"


def test_age_is_that_of_the_newest_sample_and_endless_before_the_first(block: Path) -> None:
    led, writer = course(block)
    assert led.look(5 * SECOND) == math.inf
    writer.write(StreamReading(newest=4 * SECOND, looked=5 * SECOND))
    assert led.look(5 * SECOND) == pytest.approx(1.0)
    assert not led.over
    writer.write(StreamReading(newest=4 * SECOND, ends=6 * SECOND, looked=5 * SECOND))
    led.look(5 * SECOND)
    assert not led.over
    assert led.look(round(5.041 * SECOND)) == math.inf, "nobody reads"
    for now in (5.6, 9.0):  # the joint goes home after it, which no stream leads
        assert led.look(round(now * SECOND)) == 0.0
        assert led.over, "a recording ends the run before it ends itself"


def test_a_contraction_from_before_the_run_begins_no_motion(block: Path) -> None:
    led, writer = course(block)
    writer.write(StreamReading(newest=SECOND, looked=SECOND, flexor=1.0))
    led.look(SECOND)
    led.begin()
    for _ in range(50):
        led.look(SECOND)
        assert led.step(DT).position == 0.1


def test_the_joint_follows_the_envelope_and_goes_to_rest_where_the_signal_is_in_trouble(block: Path) -> None:
    led, writer = course(block, SETTINGS._replace(proportional=1.0, full=0.5))
    for share, trouble, wanted in ((0.25, 0.0, 0.65), (0.9, 0.0, 1.2), (0.9, 2.0, 0.1), (math.nan, 0.0, 0.1)):
        writer.write(StreamReading(newest=SECOND, looked=SECOND, share=share, trouble=trouble))
        for _ in range(4000):
            led.look(SECOND)
            reference = led.step(DT)
        assert reference.position == pytest.approx(wanted, abs=1e-4)


def test_the_loops_course_is_the_kernels_and_the_motion_of_a_recording(block: Path) -> None:
    """Step by step: the arrays of the loop, the tuples of the kernel, and the table of a simulation."""
    active = (np.arange(6000) // 900 % 2).astype(float)
    run = EmgRun("file:x", None, None, None, "", SETTINGS)
    table = EmgMotion(run, active, np.zeros(6000), np.full(6000, np.nan), DT).sample(np.arange(6000) * DT)
    led, writer = course(block)
    led.begin()
    mirrored = CourseState(intent_start(0.1), Reference(0.1, 0.0, 0.0))
    for k in range(6000):
        writer.write(StreamReading(newest=SECOND, looked=SECOND, flexor=float(active[k]), share=math.nan))
        led.look(SECOND)
        reference = led.step(DT)
        assert tuple(reference) == tuple(table[k])
        if k < 1200:
            mirrored, same = course_step(SETTINGS, mirrored, float(active[k]), 0.0, math.nan, DT)
            assert tuple(same) == pytest.approx(tuple(reference), abs=1e-12)
    assert np.ptp(table[:, 0]) == pytest.approx(1.1)
    assert np.abs(np.diff(table[:, 1])).max() < 0.02, "no jump in velocity where a motion turns round"


def test_a_sender_that_says_the_same_again_is_in_trouble_and_no_muscle_is() -> None:
    """A buffer that is stuck in a contraction would hold it for ever; a converter whose count is large repeats less."""
    signal = contraction(6.0, [(2.0, 5.0)])
    stuck = np.concatenate([signal[:3000], np.tile(signal[3000:3700], 4)])
    for given, repeats in ((signal, False), (np.round(signal / 0.01) * 0.01, False), (stuck, True)):
        listener, troubled = Listener(RATE, 0), []
        for chunk in chunks(given[:, None], list(range(7, len(given), 7))):
            troubled.append(listener.take(chunk, 100.0).trouble)
        assert not any(troubled[: 3800 // 7 - 1])
        assert all(troubled[3800 // 7 + 4 :]) is repeats, "a tenth of a second after it begins anew"
