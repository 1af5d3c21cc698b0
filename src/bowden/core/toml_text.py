"""Text in TOML files that this package writes."""

import json
import re
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Any

from bowden.core.errors import OutputError

_HEADER = re.compile(r"^\s*\[")
_VALUE = re.compile(r"""=\s*("[^"]*"|'[^']*'|[^#\s]+)(\s*)""")


def quoted(text: str) -> str:
    """`text` as a basic string of TOML, which is one of JSON but for a sign.

    >>> print(quoted('a "b"'))
    "a \\"b\\""
    """
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")


def with_keys(text: str, section: str, values: Mapping[str, str], where: str, evidence: Sequence[str] = ()) -> str:
    """The text of a TOML file with other values in one section, and all else as it stands.

    Keys that are there are changed in place with their comments, others are added below the section's head.

    Args:
        text: of the file.
        section: dotted; written at the end where it is not there.
        values: key → value as TOML has it.
        where: the file, for messages.
        evidence: comments below the head, in place of earlier ones that begin with the same two words.

    Raises:
        OutputError: the section is written in a form that cannot be changed line by line.

    >>> print(with_keys("[a]  # why\\nb = 1  # one", "a", {"b": "2", "c": "3"}, "x.toml"), end="")
    [a]  # why
    c = 3
    b = 2  # one
    """
    lines = text.splitlines()
    named = r"\s*\.\s*".join(map(re.escape, section.split(".")))
    head = next((i for i, line in enumerate(lines) if re.match(rf"^\s*\[\s*{named}\s*\]\s*(#.*)?$", line)), None)
    if head is None:
        lines += [*([""] if lines else []), f"[{section}]"]
        head = len(lines) - 1
    end = next((i for i in range(head + 1, len(lines)) if _HEADER.match(lines[i])), len(lines))
    marks = tuple("# " + " ".join(line.split()[:2]) for line in evidence)
    body = [line for line in lines[head + 1 : end] if not (marks and line.startswith(marks))]
    missing = []
    for name, value in values.items():
        at = next((i for i, line in enumerate(body) if re.match(rf'\s*"?{re.escape(name)}"?\s*=', line)), None)
        if at is None:
            missing.append(f"{quoted(name) if '.' in name else name} = {value}")  # a dot would make a section of it
        else:
            body[at] = _VALUE.sub(partial(_in_place, value=value), body[at], count=1)
    written = [*lines[: head + 1], *(f"# {line}" for line in evidence), *missing, *body, *lines[end:]]
    changed = "\n".join(written) + "\n"
    try:
        wanted = dict(_flat(tomllib.loads(text)))
        wanted |= {f"{section}.{name}": tomllib.loads(f"x = {value}")["x"] for name, value in values.items()}
        fine = dict(_flat(tomllib.loads(changed))) == wanted
    except tomllib.TOMLDecodeError:
        fine = False
    if not fine:
        raise OutputError(
            f"{where}: [{section}] is not a section of its own", do=f"write its keys below [{section}], one to a line"
        )
    return changed


def _in_place(found: re.Match[str], value: str) -> str:
    """A value in the place of another; what follows stays in its column, where it can."""
    room = len(found[1]) + len(found[2]) - 2
    return f"= {value:<{room}}  " if found[2] else f"= {value}"


def _flat(tree: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    for key, value in tree.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{key}.")
        else:
            yield before + key, value
