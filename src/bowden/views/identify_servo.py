"""An identified servo: its keys of rig.toml, in a terminal and in a file."""

from pathlib import Path

from bowden.core.toml_text import with_keys
from bowden.operations.identify_servo import FittedValue, ServoIdentification
from bowden.operations.support.operation import Folder
from bowden.views.text import Call, say_next

_MARK = "bowden identify-servo: "
_SERVO = ("natural_frequency_hz", "damping", "speed_limit_deg_per_s")


def write_identify_servo(found: ServoIdentification, call: Call, *, out: Folder = Path("out/servo")) -> list[Path]:
    """Write the keys into servo.toml, or into a rig.

    Args:
        found: the servo.
        call: of the command.
        out: folder for servo.toml.
    """
    from bowden.core.files import whole_files, write_text

    into, name = call["into"], call["log"].name
    if into is not None:
        write_text(into, with_servo(into.read_text(encoding="utf-8"), found, name, str(into)))
        return [into]
    with whole_files(out) as folder:
        (folder / "servo.toml").write_text(with_servo("", found, name, "servo.toml"), encoding="utf-8")
    return [out / "servo.toml"]


def show_identify_servo(found: ServoIdentification, call: Call) -> None:
    """The keys, and what comes next."""
    print(with_servo("", found, call["log"].name, "servo.toml"))
    for warning in found.warnings:
        print(f"- {warning}")
    print(f"Wrote {call.files[0]}  ({call.seconds:.1f} s)")
    if call["into"] is None:
        print("Put these keys into rig.toml (--into rig.toml does it), then: bowden check rig.toml")
    else:
        say_next("check", call["into"])


def with_servo(text: str, found: ServoIdentification, name: str, where: str) -> str:
    """The text of a rig.toml with the values of a fit, and what is known of them as comments; all else as it stands.

    Args:
        text: of the file.
        found: of the fit, for the cycle of that rig.
        name: of the log.
        where: the file, for messages.

    Raises:
        OutputError: a section that cannot be changed line by line.
    """
    from bowden.design.rig_of_model import NOT_YOURS

    delay, cycle = found.delay_s, found.sample_time_ms
    said = f"{1e3 * delay.value:.3g} ± {1e3 * delay.uncertainty:.1g} ms rounded up at {cycle:g} ms a cycle"
    if found.joint_late_s:
        said += f", and {1e3 * found.joint_late_s:.3g} ms of the joint's sensor"
    cycles = {"delay_cycles": str(found.delay_cycles)}
    text = with_keys(text, "bench", cycles, where, [f"{_MARK}delay_cycles is {said}"])
    keys: dict[str, FittedValue] = {key: one for key in _SERVO if (one := getattr(found, key))}
    values = {key: f"{one.value:.5g}" for key, one in keys.items()}
    spread = ", ".join(f"{key} ± {one.uncertainty:.1g}" for key, one in keys.items())
    left = f"{found.residual_deg:.3g}° of the motor's motion are left, root mean square"
    evidence = [f"{_MARK}from {name}; {left}", f"{_MARK}{spread}"]
    if fastest := found.acceleration_limit_deg_per_s2:
        most = f"{fastest.value:.4g} ± {fastest.uncertainty:.1g} °/s²"
        own = "rig.toml has it by [motor] current_limit_a and inertia_kg_m2"
        evidence.append(f"{_MARK}largest acceleration {most}; {own}")
    return with_keys(text.replace(NOT_YOURS, "[servo]"), "servo", values, where, evidence)
