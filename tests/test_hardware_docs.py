"""The table in docs/background/drives.md says what the code does."""

from pathlib import Path

from bowden.core.signals import DriveState
from bowden.hardware.drives.cia402 import CONTROL, STATUS
from bowden.hardware.ports import Power

DOCS = Path(__file__).parents[1] / "docs"


def table(page: str, name: str) -> list[str]:
    text = (DOCS / page).read_text(encoding="utf-8")
    return text.split(f"<!-- {name} -->\n")[1].split("<!-- end -->")[0].splitlines()[2:]


def test_the_state_table() -> None:
    rows = []
    for state in DriveState:
        mask, value = STATUS[state]
        words = [CONTROL[state, power] for power in Power]
        cells = [state.name.lower().replace("_", " "), str(int(state)), f"{value:02X}h of {mask:02X}h"]
        rows.append(" | ".join(cells + [f"{word:04X}h" if word else "–" for word in words]))
    assert table("background/drives.md", "state table") == rows
