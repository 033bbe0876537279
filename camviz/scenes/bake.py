"""The garden's pictures, painted once and kept beside this file: `python -m camviz.scenes.bake` paints them afresh.

A reader's kernel only opens them: painting takes a quarter of a second and sixty megabytes, and a class of sixty would
paint the same garden sixty times.
"""

from __future__ import annotations

from collections.abc import Iterator
from importlib.resources import as_file, files

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz.scenes import paint
from camviz.scenes.all_round import KEPT, ORIGIN, traced_all_round
from camviz.scenes.light import SKYLIGHT, SUN, sunlight, to_display, to_linear
from camviz.scenes.photographs import photograph
from camviz.scenes.scene import Scene
from camviz.scenes.standard import terrace_edges, things

_OPTIONS = [cv2.IMWRITE_JPEG_QUALITY, 93, cv2.IMWRITE_JPEG_SAMPLING_FACTOR, cv2.IMWRITE_JPEG_SAMPLING_FACTOR_444]


def painted() -> Iterator[tuple[str, paint.Picture]]:
    """Each picture's name and its sRGB bytes (height, width, 3): things, the terrace in their shade, then all of it."""
    yield "sky", _smaller(paint.sky(), 3 / 4)
    yield "bricks", _smaller(paint.bricks(), 1 / 2)
    yield "planks", paint.planks()
    yield "cat", paint.framed(_smaller(photograph("chelsea"), 1 / 2))
    yield "lawn", to_display(to_linear(paint.lawn()) * sunlight((0, -1, 0)))
    yield "globe", to_display(paint.lit_round(_smaller(paint.globe(), 3 / 4)))
    yield "leaves", to_display(paint.lit_round(paint.leaves()))
    yield "terrace", _terrace()
    yield KEPT, traced_all_round(ORIGIN)


def _terrace() -> paint.Picture:
    """Flagstones with the shadows of the things that stand on them, soft as half of its texels are."""
    corner, across, down = terrace_edges()
    light = to_linear(paint.paving(15, 24))
    height, width = light.shape[:2]
    s, r = (np.arange(0, width, 2) + 1) / width, (np.arange(0, height, 2) + 1) / height
    points = corner + s[None, :, None] * across + r[:, None, None] * down
    _, depth = Scene(things()).trace(points, SUN / np.linalg.norm(SUN))
    lit = cv2.resize(np.isnan(depth).astype(np.float32), (width, height), interpolation=cv2.INTER_LINEAR)
    return to_display(light * (SKYLIGHT + (sunlight((0, -1, 0)) - SKYLIGHT) * lit)[..., None])


def _smaller(picture: NDArray[np.uint8], scale: float) -> NDArray[np.uint8]:
    """The picture at the size at which it is seen."""
    small = cv2.resize(picture, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)
    return np.asarray(small, dtype=np.uint8)


def main() -> None:
    """Write every picture into the package."""
    with as_file(files("camviz.scenes") / "pictures") as folder:
        folder.mkdir(exist_ok=True)
        for name, picture in painted():
            path = folder / f"{name}.jpg"
            cv2.imwrite(str(path), picture[..., ::-1], _OPTIONS)
            print(f"{path.name:12} {picture.shape[1]} × {picture.shape[0]}, {path.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
