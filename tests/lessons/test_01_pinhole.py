"""What lesson 01 says about the pinhole camera, recomputed with NumPy, SciPy and OpenCV."""

import math

import cv2
import numpy as np
import pytest
from scipy.optimize import minimize_scalar
from scipy.special import jn_zeros

from camviz.cameras import Camera, Intrinsics
from camviz_school.views.pinhole import PinholeView

EXCEPTIONS = {
    "found 1.9": "Rayleigh's own choice of 1891, which no formula gives exactly",
    "Rayleigh's constant, 1.9": "Rayleigh's own choice of 1891, which no formula gives exactly",
}

GREEN = 550e-6
"""Millimetres."""
FIRST_DARK_RING = 2 * jn_zeros(1, 1)[0] / np.pi
"""Of the Airy pattern: its diameter in λ f / d, from the first zero of J1."""
K = np.array([[50 / 0.075, 0, 239.5], [0, 50 / 0.075, 179.5], [0, 0, 1]])
"""The matrix of section 2: 50 mm and pixels of 75 µm."""


def on_the_wall(point, f):
    """Where the straight line from a point through the hole meets the wall at Z = −f."""
    X, Y, Z = point
    s = (Z + f) / Z  # along the line: the point at 0, the hole at 1
    return np.array([X - s * X, Y - s * Y])


def opencv_s(points, matrix=K):
    return cv2.projectPoints(np.asarray(points, float).reshape(-1, 1, 3), np.zeros(3), np.zeros(3), matrix, None)[0][
        :, 0
    ]


def blur(d, f=50.0, Z=np.inf):
    """Shadow and Airy disc added in squares, the lesson's rule of thumb; millimetres."""
    return np.hypot(d * (1 + f / Z), FIRST_DARK_RING * GREEN * f / d)


def best(f=50.0):
    return minimize_scalar(lambda d: blur(d, f), bounds=(0.05, 2), method="bounded", options={"xatol": 1e-9}).x


def test_the_picture_on_the_wall_is_turned_by_half_a_turn(says):
    turns = [
        *says("Yes: turned by 180°."),
        *says("Turning the picture by 180° takes both minus signs away, and most books write: x = f X/Z"),
    ]
    turns += says("This is the image on the back wall, turned by 180°.")
    says("the image on the wall is (−f X/Z, −f Y/Z)")
    says("It is upside down, and left and right are exchanged.")
    point = np.array([0.4, -0.9, 3.0])
    wall = on_the_wall(point, 0.05)
    np.testing.assert_allclose(wall, -0.05 * point[:2] / point[2])
    for turn in turns:
        angle = np.radians(turn.value)
        turned = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]] @ (0.05 * point[:2] / point[2])
        np.testing.assert_allclose(wall, turned, atol=1e-15)


def test_seen_from_inside_left_and_right_look_unchanged(says):
    says("with your back to the garden, left and right do look unchanged")
    thing = on_the_wall((1.0, 0.0, 4.0), 0.05)
    facing_the_wall, down = np.array([0, 0, -1]), np.array([0, 1, 0])
    right_hand = np.cross(down, facing_the_wall)  # x = y × z, also for someone who looks along −Z
    assert np.array([*thing, 0]) @ right_hand > 0


def test_twice_as_far_is_half_as_tall_and_a_deeper_box_waits_longer(says):
    says("twice as far is half as tall")
    says("A deeper box (depth f) makes a larger picture, and less of the garden fits on the wall.")
    says(
        "The deeper the box, the longer the hole has to stay open, "
        "because the same light is spread over a larger picture."
    )
    near, far = (np.ptp([on_the_wall((0, y, z), 0.05)[1] for y in (-0.58, 0.58)]) for z in (3.0, 6.0))
    assert far == pytest.approx(near / 2)
    shallow, deep = (PinholeView(depth_mm=f, match_exposure=True) for f in (50.0, 100.0))
    assert deep.exposed_s / shallow.exposed_s == pytest.approx(
        4
    )  # a picture of twice the width has four times the area
    assert deep.camera().intrinsics.fx == pytest.approx(2 * shallow.camera().intrinsics.fx)


