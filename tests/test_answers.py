"""What is chosen in a lesson's quizzes: kept without telling, written for the teacher, and never lost."""

import json
import re

import pytest

from camviz.draw import prose
from camviz_school.course.answers import AnswerBook, read_answers
from camviz_school.course.questions import predict_questions, question, quiz_questions
from camviz_school.widgets import quiz
from camviz_school.widgets.question import QuestionPage, QuestionWidget

STATE = (
    *("title", "lead", "cards", "summary", "looking_back", "can_start_again", "can_export", "exported", "problem"),
    "room",
)


@pytest.fixture
def book(tmp_path):
    return AnswerBook(tmp_path)


def form(name, when, book):
    return QuestionWidget(QuestionPage(quiz_questions("05", name), "…", when), book)


def page(widget):
    """Everything of the widget's state that reaches the browser, but its script and style."""
    state = widget.get_state()
    return json.dumps({key: state[key] for key in STATE}, ensure_ascii=False)


def answer(widget, choices):
    for number, choice in enumerate(choices):
        widget.commit(number, choice)


def right(name):
    return [one.answer for one in quiz_questions("05", name)]


def test_the_page_knows_every_trait_that_the_browser_is_sent(book):
    own = set(QuestionWidget.class_own_traits(sync=True)) - {"_esm", "_css", "still_hidden"}
    assert own <= set(STATE)


@pytest.mark.parametrize("choices", [[0, 0, 0, 0], [2, 1, 0, 2]])
def test_before_the_lesson_the_page_is_told_nothing_whatever_is_chosen(book, choices):
    widget = form("A", "before", book)
    answer(widget, choices)
    for one in widget.sheet.questions:
        for choice in one.choices:
            assert prose.to_html(choice.reply) not in page(widget)
            assert not choice.misconception or choice.misconception not in page(widget)
    assert all(card["correct"] is None for card in widget.cards)
    assert len({card["reply"] for card in widget.cards}) == 1
    assert not re.search("✓|✗|right at", page(widget))


def test_before_the_lesson_nothing_that_is_stored_holds_an_answer(book, monkeypatch):
    monkeypatch.setenv("CAMVIZ_STATIC", "1")
    sheet = quiz("05", "A")
    still = form("A", "before", book).still()
    for stored in (sheet._repr_html_(), repr(sheet), *still.values()):
        assert prose.inline(sheet.questions[0].choices[0].text) in stored or "(a)" in stored
        assert not re.search("✓|✗|<details>|Correct", stored)
        for one in sheet.questions:
            assert not any(prose.to_plain(choice.reply)[:30] in stored for choice in one.choices)
            assert not any(misconception in stored for misconception in one.misconceptions)


def test_before_the_lesson_a_question_takes_one_choice(book):
    widget = form("A", "before", book)
    widget.commit(0, 1)
    with pytest.raises(ValueError, match="takes one choice, and has it"):
        widget.commit(0, 2)
    assert widget.cards[0]["chosen"] == 1
    assert [one.choice for one in book.answers("05")] == ["b"]


def test_what_was_chosen_before_is_there_again_after_a_restart(book):
    form("A", "before", book).commit(2, 1)
    again = form("A", "before", book)
    assert [card["chosen"] for card in again.cards] == [None, None, 1, None]
    assert again.summary == ""
    for number in (0, 1, 3):
        again.commit(number, 0)
    assert "camviz_answers.csv" in again.summary
    assert form("A", "before", book).summary == again.summary


def predict(book, name="05.far_rays"):
    return QuestionWidget(QuestionPage((question(name),), "Predict"), book)


def test_an_answered_question_is_shown_with_its_reply_and_says_that_it_is_old(book):
    first = predict(book)
    wrong = (first.sheet.questions[0].answer + 1) % 2
    first.commit(0, wrong)
    assert not first.cards[0]["earlier"]
    (card,) = predict(book).cards
    assert card == {**first.cards[0], "earlier": True}
    assert card["reply"] == prose.to_html(first.sheet.questions[0].choices[wrong].reply)
    again = predict(book)
    again.commit(0, first.sheet.questions[0].answer)
    assert [predict(book).tries, again.cards[0]["earlier"]] == [((wrong, first.sheet.questions[0].answer),), False]


def test_questions_of_one_lesson_are_kept_apart(book):
    predict(book).commit(0, 1)
    others = [one.name for one in predict_questions("05") if one.name != "05.far_rays"]
    assert [predict(book, name).tries for name in others] == [((),)] * 2


