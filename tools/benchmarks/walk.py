"""A walk through a lesson's core in a real JupyterLab and Chromium, as a student who types everything, beside the rule.

    python tools/benchmarks/walk.py 05
    python tools/benchmarks/walk.py 01 --copy    # every solution is opened, read and copied

Prints Markdown for docs/teaching.md. The walk is a program's: it types each key, drags each slider and answers each
question in the page. What there is to read, type and move is counted there, and how long the page and the kernel let
one wait is measured. How fast a person is stands in two paces below, a quick and a slow one; neither is a constant of
the rule (`camviz_school.course.minutes`), and nobody was timed.
"""

import argparse
import re
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import nbformat
from playwright.sync_api import Locator

HERE = Path(__file__).resolve().parent
sys.path.append(str(HERE.parents[1] / "tests" / "browser"))

from laboratory import ROOT, Notebook, chromium, jupyterlab  # noqa: E402

from camviz_school.course import minutes  # noqa: E402
from camviz_school.course.notebooks import solution_code  # noqa: E402


@dataclass(frozen=True)
class Paces:
    """How many a minute a person takes of what the walk counts, or how long one of them takes."""

    words: float  # a minute; Brysbaert 2019 has a mean of 238 for English, 18 to 20 % less in a second language
    symbols: float  # a minute, of code and formulas: a name, a number or a sign
    keys: float  # a minute, of code; Dhakal 2018 has a mean of 260 for sentences that are copied
    controls: float  # seconds for one from end to end and back
    questions: float  # seconds before an answer is chosen
    exercises: float  # seconds before the first key
    mistakes: float  # seconds after a checker's reply, before the slip is found

    def minutes(self, count: Counter[str]) -> dict[str, float]:
        """Minutes of each thing counted."""
        rates = {"words": self.words, "symbols": self.symbols, "keys": self.keys}
        lasting = {name: getattr(self, name) / 60 for name in ("controls", "questions", "exercises", "mistakes")}
        taken = {name: count[name] / rate for name, rate in rates.items()}
        return taken | {name: count[name] * each for name, each in lasting.items()}


QUICK = Paces(words=240, symbols=120, keys=250, controls=8, questions=10, exercises=60, mistakes=15)
SLOW = Paces(words=150, symbols=60, keys=100, controls=20, questions=30, exercises=240, mistakes=60)

_SYMBOL = re.compile(r"\\?\w+|[^\s\w]")
_FORMULA = re.compile(r"\$\$.*?\$\$|\$[^$\n]+\$", re.DOTALL)
SLIPS = [
    (" + ", " - "),
    (" - ", " + "),
    (" * ", " / "),
    (" / ", " * "),
    (" < ", " > "),
    ("return -", "return "),
    (" % ", " // "),
    (".T", ""),
    ("axis=0", "axis=1"),
    ("axis=-1", "axis=0"),
    ("cam_from_world @ world_from_board", "world_from_board @ cam_from_world"),
    ("v::", "u::"),
]
RUN = """async (index) => {
  const panel = jupyterapp.shell.currentWidget;
  await panel.context.ready;
  await panel.sessionContext.ready;
  panel.content.deselectAll();
  panel.content.activeCellIndex = index;
  await panel.content.scrollToItem(index);
  await jupyterapp.commands.execute("notebook:run-cell");
  while (panel.sessionContext.session.kernel.status !== "idle") await hands.pause(20);
}"""
ROOM = """async (index) => {
  const { content } = jupyterapp.shell.currentWidget;
  content.activeCellIndex = index;
  await content.scrollToItem(index);
  await content.widgets[index].ready;
  content.widgets[index].node.dataset.walked = index;
}"""
WRITE = """async (index) => {
  const { content } = jupyterapp.shell.currentWidget;
  content.activeCellIndex = index;
  await jupyterapp.commands.execute("notebook:enter-edit-mode");
}"""
SOURCE = "(index) => jupyterapp.shell.currentWidget.content.widgets[index].model.sharedModel.getSource()"
ANSWERED = """form => (({ hidden, textContent }) => hidden || textContent !== "Commit to this answer")(
  form.querySelector("button.camviz-commit"))"""
VISIBLE = """root => [...root.querySelectorAll("[data-control]")].filter((one) => one.offsetParent)
  .map((one) => one.dataset.control)"""


