"""`camviz mtf`: an edge measured, in words, as JSON and as a page; everything else refused in one sentence."""

import json
import re

import cv2
import numpy as np
import pytest
from commandline import main, refused, run
from every_view import written
from test_slanted_edge import photograph, true_mtf, true_mtf50

from camviz.scenes import to_encoded
from camviz_clinic.measuring.sharpness import SlantedEdge
from camviz_clinic.views.measured_edge import MeasuredEdgeView


@pytest.fixture
def edge(room):
    """A picture of 8 bits, sRGB, whose part 100 × 200 from (60, 40) shows an edge of MTF50 0.22."""
    light = photograph("gauss", 0.8, 5, (300, 220))
    cv2.imwrite(str(room / "edge.png"), np.rint(255 * to_encoded(light)).astype(np.uint8))
    return room / "edge.png"


def test_the_figures_are_printed_and_are_those_of_the_edge(edge):
    done = run("mtf", str(edge), "--roi", "60,40,100,200", cwd=edge.parent)
    assert done.returncode == 0, done.stderr
    assert "an edge of 100 × 200 pixels, sRGB, made linear" in done.stdout
    assert f"{true_mtf50('gauss', 0.8, 5):.2f}" in done.stdout
    assert re.search(r"standard error of MTF50 +\S+ cycles/pixel", done.stdout)


def test_json_is_strict_and_has_the_curve(edge, capsys):
    assert main(["mtf", str(edge), "--json"]) == 0
    said = json.loads(capsys.readouterr().out, parse_constant=lambda name: pytest.fail(name))
    assert said["mtf50_cycles_per_pixel"] == pytest.approx(true_mtf50("gauss", 0.8, 5), rel=0.02)
    assert said["angle_deg"] == pytest.approx(5, abs=0.1)
    assert 0 < said["mtf50_standard_error"] < 0.01 * said["mtf50_cycles_per_pixel"]
    values = [one["mtf"] for one in said["curve"]]
    assert values == sorted(values, reverse=True)


def test_16_bits_are_light_and_8_bits_srgb_by_default(room, capsys):
    light = photograph("gauss", 1.5, 5, (120, 120), dark=0.05, contrast=0.9)
    cv2.imwrite(str(room / "raw.tif"), np.rint(65535 * light).astype(np.uint16))
    cv2.imwrite(str(room / "srgb.png"), np.rint(255 * to_encoded(light)).astype(np.uint8))
    found = {}
    for words in (("raw.tif",), ("srgb.png",), ("srgb.png", "--linear"), ("raw.tif", "--srgb")):
        assert main(["mtf", *words, "--json"]) == 0
        found[words] = json.loads(capsys.readouterr().out)["mtf50_cycles_per_pixel"]
    truth = true_mtf50("gauss", 1.5, 5)
    assert found["raw.tif",] == pytest.approx(truth, rel=0.01)
    assert found["srgb.png",] == pytest.approx(truth, rel=0.02)
    assert abs(found["srgb.png", "--linear"] / truth - 1) > 0.03
    assert abs(found["raw.tif", "--srgb"] / truth - 1) > 0.03


def test_a_coloured_edge_is_measured_by_its_luminance(room, capsys):
    light = photograph("gauss", 1.0, 5, (120, 120))
    blurred = photograph("gauss", 3.0, 5, (120, 120))
    bgr = np.rint(65535 * np.stack([blurred, light, light], axis=-1)).astype(np.uint16)
    cv2.imwrite(str(room / "colour.png"), bgr)
    assert main(["mtf", "colour.png", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)["mtf50_cycles_per_pixel"]
    blue = 0.0722  # of the luminance, by ITU-R BT.709
    left = (1 - blue) * true_mtf("gauss", 1.0, 5, found) + blue * true_mtf("gauss", 3.0, 5, found)
    assert left == pytest.approx(0.5, abs=0.005)


def test_the_page_is_written_whole_and_shows_the_figures(edge, capsys):
    page = edge.with_name("page.html")
    assert main(["mtf", str(edge), "--report", str(page)]) == 0
    text = page.read_text(encoding="utf-8")
    assert "MTF50" in text
    assert "standard error of MTF50" in text
    assert "http://" not in text.replace("http://www.w3.org", "")
    assert "open it in a browser" in capsys.readouterr().out


def test_the_view_states_its_figures():
    view = MeasuredEdgeView(edge=SlantedEdge.of(photograph("gauss", 0.8, 5)), name="here")
    assert "MTF50 0.220 cycles/pixel" in view.description()
    assert "nan" not in written(view.figure()).lower()


def test_what_cannot_be_measured_is_refused_in_one_sentence(edge, room, capsys):
    grey = np.full((50, 50), 90, np.uint8)
    cv2.imwrite(str(room / "grey.png"), grey)
    (room / "words.png").write_text("no picture")
    assert "holds no edge" in refused(capsys, room, "mtf", "grey.png")
    assert "not a picture that can be read" in refused(capsys, room, "mtf", "words.png")
    assert "No such file or directory" in refused(capsys, room, "mtf", "none.png")
    assert "expected X,Y,WIDTH,HEIGHT" in refused(capsys, room, "mtf", str(edge), "--roi", "1,2,3")
    assert "got 0,0,999,10" in refused(capsys, room, "mtf", str(edge), "--roi", "0,0,999,10")
    assert "overwrite" in refused(capsys, room, "mtf", str(edge), "--report", str(edge))
    assert "at least 16 × 16" in refused(capsys, room, "mtf", str(edge), "--roi", "0,0,10,10")
