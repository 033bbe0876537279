"""The time limit: whatever a reader's function catches or waits for, its call ends, and nothing stays behind."""

import _thread
import contextlib
import io
import queue
import signal
import sys
import threading
import time

import numpy as np
import pytest

from camviz.views import patience, yours
from camviz.views.patience import Patience, TimeIsUp
from camviz.views.yours import attempt_each, tried
from camviz_school.course.checks import Exercise, judge

DOUBLE = Exercise("00.double", lambda x: 2 * x, lambda rng: [(rng.normal(size=3),)] * 4, ("a", "b", "c"), "Twice.")
A_LONG_TIME = 3600
UNKNOWN = _thread._count() - threading.active_count()
"""Threads that this module did not start less the main one, such as those of a test runner's workers."""


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr(patience, "LIMIT_S", 0.2)
    monkeypatch.setattr(patience, "NOTICE_S", 0.1)
    monkeypatch.setattr(yours, "_stopped", {})
    before = signal.signal(signal.SIGINT, signal.default_int_handler)  # a job in the background is deaf to it
    yield
    signal.signal(signal.SIGINT, before)


def loop(x):
    while True:
        pass


def loop_in_numpy(x):
    while True:
        x = np.sin(x)


def loop_that_catches_exceptions(x):
    while True:
        try:
            x = np.sin(x)
        except Exception:
            x = 0.0


def loops_that_catch_everything(x):
    while True:
        try:
            try:
                for _ in range(10**12):
                    pass
            except:  # noqa: E722
                pass
        except BaseException:
            pass


def loop_that_suppresses_everything(x):
    while True:
        with contextlib.suppress(BaseException):
            for _ in range(10**12):
                pass


def recursion_that_catches_everything(x):
    while True:
        try:
            recursion_that_catches_everything(x)
        except BaseException:
            continue


def loop_in_finally(x):
    try:
        loop(x)
    finally:
        loop(x)


def loop_in_a_generator(x):
    def ones():
        while True:
            yield 1

    return sum(ones())


def loop_then_answer(x):
    try:
        loop(x)
    except BaseException:
        return 2 * x


def sleep(x):
    time.sleep(A_LONG_TIME)


def sleeps_that_catch_everything(x):
    while True:
        with contextlib.suppress(BaseException):
            time.sleep(A_LONG_TIME)


def wait_for_a_queue(x):
    queue.Queue().get()


RUNNING = [
    loop,
    loop_in_numpy,
    loop_that_catches_exceptions,
    loops_that_catch_everything,
    loop_that_suppresses_everything,
    recursion_that_catches_everything,
    loop_in_finally,
    loop_in_a_generator,
    loop_then_answer,
]
WAITING = [sleep, sleeps_that_catch_everything, wait_for_a_queue]


class Endless:
    """A result whose looking at does not end."""

    def __array__(self, *given, **named):
        return loop(0)


def assert_nothing_comes_after():
    """No thread, and nothing that is raised in this one."""
    for _ in range(20_000):
        str(_)
    assert _thread._count() - threading.active_count() == UNKNOWN


@pytest.mark.parametrize("function", [*RUNNING, *WAITING])
def test_a_call_that_does_not_return_is_stopped(function, capsys):
    before = threading.active_count()
    with Patience() as few_moments, pytest.raises(TimeIsUp):
        few_moments.call(function, 1.0)
    assert_nothing_comes_after()
    assert threading.active_count() == before
    assert capsys.readouterr().out == "still running: press ■ to stop\n"


@pytest.mark.parametrize("function", RUNNING)
def test_it_is_stopped_in_other_threads_than_the_main_one_and_nobody_speaks_of_a_button_there(function, capsys):
    ends = []

    def answer():
        with Patience() as few_moments:
            try:
                few_moments.call(function, 1.0)
            except TimeIsUp:
                ends.append("stopped")
        assert_nothing_comes_after()
        ends.append("over")

    thread = threading.Thread(target=answer)
    thread.start()
    thread.join()
    assert ends == ["stopped", "over"]
    assert capsys.readouterr().out == "still running: it is stopped after 0.2 s\n"


