"""What lesson 10 claims about mirrors, the unified sphere and rings, recomputed with OpenCV, NumPy and SciPy."""

import cv2
import numpy as np
import pytest
from claims import claims
from numpy.linalg import norm
from scipy.optimize import least_squares

from camviz.lenses import UnifiedSphere
from camviz.panoramas.cubemap import FACES, face_camera
from camviz_school.course.material import module

says = claims("10")
lesson10 = module("10")


def unified(points, f, xi):
    """Mei's formula by OpenCV, which has no ξ of 0."""
    flat = np.reshape(points, (1, -1, 3)).astype(float)
    return cv2.omnidir.projectPoints(flat, np.zeros(3), np.zeros(3), np.diag([f, f, 1.0]), xi, np.zeros(4))[0][0]


def at_angle(degrees):
    a = np.radians(degrees)
    return np.stack([np.sin(a), 0 * a, np.cos(a)], axis=-1)


def image(degrees, f, xi):
    return unified(at_angle(degrees), f, xi)[:, 0]


def reflected(rays, normals):
    normals = normals / norm(normals, axis=-1, keepdims=True)
    return rays - 2 * np.sum(rays * normals, axis=-1, keepdims=True) * normals


def ball():
    """Of a ball of 50 mm, 150 mm from its camera: its points, the rays from there, and the radii of their images."""
    phi = np.radians(np.linspace(0.05, 47.8, 4000))
    on = 50 * np.stack([np.sin(phi), np.cos(phi)], axis=-1)
    to = on - [0, 150]
    return on, reflected(to / norm(to, axis=-1, keepdims=True), on), to[:, 0] / -to[:, 1]


def test_the_rays_of_a_sphere_miss_one_point_by_3_mm():
    says("The rays of the sphere miss the best single point by 3.2 mm (root mean square).")
    says("A thing 0.3 m away is then seen 0.61° from where it is, and a thing 3 m away 0.061°.")
    on, out, rho = ball()
    rim = np.interp(np.radians(112), np.arctan2(out[:, 0], out[:, 1]), rho)
    x, z, dx, dz = (np.interp(np.linspace(0.02, 0.98, 60) * rim, rho, column) for column in (*on.T, *out.T))
    best = least_squares(lambda at: x * dz - (z - at) * dx, [30.0]).x
    missed = np.sqrt(np.mean((x * dz - (z - best) * dx) ** 2))
    assert missed == pytest.approx(3.2, abs=0.05)
    angles = np.degrees(np.arcsin(missed / np.array([300, 3000])))
    assert angles == pytest.approx([0.61, 0.061], rel=0.01)


def test_conics_reflect_one_focus_into_the_other():
    says("Such a mirror reflects rays that aim at one of its foci into the other.")
    says("the camera stands at the distance L = 2pe/(e² − 1) from the first focus")
    p, theta = 0.03, np.radians([20.0, 50, 80, 100])
    for e in (0.6, 1.5, 3.0):
        r, turn = p / (1 + e * np.cos(theta)), np.stack([np.sin(theta), np.cos(theta)], axis=-1)
        tangent = (r**2 * e * np.sin(theta) / p)[:, None] * turn + r[:, None] * turn[:, ::-1] * [1, -1]
        out = reflected(-turn, tangent[:, ::-1] * [1, -1])
        gap = [0, 2 * p * e / (e**2 - 1)] - r[:, None] * turn
        np.testing.assert_allclose(out[:, 0] * gap[:, 1] - out[:, 1] * gap[:, 0], 0, atol=1e-15)


def test_xi_1_is_the_parabola_and_the_stereographic_lens():
    says("Yes: X/(Z + D) = tan(θ/2), half of the stereographic 2 tan(θ/2).", "This is a parabolic mirror, and also")
    says("Flat, hyperbolic, parabolic: from 0 up to 1.", "All hyperbolas lie in between.", "No mirror has such a ξ")
    theta = np.array([10.0, 60, 120])
    np.testing.assert_allclose(image(theta, 1, 1.0), np.tan(np.radians(theta / 2)))
    np.testing.assert_allclose(UnifiedSphere(1.0).project(at_angle(theta))[:, 0], np.tan(np.radians(theta / 2)))
    e = np.linspace(1, 50, 5001)  # Geyer and Daniilidis: ξ = 2e/(1 + e²)
    assert (np.diff(2 * e / (1 + e**2)) < 0).all()
    says("Take f = 1 and ξ = 0.8, and put in a point in front of the camera, then two behind it:")
    points = np.array([[1.0, 2, 5], [1, 2, -1], [1, 2, -5]])
    mine = UnifiedSphere(0.8).project(points)
    for found in (mine[:2], lesson10.project(points[:2], 0.8)):
        np.testing.assert_allclose(found, unified(points[:2], 1, 0.8), atol=1e-9)
    np.testing.assert_allclose(lesson10.unproject(mine[:2], 0.8), points[:2] / norm(points[:2], axis=-1, keepdims=True))
    assert np.isnan(mine[2]).all()


