"""What lesson 03 says about intrinsics, recomputed with NumPy and OpenCV."""

import re

import cv2
import numpy as np
import pytest

from camviz.scenes.photographs import photograph
from camviz.scenes.standard import textured_scene
from camviz_school.views.balloon import BALLOON, balloon_in_sight, towards_balloon
from camviz_school.views.camera_matrix import GLOBE, GLOBE_RADIUS
from camviz_school.views.intrinsics import IntrinsicsView

EXCEPTIONS: dict[str, str] = {}


def matrix(fx=450.0, fy=450.0, cx=319.5, cy=239.5, skew=0.0):
    return np.array([[fx, skew, cx], [0, fy, cy], [0, 0, 1]])


def pixels(points, K):
    """By cv2.projectPoints, from the camera's own frame; it knows no skew."""
    return cv2.projectPoints(np.atleast_2d(points), np.zeros(3), np.zeros(3), K, None)[0].reshape(-1, 2)


def sensor_at(f, s):
    """v of the thin lens, from 1/f = 1/s + 1/v."""
    return 1 / (1 / f - 1 / s)


def resized(c, s):
    """Edges stay: the distance from -0.5 scales."""
    return s * (c + 0.5) - 0.5


# The balloon and the dolly zoom --------------------------------------------------------------------------------------


def test_a_globe_at_three_metres_a_wall_behind_it_and_a_balloon_behind_the_wall(says):
    says("A red balloon now hangs behind the right end of the wall. The bricks hide it.")
    view = IntrinsicsView()
    camera = view.camera.centre
    (wall,) = {tuple(towards_balloon(camera))}
    assert GLOBE[2] - camera[2] == pytest.approx(3)
    assert GLOBE[2] < wall[2] < BALLOON[2]
    says("the red line of sight ends at the wall")


def test_no_lens_shows_the_balloon_and_the_ring_lies_on_bricks(says):
    says("Wide or narrow, left or right: wherever the ring is in the picture, it lies on bricks.")
    says("zooming does not move the camera")
    controls = IntrinsicsView.controls()
    for name in ("focal_px", "cx"):
        for value in np.linspace(controls[name].low, controls[name].high, 7):
            view = IntrinsicsView.alone().but(**{name: float(value)})
            assert view.in_sight() == 0
            assert (view.camera.centre == IntrinsicsView().camera.centre).all()
    assert np.isfinite(towards_balloon(IntrinsicsView().camera.centre)).all()


def test_the_lock_keeps_the_globe_and_lets_what_is_behind_it_grow(says):
    near, far = says("Pull distance slowly from 3 m to 12 m.")
    for slow, quick in (
        says("pull the distance slowly from 3 m to 12 m and say nothing"),
        says("pull distance slowly from 3 m to 12 m, and say nothing"),
        says("then walk from 3 m to 12 m, with the dolly-zoom lock off and on"),
    ):
        assert (slow.value, quick.value) == (near.value, far.value)
    says("the globe keeps its size and all behind it grows")
    behind, added = says("For the cat on the wall, 3.17 m behind it, the depth is Z + 3.17:")
    (cat,) = [surface for surface in textured_scene().surfaces if surface.name == "picture"]
    assert behind == cat.corner[2] - GLOBE[2]
    assert added == behind.value
    sizes, globes = {}, []
    for distance in (near.value, far.value):
        f = 450 * distance / near.value
        globe, behind_it = (
            np.array([[-GLOBE_RADIUS, 0, distance], [GLOBE_RADIUS, 0, distance]]),
            distance + behind.value,
        )
        left, right = pixels(globe, matrix(f, f))
        globes.append(right[0] - left[0])
        left, right = pixels([[-0.6, 0, behind_it], [0.75, 0, behind_it]], matrix(f, f))
        sizes[distance] = right[0] - left[0]
    assert sizes[far.value] > sizes[near.value]
    assert globes == pytest.approx([81, 81])


def test_the_balloon_comes_out_at_the_same_distance_whatever_the_lens(says):
    says("The balloon comes out, and at the same distance with the lock on or off.")
    for distance in (3.0, 6.0, 12.0):
        locked = IntrinsicsView(dolly_zoom=True).but(distance=distance)
        free = IntrinsicsView().but(distance=distance)
        assert locked.fx == pytest.approx(150 * distance)
        assert free.fx == 450
        assert locked.in_sight() == free.in_sight() == balloon_in_sight(np.array([0, 0, GLOBE[2] - distance]))
    assert locked.in_sight() == 1


