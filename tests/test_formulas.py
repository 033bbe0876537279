"""docs/formulas.md: every deeper formula has its row, and every row a test that is there."""

import re
from pathlib import Path

import pytest

from camviz_school.course import notebooks

ROOT = Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/formulas.md").read_text(encoding="utf-8")
ROWS = re.findall(r"^\| (\d\d) \| (.*) \|$", PAGE, re.MULTILINE)


@pytest.mark.parametrize(("number", "row"), ROWS, ids=lambda one: one[:40])
def test_a_row_names_tests_that_are_in_its_lesson_s_file(number, row):
    paths = [*(ROOT / "tests/lessons").glob(f"test_{number}_*.py"), ROOT / f"tests/lessons/test_claims_{number}.py"]
    source = "".join(path.read_text(encoding="utf-8") for path in paths if path.is_file())
    named = re.findall(r"`(test_\w+)`", row)
    assert named
    assert [one for one in named if f"def {one}(" not in source] == []
    assert all(cell.strip() for cell in row.split(" | "))


@pytest.mark.parametrize("number", [f"{one:02}" for one in range(7, 20)])
def test_a_lesson_has_as_many_rows_as_deeper_sections_with_a_formula(number):
    (path,) = (ROOT / "lessons").glob(f"{number}_*.ipynb")
    with_formula, section = set(), ""
    for cell in notebooks.read(path).cells:
        if cell.cell_type == "markdown":
            section = next(iter(re.findall(r"^### Deeper: (.*)$", cell.source, re.MULTILINE)), section)
            if section and "$$" in cell.source:
                with_formula.add(section)
    assert sum(row[0] == number for row in ROWS) >= len(with_formula)