def test_one_point_by_hand(says):
    right, below, away, depth = says(
        "A point lies 30 cm to the right of the axis, 58 cm below it and 3 m away. The box is 50 mm deep:"
    )
    point = np.array([right.value / 100, below.value / 100, away.value])
    np.testing.assert_allclose(1000 * on_the_wall(point, depth.value / 1000), [-5.0, -9.67], atol=0.005)
    np.testing.assert_allclose(opencv_s([point])[0], [306.17, 308.39], atol=0.005)
    f_mm, pixel_mm, f = says("count f in pixels from the start, 50 mm / 0.075 mm = 667 px")
    assert f == f_mm.value / pixel_mm.value
    says("The width of a pixel only ever divides the focal length.")


def test_the_board_s_points_land_on_the_corners_of_the_photograph(says, samples):
    (count,) = says("From the board's 54 inner corners `cv2.solvePnP` finds how it is turned and moved")
    (drawn,) = says("The blue dots are the board's 54 corners")
    says("Half a pixel remains.")
    file = cv2.FileStorage(str(samples / "left_intrinsics.yml"), cv2.FILE_STORAGE_READ)
    matrix, bend = file.getNode("camera_matrix").mat(), file.getNode("distortion_coefficients").mat()
    grey = cv2.undistort(cv2.imread(str(samples / "left08.jpg"), cv2.IMREAD_GRAYSCALE), matrix, bend)
    _, corners = cv2.findChessboardCorners(grey, (9, 6))
    corners = cv2.cornerSubPix(grey, corners, (5, 5), (-1, -1), (3, 40, 1e-3)).reshape(-1, 2)
    squares = np.array([[column, row, 0.0] for row in range(6) for column in range(9)])
    _, turn, move = cv2.solvePnP(squares, corners, matrix, None)
    again = cv2.projectPoints(squares, turn, move, matrix, None)[0].reshape(-1, 2)
    assert len(corners) == count.value == drawn.value
    assert np.linalg.norm(again - corners, axis=-1).max() == pytest.approx(0.5, abs=0.1)


def test_posts_that_were_passed_are_drawn_on_the_other_side_upside_down(says):
    says("posts that you have already passed stand on the right, upside down")
    top, foot = (K[:2, :2] @ np.array([-1.0, y]) / -2.4 for y in (-0.4, 1.25))  # the bare equation at Z = −2.4
    assert top[0] > 0
    assert top[1] > foot[1]


def test_half_as_far_from_the_middle_row(says):
    (row,) = says("The point twice as far lies half as far from the middle row 179.5.")
    (_, second), (_, third) = opencv_s([[0, 0.58, 3], [0, 0.58, 6]])
    assert third - row.value == pytest.approx((second - row.value) / 2)
    assert row == (360 - 1) / 2


def test_turning_the_box_changes_a_point_s_coordinates(says):
    says("Turn the box, and they change though nothing in the world has moved.")
    turned = cv2.Rodrigues(np.array([0.2, 0.3, 0.1]))[0] @ [1.0, 0.5, 4.0]
    assert (np.abs(turned - [1.0, 0.5, 4.0]) > 0.05).all()


def test_parallel_lines_meet_in_the_image_of_their_direction(says):
    says("Lamps and feet run into one pixel")
    says("It is not the middle of the picture. Which pixel is it?")
    says("So all lines with direction D run into one pixel, the image K D of the direction")
    turned = cv2.Rodrigues(np.array([0.1, -0.2, 0.0]))[0]
    ends = opencv_s(np.array([[2.05, -0.70, 1e9], [2.05, 1.25, 1e9]]) @ turned.T)
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-4)
    assert np.linalg.norm(ends[0] - K[:2, 2]) > 100
    says("The farther along you go, the less A matters")
    starts, direction = np.array([[2.05, -0.7, 5.4], [2.05, 1.25, 5.4], [-3.0, 0.2, 1.0]]), np.array([0.3, -0.1, 1.0])
    far = opencv_s(starts + 1e9 * direction)
    np.testing.assert_allclose(far, np.tile(K[:2] @ direction / direction[2], (3, 1)), atol=1e-4)
    says("The point on our line is (A + s D, 1)")
    says("Divide by s, and it is (A/s + D, 1/s).")
    says("what is left is (D, 0)")
    s = 1e12
    np.testing.assert_allclose(np.append(starts[0] + s * direction, 1) / s, [*direction, 0], atol=1e-10)


