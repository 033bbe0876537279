"""What lesson 10 says about mirrors, the unified sphere, cubes and rings, recomputed with NumPy, SciPy and OpenCV."""

import re
import shlex
import shutil
from pathlib import Path

import cv2
import numpy as np
import pytest
from quoting import LESSONS
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from camviz.lenses import DoubleSphere, UnifiedSphere
from camviz.panoramas.cubemap import FACES, face_camera
from camviz.panoramas.ring import Ring
from camviz_clinic.commands.command import main
from camviz_school.course import notebooks
from camviz_school.course.exercises import exercise
from camviz_school.course.material import module

lesson10 = module("10")

EXCEPTIONS: dict[str, str] = {}


def unified(points, f, xi):
    """Mei's formula, written out here."""
    points = np.asarray(points, dtype=float)
    return f * points[..., :2] / (points[..., 2:] + xi * np.linalg.norm(points, axis=-1, keepdims=True))


def at_angle(degrees, turn=0.0):
    """The unit ray so many degrees from the axis."""
    a = np.radians(degrees)
    return np.stack([np.sin(a) * np.cos(turn), np.sin(a) * np.sin(turn), np.cos(a)], axis=-1)


def reflected(directions, normals):
    normals = normals / np.linalg.norm(normals, axis=-1, keepdims=True)
    return directions - 2 * np.sum(directions * normals, axis=-1, keepdims=True) * normals


def ball(phi):
    """Of a ball of 50 mm, 150 mm from its camera: points at phi from the axis, rays from there, image radii."""
    on = 50 * np.stack([np.sin(phi), np.cos(phi)], axis=-1)
    to = on - [0, 150]
    return on, reflected(to / np.linalg.norm(to, axis=-1, keepdims=True), on), to[:, 0] / -to[:, 1]


def bent(points):
    """By how much the middle of three image points lies beside the line through the other two."""
    a, b, c = points
    along = (c - a) / np.linalg.norm(c - a)
    return abs(np.cross(np.append(along, 0), np.append(b - a, 0))[2])


# The doughnut and its window -----------------------------------------------------------------------------------------


def test_in_the_doughnut_only_lines_that_point_at_the_middle_are_straight(says):
    says("Only lines that point at the middle are straight in it, such as the lamp posts.")
    along = np.linspace(-1, 1, 3)[:, None]
    post = np.array([2.0, 1.0, 0.0]) + along * [0, 0, 1]  # the camera's axis is upright
    brick = np.array([2.0, 1.0, 0.3]) + along * [1, -1, 0]
    assert bent(unified(post, 1.0, 0.92)) < 1e-12
    assert bent(unified(brick, 1.0, 0.92)) > 0.01
    says("In the window all straight things are straight.")
    for line in (post, brick):
        assert bent(unified(line @ Rotation.from_euler("y", 60, degrees=True).as_matrix(), 1.0, 0.0)) < 1e-12


def test_six_windows_make_a_cube(says):
    (pinholes,) = says("Six pinholes of 90° see everything")
    (six,) = says("Six pinholes of 90°, chosen by one comparison.")
    face = 2 * np.degrees(np.arctan(1.0))  # half a face, seen from the centre at the distance of half a face
    assert pinholes.value == six.value
    assert six == face


def test_one_fisheye_that_looks_up_sees_the_whole_horizon(says):
    (whole,) = says("of more than 180° that looks straight up. *Fisheye* says how a lens draws")
    says("A fisheye that looks ahead misses what is behind it.")
    (both,) = says(
        "A fisheye of more than 180° that looks straight up is both; one that looks ahead is not omnidirectional."
    )
    (one,) = says(
        "a fisheye of more than 180° that looks straight up shows the whole horizon near the rim of its picture"
    )
    turn = np.linspace(0, 2 * np.pi, 36, endpoint=False)
    horizon = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=-1)
    from_the_zenith = np.degrees(np.arccos(horizon @ [0, 0, 1]))
    ahead = np.degrees(np.arccos(np.clip(horizon @ [1, 0, 0], -1, 1)))
    for angle in (whole, both, one):
        assert 2 * from_the_zenith == pytest.approx(angle.value)
        assert (2 * ahead > 200).any()  # beyond even a fisheye of 200°


def test_how_far_the_rays_of_the_sphere_miss_one_point(says):
    """A ball of 50 mm, 150 mm from its camera, out to 112°: the mirror of the view, traced here."""
    h, near, off, far, less = says(
        "The rays of the sphere miss the best single point by 3.2 mm (root mean square). A thing 0.3 m away is then "
        "seen 0.61° from where it is, and a thing 3 m away 0.061°."
    )
    on, out, rho = ball(np.radians(np.linspace(0.05, 47.8, 4000)))
    theta = np.arctan2(out[:, 0], out[:, 1])
    rim = np.interp(np.radians(112), theta, rho)
    seen = [np.interp(np.linspace(0.02, 0.98, 60) * rim, rho, column) for column in (*on.T, *out.T)]
    x, z, dx, dz = seen
    best = least_squares(lambda at: x * dz - (z - at) * dx, [30.0]).x
    missed = np.sqrt(np.mean((x * dz - (z - best) * dx) ** 2))
    assert h == missed
    for distance, angle in ((near, off), (far, less)):
        assert angle == np.degrees(np.arcsin(missed / 1000 / distance.value))


# Mirrors with a single viewpoint -------------------------------------------------------------------------------------


