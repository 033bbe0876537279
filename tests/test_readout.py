"""Read-out: charge that is carried, and rows that each see the world at their own time."""

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation
from scipy.stats import nbinom

from camviz.cameras import Camera, Intrinsics
from camviz.scenes import render, textured_scene
from camviz.scenes.scene import Scene
from camviz.scenes.surfaces import Rectangle
from camviz.scenes.texture import Texture
from camviz.sensors import (
    PUBLISHED,
    SHUTTERS,
    bloomed,
    bucket_brigade,
    decibel,
    gliding,
    rolling_picture,
    rolling_rays,
    row_times,
    smeared,
    transferred,
)

CHARGE = np.random.default_rng(1).integers(0, 900, (5, 7)).astype(float)


def shifted_by_hand(charge: np.ndarray, efficiency: float, ticks: int) -> np.ndarray:
    """Every bucket passes a share on at each shift: what reaches the register, shift by shift."""
    buckets, arrived = charge.copy(), []
    for _ in range(ticks):
        moved = efficiency * buckets
        buckets -= moved
        buckets[:-1] += moved[1:]
        arrived.append(moved[0])
    return np.array(arrived)


@pytest.mark.parametrize("ticks", [0, 1, 6, 7, 8, 20, 34, 35])
def test_a_brigade_loses_nothing_and_reads_in_order(ticks):
    state = bucket_brigade(CHARGE, ticks)
    assert state.area.sum() + state.register.sum() + state.read.sum() == CHARGE.sum()
    np.testing.assert_array_equal(state.read, CHARGE.ravel()[:ticks])


def test_a_brigade_is_the_one_that_moves_bucket_by_bucket():
    area, register, read = CHARGE.copy(), np.zeros(7), []
    for tick in range(35):
        if tick % 7 == 0:
            register, area = area[0].copy(), np.vstack([area[1:], np.zeros(7)])
        read.append(register[0])
        register = np.append(register[1:], 0)
        state = bucket_brigade(CHARGE, tick + 1)
        np.testing.assert_array_equal(state.read, read)
        np.testing.assert_array_equal(state.area, area)
        np.testing.assert_array_equal(state.register, register)


@pytest.mark.parametrize("efficiency", [1.0, 0.9999, 0.97, 0.8])
def test_the_closed_form_of_transfer_is_what_shifting_does(efficiency):
    closed = transferred(CHARGE, efficiency, overscan=4)
    np.testing.assert_allclose(closed, shifted_by_hand(CHARGE, efficiency, 9), rtol=1e-6, atol=1e-3)


def test_a_point_arrives_with_a_tail_after_the_negative_binomial_law():
    point = np.zeros((30, 1))
    point[19] = 1.0
    arrived = transferred(point, 0.95, overscan=40)[19:, 0]
    np.testing.assert_allclose(arrived, nbinom.pmf(np.arange(51), 20, 0.95), atol=1e-7)


def test_a_good_register_keeps_most_of_a_long_way():
    """KAF-50100: 0.999999 for each vertical shift, 6132 of them: 99.4 % arrive in place."""
    column = np.zeros((6132, 1))
    column[-1] = 40_300
    assert transferred(column, 0.999999)[-1, 0] / 40_300 == pytest.approx(np.exp(-6132e-6), abs=1e-5)


def test_smear_is_a_stripe_through_the_whole_column_and_no_other():
    """A lamp of 200 rows' light, 1 µs per row and 10 ms exposure: each pixel of the column gains 200/10 000."""
    picture = np.zeros((480, 8))
    picture[100:300, 3] = 5000.0
    extra = smeared(picture, 10e-3, 1e-6) - picture
    np.testing.assert_allclose(extra[:, 3], 5000 * 200 * 1e-4)
    assert extra[:, [0, 1, 2, 4, 5, 6, 7]].max() == 0


def test_blooming_spills_both_ways_and_loses_nothing_inside():
    column = np.zeros((21, 3))
    column[10, 1] = 7000.0
    held = bloomed(column, 1000)
    assert held[:, 1].tolist() == [0.0] * 7 + [1000.0] * 7 + [0.0] * 7
    assert held[:, [0, 2]].max() == 0
    crowded = np.random.default_rng(2).uniform(0, 1900, (200, 5))
    crowded[:60] = crowded[-60:] = 0
    spilled = bloomed(crowded, 1000)
    assert spilled.max() <= 1000 + 1e-9
    np.testing.assert_allclose(spilled.sum(axis=0), crowded.sum(axis=0))


