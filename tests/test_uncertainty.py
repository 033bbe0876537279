"""Facts about projection uncertainty and the difference of two cameras, against mrcal and many noisy solutions."""

import json
import os
import shutil
import subprocess
from dataclasses import replace
from math import inf
from pathlib import Path

import cv2
import numpy as np
import pytest
from boards import BOARD, CAMERA, RIGHT, board_poses, noisy, truth
from scipy.optimize import least_squares
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Camera, Intrinsics, transform
from camviz.lenses import BrownConrady, KannalaBrandt
from camviz.lenses.base import unit
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.difference import aligned, difference, pixel_grid
from camviz_clinic.calibration.jacobian import pixel_jacobian
from camviz_clinic.calibration.uncertainty import (
    mean_deviation,
    projection_covariance,
    projection_jacobian,
    projection_uncertainty,
    worst_deviation,
)

SIGMA = 0.2
OPENCV5 = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")

# mrcal 2.2 (Debian 12's mrcal-calibrate-cameras --lensmodel LENSMODEL_OPENCV5, the board's warp solved) throws out
# these (view, corner) of left*.jpg, has an RMS of 0.117 px per coordinate, and at infinity these uncertainties of the
# pixels (320, 240), (100, 100), (20, 20): `rms-stdev`, both directions together, and `worstdirection-stdev`.
THROWN_OUT = [(1, 0), (1, 1), (1, 9), (1, 18), (1, 27), (1, 28), (1, 36), (1, 45), (1, 46), (6, 44)]
THROWN_OUT += [(8, 8), (8, 26), (8, 44), (11, 17), (11, 26), (11, 35), (11, 44), (11, 53)]
PIXELS = np.array([[320.0, 240], [100, 100], [20, 20]])
MRCAL_BOTH = [0.1126, 0.1975, 3.327]
MRCAL_WORST = [0.1179, 0.2556, 4.704]
MRCAL_BOTH_UNREGULARISED = [0.11260, 0.19751, 3.5421]  # with --skip-regularization
MRCAL_RMS = 0.117


@pytest.fixture(scope="module")
def corners():
    """The corners (13, 54, 2) of left*.jpg by the classic finder and cornerSubPix in a window of 11 pixels."""
    folder = os.environ.get("CAMVIZ_SAMPLES")
    if not folder:
        pytest.skip("CAMVIZ_SAMPLES names no folder of sample data")
    criteria = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_COUNT, 30, 0.001)
    found = []
    for path in sorted(Path(folder, "opencv-samples").glob("left??.jpg")):
        image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        uv = cv2.findChessboardCorners(image, (9, 6))[1]
        found.append(cv2.cornerSubPix(image, uv, (11, 11), (-1, -1), criteria).reshape(-1, 2))
    return np.array(found, dtype=float)


def solved_with(corners, thrown_out, warp):
    """The 13 photographs, from OpenCV's solution as a start."""
    points = [BOARD.corners.astype(np.float32)] * len(corners)
    _, K, D, rvecs, tvecs = cv2.calibrateCamera(points, list(corners.astype(np.float32)), (640, 480), None, None)
    camera = Camera(Intrinsics.from_matrix(K, 640, 480), BrownConrady.from_coefficients(D))
    poses = RigidTransform.from_components(np.reshape(tvecs, (-1, 3)), Rotation.from_rotvec(np.reshape(rvecs, (-1, 3))))
    aside = np.zeros(corners.shape[:2], bool)
    aside[tuple(np.transpose(thrown_out))] = True
    problem = ({"camera": camera}, {"camera": corners}, poses, {"camera": OPENCV5}, {"camera": aside}, warp)
    return Adjustment(BOARD, *problem).refined()


@pytest.fixture(scope="module")
def solved(corners):
    return solved_with(corners, THROWN_OUT, np.zeros(2))