@pytest.mark.parametrize("e", [0.6, 1.5, 3.0])
def test_conics_reflect_what_aims_at_one_focus_into_the_other(says, e):
    says("Such a mirror reflects rays that aim at one of its foci into the other.")
    says("A conic with eccentricity e and parameter p has the polar equation r = p / (1 + e cos θ)")
    says("the camera stands at the distance L = 2pe/(e² − 1) from the first focus")
    p, theta = 0.03, np.radians([20.0, 50.0, 80.0, 100.0])
    r = p / (1 + e * np.cos(theta))
    slope = p * e * np.sin(theta) / (1 + e * np.cos(theta)) ** 2
    point = np.stack([r * np.sin(theta), r * np.cos(theta)], axis=-1)
    tangent = np.stack([slope * np.sin(theta) + r * np.cos(theta), slope * np.cos(theta) - r * np.sin(theta)], axis=-1)
    normal = tangent[:, ::-1] * [1, -1]
    towards_the_focus = -point / np.linalg.norm(point, axis=-1, keepdims=True)
    out = reflected(towards_the_focus, normal)
    other = np.array([0, 2 * p * e / (e**2 - 1)])
    gap = other - point
    np.testing.assert_allclose(out[:, 0] * gap[:, 1] - out[:, 1] * gap[:, 0], 0, atol=1e-15)


def test_a_paraboloid_makes_them_parallel_and_a_plane_is_one_more_and_a_sphere_is_none(says):
    says("For the paraboloid the other focus is infinitely far, so its camera is orthographic.")
    says("Others are a plane and the inside of an ellipsoid")
    says("only a plane, a cone, an ellipsoid, a hyperboloid or a paraboloid has a single viewpoint")
    x = np.array([0.2, 0.5, 0.9])
    on = np.stack([x, 0.5 - x**2 / 2], axis=-1)  # its focus is the origin
    out = reflected(-on / np.linalg.norm(on, axis=-1, keepdims=True), np.stack([x, np.ones(3)], axis=-1))
    np.testing.assert_allclose(out, [[0, 1]] * 3 @ np.diag([1, -1 if out[0, 1] < 0 else 1]), atol=1e-12)
    eye = np.array([0.0, -1.0])
    plane = np.stack([x, 0 * x], axis=-1)
    back = reflected((plane - eye) / np.linalg.norm(plane - eye, axis=-1, keepdims=True), np.array([[0.0, 1.0]]))
    assert np.ptp(plane[:, 1] - plane[:, 0] * back[:, 1] / back[:, 0]) < 1e-12  # prolonged, all pass (0, 1)
    turn = np.radians([5, 20, 40])
    ball = np.stack([np.sin(turn), np.cos(turn)], axis=-1)
    out = reflected((ball - [0, 4]) / np.linalg.norm(ball - [0, 4], axis=-1, keepdims=True), ball)
    assert np.ptp(ball[:, 1] - ball[:, 0] * out[:, 1] / out[:, 0]) > 0.05  # they cross the axis in different places


def test_plane_and_ellipsoid_show_half_of_all_directions_at_most(says):
    """A ray that aims at the viewpoint must come past the mirror: where the mirror is in direction d, none is in −d."""
    says("which cannot show more than half of all directions, and a cone.")
    directions = np.random.default_rng(0).normal(size=(10000, 3))
    mirror = directions[:, 2] > 0  # as much as may be: with more, some −d would be on the mirror too
    assert not (mirror & ((-directions)[:, 2] > 0)).any()
    assert mirror.mean() == pytest.approx(0.5, abs=0.02)


def test_the_xi_of_mirrors_goes_from_0_to_1(says):
    says("No mirror has such a ξ, but the formula still works.")
    e = np.linspace(0, 50, 5001)
    assert (2 * e / (1 + e**2)).max() == pytest.approx(1)
    says("a hyperbolic or elliptic mirror.")
    theta = np.radians([20.0, 50.0, 80.0])
    for e in (0.5, 2.0):  # the mirror's point 1/(1 + e cos θ) away in each direction, seen from the other focus
        x, z = np.sin(theta) / (1 + e * np.cos(theta)), np.cos(theta) / (1 + e * np.cos(theta)) - 2 * e / (e**2 - 1)
        ratio = x / z / unified(at_angle(np.degrees(theta)), 1.0, 2 * e / (1 + e**2))[:, 0]
        np.testing.assert_allclose(ratio, ratio[0])
    (axis,) = says("No direction at 90° from the axis or beyond has an image.")
    assert at_angle(axis.value)[2] == pytest.approx(0)
    says("This is a parabolic mirror, and also a *lens*, the stereographic fisheye")
    (two,) = says("half of the stereographic 2 tan(θ/2)")
    theta = np.radians([10, 60, 120])
    np.testing.assert_allclose(two.value * unified(at_angle(np.degrees(theta)), 1.0, 1.0)[:, 0], 2 * np.tan(theta / 2))


# The unified sphere --------------------------------------------------------------------------------------------------


def test_the_middle_tells_f_over_1_plus_xi_only(says):
    says("In the middle the three cameras agree to a few hundredths of a pixel.")
    (apart,) = says("At the rim they are more than 100 px apart.")
    cameras = ((300.0, 0.0), (600.0, 1.0), (1200.0, 3.0))
    middle, rim = ([unified(at_angle(degrees), f, xi)[0] for f, xi in cameras] for degrees in (3, 79))
    assert 0.005 < np.ptp(middle) < 0.02
    assert np.abs(np.diff(rim)).min() > apart.value
    (xi,) = says("You double the focal length f of a unified sphere with ξ = 1 and change ξ to 3")
    assert 2 / (1 + xi.value) == 1 / (1 + 1)
    says("The rim does change, but it shrinks: a larger ξ draws it in.")
    assert rim[0] > rim[1] > rim[2]


