"""Recorded panes in a real browser, opened as files: every control, handle and key, without a kernel and a server."""

import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.base import AXE_SCRIPT
from laboratory import ROOT, new_page
from playwright.sync_api import Browser, ElementHandle, Page

sys.path.append(str(ROOT / "tools/benchmarks"))

from smallest import Smallest

from camviz.views.base import View
from camviz.views.distortion import DistortionView
from camviz.views.frustum import FrustumView
from camviz.widgets import Explorer, explore
from camviz_school.record import Axis, Budget, Widget, record, write_player
from camviz_school.views.readout import ReadoutView

pytestmark = pytest.mark.browser

FEW = Budget(slider=5, grid=3, orbit=8)
PANES: dict[str, Explorer] = {
    "distortion": explore(DistortionView(k1=-0.28, k2=0.07), "k1", "k2", "show", together=("k1", "k2")),
    "frustum": explore(FrustumView(), "hfov_deg", "mode"),
    "wall": explore(DistortionView.by_the_wall(), "k1"),
    "readout": explore(ReadoutView(), "time", "readout"),
}
SHEET = (
    "body { margin: 20px; background: Canvas; color: CanvasText; color-scheme: light dark; font-family: sans-serif }"
)
AXE = """async () => (await axe.run("main", { resultTypes: ["violations"] })).violations.flatMap(
  ({ id, nodes }) => nodes.map(({ html }) => `${id}: ${html.slice(0, 150)}`))"""
PICTURE = """root => { const copy = root.querySelector(".camviz-flow").cloneNode(true);
  for (const one of copy.querySelectorAll("[data-lm-suppress-shortcuts]")) delete one.dataset.lmSuppressShortcuts;
  for (const one of copy.querySelectorAll("image")) one.setAttribute("href", "");
  return copy.outerHTML }"""
UNIT = """root => { const svg = root.querySelector("[data-drag=eye]").closest(".camviz-fitted");
  return svg.clientWidth / svg.viewBox.baseVal.width }"""
SAID = """words => { const said = document.querySelector(".camviz-said").textContent;
  return said && said.split("; ").every((part) => words.includes(part)) }"""
MOVED_AT_ONCE = """() => new Promise((done) => {
  const moved = () => {
    const root = document.querySelector(".camviz-recorded[data-live] .camviz-explorer");
    if (root) hands.move(root, "k1", 0), done();
    return Boolean(root);
  };
  if (moved()) return;   // it stood before this was asked: nothing will change any more
  new MutationObserver((_, watcher) => moved() && watcher.disconnect())
    .observe(document, { childList: true, subtree: true, attributes: true });
})"""
DRAWN = """html => { const holder = document.createElement("template");
  holder.innerHTML = html;
  for (const one of holder.content.querySelectorAll("image")) one.setAttribute("href", "");
  return holder.innerHTML }"""


@dataclass
class Site:
    """A folder with a page for each pane, and what the browser complained of."""

    browser: Browser
    folder: Path

    def open(self, name: str, wait_until: Any = "load", **options: Any) -> Page:
        """The page, once it is loaded or as far as `wait_until` says."""
        page = new_page(self.browser, **{"viewport": {"width": 1200, "height": 1000}, **options})
        page.complaints = []
        page.on("console", lambda message: page.complaints.append(message.text))
        page.on("pageerror", lambda error: page.complaints.append(str(error)))
        page.add_init_script(path=Path(__file__).with_name("hands.js"))
        page.goto((self.folder / f"{name}.html").as_uri(), wait_until=wait_until)
        return page


@pytest.fixture(scope="module")
def site(browser: Browser, tmp_path_factory: pytest.TempPathFactory) -> Site:
    folder = tmp_path_factory.mktemp("site")
    write_player(folder / "recorded")
    made: dict[str, str] = {}
    for name, explorer in PANES.items():
        made[name] = record(explorer, folder / "recorded", budget=FEW).html("recorded/")
    dot = Widget(Smallest(), (Axis.slider("x", 0.0, 100.0, 0.1, 0.0, most=11),), "A dot")
    made["dot"] = record(dot, folder / "recorded").html("recorded/")
    made["far"] = f'<p style="height:4000px">Far below:</p>{made["readout"]}'
    for name, html in made.items():
        (folder / f"{name}.html").write_text(
            f'<!doctype html><html lang="en"><meta charset="utf-8"><title>{name}</title>'
            f'<meta name="viewport" content="width=device-width"><style>{SHEET}</style>'
            f'<main><h1>{name}</h1>{html}</main><script src="recorded/replay.js" defer></script>'
        )
    return Site(browser, folder)


