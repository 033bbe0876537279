"""The exercise checker: says "correct" to solutions only, speaks to known mistakes, and never raises."""

import subprocess
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from camviz.views.distortion import DistortionView
from camviz.views.yours import attempt
from camviz.widgets import explore
from camviz_school.course.checks import SHAPES, Exercise, judge
from camviz_school.course.exercises import LOOK, RUN_AGAIN, Tutor, exercise, exercises
from camviz_school.course.trials import Trial

ALL = [one for lesson in range(17) for one in exercises(f"{lesson:02d}").values()]


def distance(points):
    return np.linalg.norm(points, axis=-1)


DISTANCE = Exercise(
    name="00.distance",
    reference=distance,
    cases=lambda rng: [(rng.uniform(1, 2, (*shape, 3)),) for shape in SHAPES],
    shown=((np.array([3.0, 0.0, 4.0]),),),
    hints=("Think of Pythagoras.", "The sum of squares.", "`np.sqrt(___)`"),
    praise="Pythagoras holds.",
)


@DISTANCE.wrong("This is the *square* of the distance.")
def squared_distance(points):
    return np.sum(points**2, axis=-1)


def verdict(function, attempt=1, of=DISTANCE, seed=0):
    return judge(of, function, np.random.default_rng(seed), attempt)


@pytest.mark.sampled(30)
@pytest.mark.parametrize("one", ALL, ids=lambda one: one.name)
def test_no_stub_and_no_constant_is_ever_called_correct(one):
    (first, *_) = list(one.cases(np.random.default_rng(1)))
    frozen = one.reference(*first)
    for function in (lambda *a: None, lambda *a: ..., lambda *a: 0.0, lambda *a: np.nan, lambda *a: frozen, ..., None):
        assert not verdict(function, of=one)


@pytest.mark.parametrize("one", ALL, ids=lambda one: one.name)
def test_the_cases_are_different_every_time(one):
    cases = [[one.answer(c) for c in one.cases(np.random.default_rng(seed))] for seed in (1, 2)]
    assert not all(one.same(a, b) for a, b in zip(*cases, strict=True))


def raises(points):
    raise NotImplementedError


@pytest.mark.parametrize("stub", [raises, lambda points: None, lambda points: ..., ..., None])
def test_a_stub_is_not_solved_yet_rather_than_wrong(stub):
    assert verdict(stub).status == "unsolved"
    assert not verdict(stub)


@pytest.mark.parametrize(
    ("name", "function", "written_in"),
    [
        ("01.project", lambda points, f, cx, cy: 640 * points[..., :2] / points[..., 2:] + (cx, cy), "`f`"),
        ("01.project", lambda points, f, cx, cy: f * points[..., :2] / points[..., 2:] + (319.5, cy), "`cx`"),
        (
            "15.total_noise",
            lambda electrons, read_noise, prnu: np.sqrt(8**2 + electrons + (prnu * electrons) ** 2),
            "`read_noise`",
        ),
    ],
)
def test_a_number_shown_in_the_lesson_and_written_into_a_function_is_found_out(name, function, written_in):
    answer = verdict(function, of=exercise(name))
    assert "shown in the lesson" in answer.message
    assert written_in in answer.message


@pytest.mark.parametrize(
    "function",
    [
        lambda points: 5 + np.round(points[..., 0] - 3, 12),
        lambda points: np.sqrt(points[..., 0] ** 2 + points[..., 2] ** 2),
    ],
)
def test_who_only_happens_to_be_right_for_the_shown_numbers_is_not_called_a_cheat(function):
    answer = verdict(function)
    assert answer.status == "wrong"
    assert "shown in the lesson" not in answer.message


def test_the_same_kind_of_error_is_not_the_same_mistake():
    """Both stop with ValueError where there is more than one point; only one of them has F on the wrong side."""
    one = exercise("07.epipolar_line")

    def without_an_axis(F, uv_left):
        line = np.concatenate([uv_left, np.ones_like(uv_left[..., :1])]) @ F.T
        return line / np.linalg.norm(line[..., :2], axis=-1, keepdims=True)

    answer = verdict(without_an_axis, of=one)
    assert answer.message not in {known.explanation for known in one.misconceptions}
    assert "ValueError" in answer.message


def test_a_known_mistake_has_to_agree_in_a_number_and_not_only_in_nan():
    roots = Exercise("00.roots", lambda x: -x, lambda rng: [(rng.uniform(-2, -1, 3),)], "abc", "-")
    roots.wrong("You take the root.")(lambda x: np.sqrt(x))
    assert verdict(lambda x: np.log(x), of=roots).message.startswith("All values that your function returns are NaN.")


