"""``bowden export``: a law as C99 for a microcontroller."""

import subprocess
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bowden.app.console import folder_argument, output_folder, print_json, progress_bar, seconds
from bowden.app.given_rig import read_given

if TYPE_CHECKING:
    from bowden.control.law import Law
    from bowden.export.module import Module
    from bowden.rig.rig import Rig
    from bowden.safety.limits import Limits
    from bowden.sensing.detector import Detector

RECORDED = 5.0
"""Length of the run that goes with the code, at most [s]."""


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
    float32: Annotated[
        bool, typer.Option("--float32", help="float in place of double; the gate stays double.")
    ] = False,
    emg: Annotated[bool, typer.Option("--emg", help="Export the EMG's envelope and detector too.")] = False,
    emg_rate: Annotated[float, typer.Option(help="Samples of EMG a second.")] = 2000.0,
    safety: Annotated[bool, typer.Option("--safety", help="Export the supervisor with the rig's limits too.")] = False,
    force: Annotated[bool, typer.Option("--force", help="Export gains that do not hold on the rig, too.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Write a law as C99 that needs nothing but math.h, with a test bench that replays a run of this rig.

    The code comes from tracing the very kernels that run in Python; what cannot be traced is refused with its line.
    Before anything is written, the gains are checked as bowden check does it.
    """
    from bowden.core.files import whole_files
    from bowden.design.verdict import verdicts
    from bowden.sensing.detectors import detector_named

    given = read_given(rig).with_law(law, preset)
    chosen = given.fitted()
    output_folder(to, "--to")
    with progress_bar(quiet=json) as progress:
        progress("tracing the kernels", 0.0)
        modules = _modules(
            chosen, emg_rate if emg else None, detector_named(given.emg.detector), _limits(given) if safety else None
        )
        said = _said(rig.name, chosen, preset, float32=float32, turned=given.turned)
        texts = _texts(modules, chosen, given.sample_time, said, float32=float32)
        _only_ours(to, set(texts) | {"recording.csv", "replay"})
        progress(f"checking {chosen.name}", 0.3)
        verdict = verdicts(given, [chosen], rig.name, force=force)[0]
        progress(f"recording a run of {chosen.name}", 0.6)
        recording = _recording(given, chosen)
        with whole_files(to) as stage:
            for name, text in texts.items():
                (stage / name).write_text(text, encoding="utf-8")
            (stage / "recording.csv").write_text(recording, encoding="utf-8")
        progress("measuring on a Cortex-M4F", 0.8)
        figures = _figures(to, modules, recording, given.sample_time)
    for note in (*given.notes, *([verdict.note] if verdict.note else [])):
        print(f"bowden: note: {note}", file=sys.stderr)
    document = {
        "law": chosen.name,
        "rig": given.hash,
        "check": verdict.name,
        "precision": "float" if float32 else "double",
        "modules": [module.prefix for module in modules],
        "files": [str(to / name) for name in (*texts, "recording.csv")],
        "cortex_m4f": figures,
        "seconds": seconds(),
    }
    if json:
        print_json(document)
    else:
        _print(document, to)


def _modules(law: "Law", emg_rate: float | None, kind: "Detector", limits: "Limits | None") -> "list[Module]":
    """The law's module first.

    Raises:
        ParameterError: two modules of one name.
    """
    from bowden.core.errors import ParameterError
    from bowden.export.law import law_module
    from bowden.export.parts import emg_modules, safety_module

    modules = [law_module(law)]
    if emg_rate is not None:
        modules += emg_modules(emg_rate, kind)
    if limits is not None:
        modules.append(safety_module(limits))
    names = [module.prefix for module in modules]
    if len(set(names)) < len(names) or names[0] in ("replay", "math", "stdio", "stdlib", "string"):
        raise ParameterError(f"the law {law.name!r} has the name of another file", do="give it another name")
    return modules


def _limits(rig: "Rig") -> "Limits":
    _ = rig.drive_parameters  # which refuses limits that contradict one another
    return rig.supervisor_limits


def _said(rig: str, law: "Law", preset: str | None, *, float32: bool, turned: bool) -> str:
    """What the code was made from."""
    import bowden

    gains = f" with the preset {preset}" if preset else ""
    kind = "float" if float32 else "double"
    other_way = " Motor angles are counted the other way round, since the cable's slope is negative." if turned else ""
    return f"Written by bowden {bowden.__version__}: the law {law.name}{gains} for {rig}, in {kind}.{other_way}"


def _texts(modules: "list[Module]", law: "Law", period: float, said: str, *, float32: bool) -> dict[str, str]:
    """Name → text of every file but the recording."""
    from bowden.export.code import Style
    from bowden.export.module import files
    from bowden.export.readme import makefile, readme
    from bowden.export.replay import replay_source

    texts: dict[str, str] = {}
    for module in modules:
        single = float32 and module.prefix != "safety"  # whose set of faults needs 37 bits
        texts |= files(module, Style(module.prefix, single), said)
    return texts | {
        "replay.c": replay_source(law, period, single=float32),
        "Makefile": makefile(modules[0].prefix),
        "README.md": readme(modules[0], modules[1:], said, period, single=float32),
    }


def _only_ours(folder: Path, names: set[str]) -> None:
    """Refuse a folder in which other things are than an earlier export of the same law.

    Raises:
        OutputError: there are.
    """
    from bowden.core.errors import OutputError

    others = sorted(path.name for path in folder.iterdir() if path.name not in names) if folder.is_dir() else []
    if others:
        more = f" and {len(others) - 1} more" if others[1:] else ""
        raise OutputError(
            f"{folder} holds other files: {others[0]}{more}", expected="an empty folder", do="choose another with --to"
        )


def _recording(rig: "Rig", law: "Law") -> str:
    """A simulated run of the rig as CSV, with the columns of a live run's log, up to where the law runs away."""
    import numpy as np

    from bowden.control import user_law
    from bowden.export.replay import COLUMNS
    from bowden.sim.run import simulate

    duration = min(RECORDED, rig.duration)
    with user_law.explained(law):
        trace = simulate(
            rig.cabled,
            law,
            rig.trajectory,
            duration=duration,
            bend=rig.bend_path,
            seed=rig.seed,
            initial_motor=rig.start_motor,
        )
    references = rig.trajectory.sample(trace.time).T
    lasted = int(np.isfinite(trace["command"]).cumprod().sum())
    source = np.where(np.arange(lasted) == 0, 2.0, 3.0)  # `cycle.one_cycle.WishSource`
    values = (trace["time"], trace["joint_measured"], trace["motor_measured"], *references, trace["command"])
    rows = np.column_stack([*(column[:lasted] for column in values), source]).tolist()
    lines = [",".join(("time", *COLUMNS)), *(",".join(map(repr, row)) for row in rows)]
    return "\n".join(lines) + "\n"


def _figures(folder: Path, modules: "list[Module]", recording: str, period: float) -> dict[str, float] | None:
    """What the law costs on a Cortex-M4F; None where the tools to measure it are not installed."""
    from bowden.export import cortex

    if cortex.tools():
        return None
    prefix = modules[0].prefix
    rows = [[float(cell) for cell in line.split(",")[1:7]] for line in recording.splitlines()[1:]]
    texts = {f"{prefix}{end}": (folder / f"{prefix}{end}").read_text(encoding="utf-8") for end in (".h", ".c")}
    try:
        cost = cortex.measure(prefix, texts, [row[:5] for row in rows], period)
    except (OSError, subprocess.SubprocessError, ValueError) as error:  # a compiler without its library, say
        print(f"bowden: note: not measured on a Cortex-M4F: {' '.join(str(error).split())[:300]}", file=sys.stderr)
        return None
    return {
        "code_bytes": cost.code_bytes,
        "state_bytes": cost.state_bytes,
        "stack_bytes": cost.stack_bytes,
        "instructions_mean": round(cost.instructions_mean, 1),
        "instructions_max": cost.instructions_max,
        "furthest_rad": max(abs(command - row[5]) for command, row in zip(cost.commands, rows, strict=True)),
    }


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
    print(f"make -C {folder} check replays a run of the rig  ({document['seconds']:.1f} s)")