def test_lines_parallel_to_the_wall_stay_parallel(says):
    says("Lines parallel to the wall, with D_z = 0, have none. They stay parallel in the picture.")
    says(
        "in the picture they meet in an ordinary pixel, the image of their direction, "
        "unless they are parallel to the wall"
    )
    direction = np.array([1.0, 0.4, 0.0])
    steps = [np.diff(opencv_s([start, start + direction]), axis=0)[0] for start in np.array([[0, 0, 2], [1, -1, 7.0]])]
    assert steps[0][0] * steps[1][1] == pytest.approx(steps[0][1] * steps[1][0])


def test_a_vanishing_point_does_not_depend_on_where_the_camera_stands_but_on_how_it_is_turned(says):
    says("where the camera stands drops out, how it is turned does not")
    direction = np.array([0.2, 0.0, 1.0])
    here, there, turned = np.zeros(3), np.array([5.0, -1.0, 2.0]), cv2.Rodrigues(np.array([0, 0.2, 0.0]))[0]
    ends = opencv_s([1e9 * direction - here, 1e9 * direction - there, turned @ (1e9 * direction)])
    np.testing.assert_allclose(ends[0], ends[1], atol=1e-4)
    assert np.linalg.norm(ends[2] - ends[0]) > 50
    says("Only for lines along the optical axis. Any other direction vanishes elsewhere, often outside the picture.")
    np.testing.assert_allclose(opencv_s([[0, 0, 1e9]])[0], [239.5, 179.5])


def test_all_points_of_a_ray_share_a_pixel_and_so_does_what_is_behind(says):
    right, below = says("The picture has one pixel, 40 px to the right of the principal point and 30 px below it")
    x, y = says("(40, 30, f), twice that and ten times that all land there")
    again_x, again_y = says("A pixel is a ray, the direction (40, 30, f), and everything along it shares that pixel")
    f = K[0, 0]
    for one, other in ((x, y), (again_x, again_y)):
        pixels = opencv_s(np.outer([1, 2, 10, 3.8e8], [one.value, other.value, f]))
        np.testing.assert_allclose(pixels - K[:2, 2], np.tile([right.value, below.value], (4, 1)), atol=1e-9)
    says("The last line is behind the hole: the equation gives a pixel even to what is behind the camera")
    says("from here to the Moon it is one pixel")
    behind = -np.array([40.0, 30.0, f])
    np.testing.assert_allclose(f * behind[:2] / behind[2], [40, 30])
    says("in camviz a point without an image is NaN (not a number)")
    camera = Camera(Intrinsics(480, 360, f, f, 239.5, 179.5))
    assert np.isnan(camera.project(behind)).all()
    assert np.isnan(camera.project([1.0, 0.0, 0.0])).all()


def test_each_pixel_of_a_thing_is_as_bright_from_twice_as_far(says):
    says("a quarter of the light comes through the hole, onto a quarter of the area")
    light, area = (1 / 2) ** 2, np.ptp([on_the_wall((x, 0, 4), 0.05)[0] for x in (0, 1)]) ** 2
    assert light / (area / np.ptp([on_the_wall((x, 0, 2), 0.05)[0] for x in (0, 1)]) ** 2) == pytest.approx(1)


def test_a_thing_smaller_than_the_blur_gets_dimmer_with_its_distance(says):
    """An image 5 px wide after blurring, of a square at two distances: its middle is compared."""
    says("Only a thing whose image is smaller than the blur, such as a star, gets dimmer.")

    def middle(width_px):  # what a Gaussian blur of 5 px leaves of an evenly bright strip, squared for two directions
        return math.erf(width_px / 2 / 5 / math.sqrt(2)) ** 2

    assert middle(0.5) / middle(1.0) == pytest.approx(1 / 4, rel=0.02)  # a star at twice the distance
    assert middle(100) / middle(200) == pytest.approx(1)  # a wall


def test_where_the_first_pixel_is_and_where_the_picture_ends(says):
    columns, last, middle, begins, ends = says(
        "So of 480 columns the last centre is 479, the middle is 239.5, and the picture ends half a pixel beyond, "
        "at −0.5 and 479.5."
    )
    centres = np.arange(columns.value)
    assert last == centres[-1]
    assert middle == centres.mean()
    assert (begins.value, ends.value) == (centres[0] - 0.5, centres[-1] + 0.5)
    blurred = cv2.resize(np.tile(centres, (2, 1)), (240, 1), interpolation=cv2.INTER_AREA)[0]  # OpenCV's halving
    assert blurred[0] == 0.5  # the centre of the first two lies between 0 and 1


