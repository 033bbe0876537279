"""A copy of the repository to try things in: what is added there is seen by a camviz that runs there."""

import os
import re
import shutil
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
COPIED = (
    "camviz",
    "camviz_clinic",
    "camviz_school",
    "lessons",
    "docs",
    "tests",
    "tools",
    "README.md",
    "pyproject.toml",
    "conftest.py",
)
EXAMPLE = re.compile(r"^`(?P<path>[^`\n]+)`\n(?P<fence>`{3,})\w*\n(?P<text>.*?)^(?P=fence)$", re.MULTILINE | re.DOTALL)
RECIPES = (ROOT / "docs/recipes.md").read_text(encoding="utf-8")


def examples(heading: str, page: str = RECIPES) -> dict[str, str]:
    """The files of a section of docs/recipes.md, and the rows of those that are there already, by their paths."""
    section = re.split(r"^## ", page.partition(f"\n## {heading}\n")[2], maxsplit=1, flags=re.MULTILINE)[0]
    found = {each["path"]: each["text"] for each in EXAMPLE.finditer(section)}
    assert found, f"docs/recipes.md has no example of {heading}"
    return found


@dataclass(frozen=True)
class House:
    """The copy in `root`. `before` holds each file's bytes as they were when it was made."""

    root: Path
    before: dict[str, bytes]

    def add(self, files: dict[str, str]) -> None:
        """Writes new files, and rows into files that are there, by their paths from the top of the repository."""
        for path, text in files.items():
            if path in self.before:
                text = _with_rows(self.text(path), text)
            (self.root / path).parent.mkdir(parents=True, exist_ok=True)
            (self.root / path).write_text(text, encoding="utf-8")

    def run(self, *arguments: str, status: int = 0) -> str:
        """What `python ARGUMENTS` prints there."""
        environment = {**os.environ, "PYTHONPATH": str(self.root), "PYTHONUTF8": "1"}
        done = subprocess.run(
            [sys.executable, *arguments],
            cwd=self.root,
            env=environment,
            capture_output=True,
            encoding="utf-8",
            check=False,
        )
        assert done.returncode == status, done.stdout + done.stderr
        return done.stdout

    def text(self, path: str) -> str:
        return (self.root / path).read_text(encoding="utf-8")

    def touched(self) -> set[str]:
        """The files that are new or other than they were."""
        now = _files(self.root)
        return {path for path in now.keys() | self.before.keys() if now.get(path) != self.before.get(path)}


def house(folder: Path) -> House:
    """A copy of the repository in a folder that is not there yet."""
    for name in COPIED:
        if (ROOT / name).is_dir():
            shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns(".ipynb*"))
        else:
            shutil.copyfile(ROOT / name, folder / name)
    return House(folder, _files(folder))


def _with_rows(text: str, rows: str) -> str:
    """A file's text with the rows that have a + in front, each beneath the one above it, which the file has once."""
    above = ""
    for mark, row in re.findall(r"^([ +])(.*\n)", rows, re.MULTILINE):
        if mark == "+":
            text = text.replace(above, above + row)
        above = row
        assert text.count(above) == 1, above
    return text


def _files(folder: Path) -> dict[str, bytes]:
    """Each file's bytes; what Python compiled them to, which each run there leaves to the next, does not count."""
    files = (path for path in folder.rglob("*") if path.is_file() and path.suffix != ".pyc")
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}
