"""``bowden init``: a commented rig.toml of the default bench, or of a bench with an identified cable."""

import os
from pathlib import Path
from typing import Annotated

import typer

from bowden.app.command import Command
from bowden.app.console import print_json, say_trust, seconds
from bowden.app.next_step import say_next
from bowden.core.errors import OutputError
from bowden.core.files import shortened


def init(
    path: Annotated[Path, typer.Argument(help="The file to write.")] = Path("rig.toml"),
    model: Annotated[
        Path | None,
        typer.Option(help="model.toml of bowden identify: a bench with that cable, within its motion."),
    ] = None,
    suit: Annotated[
        bool, typer.Option("--suit", help="Write a suit on an arm, moved by EMG, in place of the bench.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file that is there.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Write a commented rig.toml of the default bench: every key with its unit and meaning.

    With --model it has that cable, a reference within the motion that the cable's log covered, limits round it, and the
    law bowden where a check says that it holds there, if need be with a smaller bandwidth; else one that does, and why.
    With --suit too, both cables of the suit lose what that one does.
    """
    from bowden.core.files import whole_file
    from bowden.design.other_law import OURS
    from bowden.design.rig_of_bench import toml_text
    from bowden.design.rig_of_suit import suit_text

    try:
        is_there, is_folder = path.exists(), path.is_dir()
    except OSError as error:
        raise OutputError(f"cannot write {shortened(str(path))}: {error.strerror}", do="choose another name") from error
    if is_folder:
        raise OutputError(f"{path} is a folder", do=f"name the file: {path / 'rig.toml'}")
    if is_there and not force:
        raise OutputError(f"{path} is there already", do="choose another name, or overwrite it with --force")
    said: list[str] = []
    if model is not None:
        text, said = _with_model(path, model, suit=suit)
    else:
        text = suit_text(path.name) if suit else toml_text(path.name, OURS)
    with whole_file(path) as part:
        part.write_text(text, encoding="utf-8")
    if json:
        print_json({"files": [str(path)], "seconds": seconds()})
        return
    print(f"Wrote {path}")
    for line in said:
        print(line)
    say_next(*(("run", path, "--twin") if suit else ("simulate", path)))


def _with_model(path: Path, model: Path, *, suit: bool) -> tuple[str, list[str]]:
    """The text of a rig with an identified cable, and what is said of it.

    Raises:
        ParameterError: a model that cannot be read.
    """
    from bowden.face.init import around
    from bowden.plants.identified import load_cable

    place = Path(os.path.relpath(model.absolute(), path.absolute().parent)).as_posix()
    cable = load_cable(model)
    say_trust(cable.trust)
    made = around(cable, path, place, suit=suit)
    return made.text, list(made.notes)


COMMANDS = (
    Command(
        "init",
        init,
        "Write a commented rig.toml of the default bench.",
        (
            "bowden init",
            "bowden init my_rig.toml --force",
            "bowden init --model out/identify/model.toml",
            "bowden init suit.toml --suit --model out/identify/model.toml",
        ),
        place=10,
    ),
)
