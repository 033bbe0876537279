"""What lesson 16 says about calibrations that are wrong, solved again by OpenCV from the same corners."""

from functools import cache

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from camviz_clinic.calibration import calibrate
from camviz_clinic.calibration.difference import pixel_grid
from camviz_clinic.checks.virtual import detections
from camviz_school.views.fault_lab import FaultLabView
from camviz_school.views.laboratory import GRID, lab_faults

EXCEPTIONS: dict[str, str] = {
    "is the answer sheet for patient 3": "it names a patient, not a quantity",
    "column 4 points left in": "it is an example of a reason, of no patient in particular",
}

BLURRED, PARALLEL, WARPED, DRIFT = (
    FaultLabView(fault=fault, strength=1.0, seed=5)
    for fault in ("blurred view", "parallel boards", "warped board", "autofocus drift")
)
ANNA = FaultLabView(fault="parallel boards", strength=1.0, noise=0.14, seed=5)
BEN = FaultLabView(fault="parallel boards", strength=0.0, noise=0.39, seed=5)
PAPER = FaultLabView(fault="warped board", strength=0.5, seed=5)


@cache
def solved(view):
    """OpenCV's own solution of the corners: RMS, fx, σ of fx, K and distortion."""
    detections = view.experiment.solved.detections["camera"].astype(np.float32)
    board = [view.experiment.solved.board.corners.astype(np.float32)] * len(detections)
    rms, K, distortion, _, _, sigmas, *_ = cv2.calibrateCameraExtended(
        board, list(detections), (640, 480), None, None, flags=cv2.CALIB_FIX_K3
    )
    return rms, K[0, 0], sigmas[0, 0], K, distortion


@cache
def jackknifed(view):
    """σ of fx by the scatter of OpenCV's solutions without each view in turn."""
    detections = view.experiment.solved.detections["camera"].astype(np.float32)
    board = [view.experiment.solved.board.corners.astype(np.float32)] * (len(detections) - 1)
    f = [
        cv2.calibrateCamera(
            board, list(np.delete(detections, left, axis=0)), (640, 480), None, None, flags=cv2.CALIB_FIX_K3
        )[1][0, 0]
        for left in range(len(detections))
    ]
    return np.sqrt(len(board) / len(detections) * np.sum((np.array(f) - solved(view)[1]) ** 2))


def true_f(view):
    return view.experiment.truth.intrinsics.fx


def rays(K, distortion, uv):
    xy = cv2.undistortPoints(uv.reshape(-1, 1, 2), K, distortion, criteria=(3, 100, 1e-12))[:, 0]
    xyz = np.concatenate([xy, np.ones((len(xy), 1))], axis=1)
    return xyz / np.linalg.norm(xyz, axis=1, keepdims=True)


def off(view):
    """How far OpenCV's camera is from the true one: the median over the image, after the best rotation (Kabsch)."""
    _, _, _, K, distortion = solved(view)
    truth, lens = view.experiment.truth.intrinsics, view.experiment.truth.lens
    true_distortion = np.array([lens.k1, lens.k2, lens.p1, lens.p2])
    uv = pixel_grid(truth, GRID).reshape(-1, 2)
    true, believed = rays(truth.K, true_distortion, uv), rays(K, distortion, uv)
    U, _, Vt = np.linalg.svd(true.T @ believed)
    turned = believed @ (U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt).T
    back = cv2.projectPoints(turned, np.zeros(3), np.zeros(3), truth.K, true_distortion)[0][:, 0]
    return np.median(np.linalg.norm(back - uv, axis=1))


def test_eleven_faults_and_their_families(says):
    says("put eleven faults into a camera, measure what each does, diagnose eight patients")
    says("The eleven faults of the lab fall into three families")
    assert len(lab_faults()) == 11
    says("corner, blurred view, column off |")
    says("| the corners leave something open | parallel boards, boards in the middle |")
    says(
        "| every view is affected, and none sticks out | warped board, autofocus drift, rolling shutter, lens too "
        "rich, "
        "moved centre, half pixel |"
    )
    listed = "outlier corner, blurred view, column off, parallel boards, boards in the middle, warped board, "
    listed += "autofocus drift, rolling shutter, lens too rich, moved centre, half pixel"
    assert set(listed.split(", ")) == set(lab_faults())


def test_anna_and_ben(says):
    anna, ben = says("Anna's error of the fit is 0.19 px, Ben's 0.52 px.")
    assert anna == solved(ANNA)[0]
    assert ben == solved(BEN)[0]
    (f,) = says(
        "Anna's error is less than half of Ben's. Her focal length is wrong by eighteen pixels of 522, and his by less "
        "than one."
    )
    assert solved(ANNA)[0] < solved(BEN)[0] / 2
    assert f == true_f(ANNA)
    assert round(abs(solved(ANNA)[1] - f.value)) in (18, 19)
    assert abs(solved(ANNA)[1] - true_f(ANNA)) == pytest.approx(18.3, abs=0.05)
    assert abs(solved(BEN)[1] - true_f(BEN)) < 1
    percent, other = says("Anna's f is off by 3.5 %, and Ben's by 0.15 %.")
    assert percent == 100 * abs(solved(ANNA)[1] / true_f(ANNA) - 1)
    assert other == 100 * abs(solved(BEN)[1] / true_f(BEN) - 1)
    says("Anna's corners are sharper, and her boards all parallel.")
    assert ANNA.noise < BEN.noise
    says("the bar of fx is fifteen times as long as Ben's.")
    assert round(ANNA.experiment.estimates["fx"][1] / BEN.experiment.estimates["fx"][1]) == 15
    formula, scatter = says(
        "For Ben's corners, whose noise is independent, the formula gives ± 2.2 px, and the scatter of his ten views "
        "± 1.3 px."
    )
    assert formula == solved(BEN)[2]
    assert scatter == BEN.experiment.estimates["fx"][1]
    assert scatter.value == pytest.approx(jackknifed(BEN), rel=0.06)
    assert BEN.experiment.solved.views == 10


