"""The house: which part stands on which, and that no import runs back up, deferred ones included."""

import ast
import json
import subprocess
import sys
from collections import Counter
from collections.abc import Iterable
from functools import cache
from pathlib import Path

import nbformat
import pytest

ROOT = Path(__file__).resolve().parents[1]
STREET = ("camviz", "camviz_clinic", "camviz_school")
"""The three packages. Each imports from itself and from those before it."""

LAYERS = {
    "camviz": (
        ("lenses", "poses"),
        ("cameras", "optics"),
        ("distortion", "scenes", "twoview"),
        ("colour", "draw", "mosaics", "panoramas"),
        ("lightfields", "sensors"),
        ("views",),
        ("widgets",),
    ),
    "camviz_clinic": (
        ("calibration", "measuring"),
        ("files", "rigs"),
        ("checks",),
        ("datasets", "films", "handeye", "views"),
        ("live", "meshes", "plots", "report"),
        ("commands",),
    ),
    "camviz_school": (
        ("samples", "server"),
        ("course",),
        ("room", "teaching", "views"),
        ("record", "widgets"),
        ("commands",),
    ),
}
"""Each package's folders and loose modules, the lowest first. A part imports from lower layers only."""

WHAT_IS_TRUE = (
    *("cameras", "colour", "distortion", "lenses", "lightfields", "mosaics"),
    *("optics", "panoramas", "poses", "scenes", "sensors", "twoview"),
    *("calibration", "checks", "datasets", "files", "films", "handeye", "measuring", "rigs", "samples"),
)
"""Parts without drawing: none of them loads one of `HEAVY`."""

CAME_LATER = (
    *("datasets", "films", "handeye", "live", "rigs"),
    *("calibration/motions.py", "calibration/motions_solving.py"),
    *("calibration/line_delay.py", "calibration/rolling_shutter.py", "calibration/rolling_solving.py"),
    *("calibration/trajectory.py", "calibration/boards/markers.py", "checks/findings/rig.py"),
    *("commands/dataset.py", "commands/films.py", "commands/handeye.py", "commands/poses.py", "commands/rig.py"),
    *("commands/rolling.py", "commands/several.py", "commands/undistort.py"),
    *("files/gyroflow.py", "files/photonvision.py"),
)
"""Folders and files of camviz_clinic for what it could not do when its bound of 26,000 lines was set: rigs, films, hand
and eye, rolling shutters, live capture, posed datasets, several boards, and two programs' formats."""

ELECTIVES = ("18", "19")
"""Lessons that came after the bound on the lessons' own views was set."""

LONGEST = 400  # lines of a file that gives no reason

HEAVY = ("matplotlib", "ipywidgets", "pyvista", "vtkmodules", "anywidget", "IPython")


LESSONS = {path.name[:2]: path for path in sorted((ROOT / "lessons").glob("*.ipynb"))}
BESIDE = sorted((ROOT / "lessons/material").glob("[0-9][0-9]/*.py"))
"""What lies beside a lesson: its exercises, and the modules that a lesson imports from `camviz_school.views`."""

VIEWS = {f"camviz_school.views.{path.stem}": path for path in BESIDE if path.stem != "exercises"}


def modules() -> dict[str, Path]:
    """Every module of the three packages, and every one beside a lesson, by its dotted name."""
    found = dict(VIEWS)
    for path in (path for package in STREET for path in (ROOT / package).rglob("*.py")):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules()


def above(name: str) -> set[str]:
    """The packages that hold a module: it names them to find its own files."""
    parts = name.split(".")
    return {".".join(parts[:end]) for end in range(1, len(parts))}


def imported(path: Path) -> set[str]:
    """The modules of the street that a file imports."""
    return named(path.read_text(encoding="utf-8"))


def named(source: str) -> set[str]:
    """The modules of the street that code imports anywhere: at its top, inside functions, for its types alone, and
    by a string that names one, as for `import_module`."""
    names = set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{ast.unparse(node)}: imports are absolute here"
            whole = {f"{node.module}.{alias.name}" for alias in node.names}  # of a package, its modules by name
            names |= whole & MODULES.keys() or {node.module or ""}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            names.add(node.value.partition(":")[0])
    return names & MODULES.keys() - {"camviz"}


