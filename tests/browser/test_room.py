"""A class votes in real Chromium: the teacher's page with 300 students, the projector, telephones light and dark."""

import json
import os
import re
from pathlib import Path

import pytest
from axe_playwright_python.base import AXE_SCRIPT
from classroom import ask, camviz_class
from file_server import files_served
from laboratory import AXE, ROOT, new_page
from playwright.sync_api import expect

from camviz_school.course.questions import question

pytestmark = pytest.mark.browser

NAME = "05.far_rays"
RIGHT = question(NAME).answer
WRONG = 2
STUDENTS = 300
LAPTOP, TELEPHONE, PROJECTOR = ((1366, 768), (375, 667), (1920, 1080))
SMALLEST = """() => Math.min(...[...document.querySelectorAll("body *")]
  .filter((one) => one.offsetParent && [...one.childNodes].some((node) => node.nodeType === 3 && node.data.trim()))
  .map((one) => parseFloat(getComputedStyle(one).fontSize)))"""
# What lies below the strip at a page's foot, axe cannot tell; preload asks for style sheets anew, by wrong names.
SITE_AXE = """async () => {
  const { violations } = await axe.run(document, { resultTypes: ["violations"], preload: false });
  return violations.flatMap(({ id, nodes }) => nodes.map(({ html }) => `${id}: ${html.slice(0, 160)}`));
}"""
BEYOND = "() => document.documentElement.scrollWidth > innerWidth"


ENDED = "410 (Gone)"  # a page that asks once more when the room has ended is told so, and the browser notes it


class Class:
    """A room that is served, the pages that are open in it, and what went wrong in them."""

    def __init__(self, browser, port, said):
        self.browser, self.port, self.wrong, self.pages = browser, port, [], []
        self.word, self.key, self.projector = (
            re.search(pattern + r"(\S+)", said)[1] for pattern in (r"join with +", "teacher#", "projector#")
        )

    def page(self, path, size, **options):
        page = new_page(self.browser, viewport=dict(zip(("width", "height"), size, strict=True)), **options)
        page.on("pageerror", lambda error: self.wrong.append(str(error)))
        page.on("console", lambda message: self.wrong.append(message.text) if ENDED not in message.text else None)
        page.on(
            "request",
            lambda one: (
                None
                if f"127.0.0.1:{self.port}/" in one.url or one.url.startswith(("data:", "blob:"))
                else self.wrong.append(one.url)
            ),
        )
        page.goto(f"http://127.0.0.1:{self.port}/{path}")
        self.pages.append(page)
        return page

    def do(self, deed, number=0):
        """What the teacher does, and is told."""
        return ask(self.port, "api/do", {"do": deed, "question": NAME, "number": number}, self.key)

    def vote(self, tokens, number, choices):
        for token, choice in zip(tokens, choices, strict=True):
            assert ask(self.port, "api/vote", {"question": NAME, "round": number, "choice": choice}, token)["counted"]

    def check(self, step):
        """axe-core finds nothing wrong in any page, and none is too wide. A picture of each for who looks."""
        for number, page in enumerate(self.pages):
            page.evaluate(AXE_SCRIPT)
            assert page.evaluate(SITE_AXE if "/site/" in page.url else AXE, "body") == [], (step, page.url)
            assert not page.evaluate(BEYOND), (step, page.url)
            if folder := os.environ.get("CAMVIZ_SCREENSHOTS"):
                Path(folder).mkdir(parents=True, exist_ok=True)
                page.screenshot(path=Path(folder, f"room-{step}-{number}.png"), full_page=True)


@pytest.fixture
def classroom(browser, tmp_path):
    with camviz_class(tmp_path) as (_, port, said):
        room = Class(browser, port, said)
        yield room
        for page in room.pages:
            page.close()
        assert room.wrong == []


