"""What lesson 08 claims about rectification, disparity and depth, recomputed with OpenCV, NumPy and SciPy."""

import cv2
import numpy as np
import pytest
from claims import claims
from scipy import ndimage
from scipy.spatial.transform import RigidTransform, Rotation

from camviz import twoview
from camviz.scenes import textured_scene
from camviz_school.course.exercises import exercise
from camviz_school.course.material import module
from camviz_school.samples import motorcycle
from camviz_school.views.rectification import RectificationView

says = claims("08")

lesson08 = module("08")
SIDES = ("left", "right")
BOARD = np.float32([(0.025 * column, 0.025 * row, 0) for row in range(6) for column in range(9)])
F = 240 / np.tan(np.radians(31))
K = np.array([[F, 0, 239.5], [0, F, 179.5], [0, 0, 1]])
WORLD_FROM = {
    "left": RigidTransform.from_components([-0.3, 0, 0.3], Rotation.from_euler("YXZ", [3, -3, -2], True)),
    "right": RigidTransform.from_components([-0.05, 0.012, 0.31], Rotation.from_euler("YXZ", [-3, -1, 4], True)),
}
"""The garden's two cameras, 480 × 360 pixels and 62° wide, as the view places them."""


@pytest.fixture(scope="module")
def garden():
    """The pair as OpenCV rectifies it: R of each side, B, and f and principal point of the lesson's pixels."""
    right_from_left = WORLD_FROM["right"].inv() * WORLD_FROM["left"]
    t = right_from_left.translation
    R1, R2, *_ = cv2.stereoRectify(K, None, K, None, (480, 360), right_from_left.rotation.as_matrix(), t.reshape(3, 1))
    k = RectificationView().stage.pair.left.intrinsics
    return {"left": R1, "right": R2}, np.linalg.norm(t), k.fx, np.array([k.cx, k.cy])


def depths(garden, uv):
    """Z of what the rectified left camera sees at pixels (n, 2), by tracing the garden."""
    R, _, f, c = garden
    x = np.column_stack([(np.asarray(uv) - c) / f, np.ones(len(uv))])
    rays = x / np.linalg.norm(x, axis=1, keepdims=True)
    world_from_rectified = WORLD_FROM["left"].rotation.as_matrix() @ R["left"].T
    _, distance = textured_scene().trace(WORLD_FROM["left"].translation, rays @ world_from_rectified.T)
    return distance * rays[:, 2]


def test_a_turn_is_a_map_of_pixels_whatever_the_depth():
    says("Such a map of pixels by a 3 × 3 matrix")
    R = Rotation.from_euler("YXZ", [5, -3, 2], degrees=True).as_matrix()
    points = np.random.default_rng(8).uniform((-1, -1, 2), (1, 1, 9), (50, 3))
    turns = np.zeros(3), cv2.Rodrigues(R)[0]
    before, after = (cv2.projectPoints(points, turn, np.zeros(3), K, None)[0] for turn in turns)
    np.testing.assert_allclose(cv2.perspectiveTransform(before, K @ R @ np.linalg.inv(K)), after, atol=1e-9)
    says("the pixel (340, 100) is the ray (0.25, −0.2, 1). Turned it is (0.1973, −0.2, 1.0117)", "(318.0, 100.9)")
    ray = Rotation.from_euler("Y", 3, True).inv().apply([0.25, -0.2, 1])
    assert ray == pytest.approx([0.1973, -0.2, 1.0117], abs=5e-5)
    assert 400 * ray[:2] / ray[2] + (240, 180) == pytest.approx([318.0, 100.9], abs=0.05)


def test_rectified_cameras_are_parallel_not_square_to_the_wall(garden):
    says("Nobody has aligned these cameras, which stand 25 cm apart.", "The wall here is not, rectified or not.")
    says("both image planes lie in **one plane, parallel to the baseline**, and their rows run along it")
    R, B, *_ = garden
    assert pytest.approx(25, abs=0.5) == 100 * B
    left, right = (WORLD_FROM[side].rotation.as_matrix() @ R[side].T for side in SIDES)
    np.testing.assert_allclose(left, right, atol=1e-9)
    baseline = WORLD_FROM["right"].translation - WORLD_FROM["left"].translation
    np.testing.assert_allclose(left[:, 0], baseline / B, atol=1e-9)
    axes = (left, *(WORLD_FROM[side].rotation.as_matrix() for side in SIDES))
    assert min(np.degrees(np.arccos(one[2, 2])) for one in axes) > 1  # off the wall's normal