@cache
def graph() -> dict[str, set[str]]:
    """What each module imports of the others. It takes seconds, and every worker of the tests reads this file."""
    return {name: imported(path) - {name, *above(name)} for name, path in MODULES.items()}


@cache
def told(number: str) -> set[str]:
    """The modules that a lesson imports itself, in its notebook or in the files beside it."""
    cells = nbformat.read(LESSONS[number], 4).cells
    lines = [line for cell in cells if cell.cell_type == "code" for line in cell.source.splitlines()]
    notebook = "\n".join(line for line in lines if not line.lstrip().startswith(("%", "!")))
    return named(notebook).union(*(imported(path) for path in BESIDE if path.parent.name == number))


def reached(names: Iterable[str]) -> set[str]:
    """These modules, those that they import, those that these import, and so on."""
    seen, left = set[str](), set(names)
    while left:
        seen |= left
        left = {other for name in left for other in graph()[name]} - seen
    return seen


def of_one_lesson() -> list[str]:
    """The modules of the packages, but for a folder's own `__init__`, that one lesson reaches, and nothing else."""
    used = set().union(*graph().values(), *map(told, LESSONS))
    shared = reached(MODULES.keys() - VIEWS.keys() - used)
    lessons = Counter(name for names in map(told, LESSONS) for name in reached(names))
    alone = [name for name in MODULES if lessons[name] == 1 and name not in shared | VIEWS.keys()]
    return [name for name in alone if MODULES[name].name != "__init__.py"]


def part(name: str) -> str:
    """The folder or loose module that a module belongs to, with its package; "" for the package itself."""
    return ".".join(name.split(".")[:2]) if "." in name else ""


def house(name: str) -> str:
    return name.partition(".")[0]


def test_every_part_has_its_layer_and_there_are_few_of_both() -> None:
    parts = {part(name) for name in MODULES} - {"", "camviz.__main__"}
    layered = [f"{package}.{name}" for package, layers in LAYERS.items() for layer in layers for name in layer]
    assert parts == set(layered)
    assert len(LAYERS["camviz"]) <= 7
    assert sum(name.startswith("camviz.") for name in layered) <= 15
    assert sum(not (ROOT / name.replace(".", "/")).is_dir() for name in parts) <= 7


def test_arrows_between_the_packages_run_one_way() -> None:
    """camviz names neither of the other two, and the clinic not the school: strings that name a module count."""
    wrong = [
        f"{one} names {other}"
        for one, others in graph().items()
        for other in others
        if STREET.index(house(other)) > STREET.index(house(one))
    ]
    assert wrong == []


def test_no_import_runs_back_up() -> None:
    height = {
        f"{package}.{name}": (STREET.index(package), number)
        for package, layers in LAYERS.items()
        for number, layer in enumerate(layers)
        for name in layer
    } | {"camviz.__main__": (9, 9)}
    arrows = [
        (one, other)
        for one, others in graph().items()
        for other in others
        if part(one) and part(other) and part(one) != part(other)
    ]
    upward = [f"{one} imports {other}" for one, other in arrows if height[part(other)] >= height[part(one)]]
    assert upward == []


def test_no_files_import_each_other_in_a_circle() -> None:
    """A file that imports none of the others, or that none of them imports, is on no circle: take it away, again."""
    left = dict(graph())
    while free := {name for name, others in left.items() if not others & left.keys() or not _importers(name, left)}:
        left = {name: others for name, others in left.items() if name not in free}
    assert sorted(left) == []


def _importers(name: str, graph: dict[str, set[str]]) -> set[str]:
    return {other for other, others in graph.items() if name in others}


