"""Boards are found where they are, and the camera that saw them comes out as it was, also among bad pictures."""

import os
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, KannalaBrandt, UnifiedSphere
from camviz_clinic.calibration import (
    MODELS,
    CannotCalibrate,
    Detections,
    calibrate,
    calibrate_pair,
    detect,
    find_corners,
    solving,
)
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.chessboards import at_saddles, crossed
from camviz_clinic.calibration.detection import detect_pair
from camviz_clinic.calibration.pairing import paired
from camviz_clinic.calibration.paper import black_parts
from camviz_clinic.calibration.solvers import pose_from_rays
from camviz_clinic.files import Board
from camviz_school.samples import SampleUnavailable, sample

BOARD = Board(9, 6, 0.025)
CHARUCO = Board(9, 6, 0.025, 0.018, "DICT_5X5_100")
WIDE = Intrinsics(1280, 960, 640, 642, 645, 475)
TRUTH = {
    "standard": Camera(Intrinsics(640, 480, 533, 534, 342, 234), BrownConrady(-0.28, 0.05, 0.001, -0.001, 0.05)),
    "rational": Camera(WIDE, BrownConrady(0.3, 0.05, 0.001, -0.001, 0.02, 0.5, 0.2, 0.03)),
    "thin-prism": Camera(WIDE, BrownConrady(-0.28, 0.08, 0.001, -0.001, 0.0, s1=0.01, s2=0.0, s3=-0.01, s4=0.0)),
    "fisheye": Camera(Intrinsics(1280, 960, 380, 381, 645, 475), KannalaBrandt(0.01, -0.002, 0.001, 0.0)),
    "omni": Camera(Intrinsics(1280, 960, 900, 905, 645, 475), UnifiedSphere(1.3, -0.05, 0.01, 0.001, -0.001)),
}


def names(count, side="view"):
    return tuple(f"{side}{i:02d}.png" for i in range(count))


def seen_by(camera, rng, views=16, noise=0.1, spread=None):
    """Detections of boards all over the image of a camera, with Gaussian noise, and the true poses."""
    spread = spread or (1.0 if isinstance(camera.lens, (KannalaBrandt, UnifiedSphere)) else 0.4)
    corners, poses = [], []
    middle = RigidTransform.from_translation(-BOARD.corners.mean(axis=0))
    while len(corners) < views:
        towards = Rotation.from_rotvec([*rng.uniform(-spread, spread, 2), rng.uniform(-0.5, 0.5)])
        tilt = Rotation.from_rotvec([*rng.uniform(-0.6, 0.6, 2), 0])
        away = RigidTransform.from_translation([0, 0, rng.uniform(0.2, 0.45)])
        pose = RigidTransform.from_rotation(towards) * away * RigidTransform.from_rotation(tilt) * middle
        uv = camera.project(pose.apply(BOARD.corners))
        if camera.intrinsics.contains(uv).all():
            corners.append(uv + noise * rng.standard_normal(uv.shape))
            poses.append(pose)
    width, height = camera.intrinsics.width, camera.intrinsics.height
    return Detections(names(views), np.array(corners), width, height), RigidTransform.concatenate(poses)


def picture(board, homography, width=640, height=480):
    """A board photographed by a homography from its millimetres to pixels, antialiased, and where its corners are."""
    parts, scale = black_parts(board), 4
    points = np.stack([parts[:, :2], parts[:, :2] + parts[:, 2:]], axis=1)
    image = np.full((height * scale, width * scale), 235, np.uint8)
    for (x0, y0), (x1, y1) in points:
        outline = np.array([[[x0, y0]], [[x1, y0]], [[x1, y1]], [[x0, y1]]])
        uv = cv2.perspectiveTransform(outline, homography)
        uv = scale * (uv + 0.5) - 0.5
        cv2.fillConvexPoly(image, np.rint(uv * 256).astype(np.int32), 20, cv2.LINE_8, 8)
    small = cv2.resize(image, (width, height), interpolation=cv2.INTER_AREA)
    millimetres = 1000 * (board.corners[:, :2] + board.square_size)
    return small, cv2.perspectiveTransform(millimetres[:, None], homography)[:, 0]


TILTED = np.array([[1.9, 0.15, 60.0], [-0.1, 2.0, 70.0], [2e-4, 3e-4, 1.0]])


