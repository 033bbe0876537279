"""How large the house is: what `explore` loads, lines and docstrings of each package, and what one has to read first.

    python tools/benchmarks/house.py [--page]

Prints a table of what is measured beside its bound; `--page` writes it into docs/house.md. tests/test_architecture.py
holds those rows that must never get worse: the direction of imports, circles, parts and floors, the top level.
"""

from __future__ import annotations

import argparse
import ast
import io
import re
import subprocess
import sys
import tokenize
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from statistics import median

ROOT = next(folder for folder in Path(__file__).resolve().parents if (folder / "pyproject.toml").is_file())
sys.path[:0] = [str(ROOT), str(ROOT / "tests")]

from test_architecture import (  # noqa: E402
    CAME_LATER,
    ELECTIVES,
    LAYERS,
    MODULES,
    STREET,
    VIEWS,
    house,
    imported,
    of_one_lesson,
)

PAGE = ROOT / "docs/house.md"
SECTIONS = re.compile(r"^\s*(Args|Returns|Raises|Source|Attributes|Yields):", re.MULTILINE)
FIRST_READING = (
    *("README.md", "camviz/__init__.py", "camviz/cameras.py", "camviz/lenses/perspective.py", "camviz/lenses/base.py"),
    *(
        "camviz/lenses/brown_conrady.py",
        "camviz/distortion/__init__.py",
        "camviz/twoview/epipolar.py",
        "camviz/views/base.py",
    ),
    "camviz/views/frustum.py",
)
LOADED = """
import sys
from camviz.views.distortion import DistortionView
from camviz.views.epipolar import EpipolarView
from camviz.views.frustum import FrustumView
from camviz.widgets import explore
print(*sorted(one.__file__ for name, one in sys.modules.items() if name.partition('.')[0].startswith('camviz')))
"""
CAME_LATER_IN_WORDS = (
    "rigs, films, hand and eye, rolling shutters, live capture, datasets, several boards, Gyroflow, PhotonVision"
)
Row = tuple[str, str, str]


def lines(paths: Iterable[Path]) -> int:
    return sum(path.read_text(encoding="utf-8").count("\n") for path in paths)


def docstrings_and_code(path: Path) -> tuple[int, int, list[float]]:
    """Lines of docstrings and of code, and for each function whose docstring has sections, docstring over body."""
    text = path.read_text(encoding="utf-8")
    nothing = {tokenize.COMMENT, tokenize.NL, tokenize.NEWLINE, tokenize.INDENT, tokenize.DEDENT, tokenize.ENDMARKER}
    tokens = [one for one in tokenize.generate_tokens(io.StringIO(text).readline) if one.type not in nothing]
    code = {line for one in tokens for line in range(one.start[0], one.end[0] + 1)}
    said: set[int] = set()
    shares = []
    for node in ast.walk(ast.parse(text)):
        if not isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            continue
        if (docstring := ast.get_docstring(node)) is None:
            continue
        first = node.body[0]
        end = first.end_lineno or first.lineno
        said |= set(range(first.lineno, end + 1))
        if SECTIONS.search(docstring) and isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            body = sum(line in code for line in range(end + 1, (node.end_lineno or end) + 1))
            shares.append((end - first.lineno + 1) / max(1, body))
    return len(said), len(code - said), shares


def told_apart(packages: dict[str, list[Path]]) -> list[tuple[str, list[Path], str]]:
    """Whose lines are counted together, the files, their bound: what came after the bounds were set stands alone."""
    camviz, clinic, school = packages.values()
    later = [ROOT / STREET[1] / name for name in CAME_LATER]
    new = [path for path in clinic if any(path.is_relative_to(one) for one in later)]
    electives = [path for path in VIEWS.values() if path.parent.name in ELECTIVES]
    return [
        ("camviz", camviz, "22,000"),
        ("camviz_clinic, what it had", sorted({*clinic} - {*new}), "26,000"),
        (f"camviz_clinic, what came later: {CAME_LATER_IN_WORDS}", new, "on top"),
        ("camviz_school", school, "7,500"),
        ("lessons' own views, 01 to 17", sorted({*VIEWS.values()} - {*electives}), "7,200"),
        (f"lessons' own views, the electives {' and '.join(ELECTIVES)}", electives, "on top"),
    ]


def measured() -> list[Row]:
    """Each row: what, as measured, its bound."""
    done = subprocess.run([sys.executable, "-c", LOADED], cwd=ROOT, capture_output=True, text=True, check=True)
    loaded = [Path(path) for path in done.stdout.split()]
    packages = {name: sorted((ROOT / name).rglob("*.py")) for name in STREET}
    read = {name: [docstrings_and_code(path) for path in paths] for name, paths in packages.items()}
    said = {name: (sum(one[0] for one in each), sum(one[1] for one in each)) for name, each in read.items()}
    shares = [share for each in read.values() for one in each for share in one[2]]
    wrong = [
        (one, other)
        for one in MODULES
        for other in imported(MODULES[one])
        if STREET.index(house(other)) > STREET.index(house(one))
    ]
    classes = Counter(
        node.name
        for path in MODULES.values()
        for node in ast.parse(path.read_text(encoding="utf-8")).body
        if isinstance(node, ast.ClassDef)
    )
    first = {path: path.read_text(encoding="utf-8").partition("\n")[0] for path in MODULES.values()}
    long = [path for path, line in first.items() if lines([path]) > 400 and " because " not in line]
    tracked = subprocess.run(["git", "ls-files"], cwd=ROOT, capture_output=True, text=True, check=True).stdout
    top = {path.partition("/")[0] for path in tracked.splitlines() if not path.startswith(".")}
    documented, code = map(sum, zip(*said.values(), strict=True))
    core = said["camviz"][0] / said["camviz"][1]
    return [
        ("`explore` with the three visualizers loads", f"{len(loaded)} files, {lines(loaded):,} lines", "66, 10,500"),
        *((f"lines of {what}", f"{lines(paths):,}", bound) for what, paths, bound in told_apart(packages)),
        ("arrows between packages the wrong way", str(len(wrong)), "0"),
        ("parts and floors of camviz", f"{sum(map(len, LAYERS['camviz']))}, {len(LAYERS['camviz'])}", "15, 7"),
        ("docstring lines for each line of code: all, camviz", f"{documented / code:.2f}, {core:.2f}", "0.30, 0.55"),
        ("median docstring over body, functions with sections", f"{median(shares):.2f}", "2"),
        ("things at the top level", str(len(top)), "14"),
        ("files over 400 lines without a reason in the first", str(len(long)), "0"),
        ("modules of the packages that one lesson alone uses", str(len(of_one_lesson())), "10"),
        ("class names with two meanings", str(sum(count > 1 for count in classes.values())), "0"),
        ("a newcomer's first reading", f"{lines(ROOT / path for path in FIRST_READING):,} lines", "2,200"),
    ]


def table(rows: list[Row]) -> str:
    head = "| what | measured | at most |\n|---|---|---|\n"
    return head + "".join(f"| {what} | {found} | {bound} |\n" for what, found, bound in rows)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--page", action="store_true", help="write the table into docs/house.md")
    written = table(measured())
    print(written)
    if parser.parse_args().page:
        before, _, after = PAGE.read_text(encoding="utf-8").partition("| what | measured")
        rest = after.partition("\n\n")[2]
        PAGE.write_text(f"{before}{written}\n{rest}".rstrip() + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
