"""What lesson 03 claims about intrinsics, recomputed with OpenCV and NumPy."""

import cv2
import numpy as np
import pytest
from claims import claims

from camviz_school.views.balloon import balloon_in_sight
from camviz_school.views.camera_matrix import GLOBE
from camviz_school.views.intrinsics import IntrinsicsView

says = claims("03")


def matrix(fx=450.0, fy=450.0, cx=319.5, cy=239.5, skew=0.0):
    return np.array([[fx, skew, cx], [0, fy, cy], [0, 0, 1]])


def pixels(points, K):
    return cv2.projectPoints(np.atleast_2d(points), np.zeros(3), np.zeros(3), K, None)[0].reshape(-1, 2)


def sensor_at(f, s):
    """The distance v from lens to sensor by 1/f = 1/s + 1/v."""
    return 1 / (1 / f - 1 / s)


def resized(c, s):
    """A coordinate after resizing by s, which keeps the image's edges: the distance from −0.5 scales."""
    return s * (c + 0.5) - 0.5


def opencv_view_deg(K, width=640, height=480):
    """OpenCV counts the principal point from the corner."""
    return cv2.calibrationMatrixValues(K + [[0, 0, 0.5], [0, 0, 0.5], [0, 0, 0]], (width, height), 1, 1)[0]


def angle_deg(a, b):
    return np.degrees(np.arccos(a @ b / np.linalg.norm(a) / np.linalg.norm(b)))


def test_only_a_moved_camera_sees_the_balloon():
    says("The balloon comes out, and at the same distance with the lock on or off.")
    says("Wide or narrow, left or right: wherever the ring is in the picture, it lies on bricks.")
    for distance in (3.0, 6.0, 12.0):
        locked, free = (IntrinsicsView(dolly_zoom=lock).but(distance=distance) for lock in (True, False))
        assert locked.in_sight() == free.in_sight() == balloon_in_sight(np.array([0, 0, GLOBE[2] - distance]))
    assert locked.in_sight() == 1
    assert all(IntrinsicsView.alone().but(focal_px=f).in_sight() == 0 for f in (150.0, 450.0, 1800.0))


def test_k_holds_the_distance_to_the_sensor_in_pixels():
    says("K counts the distance f from lens to sensor in pixels", "Focused at infinity, f is the lens's focal length.")
    says("it holds the distance from lens to sensor, in pixels, at the focus setting of the calibration")
    says("a thin 50 mm lens focused at one metre has its sensor 52.6 mm behind it")
    assert sensor_at(50, 1000) == pytest.approx(52.6, abs=0.05)
    assert sensor_at(50, 1e12) == pytest.approx(50)


def test_skew_leans_uprights_by_its_arctangent():
    says("moves every pixel sideways in proportion to its row: uprights lean, levels stay level")
    says("rows and columns that are not perpendicular, by atan(s/fx)")
    along_row, along_column = np.linalg.inv(matrix(600, 500, skew=3))[:, :2].T
    assert angle_deg(along_row, along_column) - 90 == pytest.approx(np.degrees(np.arctan(3 / 600)))
    upright = np.array([[0.2, y, 1.0] for y in (-0.2, 0, 0.4)])
    moved = upright @ (matrix(skew=3) - matrix()).T
    np.testing.assert_allclose(moved[:, :2], np.outer(3 * upright[:, 1], [1, 0]))


def test_the_field_of_view_counts_from_half_a_pixel_outside():
    says("With the principal point in the middle it is 2 atan(width / 2f); after a crop it seldom is there.")
    says("Pixels are counted from the centre of the first one, so the picture spans −0.5 … width − 0.5.")
    for cx, centred in ((319.5, True), (250.0, False)):
        left, right = (np.linalg.inv(matrix(500, 500, cx)) @ [[-0.5, 639.5], [239.5, 239.5], [1, 1]]).T
        assert angle_deg(left, right) == pytest.approx(opencv_view_deg(matrix(500, 500, cx)))
        assert (angle_deg(left, right) == pytest.approx(2 * np.degrees(np.arctan(640 / 1000)))) == centred
    says("The angle is largest with the principal point in the middle.")
    places = np.arange(-640, 1280, 0.5)
    assert places[np.argmax([opencv_view_deg(matrix(600, 600, cx)) for cx in places])] == 319.5


def test_binning_and_resizing_keep_the_image_s_edges():
    says("averages blocks of pixels or adds them up. **Binned** by 4 and **resized** by 0.25 leave the same K.")
    assert resized(np.arange(4).mean(), 0.25) == 0  # the middle of the first 4 pixels becomes pixel 0
    says("Without the half-pixel term, the principal point of a picture resized by 0.25 is wrong by 0.375 px.")
    assert resized(255.5, 0.25) - 0.25 * 255.5 == -0.375
    ramp = np.tile(np.arange(16, dtype=np.float32), (16, 1))  # its value is its column
    halved = cv2.resize(ramp, (8, 8), interpolation=cv2.INTER_LINEAR)
    np.testing.assert_allclose(resized(halved[0], 0.5), np.arange(8), atol=1e-6)


