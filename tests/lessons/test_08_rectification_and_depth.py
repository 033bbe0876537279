"""What lesson 08 says about rectification, disparity and depth, recomputed with NumPy, SciPy and OpenCV."""

import cv2
import numpy as np
import pytest
from scipy import ndimage
from scipy.spatial.transform import RigidTransform, Rotation

from camviz import twoview
from camviz.scenes import snapshot, textured_scene
from camviz_school.course.checks import judge
from camviz_school.course.exercises import exercise
from camviz_school.course.material import module
from camviz_school.samples import motorcycle
from camviz_school.views.rectification import RectificationView

lesson08 = module("08")

EXCEPTIONS: dict[str, str] = {}

SIDES = ("left", "right")
K = np.array([[180 / np.tan(np.radians(31)), 0, 239.5], [0, 180 / np.tan(np.radians(31)), 179.5], [0, 0, 1]])
K[0, 0] = K[1, 1] = 240 / np.tan(np.radians(31))  # 62° across 480 pixels
WORLD_FROM = {
    "left": RigidTransform.from_components([-0.3, 0, 0.3], Rotation.from_euler("YXZ", [3, -3, -2], True)),
    "right": RigidTransform.from_components([-0.05, 0.012, 0.31], Rotation.from_euler("YXZ", [-3, -1, 4], True)),
}
"""The garden's two cameras as the view places them: 480 × 360 pixels, 62° wide."""
THINGS = {"ball": (310.0, 326.0), "globe": (373.0, 208.0), "cat": (255.0, 152.0)}
"""Pixels of the rectified left picture, as the lesson has them."""


@pytest.fixture(scope="module")
def garden():
    """The pair as OpenCV rectifies it: the turns, B, and the frame of the lesson's pixels."""
    right_from_left = WORLD_FROM["right"].inv() * WORLD_FROM["left"]
    R, t = right_from_left.rotation.as_matrix(), right_from_left.translation
    R1, R2, *_ = cv2.stereoRectify(K, None, K, None, (480, 360), R, t.reshape(3, 1))
    pair = RectificationView().stage.pair
    f, c = pair.left.intrinsics.fx, (pair.left.intrinsics.cx, pair.left.intrinsics.cy)  # where the lesson's pixels are
    return {"R": {"left": R1, "right": R2}, "B": np.linalg.norm(t), "f": f, "c": np.array(c)}


def looked_at(garden, uv, side="left"):
    """Z of what the rectified camera sees at pixels (n, 2), by tracing the garden."""
    x = np.concatenate([(np.asarray(uv) - garden["c"]) / garden["f"], np.ones((len(uv), 1))], axis=-1)
    world_from_rectified = WORLD_FROM[side].rotation.as_matrix() @ garden["R"][side].T
    rays = x / np.linalg.norm(x, axis=-1, keepdims=True)
    _, distance = textured_scene().trace(WORLD_FROM[side].translation, rays @ world_from_rectified.T)
    return distance * rays[:, 2]


def rows_as_taken(garden, uv, Z):
    """Where points of the rectified left picture at the depths Z lie in the two pictures as they were taken."""
    x = np.concatenate([(np.asarray(uv) - garden["c"]) / garden["f"], np.ones((len(uv), 1))], axis=-1) * Z[:, None]
    rays = {"left": x, "right": x - [garden["B"], 0, 0]}
    pixels = {}
    for side in SIDES:
        seen = rays[side] @ garden["R"][side] @ K.T
        pixels[side] = seen[:, :2] / seen[:, 2:]
    return pixels


def test_the_two_cameras(says, garden):
    (apart,) = says("Nobody has aligned these cameras, which stand 25 cm apart.")
    assert apart == 100 * garden["B"]
    says("Each looks a little elsewhere, and one is tilted.")
    lean = {side: Rotation.as_euler(WORLD_FROM[side].rotation, "YXZ", degrees=True)[2] for side in SIDES}
    assert abs(lean["right"] - lean["left"]) > 5


def test_no_row_by_row_search_can_find_the_partners_of_the_pair_as_taken(says, garden):
    says("Most of this map is nonsense, and where it is hatched nothing was found.")
    score = RectificationView(rectify=0.0).score()
    assert score.missing > 0.5
    assert score.bad > 0.99
    u, v = np.meshgrid(np.linspace(0, 480, 9), np.linspace(0, 360, 7))
    uv = np.stack([u.ravel(), v.ravel()], axis=-1)
    seen = rows_as_taken(garden, uv, np.full(len(uv), garden["f"] * garden["B"] / 16))
    inside = np.all([(seen[side] > -0.5).all(axis=1) & (seen[side] < (479.5, 359.5)).all(axis=1) for side in SIDES], 0)
    apart = (seen["right"] - seen["left"])[inside, 1]
    (average,) = says("Partners lie 15 rows apart on average, here more, there less, and in places the other way round")
    assert average == np.abs(apart).mean()
    assert apart.min() < 0 < average.value < apart.max()
    says("The yellow lines run at different slopes in the two pictures")
    columns = np.array([(50.0, 168.0), (430.0, 168.0)])
    ends = rows_as_taken(garden, columns, np.array([6.0, 6.0]))
    slopes = {side: np.diff(ends[side][:, 1]) / np.diff(ends[side][:, 0]) for side in SIDES}
    assert abs(slopes["left"] - slopes["right"]) > 0.05


