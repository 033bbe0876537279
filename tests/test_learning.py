"""Hake's gain: what it is on paper, how often its interval is right, and which answers count."""

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from camviz_school.course.answers import KEPT_IN, AnswerBook
from camviz_school.course.learning import class_scores, normalised_gain
from camviz_school.course.questions import quiz_questions

PAGE = Path(__file__).parents[1] / "docs/learning.md"


@pytest.fixture
def rng():
    return np.random.default_rng(1998)


def classroom(students, rng, questions=4):
    """Shares before and after of students who differ: the abler they are, the better at both ends."""
    able = rng.beta(3, 3, students)
    before = rng.binomial(questions, 0.25 + 0.5 * able) / questions
    return before, rng.binomial(questions, np.clip(0.45 + 0.5 * able, 0, 1)) / questions


TRUE = ((0.45 + 0.25) - (0.25 + 0.25)) / (1 - (0.25 + 0.25))
"""Of `classroom`, by the mean of able, 0.5; nobody comes to more than 0.95."""


def test_a_gain_on_paper(rng):
    before, after = [0.25, 0.5, 0.0, 0.75, 0.5], [0.75, 0.5, 0.5, 1.0, 0.75]
    found = normalised_gain(before, after, rng)
    assert found.gain == pytest.approx((0.7 - 0.4) / (1 - 0.4))  # of 40 % and 70 %: half of what was missing
    assert found.low < found.gain < found.high
    assert (found.level, found.students) == (0.95, 5)
    assert re.fullmatch(r"g = 0\.50 \(95 %: \d\.\d\d to \d\.\d\d; 5 students\)", str(found))


def test_a_class_that_forgets_has_a_negative_gain(rng):
    assert normalised_gain([0.5, 0.75, 0.5], [0.25, 0.5, 0.25], rng).gain == pytest.approx(-0.25 / (1 - 7 / 12))


def test_the_interval_is_that_of_the_delta_method_in_a_large_class_whose_students_keep_their_order(rng):
    able = rng.uniform(0, 1, 600)
    before, after = rng.binomial(20, able) / 20, rng.binomial(20, able + 0.4 * (1 - able)) / 20
    found = normalised_gain(before, after, rng)
    room = 1 - before.mean()
    # g = 1 − (1 − after)/(1 − before); its slopes are 1/room after and −(1 − g)/room before
    each = (after - after.mean()) / room - (1 - found.gain) / room * (before - before.mean())
    half = 1.96 * each.std(ddof=1) / np.sqrt(600)
    assert found.high - found.gain == pytest.approx(half, rel=0.12)
    assert found.gain - found.low == pytest.approx(half, rel=0.12)


@pytest.mark.thorough
@pytest.mark.parametrize(("students", "least", "most"), [(10, 0.83, 0.95), (40, 0.90, 0.985)])
def test_about_19_of_20_intervals_hold_the_true_gain_and_fewer_in_a_small_class(rng, students, least, most):
    """So says docs/learning.md, from more classes than these."""
    intervals = [normalised_gain(*classroom(students, rng), rng) for _ in range(200)]
    held = np.mean([one.low <= TRUE <= one.high for one in intervals])
    assert least <= held <= most


def test_another_level_makes_another_width(rng):
    before, after = classroom(40, rng)
    half, most = (normalised_gain(before, after, rng, level=level) for level in (0.5, 0.99))
    assert half.high - half.low < 0.5 * (most.high - most.low)


def test_students_who_do_not_differ_give_no_interval(rng):
    found = normalised_gain([0.5, 0.5, 0.5], [0.75, 0.75, 0.75], rng)
    assert found.gain == 0.5
    assert np.isnan([found.low, found.high]).all()


@pytest.mark.parametrize(
    ("before", "after", "complaint"),
    [
        ([0.5], [0.75], "at least 2 students, got (1,)"),
        ([0.5, 0.2], [0.75], "got (2,) and (1,)"),
        ([50, 20], [75, 40], "shares between 0 and 1"),
        ([0.5, np.nan], [0.5, 0.5], "shares between 0 and 1"),
        ([1, 1], [1, 1], "leave something to gain"),
    ],
)
def test_what_has_no_gain_is_refused(before, after, complaint, rng):
    with pytest.raises(ValueError, match=re.escape(complaint)):
        normalised_gain(before, after, rng)


def student(folder, before, after, forms=("A", "B")):
    """A file as a student exports it, with so many right first choices before and after."""
    book = AnswerBook(folder)
    for when, form, right in (("before", forms[0], before), ("after", forms[1], after)):
        for number, one in enumerate(quiz_questions("05", form)):
            wrong = (one.answer + 1) % len(one.choices)
            if right is not None:
                book.keep(one, when, one.answer if number < right else wrong)
                book.keep(one, when, one.answer)  # a second try, which does not count
    path = book.export("05")
    book.path.unlink()
    return path


def test_a_class_s_files_become_scores_by_first_tries_of_those_who_answered_all(tmp_path):
    made = [student(tmp_path, *shares) for shares in ((1, 3), (0, 4), (2, 2))]
    student(tmp_path, 3, None)
    student(tmp_path, 2, 3, forms=("B", "A"))
    scores = class_scores(tmp_path.glob("answers_05_*.csv"), "05")
    assert sorted(zip(scores.before, scores.after, strict=True)) == [(0, 1), (0.25, 0.75), (0.5, 0.5), (0.5, 0.75)]
    assert scores.incomplete == 1
    assert {path.stem.split("_")[2] for path in made} < set(scores.participants)
    assert class_scores(tmp_path.glob("*.csv"), "06").participants == ()


def test_a_file_that_comes_twice_or_was_not_exported_is_named(tmp_path):
    path = student(tmp_path, 1, 3)
    (tmp_path / "copy.csv").write_bytes(path.read_bytes())
    with pytest.raises(ValueError, match="another file has the code"):
        class_scores(tmp_path.glob("*.csv"), "05")
    (tmp_path / "copy.csv").unlink()
    AnswerBook(tmp_path).keep(quiz_questions("05")[0], "after", 0)
    with pytest.raises(ValueError, match=f"{KEPT_IN} says not what is right"):
        class_scores([tmp_path / KEPT_IN], "05")


def test_one_answer_left_out_leaves_out_the_student(tmp_path):
    path = student(tmp_path, 1, 3)
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    with path.open("w", encoding="utf-8", newline="") as file:
        csv.writer(file).writerows([*rows[:1], *rows[3:]])
    assert class_scores([path], "05").incomplete == 1


def test_the_example_of_the_page_runs(tmp_path, monkeypatch, capsys):
    (code,) = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    (tmp_path / "collected").mkdir()
    for shares in ((1, 3), (0, 4), (2, 2), (1, 4), (2, 3), (3, 3)):
        student(tmp_path / "collected", *shares)
    monkeypatch.chdir(tmp_path)
    exec(code, {})
    printed = capsys.readouterr().out
    assert "g = 0.67" in printed  # 9 of 24 before, 19 of 24 after: 10 of the 15 that were missing
    assert "6 students" in printed


def test_the_page_claims_nothing_before_a_class_has_filled_its_table():
    text = PAGE.read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if re.match(r"\| (\d\d|…) ", line)]
    assert rows == ["| … | … | … | … | … | … | … |"]
