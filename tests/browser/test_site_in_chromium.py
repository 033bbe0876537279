"""The built site in a real browser: every pane moves, every page is whole, and nobody else is asked for anything.

`python start.py site` builds it before; CAMVIZ_SITE names another folder than build/site.
"""

import re
from collections.abc import Iterator
from html import unescape
from pathlib import Path
from urllib.parse import unquote, urlsplit

import pytest
from built_site import LESSONS, SITE, UNFOLDED, served
from laboratory import new_page
from playwright.sync_api import Browser, Locator, Page

from camviz_school.course.answers import mark, read_answers
from camviz_school.course.learning import class_scores
from camviz_school.course.questions import predict_questions, quiz_questions

pytestmark = pytest.mark.browser

HANDS = (Path(__file__).with_name("hands.js")).read_text(encoding="utf-8")
REPORTS = SITE / "engineers/reports"  # each a whole page in one file, as camviz inspect writes it
READ = ("index", "learn", "search", "docs/clinic", "about", "docs/glossary", "api/index", "lessons/05_distortion")
PICTURE = ".camviz-recorded, .cell_output .camviz-figure, .cell_output img"  # a pane, or its still if not recorded
SCRIPT = re.compile(r'<script type="application/json">.*?</script>', re.DOTALL)
ADDRESS = re.compile(r'<[a-z][^<>]*?\s(?:href|src)="([^"]*)"')
LOADED = re.compile(r'<(?:script|img|iframe|link(?! rel="canonical"))[^<>]*?\s(?:src|href)="([^"]*)"')
CUT = """() => [...document.querySelectorAll("math:not(.formula math)")].filter((one) => one.checkVisibility()
  && one.getBoundingClientRect().right > one.closest("p, li, td, th, summary, div").getBoundingClientRect().right + 1)
  .map((one) => one.textContent)"""
TO_BOTH_ENDS = """async () => {
  const wrong = [], panes = [...document.querySelectorAll(".camviz-recorded")].filter((one) => one.checkVisibility());
  let changed = 0;
  for (const pane of panes) {
    pane.scrollIntoView();
    for (let i = 0; i < 8000 && !pane.dataset.live; i++) await hands.pause(25);
    const root = pane.querySelector(".camviz-explorer");
    if (!root) { wrong.push(`${pane.ariaLabel} stands still`); continue; }
    await hands.settled(root);
    const controls = hands.controls(root);
    const actsBeside = async (name) => {  // a lock, or a share of something that is off
      for (const other of controls.filter((one) => one !== name)) for (const place of [0, 1, 0.5]) {
        const seen = new Set();
        for (const end of [0, 1]) {
          hands.reset(root);
          await hands.settled(root);
          for (const [one, where] of [[name, end], [other, place]]) {
            hands.move(root, one, where);
            await hands.settled(root);
          }
          seen.add(await hands.picture(root));
        }
        if (seen.size > 1 && !pane.textContent.includes("went back")) return true;
      }
      return false;
    };
    for (const name of controls) {
      const before = await hands.picture(root);
      let other = false;
      for (const end of [0, 1]) {
        hands.move(root, name, end);
        await hands.settled(root);
        other ||= (await hands.picture(root)) !== before;
        if (hands.error(root)) wrong.push(`${pane.ariaLabel}, ${name} at ${end}: ${hands.error(root)}`);
      }
      hands.reset(root);
      await hands.settled(root);
      other ||= await actsBeside(name);
      hands.reset(root);
      await hands.settled(root);
      changed += other;
      if (!other) wrong.push(`${pane.ariaLabel}: ${name} changes nothing`);
    }
  }
  return { panes: panes.length, changed, wrong };
}"""


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with served() as address:
        yield address


class Watched:
    """A page, what it complains of, and whom it asks for what."""

    def __init__(self, browser: Browser, address: str, **options) -> None:
        self.page: Page = new_page(browser, **options)
        self.address = address
        self.complaints: list[str] = []
        self.asked: list[str] = []
        self.page.on("console", lambda said: self.complaints.append(said.text) if said.type == "error" else None)
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda request: self.asked.append(request.url))
        self.page.on("response", lambda got: self.complaints.append(got.url) if got.status >= 400 else None)

    def open(self, way: str) -> Page:
        """The page with all its sections open."""
        self.page.goto(f"{self.address}/{way}.html")
        self.page.evaluate(UNFOLDED)
        return self.page

    @property
    def strangers(self) -> list[str]:
        """What was asked of anybody else."""
        return [url for url in self.asked if not url.startswith((self.address, "data:", "blob:"))]


