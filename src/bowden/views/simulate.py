"""Simulated runs: a table of their figures, their traces as files, and a page with every plot."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

from bowden.operations.simulate import SimulatedJoint, Simulation
from bowden.operations.support.operation import Folder
from bowden.views.text import Call, say_next, table


def write_simulate(
    found: Simulation, call: Call, *, out: Folder = Path("out/simulate"), csv: bool = False
) -> list[Path]:
    """Write every trace and, last, the page: all of a joint or nothing.

    Args:
        found: what ran.
        call: of the command.
        out: folder for the traces and the page.
        csv: write the traces as CSV too.
    """
    return [path for joint in found.joints for path in _write(joint, out / joint.name, csv)]


def _write(joint: SimulatedJoint, folder: Path, csv: bool) -> list[Path]:
    from bowden.core.files import whole_files
    from bowden.report.simulate_page import simulation_page

    rig = joint.joint.first
    cable = getattr(rig.cable, "file", "") if rig.worn is not None else ""
    whose = f", with the cable of {cable}" if cable else f": joint {joint.name}" if joint.name else ""
    names = []
    with whole_files(folder) as stage:
        for name, trace in joint.traces.items():
            for kind in ("npz", "csv") if csv else ("npz",):
                names.append(f"{name}.{kind}")
                trace.write(stage / names[-1])
        names.append("simulate.html")
        title = f"Simulation of {Path(rig.origin).name}{whose}"
        simulation_page(joint.traces, title).write(stage / names[-1])
    return [folder / name for name in names]


def show_simulate(found: Simulation, call: Call) -> None:
    """A row for each law, and what comes next."""
    from bowden.core.units import DEGREES

    for joint in found.joints:
        if joint.joint.shared:
            contraction = joint.joint.settings.co_contraction * DEGREES
            print(f"joint {joint.name}: {' and '.join(joint.joint.names)}, co-contraction {contraction:g}°")
            table(("law", *_JOINT[:3], *_MOTOR), _motor_rows(joint), left=("motor",))
        else:
            if joint.name:
                print(f"joint {joint.name}")
            table(("law", *_JOINT), _rows(joint))
        for run in joint.runs:
            if run.interaction is not None:
                print(f"{run.law}: the wearer feels {run.interaction.rms_nm:.2f} N·m RMS of the suit")
        pages = [file for file in call.files if file.parent == call["out"] / joint.name]
        print(f"\nPage: {pages[-1]}  ({call.seconds:.1f} s)")
        _say_next(joint, found, call)


_JOINT = ("RMSE\n°", "after 10 s\n°", "peak\n°", "delay\nms", "width\n°", "Pm energy\nJ", "Pe energy\nJ")
_MOTOR = ("motor", "pull\nN·m", "slack\n%", "current\nA", "Pe energy\nJ")


def _rows(joint: SimulatedJoint) -> Iterator[list[Any]]:
    for run in joint.runs:
        figures = [value for value, _ in run.shown().values()]
        yield [run.law, *(figures if run.rmse_deg is not None else ["unstable", *figures[1:]])]


def _motor_rows(joint: SimulatedJoint) -> Iterator[list[Any]]:
    """A row for each law and motor; the joint's figures stand in the first of them."""
    for run in joint.runs:
        errors: list[Any] = [run.rmse_deg, run.rmse_after_10s_deg, run.peak_deg]
        errors = ["unstable", None, None] if run.rmse_deg is None else errors
        for i, motor in enumerate(run.motors):
            slack = None if motor.slack_share is None else 100.0 * motor.slack_share
            own = [motor.motor, motor.largest_pull_nm, slack, motor.rms_current_a, motor.electrical_energy_j]
            yield [*(["", "", "", ""] if i else [run.law, *errors]), *own]


def _say_next(joint: SimulatedJoint, found: Simulation, call: Call) -> None:
    """The check of the rig, under the law that followed best; of a run that nothing compensated, its identification."""
    laws, preset = call["law"] or [], [*call.repeated("preset")]
    if joint.joint.shared:
        from bowden.core.errors import ParameterError
        from bowden.design.objections import refuse_sources

        try:
            refuse_sources(found.whole)
        except ParameterError as error:
            print(f"Next: nothing yet, neither check nor run take this rig: {error}")
            return
        say_next("check", call["rig"], *(["--law", laws[0]] if len(laws) == 1 else []), *preset)
        return
    if [run.law for run in joint.runs] == ["uncompensated"]:
        say_next("identify", call["out"] / joint.name / f"uncompensated.{'csv' if call['csv'] else 'npz'}")
        return
    given = dict(zip((run.law for run in joint.runs), laws, strict=False))
    errors = {run.law: run.rmse_deg for run in joint.runs if run.rmse_deg is not None and run.law in given}
    best = min(errors, key=lambda name: errors[name]) if errors else next(iter(given), None)
    options = [] if best is None or given[best] == joint.joint.first.law_name else ["--law", given[best]]
    motor = ["--motor", *joint.joint.names] if joint.name else [*call.repeated("motor")]
    say_next("check", call["rig"], *options, *preset, *motor)
