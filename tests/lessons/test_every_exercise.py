"""A right answer, a likely mistake and a hostile one of each kind, over all exercises at once."""

import subprocess
import sys
from copy import deepcopy

import numpy as np
import pytest
from test_exercises import ALL, EACH, function_of, solution_of

from camviz_school.course.checks import judge
from camviz_school.course.exercises import exercise
from camviz_school.course.trials import quiet, whole_numbers

SEED = 3


def cases_of(one):
    return list(one.cases(np.random.default_rng(SEED)))


def verdict(one, function):
    """The checker's; the cases are those of `cases_of`."""
    return judge(one, function, np.random.default_rng(SEED))


def changed(one, change):
    """The reference with its answer changed: change(answer, arguments), for each part of it."""

    def function(*arguments):
        with quiet():
            answer = one.reference(*deepcopy(arguments))
        if isinstance(answer, tuple):
            return tuple(change(np.asarray(part), arguments) for part in answer)
        return change(np.asarray(answer), arguments)

    return function


# A right answer -------------------------------------------------------------------------------------------------------

FORMS = {
    "a list": lambda answer, _: answer.tolist(),
    "in the order of Fortran": lambda answer, _: np.array(answer, order="F"),
    "a view backwards": lambda answer, _: answer[..., ::-1].copy()[..., ::-1] if answer.ndim else answer,
    "more digits": lambda answer, _: answer.astype(np.longdouble),
    "rounded otherwise": lambda answer, _: answer if answer.dtype.kind in "bi" else answer * (1 + 1e-13),
    "masked nowhere": lambda answer, _: np.ma.masked_array(answer),
}


@EACH
def test_a_right_answer_is_accepted_in_every_form(one):
    assert verdict(one, function_of(one, solution_of(one))).correct
    for form, change in FORMS.items():
        answer = verdict(one, changed(one, change))
        assert answer.correct, f"{form}: {answer!r}"


@EACH
def test_two_answers_may_come_in_one_array_or_a_list(one):
    parts = one.reference(*deepcopy(cases_of(one)[0]))
    if not isinstance(parts, tuple) or np.shape(parts[0]) != np.shape(parts[1]):
        pytest.skip("one answer, or two of two shapes")
    assert verdict(one, lambda *arguments: np.array(one.reference(*arguments))).correct
    assert verdict(one, lambda *arguments: list(one.reference(*arguments))).correct


def by_eigenvectors(uv, to):
    x = np.column_stack([uv, np.ones(len(uv))])
    A = np.block([[x, 0 * x, -to[:, :1] * x], [0 * x, x, -to[:, 1:] * x]])
    H = np.linalg.eigh(A.T @ A)[1][:, 0].reshape(3, 3)
    return H / H[2, 2]


def epipole_by_eigenvectors(F):
    e = np.linalg.eigh(F @ F.T)[1][:, 0]
    return e[:2] / e[2]


def coefficients_by_curve_fit(theta, r):
    from scipy.optimize import curve_fit

    return curve_fit(lambda t, *k: t + k[0] * t**3 + k[1] * t**5 + k[2] * t**7 + k[3] * t**9, theta, r, np.zeros(4))[0]


def polynomial_by_curve_fit(rho, theta):
    from scipy.optimize import curve_fit

    return curve_fit(lambda r, a, b, c, d: a + b * r**2 + c * r**3 + d * r**4, rho, rho / np.tan(theta))[0]


@pytest.mark.parametrize(
    ("name", "function"),
    [
        ("19.homography", by_eigenvectors),
        ("07.right_epipole", epipole_by_eigenvectors),
        ("09.coefficients", coefficients_by_curve_fit),
        ("10.polynomial", polynomial_by_curve_fit),
    ],
)
def test_a_plain_method_is_precise_enough(name, function):
    refused = [seed for seed in range(50) if not judge(exercise(name), function, np.random.default_rng(seed))]
    assert refused == []


# A likely mistake -----------------------------------------------------------------------------------------------------


def _first_off(answer, _):
    """The first number a tenth off, or the other way round for True and False, or a number in place of NaN."""
    answer = answer.astype(np.float64)
    first = np.nan_to_num(answer.flat[0], posinf=0)
    answer.flat[0] = 1 - first if first in (0, 1) else first * 1.1 + 0.1
    return answer