def test_what_half_a_pixel_is_worth():
    says("At 20 m the formula of first order says 2.5 m to either side; exactly it is 2.2 m nearer and 2.9 m farther.")
    says("With f = 800 px and B = 0.1 m, fB is 80 m·px:", "Double the baseline, and the disparity with it")
    says("To know 50 m to 10 cm, with f = 1500 px and a quarter of a pixel,", "gives 4.2 m: wider than a car.")
    assert pytest.approx(4.2, abs=0.05) == 50**2 * 0.25 / (1500 * 0.1)
    nearer, farther = 80 / (80 / 20 + 0.5), 80 / (80 / 20 - 0.5)
    assert [20**2 / 80 / 2, 20 - nearer, farther - 20] == pytest.approx([2.5, 2.2, 2.9], abs=0.05)
    says("the far side of the wedge never meets the ray: the point may be infinitely far away.")
    assert twoview.depth_interval(80, 800, 0.1, 1.0)[1] == np.inf


def test_doffs_and_time_of_flight():
    says("your function is given doffs = 15.5 px")
    assert pytest.approx(15.5, abs=0.05) == (1369.115 - 1244.772) * 370 / 2964  # as Middlebury publishes cx
    says("A centimetre of depth is 67 picoseconds.", "At f_mod = 20 MHz the phase repeats after 7.5 m")
    c = 299_792_458.0
    assert [2 * 0.01 / c * 1e12, c / (2 * 20e5)] == pytest.approx([67, 75], abs=0.5)
    says("half a pixel at 3 m is 5 cm here", "A tenth of a pixel is 9 mm for the motorcycle at 3 m")
    bike = motorcycle(width=370)
    a_pixel = 3**2 / (bike.focal_length * bike.baseline)
    assert [100 * a_pixel / 2, 1000 * a_pixel / 10] == pytest.approx([5, 9], abs=0.5)


BLOCK = 9


def searched(left, right, apart, count=32):
    """Costs (count, height, width): what `apart` says of two pixels, summed over each block."""
    height, width = left.shape[:2]
    costs = np.full((count, height, width), np.inf)
    for d in range(count):
        one = np.pad(apart(left[:, d:], right[:, : width - d]).astype(float), BLOCK // 2, mode="reflect")
        costs[d, :, d:] = np.lib.stride_tricks.sliding_window_view(one, (BLOCK, BLOCK)).sum(axis=(2, 3))
    return costs


@pytest.mark.thorough
def test_what_the_census_transform_keeps_in_another_light():
    says("The greys lose most of the map, and the census transform next to nothing.")
    says("Two costs look for each pixel's partner in blocks of 9 × 9 pixels")
    bike = motorcycle(width=370)
    left, right = (cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY) for picture in (bike.left, bike.right))
    known, costs, off = np.isfinite(bike.disparity), {}, {}

    def census(grey):
        windows = np.lib.stride_tricks.sliding_window_view(np.pad(grey, 2, mode="wrap"), (5, 5))
        return (windows < grey[..., None, None]).reshape(*grey.shape, 25)

    for light in (1.0, 0.8):
        dimmed = np.rint(light * right)
        costs["greys", light] = searched(left, dimmed, lambda a, b: np.abs(a.astype(float) - b))
        costs["census", light] = searched(census(left), census(dimmed), lambda a, b: (a != b).sum(axis=-1))
    off = {one: np.mean(np.abs(c.argmin(axis=0) - bike.disparity)[known] > 1) for one, c in costs.items()}
    assert off["greys", 0.8] > 0.5
    assert abs(off["census", 0.8] - off["census", 1.0]) < 0.01
    says("Leave out the fifth of which the matcher is least sure, and three in four mistakes are gone.")
    costs = costs["census", 0.8]
    best = costs.argmin(axis=0)
    others = np.where(np.abs(np.arange(32)[:, None, None] - best) >= 2, costs, np.inf)
    ratio = costs.min(axis=0) / others.min(axis=0)
    wrong = known & (np.abs(best - bike.disparity) > 1)
    assert (wrong & (ratio > np.quantile(ratio[known], 0.8))).sum() / wrong.sum() == pytest.approx(3 / 4, abs=0.02)


