"""Panes on a page without a kernel: what they weigh, how long they take to make, and slider to changed pixels.

    python tools/benchmarks/replay.py [--changes 40] [--positions 400] [--no-all] [--no-speed]

Replays three views in Chromium, on a page and in one file each, timed as browser.py times the notebook, and records
one state of every view (tests/every_view.py) with all its controls, two at a time. Prints Markdown for
docs/performance.md. Leave the machine alone while it runs (some ten minutes).
"""

import argparse
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from importlib import import_module
from multiprocessing import get_context
from pathlib import Path

import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1] / "tests"), str(HERE.parents[1] / "tests" / "browser"), str(HERE)]

from browser import COLUMNS, SLIDERS, measured, table  # noqa: E402
from every_view import STATES  # noqa: E402
from file_server import files_served  # noqa: E402
from laboratory import chromium  # noqa: E402
from playwright.sync_api import Browser  # noqa: E402
from smallest import Smallest  # noqa: E402

from camviz.widgets import explore  # noqa: E402
from camviz_school.record import (  # noqa: E402
    Axis,
    Budget,
    BudgetError,
    RecordedPane,
    Widget,
    record,
    write_one_file,
    write_player,
)
from camviz_school.record.packing import transferred  # noqa: E402

LOOKED = 3  # times that each pane is timed; the table has the median
HEAD = '<!doctype html><meta charset="utf-8"><link rel="icon" href="data:,">'
MODULES = (
    HEAD.replace("%", "%%")
    + """<script type="module">
  for (let i = 0; i < %d; i++) {
    const { default: widget } = await import(`./${i}.mjs`);
    const host = document.body.appendChild(document.createElement("div"));
    const el = host.attachShadow({ mode: "open" }).appendChild(document.createElement("div"));
    widget.render({ el });
  }
</script>"""
)


class Opened:
    """A page as `measured` takes it."""

    def __init__(self, page: object) -> None:
        self.page = page


@dataclass(frozen=True)
class Weighed:
    """A recorded view: megabytes, positions, seconds by the clock, and what went wrong."""

    name: str
    mb: float = 0.0
    positions: int = 0
    counts: str = ""
    seconds: float = 0.0
    problem: str = ""


def weighed(name: str, folder: Path, budget: Budget) -> Weighed:
    """A view's default state, recorded."""
    start = time.perf_counter()
    try:
        made = record(explore(STATES[name]()), folder, budget=budget)
    except BudgetError as error:
        return Weighed(name, problem=str(error))
    made.html()
    sliders = [count for count in made.counts.values() if count > 2]
    spread = f"{min(sliders)} to {max(sliders)}" if sliders else "–"
    return Weighed(name, made.size / 1e6, made.positions, spread, time.perf_counter() - start)


def report_of_all(folder: Path, budget: Budget) -> str:
    """The table of every view, and the sums."""
    start = time.perf_counter()
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:  # a fork would share this process's OpenGL
        found = list(pool.map(weighed, STATES, [folder] * len(STATES), [budget] * len(STATES)))
    clock = time.perf_counter() - start
    on_disk = sum(path.stat().st_size for path in folder.iterdir()) / 1e6
    rows = [
        [one.name, f"{one.mb:.2f}", str(one.positions), one.counts, f"{one.seconds:.1f}", one.problem] for one in found
    ]
    mb, positions = sum(one.mb for one in found), sum(one.positions for one in found)
    rows.append([f"all {len(found)}", f"{mb:.1f}", str(positions), "", f"{sum(one.seconds for one in found):.0f}", ""])
    head = ["view", "MB as transferred", "positions", "of a slider or choice", "s", "not recorded because"]
    return f"{table(rows, head)}\n\n{on_disk:.0f} MB in the folder; {clock:.0f} s by the clock in two processes."


def recordings(folder: Path) -> dict[str, tuple[list, RecordedPane]]:
    """The smallest widget and three views: the slider that is moved, and the recorded pane."""
    dot = Widget(Smallest(), (Axis.slider("x", 0.0, 100.0, 0.1, 0.0),), "A dot")
    panes = {"the smallest widget": (["x", 0.0, 100.0], record(dot, folder))}
    for view, (name, low, high, step) in SLIDERS.items():
        module = import_module(f"camviz.views.{view.removesuffix('View').lower()}")
        explorer = explore(getattr(module, view)(), **{name: (low, high, step)})
        panes[view] = [name, low, high], record(explorer, folder)
    return panes


def replayed(browser: Browser, address: str, sliders: list[list], changes: int) -> list[list[float]]:
    """Slider to changed pixels of the panes of a page, in its order."""
    page = browser.new_page(viewport={"width": 1400, "height": 1000})
    page.add_init_script(path=HERE.parents[1] / "tests/browser/hands.js")
    page.goto(address)
    page.add_script_tag(path=HERE / "stopwatch.js")
    panes, rows = page.locator(".camviz-recorded"), []
    panes.nth(len(sliders) - 1).wait_for(state="attached")
    for slider, element in zip(sliders, panes.element_handles(), strict=True):
        element.scroll_into_view_if_needed()
        root = element.wait_for_selector(".camviz-explorer, .camviz-smallest")
        page.wait_for_timeout(1500)  # until its photographs are there
        runs = [measured(Opened(page), [root, slider], "explorer", changes) for _ in range(LOOKED)]
        rows.append([*np.median(runs, axis=0)])
    page.close()
    return rows


def report_of_speed(folder: Path, changes: int) -> str:
    """The table of slider to changed pixels: panes on a page, each as a page of its own, and each as a module."""
    panes = recordings(folder)
    sliders = [slider for slider, _ in panes.values()]
    write_player(folder)
    html = "".join(pane.html() for _, pane in panes.values())
    (folder / "page.html").write_text(f'{HEAD}{html}<script src="replay.js" defer></script>')
    sizes = {"on a page": [pane.size for _, pane in panes.values()]}
    for place, ending in (("a page of its own", "html"), ("a module", "mjs")):
        files = [write_one_file(pane, folder / f"{i}.{ending}") for i, (_, pane) in enumerate(panes.values())]
        sizes[place] = [transferred(path.read_bytes()) for path in files]
    (folder / "modules.html").write_text(MODULES % len(panes))
    with chromium() as browser, files_served(folder) as address:
        times = {
            "on a page": replayed(browser, f"{address}/page.html", sliders, changes),
            "a page of its own": [
                replayed(browser, f"{address}/{i}.html", [slider], changes)[0] for i, slider in enumerate(sliders)
            ],
            "a module": replayed(browser, f"{address}/modules.html", sliders, changes),
        }
    rows = [
        [name, place, f"{sizes[place][i] / 1e3:.0f}", *(f"{value:.0f}" for value in times[place][i])]
        for i, name in enumerate(panes)
        for place in times
    ]
    return table(rows, ["recorded", "where", "kB as transferred", *COLUMNS])


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--changes", type=int, default=40)
    parser.add_argument("--positions", type=int, default=400, help="of a pane at most")
    parser.add_argument("--speed", action=argparse.BooleanOptionalAction, default=True, help="replay three in Chromium")
    parser.add_argument("--all", action=argparse.BooleanOptionalAction, default=True, help="record every view, too")
    given = parser.parse_args()
    if given.speed:
        with tempfile.TemporaryDirectory() as home:
            print(report_of_speed(Path(home), given.changes), end="\n\n", flush=True)
    if given.all:
        with tempfile.TemporaryDirectory() as home:
            print(report_of_all(Path(home), Budget(positions=given.positions)))


if __name__ == "__main__":
    main()