def pole_scene():
    """A dark upright pole 0.2 m wide, 5 m ahead, before a white wall."""
    white, black = (Texture.plain(colour) for colour in ((1.0, 1.0, 1.0), (0.0, 0.0, 0.0)))
    wall = Rectangle(np.array([-50.0, -50, 8]), np.array([100.0, 0, 0]), np.array([0, 100.0, 0]), white)
    pole = Rectangle(np.array([-0.1, -50, 5]), np.array([0.2, 0, 0]), np.array([0, 100.0, 0]), black)
    return Scene([pole, wall])


def test_a_rolling_shutter_leans_a_pole_by_the_closed_form():
    """From a train at v the pole crosses the image at f v / Z px/s, so row i finds it f v i t_row / Z to the left."""
    camera = Camera(Intrinsics.from_fov(320, 240, 60))
    speed, row_s = 4.0, 1e-4
    picture = rolling_picture(pole_scene(), camera, gliding(camera, (speed, 0, 0)), row_s)[..., 0]
    dark = 1 - picture
    middle = (dark * np.arange(320)).sum(axis=1) / dark.sum(axis=1)
    expected = camera.intrinsics.cx - camera.intrinsics.fx * speed / 5 * row_s * np.arange(240)
    assert np.abs(middle - expected).max() < 0.5  # one ray per pixel: an edge is known to half of one
    assert np.polyfit(np.arange(240), middle, 1)[0] == pytest.approx(
        -camera.intrinsics.fx * speed / 5 * row_s, rel=0.01
    )


def test_a_global_shutter_sees_what_a_camera_at_rest_sees():
    camera = Camera(Intrinsics.from_fov(80, 60, 60))
    moving = rolling_picture(textured_scene(), camera, gliding(camera, (30, 0, 0)), 0.0)
    np.testing.assert_allclose(moving, render(textured_scene(), camera), atol=2e-3)


def test_each_rows_rays_are_those_of_a_camera_standing_there():
    camera = Camera(Intrinsics.from_fov(16, 12, 70))
    turns = Rotation.from_rotvec(np.linspace(0, 0.4, 12)[:, None] * (0.2, 1, 0.1))
    poses = RigidTransform.from_components(np.linspace((0, 0, 0), (1, 2, 3), 12), turns)
    origins, directions = rolling_rays(camera, poses)
    for v in (0, 5, 11):
        there = camera.at(poses[v])
        np.testing.assert_allclose(origins[v, 0], there.centre)
        np.testing.assert_allclose(directions[v], there.rays()[v], atol=1e-12)


def test_rows_are_exposed_one_after_the_other():
    np.testing.assert_allclose(row_times(4, 2e-5, 1e-3), 5e-4 + np.array([0, 2e-5, 4e-5, 6e-5]))


@pytest.mark.parametrize("published", PUBLISHED, ids=lambda one: f"{one.name}, {one.camera}")
def test_published_figures_agree_with_each_other(published):
    """The dynamic range stated lies between that over the threshold, with quantisation, and that over σ_d alone.

    Sheets differ in which they divide by; half a tenth of a bit or of a dB is rounding.
    """
    strict = float(decibel(published.sensor.dynamic_range()))
    loose = float(decibel(published.sensor.full_well_e / published.sensor.read_noise_e))
    assert published.sensor.saturation_e == pytest.approx(published.sensor.full_well_e, rel=0.01)
    if np.isfinite(published.stated_dynamic_range_db):
        assert strict - 0.3 < published.stated_dynamic_range_db < loose + 0.3


def test_maximal_snr_as_published():
    """IMX174 45.12 dB, ICX625 37.71 dB and 38.4 dB: 10 log10 of the full well."""
    stated = {"Point Grey, global shutter": 45.12, "Point Grey GS3-PGE-50S5M-C": 37.71, "Basler piA2400-17gm": 38.4}
    for published in PUBLISHED:
        if published.camera in stated:
            assert decibel(published.sensor.full_well_e**0.5) == pytest.approx(stated[published.camera], abs=0.06)


def test_telephones_read_a_frame_in_some_thirtieth_of_a_second():
    assert all(1 / 45 < one.frame_s < 1 / 20 for one in SHUTTERS)
    assert SHUTTERS[3].row_s == pytest.approx(24.12e-6)


def test_what_cannot_be_read_out_is_refused():
    with pytest.raises(ValueError, match="ticks must lie between 0 and the 35"):
        bucket_brigade(CHARGE, 36)
    with pytest.raises(ValueError, match="efficiency"):
        transferred(CHARGE, 1.01)
    with pytest.raises(ValueError, match="exposure_s"):
        smeared(CHARGE, 0, 1e-6)
    with pytest.raises(ValueError, match="electrons must be one number"):
        bloomed(np.zeros(4), 100)
    with pytest.raises(ValueError, match="one for each of the 12 rows"):
        rolling_rays(Camera(Intrinsics.from_fov(16, 12, 70)), RigidTransform.identity())
