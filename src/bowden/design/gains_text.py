"""Putting gains into the text of a rig.toml, with everything else left as it stands."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

from bowden.core.errors import OutputError
from bowden.core.toml_text import quoted, with_keys

_HEADER = re.compile(r"^\s*\[")
_MARK = "bowden tune: "


def with_gains(
    text: str, gains: Mapping[str, float], evidence: Sequence[str], path: Path, preset: str | None = None
) -> str:
    """The text with these gains in [control.gains], and the evidence as comments below its head.

    Keys that are there are changed in place with their comments, others are added, and an earlier evidence is replaced.

    Args:
        text: of the file.
        gains: name → value.
        evidence: one comment a line.
        path: of the file, for messages.
        preset: on which the gains stand, for [control] where it is not there.

    Raises:
        OutputError: the gains are written there in a form that cannot be changed line by line.
    """
    if preset is not None:
        text = with_keys(text, "control", {"preset": quoted(preset)}, str(path))
    values = {name: repr(value) for name, value in gains.items()}
    return with_keys(text, "control.gains", values, str(path), [_MARK + line for line in evidence])


_MOTOR = re.compile(r"^\s*\[\[\s*motor\s*\]\]\s*(#.*)?$")
_OF_MOTOR = re.compile(r"^(\s*\[\s*)motor\s*\.\s*")


def with_motor_gains(
    text: str, motor: str, gains: Mapping[str, float], evidence: Sequence[str], path: Path, preset: str | None = None
) -> str:
    """`with_gains` for one motor of a rig with several: into [motor.control.gains] below its [[motor]].

    Args:
        text: of the file.
        motor: its name.
        gains: see `with_gains`.
        evidence: likewise.
        path: likewise.
        preset: likewise.

    Raises:
        OutputError: see `with_gains`; or the motors are written in another form.
    """
    lines = text.splitlines()
    heads = [i for i, line in enumerate(lines) if _MOTOR.match(line)]
    names = [one.get("name") for one in tomllib.loads(text).get("motor", ())]
    if len(heads) != len(names) or motor not in names:
        raise OutputError(f"{path}: its motors are not [[motor]] sections", do="write each below a line [[motor]]")
    begin = heads[names.index(motor)] + 1
    others = (i for i in range(begin, len(lines)) if _HEADER.match(lines[i]) and not _OF_MOTOR.match(lines[i]))
    end = next(others, len(lines))
    alone = "\n".join(_OF_MOTOR.sub(r"\1", line) for line in lines[begin:end])
    made = with_gains(alone, gains, evidence, path, preset).splitlines()
    own = [re.sub(r"^(\s*\[\s*)", r"\1motor.", line) if _HEADER.match(line) else line for line in made]
    return "\n".join([*lines[:begin], *own, *([""] * (end < len(lines) and own[-1:] != [""])), *lines[end:]]) + "\n"
