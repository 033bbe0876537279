"""What lesson 16 claims about calibrations that are wrong, solved again by OpenCV and SciPy from the same corners."""

from functools import cache, partial

import cv2
import numpy as np
import pytest
from claims import claims
from numpy.linalg import norm
from scipy.optimize import brentq, least_squares, minimize_scalar
from scipy.spatial.transform import Rotation

from camviz.poses import RigidTransform
from camviz_clinic.calibration import calibrate
from camviz_clinic.checks.virtual import detections
from camviz_clinic.rigs.graph import islands
from camviz_school.course import material, notebooks
from camviz_school.views.fault_lab import FaultLabView

says = claims("16")
lesson16 = material.module("16")

Lab = partial(FaultLabView, seed=5)
ANNA = Lab(fault="parallel boards", strength=1.0, noise=0.14)
BEN = Lab(fault="parallel boards", strength=0.0, noise=0.39)
PAPER = Lab(fault="warped board", strength=0.5)
MOVED = Lab(fault="moved centre", strength=1.0)
SIZE, F = (640, 480), ANNA.experiment.truth.intrinsics.fx


def corners(view):
    made = view.experiment.solved
    return [np.float32(made.board.corners)] * made.views, list(np.float32(made.detections["camera"]))


@cache
def solved(view):
    """OpenCV's own solution of the corners: RMS, fx, σ of fx, K and distortion."""
    rms, K, lens, _, _, sigmas, *_ = cv2.calibrateCameraExtended(
        *corners(view), SIZE, None, None, flags=cv2.CALIB_FIX_K3
    )
    return rms, K[0, 0], sigmas[0, 0], K, lens


@cache
def jackknifed(view):
    """(n − 1)/√n times the scatter of OpenCV's fx without each view in turn."""
    board, seen = corners(view)
    n, f = len(seen), []
    for left in range(n):
        rest = seen[:left] + seen[left + 1 :]
        f.append(cv2.calibrateCamera(board[1:], rest, SIZE, None, None, flags=cv2.CALIB_FIX_K3)[1][0, 0])
    return (n - 1) / np.sqrt(n) * norm(np.array(f) - solved(view)[1]) / np.sqrt(n - 1)


def model(camera):
    lens = camera.lens
    return camera.intrinsics.K, np.array([lens.k1, lens.k2, lens.p1, lens.p2])


def project(points, turn, t, K, lens=None):
    return cv2.projectPoints(np.asarray(points, dtype=float), turn, t, K, lens)[0][:, 0]


def rays(K, lens, uv):
    xy = cv2.undistortPoints(uv.reshape(-1, 1, 2), K, lens, criteria=(3, 100, 1e-12))[:, 0]
    return np.column_stack([xy, np.ones(len(xy))]) / norm(np.column_stack([xy, np.ones(len(xy))]), axis=1)[:, None]


def apart(truth, K, lens, uv, turned=True):
    """How far a camera's pixels are from the true one's: their median, after the best rotation."""
    true, believed = rays(*model(truth), uv), rays(K, lens, uv)
    R = Rotation.align_vectors(true, believed)[0] if turned else Rotation.identity()
    return np.median(norm(project(R.apply(believed), np.zeros(3), np.zeros(3), *model(truth)) - uv, axis=1))


def cells():
    (path,) = material.lessons_folder().glob("16_*.ipynb")
    return {one.id: one.source for one in notebooks.read(path).cells}


def run(*identifiers, **names):
    """What these cells of the lesson leave behind, on top of `names`."""
    for identifier in identifiers:
        exec(cells()[identifier].split("plt.semilogy")[0], names := {"np": np, "cv2": cv2} | names)
    return names