def test_turning_a_camera_is_a_map_by_a_3_by_3_matrix_whatever_the_depth(says):
    rows, columns = says("Such a map of pixels by a 3 × 3 matrix")
    R = Rotation.from_euler("YXZ", [5, -3, 2], degrees=True).as_matrix()
    H = K @ R @ np.linalg.inv(K)
    assert (rows, columns) == H.shape
    points = np.random.default_rng(8).uniform((-1, -1, 2), (1, 1, 9), (50, 3))
    before, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), K, None)
    after, _ = cv2.projectPoints(points, cv2.Rodrigues(R)[0], np.zeros(3), K, None)
    np.testing.assert_allclose(cv2.perspectiveTransform(before, H), after, atol=1e-9)


def test_the_rectified_cameras_are_not_parallel_to_the_wall(says, garden):
    says("The wall here is not, rectified or not.")
    axes = {side: WORLD_FROM[side].rotation.as_matrix() for side in SIDES}
    for matrix in (*axes.values(), axes["left"] @ garden["R"]["left"].T):
        assert np.degrees(np.arccos(matrix[2, 2])) > 1  # the wall's normal is the world's z axis
    np.testing.assert_allclose(axes["left"] @ garden["R"]["left"].T, axes["right"] @ garden["R"]["right"].T, atol=1e-9)


def test_the_ball_jumps_more_than_twice_as_far_as_the_cat(says, garden):
    Z = dict(zip(THINGS, looked_at(garden, list(THINGS.values())), strict=True))
    d = {name: garden["f"] * garden["B"] / depth for name, depth in Z.items()}
    ball, cat = says("A beach ball lies 2.6 m in front of the two cameras, and a picture of a cat hangs 6.1 m away.")
    assert ball == Z["ball"]
    assert cat == Z["cat"]
    ball, cat = says("Yes: 39 pixels against 16.")
    assert ball == d["ball"]
    assert cat == d["cat"]
    says("more than twice as far as the cat")
    assert d["ball"] > 2 * d["cat"]
    ball, cat = says("The ball has 39 px of disparity, the cat 16 px.")
    assert ball == d["ball"]
    assert cat == d["cat"]
    (away,) = says("Press + rays from above to see both rays meet: the ball is 2.6 m away.")
    assert away == Z["ball"]


def best_shift(left, right, row, block, count):
    """The disparity (width,) of the least sum of absolute differences, block by block; −1 where none is complete."""
    half, width = block // 2, left.shape[1]
    best, found = np.full(width, np.inf), np.full(width, -1)
    for d in range(count):
        for u in range(d + half, width - half):
            window = (slice(row - half, row + half + 1), slice(u - half, u + half + 1))
            shifted = (window[0], slice(u - d - half, u - d + half + 1))
            cost = np.abs(left[window] - right[shifted]).sum()
            if cost < best[u]:
                best[u], found[u] = cost, d
    return found


def test_half_of_the_mistakes_are_in_a_strip_that_only_the_left_camera_sees(says, garden):
    (wide,) = says("To the left of the globe is a strip, 17 pixels wide, that only the left camera sees.")
    says("Half of our mistakes are in one place: the strip to the left of the globe, which only the left camera sees.")
    row = 206
    uv = np.stack([np.arange(480.0), np.full(480, float(row))], axis=-1)
    d = garden["f"] * garden["B"] / looked_at(garden, uv)
    d_right = garden["f"] * garden["B"] / looked_at(garden, uv, "right")
    there = np.interp(uv[:, 0] - d, uv[:, 0], d_right)  # what the right camera sees where the partner should be
    hidden = there - d > 5
    beside_the_globe = [u for u in np.flatnonzero(hidden) if 300 < u < 345]
    assert wide == len(beside_the_globe)
    (around,) = says("Around column 330, to the left of the globe, it should drop the strip")
    assert around.value in beside_the_globe
    assert wide == beside_the_globe[-1] - beside_the_globe[0] + 1
    assert d[beside_the_globe[-1] + 1] > 30  # the globe begins there
    says("as wide in pixels as the two disparities differ")
    assert wide.value == pytest.approx(d[beside_the_globe[-1] + 1] - d[beside_the_globe[0] - 1], abs=1)
    pair = RectificationView().stage.pair
    grey = [cv2.cvtColor(snapshot(textured_scene(), one), cv2.COLOR_RGB2GRAY) for one in (pair.left, pair.right)]
    found = best_shift(*(one.astype(float) for one in grey), row, 15, 64)
    wrong = [u for u in range(64, 473) if np.isfinite(d[u]) and abs(found[u] - d[u]) > 1]
    assert sum(u in beside_the_globe for u in wrong) == pytest.approx(len(wrong) / 2, abs=1)
    says("two squares farther on (lesson 07 had four such places)")
    board = best_shift(*(one.astype(float) for one in grey), row, 15, 20)[100:180]
    two_squares = 0.2 * garden["f"] / looked_at(garden, uv)[100:180]
    assert np.median(np.abs(board - (d[100:180] - two_squares))) < 2


