"""A trace comes back from its files as it went, bit for bit; files that are no traces are refused in one line."""

import contextlib
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import signal

from bowden.core.errors import BowdenError, LogError, OutputError, ParameterError
from bowden.records.trace import LED, Trace, Traces

KINDS = ("npz", "csv", "parquet")
doubles = st.floats(width=64, allow_nan=False) | st.just(float("nan"))  # one NaN: its payload is not part of the value


def example(n: int = 5, **columns: np.ndarray) -> Trace:
    values = {"time": np.arange(n) * 1e-3, "reference": np.linspace(0.0, 1.0, n), "joint": np.linspace(0.0, 0.9, n)}
    values |= columns
    units = {name: "s" if name == "time" else "rad" for name in values}
    return Trace(values, units, {"law": "adaptive", "gains": {"κ": 0.1 + 0.2, "none": None}, "list": [1, "a"]}, seed=3)


def through(trace: Trace, kind: str, folder: Path) -> Trace:
    path = folder / f"run.{kind}"
    trace.write(path)
    return Trace.read(path)


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=60, deadline=None)
@given(values=st.lists(st.tuples(doubles, doubles), min_size=1, max_size=40))
def test_every_double_comes_back_bit_for_bit(
    kind: str, values: list[tuple[float, float]], tmp_path_factory: pytest.TempPathFactory
) -> None:
    a, b = np.array(values).T.copy()
    trace = Trace({"a": a, "b": b}, {"a": "rad/s²", "b": "1"})
    back = through(trace, kind, tmp_path_factory.mktemp("trace"))
    assert back["a"].tobytes() == a.tobytes()
    assert back["b"].tobytes() == b.tobytes()


@pytest.mark.parametrize("kind", KINDS)
def test_units_settings_seed_and_order_come_back(kind: str, tmp_path: Path) -> None:
    trace = example(**{"law.β̂": np.full(5, np.nan), 'odd, "name"': np.zeros(5)})
    back = through(trace, kind, tmp_path)
    assert list(back.columns) == list(trace.columns)
    assert back.units == trace.units
    assert back.settings == trace.settings
    assert back.seed == 3
    assert through(Trace({"a": np.zeros(1)}, {"a": "1"}), kind, tmp_path).seed is None


@pytest.mark.parametrize("kind", KINDS)
def test_the_same_trace_gives_the_same_bytes(kind: str, tmp_path: Path) -> None:
    through(example(), kind, tmp_path)
    before = (tmp_path / f"run.{kind}").read_bytes()
    through(example(), kind, tmp_path)
    assert (tmp_path / f"run.{kind}").read_bytes() == before


DECLARED = b'# bowden trace: {"units": {"a": "s", "b": "rad"}, "settings": {}, "seed": null}\n'
NO_TRACES = {
    "empty": b"",
    "binary": b"\x00\xff\xfe" * 50,
    "a plain log": b"time,joint\n0,1\n",
    "no metadata": b"# bowden trace: \na,b\n1,2\n",
    "metadata of another kind": b"# bowden trace: [1]\na,b\n1,2\n",
    "no units": b"# bowden trace: {}\na,b\n1,2\n",
    "no settings": b'# bowden trace: {"units": {"a": "s"}, "seed": 1}\na\n1\n',
    "text in numbers": DECLARED + b"a,b\n1,two\n",
    "a row cut off": DECLARED + b"a,b\n1,2\n3",
    "a column missing": DECLARED + b"a\n1\n",
    "a column too many": DECLARED + b"a,b,c\n1,2,3\n",
    "no rows": DECLARED + b"a,b\n",
    "no header": DECLARED,
}


@pytest.mark.parametrize("content", NO_TRACES.values(), ids=NO_TRACES.keys())
def test_what_is_no_trace_is_refused_in_one_line(content: bytes, tmp_path: Path) -> None:
    path = tmp_path / "bad.file"
    path.write_bytes(content)
    with pytest.raises(LogError) as caught:
        Trace.read(path)
    assert "bad.file" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_not_there_or_a_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="no such file"):
        Trace.read(tmp_path / "nothing")
    with pytest.raises(LogError, match="is a folder"):
        Trace.read(tmp_path)


@pytest.mark.parametrize("kind", KINDS)
def test_a_flipped_or_missing_byte_is_refused_or_changes_a_number(kind: str, tmp_path: Path) -> None:
    path, random = tmp_path / f"run.{kind}", np.random.default_rng(2)
    example(50).write(path)
    sound = path.read_bytes()
    for _ in range(200):
        data = bytearray(sound)
        for at in random.integers(0, len(data), random.integers(1, 4)):
            data[at] = random.integers(0, 256)
        path.write_bytes(bytes(data[: random.integers(1, len(data) + 1)] if random.random() < 0.2 else data))
        with contextlib.suppress(BowdenError):
            assert len(Trace.read(path)) <= 51
    path.write_bytes(sound[:-20])
    if kind != "csv":  # whose last row may be cut to another number
        with pytest.raises(LogError):
            Trace.read(path)