def test_a_residual_is_detected_less_projected():
    says("An arrow leads from where the fitted camera projects a corner to where the corner was detected.")
    says("This vector, detected − projected, is the corner's")
    made = BEN.experiment
    for pose, seen, residuals in zip(
        made.solved.first_from_board, made.solved.detections["camera"], made.residuals, strict=True
    ):
        at = project(made.solved.board.corners, pose.rotation.as_rotvec(), pose.translation, *model(made.camera))
        np.testing.assert_allclose(residuals.reshape(-1, 2), seen - at, atol=1e-6)


def test_anna_fits_better_and_is_farther_off():
    says("Anna's error of the fit is 0.19 px, Ben's 0.52 px.", "Anna's f is off by 3.5 %, and Ben's by 0.15 %.")
    assert [solved(ANNA)[0], solved(BEN)[0]] == pytest.approx([0.19, 0.52], abs=5e-3)
    assert 100 * abs(solved(ANNA)[1] / F - 1) == pytest.approx(3.5, abs=0.05)
    assert 100 * abs(solved(BEN)[1] / F - 1) == pytest.approx(0.15, abs=5e-3)
    says("its ± is (n − 1)/√n times the scatter of these solutions", "the bar of fx is fifteen times as long as Ben's.")
    says("the formula gives ± 2.2 px, and the scatter of his ten views ± 1.3 px")
    ben, anna = (view.experiment.estimates["fx"][1] for view in (BEN, ANNA))
    assert [solved(BEN)[2], ben] == pytest.approx([2.2, 1.3], abs=0.05)
    assert ben == pytest.approx(jackknifed(BEN), rel=0.06)  # camviz's is to first order
    assert anna / ben == pytest.approx(15, abs=0.5)


def test_a_board_of_paper_is_not_in_the_bars():
    says("f = 538.7 ± 4.9 px. Its board was printed on paper that bulges by one percent of its length, 2 mm.")
    says("in the lab f is off by seventeen pixels, and the bars know nothing of it", "and finds f = 522.3 ± 0.7 px")
    sigma = PAPER.experiment.estimates["fx"][1]
    assert [solved(PAPER)[1], sigma] == pytest.approx([538.7, 4.9], abs=0.05)
    assert sigma == pytest.approx(jackknifed(PAPER), rel=0.08)
    assert solved(PAPER)[1] - F == pytest.approx(17, abs=0.5)
    problem = PAPER.experiment.solved
    assert 1000 * 0.01 * np.ptp(problem.board.corners[:, 0]) == pytest.approx(2, abs=0.5)
    views = detections(problem.cameras["camera"], problem.detections["camera"])
    bent = calibrate(views, problem.board, "standard", board_warp="auto")
    found = bent.cameras["camera"].intrinsics.fx, np.sqrt(bent.intrinsics_covariance["camera"][0, 0])
    assert found == pytest.approx((522.3, 0.7), abs=0.05)


def test_poses_absorb_a_moved_principal_point():
    says("someone changes cx by 50 px and lets the board poses be fitted again")
    says("is 52 pixels from its true place, 51 of them by the shift, and the error of the fit is half a pixel")
    says(
        "every board was turned by about five degrees (4.5° to 5.4°)", "by 5.5° about the camera (50 px at f = 522 px)"
    )
    healthy, moved = Lab(fault="moved centre", strength=0.0).experiment, MOVED.experiment
    assert moved.camera.intrinsics.cx - moved.truth.intrinsics.cx == pytest.approx(52, abs=0.5)
    turned = moved.solved.first_from_board.rotation * healthy.solved.first_from_board.rotation.inv()
    angles = np.degrees(turned.magnitude())
    assert [angles.min(), angles.max(), np.degrees(np.arctan(50 / F))] == pytest.approx([4.5, 5.4, 5.5], abs=0.05)
    says("Before the rotation they differ by 52 px, and after the right one by 2.9 px.")
    uv = np.stack(np.meshgrid(np.arange(0, 640, 16.0), np.arange(0, 480, 16.0)), axis=-1).reshape(-1, 2)
    assert apart(moved.truth, *model(moved.camera), uv, turned=False) == pytest.approx(52, abs=0.5)
    assert apart(moved.truth, *model(moved.camera), uv) == pytest.approx(2.9, abs=0.05)
    says("The healthy camera's error grows by a quarter", "The sick camera's error becomes 2.8 times as large.")
    for made, times in ((healthy, 1.25), (moved, 2.8)):
        board, camera, squares = made.solved.board.corners, model(made.camera), []
        left = board[:, 0] < board[:, 0].mean() + 1e-9
        for seen in made.solved.detections["camera"]:
            _, turn, t = cv2.solvePnP(board[left], seen[left], *camera)
            squares.append(np.sum((seen[~left] - project(board[~left], turn, t, *camera)) ** 2, axis=-1))
        assert np.sqrt(np.mean(squares)) / made.solved.rms == pytest.approx(times, abs=0.05)


