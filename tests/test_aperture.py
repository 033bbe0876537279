"""The thin-lens camera: what its rays make agrees with the closed forms, and the fast way with every ray traced."""

from itertools import product

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from camviz import optics
from camviz.cameras import Intrinsics
from camviz.scenes import Rectangle, Scene, Texture, render, textured_scene, to_display
from camviz_school.views import aperture, parallax
from camviz_school.views.aperture import Aperture, ThinLensCamera, spiral

BLACK, WHITE = Texture.plain((0, 0, 0)), Texture.plain((1, 1, 1))
PLACE = RigidTransform.from_translation([0.5, 0.5, 1.0])  # in the garden, 2.3 m from the globe


def point_of_light(camera, depth_m, radius_px):
    """A white square on the axis that looks 2 `radius_px` wide, under a black sky: flat, so that it has one depth."""
    half = radius_px * depth_m / camera.camera.intrinsics.fx
    return Scene([Rectangle([-half, -half, depth_m], [2 * half, 0, 0], [0, 2 * half, 0], WHITE)], BLACK)


def spread(picture):
    """The variance (2,) of light about its centre, in pixels squared along u and v."""
    light = picture[..., 1].astype(float)
    v, u = np.indices(light.shape)
    mean = [(light * a).sum() / light.sum() for a in (u, v)]
    return np.array([(light * (a - m) ** 2).sum() / light.sum() for a, m in zip((u, v), mean, strict=True)])


def blur_diameter(take, scene, camera, samples=64, softened=0.0):
    """Diameter of the disc whose variance the lens adds, D²/16 along either axis, beside `softened` pixels squared."""
    sharp = ThinLensCamera(camera.width, camera.height, camera.sensor_mm, camera.focal_mm, 1e7, camera.focus_m)
    added = spread(take(scene, camera, samples)) - spread(take(scene, sharp, 1))
    return 4 * np.sqrt(added.mean() - softened)


LENSES = [
    (focal, number, focus, depth)
    for focal in (20, 50, 100)
    for number in (1.4, 22)
    for focus, depth in ((0.8, 0.6), (0.8, 1.0), (0.8, 30.0), (3.0, 0.7), (3.0, 6.0), (10.0, 0.8), (10.0, 9.0))
]


@pytest.mark.sampled(10)
@pytest.mark.parametrize(("focal", "number", "focus", "depth"), LENSES)
def test_a_traced_point_is_as_blurred_as_the_closed_form_says(focal, number, focus, depth):
    """Within 2 %, over all of the visualizer's range; seen through a loupe, so that every blur is 40 pixels wide."""
    blur_mm = optics.circle_of_confusion_mm(focal, number, 1000 * focus, 1000 * depth)
    camera = ThinLensCamera(64, 64, 64 * blur_mm / 40, focal, number, focus)
    scene = point_of_light(camera, depth, 5)
    assert blur_diameter(aperture.photograph, scene, camera) == pytest.approx(40, rel=0.02)


@pytest.mark.parametrize(("focal", "number", "focus", "depth"), [
    (50, 1.4, 0.8, 3.0), (100, 1.4, 3.0, 8.0), (100, 2.8, 4.0, 2.0), (100, 1.4, 10.0, 2.0), (50, 1.4, 0.8, 0.6),
])  # fmt: skip
def test_the_fast_picture_of_a_point_is_as_blurred_too(focal, number, focus, depth):
    camera = ThinLensCamera(320, 240, 36, focal, number, focus)
    scene = point_of_light(camera, depth, 9)
    assert camera.blur_px(depth) > 4
    between = 1 / 6  # of a pixel squared, by which looking up between pixels softens: the mean of t (1 - t)
    found = blur_diameter(parallax.photograph, scene, camera, softened=between)
    assert found == pytest.approx(camera.blur_px(depth), rel=0.02)


