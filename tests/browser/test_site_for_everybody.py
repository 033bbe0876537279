"""The built site for those who see, point or print otherwise: axe on every page, forced colours, phones, paper.

`python start.py site` builds it before; CAMVIZ_SITE names another folder than build/site.
"""

import re
from collections.abc import Iterator

import pytest
from axe_playwright_python.base import AXE_SCRIPT
from bs4 import BeautifulSoup, SoupStrainer
from built_site import LESSONS, SITE, UNFOLDED, served
from laboratory import new_page
from PIL import Image
from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.browser

LESSON = "lessons/05_distortion"
AXE = """async () => {
  const { violations } = await axe.run(document, { resultTypes: ["violations"], preload: false });
  return violations.flatMap(({ id, nodes }) => nodes.map(({ html }) => `${id}: ${html.slice(0, 160)}`));
}"""
SCROLLED_BY_KEYS = """() => [...document.querySelectorAll("pre")]
  .every((one) => one.scrollWidth <= one.clientWidth || one.tabIndex === 0)"""
JOINED = """async (ways) => {
  const texts = await Promise.all(ways.map(async (way) => (await fetch(way)).text()));
  const articles = texts.map((text) => new DOMParser().parseFromString(text, "text/html").querySelector(".bd-article"));
  document.querySelector(".bd-article").replaceWith(...articles);
  for (const one of document.querySelectorAll("pre")) one.tabIndex = 0;     // as the theme's script does on each page
}"""
EACH_KIND = (
    *("index", "learn", "about", "search", "api/camviz.cameras", "docs/engineers/calibrate-a-camera", "docs/formats"),
    *("engineers/reports/index", "engineers/reports/moved-centre", LESSON),
)
"""A page of each kind, which axe reads without --all."""

PARTS = 4
BATCH = 50
PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with served() as address:
        yield address


@pytest.fixture
def page(browser: Browser) -> Iterator[Page]:
    page = new_page(browser, viewport={"width": 1280, "height": 900})
    yield page
    page.close()


def ways(generated: bool) -> list[str]:
    """The pages of the site without their ending: those of single names of the API, or all others."""
    found = [path.relative_to(SITE).with_suffix("").as_posix() for path in SITE.rglob("*.html")]
    return sorted(way for way in found if way.startswith("api/generated/") == generated)


def found_by_axe(page: Page) -> list[str]:
    page.evaluate(UNFOLDED)
    page.wait_for_function(SCROLLED_BY_KEYS)
    page.evaluate(AXE_SCRIPT)
    return page.evaluate(AXE)


def test_axe_finds_no_fault_on_a_page_of_each_kind(page: Page, address: str) -> None:
    found = {}
    for way in EACH_KIND:
        page.goto(f"{address}/{way}.html")
        found[way] = found_by_axe(page)
    assert {way: wrong for way, wrong in found.items() if wrong} == {}


@pytest.mark.thorough
@pytest.mark.parametrize("part", range(PARTS))
def test_axe_finds_no_fault_on_any_page(page: Page, address: str, part: int) -> None:
    found = {}
    for way in ways(generated=False)[part::PARTS]:
        page.goto(f"{address}/{way}.html")
        found[way] = found_by_axe(page)
    assert {way: wrong for way, wrong in found.items() if wrong} == {}


def test_axe_finds_no_fault_on_the_page_of_any_name(page: Page, address: str, thorough: bool) -> None:
    """Their frame is the same for all, so that many go into one; without --all, every eighth of them."""
    names = ways(generated=True)[:: 1 if thorough else 8]
    found = []
    for start in range(0, len(names), BATCH):
        page.goto(f"{address}/{names[start]}.html")
        page.evaluate(JOINED, [f"{address}/{way}.html" for way in names[start : start + BATCH]])
        found += found_by_axe(page)
    assert found == []


@pytest.mark.thorough
def test_axe_finds_no_fault_on_any_lesson_in_the_dark(page: Page, address: str) -> None:
    page.emulate_media(color_scheme="dark")
    found = {}
    for name in LESSONS:
        page.goto(f"{address}/lessons/{name}.html")
        found[name] = found_by_axe(page)
    assert {name: wrong for name, wrong in found.items() if wrong} == {}


