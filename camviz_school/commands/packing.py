"""One zip from which camviz installs and opens its lessons with no network: for a stick that goes round in a class."""

from __future__ import annotations

import shutil
import subprocess
import sys
from collections.abc import Callable, Sequence
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from tempfile import TemporaryDirectory
from types import ModuleType
from zipfile import ZIP_DEFLATED, ZIP_STORED, ZipFile

import camviz
from camviz_school.course.working_copy import lay_out
from camviz_school.samples import REGISTRY, SampleUnavailable, sample
from camviz_school.teaching.platforms import PLATFORMS, wanted

Say = Callable[[str], None]
PACKED = {".whl", ".png", ".jpg", ".svgz", ".gz", ".woff2", ".mp4"}
"""Endings of files that are compressed already."""

README = """\
camviz {version}: lessons about cameras and their calibration, to install without a network
For {machines}

1. Copy this zip to your own disk and unpack it there: not on the stick, which is slow and too small.
2. Open a terminal in the unpacked folder, and start with the Python that is named above:

       python start.py lab --lesson 05

   `python` is called `python3` on Linux and macOS, and `py` on Windows.
   The first time this takes a few minutes and 2 GB; from then on it opens JupyterLab at once. Ctrl-C ends it.

What you write stays in the folder camviz-lessons. Delete the unpacked folder to undo everything.
"""
WITH_SITE = "\nsite/index.html are the lessons to read and to move, in any browser, with nothing installed.\n"


class BundleError(RuntimeError):
    """Why there is no bundle, in one sentence."""


def this_machine(root: Path) -> tuple[str, str]:
    """The names of this machine's platform and of its Python, such as ("linux-x86_64", "3.12")."""
    name, _, python = _starter(root).machine().partition(" ")
    return name, python


def write_bundle(
    root: Path, target: Path, platforms: Sequence[str], pythons: Sequence[str], *, site: Path | None, say: Say
) -> int:
    """Write the bundle of the checkout `root` to the zip `target`, and return how many wheels are in it.

    What is fetched lies beside the target until the zip is written. Raises BundleError where that cannot be done.
    """
    start = _starter(root)
    lock = start.READER.relative_to(start.ROOT)
    machines = [f"{platform} {python}" for platform in platforms for python in pythons]
    with TemporaryDirectory(dir=target.parent, prefix=".camviz-") as made:
        folder = Path(made) / f"camviz-{camviz.__version__}"
        wheels = folder / start.WHEELS.name
        wheels.mkdir(parents=True)
        for machine in machines:
            _download(start.entries(root / lock), machine, wheels, say)
        _pip(
            ["wheel", "--no-deps", "--no-build-isolation", "--wheel-dir", str(wheels), str(root)], "camviz's own wheel"
        )
        (wheels / start.MACHINES.name).write_text("\n".join(machines) + "\n")
        (folder / lock).parent.mkdir(parents=True)
        for name in (lock, "start.py", "LICENSE"):
            shutil.copyfile(root / name, folder / name)
        lay_out(root / "lessons", folder / "camviz-lessons", camviz.__version__)
        _samples(folder / start.SAMPLES.name, say)
        if site:
            shutil.copytree(site, folder / "site")
        text = README.format(version=camviz.__version__, machines=" or ".join(map(start.told, machines)))
        (folder / "README.txt").write_text(text + WITH_SITE * bool(site), encoding="utf-8", newline="\r\n")
        _zip(folder, target)
        return len(list(wheels.glob("*.whl")))


def _download(entries: Sequence[str], machine: str, wheels: Path, say: Say) -> None:
    """Fetch the wheels of a lock for a machine ("linux-x86_64 3.12"), each checked by its hash."""
    name, _, python = machine.partition(" ")
    lists = {one: wanted(entries, PLATFORMS[name], one) for one in (f"{python}.0", f"{python}.99")}
    say(f"fetching {len(lists[f'{python}.0'])} wheels for {machine}: a few hundred megabytes")
    words = ["download", "--no-deps", "--require-hashes", "--only-binary=:all:", "--dest", str(wheels)]
    words += ["--implementation", "cp"]
    words += [word for tag in PLATFORMS[name].tags for word in ("--platform", tag)]
    lock = wheels.parent / "wanted.lock"
    fetched: list[list[str]] = []
    for release, lines in lists.items():  # a lock may name other packages for a Python's first releases
        if lines not in fetched:
            lock.write_text("\n".join(lines), encoding="utf-8")
            _pip([*words, "--python-version", release, "--requirement", str(lock)], f"the wheels for {machine}")
            fetched.append(lines)
    lock.unlink()


def _pip(words: Sequence[str], what: str) -> None:
    """Run pip; where it fails, its last error is the reason. It ends with this process."""
    command = [sys.executable, "-m", "pip", "--disable-pip-version-check", "--no-input", *words, "--progress-bar=off"]
    child = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, errors="replace")
    try:
        _, said = child.communicate()
    except BaseException:  # Ctrl-C, or a signal
        child.kill()
        child.wait()
        raise
    if child.returncode:
        errors = [line.strip().removeprefix("ERROR: ") for line in said.splitlines() if "error" in line.casefold()]
        reason = errors[-1] if errors else f"pip ended with status {child.returncode}"
        raise BundleError(f"{what} could not be had: {reason.rstrip('.')}; nothing was written")


def _samples(folder: Path, say: Say) -> None:
    """The photographs that lessons otherwise fetch; without them the virtual camera's take their place."""
    folder.mkdir()
    try:
        for name in REGISTRY:
            shutil.copyfile(sample(name), folder / name)
    except SampleUnavailable as reason:
        say(f"{reason} Without it, lessons in the bundle show pictures of the virtual camera.")


def _zip(folder: Path, target: Path) -> None:
    with ZipFile(target, "w") as made:
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                kind = ZIP_STORED if path.suffix in PACKED else ZIP_DEFLATED
                made.write(path, path.relative_to(folder.parent), kind)


def _starter(root: Path) -> ModuleType:
    """The checkout's start.py, which a bundle takes along: it knows the locks, and installs from the bundle."""
    spec = spec_from_file_location("camviz_start", root / "start.py")
    if spec is None or spec.loader is None:
        raise BundleError(f"{root / 'start.py'} cannot be read")
    found = module_from_spec(spec)
    spec.loader.exec_module(found)
    return found