def test_boards_parallel_to_the_picture_say_nothing_of_f(says):
    says("Move such a board nearer, make f shorter, and the picture is the same")
    says(
        "If all boards are parallel to the picture, f can be ten percent too long and the error of the fit stays what "
        "it is."
    )
    board = np.stack(np.meshgrid(np.arange(9), np.arange(6)), axis=-1).reshape(-1, 2) * 0.025
    for distance in (0.3, 0.5, 0.8):
        pictures = [
            cv2.projectPoints(
                np.concatenate([board, np.full((54, 1), scale * distance)], axis=1), np.zeros(3), np.zeros(3),
                np.diag([scale * 522.0, scale * 522.0, 1.0]), None,
            )[0]
            for scale in (1.0, 1.1)
        ]  # fmt: skip
        np.testing.assert_allclose(*pictures, atol=1e-9)
    (low,) = says("The error of the fit is 0.08 px. What do you know?")
    (same,) = says("The intrinsics are known to about 0.08 px.")
    assert low == same.value


def test_a_board_of_paper(says):
    f, sigma, bulge = says(
        "A calibration program gives error bars: f = 538.7 ± 4.9 px. Its board was printed on paper that bulges by one "
        "percent of its length, 2 mm."
    )
    assert f == solved(PAPER)[1]
    assert sigma == PAPER.experiment.estimates["fx"][1]
    assert sigma.value == pytest.approx(jackknifed(PAPER), rel=0.08)  # camviz's is to first order
    corners = PAPER.experiment.solved.board.corners
    assert bulge == 1000 * 0.01 * np.ptp(corners[:, 0])
    assert lab_faults()["warped board"].amount(0.5) == 1.0
    (again,) = says("Exactly at 538.7: the bulge averages out over many views.")
    assert again == f.value
    says("in the lab f is off by seventeen pixels, and the bars know nothing of it")
    assert round(solved(PAPER)[1] - true_f(PAPER)) == 17
    bar, other = says(
        "The bars of fx and fy are short, ± 4.9 and ± 4.5 px, and the truth is more than three of them away."
    )
    alone, scatter = says("For fx of the paper board the formula gives ± 2.2 px, and the scatter ± 4.9 px")
    assert scatter.value == bar.value
    bent_f, bent_sigma = says("The command `camviz calibrate` solves for the bend, too, and finds f = 522.3 ± 0.7 px.")
    problem = PAPER.experiment.solved
    views = detections(problem.cameras["camera"], problem.detections["camera"])
    bent = calibrate(views, problem.board, "standard", board_warp="auto")  # as the command has it
    assert bent_f == bent.cameras["camera"].intrinsics.fx
    assert bent_sigma == np.sqrt(bent.intrinsics_covariance["camera"][0, 0])
    assert abs(bent_f.value - true_f(PAPER)) < 3 * bent_sigma.value
    assert bar == sigma.value
    assert other == PAPER.experiment.estimates["fy"][1]
    assert alone == solved(PAPER)[2]
    assert 3 < (solved(PAPER)[1] - true_f(PAPER)) / jackknifed(PAPER) < 4


def test_what_the_bullets_of_the_lab_promise(says):
    says("The only way to see this fault is to compare the first pictures with the last.")
    assert {one.id for one in DRIFT.experiment.inspection.findings} == {"split-disagreement"}
    assert DRIFT.experiment.errors.max() < 1.3 * np.median(DRIFT.experiment.errors)
    says("So it gives way to the bad column, and the arrows of the good corners point the other way.")
    column = FaultLabView(fault="column off", strength=1.0, seed=5)
    worst = int(np.argmax(column.experiment.errors))
    residuals = column.experiment.residuals[worst]
    far = np.linalg.norm(residuals, axis=-1) > 0.5 * np.linalg.norm(residuals, axis=-1).max()
    assert residuals[far].mean(axis=0) @ residuals[~far].mean(axis=0) < 0
    says("One bar towers over the rest")
    assert np.sort(column.experiment.errors)[-1] > 3 * np.sort(column.experiment.errors)[-2]
    says("the corners of the image are guesswork, and the fit is as good as ever")
    middle, healthy = (FaultLabView(fault="boards in the middle", strength=s, seed=5) for s in (1.0, 0.0))
    assert solved(middle)[0] == pytest.approx(solved(healthy)[0], rel=0.05)
    assert off(middle) > 5 * off(healthy)
    (noise,) = says("Set **noise** to 0.5 and find out how strong a fault must be to be seen at all.")
    assert noise.value in [0.5]
    FaultLabView(noise=noise.value)


def test_the_rows_read_across(says):
    first, second, far, near = says(
        "The two smallest errors of the fit, 0.20 and 0.21 px, belong to a camera that is 8.6 px off and to one that "
        "is 0.23 px off."
    )
    assert first == solved(PARALLEL)[0]
    assert second == solved(DRIFT)[0]
    assert far.about(off(PARALLEL), 0.02)  # camviz weights the pixels by how well they are known
    assert near.about(off(DRIFT), 0.05)
    furthest, believed = says(
        "The camera with the warped board is the furthest off, 17 px, and believes itself to be off by 6.4 px."
    )
    assert furthest.about(off(WARPED), 0.06)
    assert off(WARPED) == max(off(view) for view in (BLURRED, PARALLEL, WARPED, DRIFT))
    assert believed == np.median(WARPED.experiment.believed)  # by what test_clustered and test_uncertainty hold


