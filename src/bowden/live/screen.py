"""What `bowden run` shows: state, angles, error, estimates, lateness, faults and what to do."""

import math
from typing import TYPE_CHECKING

from rich.markup import escape
from rich.table import Table

from bowden.core.units import RADIANS
from bowden.cycle.one_cycle import TargetSource
from bowden.live.preflight import REASONS, Reason
from bowden.live.ring import RecorderState
from bowden.live.session import Session
from bowden.live.stops import remedy_of
from bowden.safety import faults
from bowden.safety.faults import Fault
from bowden.safety.state import Mode
from bowden.sensing.intent import Intent

if TYPE_CHECKING:
    from bowden.rig.emg_run import EmgRun

_MOST_ESTIMATES = 6
_BAR = 20
"""Width of the envelope's bar."""
_OTHER = 4.0
"""An envelope this many times that of the wearer's rest, or as many times less, is not theirs: it swings by less."""
_KEYS = "a arm · r run · s or space stop · k acknowledge · q quit"
_NEXT = {
    Mode.STOPPED: "a to arm: the motor gets power and makes a small motion",
    Mode.PREFLIGHT: "wait for the preflight, then r to run",
    Mode.RUNNING: "s or space to stop",
    Mode.LATCHED: "correct the cause, then k to acknowledge",
}


def picture(session: Session, row: dict[str, float], auto: bool, answer: str = "") -> Table:
    """One picture of a run from its newest row; `answer` is why a key did nothing."""
    mode, shown = Mode(int(row["mode"])), faults.of(row["faults"])
    table = Table(box=None, show_header=False, pad_edge=False)
    table.add_column(style="dim")
    table.add_column()
    said = "" if auto else _next(mode, row["preflight"], shown)
    table.add_row("state", f"[bold]{mode.name.lower()}[/bold]  {said}")
    for one in session.faults(row):  # all that must be seen stands above: a low terminal cuts the end off
        where = f"{one.motor}: " if one.motor else ""
        for fault in one.causes:
            remedy = remedy_of(fault, twin=session.on_twin, recorder=row["recorder"], emg=row.get("emg.loss"))
            table.add_row("[red]fault[/red]", f"{where}[red]{fault.meaning}[/red]: {remedy}")
        if one.consequences:
            table.add_row("[red]follows[/red]", where + ", ".join(fault.meaning for fault in one.consequences))
    if not {Fault.EMERGENCY, Fault.DRIVE_FAULT}.isdisjoint(shown):
        table.add_row("[red]drive[/red]", escape(session.drive_said(row)))
    each = [(motor, motor.of(row)) for motor in session.motors]
    for motor, own in each:
        if own["preflight_reason"]:
            where = f"{motor.name}: " if motor.name else ""
            table.add_row("[red]preflight[/red]", where + REASONS[Reason(int(own["preflight_reason"]))])
    table.add_row("keys", "Ctrl-C to end" if auto else f"{_KEYS}{f'  [yellow]{answer}[/yellow]' if answer else ''}")
    for motor, own in each:
        angles = f"joint {_deg(own['joint'])}, motor {_deg(own['motor'])}, target {_deg(own['command'])}"
        error = f"{_deg(own['joint'] - own['reference'])} of {_deg(own['reference'])}"
        if motor.name:
            state = Mode(int(own["mode"])).name.lower()
            heat = f"{own['current']:.2f} A, winding {own['supervisor.heat.winding']:.0f} °C{_load(own)}"
            table.add_row(motor.name, f"{state}: {angles}; error {error}; {heat}")
        else:
            table.add_row("angles", angles)
            table.add_row("error", error)
    if session.emg_process is not None:
        table.add_row("EMG", _emg(row, session.emg_process.unit, session.emg_process.lost))
        if session.live.emg is not None:
            table.add_row("wearer", wearer(session.live.emg, row))
    if "admittance.push.torque" in row:
        table.add_row("push", _push(row))
    if not session.live.several:
        table.add_row("motor", f"{row['current']:.2f} A, winding {row['supervisor.heat.winding']:.0f} °C{_load(row)}")
    table.add_row(
        "recorder", f"{RecorderState(session.recorder).name.lower().replace('_', ' ')}  {escape(str(session.log))}"
    )
    table.add_row("lateness", f"{1e6 * row['lateness']:.0f} µs; the cycle takes {1e6 * row['run_time']:.0f} µs")
    laws = [(name[4:], value) for name, value in row.items() if name.startswith("law.")]
    table.add_row("estimates", ", ".join(f"{name} {value:.3g}" for name, value in laws[:_MOST_ESTIMATES]))
    return table