def test_the_two_forms_are_one_lens(says):
    says("then ξ = α/(1 − α) and **γ = f/(1 − α)**")
    alpha, f = says("A file gives α = 0.6 and f = 190 px for a unified sphere")
    point = np.array([0.4, 0.7, -0.1])
    in_alpha = f.value * point[:2] / (alpha.value * np.linalg.norm(point) + (1 - alpha.value) * point[2])
    xi, gamma = says("ξ = 1.5, γ = 475 px")
    np.testing.assert_allclose(unified(point, gamma.value, xi.value), in_alpha)
    wrong_xi, wrong_gamma = says("ξ = 0.6, γ = 190 px")
    right_xi, half_right = says("ξ = 1.5, γ = 190 px")
    assert not np.allclose(unified(point, wrong_gamma.value, wrong_xi.value), in_alpha)
    assert not np.allclose(unified(point, half_right.value, right_xi.value), in_alpha)
    (middle,) = says("γ/(1 + ξ) = 190 px = f")
    assert middle == gamma.value / (1 + xi.value)


@pytest.mark.parametrize("xi", [0.8, 1.7])
def test_opencv_gives_an_image_to_points_that_have_none(says, xi):
    says("Its `projectPoints` takes ξ as a plain number, not as the array that a calibration returns.")
    says("for ξ ≤ 1 these have Z ≤ −ξD, and their image comes out mirrored through the middle")
    says("for ξ > 1 these have Z ≤ −D/ξ. They lie on the far side of the sphere and share their pixel with a point")

    def opencv(point, xi):
        flat = np.asarray(point, dtype=float).reshape(1, 1, 3)
        return cv2.omnidir.projectPoints(flat, np.zeros(3), np.zeros(3), np.eye(3), xi, np.zeros(4))[0].ravel()

    with pytest.raises(cv2.error):
        opencv([1, 2, 5], np.array([xi]))
    limit = np.degrees(np.arccos(-min(xi, 1 / xi)))
    seen, hidden = at_angle(limit - 5), at_angle(limit + 5)
    assert opencv(seen, xi)[0] > 0
    if xi < 1:
        assert opencv(hidden, xi)[0] < 0
    else:
        angles = np.linspace(1, limit, 20000)
        near = unified(at_angle(angles), 1.0, xi)[:, 0]
        assert (np.diff(near) > 0).all()
        assert near[0] < opencv(hidden, xi)[0] < near[-1]


def test_the_double_sphere_fits_fisheyes_better(says):
    says("It has one number more, and fits fisheye lenses better:")
    theta = np.linspace(0.01, np.radians(100), 200)
    x, _, z = at_angle(np.degrees(theta)).T

    def double(f, xi, alpha):
        return f * x / (alpha * np.hypot(x, xi + z) + (1 - alpha) * (xi + z))

    for radius in (theta, 2 * np.sin(theta / 2), theta - 0.02 * theta**3):
        one = least_squares(lambda p, r=radius: p[0] * x / (z + p[1]) - r, [2, 1.2]).cost
        two = least_squares(lambda p, r=radius: double(*p) - r, [1, 0.1, 0.6]).cost
        assert two < one / 100


# The valley ----------------------------------------------------------------------------------------------------------


def fitted(uv, corners, starts, f, xi):
    """The RMS that is left when every board has its best pose."""
    squares = 0.0
    for view, start in zip(uv, starts, strict=True):

        def misfit(pose, view=view):
            there = Rotation.from_rotvec(pose[:3]).apply(corners) + pose[3:]
            return (unified(there, f, xi) + [399.5, 319.5] - view).ravel()

        squares += 2 * least_squares(misfit, start, method="lm").cost
    return np.sqrt(squares / uv[..., 0].size)


def test_the_valley_of_boards_near_the_axis_and_the_pit_of_boards_far_out(says):
    f, xi = says("in front of the *same* camera, f = 560 px and ξ = 1.1")
    near_deg, far_deg, noise = says(
        "One set reaches 15° from the axis, the other 66°. The corners carry noise of 0.1 px."
    )
    total, over, along = says("The dashed line is f/(1 + ξ) = 560/2.1 = **266.7 px**.")
    assert (total.value, over.value) == (f.value, 1 + xi.value)
    assert along == f.value / (1 + xi.value)
    other_xi, other_f, worse, best = says("ξ = 0.5 with f = 400 px leaves 0.141 px where the truth leaves 0.136 px.")
    seen, off = says("Nobody who sees a misfit of 0.14 px would think that f is wrong by 160 px.")
    assert other_f.value / (1 + other_xi.value) == pytest.approx(along.value, abs=0.1)
    assert off == f.value - other_f.value

    code = "\n".join(cell.source for cell in notebooks.read(LESSONS / "10_omnidirectional.ipynb").cells)
    spreads = re.search(r'near the axis": boards\(rng, ([\d.]+), .*rim": boards\(rng, ([\d.]+), ', code)
    assert spreads
    namespace = {"np": np}
    setting = next(cell for cell in code.split("from scipy.spatial.transform import")[1:] if "def boards" in cell)
    exec(
        "from camviz.lenses import UnifiedSphere\nfrom scipy.spatial.transform import"
        + setting.partition("from camviz_school.views.focal_xi_ambiguity")[0],
        namespace,
    )
    rng, corners = np.random.default_rng(4), namespace["board"].corners
    for spread, away, reach in ((0.1, (0.6, 0.9), near_deg), (0.9, (0.2, 0.3), far_deg)):
        poses, uv = namespace["boards"](rng, spread, away)
        there = np.stack([pose.apply(corners) for pose in poses])
        assert reach == np.degrees(np.arctan2(np.hypot(there[..., 0], there[..., 1]), there[..., 2])).max()
        error = uv - unified(there, f.value, xi.value) - [399.5, 319.5]
        assert noise.about(error.std(), 0.05)
        starts = [np.append(pose.rotation.as_rotvec(), pose.translation) for pose in poses]
        true, elsewhere = (
            fitted(uv, corners, starts, one.value, its.value) for one, its in ((f, xi), (other_f, other_xi))
        )
        if reach is near_deg:
            assert best == true
            assert worse == elsewhere
            assert seen == elsewhere
        else:
            assert elsewhere > 5 * true


