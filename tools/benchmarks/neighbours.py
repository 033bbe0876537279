"""Saved pictures in the programs that people put them into: Inkscape, librsvg, LibreOffice and LaTeX beside Chromium.

    python tools/benchmarks/neighbours.py [NAME ...]

Saves one state of every view as SVG and PDF, and prints for each program that is installed the share of pixels that
are unlike Chromium's (as tests/browser/test_saved_pictures_in_chromium.py counts them), as Markdown. LaTeX takes the
PDF (pdflatex, then pdftoppm), the others the SVG. A quarter of a minute a view.
"""

import json
import shutil
import subprocess
import sys
import tempfile
from base64 import b64encode
from collections.abc import Callable
from math import ceil
from pathlib import Path

import cv2
import numpy as np

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1] / "tests"), str(HERE.parents[1] / "tests" / "browser")]

from every_view import STATES, figure  # noqa: E402
from laboratory import chromium  # noqa: E402
from test_saved_pictures_in_chromium import apart, in_chromium  # noqa: E402

_PAGE = r"""\documentclass{article}\usepackage{graphicx}
\usepackage[paperwidth=%.2fbp,paperheight=%.2fbp,margin=0bp]{geometry}
\pagestyle{empty}\parindent0pt\topskip0pt
\begin{document}\vbox to\textheight{\includegraphics{saved.pdf}\vss}\end{document}"""


def run(folder: Path, *words: str | Path) -> None:
    subprocess.run(list(words), cwd=folder, check=True, capture_output=True, timeout=300)


def inkscape(folder: Path, _width: float, _height: float) -> Path:
    run(folder, "inkscape", "saved.svg", "--export-filename=inkscape.png", "--export-dpi=96")
    return folder / "inkscape.png"


def librsvg(folder: Path, _width: float, _height: float) -> Path:
    run(folder, "rsvg-convert", "saved.svg", "-o", "librsvg.png")
    return folder / "librsvg.png"


def libreoffice(folder: Path, width: float, height: float) -> Path:
    sides = {"PixelWidth": width, "PixelHeight": height}
    size = json.dumps({name: {"type": "long", "value": f"{side:.0f}"} for name, side in sides.items()})
    run(folder, "soffice", "--headless", "--convert-to", f"png:draw_png_Export:{size}", "saved.svg")
    return folder / "saved.png"


def latex(folder: Path, width: float, height: float) -> Path:
    (folder / "page.tex").write_text(_PAGE % (0.75 * width, 0.75 * height))
    run(folder, "pdflatex", "-interaction=batchmode", "page.tex")
    run(folder, "pdftoppm", "-png", "-r", "96", "-singlefile", "page.pdf", "latex")
    return folder / "latex.png"


PROGRAMS: dict[str, tuple[str, Callable[[Path, float, float], Path]]] = {
    "Inkscape": ("inkscape", inkscape),
    "librsvg": ("rsvg-convert", librsvg),
    "LibreOffice": ("soffice", libreoffice),
    "LaTeX (PDF)": ("pdflatex", latex),
}


def matched(data: bytes, like: np.ndarray) -> np.ndarray:
    """A picture of a program without its transparency and of the size of another."""
    image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    if image.ndim == 3 and image.shape[2] == 4:
        alpha = image[..., 3:] / 255
        image = (image[..., :3] * alpha + 255 * (1 - alpha)).astype(np.uint8)
    height, width = like.shape[:2]
    if abs(image.shape[0] - height) > 2 or abs(image.shape[1] - width) > 2:
        return cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    return cv2.copyMakeBorder(image, 0, 2, 0, 2, cv2.BORDER_REPLICATE)[:height, :width]


def main() -> int:
    here = {name: program for name, (command, program) in PROGRAMS.items() if shutil.which(command)}
    print("not installed:", ", ".join(set(PROGRAMS) - set(here)) or "none", end="\n\n")
    print("| view |", " | ".join(here), "|\n|", " | ".join(["---"] * (len(here) + 1)), "|")
    shares: dict[str, list[float]] = {name: [] for name in here}
    with chromium() as browser:
        page = browser.new_page(viewport={"width": 1000, "height": 1000}, color_scheme="light")
        for view in sys.argv[1:] or STATES:
            picture = figure(view)
            page.set_viewport_size({"width": ceil(picture.width), "height": ceil(picture.height)})
            with tempfile.TemporaryDirectory() as name:
                folder = Path(name)
                for suffix in (".svg", ".pdf"):
                    picture.save(folder / f"saved{suffix}")
                data = b64encode((folder / "saved.svg").read_bytes()).decode()
                shown = in_chromium(page, f'<img src="data:image/svg+xml;base64,{data}">', picture)
                for program, convert in here.items():
                    written = convert(folder, picture.width, picture.height).read_bytes()
                    shares[program].append(apart(matched(written, shown), shown))
            print(f"| {view} |", " | ".join(f"{100 * all_[-1]:.1f} %" for all_ in shares.values()), "|", flush=True)
    print("| largest |", " | ".join(f"{100 * max(all_):.1f} %" for all_ in shares.values()), "|")
    return 0


if __name__ == "__main__":
    sys.exit(main())
