"""How far other people's calibration files, read by camviz, project from the equations that their programs define.

    CAMVIZ_FIELD=~/field python tools/benchmarks/formats.py

formats.toml says which files, and how to have them. references.py reads each a second time, with nothing of camviz, and
100 points before each of its cameras are projected by the format's own formula. Printed is a Markdown table: the
cameras, the largest distance in pixels between the two, and, for points of the world, the same with the poses of the
file, whose rotations are rounded there and exact in camviz.
"""

from __future__ import annotations

import hashlib
import os
import tomllib
from pathlib import Path

import numpy as np
from equations import Reference
from kernel import table
from references import REFERENCES

from camviz.cameras import Camera, transform
from camviz_clinic.files import format_of, load
from camviz_clinic.files.format import File

MANIFEST = Path(__file__).with_name("formats.toml")
POINTS = np.random.default_rng(11).uniform([-0.4, -0.3, 1.0], [0.4, 0.3, 3.0], size=(100, 3))


def apart(ours: Camera, theirs: Reference) -> tuple[float, float]:
    """The largest distance in pixels, of points in the camera's frame and of the same in the world's."""
    inside = np.abs(ours.project(transform(ours.world_from_cam, POINTS)) - theirs.project(POINTS)).max()
    world = (POINTS - theirs.t) @ np.linalg.inv(theirs.R).T
    return float(inside), float(np.abs(ours.project(world) - theirs.project(POINTS)).max())


def row(entry: dict[str, object]) -> list[str]:
    """A line of the table, or why there is none."""
    repository, name = str(entry["repository"]), str(entry["path"])
    path = Path(os.environ["CAMVIZ_FIELD"], repository.replace("/", "+"), name)
    head = [str(entry["format"]), f"{repository}: {name}", str(entry["licence"])]
    if not path.is_file() or hashlib.sha256(path.read_bytes()).hexdigest() != entry["sha256"]:
        return [*head, "not there, or another file", "", ""]
    if format_of(File(path)).name != entry["format"]:
        return [*head, f"read as {format_of(File(path)).name}", "", ""]
    cameras = load(path, size=tuple(entry["size"]) if "size" in entry else None).cameras  # type: ignore[arg-type]
    references = list(REFERENCES[head[0]](path))
    found = [apart(*pair) for pair in zip(cameras.values(), references, strict=True)]
    return [*head, str(len(found)), *(f"{max(each):.1e}" for each in zip(*found, strict=True))]


if __name__ == "__main__":
    entries = tomllib.loads(MANIFEST.read_text(encoding="utf-8"))["file"]
    print(table(["format", "file", "licence", "cameras", "lens, px", "with pose, px"], [row(each) for each in entries]))