def live(page: Page) -> ElementHandle:
    """The pane, once it is live and at rest."""
    root = page.wait_for_selector(".camviz-recorded[data-live] .camviz-explorer")
    return rested(root)


def rested(root: ElementHandle) -> ElementHandle:
    root.evaluate("root => hands.settled(root)")
    return root


def same(page: Page, root: ElementHandle, view: View) -> bool:
    """Whether the pane shows exactly what the kernel would send for a view."""
    return bool(root.evaluate(PICTURE) == page.evaluate(DRAWN, view.figure().flow()))


def move(root: ElementHandle, name: str, place: float) -> str:
    value: str = root.evaluate("(root, [name, place]) => hands.move(root, name, place)", [name, place])
    rested(root)
    return value


def line(page: Page) -> str:
    return page.inner_text(".camviz-recorded-line")


@pytest.mark.parametrize("name", PANES)
def test_every_control_goes_to_both_ends_and_back_as_the_view_draws_it(site: Site, name: str) -> None:
    page, explorer = site.open(name), PANES[name]
    root = live(page)
    assert same(page, root, explorer.first)
    for control, declared in explorer._controls.items():
        ends = declared.choices or ((declared.low, declared.high) if declared.low is not None else (False, True))
        for place, value in ((1, ends[-1]), (0, ends[0])):
            move(root, control, place)
            assert same(page, root, explorer.first.but(**{control: value})), (control, value)
        root.evaluate("root => hands.reset(root)")
        assert same(page, rested(root), explorer.first)
    assert page.complaints == []
    page.close()


def test_a_button_opens_its_panel_which_stays_while_a_slider_moves(site: Site) -> None:
    page, wall = site.open("wall"), PANES["wall"].first
    root = live(page)
    page.click("[data-opens=curve]")
    assert same(page, rested(root), wall.with_panels({"curve": True}))
    move(root, "k1", 1)
    high = wall.but(k1=PANES["wall"]._controls["k1"].high)
    assert same(page, root, high.with_panels({"curve": True}))
    assert "panel radial curve" in line(page)
    page.click("[data-opens=rays]")
    assert same(page, rested(root), high.with_panels({"rays": True})), "one at a time"
    assert page.get_attribute("[data-opens=curve]", "aria-pressed") == "false"
    page.click("[data-opens=rays]")
    assert same(page, rested(root), high)
    assert page.complaints == []
    page.close()


def test_a_screen_reader_is_told_what_is_changed_as_soon_as_the_pane_stands(site: Site) -> None:
    page = site.open("distortion", wait_until="commit")
    page.evaluate(MOVED_AT_ONCE)
    page.wait_for_function("() => document.querySelector('.camviz-said').textContent.includes('k1 = -1')")
    page.close()


def test_controls_that_belong_together_move_together_and_others_go_back_and_are_named(site: Site) -> None:
    page, explorer = site.open("distortion"), PANES["distortion"]
    root, low, high = live(page), *(explorer._controls["k1"].low, explorer._controls["k1"].high)
    move(root, "k1", 1)
    move(root, "k2", 0)
    assert same(page, root, explorer.first.but(k1=high, k2=low))
    assert "went back" not in line(page)
    move(root, "show", 1)
    assert same(page, root, explorer.first.but(show="undistorted"))
    assert line(page).startswith("Not recorded together: k1, k2 went back to the first value. Shown: show undistorted.")
    positions = page.get_attribute(".camviz-recorded", "data-positions")
    assert f"{positions} positions are recorded" in line(page)
    page.close()


def test_a_wish_between_two_positions_shows_the_nearest_and_its_number(site: Site) -> None:
    page = site.open("readout")
    root = live(page)
    page.wait_for_timeout(1200)  # a change is told to who has had time to hear the first state
    move(root, "time", 0.3)
    number = root.query_selector("[data-control=time] input[type=number]")
    assert number.evaluate("one => one.valueAsNumber") == 25
    assert same(page, root, ReadoutView(time=25.0))
    assert line(page).startswith("Shown: time 25.")
    page.wait_for_function(SAID, arg=ReadoutView(time=25.0).description())
    page.close()


