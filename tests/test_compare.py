"""How far two calibrations differ is said first, as numbers that are true."""

import json
from dataclasses import replace

import numpy as np
import pytest

from camviz.lenses import BrownConrady
from camviz_clinic.checks import inspect
from camviz_clinic.checks.virtual import alone, healthy, single
from camviz_clinic.report.inspection import report


@pytest.fixture(scope="module")
def solved():
    return healthy(np.random.default_rng(4))


def test_the_numbers_are_those_of_the_polynomial(solved):
    """k1 moves a point at r by fx k1 r³; nothing else differs, and no rotation is implied by what is symmetric."""
    camera = solved.cameras["camera"]
    grid = replace(camera.intrinsics, cx=(camera.intrinsics.width - 1) / 2, cy=(camera.intrinsics.height - 1) / 2)
    grid = replace(grid, fy=grid.fx)
    one, other = (alone(solved, replace(camera, intrinsics=grid, lens=BrownConrady(k1=k1))) for k1 in (0.0, 0.02))
    inspection = inspect(one, compare=other)
    (apart,) = inspection.differences
    u, v = np.meshgrid(np.linspace(0, grid.width - 1, 200), np.linspace(0, grid.height - 1, 200))
    r = np.hypot(*np.moveaxis(grid.from_pixels(np.stack([u, v], axis=-1)), -1, 0))
    assert apart.median == pytest.approx(np.median(grid.fx * 0.02 * r**3), rel=0.1)
    assert apart.turn_deg < 0.01
    assert apart.sigmas is None
    (finding,) = [each for each in inspection.findings if each.id == "models-differ"]
    assert finding.value == apart.median
    assert inspection.as_text().startswith(apart.sentence)
    assert json.loads(inspection.as_json())["differences"][0]["median"] == apart.median
    page = report(inspection)
    assert page.index(apart.sentence) < page.index('class="verdict"')


@pytest.mark.thorough
def test_two_solutions_of_one_camera_from_other_views_agree_and_it_is_said_how_well():
    for seed in range(3):
        rng = np.random.default_rng(seed)
        set_up = single(rng, views=16)
        one, other = (set_up.solved(set_up.observed(rng)) for _ in range(2))
        inspection = inspect(one, compare=other)
        (apart,) = inspection.differences
        assert 0 < apart.sigmas < 3
        assert ("models-differ" in {each.id for each in inspection.findings}) == (apart.median > 0.5)


def test_a_difference_of_half_a_pixel_is_found_where_the_corners_show_that_it_is_no_noise():
    """Corners of the image that are half a pixel off are far beyond the noise of these corners."""
    rng = np.random.default_rng(9)
    set_up = replace(single(rng, views=20), noise=0.01)
    lens = replace(set_up.camera.lens, k1=set_up.camera.lens.k1 + 0.002)
    changed = replace(set_up, cameras=(replace(set_up.camera, lens=lens),))
    one, other = (each.solved(each.observed(rng)) for each in (set_up, changed))
    inspection = inspect(one, compare=other)
    (apart,) = inspection.differences
    assert apart.median < 0.5
    assert "models-differ" in {each.id for each in inspection.findings}
