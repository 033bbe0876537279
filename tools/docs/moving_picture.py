"""Draw the README's moving picture anew: python tools/docs/moving_picture.py.

Eight seconds of a lens at dusk, its focus moved to both ends and back.
"""

import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tools/website"))
import previews  # noqa: E402

from camviz.draw.picture import Picture  # noqa: E402
from camviz.views.base import View  # noqa: E402
from camviz_school.views.depth_of_field import DepthOfFieldView  # noqa: E402

SECONDS, POSITIONS = 8, 25
WIDTH = 800  # pixels


def moved(view: View, name: str) -> list[Picture]:
    """The pictures along a slider: from where it stands to its upper end, to its lower, and back."""
    slider = view.controls()[name]
    places = np.geomspace if slider.low > 0 else np.linspace
    values = sorted({*places(slider.low, slider.high, POSITIONS), getattr(view, name)})
    drawn = [view.but(**{name: value}).figure() for value in values]
    first = values.index(getattr(view, name))
    return [*drawn[first:], *drawn[-2::-1], *drawn[1:first]]


if __name__ == "__main__":
    pictures = moved(DepthOfFieldView.at_dusk(panels="rays photograph"), "focus_m")
    frames = {id(picture): previews.raster(picture, WIDTH) for picture in pictures}
    first, *others = (frames[id(picture)] for picture in pictures)
    path, length = ROOT / "docs/images/depth_of_field.webp", round(1000 * SECONDS / len(pictures))
    first.save(path, save_all=True, append_images=others, duration=length, loop=0, quality=60)
    print(f"{path}: {path.stat().st_size / 1e3:.0f} kB")