def test_a_solution_for_one_point_that_does_not_broadcast_is_told_for_which_shapes_it_works():
    answer = verdict(lambda points: np.sqrt(points[0] ** 2 + points[1] ** 2 + points[2] ** 2))
    assert answer.status == "wrong"
    assert "right when `points` has shape (3,)" in answer.message


@pytest.mark.parametrize(
    ("change", "word"),
    [
        (lambda d: -d, "sign"),
        (np.degrees, "degrees"),
        (lambda d: 1.5 * d, "times 1.5"),
        (lambda d: d**2, "square"),
        (lambda d: d + 1e-7, "Close"),
        (lambda d: d * 0 + 7, "same number"),
        (lambda d: np.where(d > 2.5, np.nan, d), "NaN where there is an answer"),
        (lambda d: d[..., None], "shape"),
        (lambda d: d + 1j, "real numbers"),
        (lambda d: "five", "type str"),
        (lambda d: [[1], [2, 3]], "type list"),
        (lambda d: d + 1 / (1 + d), "where"),
    ],
)
def test_each_kind_of_wrong_answer_is_named(change, word):
    answer = verdict(lambda points: change(distance(points)))
    assert answer.status == "wrong"
    assert word in answer.message


def test_an_answer_of_nothing_but_nan_is_called_that():
    answer = verdict(lambda points: np.nan * distance(points))
    assert "NaN" in answer.message
    assert "same number" not in answer.message


def test_the_message_of_an_error_is_cut():
    def wordy(points):
        raise ValueError("x" * 10_000_000)

    assert len(verdict(wordy).message) < 1000


def test_reversed_and_transposed_answers_are_recognised():
    turn = Exercise("00.turn", lambda m: m, lambda rng: [(rng.normal(size=(3, 3)),)], ("-",) * 3, "-")
    assert "transpose" in verdict(lambda m: m.T, of=turn).message
    assert "reverse order" in verdict(lambda m: m[:, ::-1], of=turn).message


def test_a_number_where_nothing_can_be_is_asked_to_be_nan():
    root = Exercise("00.root", lambda x: np.sqrt(x), lambda rng: [(rng.uniform(-1, 1, 20),)], ("-",) * 3, "-")
    assert "NaN is wanted" in verdict(lambda x: np.sqrt(np.maximum(x, 0)), of=root).message


def test_an_exception_is_told_in_words_with_its_line():
    def broken(points):
        return points[..., 7]

    answer = verdict(broken)
    assert answer.status == "wrong"
    assert "IndexError" in answer.message
    assert "return points[..., 7]" in answer.message


def test_a_function_with_other_parameters_is_told_how_it_will_be_called():
    assert "called with `(points)`" in verdict(lambda: 1).message


def test_a_solution_that_overwrites_its_input_is_told_so():
    def overwrites(points):
        points **= 2
        return np.sqrt(points.sum(-1))

    answer = verdict(overwrites)
    assert answer.status == "wrong"
    assert "overwrites its input `points`" in answer.message


def test_what_a_function_prints_is_caught_and_repeated_once(capsys):
    def chatty(points):
        print("here")
        return distance(points)

    assert verdict(chatty).printed == "here"
    assert capsys.readouterr().out == ""


def test_a_matrix_up_to_scale_is_accepted_at_any_scale():
    scaled = Exercise(
        "00.scale",
        lambda m: m,
        lambda rng: [(rng.uniform(1, 2, (3, 3)),)],
        ("-",) * 3,
        "-",
        canonical=lambda m: m / m[0, 0],
    )
    assert verdict(lambda m: -3 * m, of=scaled).correct
    assert not verdict(lambda m: m + 1, of=scaled)


def test_a_law_that_does_not_hold_speaks_for_itself():
    def pure(function, rng):
        return "" if function(rng.normal(size=3)) >= 0 else "A distance is never negative."

    lawful = Exercise(
        "00.law", distance, DISTANCE.cases, ("-",) * 3, "-", laws=(pure, lambda function, rng: function(np.zeros(3))[0])
    )
    assert "IndexError" in verdict(distance, of=lawful).message


def test_hints_grow_stronger_with_wrong_tries_but_not_with_stubs():
    check = Tutor(np.random.default_rng(0))
    hints = exercise("05.fold_radius").hints
    assert check("05.fold_radius", lambda k1: None).hint == ""
    assert [check("05.fold_radius", lambda k1: k1).hint for _ in range(3)] == [hints[0], hints[1], hints[2]]
    assert check("05.distort", lambda xy, k1, k2, k3: xy).hint == exercise("05.distort").hints[0]