def turned(image, corners):
    return cv2.rotate(image, cv2.ROTATE_180), np.array([image.shape[1] - 1, image.shape[0] - 1]) - corners


@pytest.mark.parametrize("finder", ["auto", "sectors", "classic", "saddles"])
def test_the_corners_of_a_chessboard_are_found_in_the_boards_order_however_it_is_held(finder):
    for image, corners in (picture(BOARD, TILTED), turned(*picture(BOARD, TILTED))):
        found = find_corners(image, BOARD, finder)
        assert np.abs(found - corners).max() < (0.3 if finder in ("classic", "saddles") else 0.1)


def test_a_chessboard_with_a_narrow_margin_is_not_found_along_its_edge():
    """Sectors take places on the edge of its white margin for corners: in all these pictures, 19 to 81 px off."""
    board, side, margin = Board(3, 4, 0.05), 60, 12
    fields = np.add.outer(np.arange(5), np.arange(4)) % 2 * 255
    flat = np.pad(fields.astype(np.uint8).repeat(side, axis=0).repeat(side, axis=1), margin, constant_values=255)
    corners = margin - 0.5 + side * (1 + np.stack(np.meshgrid(np.arange(3), np.arange(4)), axis=-1).reshape(-1, 1, 2))
    height, width = flat.shape
    rng = np.random.default_rng(0)
    for _ in range(10):
        there = np.array([[100, 50], [200, 60], [190, 180], [95, 170]]) + rng.uniform(-25, 25, (4, 2))
        outline = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
        H = cv2.getPerspectiveTransform(outline, there.astype(np.float32))
        image = cv2.warpPerspective(flat, H, (320, 240), borderValue=56)
        true = cv2.perspectiveTransform(corners, H)[:, 0]
        found = find_corners(image, board)
        assert min(np.abs(found - true).max(), np.abs(found[::-1] - true).max()) < 1


def test_noise_in_a_dim_picture_refuses_no_board():
    """Fields that differ by 30 grey levels, with noise of 25 in each pixel; half a square beside, nothing crosses."""
    board, side = Board(9, 6, 0.025), 40
    fields = 60 + 30.0 * (np.add.outer(np.arange(7), np.arange(10)) % 2)
    flat = np.pad(fields.repeat(side, axis=0).repeat(side, axis=1), side, constant_values=90)
    corners = side - 0.5 + side * (1 + np.stack(np.meshgrid(np.arange(9), np.arange(6)), axis=-1).reshape(-1, 2))
    rng = np.random.default_rng(0)
    for _ in range(10):
        image = np.clip(flat + rng.normal(0, 25, flat.shape), 0, 255).astype(np.uint8)
        assert crossed(image, corners, board)
        assert not crossed(image, corners + [side / 2, 0], board)


def test_saddles_close_to_the_border_are_measured_in_a_smaller_window():
    """Corners that are off by half a pixel are brought back, also 4 px from the border, but not 1 px from it."""
    image, corners = picture(BOARD, TILTED)
    image = cv2.GaussianBlur(image, (0, 0), 0.8)
    left, top = np.floor(corners.min(axis=0)).astype(int)
    for room, most in ((4, 0.15), (1, 0.6)):
        part = np.ascontiguousarray(image[top - room :, left - room :])
        true = corners - [left - room, top - room]
        moved = np.linalg.norm(at_saddles(part, true + [0.4, -0.3], BOARD) - true, axis=1)
        outermost = np.argmin(true.min(axis=1))
        assert moved[outermost] < most
        assert (moved[outermost] == pytest.approx(0.5)) == (room < 2)
        assert np.median(moved) < 0.1


def test_in_a_large_picture_the_corners_are_where_they_are_in_a_small_one():
    scale = np.array([[4, 0, 1.5], [0, 4, 1.5], [0, 0, 1]])
    image, corners = picture(BOARD, scale @ TILTED, 2560, 1920)
    assert np.abs(find_corners(image, BOARD) - corners).max() < 0.2


def test_a_charuco_board_is_found_though_a_part_of_it_is_hidden():
    image, corners = picture(CHARUCO, TILTED)
    assert np.abs(find_corners(image, CHARUCO) - corners).max() < 0.3
    image[:, :200] = 128
    found = find_corners(image, CHARUCO)
    hidden = np.isnan(found).any(axis=1)
    assert hidden[corners[:, 0] < 190].all()
    assert not hidden[corners[:, 0] > 280].any()
    assert np.abs(found[~hidden] - corners[~hidden]).max() < 0.3