def test_the_middle_of_a_wide_picture_is_the_long_lens_s(says):
    says("Cut the middle out of a wide picture and enlarge it: it has the perspective of the long lens's picture")
    points = np.random.default_rng(1).uniform((-0.1, -0.1, 2), (0.1, 0.1, 9), (50, 3))
    wide, long = pixels(points, matrix(450, 450)), pixels(points, matrix(1800, 1800))
    centre = np.array([319.5, 239.5])
    np.testing.assert_allclose(long - centre, 4 * (wide - centre), atol=1e-9)


# The nine numbers ----------------------------------------------------------------------------------------------------


def test_four_entries_are_fixed_and_a_fifth_is_nearly_always_zero(says):
    says("Of the nine numbers, four are always 0, 0, 0 and 1, and one, s, is nearly always 0.")
    K = IntrinsicsView(fx=500, fy=400, cx=300, cy=200, skew=30).taken.K
    assert K[[1, 2, 2, 2], [0, 0, 1, 2]].tolist() == [0, 0, 0, 1]
    says("reads four entries of K and never looks at the skew")
    point, K = [[0.3, 0.2, 2.0]], matrix(500, 400, 300, 200)
    for row, column in ((0, 0), (1, 1), (0, 2), (1, 2)):
        changed = K.copy()
        changed[row, column] += 10
        assert np.abs(pixels(point, changed) - pixels(point, K)).max() > 0.5
    np.testing.assert_array_equal(pixels(point, matrix(500, 400, 300, 200, 30)), pixels(point, K))


def test_cx_shifts_and_fx_stretches_sideways_only(says):
    says("cx and cy shift it.")
    says("fx stretches the picture sideways only; fy does so up and down.")
    points = np.random.default_rng(2).uniform((-1, -1, 1), (1, 1, 5), (20, 3))
    before = pixels(points, matrix())
    np.testing.assert_allclose(pixels(points, matrix(cx=300, cy=200)) - before, np.tile([-19.5, -39.5], (20, 1)))
    stretched = pixels(points, matrix(fx=900))
    np.testing.assert_allclose(stretched - [319.5, 0], (before - [319.5, 0]) * [2, 1])
    stretched = pixels(points, matrix(fy=900))
    np.testing.assert_allclose(stretched - [0, 239.5], (before - [0, 239.5]) * [1, 2])


def test_skew_moves_a_pixel_in_proportion_to_its_row_and_leans_by_its_arctangent(says):
    says("moves every pixel sideways in proportion to its row: uprights lean, levels stay level")
    K, upright = matrix(600, 600, skew=3), np.array([[0.2, y, 1.0] for y in (-0.2, 0, 0.4)])
    moved = (upright @ K.T)[:, :2] - (upright @ matrix(600, 600).T)[:, :2]
    np.testing.assert_allclose(moved[:, 0], 3 * upright[:, 1])
    np.testing.assert_array_equal(moved[:, 1], 0)
    says("rows and columns that are not perpendicular, by atan(s/fx)")
    along_row, along_column = np.linalg.inv(matrix(600, 500, skew=3))[:, :2].T
    cosine = along_row @ along_column / np.linalg.norm(along_row) / np.linalg.norm(along_column)
    assert np.arccos(cosine) - np.pi / 2 == pytest.approx(np.arctan(3 / 600))
    says("(The lattice enlarges this lean three times.)")
    leans = []
    for skew in (0.0, 3.0):
        drawn = IntrinsicsView(panels="picture pixels", skew=skew).figure(draft=True).body
        path = re.search(r'<path d="([^"]*)" class="green thick"', drawn.split('data-panel="lattice"')[1])[1]
        (x0, y0), (x1, y1) = np.array(re.findall(r"-?[\d.]+", path), dtype=float).reshape(-1, 2)[:2]
        leans.append((x1 - x0) / (y1 - y0))
    assert leans == pytest.approx([0, -3 * 3 / 450], abs=2e-3)


