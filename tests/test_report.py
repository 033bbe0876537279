"""The clinic's report: every finding leads to its view, everything is inside one file, and pictures are linked."""

import asyncio
import io
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
from camviz_clinic.report.inspection import MOST_VIEWS, _boards, accused, report, worst_views
from camviz_clinic.report.notebook import LiveInspection
from camviz_clinic.report.pictures import QUALITY, webp
from camviz_clinic.views.catalogue import ALIASES, VIEWS, Case
from camviz_clinic.views.observations import Observations

VOID = {"meta", "br", "img", "link", "input", "hr"}


class Strict(HTMLParser):
    """Complains about tags that are not closed in their order; gathers the attributes of every element."""

    def __init__(self) -> None:
        super().__init__()
        self.open, self.elements = [], []

    def handle_starttag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.elements.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def values(self, *attributes, tag=""):
        """What elements of a tag, or of any, have of some attributes."""
        found = [each for name, each in self.elements if tag in ("", name)]
        return [each[attribute] for each in found for attribute in attributes if attribute in each]


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


@pytest.mark.parametrize("name", CALIBRATIONS)
def test_a_page_is_whole_and_each_finding_leads_to_its_view(name):
    inspection, text, parts = inspected(name), reported(name), parsed(reported(name))
    ids, links = parts.values("id"), parts.values("href", "src")
    assert len(ids) == len(set(ids))
    assert {link[1:] for link in links if link.startswith("#")} <= set(ids)
    assert [link for link in links if not link.startswith(("#", "data:"))] == []
    assert text.replace("http://www.w3.org/", "").count("http") == 0
    assert "attached:" not in text
    assert {f"view-{kind.view}" for kind in kinds().values()} <= set(ids)
    assert {f"view-{view}" for view in (*VIEWS, *ALIASES)} <= set(ids)
    assert text.index('id="findings"') < text.index('id="view-')
    assert all(finding.id in text for finding in inspection.findings)
    assert inspection.findings or "No problem found" in text


def test_bars_pictures_and_boards_of_a_view_share_its_number():
    parts = parsed(reported("sick"))
    numbers = {str(i + 1) for i in range(10)}
    assert set(parts.values("data-choose", tag="a")) == set(parts.values("data-view", tag="figure")) == numbers
    assert parts.values("data-choose", tag="a").count("4") == 2  # of its bar and of its board
    assert parts.values("data-first") == ["4"]
    tiles = [each for tag, each in parts.elements if tag == "svg" and "camviz-fitted" in each.get("class", "")]
    assert tiles
    for tile in tiles:  # each knows its shape before it is drawn
        assert tile["style"] == "aspect-ratio:{}/{}".format(*tile["viewbox"].split()[2:])
    scrolled = [each for _, each in parts.elements if "camviz-scrolled" in (each.get("class") or "")]
    assert scrolled
    assert all(each.get("tabindex") == "0" for each in scrolled)


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


def test_a_board_in_space_has_the_number_of_its_picture():
    few = single(views=10)
    names = tuple(f"left{i:02}.jpg" for i in (*range(1, 10), 11))
    seen = Observations.of(replace(few, pictures={"camera": names}))
    boards = _boards(seen, "camera", dict.fromkeys(range(10), "#")).marks.of("board")
    numbers = {board.attributes["aria_label"]: board.marks.texts()[0].words for board in boards}
    assert numbers == {f"the board of {name}": f"{int(name[4:6])}" for name in names}


def test_photographs_keep_their_edges_and_maps_every_pixel():
    """A noisy JPEG keeps its slopes within 3 %. What is transparent in a map has no colour to keep."""

    def slope(data):
        """The mean slope of a grey photograph, in grey levels a pixel."""
        return np.hypot(*np.gradient(np.array(Image.open(io.BytesIO(data)).convert("L"), float))).mean()

    rng = np.random.default_rng(0)
    before = jpeg(cv2.GaussianBlur(rng.integers(0, 255, (240, 320), np.uint8), (0, 0), 2))
    after = webp(before, QUALITY)
    assert len(after) < 0.8 * len(before)
    assert slope(after) == pytest.approx(slope(before), rel=0.03)
    map_ = rng.integers(0, 2, (12, 16, 4), np.uint8) * 200
    shown = np.array(Image.open(io.BytesIO(webp(png(map_), QUALITY))))
    np.testing.assert_array_equal(shown[..., 3], map_[..., 3])
    np.testing.assert_array_equal(shown[map_[..., 3] > 0], map_[map_[..., 3] > 0])


@pytest.mark.thorough
def test_of_many_views_the_worst_are_shown():
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


def test_the_report_opens_at_the_gravest_findings_view():
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
    assert parsed(text).values("id").count("findings") == 1
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


# In a notebook -------------------------------------------------------------------------------------------------------


def test_the_notebook_shows_the_worst_findings_view_first():
    inspection = inspected("sick")
    live = LiveInspection(inspection)
    first = inspection.findings[0].view
    assert type(live.view) is type(VIEWS[ALIASES.get(first, first)].view(live.case))
    for name in VIEWS:
        assert live.show(name).explorer.frame["error"] == ""
    with pytest.raises(ValueError, match="name must be one of numbers, residual-vectors"):
        live.show("nonsense")
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
    (hidden,) = parsed(still["text/html"]).values("data-camviz-still")
    assert hidden == live.still_id
    assert hidden in live.explorer.still_hidden
    assert hidden in live.show("coverage").explorer.still_hidden  # whatever is chosen later
    displayed.clear()
    LiveInspection(replace(inspected("bare"), calibration=None))._ipython_display_()
    assert len(displayed) == 1  # of a file that cannot be read, words alone


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
