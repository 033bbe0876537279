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
def test_a_saved_view_holds_nothing_that_only_browsers_know(name, theme, tmp_path):
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


def test_light_and_dark_differ_in_their_colours_alone():
    light, dark = (DistortionView(k1=-0.2).figure().portable(theme) for theme in ("light", "dark"))
    assert "#1c2330" in light
    assert "#1c2330" not in dark
    assert re.sub(r"#[0-9a-f]{6}", "", light) == re.sub(r"#[0-9a-f]{6}", "", dark)


def picture(body: Marks, **photographs: bytes) -> Picture:
    return Picture.whole(body, 40, 40, "Title", "What it shows", photographs)


def plain(body: Marks, **photographs: bytes) -> ElementTree.Element:
    return ElementTree.fromstring(picture(body, **photographs).portable())


def test_the_stronger_rule_wins_and_an_elements_own_style_over_both():
    drawn = svg.polygon([(0, 0), (9, 0), (9, 9)], "wash fill-blue")
    drawn += svg.line([(0, 0), (9, 9)], "blue thick") + svg.line([(0, 0), (9, 9)], "blue thick", stroke_width=7)
    drawn += svg.polygon([(0, 0), (9, 0), (9, 9)], "wash blue")
    fill, thick, own, outlined = plain(drawn).iter(f"{SVG}path")
    assert (fill.get("fill"), fill.get("fill-opacity"), fill.get("stroke")) == ("#0067a5", "0.16", "none")
    assert (thick.get("fill"), thick.get("stroke"), thick.get("stroke-width")) == ("none", "#0067a5", "2.8")
    assert own.get("stroke-width") == "7"
    assert outlined.get("stroke") == "#0067a5"  # `path.blue` names more than `.wash`, which comes later


def test_words_with_a_halo_stand_over_their_halo():
    halo, words = plain(svg.text((5, 5), "here", "label blue halo")).iter(f"{SVG}text")
    assert (halo.text, halo.get("stroke"), halo.get("fill")) == ("here", "#ffffff", "#ffffff")
    assert (words.text, words.get("stroke"), words.get("fill")) == ("here", None, "#0067a5")


def test_hints_for_the_mouse_are_left_out():
    assert list(plain(svg.text((5, 5), "drag me", "note hint")).iter(f"{SVG}text")) == []


def embedded(root: ElementTree.Element) -> np.ndarray:
    (image,) = root.iter(f"{SVG}image")
    data = re.fullmatch(r"data:image/png;base64,(.+)", image.get(LINK))[1]
    return cv2.imdecode(np.frombuffer(b64decode(data), np.uint8), cv2.IMREAD_UNCHANGED)


def test_a_mask_becomes_transparency():
    grey, mask = np.full((4, 4), 90, np.uint8), np.diag([255] * 4).astype(np.uint8)
    found = embedded(plain(svg.image("p", 0, 0, 4, 4, mask="m", mask_id="one"), p=jpeg(grey), m=png(mask)))
    np.testing.assert_array_equal(found[..., 3], mask)
    np.testing.assert_allclose(found[..., :3], 90, atol=2)


def test_hard_pixels_are_given_as_many_that_smoothing_does_not_show():
    few = np.array([[0, 200], [50, 255]], np.uint8)
    found = embedded(plain(svg.image("p", 0, 0, 40, 40, image_rendering="pixelated"), p=png(few)))
    assert found.shape == (160, 160)
    np.testing.assert_array_equal(found[::80, ::80], few)


def test_a_colour_bar_one_pixel_wide_gets_pixels_enough_that_its_borders_do_not_fade():
    ramp = np.linspace(0, 255, 64).astype(np.uint8)[:, None]
    found = embedded(plain(svg.image("p", 0, 0, 14, 40), p=png(ramp)))
    assert found.shape == (64, 14)
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


def test_without_cairosvg_a_png_says_what_to_install_and_an_svg_is_saved(tmp_path, monkeypatch):
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


def test_for_a_browser_the_picture_keeps_its_style_sheet(tmp_path):
    picture(svg.NOTHING).save(tmp_path / "p.svg", theme="browser")
    assert "prefers-color-scheme: dark" in (tmp_path / "p.svg").read_text()
