"""What a live run came to, in a terminal."""

import shlex
from pathlib import Path

from bowden.core.errors import counted, note
from bowden.live.figures import EmgRunFigures, EndedRun
from bowden.operations.run import RunResult
from bowden.views.text import Call, free_name, say_next


def show_run_to_end(found: RunResult, call: Call) -> None:
    """Figures, what stopped it, its log, and what comes next."""
    print_summary(found)
    if not found.log_lost:
        say_next_of(found, call)


def say_next_of(found: RunResult, call: Call) -> None:
    """What ended a run that did not end as asked; a log that is in parts; the export of what has run, of each motor."""
    if not (found.ended_well and found.log_whole):
        say_next("log", "info" if found.log_whole else "recover", found.log)
        return
    options, motor = [*call.repeated("law", "preset")], call["motor"]
    for name, law in [(one.name, one.law) for one in found.motors] or [(motor, found.law)]:
        folder = Path("firmware", str(law if motor == name else name))
        of_motor = [] if name is None else ["--motor", name]
        say_next("export", call["rig"], *options, *of_motor, "--to", free_name(folder))


def print_summary(found: EndedRun) -> None:
    """Figures, what stopped it, and its log."""
    from bowden.hardware.ports import TorqueLeft, torque_left

    for one in found.motors:
        said = "no law led" if one.rmse_deg is None else f"{one.rmse_deg:.3f}° RMS, {one.peak_deg:.2f}° peak"
        print(f"{one.name}, {one.law}: {said} over {one.seconds_led:g} s under the law")
    if found.rmse_deg is not None and not found.motors:
        print(f"{found.law}: {found.rmse_deg:.3f}° RMS, {found.peak_deg:.2f}° peak", end="")
        home = ", the motion back to its start included" if found.ended_well else ""
        print(f" over {found.seconds_led:g} s under the law{home}{', on the twin' if found.twin else ''}")
    if found.estimate_std_deg is not None:
        print(f"joint estimated; 1 σ {found.estimate_std_deg:.3f}° RMS under the law")
    late, run_time = found.lateness, found.run_time
    if late and run_time:
        print(
            f"lateness {late.p50_us:.0f} µs median, {late.p99_us:.0f} p99, {late.p999_us:.0f} p99.9, "
            f"{late.max_us:.0f} max; the cycle takes {run_time.p50_us:.0f} µs; ",
            end="",
        )
        if found.cycles is None:  # the loop said nothing at its end
            print(f"{counted(found.cycles_logged, 'cycle')} in the log")
        else:
            print(f"{counted(found.overruns or 0, 'overrun')} in {counted(found.cycles, 'cycle')}")
    if found.emg:
        _print_emg(found.emg)
    if found.interaction:
        felt = found.interaction
        how = f"estimated; in doubt by {felt.doubt_nm:.2f} N·m" if felt.doubt_nm else "measured"
        print(f"the wearer feels about {felt.rms_nm:.2f} N·m RMS of the suit, {felt.peak_nm:.1f} N·m at most ({how})")
    _print_stops(found)
    if found.torque != "off":
        print(torque_left(TorqueLeft[found.torque.upper()], twin=bool(found.twin)))
    for text in dict.fromkeys(one.text for one in found.emergencies):
        print(f"emergency: {text}")
    if found.preflight:
        print(f"preflight: {found.preflight}")
    if found.error:
        print(f"ended by an error: {found.error}")
    if found.ended_well and not found.seconds_led:
        print("ended as asked, before the law led")
    whole, gone = found.log_whole, found.log_lost
    if not gone:
        print(f"Log: {found.log}  ({shlex.join(['bowden', 'log', 'info' if whole else 'recover', str(found.log)])})")
        for path in found.more_logs:
            print(f"  and {path}")
    lost = (found.cycles or 0) - found.cycles_logged
    if lost > 0 or gone:
        missing = f"{lost} cycles of {found.cycles} are not in the log, nor in these figures" if lost > 0 else ""
        note(": ".join(filter(None, (missing, gone))))
    if not whole and not gone:
        note(f"{found.log} was not closed properly")


def _print_stops(found: EndedRun) -> None:
    """What stopped the run, in the order of time, then what its log does not show."""
    from bowden.live import stops
    from bowden.safety.faults import Fault

    named = {one.name: one.faults for one in found.motors} or {"": found.faults}
    said: set[tuple[str, str]] = set()
    """Motor, or nothing of a rig with one motor, and fault."""
    for number, stop in enumerate(found.stops, 1):
        last = number == len(found.stops) and not found.ended_well
        how = "ended" if last else "stopped"
        for line in stops.lines(stop, twin=bool(found.twin)):
            print(f"{how} by a fault at {stop.time_s:.3f} s: {line}")
        whose = [stop.motor] if stop.motor else [*named]
        shown = {*stop.causes, *stop.consequences}
        said |= {(motor, meaning) for motor in whose for meaning in shown}
        said |= {
            (motor, meaning) for motor, faulty in named.items() for meaning in faulty if f"{motor}: {meaning}" in shown
        }
    if found.stalled_ms and not any(stop.too_busy for stop in found.stops):
        print(stops.STALLED.format(found.stalled_ms))
    if found.unattended:
        print(f"ended before its time: {found.unattended}")
        said |= {(motor, Fault.OPERATOR_LOST.meaning) for motor in named}
    remedies = dict(zip(found.faults, found.remedies, strict=True))
    for motor, faulty in named.items():
        for meaning in faulty:
            if (motor, meaning) not in said:
                how = "at the end" if found.ended_well else "ended by a fault"
                print(f"{how}: {f'{motor}: ' if motor else ''}{meaning}; {remedies[meaning]}")


def _print_emg(found: EmgRunFigures) -> None:
    motions = "the joint follows the envelope" if found.motions is None else counted(found.motions, "motion")
    print(f"EMG: {found.stream or found.source}; {motions}", end="")
    if found.peak_after_first_second_deg is not None:
        print(f", error after the first second of each at most {found.peak_after_first_second_deg:.2f}°", end="")
    print()
    delays = {
        "loop": found.onset_to_cycle_ms,
        "command moves": found.onset_to_command_ms,
        "joint moves by 1°": found.onset_to_joint_ms,
    }
    if said := [f"{what} {one.p50:.0f} ms ({one.max:.0f} at most)" for what, one in delays.items() if one]:
        print(f"from the sample with which a contraction was detected: {', '.join(said)}")
    age = f"; {found.age_ms.p50:.0f} ms old in the loop in the median" if found.age_ms else ""
    if found.wearer:
        print(f"wearer's levels from {found.wearer}")
    print(f"{found.lost} of {counted(found.samples, 'sample')} lost{age}")
    if found.why_lost:
        print(f"the stream at the end: {found.why_lost}")
