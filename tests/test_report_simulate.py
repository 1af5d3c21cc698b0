"""The page of a simulation shows every run, marks the best, and stays calm when one ran away."""

import re
from pathlib import Path

import numpy as np
import pytest
from scipy import signal

from bowden.core.errors import LogError, OutputError
from bowden.records.trace import Trace
from bowden.report.simulate_page import simulation_page

pytestmark = pytest.mark.usefixtures("undrawn")

UNITS = {"time": "s", "current": "A", "motor_velocity": "rad/s", "width": "1"}


def run(gain: float = 1.0, *, lasts: float = np.inf, noise: float = 0.0, moved: bool = False) -> Trace:
    """A made-up run of a minute that carries all that a simulated one does."""
    time = np.arange(60_000) * 1e-3
    reference = 0.6 * (1.0 - np.cos(2.0 * np.pi * time / 10.0))
    motor = gain * reference + noise * np.random.default_rng(0).standard_normal(len(time))
    columns = {
        "time": time,
        "reference": reference,
        "joint": 0.98 * motor,
        "motor": motor,
        "command": motor,
        "motor_velocity": np.gradient(motor, time),
        "current": 1.0 + motor,
        "width": 1.0 + (0.5 * np.sin(time / 20.0) if moved else 0.0 * time),
        "slope": np.full(len(time), 0.98),
        "law.estimate": 1.0 - np.exp(-time),
        "law.unused": np.zeros(len(time)),
    }
    for name in ("joint", "motor", "command", "law.estimate", "current"):
        columns[name][time > lasts] = np.nan
        columns[name][(time > lasts - 0.1) & (time <= lasts)] *= 1e3
    settings = {
        "law": "adaptive",
        "gains": {"κ": 20.0, "list": list(range(100))},
        "reference": {"kind": "periodic_minimum_jerk"},
        "motor_resistance": 0.2,
        "torque_constant": 0.08,
    }
    return Trace(columns, {name: UNITS.get(name, "rad") for name in columns}, settings, seed=1)


def written(traces: dict[str, Trace], folder: Path) -> str:
    simulation_page(traces, "A <run>").write(folder / "run.html")
    return (folder / "run.html").read_text(encoding="utf-8")


@pytest.mark.drawn
def test_several_laws_side_by_side(tmp_path: Path) -> None:
    html = written({"adaptive": run(1.01, moved=True), "mine <b>": run(0.9, noise=1e-3)}, tmp_path)
    assert len(html) < 5_000_000
    assert "A &lt;run&gt;" in html
    assert "<b>" not in html.replace("<b>Figure", "")
    assert "2 laws, 60 s at 1000 Hz, reference: periodic minimum jerk." in html
    best = re.findall(r'<tr class="best">.*?</tr>', html)
    assert len(best) == 1
    assert "adaptive" in best[0]
    for heading in ("Inside adaptive", "Inside mine &lt;b&gt;", "How the sheath was moved", "What made these runs"):
        assert heading in html
    assert html.count("<svg") == 7
    assert "gains.κ" in html
    assert "… (100 values)" in html


def test_the_table_carries_the_trace_s_own_figures(tmp_path: Path) -> None:
    trace = run(1.1)
    figures = trace.metrics()
    html = written({"one": trace}, tmp_path)
    row = re.findall(r"<tr><td>one</td>.*?</tr>", html)[0]
    for value in (figures.rmse_deg, figures.peak_deg, figures.electrical_energy_j):
        assert f">{value:.3f}<" in row
    assert '<tr class="best">' not in html  # nothing to compare with
    assert "How the sheath was moved" not in html


@pytest.mark.drawn
def test_a_run_that_ran_away_is_told_and_has_dashes(tmp_path: Path) -> None:
    html = written({"steady": run(), "wild": run(lasts=3.0)}, tmp_path)
    assert "wild is unstable on this bench: its numbers ran away after 3.00 s" in html
    row = re.findall(r"<tr><td>wild</td>.*?</tr>", html)[0]
    assert row.count("–") == 7
    assert "nan" not in re.sub(r"<svg.*?</svg>", "", html, flags=re.S)
    assert "unstable" in written({"wild": run(lasts=3.0)}, tmp_path)  # also alone


@pytest.mark.drawn
def test_a_run_that_ran_away_at_once_is_shown(tmp_path: Path) -> None:
    assert "ran away after 0.00 s" in written({"wild": run(lasts=-1.0)}, tmp_path)


def test_a_trace_of_three_columns_is_enough(tmp_path: Path) -> None:
    whole = run(0.95)
    few = {name: whole[name] for name in ("time", "reference", "joint")}
    html = written({"log": Trace(few, {name: whole.units[name] for name in few})}, tmp_path)
    assert "Commands to the motor" not in html
    assert html.count("<svg") == 3


def test_what_cannot_be_shown_is_refused_and_nothing_written(tmp_path: Path) -> None:
    with pytest.raises(LogError, match="without reference, joint"):
        simulation_page({"a": Trace({"time": np.arange(9.0)}, {"time": "s"})}, "t")
    with pytest.raises(OutputError):
        simulation_page({"a": run()}, "t").write(tmp_path / "missing" / "x.html")
    assert not list(tmp_path.iterdir())


def test_of_a_chirp_the_table_has_the_bandwidth(tmp_path: Path) -> None:
    time = np.arange(60_000) * 1e-3
    chirp = np.sin(2.0 * np.pi * (0.1 * time + 0.5 * 9.9 / 60.0 * time**2))
    _, joint, _ = signal.lsim(([20.0], [1.0, 20.0]), chirp, time)
    settings = {"reference": {"kind": "chirp", "amplitude": 1.0, "f0": 0.1, "f1": 10.0, "duration": 60.0}}
    columns = {"time": time, "reference": chirp, "joint": joint}
    html = written({"lag": Trace(columns, dict.fromkeys(columns, "rad"), settings)}, tmp_path)
    assert "bandwidth [rad/s]" in html
    row = re.findall(r"<tr><td>lag</td>.*?</tr>", html)[0]
    assert float(re.findall(r">([^<>]+)</td></tr>", row)[0]) == pytest.approx(20.0, abs=0.2)
    assert "bandwidth" not in written({"one": run()}, tmp_path)
