"""Build the site: every lesson, its visualizers recorded, and all documentation, as static files in build/site.

    python start.py site                whole
    python start.py site 05 07          those lessons anew, with what is there of the rest
    python start.py site --stills       with no visualizer recorded: quick, for the words

Open build/site/index.html. The site asks no other host for anything.
"""

from __future__ import annotations

import argparse
import shutil
import sys
import time
from pathlib import Path

import engineers
import panes
import slim_styles
from api_pages import api_pages
from course_pages import course_pages
from lesson_page import PICTURES, LessonPage
from links import on_site
from scripts import question_script, style_sheet

from camviz_school.course.material import lesson_paths
from camviz_school.course.notebooks import Notebook, read, text_of
from camviz_school.record import write_player
from camviz_school.samples import chessboard_pictures

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
BUILT, SOURCE, CACHE = ROOT / "build/site", ROOT / "build/site-source", ROOT / "build/site-cache"
DOCUMENTS = ("docs/*.md", "docs/engineers/*.md", "lessons/conventions.md")
MOST = 300_000_000  # bytes of the whole site
SIGNPOSTS = (ROOT / "docs/conventions.md",)  # pages that only say where another page is


def main(words: list[str]) -> int:
    """Builds the site; the exit status."""
    options = _options(words)
    start = time.monotonic()
    recorder = panes.Recorder(ROOT, BUILT / panes.RECORDINGS, CACHE, options.positions)
    if not options.stills:
        chosen = [path for path in lesson_paths() if not options.lessons or path.name[:2] in options.lessons]
        recorder.record(chosen)
        recorder.forget_others([*(path.name[:2] for path in lesson_paths()), panes.HOME])
    lay_out(recorder)
    engineers.write_reports(ROOT, BUILT)
    status = sphinx()
    slim_styles.slim(BUILT)
    size = sum(path.stat().st_size for path in BUILT.rglob("*") if path.is_file())
    print(f"{BUILT / 'index.html'}: {size / 1e6:.0f} MB, made in {time.monotonic() - start:.0f} s.")
    if not (photographs := chessboard_pictures(count=1)).real:
        print(f"Some panes of lessons 06, 07, 08 and 12 show other pictures than their text. {photographs.sentence}")
    if size > MOST:
        print(f"The site must not be larger than {MOST / 1e6:.0f} MB: record fewer (--positions).")
    return status or int(size > MOST)


def _options(words: list[str]) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="start.py site", description=__doc__.splitlines()[0])
    parser.add_argument("lessons", metavar="LESSON", nargs="*", help="its number, such as 05; all by default")
    parser.add_argument("--positions", type=int, default=200, help="recorded of one visualizer at most (default: 200)")
    parser.add_argument("--stills", action="store_true", help="record nothing: each visualizer shows its still")
    options = parser.parse_args(words)
    known = [path.name[:2] for path in lesson_paths()]
    if unknown := sorted(set(options.lessons) - set(known)):
        parser.error(f"there is no lesson {', '.join(unknown)}; there are {', '.join(known)}")
    return options


def lay_out(recorder: panes.Recorder) -> None:
    """Puts all sources of pages into SOURCE, where Sphinx reads them, and pictures into BUILT.

    Files that stay the same are not touched, so that Sphinx reads anew only what has changed.
    """
    documents = [path for pattern in DOCUMENTS for path in sorted(ROOT.glob(pattern)) if path not in SIGNPOSTS]
    notebooks = lesson_paths()
    pages = frozenset(path.relative_to(ROOT).as_posix() for path in [*documents, *notebooks])
    moving = {name: recorder.panes(name) for name in [*(path.name[:2] for path in notebooks), panes.HOME]}
    made = {SOURCE / name: text for name, text in {**course_pages(BUILT / PICTURES), **api_pages()}.items()}
    for path in documents:
        way = path.relative_to(ROOT).as_posix()
        text = engineers.with_pictures(path.read_text(encoding="utf-8"))
        made[SOURCE / way] = on_site(text, way, pages, ROOT)
    made[SOURCE / f"{engineers.front(ROOT)}.md"] += engineers.contents(ROOT)
    for path in notebooks:
        live = {number: pane["html"] for number, pane in moving[path.name[:2]].items()}
        made[SOURCE / "lessons" / path.name] = text_of(LessonPage(path, ROOT, BUILT, pages, live).notebook())
        _write(BUILT / "lessons" / path.name, text_of(without_outputs(path)))
    for path in (ROOT / "docs/images").glob("*.svg"):
        _copy(path, BUILT / "docs/images" / path.name)
    home = "".join(pane["html"] for pane in moving[panes.HOME].values())
    home = home.replace(
        'loading="lazy"', 'fetchpriority="high"', 1
    )  # its first tile is the largest thing on the first screen
    for path in (HERE / "pages").rglob("*.md"):
        text = path.read_text(encoding="utf-8").replace("<!--living picture-->", home)
        text = text.replace("{engineers}", engineers.front(ROOT))
        made[SOURCE / path.relative_to(HERE / "pages")] = text
    made[SOURCE / "_static/camviz.css"] = style_sheet() + "".join(
        (HERE / "static" / name).read_text(encoding="utf-8") for name in ("camviz.css", "icons.css")
    )
    made[SOURCE / "_static/camviz.js"] = question_script() + (HERE / "static/camviz.js").read_text(encoding="utf-8")
    for path, text in made.items():
        _write(path, text)
    images = [path for folder in ("lessons/images", "docs/images") for path in (ROOT / folder).glob("*.*")]
    copied = [_copy(path, SOURCE / path.relative_to(ROOT)) for path in images]
    _forget_all_but([*made, *copied, write_player(SOURCE / "_static")])


def without_outputs(path: Path) -> Notebook:
    """The notebook as a reader downloads it, to run it: its pictures, which the page has, would be most of the site."""
    notebook = read(path)
    for cell in notebook.cells:
        if cell.cell_type == "code":
            cell.outputs, cell.execution_count = [], None
    return notebook


def sphinx() -> int:
    """Sphinx's pages of what was laid out; its exit status."""
    from sphinx.cmd.build import build_main

    words = [
        "-b",
        "html",
        "-c",
        str(HERE),
        "-d",
        str(ROOT / "build/site-doctrees"),
        "-j",
        "2",
        "-q",
        "-W",
        "--keep-going",
    ]
    return int(build_main([*words, str(SOURCE), str(BUILT)]))


def _write(path: Path, text: str) -> None:
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")


def _copy(path: Path, to: Path) -> Path:
    if not to.exists() or to.read_bytes() != path.read_bytes():
        to.parent.mkdir(parents=True, exist_ok=True)
        shutil.copyfile(path, to)
    return to


def _forget_all_but(made: list[Path]) -> None:
    """Removes what an earlier run laid out and this one did not; Sphinx's own summaries of the API stay."""
    kept = set(made)
    for path in SOURCE.rglob("*"):
        if path.is_file() and path not in kept and "generated" not in path.parts:
            path.unlink()


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
