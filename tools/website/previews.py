"""The picture that a link to a lesson shows: its first visualizer's, as PNG."""

from __future__ import annotations

import io
from pathlib import Path

from PIL import Image

from camviz.draw.picture import Picture

FOLDER = "_previews"
WIDTH = 1200  # pixels


def path_of(lesson: str, site: Path) -> Path:
    """Where a lesson's preview is."""
    return site / FOLDER / f"{lesson}.png"


def write(picture: Picture, lesson: str, site: Path) -> None:
    """Write a lesson's preview."""
    path = path_of(lesson, site)
    path.parent.mkdir(parents=True, exist_ok=True)
    raster(picture, WIDTH).save(path, optimize=True)


def sizes(site: Path) -> dict[str, tuple[int, int]]:
    """The width and the height of each preview, by its lesson."""
    found = {}
    for path in sorted((site / FOLDER).glob("*.png")):
        with Image.open(path) as image:
            found[path.stem] = image.size
    return found


def raster(picture: Picture, width: int) -> Image.Image:
    """The picture in light colours, `width` pixels wide."""
    from cairosvg import svg2png

    return Image.open(io.BytesIO(svg2png(picture.portable().encode(), output_width=width))).convert("RGB")