MISTAKES = {
    "a number off": _first_off,
    "an axis more": lambda answer, _: answer[..., None],
    "no number": lambda answer, _: answer * np.nan,
    "complex": lambda answer, _: answer + 1j,
}


@EACH
def test_a_likely_mistake_is_refused(one):
    for mistake, change in MISTAKES.items():
        answer = verdict(one, changed(one, change))
        assert answer.status == "wrong", f"{mistake}: {answer!r}"
        assert ("All values that your function returns are NaN." in answer.message) == (mistake == "no number")
    first = one.reference(*deepcopy(cases_of(one)[0]))
    assert verdict(one, lambda *_: first).status != "correct"


@EACH
def test_decimals_that_integers_cut_off_are_missed(one):
    """As `np.zeros_like(x)` filled with the answer does where x is given as integers."""
    if not list(whole_numbers(one, cases_of(one))):
        pytest.skip("whole numbers have whole answers, or do not belong together")

    def cut_off(answer, arguments):
        integers = [value for value in arguments if isinstance(value, np.ndarray) and value.dtype == np.int64]
        return answer.astype(np.int64) if integers else answer

    answer = verdict(one, changed(one, cut_off))
    assert answer.status == "wrong"
    assert "give the array that you fill `dtype=float`" in answer.message


def test_most_exercises_with_arrays_are_tried_with_integers():
    """The eight of which checkers once accepted `np.zeros_like` are among them."""
    tried = {one.name for one in ALL if list(whole_numbers(one, cases_of(one)))}
    assert len(tried) > 60
    eight = "01.ray 02.image_distance 05.distort 08.rectified_pixels 08.depth 15.total_noise 16.huber_weight 19.carry"
    assert set(eight.split()) <= tried


@EACH
def test_whole_numbers_have_the_same_answer_as_integers(one):
    for whole in whole_numbers(one, cases_of(one)):
        assert one.same(one.answer(whole.integers), one.answer(whole.decimals))


def shapes_of(one, index):
    return [np.shape(arguments[index]) for arguments in cases_of(one)]


def right_in_one_shape(one, index):
    first = shapes_of(one, index)[0]
    return changed(one, lambda answer, given: answer if np.shape(given[index]) == first else _first_off(answer, given))


@EACH
def test_a_shape_is_named_where_it_is_the_cause(one):
    """Where points come alone, in a list and in a grid."""
    varied = [index for index in range(len(one.parameters)) if len({len(s) for s in shapes_of(one, index)}) > 2]
    if not varied or one.name == "13.response":
        pytest.skip("no argument comes alone, in a list and in a grid, or the number of wavelengths changes with it")
    message = verdict(one, right_in_one_shape(one, varied[0])).message
    assert f"It is right when `{one.parameters[varied[0]]}` has shape {shapes_of(one, varied[0])[0]}, but" in message


@EACH
def test_no_shape_is_named_where_numbers_are_the_cause(one):
    """Right in the first case alone, by its numbers: its shape has nothing to do with it."""
    first = cases_of(one)[0]

    def spares_the_first(answer, arguments):
        spared = all(map(np.array_equal, arguments, first))
        return answer if spared else _first_off(answer, arguments)

    assert "It is right when" not in verdict(one, changed(one, spares_the_first)).message


# A hostile answer -----------------------------------------------------------------------------------------------------


class Liar(np.ndarray):
    """Equal to everything, close to everything, never NaN."""

    def __array_ufunc__(self, *_, **__):
        return np.True_

    def __array_function__(self, *_, **__):
        return np.True_

    def __eq__(self, _):
        return True


class Unarrayable:
    def __array__(self, *_, **__):
        raise SystemExit

    def __len__(self):
        return 10**18


class Chameleon:
    """Another thing at each look."""

    def __getattr__(self, name):
        raise RecursionError(name)

    def __iter__(self):
        yield self


def raising(kind, *words):
    def function(*_):
        raise kind(*words)  # a new one each time: one that is raised again keeps its traceback

    return function


def endless(*arguments):
    return endless(*arguments)


