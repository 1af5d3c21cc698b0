"""Notebooks as pages: their text, code and results as Markdown, so that they look as all other pages do."""

import base64
import json
import re
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).parents[1] / "docs" / "notebooks"
_DRAWING = re.compile(r"<svg.*?</svg>", re.DOTALL)
_COLOUR = re.compile(r"\x1b\[[0-9;]*m")


def notebooks() -> list[Path]:
    """All that there are, by name."""
    return sorted(FOLDER.glob("*.ipynb"))


def page(path: Path) -> tuple[str, dict[str, bytes]]:
    """A notebook as Markdown, and the pictures that the page shows by their names."""
    pictures: dict[str, bytes] = {}
    parts = []
    for cell in json.loads(path.read_text(encoding="utf-8"))["cells"]:
        source = _text(cell["source"])
        if cell["cell_type"] == "markdown":
            parts.append(source)
        elif cell["cell_type"] == "code" and source.strip():
            parts.append(f"```python\n{source}\n```")
            parts += [_shown(output, path.stem, pictures) for output in cell["outputs"]]
    head, _, rest = "\n\n".join(part for part in parts if part).partition("\n")
    note = f"*The notebook [{path.name}]({path.name}), as it ran.*"
    return f"{head}\n\n{note}\n\n{rest.lstrip()}\n", pictures


def _text(lines: Any) -> str:
    return lines if isinstance(lines, str) else "".join(lines)


def _shown(output: dict[str, Any], name: str, pictures: dict[str, bytes]) -> str:
    data = output.get("data", {})
    for kind, suffix in (("image/svg+xml", "svg"), ("image/png", "png")):
        if kind in data:
            raw = _text(data[kind])
            return _picture(raw.encode() if suffix == "svg" else base64.b64decode(raw), suffix, name, pictures)
    if "text/html" in data:  # a table, and drawings in it
        return _table(_text(data["text/html"]), name, pictures)
    text = _text(output.get("text", data.get("text/plain", "")))
    return f"```text\n{_COLOUR.sub('', text).rstrip()}\n```" if text.strip() else ""


def _table(html: str, name: str, pictures: dict[str, bytes]) -> str:
    drawn = [_picture(svg.encode(), "svg", name, pictures) for svg in _DRAWING.findall(html)]
    rest = " ".join(re.sub(r"<\?xml.*?\?>|<!DOCTYPE.*?>", "", _DRAWING.sub("", html), flags=re.DOTALL).split())
    return "\n\n".join([rest, *drawn])


def _picture(content: bytes, suffix: str, name: str, pictures: dict[str, bytes]) -> str:
    file = f"{name}-{len(pictures) + 1}.{suffix}"
    pictures[file] = content
    return f"![Drawn by the cell above]({file})"
