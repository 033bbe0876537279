"""Tests of what the lessons say, one file per lesson."""

import os
from pathlib import Path

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