def test_the_f_number_of_the_box(says):
    says("under This box is the depth of the box divided by the width of its hole.")
    view = PinholeView(hole_mm=0.4, depth_mm=60)
    assert view.numbers()["f-number"] == f"f/{60 / 0.4:.0f}"


def test_the_airy_disc(says):
    *constants, green = says(
        "an [Airy disc](00_start_here.ipynb#airy-disc), which is 2.44 λ f/d wide; λ is the wavelength, 550 nm for green"
    )
    assert green == GREEN * 1e6
    constants += says("Equal widths mean d = 2.44 λ f/d, so d = √(2.44 λ f)")
    constants += says("Set the two widths equal, d = 2.44 λ f / d")
    constants += says("it is d² that equals 2.44 λ f") + says("The 2.44 stands under the root")
    constants += says("The 2.44 is missing.") + says("Both stand in 2.44 λ f")
    assert all(one == FIRST_DARK_RING for one in constants)
    radius, diameter = says(
        "1.22 λ f / d is the radius of the Airy disc. d is a diameter: compare it with 2.44 λ f / d."
    )
    assert radius == FIRST_DARK_RING / 2
    assert diameter == FIRST_DARK_RING


def test_the_best_hole_is_as_wide_as_its_airy_disc(says):
    constant, width = says("≈ 1.56 √(f λ), 0.26 mm here")
    assert best() == pytest.approx(FIRST_DARK_RING * GREEN * 50 / best(), rel=1e-6)
    assert constant == best() / np.sqrt(50 * GREEN)
    assert width == best()
    f, width, constant, young, other = says(
        "For 50 mm and green light that is 0.26 mm, or 1.56 √(f λ). With Young's constant, 2, it would be 0.33 mm."
    )
    assert width == best(f.value)
    assert constant == best(f.value) / np.sqrt(f.value * GREEN)
    assert other == young.value * np.sqrt(f.value * GREEN)
    (lowest,) = says("a smaller hole is sharper only down to about 0.26 mm")
    assert lowest == best()
    (from_,) = says("down to about 1.56 … 2 √(f λ)")
    assert from_ == np.sqrt(FIRST_DARK_RING)
    says("In a deeper box the light spreads on for longer, so the best hole is wider.")
    assert best(100.0) > best(50.0)


def test_a_hole_of_one_fresnel_zone(says):
    (here,) = says("You will meet other constants than 1.56.")
    assert here == np.sqrt(FIRST_DARK_RING)
    young, width = says(
        "Young (1971) found 2, a hole that is just one Fresnel zone: light from its rim has half a wavelength "
        "farther to go than light through its middle. For our box that is 0.33 mm."
    )
    assert width == young.value * np.sqrt(50 * GREEN)
    rim = young.value * np.sqrt(50 * GREEN) / 2
    assert np.hypot(50, rim) - 50 == pytest.approx(GREEN / 2, rel=1e-4)
    (again,) = says("This is Young's constant, 2, for another notion of sharpness.")
    assert again == young.value
    says("√(λ f) is the radius of one Fresnel zone")
    assert rim == pytest.approx(np.sqrt(GREEN * 50))


def test_the_curve_is_flat_between_the_constants(says):
    low, high, change = says(
        "The curve is flat there: from 0.26 mm to 0.33 mm, the blue band in the visualizer, the blur changes by 6 %."
    )
    assert low == best()
    assert high == 2 * np.sqrt(50 * GREEN)
    assert change == 100 * (blur(2 * np.sqrt(50 * GREEN)) / blur(best()) - 1)


def test_the_details_on_the_wall(says):
    wall, spot, pixels = says(
        "36 mm of wall by 0.37 mm of blur are about a hundred details side by side. The picture has 480 pixels in a "
        "row; four in five of them only repeat their neighbours."
    )
    assert spot == blur(best())
    assert wall.value / blur(best()) == pytest.approx(100, rel=0.02)
    assert 1 - wall.value / blur(best()) / pixels.value == pytest.approx(4 / 5, abs=0.01)


