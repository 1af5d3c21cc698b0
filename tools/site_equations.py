"""Equations of the pages as MathML, which browsers draw by themselves: no script, no font, nothing to be fetched."""

import re
import xml.etree.ElementTree as etree

import markdown
from latex2mathml.converter import convert
from markdown.extensions import Extension
from markdown.inlinepatterns import InlineProcessor
from markdown.preprocessors import Preprocessor

_FENCE = re.compile(r"^```math\n(.*?)^```$", re.DOTALL | re.MULTILINE)
_INLINE = r"(?<![\\\w$])\$([^$\n]+?)\$(?![\w$])"


class _Blocks(Preprocessor):
    """Blocks between ```math and ```, before other fences are looked for."""

    def run(self, lines: list[str]) -> list[str]:
        """The lines with each block put away as MathML."""

        def drawn(match: "re.Match[str]") -> str:
            latex = (
                match[1].replace("\n", " ").replace("{aligned}", "{align*}").strip()
            )  # the converter knows no aligned
            made = convert(latex, display="block")
            return "\n" + self.md.htmlStash.store(f'<div class="equation">{made}</div>') + "\n"

        return _FENCE.sub(drawn, "\n".join(lines)).split("\n")


class _Inline(InlineProcessor):
    """What stands between two signs of the dollar."""

    def handleMatch(self, m: "re.Match[str]", data: str) -> "tuple[etree.Element | str, int, int]":  # type: ignore[override]
        """MathML in its place."""
        return self.md.htmlStash.store(convert(m[1])), m.start(0), m.end(0)


class Equations(Extension):
    """The extension of Markdown."""

    def extendMarkdown(self, md: markdown.Markdown) -> None:
        """Look for blocks before fences (25), for equations in a line after code (190) and before escapes (180)."""
        md.preprocessors.register(_Blocks(md), "equations", 30)
        md.inlinePatterns.register(_Inline(_INLINE, md), "equation", 185)