def test_the_globe_hides_the_partner_of_what_the_strip_shows(says, garden):
    """As the view with the slider of the column has it: row 206, columns 300 to 331, a disparity of 16.25 px."""
    says("The mark on the map lies on the wall, and that on the picture where its partner should be.")
    says("In the right picture the globe covers it.")
    uv = np.stack([np.arange(300.0, 332), np.full(32, 206.0)], axis=-1)
    wall = garden["f"] * garden["B"] / looked_at(garden, uv)
    assert np.abs(wall - 16.25).max() < 0.2
    there = garden["f"] * garden["B"] / looked_at(garden, uv - [16.25, 0], "right")
    assert np.abs(there[:14] - 16.25).max() < 0.2  # at first the wall, in both pictures
    assert there[19:].min() > 30  # then the globe
    hatched = np.isnan(RectificationView().disparity_map()[206, 300:332])
    assert not hatched[:14].any()
    assert hatched[18:].all()


def test_what_the_block_and_the_range_do(says):
    small, large = says("With method BM, move block size from 5 to 25, and look at the lamp posts and the globe.")
    first, second, third, fourth = says("larger and larger squares: 5, 9, 15, 25 pixels")
    sizes = [int(one.value) for one in (first, second, third, fourth)]
    assert small == sizes[0]
    assert large == sizes[-1]
    scores = [RectificationView(method="BM", block_size=size).score() for size in sizes]
    missing = [score.missing for score in scores]
    assert missing[0] > missing[1] > missing[2]
    assert missing[3] < missing[0] / 2
    wrong = [score.bad - score.missing for score in scores]
    assert wrong == sorted(wrong)
    count, last, again = says(
        "Set number of disparities to 16: disparities are then sought from 0 to 15 px, everything nearer than f B / 15 "
        "is lost, and what is found there is nonsense."
    )
    found = RectificationView(disparities=int(count.value)).disparity_map()
    assert last == np.nanmax(found)
    assert again == count.value - 1
    truth = RectificationView().true_disparity_map()
    nearer = np.isfinite(found) & (truth > last.value + 2)
    assert (np.abs(found - truth)[nearer] > 1).mean() > 0.99
    (more,) = says("Set it to 128: the band on the left grows, in which no full search is possible.")
    wide = RectificationView(disparities=int(more.value)).disparity_map()
    assert np.isnan(wide[:, : int(more.value) - 1]).all()
    assert np.isfinite(RectificationView().disparity_map()[:, 65:127]).any()


def test_the_filter_leaves_fewer_holes_and_more_that_is_wrong(says):
    says("The filter leaves fewer holes, and more pixels are wrong.")
    plain, filtered = (RectificationView(method=name, block_size=5).score() for name in ("SGM", "SGM + WLS"))
    assert filtered.missing < plain.missing
    assert filtered.bad - filtered.missing > plain.bad - plain.missing


def interval(Z, fB, error=0.5):
    return fB / (fB / Z + error), fB / (fB / Z - error)


def test_what_half_a_pixel_is_worth(says):
    f, B, near, error, far = says(
        "A stereo camera has f = 800 px and B = 0.1 m and finds disparities to half a pixel. At 1 m from it that makes "
        "6 mm of depth. What does it make at 10 m?"
    )
    fB = f.value * B.value
    first_order = {Z: Z**2 / fB * 0.5 for Z in (near.value, far.value, 20.0)}
    assert error == 1000 * first_order[near.value]
    (answer,) = says("63 cm: ten times as far, a hundred times the error.")
    assert answer == 100 * first_order[far.value]
    (constant,) = says("6 mm: half a pixel is half a pixel.")
    (proportional,) = says("6 cm: ten times as far, ten times the error.")
    (cube,) = says("6.3 m: it grows with the cube, as a volume does.")
    assert constant == error.value
    assert proportional == 100 * 10 * first_order[near.value]
    assert cube == 1000 * first_order[near.value]
    mm, one, cm, ten, twenty, half, nearer, farther = says(
        "6 mm at 1 m, 63 cm at 10 m: ten times as far, a hundred times the error. At 20 m the formula of first order "
        "says 2.5 m to either side; exactly it is 2.2 m nearer and 2.9 m farther."
    )
    assert mm == 1000 * first_order[one.value]
    assert cm == 100 * first_order[ten.value]
    assert half == first_order[twenty.value]
    low, high = interval(twenty.value, fB)
    assert nearer == twenty.value - low
    assert farther == high - twenty.value
    again, length, product = says("With f = 800 px and B = 0.1 m, fB is 80 m·px:")
    assert again == f.value
    assert length == B.value
    assert product == fB


