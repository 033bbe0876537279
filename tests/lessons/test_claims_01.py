"""What lesson 01 claims about the pinhole camera, recomputed with OpenCV, NumPy and SciPy."""

from math import erf

import cv2
import numpy as np
import pytest
from claims import claims
from scipy.optimize import minimize_scalar
from scipy.special import jn_zeros

says = claims("01")

GREEN_MM = 550e-6
AIRY = 2 * jn_zeros(1, 1)[0] / np.pi
"""The diameter of the first dark ring in λ f / d, from the first zero of J1."""
K = np.array([[50 / 0.075, 0, 239.5], [0, 50 / 0.075, 179.5], [0, 0, 1]])
"""The matrix of section 2: 50 mm and pixels of 75 µm."""


def on_the_wall(point, f):
    """Where the straight line from a point through the hole, at 0, meets the wall at Z = −f."""
    X, Y, Z = point
    return np.array([X, Y]) * (1 - (Z + f) / Z)


def pixels(points):
    return cv2.projectPoints(np.reshape(points, (-1, 1, 3)).astype(float), np.zeros(3), np.zeros(3), K, None)[0][:, 0]


def blur_mm(d, f=50.0, Z=np.inf):
    """Shadow and Airy disc added in squares, the lesson's rule of thumb."""
    return np.hypot(d * (1 + f / Z), AIRY * GREEN_MM * f / d)


def best_hole_mm(f=50.0):
    return minimize_scalar(lambda d: blur_mm(d, f), bounds=(0.05, 2), method="bounded", options={"xatol": 1e-9}).x


def test_the_image_is_turned_by_180_degrees():
    says("Yes: turned by 180°.", "the image on the wall is (−f X/Z, −f Y/Z)", "twice as far is half as tall")
    says("Turning the picture by 180° takes both minus signs away, and most books write: x = f X/Z")
    point = np.array([0.4, -0.9, 3.0])
    half_turn = cv2.Rodrigues(np.array([0, 0, np.pi]))[0][:2, :2]
    np.testing.assert_allclose(on_the_wall(point, 0.05), half_turn @ (0.05 * point[:2] / point[2]), atol=1e-15)
    np.testing.assert_allclose(on_the_wall(point * [1, 1, 2], 0.05), on_the_wall(point, 0.05) / 2)


def test_one_point_by_hand():
    says("A point lies 30 cm to the right of the axis, 58 cm below it and 3 m away. The box is 50 mm deep:")
    np.testing.assert_allclose(1000 * on_the_wall([0.3, 0.58, 3], 0.05), [-5.0, -9.67], atol=0.005)
    np.testing.assert_allclose(pixels([0.3, 0.58, 3])[0], [306.17, 308.39], atol=0.005)
    says("count f in pixels from the start, 50 mm / 0.075 mm = 667 px")
    assert pytest.approx(667, abs=0.5) == 50 / 0.075
    says("The point twice as far lies half as far from the middle row 179.5.")
    near, far = pixels([[0, 0.58, 3], [0, 0.58, 6]])[:, 1] - 179.5
    assert far == pytest.approx(near / 2)


def test_pixels_count_from_the_centre_of_the_first():
    says("So of 480 columns the last centre is 479, the middle is 239.5, and the picture ends half a pixel beyond,")
    says("at −0.5 and 479.5.")
    columns = np.arange(480.0)
    assert (columns[-1], columns.mean()) == (479, 239.5)
    halved = cv2.resize(np.tile(columns, (2, 1)), (240, 1), interpolation=cv2.INTER_AREA)[0]
    assert halved[0] == 0.5  # OpenCV's first two centres are 0 and 1, so that they end at −0.5 and 1.5


def test_parallel_lines_meet_in_the_image_of_their_direction():
    says("So all lines with direction D run into one pixel, the image K D of the direction")
    says("Lines parallel to the wall, with D_z = 0, have none. They stay parallel in the picture.")
    starts = np.array([[2.05, -0.7, 5.4], [2.05, 1.25, 5.4], [-3.0, 0.2, 1.0]])
    D, across = np.array([0.3, -0.1, 1.0]), np.array([1.0, 0.4, 0.0])
    np.testing.assert_allclose(pixels(starts + 1e9 * D), np.tile((K @ D)[:2] / D[2], (3, 1)), atol=1e-4)
    steps = pixels(starts + across) - pixels(starts)
    np.testing.assert_allclose(steps[:, 1], 0.4 * steps[:, 0])


