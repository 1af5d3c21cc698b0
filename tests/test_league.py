"""The league: cells that are the simulation's own figures, a fair ranking, and a command that keeps what was played."""

import json
from collections.abc import Iterator
from contextlib import nullcontext
from pathlib import Path
from typing import Any

import jsonschema
import numpy as np
import pytest

from bowden.app import main
from bowden.app.schema_command import json_schema
from bowden.control import LAWS
from bowden.control.knowledge import informed
from bowden.core.units import DEGREES
from bowden.design import league, league_cells, league_identified
from bowden.design.league import Cell, Played, standings
from bowden.design.league_cells import STROKE, LeaguePlant
from bowden.design.league_exact import exact_travel
from bowden.plants.knowledge_of import knowledge_of
from bowden.report.league_page import league_page
from bowden.rig.presets.bench import default_bench, moved_sheath
from bowden.sim.run import simulate

pytestmark = pytest.mark.usefixtures("undrawn")

ROOT = Path(__file__).parents[1]
BENCH = default_bench()
PLANTS = {one.name: one for one in league_cells.plants(BENCH, moved_sheath())}
SCENARIOS = {one.name: one for one in league_cells.scenarios()}


def played(laws: list[Any], plant: LeaguePlant, *scenarios: str) -> list[Played]:
    motions = [SCENARIOS[name] for name in scenarios]
    return list(league.play(laws, [lambda: plant], motions, lambda what, share: None, lambda law: nullcontext()))


def cell(law: str, plant: str, rmse: float | None, chatter: float | None = 1.0) -> Cell:
    return Cell(law, plant, "periodic", rmse, rmse, rmse, 0.0, chatter, 1.0, stable=rmse is not None)


@pytest.mark.parametrize("name", ["bench", "moved_sheath"])
def test_the_bench_is_the_bench(name: str) -> None:
    """A cell's figures are those of the bench itself, with the same noise."""
    (one,) = played([LAWS["uncompensated"]], PLANTS[name], "fast")
    bend = PLANTS[name].bend
    trace = simulate(BENCH, LAWS["uncompensated"], SCENARIOS["fast"].motion, duration=20.0, seed=1, bend=bend)
    figures = trace.metrics()
    assert one.cell.rmse_deg == pytest.approx(figures.rmse_deg, rel=1e-6)
    assert one.cell.energy_j == pytest.approx(figures.electrical_energy_j, rel=1e-6)
    assert one.cell.peak_deg == pytest.approx(one.errors.max(), rel=1e-12)
    assert len(one.errors) == league.STRETCHES


@pytest.mark.parametrize(
    ("plant", "name"), [("moved_sheath", "adaptive"), pytest.param("play", "uncompensated", marks=pytest.mark.long)]
)
def test_a_cell_is_what_a_trace_of_its_run_shows_to_the_last_bit(plant: str, name: str) -> None:
    found, motion = PLANTS[plant], SCENARIOS["fast"]
    start = found.plant.resting_motor(0.0, float(found.bend(np.zeros(1))[0]))
    trace = simulate(
        found.plant,
        informed(LAWS[name], knowledge_of(found.plant)),
        motion.motion,
        duration=motion.duration,
        bend=found.bend,
        seed=1,
        initial_motor=start,
    )
    figures = trace.metrics()
    errors = np.abs(trace.error) * DEGREES
    (one,) = played([LAWS[name]], found, "fast")
    travel = exact_travel(found.plant, motion.motion, duration=motion.duration, bend=found.bend, initial_motor=start)
    assert one.cell == Cell(
        law=name,
        plant=plant,
        scenario="fast",
        rmse_deg=figures.rmse_deg,
        rmse_after_10s_deg=figures.rmse_after_10s_deg,
        peak_deg=figures.peak_deg,
        delay_s=figures.delay_s,
        chatter=float(np.abs(np.diff(trace["command"], prepend=start)).sum()) / travel,
        energy_j=figures.electrical_energy_j,
        stable=True,
    )
    assert one.errors.tolist() == [part.max() for part in np.array_split(errors, league.STRETCHES)]


@pytest.mark.long
def test_on_a_cable_that_loses_nothing_no_compensation_has_a_chatter_near_one() -> None:
    from bowden.plants.cables import stack

    rigid = PLANTS["play"].plant._replace(cable=stack(1.0, [], []))
    ideal = rigid._replace(joint_encoder=type(rigid.joint_encoder)(), motor_encoder=type(rigid.motor_encoder)())
    (one,) = played([LAWS["uncompensated"]], LeaguePlant("rigid", "", ideal, PLANTS["play"].bend), "periodic")
    assert one.cell.chatter == pytest.approx(1.0, abs=0.01)


