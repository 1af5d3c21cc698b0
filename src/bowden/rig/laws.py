"""The laws as the command line knows them: `LAWS`, and what only the paper's bench can add to them."""

from collections.abc import Mapping
from dataclasses import replace

from bowden.control import LAWS, Law
from bowden.rig.presets import bench

KNOWN: Mapping[str, Law] = {
    **LAWS,
    # Table 1's observer, which knows the bench's cable less well than it is; `control` may not look at the paper.
    "observer": replace(LAWS["observer"], presets={**LAWS["observer"].presets, "paper": bench.observer().gains}),
}
"""Every law by its name."""
