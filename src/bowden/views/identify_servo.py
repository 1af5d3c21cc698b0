"""An identified servo: its keys of rig.toml, in a terminal and in a file."""

from pathlib import Path

from bowden.operations.identify_servo import ServoIdentification
from bowden.operations.support.operation import Folder
from bowden.views.text import Call, say_next


def write_identify_servo(found: ServoIdentification, call: Call, *, out: Folder = Path("out/servo")) -> list[Path]:
    """Write the keys into servo.toml, or into a rig.

    Args:
        found: the servo.
        call: of the command.
        out: folder for servo.toml.
    """
    from bowden.core.files import whole_files, write_text
    from bowden.identify.servo import keys

    into, name = call["into"], call["log"].name
    if into is not None:
        write_text(into, keys.into(into.read_text(encoding="utf-8"), found, name, str(into)))
        return [into]
    with whole_files(out) as folder:
        (folder / "servo.toml").write_text(keys.keys_of(found, name), encoding="utf-8")
    return [out / "servo.toml"]


def show_identify_servo(found: ServoIdentification, call: Call) -> None:
    """The keys, and what comes next."""
    from bowden.identify.servo.keys import keys_of

    print(keys_of(found, call["log"].name))
    for warning in found.warnings:
        print(f"- {warning}")
    print(f"Wrote {call.files[0]}  ({call.seconds:.1f} s)")
    if call["into"] is None:
        print("Put these keys into rig.toml (--into rig.toml does it), then: bowden check rig.toml")
    else:
        say_next("check", call["into"])