def test_the_exit_quiz_is_there_again_with_its_score(book):
    widget = form("B", "after", book)
    answer(widget, right("B"))
    again = form("B", "after", book)
    assert again.summary == widget.summary == "4 of 4 right at the first try."
    assert all(card["correct"] and card["earlier"] for card in again.cards)


def test_start_again_clears_what_is_seen_and_first_choices_stay_first(book):
    wrong = (right("B")[0] + 1) % 3
    widget = form("B", "after", book)
    assert not widget.can_start_again
    widget.commit(0, wrong)
    assert widget.can_start_again
    widget._receive(widget, {"again": True}, [])
    for one in (widget, form("B", "after", book)):
        assert (one.tries, one.can_start_again, one.summary) == (((),) * 4, False, "")
        assert all(card["chosen"] is None and card["reply"] == "" for card in one.cards)
    answer(widget, right("B"))
    assert form("B", "after", book).tries == tuple((choice,) for choice in right("B"))
    exported = read_answers(book.export("05"))
    first = [one.correct for one in exported if one.concept == widget.sheet.questions[0].concept]
    assert first == [False, True]
    assert [one.attempt for one in exported] == [1, 2, 1, 1, 1]


def test_the_choices_before_a_lesson_cannot_be_taken_back(book):
    widget = form("A", "before", book)
    widget.commit(0, 1)
    assert not widget.can_start_again
    with pytest.raises(ValueError, match="take one choice"):
        widget.start_again()
    assert form("A", "before", book).tries[0] == (1,)


def test_only_quizzes_are_exported(book):
    predict(book).commit(0, 1)
    with pytest.raises(ValueError, match="no answer to lesson 05"):
        book.export("05")
    answer(form("A", "before", book), right("A"))
    assert {one.when for one in read_answers(book.export("05"))} == {"before"}


def test_the_still_holds_what_was_chosen_with_its_reply_and_no_other(book):
    widget = predict(book)
    one = widget.sheet.questions[0]
    assert "(your answer)" not in widget.still()["text/html"]
    widget.commit(0, one.answer)
    for still in (widget.still()["text/html"], predict(book).still()["text/html"]):
        assert f"<strong>{prose.inline(one.choices[one.answer].text)}</strong> (your answer)" in still
        for index, choice in enumerate(one.choices):
            assert (prose.to_plain(choice.reply)[:30] in prose.to_plain(still)) == (index == one.answer)
    silent = form("A", "before", book)
    silent.commit(0, 0)
    assert not re.search("✓|✗|<details>|Correct", silent.still()["text/html"])


def test_one_code_joins_before_and_after_and_says_nothing_of_a_person(book):
    answer(form("A", "before", book), right("A"))
    answer(form("B", "after", book), right("B"))
    codes = {one.participant for one in book.answers("05")}
    assert len(codes) == 1
    assert re.fullmatch("[0-9a-f]{8}", codes.pop())
    assert (
        book.path.read_text(encoding="utf-8").splitlines()[0] == "participant,lesson,when,form,concept,attempt,choice"
    )


def test_the_kept_file_does_not_tell_what_is_right(book):
    answer(form("A", "before", book), [0, 0, 0, 0])
    kept = book.path.read_text(encoding="utf-8")
    assert "correct" not in kept
    assert not any(misconception in kept for one in quiz_questions("05", "A") for misconception in one.misconceptions)


def test_the_exported_file_says_what_is_behind_each_choice(book):
    before, after = right("A"), right("B")
    before[0] = (before[0] + 1) % 3
    answer(form("A", "before", book), before)
    widget = form("B", "after", book)
    wrong = (after[1] + 1) % 3
    widget.commit(1, wrong)
    answer(widget, after)
    widget._receive(widget, {"export": True}, [])
    (path,) = book.folder.glob("answers_05_*.csv")
    assert widget.exported.startswith(f"Written to {path.name}")
    assert "9 choices" in widget.exported
    rows = read_answers(path)
    assert [one.correct for one in rows if one.when == "before"] == [False, True, True, True]
    assert rows[0].misconception == quiz_questions("05", "A")[0].choices[before[0]].misconception
    tangential = [one for one in rows if one.when == "after" and one.concept == quiz_questions("05")[1].concept]
    assert [(one.attempt, one.correct) for one in tangential] == [(1, False), (2, True)]


def test_an_exported_file_grows_and_another_reader_s_is_left_alone(book):
    answer(form("A", "before", book), right("A"))
    first = book.export("05").read_text(encoding="utf-8")
    answer(form("B", "after", book), right("B"))
    path = book.export("05")
    assert path.read_text(encoding="utf-8").startswith(first)
    book.path.unlink()  # the next reader at the same machine
    answer(form("A", "before", book), right("A"))
    assert book.export("05") != path
    assert path.read_text(encoding="utf-8").startswith(first)


