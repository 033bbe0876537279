"""How lessons are run as tests (nbval): what is compared, and what may never be written."""

import pytest
from nbval.plugin import IPyNbCell, IPyNbFile

# A picture depends in its last digits on the versions of OpenCV's JPEG coder and of libm. Its alternative text, which
# states its numbers, is compared instead (text/plain).
PICTURES = ("text/html", "image/svg+xml")


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
