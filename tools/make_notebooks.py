"""Execute the notebooks of docs/notebooks again and keep their outputs: ``make notebooks``.

    python tools/make_notebooks.py                       # all, in place
    python tools/make_notebooks.py --to FOLDER NAME      # one, written to a folder

A kept output has nothing in it that changes without a change of the code: no file of this machine, no time, no version.
"""

import argparse
import re
import tempfile
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = ROOT / "docs" / "notebooks"
LONGEST = 300
"""A cell that takes longer has failed [s]."""
_PLACE = re.compile(r"^\S*ipykernel_\S*:\d+: ", re.MULTILINE)
"""Where Python says a warning comes from: a file of this run alone."""


def executed(path: Path) -> Any:
    """The notebook, executed from its first cell to its last in an empty folder.

    Raises:
        CellExecutionError: a cell failed.
    """
    import nbformat
    from nbclient import NotebookClient

    notebook = nbformat.read(path, as_version=4)
    with tempfile.TemporaryDirectory() as folder, tempfile.TemporaryDirectory() as sockets:
        resources = {"metadata": {"path": folder}}
        client = NotebookClient(
            notebook, timeout=LONGEST, record_timing=False, coalesce_streams=True, resources=resources
        )
        manager = client.create_kernel_manager()
        manager.transport, manager.ip = "ipc", f"{sockets}/kernel"  # files, in place of ports of the network
        client.execute()
    clean(notebook)
    return notebook


def clean(notebook: Any) -> None:
    """Leave out what differs from run to run and from machine to machine."""
    notebook.metadata.language_info = {"name": "python"}
    for cell in notebook.cells:
        cell.metadata = {}
        for output in cell.get("outputs", ()):
            if output.output_type == "stream":
                output.text = _PLACE.sub("", output.text)


def main() -> None:
    """Execute all notebooks, or those that are named."""
    import nbformat

    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("names", nargs="*", help="without .ipynb; all by default")
    parser.add_argument("--to", type=Path, default=NOTEBOOKS, help="folder to write to")
    given = parser.parse_args()
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        if given.names and path.stem not in given.names:
            continue
        notebook = executed(path)
        nbformat.validate(notebook)
        nbformat.write(notebook, given.to / path.name)
        print(f"{path.stem}: {len(notebook.cells)} cells")


if __name__ == "__main__":
    main()