@pytest.mark.parametrize(
    ("focal", "number", "focus"), [(50, 1.4, 2.3), (50, 1.4, 6.0), (100, 2.0, 0.8), (24, 1.4, 1.0)]
)
def test_the_fast_picture_is_the_one_with_every_ray_traced(focal, number, focus):
    """33 dB in the garden, where things hide one another, and 3 dB nearer than a picture without blur would be."""
    camera = ThinLensCamera(240, 180, 36, focal, number, focus, world_from_cam=PLACE)
    exact, fast = (
        to_display(take(textured_scene(), camera, 16)) for take in (aperture.photograph, parallax.photograph)
    )
    sharp = to_display(render(textured_scene(), camera.camera))
    assert cv2.PSNR(fast, exact) > max(33, cv2.PSNR(sharp, exact) + 3)


@pytest.mark.parametrize("focus", [0.7, 1.3, 2.3, 6.0])
def test_a_rough_picture_is_softer_but_every_part_of_it_is_where_it_belongs(focus):
    """To a fifth of a pixel in each quarter of the picture, whatever the enlargement."""
    camera = ThinLensCamera(240, 180, 36, 50, 4.0, focus, world_from_cam=PLACE)
    fine, rough = (
        cv2.cvtColor(parallax.photograph(textured_scene(), camera, 16, rough=rough), cv2.COLOR_RGB2GRAY)
        for rough in (False, True)
    )
    assert cv2.PSNR(to_display(fine), to_display(rough)) > 30
    for rows, columns in product((np.s_[:90], np.s_[90:]), (np.s_[:120], np.s_[120:])):
        shift, _ = cv2.phaseCorrelate(fine[rows, columns], rough[rows, columns])
        assert np.abs(shift).max() < 0.2


def test_a_layer_of_a_single_column_is_enlarged_to_one():
    """Its rows 7 … 11, seen from row 23.5, the middle, are 6.2 … 10.4 then: four of them."""
    pixels, column = Intrinsics.from_fov(64, 48, 60), np.ones((5, 1), np.float32)
    part = parallax.Layer(10, 7, np.dstack([column] * 4), column, 1.0)
    larger = parallax._enlarged(part, pixels, pixels.fx / 1.05)
    assert (larger.top, larger.nearness.shape) == (7, (4, 1))


def test_a_camera_that_is_turned_sees_the_same_both_ways():
    pose = PLACE * RigidTransform.from_rotation(Rotation.from_euler("yxz", [-0.3, 0.1, 0.2]))
    camera = ThinLensCamera(160, 120, 36, 50, 1.4, 4.0, world_from_cam=pose)
    exact, fast = (to_display(take(textured_scene(), camera, 8)) for take in (aperture.photograph, parallax.photograph))
    assert cv2.PSNR(exact, fast) > 34


def test_every_point_of_the_lens_sees_the_plane_in_focus_at_the_same_pixels():
    camera = ThinLensCamera(focal_mm=85, f_number=1.4, focus_m=3.0, world_from_cam=PLACE)
    plane = PLACE.apply(np.array([[0.3, -0.2, 3.0], [-0.5, 0.4, 3.0], [0, 0, 3.0]]))
    middle = camera.camera.project(plane)
    for point in spiral(7):
        np.testing.assert_allclose(camera.seen_from(point).project(plane), middle, atol=1e-9)
    rim = camera.seen_from([1.0, 0.0])
    far = PLACE.apply(np.array([[0.0, 0.0, 9.0]]))
    assert (rim.project(far) - camera.camera.project(far))[0, 0] == pytest.approx(camera.blur_px(9.0) / 2, rel=1e-9)


def test_the_mean_of_the_points_views_is_what_rays_traced_one_by_one_bring():
    """The definition: from a point of the lens through the place of the pixel on the plane in focus."""
    camera = ThinLensCamera(64, 48, 36, 50, 1.4, 1.5, world_from_cam=PLACE)
    scene, light = textured_scene(), 0.0
    rays = camera.camera.lens.unproject(camera.camera.intrinsics.from_pixels(camera.camera.intrinsics.grid()))
    focused = 1.5 * rays / rays[..., 2:]
    for x, y in spiral(4) * camera.aperture_mm / 2000:
        ways = focused - (x, y, 0)
        ways /= np.linalg.norm(ways, axis=-1, keepdims=True)
        light = light + scene.trace(PLACE.apply([x, y, 0]), ways, spread=1 / camera.camera.intrinsics.fx)[0] / 4
    assert cv2.PSNR(to_display(light), to_display(aperture.photograph(scene, camera, 4))) > 40


