"""``bowden sample``: simulated recordings with which every command can be tried."""

import shlex
from collections.abc import Mapping
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bowden.app.command import Command
from bowden.app.console import folder_argument, print_json, seconds
from bowden.app.next_step import say_next
from bowden.core.errors import OutputError, ParameterError
from bowden.core.files import output_folder, whole_files

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


def _folder(given: str | Path) -> Path:
    return folder_argument(given, "DIR")


def sample(
    kind: Annotated[SampleKind, typer.Argument(help="What to record.")],
    folder: Annotated[
        Path, typer.Argument(parser=_folder, metavar="DIR", help="Folder for the files; . for this one.")
    ],
    seed: Annotated[int, typer.Option(help="Of the noise; the same seed gives the same files.")] = 1,
    force: Annotated[bool, typer.Option("--force", help="Overwrite files that are there.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Write simulated recordings to try everything with, and the numbers behind them.

    cable: logs for identify and identify-servo. emg: a muscle for emg calibrate and emg score. suit: a rig with a suit
    on an arm, and the EMG that moves it in run.
    """
    output_folder(folder, "DIR")
    if not 0 <= seed < 2**32:
        raise ParameterError(f"--seed is {seed}", expected="a whole number from 0 to 4294967295")
    files = _files(kind, seed)
    there = [name for name in files if (folder / name).exists()]
    if there and not force:
        raise OutputError(
            f"{folder / there[0]} is there already", do="choose another folder, or overwrite it with --force"
        )
    with whole_files(folder) as stage:
        for name, one in files.items():
            (stage / name).write_text(one.text, encoding="utf-8")
    before = "" if folder == Path() else f"{folder}/"
    following = [word.format(before) for word in _NEXT[kind].split()]
    if json:
        written = {str(folder / name): one.about for name, one in files.items()}
        print_json({"files": written, "seed": seed, "next": shlex.join(["bowden", *following]), "seconds": seconds()})
        return
    print(f"Simulated, in {folder}:")
    for name, one in files.items():
        print(f"  {name:18} {one.about}")
    say_next(*following)


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


COMMANDS = (
    Command(
        "sample",
        sample,
        "Write simulated recordings to try everything with.",
        (
            "bowden sample cable .",
            "bowden sample emg muscle --seed 7",
            "bowden sample suit suit --json",
        ),
        place=5,
    ),
)
