"""Pictures on slides: whole, legible, where the words say they are, and none black, empty or yet to be drawn."""

import re
from base64 import b64decode, b64encode
from functools import cache
from html import unescape
from pathlib import Path

import cv2
import nbformat
import numpy as np
import pytest

from camviz.draw.gallery import side_by_side
from camviz.views.yours import faded
from camviz_school.course import notebooks
from camviz_school.teaching import deck, panels, parts, plans, slides

LESSONS = sorted((Path(__file__).parents[1] / "lessons").glob("*.ipynb"))
EACH = pytest.mark.parametrize("path", LESSONS, ids=lambda path: path.stem)
BESIDE = re.compile(r"\b(?:Left|Right|Middle):|\b(?:left|right) (?:one|picture)\b|\bon the (?:left|right)\b")
BELOW = re.compile(r"\bBelow:|\b(?:Lower|lower|Upper|upper) (?:row|right|left)\b")
DRAWN_BY = {  # what a heading may speak of, and the panels that draw it, or words of a plot's description
    r"contours?": "displacements",
    r"[Cc]urves?": "radial curve|curves?|section|corner|right picture|Plot",
    r"[Dd]isparities|maps?": "disparity map|second map|depth|map",
    r"tooth": "rays from above",
    r"[Bb]ars?": "bars|errors|estimates?|electrons|Plot",
    r"Airy disc": "blur",
    r"σ": "estimate ± σ|Plot",
}


@cache
def made(path):
    """The slides with every picture, as they are once the class has written its functions."""
    return deck.planned_slides(notebooks.read(path), solved=True)


def shown(slide):
    """The rows of a slide's panels: name, or a plot's description, and data address."""
    found = []
    for row in slide.body.split("</div>"):
        images = re.findall(r'<img alt="([^"]*)"[^>]*? src="([^"]*)"', row)
        if images:
            found.append([panels.SavedImage(source, unescape(alt)) for alt, source in images])
    return found


def titles(panel):
    """How many titled plots a PNG consists of: matplotlib's alternative text has a sentence for each."""
    return 1 if panel.name else len(re.findall(r"(?:^|\. )(?!Across|Up|Shown)\S", panel.description))


# What a view shows is on its slides ----------------------------------------------------------------------------------


@pytest.mark.sampled(4)
@EACH
def test_every_panel_of_every_picture_is_seen_once_and_together(path):
    views = [one for one in map(panels.panels, notebooks.read(path).cells) if one]
    pictures = [one for one in made(path) if one.kind.startswith("picture")]
    assert [one.kind for one in pictures].count("picture") == len(views)
    for view in views:
        (first,) = [pictures.pop(0)]
        seen = [panel for row in shown(first) for panel in row]
        while pictures and pictures[0].kind == "picture more":
            seen += [panel for row in shown(pictures.pop(0)) for panel in row]
        assert sorted(one.description for one in seen) == sorted(unescape(one.description) for one in view)
        assert sorted(one.name for one in seen) == sorted(one.name for one in view)


@EACH
def test_what_a_heading_speaks_of_is_on_its_slide(path):
    for number, one in enumerate(made(path), start=1):
        rows = shown(one)
        if one.kind != "picture":
            continue
        heading = unescape(re.sub(r"<[^>]*>", "", one.heading))
        where = f"slide {number}: {heading}"
        if BESIDE.search(heading):
            assert max(sum(map(titles, row)) for row in rows) > 1 or pictured(rows), where
        if BELOW.search(heading):
            drawn = "".join(b64decode(panel.source.partition(",")[2]).decode("latin-1") for panel in rows[0])
            assert len(rows) > 1 or titles(rows[0][0]) > 1 or "lower right" in drawn, where
        for words, names in DRAWN_BY.items():
            if re.search(rf"\b{words}\b", heading):
                names = rf"^(?:{names})$|\b(?:{names})\b"
                assert any(re.search(names, panel.name or panel.description) for row in rows for panel in row), where


def pictured(rows):
    """True for one plot that says itself what is left and right in it."""
    return len(rows[0]) == 1 and re.search(r"right|in front|left", rows[0][0].description)