def test_a_third_of_the_hole(says):
    depth, wide, narrow = says(
        "The box is 50 mm deep, its hole 0.3 mm wide. You replace the hole by one of 0.1 mm, a third of the width"
    )
    says("so the exposure is nine times as long. And the waves spread three times as far")
    assert (wide.value / narrow.value) ** 2 == pytest.approx(9)
    distance, worse, before = says("what is 3 m away is blurred by about 680 µm instead of 380 µm")
    assert worse.about(1000 * blur(narrow.value, depth.value, 1000 * distance.value), 0.01)
    assert before.about(1000 * blur(wide.value, depth.value, 1000 * distance.value), 0.01)
    constant, small, large = says(
        "an Airy disc 2.44 λ f / d wide. It grows as the hole shrinks, here from 224 µm to 671 µm"
    )
    assert constant == FIRST_DARK_RING
    assert small == 1000 * FIRST_DARK_RING * GREEN * depth.value / wide.value
    assert large == 1000 * FIRST_DARK_RING * GREEN * depth.value / narrow.value


def test_the_picture_made_by_waves_is_sharpest_there_too(says):
    (hole,) = says(
        "Move hole d from end to end: the picture is sharpest at about 0.25 mm and gets worse on either side."
    )

    def detail(d):
        picture = PinholeView(hole_mm=d, match_exposure=True, noise=False).image(320)
        return cv2.Laplacian(cv2.cvtColor(picture, cv2.COLOR_RGB2GRAY).astype(float), cv2.CV_64F).std()

    holes = np.array([0.1, 0.15, 0.2, 0.25, 0.3, 0.35, 0.4, 0.8])
    sharpness = np.array([detail(d) for d in holes])
    assert hole.about(holes[sharpness.argmax()], 0.2)
    peak = sharpness.argmax()
    assert (np.diff(sharpness[: peak + 1]) > 0).all()
    assert (np.diff(sharpness[peak:]) < 0).all()


def test_near_and_far_are_about_equally_blurred(says):
    says("Near and far are about equally sharp: in our box, one metre and infinity differ by a twentieth at most.")
    differences = [blur(d, Z=1000) / blur(d) - 1 for d in (0.1, 0.3, 1.0)]
    assert max(differences) == pytest.approx(1 / 20, abs=0.001)
    says("Only what is as near as a few depths of the box is noticeably softer.")
    assert blur(1.0, Z=3 * 50) > 1.25 * blur(1.0)
    says("The blur is everywhere about as wide as the hole, until the hole is so small that diffraction takes over.")
    assert blur(1.0, Z=1000) == pytest.approx(1.0, rel=0.1)
    assert blur(0.05) > 10 * 0.05


def test_light_grows_with_the_square_of_the_hole(says):
    says("a narrow one makes it dark: the light grows with d²")
    assert PinholeView(hole_mm=0.6).brightness == pytest.approx(4 * PinholeView(hole_mm=0.3).brightness)


def test_units_of_the_wavelength(says):
    (power,) = says("A nanometre is 10⁻⁶ mm, so the wavelength needs a factor of its own.")
    factor, power_again = says(
        "This is 1000 times too large. Either the wavelength still counts in nanometres, or your answer is in µm: "
        "a nanometre is 10⁻⁶ mm"
    )
    assert power.value == power_again.value == 10
    assert factor == np.sqrt(power.value**6)  # d goes with the root of the wavelength


def test_homogeneous_pixels(says):
    vector = [one.value for one in says("Which pixel is the homogeneous vector (600, 400, 2)?")]
    u, v = says("(300, 200).")
    assert u == vector[0] / vector[2]
    assert v == vector[1] / vector[2]
    *first, x, y = says("(600, 400, 2) and (300, 200, 1) are the same pixel")
    np.testing.assert_allclose(np.cross([one.value for one in first], [x.value, y.value, 1]), 0)
    *undivided, depth = says("(600, 400), at depth 2.")
    assert [one.value for one in (*undivided, depth)] == vector
    multiple = [one.value for one in says("Any multiple, such as (1200, 800, 4), is the same pixel")]
    np.testing.assert_allclose(np.cross(multiple, vector), 0)
    at_infinity = says("lets (600, 400, 0) stand for a direction")
    assert [one.value for one in at_infinity] == vector[:2]


def test_points_on_both_sides_of_the_hole(says):
    front, x, z = says("Put in (1, 0, 2), the point behind the camera on the same line, (−1, 0, −2)")
    np.testing.assert_allclose(np.cross([1, 0, front.value], [x.value, 0, z.value]), 0)
    assert z.value < 0
    says("(1, 0, 0), which lies beside the hole")


