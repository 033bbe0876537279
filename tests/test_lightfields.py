"""Light fields: what a shear does is what a lens does, and the slope of a line is a depth."""

from functools import cache

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.spatial.transform import RigidTransform

from camviz.cameras import Camera, Intrinsics
from camviz.lightfields import (
    APERTURES,
    LightField,
    Openings,
    aperture,
    disparity_by_structure,
    disparity_by_sweep,
    epipolar_plane_image,
    exact_range,
    fourier_slice,
    from_microlens_image,
    from_mosaic,
    periodic_shift_and_sum,
    photograph_field,
    read_folder,
    refocus,
    to_microlens_image,
    to_mosaic,
    true_disparity,
)
from camviz.scenes import Rectangle, Scene, Texture, render, textured_scene, to_encoded, to_linear
from camviz.scenes.photographs import photograph

RNG = np.random.default_rng(5)
EMPTY = np.zeros((1, 1, 1, 1, 3))
BENCHMARK = LightField(EMPTY, baseline=0.025, focal_length=100 / 35 * 512, focus_distance=4.25)


def random_field(rows=3, columns=4, height=10, width=12, **known):
    return LightField(np.random.default_rng(2).random((rows, columns, height, width, 3), dtype=np.float32), **known)


def picture_at(depth: float) -> Scene:
    """A photograph two metres wide, `depth` metres before the camera, and nothing else."""
    cat = photograph("chelsea")
    height = 2 * cat.shape[0] / cat.shape[1]
    return Scene(
        [Rectangle(np.array([-1, -height / 2, depth]), np.array([2.0, 0, 0]), np.array([0, height, 0]), Texture(cat))]
    )


# Slope, depth and α -----------------------------------------------------------------------------------------------


def test_disparities_of_the_published_benchmark_are_its_depths():
    np.testing.assert_allclose(BENCHMARK.depth([-1.6, 0, 1.5]), [5.2207, 4.25, 3.6191], atol=5e-5)
    np.testing.assert_allclose(BENCHMARK.disparity([5.2207, 4.25, 3.6191]), [-1.6, 0, 1.5], atol=5e-4)


def test_a_slope_steeper_than_infinity_s_has_no_depth():
    beyond = BENCHMARK.disparity(np.inf)
    assert BENCHMARK.depth(beyond) > 1e12
    assert np.isnan(BENCHMARK.depth(beyond - 0.01))
    assert np.isnan(LightField(EMPTY).depth(1.0))


def test_alpha_is_the_ratio_of_the_image_distances_of_the_thin_lens_equation():
    """1/f = 1/z + 1/v for both planes; the pitch that makes focal_length pixels of the distance v_focus."""
    f, focus, pitch = 0.1, 4.25, 35e-3 / 512
    image = lambda z: 1 / (1 / f - 1 / z)  # noqa: E731
    field = LightField(EMPTY, baseline=0.025, focal_length=image(focus) / pitch, focus_distance=focus)
    depth = np.array([2.0, 3.6191, 4.25, 5.2207, 100])
    np.testing.assert_allclose(field.alpha(field.disparity(depth), pitch), image(depth) / image(focus), rtol=1e-12)


def test_equal_steps_of_slope_are_not_equal_steps_of_alpha():
    alpha = BENCHMARK.alpha([-100, 0, 100], 35e-3 / 512)
    assert alpha[1] == 1
    assert alpha[2] - alpha[1] > 1.5 * (alpha[1] - alpha[0])


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        ({"views": np.zeros((2, 2, 3, 3))}, r"views must have shape .*got \(2, 2, 3, 3\)"),
        ({"views": np.zeros((0, 2, 3, 3, 3))}, "views must have shape"),
        ({"views": np.zeros((1, 1, 3, 3, 3), int)}, "views must be sRGB bytes"),
        ({"baseline": 0.0}, "baseline must be a positive number of metres"),
        ({"focal_length": -3.0}, "focal_length must be a positive number of pixels"),
        ({"focus_distance": 0.0}, "focus_distance must be a positive"),
    ],
)
def test_a_field_that_makes_no_sense_is_refused_by_name(bad, words):
    with pytest.raises(ValueError, match=words):
        LightField(**{"views": EMPTY, **bad})


