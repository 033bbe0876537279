"""Plots on a reader's own axes: what is drawn lies where the mathematics puts it, in the reader's own style."""

import cv2
import matplotlib
import numpy as np
import pytest
from calibrations import RIGHT_FROM_LEFT, TRUE, bare, pair, sick, single
from mpl_toolkits.mplot3d import proj3d

from camviz.cameras import Camera, Intrinsics, Rig
from camviz.lenses import KannalaBrandt
from camviz_clinic import plots
from camviz_clinic.views.observations import Missing, Observations

matplotlib.use("agg")
import matplotlib.pyplot as plt


@pytest.fixture(autouse=True)
def closed():
    yield
    plt.close("all")


def arrows(ax) -> tuple[np.ndarray, np.ndarray]:
    """Where the arrows (n, 2) on axes start, and what they add."""
    (found,) = [one for one in ax.collections if isinstance(one, matplotlib.quiver.Quiver)]
    return found.XY, np.column_stack([found.U, found.V])


def test_residual_arrows_lead_from_projected_to_detected_corners():
    calibration = sick()
    starts, added = arrows(plots.residuals(calibration, view=4, scale=10))
    used = np.isfinite(calibration.detections["camera"][3, :, 0]) & ~calibration.set_aside["camera"][3]
    pose, camera = calibration.cam_from_board["camera"][3], calibration.cameras["camera"]
    projected, _ = cv2.projectPoints(
        calibration.board.corners, pose.rotation.as_rotvec(), pose.translation, camera.intrinsics.K,
        np.array([getattr(camera.lens, name) for name in ("k1", "k2", "p1", "p2", "k3")]),
    )  # fmt: skip
    np.testing.assert_allclose(starts, projected[used, 0], atol=1e-6)
    np.testing.assert_allclose(starts + added / 10, calibration.detections["camera"][3][used], atol=1e-6)


def test_residuals_of_all_views_name_their_rms():
    ax = plots.residuals(single())
    assert len(arrows(ax)[0]) == Observations.of(single()).used.sum()
    assert f"{Observations.of(single()).total_rms:.3g} px RMS" in ax.get_title()


@pytest.mark.parametrize("draw", [plots.residuals, plots.coverage, plots.boards])
def test_what_a_file_does_not_hold_is_named(draw):
    with pytest.raises(Missing, match="does not hold the board"):
        draw(bare())


@pytest.mark.parametrize("view", [0, 11])
def test_a_view_that_is_not_there_is_refused(view):
    with pytest.raises(ValueError, match=rf"view must lie between 1 and 10, got {view}"):
        plots.residuals(single(), view=view)


def test_coverage_has_a_colour_for_every_view_and_all_of_its_corners():
    ax = plots.coverage(single())
    assert len(ax.lines) == 10
    drawn = np.concatenate([line.get_xydata() for line in ax.lines])
    detected = single().detections["camera"].reshape(-1, 2)
    np.testing.assert_array_equal(drawn, detected[np.isfinite(detected[:, 0])])


def test_distortion_arrows_end_where_opencv_puts_the_points():
    starts, added = arrows(plots.distortion(TRUE, step_px=50))
    ideal = np.column_stack([TRUE.intrinsics.from_pixels(starts), np.ones(len(starts))])
    coefficients = np.array([TRUE.lens.k1, TRUE.lens.k2, 0, 0])
    expected, _ = cv2.projectPoints(ideal, np.zeros(3), np.zeros(3), TRUE.intrinsics.K, coefficients)
    np.testing.assert_allclose(starts + added, expected[:, 0], atol=1e-9)


def test_axes_over_a_picture_show_all_of_it_with_v_downwards():
    ax = plots.distortion(TRUE)
    assert ax.get_xlim() == (-0.5, 639.5)
    assert ax.get_ylim() == (479.5, -0.5)


