"""What lesson 19 claims about mosaics and three views, recomputed with OpenCV, SciPy and COLMAP."""

import cv2
import numpy as np
import pytest
from claims import claims
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.stats import geom

from camviz.views import garden
from camviz_school.course.material import module
from camviz_school.views.mosaic import ACROSS, DOWN, LEFT, TOP, MosaicView
from camviz_school.views.three_views import CAMERA, STEPS, ThreeViews, true_scene

says = claims("19")
lesson19 = module("19")

F = 320 / np.tan(np.radians(25))
K = np.array([[F, 0, 319.5], [0, F, 239.5], [0, 0, 1]])
CAMERA_K = CAMERA.intrinsics.K


def turned(degrees):
    """The homography of a turning camera, by OpenCV's rotation."""
    return K @ cv2.Rodrigues(np.array([0.0, np.radians(degrees), 0]))[0] @ np.linalg.inv(K)


def carried(H, uv):
    return cv2.perspectiveTransform(np.float64(uv).reshape(-1, 1, 2), H).reshape(np.shape(uv))


def off(H, uv, to):
    return np.linalg.norm(carried(H, uv) - to, axis=-1)


@pytest.mark.parametrize("turn", [0.0, 24.0])
def test_the_mosaic_is_opencv_s_warp_to_a_grey_level(turn):
    """In full size, away from borders, with an H that is the one OpenCV finds from the same matches."""
    view = MosaicView(turn=turn, noise=0.0)
    np.testing.assert_allclose(view.H, cv2.findHomography(*view.matches)[0], rtol=0, atol=1e-4)
    np.testing.assert_allclose(view.H, turned(turn) / turned(turn)[2, 2], rtol=0, atol=2e-3)
    s = garden.FINE / 640
    small = np.array([[s, 0, (s - 1) / 2], [0, s, (s - 1) / 2], [0, 0, 1]])
    move, size = small @ np.array([[1.0, 0, -LEFT], [0, 1, -TOP], [0, 0, 1]]), (round(ACROSS * s), round(DOWN * s))
    warped, filled = [], []
    for one, H in ((view.first, np.eye(3)), (view.second, view.H)):
        M = move @ H @ np.linalg.inv(small)
        warped.append(cv2.warpPerspective(garden.taken(one, garden.FINE)[0].astype(np.float32), M, size))
        filled.append(cv2.warpPerspective(np.ones((300, 400), np.uint8), M, size))
    first, second = (cv2.erode(one, np.ones((11, 11))) > 0 for one in filled)
    no_first, no_second = (cv2.dilate(one, np.ones((11, 11))) == 0 for one in filled)
    shown = view.picture().astype(float)
    places = [(first & second, sum(warped) / 2), (first & no_second, warped[0]), (second & no_first, warped[1])]
    assert sum(where.sum() for where, _ in places) > 100_000
    assert max(np.abs(shown - right)[where].max(initial=0) for where, right in places) <= 1.0


