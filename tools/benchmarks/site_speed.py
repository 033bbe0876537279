"""Slider to changed pixels on the built site, the first pane of some lessons, in Chromium and in Firefox.

    python tools/benchmarks/site_speed.py              lessons 01, 05, 06, 15 and 16, as a Markdown table
    python tools/benchmarks/site_speed.py NN …         these lessons

`python start.py site` builds the site before; CAMVIZ_SITE names another folder than build/site. The floor is a page
that changes one word, timed by the same stopwatch in the same run. Leave the machine alone while it runs.
"""

from __future__ import annotations

import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

HERE = Path(__file__).resolve().parent
BROWSER = HERE.parents[1] / "tests/browser"
sys.path[:0] = [str(HERE.parents[1] / "tests"), str(BROWSER)]

from built_site import LESSONS, SITE  # noqa: E402
from file_server import files_served  # noqa: E402
from firefox import firefox  # noqa: E402
from kernel import table  # noqa: E402
from laboratory import chromium, new_page  # noqa: E402

USUAL = ("01", "05", "06", "15", "16")
CHANGES, LOOKED = 41, 3  # moves of a slider, and how often all of them are timed
TOOLS = "\n".join(path.read_text(encoding="utf-8") for path in (BROWSER / "hands.js", HERE / "stopwatch.js"))
FLOOR = """(async () => {
  document.body.innerHTML = '<div data-rendered="0" data-busy="false"><p data-control="x">'
    + '<input type="range" min="0" max="40"></p><b></b></div>';
  window.root = document.querySelector("[data-rendered]");
  root.oninput = (event) => { root.querySelector("b").textContent = root.dataset.rendered = event.target.value; };
})()"""
FIRST = """(async () => {
  for (const pane of document.querySelectorAll(".camviz-recorded")) {
    pane.scrollIntoView({ block: "center" });
    for (let i = 0; i < 8000 && !pane.dataset.live; i++) await hands.pause(25);
    window.root = pane.querySelector(".camviz-explorer");
    await hands.settled(root);
    if (root.querySelector('[data-control] input[type="range"]')) break;
  }
  await hands.pause(1500);  // until its photographs are there
})()"""
TIMED = f"""(async () => {{
  const input = root.querySelector('[data-control] input[type="range"]');
  const name = input.closest("[data-control]").dataset.control;
  const one = stopwatch.explorer(root, [name, Number(input.min), Number(input.max)]);
  return stopwatch.single(one, {CHANGES});
}})()"""
Evaluate = Callable[[str], Any]
Go = Callable[[str], Any]


@contextmanager
def in_chromium() -> Iterator[tuple[Go, Evaluate]]:
    """How to go to a page and how to ask it, in Chromium."""
    with chromium() as browser:
        page = new_page(browser, viewport={"width": 1400, "height": 1000})
        yield page.goto, page.evaluate


@contextmanager
def in_firefox() -> Iterator[tuple[Go, Evaluate]]:
    """The same in Firefox."""
    with tempfile.TemporaryDirectory() as folder, firefox(Path(folder) / "profile", 1400, 1000) as fox:
        yield fox.open, fox.evaluate


def timed(go: Go, evaluate: Evaluate, address: str, prepare: str) -> str:
    """ "7, 12": the median and p95 in milliseconds of a page's slider, each the median of all looks."""
    go(address)
    evaluate(f"(async () => {{ {TOOLS} }})()")
    evaluate(prepare)
    looks = [np.percentile(evaluate(TIMED), [50, 95]) for _ in range(LOOKED)]
    return ", ".join(f"{one:.0f}" for one in np.median(looks, axis=0))


def main(lessons: tuple[str, ...]) -> None:
    """Time, and print the table."""
    names, columns = [name for name in LESSONS if name[:2] in lessons], []
    with files_served(SITE) as address:
        for browser in (in_chromium, in_firefox):
            with browser() as (go, evaluate):
                floor = timed(go, evaluate, f"{address}/index.html", FLOOR)
                pages = [f"{address}/lessons/{name}.html" for name in names]
                columns.append([floor, *(timed(go, evaluate, page, FIRST) for page in pages)])
    head = ["slider to pixels, median and p95 in ms", "Chromium", "Firefox"]
    rows = ["a word on an empty page (the floor)", *(f"lesson {name[:2]}, first pane" for name in names)]
    print(table(head, [list(row) for row in zip(rows, *columns, strict=True)]))


if __name__ == "__main__":
    main(tuple(sys.argv[1:]) or USUAL)