@pytest.mark.parametrize("kind", KINDS)
def test_an_unwritable_place_leaves_nothing(kind: str, tmp_path: Path) -> None:
    (tmp_path / f"folder.{kind}").mkdir()
    for target in (tmp_path / "missing" / f"run.{kind}", tmp_path / f"folder.{kind}"):
        with pytest.raises(OutputError) as caught:
            example().write(target)
        assert str(target) in str(caught.value)
    assert [path.name for path in tmp_path.rglob("*")] == [f"folder.{kind}"]


@pytest.mark.parametrize("kind", KINDS)
def test_a_failed_write_keeps_the_old_file(kind: str, tmp_path: Path) -> None:
    path = tmp_path / f"run.{kind}"
    path.write_text("precious")
    unserialisable = Trace({"a": np.zeros(1)}, {"a": "1"}, {"law": object()})
    with pytest.raises(TypeError):
        unserialisable.write(path)
    assert path.read_text() == "precious"
    assert list(tmp_path.iterdir()) == [path]


def test_columns_must_fit_together() -> None:
    with pytest.raises(ParameterError, match="a has 2 samples, b has 3"):
        Trace({"a": np.zeros(2), "b": np.zeros(3)}, {"a": "1", "b": "1"})
    with pytest.raises(ParameterError, match="units has none for 'a'"):
        Trace({"a": np.zeros(2)}, {})


def test_missing_columns_and_uneven_time_are_told() -> None:
    with pytest.raises(LogError, match="without reference, joint"):
        Trace({"time": np.arange(3.0)}, {"time": "s"}).metrics()
    time = np.arange(100) * 0.01
    time[60:] += 0.005
    found = example(100, time=time).metrics()
    assert found.rmse_deg is not None
    assert found.delay_s is None
    with pytest.raises(LogError, match="uneven"):
        example(100, time=time[::-1].copy()).metrics()
    with pytest.raises(LogError, match="no power"):
        example().power()


def test_a_run_that_ran_away_has_no_figures() -> None:
    joint = np.linspace(0.0, 1.0, 3000)
    joint[2000:] = np.nan
    trace = example(3000, joint=joint, **{"law.estimate": joint})
    assert not trace.stable
    assert set(vars(trace.metrics()).values()) == {None}
    assert trace.bandwidth(0.1, 1.0) is None


def test_power_follows_equation_18() -> None:
    velocity, current = np.array([2.0, -2.0, 0.0]), np.array([3.0, 3.0, 3.0])
    trace = example(3, motor_velocity=velocity, current=current)
    trace = Trace(trace.columns, trace.units, {"motor_resistance": 0.5, "torque_constant": 0.1})
    mechanical, electrical = trace.power()
    assert mechanical.tolist() == pytest.approx([0.6, -0.6, 0.0])
    assert electrical.tolist() == pytest.approx([5.1, 3.9, 4.5])
    figures = trace.metrics()
    assert figures.mechanical_energy_j == pytest.approx(1e-3 * (0.5 * 0.6 - 0.6))
    assert figures.electrical_energy_j == pytest.approx(1e-3 * (0.5 * 5.1 + 3.9 + 0.5 * 4.5))


def test_bandwidth_of_a_run() -> None:
    time = np.arange(60_000) * 1e-3
    chirp = np.sin(2.0 * np.pi * (0.1 * time + 0.5 * 9.9 / 60.0 * time**2))
    _, joint, _ = signal.lsim(([20.0], [1.0, 20.0]), chirp, time)
    settling = 1.0 - np.exp(-time / 3.0)
    trace = example(60_000, time=time, reference=chirp, joint=joint, **{"law.estimate": settling})
    assert trace.bandwidth(0.3, 9.0) == pytest.approx(20.0, rel=0.01)
    assert trace.bandwidth(0.3, 2.0) is None


def test_the_figures_of_a_live_log_are_those_of_the_cycles_that_the_law_led() -> None:
    from bowden.cycle.one_cycle import TargetSource

    assert LED == TargetSource.LAW_BEGINS
    count = 200
    joint = np.where(np.arange(count) < 100, 1.0, 0.1)
    columns = {"time": np.arange(count) * 0.01, "reference": np.zeros(count), "joint": joint}
    columns["source"] = np.where(np.arange(count) < 100, 0.0, float(TargetSource.LAW_BEGINS))
    units = {"time": "s", "reference": "rad", "joint": "rad", "source": "–"}
    trace = Trace(columns, units, {"log": {}})
    assert trace.metrics().rmse_deg == pytest.approx(np.degrees(0.1))


def test_traces_without_a_reference_are_shown_by_dashes() -> None:
    t = np.linspace(0.0, 1.0, 101)
    one = Trace({"time": t, "joint": t}, {"time": "s", "joint": "rad"})
    assert repr(Traces({"recorded": one})).splitlines()[1].split() == ["recorded", "–"]
    assert "–" in Traces({"recorded": one})._repr_html_()