def test_what_returns_returns_and_what_is_raised_is_raised(capsys, monkeypatch):
    monkeypatch.setattr(patience, "LIMIT_S", A_LONG_TIME)
    monkeypatch.setattr(patience, "NOTICE_S", A_LONG_TIME)
    with Patience() as few_moments:
        assert few_moments.call(max, 1, 2) == 2
        with pytest.raises(ZeroDivisionError):
            few_moments.call(lambda: 1 / 0)
        with pytest.raises(KeyboardInterrupt):
            few_moments.call(_thread.interrupt_main) or time.sleep(1)
    assert capsys.readouterr().out == ""


def test_several_calls_share_the_time_and_none_begins_when_it_is_up():
    calls = []
    with Patience() as few_moments:
        with pytest.raises(TimeIsUp):
            few_moments.call(loop, 1)
        with pytest.raises(TimeIsUp):
            few_moments.call(calls.append, 1)
    assert calls == []


def test_a_closed_screen_keeps_nobody_from_stopping_a_loop(monkeypatch):
    screen = io.StringIO()
    screen.close()
    monkeypatch.setattr(sys, "stdout", screen)
    with Patience() as few_moments, pytest.raises(TimeIsUp):
        few_moments.call(loop, 1)


@pytest.mark.parametrize("function", [loop, loops_that_catch_everything, loop_then_answer, lambda x: Endless()])
def test_a_check_of_a_function_that_never_ends_says_so_in_a_sentence(function):
    calls = []

    def counted(x):
        calls.append(x)
        return function(x)

    answer = judge(DOUBLE, counted, np.random.default_rng(0))
    assert answer.status == "wrong"
    assert "had not returned after" in answer.message
    assert answer.message.endswith("Does a loop in it never end?")
    assert len(calls) == 1
    assert_nothing_comes_after()


def test_a_law_in_which_the_function_never_ends_is_stopped():
    lawful = Exercise(
        "00.law", lambda x: 2 * x, DOUBLE.cases, ("-",) * 3, "-", laws=(lambda function, rng: function(7),)
    )
    answer = judge(lawful, lambda x: loop(x) if np.ndim(x) == 0 else 2 * x, np.random.default_rng(0))
    assert answer.message == "Your function had not returned after 10 s, and was stopped."


def test_what_a_stopped_function_has_replaced_is_put_back():
    import builtins

    names = ("isclose", "allclose")
    before = [getattr(np, name) for name in names], len, vars, np.random.default_rng

    def replaces(x):
        for name in names:
            setattr(np, name, None)
        np.random.default_rng = builtins.len = builtins.vars = None
        builtins.setattr = None
        loop(x)

    judge(DOUBLE, replaces, np.random.default_rng(0))
    assert before == ([getattr(np, name) for name in names], len, vars, np.random.default_rng)
    assert callable(setattr)


def test_in_a_picture_its_place_stays_empty_and_it_is_not_called_again():
    calls = []

    def endless(x):
        calls.append(x)
        loop(x)

    values, problem = tried(endless, (np.ones(2),), np.ones(2))
    assert np.isnan(values).all()
    assert problem.startswith("`endless` had not returned after 10 s, and was stopped, so its part of the picture")
    assert "run the cell in which it stands" in problem
    values, again = tried(endless, (np.ones(2),), np.ones(2))
    assert np.isnan(values).all()
    assert again == problem
    assert len(calls) == 1


def test_a_function_of_each_case_is_stopped_once_for_all(capsys):
    def endless(x):
        loop(x)

    answers = attempt_each(endless, np.ones(50), like=np.ones(50))
    assert np.isnan(answers).all()
    assert capsys.readouterr().out.count("`endless` had not returned") == 1
