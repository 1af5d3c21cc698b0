"""What a check found, in a terminal."""

from typing import TYPE_CHECKING

from bowden.operations.check import CheckResult
from bowden.views.text import Call, rows, say_next

if TYPE_CHECKING:
    from bowden.rig.rig import Rig


def show_check(found: CheckResult, call: Call) -> None:
    """A line for each thing, and what comes next."""
    from bowden.design.check_result import check_rows
    from bowden.rig.families import shortest_cycles

    joints = {one.name: one for one in found.whole.each_joint}
    for name, one in found.checks.items():
        if name:
            print(f"joint {name}")
        verdict, *others = check_rows(one)
        if found.refusals:
            others.insert(0, ("its law", verdict[1]))
            verdict = "verdict", "refused: bowden run does not take this rig, see the note"
        own = joints[name].first
        if own.servo_assumed:
            others.append(("servo", own.servo_text))
        rows([verdict, *others], least=13)
    drives = [motor.rig.drive_parameters for joint in joints.values() for motor in joint.motors]
    for channel, (count, shortest) in shortest_cycles(drives).items():
        servos = f"{count} drive{'s' if count > 1 else ''} on {channel}"
        rows([("line", f"{servos}: up to {1.0 / shortest:.0f} Hz, {1e3 * shortest:.2f} ms a cycle")], least=13)
    print(f"({call.seconds:.1f} s)")
    if found.refusals:
        print("Next: correct what bowden run refuses, then check it again")
        return
    failing = [name for name, one in found.checks.items() if not one.holds]
    options = [*call.repeated("law", "preset", "motor")]
    if failing and joints[failing[0]].shared:
        say_next("check", call["rig"], *options, "--motor", joints[failing[0]].names[0])
    elif failing and failing[0]:
        (name,) = joints[failing[0]].names
        _say_next_of(found, found.whole.only(name), failing[0], [*options, "--motor", name], call)
    elif found.whole.motors:
        say_next("run", call["rig"], *options, "--twin", "--auto")
    else:
        _say_next_of(found, found.whole, "", options, call)


def _say_next_of(found: CheckResult, rig: "Rig", name: str, options: list[str], call: Call) -> None:
    """Gains for the rig's own law, where it has a choice; else a run of what was checked, or of a law that holds."""
    one = found.checks[name]
    if one.of_rig:
        print(_CHANGE_RIG)
    elif one.verdict == "holds":
        say_next("run", call["rig"], *options, "--twin", "--auto")
    elif rig.loaded_law.choices and not (call["law"] or call["preset"]):
        say_next("tune", call["rig"], *options)
    elif one.holds:
        say_next("run", call["rig"], *options, "--twin", "--auto")
    elif one.instead:
        motor = options[options.index("--motor") :][:2] if "--motor" in options else []
        say_next("simulate", call["rig"], "--law", one.instead, *motor)
    elif one.advice:
        print(_CHANGE_RIG)
    else:
        print("Next: change the law or the rig, then check it again")


_CHANGE_RIG = "Next: change the rig as the advice says, then check it again"
