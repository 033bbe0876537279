"""Lesson 18: vanishing points, the focal length, heights and P, each beside OpenCV or plain geometry."""

import ast

import cv2
import numpy as np
import pytest
from quoting import LESSONS
from scipy.linalg import rq
from scipy.optimize import brentq

from camviz.cameras import Camera
from camviz.poses import RigidTransform, Rotation
from camviz_school.course import notebooks
from camviz_school.course.exercises import exercise
from camviz_school.samples import SampleUnavailable, sample
from camviz_school.views.house import DOOR, EYE, HEADING_DEG, camera, edges
from camviz_school.views.staff import StaffView
from camviz_school.views.vanishing import VanishingView

EXCEPTIONS: dict[str, str] = {}

CORNERS = np.array([(x, y, z) for x, z in [(-3, 3.3), (-10, 3.3), (-3, 10.3)] for y in (-1.3, 1.6)])


def by_opencv(camera, points):
    """Pixels (n, 2) of points (n, 3)."""
    R, t = camera.extrinsics
    uv, _ = cv2.projectPoints(np.array(points, dtype=float), cv2.Rodrigues(R)[0], t, camera.intrinsics.K, None)
    return uv[:, 0]


def crossing(lines):
    """Where two lines (2, 2, 2) cross, by two equations for how far along."""
    (a, b), (c, d) = lines
    along, _ = np.linalg.solve(np.column_stack([b - a, c - d]), c - a)
    return a + along * (b - a)


def focal(lines, centre):
    """The focal length from the lines of both walls, by the right angle at the eye."""
    u, v = (crossing(lines[name]) - centre for name in "xz")
    return np.sqrt(-(u @ v))


