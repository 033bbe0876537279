"""Pictures on slides: whole, legible, where the words say they are, and none black, empty or yet to be drawn."""

import re
from base64 import b64decode, b64encode
from functools import cache
from pathlib import Path

import cv2
import nbformat
import numpy as np
import pytest

from camviz.draw.gallery import side_by_side
from camviz.views.yours import faded
from camviz_school.course import notebooks
from camviz_school.course.saved_outputs import images_of
from camviz_school.teaching import deck, panels, parts, plans, slides

LESSONS = sorted((Path(__file__).parents[1] / "lessons").glob("*.ipynb"))
EACH = pytest.mark.parametrize("path", LESSONS, ids=lambda path: path.stem)


@cache
def made(path):
    """The slides with every picture, as they are once the class has written its functions."""
    return deck.planned_slides(notebooks.read(path), solved=True)


def shown(slide):
    """The rows of a slide's panels."""
    rows = [images_of(row) for row in slide.body.split("</div>")]
    return [[panels.SavedImage(source, words) for words, source in row] for row in rows if row]


def style(panel):
    """How large a drawing is shown, as its own style sheet reads it; "" for a plot."""
    return "" if panel.root is None else panel.root.get("style", "")


# What a view shows is on its slides ----------------------------------------------------------------------------------


@pytest.mark.sampled(4)
@EACH
def test_every_panel_of_every_picture_is_seen_once(path):
    views = [one for one in map(panels.panels, notebooks.read(path).cells) if one]
    pictures = [one for one in made(path) if one.kind.startswith("picture")]
    assert [one.kind for one in pictures].count("picture") == len(views)
    for view in views:
        (first,) = [pictures.pop(0)]
        seen = [panel for row in shown(first) for panel in row]
        while pictures and pictures[0].kind == "picture more":
            seen += [panel for row in shown(pictures.pop(0)) for panel in row]
        assert sorted(one.description for one in seen) == sorted(one.description for one in view)
        assert sorted(one.name for one in seen) == sorted(one.name for one in view)


@EACH
def test_a_text_that_points_below_says_on_which_slide_that_is(path):
    found = made(path)
    for number, one in enumerate(found, start=1):
        pointed = re.search(r"Below in the lesson: slide (\d+)", one.body)
        text = re.sub(r"<[^>]*>", "", one.body)
        if re.search(r"\b(?:view|picture|plot|arrows|rings|curve) below\b", text):
            assert pointed, f"slide {number}: {text}"
        if pointed:
            assert int(pointed[1]) > number
            assert found[int(pointed[1]) - 1].kind == "picture"


# How large, and how legible ------------------------------------------------------------------------------------------


def drawing(width, height, name="view", panel=True):
    mark = ' data-panel="1"' if panel else ""
    source = (
        f'<svg width="{width}" height="{height}" style="--w:{width};--shown:100vw" aria-label="{name}"><g{mark}/></svg>'
    )
    return panels.SavedImage(f"data:image/svg+xml;base64,{b64encode(source.encode()).decode()}", name)


def test_panels_share_a_slide_while_their_letters_are_legible():
    """Side by side 1228 − 10 pixels are shared; three of 420 units would be drawn at 0.96, and letters touch below."""
    (page,) = panels.pages([drawing(400, 300)] * 3, "A")
    assert page.scale == pytest.approx((1228 - 20) / 1200)
    smallest = panels.SavedImage.least.fget(drawing(400, 300))
    fits, too_wide = (1208 / (3 * smallest) + off for off in (-0.01, 0.01))
    assert len(panels.pages([drawing(fits, 560)] * 3, "A")) == 1
    assert len(panels.pages([drawing(too_wide, 560)] * 3, "A")) == 2


def test_the_panels_that_a_plan_names_come_first_and_alone():
    view = [drawing(480, 400, name) for name in ("left", "right", "space", "wedge")]
    first, second = panels.pages(view, "A", ("wedge", "left"))
    assert [[one.name for one in row] for row in first.rows] == [["left", "wedge"]]
    assert sorted(one.name for row in second.rows for one in row) == ["right", "space"]
    assert len(panels.pages(view[:2], "A", ("left",))) == 1  # both fit


def test_letters_grow_with_the_panel_whatever_the_screen():
    """At a scale of 1.25 a panel 400 units wide has 500 pixels; 12-unit letters are asked to have 14 of them."""
    image = drawing(400, 300).image(1.25)
    ((words, source),) = images_of(image)
    assert "--shown:500.0px;--camviz-scale:1.1667" in style(panels.SavedImage(source, words))
    assert "width:calc(39.062*var(--u));height:calc(29.297*var(--u))" in image


@EACH
def test_no_page_is_so_small_that_its_letters_would_touch(path):
    """Plots are one PNG, and as large as a slide is high; what a plan puts together may be a little smaller."""
    for one in made(path):
        for row in shown(one) if one.kind.startswith("picture") else []:
            for panel in row:
                _, sized, pixels = style(panel).partition("--shown:")
                assert not sized or float(pixels.partition("px")[0]) / panel.size[0] > 0.93, one.heading


