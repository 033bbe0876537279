"""The page of a calibration: whole, offline, with the file's own numbers, whatever the shape of its images."""

import re
from html import escape
from itertools import combinations
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform

from camviz.cameras import Camera, Intrinsics
from camviz.draw.labels import overlap
from camviz.lenses import BrownConrady, DoubleSphere, KannalaBrandt, UnifiedSphere
from camviz.views.distortion import DistortionView
from camviz.views.epipolar import EpipolarView
from camviz.views.frustum import FrustumView
from camviz_clinic.checks import inspect
from camviz_clinic.checks.words import claim
from camviz_clinic.files import Calibration
from camviz_clinic.report.page import page

ASIDE = RigidTransform.from_translation([0.3, 0, 0])
ODD = {
    "one pixel": Intrinsics(1, 1, 1, 1, 0, 0),
    "two rows": Intrinsics(4096, 2, 2000, 2000, 2047.5, 0.5),
    "one column": Intrinsics(1, 4096, 2000, 2000, 0, 2047.5),
    "portrait": Intrinsics(480, 1200, 600, 600, 239.5, 599.5),
    "square": Intrinsics(500, 500, 400, 400, 249.5, 249.5),
    "large": Intrinsics(20000, 10000, 15000, 15000, 9999.5, 4999.5),
    "focal length of a thousandth": Intrinsics(640, 480, 1e-3, 1e-3, 319.5, 239.5),
    "focal length of a million": Intrinsics(640, 480, 1e6, 1e6, 319.5, 239.5),
    "axis far outside": Intrinsics(640, 480, 500, 500, 1e6, -1e6),
}


def calibration(*cameras, names=("left", "right", "third")):
    return Calibration(dict(zip(names, cameras, strict=False)), Path("some camera.yml"), "a test")


def shown(calibration):
    return page(inspect(calibration))


@pytest.mark.parametrize("intrinsics", ODD.values(), ids=ODD)
def test_an_odd_image_gets_its_page(intrinsics):
    text = shown(calibration(Camera(intrinsics, BrownConrady(-0.1))))
    assert text.count('camviz-flow" role') == 3
    assert not re.search(r'[ "(,](nan|inf)\b', re.sub("base64,[^\"']*", "", text))


@pytest.mark.parametrize("intrinsics", ODD.values(), ids=ODD)
@pytest.mark.parametrize("view", [FrustumView, DistortionView, EpipolarView])
def test_no_panel_lies_on_another(view, intrinsics):
    camera = Camera(intrinsics)
    picture = view.of(camera, camera.at(ASIDE)).figure() if view is EpipolarView else view.of(camera).figure()
    boxes = [(one.x, one.y, one.x + one.width, one.y + one.height) for one in picture.marks.panels().values()]
    assert len(boxes) > 1
    assert [pair for pair in combinations(boxes, 2) if overlap(*pair)] == []
    assert np.all(np.max(boxes, axis=0)[2:] <= (picture.width, picture.height))


def test_the_page_needs_nothing_from_elsewhere():
    text = shown(calibration(Camera(ODD["square"]), Camera(ODD["square"], KannalaBrandt(), ASIDE)))
    assert "attached:" not in text
    assert not re.search(r'(?:src|href)="(?!data:|#)|url\((?!data:|#)|@import|<script', text)
    assert re.sub(r"http://www\.w3\.org/\S+", "", text).count("http") == 0


def test_a_cameras_name_is_words_and_not_html():
    assert "<b>left" not in shown(calibration(Camera(ODD["square"]), names=["<b>left & 'right'</b>"]))


@pytest.mark.parametrize(
    ("lens", "words"),
    [
        (BrownConrady(-0.3, 0.1), "BrownConrady: k1 = -0.3, k2 = 0.1"),
        (KannalaBrandt(0.01, 0, 0, -0.002), "KannalaBrandt: k1 = 0.01, k4 = -0.002"),
        (UnifiedSphere(1.8, -0.2), "UnifiedSphere: xi = 1.8, k1 = -0.2"),
        (DoubleSphere(-0.2, 0.6), "DoubleSphere: xi = -0.2, alpha = 0.6"),
    ],
)
def test_the_table_lists_what_is_not_at_rest(lens, words):
    assert f"<td>{words}</td>" in shown(calibration(Camera(ODD["square"], lens)))


def test_every_pair_that_stands_apart_is_shown_once():
    square = Camera(ODD["square"])
    text = shown(calibration(square, square.at(ASIDE), square))
    assert re.findall(r"<figcaption>(\w+ and \w+)<", text) == ["left and right", "right and third"]
    assert "its own copy" not in text
    assert "its own copy 10 cm to its right" in shown(calibration(square, square))


def test_the_page_begins_with_what_inspect_says():
    folded = inspect(calibration(Camera(Intrinsics.from_fov(640, 480, 100), BrownConrady(-0.3))))
    assert not folded.healthy
    text = page(folded)
    assert text.index(escape(folded.verdict)) < text.index("<table")
    assert escape(claim(folded.findings)) in text
    assert "camviz inspect some camera.yml" in text


@pytest.mark.parametrize(
    ("lens", "field_of_view", "seen"),
    [
        (BrownConrady(), 60, False),
        (BrownConrady(-0.05), 60, False),  # folds at r = 2.58, seen at 1.72; the corner is at 0.72
        (BrownConrady(-0.3), 60, True),  # folds at r = 1.05, seen at 0.703
        (BrownConrady(-0.29), 60, True),  # at 0.7148 of 0.7217
        (BrownConrady(-0.28), 60, False),  # at 0.7274
        (BrownConrady(0.6, -1.0), 80, True),  # bent out of sight, among ideal points in sight
        (KannalaBrandt(-0.1), 100, True),  # folds at 105°, seen at 1.22 of 1.49
        (KannalaBrandt(-0.02), 100, False),  # rises as far as a ray can lean
    ],
)
def test_a_red_circle_is_spoken_of_where_one_is_seen(lens, field_of_view, seen):
    text = shown(calibration(Camera(Intrinsics.from_fov(640, 480, field_of_view), lens)))
    assert ("A red circle marks" in text) == seen