@cache
def first_loaded_by() -> dict[str, list[str]]:
    """The drawing and widget libraries that each part is the first to load, all parts in one fresh interpreter."""
    modules_of = {name: [one for one in MODULES if part(one).partition(".")[2] == name] for name in WHAT_IS_TRUE}
    code = f"""
import importlib, json, sys
loaded = {{}}
for name, modules in {modules_of}.items():
    for module in modules:
        importlib.import_module(module)
    loaded[name] = [one for one in {HEAVY} if one in sys.modules and one not in sum(loaded.values(), [])]
print(json.dumps(loaded))
"""
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert all(modules_of.values()), "a part without modules"
    found: dict[str, list[str]] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("name", WHAT_IS_TRUE)
def test_what_is_true_needs_nothing_that_draws(name: str) -> None:
    """A part whose modules are all imported has loaded no drawing or widget library. All are in one interpreter: where
    none of them loads one, none does alone."""
    assert first_loaded_by()[name] == []


def test_no_package_imports_what_lies_beside_a_lesson() -> None:
    packages = {name: others for name, others in graph().items() if name not in VIEWS}
    beside = {"camviz_school.views", *VIEWS}
    assert [f"{name} names {other}" for name, others in packages.items() for other in others & beside] == []


def test_what_lies_beside_a_lesson_serves_that_lesson_and_no_other() -> None:
    home = {name: path.parent.name for name, path in VIEWS.items()}
    used = {(name, number) for number in LESSONS for name in reached(told(number)) & VIEWS.keys()}
    assert used == set(home.items())


def test_few_modules_elsewhere_serve_one_lesson_alone() -> None:
    """A module that only a lesson reaches belongs beside that lesson. Those that are left are the nine files of
    camviz.lightfields, which camviz offers for their own sake."""
    assert {part(name) for name in of_one_lesson()} <= {"camviz.lightfields"}
    assert len(of_one_lesson()) <= 10


def test_the_modules_beside_the_lessons_are_short() -> None:
    """Together those of the lessons 01 to 17 have a bound, and those of the electives after them one of their own."""
    lengths = {path: len(path.read_text(encoding="utf-8").splitlines()) for path in VIEWS.values()}
    assert [path for path, lines in lengths.items() if lines > 400] == []
    electives = sum(lines for path, lines in lengths.items() if path.parent.name in ELECTIVES)
    assert sum(lengths.values()) - electives <= 9800
    assert electives <= 1000


def test_what_came_to_the_clinic_later_is_there() -> None:
    assert [name for name in CAME_LATER if not (ROOT / "camviz_clinic" / name).exists()] == []


def test_the_modules_beside_the_lessons_have_names_of_their_own() -> None:
    """All are modules of one package, where of two with the same name only the first would be found."""
    counts = Counter(path.stem for path in BESIDE if path.stem != "exercises")
    assert [name for name, count in counts.items() if count > 1] == []


def test_a_module_is_found_beside_its_lesson_without_server_room_or_quiz() -> None:
    """What is imported to find it costs no more than the course's folder."""
    name, path = next(iter(VIEWS.items()))
    code = f"import sys, camviz_school.views; print(*sys.modules); import {name}; print({name}.__file__)"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded, file = done.stdout.splitlines()
    assert Path(file) == path
    ours = {name for name in loaded.split() if name.startswith("camviz")}
    assert ours == {
        "camviz_school",
        *(f"camviz_school.{one}" for one in ("course", "course.material", "views")),
    }
    assert "numpy" not in loaded.split()


def test_no_class_name_has_two_meanings() -> None:
    """A reader who has met a class knows it wherever its name stands."""
    places: dict[str, list[str]] = {}
    for module, path in MODULES.items():
        for node in ast.parse(path.read_text(encoding="utf-8")).body:
            if isinstance(node, ast.ClassDef):
                places.setdefault(node.name, []).append(module)
    assert {name: where for name, where in places.items() if len(where) > 1} == {}


def test_a_file_is_short_or_its_first_line_says_why_not() -> None:
    """A file of more than 400 lines has its reason, a "because", in its first line."""
    lines = {name: path.read_text(encoding="utf-8").splitlines() for name, path in MODULES.items()}
    long = {name: text[0] for name, text in lines.items() if len(text) > LONGEST}
    assert [name for name, first in long.items() if " because " not in first] == []
