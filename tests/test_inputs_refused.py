"""A wrong shape or number gets one sentence that says what was expected and what came."""

import numpy as np
import pytest

from camviz import Camera, Intrinsics, colour, lightfields, mosaics, optics, scenes, sensors, twoview
from camviz.panoramas import cubemap_camera
from camviz.poses import RigidTransform
from camviz_clinic.measuring.noise import Level, read_recording
from camviz_clinic.measuring.sharpness import SlantedEdge

LEFT = Camera(Intrinsics(640, 480, 500, 500, 320, 240))
RIGHT = LEFT.at(RigidTransform.from_translation([0.1, 0, 0]))
PIXELS = np.random.default_rng(0).uniform(0, 480, (20, 2))
RNG = np.random.default_rng(0)
FIELD = lightfields.LightField(np.zeros((3, 3, 4, 4, 3)), 0.1, 100, 2)
WHITE = scenes.Texture.plain((1, 1, 1))
EYE = colour.observer()
NEVER = np.full((3, 3), np.nan)

COLOUR = [
    (lambda: colour.response(np.ones(80), 1, EYE), r"sensitivity must have shape \(80, channels\), got \(81, 3\)"),
    (lambda: colour.response(np.ones(81), np.ones(3), EYE), r"reflectance must have shape \(\.\.\., 81\), got \(3,\)"),
    (lambda: colour.response(np.ones(81), 1, EYE.T), r"sensitivity must have shape \(81, channels\), got \(3, 81\)"),
    (lambda: colour.metamer(np.ones(81), EYE, EYE[:, 0]), r"apart must have shape \(81, channels\), got \(81,\)"),
    (lambda: colour.tristimulus(np.ones(80)), r"light must have shape \(\.\.\., 81\)"),
    (lambda: colour.chromaticity((1, 2)), r"xyz must have shape \(\.\.\., 3\), got \(2,\)"),
    (lambda: colour.to_srgb((1, 2)), r"xyz must have shape \(\.\.\., 3\), got \(2,\)"),
    (lambda: colour.from_srgb((1, 2)), r"rgb must have shape \(\.\.\., 3\), got \(2,\)"),
    (lambda: colour.to_lab((1, 1, 1), 1), r"white must have shape \(\.\.\., 3\), got \(\)"),
    (lambda: colour.from_lab((1, 2), (1, 1, 1)), r"lab must have shape \(\.\.\., 3\), got \(2,\)"),
    (lambda: colour.delta_e_2000((1, 2, 3), (1, 2)), r"lab2 must have shape \(\.\.\., 3\), got \(2,\)"),
    (lambda: colour.adaptation((1, 2), (1, 1, 1)), r"white_from must have shape \(\.\.\., 3\), got \(2,\)"),
    (lambda: colour.grey_world(np.ones((4, 2))), r"rgb must have shape \(\.\.\., 3\), got \(4, 2\)"),
    (lambda: colour.white_patch(np.ones((4, 2))), r"rgb must have shape \(\.\.\., 3\), got \(4, 2\)"),
    (lambda: colour.developed((1, 2), (1, 1, 1), np.eye(3)), r"raw must have shape \(\.\.\., 3\), got \(2,\)"),
    (lambda: colour.fit_matrix(np.eye(3), np.eye(3), ((0, 0, 0), (1, 1, 1))), "keep must begin with a colour that is"),
    (lambda: colour.find_chart([[1, 2]]), r"picture must be uint8 \(height, width, 3\), got int64 \(1, 2\)"),
    (lambda: colour.xy_of_temperature(0), "kelvin must be above 0, got 0"),
]
LIGHT_FIELDS = [
    (
        lambda: lightfields.to_mosaic(np.zeros((2, 2))),
        r"views must have shape \(v, u, height, width, \.\.\.\), got \(2, 2",
    ),
    (
        lambda: lightfields.to_microlens_image(np.zeros(4)),
        r"views must have shape \(v, u, height, width, \.\.\.\), got",
    ),
    (
        lambda: lightfields.from_mosaic(np.zeros(4), 1, 1),
        r"a picture must have shape \(height, width, \.\.\.\), got \(4,\)",
    ),
    (lambda: lightfields.fourier_slice(np.zeros((2, 2)), 1), r"views must have shape \(v, u, height, width, \.\.\.\)"),
    (lambda: lightfields.periodic_shift_and_sum([1], 1), r"views must have shape \(v, u, height, width, \.\.\.\)"),
    (lambda: lightfields.refocus(FIELD, np.nan), "disparity must be a finite number of pixels, got nan"),
    (lambda: lightfields.disparity_by_sweep(FIELD, [0, 1, 2], 0), "window must be an odd number of pixels, at least 1"),
    (
        lambda: lightfields.disparity_by_structure(FIELD, 0, 4),
        "window must be an odd number of pixels, at least 1, got 4",
    ),
    (lambda: lightfields.disparity_by_structure(FIELD, [1, 2]), r"start must be a single disparity, got shape \(2,\)"),
    (
        lambda: lightfields.photograph_field(scenes.Scene([]), cubemap_camera(4), 1, 1, 0.1, 2),
        "camera must have a perspective lens, got Cubemap",
    ),
]
OTHERS = [
    (
        lambda: mosaics.with_green(np.zeros((4, 4)), mosaics.BAYER["RGGB"], [1, 2]),
        r"green must be one number for each of 8 pixels, got shape \(2,\)",
    ),
    (
        lambda: mosaics.opencv([[1, 2]], mosaics.BAYER["RGGB"]),
        r"values must be uint8 or uint16 \(height, width\), got int",
    ),
    (lambda: optics.ideal_lens(0), "focal_mm must be a focal length other than 0"),
    (lambda: optics.refraction(0, 1, 1.5), "radius_mm must be a radius other than 0"),
    (
        lambda: optics.Prescription("ragged", ((1, 2, 1.5), (1, 2))),
        "surfaces must be rows of radius, distance and index",
    ),
    (lambda: optics.pinhole_kernel(0, 0.3, 100), "pitch_mm must be a length above 0 mm, got 0"),
    (lambda: optics.pinhole_kernel(0.1, 0, 100), "diameter_mm must be a length above 0 mm, got 0"),
    (lambda: SlantedEdge.of([[0, 1], [0, 1]]), "image must be at least 16 × 16 pixels, got 2 × 2"),
    (lambda: scenes.Texture.plain((1, 1)), r"rgb must have shape \(\.\.\., 3\), got \(2,\)"),
    (lambda: scenes.Wireframe((np.zeros(3),), ("point",)), r"each of lines must have shape \(n, 3\), got \(3,\)"),
]
SENSORS = [
    (lambda: Level.of(0.1, [[[1, 2]]], [[[1, 2]]] * 2), "bright must be two frames, got 1"),
    (lambda: sensors.average([]), "frames must be one or more of one size, got none"),
    (
        lambda: sensors.less_dark([[1, 2, 3]], [[1, 2]]),
        r"frames must be one or more of one size, got \[\(1, 2\), \(1, 3\)\]",
    ),
    (
        lambda: sensors.smoothed(np.ones((4, 4)), sensors.NoiseModel(1, 1), "gaussian", 0),
        "strength must be above 0, got 0",
    ),
    (lambda: sensors.bloomed([[1]], -1), "full_well_e must be above 0 electrons, got -1"),
    (lambda: sensors.gliding(LEFT, (1, 2)), r"velocity_m_per_s must have shape \(\.\.\., 3\), got \(2,\)"),
    (lambda: read_recording("nowhere"), r"nowhere: there is no such folder or descriptor file\."),
]
TWO_VIEWS = [
    (lambda: twoview.epipolar_lines(np.eye(2), [1, 2]), r"F must have shape \(3, 3\), got \(2, 2\)"),
    (lambda: twoview.sampson_distance(np.eye(2), [1, 2], [1, 2]), r"F must have shape \(3, 3\), got \(2, 2\)"),
    (lambda: twoview.epipoles(np.eye(2)), r"F must have shape \(3, 3\), got \(2, 2\)"),
    (lambda: twoview.nearest_rank_two(NEVER), "F must hold finite numbers, got"),
    (lambda: twoview.decompose_essential(NEVER), "E must hold finite numbers, got"),
    (lambda: twoview.normalising_transform([1, 2]), r"uv must have shape \(n, 2\), got \(2,\)"),
    (lambda: twoview.epipolar_curve(LEFT, RIGHT, [1, 2], 1.0), r"distances must have shape \(n,\), got \(\)"),
    (lambda: twoview.left_right_check([[1, 2]], [[1]]), "the two disparities must have one shape"),
    (
        lambda: twoview.disparity([[1]], [[1]]),
        "left and right must be uint8 pictures of one size, RGB or grey, got int64",
    ),
    (
        lambda: twoview.disparity(*np.zeros((2, 64, 64, 4), np.uint8), disparities=16),
        r"left and right must be uint8 pictures of one size, RGB or grey, got uint8 \(64, 64, 4\)",
    ),
    (
        lambda: twoview.ransac_fundamental(PIXELS, PIXELS[:19], 1, RNG),
        r"pairs take two arrays of one shape \(n, 2\), got \(20, 2\) and \(19, 2\)",
    ),
    (
        lambda: twoview.ransac_fundamental(PIXELS, PIXELS, 1, RNG, confidence=1),
        "confidence must lie between 0 and 1, got 1",
    ),
    (
        lambda: twoview.recover_pose(np.diag([1, 1, 0]), np.zeros((0, 3)), np.zeros((0, 3))),
        r"in front of both cameras lie \[0, 0, 0, 0\]",
    ),
]


@pytest.mark.parametrize(("make", "said"), COLOUR + LIGHT_FIELDS + OTHERS + SENSORS + TWO_VIEWS)
def test_a_wrong_input_is_named(make, said):
    with pytest.raises(ValueError, match=said):
        make()


def test_a_fundamental_matrix_that_is_not_there_has_lines_that_are_not_there():
    assert np.isnan(twoview.epipolar_lines(NEVER, PIXELS)).all()


def test_one_number_is_counted_and_rounded_as_a_picture_is():
    counts = [float(sensors.poisson(50.0, np.random.default_rng(seed))) for seed in range(400)]
    assert all(count == round(count) for count in counts)
    assert np.mean(counts) == pytest.approx(50, abs=4 * (50 / 400) ** 0.5)
    assert sensors.quantise(10.6, 12) == 11


def test_a_flat_field_of_dead_pixels_has_no_answer():
    assert np.isnan(sensors.flattened([[1, 1]], [[1, 1]], [[1, 1]])).all()
