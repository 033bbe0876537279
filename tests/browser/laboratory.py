"""A real JupyterLab in a real browser, on a copy of the lessons, that reads and writes nothing of the person's own."""

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
from pathlib import Path
from typing import Any
from urllib.error import URLError
from urllib.request import urlopen

from playwright.sync_api import Browser, Page, sync_playwright

ROOT = Path(__file__).resolve().parents[2]
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")
# No sandbox, because root (a container, a build server) can have none; no calls home.
FLAGS = [
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run"),
    *("--disable-background-networking", "--disable-component-update", "--disable-sync"),
]
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
# The kernel is idle before the page has drawn its last widget.
ALL_SHOWN = "(made) => document.querySelectorAll('.camviz-explorer').length >= made"


@contextmanager
def jupyterlab(folder: Path, home: Path, **environment: str) -> Iterator[str]:
    """The address, up to a path, of a JupyterLab server that serves `folder` and keeps its files in `home`."""
    (home / "app").mkdir(parents=True, exist_ok=True)
    (home / "app/overrides.json").write_text(QUIET)
    port, token = _free_port(), secrets.token_hex(16)
    command = [sys.executable, "-m", "jupyterlab", "--no-browser", "--allow-root", "--expose-app-in-browser"]
    command += [f"--ServerApp.port={port}", "--ServerApp.port_retries=0", f"--ServerApp.root_dir={folder}"]
    command += ["--ServerApp.jpserver_extensions=camviz.server=True"]  # as `camviz lab` does
    command += [f"--IdentityProvider.token={token}", f"--LabApp.app_settings_dir={home / 'app'}"]
    command += ["--LabApp.extension_manager=readonly", "--ServerApp.ip=127.0.0.1"]
    log = home / "server.log"
    with log.open("w") as output:
        server = subprocess.Popen(command, env=_private(home) | environment, stdout=output, stderr=output)
    try:
        _wait_for(f"http://127.0.0.1:{port}/api", server, log)
        yield f"http://127.0.0.1:{port}/lab/tree/{{path}}?token={token}&reset"
    finally:
        server.terminate()
        server.wait(timeout=30)


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


class Notebook:
    """One notebook open in JupyterLab; `options` are those of Playwright's `new_page`.

    `errors` gathers what the page's JavaScript raised.
    """

    def __init__(self, browser: Browser, address: str, path: str, **options: Any) -> None:
        self.errors: list[str] = []
        self.page: Page = browser.new_page(**{"viewport": {"width": 1400, "height": 1000}, **options})
        self.page.on("pageerror", lambda error: self.errors.append(str(error)))
        self.page.add_init_script(path=Path(__file__).with_name("hands.js"))
        self.page.goto(address.format(path=path))
        self.page.wait_for_selector(".jp-NotebookPanel:visible .jp-Cell", timeout=60_000)

    def run_all(self) -> list[dict[str, Any]]:
        """Run every cell, wait until the kernel and all visualizers rest, and return the cells as they are now."""
        cells: list[dict[str, Any]] = self.page.evaluate(RUN_ALL, 180_000)
        self.page.wait_for_function(ALL_SHOWN, arg=sum(map(_shows_explorer, cells)), timeout=60_000)
        for explorer in self.page.query_selector_all(".camviz-explorer"):
            explorer.evaluate("root => hands.settled(root)")
        return cells

    def theme(self, name: str) -> None:
        """Change JupyterLab's theme, as its Settings menu does."""
        self.page.evaluate("theme => jupyterapp.commands.execute('apputils:change-theme', { theme })", name)
        light = str(name == "JupyterLab Light").lower()
        self.page.wait_for_selector(f"body[data-jp-theme-light='{light}']", state="attached")

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


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    return port


def _wait_for(url: str, server: subprocess.Popen[bytes], log: Path) -> None:
    end = time.monotonic() + 60
    while time.monotonic() < end and server.poll() is None:
        try:
            urlopen(url, timeout=5).close()
        except (URLError, ConnectionError, TimeoutError):
            time.sleep(0.2)
        else:
            return
    raise RuntimeError(f"JupyterLab did not start:\n{log.read_text()[-4000:]}")
