"""A page is one file that stands alone, is the same each time, and shows what it was given as text, not as markup."""

import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path
from xml.etree import ElementTree

import matplotlib
import numpy as np
import pytest

from bowden.core.errors import OutputError
from bowden.drawing.style import legend, new_figure
from bowden.report.page import Page

VOID = {"meta", "br", "hr", "img", "link", "input"}


class Reader(HTMLParser):
    """Checks that every element is closed where it should be, and gathers what the page refers to."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.ids: list[str] = []
        self.targets: set[str] = set()
        self.elements: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append(tag)
        if tag not in VOID:
            self.open.append(tag)
        self._gather(attrs)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append(tag)
        self._gather(attrs)

    def _gather(self, attrs: list[tuple[str, str | None]]) -> None:
        for name, value in attrs:
            if name == "id":
                self.ids.append(value or "")
            if name in ("href", "xlink:href", "src"):
                self.targets.add(value or "")
            self.targets |= set(re.findall(r"url\((#[^)]*)\)", value or ""))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag


def read(html: str) -> Reader:
    reader = Reader()
    reader.feed(html)
    assert not reader.open
    return reader


def filled() -> Page:
    page = Page("Bend & <tension>", "What β̂ does")
    for number in range(4):
        page.heading(f"Part {number} <i>")
    page.text("A log named <code>{name}</code>", name="<script>alert(1)</script>.csv")
    page.text("<ul><li>one</li></ul>")
    page.notice("mind the <gap>")
    for _ in range(2):
        figure, (upper, lower) = new_figure(2, 1, share_x=True)
        time = np.linspace(0.0, 60.0, 3000)
        upper.plot(time, np.sin(time), label="joint φ_out")
        upper.fill_between(time, 0.0, np.cos(time), hatch="/")
        legend(upper)
        lower.scatter(time[::50], np.cos(time[::50]), marker="x")
        lower.set(xlabel="time [s]", ylabel="angle [°]", title="B")
        page.figure(figure, "both <lines>")
    page.table(
        ["name", "value", "range", "note"],
        [["a<b", "1.707", "0.93 ± 0.01", "short"], ["c", "–", "−3.2e-4", "x"]],
        "A caption & more",
        classes=["fitted", "differs"],
    )
    return page


def test_every_element_is_closed_and_every_reference_is_found_once() -> None:
    reader = read(filled().html())
    assert len(reader.ids) == len(set(reader.ids))
    inner = {target[1:] for target in reader.targets if target.startswith("#")}
    assert inner <= set(reader.ids)
    assert inner  # glyphs, clips and contents


def test_nothing_is_fetched_and_nothing_runs() -> None:
    html = filled().html()
    reader = read(html)
    assert all(target.startswith(("#", "data:")) for target in reader.targets)
    assert not {"script", "link", "img", "iframe"} & set(reader.elements)
    assert "@import" not in html
    assert not re.search(r"url\((?!#)", html)


def test_the_figures_are_well_formed_svg_with_text_as_shapes() -> None:
    drawings = re.findall(r"<svg.*?</svg>", filled().html(), re.S)
    assert len(drawings) == 2
    for drawing in drawings:
        tree = ElementTree.fromstring(drawing)
        assert not list(tree.iter("{http://www.w3.org/2000/svg}text"))


def test_what_was_given_shows_as_text() -> None:
    html = filled().html()
    for shown in ("Bend &amp; &lt;tension&gt;", "&lt;script&gt;alert(1)", "mind the &lt;gap&gt;", "both &lt;lines&gt;"):
        assert shown in html
    assert "a&lt;b" in html
    assert "<ul><li>one</li></ul>" in html


def test_numbers_stand_to_the_right_and_rows_have_their_class() -> None:
    html = filled().html()
    assert '<th scope="col" class="number">value</th>' in html
    assert '<td class="number">0.93 ± 0.01</td>' in html
    assert '<th scope="col">note</th>' in html
    assert '<tr class="differs">' in html


def test_rows_of_another_length_are_refused() -> None:
    with pytest.raises(ValueError, match="rows of other lengths"):
        Page("t").table(["a", "b"], [["1", "2"], ["1"]])
    with pytest.raises(ValueError, match="rows of other lengths"):
        Page("t").table(["a"], [["1"], ["2"]], classes=["fitted"])


def test_the_same_page_has_the_same_bytes_whatever_the_user_s_settings() -> None:
    before = filled().html()
    with matplotlib.rc_context({"lines.linewidth": 9.0, "svg.hashsalt": None, "font.size": 30.0, "axes.grid": False}):
        settings = dict(matplotlib.rcParams)
        page = Page("t")
        figure, (axes,) = new_figure()
        axes.set_xlabel("time [s]")
        page.figure(figure)
        assert dict(matplotlib.rcParams) == settings
        under_other_settings = page.html()
    page = Page("t")
    figure, (axes,) = new_figure()
    axes.set_xlabel("time [s]")
    page.figure(figure)
    assert page.html() == under_other_settings
    assert filled().html() == before


def test_a_page_is_written_whole_or_not_at_all(tmp_path: Path) -> None:
    page = filled()
    page.write(tmp_path / "page.html")
    assert (tmp_path / "page.html").read_text(encoding="utf-8") == page.html()
    with pytest.raises(OutputError, match="nowhere"):
        page.write(tmp_path / "nowhere" / "page.html")
    assert [path.name for path in tmp_path.iterdir()] == ["page.html"]


def test_pyplot_is_never_imported_and_matplotlib_only_when_something_is_drawn() -> None:
    program = (
        "import sys; from bowden.report.page import Page; from bowden.drawing.style import new_figure; "
        "from bowden.report.simulate_page import simulation_page; "
        "assert not {'matplotlib', 'jinja2', 'scipy', 'numba', 'pyarrow'} & set(sys.modules); "
        "p = Page('t'); f, (a,) = new_figure(); a.plot([1, 2]); p.figure(f); p.html(); "
        "assert 'matplotlib.pyplot' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
