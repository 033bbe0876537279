"""What lesson 18 claims about vanishing points, heights and P, recomputed with OpenCV's pixels and plain geometry."""

import ast

import cv2
import numpy as np
import pytest
from claims import claims
from scipy.linalg import rq
from scipy.optimize import brentq

from camviz.cameras import Camera
from camviz.poses import RigidTransform, Rotation
from camviz_school.course import material, notebooks
from camviz_school.samples import SampleUnavailable, sample
from camviz_school.views.house import DOOR, EYE, HEADING_DEG, camera
from camviz_school.views.staff import StaffView
from camviz_school.views.vanishing import VanishingView

says = claims("18")
lesson18 = material.module("18")

CORNERS = np.array([(x, y, z) for x, z in [(-3, 3.3), (-10, 3.3), (-3, 10.3)] for y in (-1.3, 1.6)])
CENTRE, FAR = np.array([319.5, 239.5]), [(-1e9, 0, 0), (0, 0, 1e9)]


def by_opencv(camera, points):
    R, t = camera.extrinsics
    return cv2.projectPoints(np.array(points, dtype=float), cv2.Rodrigues(R)[0], t, camera.intrinsics.K, None)[0][:, 0]


def crossing(lines):
    """Where two lines (2, 2, 2) cross, by two equations for how far along."""
    (a, b), (c, d) = lines
    return a + np.linalg.solve(np.column_stack([b - a, c - d]), c - a)[0] * (b - a)


def focal(lines, centre):
    """The focal length from the lines of both walls, by the right angle at the eye."""
    u, v = (crossing(lines[name]) - centre for name in "xz")
    return np.sqrt(-(u @ v))


def test_a_vanishing_point_is_the_image_of_its_direction():
    says("All edges of the direction d share this point, and a step aside changes neither K nor R.")
    for state in ({}, {"turn_deg": 20.0, "tilt_deg": 5.0}, {"tilt_deg": -6.0, "aside": 1.5}):
        view = VanishingView(**state)
        seen = by_opencv(view.camera, view.camera.centre + FAR)
        np.testing.assert_allclose([view.pixels[name] for name in "xz"], seen, atol=1e-4)
        np.testing.assert_allclose([crossing(view.lines[name]) for name in "xz"], seen, atol=1e-4)
        assert view.focal == pytest.approx(view.camera.intrinsics.fx, rel=1e-9)
        right = lesson18.focal_length(*seen, CENTRE)
        assert right == pytest.approx(view.camera.intrinsics.fx, rel=1e-6)


def test_the_distance_of_two_points_does_not_tell_f():
    """OpenCV's pixels of both directions: the distance changes with the turn, −(q₁ − c)·(q₂ − c) does not."""
    says("At f = 417 px the points are 839 px apart at a turn of 0°, and 1,492 px at 25°.")
    for turn, apart in ((0.0, 839), (25.0, 1492)):
        first, second = by_opencv(camera(turn), FAR)
        assert np.linalg.norm(second - first) == pytest.approx(apart, abs=0.5)
        assert np.sqrt(-(first - CENTRE) @ (second - CENTRE)) == pytest.approx(417, abs=0.5)


def test_any_known_angle_gives_an_equation_for_f():
    """Of directions 60° apart only the true f makes rays 60° apart; at 90° a point at infinity tells none."""
    says("Any known angle gives an equation for f; a right angle gives the short one above.")
    says("For a right angle neither point may lie at infinity.")
    seen, (a, b) = camera(0.0), np.radians((-25, 35))
    rays = np.array([(np.sin(a), 0, np.cos(a)), (np.sin(b), 0, np.cos(b))])
    first, second = by_opencv(seen, 1e9 * rays @ seen.extrinsics[0]) - CENTRE

    def angle(f):
        one, other = np.append(first, f), np.append(second, f)
        return np.degrees(np.arccos(one @ other / np.linalg.norm(one) / np.linalg.norm(other)))

    assert brentq(lambda f: angle(f) - 60, 50, 5000) == pytest.approx(seen.intrinsics.fx)
    square = VanishingView(aside=-3.0, turn_deg=42.0)
    says("The points of its level and of its upright edges are both at infinity")
    np.testing.assert_allclose(square.camera.extrinsics[0][2, :2], 0, atol=1e-9)  # the depths of both directions
    assert np.isnan(square.pixels["x"]).all()
    assert np.isnan(lesson18.focal_length(square.pixels["x"], square.pixels["z"], CENTRE))


def test_how_sure_f_is():
    says("With lines as long as a wall f is within 1 % in all 50 pictures.", "Here are 50 pictures, 1280 pixels wide")
    says("turns four times as much when its ends are off, and f is off by more than 2 % in the worst picture")
    for share, low, high in ((1.0, 0, 0.01), (0.25, 0.02, 1)):
        rng, off = np.random.default_rng(3), []
        for turn, tilt in rng.uniform((-12, -3), (12, 3), (50, 2)):
            view, lines = VanishingView(turn_deg=turn, tilt_deg=tilt), {}
            fine = view.camera.intrinsics.resized(1280, 960)
            for name in "xz":
                seen = fine.to_pixels(view.camera.intrinsics.from_pixels(view.lines[name]))
                seen[:, 1] = seen[:, 0] + share * (seen[:, 1] - seen[:, 0])
                lines[name] = seen + rng.normal(0, 0.5, seen.shape)
            off.append(abs(focal(lines, np.array([fine.cx, fine.cy])) / fine.fx - 1))
        assert low < max(off) < high