def test_the_best_hole_is_as_wide_as_its_airy_disc():
    says("which is 2.44 λ f/d wide; λ is the wavelength, 550 nm for green", "≈ 1.56 √(f λ), 0.26 mm here")
    assert pytest.approx(2.44, abs=5e-3) == AIRY
    best = best_hole_mm()
    assert best == pytest.approx(AIRY * GREEN_MM * 50 / best, rel=1e-6)
    assert best == pytest.approx(0.26, abs=5e-3)
    assert best / np.sqrt(50 * GREEN_MM) == pytest.approx(1.56, abs=5e-3)
    says("Young (1971) found 2, a hole that is just one Fresnel zone", "For our box that is 0.33 mm.")
    rim = np.sqrt(GREEN_MM * 50)
    assert 2 * rim == pytest.approx(0.33, abs=5e-3)
    assert np.hypot(50, rim) - 50 == pytest.approx(GREEN_MM / 2, rel=1e-4)  # half a wavelength farther to go
    says("The curve is flat there: from 0.26 mm to 0.33 mm, the blue band in the visualizer, the blur changes by 6 %.")
    assert 100 * (blur_mm(2 * rim) / blur_mm(best) - 1) == pytest.approx(6, abs=0.5)


def test_the_details_on_the_wall():
    says("36 mm of wall by 0.37 mm of blur are about a hundred details side by side.")
    says("The picture has 480 pixels in a row; four in five of them only repeat their neighbours.")
    spot = blur_mm(best_hole_mm())
    assert spot == pytest.approx(0.37, abs=5e-3)
    assert 36 / spot == pytest.approx(100, rel=0.02)
    assert 1 - 36 / spot / 480 == pytest.approx(4 / 5, abs=0.01)


def test_the_photographed_board_tells_a_right_angle_and_f(samples):
    says("published f = 535.9 px, the principal point (342.3, 235.6) and the bend of the lens")
    file = cv2.FileStorage(str(samples / "left_intrinsics.yml"), cv2.FILE_STORAGE_READ)
    published, bend = file.getNode("camera_matrix").mat(), file.getNode("distortion_coefficients").mat()
    assert published[[0, 0, 1], [0, 2, 2]] == pytest.approx([535.9, 342.3, 235.6], abs=0.05)
    says("From the board's 54 inner corners `cv2.solvePnP` finds how it is turned and moved", "Half a pixel remains.")
    grey = cv2.imread(str(samples / "left08.jpg"), cv2.IMREAD_GRAYSCALE)
    corners = cv2.cornerSubPix(grey, cv2.findChessboardCorners(grey, (9, 6))[1], (5, 5), (-1, -1), (3, 40, 1e-3))
    board = np.array([[column, row, 0.0] for row in range(6) for column in range(9)])
    straight = cv2.undistortPoints(corners, published, bend, criteria=(3, 200, 1e-12))
    _, rotation, t = cv2.solvePnP(board, straight, np.eye(3), None)
    missed = cv2.projectPoints(board, rotation, t, np.eye(3), None)[0] - straight
    assert 535.9 * np.linalg.norm(missed, axis=-1).max() == pytest.approx(0.5, abs=0.1)
    says("A right angle, to a tenth of a degree or two")
    says("So this photograph of a right angle measures the focal length to about one per cent")
    a, b, c, d = (np.append(straight.reshape(6, 9, 2)[i, j], 1) for i in (0, -1) for j in (0, -1))
    rows, columns = np.cross(np.cross(a, b), np.cross(c, d)), np.cross(np.cross(a, c), np.cross(b, d))
    assert np.degrees(np.arccos(rows @ columns / np.linalg.norm(rows) / np.linalg.norm(columns))) == pytest.approx(
        90, abs=0.2
    )
    v1, v2 = (one[:2] / one[2] for one in (rows, columns))
    assert np.sqrt(-v1 @ v2) == pytest.approx(1, rel=0.012)