def test_pixel_width_over_height_is_fy_over_fx(says):
    fx, fy = says("fx = 800 and fy = 1000, one lens. What shape are the pixels?")
    (wide,) = says("Wider than high: width / height = 1.25.")
    (high,) = says("Higher than wide: width / height = 0.8.")
    f_mm = 5.0
    assert wide == (f_mm / fx.value) / (f_mm / fy.value)
    assert high == fx.value / fy.value
    *_, aspect = cv2.calibrationMatrixValues(matrix(fx.value, fy.value), (640, 480), 1.0, 1.0)
    assert aspect == fy.value / fx.value


def test_the_focal_length_in_pixels_takes_a_pixel_s_width_to_be_millimetres(says):
    (f,) = says("A calibration says fx = fy = 1000.")
    (not_mm,) = says("1000 mm.")
    assert not_mm.value == f.value
    pitch, mm, small, less = says("With pixels of 5 µm this is 5 mm, with pixels of 2 µm it is 2 mm")
    again, same = says("One needs the pixel size for that; with 5 µm it is 5 mm.")
    assert mm == f.value * pitch.value / 1000
    assert less == f.value * small.value / 1000
    assert same == f.value * again.value / 1000


def test_k_holds_the_place_of_the_sensor_at_the_focus_setting(says):
    says("it holds the distance from lens to sensor, in pixels, at the focus setting of the calibration")
    f, v = says("a thin 50 mm lens focused at one metre has its sensor 52.6 mm behind it")
    assert v == sensor_at(f.value, 1000)
    per_cent, f = says("f in pixels grows: by 5 % for a thin 50 mm lens focused at one metre")
    assert per_cent == 100 * (sensor_at(f.value, 1000) / f.value - 1)
    says("Only when it is focused at infinity.")
    assert sensor_at(50, 1e12) == pytest.approx(50)
    assert sensor_at(50, 2000) > 50


def test_the_field_of_view_of_a_centred_camera_and_the_half_pixel_at_its_edges(says):
    (two,) = says("With the principal point in the middle it is 2 atan(width / 2f); after a crop it seldom is there.")
    (again,) = says("This is 2 atan(width / 2f), which holds when the principal point is in the middle.")
    low, high = says("With centres at integers, as everywhere in this lesson, the edges lie at −0.5 and width − 0.5")
    (begins,) = says("the picture begins at −0.5, half a pixel before column 0")
    assert low.value == begins.value == -0.5
    assert high.value == 0.5
    for cx, centred in ((319.5, True), (250.0, False)):
        edges = np.linalg.inv(matrix(500, 500, cx)) @ [[low.value, 640 - high.value], [239.5, 239.5], [1, 1]]
        (a, b), lengths = edges.T, np.linalg.norm(edges, axis=0)
        angle = np.arccos(a @ b / lengths.prod())
        assert (angle == pytest.approx(two.value * np.arctan(640 / (2 * 500)))) == centred
        from_corner = matrix(500, 500, cx + 0.5, 240)
        assert np.degrees(angle) == pytest.approx(cv2.calibrationMatrixValues(from_corner, (640, 480), 1, 1)[0])
    assert again.value == two.value


# What is done to the picture -----------------------------------------------------------------------------------------


def test_a_crop_renumbers_pixels_and_leaves_rays(says):
    width, height, whole, high, column, row = says(
        "You cut a window of 320 × 240 pixels out of a photograph of 640 × 480, beginning at column 256 and row 96."
    )
    photo = np.arange(whole.value * high.value).reshape(int(high.value), int(whole.value))
    x0, y0 = int(column.value), int(row.value)
    window = photo[y0 : y0 + int(height.value), x0 : x0 + int(width.value)]
    assert window.shape == (height.value, width.value)
    old, new = says("The ray that arrived at column 300 arrives at column 44 now.")
    assert new == np.flatnonzero(window[0] == photo[y0, int(old.value)])[0]
    (farther,) = says("you would believe that every ray came from 256 columns farther left")
    assert farther == old.value - new.value
    right, down = says("Only the principal point moves: cx − 256 and cy − 96.")
    assert right.value == column.value
    assert down.value == row.value
    says("f stays, the width is halved")
    assert width.value == whole.value / 2


