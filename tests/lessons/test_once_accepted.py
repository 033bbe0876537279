"""What the exercises once accepted though it is wrong, and what was said that was not so."""

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


def islands_in_three_passes(seen):
    first = np.arange(len(seen))
    for _ in range(3):
        for frame in seen.T:
            if frame.any():
                first[frame] = first[frame].min()
    return first


def weak_pixels_dead(frame, dark, flat):
    answer = np.where(flat - dark > 0.05 * np.mean(flat - dark), flat - dark, np.nan)
    return (frame - dark) * np.nanmean(answer) / answer


def no_far_limit_a_little_early(f, N, s, c):
    near, far = exercise("02.limits").reference(f, N, s, c)
    return near, np.where(s < 0.95 * (f**2 / (N * c) + f), far, np.inf)


def full_frame_at_infinity(width, f, s):
    right = exercise("02.field_of_view").reference(width, f, s)
    return np.where(np.isinf(s), 2 * np.arctan(36 / (2 * f)), right)


def one_draw_more(share, n, sure):
    with np.errstate(divide="ignore"):
        return np.maximum(np.floor(np.log(1 - sure) / np.log(1 - share**n)) + 1, 1)


def the_first(name, n):
    """The solution, of the first n matches only."""
    return lambda one, other: exercise(name).reference(one[:n], other[:n])


ONCE_ACCEPTED = {
    "at most three coordinates": (
        "00.homogeneous",
        lambda points: np.concatenate([points[..., :3], np.ones_like(points[..., :1])], axis=-1),
    ),
    "no far limit from 0.95 H": ("02.limits", no_far_limit_a_little_early),
    "36 mm at infinity": ("02.field_of_view", full_frame_at_infinity),
    "a rotation to 3e-6": ("04.is_rotation", changed("04.is_rotation", ("atol=1e-6", "atol=3e-6"))),
    "the nearest of six": (
        "12.false_frequency",
        lambda f: np.min(np.abs(np.asarray(f)[..., None] - np.arange(-0.5, 3)), axis=-1),
    ),
    "weak pixels dead": ("15.flat_field", weak_pixels_dead),
    "three passes": ("16.islands", islands_in_three_passes),
    "tested before rounding": (
        "08.left_right",
        changed(
            "08.left_right", ("inside = (partner", "u = np.arange(n) - d_left\n    inside = (u"), ("& (partner", "& (u")
        ),
    ),
    "one draw more": ("19.draws", one_draw_more),
    "the first 4 of n": ("19.homography", the_first("19.homography", 4)),
    "the first 10 of n": ("19.homography", the_first("19.homography", 10)),
    "the first 6 of n": ("18.camera_matrix", the_first("18.camera_matrix", 6)),
    "the first 8 of n": ("07.eight_point", the_first("07.eight_point", 8)),
    "a guard of 1e-30": ("01.in_front", guarded),
    "1/|u|": (
        "02.effective_focal_length",
        lambda surfaces: abs(exercise("02.effective_focal_length").reference(surfaces)),
    ),
    "rtol left on": ("04.is_rotation", changed("04.is_rotation", ("rtol=0, ", ""))),
    **{f"the fold × {part}": ("05.undistort", up_to_a_part_of_the_fold(part)) for part in (0.8, 0.9)},
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
        ("07.eight_point", "the first 8 of n", "does not change when pair 8 of 20 moves"),
        ("19.homography", "the first 4 of n", "does not change when match 4 of 20 moves"),
        ("18.camera_matrix", "the first 6 of n", "does not change when pixel 6 of 20 moves"),
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


def test_draws_that_are_just_enough_need_no_further_one():
    """(1 − 0.5²)³ is exactly 1 − 0.578125; the quotient of the logarithms is rounded up to more than 3."""
    one = exercise("19.draws")
    assert 0.75**3 == 1 - 0.578125
    assert one.reference(0.5, 2, 0.578125) == 3
    assert function_of(one, solution_of(one))(0.5, 2, 0.578125) == 3


def test_a_focal_length_wrong_everywhere_is_not_told_of_nan_alone():
    one = exercise("18.focal_length")
    message = judge(one, lambda *a: np.nan_to_num(one.reference(*a)) + 50, np.random.default_rng(4)).message
    assert "NaN" not in message
    assert "is right" in message