def test_poses_absorb_a_moved_principal_point(says):
    shift, before, wrong, again = (
        says("someone changes cx by 50 px and lets the board poses be fitted again")
        + says("What happens to the error of the fit, 0.2 px before?")
        + says("It becomes about 50 px: every corner is now projected 50 px away.")
    )
    assert wrong == again.value == shift.value
    healthy, moved = (FaultLabView(fault="moved centre", strength=s, seed=5).experiment for s in (0.0, 1.0))
    assert before.about(healthy.solved.rms, 0.05)
    off, pixels = says(
        "is 52 pixels from its true place, 51 of them by the shift, and the error of the fit is half a pixel."
    )
    assert pixels == 0.08 * 640
    assert off == moved.camera.intrinsics.cx - moved.truth.intrinsics.cx
    least, most = says("every board was turned by about five degrees (4.5° to 5.4°)")
    turns = np.degrees(
        (moved.solved.first_from_board.rotation * healthy.solved.first_from_board.rotation.inv()).magnitude()
    )
    assert least == turns.min()
    assert most == turns.max()
    (again,) = says("A turn of the boards made up for nearly all of those 51 pixels.")
    assert again.value == pixels.value
    angle, cx, f = says("turn every board by 5.5° about the camera (50 px at f = 522 px)")
    assert angle == np.degrees(np.arctan(cx.value / f.value))
    assert f == true_f(ANNA)
    says("a turn moves the corners of an image farther than its middle, and a shift does not")
    x = np.array([0.0, 0.6])
    moved_by = np.tan(np.arctan(x) + 0.1) - x
    assert moved_by[1] > 1.2 * moved_by[0]


def test_the_held_out_corners(says):
    (times,) = says(
        "The healthy camera's error grows by a quarter, as it does for any pose that has to reach beyond the corners "
        "it knows. The sick camera's error becomes 2.8 times as large."
    )
    for strength, wanted in ((0.0, 1.25), (1.0, times.value)):
        made = FaultLabView(fault="moved centre", strength=strength, seed=5).experiment
        board, K, lens = made.solved.board.corners, made.camera.intrinsics.K, made.camera.lens
        left, distortion = board[:, 0] < board[:, 0].mean() + 1e-9, np.array([lens.k1, lens.k2, lens.p1, lens.p2])
        squares = []
        for seen in made.solved.detections["camera"]:
            _, turn, t = cv2.solvePnP(board[left], seen[left], K, distortion)
            foretold = cv2.projectPoints(board[~left], turn, t, K, distortion)[0].reshape(-1, 2)
            squares.append(np.sum((seen[~left] - foretold) ** 2, axis=-1))
        ratio = np.sqrt(np.mean(squares)) / made.solved.rms
        assert ratio == pytest.approx(wanted, abs=0.05)


def test_the_median_length_of_gaussian_residuals(says):
    lengths = np.linalg.norm(np.random.default_rng(1).normal(0, 1, (400_000, 2)), axis=1)
    first, second = says("half of all residuals are shorter than σ√(2 ln 2)")
    assert np.median(lengths) == pytest.approx(np.sqrt(first.value * np.log(second.value)), rel=0.005)
    two, ln, factor = says("the median length is σ √(2 ln 2) = 1.177 σ")
    assert factor == np.sqrt(two.value * np.log(ln.value))
    factor, two, ln = says("This is the median length. It is 1.177 σ, not σ: divide by √(2 ln 2).")
    assert factor == np.sqrt(two.value * np.log(ln.value))
    one_number, two, ln = says(
        "The factor 1.4826 belongs to the absolute value of one number. A length in the plane has √(2 ln 2)."
    )
    single = np.abs(np.random.default_rng(2).normal(0, 1, 4_000_000))
    assert one_number.value == pytest.approx(1 / np.median(single), rel=0.002)
    assert two.value * np.log(ln.value) == pytest.approx(np.median(lengths) ** 2, rel=0.01)
    two, ln = says("You multiply by √(2 ln 2). The median length is longer than σ by that factor: divide.")
    assert np.sqrt(two.value * np.log(ln.value)) > 1
    two, ln, again, same = says("The factor is the root of 2 ln 2. You divide by 2 ln 2 itself.")
    assert two.value * np.log(ln.value) == again.value * np.log(same.value)
    root, two, ln = says("Two coordinates make √2 for an RMS. A median length is longer than σ by √(2 ln 2).")
    assert np.sqrt(np.mean(lengths**2)) == pytest.approx(np.sqrt(root.value), rel=0.005)
    assert np.sqrt(two.value * np.log(ln.value)) == pytest.approx(np.median(lengths), rel=0.005)
    (root,) = says("This is the RMS of one coordinate: too small by √2.")
    assert np.sqrt(np.mean(lengths**2)) == pytest.approx(np.sqrt(root.value), rel=0.005)
    says("Beyond 3 σ lies one corner in ninety of a perfectly healthy camera")
    assert np.mean(lengths > 3) == pytest.approx(1 / 90, rel=0.05)


def test_shapes_and_answers_of_the_exercises(says):
    (two,) = says("Compute the RMS of every view from residuals (views, corners, 2).")
    (three,) = says("Given are unit rays (n, 3) of the same pixels, by two calibrations.")
    (again,) = says("Given are residuals (views, rows, columns, 2), all corners seen.")
    assert two.value == again.value == ANNA.experiment.residuals.shape[-1]
    assert three.value == 3 == len(ANNA.experiment.truth.unproject(np.array([3.0, 4.0])))
    says("A corner is off beyond 6 σ.")
    two, ln = says("Take σ from the median length of all residuals, which is σ√(2 ln 2) for Gaussian noise.")
    assert two.value * np.log(ln.value) == pytest.approx(np.log(4))
    whole, line = says("Answer 3 if a whole view is off, else 2 if a row or a column is")
    from camviz_school.course.material import module

    lesson16 = module("16")

    bad = np.zeros((3, 4, 5, 2)) + np.random.default_rng(0).normal(0, 0.1, (3, 4, 5, 2))
    bad[0, 1] += 50
    assert lesson16.triage(bad) == line.value
    bad[0] += 50
    assert lesson16.triage(bad) == whole.value


