"""Docstrings as the site needs them: what is typed at a prompt is shown as code."""

import re
from typing import Any

import griffe

_PROMPT = re.compile(r"^>>> .*?(?=^\s*$|\Z)", re.DOTALL | re.MULTILINE)


class Prompts(griffe.Extension):
    """Fences around the examples that doctest runs."""

    def on_object(self, *, obj: griffe.Object, **kwargs: Any) -> None:
        """Mend the docstring of what griffe has read."""
        if obj.docstring is not None:
            obj.docstring.value = _PROMPT.sub(
                lambda found: f"```pycon\n{found[0].rstrip()}\n```\n", obj.docstring.value
            )
