"""What the exercises of 01 to 08 once accepted though it is wrong, and what was said that was not so."""

import numpy as np
import pytest
from mutants import function_of, solution_of

from camviz_school.course.checks import judge
from camviz_school.course.exercises import exercise


def changed(name, *pairs):
    """The lesson's solution with pieces of its text replaced."""
    one = exercise(name)
    source = solution_of(one)
    for before, after in pairs:
        assert before in source
        source = source.replace(before, after)
    return function_of(one, source)


def up_to_a_part_of_the_fold(part):
    return changed("05.undistort", ("(r <= fold)", f"(r <= {part} * fold)"))


def newton(steps):
    return changed("05.undistort", ("range(50)", f"range({steps})"))


def dividing(steps):
    def undistort(r_d, k1):
        r = np.asarray(r_d, dtype=float)
        for _ in range(steps):
            r = r_d / (1 + k1 * r**2)
        fold = 1 / np.sqrt(-3 * k1) if k1 < 0 else np.inf
        return np.where((np.abs(r + k1 * r**3 - r_d) < 1e-9) & (r >= 0) & (r <= fold), r, np.nan)

    return undistort


def without_a_lens_divided_by_zero(r_d, k1):
    return exercise("05.undistort").reference(r_d, k1) * (1.0 / k1) * k1


def one_column_too_many(d_left, d_right, tolerance):
    n = len(d_left)
    partner = np.nan_to_num(np.rint(np.arange(n) - d_left), nan=-1).astype(int)
    inside = (partner >= 0) & (partner <= n)
    back = np.append(d_right, d_right[-1])[np.where(inside, partner, 0)]
    return np.where(inside & (np.abs(back - d_left) <= tolerance), d_left, np.nan)


def t_reversed(R, t, rays_left, rays_right):
    return exercise("07.in_front").reference(R, t[::-1], rays_left, rays_right)


def guarded(points, f, cx, cy):
    z = np.where(points[..., 2:] > 1e-30, points[..., 2:], np.nan)
    return f * points[..., :2] / z + (cx, cy)


ONCE_ACCEPTED = {
    "a guard of 1e-30": ("01.in_front", guarded),
    "1/|u|": (
        "02.effective_focal_length",
        lambda surfaces: abs(exercise("02.effective_focal_length").reference(surfaces)),
    ),
    "rtol left on": ("04.is_rotation", changed("04.is_rotation", ("rtol=0, ", ""))),
    **{f"the fold × {part}": ("05.undistort", up_to_a_part_of_the_fold(part)) for part in (0.8, 0.9, 0.95, 0.99)},
    **{f"{steps} divisions": ("05.undistort", dividing(steps)) for steps in (5, 20, 100, 1000)},
    **{f"{steps} steps of Newton": ("05.undistort", newton(steps)) for steps in (3, 5)},
    "nothing at r_d = 0": ("05.undistort", changed("05.undistort", ("(r >= 0)", "(r > 0)"))),
    "k1 = 0 divides by 0": ("05.undistort", without_a_lens_divided_by_zero),
    "t_y for t_z": ("06.board_pose", changed("06.board_pose", ("M[2, 2]", "M[1, 2]"))),
    "t_x for t_z": ("06.board_pose", changed("06.board_pose", ("M[2, 2]", "M[0, 2]"))),
    "farther than 2": ("07.in_front", changed("07.in_front", ("distances > 0", "distances > 2"))),
    "t reversed": ("07.in_front", t_reversed),
    "t with the other sign": ("07.in_front", changed("07.in_front", ("-t[:", "t[:"))),
    "a column too many": ("08.left_right", one_column_too_many),
    "less than the tolerance": ("08.left_right", changed("08.left_right", ("<= tolerance", "< tolerance"))),
    "NaN only below −1": ("08.depth", changed("08.depth", ("doffs < 0", "doffs < -1"))),
    "found > 0": ("08.metric_depth", changed("08.metric_depth", ("found < 0", "found <= 0"))),
}


@pytest.mark.sampled(6)
@pytest.mark.parametrize("what", ONCE_ACCEPTED)
def test_it_is_refused_at_every_seed(what, thorough):
    name, function = ONCE_ACCEPTED[what]
    one = exercise(name)
    accepted = [seed for seed in range(200 if thorough else 5) if judge(one, function, np.random.default_rng(seed))]
    assert accepted == []


@pytest.mark.parametrize(
    ("name", "what", "words"),
    [
        ("01.in_front", "a guard of 1e-30", "Compare Z with 0"),
        ("02.effective_focal_length", "1/|u|", "has a *negative* focal length"),
        ("04.is_rotation", "rtol left on", "give it `rtol=0`"),
        ("05.undistort", "100 divisions", "You divide again and again"),
        ("05.undistort", "20 divisions", "Twenty rounds of dividing"),
        ("05.undistort", "5 steps of Newton", "Five steps of Newton"),
        ("05.undistort", "the fold × 0.9", "Just below the fold you answer NaN"),
        ("05.undistort", "nothing at r_d = 0", "The centre of the picture has an answer, too"),
        ("08.left_right", "less than the tolerance", "*exactly* the tolerance"),
        ("08.metric_depth", "found > 0", "0 is a disparity like others"),
    ],
)
def test_its_mistake_is_named(name, what, words):
    assert words in judge(exercise(name), ONCE_ACCEPTED[what][1], np.random.default_rng(4)).message


def test_a_prescription_read_with_the_next_index_is_told_of_the_next_index():
    """Its C stays 0, as that of a product entry by entry does, which is not what was done."""
    too_early = changed(
        "02.effective_focal_length",
        ("        M = np.array([[1, 0]", "        before = after\n        M = np.array([[1, 0]"),
    )
    message = judge(exercise("02.effective_focal_length"), too_early, np.random.default_rng(4)).message
    assert "`before = after` ahead of the row's matrix" in message


def test_depths_that_are_all_zero_are_not_all_for_one_reason_and_one_without_its_baseline_is_told_so():
    one = exercise("08.metric_depth")
    zero = judge(one, lambda found, K, P_left, P_right: np.where(found < 0, np.nan, 0.0), np.random.default_rng(4))
    assert "Is the baseline taken from P_left?" in zero.message
    bare = changed("08.metric_depth", ("f * B / (found", "f / (found"))
    assert "The baseline has gone" in judge(one, bare, np.random.default_rng(4)).message


def test_the_arctangents_of_both_sides_are_a_field_of_view_with_and_without_the_half_pixels():
    one = exercise("03.field_of_view")
    without = judge(one, lambda width, fx, cx: np.degrees(np.arctan(cx / fx) + np.arctan((width - cx) / fx)))
    assert without.correct
    assert "cv2.calibrationMatrixValues" in without.message
    sums = judge(one, lambda width, fx, cx: np.degrees(np.arctan((cx + 0.5) / fx) + np.arctan((width - cx - 0.5) / fx)))
    assert sums.message == one.praise
    assert not judge(one, lambda width, fx, cx: np.degrees(np.arctan(cx / fx) + np.arctan((width - 1 - cx) / fx)))