def test_a_key_on_a_slider_goes_one_position_on(site: Site) -> None:
    page, first = site.open("readout"), ReadoutView()
    root = live(page)
    root.query_selector("[data-control=time] input[type=range]").focus()
    seen = []
    for key in ("ArrowRight", "ArrowRight", "ArrowRight", "ArrowLeft"):
        page.keyboard.press(key)
        seen.append(float(rested(root).query_selector("[data-control=time] input[type=number]").input_value()))
    assert first.time == 55
    assert seen == [75, 100, 100, 75]
    assert same(page, root, first.but(time=75.0))
    page.close()


def test_a_drag_and_keys_turn_the_onlooker_to_recorded_places(site: Site) -> None:
    page, first = site.open("frustum"), FrustumView()
    root = live(page)
    x, y = root.evaluate("root => hands.grip(root, 'eye')")
    unit = root.evaluate(UNIT)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + unit * 45 / 0.4, y, steps=30)
    page.mouse.up()
    turned = replace(first.eye, yaw_deg=first.eye.yaw_deg + 45)
    assert same(page, rested(root), first.but(eye=turned))
    page.keyboard.press("ArrowLeft")
    assert same(page, rested(root), first)
    assert page.complaints == []
    page.close()


def test_a_handle_drags_its_slider(site: Site) -> None:
    page, first = site.open("readout"), ReadoutView()
    root = live(page)
    (handle,) = root.evaluate("root => hands.handles(root)")
    x, y = root.evaluate("(root, name) => hands.grip(root, name)", handle)
    page.mouse.move(x, y)
    page.mouse.down()
    page.mouse.move(x + 1000, y, steps=20)
    page.mouse.up()
    assert same(page, rested(root), first.but(time=100.0))
    page.close()


def test_a_pane_far_below_is_a_picture_with_words_until_it_comes_near(site: Site) -> None:
    page, asked = site.open("far"), []
    page.wait_for_timeout(300)
    assert page.query_selector(".camviz-explorer") is None
    assert page.get_attribute(".camviz-recorded img", "alt").startswith(
        f"{ReadoutView.title}. {ReadoutView().description()}"
    )
    page.on("request", lambda request: asked.append(request.url))
    page.evaluate("scrollTo(0, 1e6)")
    live(page)
    assert [url for url in asked if not url.startswith(("file:", "blob:", "data:"))] == []
    assert page.query_selector(".camviz-recorded > figure") is None
    page.close()


@pytest.mark.parametrize("name", ["frustum", "wall"])  # the second has buttons below its picture
def test_nothing_jumps_when_a_picture_comes_to_life(site: Site, name: str) -> None:
    page = site.open(name, java_script_enabled=False)
    page.wait_for_load_state()
    still = page.query_selector(".camviz-recorded").bounding_box()
    page.close()
    page = site.open(name)
    live(page)
    assert page.query_selector(".camviz-recorded").bounding_box()["height"] == pytest.approx(still["height"], abs=6)
    page.close()


def test_without_javascript_the_first_picture_stands(site: Site) -> None:
    page = site.open("distortion", java_script_enabled=False)
    images = page.query_selector_all(".camviz-recorded img")
    assert len(images) >= 2
    assert images[0].bounding_box()["width"] > 300
    page.close()


def test_the_smallest_widget_moves_without_its_kernel(site: Site) -> None:
    page = site.open("dot")
    root = page.wait_for_selector(".camviz-smallest")
    for place in (0.5, 1.0, 0.0):
        root.evaluate("(root, place) => hands.move(root, 'x', place)", place)
        page.wait_for_selector(f"circle[cx='{600 * place:.1f}']")
    assert page.complaints == []
    page.close()


@pytest.mark.parametrize(("width", "scheme"), [(375, "light"), (375, "dark"), (1366, "dark"), (1920, "light")])
def test_a_recorded_pane_can_be_read_on_every_screen(site: Site, width: int, scheme: str) -> None:
    page = site.open("frustum", viewport={"width": width, "height": 900}, color_scheme=scheme)
    root = live(page)
    assert root.evaluate("root => hands.unreadable(root)") == []
    page.evaluate(AXE_SCRIPT)
    assert page.evaluate(AXE) == []
    if folder := os.environ.get("CAMVIZ_SCREENSHOTS"):
        page.screenshot(path=Path(folder) / f"recorded-{width}-{scheme}.png", full_page=True)
    page.close()
