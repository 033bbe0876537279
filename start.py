"""Set camviz up and open its lessons. Needs Python 3.11 or newer, nothing else; the first time also a network.

    python start.py                 open the lessons in JupyterLab
    python start.py test            run the tests: the package's, and every lesson from top to bottom
    python start.py COMMAND ...     any other command of camviz, such as: doctor, show FILE

Everything is installed into the folder .venv beside this file and nowhere else. Delete that folder to undo it.
"""

import hashlib
import importlib.util
import os
import shutil
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parent
VENV = ROOT / ".venv"
STAMP = VENV / "camviz-setup.txt"
PYTHON = VENV / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
TESTS = ("-m", "pytest", "-n", "auto", "--dist", "loadscope")


def main(words):
    if words and words[0] in ("-h", "--help"):
        print(__doc__)
        return 0
    set_up()
    if words and words[0] == "test":
        return run(PYTHON, *TESTS, *words[1:], cwd=ROOT)
    return run(PYTHON, "-m", "camviz", *(words or ["lab"]))


def set_up():
    """Make .venv hold exactly what requirements.lock says; at once, and offline, when it already does."""
    if STAMP.exists() and STAMP.read_text() == fingerprint():
        return
    if sys.version_info < (3, 11):  # noqa: UP036 - this file must also run where the package cannot
        sys.exit("camviz needs Python 3.11 or newer; this is {}.{}.".format(*sys.version_info[:2]))
    if not importlib.util.find_spec("ensurepip"):
        sys.exit("This Python cannot make virtual environments. On Debian and Ubuntu: sudo apt install python3-venv")
    if VENV.exists() and not STAMP.exists():
        sys.exit(f"{VENV} was not made by start.py. Move it away, or delete it, and start again.")
    print(f"Setting up camviz in {VENV}: once, some minutes and about 1.7 GB.", flush=True)
    make_venv()
    pip = [PYTHON, "-m", "pip", "--disable-pip-version-check", "--no-input", "install"]
    if not sys.stdout.isatty():
        pip.append("--quiet")  # a log needs no progress bars
    if run(*pip, "--require-hashes", "-r", ROOT / "requirements.lock") or run(*pip, "--no-deps", "--editable", ROOT):
        sys.exit("The set-up did not finish: pip says why above. With no network it cannot; otherwise start again.")
    STAMP.write_text(fingerprint())


def make_venv():
    import venv

    shutil.rmtree(VENV, ignore_errors=True)
    VENV.mkdir(exist_ok=True)
    STAMP.write_text("unfinished")
    venv.create(VENV, symlinks=os.name != "nt", with_pip=True)


def fingerprint():
    """What the installation depends on: the lock, the package's metadata, this Python and this place."""
    parts = [(ROOT / name).read_bytes() for name in ("requirements.lock", "pyproject.toml")]
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
