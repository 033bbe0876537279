"""The prose of a lesson, the numbers in it, and which of them a test recomputes.

A test quotes a sentence and recomputes its numbers:

    def test_the_fold(says):
        k1, r = says("For k1 = −0.3 the fold is at r = 1.054")
        assert r == 1 / np.sqrt(-3 * k1.value)

`says` (conftest.py) holds that the sentence stands in the lesson and that the test used each of its numbers; `==`
compares to the digits that are printed. `test_numbers.py` holds that every number of a lesson stands in a quotation.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np

from camviz_school.course import glossary, notebooks, questions
from camviz_school.course.exercises import exercises
from camviz_school.teaching import plans

HERE = Path(__file__).parent
LESSONS = HERE.parents[1] / "lessons"

_NUMBER = re.compile(
    r"(?<![A-Za-z_\d.²³⁴₀-₉])"  # part of a name or of a longer number
    r"((?:(?<![\w)\]}²³°])[−-])?(?:\d{1,3}(?:,\d{3})+(?!\d|,\d)|\d+)(?:\.\d+)?(?:e[−-]?\d+)?)"
    r"(?![A-Za-z_\d])"
)
_SYMBOL = r"(?:[kpsτ][₁-₆\d]|[rxyzXYZfNθλξπσndcuvwtBCRQαφωμΔ]|√|\()[₀-₉²³⁴⁶′']*(?![A-Za-z])"
FORMULA = re.compile(r"\$\$.*?\$\$|\$[^$\n]*\$", re.DOTALL)
"""Its whole numbers are part of it, and the lesson's truth check and exercises run it; its decimals are results."""
CODE = ((r"```.*?```", "it is run"), (r"``[^`]*``|`[^`]*`", "it is run"))
NOT_STATED = (
    (r"\[\d\d(?: [^\]]*)?\]\([^)]*\)", "the name of a lesson"),
    (r"\]\([^)]*\)|</?[A-Za-z][^<>]*>|&\w+;", "an address"),
    (r"(?m)^#+ \d+ ·|^#+ .*?Exercise \d+|^\s*\d+\. ", "the number of a heading or of an item"),
    (r"(?i)\b(?:lessons?|parts?|exercises?|sections?|chapters?|chap\.|sec\.|figures?|steps?|cells?|table|volume"
     r"|vol\.|pages?|pp?\.|release|version|views?|question) \d+(?:\.\d+)*(?:(?:,| and| to|–) ?\d+(?:\.\d+)*)*"
     r"(?![\d.]*\d? ?(?:mm|cm|m|px|°|%)\b)",
     "a reference"),
    (r"\b(?:EMVA(?: Standard)?|ISO(?:/IEC)?|CIE|ITU|IEC|IEEE|OpenCV|Python|NumPy|Nikon|Canon|Sony|Sigma|Kodak|Type"
     r"|illuminant|Apache|CC BY|BY) ?[A-Z]{0,3}-?\d[\d.:-]*", "a proper name"),
    (r"(?:(?<=[(A-Za-zé.,;] )|(?<=\())(?:1[5-9]|20)\d\d(?=[,;.:)\s]|$)(?! ?(?:K|px|mm|nm|µm|m|DN|e⁻|photons|electrons"
     r"|pixels|[×x%°–]))", "a year"),
    (r"\d+(?:–\d+)? minutes?|(?m:(?<=\? )\| \d+ \|$)|(?m:\| (?:cores )?\d+ hours.*\|$)",
     "a plan; tests hold that the places agree"),
    (r"(?m)^\| \d\d \|", "the number of a lesson"),
    (r"\(\d{4}–\d{4}\)", "the years of a life"),
    (rf"(?<![A-Za-z_\d.])\d(?= ?{_SYMBOL})|(?<=[/^])2(?!\d|\.\d)", "a coefficient in a formula"),
    (r"(?<![\w.,−-])[01](?!e[−-]?\d|[\d.,]\d|\d| ?[%°µ]| ?(?:px|mm|cm|m|km|s|ms|K|dB|DN|e⁻|bits?|pixels?|metres?)\b)",
     "nothing or one: a condition, an end of a range, a part of a formula"),
)  # fmt: skip
"""What is not a statement about the world, as a pattern, and why."""


@dataclass(frozen=True)
class Passage:
    """A piece of prose a reader meets, on one line and without emphasis, and where."""

    where: str
    text: str


def plain(text: str) -> str:
    """On one line, without the asterisks of emphasis, so that a quotation need not repeat them."""
    return " ".join(text.replace("*", "").split())


@cache
def passages(number: str) -> tuple[Passage, ...]:
    """All prose of the lesson: its cells, questions, replies, hints, explanations and plan; lesson 00: the glossary."""
    return tuple(Passage(where, plain(text)) for where, text in _texts(number))


