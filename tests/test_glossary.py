"""The glossary: every key term of the source text, in two sentences at most, and links that lead somewhere."""

import re
from pathlib import Path

import pytest

from camviz_school.course import notebooks
from camviz_school.course.glossary import anchor, glossary, markdown, page, term
from camviz_school.course.material import lesson_paths
from camviz_school.course.questions import questions
from camviz_school.course.reading import LONGEST_SENTENCE, sentences, words

ROOT = Path(__file__).parents[1]

KEY_TERMS = (
    """
Camera Calibration Techniques|Camera Coordinates|Camera Matrix|CCD Sensor|Checkerboard pattern method|CMOS Sensor
Color Filter Array|Color Space|David Marr|Demosaicing Algorithms|Depth of Field|Disparity and Depth Estimation
Dynamic Range|Epipolar Geometry|Extrinsic Calibration|Field of View|Fisheye lenses|Focal Length
Homogeneous Coordinates|Homogeneous Transformations|Image formation pipeline|Image resolution
Intrinsic Calibration|Light Field Cameras|Omnidirectional Cameras|Perspective Camera|Pinhole Camera
Pixel Aspect Ratio|Projection|Quantum Efficiency|Radial distortion|Radial distortion coefficients|Ray Tracing
Rotation Matrix|Shai Shalev-Shwartz|Skew coefficient|Stereo Rectification|Tangential Distortion
Thin lens approximation|Translation Vector|Viewing Frustum|White Balance and Color Correction|World Coordinates
Zhang's Calibration Algorithm
""".strip()
    .replace("\n", "|")
    .split("|")
)

ALL = pytest.mark.parametrize("one", glossary().terms, ids=lambda one: one.anchor)


def test_the_44_key_terms_of_the_source_text_are_all_there_and_no_other_is_called_one():
    assert len(KEY_TERMS) == 44
    assert {term(name).name for name in KEY_TERMS} == {one.name for one in glossary().terms if one.key}
    assert sum(one.key for one in glossary().terms) == 44


@ALL
def test_an_entry_has_at_most_two_sentences_that_can_be_read_at_once(one):
    assert one.sentence[0].isupper()
    assert one.sentence.endswith(".")
    said = list(sentences(one.sentence))
    assert len(said) <= 2
    assert len(re.findall(r"[.?!] [A-Z]", one.sentence)) == len(said) - 1
    assert max(map(words, said)) <= LONGEST_SENTENCE


@ALL
def test_an_entry_says_which_lessons_use_it_and_those_exist_in_the_course(one):
    assert one.lessons
    assert set(one.lessons) <= {path.name[:2] for path in lesson_paths()}
    assert list(one.lessons) == sorted(one.lessons)


def test_no_two_entries_share_a_name_or_an_address():
    names = [name.casefold() for one in glossary().terms for name in (one.name, *one.also)]
    assert len(names) == len(set(names))
    assert len({one.anchor for one in glossary().terms}) == len(glossary().terms)


def test_a_term_is_found_by_its_other_names_and_an_unknown_one_brings_suggestions():
    assert term("FOV") == term("field of view")
    assert term("Color Space").name == "Colour space"
    with pytest.raises(ValueError, match="perhaps Principal point"):
        term("principle point")


@pytest.mark.parametrize(
    ("name", "needs", "never"),
    [
        ("translation vector", "t = −R C", "position of the camera"),
        ("homogeneous transformations", "rigid", "and scaling"),
        ("checkerboard pattern method", "printed", "projecting"),
        ("skew coefficient", "perpendicular", "optical axis"),
        ("CMOS sensor", "as low as that of a CCD or lower", "higher noise"),
        ("undistortion", "forward model", "inverse model"),
        ("fundamental matrix", "not sufficient", "sufficient condition"),
        ("Zhang's calibration algorithm", "two when the skew", "few images"),
        ("Shai Shalev-Shwartz", "none of which could be found", "contributions"),
        ("white balance", "tint", "color temperature only"),
    ],
)
def test_the_source_text_s_errors_are_not_repeated(name, needs, never):
    text = repr(term(name))
    assert needs in text
    assert never not in text