@pytest.fixture
def watched(browser: Browser, address: str) -> Iterator[Watched]:
    one = Watched(browser, address, viewport={"width": 1280, "height": 900})
    yield one
    one.page.close()
    assert one.complaints == []
    assert one.strangers == []


@pytest.mark.by_example
@pytest.mark.parametrize("way", ["index", *(f"lessons/{name}" for name in LESSONS)])
def test_every_control_of_every_pane_goes_to_both_ends(watched: Watched, way: str) -> None:
    page = watched.open(way)
    page.evaluate(HANDS)
    page.mouse.move(5, 5)
    done = page.evaluate(TO_BOTH_ENDS)
    assert done["wrong"] == []
    assert done["panes"] >= 1


@pytest.mark.by_example
@pytest.mark.parametrize("name", LESSONS)
def test_an_exercise_can_be_seen_solved_and_with_each_mistake(watched: Watched, name: str) -> None:
    """Where a notebook draws the reader's function. A mistake's pane moves, too, and says what is wrong."""
    page = watched.open(f"lessons/{name}")
    page.evaluate(HANDS)
    page.mouse.move(5, 5)
    places = page.locator(".camviz-drawn-with").all()
    assert places or name < "01"
    for place in places:
        drawn, buttons = place.locator(":scope > .camviz-with"), place.locator(":scope > p > button").all()
        assert drawn.count() == len(buttons) or (drawn.count(), buttons) == (1, [])
        seen = [first_picture(drawn.first)]
        for number, button in list(enumerate(buttons))[1:]:
            button.click()
            assert [one.is_visible() for one in drawn.all()] == [i == number for i in range(drawn.count())]
            assert [one.get_attribute("aria-pressed") for one in buttons].index("true") == number
            assert len("".join(drawn.nth(number).locator(":scope > p").all_inner_texts())) > 30
            seen.append(first_picture(drawn.nth(number)))
        if buttons:
            buttons[0].click()
        assert drawn.first.is_visible()
        assert len(set(seen)) == len(seen)


def first_picture(place: Locator) -> str:
    place.scroll_into_view_if_needed()
    place.locator('.camviz-recorded[data-live="true"]').wait_for()
    explorer = place.locator(".camviz-explorer")
    explorer.evaluate("root => hands.settled(root)")
    return str(explorer.evaluate("root => hands.picture(root)"))


@pytest.mark.parametrize("size", [(375, 812), (1440, 900)], ids=["telephone", "desk"])
def test_a_lesson_begins_with_its_picture_and_one_switch_shows_the_code(browser: Browser, address: str, size) -> None:
    """Nothing to install, no import and no fold stands above the first picture, which begins on the first screen."""
    watched = Watched(browser, address, viewport={"width": size[0], "height": size[1]})
    for name in LESSONS:
        page = watched.open(f"lessons/{name}")
        assert page.locator(PICTURE).first.bounding_box()["y"] < size[1], name
    page = watched.open("lessons/05_distortion")
    folds, switch = page.locator("details.hide.above-input"), page.locator(".camviz-code button")
    shown = "all => all.filter((one) => one.checkVisibility() && one.querySelector('pre').checkVisibility()).length"
    assert folds.evaluate_all(shown) == 0
    still = switch.bounding_box()["y"]
    page.mouse.move(5, 5)
    page.locator('.camviz-recorded[data-live="true"]').first.wait_for()
    assert abs(switch.bounding_box()["y"] - still) <= 2  # a pane that comes to life pushes nothing from under a finger
    switch.click()
    assert folds.evaluate_all(shown) == folds.count() > 15
    switch.click()
    assert folds.evaluate_all(shown) == 0
    watched.page.close()
    assert watched.complaints == []


def test_a_phone_scrolls_no_page_sideways_and_cuts_no_formula_in_a_line(browser: Browser, address: str) -> None:
    phone = Watched(browser, address, viewport={"width": 375, "height": 812}, has_touch=True)
    for way in (*READ, *(f"lessons/{name}" for name in LESSONS)):
        page = phone.open(way)
        assert page.evaluate("() => document.documentElement.scrollWidth") <= 375, way
        assert page.evaluate(CUT) == [], way
    phone.page.close()


