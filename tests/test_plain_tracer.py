"""The tracer that is quick and the one that is plain take the same picture."""

import numpy as np
import pytest

from camviz.cameras import Camera, Intrinsics, look_at
from camviz.lenses import Equidistant, KannalaBrandt, Perspective, UnifiedSphere
from camviz.scenes import textured_scene, to_display
from camviz.scenes.plain_tracer import render_plainly
from camviz.scenes.scene import NEUTRAL

SMALL = Intrinsics(160, 120, 90.0, 90.0, 79.5, 59.5)
BESIDE = look_at([1.5, -0.6, -1.0], [0.0, 0.0, 4.0])


@pytest.mark.parametrize("lens", [Perspective(), KannalaBrandt(0.05, -0.01), Equidistant(), UnifiedSphere(0.9)])
def test_both_tracers_agree_within_one_level(lens):
    camera = Camera(SMALL, lens, BESIDE)
    directions = camera.unproject(np.stack(np.meshgrid(np.arange(160.0), np.arange(120.0)), axis=-1))
    quick, _ = textured_scene().trace(camera.centre, directions)
    levels = to_display(quick).astype(int) - to_display(render_plainly(textured_scene(), camera)).astype(int)
    assert np.abs(levels).max() <= 1


def test_pixels_without_a_ray_are_neutral():
    camera = Camera(Intrinsics(80, 60, 8.0, 8.0, 39.5, 29.5), Equidistant())
    picture = render_plainly(textured_scene(), camera)
    assert (picture[0, 0] == NEUTRAL).all()
    assert (picture[30, 40] != NEUTRAL).any()
