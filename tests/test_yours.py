"""A reader's function in a picture: numbers in the shape that is wanted, or empty places and one sentence."""

import numpy as np
import pytest

from camviz.views.yours import MID_GREY, attempt, attempt_each, tried, was_missed

WANTED = np.zeros((2, 3))


def stub(x):
    """Not written yet."""


def unwritten(x):
    raise NotImplementedError


def short(x):
    return x[0]


def broken(x):
    return x.colour


def several(x):
    return x, x[0]


def rude(x):
    raise SystemExit("bye")


def test_what_a_function_answers_comes_through(capsys):
    np.testing.assert_array_equal(attempt(lambda x: x + 1, WANTED, like=WANTED), WANTED + 1)
    assert attempt(lambda x: [[1, 2, 3], [4, 5, 6]], WANTED, like=WANTED).tolist() == [[1, 2, 3], [4, 5, 6]]
    assert attempt(float, 3, like=0.0) == 3.0
    assert capsys.readouterr().out == ""


@pytest.mark.parametrize(
    ("function", "sentence"),
    [
        (stub, "`stub` returns nothing yet, so its part of the picture stays empty."),
        (unwritten, "`unwritten` is not written yet, so its part of the picture stays empty."),
        (short, "`short` answers in shape (3,), where (2, 3) is wanted"),
        (broken, "AttributeError"),
        (several, "(2, 3), (3,), where (2, 3) is wanted"),
        (rude, "SystemExit: bye"),
    ],
)
def test_what_gives_no_answer_leaves_its_place_empty_and_says_so_once(capsys, function, sentence):
    answer = attempt(function, WANTED, like=WANTED)
    assert answer.shape == WANTED.shape
    assert np.isnan(answer).all()
    printed = capsys.readouterr().out
    assert sentence in printed
    assert printed.count("\n") == 1


def test_a_plot_that_was_drawn_before_its_function_was_written_is_remembered_until_asked_for(capsys):
    def later(x): ...

    def faulty(x):
        return x[5]

    attempt(later, np.zeros(3), like=np.zeros(3))
    attempt(faulty, np.zeros(3), like=np.zeros(3))
    assert was_missed(later)
    assert not was_missed(later)
    assert not was_missed(faulty)
    attempt_each(later, [1.0], like=np.zeros(1))
    assert was_missed(later)


def test_a_tuple_is_answered_by_a_tuple():
    (rows, columns), problem = tried(several, (WANTED,), (WANTED, WANTED[0]))
    assert (rows.shape, columns.shape, problem) == ((2, 3), (3,), "")


def test_a_picture_of_bytes_stays_one():
    picture = np.zeros((4, 4, 3), np.uint8)
    bright, _ = tried(lambda one: one + 300.0, (picture,), picture)
    empty, _ = tried(stub, (picture,), picture)
    assert bright.dtype == empty.dtype == np.uint8
    assert (bright == 255).all()
    assert (empty == MID_GREY).all()
    mask, _ = tried(stub, (picture,), picture > 0)
    assert mask.dtype == bool
    assert not mask.any()


def test_the_function_cannot_change_what_the_lesson_goes_on_with():
    given = np.ones(3)

    def overwrites(x):
        x[:] = 7
        np.pi = 3
        return x

    attempt(overwrites, given, like=given)
    assert given.tolist() == [1, 1, 1]
    assert np.pi > 3.14


def test_whoever_stops_a_function_is_told_so_and_it_is_not_called_again():
    calls = []

    def endless(x):
        calls.append(x)
        raise KeyboardInterrupt

    for _ in range(2):
        answer, problem = tried(endless, (1.0,), 0.0)
        assert np.isnan(answer)
        assert problem.startswith("You stopped `endless` before it returned, so its part")
    assert len(calls) == 1


def test_an_answer_of_nothing_but_nan_is_called_that_unless_it_is_right():
    answer, problem = tried(lambda x: x * np.nan, (WANTED,), WANTED)
    assert np.isnan(answer).all()
    assert "NaN everywhere" in problem
    assert tried(lambda x: x, (WANTED * np.nan,), WANTED * np.nan)[1] == ""


def test_a_thing_that_only_looks_like_a_function_is_told_of_all_the_same():
    class Thing:
        def __getattr__(self, name):
            raise SystemExit

        def __call__(self, x):
            raise ValueError("no")

    assert "ValueError: no" in tried(Thing(), (1.0,), 0.0)[1]


def test_a_function_of_one_case_is_called_for_each_and_complains_once(capsys):
    def half(row, offset):
        return row / 2 + offset

    rows = np.arange(6.0).reshape(3, 2)
    np.testing.assert_array_equal(attempt_each(half, rows, [1.0] * 3, like=rows), rows / 2 + 1)
    assert capsys.readouterr().out == ""

    def stub(row, offset): ...

    assert np.isnan(attempt_each(stub, rows, [1.0] * 3, like=rows)).all()
    assert capsys.readouterr().out.count("returns nothing yet") == 1
