"""Predict questions and quizzes: well formed, safe, and silent about the answer until the reader has committed."""

import json
import re
from unittest.mock import Mock

import pytest

from camviz.draw import prose
from camviz_school.course import notebooks
from camviz_school.course.material import lessons_folder, material
from camviz_school.course.questions import Question, parse, predict_questions, question, questions, quiz_questions
from camviz_school.widgets.question import QuestionPage, QuestionWidget, ask, quiz, score

LESSONS = sorted(path.parent.name for path in material().glob("*/questions.toml"))
ALL = [one for lesson in LESSONS for one in questions(lesson).values()]

GOOD = """
[[question]]
id = "colour"
kind = "predict"
text = "Is the sky blue?"
[[question.choice]]
text = "Yes"
reply = "Yes, by Rayleigh scattering."
correct = true
[[question.choice]]
text = "No"
reply = "Look up."
misconception = "the sky is a ceiling"
"""


@pytest.fixture
def widget():
    return QuestionWidget(QuestionPage(quiz_questions("05"), "Exit quiz"))


def page(widget):
    """Everything of the widget's state that reaches the browser, but its script and style."""
    state = widget.get_state()
    return json.dumps({key: state[key] for key in ("title", "cards", "summary", "problem")})


@pytest.mark.parametrize("one", ALL, ids=lambda one: one.name)
def test_every_question_has_one_correct_choice_and_every_wrong_one_its_misconception_and_its_own_reply(one):
    assert sum(choice.correct for choice in one.choices) == 1
    assert all(choice.misconception for choice in one.choices if not choice.correct)
    assert len({choice.reply for choice in one.choices}) == len(one.choices) >= 2
    assert len({choice.misconception for choice in one.choices}) == len(one.choices)


@pytest.mark.parametrize("one", ALL, ids=lambda one: one.name)
def test_no_asterisk_of_emphasis_is_left_for_a_reader_to_see(one):
    texts = [one.text, *(words for choice in one.choices for words in (choice.text, choice.reply))]
    assert [text for text in texts if "*" in prose.to_html(text)] == []


@pytest.mark.parametrize("one", ALL, ids=lambda one: one.name)
def test_a_reply_is_a_sentence_of_its_own_and_ends_like_one(one):
    for choice in one.choices:
        assert len(choice.reply.split()) >= 6, choice.text
        assert choice.reply.strip()[-1] in ".?!"


@pytest.mark.parametrize("lesson", LESSONS)
@pytest.mark.parametrize("form", "AB")
def test_every_quiz_has_three_to_five_questions_whose_answers_do_not_stand_in_one_place(lesson, form):
    quiz = quiz_questions(lesson, form)
    if lesson != "00" and (form == "B" or quiz):
        assert 3 <= len(quiz) <= 5
        assert len({one.answer for one in quiz}) > 1


@pytest.mark.parametrize("lesson", [lesson for lesson in LESSONS if quiz_questions(lesson, "A")])
def test_the_two_forms_ask_of_the_same_concepts_in_other_words(lesson):
    before, after = ({one.concept: one for one in quiz_questions(lesson, form)} for form in "AB")
    assert list(before) == list(after)
    for concept, one in before.items():
        assert one.misconceptions == after[concept].misconceptions
        assert len(one.choices) == len(after[concept].choices)
        assert one.text != after[concept].text
        replies = {choice.reply for choice in one.choices}
        assert not replies & {choice.reply for choice in after[concept].choices}


@pytest.mark.parametrize("one", ALL, ids=lambda one: one.name)
def test_no_sentence_of_form_a_has_more_than_35_words(one):
    if one.form == "A":
        texts = [one.text, *(text for choice in one.choices for text in (choice.text, choice.reply))]
        sentences = [sentence for text in texts for sentence in re.split(r"(?<=[.?!:;])\s", text)]
        assert max(len(sentence.split()) for sentence in sentences) <= 35


@pytest.mark.parametrize("lesson", LESSONS)
def test_the_longest_choice_is_not_always_the_correct_one(lesson):
    longest = [
        max(range(len(one.choices)), key=lambda i, o=one: len(o.choices[i].text)) for one in questions(lesson).values()
    ]
    assert longest != [one.answer for one in questions(lesson).values()]


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("correct = true", "", "exactly one choice with correct = true, has 0"),
        ('misconception = "the sky is a ceiling"', "correct = true", "exactly one choice with correct = true, has 2"),
        ('misconception = "the sky is a ceiling"', "", "must be correct or name its misconception"),
        ('reply = "Look up."', 'reply = "Yes, by Rayleigh scattering."', "same reply"),
        ('reply = "Look up."', "", "choice 2: reply must be given as str"),
        ('text = "No"', 'text = "Yes"', "same text"),
        ('kind = "predict"', 'kind = "exam"', 'kind must be "predict" or "quiz", got \'exam\''),
        ('id = "colour"', "", "without an id"),
        ("correct = true", "correkt = true", "got correkt"),
        ("[[question.choice]]", "[[question.choices]]", "got choices"),
        ('text = "Is', 'text = Is', "not TOML"),
    ],
)  # fmt: skip
def test_a_mistake_in_the_file_is_named(old, new, complaint):
    with pytest.raises(ValueError, match=re.escape(complaint)):
        parse("99", GOOD.replace(old, new))


