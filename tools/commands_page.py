"""The page of commands, made from the operations that the command line is made of."""

from collections.abc import Iterator
from pathlib import Path

from bowden.core.files import write_text
from bowden.hardware.twin.injection import KINDS
from bowden.operations.support.operation import Operation, OperationParameter, Role, declared, parameters

_COMMON = ("--out",)
"""Options that mean the same for every command that has them."""


def markdown() -> str:
    """The reference page ``docs/commands.md``."""
    lines = [
        "# Commands",
        "",
        "Every command with its options. `bowden NAME --help` explains each option and shows examples. Not listed:",
        "`--out` (where results go) and `--json`, which every command takes: it then",
        "prints one JSON document and nothing else; `bowden schema NAME` prints its schema. Exit code 0: done as",
        "asked. 1: done, with a bad result (a loop that does not hold, a run that ended by a fault). 2: not done;",
        "one line says why. 130: interrupted.",
        "",
        "command | what it does | options",
        "---|---|---",
    ]
    operations = sorted(declared().operations, key=_group)
    lines += [f"`{one.words}`{_places(one)} | {_short(one.summary)} | {_options(one)}" for one in operations]
    lines += ["", "## Faults of the twin", ""]
    lines += ["For `bowden twin RIG --inject FAULT`; in brackets what may follow the name. Drives of a family have the"]
    lines += ["faults that their protocol allows ([how](run.md#try-a-fault-on-the-twin)).", ""]
    lines += ["fault | what it is", "---|---"]
    for name, kind in KINDS.items():
        amount = "" if kind.amount is None else f" [{kind.amount:g} {kind.unit}]"
        lines.append(f"`{name}`{' [joint, motor]' if kind.side else ''}{amount} | {_short(kind.meaning)}")
    return "\n".join([*lines, ""])


def _group(operation: Operation) -> str:
    """Commands with one word in their order, then each group."""
    first, _, rest = operation.words.partition(" ")
    return first if rest else ""


def _short(text: str) -> str:
    """A sentence up to its colon: what follows are details."""
    return text.partition(": ")[0].rstrip(".")


def _given(operation: Operation) -> Iterator[OperationParameter]:
    """What a command line gives an operation and its view."""
    writer = operation.viewer("write")
    both = parameters(operation.function) | ({} if writer is None else parameters(writer))
    for name, one in both.items():
        if not (isinstance(one.kind, Role) or name in ("found", "call") or one.switch.hidden):
            yield one


def _places(operation: Operation) -> str:
    return "".join(f" {one.option}" for one in _given(operation) if not one.alone)


def _options(operation: Operation) -> str:
    return ", ".join(f"`{one.option}`" for one in _given(operation) if one.alone and one.option not in _COMMON)


def write_docs(docs: Path) -> None:
    """Write the page where it belongs.

    Raises:
        OutputError: the file cannot be written.
    """
    write_text(docs / "commands.md", markdown())