def test_a_class_of_300_votes_talks_votes_again_and_sees_why(classroom):
    teacher = classroom.page(f"teacher#{classroom.key}", LAPTOP)
    projector = classroom.page(f"projector#{classroom.projector}", PROJECTOR)
    phone = classroom.page(f"#{classroom.word}", TELEPHONE)
    dark = classroom.page("", TELEPHONE, color_scheme="dark")
    expect(projector.locator(".word")).to_have_text(classroom.word)
    classroom.check("1-before")

    expect(phone.locator("#kept")).to_contain_text("No name, no address, no time and no cookie")
    expect(phone.locator("#kept")).to_contain_text("until the teacher deletes that file")
    expect(teacher.locator("#kept")).to_contain_text(f"Kept in room_{classroom.word}.sqlite")
    expect(teacher.locator("#kept")).to_contain_text("The room ends by itself on")
    phone.get_by_role("button", name="Join").click()
    dark.get_by_label("The word of the room").fill("wrong-0000")
    dark.get_by_role("button", name="Join").click()
    expect(dark.locator("#news")).to_contain_text("not the word")
    classroom.wrong = [one for one in classroom.wrong if "403" not in one]  # Chromium's own line for what was refused
    dark.get_by_label("The word of the room").fill(classroom.word.upper())
    dark.keyboard.press("Enter")
    expect(dark.locator(".lead")).to_contain_text("You are in.")
    tokens = [ask(classroom.port, "api/join", {"word": classroom.word})["token"] for _ in range(STUDENTS - 2)]
    expect(teacher.locator(".joined")).to_have_text(f"{STUDENTS} have joined")

    teacher.locator("#questions button").nth(1).click()
    teacher.get_by_role("button", name="Open the vote").click()
    expect(phone.get_by_role("button", name="Vote", exact=True)).to_be_disabled()  # nothing is chosen yet
    phone.locator("label.choice").nth(WRONG).click()
    phone.get_by_role("button", name="Vote", exact=True).click()
    expect(phone.locator("#news")).to_have_text("Your vote is counted.")
    dark.locator("label.choice").nth(RIGHT).click()
    dark.get_by_role("button", name="Vote", exact=True).click()
    classroom.vote(tokens, 1, [RIGHT if student % 2 else WRONG for student in range(len(tokens))])
    expect(projector.locator("#news")).to_have_text(f"First vote: {STUDENTS} of {STUDENTS} have voted")
    expect(teacher.locator(".many")).to_contain_text(f"{STUDENTS} of {STUDENTS} so far")
    assert teacher.locator(".bar").count() == projector.locator(".bar").count() == 0
    classroom.check("2-open")

    teacher.get_by_role("button", name="Close the first vote").click()
    expect(teacher.locator(".bar")).to_have_count(4)
    expect(teacher.locator(".choices li").nth(RIGHT).locator(".much")).to_have_text("50 % (150)")
    expect(teacher.locator(".advice")).to_contain_text("50 % are right, between 35 and 70 %")
    expect(phone.locator(".discuss")).to_contain_text("You chose (c). Find somebody who did not.")
    expect(projector.locator(".discuss")).to_contain_text("Turn to a neighbour")
    assert projector.locator(".bar").count() == phone.locator(".bar").count() == 0
    classroom.check("3-talk")

    teacher.get_by_role("button", name="Open the second vote").click()
    expect(phone.locator(".state")).to_contain_text("Second vote.")
    phone.locator("label.choice").nth(RIGHT).click()
    phone.get_by_role("button", name="Vote", exact=True).click()
    classroom.vote(tokens, 2, [RIGHT if student % 4 else WRONG for student in range(len(tokens))])
    teacher.get_by_role("button", name="Close the second vote").click()
    expect(teacher.locator(".choices li").nth(WRONG).locator(".behind")).to_have_text(
        f"behind it: {question(NAME).choices[WRONG].misconception}"
    )
    teacher.get_by_role("button", name="Reveal the answer").click()
    expect(projector.locator(".choices li").nth(RIGHT)).to_have_class("right")
    expect(projector.locator(".bar")).to_have_count(8)
    expect(phone.locator(".choices li").nth(RIGHT)).to_contain_text("your second vote")
    expect(phone.locator(".reply")).to_have_count(2)
    expect(teacher.locator(".gain").nth(WRONG)).to_have_text("gain on this misconception: 0.50")
    classroom.check("4-revealed")
    assert projector.evaluate(SMALLEST) >= 24  # CSS pixels of 1080: a fortieth of the picture's height

    teacher.get_by_role("button", name="Show this reply on the projector").first.click()
    expect(projector.locator(".reply")).to_contain_text("To (a):")
    with teacher.expect_download() as saved:
        teacher.get_by_role("button", name="Votes as CSV").click()
    table = Path(saved.value.path()).read_text(encoding="utf-8")
    assert f"{NAME},2,c,75,0,the model saturates at the border" in table

    assert len(json.loads(phone.evaluate("sessionStorage.getItem('camviz-room')"))["token"]) > 20
    teacher.once("dialog", lambda dialog: dialog.accept())
    teacher.get_by_role("button", name="End the room").click()
    expect(phone.locator("#news")).to_have_text("The room has ended.")
    assert phone.evaluate("[sessionStorage.length, localStorage.length, document.cookie]") == [0, 0, ""]
    classroom.wrong = [one for one in classroom.wrong if "410" not in one]
    classroom.check("5-ended")


