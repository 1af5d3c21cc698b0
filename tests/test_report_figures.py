"""Figures of the pages: laws look unlike, cuts are said, axes of loops are equal, a log opens with its error."""

import re
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from bowden.control import LAWS
from bowden.drawing.style import COLOURS, CYCLE, colours_for, dashes_for, legend, new_figure, stay_near
from bowden.live.figures import LogFacts, RunStop
from bowden.records.trace import Trace
from bowden.report import page, simulate_figures
from bowden.report.log_page import faults_of, log_page, motion, states
from bowden.report.page import Page
from bowden.safety.faults import Fault
from bowden.study.distributions import Distribution
from bowden.study.figures import LawFigures, Summary
from bowden.study.results import ParameterShare
from support.blank import blank


def run(stroke: float = 1.0, *, after: int = 10_000, names: Mapping[str, list[str]] | None = None) -> Trace:
    """A made-up run of ten seconds; from sample `after` on its joint goes far astray."""
    time = np.arange(10_000) * 1e-3
    reference = 0.6 * (1.0 - np.cos(time))
    joint = stroke * reference
    joint[after:] = 1e3
    columns = {"time": time, "reference": reference, "joint": joint, "motor": 1.1 * reference, "command": joint}
    return Trace(columns, dict.fromkeys(columns, "rad"), {"names": names or {}}, seed=1)


def test_every_law_has_a_colour_of_its_own() -> None:
    names = list(LAWS)
    colours = colours_for(names)
    assert set(names) <= set(COLOURS)
    assert len(set(colours.values())) == len(names)
    assert colours_for(names[::-1]) == colours, "the same on all pages, whatever else is there"
    many = [f"law {i}" for i in range(20)]
    looks = {(colours_for(many)[name], dashes_for(many)[name]) for name in many}
    assert len(looks) == len(many)


def test_every_colour_of_a_figure_has_another_one_on_a_dark_screen_and_none_on_paper() -> None:
    assert {*COLOURS.values(), *CYCLE} <= set(page._DARK)
    made = Page("t")
    figure, (axes,) = new_figure()
    axes.plot([0.0, 1.0], color=COLOURS["adaptive"])
    made.figure(figure)
    html = made.html()
    assert "stroke: var(--c0072b2, #0072b2)" in html
    assert re.search(r"@media screen and \(prefers-color-scheme: dark\) \{ :root \{ [^}]*--c0072b2: #4fa8e0;", html)
    assert "--c" not in re.findall(r"@media print \{.*", html, re.S)[0].split("@media screen")[0]


def test_a_curve_that_is_cut_says_how_far_it_goes_on() -> None:
    _, (axes,) = new_figure()
    calm = np.sin(np.linspace(0.0, 9.0, 99))
    stay_near(axes, [calm], [calm])
    assert not axes.texts
    stay_near(axes, [calm], [calm, np.array([0.0, -4e4, np.nan])])
    assert [text.get_text() for text in axes.texts] == ["cut: goes on to −4e+04"]


def test_a_legend_of_long_names_stays_within_the_figure() -> None:
    figure, (axes,) = new_figure(height=5.0)
    for name in LAWS:
        axes.plot([0.0, 1.0], label=name)
    legend(axes)
    figure.draw_without_rendering()
    box = axes.get_legend()
    assert box is not None
    extent = box.get_window_extent()
    assert extent.x0 >= 0.0
    assert extent.x1 <= figure.bbox.x1


def test_loops_have_one_scale_and_one_range() -> None:
    traces = {"adaptive": run(), "a_law_of_a_name_that_is_too_long": run(0.8, after=8000)}
    panels = simulate_figures.loops(traces, colours_for(list(traces))).axes
    assert {one.get_aspect() for one in panels} == {1.0}
    assert len({(*one.get_xlim(), *one.get_ylim()) for one in panels}) == 1
    assert [len(one.texts) for one in panels] == [0, 1], "the cut one says so"


FACTS = blank(LogFacts, whole=True, cycles=10_000, missing=0, duration_s=10.0, law="adaptive", outcome="ended as asked")