def test_an_answer_is_replied_to_kept_and_cleared(watched: Watched) -> None:
    page = watched.open("lessons/05_distortion")
    question = predict_questions("05")[0]
    wrong = 1 - question.answer if question.answer < 2 else 0
    card = page.locator(".camviz-question", has_text="Predict").first
    card.locator("input").nth(wrong).check()
    card.get_by_role("button", name="Commit").click()
    assert "Not this one." in card.inner_text()
    card.get_by_role("button", name="Start again").click()
    assert "Your answers here are cleared." in card.inner_text()
    card.locator("input").nth(wrong).check()
    card.get_by_role("button", name="Commit").click()
    page.reload()
    assert "You answered this earlier." in card.inner_text()
    page.goto(f"{watched.address}/learn.html")
    shown = page.locator('.lesson-progress[data-lesson="05"]')
    total = len(predict_questions("05")) + len(quiz_questions("05"))
    assert shown.inner_text() == f"1 of {total} questions answered"
    page.get_by_role("button", name="Clear my answers").click()
    assert shown.inner_text() == ""
    page.goto(f"{watched.address}/lessons/05_distortion.html")
    assert "You answered this earlier." not in card.inner_text()


def test_answers_are_saved_as_a_notebook_writes_them_and_first_choices_stay_the_first(
    watched: Watched, tmp_path: Path
) -> None:
    """Form A all wrong; form B first all right, then, started again, all wrong: a class of one gains everything."""
    page = watched.open("lessons/05_distortion")
    wrong = [1 if one.answer == 0 else 0 for one in quiz_questions("05", "A")]
    chosen = {"What do you think now?": [wrong], "Exit quiz": [[one.answer for one in quiz_questions("05", "B")]]}
    chosen["Exit quiz"].append([1 if one == 0 else 0 for one in chosen["Exit quiz"][0]])
    for title, rounds in chosen.items():
        quiz = page.locator(".camviz-question", has_text=title).first
        for number, choices in enumerate(rounds):
            if number:
                quiz.get_by_role("button", name="Start again").click()
            for card, choice in zip(quiz.locator(".camviz-card").all(), choices, strict=True):
                card.locator("input").nth(choice).check()
                card.get_by_role("button", name="Commit").click()
    with page.expect_download() as saved:
        quiz.get_by_role("button", name="Write my answers to a file, without my name").click()
    path = tmp_path / saved.value.suggested_filename
    saved.value.save_as(path)
    assert re.fullmatch(r"answers_05_[0-9a-f]{8}\.csv", path.name)
    assert f"Saved as {path.name}: {3 * len(wrong)} choices, a random code, no name." in quiz.inner_text()
    assert all(mark(one) == one for one in read_answers(path))
    scores = class_scores([path], "05")
    assert (scores.before.tolist(), scores.after.tolist(), scores.incomplete) == ([0.0], [1.0], 0)


def test_a_quiz_before_and_after_the_lesson_ends_with_looking_back(watched: Watched) -> None:
    page = watched.open("lessons/05_distortion")
    for title, form in (("What do you think now?", "A"), ("Exit quiz", "B")):
        quiz = page.locator(".camviz-question", has_text=title).first
        for number, question in enumerate(quiz_questions("05", form)):
            card = quiz.locator(".camviz-card").nth(number)
            card.locator("input").nth(question.answer).check()
            card.get_by_role("button", name="Commit").click()
            assert ("Correct." in card.inner_text()) == (form == "B")
    count = len(quiz_questions("05"))
    assert f"{count} of {count} right at the first try." in quiz.inner_text()
    assert f"Before the lesson: {len(quiz_questions('05', 'A'))} of" in quiz.inner_text()


def test_a_term_shows_its_sentence_to_pointer_and_keyboard(watched: Watched) -> None:
    page = watched.open("lessons/05_distortion")
    term = page.locator("a.term").first
    term.hover()
    page.locator(".term-card").wait_for()
    page.keyboard.press("Escape")
    assert page.locator(".term-card").count() == 0
    term.focus()
    page.locator(".term-card").wait_for()


def test_without_scripts_a_lesson_has_stills_and_folded_replies(browser: Browser, address: str) -> None:
    page = new_page(browser, java_script_enabled=False)
    page.goto(f"{address}/lessons/05_distortion.html")
    stills = page.locator(".camviz-recorded img")
    assert stills.count() >= 6
    assert all(stills.nth(i).get_attribute("alt") for i in range(stills.count()))
    reply = page.locator(".camviz-folded details").first
    assert not reply.locator("blockquote").is_visible()
    reply.locator("summary").click()
    assert reply.locator("blockquote").is_visible()
    page.close()


