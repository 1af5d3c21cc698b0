"""Results of which a few lines are said, in a terminal: a view that is longer has a file of its operation's name."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

from bowden.core.errors import counted
from bowden.views.text import Call, say_next

if TYPE_CHECKING:
    from bowden.operations.calibrate import JointCalibration
    from bowden.operations.confirm import Confirmation
    from bowden.operations.console import ConsoleOpened
    from bowden.operations.demo import Demo
    from bowden.operations.doctor import Diagnosis
    from bowden.operations.emg_stream import EmgServed, EmgStreamed
    from bowden.operations.export import Exported
    from bowden.operations.init import Initialised
    from bowden.operations.measure import MeasuredMotion
    from bowden.operations.sample import SampleRecordings
    from bowden.operations.twin import TwinFaults, TwinJournal, TwinStarted


def show_calibrate_joint(found: JointCalibration, call: Call) -> None:
    """What was written, and what comes next."""
    poses = ", ".join(f"{one:g}°" for one in found.poses_deg)
    print(f"[joint_sensor] of {call['rig']} is written, by poses at {poses}; noise {found.noise_deg:.2f}°")
    say_next("run", call["rig"], "--twin")


def show_confirm(found: Confirmation, call: Call) -> None:
    """The angles by encoders and by hand."""
    angles = f"joint {found.joint_deg:.1f}°, motor {found.motor_deg:.1f}°, by hand {round(found.told_deg, 9):g}°"
    print(f"Confirmed: {angles}.")


def show_console(found: ConsoleOpened, call: Call) -> None:
    """The link."""
    print(f"Console of {call['rig'].name}: {found.link}")


def show_demo(found: Demo, call: Call) -> None:
    """The page, and what comes next."""
    print(f"\nPage: {found.files[-1]}  ({call.seconds:.0f} s)")
    if found.words:
        say_next("identify", *found.words, why="the same step by step: the page has the commands")
    else:
        say_next("demo", "my.csv", why="with a log of your own")


def show_emg_serve(found: EmgServed, call: Call) -> None:
    """Where it is heard, and what is in it."""
    print(f"{found.source}: {', '.join(found.channels)}, {found.rate_hz:g} Hz; Ctrl-C ends it")


show_emg_stream = show_emg_serve


def ended_emg_stream(found: EmgStreamed, call: Call) -> None:
    """How much was sent."""
    for sent in (count for counts in found.sent for count in counts):
        print(f"{counted(sent, 'sample')} of {counted(len(found.channels), 'channel')} sent")


def show_init_file(found: Initialised, call: Call) -> None:
    """The file, what the rig has and why, and what comes next."""
    path = call["path"]
    print(f"Wrote {path}")
    for line in found.said:
        print(line)
    say_next(*(("run", path, "--twin") if call["suit"] else ("simulate", path)))


def show_measure(found: MeasuredMotion, call: Call) -> None:
    """How the run ended, and what comes next."""
    from bowden.views.run import print_summary

    print_summary(found)
    if found.files:
        first, second = (shlex.quote(str(file)) for file in found.files[:2])
        print(f"Next: bowden identify {first}, and bowden identify-servo {second}")


def show_sample(found: SampleRecordings, call: Call) -> None:
    """Each file and what it is, and what comes next."""
    print(f"Simulated, in {call['folder']}:")
    for name, about in found.files.items():
        print(f"  {Path(name).name:18} {about}")
    print(f"Next: {found.next}")


def show_schema(found: Any, call: Call) -> None:
    """One schema, or what there is one of."""
    if found.whole_document is None:
        for name, line in found.schemas.items():
            print(f"{name:16}{line}")
    else:
        print(json.dumps(found.whole_document, ensure_ascii=False, indent=2))


def show_doctor(found: Diagnosis, call: Call) -> None:
    """Kernel, privileges, lateness, buses, streams, and what to change."""
    late, here = found.lateness, found.machine
    print(f"kernel      {here.release}, {here.preemption}")
    print(f"clock       {here.clock_source}; processors {', '.join(map(str, here.processors))}")
    for grant in (*found.privileges, *found.granted):
        print(f"{'may' if grant.granted else 'MAY NOT':11} {grant.name}: {grant.detail}")
    print(f"\nlateness of {late.cycles} wakings, one in {found.period_ms:g} ms")
    print(f"  p50 {late.p50_us:.0f}  p99 {late.p99_us:.0f}  p99.9 {late.p999_us:.0f}  max {late.max_us:.0f} µs")
    most = max(bucket.cycles for bucket in found.histogram)
    for bucket in found.histogram:
        if bucket.cycles:
            edge = "above" if bucket.up_to_us is None else f"≤ {bucket.up_to_us:g}"
            print(f"  {edge:>7} µs {bucket.cycles:8d} {'█' * max(1, round(40 * bucket.cycles / most))}")
    interfaces, emg = here.can, found.emg
    print(f"\nCAN         {', '.join(f'{name} ({state})' for name, state in interfaces.items()) or 'none'}")
    count = len(emg.streams)
    print(f"EMG         {emg.problem or ('no stream' if not count else f'{count} of LSL')}")
    for one in emg.streams:
        said = one.problem or f"{counted(one.channels, 'channel')}, {one.rate_hz:g} Hz"
        print(f"            lsl:{one.name}#{one.source_id} of {one.host}: {said}")
    print("\nWhat to change:" if found.advice else "\nNothing to change.")
    for line in found.advice:
        print(f"- {line}")


def show_export(found: Exported, call: Call) -> None:
    """The files, and what comes next."""
    print(f"{found.law} in {found.precision}: {', '.join(file.name for file in found.files)}")
    print(f"Wrote {call['folder']}  ({call.seconds:.1f} s)")
    print(f"Next: {shlex.join(['make', '-C', str(call['folder']), 'check'])}  # replays a run of the rig in C")


def show_twin(found: TwinStarted | TwinJournal | TwinFaults, call: Call) -> None:
    """Where it is, its state, or what it can be given."""
    from bowden.operations.twin import TwinFaults, TwinJournal

    if isinstance(found, TwinFaults):
        for one in found.faults:
            side = " joint|motor" if one.side else ""
            amount = "" if one.amount is None else f" [{one.amount:g} {one.unit}]"
            print(f"{one.fault + side + amount:36} {one.meaning}")
    elif isinstance(found, TwinJournal):
        state = found.twin
        faults = ", ".join(state.faults) or "none"
        print(f"twin: {state.state.lower().replace('_', ' ')}, motor {state.motor:.4f} rad; faults: {faults}")
    else:
        where = found.address | {"control": found.control}
        words = shlex.join([str(call["rig"]), *call.repeated("channel")])
        print(f"twin: {', '.join(f'{key} {value}' for key, value in where.items())}")
        print(f"It runs until Ctrl-C. In another terminal: bowden run {words}, or bowden twin {words} --status")
