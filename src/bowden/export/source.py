"""The source of a kernel: its tree, its comments, and what to say of a place in it."""

import ast
import inspect
import io
import sys
import textwrap
import tokenize
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any

from bowden.core.errors import ParameterError

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

    def __init__(self, function: Callable[..., Any]) -> None:
        self.function = function
        try:
            lines, first = inspect.getsourcelines(function)
        except (OSError, TypeError):
            name = getattr(function, "__qualname__", repr(function))
            raise ParameterError(f"{name} has no source to be exported", do="define it with def in a file") from None
        text = textwrap.dedent("".join(lines))
        node = ast.parse(text).body[0]
        self.file, self.first = inspect.getsourcefile(function) or "?", first
        if not isinstance(node, ast.FunctionDef):
            raise self.refused(node, "a lambda or a coroutine", "write a kernel: @kernel def name(x: float) -> float")
        self.node = node
        self.body = node.body[1:] if ast.get_docstring(node) is not None else node.body
        """The statements without the docstring."""
        self._lines = text.splitlines()
        self.comments = {
            token.start[0]: token.string.lstrip("# ")
            for token in tokenize.generate_tokens(io.StringIO(text).readline)
            if token.type == tokenize.COMMENT and not token.line[: token.start[1]].strip()
        }

    def is_blank_after(self, one: ast.stmt) -> bool:
        """Whether an empty line stands behind a statement."""
        return not "".join(self._lines[one.end_lineno or 0 :][:1]).strip()

    @property
    def said(self) -> str:
        """The docstring, without its examples."""
        text = ast.get_docstring(self.node) or ""
        return text.partition("\n>>>")[0].strip()

    def refused(self, node: ast.AST, what: str, do: str, expected: str = "") -> ParameterError:
        """The error that a place in it is outside the subset."""
        line = self.first + getattr(node, "lineno", 1) - 1
        return ParameterError(f"{self.file}, line {line}: {what} cannot be exported", expected=expected, do=do)

    def outside(self, node: ast.AST, where: ast.AST | None = None) -> ParameterError:
        """The error that C is not made of such a thing; an operator has no line, and is `where` its expression is."""
        word = "" if where else ast.unparse(node).partition("\n")[0]
        what = word if 0 < len(word) < 40 else type(node).__name__
        return self.refused(where or node, what, INSTEAD.get(type(node), "keep to the subset of docs/own_law.md"))


@cache
def _tree(file: str) -> tuple[list[ast.stmt], list[str]]:
    try:
        text = Path(file).read_text(encoding="utf-8")
    except OSError:
        text = ""
    return ast.parse(text).body, text.splitlines()


@cache
def origin(file: str, name: str) -> tuple[str, str]:
    """The file in which a constant was first assigned, and what is said of it there: below it, or behind it."""
    body, lines = _tree(file)
    for node, after in zip(body, [*body[1:], ast.Pass()], strict=False):
        if isinstance(node, ast.ImportFrom):
            other = getattr(sys.modules.get(node.module or ""), "__file__", None)
            for one in node.names if other else ():
                if (one.asname or one.name) == name:
                    return origin(str(other), one.name)
        targets = getattr(node, "targets", None) or [getattr(node, "target", ast.Pass())]
        if any(isinstance(one, ast.Name) and one.id == name for target in targets for one in ast.walk(target)):
            text = after.value.value if isinstance(after, ast.Expr) and isinstance(after.value, ast.Constant) else None
            behind = lines[(node.end_lineno or 1) - 1][node.end_col_offset or 0 :].partition("#")[2]
            return file, " ".join((text if isinstance(text, str) else behind).split())
    return file, ""