def test_the_shapes_of_the_exercises(says):
    (points,) = says("without a matrix, for any number of `points` of shape (..., 3) in front of the camera")
    (lines,) = says("The vanishing point of lines along `direction`, (..., 3), in camera coordinates.")
    ray, pixel = says("the unit direction (..., 3) in camera coordinates in which each pixel (..., 2) looks")
    assert all(one == K.shape[0] for one in (points, lines, ray))
    assert pixel == opencv_s([[0, 0, 1]]).shape[-1]


def test_what_was_published_for_the_chessboard_s_camera(says, samples):
    f, cx, cy = says("published f = 535.9 px, the principal point (342.3, 235.6) and the bend of the lens")
    file = cv2.FileStorage(str(samples / "left_intrinsics.yml"), cv2.FILE_STORAGE_READ)
    matrix = file.getNode("camera_matrix").mat()
    assert f == matrix[0, 0]
    assert cx == matrix[0, 2]
    assert cy == matrix[1, 2]
    says("A calibration of all thirteen pictures")
    assert file.getNode("nframes").real() == 13


def board_s_directions(samples):
    """The vanishing points of the rows and columns of the board in the lesson's photograph, by OpenCV and lines."""
    file = cv2.FileStorage(str(samples / "left_intrinsics.yml"), cv2.FILE_STORAGE_READ)
    matrix, bend = file.getNode("camera_matrix").mat(), file.getNode("distortion_coefficients").mat()
    grey = cv2.imread(str(samples / "left08.jpg"), cv2.IMREAD_GRAYSCALE)
    _, corners = cv2.findChessboardCorners(grey, (9, 6))
    corners = cv2.cornerSubPix(grey, corners.reshape(-1, 1, 2), (5, 5), (-1, -1), (3, 40, 1e-3))
    straight = cv2.undistortPoints(corners, matrix, bend, criteria=(3, 200, 1e-12)).reshape(6, 9, 2)
    points = cv2.convertPointsToHomogeneous(straight.reshape(-1, 2)).reshape(6, 9, 3)

    def meet(a, b, c, d):
        return np.cross(np.cross(a, b), np.cross(c, d))

    corner = points[0, 0], points[0, -1], points[-1, 0], points[-1, -1]
    rows = meet(corner[0], corner[1], corner[2], corner[3])
    columns = meet(corner[0], corner[2], corner[1], corner[3])
    return rows, columns, matrix


def test_rows_and_columns_of_the_board_are_at_right_angles_in_space(says, samples):
    (right,) = says("If we know that the angle is 90°, the photograph tells the focal length")
    says("A right angle, to a tenth of a degree or two")
    rows, columns, matrix = board_s_directions(samples)
    cosine = rows @ columns / np.linalg.norm(rows) / np.linalg.norm(columns)
    assert np.degrees(np.arccos(cosine)) == pytest.approx(right.value, abs=0.2)
    v1, v2 = (matrix[0, 0] * one[:2] / one[2] for one in (rows, columns))
    says("So this photograph of a right angle measures the focal length to about one per cent")
    assert np.sqrt(-v1 @ v2) == pytest.approx(matrix[0, 0], rel=0.012)


def test_a_board_held_squarely_tells_no_focal_length(says):
    """Two vanishing points of boards whose corners are off by 0.1 px, by how far the board leans about both axes."""
    says("because the board is held far aslant. Held squarely to the camera, it would tell nothing.")
    rng, square = np.random.default_rng(0), np.array([[x, y, 0.0] for y in (-2.5, 2.5) for x in (-4, 4)])

    def off(lean_deg):
        turn = cv2.Rodrigues(np.radians([lean_deg, 0.9 * lean_deg, 0]))[0]
        corners = cv2.projectPoints(square @ turn.T + [0, 0, 14], np.zeros(3), np.zeros(3), K, None)[0][:, 0]
        found = []
        for _ in range(300):
            a, b, c, d = np.c_[corners + rng.normal(0, 0.1, (4, 2)) - K[:2, 2], np.ones(4)]
            meet = [np.cross(np.cross(*one), np.cross(*other)) for one, other in (((a, b), (c, d)), ((a, c), (b, d)))]
            v1, v2 = (v[:2] / v[2] for v in meet)
            found.append(np.sqrt(np.maximum(-v1 @ v2, 0)) / K[0, 0] - 1)
        return np.median(np.abs(found))

    assert off(30) < 0.01
    assert off(0) > 0.5