# The rendered field -----------------------------------------------------------------------------------------------


@cache
def garden():
    camera = Camera(Intrinsics.from_fov(120, 90, 38), world_from_cam=RigidTransform.from_translation([0.15, 0.55, 0]))
    field = photograph_field(textured_scene(), camera, 5, 5, 16 / camera.intrinsics.fx, 4.0)
    return camera, field


@pytest.mark.parametrize("depth", [3.0, 4.0, 6.5])
def test_a_rendered_point_moves_by_the_formula_as_opencv_measures_it(depth):
    """Between the outermost views of a flat picture, by cv2.findTransformECC, to 0.02 px a view."""
    camera = Camera(Intrinsics.from_fov(160, 120, 25))
    field = photograph_field(picture_at(depth), camera, 1, 5, 0.02, 4.0, supersample=2)
    left, right = (cv2.cvtColor(field.light(0, u), cv2.COLOR_RGB2GRAY) for u in (0, 4))
    start = np.float32([[1, 0, 0], [0, 1, 0]])  # from no movement at all
    mask = np.zeros(left.shape, np.uint8)
    mask[30:90, 40:120] = 255
    stop = (cv2.TERM_CRITERIA_COUNT | cv2.TERM_CRITERIA_EPS, 200, 1e-9)
    _, found = cv2.findTransformECC(left, right, start, cv2.MOTION_TRANSLATION, stop, mask, 5)
    np.testing.assert_allclose(found[:, 2] / 4, [-field.disparity(depth), 0], atol=0.02)


def test_the_sensor_behind_microlenses_traced_ray_by_ray_is_the_views_reordered():
    """Each pixel's ray starts at its place of the main lens and meets its microlens's axis in the focused plane."""
    camera, field = garden()
    k, focus = camera.intrinsics, field.focus_distance
    v, u, y, x = np.meshgrid(*(np.arange(n) for n in (5, 5, 90, 120)), indexing="ij")
    start = np.stack([field.baseline * (u - 2), field.baseline * (v - 2), 0.0 * u], axis=-1)
    end = focus * np.stack([(x - k.cx) / k.fx, (y - k.cy) / k.fy, np.ones(x.shape)], axis=-1)
    way = end - start
    way /= np.linalg.norm(way, axis=-1, keepdims=True)
    between = np.median(np.linalg.norm(np.diff(way[2, 2], axis=1), axis=-1))  # rays, over which textures are averaged
    views, _ = textured_scene().trace(start + camera.centre, way, spread=between)
    sensor = to_microlens_image(field.views)
    apart = np.abs(to_microlens_image(views) - sensor)
    assert sensor.shape == (450, 600, 3)
    assert np.median(apart) < 1e-3
    assert (apart > 0.02).mean() < 0.01  # along edges; and textures are averaged over slightly other angles


def test_bytes_and_light_are_the_same_field():
    camera, field = garden()
    again = photograph_field(textured_scene(), camera, 1, 3, field.baseline, 4.0, encoded=True)
    assert again.views.dtype == np.uint8
    np.testing.assert_allclose(to_encoded(field.light(2, 2)), again.views[0, 1] / 255, atol=0.6 / 255)
    np.testing.assert_allclose(refocus(again, 0.3), np.float32(_by_hand(to_linear(again.views), 0.3)), atol=2e-6)


def test_a_field_without_views_is_refused():
    with pytest.raises(ValueError, match="rows and columns must be at least 1, got 0 and 3"):
        photograph_field(textured_scene(), garden()[0], 0, 3, 0.1, 4)


# The same numbers in other orders ---------------------------------------------------------------------------------

SIZES = st.tuples(*[st.integers(1, 4)] * 4)


@settings(max_examples=25, deadline=None)
@given(SIZES)
def test_orders_are_taken_back_without_loss(sizes):
    views = RNG.random((*sizes, 3))
    np.testing.assert_array_equal(from_microlens_image(to_microlens_image(views), *sizes[:2]), views)
    np.testing.assert_array_equal(from_mosaic(to_mosaic(views), *sizes[:2]), views)
    assert to_microlens_image(views).size == views.size