def test_a_good_file_is_read_and_a_doubled_question_refused():
    assert parse("99", GOOD)["99.colour"].answer == 0
    with pytest.raises(ValueError, match="occurs 2 times"):
        parse("99", GOOD + GOOD)


TWIN = GOOD.replace('"colour"', '"grass"').replace("sky blue", "grass green")
PAIR = "".join(
    text.replace('"predict"', f'"quiz"\nform = "{form}"\nconcept = "colours"')
    for form, text in (("A", GOOD), ("B", TWIN))
)


def test_a_pair_is_read_and_a_quiz_without_forms_is_form_b(monkeypatch):
    assert [one.form for one in parse("99", PAIR).values()] == ["A", "B"]
    for text, forms in ((PAIR, ["05.colour"]), (GOOD.replace("predict", "quiz"), [])):
        monkeypatch.setattr("camviz_school.course.questions.questions", lambda lesson, text=text: parse(lesson, text))
        assert [one.name for one in quiz_questions("05", "A")] == forms
        assert len(quiz_questions("05")) == 1


def test_a_lesson_without_questions_has_an_empty_quiz_and_asks_nothing():
    assert quiz_questions("99") == predict_questions("99") == ()
    assert [one.kind for one in predict_questions("05")] == ["predict"] * 3


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ('form = "A"', 'form = "C"', "question 99.colour: form must be \"A\" or \"B\", got 'C'"),
        ('form = "A"', "", "question 99.colour: form and concept must be given together"),
        ('form = "A"', "form = 1", "question 99.colour: form must be given as str, got 1"),
        ('"quiz"\nform = "A"', '"predict"\nform = "A"', "question 99.colour: a predict question has no form"),
        ('form = "A"\nconcept = "colours"', "", "question 99.colour: needs a form and a concept"),
        ('form = "A"', 'form = "B"', "question 99.colour: 99.colour and 99.grass have one concept, 'colours'"),
        ('concept = "colours"', 'concept = "hues"', "no question of form B has its concept, 'hues'"),
        ('"the sky is a ceiling"', '"air is water"', "its twin 99.grass must share its misconceptions"),
    ],
)  # fmt: skip
def test_a_pair_that_is_none_is_refused_by_name(old, new, complaint):
    assert old in PAIR
    with pytest.raises(ValueError, match=re.escape(complaint)):
        parse("99", PAIR.replace(old, new, 1))


def test_a_wrong_name_is_answered_with_the_right_ones():
    with pytest.raises(ValueError, match=r"05\.far_rays"):
        question("05.fould")
    with pytest.raises(ValueError, match=r"no questions for lesson '\.\./05'"):
        questions("../05")


def test_no_reply_reaches_the_page_before_a_choice_is_committed(widget):
    for one in widget.sheet.questions:
        assert json.dumps(prose.inline(one.choices[0].text))[1:-1] in page(widget)
        for choice in one.choices:
            assert json.dumps(prose.to_html(choice.reply))[1:-1] not in page(widget)
    assert "misconception" not in page(widget)
    assert all(card["correct"] is None and card["chosen"] is None for card in widget.cards)


def test_the_reply_is_that_of_the_choice_made_and_of_no_other(widget):
    wrong = (widget.sheet.questions[0].answer + 1) % 3
    widget.commit(0, wrong)
    card = widget.cards[0]
    assert card["chosen"] == wrong
    assert card["correct"] is False
    assert card["reply"] == prose.to_html(widget.sheet.questions[0].choices[wrong].reply)
    assert all(other["reply"] == "" for other in widget.cards[1:])


def test_a_reply_reaches_the_page_together_with_all_that_belongs_to_it(widget):
    widget.comm = page = Mock(comm_id="page")
    for number, one in enumerate(widget.sheet.questions):
        widget.commit(number, one.answer)
    told = [call.kwargs["data"]["state"].keys() for call in page.send.call_args_list]
    assert len(told) == len(widget.sheet.questions)
    assert {"cards", "summary"} <= told[-1]


def test_a_quiz_counts_first_tries_only_and_waits_for_all_of_them(widget):
    answers = [one.answer for one in widget.sheet.questions]
    widget.commit(0, (answers[0] + 1) % 3)
    for number, answer in enumerate(answers):
        assert widget.summary == ""
        widget.commit(number, answer)
    assert widget.summary == "3 of 4 right at the first try."
    assert all(card["correct"] for card in widget.cards)
    assert score(widget.sheet.questions[:1], ((answers[0],),)) == ""


