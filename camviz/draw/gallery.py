"""Photographs beside each other, each with its caption."""

from collections.abc import Mapping

import numpy as np

from camviz.draw.panel import image_panel, placed_image
from camviz.draw.picture import Picture, jpeg


def side_by_side(images: Mapping[str, np.ndarray], title: str = "Pictures") -> Picture:
    """The uint8 images, RGB (height, width, 3) or grey, in one row under their captions."""
    width = (940 - 20 * len(images)) / len(images)
    body, bottom = "", 0.0
    for i, (caption, image) in enumerate(images.items()):
        height_px, width_px = image.shape[:2]
        panel = image_panel(f"picture{i}", 20 + i * (width + 20), 34, min(width, 460), width_px, height_px)
        body += panel.show(placed_image(panel, f"picture{i}", width_px, height_px), title=caption)
        bottom = max(bottom, panel.y + panel.height)
    described = "From left to right: " + "; ".join(images) + "."
    attached = {f"picture{i}": jpeg(image) for i, image in enumerate(images.values())}
    return Picture.whole(body, 960, bottom + 14, title, described, attached)