def test_each_microlens_holds_one_point_from_everywhere():
    views = np.arange(2 * 3 * 4 * 5).reshape(2, 3, 4, 5)
    sensor = to_microlens_image(views)
    np.testing.assert_array_equal(sensor[2 * 2 : 2 * 3, 3 * 4 : 3 * 5], views[:, :, 2, 4])
    np.testing.assert_array_equal(sensor[1::2, 2::3], views[1, 2])
    np.testing.assert_array_equal(to_mosaic(views)[4:8, 10:15], views[1, 2])
    np.testing.assert_array_equal(epipolar_plane_image(views, 3), views[1, :, 3])


def test_a_sensor_that_is_no_whole_number_of_microlenses_is_refused():
    with pytest.raises(ValueError, match="10 × 9 pixels is not made of microlenses of 3 × 3 pixels"):
        from_microlens_image(np.zeros((9, 10)), 3, 3)


def test_a_point_is_a_line_in_the_epipolar_plane_image_whose_slope_is_its_disparity():
    camera, field = garden()
    truth = true_disparity(textured_scene(), camera, field)
    row, x = 58, 62  # on the crate or the ball, whatever is there
    line = [x - truth[row, x] * step for step in field.steps()[1]]
    epi = epipolar_plane_image(field.views, row)
    seen = [ndimage.map_coordinates(view[:, 1], [[at]], order=1)[0] for view, at in zip(epi, line, strict=True)]
    upright = [ndimage.map_coordinates(view[:, 1], [[x]], order=1)[0] for view in epi]
    assert np.std(seen) < 0.35 * max(np.std(upright), 0.02)


# Refocusing -------------------------------------------------------------------------------------------------------


def _by_hand(views, disparity, mask=None):
    """Shift and sum with scipy, one view after the other."""
    rows, columns = views.shape[:2]
    mask = np.ones((rows, columns)) if mask is None else mask
    total = 0
    for v, u in np.ndindex(rows, columns):
        by = disparity * (v - (rows - 1) / 2), disparity * (u - (columns - 1) / 2), 0
        total = total + mask[v, u] * ndimage.shift(np.float64(views[v, u]), by, order=1, mode="nearest")
    return total / mask.sum()


@pytest.mark.parametrize("disparity", [0, 1, -2, 0.37, -1.5, 3.21, 40])
def test_refocusing_is_what_scipy_s_shifts_sum_up_to(disparity):
    field = random_field()
    mask = np.random.default_rng(1).random((3, 4))
    np.testing.assert_allclose(refocus(field, disparity, mask), _by_hand(field.views, disparity, mask), atol=1e-6)


def test_refocusing_takes_views_in_double_precision():
    field = random_field()
    twice_as_precise = LightField(field.views.astype(np.float64))
    np.testing.assert_array_equal(refocus(twice_as_precise, 0.37), refocus(field, 0.37))


@pytest.mark.parametrize("disparity", [0, 1, -2, 0.37, -1.5, 3.21])
@pytest.mark.parametrize("shape", [(3, 4, 8, 10), (5, 5, 9, 7), (1, 1, 4, 4)])
def test_the_fourier_slice_is_shift_and_sum(shape, disparity):
    views = RNG.random((*shape, 3))
    np.testing.assert_allclose(
        fourier_slice(views, disparity), periodic_shift_and_sum(views, disparity), rtol=0, atol=1e-12
    )


def test_both_are_rolls_where_shifts_are_whole():
    views = RNG.random((3, 5, 8, 9))
    rolled = [np.roll(views[v, u], (2 * (v - 1), 2 * (u - 2)), (0, 1)) for v, u in np.ndindex(3, 5)]
    np.testing.assert_allclose(fourier_slice(views, 2), np.mean(rolled, axis=0), atol=1e-12)
    np.testing.assert_allclose(periodic_shift_and_sum(views, 2), np.mean(rolled, axis=0), atol=1e-12)


