"""Write what the documentation has from the code: `make docs`."""

from pathlib import Path

import commands_page
import results_page
import rig_page
import safety_page

DOCS = Path(__file__).parents[1] / "docs"

if __name__ == "__main__":
    for page in (rig_page, commands_page, safety_page, results_page):
        page.write_docs(DOCS)