def test_two_cameras_of_one_valley(says):
    f, one, g, other, both = says("By hand: 560/2.1 and 400/1.5 are both 266.7 px.")
    assert both == f.value / one.value
    assert both == g.value / other.value
    theta, first, second = says(
        "At θ = 0.5 the first camera draws the ray 135.76 px from the middle, and the second 139.21 px."
    )
    cameras = (f.value, one.value - 1), (g.value, other.value - 1)
    assert [first, second] == [unified(at_angle(np.degrees(theta.value)), *camera)[0] for camera in cameras]
    near, little, far, much, noise = says(
        "At 15° the two cameras are 0.47 px apart, at 66° 63 px. The noise of a corner is about 0.1 px."
    )
    for degrees, px in ((near, little), (far, much)):
        assert px == np.diff([unified(at_angle(degrees.value), *camera)[0] for camera in cameras])[0]
    (taken,) = says("Of the 0.47 px the boards' poses have taken up most.")
    assert taken == little.value
    assert noise.value < little.value
    says("The difference grows like θ³: nothing in the middle, much at the rim.")
    small = [np.diff([unified(at_angle(d), *camera)[0] for camera in cameras])[0] for d in (1, 2)]
    assert small[1] / small[0] == pytest.approx(8, rel=0.01)
    assert lesson10.apart(np.array(theta.value), f.value, one.value - 1, other.value - 1) == pytest.approx(
        second.value - first.value, abs=0.01
    )


def test_the_quiz_about_two_calibrations(says):
    f1, xi1, f2, xi2, rms = says("(f, ξ) = (560, 1.1) and (640, 1.4). Both have an RMS of 0.2 px.")
    middle = at_angle(np.linspace(0, 15, 16))
    assert np.abs(unified(middle, f1.value, xi1.value) - unified(middle, f2.value, xi2.value)).max() < rms.value
    quotient, one, other, two, both = says("560/2.1 and 640/2.4 are both 266.7")
    assert (quotient.value, other.value) == (f1.value, f2.value)
    assert (one.value, two.value) == (1 + xi1.value, 1 + xi2.value)
    assert both == f1.value / (1 + xi1.value)
    assert both == f2.value / (1 + xi2.value)
    (again,) = says("Yes: 266.7 px both times.")
    assert again == both.value
    f, xi, mean = says("The mean is (600, 1.25), with 266.7 px once more.")
    assert f == (f1.value + f2.value) / 2
    assert xi == (xi1.value + xi2.value) / 2
    assert mean == f.value / (1 + xi.value)


# A polynomial for any mirror -----------------------------------------------------------------------------------------


def test_two_numbers_are_enough_for_a_parabola(says):
    says("There ρ = f tan(θ/2), and then ρ / tan θ = f/2 − ρ²/(2f).")
    f = 1
    rho, half, less, z, again, at, degrees, twice, tangent = says(
        "take f = 1 and ρ = 0.5. Then z = 0.5 − 0.125 = 0.375, and the ray (0.5, 0.375) is 53.13° from the axis: twice "
        "the 26.57° whose tangent is 0.5."
    )
    assert half == f / 2
    assert less == rho.value**2 / (2 * f)
    assert z == half.value - less.value
    assert (again.value, at.value, tangent.value) == (rho.value, z.value, rho.value)
    assert degrees == np.degrees(np.arctan2(rho.value, z.value))
    assert twice == degrees.value / 2
    assert unified(at_angle(degrees.value), f, 1.0)[0] == pytest.approx(rho.value, abs=1e-4)
    assert np.tan(np.radians(twice.value)) == pytest.approx(tangent.value, abs=2e-4)
    theta = np.radians(np.arange(5, 100.0))
    np.testing.assert_allclose(lesson10.polynomial(np.tan(theta / 2), theta), [0.5, -0.5, 0, 0], atol=1e-12)


def test_the_powers_and_the_sign_of_z(says):
    (columns,) = says("as the columns of a matrix (n, 4), and let")
    assert columns == len(lesson10.polynomial(np.linspace(0.1, 0.9, 9), np.linspace(0.2, 1.5, 9)))
    two, three = says("Your powers are 0, 1, 2, 3.")
    wrong = next(one for one in exercise("10.polynomial").misconceptions if "0, 1, 2, 3" in one.explanation)
    given = np.linspace(0.1, 0.9, 9), np.linspace(0.2, 1.5, 9)
    cubic = np.polyfit(given[0], given[0] / np.tan(given[1]), int(three.value))[::-1]
    np.testing.assert_allclose(wrong.function(*given), cubic)
    assert two == three.value - 1
    (beside,) = says("z is positive for rays in front, where θ is below 90°.")
    assert at_angle(beside.value - 1)[2] > 0 > at_angle(beside.value + 1)[2]


def worst(rho, theta):
    """By how many degrees the polynomial of least squares misses, by its normal equations, scaled."""
    size = rho.max()
    A = np.stack([np.ones_like(rho), (rho / size) ** 2, (rho / size) ** 3, (rho / size) ** 4], axis=-1)
    z = A @ np.linalg.solve(A.T @ A, A.T @ (rho / np.tan(theta)))
    return np.degrees(np.abs(np.arctan2(rho, z) - theta)).max()