def test_resizing_keeps_edges_and_moves_centres(says):
    width, cx, half = says("A picture 640 pixels wide, with cx = 319.5 in its very middle, is resized to 320 pixels.")
    assert cx == np.arange(width.value).mean()
    middle = np.arange(half.value).mean()
    (answer,) = says("159.5.")
    assert answer == middle == resized(cx.value, half.value / width.value)
    wrong, of = says("159.75, half of 319.5.")
    assert wrong == of.value / 2
    count, last, at = says("But the middle of 320 pixels, numbered 0 … 319, is 159.5.")
    assert last == np.arange(count.value)[-1]
    assert at == middle
    edge, s, from_edge, back, same = says("at −0.5. So c + ½ scales, and c′ = s (c + ½) − ½ = 0.5 · 320 − 0.5 = 159.5.")
    assert edge == resized(-0.5, s.value)
    assert from_edge == cx.value + 0.5
    assert back == -edge.value
    assert same == s.value * from_edge.value - back.value
    says("A quarter of a pixel sounds little")
    assert wrong.value - answer.value == 0.25
    (corner,) = says("160.")
    (before,) = says("Counted so, cx was 320 before. With centres at integers both numbers are half a pixel less.")
    assert corner == answer.value + 0.5
    assert before == cx.value + 0.5


def test_what_the_exercise_about_resizing_says_of_a_row_of_640(says):
    width, middle, wrong, half, right = says(
        "The middle of a 640-pixel row, 319.5, becomes 159.75 when halved, but the middle of 320 pixels is 159.5"
    )
    assert middle == np.arange(width.value).mean()
    assert wrong == middle.value / 2
    assert half == width.value / 2
    assert right == np.arange(half.value).mean()
    cx, halved = says("Halving a picture with cx = 319.5 gives 159.5, as it must.")
    assert halved == resized(cx.value, 0.5)
    stays, to = says("Resizing keeps the image's edges where they are: −0.5 must go to −0.5.")
    assert to == resized(stays.value, 0.37)


def test_binning_is_resizing(says):
    n, s = says("Binned by 4 and resized by 0.25 leave the same K.")
    first_block = np.arange(n.value).mean()  # the middle of the first n pixels becomes pixel 0
    assert resized(first_block, s.value) == pytest.approx(0)
    assert s == 1 / n.value
    low, high = says(
        "Pixels are counted from the centre of the first one, so the picture spans −0.5 … width − 0.5. Resizing keeps"
    )
    assert low == resized(low.value, s.value)
    assert resized(640 - high.value, s.value) == 160 - high.value


def test_the_middle_of_the_globe_by_hand(says):
    right, below, away = says(
        "The middle of the globe is 0.68 m to the right of the axis, 0.36 m below it and 3 m away."
    )
    np.testing.assert_allclose([right.value, below.value], GLOBE[:2])
    K = matrix(600, 580, 330, 250)
    np.testing.assert_allclose(pixels([right.value, below.value, away.value], K)[0], [466.0, 319.6], atol=0.05)


def test_the_view_is_widest_with_the_principal_point_in_the_middle(says):
    (width,) = says("Here is your answer for pictures 640 pixels wide")
    says("The angle is largest with the principal point in the middle.")
    views = [
        cv2.calibrationMatrixValues(matrix(600, 600, cx + 0.5), (int(width.value), 480), 1, 1)[0]
        for cx in np.arange(-640, 1280, 0.5)
    ]
    assert np.arange(-640, 1280, 0.5)[np.argmax(views)] == (width.value - 1) / 2


def test_the_eye_in_the_portrait(says):
    """By finding it: the darkest spot near the place, in the whole portrait and in the binned region."""
    x0, y0, n, m = says("a region that begins at (160, 60), binned 4 × 4")
    u, v = says("One eye is at pixel (202, 100) of the whole portrait.")
    assert n.value == m.value
    grey = cv2.GaussianBlur(photograph("astronaut").mean(axis=-1), (0, 0), 2)
    around = grey[90:111, 190:215]
    row, column = np.unravel_index(around.argmin(), around.shape)
    assert np.hypot(column + 190 - u.value, row + 90 - v.value) < 3
    place = (np.array([u.value - x0.value, v.value - y0.value]) + 0.5) / n.value - 0.5  # edges stay where they are
    small = grey[60:260, 160:360].reshape(50, 4, 50, 4).mean(axis=(1, 3))
    row, column = np.unravel_index(small[7:13, 7:14].argmin(), (6, 7))
    assert np.hypot(column + 7 - place[0], row + 7 - place[1]) < 1


