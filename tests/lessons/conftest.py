"""Tests of what the lessons say, one file per lesson."""

import os
from functools import cache
from pathlib import Path

import cv2
import numpy as np
import pytest
from quoting import Quotes


@pytest.fixture
def says(request):
    """Quotes a sentence of the lesson that the test file is named after; returns its numbers, which must be used."""
    quotes = Quotes(request.path.name.split("_")[1])
    yield quotes
    quotes.hold()


@pytest.fixture(scope="session")
def samples():
    """The folder of OpenCV's sample pictures and calibrations."""
    folder = os.environ.get("CAMVIZ_SAMPLES")
    if not folder:
        pytest.skip("CAMVIZ_SAMPLES does not name a folder with OpenCV's samples")
    return Path(folder) / "opencv-samples"


@pytest.fixture(scope="session")
def chessboards(samples):
    """`chessboards("left")`: the corners (13, 54, 2) of the photographs of OpenCV's left or right camera."""

    @cache
    def corners(side, window=5, steps=40):
        views = []
        for path in sorted(samples.glob(f"{side}??.jpg")):
            grey = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
            uv = cv2.findChessboardCorners(grey, (9, 6))[1]
            views.append(cv2.cornerSubPix(grey, uv, (window, window), (-1, -1), (3, steps, 1e-3)).reshape(54, 2))
        return np.array(views)

    return corners
