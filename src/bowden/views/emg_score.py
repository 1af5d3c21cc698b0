"""The contractions in a recording: a table in a terminal, and a page."""

from pathlib import Path

from bowden.operations.emg_score import EmgScore
from bowden.operations.support.operation import Folder
from bowden.views.text import Call, table


def write_emg_score(found: EmgScore, call: Call, *, out: Folder = Path("out/emg")) -> list[Path]:
    """Write the page.

    Args:
        found: the contractions.
        call: of the command.
        out: folder for emg.html.
    """
    from bowden.core.files import whole_files
    from bowden.report.emg_page import emg_page

    whole = found.value
    with whole_files(out) as folder:
        emg_page(call["recording"].name, whole.log, whole.labels, whole.findings).write(folder / "emg.html")
    return [out / "emg.html"]


def show_emg_score(found: EmgScore, call: Call) -> None:
    """Our detector beside the plain threshold."""
    from bowden.identify.emg.log import channel_unit
    from bowden.report.emg_page import TITLES, score_row
    from bowden.sensing.envelope import PLAIN_THRESHOLD

    unit = channel_unit(found.channel) or "(no unit in the channel's name)"
    titles = [title.replace(" ", "\n", 1) for title in TITLES]
    table(titles, [score_row("ours", found), score_row("plain threshold", found.plain_threshold)])
    share, level = f"{100.0 * PLAIN_THRESHOLD:g} %", PLAIN_THRESHOLD * found.mvc
    print(f"plain threshold: {level:.3g} {unit} = {share} of MVC {found.mvc:.3g} {unit}, from {found.mvc_from}")
    if found.value.units_differ:
        print(found.value.units_differ)
    if found.shortest_ms:
        rejected = found.rejected
        said = f"; {rejected} labelled ones are, and count neither as missed nor as found" if rejected else ""
        print(f"contractions shorter than {found.shortest_ms:g} ms are left out{said}")
        print(f"that costs {found.shortest_ms:g} ms of latency")
    if found.trouble_s >= 0.05:
        print(f"nothing can be detected in {found.trouble_s:.1f} s of movement, mains or a dead electrode")
    call.page()
