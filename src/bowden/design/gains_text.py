"""Putting gains into the text of a rig.toml, with everything else left as it stands."""

import re
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path

from bowden.core.errors import OutputError, ParameterError
from bowden.core.toml_text import key_of, quoted
from bowden.rig.config import dotted

_CONTROL = re.compile(r"^\s*\[\s*control\s*\]\s*(#.*)?$")
_SECTION = re.compile(r"^\s*\[\s*control\s*\.\s*gains\s*\]\s*(#.*)?$")
_HEADER = re.compile(r"^\s*\[")
_MARK = "# bowden tune: "


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
    lines = text.splitlines()
    if preset is not None and tomllib.loads(text).get("control", {}).get("preset") != preset:
        at = next((i + 1 for i, line in enumerate(lines) if _CONTROL.match(line)), None)
        if at is None:
            at = next((i for i, line in enumerate(lines) if _SECTION.match(line)), len(lines))
            lines[at:at] = ["", "[control]"] if at == len(lines) else ["[control]"]
            at += 2 if lines[at] == "" else 1
        lines[at:at] = [f"preset = {quoted(preset)}  # with which bowden tune began"]
    head = next((i for i, line in enumerate(lines) if _SECTION.match(line)), None)
    if head is None:
        lines += ["", "[control.gains]"]
        head = len(lines) - 1
    end = next((i for i in range(head + 1, len(lines)) if _HEADER.match(lines[i])), len(lines))
    body = [line for line in lines[head + 1 : end] if not line.startswith(_MARK)]
    missing = []
    for name, value in gains.items():
        at = next((i for i, line in enumerate(body) if re.match(rf'\s*"?{re.escape(name)}"?\s*=', line)), None)
        if at is None:
            missing.append(f"{key_of(name)} = {value!r}")
        else:
            body[at] = re.sub(r"=\s*[^#\s]+", f"= {value!r}", body[at], count=1)
    written = [*lines[: head + 1], *(_MARK + line for line in evidence), *missing, *body, *lines[end:]]
    changed = "\n".join(written) + "\n"
    try:
        control = tomllib.loads(changed)["control"]
        kept = dotted(control["gains"], str(path))
        fine = all(kept.get(name) == value for name, value in gains.items())
        fine = fine and (preset is None or control["preset"] == preset)
    except (tomllib.TOMLDecodeError, KeyError, AttributeError, ParameterError):
        fine = False
    if not fine:
        raise OutputError(
            f"{path}: its gains are not a section of their own", do="write them below [control.gains], one to a line"
        )
    return changed


_AXIS = re.compile(r"^\s*\[\[\s*axis\s*\]\]\s*(#.*)?$")
_OF_AXIS = re.compile(r"^(\s*\[\s*)axis\s*\.\s*")


def with_axis_gains(
    text: str, axis: str, gains: Mapping[str, float], evidence: Sequence[str], path: Path, preset: str | None = None
) -> str:
    """`with_gains` for one axis of a rig with several: into [axis.control.gains] below its [[axis]].

    Args:
        text: of the file.
        axis: its name.
        gains: see `with_gains`.
        evidence: likewise.
        path: likewise.
        preset: likewise.

    Raises:
        OutputError: see `with_gains`; or the axes are written in another form.
    """
    lines = text.splitlines()
    heads = [i for i, line in enumerate(lines) if _AXIS.match(line)]
    names = [one.get("name") for one in tomllib.loads(text).get("axis", ())]
    if len(heads) != len(names) or axis not in names:
        raise OutputError(f"{path}: its axes are not [[axis]] sections", do="write each below a line [[axis]]")
    begin = heads[names.index(axis)] + 1
    others = (i for i in range(begin, len(lines)) if _HEADER.match(lines[i]) and not _OF_AXIS.match(lines[i]))
    end = next(others, len(lines))
    alone = "\n".join(_OF_AXIS.sub(r"\1", line) for line in lines[begin:end])
    made = with_gains(alone, gains, evidence, path, preset).splitlines()
    own = [re.sub(r"^(\s*\[\s*)", r"\1axis.", line) if _HEADER.match(line) else line for line in made]
    return "\n".join([*lines[:begin], *own, *([""] * (end < len(lines) and own[-1:] != [""])), *lines[end:]]) + "\n"