def test_the_hints_about_the_board_and_the_rotation(says):
    last, rows, columns = says("Write the numbers 0 to 5 into a board of 2 rows and 3 columns, row by row")
    assert rows.value * columns.value == last.value + 1
    says("The wrong reshape never raises an error.")
    assert np.arange(54.0).reshape(9, 6).size == np.arange(54.0).reshape(6, 9).size
    n, m = says("is a 3 × 3 matrix. The rotation closest to it is the answer.")
    assert (n.value, m.value) == (np.ones((7, 3)).T @ np.ones((7, 3))).shape
    n, m = says("This is the best 3 × 3 matrix, and no rotation")
    assert n.value == m.value == 3
    (mirror,) = says("Where what is left has determinant −1 it is a mirror")
    (same,) = says("Rays in one plane may give you a mirror, det R = −1.")
    (once_more,) = says("You saw that det R may be −1, and change the sign of all of R.")
    assert mirror.value == same.value == once_more.value == np.linalg.det(np.diag([1, 1, -1]))
    (axis,) = says("over the columns (axis 2) that in each row")
    mask = np.zeros((3, 4, 5), bool)
    mask[1, 2] = True
    assert mask.mean(axis=int(axis.value))[1, 2] == 1


def test_one_bar_and_ten_lengths_by_hand(says):
    numbers = [
        one.value
        for one in says("Three corners of a view have the residuals (0.3, 0.4), (0.0, −0.1) and (−0.2, 0.0) px:")
    ]
    error = np.linalg.norm(numbers) / np.sqrt(3)
    assert error == pytest.approx(0.316, abs=5e-4)  # what the cell below it prints
    (about,) = says("Nine residuals have lengths of about 0.2 px.")
    lengths = [0.14, 0.16, 0.18, 0.19, 0.20, 0.21, 0.22, 0.24, 0.26]
    assert about == np.mean(lengths)
    assert sorted([*lengths, 50.0])[4:6] == [0.20, 0.21]  # the median lies between these, however long the tenth is
    (noise,) = says("In the lab the noise is 0.15 px.")
    assert noise == FaultLabView().noise


def median_sigma(residuals):
    return np.nanmedian(np.hypot(residuals[..., 0], residuals[..., 1])) / np.sqrt(np.log(4))


def verdict(residuals):
    """0 … 3 by counting corners beyond 6 σ in views, rows and columns."""
    far = np.hypot(residuals[..., 0], residuals[..., 1]) > 6 * median_sigma(residuals)
    _, rows, columns = far.shape
    if max(far.sum(axis=(1, 2))) * 2 >= rows * columns:
        return 3
    if max(far.sum(axis=1).max() * 2 / rows, far.sum(axis=2).max() * 2 / columns) >= 1:
        return 2
    return int(far.any())


def test_what_the_reader_s_triage_says_in_the_lab(says):
    line, whole = says("With **column off** the verdict is 2 up to about a third of the scale, and then 3.")
    none = says("Choose **warped board**. The verdict stays 0 at any strength, because every view is equally off")
    assert not none

    def by(fault, strength):
        made = FaultLabView(fault=fault, strength=strength, seed=5).experiment
        return verdict(made.residuals.reshape(10, 6, 9, 2))

    assert all(line == by("column off", strength) for strength in (0.1, 0.2, 0.3))
    assert all(whole == by("column off", strength) for strength in (0.45, 0.7, 1.0))
    assert all(by("warped board", strength) == 0 for strength in (0.1, 0.4, 0.7, 1.0))


def test_what_a_rotation_explains_of_a_moved_centre(says):
    before, after = says("Before the rotation they differ by 52 px, and after the right one by 2.9 px.")
    view = FaultLabView(fault="moved centre", strength=1.0, seed=5)
    truth, lens = view.experiment.truth.intrinsics, view.experiment.truth.lens
    made, own = view.experiment.camera.intrinsics, view.experiment.camera.lens
    bend = [np.array([one.k1, one.k2, one.p1, one.p2]) for one in (lens, own)]
    uv = np.stack(np.meshgrid(np.arange(0, 640, 16.0), np.arange(0, 480, 16.0)), axis=-1).reshape(-1, 2)
    seen, true = rays(made.K, bend[1], uv), rays(truth.K, bend[0], uv)
    U, _, Vt = np.linalg.svd(true.T @ seen)

    def apart(turned):
        there = cv2.projectPoints(turned, np.zeros(3), np.zeros(3), truth.K, bend[0])[0][:, 0]
        return np.median(np.linalg.norm(there - uv, axis=1))

    assert before == apart(seen)
    assert after == apart(seen @ (U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt).T)
    (f,) = says("For five degrees and f = 522 px:")
    assert f == true_f(view)


def test_what_a_shift_and_a_turn_have_in_common(says):
    apart, again = says("Two calibrations of one camera have cx 12 px apart.") + says("Yes, by 12 pixels.")
    assert apart == again.value
    f, angle = says("At f = 522 px a turn of 1.3° makes up for nearly all of it.")
    assert f == true_f(ANNA)
    assert angle == np.degrees(np.arctan(apart.value / f.value))
    u, v = (
        one.ravel() - centre
        for one, centre in zip(np.meshgrid(np.arange(0, 640, 40), np.arange(0, 480, 40)), (320, 240), strict=True)
    )
    before = np.stack([u, v, np.full_like(u, f.value)], axis=-1)
    turn = cv2.Rodrigues(np.array([0, np.arctan(apart.value / f.value), 0]))[0]
    after = before @ turn.T
    left = after[:, :2] / after[:, 2:] * f.value - before[:, :2] - [apart.value, 0]
    assert np.median(np.linalg.norm(left, axis=1)) < 0.25 * apart.value


