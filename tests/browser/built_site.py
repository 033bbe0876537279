"""The site as start.py built it, and a server for it."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from file_server import files_served

ROOT = Path(__file__).resolve().parents[2]
SITE = Path(os.environ.get("CAMVIZ_SITE", ROOT / "build/site"))
LESSONS = sorted(path.stem for path in (ROOT / "lessons").glob("*.ipynb"))

UNFOLDED = "() => document.querySelectorAll('.camviz-deeper').forEach((one) => { one.open = true; })"
"""Opens all deeper sections of a page."""


@contextmanager
def served() -> Iterator[str]:
    """The address of a server for the site; a test without a site fails."""
    if not (SITE / "index.html").exists():
        pytest.fail(f"{SITE} has no index.html: build the site first, by python start.py site")
    with files_served(SITE) as address:
        yield address