def _texts(number: str) -> Iterator[tuple[str, str]]:
    (path,) = LESSONS.glob(f"{number}_*.ipynb")
    for index, cell in enumerate(notebooks.read(path).cells):
        further = cell.source.lstrip("# ").startswith("Further reading")
        if cell.cell_type == "markdown" and "glossary" not in cell.metadata.get("tags", []) and not further:
            yield f"cell {index}", _stated(cell.source)
        note = cell.metadata.get("camviz", {}).get("teacher")
        if note:
            yield f"teacher's note at cell {index}", _stated(note)
    for one in questions.questions(number).values():
        yield f"question {one.name}", _stated(one.text)
        for choice in one.choices:
            yield f"question {one.name}", _stated(choice.text)
            yield f"question {one.name}", _stated(choice.reply)
    for one in exercises(number).values():
        for text in (*one.hints, one.praise, *(known.explanation for known in (*one.misconceptions, *one.conventions))):
            yield f"exercise {one.name}", _stated(text)
    planned = plans.plan(number)
    if planned:
        for text in (planned.bring, planned.network, planned.machine, *(one.text for one in planned.notice)):
            yield "the teacher's plan", _stated(text)
        for step in planned.steps:
            yield f"the teacher's plan at {step.at}", _stated(f"{step.teacher}\n\n{step.students}")
    if number == "00":
        for term in glossary.glossary().terms:
            yield f"glossary: {term.name}", _stated(term.sentence)


def _stated(text: str) -> str:
    """The text with all that is no statement about the world left out; line breaks stay, as headings need them."""
    text = FORMULA.sub(lambda formula: " … ".join(["", *re.findall(r"\d+\.\d+", formula[0]), ""]), text)
    for pattern, _ in CODE:
        text = re.sub(pattern, " … ", text, flags=re.DOTALL)
    text = text.replace("*", "")
    for pattern, _ in NOT_STATED:
        text = re.sub(pattern, " … ", text)
    return text


def numbers_in(text: str) -> list[str]:
    """The numbers in a text, as they are written."""
    return [match[1] for match in _NUMBER.finditer(text)]


@cache
def quotations(number: str) -> tuple[str, ...]:
    """What the lesson's test file quotes by `says("…")`, read from its source."""
    (path,) = HERE.glob(f"test_{number}_*.py")
    calls = [node for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))) if isinstance(node, ast.Call)]
    quoted = [node.args[0] for node in calls if getattr(node.func, "id", "") == "says"]
    return tuple(plain(_stated(node.value)) for node in quoted if isinstance(node, ast.Constant))


def numbers_left(passage: Passage, quoted: tuple[str, ...]) -> list[str]:
    """The numbers of a passage outside all quotations, each with the words around it."""
    covered = np.zeros(len(passage.text), dtype=bool)
    for one in quoted:
        for found in re.finditer(re.escape(one), passage.text):
            covered[found.start() : found.end()] = True
    left = [match for match in _NUMBER.finditer(passage.text) if not covered[match.start(1)]]
    return [passage.text[max(0, m.start() - 40) : m.end() + 20] for m in left]


@dataclass(eq=False)
class Said:
    """A number as a sentence prints it: `value` to compute with, `==` to hold a computed one against its digits."""

    text: str
    used: bool = False

    @property
    def value(self) -> float:
        self.used = True
        return float(self.text.replace("−", "-").replace(",", ""))

    @property
    def half_a_digit(self) -> float:
        """Half of the last digit printed: 0.005 for 1.23, 0.5 for 60."""
        mantissa, _, exponent = self.text.replace("−", "-").partition("e")
        return 0.5 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))

    def __eq__(self, computed: object) -> bool:
        return bool(abs(float(computed) - self.value) <= self.half_a_digit * (1 + 1e-9))

    def about(self, computed: float, within: float = 0.1) -> bool:
        """For "about 200": true where the printed number is within this fraction of the computed one."""
        return bool(abs(computed - self.value) <= within * abs(computed))

    def __repr__(self) -> str:
        return self.text


@dataclass
class Quotes:
    """`says` of one test: finds each sentence in the lesson and hands out its numbers, all of which must be used."""

    number: str
    said: list[tuple[str, list[Said]]] = field(default_factory=list)

    def __call__(self, sentence: str) -> list[Said]:
        wanted = plain(_stated(sentence))
        assert any(wanted in one.text for one in passages(self.number)), (
            f"lesson {self.number} does not say {sentence!r} (looked for {wanted!r})"
        )
        numbers = [Said(text) for text in numbers_in(wanted)]
        self.said.append((sentence, numbers))
        return numbers

    def hold(self) -> None:
        """Fails where a number was quoted and not used."""
        for sentence, numbers in self.said:
            unused = [one.text for one in numbers if not one.used]
            assert not unused, f"quoted but not recomputed: {', '.join(unused)} in {sentence!r}"
