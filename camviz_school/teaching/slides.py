"""A lesson as slides: one idea each, taken from its own cells, with few words and large.

What becomes a slide: the lesson's question; each picture, under a heading that names one thing to notice; each
question, its key, and after a vote the reply to each wrong answer; display equations; misconceptions; bold claims;
exercises; the recap. A picture has all its panels, on as many slides as they need to be legible.
"""

from __future__ import annotations

import re
from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from html import escape

from camviz.draw import prose
from camviz_school.course.notebooks import Cell, Notebook, exercise_of
from camviz_school.course.questions import Question
from camviz_school.teaching import markup, panels, parts
from camviz_school.teaching.panels import SavedImage
from camviz_school.teaching.plans import Notice

MOST_WORDS, TASK_WORDS, HEADING_WORDS, LEAST_WORDS = 40, 55, 18, 5
RECAP_WORDS, RECAP_ROWS = 55, 3
GIVEN_LINES, CODE_LETTERS = 8, 62
"""Of a function that is given and wrong, each line so many letters: a longer one is shown by its first line."""

LONGEST_LINE, LONG_QUESTION = 60, 75
WITHHELD = "<p class='withheld'>Your own function draws this picture. Run its cell in the lesson, and it is there.</p>"
_SIZES = (("large", 28, 4), ("medium", 42, 6), ("small", 60, 8))
"""Sizes of equations in deck.css, each with the letters that fit across and the rows that fit down."""

_NOTICE = re.compile(r"^(?:Notice|See|Note)(?: that)?,? ")
_LOOK = re.compile(r"^(?:Look|Watch|Move|Drag|Turn|Follow|Compare|Take|Set|Choose|Open|Give|Put)\b")
_MATRIX = re.compile(r"\\begin\{\w+\}(.*?)\\end\{\w+\}", re.DOTALL)
_ELSEWHERE = re.compile(r"\b(?:above|below|here|recap|lesson|cell|this|these)\b|^\(", re.IGNORECASE)
_ITEM = re.compile(r"^\* (.+?)(?=^\* |\n\s*\n|\Z)", re.MULTILINE | re.DOTALL)
_MISCONCEPTION = re.compile(r"\A> \*\*Misconception: (?P<thought>.+?)\*\*\s*(?P<answer>.*)\Z", re.DOTALL)
_CLAIM = re.compile(r"\*\*([^*]+ [^*]+ [^*]+?)\*\*")  # three words or more: one or two are the name of a control
_EQUATION = re.compile(r"\$\$(.+?)\$\$", re.DOTALL)
# What is to be done with the lesson's picture; a slide has no buttons.
_BY_HAND = re.compile(
    r"^\W*(?:Then |Try it: )?(?:bring|change|choose|click|move|open|press|pull|put (?:it|the)|set|step|switch|take)\b"
    r"|\*\*\+ |\byou choose\b",
    re.IGNORECASE,
)
_ASKS = re.compile(
    r"\?|(?:^|[,:;] |\b(?:and|then|now) )(?:answer|build|compute|correct|do|estimate|find|give|invert|lay|let|make"
    r"|measure|mend|move|put|return|say|solve|take|use|work out|write)\b",
    re.IGNORECASE,
)
_QUIET = {"Recap", "Further reading", "Glossary"}
# What the lesson shows below a text is on a later slide; "below a pixel" is a comparison, and points nowhere.
_BELOW = re.compile(
    r"\b[Bb]elow\b(?!,? (?:an?|the|that|one|zero|it|by)\b|,? \d)|\b[Bb]elow (?:it (?:a|first)|the code)\b|lower row"
)
_BELOW_STUB = re.compile(r"\bbelow it\b")


@dataclass(frozen=True)
class Slide:
    """One idea. `kind` is its class on the page, `part` the heading it stands under, `body` HTML.

    `at` are the places of the lesson it belongs to, as a plan names them (plans.py), the narrowest first.
    """

    kind: str
    part: str
    heading: str
    body: str = ""
    at: tuple[str, ...] = ()


@dataclass
class _Place:
    """Where the walk through the lesson is."""

    part: str = ""
    heading: str = ""
    said: str = ""
    task: list[str] = field(default_factory=list)
    notice: list[Notice] = field(default_factory=list)
    withheld: Collection[str] = ()
    exercises: dict[str, str] = field(default_factory=dict)
    uses: dict[str, str] = field(default_factory=dict)
    asked: set[str] = field(default_factory=set)

    @property
    def at(self) -> tuple[str, ...]:
        """The places of a plan that the walk is at, the narrowest first; an exercise is part of no section."""
        if self.heading in self.exercises:
            return self.exercises[self.heading], f"section {self.heading}"
        if not self.part:
            return ("header",)
        numbered = re.match(r"(\d+) · ", self.part)
        return tuple(f"section {one}" for one in (self.heading, self.part, *([numbered[1]] if numbered else [])))

    def of_picture(self, cell: Cell) -> tuple[str, ...]:
        """The places of a picture: first the exercise whose function draws it, where that is asked in this part."""
        own = f"exercise {self.uses.get(cell.id, '')}"
        return (own, *self.at) if own in self.asked else self.at