def test_pictures_that_give_no_view_are_named_with_the_reason(tmp_path):
    image = picture(BOARD, TILTED)[0]
    for name in ("a.png", "b.png", "c.png"):
        cv2.imwrite(str(tmp_path / name), image)
    cv2.imwrite(str(tmp_path / "large.png"), cv2.resize(image, None, fx=1.5, fy=1.5))
    cv2.imwrite(str(tmp_path / "empty.png"), np.full_like(image, 128))
    (tmp_path / "text.jpg").write_text("no picture")
    paths = [*sorted(tmp_path.iterdir()), tmp_path / "gone.png"]
    found = detect(paths, BOARD, workers=1)
    assert found.pictures == ("a.png", "b.png", "c.png")
    assert found.places == (0, 1, 2)
    assert dict(found.skipped) == {
        "empty.png": "the board was not found in it",
        "gone.png": "it cannot be read (No such file or directory)",
        "large.png": "it has 960×720 pixels, most have 640×480",
        "text.jpg": "it is not a picture that can be read, it begins with 'no picture'",
    }


def test_no_board_at_all_is_said_with_what_was_looked_for(tmp_path):
    cv2.imwrite(str(tmp_path / "a.png"), picture(BOARD, TILTED)[0])
    with pytest.raises(CannotCalibrate, match=r"7×6 inner corners \(8×7 squares\).*a\.png"):
        detect([tmp_path / "a.png"], Board(7, 6, 0.025))


def test_several_processes_find_what_one_finds_and_sixteen_bits_are_as_good_as_eight(tmp_path):
    image = picture(BOARD, TILTED)[0]
    cv2.imwrite(str(tmp_path / "a.png"), image)
    cv2.imwrite(str(tmp_path / "b.png"), image.astype(np.uint16) * 16)  # twelve bits in sixteen
    paths, counts = [tmp_path / "a.png", tmp_path / "b.png"], []
    found = detect(paths, BOARD, workers=2, progress=lambda done, count: counts.append((done, count)))
    np.testing.assert_array_equal(found.corners, detect(paths, BOARD, workers=1).corners)
    assert np.abs(found.corners[1] - found.corners[0]).max() < 0.05
    assert counts == [(1, 2), (2, 2)]


SLOW = """
import os, sys, time
from camviz_clinic.calibration import detect, CannotCalibrate
from camviz_clinic.files import Board
print("started", flush=True)
try:
    detect(sys.argv[1:] * 400, Board(9, 6, 0.025), workers=2, progress=lambda done, count: print(done, flush=True))
except CannotCalibrate as error:
    print(error)
except KeyboardInterrupt:
    print("interrupted")
"""


@pytest.fixture
def detecting(tmp_path):
    """A process that looks for boards in eight hundred pictures, with two processes of its own, in its own group."""
    cv2.imwrite(str(tmp_path / "a.png"), picture(BOARD, TILTED)[0])
    (tmp_path / "script.py").write_text(SLOW)  # without `if __name__ == "__main__"`
    process = subprocess.Popen(
        [sys.executable, str(tmp_path / "script.py"), str(tmp_path / "a.png")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[1])},
        start_new_session=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),  # a job in the background is deaf to it
    )
    assert process.stdout.readline() == "started\n"
    assert process.stdout.readline() == "1\n"
    yield process
    process.kill()
    process.wait()


def children(pid):
    return [int(each) for each in Path(f"/proc/{pid}/task/{pid}/children").read_text().split()]


