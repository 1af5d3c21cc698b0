"""`export`: a law as C99 for a microcontroller."""

import subprocess
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from bowden.core.documented import Documented
from bowden.operations.check import Verdict
from bowden.operations.support.operation import GivenLaw, GivenRig, Operation, Role, Switch
from bowden.operations.support.results import Result

if TYPE_CHECKING:
    from collections.abc import Callable

    from bowden.control import Law
    from bowden.export.module import Module
    from bowden.rig.counts import Counts
    from bowden.rig.rig import Rig
    from bowden.safety.limits import Limits

RECORDED = 5.0
"""Length of the run that goes with the code, at most [s]."""
_MARK = b"Written by bowden"
"""In the beginning of what an export writes: of its README.md, and of each file of the law."""
_HEAD = 500
"""Of a file, in which that stands [bytes]."""


@dataclass(frozen=True)
class CortexCost(Documented):
    """Costs of a law on a microcontroller."""

    code_bytes: int
    """The law's own functions and constants, without those of the C library [bytes]."""
    state_bytes: int
    """Its state [bytes]."""
    stack_bytes: int
    """Most stack that a step needs below its caller, the library's functions included [bytes]."""
    instructions_mean: float
    """Instructions of a cycle, mean over the run."""
    instructions_max: float
    """Most instructions of a cycle, to within 40."""
    furthest_rad: float
    """Largest distance of a command from Python's [rad]."""


@dataclass(frozen=True, repr=False)
class Exported(Result["Exported"]):
    """A law as C."""

    rig: str
    """Hash of the rig: equal rigs have the same, whether they come from a file, Python or a log."""
    law: str
    """Name of the law."""
    check: Verdict | None
    """What bowden check says of it on this rig; null where it cannot judge the law."""
    precision: Literal["double", "float"]
    """Type of the law's and the detector's numbers; the safety gate's is double."""
    modules: tuple[str, ...]
    """What was exported, by the name that its files, types and functions begin with; the law first."""
    files: tuple[Path, ...]
    """All files that were written; ``make check`` in their folder replays a run of the rig."""
    cortex_m4f: CortexCost | None
    """The law on an emulated Cortex-M4F over the recorded run; null where the cross compiler or the emulator is not
    installed."""

    def __repr__(self) -> str:
        """One screen."""
        from bowden.drawing.shown import screen

        names = ", ".join(file.name for file in self.files)
        folder = self.files[0].parent
        return screen(
            f"{self.law} as C, in {self.precision}",
            [("check", str(self.check)), ("files", names), ("next", f"make -C {folder} check")],
        )