def test_the_sliders_of_the_error(says):
    fB = 80
    two, three = says("The teeth below the ray stand at the depths of 1, 2, 3 … pixels of disparity.")
    (begins,) = says("Take disparity slowly down from 80.")
    near, metres, middle, four, ten, *further = says(
        "At 80 (1 m) the red piece is a dot. Go to 20 (4 m), to 8 (10 m), then to 4 and 2."
    )
    assert begins.value == near.value
    assert metres == fB / near.value
    assert four == fB / middle.value
    assert ten == fB / 8
    lengths = [np.ptp(interval(fB / d, fB)) for d in (near.value, middle.value, 8, *(one.value for one in further))]
    assert lengths == sorted(lengths)
    assert lengths[0] < 0.02
    gaps = fB / np.array([1.0, two.value]) - fB / np.array([two.value, three.value])
    says("Farther away the gaps grow.")
    assert gaps[0] > gaps[1]
    says("the far side of the wedge never meets the ray: the point may be infinitely far away.")
    assert twoview.depth_interval(fB / 1, 800, 0.1, 1.0)[1] == np.inf
    says("Double the baseline, and the disparity with it, so that the depth stays: half the error.")
    assert 10**2 / (2 * fB) == 10**2 / fB / 2


def test_the_replies_about_the_error(says):
    fB = 80
    eight, seven, eighty, below = says("from 8 px to 7.5 px is a longer way than from 80 px to 79.5 px")
    assert fB / seven.value - fB / eight.value > 10 * (fB / below.value - fB / eighty.value)
    whole, small, little, large = says("half a pixel of 80 is 0.6 %, half a pixel of 8 is 6 %")
    assert small == 100 * 0.5 / whole.value
    assert large == 100 * 0.5 / little.value
    (slope,) = says("The derivative of 1/d is −1/d², and 1/d is Z up to a factor.")
    d, step = 3.0, 1e-5
    assert slope == (1 / (d + step) - 1 / (d - step)) / (2 * step) * d**2


def test_a_phone_and_a_car(says):
    cm, phone, wide, car, near, far, *errors = says(
        "the stereo camera of a phone (B = 1 cm, f about 3000 px) and of a car (B = 30 cm, f = 1500 px), at 2 m and at "
        "50 m, for half a pixel: 67 mm and 42 m for the phone, 4 mm and 2.8 m for the car."
    )
    fB = {"phone": cm.value / 100 * phone.value, "car": wide.value / 100 * car.value}
    mm, m, mm_too, m_too = errors
    assert mm == 1000 * near.value**2 / fB["phone"] / 2
    assert m == far.value**2 / fB["phone"] / 2
    assert mm_too == 1000 * near.value**2 / fB["car"] / 2
    assert m_too == far.value**2 / fB["car"] / 2
    Z, cm, f, wide = says(
        "To know 50 m to 10 cm, with f = 1500 px and a quarter of a pixel, `…` gives 4.2 m: wider than a car."
    )
    assert wide == Z.value**2 * 0.25 / (f.value * cm.value / 100)


def test_the_left_right_check_by_hand(says):
    column, d, again, minus, partner = says(
        "The left pixel in column 100 has found disparity 20. Its partner is column 100 − 20 = 80."
    )
    assert partner == column.value - d.value
    assert (again.value, minus.value) == (column.value, d.value)
    there, found, back = says("The right pixel in column 80 has found 20 as well: it points back to column 100.")
    assert back == there.value + found.value == column.value
    wrong, elsewhere = says("Had the right pixel found 37, it would point to column 117.")
    assert elsewhere == there.value + wrong.value != column.value


def test_a_turned_camera_moves_a_pixel_by_hand(says):
    f, cx, cy, turn, u, v, *numbers = says(
        "By hand, with f = 400 px, the principal point at (240, 180), and a camera that turns 3° to the right: the "
        "pixel (340, 100) is the ray (0.25, −0.2, 1). Turned it is (0.1973, −0.2, 1.0117), and that is the pixel "
        "(318.0, 100.9)."
    )
    x, y, turned_x, turned_y, turned_z, u_new, v_new = numbers
    K = np.array([[f.value, 0, cx.value], [0, f.value, cy.value], [0, 0, 1]])
    R = Rotation.from_euler("Y", turn.value, True).inv().as_matrix()
    ray = np.linalg.inv(K) @ (u.value, v.value, 1)
    assert [x, y] == list(ray[:2])
    assert [turned_x, turned_y, turned_z] == list(R @ ray)
    assert [u_new, v_new] == list(
        cv2.perspectiveTransform(np.array([[[u.value, v.value]]]), K @ R @ np.linalg.inv(K)).ravel()
    )


def test_a_length_and_a_percentage_ask_for_baselines_that_cross(says):
    f, cm, percent = says(
        "With your function, f = 1500 px and a quarter of a pixel: how wide must a stereo camera be to know a depth to "
        "10 cm, or to 1 % of itself?"
    )
    Z = cm.value / 100 / (percent.value / 100)  # where both ask for the same
    assert pytest.approx(10) == Z
    assert Z**2 * 0.25 / (f.value * 0.1) == pytest.approx(1 / 6)


def test_the_doffs_of_the_motorcycle(says):
    """The published cx of the two cameras are 1244.772 px and 1369.115 px, in pictures 2964 px wide."""
    (doffs,) = says("at 0 your function is given doffs = 15.5 px, at 1 it is given 0")
    assert doffs == (1369.115 - 1244.772) * 370 / 2964