def test_opencv_gives_an_image_to_points_that_have_none():
    says("for ξ ≤ 1 these have Z ≤ −ξD, and their image comes out mirrored through the middle")
    says("for ξ > 1 these have Z ≤ −D/ξ. They lie on the far side of the sphere and share their pixel with a point")
    for xi in (0.8, 1.7):
        limit = np.degrees(np.arccos(-min(xi, 1 / xi)))
        near, hidden = image(np.linspace(1, limit - 0.1, 999), 1, xi), image(np.array([limit + 5]), 1, xi)
        assert (np.diff(near) > 0).all()
        assert hidden[0] < 0 if xi < 1 else near[0] < hidden[0] < near[-1]


def test_the_middle_tells_f_over_1_plus_xi_only():
    says("You double the focal length f of a unified sphere with ξ = 1 and change ξ to 3")
    says("In the middle the three cameras agree to a few hundredths of a pixel.")
    says("At the rim they are more than 100 px apart.", "The rim does change, but it shrinks: a larger ξ draws it in.")
    cameras = ((300.0, 1e-12), (600.0, 1.0), (1200.0, 3.0))
    middle, rim = (np.ravel([image(t, *one) for one in cameras]) for t in (3, 79))
    assert 0.005 < np.ptp(middle) < 0.02
    assert (np.diff(rim) < -100).all()
    says("By hand: 560/2.1 and 400/1.5 are both 266.7 px.")
    says("At θ = 0.5 the first camera draws the ray 135.76 px from the middle, and the second 139.21 px.")
    says("At 15° the two cameras are 0.47 px apart, at 66° 63 px.")
    assert pytest.approx([266.7] * 2, abs=0.05) == [560 / 2.1, 400 / 1.5]
    theta = np.array([np.degrees(0.5), 15, 66])
    first, second = image(theta, 560, 1.1), image(theta, 400, 0.5)
    assert [first[0], second[0]] == pytest.approx([135.76, 139.21], abs=5e-3)
    assert (second - first)[1:] * [100, 1] == pytest.approx([47, 63], abs=0.5)
    np.testing.assert_allclose(lesson10.apart(np.radians(theta), 560, 1.1, 0.5), second - first, atol=0.02)


def test_a_polynomial_fits_a_sphere_whose_viewpoint_moves():
    says("There ρ = f tan(θ/2), and then ρ / tan θ = f/2 − ρ²/(2f).")
    theta = np.radians(np.arange(5, 100.0))
    np.testing.assert_allclose(lesson10.polynomial(np.tan(theta / 2), theta), [0.5, -0.5, 0, 0], atol=1e-12)
    says("With four, the hyperbola's error stays below 0.02°, and the sphere's below 0.3°.")
    on, rays, rho = ball()
    angles = np.arctan2(rays[:, 0], rays[:, 1])
    theta = np.linspace(0.02, 1, 200) * np.pi / 2
    there = np.linspace(0.02, 1, 200) * np.interp(np.pi / 2, angles, rho)
    for x, t, below in (
        (np.sin(theta) / (np.cos(theta) + 0.8), theta, 0.02),
        (there, np.interp(there, rho, angles), 0.3),
    ):
        A = (x / x.max())[:, None] ** [0, 2, 3, 4]
        z = A @ np.linalg.lstsq(A, x / np.tan(t), rcond=None)[0]
        assert below / 2 < np.degrees(np.abs(np.arctan2(x, z) - t)).max() < below
    says("The ray from 90° crosses the axis 9.8 mm nearer to the camera than the rays from near the axis.")
    crossing = np.interp(np.radians([1, 90]), angles, on[:, 1] - on[:, 0] * rays[:, 1] / rays[:, 0])
    assert np.diff(crossing)[0] == pytest.approx(9.8, abs=0.05)
    says("is then 0.19° from where the polynomial says, and one 0.3 m away 1.9°")
    off = np.degrees(np.arcsin(np.diff(crossing)[0] / np.array([3000, 300])))
    assert off == pytest.approx([0.19, 1.9], rel=0.026)


