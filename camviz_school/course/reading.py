"""How a lesson reads: its main line, the length of its sentences and paragraphs, and where its terms are first used."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

from camviz_school.course.glossary import Term, glossary

Notebook = Any

LONGEST_SENTENCE, LONGEST_PARAGRAPH = 35, 90
"""Words that a reader keeps in mind at once, and words between two places to rest."""

_FOLDED = re.compile(r"<details.*?</details>|<!--.*?-->", re.DOTALL)
_CODE = re.compile(r"```.*?```|\$\$.*?\$\$", re.DOTALL)
_INLINE = re.compile(r"``[^`]*``|`[^`]*`|\$[^$\n]*\$")
_LINKED = re.compile(r"!?\[([^\]]*)\]\([^)]*\)")
_PAUSE = re.compile(r"\n\s*\n|\n(?=\s*(?:[*>#|-]|\d+\.)\s)|\s\|\s|^\||\|$", re.MULTILINE)
_MARKS = re.compile(r"^[\s*>#|-]+|\*+|<[^>]*>")
_END = re.compile(r"(?<=[.?!:…])[\"”’')\]*]*\s+(?=[\"“‘'(\[*]*[^\W\d_a-z])")  # the next word begins with a capital
_ABBREVIATION = re.compile(r"(?:\b[A-Z]|\b(?:e\.g|i\.e|vs|cf|Sec|sec|Eq|Fig|Vol|vol|chap|No|approx|St))\.$")
_WORD = re.compile(r"\S*\w\S*")


@dataclass(frozen=True)
class Passage:
    """A piece of the main line: the number of its cell and its Markdown."""

    cell: int
    text: str


def main_line(notebook: Notebook) -> list[Passage]:
    """What every reader reads: the Markdown cells without folded boxes, solutions, glossary and further reading."""
    return main_line_of(notebook.cells)


def main_line_of(cells: Iterable[Any]) -> list[Passage]:
    """As `main_line`, of some cells, numbered from the first of them."""
    kept = []
    for number, cell in enumerate(cells):
        aside = {"solution", "glossary", "about"} & set(cell.metadata.get("tags", []))
        if cell.cell_type == "markdown" and not aside and "Further reading" not in cell.source.split("\n")[0]:
            kept.append(Passage(number, _FOLDED.sub("\n\n", cell.source)))
    return kept


def paragraphs(markdown: str) -> Iterator[str]:
    """The paragraphs, list items and table cells of a text as plain words; a formula in a line counts as one word."""
    text = _INLINE.sub("formula", _CODE.sub(" ", markdown))
    for part in _PAUSE.split(_LINKED.sub(r"\1", text)):
        words = " ".join(_MARKS.sub("", part).split())
        if words:
            yield words


def sentences(paragraph: str) -> Iterator[str]:
    """The sentences of a paragraph of plain words."""
    begun = ""
    for part in _END.split(paragraph):
        begun = f"{begun} {part}".strip()
        if not _ABBREVIATION.search(begun):
            yield begun
            begun = ""
    if begun:
        yield begun


def words(text: str) -> int:
    """How many words a text has: whatever holds a letter or a digit."""
    return len(_WORD.findall(text))


def too_long(markdown: str) -> list[str]:
    """The sentences and paragraphs above the limits, each as what it is, how long, and how it begins."""
    found = []
    for paragraph in paragraphs(markdown):
        if words(paragraph) > LONGEST_PARAGRAPH:
            found.append(f"a paragraph of {words(paragraph)} words: {paragraph[:60]} …")
        for sentence in sentences(paragraph):
            if words(sentence) > LONGEST_SENTENCE:
                found.append(f"a sentence of {words(sentence)} words: {sentence[:60]} …")
    return found


def unlinked(notebook: Notebook, lesson: str) -> list[str]:
    """The glossary's terms of this lesson ("05") whose first use in the running text is no link to their entry."""
    text = "\n\n".join(passage.text for passage in main_line(notebook)[1:])  # the header comes before the lesson
    text = re.sub(r"(?m)^#.*$", "", _INLINE.sub(" ", _CODE.sub(" ", text)))
    own = (term for term in glossary().terms if lesson in term.lessons)
    return [term.name for term in own if not _linked_first(term, text)]


def _linked_first(term: Term, text: str) -> bool:
    """True where the term does not occur, or its first occurrence stands inside a link to its entry."""
    names = "|".join(re.escape(name) for name in (term.name, *term.also))
    first = re.search(rf"(?<![\w-])(?:{names})s?(?![\w-])", text, re.IGNORECASE)
    if not first:
        return True
    links = re.finditer(rf"\[[^\]]*\]\([^)\s]*#{re.escape(term.anchor)}\)", text)
    return any(link.start() <= first.start() < link.end() for link in links)
