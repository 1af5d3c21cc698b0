"""Tables: Parquet of plain numbers against PyArrow, text with gaps and mistakes, packages that are missing."""

import contextlib
import json
import sys
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pyarrow import parquet

from bowden.core import plain_parquet, thrift
from bowden.core.errors import BowdenError, LogError, MissingExtraError
from bowden.core.extras import extra_module
from bowden.core.table import read_table
from bowden.core.thrift import I64
from bowden.core.trace import Trace, write_parquet

values = st.recursive(
    st.integers(-(2**31), 2**31 - 1) | st.binary(max_size=20),
    lambda inner: st.dictionaries(st.integers(1, 40), inner, max_size=4) | st.lists(st.integers(0, 9), max_size=20),
    max_leaves=12,
)


@settings(max_examples=100, deadline=None)
@given(fields=st.dictionaries(st.integers(1, 60), values, max_size=6))
def test_a_structure_comes_back(fields: dict[int, object]) -> None:
    data = thrift.written(fields)
    assert thrift.read(data) == (fields, len(data))


@settings(max_examples=300, deadline=None)
@given(data=st.binary(max_size=60))
def test_bytes_that_are_no_structure_are_refused(data: bytes) -> None:
    try:
        _, end = thrift.read(data)
    except ValueError:
        return
    assert 0 < end <= len(data)


def test_large_numbers_and_deep_nesting() -> None:
    assert thrift.read(thrift.written({1: I64(-(2**63)), 2: I64(2**63 - 1)}))[0] == {1: -(2**63), 2: 2**63 - 1}
    with pytest.raises(ValueError, match="nested"):
        thrift.read(b"\x1c" * 40)
    with pytest.raises(ValueError, match="no end"):
        thrift.read(b"\x16" + b"\xff" * 20)


def trace(n: int = 300_001) -> Trace:
    noise = np.random.default_rng(1).standard_normal(n)
    columns = {"time": np.arange(n) * 1e-3, "joint": noise, "law.β̂": np.where(noise > 2.0, np.nan, noise)}
    return Trace(columns, {"time": "s", "joint": "rad", "law.β̂": "1"}, {"law": "adaptive"}, 3)


def test_pyarrow_reads_what_is_written(tmp_path: Path) -> None:
    whole, path = trace(), tmp_path / "run.parquet"
    parts = [Trace({k: v[a:b] for k, v in whole.columns.items()}, whole.units, whole.settings, whole.seed)
             for a, b in ((0, 7), (7, 200_000), (200_000, len(whole)))]  # fmt: skip
    write_parquet(iter(parts), path)
    table = parquet.read_table(path)
    assert table.column_names == list(whole.columns)
    assert {str(kind) for kind in table.schema.types} == {"double"}
    for name, column in whole.columns.items():
        assert table[name].to_numpy().tobytes() == column.tobytes()
    assert json.loads(table.schema.metadata[b"bowden"])["units"] == whole.units
    assert parquet.ParquetFile(path).metadata.num_row_groups == 3
    back = Trace.from_parquet(path)
    assert all(back[name].tobytes() == column.tobytes() for name, column in whole.columns.items())


@pytest.mark.parametrize("compression", ["snappy", "none"])
def test_what_pyarrow_wrote_is_read_too(compression: str, tmp_path: Path) -> None:
    """As bowden 0.1 did, and others do: other kinds of numbers, and gaps."""
    whole, path = trace(5000), tmp_path / "run.parquet"
    about = {b"bowden": json.dumps({"units": whole.units, "settings": {}, "seed": 3}).encode()}
    schema = pa.schema([pa.field(name, pa.float64()) for name in whole.columns], metadata=about)
    parquet.write_table(pa.table(list(whole.columns.values()), schema=schema), path, compression=compression)
    assert Trace.from_parquet(path)["joint"].tobytes() == whole["joint"].tobytes()
    mixed = {"t": pa.array([1, 2, None]), "ok": pa.array([True, False, True]), "word": pa.array(["a", "b", "c"])}
    parquet.write_table(pa.table(mixed), path)
    table = read_table(path)
    t, ok = table.numbers([0, 1])
    np.testing.assert_array_equal(t, [1.0, 2.0, np.nan])
    np.testing.assert_array_equal(ok, [1.0, 0.0, 1.0])
    with pytest.raises(LogError, match="row 1: word is 'a'; expected a number"):
        table.numbers([2])


def test_a_flipped_or_missing_byte_is_refused_or_changes_a_number(tmp_path: Path) -> None:
    path, random = tmp_path / "run.parquet", np.random.default_rng(2)
    trace(50).to_parquet(path)
    sound = path.read_bytes()
    for _ in range(400):
        data = bytearray(sound)
        for at in random.integers(0, len(data), random.integers(1, 4)):
            data[at] = random.integers(0, 256)
        path.write_bytes(bytes(data[: random.integers(1, len(data) + 1)] if random.random() < 0.2 else data))
        with contextlib.suppress(BowdenError):
            assert len(Trace.from_parquet(path)) <= 50


def test_more_rows_than_the_file_has_bytes_for_are_refused_before_they_are_made_room_for(tmp_path: Path) -> None:
    path = tmp_path / "run.parquet"
    with path.open("wb") as file:
        plain_parquet.write(file, iter([[np.zeros(4)]]), ["a"], {})
    data = path.read_bytes()
    end = int.from_bytes(data[-8:-4], "little")
    said, _ = thrift.read(data[-8 - end : -8])
    count = I64(2**50)
    said[3] = said[4][0][3] = said[4][0][1][0][3][5] = count
    footer = thrift.written(said | {4: [group | {3: count} for group in said[4]]})
    path.write_bytes(data[: -8 - end] + footer + len(footer).to_bytes(4, "little") + b"PAR1")
    with pytest.raises(LogError, match="more rows than fit"):
        read_table(path)