def slides(notebook: Notebook, notice: Sequence[Notice] = (), *, solved: bool = False) -> list[Slide]:
    """The slides of a lesson with saved outputs, in its order; without outputs, those that need none.

    `notice` has what to notice in each picture, in their order, as the lesson's plan says it. Unless the outputs are of
    a `solved` lesson, a picture drawn by a function that students are to write is left out, and its slide says where
    it is to be seen.
    """
    exercises = {title: at for at, title in parts.titles(notebook).items() if at.startswith("exercise ")}
    withheld = {} if solved else parts.drawn_by_reader(notebook)
    uses = parts.drawn_by_reader(notebook, given=True)
    place = _Place(notice=list(notice), withheld=withheld, exercises=exercises, uses=uses)
    found = [_title(notebook)]
    for number, cell in enumerate(notebook.cells):
        tags = set(cell.metadata.get("tags", []))
        if cell.cell_type == "code":
            found += (_placed(one, place) for one in _of_code(cell, place, notebook.cells[number + 1 :]))
        elif number and not tags & {"solution", "glossary", "about"}:
            for block in markup.blocks(cell.source):
                found += (_placed(one, place) for one in _of_block(block, place))
    return list(_pointing(found))


def _placed(slide: Slide, place: _Place) -> Slide:
    return slide if slide.at else replace(slide, at=place.at)


def _pointing(found: Sequence[Slide]) -> Iterator[Slide]:
    """The slides; where one speaks of what the lesson shows below it, it says on which slide that is."""
    shown = [number for number, one in enumerate(found, start=1) if one.kind == "picture"]
    for number, one in enumerate(found, start=1):
        text = re.sub(r"<[^>]*>", "", one.body)
        points = _BELOW.search(text) or (one.kind == "exercise" and _BELOW_STUB.search(text))
        after = next((later for later in shown if later > number), 0)
        if one.kind != "picture" and points and after:
            yield replace(one, body=f"{one.body}<p class='where'>Below in the lesson: slide {after}.</p>")
        else:
            yield one


def _title(notebook: Notebook) -> Slide:
    source = notebook.cells[0].source
    asked = re.search(r"\*\*([^*]+\?)\*\*", source)
    title = markup.plain(source.splitlines()[0].lstrip("# "))
    return Slide("title", "", escape(title), f"<p>{markup.inline(asked[1])}</p>" if asked else "", ("header",))


# Code cells: pictures, questions, exercises --------------------------------------------------------------------------


def _of_code(cell: Cell, place: _Place, following: list[Cell]) -> Iterator[Slide]:
    if parts.is_pretest(cell):
        answer = "<p>Answer the first quiz. Its key comes later.</p>"
        yield Slide("claim", place.part, "What do you think now?", answer, ("header",))
        return
    for question in parts.asked(cell):
        yield from _question(question, place.part)
    shown = panels.panels(cell)
    if shown:
        yield from _picture(cell, shown, place, following)
    if "stub" in cell.metadata.get("tags", []):
        place.asked.add(f"exercise {exercise_of(cell).partition('.')[2]}")
        yield _exercise(cell, place)


def _picture(cell: Cell, shown: list[SavedImage], place: _Place, following: list[Cell]) -> Iterator[Slide]:
    noticed = place.notice.pop(0) if place.notice else None
    heading = prose.inline(noticed.text.rstrip(".")) if noticed else _to_notice(place, following)
    at = place.of_picture(cell)
    if cell.id in place.withheld:
        yield Slide("picture", place.part, heading, WITHHELD, at)
        return
    pages = panels.pages(shown, heading, noticed.panels if noticed else ())
    yield Slide("picture", place.part, heading, pages[0].html, at)
    for page in pages[1:]:
        names = ", ".join(escape(panel.name) for row in page.rows for panel in row if panel.name)
        yield Slide("picture more", place.part, f"<small>The same view: {names}</small>", page.html, at)


def _to_notice(place: _Place, following: list[Cell]) -> str:
    """One thing to notice: what the text after the picture says of it, or the text before; else the heading."""
    after = markup.unlinked(_text_after(following))
    items = [markup.sentences(one)[0] for one in _ITEM.findall(after)]
    noticed = [one for one in items if _NOTICE.match(one)]
    told = markup.sentences(next((one for one in markup.blocks(after) if one[0] not in "*|>#$"), ""))[:2]
    before = markup.sentences(markup.unlinked(place.said))
    asked = [one for one in before if _LOOK.match(one)]
    for one in (*noticed, *asked, *told, *items, *before):
        heading = _as_heading(one)
        if heading and not _ELSEWHERE.search(markup.plain(one)):
            return heading
    return markup.inline(place.heading or place.part)


