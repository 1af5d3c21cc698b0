"""Docstrings and types as the site needs them: prompts are code, and a type has nothing for the command line."""

import re
from typing import Any

import griffe

_PROMPT = re.compile(r"^>>> .*?(?=^\s*$|\Z)", re.DOTALL | re.MULTILINE)


class Prompts(griffe.Extension):
    """Fences around the examples that doctest runs; types without their `Annotated`."""

    def on_function(self, *, func: griffe.Function, **kwargs: Any) -> None:
        """Leave out what a parameter's type says to the command line."""
        for one in func.parameters:
            kind = one.annotation
            if isinstance(kind, griffe.ExprSubscript) and str(kind.left).endswith("Annotated"):
                one.annotation = kind.slice.elements[0] if isinstance(kind.slice, griffe.ExprTuple) else kind.slice

    def on_object(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        """Mend the docstring of what griffe has read."""
        if obj.docstring is not None:
            obj.docstring.value = _PROMPT.sub(
                lambda found: f"```pycon\n{found[0].rstrip()}\n```\n", obj.docstring.value
            )
