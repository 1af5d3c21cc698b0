"""What a measurement came to, in a terminal."""

import shlex

from bowden.operations.measure import MeasuredMotion
from bowden.views.run import print_summary
from bowden.views.text import Call


def show_measure(found: MeasuredMotion, call: Call) -> None:
    """How the run ended, and what comes next."""
    print_summary(found)
    if found.files:
        first, second = (shlex.quote(str(file)) for file in found.files[:2])
        print(f"Next: bowden identify {first}, and bowden identify-servo {second}")
