"""What a measurement came to, in a terminal."""

import shlex
from typing import TYPE_CHECKING

from bowden.views.text import Call

if TYPE_CHECKING:
    from bowden.operations.measure import MeasuredMotion


def show_measure(found: "MeasuredMotion", call: Call) -> None:
    """How the run ended, and what comes next."""
    from bowden.live.summary import print_summary

    print_summary(found.summary)
    if found.files:
        first, second = (shlex.quote(str(file)) for file in found.files[:2])
        print(f"Next: bowden identify {first}, and bowden identify-servo {second}")
