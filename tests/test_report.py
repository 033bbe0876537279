"""The clinic's report: every finding leads to its view, everything is inside one file, and pictures are linked."""

import asyncio
import io
import re
from dataclasses import replace
from functools import cache
from html.parser import HTMLParser

import cv2
import numpy as np
import pytest
from calibrations import bare, pair, sick, single
from PIL import Image

import camviz_clinic
from camviz.draw.picture import jpeg, png
from camviz_clinic.checks import Inspection, inspect, inspect_file, kinds
from camviz_clinic.report.inspection import MOST_VIEWS, accused, report, worst_views, write_report
from camviz_clinic.report.notebook import LiveInspection
from camviz_clinic.report.pictures import QUALITY, webp
from camviz_clinic.views.catalogue import ALIASES, VIEWS, Case

VOID = {"meta", "br", "img", "link", "input", "hr"}


class Strict(HTMLParser):
    """Complains about tags that are not closed in their order; gathers ids and links."""

    def __init__(self) -> None:
        super().__init__()
        self.open, self.ids, self.links = [], [], []

    def handle_starttag(self, tag, attributes):
        values = dict(attributes)
        self.ids += [values["id"]] if "id" in values else []
        self.links += [values[key] for key in ("href", "src") if key in values]
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        values = dict(attributes)
        self.links += [values[key] for key in ("href", "src") if key in values]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def parsed(text: str) -> Strict:
    page = Strict()
    page.feed(text)
    page.close()
    assert page.open == []
    return page


CALIBRATIONS = {"healthy": single, "sick": sick, "pair": pair, "bare": bare}


@cache
def inspected(name: str) -> Inspection:
    """The inspection of one of `CALIBRATIONS`, made once."""
    return inspect(CALIBRATIONS[name]())


@cache
def reported(name: str) -> str:
    """Its report, made once."""
    return report(inspected(name))


@pytest.fixture(scope="module", params=CALIBRATIONS)
def page(request):
    text = reported(request.param)
    return inspected(request.param), text, parsed(text)


@pytest.mark.sampled(1)
def test_every_link_inside_the_page_leads_somewhere(page):
    _, _, parts = page
    inside = {link[1:] for link in parts.links if link.startswith("#")}
    assert inside <= set(parts.ids)
    assert len(parts.ids) == len(set(parts.ids))


@pytest.mark.sampled(2)
def test_every_view_of_a_finding_has_its_anchor_whatever_was_found(page):
    _, _, parts = page
    assert {f"view-{kind.view}" for kind in kinds().values()} <= set(parts.ids)
    assert {f"view-{name}" for name in (*VIEWS, *ALIASES)} <= set(parts.ids)


def test_the_page_needs_nothing_from_elsewhere(page):
    _, text, parts = page
    assert [link for link in parts.links if not link.startswith(("#", "data:"))] == []
    assert re.sub(r"http://www\.w3\.org/\S+", "", text).count("http") == 0
    assert "attached:" not in text
    assert "@import" not in text


def test_findings_come_first_with_their_words(page):
    inspection, text, _ = page
    assert text.index('id="findings"') < text.index('id="view-')
    for finding in inspection.findings:
        assert finding.id in text
    if not inspection.findings:
        assert "No problem found" in text


def test_the_bars_pictures_and_boards_of_a_view_share_its_number():
    text = reported("sick")
    bars = set(re.findall(r'<a href="#of-camera-\d+" data-choose="(\d+)" aria-label', text))
    boards = set(re.findall(r'class="board" href="#of-camera-\d+" data-choose="(\d+)"', text))
    figures = set(re.findall(r'<figure id="of-camera-\d+" data-view="(\d+)"', text))
    assert bars == boards == figures == {str(i + 1) for i in range(10)}
    assert 'data-first="4"' in text


def test_photographs_are_embedded_small(tmp_path):
    noise = np.random.default_rng(0).integers(0, 255, (480, 640), np.uint8)
    calibration = single()
    for name in calibration.pictures["camera"]:
        cv2.imwrite(str(tmp_path / name), cv2.GaussianBlur(noise, (0, 0), 3))
    text = report(inspected("healthy"), images=tmp_path)
    assert len(text) < 5e6
    assert "is not at hand" not in text
    assert "The picture is not at hand; name its folder: --images FOLDER" in reported("healthy")
    assert text.count("data:image/webp") >= 10


