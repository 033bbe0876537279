"""The lessons' visualizers, recorded: each lesson is run once, and every explorer that a cell shows goes into files.

A page runs nothing that its reader writes, so that a lesson is run with the solutions in the exercises' places, and
panes that draw a reader's function are recorded with usual mistakes, too.
A lesson is recorded again when its code, its material, a file of camviz that it has loaded or one of those that record
it is another one.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import json
import multiprocessing
import os
import re
import sys
import threading
import time
from collections.abc import Iterable
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import previews
from mistakes import MOST, Mistake, drawn_with, mistakes, names_in

from camviz_school.record import Budget
from camviz_school.samples import local_sample

RECORDINGS = "_recordings"
SIZE = 950_000
"""Bytes of a pane, as transferred: of more than a hundred, so that the whole site holds its own budget."""

HOME = "home"
"""The name under which the living picture of the first page is kept, beside the lessons' numbers."""

_HOME_CELL = """
from camviz.views.frustum import FrustumView
from camviz.widgets import explore
explore(FrustumView(panels="world picture"), "yaw_deg", "pitch_deg", "hfov_deg")
"""
RECORDERS = ("panes.py", "mistakes.py", "previews.py")
PACKAGES = ("camviz", "camviz_clinic", "camviz_school")


class CodeCell(NamedTuple):
    """The code of a cell, and what its metadata says.

    `together` are the controls of its visualizer that a reader moves in relation to each other, as
    {"camviz": {"together": ["k1", "k2"]}} names them; `exercise` is the one whose solution the code is, or "".
    """

    source: str
    together: tuple[str, ...] = ()
    exercise: str = ""


def end_with_parent() -> None:
    """End this process as soon as the one that started it is gone, however that was ended."""
    parent = multiprocessing.parent_process()
    if parent:
        threading.Thread(target=lambda: (parent.join(), os._exit(1)), daemon=True).start()


class RecordingError(Exception):
    """Lessons could not be recorded."""


@dataclass(frozen=True)
class Recorder:
    """Records notebooks into `folder`, at most `positions` a pane, and remembers in `cache` what came out."""

    root: Path
    folder: Path
    cache: Path
    positions: int

    def record(self, notebooks: Iterable[Path]) -> None:
        """Record the home page's picture and the panes of the notebooks, where that is not done; on all processors."""
        wanted = {path.name[:2]: code_cells(path) for path in notebooks} | {HOME: {0: CodeCell(_HOME_CELL)}}
        stale = {name: cells for name, cells in wanted.items() if not self._is_fresh(name, cells)}
        if not stale:
            return
        spawn = multiprocessing.get_context("spawn")  # a fresh interpreter each: a lesson leaves nothing to the next
        workers = min(len(stale), os.cpu_count() or 1)
        fresh = {"mp_context": spawn, "max_tasks_per_child": 1, "initializer": end_with_parent}
        with ProcessPoolExecutor(workers, **fresh) as pool:
            jobs = {pool.submit(record_cells, self, name, cells): name for name, cells in stale.items()}
            for job in as_completed(jobs):
                said = job.exception() or job.result()
                print(f"{'not recorded' if job.exception() else 'recorded'} {jobs[job]}: {said}", flush=True)
        if failed := sorted(name for job, name in jobs.items() if job.exception()):
            raise RecordingError(f"not recorded: {', '.join(failed)}; above it says why")

    def panes(self, name: str) -> dict[int, dict[str, Any]]:
        """What is known of the panes of a lesson by the number of their cells: `html` and more; {} before recording."""
        return {int(number): pane for number, pane in self._kept(name).get("panes", {}).items()}

    def forget_others(self, names: Iterable[str]) -> None:
        """Remove the files that no pane of the lessons `names` needs any more."""
        needed = {file for name in names for pane in self.panes(name).values() for file in pane["files"]}
        for path in self.folder.glob("*"):
            if path.name not in needed:
                path.unlink()

    def keep(self, name: str, cells: dict[int, CodeCell], panes: dict[int, dict[str, Any]]) -> None:
        """Remember what was recorded, and the files from which it was made."""
        files = sorted(str(path.relative_to(self.root)) for path in _loaded(self.root, name))
        told = {"made from": files, "fingerprint": self._fingerprint(cells, files), "panes": panes}
        self.cache.mkdir(parents=True, exist_ok=True)
        (self.cache / f"{name}.json").write_text(json.dumps(told), encoding="utf-8")

    def _kept(self, name: str) -> dict[str, Any]:
        path = self.cache / f"{name}.json"
        return dict(json.loads(path.read_text(encoding="utf-8"))) if path.exists() else {}

    def _is_fresh(self, name: str, cells: dict[int, CodeCell]) -> bool:
        kept = self._kept(name)
        preview = previews.path_of(name, self.folder.parent)
        there = preview.exists() and all(
            (self.folder / file).exists() for pane in kept.get("panes", {}).values() for file in pane["files"]
        )
        return bool(kept) and there and kept["fingerprint"] == self._fingerprint(cells, kept["made from"])

    def _fingerprint(self, cells: dict[int, CodeCell], files: list[str]) -> str:
        real = any("chessboard_pictures" in cell.source for cell in cells.values()) and bool(local_sample("left01.jpg"))
        made = hashlib.sha256(json.dumps([cells, self.positions, SIZE, real], sort_keys=True).encode())
        for file in files:
            path = self.root / file
            made.update(file.encode() + (path.read_bytes() if path.exists() else b""))
        return made.hexdigest()


