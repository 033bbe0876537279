"""The processes that look for boards: they hear a Ctrl-C whenever it comes, and never outlive who started them."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import pytest
from test_calibration import BOARD, TILTED, picture

ROOT = Path(__file__).parents[1]
LISTEN = "import signal\nsignal.signal(signal.SIGINT, signal.default_int_handler)\n"  # background jobs do not
pytestmark = pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="the processes are found in /proc")

# Ctrl-C comes in the main thread just after Python's threading has taken a lock, while a result arrives that needs this
# lock; or, where no lock is taken, while pictures are handed out.
AT_A_LOCK = """
import sys, threading, time
from camviz_clinic.calibration import detect
from camviz_clinic.calibration import detection
from camviz_clinic.calibration.types import Board

armed = []

def strike():
    if armed and threading.current_thread() is threading.main_thread():
        armed.clear()
        time.sleep(1)
        signal.raise_signal(signal.SIGINT)

def after(function):
    def called(*arguments, **options):
        result = function(*arguments, **options)
        strike()
        return result
    return called

threading.Condition.__enter__ = after(threading.Condition.__enter__)
for name in ("_hand_out", "wait"):
    if hasattr(detection, name):
        setattr(detection, name, after(getattr(detection, name)))
try:
    detect(sys.argv[1:] * 60, Board(9, 6, 0.025), workers=2, progress=lambda done, count: armed.append(1))
except KeyboardInterrupt:
    print("interrupted")
"""

COMMAND = """
import sys
from camviz_clinic.commands.command import main
sys.argv[1:] = ["calibrate", *sys.argv[1:] * 400, "--board", "9x6", "--square-mm", "25", "--workers", "2"]
from camviz_clinic.commands.pictures import Bar
Bar.__call__ = lambda self, done, count: print(done, file=sys.stderr, flush=True)
import pathlib
import camviz_clinic.commands.calibrate as calibrate
calibrate.pictures = lambda words: [pathlib.Path(word) for word in words]
sys.exit(main())
"""


@pytest.fixture
def shot(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), picture(BOARD, TILTED)[0])
    return tmp_path / "a.png"


def started(code, shot):
    return subprocess.Popen(
        [sys.executable, "-c", LISTEN + code, str(shot)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=shot.parent,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        start_new_session=True,
    )


def members(group):
    """The processes of a group that still run."""
    found = []
    for each in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, of = each.read_text().rpartition(")")[2].split()[:3]
        except OSError:
            continue
        if int(of) == group and state != "Z":
            found.append(int(each.parent.name))
    return found


def gone(group, within):
    """Whether all processes of a group end within so many seconds; they are ended in the end."""
    until = time.monotonic() + within
    while (left := members(group)) and time.monotonic() < until:
        time.sleep(0.05)
    for each in left:
        os.kill(each, signal.SIGKILL)
    return not left


def test_a_ctrl_c_is_heard_wherever_it_comes(shot):
    with started(AT_A_LOCK, shot) as process:
        try:
            assert process.communicate(timeout=120) == ("interrupted\n", "")
        finally:
            process.kill()
            assert gone(process.pid, 5)


@pytest.mark.sampled(1)
@pytest.mark.parametrize(("ended_by", "status"), [(signal.SIGTERM, 143), (signal.SIGKILL, -9)])
def test_no_process_outlives_a_calibration(shot, ended_by, status):
    with started(COMMAND, shot) as process:
        first = process.stderr.readline()
        running = len(members(process.pid))
        os.kill(process.pid, ended_by)  # of which the others hear nothing
        ended = process.wait(timeout=120)
        assert gone(process.pid, 5)
        assert (first, ended) == ("1\n", status)
        assert running >= 3
        assert set(process.stderr.read().split()) <= {str(count) for count in range(400)}
    assert [path.name for path in shot.parent.iterdir()] == ["a.png"]