def test_parallax_in_a_ring_s_panorama():
    says("Six cameras look outwards from a ring of 25 cm radius", "At a seam stands a globe, 3 m away.")
    says("with six cameras and r = 0.25 m, b is 0.25 m.", "A panorama of 4000 px has 4000/(2π) = 637 px per radian.")
    says("So at 3 m b/Z says 53 px.", "Even half a centimetre between two lenses makes 3 px at a distance of 1 m")
    assert 0.5 * np.sin(np.pi / 6) == pytest.approx(0.25)
    per_radian = 4000 / (2 * np.pi)
    assert [per_radian, 0.25 / 3 * per_radian] == pytest.approx([637, 53], abs=0.5)
    assert 2 * np.arctan(0.0025) * per_radian == pytest.approx(3, abs=0.5)
    exact = 2 * np.arctan2(0.125, 3 - 0.25 * np.cos(np.pi / 6))  # where the right camera sees the globe, twice
    assert lesson10.parallax(6, 0.25, 3.0, 4000) == pytest.approx(exact * per_radian)


def test_the_faces_of_a_cube():
    says("So w must be 720/π = 229 px; with 180 px the middle has only 1.57 px per degree.")
    assert 720 / np.pi == pytest.approx(229, abs=0.5)
    assert 90 * np.tan(np.radians(1)) == pytest.approx(1.57, abs=5e-3)
    assert np.degrees(2 * np.arctan(1)) == pytest.approx(90)
    says(
        "Six pinholes of 90° see everything",
        "(0.333, −1, 0.6) lies on the face y = −1",
    )
    direction = np.array([0.5, -1.5, 0.9])
    on = lesson10.cube_point(direction)
    assert on == pytest.approx([0.333, -1, 0.6], abs=5e-4)
    seen = [face for face in FACES if (np.abs(face_camera(face, 100).project(direction) - 49.5) <= 50).all()]
    assert seen == ["up"]


def test_question_conversion():
    says("A file gives α = 0.6 and f = 190 px for a unified sphere", "ξ = 1.5, γ = 475 px", "γ/(1 + ξ) = 190 px = f")
    point = np.array([0.4, 0.7, -0.1])
    in_alpha = 190 * point[:2] / (0.6 * norm(point) + 0.4 * point[2])
    matches = [np.allclose(unified(point, f, xi), in_alpha) for f, xi in ((475, 1.5), (190, 0.6), (190, 1.5))]
    assert matches == [True, False, False]
    assert pytest.approx(190) == 475 / 2.5


def test_questions_rms():
    says("Yes: 266.7 px both times.")
    says("(f, ξ) = (560, 1.1) and (640, 1.4). Both have an RMS of 0.2 px.", "560/2.1 and 640/2.4 are both 266.7")
    says("The mean is (600, 1.25), with 266.7 px once more.", "since 300/1.5 and 400/2 are both 200 px")
    says("Anna finds (f, ξ) = (300 px, 0.5), Ben (400 px, 1.0).", "350/1.75 is 200 px once more")
    assert pytest.approx([266.7] * 3, abs=0.05) == [560 / 2.1, 640 / 2.4, 600 / 2.25]
    assert 300 / 1.5 == 400 / 2 == 350 / 1.75 == 200
    assert np.abs(image(15, 560, 1.1) - image(15, 640, 1.4)) < 0.2
    near, far = (np.abs(image(t, 300, 0.5) - image(t, 400, 1.0)) for t in (5, 80))
    assert near < 0.2 < 5 < far


def test_questions_seam_and_fisheye():
    """Where the right camera's ray to a person at the seam meets the circle for which the panorama is stitched."""
    says(
        "stitched for 5 m. Straight out at a seam, a person comes nearer, from 5 m to 2 m.",
        "The person is whole at 5 m",
    )
    camera = 0.25 * np.array([np.sin(np.pi / 8), np.cos(np.pi / 8)])
    for Z, lost in ((5.0, False), (2.0, True)):
        ray = (np.array([0, Z]) - camera) / norm(np.array([0, Z]) - camera)
        b = camera @ ray
        hit = camera + (-b + np.sqrt(b * b - camera @ camera + 5**2)) * ray
        assert (hit[0] < -0.01) == lost
    says("A fisheye of more than 180° that looks straight up is both", "It has a fisheye lens of 180°.")
    assert at_angle(180 / 2 + 1)[2] < 0 < at_angle(180 / 2 - 1)[2]