def test_uncertainty_is_mrcals_at_the_pixels_it_was_published_for(solved) -> None:
    """By the corners' noise alone, with σ² = ‖x‖²/(N - k), within 5 % of mrcal; with σ² = ‖x‖²/N as there within 1 ‰.

    Where mrcal's published run was regularised it is surer of the corner: by 6 %.
    """
    assert solved.rms / np.sqrt(2) == pytest.approx(MRCAL_RMS, abs=0.002)
    over_n = np.sqrt((solved.measurements - solved.unknowns) / solved.measurements)
    covariance = projection_covariance(solved.by_corners, PIXELS)
    assert np.allclose(over_n * mean_deviation(covariance)[:2], MRCAL_BOTH[:2], rtol=0.01)
    assert np.allclose(over_n * worst_deviation(covariance)[:2], MRCAL_WORST[:2], rtol=0.01)
    assert np.allclose(mean_deviation(covariance)[:2], MRCAL_BOTH[:2], rtol=0.05)
    assert np.allclose(mean_deviation(covariance), MRCAL_BOTH_UNREGULARISED, rtol=0.05)
    assert over_n * mean_deviation(covariance)[2] == pytest.approx(MRCAL_BOTH[2], rel=0.10)
    assert over_n * worst_deviation(covariance)[2] == pytest.approx(MRCAL_WORST[2], rel=0.10)
    assert np.allclose(over_n * mean_deviation(covariance), MRCAL_BOTH_UNREGULARISED, rtol=1e-3)


LIVE = """
import json, sys, mrcal, numpy as np
models = [mrcal.cameramodel(path) for path in sys.argv[1:]]
inputs = [model.optimization_inputs() for model in models]
grid = mrcal.sample_imager(12, 9, 640, 480)
answer = {"intrinsics": [m.intrinsics()[1].tolist() for m in models], "uncertainty": {}, "difference": {}}
answer["weights"] = inputs[0]["observations_board"][..., 2].reshape(13, -1).tolist()
for distance in (0, 1.0, 0.3):
    rays = mrcal.unproject(grid, *models[0].intrinsics(), normalize=True)
    answer["uncertainty"][distance] = mrcal.projection_uncertainty(
        rays * (distance or 1), models[0], atinfinity=not distance, what="covariance").tolist()
    for weighted in (False, True):
        length, shift, q0, Rt = mrcal.projection_diff(models, gridn_width=60, gridn_height=45,
            distance=distance or None, use_uncertainties=weighted)
        answer["difference"][f"{distance} {weighted}"] = [shift.tolist(), Rt.tolist(), [mrcal.projection_uncertainty(
            mrcal.unproject(q0, *m.intrinsics(), normalize=True) * (distance or 1), m, atinfinity=not distance,
            what="worstdirection-stdev").tolist() for m in models]]
print(json.dumps(answer))
"""


@pytest.fixture(scope="module")
def mrcals(corners, tmp_path_factory):
    """What mrcal, where some python3 has it, says of two solutions of the same corners: OPENCV5 and OPENCV4."""
    python = shutil.which("python3", path="/usr/bin")
    if not python or subprocess.run([python, "-c", "import mrcal"], capture_output=True, check=False).returncode:
        pytest.skip("mrcal (python3-mrcal) is not installed")
    if not shutil.which("mrcal-calibrate-cameras"):
        pytest.skip("mrcal's command line is not installed")
    folder = tmp_path_factory.mktemp("mrcal")
    rows = [f"left{view:02d}.jpg {u} {v} 0" for view, uv in enumerate(corners) for u, v in uv]
    (folder / "corners.vnl").write_text("\n".join(["# filename x y level", *rows]) + "\n")
    board = "--focal 530 --object-spacing 0.025 --object-width-n 9 --object-height-n 6 --imagersize 640 480"
    for model in ("OPENCV5", "OPENCV4"):
        command = f"mrcal-calibrate-cameras --corners-cache corners.vnl --lensmodel LENSMODEL_{model} {board}"
        command += f" --skip-regularization --outdir {model} left??.jpg"
        (folder / model).mkdir()
        subprocess.run(command.split(), cwd=folder, capture_output=True, check=True)
    paths = [str(folder / model / "camera-0.cameramodel") for model in ("OPENCV5", "OPENCV4")]
    done = subprocess.run([python, "-c", LIVE, *paths], capture_output=True, check=True, text=True)
    return json.loads(done.stdout)