def test_a_polynomial_fits_the_sphere_whose_viewpoint_moves(says):
    says("The first two have a single viewpoint.")
    (out,) = says("three mirrors, out to 90° from their axes")
    small, more = says("With four, the hyperbola's error stays below 0.02°, and the sphere's below 0.3°.")
    theta = np.linspace(0.02, 1, 200) * np.radians(out.value)
    x = np.sin(theta) / (np.cos(theta) + 0.8)  # e = 2
    assert small.value / 2 < worst(x, theta) < small.value
    on, rays, rho = ball(np.radians(np.linspace(0.05, 47.8, 4000)))
    angles = np.arctan2(rays[:, 0], rays[:, 1])
    there = np.linspace(0.02, 1, 200) * np.interp(np.radians(out.value), angles, rho)
    assert more.value / 2 < worst(there, np.interp(there, rho, angles)) < more.value
    crossing = on[:, 1] - on[:, 0] * rays[:, 1] / rays[:, 0]
    beside, moved = says(
        "The ray from 90° crosses the axis 9.8 mm nearer to the camera than the rays from near the axis."
    )
    first, last = np.interp(np.radians([1.0, beside.value]), angles, crossing)
    assert moved == last - first  # z runs towards the camera
    far, at, little, near, much = says(
        "A thing 3 m from it, on the ray from 90°, is then 0.19° from where the polynomial says, and one 0.3 m away "
        "1.9°."
    )
    assert at == beside.value
    for distance, angle in ((far, little), (near, much)):
        assert angle == np.degrees(np.arcsin((last - first) / 1000 / distance.value))


def test_at_one_distance_a_polynomial_can_be_right(says):
    (given,) = says("with boards that all stand 1 m away, and the error is a fraction of a pixel")
    (known,) = says("Where its rays go at 1 m. Nearer, the directions are off.")
    assert known.value == given.value
    says("There, each pixel has one direction, and a polynomial can have that direction, too.")
    on, rays, rho = ball(np.radians(np.linspace(1, 40, 400)))

    def seen(distance):
        """The directions of the things that far away, from the centre of the ball."""
        b = np.sum(on * rays, axis=-1)
        thing = on + (-b + np.sqrt(b * b - np.sum(on**2, axis=-1) + distance**2))[:, None] * rays
        return np.arctan2(thing[:, 0], thing[:, 1])

    assert worst(rho, seen(1000 * given.value)) < 0.5
    assert np.degrees(np.abs(seen(300.0) - seen(1000.0))).max() > 3


# The ring ------------------------------------------------------------------------------------------------------------


def seen_at(camera, thing, S):
    """The longitude at which a panorama, stitched for S, shows a thing that the camera sees: where its ray meets S."""
    ray = (thing - camera) / np.linalg.norm(thing - camera)
    b = camera @ ray
    hit = camera + (-b + np.sqrt(b * b - camera @ camera + S * S)) * ray
    return np.arctan2(hit[0], hit[1])


def test_what_a_ring_does_to_a_globe_at_a_seam(says):
    (r_cm,) = says("Six cameras look outwards from a ring of 25 cm radius")
    (z,) = says("At a seam stands a globe, 3 m away.")
    (stitched,) = says("It could make the globe whole by stitching for 3 m. Then the lamps behind it are torn")
    (lowered,) = says("Pull **stitched for** down to about 3 m: the globe becomes whole.")
    (doubled,) = says("Stitched for 3 m, the lamps are seen double.")
    assert stitched.value == lowered.value == doubled.value == z.value
    alpha, r = np.pi / 6, r_cm.value / 100
    right = r * np.array([np.sin(alpha), np.cos(alpha)])
    globe, lamp, near = (np.array([0.0, at]) for at in (z.value, 7.0, 1.5))
    assert seen_at(right, globe, 1e9) == pytest.approx(-np.arctan2(right[0], z.value - right[1]), abs=1e-6)
    assert abs(seen_at(right, globe, stitched.value)) < 1e-12
    assert abs(seen_at(right, lamp, stitched.value)) > 0.01
    says("at the seam nearer things are partly lost and farther ones doubled")
    assert seen_at(right, near, z.value) < 0  # the right camera shows what is to the right: this it does not show
    assert seen_at(right, lamp, z.value) > 0


def test_what_remains_far_from_the_ring(says):
    says("Of n cameras, each of the two beside a seam is turned α = π/n from it.")
    says(
        "Where the panorama is stitched for a distance S instead of infinity, about b (1/Z − 1/S) remains, far from "
        "the ring."
    )
    n, r, S = 6, 0.25, 30.0
    right = r * np.array([np.sin(np.pi / n), np.cos(np.pi / n)])
    for Z, within in ((1.0, 0.3), (10.0, 0.03)):
        exact = -2 * seen_at(right, np.array([0.0, Z]), S)
        assert 2 * right[0] * (1 / Z - 1 / S) == pytest.approx(exact, rel=within)
        assert exact > 1.01 * 2 * right[0] * (1 / Z - 1 / S)


def test_the_ring_of_the_picture_by_hand(says):
    r, b = says("with six cameras and r = 0.25 m, b is 0.25 m.")
    assert b == 2 * r.value * np.sin(np.pi / 6)
    width, over, per_radian = says("A panorama of 4000 px has 4000/(2π) = 637 px per radian.")
    assert over.value == width.value
    assert per_radian == over.value / (2 * np.pi)
    distance, px = says("So at 3 m b/Z says 53 px.")
    assert px == b.value / distance.value * over.value / (2 * np.pi)


def test_half_a_centimetre_between_lenses(says):
    px, distance, width = says(
        "Even half a centimetre between two lenses makes 3 px at a distance of 1 m, in a panorama of 4000."
    )
    assert px == 2 * np.arctan(0.0025 / distance.value) * width.value / (2 * np.pi)