def test_cv2_resize_follows_the_half_pixel_rule(says):
    quarter, error = says(
        "Without the half-pixel term, the principal point of a picture resized by 0.25 is wrong by 0.375 px."
    )
    assert error == abs(resized(255.5, quarter.value) - quarter.value * 255.5)
    s, ramp = 0.5, np.tile(np.arange(16, dtype=np.float32), (16, 1))
    small = cv2.resize(ramp, (8, 8), interpolation=cv2.INTER_LINEAR)
    columns = np.arange(8)
    np.testing.assert_allclose(resized(small[0], s), columns, atol=1e-6)  # value = column of the large picture
    np.testing.assert_allclose(s * small[0] - columns, 0.25, atol=1e-6)


def test_other_programs_count_from_the_corner_or_from_one(says):
    column, row = says("| COLMAP, nerfstudio | (0.5, 0.5) | subtract ½ from cx and cy |")
    corner, middle = says(
        "COLMAP calls the centre of the first pixel (0.5, 0.5), and MATLAB (1, 1): subtract ½ or 1 from"
    )
    assert (corner.value, middle.value) == (column.value, row.value)
    assert column.value == row.value == 0.5  # half a pixel from the corner of the first pixel to its centre
    (theirs,) = says("COLMAP says cx = 320.0 for a picture.")
    (ours,) = says("319.5.")
    (not_converted,) = says("320.0: a principal point is a principal point.")
    (added,) = says("320.5.")
    (centre,) = says("COLMAP puts the centre of the first pixel at 0.5, OpenCV at 0: subtract one half.")
    (again,) = says("COLMAP calls it 0.5, OpenCV 0.")
    assert ours == theirs.value - centre.value
    assert not_converted.value == theirs.value
    assert added == theirs.value + again.value


def test_the_teacher_s_four_squares(says):
    third, fourth, middle, merged = says(
        "Draw four squares in a row, number their centres 0 1 2 3, and ask where the middle is (1.5). "
        "Merge them two by two: centres 0 and 1, middle 0.5."
    )
    assert (third.value, fourth.value) == (2, 3)
    assert middle == np.arange(4).mean()
    assert merged == np.arange(2).mean()
    start, end, edge, stays = says("ask for the rule that takes 1.5 to 0.5 and the left edge −0.5 to −0.5")
    assert end == resized(start.value, 0.5)
    assert stays == resized(edge.value, 0.5)


def test_the_shape_of_any_number_of_pixels(says):
    (two,) = says("for pixels of any shape (..., 2) and any K")
    rows, columns = says("Write each as a 3×3 matrix: what is done first stands nearest to K.")
    assert two.value == len(["u", "v"])
    assert (rows.value, columns.value) == matrix().shape


# Published cameras ---------------------------------------------------------------------------------------------------


def test_opencv_s_left_camera(says, samples):
    file = cv2.FileStorage(str(samples / "left_intrinsics.yml"), cv2.FILE_STORAGE_READ)
    K = file.getNode("camera_matrix").mat()
    (view,) = says("K alone gives the [field of view](00_start_here.ipynb#field-of-view), 62°, and no lens.")
    from_corner = K + [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]]
    assert view == cv2.calibrationMatrixValues(from_corner, (640, 480), 1, 1)[0]
    third, wide, mm, on_sale = says(
        'If this is a "1/3 inch" sensor, 4.8 mm wide, the lens is a 4.02 mm one, and 4 mm is'
    )
    assert 18 / third.value == pytest.approx(
        np.hypot(wide.value, 0.75 * wide.value)
    )  # an "inch" of a small sensor: 18 mm
    assert mm == K[0, 0] * wide.value / 640
    assert on_sale == mm.value
    (sold,) = says("find the pixel width that makes the lens a 4 mm one")
    assert sold.value == on_sale.value
    f, across, down = says("Write on the board: fx = 535.9 px, 640 × 480 pixels.")
    assert f == K[0, 0]
    assert (across.value, down.value) == (640, 480)
    (pitch,) = says("Turn pixel width to 7.5 µm.")
    assert pitch == 1000 * wide.value / 640
    off, off_mm = says("Its principal point is 23 pixels off the middle, which would be 0.17 mm on that sensor.")
    distance = np.hypot(K[0, 2] - 319.5, K[1, 2] - 239.5)
    assert off == distance
    assert off_mm == distance * pitch.value / 1000