@pytest.mark.parametrize(
    "message", [{"question": 9, "choice": 0}, {"question": 0, "choice": -1}, {"question": 0}, "nonsense"]
)
def test_a_message_that_makes_no_sense_is_shown_in_the_pane_and_raised(widget, message):
    with pytest.raises((ValueError, KeyError, TypeError)):
        widget._receive(widget, message, [])
    assert widget.problem.startswith("This went wrong in the kernel")
    assert all(card["tries"] == 0 for card in widget.cards)


def test_without_a_kernel_questions_are_a_page_with_folded_replies():
    sheet = ask("05.far_rays")
    assert isinstance(sheet, QuestionPage)
    html = sheet._repr_html_()
    assert html.count("<details>") == html.count("<summary>") == len(question("05.far_rays").choices)
    assert "(a)" in repr(sheet)
    assert question("05.far_rays").choices[0].reply.split(".")[0] not in repr(sheet)


def test_in_a_kernel_the_widget_is_shown_and_the_page_beside_it(monkeypatch):
    class Shell:
        kernel = object()

    monkeypatch.delenv("CAMVIZ_STATIC", raising=False)
    monkeypatch.setattr("IPython.core.getipython.get_ipython", Shell)
    shown = []
    monkeypatch.setattr("camviz.widgets.still.display", lambda bundle, **_: shown.append(bundle))
    quiz("05")._ipython_display_()
    kept, live = shown
    assert "application/vnd.jupyter.widget-view+json" in live
    answers = [one.choices[one.answer].reply.split(".")[0] for one in quiz_questions("05")]
    assert not any(prose.to_plain(answer) in kept["text/html"] for answer in answers)
    monkeypatch.setenv("CAMVIZ_STATIC", "1")
    assert isinstance(quiz("05"), QuestionPage)


def test_a_lesson_without_a_quiz_says_so(monkeypatch):
    monkeypatch.setattr("camviz_school.widgets.question.quiz_questions", lambda lesson, form: ())
    with pytest.raises(ValueError, match="lesson '05' has no quiz"):
        quiz("05")


@pytest.mark.parametrize(
    ("text", "html"),
    [
        ("a < b & *c*", "<p>a &lt; b &amp; <em>c</em></p>"),
        ("`2*p1*x*y` and ``a`b``", "<p><code>2*p1*x*y</code> and <code>a`b</code></p>"),
        ("<img src=x onerror=alert(1)>", "<p>&lt;img src=x onerror=alert(1)&gt;</p>"),
        ("`<b>` *<b>*", "<p><code>&lt;b&gt;</code> <em>&lt;b&gt;</em></p>"),
        ("2 * 3 * 4", "<p>2 * 3 * 4</p>"),
        ("one\nline\n\nnext", "<p>one line</p><p>next</p>"),
        ("[x](javascript:alert(1))", "<p>[x](javascript:alert(1))</p>"),
    ],
)
def test_prose_becomes_safe_html_and_code_is_left_alone(text, html):
    assert prose.to_html(text) == html


def test_prose_in_a_terminal_keeps_code_and_drops_emphasis():
    assert prose.to_plain("the *only* `a*b*c`") == "the only `a*b*c`"


def test_a_question_cannot_be_built_without_choices():
    with pytest.raises(ValueError, match="at least two choices"):
        Question("00.x", "quiz", "Why?", ())


def above(question):
    """All prose and saved text above a question."""
    (path,) = lessons_folder().glob(f"{question[:2]}_*.ipynb")
    cells = notebooks.read(path).cells
    at = next(i for i, cell in enumerate(cells) if cell.source == f'ask("{question}")')
    outputs = [str(out.get("data", {}).get("text/plain", "")) for cell in cells[:at] for out in cell.get("outputs", [])]
    return " ".join([*(cell.source for cell in cells[:at]), *outputs])


@pytest.mark.parametrize(
    ("question", "words"),
    [
        ("12.measured", r"two thirds|interpolat|one of|each pixel|guess"),
        ("12.shifted", r"becomes orange|change places|which colour sees|other columns"),
        ("12.names", r"BGGR|second row|exchanged|Bayer(RG|BG)2"),
        ("12.blur", r"too late|low-pass|four spots 0|coarse and soft|afterwards"),
        ("13.white", r"greys come right|chosen patch,|pale|needs a matrix"),
        ("13.grey_world", r"brown|turns \*blue|scene=|\.mean\(axis"),
        ("13.tint", r"not enough|two dimensions|is one number|green side|beside the line"),
        ("13.gamma", r"encoded as a rule|linear values|\*\*linear|before the balance"),
        ("13.metamer", r"no matrix|cannot be told|twin|Luther|below about"),
        ("13.infrared", r"IR-cut|fade towards|near infrared"),
        ("15.light", r"Photon transfer[^✗]*on the card"),
        ("15.one_frame", r"K from the curve"),
    ],
)
def test_nothing_above_a_question_answers_it(question, words):
    assert re.search(words, above(question), 0 if question.startswith("12") else re.IGNORECASE) is None
