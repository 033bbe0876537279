"""A saved SVG looks the same to cairosvg and to Chromium, and as the picture did in the notebook."""

import sys
from base64 import b64encode
from math import ceil
from pathlib import Path

import cv2
import numpy as np
import pytest
from laboratory import new_page
from playwright.sync_api import Browser, Page

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from every_view import STATES, figure

from camviz.draw.picture import Picture

pytestmark = pytest.mark.browser
cairosvg = pytest.importorskip("cairosvg")

MOST = 0.02  # of all pixels
SLACK = 24  # levels of 255 by which a pixel may be off the range of the other picture's pixels around it
AROUND = np.ones((3, 3), np.uint8)  # pixels: how far antialiasing and a letter's hinting reach


@pytest.fixture(scope="module", params=["light", pytest.param("dark", marks=pytest.mark.thorough)])
def page(request, browser: Browser):
    page = new_page(browser, viewport={"width": 1000, "height": 1000}, color_scheme=request.param)
    page.theme = request.param
    yield page
    page.close()


def decoded(data: bytes) -> np.ndarray:
    return np.asarray(cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR))


def in_chromium(page: Page, html: str, picture: Picture) -> np.ndarray:
    page.set_content(f'<body style="margin:0">{html}</body>')
    return decoded(page.screenshot(clip={"x": 0, "y": 0, "width": int(picture.width), "height": int(picture.height)}))


def apart(one: np.ndarray, other: np.ndarray) -> float:
    """The share of pixels that are unlike all those around them in the other picture, and the other way round."""
    return max(_beyond(one, other), _beyond(other, one))


def _beyond(one: np.ndarray, other: np.ndarray) -> float:
    low, high = cv2.erode(other, AROUND).astype(int) - SLACK, cv2.dilate(other, AROUND).astype(int) + SLACK
    return float(((one < low) | (one > high)).any(axis=-1).mean())


def test_what_counts_as_apart():
    plain = np.full((100, 100, 3), 200, np.uint8)
    for most, drawn in ((0.0, 202), (0.05, 150)):
        other = plain.copy()
        other[:10, :50] = drawn
        assert apart(plain, other) == pytest.approx(most, abs=0.012)
    assert apart(plain, np.roll(plain, 1, axis=0)) == 0


@pytest.mark.parametrize("name", STATES)
def test_cairosvg_chromium_and_the_notebook_agree(page: Page, name: str, tmp_path: Path):
    picture = figure(name)
    page.set_viewport_size({"width": ceil(picture.width), "height": ceil(picture.height)})
    picture.save(tmp_path / "saved.svg", theme=page.theme)
    data = b64encode((tmp_path / "saved.svg").read_bytes()).decode()
    by_chromium = in_chromium(page, f'<img src="data:image/svg+xml;base64,{data}">', picture)
    by_cairo = decoded(cairosvg.svg2png(url=str(tmp_path / "saved.svg")))[
        : by_chromium.shape[0], : by_chromium.shape[1]
    ]
    in_notebook = in_chromium(page, picture.standalone(), picture)
    assert apart(by_cairo, by_chromium) <= MOST
    assert apart(in_notebook, by_chromium) <= MOST


@pytest.mark.parametrize("name", STATES)
def test_every_image_of_a_still_is_drawn(page: Page, name: str):
    """On a telephone and on a desk; an image that Chromium cannot read is 0 pixels wide."""
    for width in (375, 1440):
        page.set_viewport_size({"width": width, "height": 900})
        page.set_content(figure(name).figure())
        images = page.locator("img")
        assert images.count() > 0
        assert min(images.evaluate_all("images => images.map(image => image.naturalWidth)")) > 100
