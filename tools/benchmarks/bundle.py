"""A bundle made, unpacked and used with no network: does a class get as far as a picture in lesson 05?

    python tools/benchmarks/bundle.py [--zip BUNDLE.zip]

Makes the bundle of this machine (or takes the one that is named), unpacks it into an empty folder, and goes on in a
network namespace that has nothing but its own loopback: the student's Python installs it, starts JupyterLab on lesson
05, and Chromium runs all its cells. Prints sizes and seconds as Markdown. Fails where a cell failed, or where a
visualizer drew nothing. Needs Linux, Chromium, `unshare`, 2 GB of disk for as long as it runs, and once the network.
"""

from __future__ import annotations

import argparse
import os
import secrets
import socket
import subprocess
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from zipfile import ZipFile

HERE = Path(__file__).resolve().parent
ROOT = HERE.parents[1]
sys.path.append(str(ROOT / "tests" / "browser"))

from laboratory import Notebook, chromium, free_port, wait_for  # noqa: E402

LESSON = "05"
DRAWN = """roots => roots.filter(root => [...root.querySelectorAll("img, canvas, svg")].some(
  one => one.getBoundingClientRect().width > 100)).length"""


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--zip", type=Path)
    parser.add_argument("--offline", type=Path, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.offline:
        return offline(options.offline)
    with TemporaryDirectory(prefix="camviz-bundle-") as made:
        folder = Path(made)
        began = time.monotonic()
        if not options.zip:
            command = [sys.executable, "-m", "camviz", "bundle", str(folder / "bundle.zip")]
            subprocess.run(command, check=True, env={**os.environ, "PYTHONPATH": str(ROOT)})
            told("make the bundle", time.monotonic() - began)
        bundle = options.zip or folder / "bundle.zip"
        print(f"| size of the zip | {bundle.stat().st_size / 1e6:.0f} MB |")
        began = time.monotonic()
        with ZipFile(bundle) as packed:
            packed.extractall(folder / "student")
        told("unpack it", time.monotonic() - began)
        rights = ["--map-root-user"] * (os.geteuid() != 0)
        alone = ["unshare", "--net", *rights, sys.executable, __file__, "--offline", str(folder / "student")]
        return subprocess.run(alone).returncode


def offline(folder: Path) -> int:
    """What the student does, in a network of one machine."""
    subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
    print(f"| network interfaces | {', '.join(name for _, name in socket.if_nameindex())} |")
    (unpacked,) = folder.glob("camviz-*")
    ours = {name for name in os.environ if name.startswith(("CAMVIZ_", "PIP_", "PYTHON", "VIRTUAL_ENV"))}
    environment = {name: value for name, value in os.environ.items() if name not in ours} | {"HOME": str(folder)}
    python = str(Path(sys.base_prefix) / "bin" / "python{}.{}".format(*sys.version_info[:2]))
    began = time.monotonic()
    installed = subprocess.run([python, "start.py", "--version"], cwd=unpacked, env=environment, stdout=sys.stderr)
    if installed.returncode:
        return installed.returncode
    told("install it", time.monotonic() - began)
    used = sum(path.stat().st_size for path in unpacked.rglob("*") if path.is_file() and not path.is_symlink())
    print(f"| all that it takes on disk | {used / 1e9:.1f} GB |")

    port, token, log = free_port(), secrets.token_hex(16), folder / "server.log"
    words = [python, "start.py", "lab", "--lesson", LESSON, "--no-browser", "--", "--expose-app-in-browser"]
    words += [f"--ServerApp.port={port}", f"--IdentityProvider.token={token}"]
    began = time.monotonic()
    with log.open("w") as output:
        server = subprocess.Popen(words, cwd=unpacked, env=environment, stdout=output, stderr=output)
    try:
        wait_for(f"http://127.0.0.1:{port}/api", server, log)
        told("start JupyterLab", time.monotonic() - began)
        (lesson,) = (unpacked / "camviz-lessons").glob(f"{LESSON}_*.ipynb")
        return opened(f"http://127.0.0.1:{port}/lab/tree/{lesson.name}?token={token}&reset")
    finally:
        server.terminate()
        server.wait(timeout=30)


def opened(address: str) -> int:
    """Run the lesson in Chromium; 0 where nothing failed and every visualizer drew."""
    with chromium() as browser:
        began = time.monotonic()
        notebook = Notebook(browser, address, "")
        told("open the lesson", time.monotonic() - began)
        began = time.monotonic()
        cells = notebook.run_all()
        told("run all its cells", time.monotonic() - began)
        errors = [out for cell in cells for out in cell.get("outputs", []) if out["output_type"] == "error"]
        shown = notebook.page.locator(".camviz-explorer").count()
        drawn = notebook.page.eval_on_selector_all(".camviz-explorer", DRAWN)
        if folder := os.environ.get("CAMVIZ_SCREENSHOTS"):
            notebook.page.locator(".camviz-explorer").first.scroll_into_view_if_needed()
            notebook.page.screenshot(path=Path(folder) / "bundle.png")
        print(f"| visualizers that drew | {drawn} of {shown} |")
        print(f"| cells that failed | {len(errors)} |")
        return 0 if drawn == shown > 0 and not errors and not notebook.errors else 1


def told(what: str, seconds: float) -> None:
    """One row of the table."""
    print(f"| {what} | {seconds:.0f} s |", flush=True)


if __name__ == "__main__":
    sys.exit(main())
