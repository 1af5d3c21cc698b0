"""A wearer's levels, in a terminal and in a file."""

from pathlib import Path

from bowden.core.errors import note
from bowden.operations.emg_calibrate import EmgCalibration
from bowden.views.text import Call


def write_emg_calibrate(found: EmgCalibration, call: Call, *, out: Path = Path("wearer.toml")) -> list[Path]:
    """Write the levels.

    Args:
        found: the levels.
        call: of the command.
        out: file to write.
    """
    from bowden.sensing import wearer_file

    wearer_file.write(out, found.value)
    return [out]


def show_emg_calibrate(found: EmgCalibration, call: Call) -> None:
    """Both levels, and what was left out for them."""
    for text in found.little:
        note(text)
    unit = f"envelopes, in the unit of {found.channel}"
    print(f"rest {found.rest:.4g}, MVC {found.mvc:.4g} ({unit}) → {call['out']}")
