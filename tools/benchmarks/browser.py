"""Slider to changed pixels in a real JupyterLab: three visualizers, their naive equivalents, and the smallest widget.

    python tools/benchmarks/browser.py [--changes 40] [--memory 500] [--renderer wire solid] [--no-later]

Prints Markdown for docs/performance.md. Needs Chromium; leave the machine alone while it runs (about ten minutes).
"""

import argparse
import sys
import tempfile
from pathlib import Path

import nbformat
import numpy as np
import psutil

HERE = Path(__file__).resolve().parent
sys.path.append(str(HERE.parents[1] / "tests" / "browser"))

from laboratory import Notebook, chromium, jupyterlab  # noqa: E402

# The slider that is moved, its range, and its step in the naive version: name, low, high, step.
SLIDERS = {
    "FrustumView": ("hfov_deg", 40.0, 100.0, 1.5),
    "EpipolarView": ("depth", 1.0, 8.0, 0.175),
    "DistortionView": ("k1", -0.4, 0.2, 0.015),
}
# The views of the other lessons, which have no naive version here: module, view, slider, low, high.
LATER = [
    ("depth_of_field", "DepthOfFieldView", "f_number", 1.4, 16.0),
    ("depth_of_field", "DepthOfFieldView", "focus_m", 1.0, 6.0),
    ("fisheye", "FisheyeView", "f", 60.0, 300.0),
    ("fisheye", "FisheyeView", "yaw_deg", -60.0, 60.0),
    ("omnidirectional", "OmnidirectionalView", "xi", 0.0, 1.0),
    ("omnidirectional", "OmnidirectionalView", "yaw_deg", -90.0, 90.0),
    ("ring", "RingView", "stitched_m", 1.0, 20.0),
    ("light_field", "LightFieldView", "slope", -3.0, 3.4),
    ("demosaicing", "DemosaicingView", "spots_px", 0.0, 1.5),
    ("colour", "ColourView", "kelvin", 2000.0, 10000.0),
    ("image_sensor", "ImageSensorView", "exposure_ms", 0.1, 100.0),
    ("readout", "ReadoutView", "time", 0.0, 100.0),
    ("noise", "PhotonTransferView", "exposure", -10.0, 3.0),
    ("vanishing", "VanishingView", "turn_deg", -25.0, 42.0),
    ("vanishing", "VanishingView", "aside", -3.0, 2.0),
    ("staff", "StaffView", "distance_m", 5.0, 40.0),
    ("mosaic", "MosaicView", "turn", 0.0, 30.0),
    ("mosaic", "MosaicView", "step", 0.0, 0.6),
    ("three_views", "ThreeViews", "length", 0.4, 2.6),
    ("three_views", "ThreeViews", "scale", 0.2, 0.8),
]
DRAGS = 3
COLUMNS = ("median ms", "p95 ms", "drag fps", "settled ms")


def notebook(renderer: str) -> nbformat.NotebookNode:
    """The three explorers, then their naive equivalents; the first cell prints the kernel's process."""
    asked = "wire" if renderer == "wire" else ""  # solid is what nobody needs to ask for
    start = f"import os, sys\nos.environ['CAMVIZ_RENDERER'] = {asked!r}\nsys.path.append({str(HERE)!r})\n"
    cells = [start + "from camviz.widgets import explore\nprint(os.getpid())"]
    for view in SLIDERS:
        module = view.removesuffix("View").lower()
        cells.append(f"from camviz.views.{module} import {view}\nexplore({view}())")
    cells.append("from smallest import Smallest\nSmallest()")
    naive = "%matplotlib inline\nimport naive\nfrom ipywidgets import FloatSlider, interact\n"
    for view, (name, low, high, step) in SLIDERS.items():
        slider = f"FloatSlider({low}, min={low}, max={high}, step={step})"
        cells.append(f"{naive}interact(naive.{view.removesuffix('View').lower()}, {name}={slider});")
    return _notebook(cells)


def notebook_of_later_views() -> nbformat.NotebookNode:
    """The smallest widget, then an explorer for each row of LATER, as wireframes."""
    start = f"import os, sys\nos.environ['CAMVIZ_RENDERER'] = 'wire'\nsys.path.append({str(HERE)!r})\n"
    cells = [start + "from camviz.widgets import explore\nfrom smallest import Smallest\nSmallest()"]
    for module, view, *_ in LATER:
        cells.append(f"from camviz_school.views.{module} import {view}\nexplore({view}())")
    return _notebook(cells)


def _notebook(cells: list[str]) -> nbformat.NotebookNode:
    kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3"}}
    return nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(source) for source in cells], metadata=kernel)


def measured(open_notebook: Notebook, root: object, maker: str, changes: int) -> list[float]:
    """One row: median and p95 of single changes; pictures a second and time to settle, the medians of DRAGS drags."""
    page = open_notebook.page
    page.evaluate(f"([root, slider]) => {{ window.one = stopwatch.{maker}(root, slider) }}", root)
    page.evaluate("() => stopwatch.single(one, 5)")  # warm up
    times = page.evaluate("count => stopwatch.single(one, count)", changes)
    drags = [page.evaluate("() => stopwatch.drag(one, 60, 2000)") for _ in range(DRAGS)]
    dragged = [float(np.median([drag[what] for drag in drags])) for what in ("fps", "settle")]
    return [float(np.median(times)), float(np.percentile(times, 95)), *dragged]