# The earth and the cube ----------------------------------------------------------------------------------------------


def test_a_circle_on_the_sphere_stays_a_circle_or_becomes_a_line(says):
    says("A circle on the sphere stays a circle, or becomes a straight line")
    says("The middle is the south pole, and the horizon is the equator.")
    turn = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    cone = np.stack([0.5 * np.cos(turn), 0.5 * np.sin(turn), np.full(40, np.sqrt(0.75))], axis=-1)
    circle = unified(Rotation.from_euler("xy", [50, 30], degrees=True).apply(cone), 1.0, 1.0)
    fit, *_ = np.linalg.lstsq(np.column_stack([circle, np.ones(40)]), (circle**2).sum(axis=-1), rcond=None)
    radii = np.linalg.norm(circle - fit[:2] / 2, axis=-1)
    assert np.ptp(radii) < 1e-12
    meridian = unified(at_angle(np.array([10, 60, 150]), 0.7), 1.0, 1.0)
    assert bent(meridian) < 1e-12


def test_how_large_a_face_must_be(says):
    quarter, *_ = says("A quarter of the map's width, 180 px, is too small.")
    width, degrees, per_degree, again = says(
        "At the equator the map has 720/360 = 2 px per degree, that is 720/(2π) per radian."
    )
    assert (quarter.value, again.value) == (width.value / 4, width.value)
    assert per_degree == width.value / degrees.value
    assert degrees.value == np.degrees(2 * np.pi)
    over, needed, small, has = says("So w must be 720/π = 229 px; with 180 px the middle has only 1.57 px per degree.")
    assert over.value == width.value
    tangent = np.tan(np.radians(0.005))
    for side, wanted in ((small.value, has), (needed.value, per_degree)):
        assert wanted.about(side / 2 * 2 * tangent / 0.01, 0.005)  # of a face, by a hundredth of a degree
    assert needed == width.value / np.pi
    says("In its middle it has w/2 pixels per radian, and elsewhere more.")
    assert np.tan(np.radians(40.01)) - np.tan(np.radians(39.99)) > 2 * np.tan(np.radians(0.01))


# The exercises -------------------------------------------------------------------------------------------------------


def test_the_point_of_the_double_sphere_s_hint(says):
    point = says("Write down both distances for the point (0, 3, 4) with ξ = 1, by hand.")
    d1, *moved, squared = says(
        "D₁ is 5 there. The point is then moved by ξ D₁ along z, to (0, 3, 9), and D₂ is the distance of *that* "
        "point, √90."
    )
    there = np.array([0.0, *(one.value for one in point)])
    assert d1 == np.linalg.norm(there)
    there[2] += d1.value  # ξ is 1
    np.testing.assert_allclose(there[1:], [one.value for one in moved])
    assert squared == there @ there


def test_the_inverse_s_quadratic(says):
    (two,) = says("η is the larger root of the quadratic equation η² (1 + r²) − 2ηξ + ξ² = 1.")
    (again,) = says("η² (1 + r²) − 2 η ξ + ξ² = 1")
    assert two.value == again.value
    for xi, x in ((0.7, 1.4), (1.3, 0.8)):
        eta = np.roots([1 + x * x, -two.value * xi, xi * xi - 1]).max()
        ray = np.array([eta * x, 0, eta - xi])
        assert np.linalg.norm(ray) == pytest.approx(1)
        assert unified(ray, 1.0, xi)[0] == pytest.approx(x)
        assert ray[2] > -min(xi, 1 / xi)


def test_the_cube_s_side(says):
    (side,) = says("Your cube has side 1. Its faces are at ±1, so that its side is 2.")
    assert side == 1 - -1


def test_the_shapes_that_exercises_ask_for(says):
    flat, solid = says("Return the image points (…, 2), in focal lengths, of points (…, 3), by (X, Y)/(Z + ξD)")
    ray, pixel = says("Write the unit rays (…, 3) of any number of image points (…, 2), by the larger root.")
    direction, point, least = says(
        "Where do directions (…, 3) meet the cube with faces at ±1 around the camera? The answer is a point (…, 3), "
        "one of whose coordinates is +1 or −1."
    )
    (sign,) = says("you divide by the largest coordinate with its sign, and that makes −1 into +1")
    space = np.ones((5, int(solid.value)))
    image = cv2.omnidir.projectPoints(space[None], np.zeros(3), np.zeros(3), np.eye(3), 0.5, np.zeros(4))[0]
    assert image.shape[-1] == flat.value == pixel.value
    assert solid.value == ray.value == direction.value == point.value
    left = np.array([-2.0, 0.5, 1.0])
    assert (left / np.abs(left).max())[0] == least.value == sign.value
    assert (left / left[0])[0] == -sign.value


def test_the_units_in_the_ring_s_replies(says):
    (half_a_turn,) = says("α is in degrees in yours, 180/n.")
    (turn,) = says("Your angle is in radians, but you took width/360 pixels: that is per *degree*.")
    assert np.radians(half_a_turn.value) == np.pi
    assert np.radians(turn.value) == 2 * np.pi
    (two,) = says("The two cameras see the thing 2ψ apart")
    left, right = (seen_at(np.array([side, 0.2]), np.array([0.0, 2.0]), 1e9) for side in (-0.1, 0.1))
    assert left - right == pytest.approx(-two.value * right)


def cases(name):
    return list(exercise(name).cases(np.random.default_rng(5)))


