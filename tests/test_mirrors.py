"""Cameras that look into mirrors: their rays obey the law of reflection, and the models follow from it."""

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Intrinsics
from camviz.lenses import UnifiedSphere
from camviz.panoramas.mirrors import Catadioptric, Mirror, MirrorLens, direction_error, eccentricity, miss, photograph
from camviz.scenes import Scene, Texture
from camviz.scenes.surfaces import Sphere

MIRRORS = [Mirror(1.0, 0.04, 0.09), Mirror(1.3, 0.05, 0.08), Mirror(2.5, 0.03, 0.05), Mirror(40.0, 2.0, 0.05)]
CENTRAL = pytest.mark.parametrize("mirror", MIRRORS, ids=lambda mirror: f"e={mirror.eccentricity:g}")


def disc(camera, rng, count=2000):
    """Image points (count, 2) all over the mirror's image."""
    turn, radius = rng.uniform(0, 2 * np.pi, count), camera.rim() * np.sqrt(rng.uniform(0, 1, count))
    return radius[:, None] * np.stack([np.cos(turn), np.sin(turn)], axis=-1)


@CENTRAL
def test_from_the_second_focus_every_reflected_ray_prolonged_passes_through_the_first(mirror):
    camera = Catadioptric.central(mirror)
    points, directions = camera.trace(disc(camera, np.random.default_rng(1)))
    assert np.isfinite(points).all()
    assert miss(points, directions).max() < 1e-12
    assert (np.sum(points * directions, axis=-1) > 0).all()  # away from the mirror, out into the world


@CENTRAL
def test_rays_meet_the_conic_of_foci_and_are_reflected_at_equal_angles(mirror):
    """A hyperbola is the points whose distances to its foci differ by 2a = 2p/(e² - 1); a parabola has a directrix."""
    camera = Catadioptric.central(mirror)
    xy = disc(camera, np.random.default_rng(2))
    points, out = camera.trace(xy)
    to_focus, e = np.linalg.norm(points, axis=-1), mirror.eccentricity
    if e > 1:
        apart = np.linalg.norm(points - (0, 0, mirror.second_focus), axis=-1) - to_focus
        np.testing.assert_allclose(apart, 2 * mirror.curvature_radius / (e * e - 1), rtol=1e-12)
    else:
        np.testing.assert_allclose(to_focus, 2 * mirror.top - points[:, 2], rtol=1e-12)
    _, came = camera.before(xy)
    halfway = out - came  # the normal halves the angle, whatever the surface
    halfway /= np.linalg.norm(halfway, axis=-1, keepdims=True)
    radius, h = np.hypot(*points[:, :2].T), 1e-7
    slope = (mirror.depth(radius + h - 2 * h * (radius > radius.mean())) - mirror.depth(radius)) / (
        h - 2 * h * (radius > radius.mean())
    )
    np.testing.assert_allclose(np.hypot(*halfway[:, :2].T) / halfway[:, 2], slope, atol=2e-5)


@CENTRAL
def test_a_traced_mirror_is_the_unified_sphere(mirror):
    """Geyer & Daniilidis 2000: ξ = 2e/(1 + e²); both ways, to 1e-9."""
    camera = Catadioptric.central(mirror)
    xi, scale = camera.unified
    xy = disc(camera, np.random.default_rng(3))
    _, directions = camera.trace(xy)
    lens = UnifiedSphere(xi)
    np.testing.assert_allclose(scale * lens.project(directions), xy, atol=1e-9 * camera.rim())
    np.testing.assert_allclose(lens.unproject(xy / scale), directions, atol=1e-9)


@CENTRAL
def test_what_a_calibration_of_directions_knows_of_a_central_camera_is_the_unified_sphere(mirror):
    camera = Catadioptric.central(mirror)
    xi, scale = camera.unified
    xy = disc(camera, np.random.default_rng(4)) * 0.999
    lens = MirrorLens(camera)
    np.testing.assert_allclose(lens.unproject(xy), UnifiedSphere(xi).unproject(xy / scale), atol=1e-6)
    np.testing.assert_allclose(lens.project(lens.unproject(xy)), xy, atol=1e-6 * camera.rim())


def test_xi_goes_from_a_flat_mirror_to_a_paraboloid():
    """Barreto & Araujo 2001 write ξ = d/√(d² + 4p²) with d between the foci, 4p the latus rectum."""
    for xi in (0.05, 0.4, 0.8, 0.99):
        mirror = Mirror(eccentricity(xi), 0.05)
        d, p = mirror.second_focus, mirror.curvature_radius / 2
        assert d / np.hypot(d, 2 * p) == pytest.approx(xi, rel=1e-12)
        assert Catadioptric.central(mirror).unified[0] == pytest.approx(xi, rel=1e-12)
    assert eccentricity(1.0) == 1
    assert Mirror(1.0, 0.05).second_focus == np.inf


