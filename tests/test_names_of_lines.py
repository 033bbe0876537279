"""The names in a plot of lines stand clear of the curves, wherever the controls put these."""

from itertools import product

import numpy as np
import pytest

from camviz.draw.labels import words_of
from camviz.draw.picture import Picture
from camviz.views.distortion import DistortionView
from camviz_school.views.depth_of_field import DepthOfFieldView

LENSES = [(0.2959, -1.0354), (-1.0, -1.0), (-0.6, 0.0), (-0.3, 0.0), (0.3, -0.3), (1.0, -1.0), (-0.28, 0.07)]


def crossed(picture: Picture, tile: str, panel: str, name: str, curves: set[str]) -> float:
    """How much of the curves, in picture units, runs through the words that begin with `name`; NaN without them."""
    (shown,) = (one for one in picture.tiles if one.name == tile)
    x, y, width, height = shown.cell
    marks = shown.uncluttered()
    found = [words for words in words_of(marks, (x, y, x + width, y + height)) if words.text.startswith(name)]
    if not found:
        return np.nan
    left, top, right, bottom = found[0].box
    inset, within = marks.panels()[panel], 0.0
    for line in (line for mark in inset.marks if mark.class_ in curves for line in mark.lines):
        at = line + (inset.x, inset.y)
        steps = np.linspace(at[:-1], at[1:], 20).reshape(-1, 2)
        inside = (steps > (left + 1, top + 1)) & (steps < (right - 1, bottom - 1))
        within += float(inside.all(axis=1).sum())
    return within


@pytest.mark.parametrize(("k1", "k2"), LENSES)
def test_fold_and_image_corner_are_named_beside_the_curve(k1, k2):
    view = DistortionView(k1=k1, k2=k2, panels="picture curve")
    picture = view.figure(draft=True)
    lines = {"blue thick", "red thick dotted", "muted dashed", "green dashed"}
    assert crossed(picture, "radial curve", "curve", "image corner", lines) == 0
    fold = crossed(picture, "radial curve", "curve", "folds at", lines)
    assert np.isnan(fold) if view.numbers()["fold"] == "none" else fold == 0


@pytest.mark.parametrize("focal_mm", [20, 35, 100])
def test_blur_and_airy_disc_are_named_beside_the_curve(focal_mm):
    for f_number, focus_m in product((1.4, 2.8, 5.6, 8, 22), (0.8, 1.3, 2, 3, 5, 10)):
        view = DepthOfFieldView(
            focal_mm=focal_mm, f_number=f_number, focus_m=focus_m, diffraction=True, panels="photograph blur"
        )
        picture = view.figure(draft=True)
        ways = [crossed(picture, "blur", "blur", name, {"blue thick"}) for name in ("allowed", "Airy disc")]
        assert ways == [0, 0], (f_number, focus_m)