def test_the_answers_are_camviz_s_own():
    for points, xi in cases("10.project"):
        np.testing.assert_allclose(lesson10.project(points, xi), UnifiedSphere(xi).project(points), atol=1e-12)
    for xy, xi in cases("10.unproject"):
        np.testing.assert_allclose(lesson10.unproject(xy, xi), UnifiedSphere(xi).unproject(xy), atol=1e-12)
    for points, xi, alpha in cases("10.double_sphere"):
        there = DoubleSphere(xi, alpha).project(points)
        np.testing.assert_allclose(lesson10.double_sphere(points, xi, alpha), there, atol=1e-12)
    for cameras, radius, distance, width in cases("10.parallax"):
        there = Ring(cameras, radius).parallax(distance, np.inf) * width / (2 * np.pi)
        assert lesson10.parallax(cameras, radius, distance, width) == pytest.approx(float(there), abs=1e-9)


def test_the_point_on_the_cube_lies_on_the_face_whose_camera_sees_the_direction(says):
    says("The coordinate that is ±1 names the face: +z front, +x right, −y up, and so on.")
    outwards = {"front": (0, 0, 1), "right": (1, 0, 0), "back": (0, 0, -1), "left": (-1, 0, 0), "up": (0, -1, 0)}
    outwards["down"] = (0, 1, 0)
    (directions,) = cases("10.cube_point")[2]
    for direction, on in zip(directions, lesson10.cube_point(directions), strict=True):
        seen = [np.all(np.abs(face_camera(face, 100).project(direction) - 49.5) <= 50) for face in FACES]
        assert sum(seen) == 1
        assert on @ outwards[FACES[seen.index(True)]] == pytest.approx(1)


# The commands --------------------------------------------------------------------------------------------------------


def commands():
    text = "\n".join(cell.source for cell in notebooks.read(LESSONS / "10_omnidirectional.ipynb").cells)
    return sorted(re.findall(r"`camviz ([^`]+)`", text))


@pytest.mark.thorough
def test_the_commands_of_the_lesson_run_as_they_are_written(tmp_path, monkeypatch, samples):
    monkeypatch.chdir(tmp_path)
    calibrate, reproject = commands()
    Path("pictures").mkdir()
    for number in (1, 2, 3, 4, 5, 6):
        shutil.copy(samples / f"left0{number}.jpg", "pictures")
    assert main(shlex.split(calibrate)) == 0
    assert not cv2.FileStorage("camera.yaml", cv2.FILE_STORAGE_READ).getNode("xi").empty()
    earth = np.random.default_rng(0).integers(0, 255, (180, 360, 3), dtype=np.uint8)
    cv2.imwrite("earth.jpg", earth)
    assert main(shlex.split(reproject)) == 0
    assert cv2.imread("window.png").std() > 5  # of a panorama of noise


# Before the lesson ---------------------------------------------------------------------------------------------------


def test_before_the_lesson_the_order_of_xi(says):
    says("Flat, hyperbolic, parabolic: from 0 up to 1.")
    says("All hyperbolas lie in between.")
    point = np.array([1.0, 0.5, 2.0])
    np.testing.assert_allclose(unified(point, 1.0, 0.0), point[:2] / point[2])
    eccentricity = np.array([1.0, 1.001, 1.5, 4.0, 1e6])  # Geyer and Daniilidis: ξ = 2e/(1 + e²)
    xi = 2 * eccentricity / (1 + eccentricity**2)
    assert xi[0] == 1
    assert (np.diff(xi) < 0).all()
    assert 0 < xi[-1] < 1e-5


def test_who_comes_nearer_loses_a_strip(says):
    S, first, last = says("stitched for 5 m. Straight out at a seam, a person comes nearer, from 5 m to 2 m.")
    at, behind = says("so that a thing at 2 m and what is 5 m away behind it cannot both fit")
    (whole,) = says("The person is whole at 5 m; then a strip of the person is lost at the seam.")
    (right,) = says("The panorama is right for what is 5 m away.")
    (fits,) = says("At 5 m they fit: this is the distance for which the panorama is stitched.")
    assert S.value == first.value == behind.value == whole.value == right.value == fits.value
    assert last.value == at.value
    alpha = np.pi / 8
    camera = 0.25 * np.array([np.sin(alpha), np.cos(alpha)])
    there = [seen_at(camera, np.array([0.0, one.value]), S.value) for one in (first, last)]
    assert abs(there[0]) < 1e-12
    assert there[1] < -0.01  # the right camera shows nothing left of the seam


def test_before_the_lesson_anna_and_ben(says):
    anna, xi_anna, ben, xi_ben, _ = fits = says(
        "Anna finds (f, ξ) = (300 px, 0.5), Ben (400 px, 1.0). Both fits leave 0.2 px."
    )
    assert fits[-1].value > 0  # the same for both: it tells nothing apart
    a, n, b, middle = says("In the middle they agree, since 300/1.5 and 400/2 are both 200 px.")
    assert (a.value, n.value) == (anna.value, 1 + xi_anna.value)
    assert (b.value, 2) == (ben.value, 1 + xi_ben.value)
    assert middle == a.value / n.value
    assert middle == b.value / 2
    mean, mean_xi = says("Use the mean, (350 px, 0.75).")
    assert mean == (anna.value + ben.value) / 2
    assert mean_xi == (xi_anna.value + xi_ben.value) / 2
    f, by, again = says("350/1.75 is 200 px once more")
    assert f == mean.value
    assert by == 1 + mean_xi.value
    assert again == f.value / by.value
    (apart,) = says("two values of f that are 100 px apart cannot both be right")
    assert apart == ben.value - anna.value
    near, far = (
        np.abs(unified(at_angle(t), anna.value, xi_anna.value) - unified(at_angle(t), ben.value, xi_ben.value)).max()
        for t in (5, 80)
    )
    assert near < 0.1 < 5 < far