def test_the_radial_curve_is_the_lens_formula():
    fisheye = Camera(Intrinsics(640, 480, 200, 200, 319.5, 239.5), KannalaBrandt(0.02, -0.004))
    degrees, distance = plots.radial(fisheye).lines[0].get_data()
    theta = np.radians(degrees)
    np.testing.assert_allclose(distance, 200 * (theta + 0.02 * theta**3 - 0.004 * theta**5), atol=1e-9)
    assert distance[-1] == pytest.approx(np.hypot(320, 240), abs=0.5)
    assert degrees[-1] > 90


def test_the_relative_curve_of_a_perspective_lens_is_flat_and_of_a_barrel_falls():
    flat = plots.radial(Camera(TRUE.intrinsics), relative=True).lines[0].get_ydata()
    barrel = plots.radial(TRUE, relative=True).lines[0].get_ydata()
    np.testing.assert_allclose(flat, 0, atol=1e-9)
    assert (np.diff(barrel) < 0).mean() > 0.99


def test_what_both_cameras_see_lies_on_its_epipolar_curve():
    right = TRUE.at(RIGHT_FROM_LEFT.inv())
    points = np.random.default_rng(3).uniform((-0.3, -0.2, 0.8), (0.3, 0.2, 3), (12, 3))
    ax = plots.epipolar(TRUE, right, TRUE.project(points))
    assert len(ax.lines) == 12
    for line, seen in zip(ax.lines, right.project(points), strict=True):
        curve = line.get_xydata()
        curve = curve[np.isfinite(curve[:, 0])]
        along = np.linspace(0, len(curve) - 1, 20 * len(curve))
        fine = np.stack([np.interp(along, np.arange(len(curve)), each) for each in curve.T], axis=-1)
        assert np.linalg.norm(fine - seen, axis=-1).min() < 0.5


def test_space_is_not_mirrored_and_y_points_down():
    """The three axes as they are seen: to the right, up and away from the reader; right-handed like x, y, z."""
    ax = plots.space_axes()
    ax.set(xlim=(-1, 1), ylim=(-1, 1), zlim=(-1, 1))
    ax.set_aspect("equal")
    origin, *tips = np.array([proj3d.proj_transform(*p, ax.get_proj()) for p in [(0, 0, 0), *np.eye(3)]])
    x, y, z = tips - origin
    assert x[0] > 0
    assert y[1] < 0
    assert z[2] > 0
    assert np.linalg.det([x, y, z] * np.array([1, -1, 1])) > 0  # right, down, away


def test_frusta_have_their_names_and_start_at_their_centres():
    ax = plots.frusta(Rig(pair().cameras), depth=0.2)
    assert [line.get_label() for line in ax.lines] == ["left", "right"]
    for line, camera in zip(ax.lines, pair().cameras.values(), strict=True):
        points = np.stack(line.get_data_3d(), axis=-1)
        assert np.linalg.norm(points - camera.centre, axis=-1)[np.isfinite(points[:, 0])].min() < 1e-9


def test_outlines_of_boards_are_as_large_as_boards():
    ax = plots.boards(single())
    assert len(ax.lines) == 10
    for line in ax.lines:
        points = np.stack(line.get_data_3d(), axis=-1)[:5]
        np.testing.assert_allclose(np.linalg.norm(np.diff(points, axis=0), axis=-1), [0.25, 0.175, 0.25, 0.175])


def test_flat_axes_are_refused_for_space():
    with pytest.raises(ValueError, match=r"ax must be 3D axes.*got 'rectilinear' axes"):
        plots.frusta(TRUE, plt.figure().add_subplot())


def test_the_style_is_the_readers():
    with plt.rc_context({"axes.prop_cycle": plt.cycler(color=["#123456"]), "lines.linewidth": 3.5}):
        ax = plots.radial(TRUE, plots.distortion(TRUE).figure.add_subplot())
        assert (ax.lines[0].get_color(), ax.lines[0].get_linewidth()) == ("#123456", 3.5)
        (quiver,) = [one for one in plots.residuals(single()).collections if isinstance(one, matplotlib.quiver.Quiver)]
        np.testing.assert_allclose(quiver.get_facecolor()[0, :3], matplotlib.colors.to_rgb("#123456"))
    assert plots.radial(TRUE, color="red").lines[0].get_color() == "red"