class Student:
    """Goes through the cells in their order, counts what a person would read, type and move, and times the waits."""

    def __init__(self, notebook: Notebook, copies: bool) -> None:
        self.notebook, self.page, self.copies = notebook, notebook.page, copies
        self.count: Counter[str] = Counter()
        self.waited_s = 0.0

    def go(self, cells: list[Any]) -> None:
        for index, cell in enumerate(cells):
            tags = set(cell.metadata.get("tags", []))
            if cell.cell_type == "markdown":
                if not {"solution", "about"} & tags and "Further reading" not in cell.source.split("\n")[0]:
                    self._read(self._place(index).inner_text())
                    self._read_symbols(" ".join(_FORMULA.findall(cell.source)))
            elif "stub" in tags:
                self._exercise(index, cells)
            elif "check" not in tags:
                if not {"setup", "colab"} & tags and not cell.source.startswith(("ask(", "quiz(")):
                    self._read_symbols(cell.source)
                self._run(index)
                self._read_printed(index)
                self._answer(index)
                self._move(index)

    def _read(self, text: str) -> None:
        self.count["words"] += len(text.split())

    def _read_symbols(self, source: str) -> None:
        self.count["symbols"] += len(_SYMBOL.findall(source))

    def _place(self, index: int) -> Locator:
        self.page.evaluate(ROOM, index)
        return self.page.locator(f"[data-walked='{index}']")

    def _run(self, index: int) -> None:
        begun = time.monotonic()
        self.page.evaluate(RUN, index)
        for one in self._place(index).locator(".camviz-explorer").element_handles():
            one.evaluate("root => hands.settled(root)")
        self.waited_s += time.monotonic() - begun

    def _read_printed(self, index: int) -> None:
        printed = self._place(index).locator(".jp-OutputArea-output pre").all_inner_texts()
        self._read(" ".join(printed))

    def _answer(self, index: int) -> None:
        """Choose the first answer of each question, whatever it is, and read the reply."""
        for form in self._place(index).locator(".camviz-question form").all():
            self._read(form.inner_text())
            self.count["questions"] += 1
            before = form.inner_text()
            form.locator("input[type=radio]").first.check()
            form.get_by_role("button").first.click()
            begun = time.monotonic()
            self.page.wait_for_function(ANSWERED, arg=form.element_handle())
            self.waited_s += time.monotonic() - begun
            self._read(form.inner_text().replace(before, ""))

    def _move(self, index: int) -> None:
        """Every control in sight of each view from end to end."""
        for root in self._place(index).locator(".camviz-explorer").element_handles():
            for name in root.evaluate(VISIBLE):
                slider = root.evaluate(
                    "(root, name) => root.querySelector(`[data-control='${name}'] input[type=range]`) !== null", name
                )
                for place in (0, 1, 0.5) if slider else (1, 0):
                    root.evaluate("(root, [name, place]) => hands.move(root, name, place)", [name, place])
                    root.evaluate("root => hands.settled(root)")
                self.count["controls"] += 1

    def _exercise(self, index: int, cells: list[Any]) -> None:
        """Write a function with a slip, read what the checker says, mend it; or copy the solution."""
        follows = range(index + 1, len(cells))
        solution = next(i for i in follows if "solution" in cells[i].metadata.get("tags", []))
        check = next(i for i in follows if "check" in cells[i].metadata.get("tags", []))
        right, stub = solution_code(cells[solution]), cells[index].source
        self._read_symbols(stub)
        if self.copies:
            self._read_symbols(right)
            self._write(index, right)
        else:
            wrong = slip(right)
            self.count["exercises"] += 1
            self.count["keys"] += sum(map(len, body(wrong, stub)))
            self._write(index, wrong)
            self._run(index)
            self._run(check)
            said = self._place(check).locator(".jp-OutputArea").inner_text()
            if "✓" in said:
                raise AssertionError(f"the checker took {wrong!r}")
            self._read(said)
            self.count["mistakes"] += 1
            self.count["keys"] += 2  # over the wrong sign
            self._write(index, right)
        self._run(index)
        self._run(check)
        said = self._place(check).locator(".jp-OutputArea").inner_text()
        if "✓" not in said:
            raise AssertionError(f"the checker refused the solution: {said}")
        self._read(said)

    def _write(self, index: int, source: str) -> None:
        """Key by key; what JupyterLab indents by itself is typed over."""
        self._place(index)
        self.page.evaluate(WRITE, index)
        self.page.keyboard.press("Control+A")
        for number, line in enumerate(source.splitlines()):
            if number:
                self.page.keyboard.press("Enter")
                self.page.keyboard.press("Shift+Home")
            self.page.keyboard.type(line)
            self.page.keyboard.press("Escape")  # a list of completions, where one has opened
            self.page.evaluate(WRITE, index)
        if (there := self.page.evaluate(SOURCE, index)) != source:
            raise AssertionError(f"typed {source!r}, and the cell has {there!r}")


def slip(solution: str) -> str:
    """The solution with one thing wrong in the last line that has one of SLIPS: a sign, an axis, an order."""
    lines = solution.splitlines()
    for number in reversed(range(len(lines))):
        for right, wrong in SLIPS:
            if right in lines[number]:
                lines[number] = wrong.join(lines[number].rsplit(right, 1))
                return "\n".join(lines)
    raise ValueError(f"expected a sign to get wrong, in {solution!r}")


def body(source: str, stub: str) -> list[str]:
    """The lines that the stub does not have."""
    return [line.strip() for line in source.splitlines() if line not in stub.splitlines()]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lesson", metavar="NN")
    parser.add_argument("--copy", action="store_true")
    given = parser.parse_args()
    (path,) = (ROOT / "lessons").glob(f"{given.lesson}_*.ipynb")
    cells = minutes.core(nbformat.read(path, as_version=4))
    with tempfile.TemporaryDirectory() as made, chromium() as browser:
        folder = Path(made)
        (folder / "lab").mkdir()
        (folder / "lab" / path.name).write_bytes(path.read_bytes())
        with jupyterlab(folder / "lab", folder / "private") as address:
            notebook = Notebook(browser, address, path.name, viewport={"width": 1366, "height": 768})
            student = Student(notebook, given.copy)
            student.go(cells)
            notebook.close()
    if notebook.errors:
        raise AssertionError(notebook.errors)
    quick, slow = (pace.minutes(student.count) for pace in (QUICK, SLOW))
    waited = student.waited_s / 60
    print("| what | how many | quick, minutes | slow, minutes |\n|---|---|---|---|")
    for name in quick:
        print(f"| {name} | {student.count[name]} | {quick[name]:.1f} | {slow[name]:.1f} |")
    print(f"| waiting, measured | | {waited:.1f} | {waited:.1f} |")
    print(f"| **all** | | **{sum(quick.values()) + waited:.0f}** | **{sum(slow.values()) + waited:.0f}** |")
    print(f"\nThe rule: {minutes.reckoned(cells):.1f}, said as {minutes.said(minutes.reckoned(cells))} minutes.")


if __name__ == "__main__":
    main()