def code_cells(path: Path) -> dict[int, CodeCell]:
    """The code of a notebook by the numbers of its cells, each exercise solved; without what checks it."""
    from camviz_school.course import notebooks

    notebook = notebooks.read(path)
    solutions, cells = notebooks.solutions(notebook), {}
    for number, cell in enumerate(notebook.cells):
        if cell.cell_type == "code" and "check" not in cell.metadata.get("tags", []):
            told = cell.metadata.get("camviz", {})
            name = told.get("exercise", "")
            cells[number] = CodeCell(solutions.get(name, cell.source), tuple(told.get("together", ())), name)
    return cells


def record_cells(recorder: Recorder, name: str, cells: dict[int, CodeCell]) -> str:
    """Run the cells in this process and record each explorer that one shows; a line about what came out."""
    panes: dict[int, dict[str, Any]] = {}
    shown, before = _shown(recorder.root, cells)
    previews.write(shown[0][1].view.figure(), name, recorder.folder.parent)
    base = f"../{RECORDINGS}/" if name != HOME else f"{RECORDINGS}/"
    for number, explorer in shown:
        if not explorer.controls:
            continue  # its still says all
        together = cells[number].together
        made = [_recorded(explorer, together, recorder, Budget(SIZE, recorder.positions))]
        html = made[0].html(base)
        solved = own_in(cells, number)
        if solved:
            wrong = _mistaken(solved, number, cells, before, explorer)
            few = Budget(SIZE, recorder.positions // 4)
            made += [_recorded(one.explorer, together, recorder, few) for one in wrong]
            html = drawn_with(html, [(one, each.html(base)) for one, each in zip(wrong, made[1:], strict=True)])
        panes[number] = {
            "html": html,
            "files": [file for one in made for file in one.files] + re.findall(rf"{RECORDINGS}/(\w+\.svg)", html),
            "positions": sum(one.positions for one in made),
            "size": sum(one.size for one in made),
        }
    recorder.keep(name, cells, panes)
    size, positions = (sum(pane[what] for pane in panes.values()) for what in ("size", "positions"))
    return f"{len(panes)} panes, {positions} positions, {size / 1e6:.1f} MB, {time.process_time():.0f} s of a processor"


def own_in(cells: dict[int, CodeCell], pane: int) -> dict[str, int]:
    """The exercises, with the numbers of their cells, whose functions are named where the visualizer is made."""
    read = names_in(cells[pane].source)
    solved = {cell.exercise: number for number, cell in cells.items() if cell.exercise and number < pane}
    return {exercise: number for exercise, number in solved.items() if exercise.split(".")[1] in read}


def _mistaken(
    solved: dict[str, int], pane: int, cells: dict[int, CodeCell], before: dict[int, dict[str, Any]], explorer: Any
) -> list[Mistake]:
    sources = {number: cell.source for number, cell in cells.items()}
    kept: list[Mistake] = []
    for exercise, stub in solved.items():
        shown = [explorer, *(one.explorer for one in kept)]
        kept += islice(mistakes(exercise, stub, pane, sources, before, shown), MOST)
    return kept


def _recorded(explorer: Any, together: tuple[str, ...], recorder: Recorder, budget: Budget) -> Any:
    from camviz_school.record import record
    from camviz_school.record.panes import Explored

    return record(Explored(explorer, together), recorder.folder, budget=budget)


def _shown(root: Path, cells: dict[int, CodeCell]) -> tuple[list[tuple[int, Any]], dict[int, dict[str, Any]]]:
    """Each explorer that a cell shows, with the cell's number, as IPython shows it; and the names before each cell."""
    os.environ |= {"CAMVIZ_STATIC": "1", "CAMVIZ_RENDERER": "solid", "MPLBACKEND": "Agg"}
    os.chdir(root / "lessons")
    from IPython.core.interactiveshell import InteractiveShell

    from camviz.widgets import Explorer

    shell, shown, before = InteractiveShell.instance(), [], {}
    number = 0
    shell.display_formatter.ipython_display_formatter.for_type(Explorer, lambda one: shown.append((number, one)))
    for number, cell in cells.items():
        printed = io.StringIO()
        before[number] = dict(shell.user_ns)
        with contextlib.redirect_stdout(printed):
            done = shell.run_cell(cell.source, silent=False)
        if not done.success:
            raise RuntimeError(f"cell {number} failed: {printed.getvalue()[-2000:]}")
        if "matplotlib.pyplot" in sys.modules:
            sys.modules["matplotlib.pyplot"].close("all")  # as a notebook does: the next cell begins its own figure
    return shown, before


def _loaded(root: Path, name: str) -> set[Path]:
    """The files on which what this process has drawn depends: modules, the package's data, the lesson's material."""
    modules = {Path(module.__file__) for module in list(sys.modules.values()) if getattr(module, "__file__", None)}
    packages = [root / name for name in PACKAGES]
    files = [path for package in packages for path in package.rglob("*") if path.is_file()]
    data = {path for path in files if path.suffix not in (".py", ".pyc")}
    material = {path for path in (root / "lessons/material" / name).glob("*") if path.is_file()}
    loaded = {path for path in modules if any(map(path.is_relative_to, packages))}
    return loaded | data | material | {root / "tools/website" / name for name in RECORDERS}
