"""The site as start.py built it, and a server for it."""

import os
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
SITE = Path(os.environ.get("CAMVIZ_SITE", ROOT / "build/site"))
LESSONS = sorted(path.stem for path in (ROOT / "lessons").glob("*.ipynb"))


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *_: object) -> None:
        """Nothing."""


@contextmanager
def served() -> Iterator[str]:
    """The address of a server for the site; a test without a site fails."""
    if not (SITE / "index.html").exists():
        pytest.fail(f"{SITE} has no index.html: build the site first, by python start.py site")
    server = ThreadingHTTPServer(("127.0.0.1", 0), partial(_Quiet, directory=str(SITE)))
    threading.Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()
    server.server_close()
