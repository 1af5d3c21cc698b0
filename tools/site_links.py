"""Links of the pages as the site needs them: to pages of it, or to nothing where the source is no part of it."""

import os
import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
OUTSIDE = {"CONTRIBUTING.md": "contributing.md"}
"""Files beside docs/ that are pages of the site as well, and their place in it."""
FOLDERS = {"docs/decisions": "decisions/index.md"}
"""Folders that pages link to, and the page that lists each."""
_SHOWN = (".md", ".svg", ".png")
_CODE = re.compile(r"(^```.*?^```$)", re.DOTALL | re.MULTILINE)
_PATH = re.compile(r"[\w./-]+\.(?:py|toml)|[\w.-]+(?:/[\w.-]+)+/?")
_LINK = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\[\]]*\])*)\]\(([^)\s]+)\)")


def relinked(text: str, origin: str, uri: str) -> str:
    """A page with its links made for the site.

    Args:
        text: in Markdown.
        origin: the file that it is from, from the root of the repository.
        uri: its place in the site's source, from docs/.
    """

    def one(match: "re.Match[str]") -> str:
        target = placed(match[3], origin, uri)
        if target is not None:
            return f"{match[1]}[{match[2]}]({target})"
        return f"`{match[2]}`" if _PATH.fullmatch(match[2]) else match[2]

    parts = _CODE.split(text)
    return "".join(part if i % 2 else _LINK.sub(one, part) for i, part in enumerate(parts))


def placed(target: str, origin: str, uri: str) -> str | None:
    """Where a link goes in the site; None where it goes to what the site does not have."""
    if re.match(r"[a-z]+:", target):
        return target
    file, _, anchor = target.partition("#")
    path = os.path.normpath(os.path.join(os.path.dirname(origin), file)) if file else origin
    if path in FOLDERS:
        goal = FOLDERS[path]
    elif path in OUTSIDE:
        goal = OUTSIDE[path]
    elif path.startswith("docs/") and path.endswith(_SHOWN):
        goal = path.removeprefix("docs/")
    elif path.endswith(".ipynb"):
        goal = f"notebooks/{Path(path).stem}.md"
    else:
        return None
    here = "" if goal == uri and anchor else os.path.relpath(goal, os.path.dirname(uri) or ".")
    return f"{here}#{anchor}" if anchor else here