def test_squares_count(says):
    one, many, small = says("one corner that is 30 px off weighs as much as 10,000 corners that are 0.3 px off")
    assert one.value**2 == pytest.approx(many.value * small.value**2)


def test_the_published_left_camera(says, samples):
    low, high, worst = says("Twelve views are between 0.16 and 0.38 px, and one has 1.18.")
    file = cv2.FileStorage(str(samples / "left_intrinsics.yml"), cv2.FILE_STORAGE_READ)
    errors = np.sort(file.getNode("per_view_reprojection_errors").mat().ravel())
    assert low == errors[0]
    assert high == errors[-2]
    assert worst == errors[-1]
    near, far, before, after = says(
        "first column of the second board is off by 1.7 to 6.3 px from where the other eight columns put it. "
        "Without that picture the error of the fit falls from 0.41 to 0.23 px."
    )
    board = np.zeros((54, 3), np.float32)
    board[:, :2] = np.mgrid[0:9, 0:6].T.reshape(-1, 2) * 0.025
    corners = []
    for path in sorted(samples.glob("left[01]*.jpg")):
        grey = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        found, seen = cv2.findChessboardCorners(grey, (9, 6))
        assert found
        end = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 30, 0.001)
        corners.append(cv2.cornerSubPix(grey, seen.reshape(-1, 1, 2).astype(np.float32), (11, 11), (-1, -1), end))
    assert len(corners) == 13
    assert before == cv2.calibrateCamera([board] * 13, corners, (640, 480), None, None)[0]
    sigma, far_corners, line = says(
        "The robust σ is 0.14 px, and the second photograph has 17 corners beyond six of them."
    ) + says("The verdict is 2: a row or a column.")
    says("All others together have four.")
    _, K, distortion, turns, shifts = cv2.calibrateCamera([board] * 13, corners, (640, 480), None, None)
    there = [cv2.projectPoints(board, R, t, K, distortion)[0] for R, t in zip(turns, shifts, strict=True)]
    residuals = (np.array(corners) - np.array(there)).reshape(13, 54, 2)
    assert sigma == median_sigma(residuals)
    beyond = (np.linalg.norm(residuals, axis=-1) > 6 * median_sigma(residuals)).sum(axis=1)
    assert far_corners == beyond[1]
    assert np.delete(beyond, 1).sum() == 4
    assert line == verdict(residuals.reshape(13, 6, 9, 2))
    rest = corners[:1] + corners[2:]
    rms, K, distortion, _, _ = cv2.calibrateCamera([board] * 12, rest, (640, 480), None, None)
    assert after == rms
    others = np.tile(np.arange(9) > 0, 6)
    _, turn, shift = cv2.solvePnP(board[others], corners[1][others], K, distortion)
    foretold = cv2.projectPoints(board, turn, shift, K, distortion)[0]
    lengths = np.linalg.norm((corners[1] - foretold)[:, 0], axis=1)
    assert near == lengths[~others].min()
    assert far == lengths[~others].max()
    assert lengths[others].max() < 0.5


def test_the_published_stereo_rig(says):
    f, cx, cy = 534.80, 335.69, 240.66
    k1, k2 = 0.29589439552724328, -1.0354662043042675
    fold, lands, near, corner = says(
        "The left one's polynomial turns back at r = 0.73 before distortion. That ray lands at 0.63 in the picture, "
        "whose corners are at 0.72 to 0.77: seven percent of its pixels have no ray."
    )
    r = np.sqrt(min(root for root in np.roots([5 * k2, 3 * k1, 1]) if root > 0))
    assert fold == r
    reach = r * (1 + k1 * r**2 + k2 * r**4)
    assert lands == reach
    u, v = np.meshgrid(np.arange(640), np.arange(480))
    radius = np.hypot(u - cx, v - cy) / f
    assert near == min(np.hypot(x - cx, y - cy) / f for x in (-0.5, 639.5) for y in (-0.5, 479.5))
    assert corner == max(np.hypot(x - cx, y - cy) / f for x in (-0.5, 639.5) for y in (-0.5, 479.5))
    assert round(100 * np.mean(radius > reach)) == 7


# Going deeper --------------------------------------------------------------------------------------------------------


