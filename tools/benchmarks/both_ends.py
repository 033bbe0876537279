"""Every view with every control at either end, on screens from a telephone to a projector, light and dark, in Chromium.

    python tools/benchmarks/both_ends.py [NAME ...] [--width 375 800 1440 2560] [--sheets FOLDER]

Prints each word that is below 12 CSS pixels, cut off, over another, or of too little contrast: in the first state, with
all controls low and high, and on the screens of `--all` with each control alone at its ends. `--sheets` writes one
picture per view and width, so that a person can look: those three states, light above dark.
"""

import argparse
import sys
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from typing import Any

from PIL import Image
from playwright.sync_api import Page

HERE = Path(__file__).resolve().parent
sys.path += [str(HERE.parents[1] / "tests"), str(HERE.parents[1] / "tests" / "browser")]

from every_view import STATES  # noqa: E402
from laboratory import chromium  # noqa: E402

from camviz.draw.picture import Picture, page_style  # noqa: E402
from camviz.views.base import Control, View  # noqa: E402

HANDS = (HERE.parents[1] / "tests/browser/hands.js").read_text(encoding="utf-8")
# What explorer.js tells the kernel of each tile, by which words make room for each other.
UNITS = """() => {
  const shown = [...document.querySelectorAll(".camviz-fitted")].filter((svg) => svg.clientWidth);
  const unit = (svg) => Math.min(20, Math.max(1, svg.viewBox.baseVal.width / svg.clientWidth));
  return Object.fromEntries(shown.map((svg) => [svg.parentElement.dataset.tile, unit(svg)]));
}"""
SHOW = """async (html) => {
  document.querySelector(".camviz-picture").innerHTML = html;
  await Promise.all([...document.images].map((one) => one.decode()));
}"""
PAGE = (
    '<!doctype html><style>{}</style><body style="margin:0;font-family:sans-serif;color-scheme:light dark">'
    '<div class="camviz-explorer"><div class="camviz-picture">'
)


def ends(control: Control) -> tuple[Any, ...]:
    """Each choice of a control, or the ends of its range."""
    return control.choices or ((False, True) if control.low is None else (control.low, control.high))


def states(view: View) -> dict[str, View]:
    """The first state, all controls low, all controls high, and each control alone at each of its ends."""
    controls = view.offered()
    made = {"first": view}
    for name, end in (("all low", 0), ("all high", -1)):
        made[name] = changed(view, {field: ends(control)[end] for field, control in controls.items()})
    for field, control in controls.items():
        made |= {f"{field} = {value}": changed(view, {field: value}) for value in ends(control)}
    return made


def changed(view: View, values: dict[str, Any]) -> View:
    """The view with these values, without those that it refuses beside the others."""
    for field, value in values.items():
        try:
            view = view.but(**{field: value})
        except ValueError as refused:
            print(f"    {type(view).__name__} refuses {field} = {value}: {refused}")
    return view


def pictures(name: str) -> Iterator[tuple[str, Picture]]:
    """Every state of a view, drawn; one that cannot be drawn is named."""
    for state, view in states(STATES[name]()).items():
        try:
            yield state, view.figure()
        except ValueError as refused:
            print(f"    {name} cannot draw {state}: {refused}")


def show(page: Page, picture: Picture) -> None:
    """The picture in the page, its words with the room they need at the sizes that its tiles have there."""
    page.evaluate(SHOW, picture.embedded())
    units = page.evaluate(UNITS)
    if max(units.values(), default=1) > 1.04:
        page.evaluate(SHOW, picture._with_photographs(picture.flow(units)))


def sheet(page: Page, pictures: list[Picture], path: Path) -> None:
    """One picture of these states, light above dark."""
    rows = []
    for scheme in ("light", "dark"):
        page.emulate_media(color_scheme=scheme)
        shots = []
        for picture in pictures:
            show(page, picture)
            shots.append(Image.open(BytesIO(page.locator(".camviz-picture").screenshot())))
        rows.append(shots)
    across = max(sum(shot.width + 12 for shot in shots) for shots in rows)
    down = [max(shot.height for shot in shots) + 12 for shots in rows]
    whole = Image.new("RGB", (across, sum(down)), "#808080")
    for number, shots in enumerate(rows):
        x = 0
        for shot in shots:
            whole.paste(shot, (x, sum(down[:number])))
            x += shot.width + 12
    whole.save(path)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "views", nargs="*", help="names of views, as tests/every_view.py has them; all when none is given"
    )
    parser.add_argument("--width", nargs="*", type=int, default=[375, 800, 1440, 2560])
    parser.add_argument("--all", nargs="*", type=int, default=[375, 1440], help="widths at which all states are shown")
    parser.add_argument("--sheets", type=Path)
    given = parser.parse_args()
    total = shown = 0
    with chromium() as browser:
        page = browser.new_page()
        page.set_content(PAGE.format(page_style()))
        page.evaluate(HANDS)
        for name in given.views or STATES:
            drawn = dict(pictures(name))
            for width in given.width:
                page.set_viewport_size({"width": width, "height": 900})
                found, seen_here = [], list(drawn)[: None if width in given.all else 3]
                for state in seen_here:
                    show(page, drawn[state])
                    root = page.query_selector(".camviz-explorer")
                    seen = root.evaluate("root => hands.unreadable(root)")
                    if width in given.all[-1:]:
                        seen += root.evaluate("root => hands.weakInPicture(root)")
                    found += [f"{state}: {one}" for one in seen]
                shown += len(seen_here)
                total += len(found)
                print(f"{name}, {width} px, {len(seen_here)} states: {len(found)}", *found, sep="\n    ", flush=True)
                if given.sheets:
                    given.sheets.mkdir(parents=True, exist_ok=True)
                    sheet(page, list(drawn.values())[:3], given.sheets / f"{name.replace(' ', '-')}-{width}.png")
                    page.emulate_media(color_scheme="light")
    print(f"{shown} pictures, {total} findings")
    return int(total > 0)


if __name__ == "__main__":
    sys.exit(main())