def focal_errors(share, pictures=50, width=1280, noise=0.5, seed=3):
    """How far f is off, relatively, by two lines over a share of each wall, their ends off by `noise` px."""
    rng, off = np.random.default_rng(seed), []
    for turn, tilt in rng.uniform((-12, -3), (12, 3), (pictures, 2)):
        view = VanishingView(turn_deg=turn, tilt_deg=tilt)
        fine = view.camera.intrinsics.resized(width, width * 3 // 4)
        lines = {}
        for name in "xz":
            seen = fine.to_pixels(view.camera.intrinsics.from_pixels(view.lines[name]))  # as far as the picture goes
            seen[:, 1] = seen[:, 0] + share * (seen[:, 1] - seen[:, 0])
            lines[name] = seen + rng.normal(0, noise, seen.shape)
        off.append(abs(focal(lines, np.array([fine.cx, fine.cy])) / fine.fx - 1))
    return np.array(off)


# The oracles ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("state", [{}, {"turn_deg": 20.0, "tilt_deg": 5.0}, {"tilt_deg": -6.0, "aside": 1.5}])
def test_a_vanishing_point_is_where_opencv_sees_the_edge_s_end_a_billion_metres_away(state):
    view = VanishingView(**state)
    for name, direction in (("x", (-1e9, 0, 0)), ("z", (0, 0, 1e9))):
        far = view.camera.centre + direction
        np.testing.assert_allclose(view.pixels[name], by_opencv(view.camera, [far])[0], atol=1e-4)
    assert view.focal == pytest.approx(view.camera.intrinsics.fx, rel=1e-9)
    assert view.tilt == pytest.approx(state.get("tilt_deg", 0), abs=1e-7)


def test_k_from_vanishing_points_of_50_pictures_is_within_1_percent_and_nan_where_two_lie_at_infinity():
    assert focal_errors(1.0).max() < 0.01
    right = exercise("18.focal_length").reference
    square = VanishingView(aside=-3.0, turn_deg=42.0)
    assert np.isnan(square.pixels["x"]).all()
    assert np.isnan(square.focal)
    assert np.isnan(right(square.pixels["x"], square.pixels["z"], np.array([319.5, 239.5])))
    assert square.numbers()["focal length"] == "none: a point is at infinity"


def test_p_from_six_points_is_opencv_s_to_a_billionth():
    seen = camera(0.0, 3.0)
    pixels = by_opencv(seen, CORNERS)
    P = exercise("18.camera_matrix").reference(CORNERS, pixels)
    K, R, centre, *_ = cv2.decomposeProjectionMatrix(P)
    signs = np.sign(np.diag(K))
    K, R = K * signs / K[2, 2], signs[:, None] * R
    R *= np.sign(np.linalg.det(R))
    np.testing.assert_allclose(K / K[2, 2], seen.intrinsics.K, rtol=1e-9, atol=1e-7)
    _, turn, t = cv2.solvePnP(CORNERS, pixels, seen.intrinsics.K, None, flags=cv2.SOLVEPNP_SQPNP)
    np.testing.assert_allclose(R, cv2.Rodrigues(turn)[0], atol=1e-9)
    posed = seen.intrinsics.K @ np.column_stack([cv2.Rodrigues(turn)[0], t])
    scale = np.linalg.norm(posed) * np.sign(np.sum(posed * P))
    np.testing.assert_allclose(P / np.linalg.norm(P), posed / scale, atol=1e-9)
    np.testing.assert_allclose((centre[:3] / centre[3]).ravel(), seen.centre, atol=1e-9)
    upper, turned = rq(P[:, :3])
    np.testing.assert_allclose(np.abs(upper / upper[2, 2]), np.abs(K / K[2, 2]), atol=1e-7)
    np.testing.assert_allclose(np.abs(turned), np.abs(R), atol=1e-9)


@pytest.mark.parametrize("tilt", [-6.0, 0.0, 6.0])
def test_heights_at_every_tilt_and_distance_are_those_of_the_scene(tilt):
    for distance, tall in ((5.0, 0.5), (12.0, 2.5), (40.0, 3.0)):
        yours = exercise("18.any_height").reference
        view = StaffView(distance_m=distance, staff_m=tall, tilt_deg=tilt, tilted=True, yours=yours)
        foot, top = by_opencv(view.camera, [[0.6, EYE, distance], [0.6, EYE - tall, distance]])
        np.testing.assert_allclose(view.staff, [foot, top], atol=1e-8)
        assert float(view.numbers()["the staff, by yours"][:-2]) == pytest.approx(tall, abs=0.005)


# What the lesson says -------------------------------------------------------------------------------------------------


def test_what_a_step_a_turn_and_a_lens_do(says):
    says("The house moves, and the dots stay.")
    first, aside = VanishingView(), VanishingView(aside=2.0)
    far = np.array([[0, 0, 1e9]])
    np.testing.assert_allclose(by_opencv(first.camera, far), by_opencv(aside.camera, far), atol=1e-4)
    assert np.abs(by_opencv(first.camera, CORNERS[:1]) - by_opencv(aside.camera, CORNERS[:1])).max() > 50
    says("They move apart, in proportion to the focal length.")
    apart = [
        np.linalg.norm(np.subtract(*(crossing(v.lines[n]) for n in "xz")))
        for v in (first, VanishingView(hfov_deg=50.0))
    ]
    longer = VanishingView(hfov_deg=50.0).camera.intrinsics.fx / first.camera.intrinsics.fx
    assert apart[1] / apart[0] == pytest.approx(longer)
    (degrees,) = says("Turning the camera by 5°.")
    turned = VanishingView(turn_deg=degrees.value)
    assert np.abs(by_opencv(turned.camera, far) - by_opencv(first.camera, far)).max() > 30


def test_how_sure_f_is(says):
    (pictures, width) = says("Here are 50 pictures, 1280 pixels wide, from different turns and tilts.")
    (noise,) = says("Each wall gives two lines, and their ends are off by 0.5 px (the standard deviation).")
    (half,) = says("In the picture above, which is half as wide, that is 0.25 px.")
    assert half == noise.value * 640 / width.value
    percent, again = says("With lines as long as a wall f is within 1 % in all 50 pictures.")
    assert again == pictures.value
    given = {"pictures": int(pictures.value), "width": int(width.value), "noise": noise.value}
    assert focal_errors(1.0, **given).max() < percent.value / 100
    (worst,) = says(
        "turns four times as much when its ends are off, and f is off by more than 2 % in the worst picture"
    )
    assert focal_errors(0.25, **given).max() > worst.value / 100


def test_heights(says):
    (eye,) = says("The camera stands 1.6 m above a level lawn and looks level.")
    (staff,) = says("A staff 1.6 m tall stands on the lawn, too.")
    assert eye == EYE
    assert staff == StaffView().staff_m
    (door,) = says("A door of 2 m tells how many metres a camera height is.")
    assert door == DOOR
    (distance,) = says("By hand, for a staff 10 m away:")
    for z in (5.0, distance.value, 40.0):  # the top stays on the horizon
        top = by_opencv(StaffView().camera, [[0.6, 0, z]])[0]
        assert top[1] == pytest.approx(StaffView().horizon_row, abs=1e-9)
    (barn,) = says("Your camera is 3 m above a flat field.")
    (height,) = says("At the height of the camera, 3 m above the field.")
    assert barn.value == height.value
    (belt,) = says("the horizon crosses a man at his belt, 1 m above the sand")
    (pole,) = says("4 m")
    camera_height, mark = says(
        "Yes: the camera is 1 m high, so the horizon marks 1 m on the pole as well, which is a quarter of it."
    )
    assert camera_height.value == mark.value == belt.value
    assert pole == mark.value / 0.25


def test_a_level_rule_in_a_tilted_picture(says):
    (tall,) = says("Below, your function of exercise 3 measures a staff of 2.5 m.")
    (tilt, again) = says("You tilt the camera by 6° and use the new horizon. What does it say of a staff of 2.5 m?")
    assert again == tall.value
    found = []
    for z in (5.0, 10.0, 40.0):
        seen = StaffView(tilt_deg=tilt.value).camera
        places = [[0.6, EYE, z], [0.6, EYE - tall.value, z], [-3, EYE, 4.6], [-3, EYE - DOOR, 4.6]]
        rows = by_opencv(seen, places)[:, 1]
        horizon = 239.5 + seen.intrinsics.fx * np.tan(np.radians(tilt.value))
        eye = DOOR * (rows[2] - horizon) / (rows[2] - rows[3])
        found.append(eye * (rows[0] - rows[1]) / (rows[0] - horizon))
    assert max(found) - min(found) > 0.03  # it depends on where the staff stands
    assert np.abs(np.array(found) - tall.value).max() == pytest.approx(0.03, abs=0.01)


def principal_points(tilt, noise, count=400):
    """Principal points (count, 2) from three vanishing points, by least squares over all three altitudes."""
    rng, found = np.random.default_rng(5), []
    lines = VanishingView(tilt_deg=tilt, upright=True).lines
    for _ in range(count):
        a, b, c = (crossing(both + rng.normal(0, noise, both.shape)) for both in lines.values())
        sides = np.array([b - c, c - a, a - b])
        found.append(np.linalg.lstsq(sides, np.sum(sides * [a, b, c], axis=1), rcond=None)[0])
    return np.array(found)


def test_three_points_find_the_middle_and_are_delicate(says):
    columns, tilt = says("Someone has cut the left 200 columns off a picture that looks up by 12°.")
    lines = VanishingView(tilt_deg=tilt.value, turn_deg=4.0, upright=True).lines
    cropped = [crossing(both) - (columns.value, 0) for both in lines.values()]
    found = exercise("18.principal_point").reference(*cropped)
    np.testing.assert_allclose(found, (319.5 - columns.value, 239.5), atol=1e-6)
    noise, wide = says("Let the ends of the lines be off by 0.5 px. This picture is 640 px wide")
    (finer,) = says("pictures, 1280 pixels wide")
    says("so that is twice as much as in section 2")
    assert finer.value / wide.value == 2
    assert wide == VanishingView().camera.intrinsics.width
    tilt, across = says("At a tilt of 12° the principal point then scatters by 8 px across")
    (down,) = says("px across and by 3 px down (standard deviations)")
    scatter = principal_points(tilt.value, noise.value).std(axis=0)
    assert across == scatter[0]
    assert down == scatter[1]
    level, wide = says("At a tilt of 4° it is 25 px across.")
    assert wide.about(principal_points(level.value, noise.value).std(axis=0)[0], within=0.06)
    (again,) = says("Someone cuts 200 columns off the left side of a photograph.")
    (moved,) = says("where it was, 200 columns farther to the left of the new numbering")
    (aside,) = says("At the same spot of the scene, 100 pixels left of the new middle.")
    falls, middle = says("Yes. Its column falls by 200, and that of the middle by 100.")
    assert again.value == moved.value == falls.value == columns.value
    assert aside.value == middle.value == columns.value - columns.value / 2


def test_a_wall_seen_squarely(says):
    (turn,) = says("Pull turn up to 42°.")
    (again,) = says("Turn on to 42°: do the blue lines still meet, and is there an f?")
    assert again.value == turn.value
    seen = camera(turn.value, aside=-3.0)
    upper, lower = (by_opencv(seen, edge) for edge in edges()["x"])
    assert upper[0][1] == pytest.approx(upper[1][1])
    assert lower[0][1] == pytest.approx(lower[1][1])
    says("The purple point has come to the middle")
    np.testing.assert_allclose(by_opencv(seen, [[0, 0, 1e9]])[0], (319.5, 239.5), atol=1e-4)


def test_the_house_s_numbers_and_the_phone_s(says):
    (tilt,) = says("read off a picture that looks up by 3°")
    seen = camera(0.0, tilt.value)
    typed = [[(318, 141), (83, 202)], [(317, 414), (79, 335)], [(318, 141), (520, 205)], [(317, 414), (523, 331)]]
    true = np.concatenate([[by_opencv(seen, edge) for edge in edges()[name]] for name in "xz"])
    np.testing.assert_allclose(typed, true, atol=0.51)
    film, diagonal = says(
        "tell the focal length on 35 mm film, as `FocalLengthIn35mmFilm`. Divided by 43.3 mm and times"
    )
    assert film.value == 35  # the film's name
    assert diagonal == np.hypot(36, 24)


MIDDLE = np.array([433.5, 299.5])


@pytest.fixture(scope="module")
def read_off():
    """The lines (2, 2, 2) that the lesson's cell has of the photograph: the floors' as x, the uprights' as z."""
    (path,) = LESSONS.glob("18_*.ipynb")
    (cell,) = (cell for cell in notebooks.read(path).cells if cell.id == "building")
    given = {line.split(" = ")[0]: line for line in cell.source.splitlines() if " = [" in line}
    typed = (given[name].partition(" = ")[2].partition("#")[0].strip() for name in ("floors", "uprights"))
    return dict(zip("xz", (np.array(ast.literal_eval(lines), dtype=float) for lines in typed), strict=True))


def test_a_real_photograph(says, read_off):
    f = focal(read_off, MIDDLE)
    lens, film = says("The field of view is that of a lens of 50 mm on film 36 mm wide")
    assert lens.about(f * film.value / 868, within=0.02)
    rng, found = np.random.default_rng(1), []
    for _ in range(1000):
        noisy = {name: both + rng.normal(0, 0.5, both.shape) for name, both in read_off.items()}
        found.append(focal(noisy, MIDDLE))
    (percent,) = says("Still f scatters by some 3 % only")
    assert percent == 100 * np.std(found) / f


def test_the_lines_of_the_photograph_are_those_that_opencv_finds_in_it(read_off):
    """A line segment detector's edges, some ninety of both directions, give the same focal length."""
    try:
        path = sample("building.jpg")
    except SampleUnavailable as reason:
        pytest.skip(str(reason))
    segments = cv2.createLineSegmentDetector().detect(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE))[0].reshape(-1, 2, 2)
    across = segments[:, 1] - segments[:, 0]
    angle, length = np.degrees(np.arctan2(across[:, 1], across[:, 0])) % 180, np.linalg.norm(across, axis=1)
    uprights = segments[(abs(angle - 90) < 8) & (length > 40)]
    floors = segments[(abs(angle - 159) < 19) & (length > 60) & (segments[:, 0, 1] < 480)]
    along, up = (common_point((both - MIDDLE) / 500) * 500 for both in (floors, uprights))
    assert np.sqrt(-(along @ up)) == pytest.approx(focal(read_off, MIDDLE), rel=0.03)


