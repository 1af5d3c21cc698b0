"""Which recordings were written, in a terminal."""

from pathlib import Path

from bowden.operations.sample import SampleRecordings
from bowden.views.text import Call


def show_sample(found: SampleRecordings, call: Call) -> None:
    """Each file and what it is, and what comes next."""
    print(f"Simulated, in {call['folder']}:")
    for name, about in found.files.items():
        print(f"  {Path(name).name:18} {about}")
    print(f"Next: {found.next}")
