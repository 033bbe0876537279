"""A guided calibration in a real JupyterLab, with Chromium's fake camera showing a film by a virtual camera."""

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import nbformat
import numpy as np
import pytest
from laboratory import BROWSERS, FLAGS, LATE_MS, Notebook, jupyterlab
from playwright.sync_api import Browser

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
TOLD = """k = widget.calibration.cameras["camera"].intrinsics
print(k.fx, k.fy, len(widget.session.views), len(widget.delays_ms))"""
START = ".camviz-capture .start"
EXECUTE = """async (code) => {
  const future = jupyterapp.shell.currentWidget.sessionContext.session.kernel.requestExecute({ code });
  let out = "";
  future.onIOPub = (message) => { out += message.content.text ?? message.content.evalue ?? ""; };
  await future.done;
  return out;
}"""
SLOW = """import time
from camviz_clinic.live import FrameAnswer
def slowly(gray, time_s):
    time.sleep(1)
    return FrameAnswer(None, False, "slow")
widget.session.look = slowly"""
WATCH = """() => {
  window.most = 0;  // frames under way at once
  const data = document.querySelector('.camviz-capture').dataset;
  setInterval(() => { window.most = Math.max(window.most, data.sent - data.answered); }, 20);
}"""
INSECURE = "() => Object.defineProperty(navigator, 'mediaDevices', { value: undefined, configurable: true })"
EMBEDDED = """() => {
  delete navigator.mediaDevices;
  const policy = { value: { allowsFeature: () => false }, configurable: true };
  for (const name of ["featurePolicy", "permissionsPolicy"]) Object.defineProperty(document, name, policy);
}"""


def refused(name: str) -> str:
    """A script after which the browser answers with an error of that name."""
    error = f"new DOMException('as the test has it', '{name}')"
    return f"() => {{ navigator.mediaDevices.getUserMedia = () => Promise.reject({error}); }}"


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


@contextmanager
def filmed(home: Path, browser: Browser) -> Iterator[Callable[[], Notebook]]:
    """Opens the notebook in a new page of a browser whose camera is a film, and runs it."""
    film = home / "film.y4m"
    write_film(film)
    (home / "work").mkdir()
    book = nbformat.v4.new_notebook(cells=[nbformat.v4.new_code_cell(CELL)], metadata=KERNEL)
    nbformat.write(book, home / "work/capture.ipynb")
    fake = ["--use-fake-device-for-media-stream", f"--use-file-for-fake-video-capture={film}"]
    path = os.environ.get("CAMVIZ_CHROMIUM") or next(filter(None, map(shutil.which, BROWSERS)))
    with jupyterlab(home / "work", home / "private") as address:
        flags = [*FLAGS, *fake, "--use-fake-ui-for-media-stream"]
        other = browser.browser_type.launch(executable_path=path, args=flags)  # beside the one of the other tests

        def anew() -> Notebook:
            notebook = Notebook(other, address, "capture.ipynb")
            notebook.run_all()
            notebook.page.wait_for_selector(START)
            return notebook

        yield anew
        other.close()


@pytest.fixture(scope="module")
def opened(tmp_path_factory, browser):
    with filmed(tmp_path_factory.mktemp("capture"), browser) as anew:
        yield anew


@pytest.fixture
def notebook(opened):
    notebook = opened()
    yield notebook
    assert notebook.errors == []
    notebook.close()


def told(notebook, name: str) -> str:
    return notebook.page.eval_on_selector(".camviz-capture", "(root, name) => root.dataset[name] ?? ''", name)


def wait_until(notebook, condition: str) -> None:
    """Wait for a condition on the page's data `d`."""
    code = f"() => {{ const d = document.querySelector('.camviz-capture').dataset; return {condition}; }}"
    notebook.page.wait_for_function(code, timeout=LATE_MS)


