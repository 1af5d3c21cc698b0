"""`sample`: simulated recordings with which every operation can be tried."""

import shlex
from collections.abc import Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from bowden.operations.support.operation import Operation, Switch
from bowden.operations.support.results import Result

if TYPE_CHECKING:
    from bowden.sim.samples.files import SampleFile


class SampleKind(StrEnum):
    """What is recorded."""

    CABLE = "cable"
    EMG = "emg"
    SUIT = "suit"


_NEXT = {
    SampleKind.CABLE: "identify {}log.csv",
    SampleKind.EMG: "emg calibrate {0}mvc.csv --rest {0}rest.csv",
    SampleKind.SUIT: "run {0}suit.toml --twin --auto --emg file:{0}biceps.csv",
}
"""The command to go on with; the folder goes before each file."""


@dataclass(frozen=True)
class SampleRecordings(Result["SampleRecordings"]):
    """Recordings, and the numbers behind them."""

    files: dict[str, str]
    """Path of each file that was written → what it is; the last one has the numbers behind the others."""
    seed: int
    """Seed of the noise."""
    next: str
    """The command to go on with."""


def sample(
    kind: SampleKind,
    folder: Annotated[Path, Switch(metavar="FOLDER")],
    *,
    seed: int = 1,
    force: bool = False,
) -> SampleRecordings:
    """Write simulated recordings to try the commands with.

    cable: logs for identify and identify-servo. emg: a muscle for emg calibrate and emg score. suit: a rig with a suit
    on an arm, and the EMG that moves it in run.

    Args:
        kind: what to record.
        folder: for the files; . for this one.
        seed: seed of the noise; the same seed gives the same files.
        force: overwrite files that are there.

    Raises:
        ParameterError: a seed that cannot be.
        OutputError: files that are there already.

    Examples:
        bowden sample cable .
        bowden sample emg muscle --seed 7
        bowden sample suit suit --json
    """
    from bowden.core.caller import argument
    from bowden.core.errors import OutputError, ParameterError
    from bowden.core.files import whole_files

    if not 0 <= seed < 2**32:
        raise ParameterError(
            f"{argument('seed').rstrip('=')} is {seed}", expected="a whole number from 0 to 4294967295"
        )
    files = _files(kind, seed)
    there = [name for name in files if (folder / name).exists()]
    if there and not force:
        do = f"choose another folder, or overwrite it with {argument('force', True)}"
        raise OutputError(f"{folder / there[0]} is there already", do=do)
    with whole_files(folder) as stage:
        for name, one in files.items():
            (stage / name).write_text(one.text, encoding="utf-8")
    before = "" if folder == Path() else f"{folder}/"
    following = [word.format(before) for word in _NEXT[kind].split()]
    written = {str(folder / name): one.about for name, one in files.items()}
    return SampleRecordings(written, seed, shlex.join(["bowden", *following]))


def _files(kind: SampleKind, seed: int) -> "Mapping[str, SampleFile]":
    if kind is SampleKind.CABLE:
        from bowden.sim.samples.cable import cable_files

        return cable_files(seed)
    from bowden.sim.samples.emg import emg_files, suit_files

    if kind is SampleKind.EMG:
        return emg_files(seed)
    from bowden.design import rig_of_suit as suit_rig
    from bowden.sim.samples.files import SampleFile

    rig = SampleFile(suit_rig.suit_text("suit.toml"), "a suit on an arm, as bowden init --suit writes it")
    return {"suit.toml": rig} | suit_files(seed)


OPERATIONS = (Operation("sample", sample, 5),)
