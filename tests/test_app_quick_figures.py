"""matplotlib as a command imports it: the same figures, and nothing of it left aside afterwards."""

import subprocess
import sys

DRAW = """
from bowden.drawing.style import legend, new_figure, svg
from matplotlib import artist
assert artist.kwdoc(artist.Artist)
figure, (axes,) = new_figure()
axes.plot([0.0, 1.0], [2.0, 3.0], label="a line")
axes.set(xlabel="time [s]", ylabel="joint [°]")
legend(axes)
class Mine(artist.Artist):
    def set_hue(self, value): self.hue = value
mine = Mine()
mine.set(hue=3.0)
assert mine.hue == 3.0 and "hue" in Mine.set.__doc__
print(svg(figure, "a"))
"""


def said(program: str) -> str:
    return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout


def test_a_figure_is_the_same_to_the_byte() -> None:
    whole = said(DRAW)
    assert "</svg>" in whole
    assert said("from bowden.app.quick_figures import import_figures\nimport_figures()\n" + DRAW) == whole


def test_the_glyphs_of_tex_are_imported_when_they_are_used() -> None:
    program = "import sys\nfrom bowden.app.quick_figures import import_figures\nimport_figures()\n"
    program += "import fontTools.agl, matplotlib.backends.backend_svg\nsaid = vars(fontTools.agl).get('UV2AGL')\n"
    program += "print(said, fontTools.agl.UV2AGL[65], vars(fontTools.agl).get('UV2AGL')[66])"
    assert said(program) == "None A B\n"