@pytest.mark.thorough
@pytest.mark.parametrize("distance", [inf, 1.0, 0.3])
def test_covariance_is_mrcals_all_over_the_image(corners, mrcals, distance) -> None:
    """The whole covariance, at infinity and near by, to 0.5 % of its size at every pixel of a 12 × 9 grid."""
    thrown_out = np.argwhere(np.array(mrcals["weights"]) <= 0)
    ours = solved_with(corners, thrown_out, np.zeros(2))
    over_n = (ours.measurements - ours.unknowns) / ours.measurements
    uv = pixel_grid(CAMERA.intrinsics, (12, 9))
    covariance = over_n * projection_covariance(ours.by_corners, uv, distance)
    theirs = np.array(mrcals["uncertainty"]["0" if distance == inf else str(distance)])
    size = np.trace(theirs, axis1=-2, axis2=-1)
    inside = np.isfinite(covariance).all(axis=(-1, -2))
    assert inside.mean() > 0.9
    assert np.abs((covariance - theirs)[inside] / size[inside, None, None]).max() < 0.005


@pytest.mark.thorough
@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("distance", [inf, 1.0])
def test_difference_is_mrcals(mrcals, distance, weighted) -> None:
    """Our motion fits the rays at least as well as mrcal's, and with mrcal's motion our map is mrcal's to 1e-6 px.

    The two maps themselves cannot be compared: the cost, of fourth powers, is so flat that mrcal stops above the
    bottom, by up to 1 %, and elsewhere in every run.
    """
    models = [(values[:4], values[4:]) for values in mrcals["intrinsics"]]
    first, second = (Camera(Intrinsics(640, 480, *p), BrownConrady.from_coefficients(d)) for p, d in models)
    theirs, motion, uncertainties = mrcals["difference"][f"{'0' if distance == inf else distance} {weighted}"]
    given = (np.array(uncertainties[0]), np.array(uncertainties[1])) if weighted else None
    ours = difference(first, second, distance, (60, 45), uncertainties=given)
    motion = RigidTransform.from_components(motion[3], Rotation.from_matrix(motion[:3]))
    costs = [misfit(first, second, it, distance, given) for it in (ours.second_from_first, motion)]
    assert costs[0] < 1.0001 * costs[1]
    points = first.lens.unproject(first.intrinsics.from_pixels(ours.uv)) * (1 if distance == inf else distance)
    by_theirs = second.intrinsics.to_pixels(second.lens.project(transform(motion, points))) - ours.uv
    assert np.nanmax(np.abs(by_theirs - theirs)) < 1e-6


def misfit(first, second, second_from_first, distance, uncertainties):
    """The sum of the fourth powers of the angles between rays, weighted or in the middle of the picture."""
    uv = pixel_grid(first.intrinsics, (60, 45))
    rays = [camera.lens.unproject(camera.intrinsics.from_pixels(uv)) for camera in (first, second)]
    points = transform(second_from_first, rays[0] * (1 if distance == inf else distance))
    angle = np.arccos(np.clip((unit(points) * rays[1]).sum(axis=-1), -1, 1))
    if uncertainties is None:
        return float(np.sum(angle[np.linalg.norm(uv - (319.5, 239.5), axis=-1) < 80] ** 4))
    return float(np.nansum((angle / (uncertainties[0] * uncertainties[1])) ** 4))


