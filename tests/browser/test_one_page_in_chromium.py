"""The page that a teacher holds in front of a class is one A4 page in a real browser, whatever the lesson."""

import re

import pytest
from laboratory import new_page
from playwright.sync_api import Browser

from camviz_school.course.material import lesson_paths
from camviz_school.course.notebooks import read
from camviz_school.teaching import plans
from camviz_school.teaching.deck import planned_slides
from camviz_school.teaching.numbering import Numbering
from camviz_school.teaching.one_page import one_page

A4_PT = (595, 842)
PLANNED = [path for path in lesson_paths() if plans.plan(path.name[:2])]

pytestmark = pytest.mark.browser


def written(path):
    lesson = read(path)
    return one_page(lesson, Numbering.of(plans.plan(path.name[:2]), planned_slides(lesson)), path.name)


@pytest.mark.parametrize("path", PLANNED, ids=lambda path: path.stem)
def test_the_page_of_a_lesson_prints_on_one_sheet_of_a4(browser: Browser, path):
    """Chromium writes each page of a PDF as an object with its size in points."""
    page = new_page(browser)
    page.set_content(written(path))
    printed = page.pdf(prefer_css_page_size=True)
    page.close()
    sizes = re.findall(rb"/Type /Page\n.*?/MediaBox \[0 0 ([\d.]+) ([\d.]+)\]", printed, re.DOTALL)
    assert [tuple(round(float(side)) for side in size) for size in sizes] == [A4_PT]


def test_nothing_on_the_page_is_wider_than_a_telephone(browser: Browser):
    path = next(one for one in PLANNED if one.name.startswith("05"))
    page = new_page(browser, viewport={"width": 360, "height": 740})
    page.set_content(written(path))
    assert page.evaluate("document.documentElement.scrollWidth") <= 360
    page.close()
