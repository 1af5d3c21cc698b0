"""`export`: a law as C99 for a microcontroller."""

import subprocess
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

import bowden
from bowden.control import Law, user_law
from bowden.core import arguments
from bowden.core.errors import OutputError, ParameterError, near
from bowden.core.files import output_folder, whole_files
from bowden.design.forecast import off_reference
from bowden.design.verdict import verdicts
from bowden.drawing import shown
from bowden.face import given
from bowden.face.given import GivenLaw, GivenRig
from bowden.rig.rig import Rig
from bowden.safety.limits import Limits
from bowden.sensing.detectors import detector_named

if TYPE_CHECKING:
    from bowden.export.unit import Module
    from bowden.rig.counts import Counts

RECORDED = 5.0
"""Length of the run that goes with the code, at most [s]."""
Progress = Callable[[str, float], None]


@dataclass(frozen=True, repr=False)
class Exported:
    """What was written."""

    law: str
    """Its name."""
    files: tuple[Path, ...]
    """All files; ``make check`` in their folder replays a run of the rig."""
    modules: tuple[str, ...]
    """The law first; then what else was asked for."""
    precision: str
    """``double`` or ``float``."""
    check: str | None
    """Verdict of `bowden.check` on the gains; None where it cannot judge the law."""
    cortex_m4f: dict[str, float] | None
    """What the law costs on a Cortex-M4F; None where the tools to measure it are not installed."""
    notes: tuple[str, ...]
    """What the user should know."""

    def __repr__(self) -> str:
        """One screen: the law, its files, and what it costs."""
        cost = "" if self.cortex_m4f is None else ", ".join(f"{k} {v:.6g}" for k, v in self.cortex_m4f.items())
        rows = [
            ("folder", str(self.files[0].parent)),
            ("files", ", ".join(file.name for file in self.files)),
            ("check", self.check or ""),
            ("Cortex-M4F", cost),
        ]
        return shown.screen(f"Export of {self.law} in {self.precision}", rows)


def export(
    rig: GivenRig,
    folder: str | Path,
    law: GivenLaw | None = None,
    *,
    preset: str | None = None,
    target: str = "host",
    float32: bool = False,
    emg_rate: float | None = None,
    safety: bool = False,
    force: bool = False,
) -> Exported:
    """Write a law as C99 that needs nothing but math.h, with a test bench that replays a run of this rig.

    The code comes from the source of the very kernels that run in Python. Before anything is written, the gains are
    checked as `bowden.check` does it.

    Args:
        rig: a `Rig`, or the path of a rig.toml.
        folder: for the code; empty, not there, or with an earlier export of the same law.
        law: a key of `LAWS`, ``FILE.py:NAME`` or a `Law`; the rig's by default.
        preset: a named set of gains of that law.
        target: what the code is for: ``cortex-m4f``, ``cortex-m33`` and ``esp32`` get float, ``cortex-m7`` and ``host``
            double, as their hardware has it.
        float32: float on any target; the supervisor stays double.
        emg_rate: export the EMG's envelope and detector too, for this many samples a second.
        safety: export the supervisor with the rig's limits too.
        force: export gains that do not hold, too.

    Returns:
        The files, and what the law costs on a Cortex-M4F where the tools to measure it are installed.

    Raises:
        ParameterError: a rig or law that cannot be used or does not hold, or a kernel outside the subset, with its
            line.
        OutputError: a folder that cannot be written, or holds other things.

    >>> import tempfile
    >>> found = export(Rig(duration=2.0), tempfile.mkdtemp(), "uncompensated")
    >>> sorted(file.name for file in found.files)[-1]
    'uncompensated.h'
    """
    whole = given.under(given.rig_of(rig, "export"), law, preset, "export")
    to = arguments.path_of(folder, "export: folder", "folder")
    flags = {"float32": float32, "safety": safety, "force": force}
    float32, safety, force = (arguments.flag(value, f"export: {name}") for name, value in flags.items())
    rate = None if emg_rate is None else arguments.number(emg_rate, "export: emg_rate", "samples a second")
    with given.in_words_of_python():
        found = exported(
            whole,
            to,
            name=given.name_of(whole),
            preset=preset,
            target=arguments.text(target, "export: target", "the name of a target"),
            float32=float32,
            emg_rate=rate,
            safety=safety,
            force=force,
        )
    given.tell(found.notes)
    return found