# The numbers of the questions ----------------------------------------------------------------------------------------


def test_question_hole():
    says("The box is 50 mm deep, its hole 0.3 mm wide. You replace the hole by one of 0.1 mm, a third of the width")
    says("so the exposure is nine times as long", "a smaller hole is sharper only down to about 0.26 mm")
    assert pytest.approx(9) == (0.3 / 0.1) ** 2
    says("what is 3 m away is blurred by about 680 µm instead of 380 µm")
    assert 1000 * blur_mm(0.1, Z=3000) == pytest.approx(680, rel=0.01)
    assert 1000 * blur_mm(0.3, Z=3000) == pytest.approx(380, rel=0.01)
    says("an Airy disc 2.44 λ f / d wide. It grows as the hole shrinks, here from 224 µm to 671 µm")
    assert [1000 * AIRY * GREEN_MM * 50 / d for d in (0.3, 0.1)] == pytest.approx([224, 671], abs=0.5)


def test_question_ray():
    says("one pixel, 40 px to the right of the principal point and 30 px below it", "the direction (40, 30, f)")
    says("(40, 30, f), twice that and ten times that all land there")
    seen = pixels(np.outer([1, 2, 10, 3.8e8], [40, 30, K[0, 0]])) - K[:2, 2]
    np.testing.assert_allclose(seen, np.tile([40, 30], (4, 1)), atol=1e-9)
    says("From twice as far, a quarter of the light comes through the hole, onto a quarter of the area.")
    says("Only a thing whose image is smaller than the blur, such as a star, gets dimmer.")
    star, wall = ([erf(width / 10 / 2**0.5) ** 2 for width in widths] for widths in ((1.0, 0.5), (200, 100)))
    assert star[1] / star[0] == pytest.approx(1 / 4, rel=0.02)  # the middle of a square after a Gaussian blur of 5 px
    assert wall[1] / wall[0] == pytest.approx(1)


def test_questions_homogeneous():
    says("Which pixel is the homogeneous vector (600, 400, 2)?", "(600, 400, 2) and (300, 200, 1) are the same pixel")
    says("Any multiple, such as (1200, 800, 4), is the same pixel", "(640, 480, 4) and (160, 120, 1) are one pixel")
    says("(300, 200).", "A program writes the place of a pixel as three numbers: (640, 480, 4).", "At (160, 120).")
    says("640/4 is 160 and 480/4 is 120", "The 4 is a divisor and no label")
    vectors = np.array([[[600.0, 400, 2], [1200, 800, 4], [640, 480, 4]]])
    seen = cv2.convertPointsFromHomogeneous(vectors[0])[:, 0]
    np.testing.assert_array_equal(seen, [[300, 200], [300, 200], [160, 120]])


def test_question_first_depth_of_field():
    says("A camera with a hole 0.3 mm wide and no lens photographs a flower 1 m away and a church 100 m away.")
    says("In a box 50 mm deep its shadow is 0.315 mm wide for the flower and 0.300 mm for the church.")
    flower, church = (0.3 * (Z + 50) / Z for Z in (1000, 100_000))  # similar triangles from the point through the hole
    assert (flower, church) == pytest.approx((0.315, 0.300), abs=5e-4)
    says("the two spots differ by a twentieth only")
    assert flower / church == pytest.approx(1 + 1 / 20, abs=0.001)


def test_questions_vanishing():
    says("You walk 20 m to the side and photograph it again", "Farther along, your 20 m matter less and less")
    moved = [np.ptp(pixels([[0, 1.6, Z], [-20, 1.6, Z]])[:, 0]) for Z in (10, 100, 1e4, 1e9)]
    assert (np.diff(moved) < 0).all()
    assert moved[-1] < 1e-3
    says("Only for lines along the optical axis. Any other direction vanishes elsewhere, often outside the picture.")
    np.testing.assert_allclose(pixels([0, 0, 1e9])[0], [239.5, 179.5])
