"""What a reader writes makes the picture: a wrong function gives a visibly other one (with --all three). Nothing stops.

The lesson is run once with its solutions, and every check accepts them. Then each exercise's function is replaced by a
wrong one, and what depends on it is run again to the lesson's end. Without --all, in lesson 05.
"""

import re
import sys
from dataclasses import dataclass, field
from pathlib import Path

import cv2
import matplotlib
import matplotlib.pyplot as plt
import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "tools/website"))

from mistakes import assigned_in, names_in, value_of

from camviz.draw.picture import Picture
from camviz.widgets.explorer import Explorer
from camviz_school.course import notebooks
from camviz_school.course.exercises import exercises
from camviz_school.course.material import lessons_folder

PATHS = [path for path in sorted(lessons_folder().glob("*.ipynb")) if "attempt(" in path.read_text(encoding="utf-8")]
VISIBLE = 5e-4
"""Of a picture's pixels: as many as one moved marker covers."""

_CURVE = re.compile(
    r'<path d="([^"]*)"[^>]*class="[^"]*orange[^"]*"|<path[^>]*class="[^"]*orange[^"]*"[^>]*\bd="([^"]*)"'
)
_WORDS = re.compile(r'<text[^>]*class="[^"]*orange[^"]*"[^>]*>((?:[^<]|</?tspan)*)</text>')
_PLACE = re.compile(r"-?\d+(?:\.\d+)?")


@dataclass
class Shown:
    """What a cell shows: pictures as pixels (height, width, channels), and the reader's figures in words."""

    pictures: list[np.ndarray] = field(default_factory=list)
    words: list[str] = field(default_factory=list)

    def differs(self, other: "Shown") -> bool:
        return self.words != other.words or any(map(visibly_different, self.pictures, other.pictures))


def visibly_different(one: np.ndarray, other: np.ndarray) -> bool:
    if one.shape != other.shape:
        return True
    return np.mean(np.abs(one.astype(int) - other).max(axis=-1) > 40) > VISIBLE


def run(cell, namespace) -> Shown:
    """Runs a cell, and gathers what it shows."""
    shown, value = Shown(), value_of(cell.source, namespace)
    for number in plt.get_fignums():
        canvas = plt.figure(number).canvas
        canvas.draw()
        shown.pictures.append(np.asarray(canvas.buffer_rgba()).copy())
    plt.close("all")
    if isinstance(value, Explorer):
        add_view(shown, value.view)
    elif isinstance(value, Picture):
        shown.pictures += photographs_of(value)
    return shown


def photographs_of(picture) -> list[np.ndarray]:
    return [cv2.imdecode(np.frombuffer(b, np.uint8), cv2.IMREAD_COLOR) for b in picture.photographs.values()]


def add_view(shown: Shown, view) -> None:
    """The photographs of a view, and what it draws in orange, the reader's own, on a canvas."""
    figure = view.figure()
    shown.pictures += photographs_of(figure)
    canvas = np.zeros((700, 1000, 1), np.uint8)
    for found in _CURVE.finditer(figure.svg()):
        for piece in re.split("[Mm]", found[1] or found[2]):
            places = np.array([float(one) for one in _PLACE.findall(piece)])
            points = places[: len(places) // 2 * 2].reshape(-1, 1, 2)
            cv2.polylines(canvas, [np.clip(points, -2000, 2000).round().astype(np.int32)], False, 255, 2)
    shown.pictures.append(canvas)
    shown.words += _WORDS.findall(figure.svg())


class Lesson:
    """A lesson run with its solutions: the cells, what each shows, and the names before each of them."""

    def __init__(self, path) -> None:
        notebook = notebooks.read(path)
        self.stubs, self.cells, self.shown, self.before = {}, [], [], []
        solutions, namespace = notebooks.solutions(notebook), {"__name__": "__main__", "display": print}
        for cell in notebook.cells:
            tags = set(cell.metadata.get("tags", []))
            if cell.cell_type != "code" or "raises-exception" in tags:
                continue
            if "check" in tags:
                answer = value_of(cell.source, namespace)
                assert answer.correct, (cell.source, answer)
                continue
            name = cell.metadata.get("camviz", {}).get("exercise")
            if name:
                cell.source = solutions[name]
                self.stubs[name] = len(self.cells)
            self.before.append(dict(namespace))
            self.cells.append(cell)
            self.shown.append(run(cell, namespace))
        self.before.append(namespace)

    def with_another(self, name: str, function) -> list[int]:
        """The cells that show something else when the exercise's function is replaced; all run to the end."""
        own, begin = name.split(".")[1], self.stubs[name] + 1
        namespace, tainted, different = {**self.before[begin], own: function}, {own}, []
        for i in range(begin, len(self.cells)):
            cell, after = self.cells[i], self.before[i + 1]
            if tainted & names_in(cell.source) and i not in self.stubs.values():
                if run(cell, namespace).differs(self.shown[i]):
                    different.append(i)
                tainted |= assigned_in(cell.source)
            else:
                namespace |= {key: value for key, value in after.items() if key not in tainted}
        return different


def count_what_shows(path, monkeypatch, wanted: int) -> None:
    monkeypatch.setenv("CAMVIZ_STATIC", "1")
    monkeypatch.setenv("CAMVIZ_RENDERER", "wire")
    monkeypatch.chdir(path.parent)
    matplotlib.use("Agg")
    lesson, seen = Lesson(path), {}
    for name in lesson.stubs:
        own = name.split(".")[1]
        if not any(own in names_in(cell.source) for i, cell in enumerate(lesson.cells) if i > lesson.stubs[name]):
            continue  # this one is checked and not used further
        seen[name] = 0
        for known in exercises(path.stem[:2])[name].misconceptions:
            seen[name] += bool(lesson.with_another(name, known.function))
            if seen[name] == wanted:
                break
    assert len(seen) >= min(2, len(lesson.stubs))  # lesson 00 has one exercise
    assert all(count == wanted for count in seen.values()), seen


# Two classes, so that two workers share the lessons.


@pytest.mark.thorough
class TestEveryOtherLesson:
    @pytest.mark.parametrize("path", PATHS[::2], ids=lambda path: path.stem)
    def test_wrong_functions_make_another_picture(self, path, monkeypatch, thorough):
        count_what_shows(path, monkeypatch, 3 if thorough else 1)


@pytest.mark.by_example
class TestTheLessonsBetween:
    @pytest.mark.parametrize("path", PATHS[1::2], ids=lambda path: path.stem)
    def test_wrong_functions_make_another_picture(self, path, monkeypatch, thorough):
        count_what_shows(path, monkeypatch, 3 if thorough else 1)