def test_time_of_flight(says):
    there_and_back, ps = says("Z = c Δt / 2. A centimetre of depth is 67 picoseconds.")
    MHz, far = says("At f_mod = 20 MHz the phase repeats after 7.5 m")
    c = 299_792_458.0
    assert ps == there_and_back.value * 0.01 / c * 1e12
    assert far == c * 2 * np.pi / (4 * np.pi * MHz.value * 1e6)


def test_twice_as_far_takes_four_times_the_baseline(says):
    (two,) = says("By 2.")
    (four,) = says("By 4.")
    (also,) = says("Or by 2, with twice the focal length.")

    def error(Z, f, B):
        return Z**2 / (f * B)

    assert error(2, 1, four.value) == error(1, 1, 1)
    assert error(2, 2, also.value) == error(1, 1, 1)
    assert error(2, 1, two.value) / 2 == error(1, 1, 1)  # the same percentage, not the same length
    says("an error of half a pixel would have to become an eighth")
    assert error(2, 1, 1) / 8 == error(1, 1, 1) / 2


def test_the_pair_as_taken_puts_everything_behind_the_cameras(says, garden):
    angle, shift = says(
        "As taken, the two cameras are turned towards each other by 6°, which shifts everything by about 42 px. Ball "
        "and cat have negative disparities there, and the formula puts both behind the cameras."
    )
    yaws = {side: WORLD_FROM[side].rotation.as_euler("YXZ", degrees=True)[0] for side in SIDES}
    assert angle == yaws["left"] - yaws["right"]
    assert shift == 2 * K[0, 0] * np.tan(np.radians(angle.value / 2))
    seen = rows_as_taken(garden, list(THINGS.values()), looked_at(garden, list(THINGS.values())))
    assert ((seen["left"] - seen["right"])[:, 0] < 0).all()


def test_the_strip_that_the_left_right_check_removes(says):
    near, far, strip = says(
        "how wide is the strip that the check removes beside a thing at disparity 12 before a wall at 4? (8 px: the "
        "difference of the disparities.)"
    )
    n, left, right = 60, int(near.value), int(far.value)
    d_left, d_right = np.full(n, float(right)), np.full(n, float(right))
    d_left[30:40], d_right[30 - left : 40 - left] = left, left
    kept = lesson08.left_right(d_left, d_right, 0.5)
    assert strip == np.isnan(kept[right:]).sum()
    assert np.isnan(kept[30 - int(strip.value) : 30]).all()  # on its left


# Another light, between two pixels, and how sure ---------------------------------------------------------------------


BLOCK = 9


def answered(grey):
    """The census answers (height, width, 25), with the picture's wrap-around that the lesson's np.roll has."""
    windows = np.lib.stride_tricks.sliding_window_view(np.pad(grey, 2, mode="wrap"), (5, 5))
    return (windows < grey[..., None, None]).reshape(*grey.shape, 25)


def searched(left, right, apart, count=32):
    """Costs (count, height, width) by summing what `apart` says of two pixels over each block, one by one."""
    height, width = left.shape[:2]
    costs = np.full((count, height, width), np.inf)
    for d in range(count):
        one = np.pad(apart(left[:, d:], right[:, : width - d]).astype(float), BLOCK // 2, mode="reflect")
        costs[d, :, d:] = np.lib.stride_tricks.sliding_window_view(one, (BLOCK, BLOCK)).sum(axis=(2, 3))
    return costs


def by_grey(one, other):
    return np.abs(one.astype(float) - other)


def by_answers(one, other):
    return (one != other).sum(axis=-1)


@pytest.fixture(scope="module")
def searches():
    """Where each cost finds a partner on the motorcycle, in the same light and a fifth darker; and the truth."""
    bike = motorcycle(width=370)
    left, right = (cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY) for picture in (bike.left, bike.right))
    costs = {}
    for light in (1.0, 0.8):
        dimmed = np.rint(light * right)
        costs["greys", light] = searched(left, dimmed, by_grey)
        costs["census", light] = searched(answered(left), answered(dimmed), by_answers)
    return costs, bike


@pytest.mark.thorough
def test_what_the_census_transform_keeps_in_another_light(says, searches):
    high, wide = says("Two costs look for each pixel's partner in blocks of 9 × 9 pixels")
    assert high == BLOCK
    assert wide == BLOCK
    costs, bike = searches
    known = np.isfinite(bike.disparity)
    off = {one: np.mean(np.abs(c.argmin(axis=0) - bike.disparity)[known] > 1) for one, c in costs.items()}
    says("The greys lose most of the map, and the census transform next to nothing.")
    assert off["greys", 0.8] > 0.5
    assert abs(off["census", 0.8] - off["census", 1.0]) < 0.01
    assert off["census", 1.0] < off["greys", 1.0]  # in the same light it is the better cost as well