def growth(open_notebook: Notebook, root: object, kernel: psutil.Process, changes: int) -> tuple[float, float, float]:
    """Megabytes of the kernel after a warm-up, and what `changes` slider changes add to the kernel and to the page."""
    page, heap = open_notebook.page, "() => performance.memory.usedJSHeapSize / 2 ** 20"
    page.evaluate("([root, slider]) => { window.one = stopwatch.explorer(root, slider) }", root)
    page.evaluate("() => stopwatch.many(one, 50)")
    before, page_before = kernel.memory_info().rss / 2**20, page.evaluate(heap)
    page.evaluate("count => stopwatch.many(one, count)", changes)
    return before, kernel.memory_info().rss / 2**20 - before, page.evaluate(heap) - page_before


def table(rows: list[list[str]], head: list[str]) -> str:
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def report(open_notebook: Notebook, renderer: str, changes: int, memory: int) -> str:
    """The tables of one renderer."""
    cells = _run(open_notebook)
    kernel = psutil.Process(int(cells[0]["outputs"][0]["text"]))
    explorers = open_notebook.page.query_selector_all(".camviz-explorer")
    naives = open_notebook.page.query_selector_all(".widget-interact")
    rows, grown = [], []
    smallest = open_notebook.page.query_selector(".camviz-smallest")
    smallest.scroll_into_view_if_needed()
    floor = measured(open_notebook, [smallest, ["x", 0.0, 100.0]], "explorer", changes)
    rows.append(["the smallest widget", *(f"{value:.0f}" for value in floor), "", ""])
    for (view, slider), explorer, naive in zip(SLIDERS.items(), explorers, naives, strict=True):
        explorer.scroll_into_view_if_needed()
        ours = measured(open_notebook, [explorer, slider], "explorer", changes)
        size, kernel_mb, page_mb = growth(open_notebook, [explorer, slider], kernel, memory)
        naive.scroll_into_view_if_needed()
        theirs = measured(open_notebook, [naive, slider], "naive", changes)
        rows.append(
            [view, *(f"{value:.0f}" for value in ours), f"{theirs[0] / ours[0]:.1f}×", f"{ours[0] / floor[0]:.2f}×"]
        )
        rows.append([f"{view}, naive", *(f"{value:.0f}" for value in theirs), "", ""])
        grown.append([view, f"{size:.0f}", f"{kernel_mb:+.1f}", f"{page_mb:+.1f}"])
    speed = table(rows, [f"{renderer} renderer", *COLUMNS, "faster", "of the smallest"])
    return f"{speed}\n\n" + table(grown, ["memory", "kernel MB", f"after {memory} changes, kernel MB", "page MB"])


def report_later(open_notebook: Notebook, changes: int) -> str:
    """The table of LATER, and the smallest widget's row before it."""
    _run(open_notebook)
    smallest = open_notebook.page.query_selector(".camviz-smallest")
    smallest.scroll_into_view_if_needed()
    floor = measured(open_notebook, [smallest, ["x", 0.0, 100.0]], "explorer", changes)
    rows = [["the smallest widget", "x", *(f"{value:.0f}" for value in floor)]]
    explorers = open_notebook.page.query_selector_all(".camviz-explorer")
    for (_, view, *slider), explorer in zip(LATER, explorers, strict=True):
        explorer.scroll_into_view_if_needed()
        times = measured(open_notebook, [explorer, slider], "explorer", changes)
        rows.append([view, slider[0], *(f"{value:.0f}" for value in times)])
    return table(rows, ["view (wire)", "slider", *COLUMNS])


def _run(open_notebook: Notebook) -> list:
    """The cells after they have run, and JupyterLab at rest, with a stopwatch."""
    cells = open_notebook.run_all()
    failed = [out for cell in cells for out in cell["outputs"] if out["output_type"] == "error"]
    if failed:
        raise RuntimeError(f"{failed[0]['ename']}: {failed[0]['evalue']}")
    open_notebook.page.wait_for_timeout(5000)  # what JupyterLab does after a notebook was opened
    open_notebook.page.add_script_tag(path=HERE / "stopwatch.js")
    return cells


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--changes", type=int, default=40)
    parser.add_argument("--memory", type=int, default=500)
    parser.add_argument("--renderer", nargs="*", default=["wire", "solid"], choices=["wire", "solid"])
    parser.add_argument("--later", action=argparse.BooleanOptionalAction, default=True)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as home:
        folder = Path(home)
        for renderer in given.renderer:
            nbformat.write(notebook(renderer), folder / f"{renderer}.ipynb")
        nbformat.write(notebook_of_later_views(), folder / "later.ipynb")
        with jupyterlab(folder, folder / "private") as address, chromium() as browser:
            for renderer in given.renderer:
                opened = Notebook(browser, address, f"{renderer}.ipynb")
                print(report(opened, renderer, given.changes, given.memory), end="\n\n", flush=True)
                opened.close()
            if given.later:
                print(report_later(Notebook(browser, address, "later.ipynb"), given.changes), flush=True)


if __name__ == "__main__":
    main()