def _text_after(following: list[Cell]) -> str:
    """The Markdown up to the next code cell or heading."""
    text = ""
    for cell in following:
        if cell.cell_type != "markdown":
            break
        text += f"\n\n{cell.source}"
    return re.split(r"^#", text, maxsplit=1, flags=re.MULTILINE)[0]


def _as_heading(sentence: str) -> str:
    """A sentence as a heading: without "Notice that" and full stop, up to its colon; "" where it is too long."""
    text = _NOTICE.sub("", sentence.strip())
    for end in (None, ": ", "; ", " ("):
        short = text if end is None else text.partition(end)[0]
        balanced = short.count("**") % 2 == 0 and short.count("$") % 2 == 0
        if balanced and LEAST_WORDS <= markup.words(short) <= HEADING_WORDS:
            short = short.rstrip(" .:;,")
            return markup.inline(re.sub(r"[^\W\d_]", lambda first: first[0].upper(), short, count=1))
    return ""


def _exercise(cell: Cell, place: _Place) -> Slide:
    lines = cell.source[cell.source.find("def ") :].splitlines()
    given = not parts.is_open(cell) and sum(-(-len(line) // CODE_LETTERS) for line in lines) <= GIVEN_LINES
    code = "\n".join(lines if given else lines[:1])
    task = _asked_for(place.task, MOST_WORDS if given else TASK_WORDS)
    body = f"{f'<p>{markup.inline(task)}</p>' if task else ''}<pre>{escape(code)}</pre>"
    return Slide("exercise", place.part, markup.inline(place.heading), body)


def _asked_for(task: Sequence[str], most: int) -> str:
    """What an exercise asks for: how its last paragraph opens, or of the one that asks its first sentence and that."""
    for paragraph in reversed(task):
        opening = markup.opening(paragraph, most)
        if any(map(_ASKS.search, markup.sentences(opening))):
            return opening
        first, *others = markup.sentences(paragraph)
        for one in filter(_ASKS.search, others):
            shortened = (f"{first} … {one}", one)
            return next((text for text in shortened if markup.words(text) <= most), opening)
    return markup.opening(task[-1], most) if task else ""


# Questions -----------------------------------------------------------------------------------------------------------


def _question(question: Question, part: str) -> Iterator[Slide]:
    """The question; its key, which a page hides until it is asked for; after a vote the reply to each wrong answer."""
    part = part if question.kind == "predict" else "Exit quiz"
    choices = "".join(f"<li>{prose.inline(choice.text)}</li>" for choice in question.choices)
    words = sum(len(one.split()) for one in (question.text, *(choice.text for choice in question.choices)))
    kind = "question long" if words > LONG_QUESTION else "question"
    at = (f"question {question.name.partition('.')[2]}",) if question.kind == "predict" else ("quiz",)
    yield Slide(kind, part, "", f"{prose.to_html(question.text)}<ol type='a'>{choices}</ol>", at)
    headings = [f"<b class='letter'>({letter})</b> {prose.inline(one.text)}" for letter, one in question.lettered]
    yield Slide("key", part, headings[question.answer], prose.to_html(question.choices[question.answer].reply), at)
    for heading, choice in zip(headings, question.choices, strict=True):
        if question.kind == "predict" and not choice.correct:
            thought = f"<p class='thought'>{prose.inline(choice.misconception)}</p>"
            yield Slide("reply", part, heading, thought + prose.to_html(choice.reply), at)


# Markdown: equations, misconceptions, claims, the recap --------------------------------------------------------------


def _of_block(block: str, place: _Place) -> Iterator[Slide]:
    heading = re.match(r"(#+) (.+)", block)
    if heading:
        place.heading, place.said, place.task = heading[2].strip(), "", []
        if len(heading[1]) == 2:
            place.part, place.asked = place.heading, set()
        block = block[heading.end() :].strip()
    misconception = _MISCONCEPTION.match(block)
    if place.heading == "Recap" and block.startswith("|"):
        yield from _recap(block, place.part)
    elif place.heading in _QUIET or not block:
        return
    elif misconception:
        answer = re.sub(r"^> ?", "", misconception["answer"], flags=re.MULTILINE)
        text = re.sub(r":$", ".", markup.opening(answer, MOST_WORDS))
        yield Slide("misconception", place.part, markup.inline(misconception["thought"].rstrip(".")), _paragraph(text))
    else:
        for latex in _EQUATION.findall(block):
            before = block.partition("$$")[0] or place.said
            yield Slide("equation", place.part, _heading_of_equation(before, place), _equation(latex))
        if not block.startswith(("|", ">", "*", "1.", "$$", "```")):
            yield from _claims(block, place.part)
            place.said = block
            place.task.append(block)


def _heading_of_equation(before: str, place: _Place) -> str:
    """The sentence that leads to the equation, or the heading it stands under."""
    for sentence in reversed(markup.sentences(markup.unlinked(_EQUATION.sub("", before)))):
        heading = _as_heading(re.sub(r"\s*\([^()]*\)", "", sentence.strip()))
        if heading:
            return heading
    return markup.inline(place.heading)


def _equation(latex: str) -> str:
    """The equation as large as it fits: its parts one under the other, in the size that width and height allow."""
    lines = [one.strip(" ,\n") for one in re.split(r"\\qquad(?![a-z])", latex) if one.strip(" ,\n")]
    if any(_depth(line) for line in lines):
        lines = [latex]
    lines = [half for line in lines for half in _halves(line)]
    wide, high = max(map(_width, lines)), sum(map(_height, lines))
    size = next((name for name, across, down in _SIZES if wide <= across and high <= down), "tiny")
    return f"<div class='{size}'>{''.join(markup.formula(line, display=True) for line in lines)}</div>"


def _width(line: str) -> int:
    """About how many letters wide a line is when it is set; a matrix as wide as its widest row, two letters a gap."""
    text = _MATRIX.sub(lambda found: "x" * (5 + max(map(_letters, found[1].split(r"\\")))), line)
    return _letters(text)


def _letters(latex: str) -> int:
    text = re.sub(r"\\(?:left|right|text|mathrm|mathbf|frac|tfrac|dfrac|hat|bar|quad|tag)(?![a-z])", "", latex)
    text = re.sub(r"&|\\(?:Longrightarrow|sum|sqrt|cdot)(?![a-z])| [=+] ", "xxx", text)
    return len(re.sub(r"[{}_^\\ ,;!]", "", re.sub(r"\\[a-zA-Z]+", "x", text)))


def _height(line: str) -> int:
    """About how many rows of text high a line is when it is set."""
    rows = max((found.count(r"\\") + 1 for found in _MATRIX.findall(line)), default=1)
    return rows + ("frac" in line or r"\sum" in line) + 2 * ("brace" in line)


def _halves(line: str) -> list[str]:
    """A line that is too long for a slide, broken where a gap parts it, else before the operator nearest its middle."""
    several = [one for one in re.split(r"[,;]?\s*\\quad(?![a-z])", line) if one.strip()]
    if _width(line) > LONGEST_LINE and len(several) > 1 and not any(map(_depth, several)):
        return [half for one in several for half in _halves(one)]
    signs = [found.start() for found in re.finditer(r"(?<=\s)[+=−-](?=\s)|\\Longrightarrow", line)]
    breaks = [at for at in signs if not _depth(line[:at])]
    if _width(line) <= LONGEST_LINE or not breaks or "\\begin" in line:
        return [line]
    at = min(breaks, key=lambda at: abs(at - len(line) / 2))
    return [line[:at], line[at:]]


def _depth(latex: str) -> int:
    """How many braces, brackets and environments are open at the end."""
    opened = sum(map(latex.count, ("{", "(", "[", r"\begin", r"\left")))
    return opened - sum(map(latex.count, ("}", ")", "]", r"\end", r"\right")))


def _claims(paragraph: str, part: str) -> Iterator[Slide]:
    for sentence in markup.sentences(_EQUATION.sub("", paragraph)):
        if _CLAIM.search(sentence) and markup.words(sentence) <= MOST_WORDS and not _BY_HAND.search(sentence):
            yield Slide("claim", part, "", _paragraph(sentence))


def _recap(table: str, part: str) -> Iterator[Slide]:
    """The recap's table, as many rows a slide as stay within RECAP_ROWS and RECAP_WORDS."""
    head, _, *rows = table.splitlines()
    pages: list[list[str]] = [[]]
    for row in rows:
        if pages[-1] and (len(pages[-1]) == RECAP_ROWS or markup.words(" ".join([*pages[-1], row])) > RECAP_WORDS):
            pages.append([])
        pages[-1].append(row)
    for number, few in enumerate(pages, start=1):
        made = markup.html("\n".join([head, "|---" * (head.count("|") - 1) + "|", *few]))
        yield Slide("recap", part, f"Recap ({number} of {len(pages)})" if len(pages) > 1 else "Recap", made)


def _paragraph(markdown: str) -> str:
    return f"<p>{markup.inline(markdown)}</p>" if markdown else ""