def test_an_unstable_run_has_no_figures() -> None:
    (one,) = played([LAWS["adaptive"].preset("paper")], PLANTS["bench"], "fast")
    values = {name: value for name, value in one.cell.__dict__.items() if name not in ("law", "plant", "scenario")}
    assert values.pop("stable") is False
    assert set(values.values()) == {None}
    assert np.isnan(one.errors).all()


LONG = ("dahl", "slack", "coulomb", "capstan", "play")


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.long) if n in LONG else n for n in PLANTS])
def test_every_plant_can_be_played(name: str) -> None:
    """No compensation leaves an error on each of them, and never a large one."""
    (one,) = played([LAWS["uncompensated"]], PLANTS[name], "fast")
    assert one.cell.stable
    assert one.cell.rmse_deg is not None
    assert 1.0 < one.cell.rmse_deg < 20.0
    assert one.cell.chatter is not None
    assert 0.4 < one.cell.chatter < 1.1


@pytest.mark.long
def test_the_slack_cable_goes_slack() -> None:
    plant = PLANTS["slack"].plant
    trace = simulate(plant, LAWS["uncompensated"], SCENARIOS["fast"].motion, duration=4.0)
    still = np.abs(trace["joint"]) < 1e-12
    assert still[1:].any()
    assert np.ptp(trace["motor"][still]) > 0.05


def test_scenarios_fit_the_plants_stroke() -> None:
    time = np.arange(0.0, 36.0, 0.01)
    for one in SCENARIOS.values():
        whole, half = (one.reference(stroke).sample(time) for stroke in (STROKE, 0.5 * STROKE))
        assert half == pytest.approx(0.5 * whole)
        assert whole[:, 0].max() * DEGREES == pytest.approx(70.0, abs=0.01)
        assert whole[:, 0].min() >= 0.0


def test_the_ranking_counts_an_unstable_cell_as_the_worst() -> None:
    cells = [cell("adaptive", name, 1.0, 2.0) for name in "abcd"]
    cells += [cell("good", name, value) for name, value in zip("abcd", (0.1, 0.2, 2.0, 0.4), strict=True)]
    cells += [cell("wild", name, value) for name, value in zip("abcd", (0.05, None, None, None), strict=True)]
    first, second, third = standings(cells)
    assert (first.law, second.law, third.law) == ("good", "adaptive", "wild")
    assert (first.won, second.won, third.won) == (0.5, 0.25, 0.25)
    assert first.ratio == pytest.approx(0.3)
    assert (second.ratio, second.chatter, second.most_chatter) == (1.0, 2.0, 2.0)
    assert (third.ratio, third.rmse_deg, third.unstable) == (None, None, 3)
    assert standings([]) == []


@pytest.mark.drawn
def test_the_page_holds_every_cell_and_escapes_names() -> None:
    results = played([LAWS["uncompensated"], LAWS["adaptive"]], PLANTS["play"], "fast")
    strange = Played(cell("<b>", "play", None), "what & how", np.full(league.STRETCHES, np.nan))
    everything = [*results, strange]
    html = league_page(everything, standings([one.cell for one in everything]), [SCENARIOS["fast"]]).html()
    assert "&lt;b&gt;" in html
    assert "<b>" not in html.replace("<b>Figure", "")
    assert "what &amp; how" in html
    assert html.count("<polyline") == 2
    assert "unstable" in html
    assert "interrupted" in league_page([], [], [], interrupted=True).html()


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    return tmp_path


SMALL = ["league", "--plants", "play", "--scenarios", "fast,point_to_point", "--data", "nowhere"]


def checked(printed: str) -> Any:
    document = json.loads(printed)
    jsonschema.validate(document, json_schema("league"))
    return document