def export(
    rig: GivenRig,
    folder: Annotated[Path, Switch(name="--to", metavar="FOLDER")],
    law: GivenLaw | None = None,
    *,
    preset: str | None = None,
    motor: str | None = None,
    target: str = "host",
    float32: bool = False,
    emg: bool = False,
    emg_rate: float | None = None,
    safety: bool = False,
    force: bool = False,
    progress: Annotated["Callable[[str, float], None] | None", Switch(Role.PROGRESS)] = None,
) -> Exported:
    """Write a law as C99 for a microcontroller: it needs nothing but math.h.

    A test bench beside it replays a run of this rig. The code comes from the source of the kernels that run in Python;
    what is outside the subset is refused with its line. Before anything is written, the gains are checked as by
    `check`.

    Args:
        rig: the bench, law and limits; ``bowden init`` writes one.
        folder: for the code; new, empty, or with an earlier export of the same law.
        law: a law's name, or FILE.py:NAME of your own, in place of the rig's.
        preset: a named set of gains of that law.
        motor: the motor, of a rig with several.
        target: one of host, cortex-m4f, cortex-m33, cortex-m7, esp32; ``float`` where the hardware has no ``double``.
        float32: use ``float`` on any target.
        emg: export the EMG's envelope and detector too.
        emg_rate: samples of EMG a second, 2000 by default; with it they are exported.
        safety: export the supervisor with the rig's limits too.
        force: export gains that fail the check on the rig, and limits with which a run is refused, too.
        progress: a function of what is being done and the share done.

    Returns:
        The files, and what the law costs on a Cortex-M4F where the tools to measure it are installed.

    Raises:
        ParameterError: a rig or law that cannot be used or does not hold, or a kernel outside the subset, with its
            line.
        OutputError: a folder that cannot be written, or holds other things.

    >>> import tempfile
    >>> from bowden import Rig, export
    >>> found = export(Rig(duration=2.0), tempfile.mkdtemp(), "uncompensated")
    >>> sorted(file.name for file in found.files)[-1]
    'uncompensated.h'
    """
    from bowden.core.caller import argument
    from bowden.core.errors import ParameterError, near
    from bowden.core.files import output_folder, whole_files
    from bowden.design.objections import refusals
    from bowden.design.verdict import verdicts
    from bowden.export.readme import TARGETS, YOURS
    from bowden.operations.support import given
    from bowden.operations.support.progress import reported
    from bowden.rig.counts import counts_of, guessed

    whole = given.under(given.rig_of(rig).only(motor), law, preset)
    own, name = whole.fitted(), given.name_of(whole)
    refused = refusals(given.rig_of(rig))
    if refused and safety and not force:
        raise ParameterError(
            f"the limits of the supervisor are not exported: {refused[0]}",
            do=f"or export them anyway with {argument('force', True)}",
        )
    output_folder(folder, argument("folder"))
    if target not in TARGETS:
        do = f"correct {argument('target')}"
        raise ParameterError(f"there is no target {target!r}", expected=near(target, TARGETS), do=do)
    float32 = float32 or TARGETS[target]
    counts, doubt = counts_of(whole), guessed(whole)
    modules = _modules(whole, own, counts, (emg_rate or 2000.0) if emg or emg_rate else None, safety=safety)
    said = _said(name, own, preset, float32=float32, counts=counts) + (f" Beware: {doubt}." if doubt else "")
    if whole.worn is None and whole.plant is None:
        said += f" Its gains are judged for {whole.servo_text}."
    texts = _texts(modules, own, counts, whole.sample_time, said, float32=float32)
    _only_ours(folder, set(texts) | {"recording.csv", "replay"})
    kept = [name for name in YOURS if (folder / name).exists()]
    texts = {name: text for name, text in texts.items() if name not in kept}
    with reported(progress, "export") as report:
        report(f"checking {own.name}", 0.3)
        verdict = verdicts(whole.each_joint[0], [[own]], name, force=force)[0]
        report(f"recording a run of {own.name}", 0.6)
        recording = _recording(whole, own)
        with whole_files(folder) as stage:
            for file, text in texts.items():
                (stage / file).write_text(text, encoding="utf-8")
            (stage / "recording.csv").write_text(recording, encoding="utf-8")
        report("measuring on a Cortex-M4F", 0.8)
        figures = _figures(folder, modules, recording)
    notes = (
        doubt,
        f"{' and '.join(kept)} in {folder} stay as they are: they are yours" if kept else "",
        *whole.notes,
        *refused,
        verdict.note,
        figures if isinstance(figures, str) else "",
    )
    return Exported(
        rig=whole.hash,
        law=own.name,
        check=verdict.name,
        precision="float" if float32 else "double",
        modules=tuple(module.prefix for module in modules),
        files=tuple(folder / file for file in (*texts, "recording.csv")),
        cortex_m4f=None if isinstance(figures, str) else figures,
        notes=tuple(note for note in notes if note),
    )


def _modules(
    rig: "Rig", law: "Law", counts: "Counts | None", emg_rate: float | None, *, safety: bool
) -> "list[Module]":
    """The law's module first.

    Raises:
        ParameterError: two modules of one name.
    """
    from bowden.core.errors import ParameterError
    from bowden.export.law import law_module
    from bowden.export.parts import emg_modules, safety_module
    from bowden.sensing.detectors import detector_named

    modules = [law_module(law, rig.sample_time, counts)]
    if emg_rate is not None:
        modules += emg_modules(emg_rate, detector_named(rig.emg.detector))
    if safety:
        modules.append(safety_module(_limits(rig, law)._replace(uses_emg=emg_rate is not None)))
    names = [module.prefix for module in modules]
    if len(set(names)) < len(names) or names[0] in ("replay", "math", "stdio", "stdlib", "string"):
        raise ParameterError(f"the law {law.name!r} has the name of another file", do="give it another name")
    return modules


