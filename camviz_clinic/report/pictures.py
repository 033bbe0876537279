"""Pictures of a report: their photographs as WebP, their places kept free until they come near the screen."""

from __future__ import annotations

import io
from dataclasses import replace
from html import escape

from PIL import Image

from camviz.draw.picture import Picture

QUALITY = 85  # of WebP, for photographs; maps and masks (PNG) keep every pixel


def embedded(picture: Picture) -> str:
    """The flowing tiles as HTML, with their photographs inside, as WebP.

    `report.css` lets a browser draw a tile when it comes near the screen. It has its size before, so nothing moves.
    """
    photographs = {name: webp(data, QUALITY) for name, data in picture.photographs.items()}
    return replace(picture, photographs=photographs).embedded()


def figure(name: str, picture: Picture) -> str:
    """A picture as a figure under its caption, if it has a name."""
    caption = f"<figcaption>{escape(name)}</figcaption>" if name else ""
    return f"<figure>{caption}{embedded(picture)}</figure>"


def webp(data: bytes, quality: int, effort: int = 4) -> bytes:
    """A JPEG or PNG as WebP: a PNG keeps every pixel, a JPEG is stored with `quality` 0 … 100.

    More `effort`, 0 … 6, takes longer and makes fewer bytes.

    >>> from camviz.draw.picture import png
    >>> import numpy as np
    >>> level = png(np.full((100, 100, 3), 200, np.uint8))
    >>> made = webp(level, QUALITY)
    >>> made[8:12], len(made) < len(level)
    (b'WEBP', True)
    """
    with Image.open(io.BytesIO(data)) as image, io.BytesIO() as made:
        image.save(made, "WEBP", quality=quality, method=effort, lossless=image.format == "PNG")
        return made.getvalue()