def test_photographs_keep_their_edges_and_maps_every_pixel():
    """A noisy JPEG keeps its slopes within 3 %. What is transparent in a map has no colour to keep."""
    rng = np.random.default_rng(0)
    grey = cv2.GaussianBlur(rng.integers(0, 255, (240, 320), np.uint8), (0, 0), 2)
    before = jpeg(grey)
    after = webp(before, QUALITY)
    assert after.startswith(b"RIFF")
    assert len(after) < 0.8 * len(before)
    assert edges(after) == pytest.approx(edges(before), rel=0.03)
    map_ = rng.integers(0, 2, (12, 16, 4), np.uint8) * 200
    shown = np.array(Image.open(io.BytesIO(webp(png(map_), QUALITY))))
    np.testing.assert_array_equal(shown[..., 3], map_[..., 3])
    np.testing.assert_array_equal(shown[map_[..., 3] > 0], map_[map_[..., 3] > 0])


def edges(data: bytes) -> float:
    """The mean slope of a grey photograph, in grey levels a pixel."""
    grey = np.array(Image.open(io.BytesIO(data)).convert("L"), float)
    return float(np.hypot(*np.gradient(grey)).mean())


def test_every_tile_knows_its_shape_before_it_is_drawn(page):
    _, text, _ = page
    tiles = re.findall(
        r'<svg [^>]*camviz-fitted[^>]* viewBox="\S+ \S+ (\S+) (\S+)" style="aspect-ratio:(.*?)/(.*?)"', text
    )
    assert len(tiles) == text.count('class="camviz-svg camviz-fitted"') > 0
    assert all(tile[:2] == tile[2:] for tile in tiles)


def test_what_scrolls_on_a_phone_can_be_scrolled_by_keys():
    text = reported("healthy")
    assert 0 < text.count('camviz-scrolled"') == text.count('camviz-scrolled" tabindex="0"')


def test_a_board_in_space_is_called_by_the_number_of_its_picture():
    few = single(views=10)
    names = tuple(f"left{i:02}.jpg" for i in (*range(1, 10), 11))
    text = report(Inspection(replace(few, pictures={"camera": names}), (), ()))
    boards = re.findall(r'aria-label="the board of (left\d+).jpg".*?class="note[^>]*>(\d+)<', text)
    assert ("left11", "11") in boards
    assert all(int(name.removeprefix("left")) == int(number) for name, number in boards)


@pytest.mark.thorough
def test_of_many_views_the_worst_are_shown_and_the_page_says_so():
    """Five hundred views, the tenth of which is bad."""
    few = single(views=10)
    uv = np.tile(few.detections["camera"], (50, 1, 1))
    uv[9] += np.random.default_rng(0).normal(0, 3, uv[9].shape)
    poses = type(few.cam_from_board["camera"]).concatenate([few.cam_from_board["camera"]] * 50)
    many = replace(few, detections={"camera": uv}, cam_from_board={"camera": poses}, pictures={}, per_view_errors={})
    text = report(Inspection(many, (), ()))
    assert f"Of the 500 views {MOST_VIEWS} are shown: those that a finding names, and the worst." in text
    assert text.count("<figure id=") == MOST_VIEWS
    assert 'id="of-camera-10"' in text
    assert len(text) < 5e6
    parsed(text)
    named = worst_views(Case(many).observations("camera"), [300])
    assert {9, 300} < set(named)
    assert len(named) == MOST_VIEWS


def test_the_report_opens_at_what_the_gravest_finding_is_about():
    """The worst view of `sick` is the fourth; a fault about the second comes before a warning about the third."""
    calibration = sick()
    kind = kinds()["outlier-view"]
    first = kind.found("a", 1.0, "px", "camera", pictures=(1, 5), severity="fault")
    other = kind.found("b", 1.0, "px", "camera", pictures=(2,), severity="warning")
    assert accused(Inspection(calibration, (first, other), ()), "camera") == [1, 5, 2]
    assert accused(Inspection(calibration, (first,), ()), "another") == []
    assert 'data-first="2"' in report(Inspection(calibration, (first, other), ()))
    assert 'data-first="4"' in report(Inspection(calibration, (), ()))