def test_a_still_has_no_frame_of_the_theme_in_the_dark(page: Page, address: str) -> None:
    """The theme lays white paper with a margin under every picture of a notebook; stills bring their own ground."""
    page.emulate_media(color_scheme="dark")
    page.goto(f"{address}/{LESSON}.html")
    framed = page.evaluate("""() => [...document.querySelectorAll(".bd-article img")].filter((one) => {
      const style = getComputedStyle(one);
      return style.backgroundColor !== "rgba(0, 0, 0, 0)" || style.padding !== "0px" || style.filter !== "none";
    }).map((one) => one.alt)""")
    assert framed == []
    assert page.locator(".bd-article .cell_output img").count() > 5


def test_a_button_can_be_called_by_the_words_on_it() -> None:
    """WCAG 2.5.3: who speaks to the computer says what can be read; its name for scripts must have these words."""
    for path in SITE.rglob("*.html"):
        called = SoupStrainer(["button", "a", "summary"])  # nothing else need be built: there are hundreds of pages
        parsed = BeautifulSoup(path.read_text(encoding="utf-8"), "html.parser", parse_only=called)
        for one in parsed.select("button[aria-label], a[aria-label], summary[aria-label]"):
            assert words(one.get_text(" ")) in words(str(one["aria-label"])), (path, one)


def words(text: str) -> str:
    return " ".join(re.findall(r"\w+", text.lower()))


def test_a_page_has_its_colours_before_and_without_scripts(browser: Browser, address: str) -> None:
    without = new_page(browser, java_script_enabled=False)
    without.goto(f"{address}/{LESSON}.html")
    assert without.locator("html").get_attribute("data-theme") == "light"
    for scheme in ("dark", "light"):
        page = new_page(browser, color_scheme=scheme)
        page.route("**/_static/scripts/*", lambda route: route.abort())
        page.goto(f"{address}/{LESSON}.html")
        assert page.locator("html").get_attribute("data-theme") == scheme
        page.close()
    without.close()


def test_the_icons_are_drawn_and_seen_in_forced_colours(page: Page, address: str) -> None:
    page.emulate_media(forced_colors="active")
    page.set_viewport_size({"width": 390, "height": 844})
    page.goto(f"{address}/{LESSON}.html")
    wrong = page.evaluate("""() => [...document.querySelectorAll(".fa-solid")].filter((icon) => {
      const style = getComputedStyle(icon, "::before"), paper = getComputedStyle(document.body).backgroundColor;
      return !style.maskImage.startsWith("url(") || style.backgroundColor === paper || style.content !== '""';
    }).map((icon) => icon.className)""")
    assert wrong == []


def test_no_animation_and_no_transition_runs_where_motion_is_unwelcome(page: Page, address: str) -> None:
    page.emulate_media(reduced_motion="reduce")
    page.goto(f"{address}/{LESSON}.html")
    moving = page.evaluate("""() => [...document.querySelectorAll("body *")].filter((one) => {
      const { transitionDuration, animationName } = getComputedStyle(one);
      return animationName !== "none" || !/^(0s(, )?)+$/.test(transitionDuration);
    }).length""")
    assert moving == 0


def test_paper_has_stills_and_nothing_to_press(page: Page, address: str) -> None:
    page.emulate_media(media="print")
    page.goto(f"{address}/{LESSON}.html")
    page.locator(".camviz-recorded").first.scroll_into_view_if_needed()
    page.locator('.camviz-recorded[data-live="true"]').first.wait_for()
    pressed = page.locator(".camviz-controls, .camviz-question button, .bd-header, .camviz-solution, .fa-solid")
    assert pressed.count() > 20
    assert [one for one in pressed.all() if one.is_visible()] == []


def test_a_finger_moves_a_slider_and_scrolls_the_page(browser: Browser, address: str) -> None:
    page = new_page(browser, **PHONE)
    page.goto(f"{address}/index.html")
    page.touchscreen.tap(200, 300)
    page.locator('.camviz-recorded[data-live="true"]').wait_for()
    slider = page.locator('.camviz-recorded input[type="range"]').first
    slider.scroll_into_view_if_needed()
    before, box = slider.input_value(), slider.bounding_box()
    page.touchscreen.tap(box["x"] + 0.9 * box["width"], box["y"] + box["height"] / 2)
    assert float(slider.input_value()) > float(before)
    assert slider.evaluate("(one) => getComputedStyle(one).touchAction") == "pan-y"
    page.close()


