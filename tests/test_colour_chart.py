"""The chart in a photograph: found where it is, and its colours read."""

from __future__ import annotations

import warnings

import cv2
import numpy as np
import pytest
from raw_charts import raw_chart

from camviz.cameras import Camera, Intrinsics
from camviz.colour import balance, charts, spectra
from camviz.colour.developing import CameraInLight
from camviz.scenes import Rectangle, Scene, Texture, render, textured_scene
from camviz.scenes.light import to_display
from camviz.scenes.photographs import photograph

with warnings.catch_warnings():
    warnings.simplefilter("ignore")


def painted_chart(cast=(1, 1, 1)):
    """The chart from straight ahead, sRGB bytes: each patch in D65 times a cast."""
    return to_display(charts.painted(np.clip(charts.published_srgb(), 0, 1) * cast, side=60))


def photographed(chart, corners, rng):
    """The chart between four corners in a photograph of 900 × 600 with a little noise."""
    height, width = chart.shape[:2]
    edges = np.float32([(-0.5, -0.5), (width - 0.5, -0.5), (width - 0.5, height - 0.5), (-0.5, height - 0.5)])
    warp = cv2.getPerspectiveTransform(edges, np.float32(corners))
    picture = cv2.resize(photograph("coffee"), (900, 600), interpolation=cv2.INTER_AREA)
    seen = cv2.warpPerspective(np.full((height, width), 255, np.uint8), warp, (900, 600)) > 128
    picture[seen] = cv2.warpPerspective(chart, warp, (900, 600))[seen]
    return np.clip(picture + rng.normal(0, 2, picture.shape), 0, 255).astype(np.uint8)


UPRIGHT = [(250, 150), (650, 180), (640, 450), (240, 430)]


@pytest.mark.parametrize("corners", [UPRIGHT, UPRIGHT[2:] + UPRIGHT[:2]], ids=["upright", "upside down"])
def test_a_chart_is_found_and_its_colours_read(corners):
    cast = np.array([0.9, 0.75, 0.5])
    found = charts.find_chart(photographed(painted_chart(cast), corners, np.random.default_rng(0)))
    np.testing.assert_allclose(found.rgb, np.clip(charts.published_srgb(), 0, 1) * cast, atol=0.012)
    assert not found.clipped
    first, last = np.asarray(corners[0]), np.asarray(corners[2])
    assert (
        np.linalg.norm(found.patches[0].mean(axis=0) - first)
        < 60
        < np.linalg.norm(found.patches[0].mean(axis=0) - last)
    )


def test_a_matrix_from_the_photographed_chart_undoes_a_cast():
    found = charts.find_chart(photographed(painted_chart((0.9, 0.75, 0.5)), UPRIGHT, np.random.default_rng(1)))
    m = balance.fit_matrix(found.rgb, charts.published_srgb())
    assert charts.differences(found.rgb).mean() > 7
    assert charts.differences(found.rgb @ m.T).mean() < 1.5


def test_a_chart_beside_a_chessboard_is_found_in_a_photograph_of_the_garden():
    """OpenCV's detector alone takes something else for the chart there."""
    colours = Texture(0.9 * charts.painted(np.clip(charts.published_srgb(), 0, 1)))
    chart = Rectangle((-0.3, -0.25, 1.6), (0.84, 0.0, 0.2), (0.0, 0.57, 0.05), colours)
    garden = textured_scene()
    camera = Camera(Intrinsics.from_fov(900, 600, 60))
    bulb = CameraInLight("Nikon D5100", spectra.planckian(2850))
    picture = to_display(0.9 * render(Scene([*garden.surfaces, chart], garden.sky), camera) @ bulb.raw_from_srgb.T)
    found = charts.find_chart(picture)
    first = camera.project(chart.corner + (0.5 / 6 * chart.across + 0.5 / 4 * chart.down))
    np.testing.assert_allclose(found.patches[0].mean(axis=0), first, atol=5)
    m = balance.fit_matrix(found.rgb, charts.published_srgb())
    assert charts.differences(found.rgb).mean() > 10
    assert charts.differences(found.rgb @ m.T).mean() < 1


def test_what_has_not_the_chart_s_colours_is_no_chart():
    """Whatever the light and the camera, a matrix brings a chart's colours home; it does not bring others there."""
    chart = raw_chart("Sigma SD1 Merrill", "A")[0]
    assert charts._alike(chart)
    assert not charts._alike(chart[::-1])
    assert not charts._alike(np.random.default_rng(11).permutation(chart))
    assert not charts._alike(np.random.default_rng(12).uniform(0, 1, (24, 3)))


def test_overexposed_patches_are_named():
    found = charts.find_chart(photographed(painted_chart((1.4, 1.4, 1.4)), UPRIGHT, np.random.default_rng(2)))
    assert 18 in found.clipped


def test_a_picture_without_a_chart_is_refused_in_words():
    with pytest.raises(ValueError, match="no chart of 24 patches was found in this picture of 600 × 400 pixels: show"):
        charts.find_chart(photograph("coffee"))
    with pytest.raises(ValueError, match="uint8"):
        charts.find_chart(np.zeros((40, 40, 3)))
