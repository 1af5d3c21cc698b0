"""Whether a built site loads anything from elsewhere: ``python tools/site_check.py out/site``; if so, exit code 1."""

import re
import sys
from html.parser import HTMLParser
from pathlib import Path

_LOADS = {
    "script": ("src",),
    "img": ("src", "srcset"),
    "iframe": ("src",),
    "source": ("src", "srcset"),
    "video": ("src", "poster"),
    "audio": ("src",),
    "embed": ("src",),
    "object": ("data",),
    "link": ("href",),
    "use": ("href", "xlink:href"),
}
"""Tags that make a browser fetch something, and by which of their attributes. A link to be clicked on is none."""
_ELSEWHERE = re.compile(r"^\s*(?:https?:)?//", re.IGNORECASE)
_IN_STYLE = re.compile(r"(?:url\(|@import)\s*['\"]?\s*((?:https?:)?//[^'\")\s;]+)", re.IGNORECASE)


class _Loads(HTMLParser):
    def __init__(self) -> None:
        super().__init__()
        self.found: list[str] = []
        self._style = False

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        """Look at what the tag fetches."""
        self._style = tag == "style"
        for name, value in attrs:
            if name in _LOADS.get(tag, ()) and value and _ELSEWHERE.match(value):
                self.found.append(f"<{tag}> {value}")
            if name == "style" and value:
                self.found += _IN_STYLE.findall(value)

    def handle_data(self, data: str) -> None:
        """Look at a style sheet within the page."""
        if self._style:
            self.found += _IN_STYLE.findall(data)


def loads(site: Path) -> dict[str, list[str]]:
    """Page or style sheet → what it loads from elsewhere; empty where all is in the site."""
    found: dict[str, list[str]] = {}
    for path in sorted(site.rglob("*")):
        if path.suffix not in (".html", ".css", ".svg"):
            continue
        text = path.read_text(encoding="utf-8")
        if path.suffix == ".css":
            here = _IN_STYLE.findall(text)
        else:
            parser = _Loads()
            parser.feed(text)
            here = parser.found
        if here:
            found[str(path.relative_to(site))] = here
    return found


if __name__ == "__main__":
    folder = Path(sys.argv[1])
    if not (folder / "index.html").exists():
        sys.exit(f"{folder} holds no site: make site")
    elsewhere = loads(folder)
    for page, addresses in elsewhere.items():
        print(f"{page} loads {', '.join(addresses)}", file=sys.stderr)
    sys.exit(1 if elsewhere else 0)
