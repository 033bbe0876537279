"""Ten seconds of a visualizer, its first slider moved to both ends, as WebP; and its first picture for links."""

from __future__ import annotations

import io
from pathlib import Path
from typing import Any

import numpy as np
from PIL import Image

from camviz.draw.picture import Picture

CLIPS = "_clips"
SECONDS, POSITIONS = 10, 21
WIDTH = 600  # pixels of a clip
PREVIEW = 1200  # pixels of the picture that a link shows


def write(explorers: list[Any], lesson: str, folder: Path) -> None:
    """Write a clip of each visualizer, under its own name, that no other lesson has, and the lesson's preview."""
    folder.mkdir(parents=True, exist_ok=True)
    for explorer in explorers:
        clip = folder / f"{type(explorer.view).__name__}.webp"
        if not clip.exists():
            shown = [_raster(picture, WIDTH) for picture in moved(explorer)]
            length = round(1000 * SECONDS / len(shown))
            own = clip.with_suffix(f".{lesson}.webp")  # another lesson may be at the same visualizer
            shown[0].save(own, save_all=True, append_images=shown[1:], duration=length, loop=0, quality=60)
            own.replace(clip)
    _raster(explorers[0].view.figure(), PREVIEW).save(folder / f"{lesson}.png", optimize=True)


def moved(explorer: Any) -> list[Picture]:
    """The pictures along the explorer's first slider: from where it stands to its upper end, to its lower, and back.

    One picture for a visualizer without a slider. What cannot be drawn is left out.
    """
    name, slider = next(((name, one) for name, one in explorer._controls.items() if not one.choices), ("", None))
    if slider is None or isinstance(getattr(explorer.view, name), bool):
        return [explorer.view.figure()]
    values = np.linspace(slider.low, slider.high, POSITIONS)
    first = int(np.argmin(np.abs(values - getattr(explorer.view, name))))
    way = [*range(first, POSITIONS), *range(POSITIONS - 2, -1, -1), *range(1, first)]
    whole = isinstance(getattr(explorer.view, name), int)
    drawn = {place: _drawn(explorer.view, {name: round(values[place]) if whole else values[place]}) for place in way}
    return [picture for place in way if (picture := drawn[place])]


def previews(folder: Path) -> dict[str, tuple[int, int]]:
    """The width and the height of each preview in the folder, by its lesson."""
    found = {}
    for path in sorted(folder.glob("*.png")):
        with Image.open(path) as image:
            found[path.stem] = image.size
    return found


def _drawn(view: Any, values: dict[str, Any]) -> Picture | None:
    try:
        picture: Picture = view.but(**values).figure()
    except ValueError:
        return None
    return picture


def _raster(picture: Picture, width: int) -> Image.Image:
    """The picture in light colours, `width` pixels wide."""
    from cairosvg import svg2png

    return Image.open(io.BytesIO(svg2png(picture.portable().encode(), output_width=width))).convert("RGB")