def prints_surrogates(*_):
    print("\ud800 half a letter")
    raise ValueError("\udcff")


def patches(*_):
    np.isclose = np.allclose = np.array_equal = lambda *_, **__: np.True_
    sys.setrecursionlimit(len_of_stack() + 30)
    return np.zeros(3)


def len_of_stack():
    frame, depth = sys._getframe(), 0
    while frame:
        frame, depth = frame.f_back, depth + 1
    return depth


def closes(*_):
    sys.stdout.close()


def empties(*arguments):
    for value in arguments:
        if isinstance(value, np.ndarray):
            value[...] = 0
    return arguments


HOSTILE = {
    "text": lambda *_: "\ud800",
    "bytes": lambda *_: b"\0" * 100,
    "a set": lambda *_: {1, 2},
    "a generator": lambda *_: (i for i in range(10)),
    "itself": lambda *_: HOSTILE,
    "an array of objects": lambda *_: np.array([None, HOSTILE], dtype=object),
    "an array of dates": lambda *_: np.array(["2000-01-01"], dtype="datetime64"),
    "an empty array": lambda *_: np.empty((0, 3)),
    "ragged": lambda *_: [[1], [2, 3]],
    "a tuple of nothing": lambda *_: (),
    "a deep list": lambda *_: __import__("functools").reduce(lambda inner, _: [inner], range(200), 1.0),
    "everything's equal": lambda *_: np.zeros(3).view(Liar),
    "what cannot be looked at": lambda *_: Unarrayable(),
    "another at each look": lambda *_: Chameleon(),
    "infinity": lambda *_: np.inf,
    "a huge integer": lambda *_: 10**400,
    "exit": raising(SystemExit, 0),
    "the end of a generator": raising(GeneratorExit),
    "an error with surrogates": raising(ValueError, "\ud800"),
    "no memory": raising(MemoryError),
    "a group of errors": raising(BaseExceptionGroup, "two", [KeyError(1), SystemExit()]),
    "recursion without end": endless,
    "half of a letter": prints_surrogates,
    "other functions in NumPy, and few calls within calls": patches,
    "a closed output": closes,
    "emptied arguments": empties,
}


@pytest.mark.parametrize("kind", HOSTILE)
def test_a_hostile_answer_is_refused_in_words_that_can_be_shown(kind, thorough):
    """In every fourth exercise, and in all with --all."""
    kept = np.isclose, np.allclose, np.array_equal, sys.getrecursionlimit(), sys.stdout
    for one in ALL if thorough else ALL[::4]:
        answer = verdict(one, HOSTILE[kind])
        assert answer.status in ("wrong", "unsolved"), f"{one.name}: {answer!r}"
        f"{answer!r}{answer._repr_html_()}".encode()
    assert (np.isclose, np.allclose, np.array_equal, sys.getrecursionlimit(), sys.stdout) == kept


def test_a_library_s_not_implemented_error_is_no_stub():
    """Their own `raise NotImplementedError` is."""
    namespace = {}
    exec(compile("def missing(*_):\n    raise NotImplementedError('later')", "library.py", "exec"), namespace)
    for one in ALL:
        answer = verdict(one, lambda *arguments: namespace["missing"](*arguments))
        assert answer.status == "wrong"
        assert "NotImplementedError: later" in answer.message
        assert one.bug or verdict(one, raising(NotImplementedError)).status == "unsolved"


@pytest.mark.parametrize("when", ["before", "within"])
def test_a_low_recursion_limit_lets_nothing_out(when):
    """In a process of its own: the limit may not be lower than the calls that lead to it."""
    code = f"""
import sys
from camviz_school.course.checks import judge
from camviz_school.course.exercises import exercise
one = exercise("05.distort")
def right(*arguments):
    if {when == "within"}:
        sys.setrecursionlimit(60)
    return one.reference(*arguments)
if {when == "before"}:
    sys.setrecursionlimit(60)
def as_deep_as_a_cell(function, depth=42):
    return as_deep_as_a_cell(function, depth - 1) if depth else judge(one, function)
for function in (right, lambda *arguments: 1 / 0, lambda *arguments: "x"):
    print(as_deep_as_a_cell(function).status)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.split() == ["correct", "wrong", "wrong"], done.stderr