def test_entries_show_as_safe_html_and_as_plain_text():
    assert '<dt id="principal-point">' in term("principal point")._repr_html_()
    assert "<em>pixels</em>" in term("fundamental matrix")._repr_html_()
    assert "<" not in repr(term("fundamental matrix"))
    assert len(re.findall("<dt id=", glossary()._repr_html_())) == len(glossary().terms)


def test_the_saved_glossary_is_fresh():
    """Mend with: python -m camviz_school.commands.lessons pages"""
    assert (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8") == page()


def test_addresses_are_those_github_gives_a_heading():
    assert anchor("Zhang's calibration algorithm") == "zhangs-calibration-algorithm"
    assert '<a id="shai-shalev-shwartz"></a>' in markdown()
    assert "[05](lessons/05_distortion.ipynb)" in markdown("lessons/")


def _order():
    """The lessons as the README's table lists them."""
    return re.findall(r"^\| (\d\d) ", (ROOT / "README.md").read_text(encoding="utf-8"), re.MULTILINE)


def _pattern(one):
    names = "|".join(re.escape(name) for name in (one.name, *one.also))
    return re.compile(rf"(?<![\w-])(?:{names})s?(?![\w-])", re.IGNORECASE)


EVERYDAY = {
    "Checkerboard pattern method": "a chessboard is one for everybody",
    "Fisheye lenses": "a fisheye is known from photographs, and named in the lesson's title",
    "Pixel pitch": "how large a pixel is, lesson 01 says",
    "Colour temperature": "a tint is a cast of colour",
}
EXPLAINED = {
    ("03.first_skew", "Skew coefficient"): "where the second number, the skew, is nearly always 0",
    ("06.views", "Zhang's calibration algorithm"): "that is Zhang's method",  # just above: Zhang (2000) showed how
    ("13.first_delta", "Colour difference"): "The measure is ΔE2000, of which 1 is about the least that an eye notices",
    ("14.fan", "Rolling shutter"): "each of its 480 rows is exposed 64 µs after the one above",
    ("14.first_shutter", "CMOS sensor"): "Sensors come in two kinds, CCD and CMOS.",
    ("14.first_decibel", "Dynamic range"): "Dynamic range is saturation divided by the threshold",
}
"""A question that says itself what its term means, and with which words."""


@pytest.mark.parametrize("lesson", [path.name[:2] for path in lesson_paths()][1:])
def test_a_question_asked_before_a_term_is_explained_does_without_it(lesson):
    """Form A stands before its lesson, a prediction behind the cells above it; its text and choices are read."""
    order = _order()
    (path,) = (path for path in lesson_paths() if path.name.startswith(lesson))
    cells = notebooks.read(path).cells
    unknown = [one for one in glossary().terms if min(map(order.index, one.lessons)) >= order.index(lesson)]
    found, excused = set(), set()
    for asked in questions(lesson).values():
        if asked.form == "B":
            continue
        above = next((i for i, cell in enumerate(cells) if f'ask("{asked.name}")' in cell.source), 0)
        told = " ".join(cell.source for cell in cells[1:above] if cell.cell_type == "markdown")
        said = " ".join([asked.text, *(choice.text for choice in asked.choices)])
        used = {one.name for one in unknown if _pattern(one).search(said) and not _pattern(one).search(told)}
        for name in used - set(EVERYDAY):
            (excused if EXPLAINED.get((asked.name, name), "\0") in " ".join(said.split()) else found).add(
                (asked.name, name)
            )
    assert not found
    assert excused == {one for one in EXPLAINED if one[0].startswith(lesson)}


def test_every_glossary_link_in_the_lessons_has_a_target():
    anchors = {one.anchor for one in glossary().terms}
    for path in sorted((ROOT / "lessons").glob("*.ipynb")):
        linked = set(re.findall(r"00_start_here\.ipynb#([^)\"\\]+)\)", path.read_text(encoding="utf-8")))
        assert linked <= anchors, f"{path.name} links to {sorted(linked - anchors)}"


def test_the_lessons_that_the_glossary_links_to_exist_once_there_are_lessons():
    notebooks = {path.name for path in (ROOT / "lessons").glob("*.ipynb")}
    linked = set(re.findall(r"\(lessons/([^)]+)\)", markdown("lessons/")))
    assert linked
    assert "00_start_here.ipynb" not in notebooks or linked <= notebooks
