"""``bowden init``: a commented rig.toml of the default bench."""

from pathlib import Path
from typing import Annotated

import typer

from bowden.app.command import Command
from bowden.app.console import print_json, seconds
from bowden.core.errors import OutputError
from bowden.core.files import shortened


def init(
    path: Annotated[Path, typer.Argument(help="The file to write.")] = Path("rig.toml"),
    suit: Annotated[
        bool, typer.Option("--suit", help="Write a suit on an arm, moved by EMG, in place of the bench.")
    ] = False,
    force: Annotated[bool, typer.Option("--force", help="Overwrite a file that is there.")] = False,
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Write a commented rig.toml of the default bench: every key with its unit and meaning."""
    from bowden.core.files import whole_file
    from bowden.rig import suit_rig
    from bowden.rig.page import toml_text

    try:
        is_there, is_folder = path.exists(), path.is_dir()
    except OSError as error:
        raise OutputError(f"cannot write {shortened(str(path))}: {error.strerror}", do="choose another name") from error
    if is_folder:
        raise OutputError(f"{path} is a folder", do=f"name the file: {path / 'rig.toml'}")
    if is_there and not force:
        raise OutputError(f"{path} is there already", do="choose another name, or overwrite it with --force")
    with whole_file(path) as part:
        text = suit_rig.TEXT.format(name=path.name) if suit else toml_text(path.name)
        part.write_text(text, encoding="utf-8")
    if json:
        print_json({"files": [str(path)], "seconds": seconds()})
    else:
        print(f"Wrote {path}. Next: bowden {'run' if suit else 'simulate'} {path}{' --twin' * suit}")


COMMANDS = (
    Command(
        "init",
        init,
        "Write a commented rig.toml of the default bench.",
        (
            "bowden init",
            "bowden init my_rig.toml --force",
        ),
        place=10,
    ),
)