def test_a_point_out_of_focus_is_as_wide_as_the_circle_of_confusion():
    """blur = f² / (N (s − f)) |z − s| / z with N = f / D (golden rule of a thin lens), on pixels of `pitch`."""
    f, focus, depth, pitch, D = 0.1, 4.0, 3.0, 50e-6, 0.08
    image_px = f * focus / (focus - f) / pitch
    field = LightField(np.zeros((1, 9, 1, 161, 3), np.float32), D / 8, image_px, focus)
    disparity = field.disparity(depth)
    for u, step in enumerate(field.steps()[1]):
        at = 80 - disparity * step
        field.views[0, u, 0, [int(at), int(at) + 1]] = np.array([[1 - at % 1], [at % 1]])
    lit = np.flatnonzero(refocus(field, 0)[0, :, 0] > 1e-3)
    blur_px = f**2 / (f / D * (focus - f)) * abs(depth - focus) / depth / pitch
    assert np.ptp(lit) == pytest.approx(blur_px, abs=1.5)
    sharp = refocus(field, disparity)[0, :, 0]
    assert sharp[79:82].sum() == pytest.approx(1, abs=1e-5)


def test_one_view_alone_is_itself_wherever_the_focus_is():
    _, field = garden()
    np.testing.assert_array_equal(refocus(field, 1.7, aperture("pinhole", 5, 5)), field.views[2, 2])


def test_a_whole_aperture_sees_through_a_fence():
    """Focused behind it, the picture is 6 dB nearer to the one without a fence than the middle view is to its own."""
    camera, clear = garden()
    slats = [
        Rectangle(
            camera.centre + (x, -1, 1.2), np.array([0.025, 0, 0]), np.array([0, 2.0, 0]), Texture.plain((0.1, 0.3, 0.1))
        )
        for x in np.arange(-0.6, 0.6, 0.11)
    ]
    garden_scene = textured_scene()
    fenced = photograph_field(
        Scene([*slats, *garden_scene.surfaces], garden_scene.sky), camera, 5, 5, clear.baseline, 4.0
    )
    inner = np.s_[10:80, 15:105]
    far = lambda field: to_encoded(refocus(field, 0.0))[inner] * 255  # noqa: E731
    one = to_encoded(fenced.light(2, 2))[inner] * 255
    assert cv2.PSNR(one, to_encoded(clear.light(2, 2))[inner] * 255) < 15
    assert cv2.PSNR(far(fenced), far(clear)) > cv2.PSNR(one, to_encoded(clear.light(2, 2))[inner] * 255) + 6


# Openings ---------------------------------------------------------------------------------------------------------


def through_an_opening(scene, camera, baseline, focus, width, many=9):
    """The middle view as the mean of many × many pinholes, evenly over its opening."""
    dense = photograph_field(scene, camera, many, many, width * baseline / many, focus)
    return np.mean([dense.light(v, u) for v, u in np.ndindex(many, many)], axis=0)


def opened(scene, camera, baseline, focus, width):
    return Openings(photograph_field(scene, camera, 3, 3, baseline, focus, encoded=True), scene, camera).opened(width)


@pytest.mark.sampled(1)
@pytest.mark.parametrize(("depth", "width"), [(2.5, 1.0), (4.0, 1.0), (2.2, 0.7)])
def test_a_view_through_an_opening_is_the_mean_of_what_its_places_see(depth, width):
    """A flat picture, in linear light; a pinhole's picture is farther off wherever there is blur."""
    camera, scene = Camera(Intrinsics.from_fov(160, 120, 25)), picture_at(depth)
    truth = through_an_opening(scene, camera, 8 / camera.intrinsics.fx, 4.0, width)
    inner = np.s_[20:100, 20:140]
    error, pinhole = (
        np.sqrt(np.mean((one - truth)[inner] ** 2))
        for one in (
            opened(scene, camera, 8 / camera.intrinsics.fx, 4.0, width).light(1, 1),
            opened(scene, camera, 8 / camera.intrinsics.fx, 4.0, 0).light(1, 1),
        )
    )
    assert error < 0.002
    assert depth == 4.0 or error < 0.6 * pinhole