def test_the_camera_is_known_within_half_a_per_cent_and_then_off(notebook):
    page = notebook.page
    assert "to your own kernel" in page.inner_text(".camviz-capture .promise")
    assert notebook.axe() == []
    page.click(START)
    wait_until(notebook, "d.state === 'done'")
    assert page.inner_text(".camviz-capture .sentence").startswith("The goal is reached: fx = 5")
    assert page.eval_on_selector("video", "video => video.srcObject.getTracks().every(t => t.readyState === 'ended')")
    assert page.is_visible(".camviz-capture .frame")  # the last frame stays: a video without its camera is black
    assert page.is_hidden(".camviz-capture video")
    fx, fy, views, delays = map(float, page.evaluate(EXECUTE, TOLD).split())
    assert fx == pytest.approx(TRUTH.intrinsics.fx, rel=0.005)
    assert fy == pytest.approx(TRUTH.intrinsics.fy, rel=0.005)
    assert 6 <= views <= 12
    assert delays == int(told(notebook, "answered")) - 1  # each frame but the last has told its delay


def test_of_a_slow_kernel_nothing_waits_but_one_frame(notebook, thorough):
    """A second for each frame, and yet one frame is under way at a time, and the overlay never grows older."""
    seconds = 60 if thorough else 10
    page = notebook.page
    page.click(START)
    wait_until(notebook, "Number(d.answered) > 5")
    page.evaluate(EXECUTE, SLOW)
    wait_until(notebook, "document.querySelector('.camviz-capture .sentence').textContent === 'slow'")
    page.evaluate(WATCH)
    before = int(told(notebook, "answered"))
    page.wait_for_timeout(1000 * seconds)
    answered = int(told(notebook, "answered")) - before
    assert 2 <= answered <= seconds + 1
    assert page.evaluate("() => window.most") == 1
    ages = page.evaluate(EXECUTE, f"print(*list(widget.delays_ms)[-{answered - 1}:])").split()
    assert min(map(float, ages)) > 1000
    assert float(ages[-1]) < 1000 * seconds / 2  # of a queue the last would be about as old as the test is long
    page.evaluate(EXECUTE, "del widget.session.look")
    wait_until(notebook, f"Number(d.answered) > {before + answered + 12}")
    last = page.evaluate(EXECUTE, "print(*list(widget.delays_ms)[-8:])")
    assert max(map(float, last.split())) < 1000 * seconds / 2  # no frame had to wait for those before it


@pytest.mark.parametrize(
    ("script", "said"),
    [
        (refused("NotFoundError"), "No camera was found. Plug one in"),
        (refused("NotAllowedError"), "The browser was not allowed to use the camera. Click the camera symbol"),
        (refused("NotReadableError"), "The camera is in use by another tab or program. Close it there"),
        (refused("AbortError"), "The camera could not be opened (AbortError: as the test has it)."),
        (INSECURE, "This page has no camera, because browsers give one only to https and to localhost. Open"),
        (EMBEDDED, "This notebook is shown in a frame that is not allowed to use the camera. Open it in JupyterLab"),
    ],
)
def test_each_refusal_is_a_sentence_that_says_what_to_do(still_open, script, said):
    page = still_open.page
    page.evaluate(script)
    page.click(START)
    wait_until(still_open, "d.state === 'refused'")
    assert page.inner_text(".camviz-capture .error").startswith(said)
    assert page.is_enabled(START)


def test_a_camera_that_is_unplugged_is_told(still_open):
    page = still_open.page
    page.evaluate("() => { delete navigator.mediaDevices; delete navigator.mediaDevices?.getUserMedia; }")
    page.evaluate("() => { delete document.featurePolicy; delete document.permissionsPolicy; }")
    page.click(START)
    wait_until(still_open, "d.state === 'live'")
    page.eval_on_selector("video", "video => video.srcObject.getTracks()[0].onended()")
    assert page.inner_text(".camviz-capture .error").startswith("The camera has stopped: it was unplugged")
    assert told(still_open, "state") == "refused"


@pytest.fixture(scope="module")
def still_open(opened):
    """One page for all refusals."""
    notebook = opened()
    yield notebook
    notebook.close()
