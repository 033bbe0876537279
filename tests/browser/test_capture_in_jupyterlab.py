"""A guided calibration in a real JupyterLab, with Chromium's fake camera showing a film by a virtual camera."""

import shutil
from dataclasses import dataclass
from pathlib import Path

import nbformat
import numpy as np
import pytest
from laboratory import BROWSERS, FLAGS, LATE_MS, Notebook, jupyterlab
from playwright.sync_api import sync_playwright

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz_clinic.calibration import Board
from camviz_clinic.calibration.guidance import candidate_poses, tilt_deg
from camviz_clinic.checks.snapshots import snapshot

pytestmark = pytest.mark.browser

TRUTH = Camera(Intrinsics(640, 480, 560, 561, 325, 236), BrownConrady(-0.12, 0.05))
BOARD = Board(9, 6, 0.025)
KERNEL = {"kernelspec": {"name": "python3", "display_name": "Python 3", "language": "python"}}
CELL = """from camviz_clinic import capture
from camviz_clinic.calibration import Board
widget = capture(Board(9, 6, 0.025))
widget"""
SLOW = """import time
time.sleep(12)"""
TOLD = """k = widget.calibration.cameras["camera"].intrinsics
print(f"{k.fx} {k.fy} {len(widget.session.views)} {len(widget.delays_ms)}")
import numpy as np
print(*np.percentile(list(widget.delays_ms), [50, 95]))"""


def write_film(path: Path, stops: int = 12, frames: int = 6, rate: int = 5) -> None:
    """A board at rest at poses all over the picture, 1.2 s each, as Y4M: not a bit is lost."""
    rng = np.random.default_rng(7)
    poses = candidate_poses(TRUTH, BOARD)
    poses = poses[tilt_deg(poses, BOARD) > 20]
    poses = poses[rng.choice(len(poses), stops, replace=False)]
    with path.open("wb") as file:
        file.write(f"YUV4MPEG2 W640 H480 F{rate}:1 Ip A1:1 C420jpeg\n".encode())
        for pose in poses:
            picture = snapshot(TRUTH, BOARD, pose, rng).tobytes() + b"\x80" * (320 * 240 * 2)  # and no colour
            file.write(frames * (b"FRAME\n" + picture))


@dataclass
class Lab:
    browser: object
    address: str


@pytest.fixture(scope="module")
def lab(tmp_path_factory):
    """A JupyterLab with one notebook, and a browser whose camera is a film."""
    home = tmp_path_factory.mktemp("capture")
    film = home / "film.y4m"
    write_film(film)
    (home / "work").mkdir()
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(CELL)], metadata=KERNEL)
    nbformat.write(book, home / "work/capture.ipynb")
    fake = ["--use-fake-device-for-media-stream", f"--use-file-for-fake-video-capture={film}"]
    path = next(filter(None, map(shutil.which, BROWSERS)))
    with jupyterlab(home / "work", home / "private") as address, sync_playwright() as playwright:
        browser = playwright.chromium.launch(
            executable_path=path, args=[*FLAGS, *fake, "--use-fake-ui-for-media-stream"]
        )
        yield Lab(browser, address)
        browser.close()