def test_every_question_of_all_lessons_fits_on_the_projector(browser, tmp_path):
    """The longest question, revealed: all of it in sight, and no print smaller than a fiftieth of the height."""
    with camviz_class(tmp_path, "all") as (_, port, said):
        room = Class(browser, port, said)
        names = [
            each["name"]
            for lesson in ask(port, "api/room", key=room.key)["lessons"]
            for each in lesson["questions"]
            if each["kind"] != "quiz A"
        ]
        length = {name: sum(len(each.text) for each in (question(name), *question(name).choices)) for name in names}
        projector = room.page(f"projector#{room.projector}", PROJECTOR)
        token = ask(port, "api/join", {"word": room.word})["token"]
        for name in sorted(names, key=length.get)[-3:]:
            for number in (1, 2):
                ask(port, "api/do", {"do": "open", "question": name, "number": number}, room.key)
                ask(port, "api/vote", {"question": name, "round": number, "choice": 0}, token)
                ask(port, "api/do", {"do": "close", "question": name}, room.key)
            ask(port, "api/do", {"do": "reveal", "question": name}, room.key)
            expect(projector.locator(".bar")).to_have_count(2 * len(question(name).choices))
            expect(projector.locator(".choices")).to_contain_text("✓")
            assert projector.evaluate("() => document.documentElement.scrollHeight <= innerHeight"), name
            assert projector.evaluate(SMALLEST) >= 1080 / 60, name
            room.check(f"long-{name}")
        projector.close()
        assert room.wrong == []


# The site, served by the room ----------------------------------------------------------------------------------------

SITE = Path(os.environ.get("CAMVIZ_SITE", ROOT / "build/site"))
LESSON = "site/lessons/05_distortion.html"
COUNTS = "() => JSON.stringify(localStorage)"


@pytest.fixture
def reading(browser, tmp_path):
    """A room that serves the site."""
    if not (SITE / "index.html").exists():
        pytest.fail(f"{SITE} has no index.html: build the site first, by python start.py site")
    with camviz_class(tmp_path, "05", "--site", str(SITE)) as (_, port, said):
        room = Class(browser, port, said)
        yield room
        for page in room.pages:
            page.close()
        assert [one for one in room.wrong if "[PST]" not in one] == []


def asked(page):
    """The question on a lesson's page."""
    return page.locator(".camviz-asked", has_text="Keep k1 = −0.3 and look at rays")


def joins(page, word):
    page.get_by_text("Vote with your class").click()
    page.get_by_label("The word of the room").fill(word)
    page.get_by_role("button", name="Join").click()


