"""A copy of the repository to try things in: what is added there is seen by a camviz that runs there."""

import os
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


@dataclass(frozen=True)
class House:
    """The copy in `root`. `before` holds each file's bytes as they were when it was made."""

    root: Path
    before: dict[str, bytes]

    def add(self, files: dict[str, str]) -> None:
        """Writes files that are not there yet, by their paths from the top of the repository."""
        for path, text in files.items():
            assert path not in self.before, f"{path} is there already"
            (self.root / path).parent.mkdir(parents=True, exist_ok=True)
            (self.root / path).write_text(text, encoding="utf-8")

    def run(self, *arguments: str, status: int = 0) -> str:
        """What `python ARGUMENTS` prints there."""
        environment = {**os.environ, "PYTHONPATH": str(self.root)}
        done = subprocess.run(
            [sys.executable, *arguments], cwd=self.root, env=environment, capture_output=True, text=True, check=False
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


def _files(folder: Path) -> dict[str, bytes]:
    """Each file's bytes; what Python compiled them to, which each run there leaves to the next, does not count."""
    files = (path for path in folder.rglob("*") if path.is_file() and path.suffix != ".pyc")
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}
