"""The built site for those who see, point or print otherwise: axe on every page, forced colours, phones, paper.

`python start.py site` builds it before; CAMVIZ_SITE names another folder than build/site.
"""

from collections.abc import Iterator

import pytest
from axe_playwright_python.base import AXE_SCRIPT
from built_site import LESSONS, SITE, served
from playwright.sync_api import Browser, Page

pytestmark = pytest.mark.browser

LESSON = "lessons/05_distortion"
AXE = """async () => {
  const { violations } = await axe.run(document, { resultTypes: ["violations"], preload: false });
  return violations.flatMap(({ id, nodes }) => nodes.map(({ html }) => `${id}: ${html.slice(0, 160)}`));
}"""
CHUNKS = 4


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with served() as address:
        yield address


def pages() -> list[str]:
    """All pages of the site, as ways without the ending."""
    return sorted(path.relative_to(SITE).with_suffix("").as_posix() for path in SITE.rglob("*.html"))


def found_by_axe(page: Page, address: str, ways: list[str]) -> dict[str, list[str]]:
    """What axe finds wrong, by page; pages without fault are left out."""
    found = {}
    for way in ways:
        page.goto(f"{address}/{way}.html")
        page.evaluate(AXE_SCRIPT)
        if wrong := page.evaluate(AXE):
            found[way] = wrong
    return found


@pytest.mark.parametrize("part", range(CHUNKS))
def test_axe_finds_no_fault_on_any_page(browser: Browser, address: str, part: int) -> None:
    page = browser.new_page(viewport={"width": 1280, "height": 900})
    assert found_by_axe(page, address, pages()[part::CHUNKS]) == {}
    page.close()


def test_axe_finds_no_fault_on_any_lesson_in_the_dark(browser: Browser, address: str) -> None:
    page = browser.new_page(viewport={"width": 1280, "height": 900}, color_scheme="dark")
    assert found_by_axe(page, address, [f"lessons/{name}" for name in LESSONS]) == {}
    page.close()
