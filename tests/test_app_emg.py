"""`bowden emg calibrate` and `score`: documents, files, and recordings that cannot be used."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bowden.app.main import run
from bowden.core.errors import StreamError
from bowden.hardware.emg.listener import Listener
from bowden.hardware.emg.sources import Playback
from bowden.hardware.ports import EmgChunk
from bowden.identify.emg.levels import envelope_levels
from bowden.identify.emg.log import read_emg
from bowden.sensing import wearer_file
from bowden.sensing.envelope import DEFAULTS
from bowden.sensing.stream import EnvelopeFilter
from bowden.sim.emg import NOISE, background, contractions, hum
from emg_sources import heart
from support.command import Command

pytestmark = pytest.mark.usefixtures("undrawn")

SPANS = [(2.0, 3.0, 0.2), (5.0, 6.0, 0.4)]


@pytest.fixture(autouse=True)
def _here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)


def signal(seconds: float = 8.0, rate: float = 1000.0) -> np.ndarray:
    count = round(seconds * rate)
    return background(rate, count, np.random.default_rng(1)) + contractions(rate, SPANS, count, 1)


def write(path: str, values: Any, rate: float = 1000.0, head: str = "time_s,emg_mV", start: float = 0.0) -> Path:
    columns = np.atleast_2d(np.asarray(values, dtype=float))
    table = np.column_stack([start + np.arange(columns.shape[1]) / rate, columns.T])
    np.savetxt(path, table, delimiter=",", header=head, comments="", fmt="%.9g")
    return Path(path)


def labels(path: str = "labels.csv", spans: Any = SPANS, head: str = "onset_s,offset_s") -> Path:
    Path(path).write_text("\n".join([head, *(f"{span[0]},{span[1]}" for span in spans)]) + "\n")
    return Path(path)


@pytest.mark.drawn
def test_a_recording_is_scored_in_its_own_time(command: Command) -> None:
    recording = write("a.csv", signal(), start=100.0)
    known = labels(spans=[(on + 100.0, off + 100.0) for on, off, _ in SPANS])
    found = command.document("emg", "score", recording, "--labels", known)
    assert (found["detections"], found["misses"], found["false_activations"], found["false_per_minute"]) == (2, 0, 0, 0)
    assert 0.0 < found["latency_median_s"] <= found["latency_max_s"] < 0.12
    assert [round(on) for on, _ in found["contractions_s"]] == [102, 105]
    assert found["plain_threshold"]["misses"] == 0
    assert Path("out/emg/emg.html").is_file()
    assert "Contractions in a.csv" in Path("out/emg/emg.html").read_text()


def test_a_slow_recording_is_scored_with_a_warning_and_moves_nothing(command: Command) -> None:
    recording = write("slow.csv", signal(rate=500.0), rate=500.0)
    found = command.document("emg", "score", recording, "--labels", str(labels()))
    assert (found["detections"], found["misses"], found["false_activations"]) == (2, 0, 0)
    assert found["warnings"] == ["500 samples a second are few: below 900 an open input may pass for a contraction"]
    with pytest.raises(StreamError, match="500 samples a second; expected 900 to 5000 Hz"):
        Playback(recording).open()


def test_without_labels_there_are_detections_alone(command: Command) -> None:
    found = command.document("emg", "score", str(write("a.csv", signal())))
    assert found["detections"] == 2
    assert found["misses"] is None
    said = command("emg score a.csv --shortest-ms 100").out
    assert "plain threshold" in said
    assert "costs 100 ms of latency" in said


def test_a_wearer_is_calibrated_and_gives_the_plain_threshold_its_mvc(command: Command) -> None:
    recording = str(write("a.csv", signal()))
    calm = str(write("rest.csv", background(1000.0, 5000, np.random.default_rng(2))))
    found = command.document("emg", "calibrate", recording, "--rest", calm)
    wearer = wearer_file.read(Path("wearer.toml"))
    assert (wearer.rest, wearer.mvc) == (found["rest"], found["mvc"]), "the file keeps every digit, and a rig its hash"
    assert 0.3 < wearer.mvc < 0.6
    assert 0.002 < wearer.rest < 0.006
    score = command.document("emg", "score", recording, "--wearer", "wearer.toml")
    assert score["mvc"] == wearer.mvc
    assert run(["emg", "calibrate", recording, "--out", "b.toml"]) == 0
    assert wearer_file.read(Path("b.toml")).rest == pytest.approx(wearer.rest, rel=0.3)


def test_a_wearer_of_another_channel_and_a_dead_electrode_are_told(command: Command) -> None:
    values = signal()
    values[7000:] = values[7000]
    recording = str(write("a.csv", values))
    for channel in ("emg_mV", "triceps_mV"):
        wearer_file.write(Path("wearer.toml"), wearer_file.MuscleCalibration(0.004, 0.4, channel, "a\nb"))
        said = command("emg", "score", recording, "--wearer", "wearer.toml")
        assert ("measured on 'triceps_mV', and this is 'emg_mV'" in said.err) == (channel == "triceps_mV")
        # a second without electrode, and a tenth until the step to it has faded from the movement's peak
        assert "nothing can be detected in 1.1 s" in said.out


def test_a_wearer_in_another_unit_is_hard_to_miss(command: Command) -> None:
    recording = str(write("a.csv", 1e3 * signal(), head="time_s,emg_uV"))
    wearer_file.write(Path("wearer.toml"), wearer_file.MuscleCalibration(0.004, 0.358, "emg_mV", "a"))
    said = command("emg", "score", recording, "--wearer", "wearer.toml")
    assert "UNITS DIFFER: wearer.toml was measured in mV, and 'emg_uV' is in uV" in said.err
    assert "UNITS DIFFER" in said.out
    said = command("emg", "score", str(write("b.csv", signal())), "--wearer", "wearer.toml")
    assert "plain threshold: 0.0716 mV = 20 % of MVC 0.358 mV, from wearer.toml" in said.out
    assert "UNITS" not in said.out + said.err


def test_contractions_in_a_recording_of_rest_are_told(command: Command) -> None:
    recording = str(write("a.csv", signal()))
    said = command("emg", "calibrate", recording, "--rest", recording).err
    assert "REST HAS CONTRACTIONS: a.csv from 2." in said
    assert " to 3." in said
    calm = str(write("rest.csv", background(1000.0, 5000, np.random.default_rng(2))))
    assert "CONTRACTIONS" not in command("emg", "calibrate", recording, "--rest", calm).err


@pytest.mark.parametrize("hum", [0.0, pytest.param(0.1, marks=pytest.mark.long)])
def test_the_recording_of_a_wearer_goes_from_rest_to_all_of_their_maximum_as_the_loop_hears_it(hum: float) -> None:
    values = signal() + hum * np.sin(2.0 * np.pi * 50.0 * np.arange(8000) / 1000.0)
    assert run(["emg", "calibrate", str(write("a.csv", values))]) == 0
    wearer = wearer_file.read(Path("wearer.toml"))
    assert wearer.mvc > 50.0 * wearer.rest, "mains are no rest"
    listener = Listener(1000.0, 0, wearer=wearer)
    heard = [listener.take(EmgChunk(values[k : k + 1, None], np.array([1e-3 * k])), 10.0).share for k in range(8000)]
    assert max(heard[500:]) == pytest.approx(1.0, abs=1e-5)
    assert np.quantile(heard[500:], 0.1) == pytest.approx(0.0, abs=1e-3), "but for what calibration left out"


def artefact(name: str) -> np.ndarray:
    """A recording with a second of rest more than `signal`, and with what no muscle makes in it."""
    values, time = (
        np.concatenate([background(1000.0, 3000, np.random.default_rng(4)), signal()]),
        np.arange(11000) / 1e3,
    )
    rest, contracts = time > 1.5, time > 8.5
    return {
        "step": values + 3.0 * rest,
        "swing": values + 2.0 * np.sin(4.0 * np.pi * time) * (rest & (time < 3.0)),
        "click": values + 5.0 * (rest & (time < 1.503)),
        "click in a contraction": values + 5.0 * (contracts & (time < 8.503)),
        "step in a contraction": values + 0.5 * contracts,
        "dead": np.where(rest & (time < 3.0), 0.0, values),
    }[name]


@pytest.mark.parametrize("name", ["step", "swing", "click", "dead", "click in a contraction", "step in a contraction"])
def test_what_no_muscle_makes_is_neither_rest_nor_maximum(name: str, command: Command) -> None:
    clean = np.concatenate([background(1000.0, 3000, np.random.default_rng(4)), signal()])
    truth = command.document("emg", "calibrate", str(write("clean.csv", clean)))
    assert truth["left_out_s"] < 1.5, "a contraction that breaks off leaves a tail"
    found = command.document("emg", "calibrate", str(write("a.csv", artefact(name))))
    assert found["mvc"] == pytest.approx(truth["mvc"], rel=0.2)
    assert found["rest"] == pytest.approx(truth["rest"], rel=0.25)
    assert truth["left_out_s"] - 0.2 < found["left_out_s"] < 5.0, "of a swing or a step the envelope is free"
    said = command("emg calibrate a.csv").err
    assert found["left_out_s"] < 0.05 or f"note: a.csv: {found['left_out_s']:.1f} s of dead electrode" in said


def test_a_calibration_with_too_little_left_is_one_line(command: Command) -> None:
    dead = signal()
    dead[600:] = np.where(np.arange(7400) % 400 < 200, 0.0, dead[600:])
    said = command("emg", "calibrate", str(write("a.csv", dead)), code=2).err
    assert "of 8.0 s are free of dead electrodes, movement, mains and clicks; expected at least 1 s" in said
    assert not Path("wearer.toml").exists()


@pytest.mark.parametrize("name", ["biceps_bursts", "biceps_fatigue", "adductor_pollicis_twitches"])
def test_nothing_of_a_real_maximum_is_left_out(name: str, shared_data: Path) -> None:
    log = read_emg(shared_data / "emg" / f"{name}.csv.gz")
    largest = EnvelopeFilter(log.rate, DEFAULTS).feed(log.values).envelope[round(0.5 * log.rate) :].max()
    assert envelope_levels(log.values, log.rate).high == pytest.approx(largest, rel=1e-3)


def test_of_several_channels_one_is_chosen(command: Command) -> None:
    head = "time_s,biceps_mV,triceps_mV"
    recording = str(write("two.csv", [signal(), background(1000.0, 8000, np.random.default_rng(3))], head=head))
    assert command.document("emg", "score", recording)["channel"] == "biceps_mV"
    other = command.document("emg", "score", recording, "--channel", "triceps_mV")
    assert (other["channel"], other["detections"]) == ("triceps_mV", 0)
    assert "no channel 'deltoid' among 'biceps_mV', 'triceps_mV'" in command.refused(
        "emg", "score", recording, "--channel", "deltoid"
    )


def test_a_column_of_text_is_no_channel() -> None:
    """As Noraxon writes them: three lines above the names, marks of activities beside the channel."""
    rows = "".join(f'{k / 1000:.3f},"{"Begin" * (k == 0)}",{value:.4f}\n' for k, value in enumerate(signal()))
    Path("marked.csv").write_text('"record","0.0","1000"\n\n"time","Activity","BICEPS (uV)"\n' + rows)
    assert read_emg(Path("marked.csv")).channel == "BICEPS (uV)"


def test_rest_is_of_the_channel_of_the_contraction(command: Command) -> None:
    quiet, loud = background(1000.0, 8000, np.random.default_rng(3)), signal()
    write("mvc.csv", [loud, quiet], head="time_s,biceps_mV,triceps_mV")
    write("rest.csv", [0.1 * loud + 0.5 * np.sin(np.arange(8000)), quiet], head="time_s,triceps_mV,biceps_mV")
    assert run(["emg", "calibrate", "mvc.csv", "--rest", "rest.csv"]) == 0
    assert wearer_file.read(Path("wearer.toml")).rest < 0.006
    write("rest.csv", quiet, head="time_s,triceps_mV")
    assert "rest.csv: no channel 'biceps_mV' among 'triceps_mV'" in command.refused(
        "emg calibrate mvc.csv --rest rest.csv --out b.toml"
    )
    assert not Path("b.toml").exists()


def bad(name: str) -> Path:
    values = signal()
    changed = {
        "nan": np.where(np.arange(8000) == 1234, np.nan, values),
        "flat": np.full(8000, 0.25),
        "clipped": np.clip(10.0 * values, -0.5, 0.5),
        "huge": 1e300 * values,
        "short": values[:900],
    }.get(name, values)
    head, rate = "x,emg_mV" if name == "no time" else "time_s,emg_mV", 100.0 if name == "slow" else 1000.0
    path = write("bad.csv", changed, rate, head)
    if name == "gap":
        lines = path.read_text().splitlines()
        path.write_text("\n".join(lines[:500] + lines[600:]))
    return path


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("nan", "line 1236: emg_mV is nan"),
        ("flat", "0.25 in every sample"),
        ("clipped", "are at an end of its range"),
        ("huge", "expected at most 100000 mV, which are 100 V; look at the unit in the column's name"),
        ("short", "expected at least 2 s"),
        ("gap", "time has a gap"),
        ("no time", "no column of times among 'x', 'emg_mV'"),
        ("slow", "100 samples a second; expected 400 to 5000 Hz"),
    ],
)
@pytest.mark.parametrize("word", ["score", "calibrate"])
def test_what_cannot_be_used_is_one_line(name: str, said: str, word: str, command: Command) -> None:
    assert said in command.refused("emg", word, bad(name))
    assert not Path("out").exists()
    assert not Path("wearer.toml").exists()


def test_hum_of_a_wearers_mains_is_taken_out_of_their_envelope(command: Command) -> None:
    """60 Hz of some ten times rest's noise; the wearer's file has it, and the live envelope goes by it."""
    hum = 0.05 * np.sin(2.0 * np.pi * 60.0 * np.arange(8000) / 1000.0)
    recording = str(write("hum.csv", signal() + hum))
    assert "and --mains" in command.refused("emg", "calibrate", recording)
    command.document("emg", "calibrate", recording, "--mains", "60", "--out", "60.toml")
    found = wearer_file.read(Path("60.toml"))
    assert found.mains == 60.0
    times = np.arange(1500) / 1000.0
    share = [
        Listener(1000.0, 0, wearer=found._replace(mains=mains)).take(EmgChunk(hum[:1500, None], times), 1.5).share
        for mains in (60.0, 50.0)
    ]
    assert abs(share[0]) < 0.02
    assert share[1] > 0.05
    assert "--mains is 55; expected 50, 60, or 0 for none" in command.refused(
        "emg", "calibrate", recording, "--mains", "55"
    )
    text = Path("60.toml").read_text()
    Path("60.toml").write_text(text.replace("mains_hz = 60", "mains_hz = 16"))
    assert "mains_hz is 16" in command.refused("emg", "score", recording, "--wearer", "60.toml")


def test_a_maximum_below_rest_is_refused(command: Command) -> None:
    calm = str(write("rest.csv", background(1000.0, 5000, np.random.default_rng(2))))
    assert "no contraction: the envelope is" in command.refused("emg", "calibrate", calm)
    assert not Path("wearer.toml").exists()
    Path("wearer.toml").write_text('[emg]\nchannel = "a"\nrest = 0.5\nmvc = 0.2\nsource = "b"\n')
    assert "expected at least 1.5 times as much" in command.refused(
        "emg", "score", str(write("a.csv", signal())), "--wearer", "wearer.toml"
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("", "no key 'emg'"),
        (
            "[emg]\nrest = 'x'\nmvc = 1\nchannel = 'a'\nsource = 'b'",
            'rest is "x", which is not a number; expected [emg]',
        ),
        ("[emg]\nrest = 0.1\nmvc = 1\nchannel = 'a'\nsource = 'b'\nfoo = 1", "unknown key 'foo'"),
        ("[emg]\nrest = nan\nmvc = 1\nchannel = 'a'\nsource = 'b'", "expected numbers above 0"),
    ],
)
def test_a_wearer_that_cannot_be_is_one_line(text: str, said: str, command: Command) -> None:
    Path("w.toml").write_text(text)
    assert said in command.refused("emg", "score", str(write("a.csv", signal())), "--wearer", "w.toml")


@pytest.mark.parametrize("head", ["onset_s,offset_s", "onset,offset", "start_s,end_s", "Start [s],End [s]"])
@pytest.mark.parametrize("unit", ["s", "ms"])
def test_labels_have_the_names_and_units_that_they_come_with(head: str, unit: str, command: Command) -> None:
    scale = 1.0
    if unit == "ms":
        named = "_s" in head or "[s]" in head
        head, scale = head.replace("_s", "_ms").replace("[s]", "[ms]"), 1e3 if named else 1.0
    known = str(labels(spans=[(scale * on, scale * off) for on, off, _ in SPANS], head=head))
    found = command.document("emg", "score", str(write("a.csv", signal())), "--labels", known)
    assert (found["misses"], found["false_activations"]) == (0, 0)
    assert 0.0 < found["latency_median_s"] < 0.12


def test_bytes_that_are_no_table_are_one_line_that_can_be_printed(capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.csv").write_bytes(np.random.default_rng(1).bytes(4000) + b"\n\x1b[31m,1,2\n")
    assert run(["emg", "score", "a.csv"]) == 2
    said = capsys.readouterr().err.strip()
    assert "a.csv" in said
    assert said.isprintable()
    assert len(said) < 500


@pytest.mark.parametrize(
    ("spans", "head", "said"),
    [
        (
            [(0.5, 1.0), (2.0, 3.0), (2.5, 4.0)],
            "onset_s,offset_s",
            "row 3: a contraction begins at 2.5 s, and the one before it ends at 3 s; expected onset < offset",
        ),
        ([(2.0, 3.0), (5.0, 4.0)], "start,end", "row 2: a contraction from 5 to 4 s; expected onset < offset"),
        ([(2.0, 3.0), ("nan", 4.0)], "onset_s,offset_s", "row 2: onset_s is nan; expected a time; remove that row"),
        ([(2.0, 3.0)], "a,b", "expected onset_s and offset_s, or start_s and end_s, named in the first row"),
        ([(2.0, 3.0)], "onset_s,off_s", "columns 'onset_s', 'off_s'; expected onset_s and offset_s"),
        ([(2.0, 3.0)], "onset_deg,offset_deg", "columns 'onset_deg', 'offset_deg'; expected onset_s and offset_s"),
        ([(2.0, 3.0), (5.0, 6.0)], "2.0,3.0", "no names stand above its 2 columns of numbers; expected a row of names"),
        ([(2.0, 3.0)], "on\x1b[31mset_s,offset_s", "a column is named 'on\\x1b[31mset_s'"),
        ([(2.0, 30.0)], "onset_s,offset_s", "the recording lasts from 0 to 8 s"),
    ],
)
def test_labels_that_cannot_be_are_one_line(spans: Any, head: str, said: str, command: Command) -> None:
    known = labels(spans=spans, head=head)
    assert said in command.refused("emg", "score", str(write("a.csv", signal())), "--labels", known)
    assert run(["emg", "score", "a.csv", "--shortest-ms", "-1"]) == 2
    assert run(["emg", "score", "nowhere.csv"]) == 2


@pytest.mark.parametrize(
    "name", ["weak", "short rest", "no rest at first", "heart", "drift", "hum", "lifted", "500 Hz"]
)
def test_a_recording_that_a_person_would_use_is_calibrated(name: str, command: Command) -> None:
    """One contraction of ten times rest, or as named: what is beside it is no reason to refuse it."""
    rate, random = 500.0 if name == "500 Hz" else 1000.0, np.random.default_rng(11)
    count, size, first, last = round(8.0 * rate), 10.0 * NOISE, 3.0, 6.0
    if name == "weak":
        size = 3.0 * NOISE
    elif name in ("short rest", "no rest at first"):
        first, last = (0.8, 7.9) if name == "short rest" else (-1.0, 5.0)
    time = np.arange(count) / rate
    calm = background(rate, count, random)
    values = calm + contractions(rate, [(first, last, size)], count, 11)
    if name == "heart":
        values += 15.0 * NOISE * heart(rate, count, 1.3, random)
    elif name == "drift":
        values += 200.0 * NOISE * np.sin(2.0 * np.pi * 0.4 * time)
    elif name == "hum":
        values += 5.0 * NOISE * hum(rate, count, 50.0, 0.2, random)
    elif name == "lifted":
        values[(time > 7.0) & (time < 7.5)] = 100.0 * NOISE
    found = command.document("emg", "calibrate", str(write("a.csv", values, rate=rate)))
    rest = float(np.mean(np.abs(calm)))
    assert 0.5 * rest < found["rest"] < (3.0 if name == "hum" else 1.5) * rest
    assert 0.7 * size < found["mvc"] < 2.0 * size
    assert 0.0 < found["sigma"] < 2.0 * rest
