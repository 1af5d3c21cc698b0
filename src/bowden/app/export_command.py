"""``bowden export``: a law as C99 for a microcontroller."""

import shlex
from pathlib import Path
from typing import Annotated, Any

import typer

from bowden.app.command import Command
from bowden.app.console import folder_argument, print_json, progress_bar, say_note, seconds
from bowden.app.given_rig import read_given


def _folder(given: str | Path) -> Path:
    return folder_argument(given, "--to")


def export(
    rig: Annotated[Path, typer.Argument(help="The bench, law and limits; bowden init writes one.")],
    to: Annotated[
        Path, typer.Option(parser=_folder, metavar="FOLDER", help="Folder for the code; empty, or not there.")
    ],
    law: Annotated[
        str | None, typer.Option(help="A law's name, or FILE.py:NAME of your own, in place of the rig's.")
    ] = None,
    preset: Annotated[str | None, typer.Option(help="A named set of gains of that law.")] = None,
    axis: Annotated[str | None, typer.Option(help="The axis, of a rig with several.")] = None,
    target: Annotated[
        str,
        typer.Option(help="host, cortex-m4f, cortex-m33, cortex-m7, esp32: float where hardware has no double."),
    ] = "host",
    float32: Annotated[bool, typer.Option("--float32", help="float on any target; the gate stays double.")] = False,
    emg: Annotated[bool, typer.Option("--emg", help="Export the EMG's envelope and detector too.")] = False,
    emg_rate: Annotated[float, typer.Option(help="Samples of EMG a second.")] = 2000.0,
    safety: Annotated[bool, typer.Option("--safety", help="Export the supervisor with the rig's limits too.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Export gains that fail the check on the rig, too.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Write a law as C99 that needs nothing but math.h, with a test bench that replays a run of this rig.

    The code comes from the source of the kernels that run in Python; what is outside the subset is refused with its
    line. Before anything is written, the gains are checked as bowden check does it.
    """
    from bowden.face.export import exported

    given = read_given(rig, axis).with_law(law, preset)
    with progress_bar(quiet=json) as progress:
        found = exported(
            given,
            to,
            name=rig.name,
            preset=preset,
            target=target,
            float32=float32,
            emg_rate=emg_rate if emg else None,
            safety=safety,
            force=force,
            progress=progress,
        )
    for note in found.notes:
        say_note(note)
    document = {
        "law": found.law,
        "rig": given.hash,
        "check": found.check,
        "precision": found.precision,
        "modules": list(found.modules),
        "files": [str(file) for file in found.files],
        "cortex_m4f": found.cortex_m4f,
        "seconds": seconds(),
    }
    if json:
        print_json(document)
    else:
        _print(document, to)


def _print(document: dict[str, Any], folder: Path) -> None:
    print(f"{document['law']} in {document['precision']}: {', '.join(Path(name).name for name in document['files'])}")
    cost = document["cortex_m4f"]
    if cost is None:
        print("Cortex-M4F: not measured; that needs gcc-arm-none-eabi, libnewlib-arm-none-eabi and qemu-system-arm")
    else:
        print(
            f"Cortex-M4F: {cost['code_bytes']} bytes of code, {cost['state_bytes']} of state, {cost['stack_bytes']} of "
            f"stack, {cost['instructions_mean']:.0f} instructions a cycle ({cost['instructions_max']:.0f} at most); "
            f"commands within {cost['furthest_rad']:.2g} rad of Python's"
        )
    print(f"Wrote {folder}  ({document['seconds']:.1f} s)")
    print(f"Next: {shlex.join(['make', '-C', str(folder), 'check'])}  # replays a run of the rig in C")


COMMANDS = (
    Command(
        "export",
        export,
        "Write a law as C99 for a microcontroller.",
        (
            "bowden export rig.toml --law bowden --to firmware/law",
            "bowden export rig.toml --to firmware/law --target cortex-m4f --emg --safety",
        ),
        place=120,
    ),
)
