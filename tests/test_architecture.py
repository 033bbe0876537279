"""The house: which part stands on which, and that no import runs back up, deferred ones included."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PACKAGE = ROOT / "camviz"
LAYERS = (
    ("lenses", "poses", "server"),
    ("cameras", "course", "optics"),
    ("distortion", "room", "scenes", "twoview"),
    ("calibration", "colour", "draw", "mosaics", "panoramas"),
    ("files", "lightfields", "samples", "sensors", "teaching"),
    ("clinic",),
    ("views",),
    ("meshes", "plots", "report"),
    ("widgets",),
    ("record",),
    ("commands",),
    ("__main__",),
)
"""The package's folders and loose modules, the lowest first. A part imports from lower layers only."""

WHAT_IS_TRUE = (
    *("calibration", "cameras", "clinic", "colour", "distortion", "files", "lenses", "lightfields", "mosaics"),
    *("optics", "panoramas", "poses", "samples", "scenes", "sensors", "twoview"),
)
"""Parts without drawing: none of them loads one of `HEAVY`."""

HEAVY = ("matplotlib", "ipywidgets", "pyvista", "vtkmodules", "anywidget", "IPython")


def modules() -> dict[str, Path]:
    """Every module of the package by its dotted name."""
    found = {}
    for path in PACKAGE.rglob("*.py"):
        parts = path.relative_to(ROOT).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


MODULES = modules()


def imported(path: Path) -> set[str]:
    """The package's modules that a file imports anywhere: at its top, inside functions, and for its types alone."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute here"
            whole = {f"{node.module}.{alias.name}" for alias in node.names}  # of a package, its modules by name
            names |= whole & MODULES.keys() or {node.module or ""}
    return names & MODULES.keys() - {"camviz"}


GRAPH = {name: imported(path) - {name} for name, path in MODULES.items()}


def part(name: str) -> str:
    """The folder or loose module that a module belongs to; "" for the package itself."""
    return name.split(".")[1] if "." in name else ""


def test_every_part_has_its_layer_and_there_are_few_of_both() -> None:
    parts = {part(name) for name in MODULES} - {""}
    layered = [name for layer in LAYERS for name in layer]
    assert parts == set(layered)
    assert len(layered) <= 29
    assert len(LAYERS) <= 12
    assert sum(not (PACKAGE / name).is_dir() for name in parts) <= 9


def test_no_import_runs_back_up() -> None:
    height = {name: number for number, layer in enumerate(LAYERS) for name in layer}
    arrows = [
        (one, other) for one, others in GRAPH.items() for other in others if part(one) and part(one) != part(other)
    ]
    upward = [f"{one} imports {other}" for one, other in arrows if height[part(other)] >= height[part(one)]]
    assert upward == []


def test_no_files_import_each_other_in_a_circle() -> None:
    """A file that imports none of the others, or that none of them imports, is on no circle: take it away, again."""
    left = dict(GRAPH)
    while free := {name for name, others in left.items() if not others & left.keys() or not _importers(name, left)}:
        left = {name: others for name, others in left.items() if name not in free}
    assert sorted(left) == []


def _importers(name: str, graph: dict[str, set[str]]) -> set[str]:
    return {other for other, others in graph.items() if name in others}


@pytest.mark.parametrize("name", WHAT_IS_TRUE)
def test_what_is_true_needs_nothing_that_draws(name: str) -> None:
    """A fresh interpreter that imports all of a part has loaded no drawing or widget library."""
    wanted = [module for module in MODULES if part(module) == name]
    code = f"import sys, {', '.join(wanted)}; print(*[name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.split()) == (0, []), done.stderr


def test_the_lessons_material_is_read_by_the_course_alone() -> None:
    """No module of the package imports a lesson's own: they are loaded by `camviz_school.course.material`."""
    named = [name for name, path in MODULES.items() if "lessons.material" in path.read_text(encoding="utf-8")]
    assert named == []
