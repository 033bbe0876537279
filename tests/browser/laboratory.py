"""A real JupyterLab or Notebook 7 in a real browser, on a copy of the lessons; nothing of the person's own is used."""

from __future__ import annotations

import os
import secrets
import shutil
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any
from urllib.error import URLError
from urllib.request import urlopen

from axe_playwright_python.base import AXE_SCRIPT
from playwright.sync_api import Browser, ElementHandle, Page, sync_playwright

ROOT = Path(__file__).resolve().parents[2]
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
# No sandbox, because root (a container, a build server) can have none; no calls home.
FLAGS = [
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
]
FRONT_ENDS = {  # module, application, where a notebook opens
    "JupyterLab": ("jupyterlab", "LabApp", "lab/tree"),
    "Notebook 7": ("notebook", "JupyterNotebookApp", "notebooks"),
}
NOTEBOOKS_OWN = "Cannot read properties of undefined (reading 'schema')"  # of Notebook 7 where it opens any notebook
QUIET = """{"@jupyterlab/apputils-extension:notification":
  {"checkForUpdates": false, "doNotDisturbMode": true, "fetchNews": "false"}}"""
RUN_ALL = """async (limit) => {
  const panel = jupyterapp.shell.currentWidget;
  const run = async () => {
    await panel.context.ready;
    await panel.sessionContext.ready;
    await jupyterapp.commands.execute("notebook:run-all-cells");
    while (panel.sessionContext.session.kernel.status !== "idle") await hands.pause(50);
    return panel.content.model.toJSON().cells;
  };
  const late = async () => { await hands.pause(limit); throw new Error(`still running after ${limit} ms`); };
  return Promise.race([run(), late()]);
}"""
AXE = """async (ours) => {
  const kinds = { resultTypes: ["violations", "incomplete"] };
  const { violations, incomplete } = await axe.run({ include: [[ours]] }, kinds);
  const told = ({ id, nodes }) => nodes.map(({ html, target }) => `${id}: ${html.slice(0, 150)} at ${target}`);
  return [...violations, ...incomplete].flatMap(told);
}"""
LATE_MS = 300_000
"""After so long a page is broken: a wait ends as soon as it may, and no test passes or fails by the machine's speed."""
# MathJax lays a copy of each formula for screen readers over it, unseen, in whatever font the machine has for formulas.
# Where that is the wider one, and a line ends there, JupyterLab's cell would scroll by some pixels of nothing.
UNSEEN_FORMULAS = "mjx-assistive-mml { max-width: 100% !important }"
SCROLLED = "() => document.querySelector('.jp-WindowedPanel-outer').scrollTop"
# The kernel is idle before the page has drawn its last widget.
ALL_SHOWN = "(made) => document.querySelectorAll('.camviz-explorer').length >= made"


@contextmanager
def jupyter(front_end: str, folder: Path, home: Path, **environment: str) -> Iterator[str]:
    """The address, up to a path, of a server with that front end; it serves `folder` and keeps its files in `home`."""
    module, app, place = FRONT_ENDS[front_end]
    (home / "app").mkdir(parents=True, exist_ok=True)
    (home / "app/overrides.json").write_text(QUIET)
    port, token = free_port(), secrets.token_hex(16)
    command = [sys.executable, "-m", module, "--no-browser", "--allow-root", "--expose-app-in-browser"]
    command += [f"--ServerApp.port={port}", "--ServerApp.port_retries=0", f"--ServerApp.root_dir={folder}"]
    command += ["--ServerApp.jpserver_extensions=camviz_school.server=True"]  # as `camviz lab` does
    command += [f"--IdentityProvider.token={token}", f"--{app}.app_settings_dir={home / 'app'}"]
    command += ["--LabApp.extension_manager=readonly", "--ServerApp.ip=127.0.0.1"]
    log = home / "server.log"
    with log.open("w") as output:
        server = subprocess.Popen(command, env=_private(home) | environment, stdout=output, stderr=output)
    try:
        wait_for(f"http://127.0.0.1:{port}/api", server, log)
        yield f"http://127.0.0.1:{port}/{place}/{{path}}?token={token}&reset"
    finally:
        _end(server)


def _end(server: subprocess.Popen[bytes]) -> None:
    """Ask a server to stop. One that has stopped but for a thread of anyio's, as happens now and then, is killed."""
    server.terminate()
    try:
        server.wait(timeout=60)
    except subprocess.TimeoutExpired:
        server.kill()
        server.wait()


jupyterlab = partial(jupyter, "JupyterLab")


@contextmanager
def chromium() -> Iterator[Browser]:
    """A headless browser: the one that CAMVIZ_CHROMIUM names, or the first Chromium on the path."""
    path = os.environ.get("CAMVIZ_CHROMIUM") or next(filter(None, map(shutil.which, BROWSERS)), None)
    if not path:
        raise FileNotFoundError("no Chromium found: install one, or name it in CAMVIZ_CHROMIUM")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=path, args=FLAGS)
        yield browser
        browser.close()


def new_page(browser: Browser, **options: Any) -> Page:
    """A page of its own, with Playwright's options, that waits as long as a slow machine needs."""
    page = browser.new_page(**options)
    page.set_default_timeout(LATE_MS)
    return page