def common_point(segments):
    """Where the lines through segments (n, 2, 2) meet, by least squares with their lengths as weights."""
    ends = np.concatenate([segments, np.ones((len(segments), 2, 1))], axis=2)
    lines = np.cross(ends[:, 0], ends[:, 1])
    lines *= (np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1) / np.linalg.norm(lines[:, :2], axis=1))[:, None]
    x, y, w = np.linalg.svd(lines)[2][-1]
    return np.array([x, y]) / w


def test_the_horizon_tells_how_the_camera_stood(says):
    """A camera that was turned, tilted and rolled, and OpenCV's pixels of both walls' directions, far away."""
    says("The horizon is the line through both points.")
    says("How far it is below the middle of the picture tells the tilt, and how much it slopes tells the roll.")
    for turn, tilt, roll in [(0, 3, 0), (6, -5, 4), (-8, 9, -6)]:
        turned = Rotation.from_euler("YXZ", [HEADING_DEG + turn, tilt, -roll], degrees=True)
        placed = Camera(camera().intrinsics, world_from_cam=RigidTransform.from_components(np.zeros(3), turned))
        first, second = by_opencv(placed, [(-1e9, 0, 0), (0, 0, 1e9)])
        f, middle = placed.intrinsics.fx, np.array([placed.intrinsics.cx, placed.intrinsics.cy])
        slope = (second[1] - first[1]) / (second[0] - first[0])
        assert slope == pytest.approx(np.tan(np.radians(roll)), abs=1e-6)
        h = first[1] + slope * (middle[0] - first[0]) - middle[1]
        assert h * np.cos(np.radians(roll)) / f == pytest.approx(np.tan(np.radians(tilt)), abs=1e-6)
        aside = (middle - first) @ np.array([np.cos(np.radians(roll)), np.sin(np.radians(roll))])
        d = f / np.cos(np.radians(tilt))
        assert np.degrees(np.arctan(aside / d)) == pytest.approx(90 + HEADING_DEG + turn, abs=1e-4)


