"""`export`: a law as C99 for a microcontroller."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from bowden.operations.check import Verdict
from bowden.operations.support.operation import GivenLaw, GivenRig, Operation, Role, Switch
from bowden.operations.support.results import Result

if TYPE_CHECKING:
    from collections.abc import Callable

    from bowden.control import Law
    from bowden.export.unit import Module
    from bowden.models.suit.suit_angle import SpoolMap
    from bowden.rig.counts import Counts
    from bowden.rig.rig import Rig
    from bowden.safety.limits import Limits

RECORDED = 5.0
"""Length of the run that goes with the code, at most [s]."""
_MARK = "Written by bowden"
"""In the first 500 bytes of what an export writes: of its README.md, and of each file of the law."""
_TAKEN = ("replay", "loop", "board", "arduino", "math", "stdio", "stdlib", "string")
"""Names of files, which no law's may be."""


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
    """Type of the law's and the detector's numbers; the supervisor's is double."""
    modules: tuple[str, ...]
    """What was exported, by the name that its files, types and functions begin with; the law first."""
    files: tuple[Path, ...]
    """All files that were written; ``make check`` in their folder replays a run of the rig."""

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
        emg: let contractions move the reference, as `[emg]` of the rig says.
        emg_rate: samples of EMG a second, 2000 by default; with it contractions move the reference.
        force: export gains that fail the check on the rig, and limits with which a run is refused, too.
        progress: a function of what is being done and the share done.

    Returns:
        The files.

    Raises:
        ParameterError: a rig or law that cannot be used or does not hold, or a kernel outside the subset, with its
            line.
        OutputError: a folder that cannot be written, or holds other things.

    Examples:
        bowden export rig.toml --law bowden --to firmware/law
        bowden export rig.toml --to firmware/law --target cortex-m4f --emg

    >>> import tempfile
    >>> from bowden import Rig, export
    >>> found = export(Rig(duration=2.0), tempfile.mkdtemp(), "uncompensated")
    >>> sorted(file.name for file in found.files)[-1]
    'uncompensated.h'
    """
    import bowden
    from bowden.core.caller import argument
    from bowden.core.errors import ParameterError, near
    from bowden.core.files import output_folder, whole_files
    from bowden.design.objections import refusals
    from bowden.design.verdict import verdicts
    from bowden.export.files import TARGETS, YOURS, files, pages
    from bowden.operations.support import given
    from bowden.operations.support.progress import reported
    from bowden.rig.counts import Counts, counts_of, guessed
    from bowden.rig.notes import NO_SOURCE

    whole = given.under(given.rig_of(rig).only(motor), law, preset)
    own, name = whole.fitted(), given.name_of(whole)
    refused = refusals(given.rig_of(rig))
    if refused and not force:
        raise ParameterError(refused[0], do=f"or export it anyway with {argument('force', True)}")
    output_folder(folder, argument("folder"))
    if target not in TARGETS:
        do = f"correct {argument('target')}"
        raise ParameterError(f"there is no target {target!r}", expected=near(target, TARGETS), do=do)
    hardware = TARGETS[target]
    float32 = float32 or hardware.single
    encoders, doubt, rate = counts_of(whole), guessed(whole), emg_rate or 2000.0
    modules = _modules(whole, own, encoders, rate if emg or emg_rate else None)
    precision: Literal["double", "float"] = "float" if float32 else "double"
    gains = f" with the preset {preset}" if preset else ""
    preamble = f"{_MARK} {bowden.__version__}: the law {own.name}{gains} for {name}, in {precision}."
    preamble += f" {encoders.notes()}" if isinstance(encoders, Counts) else ""
    preamble += f" Beware: {doubt}." if doubt else ""
    if whole.worn is None and whole.plant is None:
        preamble += f" Its gains are judged for {whole.servo_text}."
    texts = pages(whole, modules, encoders, preamble, rate, hardware, single=float32)
    for module in modules:
        single = float32 and module.prefix not in (
            "safety",
            "joint",
        )  # what it adds up over minutes needs more than a float
        texts |= files(module, preamble, single=single)
    _only_ours(folder, set(texts) | {"recording.csv", "replay"})
    kept = [name for name in YOURS if (folder / name).exists()]
    board = f"board = {hardware.board}"
    other = "platformio.ini" in kept and board not in (folder / "platformio.ini").read_text(encoding="utf-8")
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
    notes = (
        doubt,
        f"{' and '.join(kept)} in {folder} stay as they are: they are yours" if kept else "",
        f"platformio.ini names another board than one for {target} ({board}): see that it has this processor"
        if other
        else "",
        *(note for note in whole.notes if note != NO_SOURCE or not (emg or emg_rate)),
        *refused,
        verdict.note,
    )
    return Exported(
        rig=whole.hash,
        law=own.name,
        check=verdict.name,
        precision=precision,
        modules=tuple(module.prefix for module in modules),
        files=tuple(folder / file for file in (*texts, "recording.csv")),
        notes=tuple(note for note in notes if note),
    )


def _modules(rig: "Rig", law: "Law", encoders: "Counts | SpoolMap", emg_rate: float | None) -> "list[Module]":
    """The law's module first, the detector's last.

    Raises:
        ParameterError: two modules of one name.
    """
    from bowden.core.errors import ParameterError
    from bowden.export.modules import course_module, emg_modules, joint_module, law_module, safety_module
    from bowden.rig.emg_run import course_of
    from bowden.rig.joint_sensor import motor_reach
    from bowden.sensing.detectors import detector_named

    limits = limits_of(rig, law)._replace(uses_emg=emg_rate is not None)
    modules = [law_module(law, rig.sample_time, encoders), safety_module(limits, rig.filters)]
    if rig.joint_sensor.estimated:
        modules += [joint_module(rig.joint_model, motor_reach(limits), rig.sample_time)]
    if emg_rate is not None:
        given = rig.emg
        modules += [course_module(course_of(given))]
        modules += emg_modules(emg_rate, detector_named(given.detector), given.levels)
    names = [module.prefix for module in modules]
    if len(set(names)) < len(names) or names[0] in _TAKEN:
        raise ParameterError(f"the law {law.name!r} has the name of another file", do="give it another name")
    return modules


def limits_of(rig: "Rig", law: "Law") -> "Limits":
    """The supervisor's limits in a run of this law."""
    from bowden.design.forecast import off_reference

    _ = rig.drive_parameters  # which refuses limits that contradict one another
    return rig.supervisor_limits._replace(off_reference=off_reference(rig, law))


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
    return file.is_file() and _MARK.encode() in file.read_bytes()[:500]


def _recording(rig: "Rig", law: "Law") -> str:
    """A simulated run of the rig as CSV, with the columns of a live run's log, up to where the law runs away."""
    import numpy as np

    from bowden.control import user_law
    from bowden.export.files import COLUMNS
    from bowden.sim.run import simulate

    duration = min(RECORDED, rig.duration)
    with user_law.explained(law):
        trace = simulate(
            rig.simulated_plant,
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


OPERATIONS = (Operation("export", export, 120),)