def exported(
    rig: Rig,
    folder: Path,
    *,
    name: str,
    preset: str | None,
    target: str,
    float32: bool,
    emg_rate: float | None,
    safety: bool,
    force: bool,
    progress: Progress = lambda what, share: None,
) -> Exported:
    """The export of a rig's own law; see `export`. `name` is the rig's, for messages and for the files."""
    law = rig.fitted()
    output_folder(folder, "--to")
    progress("reading the kernels", 0.0)
    from bowden.export.readme import TARGETS
    from bowden.rig.counts import counts_of, guessed

    if target not in TARGETS:
        raise ParameterError(f"there is no target {target!r}", expected=near(target, TARGETS), do="correct --target")
    float32 = float32 or TARGETS[target]

    counts, doubt = counts_of(rig), guessed(rig)
    modules = _modules(rig, law, counts, emg_rate, safety=safety)
    said = _said(name, law, preset, float32=float32, counts=counts) + (f" Beware: {doubt}." if doubt else "")
    texts = _texts(modules, law, counts, rig.sample_time, said, float32=float32)
    _only_ours(folder, set(texts) | {"recording.csv", "replay"})
    progress(f"checking {law.name}", 0.3)
    verdict = verdicts(rig, [law], name, force=force)[0]
    progress(f"recording a run of {law.name}", 0.6)
    recording = _recording(rig, law)
    with whole_files(folder) as stage:
        for file, text in texts.items():
            (stage / file).write_text(text, encoding="utf-8")
        (stage / "recording.csv").write_text(recording, encoding="utf-8")
    progress("measuring on a Cortex-M4F", 0.8)
    figures = _figures(folder, modules, recording)
    notes = (doubt, *rig.notes, verdict.note, figures if isinstance(figures, str) else "")
    return Exported(
        law=law.name,
        files=tuple(folder / file for file in (*texts, "recording.csv")),
        modules=tuple(module.prefix for module in modules),
        precision="float" if float32 else "double",
        check=verdict.name,
        cortex_m4f=None if isinstance(figures, str) else figures,
        notes=tuple(note for note in notes if note),
    )


def _modules(rig: Rig, law: Law, counts: "Counts | None", emg_rate: float | None, *, safety: bool) -> "list[Module]":
    """The law's module first.

    Raises:
        ParameterError: two modules of one name.
    """
    from bowden.export.law import law_module
    from bowden.export.parts import emg_modules, safety_module

    modules = [law_module(law, rig.sample_time, counts)]
    if emg_rate is not None:
        modules += emg_modules(emg_rate, detector_named(rig.emg.detector))
    if safety:
        modules.append(safety_module(_limits(rig, law)))
    names = [module.prefix for module in modules]
    if len(set(names)) < len(names) or names[0] in ("replay", "math", "stdio", "stdlib", "string"):
        raise ParameterError(f"the law {law.name!r} has the name of another file", do="give it another name")
    return modules


def _limits(rig: Rig, law: Law) -> Limits:
    _ = rig.drive_parameters  # which refuses limits that contradict one another
    return rig.supervisor_limits._replace(off_reference=off_reference(rig, law))


def _said(rig: str, law: Law, preset: str | None, *, float32: bool, counts: "Counts | None") -> str:
    """What the code was made from."""
    gains = f" with the preset {preset}" if preset else ""
    kind = "float" if float32 else "double"
    angles = "" if counts is None else f" {counts.notes()}"
    return f"Written by bowden {bowden.__version__}: the law {law.name}{gains} for {rig}, in {kind}.{angles}"


def _texts(
    modules: "list[Module]", law: Law, counts: "Counts | None", period: float, said: str, *, float32: bool
) -> dict[str, str]:
    """Name → text of every file but the recording."""
    from bowden.export.kinds import Style
    from bowden.export.readme import arduino, makefile, readme
    from bowden.export.replay import replay_source
    from bowden.export.unit import files

    texts: dict[str, str] = {}
    for module in modules:
        single = float32 and module.prefix != "safety"  # whose set of faults has more bits than a float
        texts |= files(module, Style(module.prefix, single), said)
    return texts | {
        "replay.c": replay_source(law, single=float32),
        **arduino(modules[0].prefix, counts, period),
        "Makefile": makefile([module.prefix for module in modules]),
        "README.md": readme(modules[0], modules[1:], counts, said, period, single=float32),
    }


def _only_ours(folder: Path, names: set[str]) -> None:
    """Refuse a folder in which other things are than an earlier export of the same law.

    Raises:
        OutputError: there are.
    """
    others = sorted(path.name for path in folder.iterdir() if path.name not in names) if folder.is_dir() else []
    if others:
        more = f" and {len(others) - 1} more" if others[1:] else ""
        raise OutputError(
            f"{folder} holds other files: {others[0]}{more}", expected="an empty folder", do="choose another with --to"
        )


def _recording(rig: Rig, law: Law) -> str:
    """A simulated run of the rig as CSV, with the columns of a live run's log, up to where the law runs away."""
    from bowden.export.replay import COLUMNS
    from bowden.sim.run import simulate

    duration = min(RECORDED, rig.duration)
    with user_law.explained(law):
        trace = simulate(
            rig.moved,
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


def _figures(folder: Path, modules: "list[Module]", recording: str) -> dict[str, float] | str | None:
    """What the law costs on a Cortex-M4F; or a note where a tool to measure it fails, and None where none is there."""
    from bowden.export import cortex

    if cortex.tools():
        return None
    prefix = modules[0].prefix
    rows = [[float(cell) for cell in line.split(",")[1:7]] for line in recording.splitlines()[1:]]
    texts = {f"{prefix}{end}": (folder / f"{prefix}{end}").read_text(encoding="utf-8") for end in (".h", ".c")}
    try:
        cost = cortex.measure(prefix, texts, [row[:5] for row in rows])
    except (OSError, subprocess.SubprocessError, ValueError) as error:  # a compiler without its library, say
        return f"not measured on a Cortex-M4F: {' '.join(str(error).split())[:300]}"
    return {
        "code_bytes": cost.code_bytes,
        "state_bytes": cost.state_bytes,
        "stack_bytes": cost.stack_bytes,
        "instructions_mean": round(cost.instructions_mean, 1),
        "instructions_max": cost.instructions_max,
        "furthest_rad": max(abs(command - row[5]) for command, row in zip(cost.commands, rows, strict=True)),
    }