def test_the_distance_of_two_points_does_not_tell_f(says):
    """OpenCV's pixels of both directions: the distance changes with the turn, −(q₁ − c)·(q₂ − c) does not."""
    f, at_0, none, at_25, turn = says("At f = 417 px the points are 839 px apart at a turn of 0°, and 1,492 px at 25°.")
    middle, directions = np.array([319.5, 239.5]), [(-1e9, 0, 0), (0, 0, 1e9)]
    for degrees, apart in ((none.value, at_0), (turn.value, at_25)):
        first, second = by_opencv(camera(degrees), directions)
        assert apart == np.linalg.norm(second - first)
        assert f == np.sqrt(-(first - middle) @ (second - middle))
    says("So at the same turn their distance grows with the focal length.")
    says("That gives the focal length, counted in widths of the picture, whichever way the camera was turned.")


def test_any_known_angle_gives_an_equation_for_f(says):
    """Of directions 60° apart only the true f makes rays 60° apart; at 90° a point at infinity tells none."""
    says("Any known angle gives an equation for f; a right angle gives the short one above.")
    says("For a right angle neither point may lie at infinity.")
    says("A known angle, seen aslant, tells f.")
    seen, middle = camera(0.0), np.array([319.5, 239.5])
    R, (a, b) = seen.extrinsics[0], np.radians((-25, 35))
    rays = np.array([(np.sin(a), 0, np.cos(a)), (np.sin(b), 0, np.cos(b))])
    first, second = by_opencv(seen, 1e9 * rays @ R) - middle

    def angle(f):
        one, other = np.append(first, f), np.append(second, f)
        return np.degrees(np.arccos(one @ other / np.linalg.norm(one) / np.linalg.norm(other)))

    assert brentq(lambda f: angle(f) - 60, 50, 5000) == pytest.approx(seen.intrinsics.fx)
    for f in (200.0, 800.0):  # at infinity along the rows: any f makes a right angle with the middle column
        assert np.dot((1.0, 0, 0), np.append((0.0, 50), f)) == 0


