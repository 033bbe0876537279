"""A working copy of the lessons: laid out where a reader wants it, and never over what the reader wrote."""

from __future__ import annotations

import hashlib
import json
import os
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory

from camviz_school.course.material import MATERIAL

MANIFEST = ".camviz-lessons.json"
_SKIPPED = {".ipynb_checkpoints", "__pycache__", MATERIAL}
"""Folders that are not laid out; the package reads the material, solutions among it, where it is."""


def edition(folder: Path) -> str | None:
    """Whose lessons were laid out in a folder, "student" or "teacher"; None where none were."""
    return str(_manifest(folder).get("edition", "student")) if (folder / MANIFEST).is_file() else None


def lay_out(source: Path, folder: Path, version: str, edition: str = "student") -> list[str]:
    """Copy the lessons into `folder`, and return what a reader should know, in sentences.

    A file is written where there is none and where it still is what was laid out before. One that the reader changed
    stays, and a new version of it is put beside it as NAME.new-VERSION.SUFFIX.
    """
    folder.mkdir(parents=True, exist_ok=True)
    laid_out = _laid_out(folder)
    sentences = [f"The lessons are in {folder}."] if not laid_out else []
    for path in sorted(source.rglob("*")):
        if path.is_file() and not _SKIPPED & set(path.relative_to(source).parts):
            name = path.relative_to(source)
            sentences += _lay_out_one(path.read_bytes(), folder, name, version, laid_out)
    manifest = {"version": version, "edition": edition, "files": laid_out}
    _write(folder / MANIFEST, json.dumps(manifest, indent=1).encode())
    return sentences


def _lay_out_one(content: bytes, folder: Path, name: Path, version: str, laid_out: dict[str, str]) -> list[str]:
    new, before = _sha256(content), laid_out.get(name.as_posix())
    if _place(content, folder, name, laid_out) or new == before:
        return []
    for again in ("", *(f"-{count}" for count in range(2, 100))):  # a new version may have been changed, too
        beside = name.with_name(f"{name.stem}.new-{version}{again}{name.suffix}")
        known = (folder / beside).exists()
        if _place(content, folder, beside, laid_out):
            said = f"You changed {name}: it stays as it is, and its new version is beside it as {beside.name}."
            return [] if known else [said]
    return []


def _place(content: bytes, folder: Path, name: Path, laid_out: dict[str, str]) -> bool:
    """Write one file unless that would lose what a reader wrote; whether the content is there now."""
    target, new = folder / name, _sha256(content)
    if os.path.lexists(target):
        held = _sha256(target.read_bytes()) if target.is_file() and not target.is_symlink() else None
        if held != new and (held is None or held != laid_out.get(name.as_posix())):
            return False
    target.parent.mkdir(parents=True, exist_ok=True)
    _write(target, content)
    laid_out[name.as_posix()] = new
    return True


def _laid_out(folder: Path) -> dict[str, str]:
    """name → sha256 of what was laid out; nothing when there is no manifest or it makes no sense."""
    files = _manifest(folder).get("files")
    return {str(name): str(digest) for name, digest in files.items()} if isinstance(files, dict) else {}


def _manifest(folder: Path) -> dict[str, object]:
    try:
        held = json.loads((folder / MANIFEST).read_text(encoding="utf-8"))
    except (OSError, ValueError, RecursionError):  # the last where it is nested thousands deep
        return {}
    return held if isinstance(held, dict) else {}


def _write(path: Path, content: bytes) -> None:
    if path.is_file() and path.read_bytes() == content:
        return
    try:
        with TemporaryDirectory(dir=path.parent, prefix=".camviz-") as room:
            part = Path(room) / path.name
            part.write_bytes(content)
            if path.exists():
                shutil.copymode(path, part)
            os.replace(part, path)
    except OSError as error:  # whose file name is that of the part
        raise OSError(error.errno, error.strerror, str(path)) from error


def _sha256(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
