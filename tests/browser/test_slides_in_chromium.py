"""Slides in a real browser: keys, clicks and swipes; no slide overflows; paper and no script show them all."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest
from laboratory import new_page

from camviz_school.course import notebooks
from camviz_school.teaching.deck import deck
from camviz_school.teaching.pack import write_pack

pytestmark = pytest.mark.browser

LESSONS = sorted((Path(__file__).parents[2] / "lessons").glob("*.ipynb"))
DISTORTION = next(path for path in LESSONS if path.name.startswith("05"))
PROJECTED, WIDE, NARROW = (
    {"width": 1280, "height": 720},
    {"width": 1920, "height": 1080},
    {"width": 1024, "height": 768},
)
OVERFLOWING = """() => [...document.querySelectorAll(".slide")].filter((slide) => {
  const idea = slide.querySelector(".idea"), limits = slide.getBoundingClientRect();
  const inside = [...idea.querySelectorAll("math, img, li, p, h2, td")].map((one) => one.getBoundingClientRect());
  return idea.scrollHeight > idea.clientHeight + 1 || idea.scrollWidth > idea.clientWidth + 1
    || inside.some((box) => box.right > limits.right || box.bottom > limits.bottom || box.top < limits.top);
}).map((slide) => `${slide.id} ${slide.className}`)"""

LEAST_TEXT = """async () => {  // of each drawing on a slide its smallest words in pixels, and its name
  const found = [];
  for (const image of document.querySelectorAll(".panels img[src^='data:image/svg']")) {
    const box = image.getBoundingClientRect(), frame = document.createElement("iframe");
    frame.style.cssText = `position:fixed;inset:0 auto auto 0;border:0;width:${box.width}px;height:${box.height}px`;
    frame.srcdoc = `<!DOCTYPE html><body style="margin:0">${atob(image.src.split(",")[1])}</body>`;
    document.body.append(frame);
    await new Promise((resolve) => { frame.onload = resolve; });
    const drawn = frame.contentDocument.querySelector("svg"), style = frame.contentWindow;
    drawn.setAttribute("width", box.width), drawn.setAttribute("height", box.height);
    for (const text of drawn.querySelectorAll("text")) {
      const { a, b } = text.getScreenCTM();  // of words that stand upright, too
      const size = parseFloat(style.getComputedStyle(text).fontSize) * Math.hypot(a, b);
      if (style.getComputedStyle(text).display !== "none") found.push([size, `${image.alt}: ${text.textContent}`]);
    }
    frame.remove();
  }
  return found;
}"""


@pytest.fixture(scope="module")
def solved(tmp_path_factory):
    """The deck of lesson 05 run with its solutions, as a teacher gets it."""
    folder = tmp_path_factory.mktemp("solved")
    write_pack(DISTORTION.parent, folder, ["05"], run=True, slides=True, say=lambda sentence: None)
    return folder / "05_slides.html"


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    path = tmp_path_factory.mktemp("slides") / "05_slides.html"
    path.write_text(deck(notebooks.read(DISTORTION)), encoding="utf-8")
    return path


@pytest.fixture
def opened(browser, written):
    """The deck on a projector; whatever it asks for besides itself fails the test, as does an error of its script."""
    page = new_page(browser, viewport=WIDE)
    wrong = []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on("console", lambda message: wrong.append(message.text))
    page.on("request", lambda one: wrong.append(one.url) if not one.url.startswith(("file:", "data:")) else None)
    page.goto(written.as_uri())
    yield page
    page.close()
    assert wrong == []


def now(page):
    return page.evaluate(
        "() => [...document.querySelectorAll('.slide')].filter((s) => s.offsetParent).map((s) => s.id)"
    )


def kinds(page):
    return page.evaluate("() => [...document.querySelectorAll('.slide')].map((slide) => slide.classList[1])")


def test_a_key_is_hidden_until_the_next_press(opened):
    asked = kinds(opened).index("question")
    for _ in range(asked):
        opened.keyboard.press("ArrowRight")
    assert now(opened) == [f"s{asked + 1}"]
    assert not opened.locator(".key").first.is_visible()
    opened.keyboard.press(" ")
    assert opened.locator(".key").first.is_visible()
    opened.keyboard.press("ArrowLeft")
    assert now(opened) == [f"s{asked + 1}"]


def test_keys_clicks_and_the_address_lead_to_slides(opened):
    last = f"s{len(kinds(opened))}"
    for key, slide in (("End", last), ("ArrowRight", last), ("Home", "s1"), ("ArrowLeft", "s1"), ("PageDown", "s2")):
        opened.keyboard.press(key)
        assert now(opened) == [slide], key
    opened.keyboard.press("3")
    assert opened.locator(".slide.now header").inner_text().startswith("3 · ")
    here = now(opened)
    opened.reload()
    assert now(opened) == here
    opened.mouse.click(1500, 500)
    opened.mouse.click(100, 500)
    assert now(opened) == here


def test_a_swipe_turns_the_page(browser, written):
    page = new_page(browser, viewport=NARROW, has_touch=True)
    page.goto(written.as_uri())
    swipe = """([from, to]) => {
      const touch = (x) => new Touch({ identifier: 1, target: document.body, clientX: x, clientY: 300 });
      dispatchEvent(new TouchEvent("touchstart", { touches: [touch(from)], changedTouches: [touch(from)] }));
      dispatchEvent(new TouchEvent("touchend", { touches: [], changedTouches: [touch(to)], cancelable: true }));
    }"""
    page.evaluate(swipe, [800, 300])
    assert now(page) == ["s2"]
    page.evaluate(swipe, [300, 800])
    assert now(page) == ["s1"]
    page.evaluate(swipe, [300, 320])
    assert now(page) == ["s1"]
    page.close()


def test_a_picture_comes_nearer_and_the_light_can_be_turned(opened):
    for _ in range(kinds(opened).index("picture")):
        opened.keyboard.press("ArrowRight")
    image = opened.locator(".slide.now img").first
    before = image.bounding_box()["width"]
    opened.keyboard.press("z")
    assert image.bounding_box()["width"] == pytest.approx(2 * before)
    paper = "() => getComputedStyle(document.body).backgroundColor"
    light = opened.evaluate(paper)
    opened.keyboard.press("d")
    assert opened.evaluate(paper) != light
    opened.keyboard.press("d")
    assert opened.evaluate(paper) == light


def test_without_a_script_and_on_paper_all_slides_stand_one_below_the_other(browser, written):
    page = new_page(browser, java_script_enabled=False, viewport=NARROW)
    page.goto(written.as_uri())
    slides = page.locator(".slide")
    assert all(slides.nth(number).is_visible() for number in range(slides.count()))
    page.close()
    page = new_page(browser)
    page.goto(written.as_uri())
    page.keyboard.press("ArrowRight")
    pdf = page.pdf(prefer_css_page_size=True)
    assert len(re.findall(rb"/Type\s*/Page\b", pdf)) == len(kinds(page))
    page.goto(f"{written.as_uri()}?print")
    assert len(now(page)) == len(kinds(page))
    page.close()


@pytest.mark.sampled(8)
@pytest.mark.parametrize("path", LESSONS, ids=lambda path: path.stem)
def test_nothing_leaves_its_slide(browser, tmp_path, path):
    """On a projector, on an old one of 4:3, and on paper."""
    written = tmp_path / "slides.html"
    written.write_text(deck(notebooks.read(path)), encoding="utf-8")
    page = new_page(browser, viewport=WIDE)
    page.goto(f"{written.as_uri()}?print")
    for size in (WIDE, NARROW):
        page.set_viewport_size(size)
        assert page.evaluate(OVERFLOWING) == []
    page.emulate_media(media="print")
    assert page.evaluate(OVERFLOWING) == []
    page.close()


def test_every_picture_of_a_solved_lesson_is_drawn_and_large_enough_to_read(browser, solved):
    """A picture has paper and ink, none is black, and no letter of a drawing is below 14 pixels of 1280."""
    page = new_page(browser, viewport=PROJECTED)
    page.goto(f"{solved.as_uri()}?print")
    assert page.locator(".withheld").count() == 0
    assert page.evaluate(OVERFLOWING) == []
    seen = 0
    for picture in page.locator(".panels img").all():
        pixels = cv2.imdecode(np.frombuffer(picture.screenshot(), np.uint8), cv2.IMREAD_GRAYSCALE)
        black = cv2.boxFilter((pixels < 3).astype(float), -1, (120, 90)).max()
        assert pixels.std() > 5, picture.get_attribute("alt")
        assert black < 0.999, picture.get_attribute("alt")
        seen += 1
    assert seen > 20
    sizes = page.evaluate(LEAST_TEXT)
    drawings = [one.get_attribute("alt") for one in page.locator(".panels img[src^='data:image/svg']").all()]
    page.close()
    assert [alt for alt in drawings if not any(words.startswith(f"{alt}: ") for _, words in sizes)] == []
    assert [one for one in sizes if one[0] < 13.99] == []