def test_each_gap_has_its_own_help(says):
    """A wall seen squarely has both points at infinity; twice the scene and twice the step give the same pictures."""
    says("The points of its level and of its upright edges are both at infinity")
    square = camera(42.0, aside=-3.0)
    for direction in ((-1.0, 0, 0), (0, 1.0, 0)):
        assert (square.extrinsics[0] @ direction)[2] == pytest.approx(0, abs=1e-9)
    says("A second picture from another place tells depth, and never the scale.")
    R, t = square.extrinsics
    one, twice = (
        cv2.projectPoints(s * CORNERS, R, s * (t - (0.3, 0, 0)), square.intrinsics.K, None)[0] for s in (1, 2)
    )
    np.testing.assert_allclose(one, twice, atol=1e-9)
    (square_on,) = says("right only in a level picture of walls both seen at 45°.")
    f, both = 400.0, np.radians((square_on.value, 30))
    halves = [f * (np.tan(angle) + 1 / np.tan(angle)) / 2 for angle in both]
    assert halves[0] == pytest.approx(f)
    assert halves[1] > 1.1 * f


def test_rq_gives_a_rotation_where_the_sign_of_P_is_chosen(says):
    says("writes any square matrix as an upper triangle times an orthogonal matrix")
    (mirror,) = says("Where det R comes out as −1, take −P instead: then R is a rotation.")
    seen = camera(7.0, 3.0)
    P = seen.intrinsics.K @ np.column_stack(seen.extrinsics)
    for sign in (1, mirror.value):
        K, R = rq(sign * P[:, :3])
        R = np.sign(np.diag(K))[:, None] * R
        assert np.linalg.det(R) == pytest.approx(sign)
        np.testing.assert_allclose(sign * R, seen.extrinsics[0], atol=1e-9)