def test_vanishing_points_need_no_focal_length(says):
    says("The two circles lie where straight lines in the picture meet. No focal length was used for them.")
    board = np.array([[0, 0, 0], [8, 0, 0], [0, 5, 0], [8, 5, 0.0]])
    pixels = cv2.projectPoints(board, np.array([0.4, 0.5, 0.1]), np.array([-4.0, -2.0, 20]), K, None)[0][:, 0]
    lines = np.column_stack([pixels, np.ones(4)])
    met = np.cross(np.cross(lines[0], lines[1]), np.cross(lines[2], lines[3]))
    direction = cv2.Rodrigues(np.array([0.4, 0.5, 0.1]))[0][:, 0]
    np.testing.assert_allclose(met[:2] / met[2], (K @ direction)[:2] / direction[2])


def test_a_door_calibrates_a_phone(says):
    says("f = pixels · Z / height")
    top, bottom = opencv_s([[0, -1.0, 4.0], [0, 1.0, 4.0]])
    assert (bottom - top)[1] * 4.0 / 2.0 == pytest.approx(K[1, 1])


# Before the lesson ---------------------------------------------------------------------------------------------------


def test_before_the_lesson_what_a_hole_shows_sharply(says):
    d, near, far = says(
        "A camera with a hole 0.3 mm wide and no lens photographs a flower 1 m away and a church 100 m away."
    )
    box, flower, church = says(
        "In a box 50 mm deep its shadow is 0.315 mm wide for the flower and 0.300 mm for the church."
    )
    for one, Z in ((flower, near.value), (church, far.value)):
        rims = [
            on_the_wall([0, 0, 1000 * Z], box.value)[0] + side * d.value / 2 * (1 + box.value / (1000 * Z))
            for side in (-1, 1)
        ]
        assert one == rims[1] - rims[0]
    says("the two spots differ by a twentieth only")
    assert flower.value / church.value == pytest.approx(1 + 1 / 20, abs=0.001)
    assert (
        min(blur(d.value, box.value, 1000 * Z.value) for Z in (near, far)) > d.value
    )  # "at least as wide as the hole"


def test_before_the_lesson_a_homogeneous_pixel(says):
    x, y, w = says("A program writes the place of a pixel as three numbers: (640, 480, 4).")
    pixel = cv2.convertPointsFromHomogeneous(np.array([[x.value, y.value, w.value]]))[0, 0]
    u, v = says("At (160, 120).")
    assert u == pixel[0]
    assert v == pixel[1]
    a, n, u, b, m, v = says("640/4 is 160 and 480/4 is 120")
    assert u == a.value / n.value
    assert v == b.value / m.value
    wrong = says("At (640, 480); the 4 says how far away the point is.")
    same = says("(640, 480, 4) and (160, 120, 1) are one pixel")
    (divisor,) = says("The 4 is a divisor and no label:")
    assert divisor == w.value
    assert [one.value for one in wrong] == [one.value for one in same[:3]] == [x.value, y.value, w.value]
    np.testing.assert_allclose(pixel, [one.value for one in same[3:]])


def test_before_the_lesson_a_walk_does_not_move_a_vanishing_point(says):
    (walk,) = says("You walk 20 m to the side and photograph it again")
    (again,) = says("Farther along, your 20 m matter less and less")
    assert again == walk.value
    shift = [np.ptp(opencv_s([[0, 1.6, Z], [-walk.value, 1.6, Z]])[:, 0]) for Z in (10, 100, 1e4, 1e9)]
    assert all(np.diff(shift) < 0)
    assert shift[-1] < 1e-3


def test_the_curve_that_a_teacher_draws_on_the_board(says):
    depth, narrow, high, lowest, low, wide, up, last = says(
        "For a box 50 mm deep draw the blur over the hole's width, both in mm: (0.1, 0.68), (0.26, 0.37), (0.5, 0.52), "
        "(1, 1.00)."
    )
    assert lowest == best(depth.value)
    assert low == blur(best(depth.value), depth.value)
    assert high == blur(narrow.value, depth.value)
    assert up == blur(wide.value, depth.value)
    assert last == blur(1.0, depth.value)
