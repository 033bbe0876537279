"""The lessons' Markdown as HTML that needs nothing: formulas as MathML, links as their words.

mistune and latex2mathml come with `camviz[lab]`; whoever calls this has looked for them
(camviz_school.commands.teacher).
"""

from __future__ import annotations

import re
from collections.abc import Iterator

FORMULA = re.compile(r"(?P<code>```.*?```|`[^`\n]*`)|\$\$(?P<display>.+?)\$\$|\$(?P<inline>[^$\n]+)\$", re.DOTALL)
_HELD = re.compile("\ue000(\\d+)\ue001")
_LINK = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")
_FOLDED = re.compile(r"<details>.*?</details>", re.DOTALL)
_SENTENCE = re.compile(r"(?<=[.!?])[*”\"')]*\s+(?=[*“\"'(`$\[]*[A-Z0-9μ])")


def formula(latex: str, display: bool = False) -> str:
    """LaTeX as MathML. Raises what latex2mathml does for what it does not know."""
    from latex2mathml.converter import convert

    text = re.sub(r"\\text\w*\{[^{}]*\}", lambda found: found[0].replace(r"\_", "_"), latex)
    made: str = convert(" ".join(text.split()), display="block" if display else "inline")
    return re.sub(r' xmlns="[^"]*"', "", made)


def html(markdown: str) -> str:
    """Markdown as HTML: paragraphs, lists, tables, code; no addresses and no markup of its own."""
    import mistune

    class Words(mistune.HTMLRenderer):
        """Links are their words, pictures and HTML are left out."""

        def link(self, text: str, url: str, title: str | None = None) -> str:
            return text

        def image(self, text: str, url: str, title: str | None = None) -> str:
            return ""

        def inline_html(self, html: str) -> str:
            return ""

        def block_html(self, html: str) -> str:
            return ""

    held: list[str] = []

    def hold(found: re.Match[str]) -> str:
        if found["code"]:
            return found[0]
        held.append(formula(found["display"] or found["inline"], display=bool(found["display"])))
        return f"\ue000{len(held) - 1}\ue001"

    render = mistune.create_markdown(renderer=Words(), plugins=["table"])
    made = str(render(FORMULA.sub(hold, markdown)))
    return _HELD.sub(lambda found: held[int(found[1])], made)


def inline(markdown: str) -> str:
    """One line of Markdown as HTML, without the paragraph around it."""
    return re.sub(r"\A<p>|</p>\Z", "", html(" ".join(markdown.split())).strip())


def plain(markdown: str) -> str:
    """Words alone: no links, no emphasis, no backticks; formulas as they are written."""
    return " ".join(re.sub(r"\*+|`", "", unlinked(markdown)).split())


def sentences(markdown: str) -> list[str]:
    """The sentences of a paragraph, each still Markdown, with its full stop."""
    found, text = [], " ".join(markdown.split())
    end = 0
    for gap in _SENTENCE.finditer(text):
        closing = gap[0].rstrip()
        found.append(text[end : gap.start()] + closing)
        end = gap.end()
    return [one for one in [*found, text[end:]] if one]


def unlinked(markdown: str) -> str:
    """The same Markdown with links as their words."""
    return _LINK.sub(r"\1", markdown)


def words(markdown: str) -> int:
    """How many words a reader sees."""
    return len(plain(markdown).split())


def opening(markdown: str, most: int) -> str:
    """As many whole sentences from the beginning as stay within `most` words; "" where the first is longer."""
    kept: list[str] = []
    for one in sentences(markdown):
        if words(" ".join([*kept, one])) > most:
            break
        kept.append(one)
    return " ".join(kept)


def blocks(markdown: str) -> Iterator[str]:
    """Headings, paragraphs, lists, tables, quotations, formulas: whatever blank lines part; folded boxes left out."""
    for part in re.split(r"\n\s*\n", _FOLDED.sub("", markdown)):
        if part.strip():
            yield part.strip()
