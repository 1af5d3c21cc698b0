"""Progress of what takes long, on one line that changes, and only where standard error is a terminal."""

import sys


def line(text: str) -> None:
    """Show this in place of what stood there."""
    if sys.stderr.isatty():
        print(f"\r{text:<70}", end="", file=sys.stderr, flush=True)


def end() -> None:
    """What follows begins on a line of its own."""
    if sys.stderr.isatty():
        print(file=sys.stderr)
