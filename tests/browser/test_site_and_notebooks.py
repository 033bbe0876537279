"""A lesson's built page and its notebook: the same text, code, printed output, pictures, questions and replies."""

import json
import re
from collections.abc import Iterator
from dataclasses import dataclass

import nbformat
import pytest
from bs4 import BeautifulSoup, Tag
from built_site import LESSONS, ROOT, SITE
from mistune import create_markdown

from camviz.draw import prose
from camviz.views.yours import is_unwritten
from camviz_school.course.questions import predict_questions, quiz_questions
from camviz_school.samples import local_sample

pytestmark = pytest.mark.browser

MATHS = re.compile(r"\$\$.*?\$\$|\$[^$\n]+\$", re.DOTALL)  # the page has MathML instead
BLOCKS = ["p", "li", "h1", "h2", "h3", "th", "td"]
NOT_FETCHED = re.compile(r"The sample \S+ could not be fetched")
YOURS = re.compile(r"; [^;]*\byours\b.*?(?=;|\.(?: |$)|$)")  # of the solution on a page, of the stub in a notebook
PICTURE = re.compile(r'<img alt="([^"]*)"[^>]*? src="([^"]*)"')


@dataclass(frozen=True)
class Pair:
    """The notebook, and what stands in the article of its page."""

    name: str
    notebook: nbformat.NotebookNode
    article: Tag

    def cells(self, kind: str) -> list[nbformat.NotebookNode]:
        return [cell for cell in self.notebook.cells if cell.cell_type == kind]

    def outputs(self) -> Iterator[nbformat.NotebookNode]:
        for cell in self.cells("code"):
            yield from cell.outputs


@pytest.fixture(scope="module", params=LESSONS)
def pair(request: pytest.FixtureRequest) -> Pair:
    page = SITE / f"lessons/{request.param}.html"
    if not page.exists():
        pytest.fail(f"{page} is not there: build the site first, by python start.py site")
    article = BeautifulSoup(page.read_text(encoding="utf-8"), "html.parser").article
    return Pair(request.param, nbformat.read(ROOT / f"lessons/{request.param}.ipynb", 4), article)


def plain(html: str) -> str:
    return words(BeautifulSoup(html, "html.parser").get_text())


def words(text: str) -> str:
    return " ".join(re.findall(r"\w+", text))


def blocks(markdown: str) -> Iterator[str]:
    """The words of each paragraph, point, heading and field of a table, in pieces between formulas."""
    html = create_markdown(escape=False, plugins=["table"])(MATHS.sub("§", markdown))
    for block in BeautifulSoup(html, "html.parser").find_all(BLOCKS):
        if not block.find(BLOCKS):
            yield from filter(None, map(words, block.get_text(" ").split("§")))


def test_the_page_has_every_sentence_in_the_notebooks_order(pair: Pair) -> None:
    for one in pair.article.select("math"):
        one.extract()
    said = words(pair.article.get_text(" "))
    place = 0
    for cell in pair.cells("markdown"):
        for block in blocks(cell.source):
            found = said.find(block, max(place - 200, 0))
            assert found >= 0, block
            place = max(place, found)


def test_the_page_has_every_line_of_code_and_every_printed_line(pair: Pair) -> None:
    code = [line for one in pair.article.select(".cell_input pre") for line in one.get_text().splitlines() if line]
    assert code == [line for cell in pair.cells("code") for line in cell.source.splitlines() if line]
    printed = "".join(one.get_text() for one in pair.article.select(".cell_output pre"))
    waits = " ".join(one.get_text() for one in pair.article.select(".camviz-awaited"))
    for output in pair.outputs():
        lines = output.text.splitlines(keepends=True) if output.output_type == "stream" else []
        kept = "".join(line for line in lines if not is_unwritten(line) and not NOT_FETCHED.match(line))
        assert re.sub(r"\bnan\b", "–", kept).strip() in printed
        for name in re.findall(r"`(\w+)`", "".join(filter(is_unwritten, lines))):
            assert name in waits  # said once, in the page's own words


def test_the_page_has_every_picture_in_the_same_words(pair: Pair) -> None:
    if any("chessboard_pictures" in cell.source for cell in pair.cells("code")) and not local_sample("left01.jpg"):
        pytest.skip("CAMVIZ_SAMPLES names no folder with the photographs that the notebook was saved with")
    saved = [
        match for output in pair.outputs() for match in PICTURE.findall(output.get("data", {}).get("text/html", ""))
    ]
    for one in pair.article.select(".camviz-with[hidden]"):  # a usual mistake, which no notebook was saved with
        one.extract()
    shown = [(one.get("alt"), one.get("src")) for one in pair.article.select(".cell_output img")]
    spoken = [re.sub(YOURS, "", BeautifulSoup(alt, "html.parser").get_text()) for alt, _ in saved]
    assert [alt for alt in (re.sub(YOURS, "", alt) for alt, _ in shown) if alt in spoken] == spoken
    assert all((SITE / "lessons" / source).exists() for _, source in shown)


def test_the_page_asks_the_same_questions_and_gives_the_same_replies(pair: Pair) -> None:
    data = [json.loads(one.string) for one in pair.article.select(".camviz-asked script")]
    told = {one["name"]: one for each in data for one in each["questions"]}
    lesson = pair.name[:2]
    quizzes = () if lesson == "00" else (*quiz_questions(lesson, "A"), *quiz_questions(lesson, "B"))
    asked = {one.name: one for one in (*predict_questions(lesson), *quizzes)}
    assert told.keys() == asked.keys()
    for name, question in asked.items():
        shown = [(one["text"], one["reply"], one["correct"]) for one in told[name]["choices"]]
        wanted = [(one.text, one.reply, one.correct) for one in question.choices]
        assert [(plain(text), plain(reply), correct) for text, reply, correct in shown] == [
            (plain(prose.to_html(text)), plain(prose.to_html(reply)), correct) for text, reply, correct in wanted
        ]