def test_light_along_the_axis_of_a_sphere_has_the_nephroid_for_its_caustic():
    """Huygens 1690: for rays parallel to the axis, met at angle φ, r = R sin³φ and z = R cos φ (1 + 2 sin²φ)/2."""
    R = 0.06
    camera = Catadioptric(Mirror(0.0, R, 0.055), np.inf)
    phi = np.linspace(0.1, 1.1, 21)
    found = camera.caustic(R * np.sin(phi))
    np.testing.assert_allclose(found[:, 0], R * np.sin(phi) ** 3, atol=1e-8 * R + 1e-11)
    np.testing.assert_allclose(found[:, 1], R * np.cos(phi) * (1 + 2 * np.sin(phi) ** 2) / 2, atol=1e-9)


def test_only_in_the_focus_does_the_caustic_shrink_to_a_point():
    central = Catadioptric.central(Mirror(1.3, 0.05, 0.08))
    xs = np.linspace(0.05, 0.99, 40) * central.rim()
    assert np.abs(central.caustic(xs)).max() < 1e-8
    moved = central.moved(0.05)
    assert np.nanmax(np.ptp(moved.caustic(xs[:30]), axis=0)) > 1e-3
    sphere = Catadioptric(Mirror(0.0, 0.05, 0.045), 0.3)
    for camera in (moved, sphere):
        points, directions = camera.trace(np.stack([xs * camera.rim() / central.rim(), 0 * xs], axis=-1))
        z = camera.best_viewpoint(xs * camera.rim() / central.rim())
        best = np.sqrt(np.mean(miss(points, directions, (0, 0, z)) ** 2))
        for other in (z - 1e-4, z + 1e-4):
            assert np.sqrt(np.mean(miss(points, directions, (0, 0, other)) ** 2)) > best > 1e-4


def up():
    """world_from_viewpoint of a mirror above a camera that looks straight up: z, the middle of the image, is down."""
    return RigidTransform.from_rotation(Rotation.from_euler("x", -90, degrees=True))


def spotted(camera, direction, start, distance):
    """The image point (2,) of a white ball `distance` metres from `start` along `direction`: found, then zoomed."""
    at = up().apply(start + distance * direction)
    scene = Scene([Sphere(at, 0.01 * distance, Texture.plain((1.0, 1.0, 1.0)), "ball")], Texture.plain((0.0, 0.0, 0.0)))
    pixels = Intrinsics(301, 301, 150 / camera.rim(), 150 / camera.rim(), 150, 150)
    uv = _centroid(scene, camera, pixels)
    fine = pixels.resized(301 * 16, 301 * 16)
    u, v = np.rint(fine.to_pixels(pixels.from_pixels(uv))).astype(int) - 75
    window = fine.cropped(int(u), int(v), 151, 151)
    return window.from_pixels(_centroid(scene, camera, window))


def _centroid(scene, camera, pixels):
    light = photograph(scene, camera, pixels, up()).sum(axis=-1)
    light[np.isnan(camera.trace(pixels.from_pixels(pixels.grid()))[0][..., 0])] = 0
    return np.average(pixels.grid().reshape(-1, 2), axis=0, weights=light.ravel())


def test_a_ball_at_any_distance_is_photographed_where_the_unified_sphere_says():
    camera = Catadioptric.central(Mirror(1.4, 0.05, 0.08))
    xi, scale = camera.unified
    direction = np.array([0.8, 0.5, 0.3]) / np.linalg.norm([0.8, 0.5, 0.3])
    expected = scale * UnifiedSphere(xi).project(direction)
    for distance in (0.4, 6.0):
        found = spotted(camera, direction, np.zeros(3), distance)
        np.testing.assert_allclose(found, expected, atol=1e-3 * camera.rim())


def test_without_a_single_viewpoint_the_error_of_a_direction_depends_on_the_distance():
    """What is photographed at a pixel was given that pixel's direction; sin ε = miss / distance says how wrong."""
    camera = Catadioptric(Mirror(0.0, 0.10, 0.095), 0.5)
    viewpoint = np.array([0, 0, camera.best_viewpoint(np.linspace(0.02, 0.98, 50) * camera.rim())])
    direction = np.array([0.9, 0.0, 0.1]) / np.hypot(0.9, 0.1)
    for distance in (0.5, 1.0, 4.0):
        point, seen = camera.trace(spotted(camera, direction, viewpoint, distance))
        mistaken = np.arccos(seen @ direction)
        expected = direction_error(miss(point, seen, viewpoint), distance)
        assert mistaken == pytest.approx(expected, abs=1e-4)
        assert expected > 0.003 / distance


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda: Mirror(-1, 0.1), "eccentricity"),
        (lambda: Mirror(1, 0), "curvature_radius"),
        (lambda: Mirror(1, 0.1, 0), "rim"),
        (lambda: Mirror(0.5, 0.1).second_focus, "eccentricity"),
        (lambda: Catadioptric(Mirror(0, 0.1), 0.05), "distance"),
        (lambda: Catadioptric(Mirror(1.5, 0.1), 0.3).unified, "distance"),
        (lambda: eccentricity(1.2), "xi"),
    ],
)
def test_what_makes_no_camera_is_refused_by_name(make, name):
    with pytest.raises(ValueError, match=name):
        make()
