"""Photographs beside each other, each with its caption."""

from collections.abc import Mapping
from math import inf

import numpy as np

from camviz.draw import labels, svg
from camviz.draw.flow import WIDTH, Tile
from camviz.draw.panel import image_panel, placed_image
from camviz.draw.picture import Picture, jpeg

_MARGIN = 10.0
_NARROW = 259  # CSS pixels, of a picture on a telephone: there a caption has most lines


def side_by_side(images: Mapping[str, np.ndarray], title: str = "Pictures") -> Picture:
    """The uint8 images, RGB (height, width, 3) or grey, in rows of at most four, each a tile over its caption."""
    across = 3 if len(images) > 4 else max(2, len(images))
    width = WIDTH / across
    tiles = list[Tile]()
    for i, (caption, image) in enumerate(images.items()):
        left, top = (
            i % across * width,
            max((tile.cell[1] + tile.cell[3] for tile in tiles[: i - i % across]), default=0),
        )
        tiles.append(_tile(f"picture{i}", caption, image, left, top, width))
    described = "From left to right: " + "; ".join(images) + "."
    attached = {f"picture{i}": jpeg(image) for i, image in enumerate(images.values())}
    return Picture(tuple(tiles), title, described, attached)


def _tile(name: str, caption: str, image: np.ndarray, left: float, top: float, width: float) -> Tile:
    height_px, width_px = image.shape[:2]
    panel = image_panel(name, left + _MARGIN, top + _MARGIN, width - 2 * _MARGIN, width_px, height_px)
    shown = panel.show(placed_image(panel, name, width_px, height_px), label=caption)
    below = svg.paragraph((panel.x, panel.y + panel.height + 22), caption, panel.width / 1.12, "title")  # it is bold
    (words,) = labels.words_of(below, (left, top, left + width, inf), max(1.0, width / _NARROW))
    return Tile(caption, (left, top, width, words.box[3] + 6 - top), shown + below)