def test_heights_at_every_tilt_are_those_of_the_scene():
    says("A staff 1.6 m tall stands on the lawn, too.", "A door of 2 m tells how many metres a camera height is.")
    assert (EYE, DOOR) == (1.6, 2)
    says(r"$$\frac{|\text{foot} \times \text{top}|}{(l \cdot \text{foot})\;|q \times \text{top}|}$$")
    for tilt in (-6.0, 0.0, 6.0):
        for distance, tall in ((5.0, 0.5), (12.0, 2.5), (40.0, 3.0)):
            state = {"distance_m": distance, "staff_m": tall, "tilt_deg": tilt}
            view = StaffView(tilted=True, yours=lesson18.any_height, **state)
            ends = by_opencv(view.camera, [[0.6, EYE, distance], [0.6, EYE - tall, distance]])
            np.testing.assert_allclose(view.staff, ends, atol=1e-8)
            assert float(view.numbers()["the staff, by yours"][:-2]) == pytest.approx(tall, abs=0.005)
            assert (ends[1][1] < view.horizon_row) == (tall > EYE)


def test_three_points_find_the_middle_and_are_delicate():
    says(
        "Someone has cut the left 200 columns off a picture that looks up by 12°.",
        "the three altitudes of the triangle",
    )
    says("At a tilt of 12° the principal point then scatters by 8 px across", "px across and by 3 px down")
    says("At a tilt of 4° it is 25 px across.")
    lines = VanishingView(tilt_deg=12.0, turn_deg=4.0, upright=True).lines
    found = lesson18.principal_point(*(crossing(both) - (200, 0) for both in lines.values()))
    np.testing.assert_allclose(found, CENTRE - (200, 0), atol=1e-6)
    for tilt, scatter in ((12.0, (8, 3)), (4.0, (25,))):
        rng, middles = np.random.default_rng(5), []
        lines = VanishingView(tilt_deg=tilt, upright=True).lines
        for _ in range(400):
            a, b, c = (crossing(both + rng.normal(0, 0.5, both.shape)) for both in lines.values())
            sides = np.array([b - c, c - a, a - b])
            middles.append(np.linalg.lstsq(sides, np.sum(sides * [a, b, c], axis=1), rcond=None)[0])
        assert np.std(middles, axis=0)[: len(scatter)] == pytest.approx(scatter, rel=0.06, abs=0.5)


@pytest.fixture(scope="module")
def read_off():
    """The lines (2, 2, 2) that the lesson's cell has of the photograph: the floors' as x, the uprights' as z."""
    (path,) = material.lessons_folder().glob("18_*.ipynb")
    (cell,) = (cell for cell in notebooks.read(path).cells if cell.id == "building")
    given = dict(line.split(" = ") for line in cell.source.splitlines() if " = [" in line)
    typed = (given[name].partition("#")[0].strip() for name in ("floors", "uprights"))
    return dict(zip("xz", (np.array(ast.literal_eval(lines), dtype=float) for lines in typed), strict=True))


def test_the_photograph_s_focal_length(read_off):
    says("The field of view is that of a lens of 50 mm on film 36 mm wide", "Still f scatters by some 3 % only")
    middle, rng = np.array([433.5, 299.5]), np.random.default_rng(1)
    f = focal(read_off, middle)
    assert f * 36 / 868 == pytest.approx(50, rel=0.02)
    noisy = [{name: both + rng.normal(0, 0.5, both.shape) for name, both in read_off.items()} for _ in range(1000)]
    assert 100 * np.std([focal(lines, middle) for lines in noisy]) / f == pytest.approx(3, abs=0.5)


def test_the_lines_of_the_photograph_are_those_that_opencv_finds(read_off):
    """A line segment detector's edges, some ninety of both directions, give the same focal length."""
    try:
        path = sample("building.jpg")
    except SampleUnavailable as reason:
        pytest.skip(str(reason))
    segments = cv2.createLineSegmentDetector().detect(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))[0].reshape(-1, 2, 2)
    middle, across = np.array([433.5, 299.5]), segments[:, 1] - segments[:, 0]
    angle, length = np.degrees(np.arctan2(across[:, 1], across[:, 0])) % 180, np.linalg.norm(across, axis=1)
    uprights = (abs(angle - 90) < 8) & (length > 40)
    floors = (abs(angle - 159) < 19) & (length > 60) & (segments[:, 0, 1] < 480)
    points = []
    for kind in (floors, uprights):  # where they meet, by least squares with their lengths as weights
        ends = np.concatenate([(segments[kind] - middle) / 500, np.ones((kind.sum(), 2, 1))], axis=2)
        lines = np.cross(ends[:, 0], ends[:, 1])
        x, y, w = np.linalg.svd(lines * (length[kind] / np.linalg.norm(lines[:, :2], axis=1))[:, None])[2][-1]
        points.append(500 * np.array([x, y]) / w)
    assert np.sqrt(-(points[0] @ points[1])) == pytest.approx(focal(read_off, middle), rel=0.03)