@pytest.mark.parametrize("scripts", [True, False])
def test_a_deeper_section_is_folded_until_it_is_opened(browser: Browser, address: str, scripts: bool) -> None:
    page = new_page(browser, java_script_enabled=scripts)
    page.goto(f"{address}/lessons/05_distortion.html")
    heading = page.locator("section", has=page.locator(":scope > h3", has_text="Deeper: ")).first
    words = heading.locator(":scope > .camviz-deeper > p").first
    assert heading.locator(":scope > p").inner_text().startswith("About ")
    assert not words.is_visible()
    heading.get_by_text("Show this section").click()
    assert words.is_visible()
    heading.get_by_text("Hide this section").click()
    assert not words.is_visible()
    page.close()


def test_a_link_into_a_deeper_section_and_paper_open_it(watched: Watched) -> None:
    page = watched.page
    page.goto(f"{watched.address}/lessons/05_distortion.html")
    folds = page.locator(".camviz-deeper")
    inner = folds.locator("section[id]").last.get_attribute("id")
    page.goto(f"{watched.address}/lessons/05_distortion.html#{inner}")
    assert 0 <= page.locator(f"#{inner}").bounding_box()["y"] < 300
    own = folds.first.locator("..").get_attribute("id")
    page.goto(f"{watched.address}/lessons/05_distortion.html#{own}")
    opened = folds.evaluate_all("all => all.map((one) => one.open)")
    assert (opened[0], opened.count(True)) == (True, 2)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert folds.evaluate_all("all => all.every((one) => one.open)")


def test_a_printed_lesson_has_pictures_and_no_solution(watched: Watched) -> None:
    page = watched.open("lessons/05_distortion")
    page.emulate_media(media="print")
    assert page.locator(".camviz-solution").count() >= 4
    assert not any(one.is_visible() for one in page.locator(".camviz-solution, .camviz-exercise details").all())
    assert page.locator(".camviz-recorded").first.is_visible()


def test_a_site_opened_as_a_file_moves_too(browser: Browser) -> None:
    page = new_page(browser)
    complaints: list[str] = []
    page.on("pageerror", lambda error: complaints.append(str(error)))
    page.goto((SITE / "index.html").as_uri())
    page.mouse.move(5, 5)
    page.locator('.camviz-recorded[data-live="true"]').wait_for()
    page.goto((SITE / "lessons/05_distortion.html").as_uri())
    page.locator(".camviz-question").first.wait_for()
    assert complaints == []
    page.close()


def test_search_finds_a_lesson_by_a_word(watched: Watched) -> None:
    watched.page.goto(f"{watched.address}/search.html?q=pincushion")
    watched.page.locator('#search-results a[href*="05_distortion"]').first.wait_for()


def test_no_link_within_the_site_is_broken() -> None:
    pages = {path: re.sub(SCRIPT, "", path.read_text(encoding="utf-8")) for path in SITE.rglob("*.html")}
    names = {path: set(re.findall(r'\sid="([^"]*)"', text)) for path, text in pages.items()}
    broken = []
    for path, text in pages.items():
        for address in set(re.findall(ADDRESS, text)):
            link = urlsplit(unescape(address))
            if link.scheme:
                assert link.scheme in ("https", "http", "mailto", "data"), address
                continue
            target = (path.parent / unquote(link.path)).resolve() if link.path else path
            lost = bool(link.fragment) and unquote(link.fragment) not in names.get(target, {unquote(link.fragment)})
            if lost or not target.exists():
                broken.append(f"{path.relative_to(SITE)}: {address}")
    assert broken == []


def test_the_site_keeps_its_budget() -> None:
    """Whole at most 300 MB; a page's words at most 600 kB, a report's apart; no page loads anything of another host."""
    assert sum(path.stat().st_size for path in SITE.rglob("*") if path.is_file()) <= 300e6
    for path in SITE.rglob("*.html"):
        assert path.stat().st_size <= 600e3 or path.parent == REPORTS, path
        loaded = re.findall(LOADED, re.sub(SCRIPT, "", path.read_text(encoding="utf-8")))
        assert [one for one in loaded if urlsplit(one).netloc] == [], path