def test_difference_of_a_camera_with_itself_is_nothing() -> None:
    found = difference(CAMERA, RIGHT)
    assert np.nanmax(found.length) < 1e-9
    assert found.turn_deg < 1e-9
    assert np.linalg.norm(difference(CAMERA, RIGHT, 0.5).second_from_first.translation) < 1e-9


def test_a_shifted_principal_point_is_a_rotation() -> None:
    """5 px of 530 are atan(5/530) = 0.54°: what is left of them near the middle is a tenth of a pixel."""
    moved = replace(CAMERA, intrinsics=replace(CAMERA.intrinsics, cx=CAMERA.intrinsics.cx + 5))
    found = difference(CAMERA, moved)
    assert found.turn_deg == pytest.approx(np.degrees(np.arctan2(5, 530)), rel=0.05)
    assert found.length[18:22, 27:33].max() < 0.2


def test_within_sets_where_cameras_are_brought_together() -> None:
    """Where k1 differs, a small circle agrees better in the middle and worse at the border than the whole picture."""
    other = replace(CAMERA, lens=replace(CAMERA.lens, k1=-0.25, p1=3e-3))
    middle, whole = (difference(CAMERA, other, within=within) for within in (60, 1000))
    assert middle.length[20, 30] < whole.length[20, 30]
    assert middle.length[-1, -1] > whole.length[-1, -1]


def test_implied_motion_is_found_at_a_finite_distance() -> None:
    """Points half a metre away, moved by a known twist: rotation and translation are those, to rounding."""
    motion = RigidTransform.from_components([0.01, -0.02, 0.03], Rotation.from_rotvec([0.01, 0.02, -0.03]))
    points = 0.5 * CAMERA.unproject(pixel_grid(CAMERA.intrinsics, (20, 15)).reshape(-1, 2))
    found = aligned(points, unit(transform(motion, points)), np.ones(len(points)), turn_only=False)
    assert np.allclose(found.as_matrix(), motion.as_matrix(), atol=1e-6)


def test_wild_rays_pull_no_more_than_hubers_loss_lets_them() -> None:
    """A tenth of the rays 20° off: the rotation is that of scipy.optimize.least_squares with mrcal's cost."""
    rng = np.random.default_rng(3)
    points = unit(rng.normal(size=(200, 3)) + [0, 0, 4])
    rays = transform(RigidTransform.from_rotation(Rotation.from_rotvec([0.01, 0.02, -0.03])), points)
    rays = unit(rays + rng.normal(0, 0.01, rays.shape))
    rays[:20] = Rotation.from_rotvec([0, np.deg2rad(20), 0]).apply(rays[:20])

    def squared_angles(rotvec):
        return np.sum((Rotation.from_rotvec(rotvec).apply(points) - rays) ** 2, axis=-1)

    limit = np.deg2rad(5) ** 2
    expected = least_squares(squared_angles, np.zeros(3), loss="huber", f_scale=limit, xtol=1e-15, gtol=1e-15).x
    found = aligned(points, rays, np.ones(200), turn_only=True).rotation.as_rotvec()
    assert np.allclose(found, expected, atol=1e-5)
    everything = least_squares(squared_angles, np.zeros(3)).x
    assert np.linalg.norm(everything - expected) > 1e-3


@pytest.mark.parametrize("bad", [0, -1, float("nan")])
def test_a_distance_that_is_none_is_refused(bad) -> None:
    with pytest.raises(ValueError, match="distance"):
        difference(CAMERA, RIGHT, bad)
    with pytest.raises(ValueError, match="distance"):
        projection_uncertainty(truth(board_poses(np.random.default_rng(0), 5)), PIXELS, bad)


def test_pictures_of_two_sizes_are_not_compared() -> None:
    other = replace(CAMERA, intrinsics=CAMERA.intrinsics.resized(320, 240))
    with pytest.raises(ValueError, match="one size"):
        difference(CAMERA, other)