TEXT = 'time_s,emg_mV,note\n0,1,a\n0.5,,b\n1.0,NA,"c, d"\n'


def test_empty_fields_are_no_numbers_and_text_elsewhere_is_left_alone(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    for text in (TEXT, "\ufeff" + TEXT, "# by hand\n\n" + TEXT.replace("\n", "\r\n")):
        path.write_bytes(text.encode())
        table = read_table(path)
        assert table.names == ("time_s", "emg_mV", "note")
        emg, time = table.numbers([1, 0])
        np.testing.assert_array_equal(time, [0.0, 0.5, 1.0])
        np.testing.assert_array_equal(emg, [1.0, np.nan, np.nan])


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a,b\n1,2\n3,x\n", "row 2: b is 'x'; expected a number"),
        ("a,b\n1,2\n3,4,5\n", "row 2: 3 fields where there are 2 columns; expected as many in each row"),
        ("a,b\n1,2\n3\n", "row 2: 1 fields where there are 2 columns"),
        ("a,b,c\n1,2\n3,4\n", "row 1: 2 fields where there are 3 columns"),
        ("a,b\n1,2\n3,\x1b[31m\n", "row 2: b is '"),
        ("a,b\n1,2\n3,1_000\n", "row 2: b is '1_000'; expected a number"),
        ("a,b\n1,2\n3,１２\n", "row 2: b is '１２'"),
        ("a,b\n1,2\n#REF!,3\n", "row 2: a is '#REF!'"),
        ("", "it is empty"),
    ],
)
def test_text_that_is_no_table_of_numbers_is_refused_with_its_row(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text(text)
    with pytest.raises(LogError) as caught:
        read_table(path).numbers([0, 1])
    assert said in str(caught.value)
    assert "\x1b" not in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("above", ["", "\ufeff", "\ufeff# a comment\n", "\n \n# a comment\r\n", "\ufeff\n"])
@pytest.mark.parametrize("below", ["", "   ", "\n  \n", "# the end", "\n# the end, of all\r\n"])
@pytest.mark.parametrize("last", ["3,4", "3,"])
def test_comments_and_empty_lines_do_not_count(above: str, below: str, last: str, tmp_path: Path) -> None:
    path = tmp_path / "a.csv"
    path.write_bytes(f"{above}a,b\n1,2\n \n# between\n{last}\n{below}".encode())
    table = read_table(path)
    assert table.names == ("a", "b")
    assert table.numbers([0])[0].tolist() == [1.0, 3.0]


def test_names_without_rows_are_a_table_of_none(tmp_path: Path) -> None:
    path = tmp_path / "log.csv"
    path.write_text("a,b\n\n")
    assert [len(one) for one in read_table(path).numbers([0, 1])] == [0, 0]


def test_without_pyarrow_our_own_files_are_read_and_others_say_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours, theirs = tmp_path / "ours.parquet", tmp_path / "theirs.parquet"
    trace(10).to_parquet(ours)
    parquet.write_table(pa.table({"a": [1.0]}), theirs)
    for name in [name for name in sys.modules if name.partition(".")[0] == "pyarrow"]:
        monkeypatch.setitem(sys.modules, name, None)
    assert len(Trace.from_parquet(ours)) == 10
    for reader in (read_table, Trace.from_parquet):
        with pytest.raises(MissingExtraError, match=r'pip install "bowden\[parquet\]"'):
            reader(theirs)


def test_a_package_that_is_there_but_broken_says_why(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "broken_package.py").write_text("import no_such_part\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    with pytest.raises(MissingExtraError, match=r"cannot be imported .*no_such_part"):
        extra_module("broken_package", "parquet", "it")


@pytest.mark.parametrize(
    ("names", "rows"),
    [
        ("time_s,emg_mV", ["0.001,-0.5", "0.002,1e-3"]),
        ("time_s;emg_mV", ["0.001;-0.5", "0.002;1e-3"]),
        ("time_s;emg_mV", ["0,001;-0,5", "0,002;1e-3"]),
        ("time_s\temg_mV", ["0,001\t-0,5", "0.002\t1e-3"]),
    ],
)
def test_commas_semicolons_and_tabs(names: str, rows: list[str], tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("\n".join([names, *rows, ""]))
    table = read_table(tmp_path / "a.csv")
    assert table.names == ("time_s", "emg_mV")
    assert [list(one) for one in table.numbers([0, 1])] == [[0.001, 0.002], [-0.5, 0.001]]
    (tmp_path / "a.csv").write_text("\n".join([names, *rows, rows[0].replace("-0", "none"), ""]))
    with pytest.raises(LogError, match=r"row 3: emg_mV is 'none"):
        read_table(tmp_path / "a.csv").numbers([0, 1])


@pytest.mark.parametrize("first", ["0.001,-0.5", "0;1,5", "3\t4", "0.1,0.2,"])
def test_a_first_row_of_numbers_is_refused(first: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(f"{first}\n{first}\n")
    with pytest.raises(LogError, match="the first row has numbers") as refused:
        read_table(tmp_path / "a.csv")
    assert "row of names" in str(refused.value)


def test_decimal_commas_between_commas_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time_s,emg_mV\n0,001,0,5\n")
    with pytest.raises(LogError, match="decimal commas need"):
        read_table(tmp_path / "a.csv").numbers([0, 1])