def test_the_keyboard_alone_reaches_a_slider_and_moves_it(page: Page, address: str) -> None:
    page.goto(f"{address}/index.html")
    page.keyboard.press("Tab")
    page.locator('.camviz-recorded[data-live="true"]').wait_for()
    for _ in range(40):
        page.keyboard.press("Tab")
        if page.evaluate("document.activeElement.type") == "range":
            break
    before = page.evaluate("document.activeElement.value")
    page.keyboard.press("ArrowRight")
    assert page.evaluate("document.activeElement.value") != before
    assert page.evaluate("getComputedStyle(document.activeElement).outlineStyle") != "none"


def test_nothing_jumps_on_a_phone_while_the_first_picture_comes_to_life(browser: Browser, address: str) -> None:
    """A shift that moves what is seen by more than 0.1 counts as poor (Core Web Vitals)."""
    page = new_page(browser, **PHONE)
    page.goto(f"{address}/index.html")
    page.evaluate("""() => { window.shifted = 0;
      new PerformanceObserver((list) => list.getEntries().forEach((one) => { window.shifted += one.value; }))
        .observe({ type: "layout-shift", buffered: true }); }""")
    page.locator('.camviz-recorded[data-live="true"]').wait_for()
    page.wait_for_timeout(500)
    assert page.evaluate("window.shifted") < 0.02
    page.close()


@pytest.mark.parametrize("width", [1200, 1440, 1920])
def test_a_lesson_stands_where_it_will_before_the_list_of_its_sections_comes(
    browser: Browser, address: str, width: int
) -> None:
    """The list is the last part of the page's HTML to arrive."""
    page = new_page(browser, viewport={"width": width, "height": 900})
    page.goto(f"{address}/lessons/05_distortion.html")
    box = "document.querySelector('.bd-article-container').getBoundingClientRect().toJSON()"
    whole = page.evaluate(box)
    page.evaluate("document.querySelector('.bd-sidebar-secondary').remove()")
    waiting = page.evaluate(box)
    assert (waiting["x"], waiting["width"]) == (whole["x"], whole["width"])
    page.close()


@pytest.mark.parametrize("width", [375, 1440])
def test_a_pane_is_as_high_before_it_comes_to_life_as_after(browser: Browser, address: str, width: int) -> None:
    """The panes of lesson 16 in order: first no recording comes, then all do. Some have words among their pictures."""
    waiting = pane_heights(browser, f"{address}/lessons/16_clinic.html", width, live=False)
    assert len(waiting) > 10
    assert pane_heights(browser, f"{address}/lessons/16_clinic.html", width, live=True) == pytest.approx(waiting, abs=1)


def pane_heights(browser: Browser, lesson: str, width: int, *, live: bool) -> list[float]:
    """The heights of a lesson's panes that are not folded away, in CSS pixels: alive, or before they are."""
    page = new_page(browser, viewport={"width": width, "height": 900})
    if not live:
        page.route("**/_recordings/*.js", lambda route: route.abort())
    page.goto(lesson)
    page.evaluate(UNFOLDED)
    heights = []
    for pane in page.locator(".camviz-recorded:visible").all():
        pane.scroll_into_view_if_needed()
        if live:
            page.wait_for_function("(one) => one.dataset.live === 'true'", arg=pane.element_handle())
        heights.append(pane.bounding_box()["height"])
    page.close()
    return heights


def test_a_link_to_any_page_shows_a_picture_of_known_size(page: Page, address: str) -> None:
    for way in ("index", "learn", LESSON, "docs/glossary"):
        page.goto(f"{address}/{way}.html")
        told = page.evaluate("""() => Object.fromEntries([...document.querySelectorAll('meta[property^="og:"]')]
          .map((one) => [one.getAttribute("property"), one.content]))""")
        picture = told["og:image"]
        assert picture.startswith("https://"), way
        with Image.open(SITE / "_previews" / picture.rsplit("/", 1)[1]) as image:
            assert image.size == (int(told["og:image:width"]), int(told["og:image:height"])), way
        assert told["og:url"].startswith("https://"), way
        assert told["og:description"], way
        assert told["og:title"], way