def test_the_median_length_of_gaussian_residuals():
    says("half of all residuals are shorter than σ√(2 ln 2)")
    lengths = norm(np.random.default_rng(1).normal(0, 1, (400_000, 2)), axis=1)
    assert np.median(lengths) == pytest.approx(np.sqrt(2 * np.log(2)), rel=0.005)
    normal = np.random.default_rng(2).normal(0, 0.14, (20, 400, 2))
    assert lesson16.robust_sigma(normal) == pytest.approx(0.14, rel=0.05)


def test_the_published_left_camera(samples):
    says("Twelve views are between 0.16 and 0.38 px, and one has 1.18.")
    file = cv2.FileStorage(str(samples / "left_intrinsics.yml"), cv2.FILE_STORAGE_READ)
    errors = np.sort(file.getNode("per_view_reprojection_errors").mat().ravel())
    assert errors[[0, -2, -1]] == pytest.approx([0.16, 0.38, 1.18], abs=5e-3)
    says("The robust σ is 0.14 px, and the second photograph has 17 corners beyond six of them.")
    says("Without that picture the error of the fit falls from 0.41 to 0.23 px.", "All others together have four.")
    board, seen = np.zeros((54, 3), np.float32), []
    board[:, :2] = np.mgrid[0:9, 0:6].T.reshape(-1, 2) * 0.025
    for path in sorted(samples.glob("left[01]*.jpg")):
        grey = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
        uv = np.float32(cv2.findChessboardCorners(grey, (9, 6))[1].reshape(-1, 1, 2))
        seen.append(cv2.cornerSubPix(grey, uv, (11, 11), (-1, -1), (3, 30, 0.001)))
    rms, K, lens, turns, ts = cv2.calibrateCamera([board] * 13, seen, SIZE, None, None)
    without = cv2.calibrateCamera([board] * 12, seen[:1] + seen[2:], SIZE, None, None)[0]
    assert [rms, without] == pytest.approx([0.41, 0.23], abs=5e-3)
    there = [project(board, R, t, K, lens) for R, t in zip(turns, ts, strict=True)]
    residuals = np.array(seen)[:, :, 0] - there
    sigma = np.median(norm(residuals, axis=-1)) / np.sqrt(np.log(4))
    beyond = (norm(residuals, axis=-1) > 6 * sigma).sum(axis=1)
    assert (sigma, beyond[1], beyond.sum()) == (pytest.approx(0.14, abs=5e-3), 17, 21)
    says("The verdict is 2: a row or a column.")
    assert lesson16.triage(residuals.reshape(13, 6, 9, 2)) == 2


