"""Saved pictures open everywhere: nothing in them that only a browser knows, and what is asked of PNG and PDF."""

import re
import sys
import zlib
from base64 import b64decode
from xml.etree import ElementTree

import cv2
import numpy as np
import pytest
from every_view import STATES, classes, figure

from camviz.draw import svg
from camviz.draw.marks import Marks
from camviz.draw.picture import Picture, jpeg, png
from camviz.views.distortion import DistortionView
from camviz_school.views.pinhole import PinholeView

SVG = "{http://www.w3.org/2000/svg}"
LINK = "{http://www.w3.org/1999/xlink}href"
PLAIN = {"circle", "svg", "title", "tspan", "desc", "g", "path", "text", "rect", "image", "clipPath"}


def test_a_state_of_every_view_is_among_them():
    assert {type(make()).__name__ for make in STATES.values()} == set(classes())


@pytest.mark.sampled(20)
@pytest.mark.parametrize("theme", ["light", "dark"])
@pytest.mark.parametrize("name", STATES)
def test_a_saved_view_has_nothing_that_only_browsers_know(name, theme, tmp_path):
    figure(name).save(tmp_path / "saved.svg", theme=theme)
    root = ElementTree.parse(tmp_path / "saved.svg").getroot()
    elements = list(root.iter())
    assert {element.tag.removeprefix(SVG) for element in elements} <= PLAIN
    assert not {"class", "style", "mask", "paint-order"} & {key for element in elements for key in element.attrib}
    assert not [value for one in elements for value in one.attrib.values() if "var(" in value or "attached:" in value]
    assert sum(element.tag == f"{SVG}svg" for element in elements) == 1
    shapes = [one for one in elements if one.tag.removeprefix(SVG) in ("circle", "path", "rect", "text")]
    clips = {id(rect) for clip in root.iter(f"{SVG}clipPath") for rect in clip}
    assert [one.attrib for one in shapes if "fill" not in one.attrib and id(one) not in clips] == []  # these are black


def picture(body: Marks, **photographs: bytes) -> Picture:
    return Picture.whole(body, 40, 40, "Title", "What it shows", photographs)


def plain(body: Marks, **photographs: bytes) -> ElementTree.Element:
    return ElementTree.fromstring(picture(body, **photographs).portable())


def test_the_stronger_rule_wins_and_an_own_style_over_both():
    drawn = svg.polygon([(0, 0), (9, 0), (9, 9)], "wash fill-blue")
    drawn += svg.line([(0, 0), (9, 9)], "blue thick") + svg.line([(0, 0), (9, 9)], "blue thick", stroke_width=7)
    drawn += svg.polygon([(0, 0), (9, 0), (9, 9)], "wash blue")
    fill, thick, own, outlined = plain(drawn).iter(f"{SVG}path")
    assert (fill.get("fill"), fill.get("fill-opacity"), fill.get("stroke")) == ("#0067a5", "0.16", "none")
    assert (thick.get("fill"), thick.get("stroke"), thick.get("stroke-width")) == ("none", "#0067a5", "2.8")
    assert own.get("stroke-width") == "7"
    assert outlined.get("stroke") == "#0067a5"  # `path.blue` names more than `.wash`, which comes later


def test_words_stand_over_their_halo_and_hints_are_left_out():
    halo, words = plain(svg.text((5, 5), "here", "label blue halo")).iter(f"{SVG}text")
    assert (halo.text, halo.get("stroke"), halo.get("fill")) == ("here", "#ffffff", "#ffffff")
    assert (words.text, words.get("stroke"), words.get("fill")) == ("here", None, "#0067a5")
    assert list(plain(svg.text((5, 5), "drag me", "note hint")).iter(f"{SVG}text")) == []


def embedded(drawn: Marks, **photographs: bytes) -> np.ndarray:
    """The pixels of the one image of a saved picture."""
    (image,) = plain(drawn, **photographs).iter(f"{SVG}image")
    data = image.get(LINK).removeprefix("data:image/png;base64,")
    return cv2.imdecode(np.frombuffer(b64decode(data), np.uint8), cv2.IMREAD_UNCHANGED)


def test_masks_and_hard_pixels_are_made_of_pixels():
    """A mask becomes transparency; few pixels are given as many that a program's smoothing does not show."""
    grey, mask = np.full((4, 4), 90, np.uint8), np.diag([255] * 4).astype(np.uint8)
    found = embedded(svg.image("p", 0, 0, 4, 4, mask="m", mask_id="one"), p=jpeg(grey), m=png(mask))
    np.testing.assert_array_equal(found[..., 3], mask)
    np.testing.assert_allclose(found[..., :3], 90, atol=2)
    few = np.array([[0, 200], [50, 255]], np.uint8)
    found = embedded(svg.image("p", 0, 0, 40, 40, image_rendering="pixelated"), p=png(few))
    assert found.shape == (160, 160)
    np.testing.assert_array_equal(found[::80, ::80], few)
    ramp = np.linspace(0, 255, 64).astype(np.uint8)[:, None]  # a colour bar one pixel wide
    found = embedded(svg.image("p", 0, 0, 14, 40), p=png(ramp))
    np.testing.assert_array_equal(found, np.repeat(ramp, 14, axis=1))


def test_the_size_of_a_png_is_its_units_by_their_resolution(tmp_path):
    pytest.importorskip("cairosvg")
    view = PinholeView()
    for dpi, per_unit in ((96, 1), (192, 2)):
        view.save(tmp_path / "p.png", dpi=dpi)
        height, width = cv2.imread(str(tmp_path / "p.png")).shape[:2]
        figure = view.figure()
        assert (width, height) == (round(per_unit * figure.width), round(per_unit * figure.height))


def test_a_pdf_has_all_of_its_fonts_inside(tmp_path):
    pytest.importorskip("cairosvg")
    DistortionView(k1=-0.2).save(tmp_path / "p.pdf")
    data = (tmp_path / "p.pdf").read_bytes()
    parts = [data]
    for stream in re.findall(rb"stream\r?\n(.*?)\r?\nendstream", data, flags=re.DOTALL):
        try:
            parts.append(zlib.decompress(stream))
        except zlib.error:
            continue
    text = b"\n".join(parts)
    assert data.startswith(b"%PDF")
    assert text.count(b"/FontDescriptor\n") == len(re.findall(rb"/FontFile\d? \d+ 0 R", text)) >= 3
    assert b"DejaVuSans" in text


def test_without_cairosvg_a_png_says_what_to_install(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "cairosvg", None)
    with pytest.raises(ModuleNotFoundError, match=r"pip install camviz\[figures\]") as refused:
        picture(svg.NOTHING).save(tmp_path / "p.png")
    assert str(refused.value).count(".") == str(refused.value).rstrip(".").count(".") + 1
    picture(svg.NOTHING).save(tmp_path / "p.svg")
    assert not (tmp_path / "p.png").exists()


@pytest.mark.parametrize(("name", "options", "words"), [
    ("p.jpg", {}, r"must end in \.svg, \.png or \.pdf, got 'p.jpg'"),
    ("p.svg", {"theme": "blue"}, r"theme must be one of 'light', 'dark', got 'blue'"),
])  # fmt: skip
def test_what_cannot_be_saved_is_refused_in_words(name, options, words, tmp_path):
    with pytest.raises(ValueError, match=words):
        picture(svg.NOTHING).save(tmp_path / name, **options)
    picture(svg.NOTHING).save(tmp_path / "p.svg", theme="browser")  # keeps its style sheet
    assert "prefers-color-scheme: dark" in (tmp_path / "p.svg").read_text()