def test_the_command_plays_a_users_law_too(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The law of the page, in twenty lines or so."""
    text = (ROOT / "docs" / "league.md").read_text(encoding="utf-8")
    source = text.split("```python\n")[1].split("```")[0]
    assert len([line for line in source.splitlines() if line.strip()]) <= 20
    Path("my_law.py").write_text(source, encoding="utf-8")
    assert main.run([*SMALL, "--laws", "uncompensated", "--law", "my_law.py", "--json"]) == 0
    output = capsys.readouterr()
    cells = checked(output.out)["cells"]
    assert [(one["law"], one["scenario"]) for one in cells] == [
        (law, motion) for motion in ("fast", "point_to_point") for law in ("uncompensated", "my_law")
    ]
    assert cells[1]["rmse_deg"] < 0.5 * cells[0]["rmse_deg"]
    assert "no cable logs" in output.err
    assert "my_law" in Path("out/league/league.html").read_text(encoding="utf-8")


def test_the_table_without_json(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run([*SMALL[:3], "--scenarios", "fast", "--laws", "uncompensated", "--out", "here"]) == 0
    assert "uncompensated" in capsys.readouterr().out
    assert Path("here/league.html").is_file()


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["--laws", "adaptve"], "there is no law 'adaptve'"),
        (["--plants", "bench,capstn"], "there is no plant 'capstn' in the league; expected capstan (did you mean"),
        (["--scenarios", "quick"], "there is no scenario 'quick'"),
        (["--law", "none.py"], "cannot read the law"),
    ],
)
def test_what_is_not_known_is_refused(
    arguments: list[str], said: str, folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main.run(["league", "--data", "nowhere", *arguments]) == 2
    output = capsys.readouterr()
    assert said in output.err
    assert output.out == ""
    assert not Path("out").exists()


def test_two_plants_of_one_name_are_refused(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for place in ("a", "b"):
        Path(place).mkdir()
        Path(place, "mine.py").write_text((ROOT / "examples" / "my_plant.py").read_text())
    assert main.run(["league", "--data", "nowhere", "--plants", "a/mine.py,b/mine.py"]) == 2
    assert "'b/mine.py': there is a plant 'mine' already; give yours another name" in capsys.readouterr().err


def test_an_interrupted_league_keeps_what_it_has(
    folder: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    whole = league.play

    def broken(*arguments: Any, **named: Any) -> Iterator[Played]:
        for i, one in enumerate(whole(*arguments, **named)):
            if i == 1:
                raise KeyboardInterrupt
            yield one

    monkeypatch.setattr(league, "play", broken)
    assert main.run([*SMALL, "--laws", "uncompensated", "--json"]) == 130
    output = capsys.readouterr()
    assert len(checked(output.out)["cells"]) == 1
    assert "interrupted; 1 cells played" in output.err
    assert "was interrupted" in Path("out/league/league.html").read_text(encoding="utf-8")


def test_a_real_cable_is_zeroed_at_the_lower_end_of_its_stroke(shared_data: Path) -> None:
    """From there it goes over its stroke as the log does, whichever way its motor is counted."""
    log, fit = league_identified.fitted(shared_data / "cable" / "L_4_24.csv.gz")
    for model in ("play", "bouc_wen", "bouc_wen_static", "prandtl_ishlinskii"):
        one = league_identified.zeroed(log, fit, model)
        assert one.stroke == pytest.approx(0.9 * np.ptp(log.joint), rel=0.05), model
        memory = one.cable.start(one.cable.prepared, 0.0, 1.0, 1.0)
        assert one.cable.look(one.cable.prepared, memory, 0.0, 1.0, 1.0).joint == pytest.approx(0.0, abs=1e-12)


@pytest.mark.long
def test_a_cable_between_two_wrist_poses(shared_data: Path) -> None:
    logs = {name: shared_data / "cable" / f"{name}.csv.gz" for name in league_identified.POSES}
    assert league_identified.names(logs) == [*logs, "wrist_poses"]
    assert league_identified.names({"L_4_24": Path()}) == ["L_4_24"]
    plant = league_identified.identified_plant(PLANTS["bench"].plant, "wrist_poses", logs)
    (one,) = played([LAWS["uncompensated"]], plant, "periodic")
    (held,) = played([LAWS["uncompensated"]], plant, "fast")
    assert one.cell.rmse_deg is not None
    assert held.cell.rmse_deg is not None
    assert 2.0 < one.cell.rmse_deg < held.cell.rmse_deg < 8.0
    trace = simulate(plant.plant, LAWS["uncompensated"], SCENARIOS["slow"].motion, duration=20.0, bend=plant.bend)
    assert trace["width"].min() == pytest.approx(1.0)
    assert trace["width"].max() == pytest.approx(2.0)