def test_the_blur_of_a_point_has_the_width_of_its_slope():
    """Second moments: an edge spread evenly over |d| pixels has the variance d²/12 more; to a tenth of the width."""
    camera = Camera(Intrinsics.from_fov(160, 120, 25))
    black = Texture.plain((0.0, 0.0, 0.0))
    scene = Scene([Rectangle(np.array([0.0, -9, 2.5]), np.array([9.0, 0, 0]), np.array([0, 18.0, 0]), black)])
    spread = {}
    for width in (0.0, 0.5, 1.0):
        field = opened(scene, camera, 20 / camera.intrinsics.fx, 4.0, width)
        line = -np.diff(field.light(1, 1)[60, :, 1].astype(float))
        line /= line.sum()
        x = np.arange(len(line)) - line @ np.arange(len(line))
        spread[width] = line @ x**2
    d = float(field.disparity(2.5))
    assert d == pytest.approx(3.0)
    assert spread[1.0] - spread[0.0] == pytest.approx(d**2 / 12, rel=0.2)
    assert spread[0.5] - spread[0.0] == pytest.approx((0.5 * d) ** 2 / 12, rel=0.2)


def test_behind_a_fence_openings_are_nearer_to_the_truth_than_pinholes():
    """Where things hide each other the step from place to place is only nearly right."""
    camera = Camera(Intrinsics.from_fov(120, 90, 38), world_from_cam=RigidTransform.from_translation([0.15, 0.55, 0]))
    slat = Texture.plain((0.1, 0.3, 0.1))
    slats = [
        Rectangle(camera.centre + (x, -1, 2.0), np.array([0.03, 0, 0]), np.array([0, 2.0, 0]), slat)
        for x in np.arange(-0.6, 0.6, 0.11)
    ]
    scene = Scene([*slats, *textured_scene().surfaces], textured_scene().sky)
    truth = to_encoded(through_an_opening(scene, camera, 0.056, 4.0, 1.0, many=5)) * 255
    wide, pinhole = (to_encoded(opened(scene, camera, 0.056, 4.0, width).light(1, 1)) * 255 for width in (1.0, 0.0))
    assert cv2.PSNR(wide, truth) > cv2.PSNR(pinhole, truth) + 4
    assert cv2.PSNR(wide, truth) > 27


def test_the_exact_range_is_where_no_view_is_blurred_by_more_than_a_pixel():
    near, far = exact_range(BENCHMARK, 1.0)
    assert np.abs(BENCHMARK.disparity([near, far])) == pytest.approx(1)
    assert near < BENCHMARK.focus_distance < far
    assert exact_range(BENCHMARK, 0.0) == (0.0, np.inf)
    assert exact_range(BENCHMARK, 0.1)[1] == np.inf  # from 1/z < 0 on nothing is left to be blurred
    for bad in (-0.1, 1.1, np.nan):
        with pytest.raises(ValueError, match="width must lie between 0 and 1"):
            exact_range(BENCHMARK, bad)


def test_openings_take_bytes_only():
    camera = Camera(Intrinsics.from_fov(8, 6, 25))
    with pytest.raises(ValueError, match=r"pinholes must hold views as sRGB bytes \(uint8\), got float32"):
        Openings(photograph_field(picture_at(3.0), camera, 3, 3, 0.02, 4.0), picture_at(3.0), camera)


def test_an_opening_wider_than_the_places_are_apart_is_refused():
    with pytest.raises(ValueError, match=r"width must lie between 0 and 1, got 1\.5"):
        opened(picture_at(3.0), Camera(Intrinsics.from_fov(8, 6, 25)), 0.02, 4.0, 1.5)


@pytest.mark.parametrize(
    ("mask", "words"),
    [
        (np.ones((2, 2)), r"mask must have shape \(3, 4\)"),
        (np.zeros((3, 4)), "at least one"),
        (-np.ones((3, 4)), "not negative"),
        (np.full((3, 4), np.nan), "not negative"),
    ],
)
def test_an_aperture_that_lets_nothing_through_is_refused(mask, words):
    with pytest.raises(ValueError, match=words):
        refocus(random_field(), 0, mask)