def test_losses_that_forgive():
    """Minimised by SciPy, without weights; one column of a board is moved along u."""
    says("Below, c is 0.4 px for noise of σ = 0.15 px.", "With least squares the harm grows with the fault, to 0.97 px")
    says("With Huber's weights it stays below 0.07 px: bounded, and not zero. Cauchy's is below 0.02 px there")
    made, c = Lab(strength=0.0).experiment, 0.4
    board, good, camera = made.solved.board.corners, np.arange(54) % 9 != 3, model(made.camera)
    seen = made.solved.detections["camera"][0]
    losses = {
        "linear": lambda r: r,
        "huber": lambda r: np.sqrt(np.where(r <= c, r**2, 2 * c * r - c**2)),
        "cauchy": lambda r: c * np.sqrt(np.log1p((r / c) ** 2)),
    }

    def fitted(uv, loss):
        def force(pose):
            return losses[loss](norm(uv - project(board, pose[:3], pose[3:], *camera), axis=1))

        start = np.concatenate(cv2.solvePnP(board, uv, *camera)[1:])[:, 0]
        found = least_squares(force, start, x_scale="jac", xtol=1e-12).x
        return project(board, found[:3], found[3:], *camera)

    def harm(by, loss):
        moved = fitted(seen + np.where(good, 0, by)[:, None] * [1, 0], loss) - fitted(seen, "linear")
        return np.sqrt(np.mean(np.sum(moved[good] ** 2, axis=-1)))

    assert harm(8, "linear") == pytest.approx(0.97, abs=5e-3)
    assert 0.06 < max(harm(by, "huber") for by in (2, 4, 6, 8)) < 0.07
    assert 0.015 < harm(8, "cauchy") < 0.02


def test_the_next_best_view():
    """By derivatives of OpenCV's projections, by differences, over all views and the camera at once."""
    says("the foretold σ of fx stays at 12 px. One that is tilted by 60° brings it to 1.3 px")
    says("For cx that board is nearly worthless.")
    made = ANNA.experiment
    (K, lens), board, poses = model(made.camera), made.solved.board.corners, made.solved.first_from_board
    camera = np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2], *lens])

    def shown(x):
        c, pose = x[:8], x[8:]
        return project(
            board, pose[:3], pose[3:], np.array([[c[0], 0, c[2]], [0, c[1], c[3]], [0, 0, 1]]), c[4:]
        ).ravel()

    def sigmas(degrees):
        turn = np.array([0, np.radians(degrees), 0])
        shift = [0, 0, 0.4] - cv2.Rodrigues(turn)[0] @ board.mean(axis=0)
        views = [*np.column_stack([poses.rotation.as_rotvec(), poses.translation]), np.concatenate([turn, shift])]
        J = np.zeros((108 * len(views), 8 + 6 * len(views)))
        for i, pose in enumerate(views):
            x, steps = np.concatenate([camera, pose]), np.diag([1e-3] * 4 + [1e-6] * 10)
            slopes = np.array([(shown(x + h) - shown(x - h)) / (2 * h.max()) for h in steps]).T
            J[108 * i : 108 * i + 108, [*range(8), *range(8 + 6 * i, 14 + 6 * i)]] = slopes
        return 0.14 * np.sqrt(np.diag(np.linalg.inv(J.T @ J)))[[0, 2]]

    straight, tilted = sigmas(0), sigmas(60)
    assert straight[0] == pytest.approx(12, abs=0.5)
    assert tilted[0] == pytest.approx(1.3, abs=0.05)
    assert tilted[1] > 0.98 * straight[1]


def test_which_frames_of_a_film():
    """By OpenCV's error bars of the views alone, from their corners."""
    says("Six chosen frames bring the foretold σ to 1.0 px.", "Equal spacing needs about sixty for it")
    made = ANNA.experiment
    (K, lens), board = model(made.camera), made.solved.board.corners
    names = {"np": np, "cv2": cv2, "board": board, "believed": (K, lens), "next_view": lesson16.next_view}
    names["attempt"] = lambda function, *arguments, like: function(*arguments)
    exec("def information" + cells()["information"].split("def information")[1].split("def tilted")[0], names)
    names = run("film-choice", **names)

    def sigma(frames):
        rng, flags = np.random.default_rng(1), cv2.CALIB_FIX_K3 | cv2.CALIB_USE_INTRINSIC_GUESS
        seen = [project(board, names["turns"][i], names["shifts"][i], K, lens) for i in frames]
        seen = [np.float32(uv + rng.normal(0, 0.14, uv.shape)) for uv in seen]
        start = [np.float32(board)] * len(seen), seen, SIZE, K.copy(), np.append(lens, 0)
        rms, *_, sigmas, _, _ = cv2.calibrateCameraExtended(*start, flags=flags)
        return 0.14 / rms * np.sqrt(2) * sigmas[0, 0]

    yours = sigma(names["chosen"][:6])
    assert yours == pytest.approx(1.0, abs=0.1)
    assert sigma(names["equal"][59]) == pytest.approx(yours, rel=0.1)
    assert sigma(names["equal"][29]) > 1.2 * yours