class Notebook:
    """One notebook open in JupyterLab or Notebook 7; `options` are those of Playwright's `new_page`.

    `errors` gathers what the page's JavaScript raised.
    """

    def __init__(self, browser: Browser, address: str, path: str, **options: Any) -> None:
        self.errors: list[str] = []
        self.page = new_page(browser, **{"viewport": {"width": 1400, "height": 1000}, **options})
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.add_init_script(path=Path(__file__).with_name("hands.js"))
        self.page.goto(address.format(path=path))
        self.page.wait_for_selector(".jp-NotebookPanel:visible .jp-Cell", timeout=LATE_MS)

    def run_all(self) -> list[dict[str, Any]]:
        """Run every cell, wait until the kernel and all visualizers rest, and return the cells as they are now."""
        cells: list[dict[str, Any]] = self.page.evaluate(RUN_ALL, 10 * LATE_MS)
        self.page.wait_for_function(ALL_SHOWN, arg=sum(map(_shows_explorer, cells)), timeout=LATE_MS)
        for explorer in self.page.query_selector_all(".camviz-explorer"):
            explorer.evaluate("root => hands.settled(root)")
        return cells

    def unreadable(self, width: int) -> list[str]:
        """What cannot be read in the visualizers, in a window of that many CSS pixels."""
        found = []
        for number, explorer in enumerate(self.shown_in(width, 900), 1):
            for _ in range(20):  # words make room once the kernel knows how large they are shown
                if not (seen := explorer.evaluate("root => hands.unreadable(root)")):
                    break
                self.page.wait_for_timeout(250)
            found += [f"{width} px, visualizer {number}: {one}" for one in seen]
        return found

    def shown_in(self, width: int, height: int) -> Iterator[ElementHandle]:
        """Every visualizer in a window of that size, in CSS pixels, once it is in sight and has come to rest.

        JupyterLab's side panel, which on a telephone would leave a notebook 50 pixels, is closed there.
        """
        self.page.set_viewport_size({"width": width, "height": height})
        self.page.evaluate(f"jupyterapp.shell.{'collapse' if width < 500 else 'expand'}Left()")
        for explorer in self.page.query_selector_all(".camviz-explorer"):
            explorer.scroll_into_view_if_needed()
            self.page.wait_for_timeout(300)  # until the tiles have their sizes, and the kernel is asked
            explorer.evaluate("root => hands.settled(root)")
            yield explorer

    def swipe(self, x: float, y: float, dx: float, dy: float, moves: int = 15) -> float:
        """Lead a finger over the page in that many moves; by how much the notebook has scrolled."""
        before = self.page.evaluate(SCROLLED)
        session = self.page.context.new_cdp_session(self.page)

        def touch(kind: str, *points: tuple[float, float]) -> None:
            places = [{"x": x, "y": y} for x, y in points]
            session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": places})
            self.page.wait_for_timeout(16)

        touch("touchStart", (x, y))
        for i in range(1, moves + 1):
            touch("touchMove", (x + dx * i / moves, y + dy * i / moves))
        touch("touchEnd")
        session.detach()
        after: float = self.page.evaluate(SCROLLED)
        return after - before

    def theme(self, name: str) -> None:
        """Change the theme, as the Settings menu does."""
        self.page.evaluate("theme => jupyterapp.commands.execute('apputils:change-theme', { theme })", name)
        light = str(name == "JupyterLab Light").lower()
        self.page.wait_for_selector(f"body[data-jp-theme-light='{light}']", state="attached")

    def axe(self) -> list[str]:
        """What axe-core finds wrong, or cannot decide, in the outputs and texts of cells that are in the page now."""
        self.page.wait_for_selector(".jp-OutputArea-output", state="attached")
        if self.page.evaluate("() => !window.axe"):
            self.page.evaluate(AXE_SCRIPT)
            self.page.add_style_tag(content=UNSEEN_FORMULAS)
        found: list[str] = self.page.evaluate(AXE, ".jp-OutputArea-output, .jp-RenderedMarkdown")
        return found

    def close(self) -> None:
        """Close the page and its kernel."""
        self.page.evaluate("() => jupyterapp.shell.currentWidget.sessionContext.shutdown()")
        self.page.close()


def _shows_explorer(cell: dict[str, Any]) -> bool:
    return any("A still picture: run this cell" in str(out.get("data")) for out in cell.get("outputs", []))


def _private(home: Path) -> dict[str, str]:
    """An environment in which Jupyter keeps everything inside `home`, and camviz is this repository's."""
    names = ("JUPYTER_CONFIG_DIR", "JUPYTER_DATA_DIR", "JUPYTER_RUNTIME_DIR", "IPYTHONDIR")
    names += ("JUPYTERLAB_SETTINGS_DIR", "JUPYTERLAB_WORKSPACES_DIR")
    kept = {name: str(home / name.lower()) for name in names}
    paths = [str(ROOT), *filter(None, [os.environ.get("PYTHONPATH")])]
    return {**os.environ, **kept, "PYTHONPATH": os.pathsep.join(paths)}


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    return port


def wait_for(url: str, server: subprocess.Popen[bytes], log: Path) -> None:
    end = time.monotonic() + LATE_MS / 1000
    while time.monotonic() < end and server.poll() is None:
        try:
            urlopen(url, timeout=5).close()
        except (URLError, ConnectionError, TimeoutError):
            time.sleep(0.2)
        else:
            return
    raise RuntimeError(f"Jupyter did not start:\n{log.read_text()[-4000:]}")