def test_the_horizon_tells_how_the_camera_stood():
    """A camera that was turned, tilted and rolled, and OpenCV's pixels of both walls' directions, far away."""
    says("How far it is below the middle of the picture tells the tilt, and how much it slopes tells the roll.")
    for turn, tilt, roll in [(0, 3, 0), (6, -5, 4), (-8, 9, -6)]:
        turned = Rotation.from_euler("YXZ", [HEADING_DEG + turn, tilt, -roll], degrees=True)
        placed = Camera(camera().intrinsics, world_from_cam=RigidTransform.from_components(np.zeros(3), turned))
        first, second = by_opencv(placed, FAR)
        slope = (second[1] - first[1]) / (second[0] - first[0])
        assert slope == pytest.approx(np.tan(np.radians(roll)), abs=1e-6)
        below = (first[1] + slope * (CENTRE[0] - first[0]) - CENTRE[1]) * np.cos(np.radians(roll))
        assert below / placed.intrinsics.fx == pytest.approx(np.tan(np.radians(tilt)), abs=1e-6)


def test_p_from_six_points_is_opencv_s_to_a_billionth():
    says("Where det R comes out as −1, take −P instead: then R is a rotation.")
    seen = camera(0.0, 3.0)
    pixels = by_opencv(seen, CORNERS)
    P = lesson18.camera_matrix(CORNERS, pixels)
    _, turn, t = cv2.solvePnP(CORNERS, pixels, seen.intrinsics.K, None, flags=cv2.SOLVEPNP_SQPNP)
    posed = seen.intrinsics.K @ np.column_stack([cv2.Rodrigues(turn)[0], t])
    scale = np.linalg.norm(posed) * np.sign(np.sum(posed * P))
    np.testing.assert_allclose(P / np.linalg.norm(P), posed / scale, atol=1e-9)
    K, R, centre, *_ = cv2.decomposeProjectionMatrix(P)
    np.testing.assert_allclose((centre[:3] / centre[3]).ravel(), seen.centre, atol=1e-9)
    np.testing.assert_allclose(np.abs(K / K[2, 2]), seen.intrinsics.K, rtol=1e-9, atol=1e-7)
    for sign in (1, -1):
        K, R = rq(sign * posed[:, :3])
        R = np.sign(np.diag(K))[:, None] * R
        assert np.linalg.det(R) == pytest.approx(sign)
        np.testing.assert_allclose(sign * R, seen.extrinsics[0], atol=1e-9)


def test_question_tilted():
    says("You tilt the camera by 6° and use the new horizon. What does it say of a staff of 2.5 m?")
    found, seen = [], StaffView(tilt_deg=6.0).camera
    horizon = 239.5 + seen.intrinsics.fx * np.tan(np.radians(6))
    for z in (5.0, 10.0, 40.0):
        rows = by_opencv(seen, [[0.6, EYE, z], [0.6, EYE - 2.5, z], [-3, EYE, 4.6], [-3, EYE - DOOR, 4.6]])[:, 1]
        eye = DOOR * (rows[2] - horizon) / (rows[2] - rows[3])
        found.append(eye * (rows[0] - rows[1]) / (rows[0] - horizon))
    assert np.ptp(found) > 0.03  # it depends on where the staff stands
    assert np.abs(np.array(found) - 2.5).max() == pytest.approx(0.03, abs=0.01)


def test_questions_cropped_focal_and_horizon():
    says("Someone cuts 200 columns off the left side of a photograph.")
    says(
        "At the same spot of the scene, 100 pixels left of the new middle.",
        "falls by 200, and that of the middle by 100",
    )
    assert (CENTRE[0] - 200) - (640 - 200 - 1) / 2 == -100
    says("900 px apart in the first and 1800 px in the second", "Turning the camera by 5°.")
    apart = [np.subtract(*by_opencv(VanishingView(hfov_deg=fov).camera, FAR)) for fov in (75.0, 50.0)]
    longer = np.tan(np.radians(75 / 2)) / np.tan(np.radians(25))
    assert np.linalg.norm(apart[1]) / np.linalg.norm(apart[0]) == pytest.approx(longer)
    assert np.abs(by_opencv(camera(5.0), FAR[1:]) - by_opencv(camera(0.0), FAR[1:])).max() > 30
    says(
        "at his belt, 1 m above the sand", "the horizon marks 1 m on the pole as well, which is a quarter of it", "4 m"
    )
    says("Your camera is 3 m above a flat field.", "At the height of the camera, 3 m above the field.")
    for z in (40.0, 500.0):  # what is as high as a level camera lies in the horizon's row, however far it is
        assert by_opencv(StaffView().camera, [[0.6, 0, z]])[0, 1] == pytest.approx(StaffView().horizon_row)