def test_a_small_turn_moves_the_picture_as_cx_does(says):
    says("a small turn of the camera moves the picture in nearly the same way")
    K = matrix(536, 536)
    board = np.array([[x, y, 1.0] for x in np.linspace(-0.2, 0.2, 9) for y in np.linspace(-0.15, 0.15, 6)])
    turn = cv2.Rodrigues(np.array([0, -23 / 536, 0]))[0]
    moved = pixels(board @ turn.T, K) - pixels(board, K)
    shift = moved.mean(axis=0)
    assert abs(shift[0]) > 20
    assert np.abs(moved - shift).max() < 0.1 * abs(shift[0])


def test_a_frame_of_film(says):
    width, height, diagonal = says("The frame is 36 × 24 mm, 43.27 mm across the diagonal.")
    assert diagonal == np.hypot(width.value, height.value)
    says("good to some per cent")
    assert np.isclose(0.5 / 26, 0.02, atol=0.001)  # EXIF keeps whole millimetres


# Before the lesson ---------------------------------------------------------------------------------------------------


def test_before_the_lesson_what_skew_is(says):
    fx, skew, _ = row = says(
        "The first row of K reads 800, 8, 320, where the second number, the skew, is nearly always 0."
    )
    K = matrix(row[0].value, 800.0, row[2].value, 240.0, row[1].value)
    columns = np.linalg.inv(K)[:2, :2] @ np.array([[1.0, 0.0], [0.0, 1.0]])  # a step to the right and a step down
    angle = np.degrees(np.arccos(columns[:, 0] @ columns[:, 1] / np.prod(np.linalg.norm(columns, axis=0))))
    (off,) = says("they are off by about 0.6°")
    assert off == abs(angle - 90)
    a, b, exactly = says("Yes, by atan(8/800) = 0.57°.")
    assert (a.value, b.value) == (skew.value, fx.value)
    assert exactly == abs(angle - 90)


def test_before_the_lesson_what_leaves_k_alone(says):
    (near,) = says("You have turned the focus ring from 1 m to infinity.")
    f, percent = says("for a thin 35 mm lens by 3.5 %")
    assert percent == 100 * (1 - f.value / sensor_at(f.value, 1000 * near.value))
    (turn,) = says("You have turned the camera on its tripod by 90°.")
    axis = np.radians(turn.value) * np.array([0, 1.0, 0])
    world = np.array([[3.0, 0.2, 0.1]])
    turned = cv2.Rodrigues(axis)[0] @ world[0]  # the pose alone
    np.testing.assert_allclose(
        cv2.projectPoints(world, axis, np.zeros(3), matrix(), None)[0][0], pixels(turned, matrix())
    )


def test_before_the_lesson_two_ways_to_count_pixels(says):
    (first,) = says("One program calls the centre of the first pixel 0.5, another calls it 0.")
    (lamp,) = says("The first program finds a lamp at column 100.0.")
    (column,) = says("At 99.5.")
    assert column == lamp.value - first.value
    (wrong,) = says("At 100.5.")
    assert wrong == lamp.value + first.value
    for (one,) in (says("what one program calls 0.5 the other calls 0"), says("as 0.5 becomes 0")):
        assert one == first.value
    (unmoved,) = says("At 100.0, for the lamp has not moved.")
    assert unmoved == lamp.value


def test_before_the_lesson_the_shape_of_a_pixel(says):
    shape, fy = says("A camera has an ordinary lens and pixels that are 1.5 times as high as wide. Its fy is 600.")
    height = 0.006
    f = fy.value * height
    (fx,) = says("900.")
    assert fx == f / (height / shape.value)
    (wrong,) = says("400.")
    assert wrong == fy.value / shape.value
    (same,) = says("600 as well: the lens has one focal length.")
    heights, times = says("the same focal length is 600 pixel heights, or 1.5 times as many pixel widths")
    assert [same.value, heights.value, times.value] == [fy.value, fy.value, shape.value]