def test_a_tutor_without_a_seed_asks_differently_each_time():
    seen = []
    check = Tutor()
    for _ in range(2):
        check("05.fold_radius", lambda k1: seen.append(k1))
    assert len(set(seen)) > len(seen) // 2 + 1


@settings(max_examples=60, deadline=None)
@given(
    st.one_of(
        st.none(), st.text(), st.floats(), st.lists(st.floats()), st.dictionaries(st.text(), st.floats()), st.binary()
    )
)
def test_whatever_a_function_returns_the_checker_does_not_raise(result):
    for one in (DISTANCE, exercise("05.distort")):
        assert not verdict(lambda *a: result, of=one)


@pytest.mark.parametrize(
    "error", [SystemExit, RecursionError, MemoryError, KeyError("x"), StopIteration, AssertionError]
)
def test_whatever_a_function_raises_the_checker_answers_in_words(error):
    def raiser(points):
        raise error

    assert verdict(raiser).status == "wrong"


def test_a_verdict_is_safe_html_and_plain_text():
    def inject(points):
        raise ValueError("<script>alert(1)</script>")

    answer = verdict(inject)
    assert "<script>" not in answer._repr_html_()
    assert "ValueError" in repr(answer)
    assert "<" not in repr(verdict(distance))


def test_a_lesson_s_exercises_are_found_by_name_and_a_wrong_name_is_answered_with_the_right_ones():
    assert list(exercises("05")) == [
        f"05.{n}" for n in ("distort", "fold_radius", "undistort_map", "undistort", "tangential")
    ]
    assert exercises("99") == {}
    with pytest.raises(ValueError, match=r"05\.distort"):
        exercise("05.distrot")


def test_checks_import_neither_drawing_nor_widgets():
    code = "import sys; from camviz_school.course.material import module; module('05'); print(*sys.modules)"
    modules = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"matplotlib", "ipywidgets", "anywidget", "pyvista", "cv2", "IPython", "scipy"} & set(modules)


def test_the_distortion_exercises_agree_with_opencv():
    cv2 = pytest.importorskip("cv2")
    rng = np.random.default_rng(5)
    xy, (k1, k2, k3), (p1, p2) = rng.uniform(-0.5, 0.5, (50, 2)), rng.uniform(-0.3, 0.3, 3), rng.uniform(-0.1, 0.1, 2)
    points = np.concatenate([xy, np.ones((50, 1))], axis=1)
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), np.eye(3), np.array([k1, k2, p1, p2, k3]))
    ours = exercise("05.distort").reference(xy, k1, k2, k3) + exercise("05.tangential").reference(xy, p1, p2)
    np.testing.assert_allclose(ours, pixels[:, 0], atol=1e-12)


def test_the_map_exercise_is_opencv_s_undistortion_map():
    cv2 = pytest.importorskip("cv2")
    width, height, f, k1 = 12, 9, 10.0, -0.2
    K = np.array([[f, 0, (width - 1) / 2], [0, f, (height - 1) / 2], [0, 0, 1]])
    maps = cv2.initUndistortRectifyMap(K, np.array([k1, 0, 0, 0]), np.eye(3), K, (width, height), cv2.CV_32FC1)
    ours = exercise("05.undistort_map").reference(width, height, f, k1)
    np.testing.assert_allclose(ours, np.stack(maps[:2], axis=-1), atol=1e-5)


def test_the_fold_of_k1_minus_0_3_is_the_published_one_and_the_inverse_ends_there():
    fold = exercise("05.fold_radius").reference(-0.3)
    assert fold == pytest.approx(1.0541, abs=5e-5)
    assert np.degrees(np.arctan(fold)) == pytest.approx(46.5, abs=0.05)
    inverse = exercise("05.undistort").reference
    r = np.linspace(0, 0.99 * fold, 50)
    np.testing.assert_allclose(inverse(r - 0.3 * r**3, -0.3), r, atol=1e-7)
    assert np.isnan(inverse(np.array([0.71, 2.0, 9.0]), -0.3)).all()


