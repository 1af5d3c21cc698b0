"""The rig that a command is given: a rig.toml, or the log of a run."""

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from bowden.rig.rig import Rig


def read_given(path: Path) -> "Rig":
    """The rig of a rig.toml, or of a log (``.mcap``), which holds the one that it ran with.

    Raises:
        ParameterError: a file, key or value that cannot be used.
        LogError: a log without a rig.
    """
    if path.suffix == ".mcap":
        from bowden.live.log_rig import rig_of_log

        return rig_of_log(path)
    from bowden.rig.rig import Rig

    return Rig.read(path)


def shortened(rig: "Rig", duration: float | None, seed: int | None = None) -> "Rig":
    """The rig with what the command line says in place of its own."""
    changes = {"duration": duration, "seed": seed}
    given = {name: value for name, value in changes.items() if value is not None}
    return rig.replace(**given) if given else rig