def test_four_neighbours_by_hand(says):
    middle, *rest = says(
        "One pixel, by hand: grey 100, and four neighbours of 80, 120, 99 and 100. The answers are yes, no, yes, no. A "
        "fifth darker, the pixel is 80, the neighbours are 64, 96, 79.2 and 80, and the answers are the same."
    )
    greys = np.array([float(one.value) for one in rest if one.value != 4])
    before, after = greys[:4], greys[-4:]
    np.testing.assert_allclose(after, 0.8 * before)
    assert list(before < float(middle.value)) == list(after < 0.8 * float(middle.value)) == [True, False, True, False]


@pytest.mark.thorough
def test_leaving_out_what_is_least_sure(says, searches):
    says("Leave out the fifth of which the matcher is least sure, and three in four mistakes are gone.")
    costs, bike = searches
    costs = costs["census", 0.8]
    best = costs.argmin(axis=0)
    others = np.where(np.abs(np.arange(32)[:, None, None] - best) >= 2, costs, np.inf)
    share = costs.min(axis=0) / others.min(axis=0)
    known = np.isfinite(bike.disparity)
    wrong = known & (np.abs(best - bike.disparity) > 1)
    sure = share <= np.quantile(share[known], 0.8)
    assert 1 - (wrong & sure).sum() / wrong.sum() == pytest.approx(3 / 4, abs=0.02)


def test_a_parabola_through_three_costs(says):
    *three, delta = says("One minimum, by hand: the costs are 50, 20 and 40. The parabola is least at δ = 0.1")
    three = [float(one.value) for one in three if one.value >= 20]
    a, b, _ = np.polyfit([-1, 0, 1], three, 2)
    assert delta == -b / (2 * a)
    assert lesson08.between_pixels(*np.array(three)) == pytest.approx(0.1)


