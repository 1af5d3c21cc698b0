"""Tables: Parquet and NPZ, text with gaps and mistakes, packages that are missing."""

import json
import sys
import zipfile
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest
from pyarrow import parquet

from bowden.core.errors import LogError, MissingExtraError
from bowden.core.extras import extra_module
from bowden.records.table import read_table
from bowden.records.trace import Trace, write_traces


def trace(n: int = 300_001) -> Trace:
    noise = np.random.default_rng(1).standard_normal(n)
    columns = {"time": np.arange(n) * 1e-3, "joint": noise, "law.β̂": np.where(noise > 2.0, np.nan, noise)}
    return Trace(columns, {"time": "s", "joint": "rad", "law.β̂": "1"}, {"law": "adaptive"}, 3)


def test_pyarrow_reads_what_is_written(tmp_path: Path) -> None:
    whole, path = trace(), tmp_path / "run.parquet"
    parts = [Trace({k: v[a:b] for k, v in whole.columns.items()}, whole.units, whole.settings, whole.seed)
             for a, b in ((0, 7), (7, 200_000), (200_000, len(whole)))]  # fmt: skip
    write_traces(iter(parts), path)
    table = parquet.read_table(path)
    assert table.column_names == list(whole.columns)
    assert {str(kind) for kind in table.schema.types} == {"double"}
    for name, column in whole.columns.items():
        assert table[name].to_numpy().tobytes() == column.tobytes()
    assert json.loads(table.schema.metadata[b"bowden"])["units"] == whole.units
    assert parquet.ParquetFile(path).metadata.num_row_groups == 3
    back = Trace.read(path)
    assert all(back[name].tobytes() == column.tobytes() for name, column in whole.columns.items())


@pytest.mark.parametrize("compression", ["snappy", "none"])
def test_what_pyarrow_wrote_is_read_too(compression: str, tmp_path: Path) -> None:
    """Other kinds of numbers, and gaps."""
    whole, path = trace(5000), tmp_path / "run.parquet"
    about = {b"bowden": json.dumps({"units": whole.units, "settings": {}, "seed": 3}).encode()}
    schema = pa.schema([pa.field(name, pa.float64()) for name in whole.columns], metadata=about)
    parquet.write_table(pa.table(list(whole.columns.values()), schema=schema), path, compression=compression)
    assert Trace.read(path)["joint"].tobytes() == whole["joint"].tobytes()
    mixed = {"t": pa.array([1, 2, None]), "ok": pa.array([True, False, True]), "word": pa.array(["a", "b", "c"])}
    parquet.write_table(pa.table(mixed), path)
    table = read_table(path)
    t, ok = table.numbers([0, 1])
    np.testing.assert_array_equal(t, [1.0, 2.0, np.nan])
    np.testing.assert_array_equal(ok, [1.0, 0.0, 1.0])
    with pytest.raises(LogError, match="row 1: word is 'a'; expected a number"):
        table.numbers([2])


def test_numpys_own_files_are_tables(tmp_path: Path) -> None:
    for save in (np.savez, np.savez_compressed):
        save(
            tmp_path / "log.npz",
            t=np.arange(3),
            flag=np.array([True, False, True]),
            wide=np.eye(2),
            word=["a", "b", "c"],
        )
        table = read_table(tmp_path / "log.npz")
        assert table.names == ("t", "flag", "wide", "word")
        assert [one.tolist() for one in table.numbers([0, 1])] == [[0.0, 1.0, 2.0], [1.0, 0.0, 1.0]]
        with pytest.raises(LogError, match="row 1: word is 'a'; expected a number"):
            table.numbers([0, 3])
        with pytest.raises(LogError, match="differ in length"):
            table.numbers([0, 2])


def test_what_unpacks_to_more_numbers_than_fit_is_refused_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bowden.records.table.MOST_CELLS", 1_000_000)
    with zipfile.ZipFile(tmp_path / "log.npz", "w", zipfile.ZIP_DEFLATED) as file, file.open("t.npy", "w") as member:
        np.lib.format.write_array_header_1_0(member, {"descr": "<f8", "fortran_order": False, "shape": (10**12,)})
        for _ in range(20):
            member.write(bytes(1 << 20))
    with pytest.raises(LogError, match="numbers"):
        read_table(tmp_path / "log.npz").numbers([0])


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
        ("a,b\n1,2\n3,x\n", "line 3: b is 'x'; expected a number"),
        ("a,b\n1,2\n3,4,5\n", "line 3: 3 fields where there are 2 columns; expected as many in each row"),
        ("a,b\n1,2\n3\n", "line 3: 1 fields where there are 2 columns"),
        ("1,2\n3,4,5\n3\n", "line 2: 3 fields where there are 2 columns"),
        ("1,2\n3,4,5\n6,7,8\n", "line 2: 3 fields where there are 2 columns"),
        ("a,b\n1,2\n3,\x1b[31m\n", "line 3: b is '"),
        ("a,b\n1,2\n3,1_000\n", "line 3: b is '1_000'; expected a number"),
        ("a,b\n1,2\n3,１２\n", "line 3: b is '１２'"),
        ("a,b\n1,2\n#REF!,3\n", "line 3: a is '#REF!'"),
        ("", "is empty"),
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


def test_without_pyarrow_a_trace_is_kept_otherwise_and_parquet_says_what_to_install(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    parquet.write_table(pa.table({"a": [1.0]}), tmp_path / "theirs.parquet")
    for name in [name for name in sys.modules if name.partition(".")[0] == "pyarrow"]:
        monkeypatch.setitem(sys.modules, name, None)
    for kind in ("npz", "csv"):
        trace(10).write(tmp_path / f"ours.{kind}")
        assert len(Trace.read(tmp_path / f"ours.{kind}")) == 10
    for refused in (read_table, Trace.read, trace(10).write):
        with pytest.raises(MissingExtraError, match=r'pip install "bowden\[parquet\]"'):
            refused(tmp_path / "theirs.parquet")


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
    with pytest.raises(LogError, match=r"line 4: emg_mV is 'none"):
        read_table(tmp_path / "a.csv").numbers([0, 1])


@pytest.mark.parametrize("first", ["0.001,-0.5", "0;1,5", "3\t4"])
def test_columns_without_names_are_called_by_their_numbers(first: str, tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(f"{first}\n{first}\n")
    assert read_table(tmp_path / "a.csv").names == ("1", "2")


def test_decimal_commas_between_commas_are_named(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("time_s,emg_mV\n0,001,0,5\n")
    with pytest.raises(LogError, match="decimal commas need"):
        read_table(tmp_path / "a.csv").numbers([0, 1])