def test_apertures_have_the_areas_of_their_names():
    count = {name: aperture(name, 9, 9).sum() for name in APERTURES}
    assert count["full"] == 81
    assert count["pinhole"] == 1
    assert count["half"] == 45
    assert count["round"] == pytest.approx(np.pi / 4 * 81, rel=0.1)
    assert 0 < count["ring"] < count["round"]
    assert aperture("ring", 9, 9)[4, 4] == 0
    assert aperture("pinhole", 9, 9, 0, 8)[0, 8] == 1
    with pytest.raises(ValueError, match="shape must be one of full, round"):
        aperture("star", 9, 9)
    with pytest.raises(ValueError, match="v and u must be a view"):
        aperture("pinhole", 3, 3, 3, 0)


# Depth from slope -------------------------------------------------------------------------------------------------


def _apart(measured, truth):
    """Errors in pixels where 15 × 15 pixels around hold one smooth surface: at its rim one half sees what is behind."""
    near, far = (one(truth, np.ones((15, 15))) for one in (cv2.dilate, cv2.erode))
    smooth = (near - far < 0.3) & (truth > truth.min() + 0.2)  # and not the sky, which is plain
    return np.abs(measured - truth)[smooth]


def test_the_sweep_finds_the_true_slopes():
    """Half of the pixels within 0.03 px, nine in ten within 0.15 px of what the tracer says."""
    camera, field = garden()
    truth = true_disparity(textured_scene(), camera, field)
    error = _apart(disparity_by_sweep(field, np.arange(-4.4, 2.4, 0.2)), truth)
    assert len(error) > 2000
    assert np.median(error) < 0.03
    assert np.quantile(error, 0.9) < 0.15


def test_the_structure_tensor_finds_small_slopes_where_it_trusts_itself():
    camera, field = garden()
    truth = true_disparity(textured_scene(), camera, field)
    found, trust = disparity_by_structure(field)
    sure = (trust > 0.9) & (np.abs(truth) < 0.5)
    assert sure.sum() > 300
    assert np.median(np.abs(found - truth)[sure]) < 0.06
    sheared, trust = disparity_by_structure(field, 1.2)
    sure = (trust > 0.9) & (np.abs(truth - 1.2) < 0.4)
    assert np.median(np.abs(sheared - truth)[sure]) < 0.06


def test_slopes_that_cannot_be_measured_are_refused():
    with pytest.raises(ValueError, match="at least three evenly spaced"):
        disparity_by_sweep(random_field(), [0, 1])
    with pytest.raises(ValueError, match="at least three evenly spaced"):
        disparity_by_sweep(random_field(), [0, 1, 3])
    with pytest.raises(ValueError, match="needs 3 × 3 views, got 1 × 4"):
        disparity_by_structure(random_field(rows=1))


# Folders ----------------------------------------------------------------------------------------------------------

PARAMETERS = """[intrinsics]
focal_length_mm = 100.0
image_resolution_x_px = 24
image_resolution_y_px = 16
sensor_size_mm = 35.0
[extrinsics]
num_cams_x = 3
num_cams_y = 3
baseline_mm = 50.0
focus_distance_m = 8.2
"""


def written(folder, names, size=(16, 24)):
    """Pictures, each of one colour of its own, and the colours."""
    folder.mkdir(exist_ok=True)
    colours = np.random.default_rng(3).integers(0, 255, (len(names), 3), dtype=np.uint8)
    for name, colour in zip(names, colours, strict=True):
        cv2.imwrite(str(folder / name), np.broadcast_to(colour[::-1], (*size, 3)).copy())
    return colours


def test_the_benchmark_s_folder_is_read_with_its_parameters(tmp_path):
    colours = written(tmp_path, [f"input_Cam{i:03d}.png" for i in range(9)])
    (tmp_path / "parameters.cfg").write_text(PARAMETERS)
    (tmp_path / "notes.txt").write_text("not a view")
    written(tmp_path, ["gt_depth_preview.png"], (5, 5))  # pictures that are no views lie there too
    field = read_folder(tmp_path)
    assert field.views.shape == (3, 3, 16, 24, 3)
    np.testing.assert_array_equal(field.views[:, :, 7, 7].reshape(-1, 3), colours)
    assert (field.baseline, field.focus_distance) == (0.05, 8.2)
    assert field.focal_length == pytest.approx(100 / 35 * 24)
    assert read_folder(str(tmp_path), width=12).focal_length == pytest.approx(100 / 35 * 12)
    assert read_folder(tmp_path, width=12).views.shape == (3, 3, 8, 12, 3)