def test_a_file_that_cannot_be_read_gets_its_finding_and_no_views(tmp_path):
    path = tmp_path / "bad.yml"
    path.write_text(
        "%YAML:1.0\nimage_width: 640\nimage_height: 480\n"
        "camera_matrix: [[500, 0, 320], [0, 500, 240], [0, 0, 0]]\ndistortion_coefficients: [0.1, 0, 0, 0, 0]\n"
    )
    inspection = inspect_file(path)
    text = report(replace(inspection, calibration=None))
    assert parsed(text).ids.count("findings") == 1
    assert "could not be read" in text
    for finding in inspection.findings:
        assert f'id="view-{finding.view}"' in text


def test_names_from_a_file_are_words_and_not_html():
    healthy = single()
    hostile = "<img src=x onerror=alert(1)>'\""
    calibration = replace(
        healthy,
        cameras={hostile: healthy.cameras["camera"]},
        detections={hostile: healthy.detections["camera"]},
        cam_from_board={hostile: healthy.cam_from_board["camera"]},
        pictures={hostile: (hostile,) * 10},
        per_view_errors={},
        estimated={},
        notes=(hostile,),
    )
    text = report(inspect(calibration))
    assert "<img" not in text
    parsed(text)


def test_the_report_is_written_as_it_is_made(tmp_path):
    write_report(inspected("bare"), tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == reported("bare")


# In a notebook -------------------------------------------------------------------------------------------------------


def test_the_notebook_shows_the_view_of_the_worst_finding_first_and_any_other_on_demand():
    inspection = inspected("sick")
    live = LiveInspection(inspection)
    first = inspection.findings[0].view
    assert type(live.view) is type(VIEWS[ALIASES.get(first, first)].view(live.case))
    for name in VIEWS:
        assert live.show(name).explorer.frame["error"] == ""
    with pytest.raises(ValueError, match="name must be one of numbers, residual-vectors"):
        live.show("nonsense")


def test_the_notebook_chooses_between_cameras():
    live = LiveInspection(inspected("pair")).show("residual-histogram", "right")
    assert live.view.observations.name == "right"
    with pytest.raises(ValueError, match="camera must be one of left, right, got 'top'"):
        live.show("coverage", "top")


@pytest.fixture
def displayed(monkeypatch):
    shown = []
    for module in ("camviz_clinic.report.notebook", "camviz.widgets.still"):
        monkeypatch.setattr(f"{module}.display", lambda what, **_: shown.append(what))
    return shown


def test_a_saved_notebook_keeps_the_findings_and_a_still(displayed, monkeypatch):
    monkeypatch.delenv("CAMVIZ_STATIC", raising=False)
    inspection = camviz_clinic.inspect(sick())
    live = LiveInspection(inspection)
    live._ipython_display_()
    words, still, widget = displayed
    assert inspection.findings[0].id in words["text/html"]
    assert inspection.findings[0].sentence in words["text/plain"]
    assert "<img" in still["text/html"]
    assert widget["application/vnd.jupyter.widget-view+json"]["model_id"] == live.widget.model_id
    assert re.search(r'data-camviz-still="(\w+)"', still["text/html"])[1] in live.explorer.still_hidden


def test_the_saved_still_is_of_the_view_that_was_chosen_last(displayed, monkeypatch):
    monkeypatch.delenv("CAMVIZ_STATIC", raising=False)
    monkeypatch.setattr("camviz.widgets.still._REST_S", 0.0)
    kept = []
    monkeypatch.setattr("camviz.widgets.still.update_display", lambda bundle, **_: kept.append(bundle["text/plain"]))

    async def cell() -> None:
        live = LiveInspection(inspected("sick"))
        live._ipython_display_()
        live.show("coverage")
        await asyncio.sleep(0.01)

    asyncio.run(cell())
    (words,) = kept
    assert words.startswith("Coverage")


def test_whatever_view_is_chosen_later_hides_the_one_still(displayed):
    live = LiveInspection(inspected("sick"))
    live._ipython_display_()
    assert live.still_id in live.show("coverage").explorer.still_hidden


def test_a_file_that_cannot_be_read_has_words_alone(displayed):
    LiveInspection(replace(inspected("bare"), calibration=None))._ipython_display_()
    assert len(displayed) == 1