@pytest.mark.parametrize(
    ("name", "function", "word"),
    [
        ("05.fold_radius", lambda k1: 1 / np.sqrt(-3 * k1) if k1 <= 0 else np.inf, "gave -inf, where inf"),
        ("05.fold_radius", lambda k1: 1 / np.sqrt(-3 * k1) if k1 < 0 else 7.0, "gave 7, where inf"),
        ("05.distort", lambda xy, k1, k2, k3: exercise("05.distort").reference(xy, k1, k2, 0), "k3"),
        ("01.best_hole", lambda focal_mm, wavelength_nm: 1.56 * np.sqrt(focal_mm * wavelength_nm * 1e-6), "rounded"),
    ],
)
def test_an_honest_near_miss_is_not_called_rounding_or_written_in_numbers(name, function, word):
    message = judge(exercise(name), function, np.random.default_rng(5)).message
    assert word in message
    assert "shown in the lesson" not in message
    assert "stopped too early" not in message


def test_the_best_of_a_grid_is_told_that_the_grid_is_too_coarse():
    def tried(focal_mm, wavelength_nm):
        d = np.geomspace(0.05, 2, 400)
        return d[np.argmin(np.hypot(d, 2.44 * wavelength_nm * 1e-6 * focal_mm / d))]

    assert "a grid that is too coarse" in judge(exercise("01.best_hole"), tried, np.random.default_rng(5)).message
    assert "too coarse" not in verdict(lambda points: distance(points) + 1e-3 * points[..., 0]).message


@pytest.mark.parametrize("guard", [1e-8, 1e-12, 1e-30, 1e-40])
def test_a_point_however_near_in_front_of_the_hole_has_an_image(guard):
    one = exercise("01.in_front")
    assert not verdict(
        lambda points, f, cx, cy: (
            one.reference(points * [1, 1, 1], f, cx, cy) + np.where(points[..., 2:] > guard, 0, np.nan)
        ),
        of=one,
    )


def test_a_map_of_single_precision_is_good_enough_for_remap_and_one_half_a_pixel_off_is_not():
    reference = exercise("05.undistort_map").reference
    assert judge(exercise("05.undistort_map"), lambda *a: np.float32(reference(*a)))
    assert not judge(exercise("05.undistort_map"), lambda *a: reference(*a) + 0.5)


def test_a_small_matrix_is_shown_in_full_with_digits_that_count():
    assert DISTANCE.call((np.array([[1e-6, 0.0, -2.5e-7]]),)) == "``distance(points=[[1e-06, 0, -2.5e-07]])``"


# Nothing escapes, and nothing stays behind ---------------------------------------------------------------------------


class UnspeakableError(Exception):
    def __str__(self):
        raise RuntimeError("no words")


class Unarrayable:
    def __array__(self, *given, **named):
        raise SystemExit


def raising(error):
    def function(points):
        raise error

    return function


@pytest.mark.parametrize(
    ("error", "word"),
    [
        (UnspeakableError(), "cannot be read"),
        (BaseException("all of it"), "all of it"),
        (GeneratorExit(), "GeneratorExit"),
        (KeyboardInterrupt(), "You stopped"),
    ],
)
def test_no_exception_whatever_escapes(error, word):
    answer = verdict(raising(error))
    assert answer.status == "wrong"
    assert word in answer.message


def test_a_result_that_raises_when_it_is_looked_at_is_told_by_its_type():
    assert "Unarrayable" in verdict(lambda points: Unarrayable()).message


def test_a_call_that_the_reader_stops_is_the_last_one():
    calls = []

    def endless(points):
        calls.append(1)
        raise KeyboardInterrupt

    assert "never end" in verdict(endless).message
    assert len(calls) == 1


def test_a_function_that_closes_its_output_is_checked_all_the_same(capsys):
    def closes(points):
        print("before")
        sys.stdout.close()
        return distance(points)

    answer = verdict(closes)
    assert answer.correct
    assert answer.printed == "before"
    print("still open")
    assert capsys.readouterr().out == "still open\n"


def test_a_flood_of_printing_is_cut():
    def floods(points):
        print("x" * 10_000_000)
        return distance(points)

    assert len(verdict(floods).printed) <= 200


def test_what_a_function_patches_is_put_back_before_its_answer_is_compared():
    before = np.isclose, np.linalg.norm, abs

    def patches(points):
        import builtins

        np.isclose = lambda *given, **named: np.array(True)
        np.linalg.norm = None
        builtins.abs = None
        return 0.0 * points[..., 0] + 9

    try:
        assert not verdict(patches)
        assert (np.isclose, np.linalg.norm, abs) == before
    finally:
        np.isclose, np.linalg.norm = before[:2]


