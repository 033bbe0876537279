"""How lessons are run as tests (nbval): what is compared, what may never be written, and in which font."""

import os
import re
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # a worker for each processor; and sums in one order on all
os.environ.setdefault("OPENCV_FOR_THREADS_NUM", "1")  # each processor has its worker: OpenCV's threads would only wait

import matplotlib
import pytest
from nbval.plugin import IPyNbCell, IPyNbFile

# A picture depends in its last digits on the versions of OpenCV's JPEG coder and of libm. Its alternative text, which
# states its numbers, is compared instead (text/plain).
PICTURES = ("text/html", "image/svg+xml")


EXAMPLES = ("05", "16")
"""The lessons in which is tested what is the same in all of them (marker by_example)."""

# Words are as wide as their font. So that no test depends on the fonts of a machine, browsers and Cairo see one family
# only, the DejaVu that matplotlib brings along.
FONTS = """<?xml version="1.0"?><!DOCTYPE fontconfig SYSTEM "fonts.dtd">
<fontconfig>
  <dir>{folder}</dir>
  <cachedir>{cache}</cachedir>
  <alias binding="same"><family>serif</family><prefer><family>DejaVu Serif</family></prefer></alias>
  <alias binding="same"><family>monospace</family><prefer><family>DejaVu Sans Mono</family></prefer></alias>
  <match target="pattern">
    <edit name="family" mode="append_last"><string>DejaVu Sans</string></edit>
  </match>
  <match target="font">
    <edit name="antialias" mode="assign"><bool>true</bool></edit>
    <edit name="hinting" mode="assign"><bool>true</bool></edit>
    <edit name="hintstyle" mode="assign"><const>hintslight</const></edit>
  </match>
</fontconfig>
"""


def pytest_addoption(parser):
    parser.addoption("--all", action="store_true", help="everything: more seeds, both themes, Firefox, every pane")


def pytest_ignore_collect(collection_path, config):
    """The browser's tests are not even imported where none of them is to be run."""
    browser = collection_path == Path(__file__).parent / "tests/browser"
    return True if browser and config.getoption("markexpr") == "not browser" else None


def pytest_collection_modifyitems(config, items):
    if not config.getoption("--all"):
        left_out = {item for item in items if needs_all(item)}
        left_out |= beyond_their_sample([item for item in items if item not in left_out])
        config.hook.pytest_deselected(items=list(left_out))
        items[:] = [item for item in items if item not in left_out]


def beyond_their_sample(items):
    """The cases that a test with `sampled(n)` leaves out: n of them run, evenly spaced, the first among them."""
    cases = {}
    for item in items:
        if item.get_closest_marker("sampled"):
            cases.setdefault(item.nodeid.partition("[")[0], []).append(item)
    left_out = set()
    for each in cases.values():
        wanted = each[0].get_closest_marker("sampled").args[0]
        kept = {index * len(each) // wanted for index in range(wanted)}
        left_out |= {item for index, item in enumerate(each) if index not in kept}
    return left_out


def needs_all(item):
    lesson = re.search(r"\[(?:lessons/)?(\d\d)_", item.name)
    of_another = bool(item.get_closest_marker("by_example")) and bool(lesson) and lesson[1] not in EXAMPLES
    return of_another or bool(item.get_closest_marker("thorough"))


def pytest_configure(config):
    made = Path(__file__).parent / "build/fonts"
    made.mkdir(parents=True, exist_ok=True)
    (made / "fonts.conf").write_text(FONTS.format(folder=Path(matplotlib.get_data_path(), "fonts/ttf"), cache=made))
    os.environ["FONTCONFIG_FILE"] = str(made / "fonts.conf")


def pytest_collectstart(collector):
    if isinstance(collector, IPyNbFile):
        collector.skip_compare += PICTURES
        collector.sanitize_patterns.update({r"\b0x[0-9a-fA-F]+\b": "0xADDRESS"})


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    """A cell that writes to stderr fails: a warning, or an error shown by a widget and raised nowhere."""
    result = yield
    if isinstance(item, IPyNbCell):
        written = "".join(out.text for out in item.test_outputs or () if out.get("name") == "stderr")
        if written:
            item.raise_cell_error("The cell wrote to stderr", written)
    return result