FISHEYE = Camera(Intrinsics(640, 480, 300.0, 300.0, 320.0, 240.0), KannalaBrandt(0.02, -0.005, 1e-3, -5e-4))


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    ("cameras", "distance", "estimated", "warp"),
    [
        ({"camera": CAMERA}, inf, None, None),
        ({"camera": CAMERA}, 0.4, None, np.array([1e-4, -1e-4])),
        ({"camera": FISHEYE}, inf, ("fx", "fy", "cx", "cy", "k1", "k2"), None),
        ({"left": CAMERA, "right": RIGHT}, 0.6, None, None),
    ],
    ids=["infinity", "near", "fisheye", "right of a pair"],
)
def test_covariance_by_corners_is_the_scatter_of_many_solutions(cameras, distance, estimated, warp) -> None:
    """80 solutions from fresh noise, the point kept in each board's frame and the boards' opinions averaged.

    Its standard deviation against the foretold: with some 80 × 1.5 degrees of freedom within 25 % at every pixel.
    """
    rng = np.random.default_rng(11)
    name, camera = list(cameras.items())[-1]
    exact = truth(board_poses(rng, 7, camera=next(iter(cameras.values()))), cameras, warp=warp)
    if estimated:
        exact = replace(exact, estimated=dict.fromkeys(cameras, estimated))
    uv = np.array([[320.0, 240], [150, 130], [500, 380]])
    far = 1e6 if distance == inf else distance
    points_first = camera.centre + far * camera.unproject(uv)
    scatter = []
    for _ in range(80):
        one = noisy(exact, rng, SIGMA).refined()
        opinions = one.first_from_board * exact.first_from_board.inv()
        mean = np.mean([transform(opinion, points_first) for opinion in opinions], axis=0)
        scatter.append(one.cameras[name].project(mean) - uv)
    measured = np.einsum("nki,nkj->kij", scatter, scatter) / len(scatter)
    expected = (SIGMA / one.sigma) ** 2 * projection_covariance(one.by_corners, uv, distance, name)
    ratio = np.trace(measured, axis1=1, axis2=2) / np.trace(expected, axis1=1, axis2=2)
    assert np.all((ratio > 0.75**2) & (ratio < 1.25**2)), ratio


@pytest.mark.parametrize("distance", [inf, 0.3])
def test_slopes_are_those_of_the_mean_opinion(distance) -> None:
    """Every shared parameter, and one twist given to all boards, moved a little: the right camera's pixels follow."""
    exact = truth(board_poses(np.random.default_rng(0), 4), {"left": CAMERA, "right": RIGHT})
    uv = np.array([[320.0, 240], [150, 130], [500, 380]])
    far = 1e5 if distance == inf else distance
    points = RIGHT.centre + far * RIGHT.unproject(uv)

    def seen(change):
        there = exact._moved(change[:-6], np.tile(change[-6:], (4, 1)))
        opinions = there.first_from_board * exact.first_from_board.inv()
        mean = np.mean([transform(opinion, points) for opinion in opinions], axis=0)
        return there.cameras["right"].project(mean)

    steps = 1e-5 * np.eye(len(exact.parameters) + 6)
    expected = np.stack([(seen(step) - seen(-step)) / 2e-5 for step in steps], axis=-1)
    assert np.allclose(projection_jacobian(exact, uv, distance, "right"), expected, rtol=1e-4, atol=0.02)


def test_poses_held_fixed_would_say_something_else(solved) -> None:
    """The covariance of the intrinsics alone, carried to the pixel, is several times off in the middle."""
    camera = solved.cameras["camera"]
    _, _, slopes = pixel_jacobian(camera, camera.unproject(PIXELS[:1]), OPENCV5)
    naive = worst_deviation(slopes @ solved.covariance[:9, :9] @ np.swapaxes(slopes, 1, 2))
    assert naive > 3 * projection_uncertainty(solved, PIXELS[:1])
