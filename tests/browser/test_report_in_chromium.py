"""The clinic's report in a real browser: a bar brings its picture and its board, offline, without an error."""

import sys
from pathlib import Path

import numpy as np
import pytest
from laboratory import new_page
from playwright.sync_api import Browser, Page

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from calibrations import pair, sick

from camviz_clinic.checks import inspect
from camviz_clinic.report.inspection import write_report

pytestmark = pytest.mark.browser


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    import cv2

    folder = tmp_path_factory.mktemp("report")
    calibration = sick()
    for i, name in enumerate(calibration.pictures["camera"]):
        cv2.imwrite(str(folder / name), np.full((480, 640), 20 * i + 20, np.uint8))
    write_report(inspect(calibration), folder / "one.html", images=folder)
    write_report(inspect(pair()), folder / "pair.html")
    return folder


def opened(browser: Browser, path: Path, **options) -> tuple[Page, list[str], list[str]]:
    """The page, and what it complains of, and whatever it asks the network for."""
    page = new_page(browser, viewport={"width": 1200, "height": 1000}, **options)
    complaints, asked = [], []
    page.on("console", lambda message: complaints.append(message.text))
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.on("request", lambda request: asked.append(request.url))
    page.goto(path.as_uri())
    return page, complaints, [url for url in asked if not url.startswith(("file:", "data:"))]


def chosen(page: Page) -> tuple[list[str], list[str], list[str]]:
    """Which picture can be seen, which bar and which board are picked out."""
    return tuple(
        page.eval_on_selector_all(selector, f"found => found.filter({test}).map(one => one.dataset.{key})")
        for selector, test, key in (
            (".pictures figure", "one => one.getClientRects().length > 0", "view"),
            ("a[data-choose]:not(.board)", "one => one.classList.contains('chosen')", "choose"),
            ("a.board", "one => one.classList.contains('chosen')", "choose"),
        )
    )


@pytest.mark.parametrize("scheme", ["light", "dark"])
def test_a_bar_brings_its_picture_and_its_board(browser, written, scheme):
    page, complaints, asked = opened(browser, written / "one.html", color_scheme=scheme)
    assert chosen(page) == (["4"], ["4"], ["4"])  # the worst
    before = page.locator("a.board[data-choose='7'] path.muted").first.evaluate("path => getComputedStyle(path).stroke")
    page.locator("a[data-choose='7']:not(.board) rect").click()
    assert chosen(page) == (["7"], ["7"], ["7"])
    after = page.locator("a.board[data-choose='7'] path.muted").first.evaluate("path => getComputedStyle(path).stroke")
    assert before != after
    assert page.evaluate("document.activeElement.dataset.choose") == "7"
    assert complaints == []
    assert asked == []
    page.close()


def test_a_board_in_space_brings_its_bar(browser, written):
    page, complaints, _ = opened(browser, written / "one.html")
    page.evaluate(
        "document.querySelector(\"a.board[data-choose='2']\").dispatchEvent(new MouseEvent('click', "
        "{bubbles: true, cancelable: true}))"
    )
    assert chosen(page) == (["2"], ["2"], ["2"])
    assert complaints == []
    page.close()


def test_the_arrow_keys_go_from_view_to_view(browser, written):
    page, complaints, _ = opened(browser, written / "one.html")
    page.locator("a[data-choose='4']:not(.board)").focus()
    page.keyboard.press("ArrowRight")
    page.keyboard.press("ArrowRight")
    assert chosen(page)[0] == ["6"]
    page.keyboard.press("ArrowLeft")
    assert chosen(page) == (["5"], ["5"], ["5"])
    assert complaints == []
    page.close()


def test_a_findings_link_to_a_picture_chooses_it(browser, written):
    page, complaints, _ = opened(browser, written / "one.html")
    page.locator("a[data-choose='1']:not(.board) rect").click()
    page.locator("#findings a[href='#of-camera-4']").first.click()
    page.wait_for_function("document.querySelector('.linked').dataset.chosen === '4'")
    assert chosen(page)[0] == ["4"]
    assert complaints == []
    page.close()


def test_without_javascript_every_picture_is_there(browser, written):
    page = new_page(browser, java_script_enabled=False)
    page.goto((written / "one.html").as_uri())
    assert page.locator(".pictures figure:visible").count() == 10
    assert page.locator("#findings li").first.is_visible()
    page.close()


def test_nothing_is_wider_than_a_narrow_window(browser, written):
    for name in ("one.html", "pair.html"):
        page, complaints, _ = opened(browser, written / name)
        page.set_viewport_size({"width": 480, "height": 900})
        assert page.evaluate("document.documentElement.scrollWidth") <= 480
        assert complaints == []
        page.close()


def test_each_camera_of_a_pair_has_its_own_choice(browser, written):
    page, complaints, _ = opened(browser, written / "pair.html")
    left, right = page.locator(".linked").all()
    left.locator("a[data-choose='3']:not(.board) rect").click()
    assert left.get_attribute("data-chosen") == "3"
    assert right.get_attribute("data-chosen") != "3" or right.get_attribute("data-first") == "3"
    assert complaints == []
    page.close()


@pytest.mark.parametrize("width", [375, 1440])
def test_tiles_away_from_the_screen_wait_in_the_room_that_they_take(browser, written, width):
    """Every tile, and the page, is as tall before it is drawn as when all are drawn; on paper all are drawn."""
    page, complaints, _ = opened(browser, written / "pair.html")
    page.set_viewport_size({"width": width, "height": 800})
    waiting = """[...document.querySelectorAll(".camviz-fitted text")].filter(
        (one) => !one.checkVisibility({ contentVisibilityAuto: true })).length"""
    heights = """[document.documentElement, ...document.querySelectorAll(".camviz-fitted")].map(
        (one) => one.getBoundingClientRect().height)"""
    assert page.evaluate(waiting) > 100
    before = page.evaluate(heights)
    page.emulate_media(media="print")
    assert page.evaluate("getComputedStyle(document.querySelector('.camviz-fitted')).contentVisibility") == "visible"
    page.emulate_media(media="screen")
    page.add_style_tag(content=".camviz-fitted { content-visibility: visible !important; }")
    np.testing.assert_allclose(page.evaluate(heights), before, atol=0.02)
    assert complaints == []
    page.close()