DONE = re.compile(  # "Pull the slider, and it turns grey": an order, and what comes of it
    r"(?:^|[.:] )(?:Bring|Choose|Click|Drag|Move|Press|Pull|Set|Switch|Take|Turn)\b[^.?]*(?:: |, and\b)[^.?]*(?:\.|$)"
    r"|\b(?:(?i:as soon as|once you|after you|when you)|(?<!, )when the \w+ (?:turns?|moves?))\b[^.?]*(?:[.,]|$)"
)


@EACH
def test_a_heading_does_not_tell_what_only_comes_after_a_movement(path):
    """It may ask for it: what stands on a slide is the picture before anything was moved."""
    headings = [unescape(re.sub(r"<[^>]*>", "", one.heading)) for one in made(path) if one.kind == "picture"]
    assert [one for one in headings if DONE.search(one)] == []


@pytest.mark.parametrize(
    ("heading", "found"),
    [
        ("Rings are coloured. Pull the slider, and they turn grey", True),
        ("Turn both cameras: every yellow line becomes a row", True),
        ("The dots move when the camera turns, and they stay", True),
        ("Turn both cameras until every yellow line is a row", False),
        ("Drag the focal length: what becomes of globe and bush?", False),
        ("Will the dots stay on it when the camera turns?", False),
    ],
)
def test_such_a_heading_would_be_found(heading, found):
    assert bool(DONE.search(heading)) is found


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


def test_panels_share_a_slide_as_long_as_their_letters_stay_as_large_as_they_may():
    """Side by side 1228 − 10 pixels are shared; three of 420 units would be drawn at 0.96, and letters touch below."""
    (page,) = panels.pages([drawing(400, 300)] * 3, "A")
    assert page.scale == pytest.approx((1228 - 20) / 1200)
    smallest = panels.SavedImage.least.fget(drawing(400, 300))
    fits, too_wide = (1208 / (3 * smallest) + off for off in (-0.01, 0.01))
    assert len(panels.pages([drawing(fits, 560)] * 3, "A")) == 1
    assert len(panels.pages([drawing(too_wide, 560)] * 3, "A")) == 2


def test_a_heading_of_two_lines_leaves_less_height():
    tall = [drawing(300, 400)]
    (one,), (two,) = panels.pages(tall, "A" * panels.LETTERS_A_LINE), panels.pages(tall, "A" * 63)
    assert (one.scale, two.scale) == pytest.approx((604 / 400, 567 / 400))


def test_the_panels_that_a_plan_names_come_first_and_alone():
    view = [drawing(480, 400, name) for name in ("left", "right", "space", "wedge")]
    first, second = panels.pages(view, "A", ("wedge", "left"))
    assert [[one.name for one in row] for row in first.rows] == [["left", "wedge"]]
    assert sorted(one.name for row in second.rows for one in row) == ["right", "space"]
    assert len(panels.pages(view[:2], "A", ("left",))) == 1  # both fit


def test_letters_grow_with_the_panel_whatever_the_screen():
    """At a scale of 1.25 a panel 400 units wide has 500 pixels; 12-unit letters are asked to have 14 of them."""
    image = drawing(400, 300).image(1.25)
    source = b64decode(re.search(r'src="[^,]*,([^"]*)"', image)[1]).decode()
    assert "--shown:500.0px;--camviz-scale:1.1667" in source
    assert "width:calc(39.062*var(--u));height:calc(29.297*var(--u))" in image


@EACH
def test_no_page_is_drawn_so_small_that_its_letters_would_touch(path):
    """Plots are one PNG, and as large as a slide is high; what a plan puts together may be a little smaller."""
    for one in made(path):
        for row in shown(one) if one.kind.startswith("picture") else []:
            for panel in row:
                size = re.search(r"--shown:([\d.]+)px", b64decode(panel.source.partition(",")[2]).decode("latin-1"))
                if size:
                    assert float(size[1]) / panel.size[0] > 0.93, one.heading


# Nothing black, nothing empty ----------------------------------------------------------------------------------------