@pytest.mark.usefixtures("undrawn")
def test_a_log_opens_with_its_error_and_its_end() -> None:
    trace = run(0.99)
    modes = np.where(trace.time < 9.0, 2.0, 0.0)
    sources = np.where(trace.time < 5.0, 0.0, 9.0)  # the law leads from then on
    whole = Trace({**trace.columns, "mode": modes, "source": sources}, {**trace.units, "mode": "1", "source": "1"})
    html = log_page(whole, [], replace(FACTS, rmse_deg=0.5, peak_deg=1.0, seconds_led=5.0), "Run").html()
    assert "How the run ended: ended as asked. The log ends at 9.999 s." in html
    assert '<td>RMSE while the law led</td><td class="number">0.500</td>' in html
    assert html.index("RMSE while the law led") < html.index("<svg")
    ended = replace(
        FACTS, stops=(RunStop(3.0, ("a",), ("b",), ("c",), None),), outcome="ended by a fault at 3.000 s: a"
    )
    latched = Trace({**whole.columns, "mode": np.full(len(trace), 5.0)}, whole.units)
    html = log_page(latched, [], ended, "Run").html()
    assert "Stopped by a fault at 3.000 s: a; b." in html
    assert "How the run ended: ended by a fault at 3.000 s: a." in html


def test_a_log_without_reference_has_no_empty_panel_and_what_was_not_read_yet_is_no_fault() -> None:
    trace = run(names={"faults": ["joint_lost", "joint_jump"]})
    faults = np.zeros(len(trace))
    faults[:3] = 1.0  # joint_lost, until it was read
    faults[500:600] = 2.0
    columns = trace.columns | {"reference": np.full(len(trace), np.nan), "faults": faults}
    log = Trace(columns, trace.units | {"faults": "1"}, trace.settings)
    assert len(motion(log).axes) == 1
    bands = states(log)
    assert bands is not None
    assert [label.get_text() for label in bands.axes[0].get_yticklabels()] == ["joint jump"]
    assert np.array_equal(log["faults"], faults), "the log is not touched"


@pytest.mark.usefixtures("undrawn")
def test_the_speed_of_a_first_reading_is_no_fault() -> None:
    """The angles step from nothing to what they are; the same later is a fault."""
    names = [fault.name.lower() for fault in Fault]
    sets = np.zeros(200)
    sets[:2] = 1 << Fault.JOINT_LOST | 1 << Fault.MOTOR_LOST
    sets[2:9] = 1 << Fault.JOINT_OVER_SPEED
    sets[100:110] = 1 << Fault.MOTOR_OVER_SPEED
    time = np.arange(200) * 1e-3
    trace = Trace({"time": time, "faults": sets}, {"time": "s", "faults": "1"}, {"names": {"faults": names}})
    ((name, there),) = faults_of(trace)
    assert name == "motor over speed"
    assert there.sum() == 10


def test_a_campaign_ranks_what_matters_most_and_faults_too() -> None:
    from bowden.report.campaign_page import campaign_page

    found = (
        ParameterShare("servo", -0.2, 0.04, 0.0, above_chance=True),
        ParameterShare("fault.kind", None, 0.6, 0.0, above_chance=True),
        ParameterShare("x", 0.0, 0.0, 0.0, above_chance=False),
    )
    steps = {
        "servo": (np.array([1.0, 2.0]), np.array([0.2, 0.1])),
        "fault.kind": (np.array([0.0, 1.0]), np.array([0.1, 0.9])),
    }
    words = {"fault.kind": ("nothing", "spike")}
    law = LawFigures("adaptive", 9, 0, 0, (0.0, 0.3), None, None, {}, (), found, steps=steps, words=words)
    drawn = [
        ("servo", "Hz", Distribution("uniform", (1.0, 2.0))),
        ("fault.kind", "", Distribution("choice", ("nothing", "spike"))),
        ("x", "", Distribution("fixed", (1.0,))),
    ]
    html = campaign_page(Summary("h", "d", 9, (law,)), "t", drawn, "", 1.0).html()
    assert "<b>adaptive</b>: fault.kind (60 %), servo (4 %)." in html
    rows = re.findall(r"<tr><td class=\"number\">(\d)</td><td>(\S+?)</td>", html)
    assert rows == [("1", "fault.kind"), ("2", "servo")]
    lacking = ParameterShare("gain", None, None, None, above_chance=False)
    law = replace(law, sensitivity=(replace(found[0], chance_share=0.2, above_chance=False), found[1], lacking))
    drawn.append(("gain", "", Distribution("uniform", (1.0, 2.0))))
    html = campaign_page(Summary("h", "d", 9, (law,)), "t", drawn, "", 1.0).html()
    assert "<b>adaptive</b>: fault.kind (60 %)." in html
    assert "(4.0)" in html
    assert "are below 20 %" in html
    assert "Oscillating: the command travelled more than 5 times" in html
