"""A dozen pictures are drawn as they were approved by eye: views of the core, of the clinic and of the lessons.

What a picture shows is tested by its marks; this test sees what is lost between marks and pixels: layers, styles,
clipping, labels. Pictures are drawn in wireframe at 48 dpi, in the fonts that the tests bring along, and compared as
pixels in the approved picture's palette. After a change that is meant, draw them anew and look at each in `git diff`:

    CAMVIZ_APPROVE=1 python -m pytest -n 0 tests/test_approved_pictures.py
"""

import io
import os
from pathlib import Path

import numpy as np
import pytest
from calibrations import pair, sick, single
from PIL import Image

from camviz.views.distortion import DistortionView
from camviz.views.epipolar import EpipolarView
from camviz.views.frustum import FrustumView
from camviz_clinic.views.catalogue import VIEWS, Case
from camviz_school.views.calibration import CalibrationView
from camviz_school.views.intrinsics import IntrinsicsView
from camviz_school.views.pinhole import PinholeView

FOLDER = Path(__file__).parent / "data/approved"
DPI = 48
MAX_MEAN_DIFFERENCE = 0.005
"""Of the whole picture, as a part of the way from black to white."""
MAX_BLOCK_DIFFERENCE = 0.10
"""Of the block of BLOCK_PX × BLOCK_PX that differs most. Letters that are not hinted differ by 0.07."""
BLOCK_PX = 8

PICTURES = {
    "distortion": DistortionView,
    "distortion-straightened-dark": lambda: DistortionView.by_the_wall(
        k1=-0.5, show="undistorted", panels="picture grid curve"
    ),
    "epipolar": EpipolarView,
    "epipolar-estimated-dark": lambda: EpipolarView(noise=1.0, right_x=0.15, right_z=0.9, yaw=0.0),
    "frustum": FrustumView,
    "frustum-own-frame-dark": lambda: FrustumView(seen_from="camera view", panels="world picture"),
    "clinic-residuals": lambda: VIEWS["residual-vectors"].view(Case(sick())),
    "clinic-uncertainty-dark": lambda: VIEWS["uncertainty"].view(Case(single())),
    "clinic-epipolar-pairs": lambda: VIEWS["epipolar-pairs"].view(Case(pair())),
    "pinhole": lambda: PinholeView(noise=False),
    "intrinsics-cropped-dark": lambda: IntrinsicsView(operation="cropped", skew=40),
    "calibration": lambda: CalibrationView(boards=4),
}


def drawn(name: str) -> Image.Image:
    """The picture of that name, in the light theme or, where its name ends so, the dark one."""
    cairosvg = pytest.importorskip("cairosvg")
    svg = PICTURES[name]().figure().portable("dark" if name.endswith("dark") else "light")
    pixels = cairosvg.svg2png(bytestring=svg.encode(), scale=DPI / 96)
    return Image.open(io.BytesIO(pixels)).convert("RGB")


def in_palette(picture: Image.Image, palette: Image.Image) -> Image.Image:
    return picture.quantize(palette=palette, dither=Image.Dither.NONE)


def differences(one: Image.Image, other: Image.Image) -> tuple[float, float]:
    """Of two pictures of one size: on average, and in the block that differs most."""
    away = np.abs(np.subtract(one.convert("RGB"), other.convert("RGB"), dtype=float)).mean(axis=-1) / 255
    rows, columns = (side // BLOCK_PX for side in away.shape)
    blocks = away[: rows * BLOCK_PX, : columns * BLOCK_PX].reshape(rows, BLOCK_PX, columns, BLOCK_PX)
    return float(away.mean()), float(blocks.mean(axis=(1, 3)).max())


@pytest.mark.parametrize("name", PICTURES)
def test_a_picture_is_drawn_as_approved(name, monkeypatch):
    monkeypatch.setenv("CAMVIZ_RENDERER", "wire")
    picture, path = drawn(name), FOLDER / f"{name}.png"
    if os.environ.get("CAMVIZ_APPROVE"):
        in_palette(picture, picture.quantize(64)).save(path, optimize=True)
    with Image.open(path) as approved:
        assert picture.size == approved.size
        mean, block = differences(in_palette(picture, approved), approved)
    assert mean < MAX_MEAN_DIFFERENCE
    assert block < MAX_BLOCK_DIFFERENCE