def test_the_answers_of_before_are_told_at_the_end_and_not_earlier(book):
    answer(form("A", "before", book), right("A"))
    widget = form("B", "after", book)
    for number, choice in enumerate(right("B")):
        assert (widget.looking_back, widget.can_export) == ("", False)
        widget.commit(number, choice)
    assert "4 of 4 right" in widget.looking_back
    assert widget.looking_back.count("You chose the answer:") == 4
    assert all(
        prose.to_html(one.choices[one.answer].reply)[3:40] in widget.looking_back for one in quiz_questions("05", "A")
    )
    assert form("B", "after", book).can_export


def test_looking_back_shows_a_wrong_choice_with_its_reply_and_the_answer_beside_it(book):
    wrong = [(answer + 1) % 3 for answer in right("A")]
    answer(form("A", "before", book), wrong[:1])
    widget = form("B", "after", book)
    answer(widget, right("B"))
    one = quiz_questions("05", "A")[0]
    assert "0 of 1 right" in widget.looking_back
    assert re.search("You chose:.*The answer:", widget.looking_back)
    for choice in (one.choices[wrong[0]], one.choices[one.answer]):
        assert prose.inline(choice.text) in widget.looking_back
        assert prose.to_html(choice.reply) in widget.looking_back


def test_who_skipped_the_quiz_before_the_lesson_has_nothing_to_look_back_at(book):
    widget = form("B", "after", book)
    answer(widget, right("B"))
    assert widget.looking_back == ""
    assert widget.can_export


def test_half_a_class_can_have_the_forms_the_other_way_round(book):
    answer(form("B", "before", book), right("B"))
    answer(form("A", "after", book), right("A"))
    assert [(one.when, one.form) for one in book.answers("05")] == [("before", "B")] * 4 + [("after", "A")] * 4
    with pytest.raises(ValueError, match='when must be "before" or "after", got \'later\''):
        quiz("05", "A", when="later")
    with pytest.raises(ValueError, match="the quiz of '05' has no 'C'"):
        quiz("05", "C")
    assert quiz("05", "B", when="before").silent
    assert not quiz("05", "A", when="after").silent


def test_a_folder_that_cannot_be_written_is_said_and_the_quiz_goes_on(tmp_path):
    widget = form("B", "after", AnswerBook(tmp_path / "absent"))
    widget.commit(0, 0)
    assert widget.cards[0]["reply"]
    assert "cannot be kept" in widget.problem


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("name,age\n", "the first line must be participant,lesson,when"),
        ("", "the first line must be"),
        ("HEADER\nab,05,before,A,x,1\n", "line 2: needs 7 entries, has 6"),
        ("HEADER\n../ab,05,before,A,x,1,a\n", "line 2: is no answer"),
        ("HEADER\nab,05,later,A,x,1,a\n", "line 2: is no answer"),
        ("HEADER\nab,05,before,A,x,one,a\n", "line 2: is no answer"),
        ("HEADER\nab,05,before,A,x,1,ab\n", "line 2: is no answer"),
        ("HEADER\nab,05,before,A,x,1,é\n", "line 2: is no answer"),
        ("HEADER,correct,misconception\nab,05,before,A,x,1,a,yes,\n", "line 2: correct must be 0 or 1, got 'yes'"),
    ],
)
def test_a_file_that_somebody_changed_is_named_by_its_line_and_left_as_it_is(book, text, complaint):
    text = text.replace("HEADER", "participant,lesson,when,form,concept,attempt,choice")
    book.path.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=complaint):
        book.answers("05")
    widget = form("A", "before", book)
    widget.commit(0, 0)
    assert complaint in widget.problem
    assert book.path.read_text(encoding="utf-8") == text


def test_a_line_without_its_end_is_not_run_together_with_the_next(book):
    form("A", "before", book).commit(0, 0)
    book.path.write_text(book.path.read_text(encoding="utf-8").rstrip("\n"), encoding="utf-8")
    form("A", "before", book).commit(1, 1)
    assert [one.choice for one in book.answers("05")] == ["a", "b"]


def test_what_a_lesson_does_not_ask_any_more_is_left_out_of_the_export(book):
    answer(form("A", "before", book), right("A"))
    with book.path.open("a", encoding="utf-8") as file:
        file.write("ab,05,before,A,a concept of long ago,1,a\nab,05,before,A,the unit of r,2,h\n")
    assert len(read_answers(book.export("05"))) == 4
    with pytest.raises(ValueError, match="no answer to lesson 06"):
        book.export("06")
