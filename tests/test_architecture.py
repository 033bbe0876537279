"""The house: which part stands on which, and that no import runs back up, deferred ones included."""

import ast
import subprocess
import sys
from pathlib import Path

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
        ("calibration",),
        ("files",),
        ("checks",),
        ("handeye", "views"),
        ("meshes", "plots", "report"),
        ("commands",),
    ),
    "camviz_school": (
        ("samples", "server"),
        ("course",),
        ("room", "teaching"),
        ("record", "widgets"),
        ("commands",),
    ),
}
"""Each package's folders and loose modules, the lowest first. A part imports from lower layers only."""

WHAT_IS_TRUE = (
    *("cameras", "colour", "distortion", "lenses", "lightfields", "mosaics"),
    *("optics", "panoramas", "poses", "scenes", "sensors", "twoview"),
    *("calibration", "checks", "files", "handeye", "samples"),
)
"""Parts without drawing: none of them loads one of `HEAVY`."""

HEAVY = ("matplotlib", "ipywidgets", "pyvista", "vtkmodules", "anywidget", "IPython")


def modules() -> dict[str, Path]:
    """Every module of the three packages by its dotted name."""
    found = {}
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
    """The modules of the street that a file imports anywhere: at its top, inside functions, for its types alone, and
    by a string that names one, as for `import_module`."""
    names = set()
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            names |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: imports are absolute here"
            whole = {f"{node.module}.{alias.name}" for alias in node.names}  # of a package, its modules by name
            names |= whole & MODULES.keys() or {node.module or ""}
        elif isinstance(node, ast.Constant) and isinstance(node.value, str):
            names.add(node.value.partition(":")[0])
    return names & MODULES.keys() - {"camviz"}


GRAPH = {name: imported(path) - {name, *above(name)} for name, path in MODULES.items()}


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
        for one, others in GRAPH.items()
        for other in others
        if STREET.index(house(other)) > STREET.index(house(one)) and one != "camviz"  # which says where old names are
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
        for one, others in GRAPH.items()
        for other in others
        if part(one) and part(other) and part(one) != part(other)
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
    wanted = [module for module in MODULES if part(module).partition(".")[2] == name]
    code = f"import sys, {', '.join(wanted)}; print(*[name for name in {HEAVY} if name in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout.split()) == (0, []), done.stderr


def test_the_lessons_material_is_read_by_the_course_alone() -> None:
    """No module of the package imports a lesson's own: they are loaded by `camviz_school.course.material`."""
    named = [name for name, path in MODULES.items() if "lessons.material" in path.read_text(encoding="utf-8")]
    assert named == []