def test_before_the_lesson_a_fisheye_that_looks_ahead(says):
    (across,) = says("It has a fisheye lens of 180°.")
    assert at_angle(across.value / 2 + 1)[2] < 0  # whatever is farther from the axis lies behind


# By hand -------------------------------------------------------------------------------------------------------------


def test_one_ray_reflected_by_hand(says):
    (e,) = says("The section of this mirror is a hyperbola with the eccentricity e = 1.5.")
    (angle,) = says("Take the point of the mirror 80° from the axis.")
    p, theta = 0.03, np.radians(angle.value)
    point = p / (1 + e.value * np.cos(theta)) * np.array([np.sin(theta), np.cos(theta)])
    camera = np.array([0.0, 2 * p * e.value / (e.value**2 - 1)])
    assert 1000 * camera[1] == pytest.approx(72.0)  # as printed
    difference = np.linalg.norm(point - camera) - np.linalg.norm(point)
    assert difference == pytest.approx(2 * p / (e.value**2 - 1))  # 2a, the same for every point of the hyperbola
    says("The reflected ray seems to come from the focus. So it is for every point of the mirror: a single viewpoint.")


def test_the_proof_that_the_rays_meet(says):
    says("the normal is then along u₂ − u₁")
    says("Both are unit vectors, so $|u_2 - u_1|^2 = 2\\,(1 - u_1 \\cdot u_2)$")
    says("the reflected ray continues the line from the first focus")
    u1, u2 = at_angle(20), at_angle(75, 1.0)
    assert np.sum((u2 - u1) ** 2) == pytest.approx(2 * (1 - u1 @ u2))
    assert u2 @ (u2 - u1) == pytest.approx(1 - u1 @ u2)
    np.testing.assert_allclose(reflected(u2, u2 - u1), u1)


def test_points_by_hand_and_the_reader_s_difference_from_opencv(says):
    (xi,) = says("Take f = 1 and ξ = 0.8, and put in a point in front of the camera, then two behind it:")
    says("A point a little behind the camera still has an image. The last one has none, because Z + ξD is negative.")
    depths = [Z + xi.value * np.sqrt(1 + 4 + Z * Z) for Z in (5.0, -1.0, -5.0)]
    assert [depth > 0 for depth in depths] == [True, True, False]
    (digits,) = says("Yours should differ by less than 1e-9 px.")
    alpha, f, point = 0.6291060871161842, 191.14799816648748, np.array([1.0, 2.0, 5.0])
    gamma, xi = f / (1 - alpha), alpha / (1 - alpha)
    K = np.diag([gamma, gamma, 1.0])
    there = cv2.omnidir.projectPoints(point.reshape(1, 1, 3), np.zeros(3), np.zeros(3), K, xi, np.zeros(4))[0].ravel()
    assert np.abs(unified(point, gamma, xi) - there).max() < digits.value


def test_the_published_double_sphere_and_the_first_answer_on_the_cube(says):
    f, xi, alpha = says("draws a flat grid through a published lens: f = 402.5 px, ξ = −0.075, α = 0.744, again")
    assert f == 0.5 * 805  # getTestProjections in basalt-headers, camera/double_sphere_camera.hpp
    assert xi == 0.5 * -0.150694
    assert alpha == 0.5 * 1.48785
    x, y, z, size, by, cx, cy, cz, face = says(
        "Take the direction (0.5, −1.5, 0.9). Its largest coordinate, by size, is −1.5. Divide all three by 1.5: "
        "(0.333, −1, 0.6) lies on the face y = −1, the upper one, for y points down."
    )
    direction = np.array([x.value, y.value, z.value])
    assert size == direction[np.abs(direction).argmax()]
    assert by == abs(size.value)
    for said, its in zip((cx, cy, cz), direction / by.value, strict=True):
        assert said == its
    assert face == cy.value


def test_every_twelfth_pixel_and_the_dots_above_the_lines(says):
    says("the ground below, the sky above")
    says("there your dots belong on them, and near the ring above them")
    for radius in (0.05, 0.15, 0.25):
        beside, along = radius * np.sin(np.pi / 6), radius * np.cos(np.pi / 6)
        near, far = (2 * np.arctan2(beside, Z - along) / (2 * beside / Z) for Z in (0.6, 20.0))
        assert near > 1.05
        assert far == pytest.approx(1, abs=0.02)


def test_the_half_circle_that_a_teacher_draws_on_the_board(says):
    *given, first, second, third = says(
        "rays that come straight down, 0.2, 0.5 and 0.8 from its axis. They are reflected, and prolonged behind the "
        "mirror they cross the axis at 0.51, 0.58 and 0.83 from the centre"
    )
    x = np.array([one.value for one in given])
    down = np.tile([0.0, -1.0], (3, 1))
    on = np.stack([x, np.sqrt(1 - x**2)], axis=-1)
    out = reflected(down, on)
    assert [first, second, third] == list(on[:, 1] - x * out[:, 1] / out[:, 0])
    says("Behind a parabola they all cross at one.")
    on = np.stack([x, 1 - x**2], axis=-1)
    out = reflected(down, np.stack([2 * x, np.ones(3)], axis=-1))
    np.testing.assert_allclose(on[:, 1] - x * out[:, 1] / out[:, 0], 0.75)


def test_the_double_sphere_with_the_bug_is_right_in_the_very_middle_only(says):
    says("The given function is right in the very middle only.")
    xi, alpha, x = -0.075, 0.744, np.linspace(0, 2, 11)
    d1 = np.hypot(x, 1)
    z = 1 + xi * d1
    apart = np.abs(x / (alpha * d1 + (1 - alpha) * z) - x / (alpha * np.hypot(x, z) + (1 - alpha) * z))
    assert apart[0] == 0
    assert (402.5 * apart[1:] > 4).all()