def test_a_corner_through_two_lenses(says):
    near, far = says("are 900 px apart in the first and 1800 px in the second")
    says("The second: its focal length is twice as long.")
    assert far.value / near.value == 2


def test_shapes_are_those_of_the_functions(says):
    (pixel,) = says("the second through `c` and `d`, each a pixel (2,).")
    assert exercise("18.meet").reference(*np.eye(4)[:, :2] + 1.5).shape == (pixel.value,)
    (points,) = says("from vanishing points `first` and `second` (..., 2) of directions at a right angle")
    (centre,) = says("and the principal point `centre` (2,).")
    one = np.full((5, int(points.value)), 40.0)
    assert exercise("18.focal_length").reference(one, -one, np.zeros(int(centre.value))).shape == (5,)
    (line,) = says("l the horizon as a line (3,)")
    (upright,) = says("q the vanishing point of the upright lines (3,).")
    (foot,) = says(
        "`foot`, `top`, `door_foot` and `door_top` are pixels (2,), `horizon` and `vertical` have three numbers."
    )
    view = StaffView()
    x, vertical, z = view._directions
    assert np.cross(x, z).shape == (line.value,)
    assert vertical.shape == (upright.value,)
    assert view.staff[0].shape == (foot.value,)
    (middle,) = says("Return c (2,) from the three vanishing points")
    (corner,) = says("from the three vanishing points `a`, `b` and `c` (2,).")
    triangle = np.array([[0.0, 0], [5, 1], [2, 4]])[:, : int(corner.value)]
    assert exercise("18.principal_point").reference(*triangle).shape == (middle.value,)
    rows, columns = says("Return P (3, 4), of any scale")
    space, flat = says("from `points` (n, 3) in metres and `pixels` (n, 2).")
    assert exercise("18.camera_matrix").reference(np.eye(6)[:, :3], np.eye(6)[:, :2]).shape == (
        rows.value,
        columns.value,
    )
    assert CORNERS.shape[1] == space.value
    assert by_opencv(camera(), CORNERS).shape[1] == flat.value
    high, wide = says("The left 3 × 3 part of P is K R.")
    assert rq(np.eye(int(high.value)))[0].shape == (high.value, wide.value)
