"""Files that were made to do harm: each is refused in one line, within seconds and with little memory."""

import gzip
import itertools
import os
import struct
import subprocess
import sys
import tracemalloc
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.io import savemat

from bowden.app.main import run
from bowden.control.law_file import LawFile
from bowden.core import bounded
from bowden.core.errors import BowdenError, ParameterError
from bowden.identify.emg.log import read_emg
from bowden.identify.log.read import read_log
from bowden.live.mcap_read import read as read_mcap
from bowden.live.mcap_read import read_trace
from bowden.plants.cables import identified
from bowden.plants.identified import load_cable
from bowden.records.table import read_table
from bowden.rig.tree import read_values
from bowden.sensing import wearer_file
from bowden.study.load import load

READERS: dict[str, Callable[[Path], Any]] = {
    "rig": read_values,
    "study": load,
    "wearer": wearer_file.read,
    "model": load_cable,
    "law": lambda path: LawFile.found(str(path)),
    "log of a cable": read_log,
    "EMG": read_emg,
    "log of a run": read_mcap,
    "trace": read_trace,
}
"""Everything that reads a file of a user's."""
WRITTEN = ("rig", "study", "wearer", "model")


@pytest.mark.parametrize("reader", READERS)
def test_what_is_no_file_is_refused_at_once(reader: str, tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    for path in (pipe, Path("/dev/zero")):
        with pytest.raises(BowdenError, match=r"it is a (pipe|device), which may have no end"):
            READERS[reader](path)


TOML = {
    "nested lists": "a = " + "[" * 2000 + "]" * 2000,
    "nested tables": "a = " + "{a=" * 2000 + "1" + "}" * 2000,
    "a key of many parts": ".".join("a" * 50_000) + " = 1",
    "quoted parts": " . ".join(['"#"'] * 20_000) + " = 1",
    "a section of many parts": "[" + ".".join("a" * 50_000) + "]",
    "an integer of a megabyte": "a = " + "1" * 1_000_000,
    "one in hexadecimal": "a = 0x" + "f" * 1_000_000,
    "many unknown keys": "".join(f"k{i} = 1\n" for i in range(600_000)),
    "a megabyte of unknown keys": "".join(f"k{i}=1\n" for i in range(90_000)),
    "a key of a megabyte": "a" * 1_000_000 + " = 1",
    "the smallest number": "[encoder.joint]\nresolution_deg = 5e-324\n[vary]\nservo.damping = 5e-324",
}


@pytest.mark.parametrize("kind", WRITTEN)
@pytest.mark.parametrize("case", TOML)
def test_a_text_that_was_made_to_break_its_reader_is_refused(case: str, kind: str, tmp_path: Path) -> None:
    file = tmp_path / "file.toml"
    file.write_text(TOML[case])
    with pytest.raises(BowdenError):
        READERS[kind](file)


@pytest.mark.parametrize("fault", ["begin_s = 1e58", "length_s = 1e300", "begin_s = { uniform = [0, 9e15] }"])
def test_a_fault_of_a_study_is_within_the_longest_run(fault: str, tmp_path: Path) -> None:
    file = tmp_path / "study.toml"
    file.write_text(f'runs = 2\n[fault]\nkind = "bias"\n{fault}\n')
    with pytest.raises(BowdenError, match=r"fault\.|e\+300"):
        load(file)


def test_what_a_person_writes_is_read_as_ever(tmp_path: Path) -> None:
    file = tmp_path / "rig.toml"
    file.write_text(f'# {"." * 200}\n"a.b" = "{"x. " * 30}"\r\nc.d.e = [{",".join(["0.1"] * 500)}] # e.g. {"." * 99}\n')
    found = bounded.read_toml(file)
    assert found == {"a.b": "x. " * 30, "c": {"d": {"e": [0.1] * 500}}}


def packed(path: Path, head: bytes, row: bytes, size: int) -> Path:
    """A gzipped file of so many bytes of rows, which is small."""
    member = gzip.compress(row * ((16 << 20) // len(row)))
    path.write_bytes(gzip.compress(head) + member * (size >> 24))
    return path


@pytest.mark.parametrize(
    ("reader", "row"),
    [("log of a cable", b"0.1,0.2,0.3\n"), ("log of a cable", b"0"), ("EMG", b"0.1,0.2,0.3\n"), ("EMG", b"\0")],
)
def test_a_small_file_that_unpacks_without_end_is_refused(
    reader: str, row: bytes, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(bounded.Bounded.__init__, "__defaults__", (32 << 20,))
    monkeypatch.setattr(bounded.pieces, "__defaults__", (32 << 20,))
    monkeypatch.setattr(bounded.read_whole, "__defaults__", (32 << 20,))
    file = packed(tmp_path / "log.csv.gz", b"time_s,motor_deg,joint_deg\n0,1,2\n0.001,1,2\n", row, 1 << 30)
    tracemalloc.start()
    try:
        with pytest.raises(BowdenError, match="is binary" if row == b"\0" else "32 MB unpacked"):
            READERS[reader](file)
        assert tracemalloc.get_traced_memory()[1] < 100 << 20
    finally:
        tracemalloc.stop()


def test_more_fields_than_fit_are_refused_before_they_are_taken_apart(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bowden.records.table.MOST_CELLS", 5_000_000)
    file = packed(tmp_path / "emg.csv.gz", b"time_s,emg_mV\n", b"1,2\n", 32 << 20)
    with pytest.raises(BowdenError, match="fields"):
        read_table(file).numbers([0, 1])
    with pytest.raises(BowdenError, match="fields"):
        read_log(packed(file, b"time_s,motor,joint\n0,1,2\n1,2,3\n", b"1,2,3\n", 256 << 20))


def test_a_parquet_file_of_endless_rows_is_refused(tmp_path: Path) -> None:
    import pyarrow as pa
    from pyarrow import parquet

    file = tmp_path / "log.parquet"
    names = ("time", "motor", "joint", *(f"c{i}" for i in range(13)))
    zeros = pa.array(np.zeros(4_000_000))
    parquet.write_table(pa.table(dict.fromkeys(names, zeros)), file)
    assert file.stat().st_size < 1 << 20
    with pytest.raises(BowdenError, match="64000000 fields"):
        read_table(file).numbers(range(len(names)))
    with pytest.raises(BowdenError, match="does not say its units"):
        read_trace(file)
    with pytest.raises(BowdenError, match="every sample"):  # of three columns alone there is room
        read_log(file)


def test_a_matlab_file_that_ends_scipys_process_is_refused(tmp_path: Path) -> None:
    t = np.arange(5) * 0.1
    savemat(tmp_path / "log.mat", {"log": {"time": t, "motor": t, "joint": t}})
    data = bytearray((tmp_path / "log.mat").read_bytes())
    data[264] ^= 0x80
    (tmp_path / "log.mat").write_bytes(data)
    with pytest.raises(BowdenError, match="cannot be read as a MATLAB file: it is damaged"):
        read_log(tmp_path / "log.mat")


def test_a_matlab_file_that_unpacks_without_end_is_refused_within_bounded_memory(tmp_path: Path) -> None:
    unpacked = zlib.compress(bytes(64 << 20), 9)
    element = struct.pack("<II", 15, len(unpacked)) + unpacked
    (tmp_path / "log.mat").write_bytes(b"MATLAB 5.0 MAT-file".ljust(124) + b"\x00\x01IM" + element * 160)
    reads = (  # in a process of its own: this one has other children, of other tests
        "import resource, sys\nfrom pathlib import Path\nfrom bowden.core.errors import BowdenError\n"
        "from bowden.identify.log.read import read_log\n"
        "try:\n    read_log(Path(sys.argv[1]))\nexcept BowdenError as error:\n    print(error)\n"
        "print(resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss)"
    )
    done = subprocess.run([sys.executable, "-c", reads, tmp_path / "log.mat"], capture_output=True, text=True)
    said, most = done.stdout.splitlines()
    assert "cannot be read as a MATLAB file" in said
    assert int(most) << 10 < 4 * bounded.MOST_DATA


def test_a_message_is_one_line_of_text(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = tmp_path / "rig.toml"
    file.write_text('[control]\nlaw = "' + "\\u001b[2J" * 9000 + '"\n')
    assert run(["simulate", str(file)]) == 2
    said = capsys.readouterr().err
    assert "\x1b" not in said
    assert len(said) < 2100
    assert said.count("\n") == 1


BOUC_WEN = "slope 0.938 hysteresis_gain -0.114 rate 10.5 shape 9.4 exponent 3 offset 0.01 initial_h 0.1"
MODELS = {
    "play": "slope 0.9 half_width 0.1 offset 0 initial_lag 0",
    "bouc_wen": BOUC_WEN,
    "bouc_wen_static": f"{BOUC_WEN} static_2 0.01 hysteresis_gain_1 0.01 static_centre 0.6 static_half_range 0.7",
    "prandtl_ishlinskii": "slope 0.5 half_width_1 0.05 half_width_2 0.1 weight_1 0.2 weight_2 0.2 offset 0 "
    "initial_lag 0",
    "generalised_play": "slope 0.9 bend_1 0 bend_2 0.01 bend_3 0 gap_1 0.05 gap_2 0.06 reach_1 0.5 reach_2 1.5 "
    "share_1 0.5 share_2 0.5 first_node 0 last_node 1.5 offset 0 initial_lag 0",
    "sliding": "friction 0.1 motor_radius 0.01 joint_radius 0.01 length 1 stiffness 11000 spring 0.2 pretension 0.1 "
    "slack 0 bend 3.1 elements 5",
    "lumped_dahl": "friction 0.1 elements 5 density 0.01 inertia 0.002 damping 0.02 presliding 0.0001 step 0.001",
}
"""Model → its parameters as they are usual."""
EXTREMES = (*(s * 10.0**e for s in (1.0, -1.0) for e in (-320, -9, -3, 1, 4, 300)), 0.0)


def model_file(path: Path, name: str, parameters: dict[str, Any]) -> Path:
    pairs = BOUC_WEN.split()
    models = {"bouc_wen": dict(zip(pairs[::2], pairs[1::2], strict=True)), name: parameters}
    lines = [f"best = '{name}'"]
    for one, given in models.items():
        lines += [f"[models.{one}.parameters]", *(f"{key} = {value}" for key, value in given.items())]
    path.write_text("\n".join(lines))
    return path


@pytest.mark.parametrize("name", MODELS)
def test_a_coefficient_that_no_cable_has_is_refused_and_any_other_moves_the_joint_to_a_number(
    name: str, tmp_path: Path
) -> None:
    words, file = MODELS[name].split(), tmp_path / "model.toml"
    usual = dict(zip(words[::2], words[1::2], strict=True))
    way = np.concatenate([np.linspace(0.0, 1.5, 12), np.linspace(1.5, -0.5, 12)])
    assert load_cable(model_file(file, name, usual)).best == name
    taken = 0
    for key in usual:
        for none in ("nan", "inf", "-inf", "true", "'1'"):
            with pytest.raises(ParameterError, match=rf"{key} of {name} is .*; expected a number from .* to .*; "):
                load_cable(model_file(file, name, usual | {key: none}))
        for value in EXTREMES:
            try:
                found = load_cable(model_file(file, name, usual | {key: repr(value)}))
                cable = identified(name, found.models[name])
            except ParameterError:
                continue
            taken += 1
            memory = cable.start(cable.prepared, 0.0, 1.0, 1.0)
            for before, after in itertools.pairwise(way):
                memory = cable.advance(cable.prepared, memory, before, after, after - before, 1.0, 1e-3)
                joint = cable.look(cable.prepared, memory, after, 1.0, 1.0).joint
                assert np.isfinite(joint), (key, value)
    assert taken > len(usual)


def test_a_model_of_a_million_plays_or_without_a_slope_is_refused(tmp_path: Path) -> None:
    file, count = tmp_path / "model.toml", 1001
    many = {"slope": 0.9, "offset": 0.0}
    for one in range(1, count // 2 + 1):
        many |= {f"half_width_{one}": 0.1, f"weight_{one}": 0.0}
    with pytest.raises(ParameterError, match=rf"{len(many)} parameters; expected at most 1000"):
        load_cable(model_file(file, "prandtl_ishlinskii", many))
    with pytest.raises(ParameterError, match="slope of play is 1e-09"):
        load_cable(model_file(file, "play", {"slope": 1e-9, "half_width": 0.1, "offset": 0.0, "initial_lag": 0.0}))
    million = "".join(f"half_width_{one} = 0.1\n" for one in range(1_000_000))
    file.write_text(f"best = 'play'\n[models.play.parameters]\n{million}")
    with pytest.raises(BowdenError):
        load_cable(file)