def _limits(rig: "Rig", law: "Law") -> "Limits":
    from bowden.design.forecast import off_reference

    _ = rig.drive_parameters  # which refuses limits that contradict one another
    return rig.supervisor_limits._replace(off_reference=off_reference(rig, law))


def _said(rig: str, law: "Law", preset: str | None, *, float32: bool, counts: "Counts | None") -> str:
    """What the code was made from."""
    import bowden

    gains = f" with the preset {preset}" if preset else ""
    kind = "float" if float32 else "double"
    angles = "" if counts is None else f" {counts.notes()}"
    return f"{_MARK.decode()} {bowden.__version__}: the law {law.name}{gains} for {rig}, in {kind}.{angles}"


def _texts(
    modules: "list[Module]", law: "Law", counts: "Counts | None", period: float, said: str, *, float32: bool
) -> dict[str, str]:
    """Name → text of every file but the recording."""
    from bowden.export.files import files
    from bowden.export.readme import pages

    texts: dict[str, str] = {}
    for module in modules:
        single = float32 and module.prefix != "safety"  # whose set of faults has more bits than a float
        texts |= files(module, said, single=single)
    return texts | pages(modules, law, counts, said, period, single=float32)


def _only_ours(folder: Path, names: set[str]) -> None:
    """Refuse a folder that is neither empty nor an earlier export of the same law; files of one's own beside that stay.

    Raises:
        OutputError: it is.
    """
    from bowden.core.caller import argument
    from bowden.core.errors import OutputError

    there = sorted(path.name for path in folder.iterdir()) if folder.is_dir() else []
    earlier = _written(folder / "README.md")
    others = [name for name in there if not earlier or (name not in names and _written(folder / name))]
    if others:
        more = f" and {len(others) - 1} more" if others[1:] else ""
        raise OutputError(
            f"{folder} holds {'another export' if earlier else 'other files'}: {others[0]}{more}",
            expected="an empty folder, or one of an earlier export of this law",
            do=f"choose another with {argument('folder')}",
        )


def _written(file: Path) -> bool:
    """True if an export has written it."""
    return file.is_file() and _MARK in file.read_bytes()[:_HEAD]


def _recording(rig: "Rig", law: "Law") -> str:
    """A simulated run of the rig as CSV, with the columns of a live run's log, up to where the law runs away."""
    import numpy as np

    from bowden.control import user_law
    from bowden.export.readme import COLUMNS
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
    source = np.where(np.arange(lasted) == 0, 2.0, 3.0)  # `cycle.one_cycle.TargetSource`
    values = (trace["time"], trace["joint_measured"], trace["motor_measured"], *references, trace["command"])
    rows = np.column_stack([*(column[:lasted] for column in values), source]).tolist()
    lines = [",".join(("time", *COLUMNS)), *(",".join(map(repr, row)) for row in rows)]
    return "\n".join(lines) + "\n"


def _figures(folder: Path, modules: "list[Module]", recording: str) -> CortexCost | str | None:
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
    furthest = max(abs(command - row[5]) for command, row in zip(cost.commands, rows, strict=True))
    return CortexCost(
        *(cost.code_bytes, cost.state_bytes, cost.stack_bytes),
        *(round(cost.instructions_mean, 1), cost.instructions_max, furthest),
    )


OPERATIONS = (
    Operation(
        "export",
        export,
        (
            "bowden export rig.toml --law bowden --to firmware/law",
            "bowden export rig.toml --to firmware/law --target cortex-m4f --emg --safety",
        ),
        place=120,
    ),
)
