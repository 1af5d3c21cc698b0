"""The commands declare themselves, a file each, and a command line imports the file that it needs and nothing heavy."""

import inspect
import json
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest

from bowden import app
from bowden.app import main
from bowden.app.command import Command, files, found
from bowden.app.documents import DOCUMENTS
from bowden.app.schema_command import json_schema
from bowden.hardware.twin.injection import KINDS

HEAVY = ("numpy", "numba", "scipy", "matplotlib", "pyarrow", "pydantic", "rich", "jinja2", "can", "asyncio")
COMMANDS = found().commands
GREET = '''
from typing import Annotated

import typer

from bowden.app.command import Command
from bowden.app.console import print_json, seconds


def greet(
    name: Annotated[str, typer.Argument(help="Whom.")],
    json: Annotated[bool, typer.Option("--json", help="Print one JSON document and nothing else.")] = False,
) -> None:
    """Greet somebody."""
    if json:
        print_json({"greeted": name, "seconds": seconds()})
    else:
        print(f"Hello, {name}.")


COMMANDS = (Command("greet", greet, "Greet somebody.", ("bowden greet Anna",)),)
'''


def loaded_by(*words: str) -> tuple[set[str], str]:
    """The modules that a command line imports, in a process of its own, and what it prints before."""
    code = (
        f"import sys; from bowden.app.main import run; code = run({list(words)!r}); "
        "print('\\n' + ' '.join(sys.modules)); sys.exit(code)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    said, _, modules = done.stdout.rstrip().rpartition("\n")
    return set(modules.split()), said


def test_help_tells_every_command_and_loads_nothing_heavy() -> None:
    modules, said = loaded_by("--help")
    alone = {one.words.split()[0] for one in COMMANDS}
    assert {line.split()[0] for line in said.split("Commands:")[1].splitlines() if line[2:3].strip()} == alone
    assert not modules & set(HEAVY)
    assert len(modules) < 300  # 184, of them 33 an empty interpreter's, take 0.2 s
    assert {f"bowden.app.{name}" for name in files()} <= modules


@pytest.mark.parametrize("words", ["init", "identify-servo", "twin", "log info", "emg serve"])
def test_a_command_line_imports_the_files_that_its_first_word_names(words: str) -> None:
    modules, said = loaded_by(*words.split(), "--help")
    assert f"bowden {words}" in said
    first = words.split()[0].split("-")[0]
    wanted = {f"bowden.app.{name}" for name in files() if name.split("_")[0] == first}
    assert {name for name in modules if name.startswith("bowden.app.") and name.endswith("_command")} == wanted
    assert not modules & set(HEAVY) - {"pydantic"}, "typer itself takes pydantic where it reads a command's words"


@pytest.mark.parametrize("one", COMMANDS, ids=lambda one: one.words)
def test_a_command_is_declared_as_it_is_found_shown_and_documented(
    one: Command, capsys: pytest.CaptureFixture[str]
) -> None:
    assert one in found(one.words.split()[0]).commands, "its file's name begins with its first word"
    assert main.run([*one.words.split(), "--help"]) == 0
    printed = capsys.readouterr().out
    assert one.examples
    assert all(example.startswith(f"bowden {one.words}") for example in one.examples)
    assert all(" ".join(example.split()) in " ".join(printed.split()) for example in one.examples)
    assert one.summary.endswith(".")
    assert "json" in inspect.signature(one.function).parameters
    schema = json_schema(one.words)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert schema["title"] == f"bowden {one.words} --json"


@pytest.mark.parametrize("name", ["rig", "log info", "twin"])
def test_a_schema_is_printed_by_its_name(name: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(["schema", *name.split()]) == 0
    assert json.loads(capsys.readouterr().out) == json_schema(name)
    assert main.run(["schema", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    jsonschema.validate(found, json_schema("schema"))
    assert set(found["schemas"]) == {"rig", "study", *DOCUMENTS} == {"rig", "study", *(one.words for one in COMMANDS)}
    assert main.run(["schema"]) == 0
    assert {line[:16].strip() for line in capsys.readouterr().out.splitlines()} == set(found["schemas"])
    assert main.run(["schema", "rgi"]) == 2
    assert "'rgi'; expected a name that bowden schema lists" in capsys.readouterr().err


def test_a_schema_has_what_the_types_say() -> None:
    replay = json_schema("log replay")
    one, several = (replay["$defs"][part["$ref"].split("/")[-1]] for part in replay["anyOf"])
    asked = several["properties"]["axes"]["items"]["required"]
    assert set(asked) == {"axis", *one["required"]} - {"file", "seconds"}
    assert json_schema("log info")["additionalProperties"] is False
    gain = json_schema("log info")["$defs"]["_Gain"]["properties"]["from"]
    assert gain == {"description": "Value in force before, in the law's own unit.", "type": "number"}


def test_no_two_commands_have_the_same_words() -> None:
    words = [one.words for one in COMMANDS]
    assert len(set(words)) == len(words)
    assert set(found().groups) == {one.split()[0] for one in words if " " in one}


def test_a_new_command_is_one_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "greet_command.py").write_text(GREET)
    monkeypatch.setattr(app, "__path__", [*app.__path__, str(tmp_path)])
    assert main.run(["greet", "Anna"]) == 0
    assert capsys.readouterr().out == "Hello, Anna.\n"
    assert main.run(["greet", "Anna", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["greeted"] == "Anna"
    assert main.run(["--help"]) == 0
    assert "greet           Greet somebody." in capsys.readouterr().out
    assert main.run(["greet"]) == 2
    assert capsys.readouterr().err == "bowden: Missing argument 'name'; see bowden greet --help\n"
    sys.modules.pop("bowden.app.greet_command")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["simulat"], "No such command 'simulat'. Did you mean 'simulate'? See bowden --help"),
        (["log", "inf"], "No such command 'inf'. Did you mean 'info'? See bowden log --help"),
        (["emg"], "Missing command; see bowden emg --help"),
        ([], "Missing command; see bowden --help"),
    ],
)
def test_a_command_that_there_is_not(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(words) == 2
    assert capsys.readouterr().err == f"bowden: {said}\n"


def test_the_twins_list_of_faults_is_a_document_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "rig.toml").write_text("")
    assert main.run(["twin", str(tmp_path / "rig.toml"), "--inject", "list", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, json_schema("twin"))
    assert [one["fault"] for one in document["faults"]] == list(KINDS)
