"""The course as a list of lessons: what each says of itself, and the pages that are made from that."""

import re
from dataclasses import replace
from pathlib import Path

import nbformat
import pytest

from camviz_school.commands import lessons as command
from camviz_school.course import catalogue, material, pages
from camviz_school.course.catalogue import Lesson
from camviz_school.course.tables import shaped, table_of

ROOT = Path(__file__).parents[1]
ONE = Lesson("05", "05_bent.ipynb", "Bent lines", "Why?", "they bend", "a wall", 40, "wall.svg")


@pytest.fixture(scope="module")
def listed():
    return catalogue.catalogue()


@pytest.mark.parametrize("page", ["README.md", "docs/glossary.md", "lessons/00_start_here.ipynb"])
def test_the_saved_pages_are_fresh(page):
    """Mend with: python -m camviz_school.commands.lessons pages"""
    assert (ROOT / page).read_text(encoding="utf-8") == pages.pages()[ROOT / page]


def test_every_notebook_and_every_numbered_folder_is_a_lesson(listed):
    folders = {path.name for path in material.material().iterdir() if path.name.isdigit()}
    assert {one.number for one in listed} == folders
    assert {one.file for one in listed} == {path.name for path in (ROOT / "lessons").glob("*.ipynb")}


def test_the_order_of_the_lessons_is_that_of_their_numbers(listed):
    order = [one.number for one in listed]
    assert order == sorted(order)


def test_every_lesson_from_01_on_has_a_picture_that_exists_and_says_what_a_reader_takes_along(listed):
    for one in listed[1:]:
        assert (ROOT / one.picture).is_file(), one
        assert one.takeaway
        assert one.real_data
        assert not one.question.startswith("**")


def test_the_gallery_has_three_pictures_a_row_and_the_beginning_last(listed):
    rows = catalogue.gallery(listed).splitlines()[2:]
    assert [row.count(" | ") for row in rows[:-1]] == [2] * (len(rows) - 1)
    assert re.findall(r"Begin with \*\*\[(\d\d) ", "\n".join(rows)) == ["00"]
    page = "\n".join(rows)
    assert page.rindex("Begin with") > page.rindex(listed[-1].file)


def test_a_lesson_without_a_picture_stands_in_the_gallery_by_its_title():
    assert (
        catalogue.gallery([replace(ONE, picture="")]).splitlines()[2]
        == "| **[05 Bent lines](lessons/05_bent.ipynb)** |"
    )


def test_what_a_header_lacks_is_named():
    def header(text):
        return nbformat.v4.new_notebook(cells=[nbformat.v4.new_markdown_cell(text)])

    with pytest.raises(ValueError, match=r"header of 05_bent\.ipynb must say how long"):
        catalogue.described(header("# 05\n**Why?**"), "05_bent.ipynb")
    with pytest.raises(ValueError, match=r"header of 05_bent\.ipynb must ask"):
        catalogue.described(header("# 05\nAbout 5 minutes."), "05_bent.ipynb")
    with pytest.raises(ValueError, match=r"lesson 98 needs a file lesson\.toml in .*98"):
        catalogue.described(header("# 98\n**Why?** About 5 minutes."), "98_bent.ipynb")


def test_a_table_takes_the_place_of_the_one_with_the_same_first_line():
    page = "| a |\n|---|\n| 1 |\n| 2 |\n\n| b |\n|---|\n| 3 |\n"
    assert (
        catalogue.with_table(page, "| b |\n|---|\n| \\1 |") == "| a |\n|---|\n| 1 |\n| 2 |\n\n| b |\n|---|\n| \\1 |\n"
    )
    for twice_or_never in (page + page, "no table"):
        with pytest.raises(ValueError, match=r"expected one table that begins with \| b \|, found [02]"):
            catalogue.with_table(twice_or_never, "| b |\n|---|")


def test_the_command_writes_stale_pages_only_and_says_which(tmp_path, monkeypatch, capsys):
    stale, fresh = tmp_path / "stale.md", tmp_path / "fresh.md"
    stale.write_text("old")
    fresh.write_text("new")
    monkeypatch.setattr(pages, "pages", lambda: {stale: "new", fresh: "new"})
    assert command.main(["pages"]) == 0
    assert capsys.readouterr().out == f"wrote {stale}\n"
    assert stale.read_text() == "new"
    assert command.main(["pages"]) == 0
    assert capsys.readouterr().out == "all pages are fresh\n"


def test_an_installed_package_has_no_pages_to_write(monkeypatch, capsys):
    monkeypatch.setattr(pages, "checkout_lessons", lambda: None)
    assert command.main(["pages"]) == 2
    assert "source checkout" in capsys.readouterr().err


def test_a_table_that_has_another_shape_is_named_with_its_place():
    kinds = {"title": str, "minutes": int}
    assert shaped({"title": "Fold"}, kinds, "here", {"minutes"}) == {"title": "Fold"}
    for table, said in (
        ([], r"here: expected a table, got \[\]"),
        ({"title": "Fold", "minute": 3}, "here: knows title, minutes, got minute"),
        ({"title": "Fold", "minutes": "3"}, "here: minutes must be given as int, got '3'"),
        ({"minutes": 3}, "here: title must be given as str, got None"),
    ):
        with pytest.raises(ValueError, match=said):
            shaped(table, kinds, "here", {"minutes"})
    with pytest.raises(ValueError, match="here is not TOML: "):
        table_of("title =", "here")