def test_losses_that_forgive(says):
    """Minimised by SciPy's own Huber and Cauchy; those of SciPy act on single coordinates, and only u is off."""
    from scipy.optimize import least_squares

    says("Cauchy's loss has w = 1/(1 + r²/c²), and there the force falls again.")
    limit, sigma = says("Below, c is 0.4 px for noise of σ = 0.15 px.")
    assert sigma == FaultLabView(strength=0.0, seed=5).noise
    least, shift, huber, cauchy = says(
        "With least squares the harm grows with the fault, to 0.97 px at 8 px. With Huber's weights it stays below "
        "0.07 px: bounded, and not zero. Cauchy's is below 0.02 px there"
    )
    healthy = FaultLabView(strength=0.0, seed=5).experiment
    K, lens, board = healthy.camera.intrinsics.K, healthy.camera.lens, healthy.solved.board.corners
    bend, good = np.array([lens.k1, lens.k2, lens.p1, lens.p2]), np.arange(54) % 9 != 3
    seen = healthy.solved.detections["camera"][0]

    def projected(corners, loss):
        def left(pose):
            return np.linalg.norm(corners - cv2.projectPoints(board, pose[:3], pose[3:], K, bend)[0][:, 0], axis=1)

        def moved(pose):
            return (corners - cv2.projectPoints(board, pose[:3], pose[3:], K, bend)[0][:, 0]).ravel()

        _, turn, t = cv2.solvePnP(board, corners, K, bend)
        start = np.concatenate([turn, t])[:, 0]
        c = limit.value
        force = {
            "linear": lambda r: r,
            "huber": lambda r: np.sqrt(np.where(r <= c, r**2, 2 * c * r - c**2)),
            "cauchy": lambda r: c * np.sqrt(np.log1p((r / c) ** 2)),
        }[loss]
        found = least_squares(
            moved if loss == "linear" else lambda pose: force(left(pose)), start, x_scale="jac", xtol=1e-12
        ).x
        return cv2.projectPoints(board, found[:3], found[3:], K, bend)[0][:, 0]

    def harm(by, loss):
        off = projected(seen + np.where(good, 0, by)[:, None] * [1, 0], loss) - projected(seen, "linear")
        return np.sqrt(np.mean(np.sum(off[good] ** 2, axis=-1)))

    assert least == harm(shift.value, "linear")
    assert huber.value - 0.01 < max(harm(by, "huber") for by in (2, 4, 6, shift.value)) < huber.value
    assert cauchy.value - 0.005 < harm(shift.value, "cauchy") < cauchy.value
    assert harm(1, "cauchy") > 1.5 * harm(8, "cauchy")  # hardly told from noise


def test_the_next_best_view(says):
    """By OpenCV's own error bars of eleven views; the eleventh is exact, so that only its pose counts."""
    stays, tilt, brings = says(
        "One more board held straight changes nothing: the foretold σ of fx stays at 12 px. One that is tilted by 60° "
        "brings it to 1.3 px, and one picture does what ten could not."
    )
    says("For cx that board is nearly worthless.")
    says("Anna has her ten views, and may take one more.")
    made = ANNA.experiment
    K, lens, board = made.camera.intrinsics.K, made.camera.lens, made.solved.board.corners
    bend = np.array([lens.k1, lens.k2, lens.p1, lens.p2])

    def sigmas(degrees):
        """Of fx and cx: by all poses and the camera together, with derivatives by finite differences."""
        turn = np.array([0, np.radians(degrees), 0])
        R = cv2.Rodrigues(turn)[0]
        poses = made.solved.first_from_board
        views = [*np.concatenate([poses.rotation.as_rotvec(), poses.translation], axis=1)]
        views.append(np.concatenate([turn, [0, 0, 0.4] - R @ board.mean(axis=0)]))
        camera = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2], *bend])

        def shown(pose, c):
            return cv2.projectPoints(
                board, pose[:3], pose[3:], np.array([[c[0], 0, c[2]], [0, c[1], c[3]], [0, 0, 1]]), c[4:]
            )[0].ravel()

        J = np.zeros((108 * len(views), 8 + 6 * len(views)))
        for i, pose in enumerate(views):
            rows = slice(108 * i, 108 * i + 108)
            for j in range(8):
                h = np.eye(8)[j] * (1e-3 if j < 4 else 1e-6)
                J[rows, j] = (shown(pose, camera + h) - shown(pose, camera - h)) / (2 * h[j])
            for j in range(6):
                h = np.eye(6)[j] * 1e-6
                J[rows, 8 + 6 * i + j] = (shown(pose + h, camera) - shown(pose - h, camera)) / 2e-6
        return 0.14 * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))[[0, 2]]

    assert stays == sigmas(0)[0]
    assert brings == sigmas(tilt.value)[0]
    assert sigmas(tilt.value)[1] > 0.98 * sigmas(0)[1]


def test_gauge_freedom(says):
    says("there are three turns, three shifts and one scale, seven in all")
    n, m, k = says("Given are R (3, 3) and t (3,) of a camera, and Q, d and s > 0.")[:3]
    assert n.value == m.value == k.value == 3
    says("In lesson 06 the board was known.")
    (noise,) = says("The noise is 0.2 px:")
    assert noise.value in [0.2]  # as the cell below has it
    from camviz_school.course.material import module

    rng = np.random.default_rng(3)
    X, K = rng.uniform(-0.3, 0.3, (9, 3)), np.diag([520.0, 520.0, 1.0])
    R, Q = (Rotation.from_rotvec(one).as_matrix() for one in ((0.2, -0.1, 0.4), (0.5, 0.3, -0.9)))
    t, d, s = np.array([0.1, -0.2, 2.0]), np.array([3.0, -1, 0.5]), 1.7
    R_new, t_new = module("16").same_pictures(R, t, Q, d, s)
    before = cv2.projectPoints(X, cv2.Rodrigues(R)[0], t, K, None)[0]
    after = cv2.projectPoints(s * X @ Q.T + d, cv2.Rodrigues(R_new)[0], t_new, K, None)[0]
    np.testing.assert_allclose(after, before, atol=1e-8)
    seen = BEN.experiment.solved.detections["camera"].astype(np.float32)
    board = BEN.experiment.solved.board.corners.astype(np.float32)
    well, large = (
        cv2.calibrateCamera([f * board] * 10, list(seen), (640, 480), None, None, flags=cv2.CALIB_FIX_K3)
        for f in (np.float32(1), np.float32(1.02))
    )
    assert large[0] == pytest.approx(well[0], abs=1e-4)
    assert large[1][0, 0] == pytest.approx(well[1][0, 0], abs=0.05)
    assert np.linalg.norm(large[4][0]) == pytest.approx(1.02 * np.linalg.norm(well[4][0]), rel=1e-4)


# Before the lesson ---------------------------------------------------------------------------------------------------


