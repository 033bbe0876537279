"""One JupyterLab and one browser for all browser tests; one open notebook per lesson."""

import os
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from laboratory import LATE_MS, ROOT, Notebook, chromium, jupyterlab
from playwright.sync_api import Browser, expect
from xdist.scheduler.loadscope import LoadScopeScheduling

expect.set_options(timeout=LATE_MS)
LESSONS = sorted(path.name for path in (ROOT / "lessons").glob("*.ipynb"))


class ByLesson(LoadScopeScheduling):
    """Workers share the lessons out among them, each lesson whole: it is opened and run once."""

    def _split_scope(self, nodeid: str) -> str:
        lesson = re.search(r"\w+\.ipynb", nodeid)
        return lesson[0] if lesson else super()._split_scope(nodeid)


def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> ByLesson:
    return ByLesson(config, log)


@pytest.fixture(scope="session")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


@pytest.fixture(scope="session")
def address(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    home = tmp_path_factory.mktemp("jupyter")
    shutil.copytree(ROOT / "lessons", home / "lessons")
    with jupyterlab(home / "lessons", home / "private") as address:
        yield address


OPENED = ("00", "05", "16")
"""The lessons that are opened without --all: nbval runs every one, and each view has its own tests."""


def _opened(name: str) -> Any:
    return name if name[:2] in OPENED else pytest.param(name, marks=pytest.mark.thorough)


@pytest.fixture(scope="module", params=[_opened(name) for name in LESSONS])
def lesson(request: pytest.FixtureRequest, browser: Browser, address: str) -> Iterator[Notebook]:
    """A lesson, opened and run from top to bottom; `lesson.cells` is what came out.

    `lesson.wrong_at_first` is what axe-core found wrong with the outputs that were saved.
    """
    notebook = Notebook(browser, address, request.param)
    notebook.wrong_at_first = notebook.axe()
    notebook.cells = notebook.run_all()
    yield notebook
    notebook.close()


@pytest.fixture
def screenshot(request: pytest.FixtureRequest):
    """Takes a picture of an element into the folder that CAMVIZ_SCREENSHOTS names; does nothing when it names none."""
    folder = os.environ.get("CAMVIZ_SCREENSHOTS")

    def take(element, name: str) -> None:
        if folder:
            stem = re.sub(r"[^\w.-]+", "-", f"{request.node.callspec.id}-{name}")
            Path(folder).mkdir(parents=True, exist_ok=True)
            element.screenshot(path=Path(folder, f"{stem}.png"))

    return take