def commits(page, choice):
    asked(page).locator("input").nth(choice).check()
    asked(page).get_by_role("button", name="Commit").click()


def test_a_lessons_page_votes_twice_is_counted_once_and_keeps_its_reply_back(reading):
    page = reading.page(LESSON, TELEPHONE)
    page.get_by_text("Vote with your class").click()
    expect(page.locator(".camviz-class .kept")).to_contain_text("No name, no address, no time and no cookie is kept")
    page.get_by_text("Vote with your class").click()
    joins(page, reading.word)
    expect(page.locator(".camviz-class .news")).to_contain_text("You are in.")
    reading.do("open", 1)
    page.get_by_role("link", name="go to the question").click()
    for choice in (0, WRONG):
        commits(page, choice)
        expect(asked(page).locator(".camviz-reply")).to_contain_text(f"Your first vote is ({'abcd'[choice]})")
    reading.check("6-site-voted")
    told = reading.do("close")
    assert told["question"]["counts"]["1"] == [0, 0, 1, 0]
    expect(asked(page).locator(".camviz-reply")).to_contain_text("Turn to a neighbour who chose another answer")
    expect(asked(page).locator("input:enabled")).to_have_count(0)
    reading.do("open", 2)
    expect(asked(page).locator(".camviz-reply")).to_contain_text("This is the second vote. You chose (c).")
    expect(asked(page).locator("input:checked")).to_have_count(0)
    commits(page, RIGHT)
    expect(asked(page).locator(".camviz-reply")).to_contain_text("Your second vote")
    page.reload()  # what is being voted on is in the room, and not in this browser
    expect(asked(page).locator(".camviz-reply")).to_contain_text("Your second vote")
    told = reading.do("close")
    assert (told["joined"], told["question"]["counts"]["2"]) == (1, [0, 1, 0, 0])
    expect(asked(page).locator(".camviz-reply")).to_contain_text("The vote is closed.")
    assert "correct" not in asked(page).inner_text().lower()
    assert "%" not in asked(page).inner_text()
    assert "far_rays" not in page.evaluate(COUNTS)
    reading.do("reveal")
    expect(asked(page).locator(".camviz-reply")).to_contain_text("✓ Correct.")
    expect(asked(page).locator(".camviz-room")).to_contain_text("0 % in the first vote, 100 % in the second vote")
    assert json.loads(json.loads(page.evaluate(COUNTS))["camviz.answers.05"]) == {"during  far_rays": [WRONG, RIGHT]}


def test_a_vote_from_a_lessons_page_that_comes_after_closing_is_refused_by_the_server(reading):
    page = reading.page(LESSON, LAPTOP)
    joins(page, reading.word)
    reading.do("open", 1)
    expect(asked(page).locator(".camviz-reply")).to_contain_text("This is the first vote")
    page.route("**/api/vote", lambda route: (reading.do("close"), route.continue_()))  # closed while it is on its way
    commits(page, RIGHT)
    expect(page.locator(".camviz-class .news")).to_contain_text("The vote is closed")
    expect(asked(page).locator(".camviz-reply")).to_have_text(re.compile("was not counted|did not vote"))
    expect(asked(page).locator("input:checked")).to_have_count(0)
    assert reading.do("choose")["question"]["counts"]["1"] == [0] * 4
    reading.wrong = [one for one in reading.wrong if "409" not in one]


def test_a_wrong_word_lets_no_lessons_page_in_and_the_lesson_goes_on(reading):
    page = reading.page(LESSON, TELEPHONE, color_scheme="dark")
    joins(page, "wrong-0000")
    expect(page.locator(".camviz-class .news")).to_contain_text("not the word of the room")
    reading.check("7-site-wrong-word")
    reading.do("open", 1)
    commits(page, WRONG)
    expect(asked(page).locator(".camviz-reply")).to_contain_text("Not this one.")
    told = reading.do("close")
    assert (told["joined"], told["question"]["counts"]["1"]) == (0, [0] * 4)
    reading.wrong = [one for one in reading.wrong if "403" not in one]