def test_before_the_lesson_what_an_error_of_the_fit_says(says):
    (error,) = says("A report says: error of the fit 0.11 px.")
    (agrees,) = says("Where corners were found, the model agrees with them to about 0.11 px.")
    (claimed,) = says("The focal length is right to about 0.11 px.")
    assert error.value == agrees.value == claimed.value
    rms, f, *_ = solved(ANNA)  # boards that were all held alike
    assert abs(f - true_f(ANNA)) > 10 * rms


def test_before_the_lesson_how_much_one_corner_weighs(says):
    bad, others = says("In one of them the error is 3 px, in the others 0.2 px.")
    off, corners, each = says("one corner that is 3 px off weighs as much as 225 that are 0.2 px off")
    assert (off.value, each.value) == (bad.value, others.value)
    assert corners == off.value**2 / each.value**2


def test_before_the_lesson_a_turn_explains_most_of_cy(says):
    moved, f = says("Now cy is 8 px greater, at f = 640 px.")
    (claimed,) = says("Yes: by 8 px.")
    (explained,) = says("The question is how much of the 8 px a turn explains.")
    assert claimed.value == explained.value == moved.value
    (angle,) = says("A turn by 0.7° moves the picture by nearly as much")
    K = np.array([[f.value, 0, 319.5], [0, f.value, 239.5], [0, 0, 1]])
    assert angle == np.degrees(np.arctan(moved.value / f.value))
    turn = cv2.Rodrigues(np.array([np.arctan(moved.value / f.value), 0, 0]))[0]
    x, y = np.meshgrid(np.linspace(-0.4, 0.4, 9), np.linspace(-0.3, 0.3, 7))
    points = np.stack([x, y, np.ones_like(x)], axis=-1)
    before, after = (p[..., :2] / p[..., 2:] for p in (points @ K.T, points @ turn.T @ K.T))
    steps = (after - before)[..., 1]
    assert np.abs(steps + moved.value).max() < 0.2 * moved.value


def test_hand_and_eye(says):
    """Least squares of AX = XB over all six numbers of X, begun at nothing; where OpenCV has its own, that too."""
    from quoting import LESSONS
    from scipy.optimize import least_squares

    from camviz_school.course import notebooks

    cell = next(
        one for one in notebooks.read(LESSONS / "16_clinic.ipynb").cells if "R = Rotation.align_vectors" in one.source
    )
    names: dict[str, object] = {"np": np}
    exec(cell.source.split("R = Rotation.align_vectors")[0], names)
    A, B, X, hand, seen = (names[name] for name in ("A", "B", "X", "hand", "seen"))

    def errors(x):
        R = Rotation.from_rotvec(x[:3]).as_matrix()
        turned = A.rotation.as_matrix() @ R - R @ B.rotation.as_matrix()
        moved = A.rotation.apply(x[3:]) + A.translation - B.translation @ R.T - x[3:]
        return np.concatenate([turned.ravel(), moved.ravel()])

    found = least_squares(errors, np.array([0, 0, 1.5, 0, 0, 0])).x
    assert np.degrees((Rotation.from_rotvec(found[:3]) * X.rotation.inv()).magnitude()) < 0.25
    assert np.linalg.norm(found[3:] - X.translation) < 0.005
    if hasattr(cv2, "calibrateHandEye"):
        poses = (hand.rotation.as_matrix(), hand.translation, seen.rotation.as_matrix(), seen.translation)
        R, t = cv2.calibrateHandEye(*map(list, poses), method=cv2.CALIB_HAND_EYE_PARK)
        np.testing.assert_allclose(R, X.rotation.as_matrix(), atol=0.005)
        np.testing.assert_allclose(t.ravel(), X.translation, atol=0.005)
    (release,) = says("OpenCV has this as `calibrateHandEye` in its releases 4.")
    assert release.value == 4


def cells():
    """The cells of the lesson by their names."""
    from quoting import LESSONS

    from camviz_school.course import notebooks

    return {one.id: one.source for one in notebooks.read(LESSONS / "16_clinic.ipynb").cells}


def run_here(names, *identifiers):
    """What these cells of the lesson leave behind, on top of `names`."""
    for identifier in identifiers:
        exec(cells()[identifier], names)
    return names


def test_which_frames_of_a_film(says):
    """By OpenCV's error bars of the views alone, from their corners."""
    from camviz_school.course.material import module

    says("Equal spacing needs about sixty for it")
    (pictures,) = says("A film of ten seconds holds 300 pictures, and most of them show the same.")
    (foretold,) = says("Six chosen frames bring the foretold σ to 1.0 px.")
    made = ANNA.experiment
    bend = np.array([getattr(made.camera.lens, name) for name in ("k1", "k2", "p1", "p2")])
    board, K = made.solved.board.corners, made.camera.intrinsics.K
    names = {"np": np, "cv2": cv2, "board": board, "believed": (K, bend), "next_view": module("16").next_view}
    names["attempt"] = lambda function, *arguments, like: function(*arguments)
    exec("def information" + cells()["information"].split("def information")[1].split("def tilted")[0], names)
    exec(cells()["film-choice"].split("plt.semilogy")[0], names)

    def sigma(frames):
        """OpenCV's σ of fx of these frames, for a noise of 0.14 px."""
        rng, seen = np.random.default_rng(1), []
        for frame in frames:
            uv = cv2.projectPoints(board, names["turns"][frame], names["shifts"][frame], K, bend)[0]
            seen.append(np.float32(uv[:, 0] + rng.normal(0, 0.14, (54, 2))))
        flags = cv2.CALIB_FIX_K3 | cv2.CALIB_USE_INTRINSIC_GUESS
        flat = [np.float32(board)] * len(seen)
        start = K.copy(), np.append(bend, 0)
        rms, *_, sigmas, _, _ = cv2.calibrateCameraExtended(flat, seen, (640, 480), *start, flags=flags)
        return 0.14 / rms * np.sqrt(2) * sigmas[0, 0]

    yours = sigma(names["chosen"][:6])
    assert yours == pytest.approx(foretold.value, abs=0.1)
    assert sigma(names["equal"][59]) == pytest.approx(yours, rel=0.1)
    assert sigma(names["equal"][29]) > 1.2 * yours
    assert len(names["frames"]) == pictures.value


