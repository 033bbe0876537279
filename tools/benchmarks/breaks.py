"""Breaks on purpose, in every room of the house: which tests of the short run find each.

    python tools/benchmarks/breaks.py [--all] [a word of the break …]

Each entry of breaks.toml changes one line, wherever that line now stands, in a copy of the repository, and runs the
tests that it names. `--all` runs them with their thorough halves, too. Prints a table of the breaks; fails where one is
not found. The tests named belong to `python start.py test`, so what they find the short run finds.
"""

from __future__ import annotations

import argparse
import os
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path

ROOT = next(folder for folder in Path(__file__).resolve().parents if (folder / "pyproject.toml").is_file())
LEFT_OUT = shutil.ignore_patterns(".git", ".venv", "build", "__pycache__", ".*_cache", "*.egg-info")
BROKEN_IN = ("camviz", "camviz_clinic", "camviz_school", "lessons", "tools/website", "website")


def the_file_with(line: str, copy: Path) -> Path:
    """The one file that holds a text. Raises ValueError where there is none, or more than one."""
    files = [
        path for folder in BROKEN_IN for path in (copy / folder).rglob("*.*") if path.suffix in (".py", ".js", ".toml")
    ]
    found = [path for path in files if line in path.read_text(encoding="utf-8")]
    if len(found) != 1:
        raise ValueError(f"{line!r} must stand in one file, it stands in {len(found)}")
    return found[0]


def failing(copy: Path, tests: list[str], more: list[str]) -> list[str]:
    """The tests that fail in a copy, by name."""
    command = [sys.executable, "-m", "pytest", "-n", "0", "-q", "-rfE", "-p", "no:cacheprovider", *more, *tests]
    environment = {**os.environ, "PYTHONPATH": str(copy)}
    done = subprocess.run(command, cwd=copy, env=environment, capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1, 2):
        raise RuntimeError(done.stdout + done.stderr)
    return re.findall(r"^(?:FAILED|ERROR) (\S+)", done.stdout, re.MULTILINE)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--all", action="store_true", help="with the thorough halves of the tests")
    parser.add_argument("words", nargs="*", help="only breaks whose description has one of these words")
    options = parser.parse_args()
    breaks = tomllib.loads(Path(__file__).with_suffix(".toml").read_text(encoding="utf-8"))["break"]
    chosen = [one for one in breaks if not options.words or any(word in one["what"] for word in options.words)]
    missed = 0
    print("| where | what is broken | found by |\n|---|---|---|")
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder, "camviz")
        shutil.copytree(ROOT, copy, ignore=LEFT_OUT)
        for one in chosen:
            path = the_file_with(one["old"], copy)
            whole = path.read_text(encoding="utf-8")
            path.write_text(whole.replace(one["old"], one["new"], 1), encoding="utf-8")
            found = failing(copy, one["tests"], ["--all"] * options.all)
            path.write_text(whole, encoding="utf-8")
            missed += not found
            first = f"{len(found)}: `{found[0].rpartition('/')[2]}`" if found else "**nothing**"
            print(f"| {path.relative_to(copy).parent} | {one['what']} | {first} |", flush=True)
    print(f"{len(chosen) - missed} of {len(chosen)} breaks found")
    return bool(missed)


if __name__ == "__main__":
    sys.exit(main())