def test_covering_half_the_lens_halves_the_light_and_crops_nothing():
    open_, half = (
        ThinLensCamera(96, 72, 36, 50, 2.0, 6.0, Aperture(covered=covered), world_from_cam=PLACE)
        for covered in ("nothing", "left half")
    )
    whole, masked = (parallax.photograph(textured_scene(), camera, 256) for camera in (open_, half))
    ratio = masked.sum(axis=2) / whole.sum(axis=2)
    assert np.median(ratio) == pytest.approx(0.5, abs=0.01)
    assert ratio.min() > 0.25  # every pixel keeps its light, near enough: nowhere is the picture cut off
    assert ratio.max() < 0.75


def test_a_half_covered_lens_leaves_half_discs_one_way_round_beyond_the_focus_and_the_other_before_it():
    lens = ThinLensCamera(128, 128, 6, 50, 1.4, 1.5, Aperture(covered="left half"))
    for depth, side in ((4.0, 1), (0.8, -1)):
        light = aperture.photograph(point_of_light(lens, depth, 5), lens, 128)[..., 1]
        u = np.indices(light.shape)[1] - (light.shape[1] - 1) / 2
        shift = (light * u).sum() / light.sum()
        assert side * shift == pytest.approx(2 / (3 * np.pi) * lens.blur_px(depth), rel=0.05)  # a half disc's centroid


@pytest.mark.parametrize(("shape", "area"), [
    (Aperture(), 1.0),
    (Aperture("polygon", blades=6), 3 * np.sin(np.pi / 3) / np.pi),
    (Aperture("polygon", blades=3), 1.5 * np.sin(2 * np.pi / 3) / np.pi),
    (Aperture("ring"), 1 - 0.6**2),
    (Aperture(covered="upper half"), 0.5),
    (Aperture(mask=np.array([[1.0, 0.0], [0.0, 0.5]])), 0.375),
], ids=["disc", "hexagon", "triangle", "ring", "half", "picture"])  # fmt: skip
def test_an_aperture_passes_the_share_of_light_that_is_its_area(shape, area):
    assert shape.passes(spiral(20_000)).mean() == pytest.approx(area, abs=4e-3)


def test_shapes_stand_upright():
    heart, triangle = Aperture("heart"), Aperture("polygon", blades=3)
    assert heart.passes(np.array([[0.0, 0.6], [0.5, -0.4]])).all()  # its tip is below
    assert not heart.passes(np.array([[0.5, 0.6], [0.0, -0.85]])).any()
    assert triangle.passes(np.array([[0.0, -0.9]])).all()  # a corner is above
    assert not triangle.passes(np.array([[0.0, 0.9]])).any()


def test_samples_are_spread_like_the_disc_they_stand_for():
    points = spiral(64)
    assert np.linalg.norm(points, axis=1).max() < 1
    assert (points**2).sum(axis=1).mean() == pytest.approx(0.5)
    np.testing.assert_allclose(points.mean(axis=0), 0, atol=0.01)
    apart = np.linalg.norm(points[:, None] - points, axis=-1) + 9 * np.eye(64)
    assert apart.min() > 0.9 / np.sqrt(64)  # no two close together: random points come as near as a tenth of that


@pytest.mark.parametrize(("bad", "word"), [
    ({"focal_mm": 0}, "focal_mm"), ({"f_number": -1}, "f_number"), ({"focus_m": 0.04}, "beyond the focal length"),
    ({"sensor_mm": np.nan}, "sensor_mm"),
])  # fmt: skip
def test_a_camera_that_cannot_be_is_refused_by_name(bad, word):
    with pytest.raises(ValueError, match=word):
        ThinLensCamera(**bad)


@pytest.mark.parametrize(("bad", "word"), [
    ({"shape": "star"}, "shape"), ({"blades": 2}, "blades"), ({"covered": "all"}, "covered"),
    ({"mask": np.ones(3)}, "mask"), ({"mask": np.full((2, 2), 1.5)}, "mask"),
])  # fmt: skip
def test_an_aperture_that_cannot_be_is_refused_by_name(bad, word):
    with pytest.raises(ValueError, match=word):
        Aperture(**bad)
    with pytest.raises(ValueError, match="samples"):
        spiral(0)