@pytest.mark.parametrize("end", ["_.png", ".png"])
def test_the_stanford_archive_s_folder_is_read_by_row_and_column(tmp_path, end):
    places = [(row, column) for row in range(2) for column in range(3)]
    names = [f"out_{r:02d}_{c:02d}_{-381.9 + 8 * r:.6f}_{1103.4 - 8 * c:.6f}{end}" for r, c in places]
    colours = written(tmp_path, names)
    field = read_folder(tmp_path, baseline=0.02)
    np.testing.assert_array_equal(field.views[:, :, 0, 0].reshape(-1, 3), colours)
    assert field.baseline == 0.02
    assert np.isnan(field.focal_length)


def test_a_camera_moved_along_a_ruler_makes_one_row_in_the_order_in_which_one_counts(tmp_path):
    names = [f"IMG_{number}.jpg" for number in (8, 9, 10, 11, 12)]
    colours = written(tmp_path, names)
    views = read_folder(tmp_path, rows=1).views
    assert views.shape[:2] == (1, 5)
    np.testing.assert_allclose(views[0, :, 4, 4].astype(int), colours, atol=4)  # JPEG


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda f: (f / "input_Cam004.png").unlink(), "lacks view 004"),
        (lambda f: written(f, ["input_Cam005.png"], (8, 8)), "Cam005.png has 8 × 8 pixels and input_Cam000"),
        (lambda f: (f / "input_Cam008.png").unlink(), "holds 8 pictures, which make no square"),
        (lambda f: (f / "input_Cam003.png").write_bytes(b"no picture"), "input_Cam003.png: it is not a picture"),
        (lambda f: (f / "input_Cam003.png").write_bytes(b""), "input_Cam003.png: it is empty"),
        (lambda f: [one.unlink() for one in f.glob("*.png")], "holds no pictures"),
        (lambda f: (f / "parameters.cfg").write_text("[intrinsics]\nfocal_length_mm = 3"), "it lacks extrinsics"),
        (lambda f: (f / "parameters.cfg").write_text("hello"), "does not tell focal length"),
        (lambda f: (f / "parameters.cfg").write_text(PARAMETERS.replace("50.0", "wide")), "could not convert"),
    ],
)  # fmt: skip
def test_a_bad_folder_is_refused_in_one_sentence(tmp_path, change, words):
    written(tmp_path, [f"input_Cam{i:03d}.png" for i in range(9)])
    change(tmp_path)
    with pytest.raises(ValueError, match=words) as refused:
        read_folder(tmp_path)
    assert "\n" not in str(refused.value)
    assert str(tmp_path) in str(refused.value)


def test_folders_that_are_no_folder_and_rows_that_do_not_fit_are_refused(tmp_path):
    with pytest.raises(ValueError, match="is not a folder"):
        read_folder(tmp_path / "nowhere")
    written(tmp_path, ["a.png", "b.png", "c.png"])
    with pytest.raises(ValueError, match="do not make 2 equal rows"):
        read_folder(tmp_path, rows=2)
    (tmp_path / "stanford").mkdir()
    written(tmp_path / "stanford", ["out_00_00_1.0_2.0_.png", "out_01_01_1.0_2.0_.png"])
    with pytest.raises(ValueError, match="lacks the view out_00_01_…, of 2 × 2"):
        read_folder(tmp_path / "stanford")


def test_one_sensor_gives_either_many_views_or_many_pixels():
    """n² views leave 1/n² of the sensor's pixels to each: 9 × 9 views cost 81 times the resolution."""
    sensor = render(textured_scene(), Camera(Intrinsics.from_fov(180, 144, 38)))
    pixels = {n: from_microlens_image(sensor, n, n).shape[2:4] for n in (1, 3, 9)}
    assert pixels == {1: (144, 180), 3: (48, 60), 9: (16, 20)}
    assert all(n * n * height * width == 144 * 180 for n, (height, width) in pixels.items())