@pytest.mark.skipif(not Path("/proc/self/task").is_dir(), reason="the processes are found in /proc")
def test_a_killed_worker_is_said_in_one_sentence(detecting):
    workers = [pid for pid in children(detecting.pid) if b"spawn_main" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    os.kill(workers[0], signal.SIGKILL)
    out, err = detecting.communicate(timeout=300)
    assert "a process that was looking for boards was ended from outside" in out.splitlines()[-1]
    assert err == ""


@pytest.mark.skipif(os.name == "nt", reason="sends Ctrl-C to a group of processes")
def test_ctrl_c_ends_all_processes_quietly(detecting):
    os.killpg(detecting.pid, signal.SIGINT)
    out, err = detecting.communicate(timeout=300)  # which ends when the last process has closed its end
    assert out.splitlines()[-1] == "interrupted"
    assert err == ""


def test_the_pose_of_a_board_follows_from_rays_also_behind_the_camera():
    pose = RigidTransform.from_components([-0.3, 0.02, -0.05], Rotation.from_rotvec([0.2, -1.7, 0.1]))
    found = pose_from_rays(pose.apply(BOARD.corners), BOARD.corners)
    np.testing.assert_allclose(found.as_matrix(), pose.as_matrix(), atol=1e-9)


@pytest.mark.sampled(2)
@pytest.mark.parametrize("model", MODELS)
def test_the_true_camera_is_found_within_its_standard_deviations(model):
    truth, rng = TRUTH[model], np.random.default_rng(4)
    found = calibrate(seen_by(truth, rng)[0], BOARD, model)
    camera, names = found.cameras["camera"], found.estimated["camera"]
    deviations = np.sqrt(np.diag(found.intrinsics_covariance["camera"]))
    for name, deviation in zip(names, deviations, strict=True):
        if model == "rational" and name[0] == "k":
            continue  # numerator and denominator trade far beyond where the problem is linear
        first, second = ((each.intrinsics if name[0] in "fc" else each.lens) for each in (camera, truth))
        assert abs(getattr(first, name) - getattr(second, name)) < 4 * deviation, name
    assert np.mean(found.per_view_errors["camera"]) == pytest.approx(0.1 * np.sqrt(2), rel=0.08)
    assert found.set_aside["camera"].sum() <= 1


def test_without_outliers_the_solution_is_opencvs_own():
    detections = seen_by(TRUTH["standard"], np.random.default_rng(7))[0]
    found = calibrate(detections, BOARD, robust=False)
    points = [BOARD.corners.astype(np.float32)] * len(detections.corners)
    pixels = list(detections.corners.astype(np.float32))
    rms, K, distortion, *_ = cv2.calibrateCamera(points, pixels, (640, 480), None, None)
    np.testing.assert_allclose(found.cameras["camera"].intrinsics.K, K, atol=2e-3)
    lens = found.cameras["camera"].lens
    np.testing.assert_allclose([lens.k1, lens.k2, lens.p1, lens.p2, lens.k3], distortion.ravel(), atol=2e-4)
    assert np.sqrt(np.mean(found.per_view_errors["camera"] ** 2)) == pytest.approx(rms, abs=1e-5)


def test_the_parameters_that_are_fixed_stay():
    detections = seen_by(TRUTH["standard"], np.random.default_rng(7))[0]
    found = calibrate(detections, BOARD, fixed=("k3", "cx", "cy", "p2"))
    camera = found.cameras["camera"]
    assert (camera.intrinsics.cx, camera.intrinsics.cy) == (319.5, 239.5)
    assert (camera.lens.k3, camera.lens.p2) == (0, 0)
    assert found.estimated["camera"] == ("fx", "fy", "k1", "k2", "p1")
    assert found.intrinsics_covariance["camera"].shape == (5, 5)


def test_outlier_corners_and_a_wrong_view_are_set_aside_and_nothing_else():
    detections, _ = seen_by(TRUTH["standard"], np.random.default_rng(5))
    corners = detections.corners.copy()
    bad = np.zeros(corners.shape[:2], dtype=bool)
    bad[2, 8::9] = bad[3, 17] = bad[9] = True
    corners[2, 8::9] += [3, -1]
    corners[3, 17] += [0, 2]
    corners[9] = corners[9, ::-1] * [0.9, 1.05] + np.random.default_rng(1).normal(0, 6, corners[9].shape)
    found = calibrate(replace(detections, corners=corners), BOARD)
    np.testing.assert_array_equal(found.set_aside["camera"], bad)
    assert "view09.png was set aside" in found.notes[0]
    assert "6 in view02.png, 1 in view03.png" in found.notes[1]
    clean = calibrate(
        replace(
            detections,
            corners=np.where(bad[..., None], np.nan, corners)[np.arange(16) != 9],
            pictures=names(15),
            places=(),
        ),
        BOARD,
    )
    np.testing.assert_allclose(found.cameras["camera"].intrinsics.K, clean.cameras["camera"].intrinsics.K, atol=1e-4)


def test_a_healthy_set_loses_almost_nothing():
    lost = 0
    for seed in range(5):
        found = calibrate(seen_by(TRUTH["standard"], np.random.default_rng(100 + seed), views=12)[0], BOARD)
        lost += found.set_aside["camera"].sum()
    assert lost <= 3  # 0.1 of 648 corners each are expected, half a corner in all


def test_a_pair_is_found_as_it_stands_and_views_of_one_camera_only_are_named():
    left, rng = TRUTH["standard"], np.random.default_rng(3)
    detections, poses = seen_by(left, rng)
    right_from_left = RigidTransform.from_components([-0.06, 0.002, 0.001], Rotation.from_rotvec([0.01, 0.05, -0.02]))
    right = replace(left, intrinsics=replace(left.intrinsics, fx=540.0, cx=330.0))
    uv = right.project(np.stack([(right_from_left * pose).apply(BOARD.corners) for pose in poses]))
    uv += 0.1 * rng.standard_normal(uv.shape)
    whole = right.intrinsics.contains(uv).all(axis=1)
    assert 5 < whole.sum() < 16
    places = tuple(np.flatnonzero(whole).tolist())
    other = replace(detections, corners=uv[whole], pictures=tuple(f"right{i:02d}.png" for i in places), places=places)
    found = calibrate_pair(detections, other, BOARD)
    apart = found.rig.a_from_b("right", "left") * right_from_left.inv()
    adjustment = Adjustment.of(found)
    deviations = np.sqrt(np.diag(adjustment.covariance))[adjustment.place_of("right")]
    assert np.all(np.abs([*apart.rotation.as_rotvec(), *apart.translation]) < 4 * deviations)
    assert deviations[3] < 2e-4
    lonely = [picture for picture, why in found.skipped if "its partner" in why]
    assert lonely == [f"view{i:02d}.png" for i in np.flatnonzero(~whole)]
    joined = found.rig.a_from_b("right", "left") * found.cam_from_board["left"]
    np.testing.assert_allclose(joined.as_matrix(), found.cam_from_board["right"].as_matrix(), atol=1e-12)


def test_too_few_views_and_unknown_models_are_refused():
    detections = seen_by(TRUTH["standard"], np.random.default_rng(2), views=2)[0]
    with pytest.raises(CannotCalibrate, match="at least 3 views of the board are needed for a calibration, got 2"):
        calibrate(detections, BOARD)
    with pytest.raises(ValueError, match="model must be one of standard, rational"):
        calibrate(detections, BOARD, "pinhole")
    with pytest.raises(ValueError, match="fixed must be some of cx, cy, k1"):
        calibrate(detections, BOARD, fixed=("k9",))


def test_pictures_find_their_partners_by_name_by_number_and_by_order():
    def paths(*all_names):
        return [Path(name) for name in all_names]

    by_name = paired(paths("l/a.png", "l/b.png"), paths("r/b.png", "r/a.png", "r/c.png"))
    assert by_name.right == (Path("r/a.png"), Path("r/b.png"))
    assert by_name.lonely == (("c.png", "it has no partner among the pictures of the left camera"),)
    by_number = paired(paths("left01.jpg", "left2.jpg", "left10.jpg"), paths("cam1_right02.jpg", "right10.jpg"))
    assert [path.name for path in by_number.left] == ["left2.jpg", "left10.jpg"]
    assert by_number.lonely == (("left01.jpg", "it has no partner among the pictures of the right camera"),)
    by_order = paired(paths("a.png", "b.png"), paths("c.png", "d.png"))
    assert (by_order.left, by_order.right) == (tuple(paths("a.png", "b.png")), tuple(paths("c.png", "d.png")))
    with pytest.raises(CannotCalibrate, match="2 pictures of the left camera and 1 of the right"):
        paired(paths("a.png", "b.png"), paths("c.png"))


# OpenCV's photographs, against the figures that OpenCV itself comes to.


@pytest.fixture(scope="module")
def photographs():
    try:
        numbers = [i for i in range(1, 15) if i != 10]
        sides = [[sample(f"{side}{i:02d}.jpg") for i in numbers] for side in ("left", "right")]
    except SampleUnavailable as reason:
        pytest.skip(str(reason))
    return sides, detect_pair(*sides, BOARD, finder="classic", workers=1)


def test_the_sample_photographs_give_opencvs_figures(photographs):
    found = calibrate(photographs[1][0], BOARD, robust=False)
    errors = dict(zip(found.pictures["camera"], found.per_view_errors["camera"], strict=True))
    assert np.sqrt(np.mean(np.square(list(errors.values())))) == pytest.approx(0.4087, abs=5e-4)
    assert errors["left02.jpg"] == pytest.approx(1.22, abs=5e-3)
    rest = [i for i in range(13) if i != 1]
    left = photographs[1][0]
    without = Detections(tuple(left.pictures[i] for i in rest), left.corners[rest], 640, 480)
    errors = calibrate(without, BOARD, robust=False).per_view_errors["camera"]
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(0.234, abs=5e-4)


def test_the_bad_column_of_left02_is_set_aside_and_hardly_anything_else(photographs):
    found = calibrate(photographs[1][0], BOARD)
    aside = found.set_aside["camera"].reshape(13, 6, 9)
    assert aside[1].all(axis=0).sum() == 1
    assert aside[1].sum() == 6
    assert 6 < aside.sum() <= 18
    assert np.sqrt(np.mean(found.per_view_errors["camera"] ** 2)) < 0.18


def test_the_pair_of_the_samples_is_84_millimetres_apart_with_each_camera_held_as_it_is(photographs):
    alone = calibrate_pair(*photographs[1], BOARD, robust=False, joint=False).rig.a_from_b("right", "left")
    assert np.linalg.norm(alone.translation) == pytest.approx(0.0836, abs=5e-5)
    assert alone.translation[0] < 0


def test_the_joint_solution_of_a_pair_is_opencvs(photographs):
    found = calibrate_pair(*photographs[1], BOARD, robust=False)
    left, right = (calibrate(each, BOARD, robust=False).cameras["camera"] for each in photographs[1])
    points = [BOARD.corners.astype(np.float32)] * 13
    start = [
        part
        for camera in (left, right)
        for part in (camera.intrinsics.K, np.array([getattr(camera.lens, k) for k in ("k1", "k2", "p1", "p2", "k3")]))
    ]
    pixels = [list(each.corners.astype(np.float32)) for each in photographs[1]]
    rms, K, *_, R, t, _, _ = cv2.stereoCalibrate(
        points, *pixels, *start, (640, 480), flags=cv2.CALIB_USE_INTRINSIC_GUESS, criteria=(3, 200, 1e-12)
    )
    right_from_left = found.rig.a_from_b("right", "left")
    np.testing.assert_allclose(right_from_left.translation, t.ravel(), atol=2e-7)
    np.testing.assert_allclose(right_from_left.rotation.as_matrix(), R, atol=2e-6)
    np.testing.assert_allclose(found.cameras["left"].intrinsics.K, K, atol=2e-3)
    errors = np.concatenate(list(found.per_view_errors.values()))
    assert np.sqrt(np.mean(errors**2)) == pytest.approx(rms, abs=1e-5)


def test_a_view_beyond_the_fold_of_the_lens_keeps_its_pose():
    """Nothing can be fitted to corners without an image, and no warning says so on the way."""
    camera = Camera(WIDE, BrownConrady(-0.3))  # it folds 450 pixels from the middle
    found, poses = seen_by(camera, np.random.default_rng(1), views=4)
    beyond = [1200, 900] + 0.1 * (found.corners[:1] - found.corners[0].mean(axis=0))
    aside = RigidTransform.from_translation([2, 2, 0.3])
    assert np.isnan(camera.project(aside.apply(BOARD.corners))).all()
    corners = np.concatenate([found.corners, beyond])
    silent = np.repeat([[False]] * 4 + [[True]], len(BOARD.corners), axis=1)
    start = Adjustment(
        BOARD,
        {"camera": camera},
        {"camera": corners},
        RigidTransform.concatenate([*poses, aside]),
        {"camera": ("fx", "fy")},
        {"camera": silent},
    )
    solved = solving._settled(start)
    np.testing.assert_allclose(solved.first_from_board[4].as_matrix(), aside.as_matrix())
