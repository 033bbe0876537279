"""How sentences, paragraphs and words are counted, and which first uses of a term need a link."""

import nbformat
import pytest

from camviz_school.course.exercises import exercises
from camviz_school.course.questions import questions
from camviz_school.course.reading import main_line, paragraphs, sentences, too_long, unlinked, words


def notebook(*texts):
    return nbformat.v4.new_notebook(cells=[nbformat.v4.new_markdown_cell(text) for text in ("# 05", *texts)])


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("One. Two.", 2),
        ("It is 1.5 m long, e.g. Here.", 1),
        ("D. C. Brown wrote it.", 1),
        ("It folds. k1 is negative.", 1),  # a small letter begins no sentence
        ('He asked: "Why?" She knew.', 3),
    ],
)
def test_where_a_sentence_ends(text, number):
    assert len(list(sentences(text))) == number


def test_items_cells_of_a_table_and_headings_are_paragraphs_of_their_own():
    text = "## Title\n\nOne.\n* item\n* item\n\n| a | b |\n|---|---|\n| c | d |"
    assert list(paragraphs(text)) == ["Title", "One.", "item", "item", "a", "b", "c", "d"]


def test_a_formula_in_a_line_is_a_word_and_a_displayed_one_is_none():
    assert words(" ".join(paragraphs("Where $x^2 + y^2 = 1$ holds, `a + b` is so.\n\n$$a = b + c$$"))) == 6


def test_limits_hold_at_their_last_word():
    assert too_long("word " * 35 + ".") == []
    assert too_long("word " * 36 + ".") == ["a sentence of 36 words: " + ("word " * 12)[:60] + " …"]
    sentence = "Word " * 29 + "word. "
    assert too_long(sentence * 3) == []
    assert "a paragraph of 91 words" in too_long(sentence * 3 + "Word.")[0]


def test_folded_boxes_and_further_reading_are_beside_the_main_line():
    text = notebook(
        "Seen.\n\n<details><summary>Proof</summary>\n\nFolded.\n</details>", "### Further reading\n\nA book."
    )
    assert [one.text.split() for one in main_line(text)] == [["#", "05"], ["Seen."]]


def test_the_first_use_of_a_term_is_a_link_to_its_entry():
    linked = "A [fold](00_start_here.ipynb#fold) is where it turns. The fold moves."
    assert unlinked(notebook(linked), "05") == []
    assert unlinked(notebook("The fold moves. " + linked), "05") == ["Fold"]
    assert unlinked(notebook("# The fold\n\n" + linked), "05") == []
    assert unlinked(notebook("The fold moves."), "01") == []  # not a term of that lesson


@pytest.mark.parametrize("lesson", [f"{number:02}" for number in range(18)])
def test_no_question_reply_or_hint_is_longer_either(lesson):
    said = [(one.name, one.text) for one in questions(lesson).values()]
    said += [
        (one.name, text)
        for one in questions(lesson).values()
        for choice in one.choices
        for text in (choice.text, choice.reply)
    ]
    for one in exercises(lesson).values():
        said += [
            (one.name, text) for text in (*one.hints, one.praise, *(known.explanation for known in one.misconceptions))
        ]
    assert [(name, long) for name, text in said for long in too_long(text)] == []
