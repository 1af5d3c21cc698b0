"""What mkdocs is told beside mkdocs.yml: pages that are made for the site alone, links, equations."""

import re
from pathlib import Path
from typing import Any

from mkdocs.config.defaults import MkDocsConfig
from mkdocs.structure.files import File, Files
from mkdocs.structure.pages import Page

import site_api
import site_notebooks
from site_equations import Equations
from site_links import OUTSIDE, ROOT, relinked

_CODE = re.compile(r"(?<=<code>)[^<]*(?=</code>)")
_ORIGINS = {uri: origin for origin, uri in OUTSIDE.items()}

_FOUND = {"glossary": 5.0, "decisions/": 0.3, "background/": 0.6, "api/": 1.0}
"""How much what a search finds there weighs; pages for users come first."""


def slug(heading: str, separator: str) -> str:
    """The anchor of a heading, as links in the pages have it."""
    return re.sub(r"[^\w\- ]", "", heading.strip().lower()).replace(" ", separator)


def on_config(config: MkDocsConfig) -> MkDocsConfig:
    """Equations, anchors, and the places of what is made here."""
    config.markdown_extensions.append(Equations())  # type: ignore[arg-type]
    config.mdx_configs.setdefault("toc", {})["slugify"] = slug
    nav: list[dict[str, Any]] = config.nav
    parts = {title: pages for part in nav for title, pages in part.items()}
    if books := site_notebooks.notebooks():
        parts["Start"].append({"Notebooks": [f"notebooks/{book.stem}.md" for book in books]})
    parts["Background"] += [{"Decisions": "decisions/index.md"}, {"Contributing": "contributing.md"}]
    api = ["api/index.md", *(f"api/{name}.md" for name in site_api.PAGES)]
    nav.insert(len(nav) - 1, {"Python API": api})
    return config


def on_files(files: Files, config: MkDocsConfig) -> Files:
    """Add the pages that are made here."""
    made: dict[str, str | bytes] = dict(site_api.sources())
    made |= {uri: (ROOT / origin).read_text(encoding="utf-8") for origin, uri in OUTSIDE.items()}
    made["decisions/index.md"] = _decisions()
    for book in site_notebooks.notebooks():
        text, pictures = site_notebooks.page(book)
        _ORIGINS[f"notebooks/{book.stem}.md"] = str(book.relative_to(ROOT))
        made[f"notebooks/{book.stem}.md"] = text
        made |= {f"notebooks/{name}": picture for name, picture in pictures.items()}
    for uri, content in made.items():
        files.append(File.generated(config, uri, content=content))
    return files


def on_page_markdown(markdown: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Mend the links of a page."""
    uri = page.file.src_uri
    page.meta["search"] = {"boost": next((found for part, found in _FOUND.items() if uri.startswith(part)), 3.0)}
    if uri.startswith(("api/", "decisions/index")):
        return markdown
    return relinked(markdown, _ORIGINS.get(uri, f"docs/{uri}"), uri)


def on_page_content(html: str, page: Page, config: MkDocsConfig, files: Files) -> str:
    """Let names in tables break at their underscores."""
    return re.sub(r"<t[dh][ >].*?</t[dh]>", lambda cell: _CODE.sub(_breakable, cell[0]), html, flags=re.DOTALL)


def _breakable(name: "re.Match[str]") -> str:
    return name[0].replace("_", "_<wbr>")


def _title(path: Path) -> str:
    return path.read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")


def _decisions() -> str:
    rows = [f"- [{_title(path)}]({path.name})" for path in sorted((ROOT / "docs/decisions").glob("*.md"))]
    head = "# Decisions\n\nWhat was decided, why, and what else was tried.\n\n"
    return head + "\n".join(rows) + "\n"