def test_places_are_drawn_to_the_nearest_whole_pixel(says):
    """By spectra of its own seed, and moved by waves of the whole length: SciPy's, not the lesson's."""
    (sharp,) = says(
        "the found places are drawn to the nearest whole pixel: by up to 0.10 px with |difference|, and by a quarter "
        "of that with its square."
    )
    rng, n = np.random.default_rng(1), 2**15
    row = ndimage.gaussian_filter1d(rng.normal(size=n), 1.0, mode="wrap")
    bias = {1: [], 2: []}
    for s in np.arange(0.05, 0.5, 0.05):
        moved = np.fft.ifft(ndimage.fourier_shift(np.fft.fft(row), s)).real
        for power, found in bias.items():
            costs = [np.abs(row - np.roll(moved, -d)) ** power for d in (-1, 0, 1)]
            costs = np.array([one[: n // 15 * 15].reshape(-1, 15).sum(axis=1) for one in costs])
            found.append(s - np.nanmedian(lesson08.between_pixels(*costs)))
    assert min(bias[1] + bias[2]) > 0  # towards 0, the nearest whole pixel
    assert sharp == max(bias[1])
    assert max(bias[2]) / max(bias[1]) == pytest.approx(1 / 4, abs=0.015)


def test_what_parts_of_a_pixel_are_worth_on_the_motorcycle(says):
    bike = motorcycle(width=370)
    far, step = says("half a pixel at 3 m is 5 cm here")
    a_metre = float(far.value) ** 2 / (bike.focal_length * bike.baseline)
    assert step == 100 * 0.5 * a_metre
    softly, as_far = says("A tenth of a pixel is 9 mm for the motorcycle at 3 m")
    assert as_far == far.value
    assert softly == 1000 * 0.1 * a_metre


# The photographs -----------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def rig(samples):
    """The thirteen pairs of OpenCV's samples, calibrated with OpenCV alone: corners, K, lenses, R and t."""
    uv = {side: np.array([corners(path) for path in sorted(samples.glob(f"{side}??.jpg"))]) for side in SIDES}
    K, lens = {}, {}
    for side in SIDES:
        _, K[side], lens[side], _, _ = cv2.calibrateCamera([BOARD] * 13, list(uv[side]), (640, 480), None, None)
    rms, R, t = together(uv, K, lens)
    return {"uv": uv, "K": K, "lens": lens, "rms": rms, "R": R, "t": t}


BOARD = np.float32([(0.025 * column, 0.025 * row, 0) for row in range(6) for column in range(9)])


def corners(path):
    grey = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
    _, found = cv2.findChessboardCorners(grey, (9, 6))
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 40, 1e-3)
    return cv2.cornerSubPix(grey, np.float32(found).reshape(-1, 1, 2), (5, 5), (-1, -1), stop).reshape(54, 2)


def together(uv, K, lens):
    """RMS, R and t of the pair with the intrinsics as they are."""
    arguments = ([BOARD] * 13, list(uv["left"]), list(uv["right"]), K["left"], lens["left"], K["right"], lens["right"])
    rms, _, _, _, _, R, t, _, _ = cv2.stereoCalibrate(*arguments, (640, 480), flags=cv2.CALIB_FIX_INTRINSIC)
    return rms, R, t.ravel()


def straightened(rig, side):
    """x, y of the corners (13, 54, 2) without the lens."""
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 100, 1e-12)
    points = rig["uv"][side].reshape(-1, 1, 2).astype(float)
    return cv2.undistortPoints(points, rig["K"][side], rig["lens"][side], criteria=stop).reshape(13, 54, 2)


def test_how_the_two_real_cameras_stand(says, rig):
    beside, across = says(
        "The right camera is turned by half a degree against the left one. It stands 83 mm to its right, and t says "
        "that less than 1 mm of the way is across the rows."
    )
    assert np.degrees(np.linalg.norm(cv2.Rodrigues(rig["R"])[0])) == pytest.approx(0.5, abs=0.02)
    assert beside == -1000 * rig["t"][0]
    assert 1000 * abs(rig["t"][1]) < across.value


def test_rectification_leaves_a_seventh_of_a_pixel(says, rig):
    (before,) = says("the rows differ by 13 px before and by a seventh of a pixel after")
    assert before == np.abs(rig["uv"]["right"] - rig["uv"]["left"])[..., 1].mean()
    K, lens = rig["K"], rig["lens"]
    R1, R2, P1, P2, *_ = cv2.stereoRectify(
        K["left"], lens["left"], K["right"], lens["right"], (640, 480), rig["R"], rig["t"].reshape(3, 1)
    )
    v = [
        P[1, 1] * turned[..., 1] / turned[..., 2] + P[1, 2]
        for side, R, P in (("left", R1, P1), ("right", R2, P2))
        for turned in [cv2.convertPointsToHomogeneous(straightened(rig, side).reshape(-1, 2)).reshape(13, 54, 3) @ R.T]
    ]
    assert np.abs(v[0] - v[1]).mean() == pytest.approx(1 / 7, abs=0.02)


def test_the_principal_points_make_the_thirteen_pixels(says, rig):
    K, t = rig["K"], rig["t"]
    v = {side: rig["uv"][side][..., 1] for side in SIDES}
    straight = {side: straightened(rig, side) for side in SIDES}
    rays = np.concatenate([straight["left"], np.ones((13, 54, 1))], axis=-1)
    turned = rays @ rig["R"].T
    f = {side: K[side][1, 1] for side in SIDES}
    parts = {
        "principal points": K["right"][1, 2] - K["left"][1, 2],
        "turn": f["left"] * (turned[..., 1] / turned[..., 2] - rays[..., 1]).mean(),
        "height": (f["right"] * straight["right"][..., 1] - f["left"] * turned[..., 1] / turned[..., 2]).mean(),
    }
    bend = {side: v[side] - K[side][1, 2] - f[side] * straight[side][..., 1] for side in SIDES}
    whole = (v["right"] - v["left"]).mean()
    assert sum(parts.values()) + (bend["right"] - bend["left"]).mean() == pytest.approx(whole)
    rows, turn, px = says("Half a degree cannot explain 13 px: it is only f · tan 0.5° = 4.7 px.")
    assert rows == whole
    assert px == f["left"] * np.tan(np.radians(turn.value))
    says("Most of it comes from the principal points.")
    assert abs(parts["principal points"] - whole) < 0.3 * whole
    assert max(abs(parts["turn"]), abs(parts["height"]), abs((bend["right"] - bend["left"]).mean())) < 0.3 * whole
    left, right = says(
        "The axis of the left lens meets its sensor in row 234, that of the right one in row 249. Rectification "
        "removes that too"
    )
    assert left == K["left"][1, 2]
    assert right == K["right"][1, 2]
    assert 1000 * abs(t[1]) < 1


# What the motorcycle's numbers are -----------------------------------------------------------------------------------


def test_the_motorcycle_without_doffs_is_nearly_twice_as_far():
    f, B, doffs = 994.978, 193.001, 31.086  # as the data set publishes them, in pixels and millimetres
    d = 2 * 19.3
    assert f * B / (d + doffs) / 1000 == pytest.approx(2.75, abs=0.01)
    assert f * B / d / 1000 == pytest.approx(4.96, abs=0.02)


# The exercises against other programs --------------------------------------------------------------------------------


def test_depth_and_baseline_are_those_of_camviz():
    rng = np.random.default_rng(5)
    for d, f, B, doffs in exercise("08.depth").cases(rng):
        np.testing.assert_allclose(lesson08.depth(d, f, B, doffs), twoview.depth_from_disparity(d, f, B, doffs))
    for Z, error, f, disparity_error in exercise("08.baseline_for").cases(rng):
        B = lesson08.baseline_for(Z, error, f, disparity_error)
        np.testing.assert_allclose(twoview.depth_error(Z, f, B, disparity_error), error)


def test_the_left_right_check_is_that_of_camviz():
    for arguments in exercise("08.left_right").cases(np.random.default_rng(5)):
        np.testing.assert_array_equal(lesson08.left_right(*arguments), twoview.left_right_check(*arguments))


def test_a_constant_and_a_tolerance_of_one_s_own_are_told_so():
    said = judge(exercise("08.depth"), lambda d, f, B, doffs: 3.0, np.random.default_rng(0))
    assert "same number" in said.message

    def far_too_tolerant(d_left, d_right, tolerance):
        return twoview.left_right_check(d_left, d_right, 9.0)

    assert judge(exercise("08.left_right"), far_too_tolerant, np.random.default_rng(0)).status == "wrong"


def test_the_sixteenths_that_a_reply_speaks_of():
    grey = np.random.default_rng(8).integers(0, 255, (60, 200), dtype=np.uint8)
    found = cv2.StereoSGBM.create(0, 32, 5).compute(grey, np.roll(grey, -7, axis=1))
    assert found.dtype == np.int16
    assert np.median(found[found >= 0]) == 7 * 16
    assert (found[:, :20] == -16).all()  # no match


def test_sixteenths_in_the_replies(says):
    (one,) = says("You divide the sum by 16, and doffs with it.")
    (other,) = says("a number of sixteenths is divided by 16 to give pixels")
    (third,) = says("You divide by 16. OpenCV's matchers count in sixteenths of a pixel")
    assert all(number == 16 for number in (one, other, third))


# Before the lesson ---------------------------------------------------------------------------------------------------


def test_before_the_lesson_which_f(says):
    f, B = says("now both have f = 700 px, and the cameras stand 0.12 m apart")
    before, lens = says("Before that, the left camera's own K had fx = 820, and its lens says 4 mm.")
    (d,) = says("A point lies 35 px farther left in the right picture.")
    (named,) = says("The 35 px, the disparity, are in pixels")
    assert named.value == d.value
    for focal, claim, sum_ in (
        (f, says("2.4 m."), says("Yes: 700 · 0.12/35.")),
        (before, says("2.8 m."), says("That is 820 · 0.12/35.")),
        (lens, says("1.4 cm."), says("That is 4 · 0.12/35, in millimetres times metres per pixel.")),
    ):
        assert [one.value for one in sum_] == [focal.value, B.value, d.value]
        assert claim[0] == focal.value * B.value / d.value * (100 if focal is lens else 1)
    (again,) = says("The picture with fx = 820 is not the one in which the disparity was measured.")
    assert again == before.value
    Q = np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, f.value], [0, 0, 1 / B.value, 0]])
    Z = cv2.reprojectImageTo3D(np.full((1, 1), d.value, np.float32), Q)[0, 0, 2]
    assert pytest.approx(2.4, rel=1e-6) == Z