def test_from_the_telephones_page_a_student_reads_on_in_the_lesson_and_is_still_in(reading):
    page = reading.page(f"#{reading.word}", TELEPHONE)
    page.get_by_role("button", name="Join").click()
    reading.do("open", 1)
    page.get_by_role("link", name="Read the lesson, and vote there").click()
    commits(page, RIGHT)
    expect(asked(page).locator(".camviz-reply")).to_contain_text("Your first vote is (b)")
    assert reading.do("close")["question"]["counts"]["1"] == [0, 1, 0, 0]
    reading.do("end")
    expect(page.locator(".camviz-class .news")).to_contain_text("The room has ended.")
    assert page.evaluate("sessionStorage.getItem('camviz-room')") is None
    expect(asked(page).locator(".camviz-reply")).to_contain_text("✓ Correct.")
    reading.wrong = [one for one in reading.wrong if "410" not in one]


def test_at_home_a_lessons_page_asks_twice_and_then_says_why(reading):
    page = reading.page(LESSON, LAPTOP)
    joins(page, reading.word)
    reading.do("open at home")
    expect(asked(page).locator(".camviz-reply")).to_contain_text("the reply comes after your second answer")
    commits(page, WRONG)
    expect(asked(page).locator(".camviz-reply")).to_contain_text("You chose (c). Before you answer again")
    assert "far_rays" not in page.evaluate(COUNTS)
    commits(page, RIGHT)
    expect(asked(page).locator(".camviz-reply")).to_contain_text("✓ Correct.")
    expect(asked(page).locator(".camviz-room")).to_be_empty()  # the class's split comes when the teacher closes it
    assert reading.do("close at home")["states"][NAME] == "voted twice"


def test_at_home_the_folded_sections_open_in_which_something_is_asked(browser, tmp_path):
    with camviz_class(tmp_path, "02", "--site", str(SITE)) as (_, port, said):
        room = Class(browser, port, said)
        page = room.page("site/lessons/02_lenses.html", LAPTOP)
        folded = page.locator(".camviz-deeper", has=page.locator(".camviz-question"))
        assert folded.count() == 1
        assert not folded.locator(".camviz-question").is_visible()
        joins(page, room.word)
        room.do("open at home")
        expect(folded.locator(".camviz-question")).to_be_visible()
        folded.get_by_text("Hide this section").click()
        room.do("close at home")
        expect(page.locator(".camviz-class .news")).not_to_contain_text("open at home")
        assert not folded.locator(".camviz-question").is_visible()
        page.close()
        assert [one for one in room.wrong if "[PST]" not in one] == []


def test_the_published_page_offers_no_room(browser):
    """The same files, from anybody else's server."""
    page = new_page(browser)
    seen = []
    page.on("request", lambda one: seen.append(one.url))
    with files_served(SITE) as address:
        page.goto(f"{address}/lessons/05_distortion.html")
        commits(page, RIGHT)
        expect(asked(page).locator(".camviz-reply")).to_contain_text("✓ Correct.")
        assert page.locator(".camviz-class").count() == 0
        assert "Vote with your class" not in page.content()
        page.close()
    assert not [url for url in seen if "/api/" in url or "static/lesson" in url.replace("_static", "")]


@pytest.mark.parametrize("way", ["index.html", "learn.html", "search.html", "lessons/05_distortion.html"])
def test_the_rooms_policy_lets_a_page_of_the_site_work(reading, way):
    page = reading.page(f"site/{way}", LAPTOP)
    page.mouse.move(5, 5)
    if way.startswith(("index", "lessons")):
        page.locator(".camviz-recorded").first.scroll_into_view_if_needed()
        page.locator('.camviz-recorded[data-live="true"]').first.wait_for()
    page.wait_for_timeout(300)
    assert [one for one in reading.wrong if "Content Security Policy" in one] == []
