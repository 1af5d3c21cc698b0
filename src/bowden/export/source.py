"""The source of a kernel: its tree, its comments, and what to say of a place in it."""

import ast
import inspect
import io
import linecache
import sys
import textwrap
import tokenize
from collections.abc import Callable, Sequence
from functools import cache
from types import FunctionType
from typing import Any

from bowden.core.errors import ParameterError
from bowden.core.quantity import texts_of

_ADVICE: dict[str, tuple[type[ast.AST], ...]] = {
    "write a loop over a fixed range: for i in range(n)": (ast.While,),
    "test with an if before: math.isfinite(x), or x != 0.0 before x divides": (ast.Try,),
    "return a number that says so; a kernel has no exceptions": (ast.Raise,),
    "take it out; check arguments where the kernel is made": (ast.Assert,),
    "write its terms one by one, or a loop that adds up": (ast.ListComp, ast.GeneratorExp),
    "use a NamedTuple": (ast.Dict, ast.DictComp, ast.List, ast.Set),
    "write a kernel: @kernel def name(x: float) -> float": (ast.Lambda,),
    "write it outside, as a kernel of its own": (ast.FunctionDef,),
    "take texts out of the kernel": (ast.JoinedStr,),
    "take files and locks out of the kernel": (ast.With,),
    "put it into the state": (ast.Global, ast.Nonlocal),
    "use an if within the loop": (ast.Break, ast.Continue),
    "multiply, or call bowden.core.kernel.power(a, b)": (ast.Pow,),
    "use a - b*floor(a/b), with floor of bowden.core.kernel": (ast.Mod,),
    "use floor(a/b), with floor of bowden.core.kernel": (ast.FloorDiv,),
    "leave it out": (ast.Delete,),
    "assign on a line of its own": (ast.NamedExpr,),
    "name the values one by one": (ast.Starred, ast.Slice),
    "compare numbers with ==": (ast.Is,),
    "compare numbers with !=": (ast.IsNot,),
    "compare with == and or": (ast.In,),
    "compare with != and and": (ast.NotIn,),
}
INSTEAD = {node: advice for advice, nodes in _ADVICE.items() for node in nodes}
"""What the subset has in place of what it does not have."""


class KernelSource:
    """One function as its file has it."""

    def __init__(self, function: FunctionType) -> None:
        self.module, self.file = function.__module__, function.__code__.co_filename
        self._description = description(function)
        try:
            lines, self.first = inspect.getsourcelines(function)
        except (OSError, TypeError):
            name = function.__qualname__
            raise ParameterError(f"{name} has no source to be exported", do="define it with def in a file") from None
        text = textwrap.dedent("".join(lines))
        node = ast.parse(text).body[0]
        if not isinstance(node, ast.FunctionDef):
            raise self.refused(node, "", INSTEAD[ast.Lambda])
        self.body = node.body[ast.get_docstring(node) is not None :]
        """The statements without the docstring."""
        self._lines = text.splitlines()
        self._above: dict[int, list[str]] = {}
        """Line of a statement → comments that stand on lines of their own above it."""
        starts = [one.lineno for one in ast.walk(node) if isinstance(one, ast.stmt)]
        for token in tokenize.generate_tokens(io.StringIO(text).readline):
            if token.type == tokenize.COMMENT and not token.line[: token.start[1]].strip():
                below = min((line for line in starts if line > token.start[0]), default=0)
                self._above.setdefault(below, []).append(token.string.lstrip("# "))

    def docstring(self) -> list[str]:
        """Its module and its docstring without the examples, as a comment."""
        first, *more = self._description
        short = f"{self.module}: {first}".rstrip(": ")
        return comments([short, *more] if len(short) < 112 else [f"{self.module}:", first, *more])

    def above(self, one: ast.stmt) -> list[str]:
        """The comments above a statement, once."""
        return comments(self._above.pop(one.lineno, []))

    def is_blank_after(self, one: ast.stmt) -> bool:
        """Whether an empty line stands behind a statement."""
        return not "".join(self._lines[one.end_lineno or 0 :][:1]).strip()

    def refused(self, node: ast.AST, why: str = "", do: str = "", expected: str = "") -> ParameterError:
        """The error that a place in it is outside the subset."""
        line = self.first + getattr(node, "lineno", 1) - 1
        text = f"{ast.unparse(node.func)}()" if isinstance(node, ast.Call) else ast.unparse(node).partition("\n")[0]
        text = f"{text[:40]}{why and f', {why},'} cannot be exported"
        advice = [INSTEAD[type(one)] for one in (node, *operators(node)) if type(one) in INSTEAD]
        do = do or (advice or ["keep to the subset of docs/own_law.md"])[0]
        return ParameterError(f"{self.file}, line {line}: {text}", expected=expected, do=do)


def operators(node: ast.AST) -> list[ast.AST]:
    """The operators of an expression: one, several of a comparison, or none."""
    return [node.op] if isinstance(node, ast.BinOp | ast.UnaryOp | ast.BoolOp) else list(getattr(node, "ops", ()))


@cache
def origin(file: str, name: str) -> tuple[str, str]:
    """The file in which a constant was first assigned, and what is said of it there."""
    text = "".join(linecache.getlines(file))
    body = ast.parse(text).body
    texts = texts_of(body, text)
    for node in body if name not in texts else ():
        if isinstance(node, ast.ImportFrom):
            other = getattr(sys.modules.get(node.module or ""), "__file__", None)
            for one in node.names if other else ():
                if (one.asname or one.name) == name:
                    return origin(str(other), one.name)
    return file, texts.get(name, "")


def description(function: Callable[..., Any]) -> list[str]:
    """Lines of a docstring without the examples."""
    return (inspect.getdoc(function) or "").partition("\n>>>")[0].strip().split("\n")


def comments(lines: Sequence[str]) -> list[str]:
    """Lines as a comment; nothing where there are none."""
    rows = [one.replace("*/", "* /").replace("/*", "/ *").rstrip() for one in lines]
    rows = [f"{' *' if k else '/*'} {one}".rstrip() for k, one in enumerate(rows)]
    return [*rows[:-1], f"{rows[-1]} */"] if rows else []


def comment(text: str) -> str:
    """A text behind a line of C; nothing where there is none."""
    return "".join(f" {one}" for one in comments([" ".join(text.split())] if text.strip() else []))