def test_places_between_pixels_are_drawn_to_whole_ones():
    """By spectra of its own seed, moved by waves of the whole length: SciPy's, not the lesson's."""
    says("the costs are 50, 20 and 40. The parabola is least at δ = 0.1")
    a, b, _ = np.polyfit([-1, 0, 1], [50, 20, 40], 2)
    assert [-b / (2 * a), lesson08.between_pixels(*np.array([50.0, 20, 40]))] == pytest.approx([0.1, 0.1])
    says("by up to 0.10 px with |difference|, and by a quarter of that with its square")
    row = ndimage.gaussian_filter1d(np.random.default_rng(1).normal(size=2**15), 1.0, mode="wrap")
    bias = {1: [], 2: []}
    for s in np.arange(0.05, 0.5, 0.05):
        moved = np.fft.ifft(ndimage.fourier_shift(np.fft.fft(row), s)).real
        for power, one in bias.items():
            costs = [np.abs(row - np.roll(moved, -d)) ** power for d in (-1, 0, 1)]
            costs = np.array([cost[: 2**15 // 15 * 15].reshape(-1, 15).sum(axis=1) for cost in costs])
            one.append(s - np.nanmedian(lesson08.between_pixels(*costs)))
    assert max(bias[1]) == pytest.approx(0.10, abs=5e-3)
    assert max(bias[2]) / max(bias[1]) == pytest.approx(1 / 4, abs=0.015)


def test_the_real_pair(chessboards):
    says("It stands 83 mm to its right, and t says that less than 1 mm of the way is across the rows.")
    uv = {side: chessboards(side) for side in SIDES}
    (K1, lens1), (K2, lens2) = (
        cv2.calibrateCamera([BOARD] * 13, [*uv[side]], (640, 480), None, None)[1:3] for side in SIDES
    )
    cameras = (K1, lens1, K2, lens2, (640, 480))
    pair = cv2.stereoCalibrate([BOARD] * 13, [*uv["left"]], [*uv["right"]], *cameras, flags=cv2.CALIB_FIX_INTRINSIC)
    R, t = pair[5:7]
    assert -1000 * t[0, 0] == pytest.approx(83, abs=0.5)
    assert 1000 * abs(t[1, 0]) < 1
    says("the rows differ by 13 px before and by a seventh of a pixel after", "it is only f · tan 0.5° = 4.7 px")
    assert np.abs(uv["right"] - uv["left"])[..., 1].mean() == pytest.approx(13, abs=0.5)
    R1, R2, P1, P2, *_ = cv2.stereoRectify(*cameras, R, t)
    sides = ((uv["left"], K1, lens1, R1, P1), (uv["right"], K2, lens2, R2, P2))
    rectified = [cv2.undistortPoints(one.reshape(-1, 1, 2), k, lens, R=turn, P=P) for one, k, lens, turn, P in sides]
    assert np.abs(rectified[0] - rectified[1])[..., 1].mean() == pytest.approx(1 / 7, abs=0.02)
    assert K1[1, 1] * np.tan(np.radians(0.5)) == pytest.approx(4.7, abs=0.05)
    says("The axis of the left lens meets its sensor in row 234, that of the right one in row 249.")
    assert [K1[1, 2], K2[1, 2]] == pytest.approx([234, 249], abs=0.5)


def test_the_exercises_answers_are_camviz_s():
    rng = np.random.default_rng(5)
    for d, f, B, doffs in exercise("08.depth").cases(rng):
        np.testing.assert_allclose(lesson08.depth(d, f, B, doffs), twoview.depth_from_disparity(d, f, B, doffs))
    for Z, error, f, disparity_error in exercise("08.baseline_for").cases(rng):
        B = lesson08.baseline_for(Z, error, f, disparity_error)
        np.testing.assert_allclose(twoview.depth_error(Z, f, B, disparity_error), error)
    for arguments in exercise("08.left_right").cases(rng):
        np.testing.assert_array_equal(lesson08.left_right(*arguments), twoview.left_right_check(*arguments))


# The numbers of the questions ----------------------------------------------------------------------------------------


def test_question_rectify(garden):
    says("Partners lie 15 rows apart on average, here more, there less, and in places the other way round.")
    R, B, f, c = garden
    u, v = np.meshgrid(np.linspace(0, 480, 9), np.linspace(0, 360, 7))
    x = np.column_stack([(np.column_stack([u.ravel(), v.ravel()]) - c) / f, np.ones(u.size)]) * f * B / 16
    seen = np.array([p[:, :2] / p[:, 2:] for p in (x @ R["left"] @ K.T, (x - [B, 0, 0]) @ R["right"] @ K.T)])
    inside = ((seen > -0.5) & (seen < (479.5, 359.5))).all(axis=(0, 2))
    apart = (seen[1] - seen[0])[inside, 1]
    assert np.abs(apart).mean() == pytest.approx(15, abs=0.5)
    assert apart.min() < 0 < apart.max()


def test_question_disparity(garden):
    says("A beach ball lies 2.6 m in front of the two cameras, and a picture of a cat hangs 6.1 m away.")
    says("Yes: 39 pixels against 16.")
    Z = depths(garden, [(310.0, 326.0), (255.0, 152.0)])  # the lesson's pixels of the ball and the cat
    assert pytest.approx([2.6, 6.1], abs=0.05) == Z
    assert garden[1] * garden[2] / Z == pytest.approx([39, 16], abs=0.5)


def test_question_error():
    says("f = 800 px and B = 0.1 m and finds disparities to half a pixel. At 1 m from it that makes 6 mm of depth.")
    says("63 cm: ten times as far, a hundred times the error.", "half a pixel of 80 is 0.6 %, half a pixel of 8 is 6 %")
    says("What does it make at 10 m?", "6 cm: ten times as far, ten times the error.", "6.3 m: it grows with the cube")
    near, far = (80 / (80 / Z - 1e-6) - Z for Z in (1.0, 10.0))  # of a millionth of a pixel
    assert [1000 * near * 0.5e6, 100 * far * 0.5e6] == pytest.approx([6, 63], abs=0.5)
    wrong = 100 * 10 * near * 0.5e6, 10 * 1000 * near * 0.5e6  # cm by a linear law, dm by a cube's
    assert wrong == pytest.approx((6, 63), abs=0.5)
    assert pytest.approx([0.6, 0.6], abs=0.05) == [100 * 0.5 / 80, 10 * 0.5 / 8]
    says("from 8 px to 7.5 px is a longer way than from 80 px to 79.5 px", "The derivative of 1/d is −1/d²")
    assert 80 / 7.5 - 80 / 8 > 10 * (80 / 79.5 - 80 / 80)


def test_questions_twice():
    """By 2, by 4 or by 9: the baseline that keeps the error in metres, from the exact interval of a small error."""
    says("Yes: ΔZ = Z² Δd / (f B). Or by 2, with twice the focal length.", "would have to become an eighth")
    says("It has to hang 3 m above it and be right to 1 mm still.", "By 9.", "Then the error would be 3 mm")
    says("A stereo camera hangs 1 m above a conveyor belt and is right to 1 mm.", "By 4.", "Z² has grown 9 times")

    def error(Z, fB, step=1e-6):
        return (fB / (fB / Z - step) - Z) / step

    assert error(2, 4) == pytest.approx(error(1, 1), rel=1e-4)
    assert error(2, 1) / 8 == pytest.approx(error(1, 1) / 2, rel=1e-4)
    assert [error(3, 9), error(3, 3) / 3] == pytest.approx([error(1, 1)] * 2, rel=1e-4)


def test_question_first_formula():
    says("now both have f = 700 px, and the cameras stand 0.12 m apart", "own K had fx = 820, and its lens says 4 mm")
    Q = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 700.0], [0, 0, 1 / 0.12, 0]])
    says("2.4 m.", "Yes: 700 · 0.12/35.", "2.8 m.", "That is 820 · 0.12/35.", "1.4 cm.", "That is 4 · 0.12/35")
    says("A point lies 35 px farther left in the right picture.")
    assert cv2.reprojectImageTo3D(np.full((1, 1), 35, np.float32), Q)[0, 0, 2] == pytest.approx(2.4, rel=1e-6)
    assert pytest.approx([2.8, 1.4], abs=0.05) == [820 * 0.12 / 35, 100 * 4 * 0.12 / 35]


def test_questions_hole():
    says("The strip is on its left only, and as wide in pixels as the two disparities differ.")
    d_left, d_right = np.full(60, 4.0), np.full(60, 4.0)
    d_left[30:40], d_right[18:28] = 12, 12  # a near thing before a wall
    lost = np.flatnonzero(np.isnan(twoview.left_right_check(d_left, d_right, 0.5)[4:])) + 4
    np.testing.assert_array_equal(lost, np.arange(30 - (12 - 4), 30))