def test_the_answer_is_not_in_the_frames_of_those_who_call():
    found = []

    def spies(points):
        frame = sys._getframe(1)
        while frame:
            found.extend(value for name, value in frame.f_locals.items() if name == "expected")
            trial = frame.f_locals.get("trial")
            if isinstance(trial, Trial):
                found.extend(trial.expected)
            frame = frame.f_back
        return found[0] if found else points[..., 0]

    assert not verdict(spies)
    assert not found


def test_what_is_masked_is_no_answer():
    masked = np.ma.masked_array
    assert not verdict(lambda points: masked(distance(points), mask=np.ones(points.shape[:-1], bool)))
    assert verdict(lambda points: masked(distance(points), mask=np.zeros(points.shape[:-1], bool))).correct


def test_a_wrong_signature_brings_no_hint_and_does_not_count_as_a_try():
    check = Tutor(np.random.default_rng(0))
    hints = exercise("05.fold_radius").hints
    assert [check("05.fold_radius", lambda: 1.0).hint for _ in range(4)] == [""] * 4
    assert check("05.fold_radius", lambda k1: k1).hint == hints[0]


def test_hints_can_be_asked_for_without_a_try():
    check = Tutor(np.random.default_rng(0))
    hints = exercise("05.tangential").hints
    assert [check.hint("05.tangential").message for _ in range(4)] == [*hints, hints[-1]]
    assert repr(check.hint("05.tangential")).startswith("Hint.")


def test_an_untouched_faulty_function_is_not_tried_yet_and_a_changed_one_is_judged():
    one = exercise("05.tangential")
    untouched = judge(one, one.as_given, np.random.default_rng(3))
    assert untouched.status == "unsolved"
    assert untouched.hint == ""
    assert 'check.hint("05.tangential")' in untouched.message
    assert judge(one, lambda xy, p1, p2: 2 * one.as_given(xy, p1, p2), np.random.default_rng(3)).status == "wrong"


def test_zeros_have_a_say_in_what_is_close_and_digits_are_shown_until_two_numbers_differ():
    """An entry that should be 0 and is not is no matter of rounding."""
    turn = Exercise("00.turn", lambda m: m * [1, 1, 0], lambda rng: [(rng.uniform(1, 2, (4, 3)),)], "abc", "-")
    assert "rounded" not in verdict(lambda m: m * [1, 1, 1], of=turn).message
    assert "rounded" in verdict(lambda m: m * [1 + 1e-7, 1 + 1e-7, 0], of=turn).message
    near = Exercise("00.near", lambda x: np.ones(2), lambda rng: [(rng.normal(),)], "abc", "-")
    answer = verdict(lambda x: np.array([1.0000002, 5.0]), of=near)
    assert "gave 1.0000002 at index [0], where 1 is right" in answer.message
    yes = Exercise("00.yes", lambda x: x > 0, lambda rng: [(1.0,), (-1.0,), (-2.0,)], "abc", "-")
    assert "gave True, where False is right" in verdict(lambda x: bool(x > -2), of=yes).message


def test_a_rounded_answer_is_told_so_even_where_the_shown_numbers_are_round():
    answer = verdict(lambda points: np.round(distance(points), 6))
    assert "is something rounded" in answer.message
    assert "shown in the lesson" not in answer.message


def test_an_exercise_of_yes_and_no_does_not_speak_of_digits():
    yes = Exercise("00.yes", lambda x: x > 0, lambda rng: [(rng.normal(),) for _ in range(4)], "abc", "-")
    assert "must be True or False" in verdict(None, of=yes).message
    assert "right to about 9 digits" in verdict(None).message


def test_a_right_answer_draws_the_views_that_waited_for_it_and_says_where_to_look(capsys):
    """A wrong one draws nothing: the view goes on waiting."""
    check, right = Tutor(np.random.default_rng(0)), exercise("05.distort").reference

    def distort(xy, k1, k2, k3): ...

    def turned(xy, k1, k2, k3):
        return right(xy, -k1, -k2, -k3)

    turned.__name__ = "distort"

    view = explore(DistortionView(panels="picture yours", yours=distort))
    attempt(distort, np.zeros(2), 0.0, 0.0, 0.0, like=np.zeros(2))
    assert "yours appears here" in view.frame["html"]
    assert not check("05.distort", turned)
    assert "yours appears here" in view.frame["html"]
    assert check("05.distort", right).message.endswith(LOOK + RUN_AGAIN)
    assert "Bent by your function" in view.frame["html"]
    assert view.view.yours is right
    assert check("05.distort", right).message == exercise("05.distort").praise  # nothing waits any more