def black_or_empty(panel):
    """Whether a plot has a wholly black part as large as an axes, or nothing but paper; or a drawing has nothing."""
    data = b64decode(panel.source.partition(",")[2])
    if panel.name:
        drawn = re.findall(r"<(?:path|image|text|tspan|polygon|circle|rect|line)\b", data.decode())
        pictures = re.findall(r"data:image/(?:jpeg|png);base64,([\w+/=]+)", data.decode())
        return len(drawn) < 2 or any(decoded(b64decode(one)).max() < 12 for one in pictures)
    pixels = decoded(data).max(axis=-1)
    tiles = cv2.boxFilter((pixels < 3).astype(float), -1, (120, 90))
    return tiles.max() > 0.999 or (pixels < 250).mean() < 0.005


def decoded(data):
    return cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR)


@pytest.mark.sampled(4)
@EACH
def test_no_picture_of_an_unsolved_lesson_is_black_or_empty(path):
    notebook = notebooks.read(path)
    for one in deck.planned_slides(notebook):
        for row in shown(one) if one.kind.startswith("picture") else []:
            assert not any(map(black_or_empty, row)), one.heading


def test_the_black_map_of_an_unwritten_function_would_be_seen():
    """And the greyed picture that stands in its place is neither."""
    photograph = np.random.default_rng(1).integers(0, 255, (90, 120, 3)).astype(np.uint8)
    shown = side_by_side({"black": np.zeros((90, 120, 3), np.uint8), "yours": faded(photograph)})
    cell = nbformat.v4.new_code_cell("shown")
    cell.outputs = [nbformat.v4.new_output("display_data", data=shown._repr_mimebundle_())]
    assert [black_or_empty(one) for one in panels.panels(cell)] == [True, False]


# Whose function draws it ---------------------------------------------------------------------------------------------


def lesson(*cells):
    made = []
    for source, tag in cells:
        cell = nbformat.v4.new_code_cell(source)
        cell.metadata["tags"] = [tag] if tag else []
        made.append(cell)
    return nbformat.v4.new_notebook(cells=made)


STUB = ('def f(x):\n    """Twice x."""\n    ...  # your lines here', "stub")
CHECKED = ('check("00.f", f)', "check")


@pytest.mark.parametrize(
    ("source", "drawn"),
    [
        ("draw(f)", True),
        ("draw(lambda f: f)", False),
        ("def g(f):\n    return f", False),
        ("def g(x):\n    return f(x)\n\ndraw(g)", True),
        ("[f for f in range(3)]", False),
        ("for f in range(3):\n    draw(f)", False),
        ("for i in range(3):\n    f = 3\n    draw(f)", False),
        ("for i in f(3):\n    draw(i)", True),
        ("f = 3\ndraw(f)", False),
        ("y = f(2)", True),
    ],
)
def test_a_picture_is_the_readers_where_it_takes_what_the_function_makes(monkeypatch, source, drawn):
    monkeypatch.setattr(notebooks, "exercise_of", lambda cell: "00.f")
    notebook = lesson(STUB, (source, ""))
    assert bool(parts.drawn_by_reader(notebook)) is drawn
    if drawn:
        assert list(parts.drawn_by_reader(notebook).values()) == ["f"]


def test_what_a_readers_function_gives_is_followed_until_it_is_replaced(monkeypatch):
    monkeypatch.setattr(notebooks, "exercise_of", lambda cell: "00.f")
    notebook = lesson(STUB, ("y = f(2)", ""), ("draw(y)", ""), ("y = 3", ""), ("draw(y)", ""))
    assert list(parts.drawn_by_reader(notebook)) == [notebook.cells[1].id, notebook.cells[2].id]


def test_a_function_that_is_given_and_wrong_draws_its_own_picture(monkeypatch):
    monkeypatch.setattr(notebooks, "exercise_of", lambda cell: "00.f")
    notebook = lesson(("def f(x):\n    return 3 * x", "stub"), ("draw(f)", ""))
    assert parts.drawn_by_reader(notebook) == {}
    assert parts.drawn_by_reader(notebook, given=True) == {notebook.cells[1].id: "f"}


def test_an_unsolved_deck_says_where_the_readers_picture_is_and_a_solved_one_shows_it():
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
