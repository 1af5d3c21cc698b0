"""Operations declare themselves, a file each, and a command line imports the files that it needs and nothing heavy."""

import importlib
import json
import math
import subprocess
import sys
from pathlib import Path

import jsonschema
import pytest

from bowden.app import main
from bowden.core.errors import ParameterError
from bowden.core.guesses import UnknownArgumentError
from bowden.hardware.twin.injection import KINDS
from bowden.operations.schema import json_schema
from bowden.operations.support.operation import Operation, Role, declared, files, parameters
from bowden.operations.support.python import public
from bowden.operations.support.results import json_of

HEAVY = ("numpy", "numba", "scipy", "matplotlib", "pyarrow", "pydantic", "rich", "jinja2", "can", "asyncio")
OPERATIONS = declared().operations
GREET = '''
"""`greet`: an operation."""

from dataclasses import dataclass

from bowden.operations.support.operation import Operation
from bowden.operations.support.results import Result


@dataclass(frozen=True)
class Greeted(Result["Greeted"]):
    """Who was greeted."""

    greeted: str
    """Whom."""


def greet(name: str, *, loud: bool = False) -> Greeted:
    """Greet somebody.

    Args:
        name: whom.
        loud: so that all hear it; see `name`.
    """
    return Greeted(name.upper() if loud else name)


OPERATIONS = (Operation("greet", greet),)
'''
VIEW = """
def show_greet(found, call):
    print(f"Hello, {found.greeted}.")
"""


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
    alone = {one.words.split()[0] for one in OPERATIONS}
    assert {line.split()[0] for line in said.split("Commands:")[1].splitlines() if line[2:3].strip()} == alone
    assert not modules & set(HEAVY)
    assert len(modules) < 300  # 184, of them 33 an empty interpreter's, take 0.2 s
    assert {*files()} <= modules


TYPES = ("check", "simulate", "identify", "run", "log", "confirm", "measure")
"""Operations whose types are parts of the results of others."""


@pytest.mark.parametrize("words", ["init", "identify-servo", "twin", "log info", "emg serve"])
def test_a_command_line_imports_the_files_that_its_first_word_names(words: str) -> None:
    modules, said = loaded_by(*words.split(), "--help")
    assert f"bowden {words}" in said
    first = words.split()[0].split("-")[0]
    wanted = {name for name, word in files().items() if word == first}
    assert wanted <= modules & {*files()} <= wanted | {f"bowden.operations.{name}" for name in TYPES}
    assert not modules & set(HEAVY) - {"pydantic"}, "typer itself takes pydantic where it reads a command's words"


@pytest.mark.parametrize("one", OPERATIONS, ids=lambda one: one.words)
def test_an_operation_is_declared_as_it_is_found_shown_and_documented(
    one: Operation, capsys: pytest.CaptureFixture[str]
) -> None:
    assert one in declared(one.words.split()[0]).operations, "its file's name begins with its first word"
    assert main.run([*one.words.split(), "--help"]) == 0
    printed = capsys.readouterr().out
    assert one.examples
    assert all(example.startswith(f"bowden {one.words}") for example in one.examples)
    assert all(" ".join(example.split()) in " ".join(printed.split()) for example in one.examples)
    assert one.summary.endswith(".")
    assert "--json" in printed
    assert "`" not in printed
    for parameter in parameters(one.function).values():
        assert parameter.means or parameter.kind in (Role.TELL, Role.QUIET, Role.PROGRESS), parameter.name
    assert one.viewer("show") is not None
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
    assert set(found["schemas"]) == {"rig", "study", *(one.words for one in OPERATIONS)}
    assert main.run(["schema"]) == 0
    assert {line[:16].strip() for line in capsys.readouterr().out.splitlines()} == set(found["schemas"])
    assert main.run(["schema", "rgi"]) == 2
    assert "'rgi'; expected a name that bowden schema lists" in capsys.readouterr().err


def test_a_schema_has_what_the_types_say() -> None:
    info = json_schema("log info")
    assert info["additionalProperties"] is False
    gain = info["$defs"]["GainChange"]["properties"]["before"]
    assert gain == {"description": "Value in force before, in the law's own unit.", "type": "number"}
    check = json_schema("check")
    assert {"law", "verdict", "joints", "seconds"} <= {*check["required"]}
    assert not {"checks", "whole", "notes", "interrupted"} & {*check["properties"]}


def test_a_number_that_does_not_exist_is_null() -> None:
    assert json_of({"a": (1.0, math.nan, math.inf), "b": Path("c")}) == {"a": [1.0, None, None], "b": "c"}


def test_no_two_operations_have_the_same_words() -> None:
    words = [one.words for one in OPERATIONS]
    assert len(set(words)) == len(words)
    assert set(declared().groups) == {one.split()[0] for one in words if " " in one}


def test_a_new_operation_is_its_file_and_its_view(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    for name, text in (("operations", GREET), ("views", VIEW)):
        (tmp_path / name).mkdir()
        (tmp_path / name / "greet.py").write_text(text)
        package = importlib.import_module(f"bowden.{name}")
        monkeypatch.setattr(package, "__path__", [*package.__path__, str(tmp_path / name)])
    assert main.run(["greet", "Anna"]) == 0
    assert capsys.readouterr().out == "Hello, Anna.\n"
    assert main.run(["greet", "Anna", "--loud", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    jsonschema.validate(found, json_schema("greet"))
    assert found["greeted"] == "ANNA"
    assert main.run(["--help"]) == 0
    assert "greet           Greet somebody." in capsys.readouterr().out
    assert main.run(["greet"]) == 2
    assert capsys.readouterr().err == "bowden: Missing argument 'name'; see bowden greet --help\n"
    greet = public(importlib.import_module("bowden.operations.greet").greet)
    assert greet("Anna").greeted == "Anna"
    with pytest.raises(ParameterError, match="greet: loud is 3; expected True or False"):
        greet("Anna", loud=3)
    with pytest.raises(UnknownArgumentError, match="greet has no 'lod': did you mean loud"):
        greet("Anna", lod=True)
    for name in ("operations", "views"):
        sys.modules.pop(f"bowden.{name}.greet")


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["simulat"], "No such command 'simulat'. Did you mean 'simulate'? See bowden --help"),
        (["log", "inf"], "No such command 'inf'. Did you mean 'info'? See bowden log --help"),
        (["emg"], "Missing command; see bowden emg --help"),
    ],
)
def test_a_command_that_there_is_not(words: list[str], said: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run(words) == 2
    assert capsys.readouterr().err == f"bowden: {said}\n"


def test_the_bare_command_shows_its_help(capsys: pytest.CaptureFixture[str]) -> None:
    assert main.run([]) == 0
    assert "Usage: bowden" in capsys.readouterr().out


def test_the_twins_list_of_faults_is_a_document_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "rig.toml").write_text("")
    assert main.run(["twin", str(tmp_path / "rig.toml"), "--inject", "list", "--json"]) == 0
    document = json.loads(capsys.readouterr().out)
    jsonschema.validate(document, json_schema("twin"))
    assert [one["fault"] for one in document["faults"]] == list(KINDS)