def _push(row: dict[str, float]) -> str:
    """The push that makes the reference; none counts where the law does not have the motor."""
    if row["source"] < TargetSource.LAW_BEGINS:
        return "–"
    push, doubt = row["admittance.push.torque"], row["admittance.estimate.doubt"]
    return f"{push:+.2f} N·m, in doubt by {doubt:.2f}" if math.isfinite(push) else "not known"


_TROUBLE = ("", "flat, missing or repeated: check electrodes and sender", "movement or mains")


def _emg(row: dict[str, float], unit: str, lost: str) -> str:
    """The envelope as a bar, what the muscles do, what is wrong, and how old it is."""
    share, said = row["emg.share"], [escape(f"{row['emg.level']:.3g} {unit}".strip())]
    if not math.isnan(share):
        full = round(_BAR * min(max(share, 0.0), 1.0))
        said = [f"{'█' * full}{'░' * (_BAR - full)} {100.0 * share:.0f} % MVC"]
    active = [name for name in ("flexor", "extensor") if row[f"emg.{name}"]]
    said.append(f"[bold]{' and '.join(active)} contracts[/bold]" if active else "at rest")
    if row["emg.trouble"]:
        said.append(f"[red]{_TROUBLE[int(row['emg.trouble'])]}[/red]")
    said.append(f"[red]{escape(lost)}[/red]" if lost else f"{1e3 * row['emg.age']:.0f} ms old")
    return ", ".join([f"{Intent(int(row['emg.intent'])).name.lower()}: {said[0]}", *said[1:]])


def wearer(run: "EmgRun", row: dict[str, float]) -> str:
    """Whose levels the run goes by; before the law has the motor, also whether the muscle's rest is theirs."""
    if run.wearer is None:
        return "not known; only contractions are detected"
    given, level = run.wearer, row["emg.level"]
    said = f"{run.where}: {given.channel} at rest {given.rest:.3g}, at most {given.mvc:.3g}"
    quiet = row["source"] < TargetSource.LAW_BEGINS and not row["emg.flexor"] and not row["emg.trouble"]
    if not quiet or level == 0.0 or given.rest / _OTHER <= level <= given.rest * _OTHER:
        return escape(said)
    return f"{escape(said)}, [red]and rests at {level:.3g} now: another wearer's file, or electrodes elsewhere?[/red]"


def _next(mode: Mode, preflight: float, shown: list[Fault]) -> str:
    """What the operator may do."""
    if mode == Mode.STOPPED and Fault.DRIVE_FAULT in shown:
        return "correct the cause, then k to reset the drive"
    if mode == Mode.STOPPED and shown:
        return "cannot be armed"
    if mode == Mode.PREFLIGHT and preflight:
        return "passed; r to run" if preflight > 0.0 else "failed"
    return _NEXT.get(mode, "")


def _load(row: dict[str, float]) -> str:
    """What the load cell says, where there is one."""
    told = (("tension", "N"), ("joint_torque", "N·m"))
    return "".join(f", {row[name]:.1f} {unit}" for name, unit in told if math.isfinite(row.get(name, math.nan)))


def _deg(angle: float) -> str:
    return "–" if math.isnan(angle) else f"{angle / RADIANS:.2f}°"
