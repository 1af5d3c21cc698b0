"""A command line within the tests' process, in the current folder, and what it prints."""

import json
import shlex
from typing import Any, NamedTuple

import jsonschema
import pytest

from bowden.app import main
from bowden.operations.schema import json_schema
from bowden.operations.support.operation import declared


class Printed(NamedTuple):
    """What a command printed."""

    out: str
    err: str


def split(words: tuple[object, ...]) -> list[str]:
    """Arguments as they are, or one text as a shell splits it."""
    return [str(word) for word in words] if len(words) > 1 else shlex.split(str(words[0]))


class Command:
    """Runs command lines: each word an argument, or one text that a shell would split."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys

    def __call__(self, *words: object, code: int = 0) -> Printed:
        """What it prints, with this exit code."""
        self._capsys.readouterr()
        found = main.run(split(words))
        printed = Printed(*self._capsys.readouterr())
        assert found == code, printed
        return printed

    def whole(self, *words: object, code: int = 0) -> tuple[dict[str, Any], str]:
        """Its one document, as its schema has it, and what it says beside."""
        given = split(words)
        printed = self(*given, "--json", code=code)
        found = json.loads(printed.out)
        named = [
            one.words for one in declared(given[0]).operations if given[: len(one.words.split())] == one.words.split()
        ]
        jsonschema.validate(found, json_schema(max(named, key=len)))
        return found, printed.err

    def document(self, *words: object, code: int = 0) -> dict[str, Any]:
        """Its one document, as its schema has it."""
        return self.whole(*words, code=code)[0]

    def refused(self, *words: object, code: int = 2, figures: bool = False) -> str:
        """The one line with which it ends; nothing else is printed but, where they are there, the result's figures."""
        printed = self(*words, code=code)
        assert (printed.out != "") is figures
        assert printed.err.startswith("bowden: ")
        assert printed.err.count("\n") == 1
        return printed.err
