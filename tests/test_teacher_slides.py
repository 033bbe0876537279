"""Slides: one idea each, every question before its key, few words, and nothing that has to be loaded."""

import re
from functools import cache
from pathlib import Path

import nbformat
import pytest

from camviz.draw import prose
from camviz_school.course import notebooks
from camviz_school.teaching import deck, parts, slides

LESSONS = sorted((Path(__file__).parents[1] / "lessons").glob("*.ipynb"))
EACH = pytest.mark.parametrize("path", LESSONS, ids=lambda path: path.stem)
LONGEST = 130
"""Words of a question with all its choices; everything else has far fewer."""


@cache
def made(path):
    return deck.planned_slides(notebooks.read(path))


def words(slide):
    """The words of a slide, with each formula as one, and without code."""
    text = re.sub(r"<math.*?</math>|<pre>.*?</pre>", " x ", f"{slide.heading} {slide.body}", flags=re.DOTALL)
    return len(re.sub(r"<[^>]*>", " ", text).split())


@pytest.mark.sampled(4)
@EACH
def test_every_question_is_followed_by_its_key(path):
    found = made(path)
    asked = [number for number, one in enumerate(found) if one.kind.startswith("question")]
    assert len(asked) >= 1
    cells = [cell for cell in notebooks.read(path).cells if not parts.is_pretest(cell)]
    known = [one for cell in cells for one in parts.asked(cell)]
    assert len(asked) == len(known)
    for number, question in zip(asked, known, strict=True):
        right = question.choices[question.answer]
        key = found[number + 1]
        assert key.kind == "key"
        assert key.heading.startswith(f"<b class='letter'>({'abcdefgh'[question.answer]})</b>")
        assert key.heading.endswith(prose.inline(right.text))
        assert re.sub(r"<p class=.where.>.*", "", key.body) == prose.to_html(right.reply)
        assert found[number - 1].kind != "key" or found[number - 1].part == "Exit quiz"
    assert sum(one.kind == "key" for one in found) == len(asked)


@EACH
def test_a_slide_has_one_idea_in_few_words(path):
    for one in made(path):
        most = {"question": LONGEST, "key": 95, "reply": 95}.get(one.kind.split()[0], 70)
        assert words(one) <= most, one
        assert one.heading or one.body
        if one.kind.startswith("picture"):
            assert one.body == slides.WITHHELD or one.body.startswith("<div class='panels'><div><img alt=")
            said = re.sub(r"<math.*?</math>|<[^>]*>", " ", one.heading)
            assert 0 < len(said.split()) <= slides.HEADING_WORDS + 2


@pytest.mark.sampled(4)
@EACH
def test_a_deck_loads_nothing_and_names_no_other_address(path):
    page = deck.deck(notebooks.read(path))
    assert "http" not in re.sub(r"http-equiv|https?://www\.w3\.org/\S+", "", re.sub(r'src="data:[^"]*"', "", page))
    assert not re.findall(r'(?:src|href)="(?!data:)[^"]*"|url\((?!data:)|@import|<link', page)
    assert "default-src 'none'" in page
    assert page.count("<section class=") == len(made(path))
    assert len(set(re.findall(r'<section[^>]* id="(s\d+)"', page))) == len(made(path))


def test_a_pretest_is_asked_and_not_answered(monkeypatch):
    monkeypatch.setattr(parts, "is_pretest", lambda cell: cell.source.startswith("quiz("))
    header = nbformat.v4.new_markdown_cell("# 05 · A\n\n**Why?**")
    found = slides.slides(nbformat.v4.new_notebook(cells=[header, nbformat.v4.new_code_cell('quiz("05", "A")')]))
    assert [one.heading for one in found] == ["05 · A", "What do you think now?"]


def test_a_long_equation_is_broken_and_a_short_one_is_large():
    assert "class='large'" in slides._equation("Z = f B / d")
    long = " + ".join(f"u_{{{number}}} v_{{{number}}}" for number in range(16))
    assert slides._equation(long).count("<math") == 2
    matrix = r"\begin{bmatrix} a + b \\ c \end{bmatrix}" * 9
    assert slides._equation(matrix).count("<math") == 1


def test_an_exercise_asks_even_where_its_text_is_long():
    given = "You get windows of five pixels, each centred on a red one."
    rule = "For the middle row let bend be 2c − a − e, for the middle column the same, and so on."
    asks = "Take the green of the smaller change."
    assert slides._asked_for([f"{given} {rule} {asks}"], 30) == f"{given} … {asks}"
    assert slides._asked_for([f"{given} {rule} {asks}"], 60) == f"{given} {rule} {asks}"
    assert slides._asked_for(["How far does it land?", "By hand: 3 px."], 30) == "How far does it land?"


def test_only_what_is_below_in_the_lesson_is_a_picture():
    picture = slides.Slide("picture", "", "A")
    texts = ("Divide above and below by 2.", "The picture below the code is wrong.")
    shown = [next(slides._pointing([slides.Slide("claim", "", "", text), picture])).body for text in texts]
    assert shown == [texts[0], f"{texts[1]}<p class='where'>Below in the lesson: slide 2.</p>"]
