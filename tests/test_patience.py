"""The time limit: a reader's function that does not return is stopped, nothing stays behind, and debuggers work."""

import _thread
import io
import os
import queue
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

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


PYTHONS = [sys.executable, *filter(None, os.environ.get("CAMVIZ_PYTHONS", "").split(os.pathsep))]
"""This Python, and others that have numpy and coverage."""

AFTER_A_CHECK = """
import contextlib, io, pdb, subprocess, sys, threading, time
from camviz.views import patience
from camviz_school.course.checks import Exercise, judge

patience.NOTICE_S, patience.LIMIT_S = 0.1, 0.3
double = Exercise("00.double", lambda x: 2 * x, lambda rng: [(rng.normal(),)] * 4, ("a", "b", "c"), "Twice.")

def catches(x):
    while True:
        with contextlib.suppress(Exception):
            time.sleep(0.001)

def opens_debugger(x):
    breakpoint()
    return 2 * x

for endless in (lambda x: [0 for _ in iter(int, 1)], lambda x: time.sleep(60), catches):
    start = time.monotonic()
    print(judge(double, endless).message)
    assert time.monotonic() - start < 12
print(judge(double, lambda x: 2 * x).status)

lines = []
sys.settrace(lambda frame, event, _: lines.append(event))
(lambda: 1)()
sys.settrace(None)
print("traced", len(lines) > 0)

class SlowKeyboard(io.StringIO):
    def readline(self):
        time.sleep(0.5)
        return "continue\\n"

sys.stdin = SlowKeyboard()
print(judge(double, opens_debugger).status)
"""


@pytest.fixture(autouse=True)
def impatient(monkeypatch):
    monkeypatch.setattr(patience, "LIMIT_S", 0.2)
    monkeypatch.setattr(patience, "NOTICE_S", 0.1)
    monkeypatch.setattr(yours, "_stopped", {})


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


def wait_for_a_queue(x):
    queue.Queue().get()


RUNNING = [
    loop,
    loop_in_numpy,
    loop_that_catches_exceptions,
    loop_in_a_generator,
    loop_then_answer,
]
WAITING = [sleep, loop_in_finally, wait_for_a_queue]


class Endless:
    """A result whose looking at does not end."""

    def __array__(self, *given, **named):
        return loop(0)


def assert_nothing_comes_after():
    """No thread, no signal, and nothing that is raised in this thread."""
    for _ in range(20_000):
        str(_)
    deadline = time.monotonic() + 60
    while any(thread.name.endswith("(_watch)") for thread in threading.enumerate()) and time.monotonic() < deadline:
        time.sleep(0.01)
    assert _thread._count() - threading.active_count() == UNKNOWN
    assert signal.getitimer(signal.ITIMER_REAL) == (0, 0)
    assert signal.getsignal(signal.SIGALRM) == signal.SIG_DFL


@pytest.mark.parametrize("function", [*RUNNING, *WAITING])
def test_a_call_that_does_not_return_is_stopped(function, capsys):
    with Patience() as few_moments, pytest.raises(TimeIsUp):
        few_moments.call(function, 1.0)
    assert_nothing_comes_after()
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


@pytest.mark.parametrize("python", PYTHONS, ids=lambda path: path.split(os.sep)[-3])
def test_checks_leave_tracing_and_debuggers_alone(python, tmp_path):
    """After checks that were stopped, settrace, pdb and coverage work in a fresh process of each Python at hand."""
    script = tmp_path / "after_a_check.py"
    script.write_text(AFTER_A_CHECK)
    environment = {**os.environ, "PYTHONPATH": str(Path(__file__).parents[1]), "COVERAGE_FILE": str(tmp_path / "c")}
    for command in ([python], [python, "-m", "coverage", "run"]):
        ended = subprocess.run(
            [*command, str(script)], input="quit\n", capture_output=True, text=True, timeout=300, env=environment
        )
        assert ended.returncode == 0, ended.stderr
        assert ended.stdout.count("had not returned after 10 s, and was stopped.") == 3
        assert ended.stdout.count("correct") == 2
        assert "traced True" in ended.stdout
        assert ended.stdout.count("opens_debugger()") == 4, "the debugger opens in each call, on the screen"


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


@pytest.mark.parametrize("function", [loop, loop_then_answer, lambda x: Endless()])
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
