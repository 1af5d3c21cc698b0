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
