"""The console's link, in a terminal."""

from bowden.operations.console import ConsoleOpened
from bowden.views.text import Call


def show_console(found: ConsoleOpened, call: Call) -> None:
    """The link."""
    print(f"Console of {call['rig'].name}: {found.link}")
