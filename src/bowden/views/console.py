"""The console's link, in a terminal."""

from typing import TYPE_CHECKING

from bowden.views.text import Call

if TYPE_CHECKING:
    from bowden.operations.console import ConsoleOpened


def show_console(found: "ConsoleOpened", call: Call) -> None:
    """The link."""
    print(f"Console of {call['rig'].name}: {found.link}")