def test_before_the_lesson_how_much_the_baseline_grows(says):
    near, error = says("A stereo camera hangs 1 m above a conveyor belt and is right to 1 mm.")
    far, kept = says("It has to hang 3 m above it and be right to 1 mm still.")
    assert kept == error.value

    def off(Z, B, step=1e-6):  # ΔZ for a small Δd, from Z = f B/d by differences
        return (1 / (1 / (Z * B) * B - step / B) - Z) / step

    factor = off(far.value, 1.0) / off(near.value, 1.0)
    (right,) = says("By 9.")
    (times,) = says("Z² has grown 9 times, so B has to")
    assert all(abs(one.value - factor) < 1e-3 for one in (right, times))
    assert off(far.value, right.value) == pytest.approx(off(near.value, 1.0), rel=1e-4)
    (tripled,) = says("By 3.")
    (worse,) = says("Then the error would be 3 mm: the same share of the distance, and three times too much.")
    assert worse == error.value * off(far.value, tripled.value) / off(near.value, 1.0)
    says("Its error in the disparity would have to shrink to a ninth.")


def test_before_the_lesson_which_side_is_hidden(says):
    says("From farther to the right, the trunk covers more of what is on its left.")
    trunk, hedge, B = (-0.1, 0.1, 2.0), 4.0, 0.12  # left and right edge, its depth; the hedge's; the baseline
    hidden = {}
    for name, camera in (("left", 0.0), ("right", B)):
        hidden[name] = [camera + (edge - camera) * hedge / trunk[2] for edge in trunk[:2]]
    assert hidden["right"][0] < hidden["left"][0]  # more on the left of the trunk
    assert hidden["right"][1] < hidden["left"][1]


def test_what_a_teacher_marks_on_the_board(says):
    f, B, *marked = says(
        "take f = 800 px and B = 0.1 m, and mark on a line on the board how far 10, 8, 6, 4 and 2 px of disparity are: "
        "8, 10, 13.3, 20 and 40 m."
    )
    disparities, depths = np.array([one.value for one in marked[:5]]), marked[5:]
    assert list(depths) == list(f.value * B.value / disparities)
    assert np.ptp(np.diff(disparities)) == 0
    assert (np.diff([one.value for one in depths], n=2) > 0).all()
    whole, less = says("Only then let all compute f B/d for 8 px and for 7.5 px, and talk.")
    assert whole.value - less.value == 0.5
    nearer, farther = (800 * 0.1 / one.value for one in (whole, less))
    assert nearer == pytest.approx(10)
    assert farther - nearer == pytest.approx(0.667, abs=1e-3)  # one side of the interval that the lesson prints
    cm, px, wrong, at = says("a telephone with B = 1 cm and f = 3000 px: half a pixel is worth 42 m at 50 m.")
    assert wrong == at.value**2 / (cm.value / 100 * px.value) / 2
    (near,) = says("They compute the telephone's error at 2 m")
    assert near.value**2 / (cm.value / 100 * px.value) / 2 == pytest.approx(0.067, abs=1e-3)