def test_a_film_whose_rows_wait():
    """The delay that OpenCV fits best, of many tried; where a corner is found, by a root."""
    says("The right delay comes out as 49.5 µs. With it fx is 523.0 px in place of 534.3")
    says("falls from 0.23 px to the noise, 0.14 px", "The delay is 50 µs, which makes 24 ms")
    board = ANNA.experiment.solved.board.corners
    names = run("rows-film", "rows-derivative", "rows-fit", board=board, Rotation=Rotation)
    seen, q, fit = (names[name] for name in ("seen", "q", "fit"))
    yours = lesson16.line_delay(names["e"], names["J"], q.ravel())
    best = minimize_scalar(
        lambda d: fit(seen - d * q)[0][0], bounds=(40, 60), method="bounded", options={"xatol": 0.05}
    )
    assert yours == pytest.approx(49.5, abs=0.05)
    assert yours == pytest.approx(best.x, abs=1.0)  # to first order, and to the end
    mended, before = fit(seen - yours * q)[0], names["found"]
    assert [mended[1][0, 0], before[1][0, 0]] == pytest.approx([523.0, 534.3], abs=0.05)
    assert [mended[0], before[0]] == pytest.approx([0.14, 0.23], abs=5e-3)

    def miss(rows):
        t = rows * 50e-6
        turn = np.array([0.35 * np.sin(2.1 * t + 0.3), 0.4 * np.sin(1.7 * t + 1), 0.3 * np.sin(1.3 * t)])
        shift = np.array([0.1 * np.sin(3 * t), 0.07 * np.sin(2.3 * t), 0.55 + 0.08 * np.sin(1.9 * t + 2)])
        return project(names["middled"][20:21], turn, shift, names["K_true"], names["lens_true"])[0, 1] - 240 - rows

    assert names["film"](np.array([0.0]))[0][20, 1] - 240 == pytest.approx(brentq(miss, -240, 240), abs=1e-6)


def test_hand_and_eye():
    """Least squares of AX = XB over all six numbers of X, begun at nothing; where OpenCV has its own, that too."""
    source = next(one for one in cells().values() if "R = Rotation.align_vectors" in one)
    names = {"np": np}
    exec(source.split("R = Rotation.align_vectors")[0], names)
    A, B, X = names["A"], names["B"], names["X"]

    def errors(x):
        R = Rotation.from_rotvec(x[:3]).as_matrix()
        turned = A.rotation.as_matrix() @ R - R @ B.rotation.as_matrix()
        moved = A.rotation.apply(x[3:]) + A.translation - B.translation @ R.T - x[3:]
        return np.concatenate([turned.ravel(), moved.ravel()])

    found = least_squares(errors, np.array([0, 0, 1.5, 0, 0, 0])).x
    assert np.degrees((Rotation.from_rotvec(found[:3]) * X.rotation.inv()).magnitude()) < 0.25
    np.testing.assert_allclose(found[3:], X.translation, atol=0.005)
    if hasattr(cv2, "calibrateHandEye"):
        poses = [(one.rotation.as_matrix(), one.translation) for one in (names["hand"], names["seen"])]
        R, t = cv2.calibrateHandEye(*map(list, poses[0] + poses[1]), method=cv2.CALIB_HAND_EYE_PARK)
        np.testing.assert_allclose(R, X.rotation.as_matrix(), atol=0.005)
        np.testing.assert_allclose(t.ravel(), X.translation, atol=0.005)


