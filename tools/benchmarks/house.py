"""How large camviz is: lines of each part beside its bound, and what the three visualizers load.

    python tools/benchmarks/house.py [--page]

`--page` writes the table into docs/house.md. tests/test_architecture.py holds the direction of imports and circles.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs/house.md"
MAX_LINES = {  # of Python, by `wc -l`
    "camviz": 17_500,
    "camviz_clinic": 35_000,
    "camviz_school": 7_500,
    "lessons/material": 20_000,
    "tests": 31_000,
    "tools": 4_000,
}
MAX_BENCHMARK_LINES, MAX_LESSON_TOML_LINES, MAX_LOADED_LINES = 1_500, 6_500, 8_000
VISUALIZERS = """
import sys
from camviz.views.distortion import DistortionView
from camviz.views.epipolar import EpipolarView
from camviz.views.frustum import FrustumView
from camviz.widgets import explore
print(*(one.__file__ for name, one in sys.modules.items() if name.partition('.')[0].startswith('camviz')))
"""
Row = tuple[str, int, int]


def tracked(*patterns: str) -> list[Path]:
    """The files of the repository that match."""
    listed = subprocess.run(["git", "ls-files", *patterns], cwd=ROOT, capture_output=True, text=True, check=True)
    return [ROOT / line for line in listed.stdout.splitlines()]


def lines(paths: list[Path]) -> int:
    return sum(path.read_text(encoding="utf-8").count("\n") for path in paths)


def rows() -> list[Row]:
    """What is measured, its lines, and its bound."""
    parts = [(part, lines(tracked(f"{part}/*.py")), bound) for part, bound in MAX_LINES.items()]
    loaded = subprocess.run([sys.executable, "-c", VISUALIZERS], cwd=ROOT, capture_output=True, text=True, check=True)
    toml = [path for path in tracked("lessons/material/*.toml") if path.name in ("plan.toml", "questions.toml")]
    return [
        *parts,
        ("all of these", sum(count for _, count, _ in parts), sum(MAX_LINES.values())),
        ("tools/benchmarks, of tools", lines(tracked("tools/benchmarks/*.py")), MAX_BENCHMARK_LINES),
        ("`plan.toml` and `questions.toml`", lines(toml), MAX_LESSON_TOML_LINES),
        (
            "`explore` with the three visualizers loads",
            lines([Path(path) for path in loaded.stdout.split()]),
            MAX_LOADED_LINES,
        ),
    ]


def table(measured: list[Row]) -> str:
    head = "| Lines of | measured | at most |\n|---|---|---|\n"
    return head + "".join(f"| {what} | {count:,} | {bound:,} |\n" for what, count, bound in measured)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--page", action="store_true", help="write the table into docs/house.md")
    written = table(rows())
    print(written)
    if parser.parse_args().page:
        before, _, after = PAGE.read_text(encoding="utf-8").partition("| Lines of |")
        _, _, rest = after.partition("\n\n")
        PAGE.write_text(f"{before}{written}\n{rest}", encoding="utf-8")


if __name__ == "__main__":
    main()