def test_a_film_whose_rows_wait(says):
    """The delay by trying which one OpenCV fits best; where corners are found, by a root for each corner."""
    from scipy.optimize import brentq, minimize_scalar

    from camviz_school.course.material import module

    middle, rows = says("Row v is read (v − 240) d after the middle one of 480")
    assert 2 * middle.value == rows
    (again,) = says("A corner that moves at w px/s is therefore found off its place by d · (v − 240) w.")
    assert again.value == middle
    (unit,) = says("Call q how far that is at a delay of 1 µs")
    frames, delay, whole = says("Here 24 frames are taken of a board in motion. The delay is 50 µs, which makes 24 ms")
    right, fx, before, rms, noise = says(
        "The right delay comes out as 49.5 µs. With it fx is 523.0 px in place of 534.3, and the error of the fit "
        "falls from 0.23 px to the noise, 0.14 px."
    )[:5]
    made = ANNA.experiment
    names = {"np": np, "cv2": cv2, "board": made.solved.board.corners, "Rotation": Rotation}
    run_here(names, "rows-film", "rows-derivative", "rows-fit")
    seen, q, e, J = (names[name] for name in ("seen", "q", "e", "J"))
    assert len(seen) == frames.value
    assert 480 * delay.value * 1e-3 == whole
    np.testing.assert_allclose(q, unit.value * 1e-6 * (seen[..., 1:] - middle.value) * names["w"])

    def late(i):
        """How many rows after the middle one a corner of the first frame is read, by a root."""

        def miss(rows):
            t = rows * delay.value * 1e-6
            turn = np.array([0.35 * np.sin(2.1 * t + 0.3), 0.4 * np.sin(1.7 * t + 1), 0.3 * np.sin(1.3 * t)])
            shift = np.array([0.1 * np.sin(3 * t), 0.07 * np.sin(2.3 * t), 0.55 + 0.08 * np.sin(1.9 * t + 2)])
            xyz = Rotation.from_rotvec(turn).apply(names["middled"][i]) + shift
            uv = cv2.projectPoints(xyz, np.zeros(3), np.zeros(3), names["K_true"], names["lens_true"])[0].ravel()
            return uv[1] - 240 - rows

        return brentq(miss, -240, 240, xtol=1e-9)

    rolled = names["film"](np.array([0.0]))[0]
    np.testing.assert_allclose(rolled[[0, 20, 53], 1] - 240, [late(i) for i in (0, 20, 53)], atol=1e-6)

    def error(d):
        return names["fit"](seen - d * q)[0][0]

    best = minimize_scalar(error, bounds=(40, 60), method="bounded", options={"xatol": 0.05}).x
    yours = module("16").line_delay(e, J, q.ravel())
    assert yours == right
    assert yours == pytest.approx(best, abs=1.0)  # to first order, and to the end
    assert np.sum(q.ravel() * e) / np.sum(q**2) < delay.value / 10
    says("The slope finds less than a tenth of the delay.")
    mended, global_shutter = names["fit"](seen - yours * q)[0], names["found"]
    assert (mended[1][0, 0], mended[0]) == (fx, noise)
    assert (global_shutter[1][0, 0], global_shutter[0]) == (before, rms)
    assert 0.1 * np.sqrt(2) == noise  # of both coordinates


def test_islands_and_a_ring(says):
    """The clinic's own islands; errors of a chain by first order, from each link's lever arm."""
    from camviz.poses import RigidTransform
    from camviz_clinic.rigs.graph import islands
    from camviz_school.course.material import module

    says("Six cameras look into a room from all sides")
    says("There are three islands: cam0, cam1 and cam2; cam3 and cam4; cam5 alone.")
    names = run_here({"np": np}, "rig-seen")
    saw = names["saw"]
    assert islands(dict(zip(names["TABLE"], saw, strict=True))) == [
        ("cam0", "cam1", "cam2"),
        ("cam3", "cam4"),
        ("cam5",),
    ]
    assert module("16").islands(saw).tolist() == [0, 0, 0, 3, 3, 5]
    assert saw.shape == (6, 12)
    assert not (saw[0] & saw[2]).any()
    tied = np.column_stack([saw, np.isin(range(6), (2, 3)), np.isin(range(6), (4, 5))])
    assert module("16").islands(tied).tolist() == [0] * 6
    turn, shift = says("with a pose that is off by 0.05° about each axis and by 0.5 mm along each")
    closed, chained, worst = says("cam5 is off by 0.9 mm in place of 5.3 mm, and no camera by more than 2.3 mm")
    says("cam5 is off six times as far as cam1")
    chord = 2 * 1200 * np.abs(np.sin(np.radians(60) * np.arange(6) / 2))  # from a camera to the one so many places on
    variance = [3 * n * shift.value**2 + 2 * np.radians(turn.value) ** 2 * np.sum(chord[:n] ** 2) for n in range(1, 6)]
    off = np.sqrt(variance)
    ring = 1 / np.sqrt(1 / off**2 + 1 / off[::-1] ** 2)
    assert (ring[-1], off[-1], ring.max()) == (closed, chained, worst)
    assert 5.5 < off[-1] / off[0] < 6.5
    names = run_here({"np": np, "RigidTransform": RigidTransform, "Rotation": Rotation}, "rig-chain")
    np.testing.assert_allclose(names["off"], off, rtol=0.02)