def test_islands_and_a_ring():
    """The clinic's own islands; errors of a chain to first order, from each link's lever arm."""
    says("There are three islands: cam0, cam1 and cam2; cam3 and cam4; cam5 alone.")
    names = run("rig-seen")
    groups = islands(dict(zip(names["TABLE"], names["saw"], strict=True)))
    assert groups == [("cam0", "cam1", "cam2"), ("cam3", "cam4"), ("cam5",)]
    assert lesson16.islands(names["saw"]).tolist() == [0, 0, 0, 3, 3, 5]
    says("with a pose that is off by 0.05° about each axis and by 0.5 mm along each")
    says("cam5 is off by 0.9 mm in place of 5.3 mm, and no camera by more than 2.3 mm")
    chord = 2400 * np.abs(np.sin(np.radians(60) * np.arange(6) / 2))
    chain = np.sqrt([3 * n * 0.5**2 + 2 * np.radians(0.05) ** 2 * np.sum(chord[:n] ** 2) for n in range(1, 6)])
    ring = 1 / np.sqrt(1 / chain**2 + 1 / chain[::-1] ** 2)
    assert [ring[-1], chain[-1], ring.max()] == pytest.approx([0.9, 5.3, 2.3], abs=0.05)
    found = run("rig-chain", RigidTransform=RigidTransform, Rotation=Rotation)["off"]
    np.testing.assert_allclose(found, chain, rtol=0.02)


def test_gauge_freedom():
    says("there are three turns, three shifts and one scale, seven in all")
    X, K = np.random.default_rng(3).uniform(-0.3, 0.3, (9, 3)), np.diag([520.0, 520, 1])
    R, Q = (Rotation.from_rotvec(one).as_matrix() for one in ((0.2, -0.1, 0.4), (0.5, 0.3, -0.9)))
    t, d, s = np.array([0.1, -0.2, 2.0]), np.array([3.0, -1, 0.5]), 1.7
    R_new, t_new = lesson16.same_pictures(R, t, Q, d, s)
    after = project(s * X @ Q.T + d, cv2.Rodrigues(R_new)[0], t_new, K)
    np.testing.assert_allclose(after, project(X, cv2.Rodrigues(R)[0], t, K), atol=1e-8)


def test_questions_squares_and_a_turn():
    says(
        "have cx 12 px apart",
        "In one of them the error is 3 px, in the others 0.2 px.",
        "Now cy is 8 px greater, at f = 640 px.",
    )
    says("one corner that is 30 px off weighs as much as 10,000 corners that are 0.3 px off")
    says(
        "one corner that is 3 px off weighs as much as 225 that are 0.2 px off",
        "arrows that all point outward or inward",
    )
    assert pytest.approx([10_000, 225]) == [30**2 / 0.3**2, 3**2 / 0.2**2]
    says(
        "At f = 522 px a turn of 1.3° makes up for nearly all of it.",
        "A turn by 0.7° moves the picture by nearly as much",
    )
    assert np.degrees(np.arctan([12 / F, 8 / 640])) == pytest.approx([1.3, 0.7], abs=0.05)
    x = np.stack(np.meshgrid(np.linspace(-0.5, 0.5, 9), np.linspace(-0.4, 0.4, 7)), axis=-1).reshape(-1, 2)
    points = np.column_stack([x, np.ones(len(x))])
    moved = F * (project(points, np.array([0, np.arctan(12 / F), 0]), np.zeros(3), np.eye(3)) - x)
    assert np.median(norm(moved - [12, 0], axis=1)) < 0.25 * 12
    says("The error of the fit is 0.08 px. What do you know?", "The focal length is right to about 0.11 px.")
    assert abs(solved(ANNA)[1] - F) > 10 * solved(ANNA)[0]
