"""Where the demonstration's page is, in a terminal."""

from bowden.operations.demo import Demo
from bowden.views.text import Call, say_next


def show_demo(found: Demo, call: Call) -> None:
    """The page, and what comes next."""
    print(f"\nPage: {found.files[-1]}  ({call.seconds:.0f} s)")
    if found.words:
        say_next("identify", *found.words, why="the same step by step: the page has the commands")
    else:
        say_next("demo", "my.csv", why="with a log of your own")
