"""The examples of docs/recorded-widgets.md, word for word: a widget of one's own on pages that others build."""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
from file_server import files_served
from laboratory import ROOT, new_page
from playwright.sync_api import Browser, Locator, Page

pytestmark = pytest.mark.browser

WRITTEN = (ROOT / "docs/recorded-widgets.md").read_text(encoding="utf-8")
MYST = """<!doctype html><meta charset="utf-8"><title>As MyST's theme does it</title><link rel="icon" href="data:,">
<style>svg { display: none } .camviz-explorer { display: none }</style><div id="one"></div><div id="two"></div>
<script type="module">
  for (const [id, name] of [["one", "wave"], ["two", "lens"]]) {
    const { default: widget } = await import(`./${name}-70e86e1e.mjs`);
    const refuse = () => { throw new Error("there is no kernel"); };
    const model = { get: () => undefined, set: refuse, on: () => {}, off: refuse, send: refuse, save_changes: refuse };
    const el = document.createElement("div");
    document.getElementById(id).attachShadow({ mode: "open" }).replaceChildren(el);
    await widget.render({ model, el });
  }
</script>"""


@dataclass
class Made:
    """What the page's Python made, and the address of its folder `public`."""

    folder: Path
    address: str
    names: dict[str, Any]

    def drawn(self, sines: int) -> str:
        """What the kernel draws."""
        wave = self.names["SquareWave"]()
        wave.sines = sines
        return str(re.search(r'points="([^"]+)"', wave.svg)[1])  # type: ignore[index]


@pytest.fixture(scope="module")
def made(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Made]:
    folder = tmp_path_factory.mktemp("elsewhere")
    names: dict[str, Any] = {}
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(folder)
        for block in re.findall(r"```python\n(.*?)```", WRITTEN, flags=re.DOTALL):
            exec(block, names)
        names["write_one_file"](names["lens"], "public/lens-70e86e1e.mjs")
    public = folder / "public"
    (public / "wave-70e86e1e.mjs").write_bytes((public / "wave.mjs").read_bytes())  # MyST renames what it copies
    (public / "myst.html").write_text(MYST)
    (frame,) = re.findall(r"```html\n(.*?)```", WRITTEN, flags=re.DOTALL)
    (public / "frame.html").write_text(f'<!doctype html><html lang="en"><title>A frame</title>{frame}</html>')
    with files_served(public) as address:
        yield Made(public, address, names)


def opened(browser: Browser, address: str) -> Page:
    page = new_page(browser, viewport={"width": 900, "height": 900})
    page.complaints = []
    page.on("console", lambda message: page.complaints.append(message.text))
    page.on("pageerror", lambda error: page.complaints.append(str(error)))
    page.goto(address)
    return page


def shows(place: Any, made: Made, sines: int) -> None:
    """Waits until the wave is that of so many sines, as the kernel draws it."""
    place.locator(f'polyline[points="{made.drawn(sines)}"]').wait_for(state="attached")


def to_both_ends(slider: Locator) -> Iterator[int]:
    slider.wait_for()  # what is not shown yet takes no key
    for key, sines in (("End", 20), ("Home", 1)):
        slider.press(key)
        yield sines


@pytest.mark.parametrize("file", ["index.html", "wave.html"])
def test_a_page_and_a_single_file_move_from_end_to_end_and_need_no_server(
    browser: Browser, made: Made, file: str
) -> None:
    page = opened(browser, (made.folder / file).as_uri())
    shows(page, made, 3)
    for sines in to_both_ends(page.locator("label input").first):
        shows(page, made, sines)
    assert page.complaints == []


def test_the_single_file_asks_for_no_other(browser: Browser, made: Made, tmp_path: Path) -> None:
    alone = tmp_path / "alone.html"
    alone.write_bytes((made.folder / "wave.html").read_bytes())
    page = opened(browser, alone.as_uri())
    shows(page, made, 3)
    assert page.evaluate("performance.getEntriesByType('resource').map(({ name }) => name)") == []


def test_the_frame_shows_the_single_file(browser: Browser, made: Made) -> None:
    frame = opened(browser, made.address + "/frame.html").frame_locator("iframe")
    for sines in to_both_ends(frame.locator("label input")):
        shows(frame, made, sines)


def test_modules_move_as_myst_draws_them_each_in_a_root_that_the_page_s_style_does_not_reach(
    browser: Browser, made: Made
) -> None:
    page = opened(browser, made.address + "/myst.html")
    for sines in to_both_ends(page.locator("#one label input")):
        shows(page.locator("#one"), made, sines)
    slider = page.locator("#two input[type=range]")
    slider.wait_for()
    slider.press("End")
    page.locator("#two .camviz-recorded-line").get_by_text("Shown: k1 1.").wait_for()
    photograph = page.locator("#two svg image").first
    assert photograph.get_attribute("href").startswith("data:image/webp;base64,")
    assert page.locator("#two .camviz-controls").evaluate("one => getComputedStyle(one).display") == "grid"
    assert page.complaints == []