# Nothing black, nothing empty ----------------------------------------------------------------------------------------


def black_or_empty(panel):
    """Whether a plot has a wholly black part as large as an axes, or nothing but paper; or a drawing has nothing."""
    if panel.root is not None:
        parts = [*panel.root.iter()]
        pictures = [part.get("href") for part in parts if part.get("href", "").startswith("data:")]
        drawn = [part for part in parts if part.tag.endswith(("path", "image", "text", "tspan", "rect"))]
        return len(drawn) < 2 or any(decoded(one).max() < 12 for one in pictures)
    pixels = decoded(panel.source).max(axis=-1)
    tiles = cv2.boxFilter((pixels < 3).astype(float), -1, (120, 90))
    return tiles.max() > 0.999 or (pixels < 250).mean() < 0.005


def decoded(address):
    return cv2.imdecode(np.frombuffer(b64decode(address.partition(",")[2]), np.uint8), cv2.IMREAD_COLOR)


@pytest.mark.sampled(4)
@EACH
def test_no_picture_of_an_unsolved_lesson_is_black_or_empty(path):
    notebook = notebooks.read(path)
    for one in deck.planned_slides(notebook):
        for row in shown(one) if one.kind.startswith("picture") else []:
            assert not any(map(black_or_empty, row)), one.heading


def test_a_black_map_of_an_unwritten_function_would_be_seen():
    """And the greyed picture that stands in its place is neither."""
    photograph = np.random.default_rng(1).integers(0, 255, (90, 120, 3)).astype(np.uint8)
    shown = side_by_side({"black": np.zeros((90, 120, 3), np.uint8), '"yours"': faded(photograph)})
    cell = nbformat.v4.new_code_cell("shown")
    cell.outputs = [nbformat.v4.new_output("display_data", data=shown._repr_mimebundle_())]
    saved = panels.panels(cell)
    assert [black_or_empty(one) for one in saved] == [True, False]
    assert [one.description for one in saved] == ['Pictures. From left to right: black; "yours".', '"yours"']
    assert images_of(saved[1].image(1.25))[0][0] == '"yours"'


# Whose function draws it ---------------------------------------------------------------------------------------------


def lesson(*cells):
    made = []
    for source, tag in cells:
        cell = nbformat.v4.new_code_cell(source)
        cell.metadata["tags"] = [tag] if tag else []
        made.append(cell)
    return nbformat.v4.new_notebook(cells=made)


STUB = ('def f(x):\n    """Twice x."""\n    ...  # your lines here', "stub")


def test_a_picture_is_the_readers_where_it_takes_their_answer(monkeypatch):
    monkeypatch.setattr(notebooks, "exercise_of", lambda cell: "00.f")
    of_the_reader = ("draw(f)", "def g(x):\n    return f(x)\n\ndraw(g)", "for i in f(3):\n    draw(i)", "y = f(2)")
    others = ("draw(lambda f: f)", "def g(f):\n    return f", "[f for f in range(3)]", "f = 3\ndraw(f)")
    others += ("for f in range(3):\n    draw(f)", "for i in range(3):\n    f = 3\n    draw(f)")
    for source in of_the_reader + others:
        found = parts.drawn_by_reader(lesson(STUB, (source, "")))
        assert [*found.values()] == ["f"] * (source in of_the_reader), source
    followed = lesson(STUB, ("y = f(2)", ""), ("draw(y)", ""), ("y = 3", ""), ("draw(y)", ""))
    assert list(parts.drawn_by_reader(followed)) == [followed.cells[1].id, followed.cells[2].id]
    given = lesson(("def f(x):\n    return 3 * x", "stub"), ("draw(f)", ""))  # and wrong: it draws its own picture
    assert parts.drawn_by_reader(given) == {}
    assert parts.drawn_by_reader(given, given=True) == {given.cells[1].id: "f"}


def test_an_unsolved_deck_withholds_the_readers_picture():
    path = next(path for path in LESSONS if path.name.startswith("05"))
    headings = {
        one.heading: one.body for one in deck.planned_slides(notebooks.read(path)) if one.kind.startswith("picture")
    }
    wall = "Left: the wall bent by the lens. Right: the wall bent by your function"
    assert headings[wall] == slides.WITHHELD
    assert "<img" in headings["Two arrows at each point: OpenCV&#x27;s and yours"]  # given, and to be mended
    assert not [one for one in made(path) if one.body == slides.WITHHELD]


# Plans name panels ---------------------------------------------------------------------------------------------------


def test_a_plan_that_names_no_panel_of_its_picture_is_complained_of():
    path = next(path for path in LESSONS if path.name.startswith("05"))
    plan = plans.plan("05")
    wrong = [*plan.notice[:7], plans.Notice("A.", ("radial curve", "wedge")), *plan.notice[8:]]
    found = plans.complaints(
        plans.Plan("05", "a", "b", "c", plan.steps, plan.votes, tuple(wrong)), notebooks.read(path)
    )
    assert found == ["the plan names the panel 'wedge' of picture 8, whose panels are the picture, radial curve"]
