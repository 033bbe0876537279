"""Ways through the course: what each promises is what its lessons take, and its links lead to them."""

import re
from pathlib import Path

import nbformat
import pytest

from camviz_school.course import catalogue, minutes, paths

ROOT = Path(__file__).parents[1]
LESSONS = catalogue.catalogue()
PATHS = {one.title: one for one in paths.paths(LESSONS)}


def test_twenty_minutes_are_no_more_and_need_no_code():
    path = PATHS["Twenty minutes, no code"]
    assert path.minutes <= 20
    for stop in path.stops:
        cells = paths.part_of(minutes.core(nbformat.read(ROOT / "lessons" / stop.lesson.file, 4)), stop.part)
        assert not minutes.stubs(cells), "nothing is to be written"
        assert any("explore(" in cell.source for cell in cells), "there is something to move"


def test_an_afternoon_has_one_exercise_of_each_of_its_lessons():
    path = PATHS["An afternoon"]
    assert path.minutes <= 240
    for stop in path.stops:
        cells = paths.part_of(minutes.core(nbformat.read(ROOT / "lessons" / stop.lesson.file, 4)), stop.part)
        assert len(minutes.stubs(cells)) == 1, stop.lesson.number
        assert "check" in cells[-1].metadata.tags


def test_the_course_is_every_lesson_but_the_first_page_and_the_electives():
    assert [one.number for one in PATHS["The course"].lessons] == [f"{number:02}" for number in range(1, 17)]
    assert PATHS["The course"].minutes == sum(one.minutes for one in LESSONS if "01" <= one.number <= "16")


def test_the_course_names_the_hours_of_its_deeper_sections():
    course, stated = PATHS["The course"], 0
    for lesson in course.lessons:
        deeper = (ROOT / "lessons" / lesson.file).read_text(encoding="utf-8").split("## Going deeper")[1]
        stated += sum(map(int, re.findall(r'"\*About (\d+) minutes', deeper)))
    assert course.deeper_minutes == pytest.approx(stated, rel=0.02)
    assert f"cores {course.minutes / 60:.0f} hours, deeper sections {stated / 60:.0f} hours |" in paths.table(LESSONS)
    assert PATHS["An afternoon"].deeper_minutes == 0


@pytest.mark.parametrize(("page", "folder"), [("README.md", ""), ("lessons/00_start_here.ipynb", "lessons")])
def test_the_links_of_the_first_pages_lead_to_lessons(page, folder):
    text = (ROOT / page).read_text(encoding="utf-8")
    row = re.search(r"\| For an engineer \|.*", text)[0]
    links = re.findall(r"\[(\d\d)\]\(([^)]+)\)", row)
    assert [number for number, _ in links] == [one.number for one in PATHS["For an engineer"].lessons]
    assert all((ROOT / folder / way).is_file() for _, way in links)


def test_lessons_that_follow_one_another_are_named_by_the_first_and_the_last():
    assert "[01](01_pinhole.html) to [16](16_clinic.html) |" in paths.table(LESSONS, suffix=".html")


def test_a_stop_that_is_no_lesson_is_named(monkeypatch, tmp_path):
    (tmp_path / "paths.toml").write_text('[[path]]\ntitle = "A walk"\nstops = ["05 all"]\n', encoding="utf-8")
    monkeypatch.setattr(paths, "material", tmp_path.joinpath)
    with pytest.raises(ValueError, match=r'paths\.toml: a stop is a lesson, such as "05".*got \'05 all\''):
        paths.paths(LESSONS)