def test_opencv_s_left_camera(samples):
    file = cv2.FileStorage(str(samples / "left_intrinsics.yml"), cv2.FILE_STORAGE_READ)
    K = file.getNode("camera_matrix").mat()
    says("K alone gives the [field of view](00_start_here.ipynb#field-of-view), 62°, and no lens.")
    assert opencv_view_deg(K) == pytest.approx(62, abs=0.5)
    says('If this is a "1/3 inch" sensor, 4.8 mm wide, the lens is a 4.02 mm one, and 4 mm is')
    assert K[0, 0] * 4.8 / 640 == pytest.approx(4.02, abs=5e-3)
    says(
        "Turn **pixel width** to 7.5 µm.", "Its principal point is 23 pixels off the middle, which would be 0.17 mm on"
    )
    assert 1000 * 4.8 / 640 == 7.5
    off = np.hypot(K[0, 2] - 319.5, K[1, 2] - 239.5)
    assert [off, 100 * off * 0.0075] == pytest.approx([23, 17], abs=0.5)
    says("a small turn of the camera moves the picture in nearly the same way")
    board = np.array([[x, y, 1.0] for x in np.linspace(-0.2, 0.2, 9) for y in np.linspace(-0.15, 0.15, 6)])
    turn = cv2.Rodrigues(np.array([0, -off / 536, 0]))[0]
    moved = pixels(board @ turn.T, matrix(536, 536)) - pixels(board, matrix(536, 536))
    assert np.abs(moved - moved.mean(axis=0)).max() < 0.1 * np.abs(moved.mean(axis=0)[0])


# The numbers of the questions ----------------------------------------------------------------------------------------


def test_questions_on_focus_and_millimetres():
    says("A calibration says fx = fy = 1000.", "With pixels of 5 µm this is 5 mm, with pixels of 2 µm it is 2 mm")
    says("One needs the pixel size for that; with 5 µm it is 5 mm.")
    assert [1000 * 0.005, 1000 * 0.002] == [5, 2]
    says("by 5 % for a thin 50 mm lens focused at one metre", "from 1 m to infinity", "for a thin 35 mm lens by 3.5 %")
    assert 100 * (sensor_at(50, 1000) / 50 - 1) == pytest.approx(5, abs=0.5)
    assert 100 * (1 - 35 / sensor_at(35, 1000)) == pytest.approx(3.5, abs=0.05)


def test_question_crop():
    says("You cut a window of 320 × 240 pixels out of a photograph of 640 × 480, beginning at column 256 and row 96.")
    says("The ray that arrived at column 300 arrives at column 44 now.", "cx − 256 and cy − 96")
    says("you would believe that every ray came from 256 columns farther left")
    photo = np.arange(640 * 480).reshape(480, 640)
    window = photo[96 : 96 + 240, 256 : 256 + 320]
    assert window[0, 44] == photo[96, 300]


def test_question_resize():
    says("A picture 640 pixels wide, with cx = 319.5 in its very middle, is resized to 320 pixels.")
    says("the middle of 320 pixels, numbered 0 … 319, is 159.5", "c′ = s (c + ½) − ½ = 0.5 · 320 − 0.5 = 159.5")
    says("159.5.", "what stays in place is the *edge* of the image, at −0.5", "160.", "Counted so, cx was 320 before.")
    assert resized(319.5, 0.5) == np.arange(320).mean() == 159.5
    assert 0.5 * 320 == 160  # from the corner
    says("159.75, half of 319.5.", "A quarter of a pixel sounds little", "c′ = s c + (s − 1)/2")
    assert 319.5 / 2 - 159.5 == 0.25
    assert resized(319.5, 0.5) == 0.5 * 319.5 + (0.5 - 1) / 2


def test_questions_on_where_pixels_count_from():
    says("COLMAP says cx = 320.0 for a picture.", "COLMAP puts the centre of the first pixel at 0.5, OpenCV at 0")
    says("The first program finds a lamp at column 100.0.", "At 99.5.", "MATLAB puts it at 1: there, subtract 1")
    says("319.5.", "320.5.", "At 100.5.", "One program calls the centre of the first pixel 0.5, another calls it 0.")
    corner_of_first_pixel = -0.5
    assert [one + corner_of_first_pixel for one in (320.0, 100.0)] == [319.5, 99.5]


def test_questions_on_the_shape_of_a_pixel():
    says("fx = 800 and fy = 1000, one lens.", "Wider than high: width / height = 1.25.", "width / height = 0.8")
    assert cv2.calibrationMatrixValues(matrix(800, 1000), (640, 480), 1, 1)[-1] == 1000 / 800 == 1.25
    says("pixels that are 1.5 times as high as wide. Its fy is 600.", "900.", "400.", "600 pixel heights, or 1.5 times")
    assert cv2.calibrationMatrixValues(matrix(900, 600), (640, 480), 1, 1)[-1] == pytest.approx(1 / 1.5)
    says("The first row of K reads 800, 8, 320", "Yes, by atan(8/800) = 0.57°.", "they are off by about 0.6°")
    right, down = np.linalg.inv(matrix(800, 800, 320, 240, 8))[:, :2].T
    assert angle_deg(right, down) - 90 == pytest.approx(0.57, abs=5e-3)
