"""Set camviz up and open its lessons. Needs Python 3.11 or newer, nothing else; the first time also a network.
In a bundle, which `camviz bundle` makes, everything is there: it needs no network.

    python start.py                 open the lessons in JupyterLab
    python start.py --light         the same without VTK, 600 MB smaller: 3D is drawn as wireframes
    python start.py test            run the tests: the package's, and every lesson from top to bottom
    python start.py site            build the site, every lesson with it, in build/site
    python start.py COMMAND ...     any other command of camviz, such as: doctor, show FILE

--light may stand before a command, too; what is installed already is not taken away.
Everything is installed into the folder .venv beside this file and nowhere else. Delete that folder to undo it.
"""

import hashlib
import importlib.util
import os
import platform
import re
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
STAMP = VENV / "camviz-setup.txt"
PYTHON = VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
READER, SITE, TESTER = (ROOT / f"tools/locks/requirements{what}.lock" for what in ("", "-site", "-test"))
WHEELS = ROOT / "wheels"  # in a bundle only: all that is installed
MACHINES = WHEELS / "machines.txt"  # what a bundle is for: a line such as "linux-x86_64 3.12" for each
SAMPLES = ROOT / "samples"  # in a bundle: the photographs that are otherwise fetched
BUNDLED = MACHINES.is_file()
SOLID = ("pyvista", "vtk")  # what --light leaves out
LARGER = ("light", "reader", "site", "test")  # each holds the one before
SIZE = {"light": "0.7 GB", "reader": "1.3 GB", "site": "1.4 GB", "test": "1.9 GB"}
TESTS = ("-m", "pytest", "-n", "auto", "--dist", "loadscope", "--no-loadscope-reorder")


def main(words):
    if words and words[0] in ("-h", "--help"):
        print(__doc__)
        return 0
    light = words[:1] == ["--light"]
    words = words[light:]
    special = words[0] if words and words[0] in ("site", "test") else ""
    if special and BUNDLED:
        sys.exit(f"A bundle has the lessons, not what `start.py {special}` needs: take the repository for that.")
    if BUNDLED and SAMPLES.is_dir():
        os.environ.setdefault("CAMVIZ_SAMPLES", str(SAMPLES))
    set_up(special or ("light" if light else "reader"))
    if special == "test":
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # else each worker and each command compiles the house again
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # a worker for each core: threads of its own would wait
        return run(PYTHON, *TESTS, *words[1:], cwd=ROOT)
    if special == "site":
        return run(PYTHON, ROOT / "tools/website/build.py", *words[1:], cwd=ROOT)
    return run(PYTHON, "-m", "camviz", *(words or ["lab"]))


def set_up(what):
    """Make .venv hold what the locks say for one of LARGER; at once and offline when it already does."""
    held = STAMP.read_text().split() if STAMP.exists() else []
    current = held[:1] == [fingerprint()]
    if current and LARGER.index(held[1]) >= LARGER.index(what):
        return
    if sys.version_info < (3, 11):  # noqa: UP036 - this file must also run where the package cannot
        sys.exit("camviz needs Python 3.11 or newer; this is {}.{}.".format(*sys.version_info[:2]))
    if BUNDLED and machine() not in (machines := MACHINES.read_text().splitlines()):
        sys.exit(f"This bundle is for {' or '.join(map(told, machines))}; this is {told(machine())}.")
    if not importlib.util.find_spec("ensurepip"):
        sys.exit("This Python cannot make virtual environments. On Debian and Ubuntu: sudo apt install python3-venv")
    if VENV.exists() and not STAMP.exists():
        sys.exit(f"{VENV} was not made by start.py. Move it away, or delete it, and start again.")
    print(f"Setting up camviz in {VENV}: once, some minutes and about {SIZE[what]}.", flush=True)
    if not current:
        make_venv()
    pip = [PYTHON, "-m", "pip", "--disable-pip-version-check", "--no-input", "install"]
    if not sys.stdout.isatty():
        pip.append("--quiet")  # a log needs no progress bars
    locks = [lock for path in locked(what) for lock in ("-r", path)]
    itself = ["--no-deps", "--no-build-isolation", "--editable", ROOT]  # by the build backend that the lock holds
    if BUNDLED:
        pip += ["--no-index", "--find-links", WHEELS]
        itself = ["--no-deps", *WHEELS.glob("camviz-*.whl")]
    if run(*pip, "--require-hashes", "--no-deps", *locks) or run(*pip, *itself):
        remedy = "Unpack the bundle again, and" if BUNDLED else "With no network it cannot; otherwise"
        sys.exit(f"The set-up did not finish: pip says why above. {remedy} start again.")
    STAMP.write_text(f"{fingerprint()} {what}")


def locked(what):
    """The locks of what is to be installed; for "light" a copy of the reader's without what draws solid 3D."""
    if what != "light":
        return [READER, SITE, TESTER][: LARGER.index(what)]
    light = VENV / "light.lock"
    light.write_text("\n".join(entries(READER, light=True)))
    return [light]


def entries(lock, light=False):
    """The entries of a lock, each with its hashes."""
    found = re.split(r"\n(?=\S)", lock.read_text().strip())
    return [each for each in found if not (light and each.split("==")[0] in SOLID)]


def machine():
    """This machine and Python as a bundle names them, such as "linux-x86_64 3.12"."""
    system = {"darwin": "macos", "win32": "windows"}.get(sys.platform, sys.platform)
    processor = platform.machine().lower().replace("amd64", "x86_64")
    return "{}-{} {}.{}".format(system, processor, *sys.version_info[:2])


def told(machine):
    return machine.replace(" ", " with Python ")


def make_venv():
    import venv

    shutil.rmtree(VENV, ignore_errors=True)
    VENV.mkdir(exist_ok=True)
    STAMP.write_text("unfinished")
    venv.create(VENV, symlinks=os.name != "nt", with_pip=True)


def fingerprint():
    """What the installation depends on: the lock, the package's metadata, this Python and this place."""
    stated = [READER, SITE, TESTER, ROOT / "pyproject.toml", *WHEELS.glob("camviz-*.whl")]
    parts = [path.read_bytes() for path in stated if path.exists()]
    parts += [sys.version.encode(), sys.base_prefix.encode(), str(ROOT).encode()]
    return hashlib.sha256(b"\0".join(parts)).hexdigest()


def run(*command, cwd=None):
    """The exit status of a command; Ctrl-C is the command's business."""
    child = subprocess.Popen([str(part) for part in command], cwd=cwd)
    while True:
        try:
            return child.wait()
        except KeyboardInterrupt:
            continue


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
