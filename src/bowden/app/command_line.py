"""An operation as a command: its options by its signature and docstring, its result as a view or as JSON."""

import contextlib
import inspect
import re
import sys
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import typer

from bowden.app.console import InterruptedPartway, ProgressBar, folder_argument, print_json, seconds, trusting
from bowden.core.caller import in_commands, speaking
from bowden.core.errors import BowdenError, note
from bowden.core.files import output_folder
from bowden.operations.support.operation import Operation, OperationParameter, Role, parameters
from bowden.operations.support.results import Result, doubt, json_of, trusted
from bowden.views.text import Call

_JSON = Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")]


def command(operation: Operation) -> Callable[..., None]:
    """The function that typer makes a command of."""
    writer, view = operation.viewer("write"), operation.viewer("show")
    own = parameters(operation.function)
    more = {} if writer is None else parameters(writer)
    offered = {name: one for name, one in (own | more).items() if not _of_the_rim(one, name)}
    options = {name: one.option for name, one in offered.items()}

    def run(json: bool, **given: Any) -> None:
        def words(name: str, value: Any) -> str:
            return in_commands(options.get(name, name).removeprefix("--"), value)

        with speaking(words), contextlib.closing(ProgressBar(quiet=json)) as bar:
            for name, one in offered.items():
                if one.is_folder and given[name] is not None:
                    output_folder(given[name], one.option)
            call, rigs = Call(given, options, seconds), list[Any]()
            try:
                found = trusting(lambda: _called(operation, own, given, rigs, bar, json), unasked=_trusts(given))
                going_on = inspect.isgenerator(found)
                first = next(found, None) if going_on else found
                if first is None:
                    return
                if writer is not None:
                    kept = {name: given[name] for name in more if name in given}
                    call = replace(call, write=partial(writer, first, **kept))
                bar.close()
                if first.interrupted:
                    where = next((given[name] for name, one in offered.items() if one.is_folder), None)
                    place = f"written to {where or call.files[-1]}" if call.files else "not written"
                    raise InterruptedPartway(f"{first.interrupted} {place}")
                code = _shown(view, first, call, json, rigs, writes=writer is not None)
                if going_on:
                    sys.stdout.flush()
                    _ = [*found]
                    if (ended := operation.viewer("ended")) and not json:
                        ended(first, call)
            except KeyboardInterrupt as stop:
                if str(stop):  # it says what is kept
                    raise InterruptedPartway(str(stop)) from None
                raise
            except BowdenError as error:
                if (failed := operation.viewer("failed")) and not json:
                    failed(error, call)
                raise
        if code or first.exit_code:
            raise typer.Exit(code or first.exit_code)

    form = [_parameter(one, [*offered]) for one in offered.values()]
    json = inspect.Parameter("json", inspect.Parameter.KEYWORD_ONLY, annotation=_JSON, default=False)
    run.__signature__ = inspect.Signature([*form, json])  # type: ignore[attr-defined]
    run.__annotations__ = {one.name: one.annotation for one in (*form, json)}
    run.__doc__ = _in_switches(operation.text, options)
    return run


def _of_the_rim(one: OperationParameter, name: str) -> bool:
    """True if a parameter is handed over by the command itself, and is no option."""
    return isinstance(one.kind, Role) or name in ("found", "call")


def _trusts(given: dict[str, Any]) -> bool:
    """True if the user has said that a program in a log may run."""
    return bool(given.get("trust_law"))


def _called(
    operation: Operation,
    own: dict[str, OperationParameter],
    given: dict[str, Any],
    rigs: list[Any],
    bar: ProgressBar,
    json: bool,
) -> Any:
    """What an operation returns, called with what the command line has; the rigs that it reads are kept in a list."""
    rigs.clear()
    values = {name: given[name] for name in own if name in given}
    for name, one in own.items():
        if one.is_rig and values[name] is not None and values[name] != Path("-"):
            from bowden.operations.support.given import rig_of

            values[name] = rig_of(values[name])
            rigs.append(values[name])
    hands = {Role.PROGRESS: bar, Role.TELL: note, Role.QUIET: json}
    values |= {name: hands[one.kind] for name, one in own.items() if one.kind in hands}
    return operation.function(**values)


def _shown(view: Any, found: Result[Any], call: Call, json: bool, rigs: list[Any], *, writes: bool) -> int | None:
    """Print a result: as one document, or as its view has it, which may say how the command ends."""
    if json:
        _ = call.files  # one document or one line of error
    for text in found.notes:
        if not (json and text in found.needless):
            note(text)
    found = trusted(found, rigs)
    said = doubt(found, rigs)
    trust = found.cable_trust if said else None
    if json and found.whole_document is not None:
        print_json(found.whole_document)
        return None
    if json:
        document = json_of(found)
        if writes:
            document.setdefault("files", json_of(call.files))
        if trust is not None:
            document.setdefault("trust", json_of(trust))
        print_json(document | {"seconds": seconds()})
        return None
    if said:
        print(said)
    code: int | None = view(found, call)
    _ = call.files  # written now, where the view does not name them
    return code


def _parameter(one: OperationParameter, names: list[str]) -> inspect.Parameter:
    """Arguments of typer for a parameter."""
    switch = one.switch
    said: dict[str, Any] = {"help": _in_switches(one.means[:1].upper() + one.means[1:], {}), "metavar": switch.metavar}
    if one.is_folder:
        said["parser"] = lambda given: folder_argument(given, one.option)
    said |= {"min": switch.least, "max": switch.most, "hidden": switch.hidden}
    kind = one.kind | None if one.default is None and one.kind is not bool else one.kind
    mark = typer.Option(one.option, **said) if one.alone else typer.Argument(**said)
    return inspect.Parameter(
        one.name, inspect.Parameter.KEYWORD_ONLY, annotation=Annotated[kind, mark], default=one.default
    )


def _in_switches(text: str, options: dict[str, str]) -> str:
    """A docstring's text for a terminal: parameters as switches, without the marks of code."""
    text = re.sub(r"(?<!`)`(\w+)`(?!`)", lambda found: options.get(found[1], found[1]), text)
    return text.replace("``", "").replace("`", "")
