"""The built site in a real Firefox: a slider moves its picture, a question gives its reply. With --all in every lesson.

`python start.py site` builds it before; CAMVIZ_SITE names another folder than build/site.
"""

import os
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
from built_site import LESSONS, served
from firefox import Firefox, executable, firefox

pytestmark = [
    pytest.mark.browser,
    pytest.mark.skipif(executable() is None, reason="no Firefox on this machine: apt-get install firefox-esr"),
]

HANDS = Path(__file__).with_name("hands.js").read_text(encoding="utf-8")
SLIDER = """(async () => {
  for (const pane of document.querySelectorAll(".camviz-recorded")) {
    pane.scrollIntoView();
    for (let i = 0; i < 8000 && !pane.dataset.live; i++) await hands.pause(25);
    window.root = pane.querySelector(".camviz-explorer");
    await hands.settled(root);
    window.slider = root.querySelector('[data-control] input[type="range"]');
    if (slider) break;
  }
  slider.scrollIntoView({ block: "center" });
  await hands.pause(100);
  const { left, right, top, bottom } = slider.getBoundingClientRect(), middle = (top + bottom) / 2;
  window.before = { value: slider.value, picture: await hands.picture(root) };
  const part = (slider.value - slider.min) / (slider.max - slider.min), thumb = 8;
  const x = left + thumb + part * (right - left - 2 * thumb);
  return [[x, middle], [part < 0.5 ? right - thumb : left + thumb, middle]];
})()"""
MOVED = """(async () => {
  await hands.settled(root);
  return { value: slider.value !== before.value, picture: (await hands.picture(root)) !== before.picture,
           error: hands.error(root), said: slider.getAttribute("aria-valuetext") };
})()"""
MIDDLE = """(async () => {
  const replying = (card) => !card.textContent.includes("What do you think now");
  const one = [...document.querySelectorAll(".camviz-question")].find(replying).querySelector("SELECTOR");
  const near = ({ top, bottom }) => bottom > -900 && top < innerHeight + 900;
  const asleep = [...document.querySelectorAll(".camviz-recorded")];
  const still = () => asleep.some((pane) => !pane.dataset.live && near(pane.getBoundingClientRect()));
  // Panes near it that come to life may push it.
  for (let i = 0, calm = 0; i < 200 && calm < 4; i++, calm = still() ? 0 : calm + 1) {
    one.scrollIntoView({ block: "center" });
    await hands.pause(50);
  }
  const { left, right, top, bottom } = one.getBoundingClientRect();
  return [(left + right) / 2, (top + bottom) / 2];
})()"""


@pytest.fixture(scope="module")
def address() -> Iterator[str]:
    with served() as address:
        yield address


@pytest.fixture(scope="module")
def fox(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Firefox]:
    with firefox(tmp_path_factory.mktemp("firefox") / "profile") as one:
        yield one


@pytest.fixture
def watched(fox: Firefox, address: str) -> Iterator[Firefox]:
    """The Firefox, whose page may complain of nothing and ask nobody else."""
    fox.complaints, fox.asked = [], []
    yield fox
    assert fox.complaints == []
    assert [url for url in fox.asked if urlsplit(url).scheme in ("http", "https") and not url.startswith(address)] == []


def opened(fox: Firefox, url: str) -> None:
    fox.open(url)
    fox.evaluate(f"(() => {{ {HANDS} }})()")
    fox.move((3, 3))


def kept(fox: Firefox, name: str) -> None:
    if folder := os.environ.get("CAMVIZ_SCREENSHOTS"):
        fox.screenshot(Path(folder) / f"firefox-{name}.png")


@pytest.mark.by_example
@pytest.mark.parametrize("way", ["index", *(f"lessons/{name}" for name in LESSONS)])
def test_a_slider_dragged_by_its_thumb_changes_the_picture(watched: Firefox, address: str, way: str) -> None:
    opened(watched, f"{address}/{way}.html")
    thumb, end = watched.evaluate(SLIDER)
    watched.drag(thumb, end)
    moved = watched.evaluate(MOVED)
    kept(watched, way.replace("/", "-"))
    assert moved["error"] == ""
    assert (moved["value"], moved["picture"]) == (True, True), moved


@pytest.mark.by_example
@pytest.mark.parametrize("name", LESSONS)
def test_a_question_replies_to_a_click(watched: Firefox, address: str, name: str) -> None:
    opened(watched, f"{address}/lessons/{name}.html")
    watched.click(watched.evaluate(MIDDLE.replace("SELECTOR", "input[type=radio]")))
    watched.click(watched.evaluate(MIDDLE.replace("SELECTOR", "button")))
    kept(watched, f"answer-{name}")
    watched.wait_for("/Not this one\\.|Correct\\./.test(document.querySelector('.bd-article').innerText)")