def test_a_turn_keeps_straight_lines():
    says("It lies 305.5 pixels to the right of the first picture's middle, which is f tan 24°.")
    assert carried(turned(24), [(319.5, 239.5)])[0, 0] - 319.5 == pytest.approx(305.5, abs=0.05)
    says("The second picture becomes a trapezoid. Straight lines stay straight", "from eighty matches")
    a, b, c, d = carried(turned(24), [(0, 0), (639, 0), (639, 479), (0, 479)])
    assert a[0] == pytest.approx(d[0])
    assert b[0] == pytest.approx(c[0])
    assert abs((b - a)[1] - (c - d)[1]) > 100
    uv = np.random.default_rng(1).uniform(0, 600, (9, 2))
    H = lesson19.homography(uv, carried(turned(20), uv))
    np.testing.assert_allclose(H, turned(20) / turned(20)[2, 2], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(lesson19.carry(H, uv), carried(turned(20), uv))
    assert len(MosaicView().exact[0]) == 80


def test_a_step_leaves_one_plane_together():
    says(
        "Now the second picture is taken 30 cm farther to the right.",
        "Fitted to the wall, the wall and its picture are",
    )
    for name, axis, at in (("wall", 2, 6.5), ("floor", 1, 1.25)):
        view = MosaicView(step=0.3, fit=name, noise=0.0)
        points, uv, to = view.exact
        on = np.abs(points[:, axis] - at) < 0.02
        left = off(cv2.findHomography(uv[on], to[on])[0], uv, to)
        assert max(left[on].max(), view.miss[on].max()) < 1.5 < 20 < left[~on].max()
    says("at 30 m the same step shifts things by 7 pixels", "f is 686 pixels, and the step is 0.3 m.")
    assert pytest.approx([686, 7], abs=0.5) == [F, F * 0.3 / 30]
    assert pytest.approx([31.7, 62.4], abs=0.05) == [F * 0.3 / 6.5, F * 0.3 / 3.3]  # as the cell prints


def test_the_inverse_depth_of_a_plane_is_linear_in_the_pixel():
    """1/Z of the floor and of a slanting wall, by the plane's equation, and OpenCV's shifted pixels; Z is not."""
    says("on a plane 1/Z is linear in the pixel. So the shift f b / Z is linear in it, too, and fits into H.")
    pixels = np.stack(np.meshgrid([0.0, 200, 320, 639], [300.0, 350, 400, 479]), axis=-1).reshape(-1, 2)
    x = np.column_stack([pixels, np.ones(len(pixels))])
    rays = x @ np.linalg.inv(K).T
    for normal, offset in (((0, 1.0, 0), 1.25), ((0.3, -0.2, 1.0), 6.5)):
        Z = offset / (rays @ normal)
        shifted = cv2.projectPoints(Z[:, None] * rays, np.zeros(3), np.array([-0.3, 0, 0]), K, None)[0][:, 0]
        np.testing.assert_allclose(pixels[:, 0] - shifted[:, 0], F * 0.3 / Z, atol=1e-9)
        for values, linear in ((1 / Z, True), (Z, False)):
            left = values - x @ np.linalg.lstsq(x, values, rcond=None)[0]
            assert (np.abs(left).max() < 1e-9 * np.abs(values).max()) == linear


def test_no_h_joins_everything_only_after_a_step():
    says("For which of these four can *no* H join everything, even if every match is used and right?")
    says("For the step alone, unless all that matters lies on one plane.")
    for options in ({"turn": 30.0}, {"noise": 2.0}, {"wrong": 50.0}, {"step": 0.3}):
        _, uv, to = MosaicView(**options).exact
        left = off(cv2.findHomography(uv, to)[0], uv, to).max()
        assert left > 5 if "step" in options else left < 1e-3


def test_draws_beside_a_published_table():
    """Hartley & Zisserman (2004), table 4.3; and SciPy's geometric distribution."""
    says("for a certainty of 0.99", "With it, half of the matches may be wrong.")
    right = np.array([0.95, 0.9, 0.8, 0.75, 0.7, 0.6, 0.5])
    for n, table in ((4, [3, 5, 9, 13, 17, 34, 72]), (8, [5, 9, 26, 44, 78, 272, 1177])):
        assert lesson19.draws(right, n, 0.99).tolist() == geom.ppf(0.99, right**n).tolist() == table
    says("With one wrong match in twenty the mosaic is spoilt, as long as RANSAC is off.")
    assert MosaicView(wrong=5.0, robust=False).miss.max() > 20 > 1 > MosaicView(wrong=50.0).miss.max()


def test_the_second_step():
    says("At 1.6 first steps all crosses sit in their rings at once.")
    first, second = np.linalg.norm(np.diff([one.centre for one in true_scene().cameras], axis=0), axis=1)
    assert second / first == pytest.approx(1.6)
    for scale in (0.2, 0.8):  # the same pictures
        assert np.abs(ThreeViews(length=1.6, scale=scale).residuals).max() < 1e-9
    assert np.linalg.norm(ThreeViews(length=1.0).residuals[2], axis=-1).min() > 10


def test_a_residual_is_detected_less_projected():
    """A point detected 1 px to the right of its projection has the residual (+1, 0), as the glossary has it."""
    says("is where a point was detected, less where the model projects it.")
    scene = true_scene()
    poses = [one.cam_from_world for one in scene.cameras]
    turns, steps = np.array([[p.rotation.as_rotvec(), p.translation] for p in poses]).swapaxes(0, 1)
    right = lesson19.residuals(turns, steps, scene.points, scene.seen + (1.0, 0.0), CAMERA_K)
    np.testing.assert_allclose(right, np.broadcast_to([1.0, 0.0], right.shape), atol=1e-9)
    model = ThreeViews(length=0.5 * STEPS[1] / STEPS[0])
    (first, second), points = scene.pairs, model.model[1]
    moved = (second.rotation * first.rotation).apply(points) + second.rotation.apply(first.translation)
    at = cv2.projectPoints(moved + model.length * second.translation, np.zeros(3), np.zeros(3), CAMERA_K, None)[0][:, 0]
    np.testing.assert_allclose(model.residuals[2], scene.seen[2] - at, atol=1e-9)


def project(x, P):
    x = x @ P.T
    return x[..., :2] / x[..., 2:]


def test_what_stays_open_without_K():
    """Any projective map of the scene gives the same pixels; square pixels tell f by E's two equal singular values."""
    says("If K is unknown and free in every picture, more stays open", "or square pixels, usually allows *auto-calib")
    scene, rng = true_scene(), np.random.default_rng(19)
    X, bent = np.column_stack([scene.points, np.ones(len(scene.points))]), np.eye(4) + 0.1 * rng.normal(size=(4, 4))
    for view, seen in zip(scene.cameras, scene.seen, strict=True):
        P = view.intrinsics.K @ np.column_stack(view.extrinsics)
        np.testing.assert_allclose(project(X @ bent.T, P @ np.linalg.inv(bent)), seen, atol=1e-6)
    Fs = [cv2.findFundamentalMat(scene.seen[i], scene.seen[j], cv2.FM_8POINT)[0] for i, j in ((0, 1), (1, 2), (0, 2))]

    def unlike(f):
        guess = np.array([[f, 0, K[0, 2]], [0, f, K[1, 2]], [0, 0, 1]])
        return sum((1 - np.divide(*np.linalg.svd(guess.T @ one @ guess)[1][1::-1])) ** 2 for one in Fs)

    tried = np.linspace(200, 2000, 901)
    assert tried[np.argmin([unlike(f) for f in tried])] == pytest.approx(CAMERA.intrinsics.fx, abs=3)


def motion(left, right):
    """R and t, by OpenCV's own eight points and its choice among four motions."""
    E = CAMERA_K.T @ cv2.findFundamentalMat(left, right, cv2.FM_8POINT)[0] @ CAMERA_K
    _, R, t, _ = cv2.recoverPose(E, left, right, CAMERA_K)
    return R, t[:, 0]


def nearest(rays, poses):
    """The point nearest to two rays of two cameras [R | t], by least squares."""
    across = [np.eye(3) - np.outer(r, r) for r in rays]
    A = np.concatenate([one @ R for one, (R, _) in zip(across, poses, strict=True)])
    return np.linalg.lstsq(
        A, -np.concatenate([one @ t for one, (_, t) in zip(across, poses, strict=True)]), rcond=None
    )[0]


@pytest.fixture(scope="module")
def bundle():
    """The lesson's noisy pixels, their chain, and what SciPy makes of it: as far as it goes, by Levenberg-Marquardt."""
    scene = true_scene()
    seen = scene.seen + 0.5 * np.random.default_rng(19).normal(size=scene.seen.shape)
    rays = np.concatenate([seen, np.ones((3, 50, 1))], axis=-1) @ np.linalg.inv(CAMERA_K).T
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    (R1, t1), (R2, t2) = motion(seen[0], seen[1]), motion(seen[1], seen[2])
    points = np.array([nearest(two, [(np.eye(3), np.zeros(3)), (R1, t1)]) for two in zip(*rays[:2], strict=True)])
    a, b = np.cross(rays[2], t2), np.cross(rays[2], (points @ R1.T + t1) @ R2.T)
    length = np.linalg.lstsq(a.reshape(-1, 1), -b.ravel(), rcond=None)[0][0]
    assert lesson19.second_step(points @ R1.T + t1, R2, t2, rays[2]) == pytest.approx(length)
    poses = [(R1, t1), (R2 @ R1, R2 @ t1 + length * t2)]
    start = np.concatenate([*(np.r_[cv2.Rodrigues(R)[0][:, 0], t] for R, t in poses), points.ravel()])

    def errors(x):
        cameras, world = np.concatenate([np.zeros((1, 6)), x[:12].reshape(2, 6)]), x[12:].reshape(-1, 3)
        there = [project(Rotation.from_rotvec(c[:3]).apply(world) + c[3:], CAMERA_K) for c in cameras]
        return (seen - np.array(there)).ravel()

    end = least_squares(errors, start, method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    return seen, start, end, errors


def onto(points, true):
    """Umeyama's similarity by SciPy's alignment of vectors, and the best scale after it."""
    a, b = points - points.mean(axis=0), true - true.mean(axis=0)
    around = Rotation.align_vectors(b, a)[0].apply(a)
    return np.sum(around * b) / np.sum(a * a) * around + true.mean(axis=0)


def test_bundle_adjustment(bundle):
    seen, start, end, errors = bundle
    says("From 1.29 px to 0.49 px.", "The root of 139/300 of the noise is 0.48 px.")
    rms = [np.sqrt(2 * np.mean(errors(x) ** 2)) for x in (start, end)]
    assert [*rms, 0.5 * np.sqrt(2 * 139 / 300)] == pytest.approx([1.29, 0.49, 0.48], abs=5e-3)
    says("300 numbers were measured, and 161 were free to follow them, the 162 unknowns less the scale")
    J = np.stack([(errors(end + 1e-6 * one) - errors(end)) / 1e-6 for one in np.eye(len(end))], axis=1)
    s = np.linalg.svd(J / np.linalg.norm(J, axis=0), compute_uv=False)
    assert (seen.size, len(end), (s > 1e-5 * s[0]).sum()) == (300, 162, 161)
    says("so of the 300 × 162 derivatives only 4 % differ from zero")
    assert 100 * (np.abs(J) > 1e-6).mean() == pytest.approx(4, abs=0.5)
    says("they are off by 8.1 cm before the adjustment (root mean square), and by 2.3 cm after it")
    true = true_scene().points
    gaps = [onto(x[12:].reshape(-1, 3), true) - true for x in (start, end)]
    assert [100 * np.sqrt(3 * np.mean(gap**2)) for gap in gaps] == pytest.approx([8.1, 2.3], abs=0.05)


def test_colmap_ends_at_the_same_points(bundle):
    says("ends at the same points to 0.000001 first steps")
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap, the oracle of this test, is not installed")
    seen, start, end, _ = bundle
    made = pycolmap.Reconstruction()
    params = [CAMERA_K[0, 0], CAMERA_K[1, 1], CAMERA_K[0, 2] + 0.5, CAMERA_K[1, 2] + 0.5]
    made.add_camera_with_trivial_rig(
        pycolmap.Camera(model="PINHOLE", width=640, height=480, params=params, camera_id=1)
    )
    for number, (pose, uv) in enumerate(zip([np.zeros(6), *start[:12].reshape(2, 6)], seen, strict=True), 1):
        image = pycolmap.Image(name=f"{number}.jpg", camera_id=1, image_id=number, keypoints=uv + 0.5)
        turn = pycolmap.Rotation3d(Rotation.from_rotvec(pose[:3]).as_quat())
        made.add_image_with_trivial_frame(image, pycolmap.Rigid3d(turn, pose[3:]))
    for k, X in enumerate(start[12:].reshape(-1, 3)):
        track = pycolmap.Track()
        for number in (1, 2, 3):
            track.add_element(number, k)
        made.add_point3D(X, track, np.zeros(3, np.uint8))
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_focal_length = options.refine_principal_point = options.refine_extra_params = False
    solver = options.ceres.solver_options
    solver.function_tolerance = solver.gradient_tolerance = solver.parameter_tolerance = 1e-16
    solver.max_num_iterations = 200
    pycolmap.bundle_adjustment(made, options)
    theirs, ours = np.array([made.points3D[k].xyz for k in sorted(made.points3D)]), end[12:].reshape(-1, 3)
    assert np.abs(onto(theirs, ours) - ours).max() / np.linalg.norm(end[3:6]) <= 1e-6


def test_opencv_s_points_are_the_true_ones_after_alignment():
    says("With exact pixels, aligned, they lie on the true points to less than a micrometre.")
    scene = true_scene()
    E = cv2.findEssentialMat(scene.seen[0], scene.seen[1], CAMERA_K, cv2.RANSAC, 0.9999, 1e-3)[0]
    _, R, t, _ = cv2.recoverPose(E, scene.seen[0], scene.seen[1], CAMERA_K)
    P = CAMERA_K @ np.eye(3, 4), CAMERA_K @ np.column_stack([R, t])
    X = cv2.triangulatePoints(*P, scene.seen[0].T, scene.seen[1].T)
    points = (X[:3] / X[3]).T
    for moved in (lesson19.aligned(points, scene.points), onto(points, scene.points)):
        assert np.abs(moved - scene.points).max() < 1e-6


def test_questions_turn_step_and_scale():
    says("A model of a church was made of 200 photographs")
    says(
        "is turned by 24° to the right, and takes another",
        "taken 30 cm farther to the right",
        "gives the same 200 pictures",
    )
    assert MosaicView().turn == 24
    X, t = true_scene().points, np.array([0.3, 0.1, 2.0])
    pictures = [cv2.projectPoints(X / size, np.zeros(3), t / size, K, None)[0] for size in (1, 20)]
    np.testing.assert_allclose(*pictures, rtol=0, atol=1e-9)
