"""Lesson 19: a mosaic beside OpenCV's, what a step does to it, three views beside OpenCV and COLMAP."""

import cv2
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from scipy.stats import geom

from camviz.views import garden
from camviz_school.course.exercises import exercise
from camviz_school.views.mosaic import ACROSS, DOWN, LEFT, TOP, MosaicView
from camviz_school.views.three_views import CAMERA, STEPS, ThreeViews, true_scene

EXCEPTIONS: dict[str, str] = {}

F = 320 / np.tan(np.radians(25))
K = np.array([[F, 0, 319.5], [0, F, 239.5], [0, 0, 1]])


def turned(degrees):
    """The homography of a turning camera, by OpenCV's rotation."""
    R = cv2.Rodrigues(np.array([0.0, np.radians(degrees), 0]))[0]
    return K @ R @ np.linalg.inv(K)


def carried(H, uv):
    return cv2.perspectiveTransform(np.float64(uv).reshape(-1, 1, 2), H).reshape(np.shape(uv))


# The mosaic ----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("turn", [0.0, 12.0, 24.0, 30.0])
def test_the_mosaic_is_opencv_s_warp_to_a_grey_level(turn):
    """In full size, away from borders, with an H that is the one OpenCV finds from the same matches."""
    view = MosaicView(turn=turn, noise=0.0)
    pictures = [garden.taken(camera, garden.FINE)[0] for camera in (view.first, view.second)]
    H = view.H
    np.testing.assert_allclose(H, cv2.findHomography(*view.matches)[0], rtol=0, atol=1e-4)
    np.testing.assert_allclose(H, turned(turn) / turned(turn)[2, 2], rtol=0, atol=2e-3)
    s = garden.FINE / 640
    small = np.array([[s, 0, (s - 1) / 2], [0, s, (s - 1) / 2], [0, 0, 1]])
    move = small @ np.array([[1.0, 0, -LEFT], [0, 1, -TOP], [0, 0, 1]])
    size = round(ACROSS * s), round(DOWN * s)
    into = [move @ matrix @ np.linalg.inv(small) for matrix in (np.eye(3), H)]
    over, under = (cv2.warpPerspective(one.astype(np.float32), M, size) for one, M in zip(pictures, into, strict=True))
    filled = [cv2.warpPerspective(np.ones((300, 400), np.uint8), M, size) for M in into]
    first, second = (cv2.erode(one, np.ones((11, 11))) > 0 for one in filled)
    neither = [cv2.dilate(one, np.ones((11, 11))) == 0 for one in filled]
    shown = view.picture().astype(float)
    places = [(first & second, (over + under) / 2), (first & neither[1], over), (second & neither[0], under)]
    assert sum(where.sum() for where, _ in places) > 100_000
    assert max(np.abs(shown - right)[where].max(initial=0) for where, right in places) <= 1.0


def test_where_the_matches_leave_h_open_the_picture_says_so_and_draws_nothing_by_it():
    view = MosaicView(turn=24.0, step=0.6, fit="floor", panels="mosaic matches numbers")
    assert view.used.sum() < 4
    assert view.numbers()["H is off by (mean)"] == view.numbers()["at most"] == "no H"
    shown = view.figure().body
    assert "it takes four matches" in shown
    assert "nan" not in shown
    assert "inf" not in shown
    assert "it takes four matches" not in MosaicView(turn=24.0, panels="mosaic matches").figure().body


def test_a_pixel_by_hand(says):
    (turn,) = says("By hand, for the middle of the second picture, after a turn of 24°")
    right, again = says("It lies 305.5 pixels to the right of the first picture's middle, which is f tan 24°.")
    (asked,) = says("is turned by 24° to the right, and takes another")
    assert asked == turn.value == again.value == MosaicView().turn
    assert right == carried(turned(turn.value), [(319.5, 239.5)])[0, 0] - 319.5
    assert right == F * np.tan(np.radians(again.value))


def test_the_first_picture_falls_apart_and_the_second_becomes_a_trapezoid(says):
    says("The second picture becomes a trapezoid. Straight lines stay straight")
    a, b, c, d = carried(turned(24), [(0, 0), (639, 0), (639, 479), (0, 479)])
    assert np.cross([*(b - a), 0], [*(c - d), 0])[2] != pytest.approx(0, abs=1e4)  # above and below: not parallel
    assert abs(np.cross([*(d - a), 0], [*(c - b), 0])[2]) < 1e-6  # left and right: parallel
    assert MosaicView(step=0.0).miss.max() < 1 < 20 < MosaicView(step=0.3).miss.max()


def test_the_shapes_that_are_asked_for(says):
    two, again, i, j = says(
        "You get n pixels `uv` (n, 2) of one picture and their partners `to` (n, 2) in the other. Build A from the "
        "rows (x, 0, −u x) and (0, x, −v x), and return H with H[2, 2] = 1."
    )
    uv = np.random.default_rng(1).uniform(0, 600, (9, 2))
    H = exercise("19.homography").reference(uv, carried(turned(20), uv))
    assert uv.shape[1] == two.value == again.value
    assert H[int(i.value), int(j.value)] == 1
    for one in says("The task asks for H[2, 2] = 1, which makes two answers comparable."):
        assert H[int(one.value), int(one.value)] == 1
    (pixel,) = says("`carry` shall take pixels of any shape (..., 2) through H.")
    assert pixel == exercise("19.carry").reference(H, uv).shape[-1]


def test_eighty_matches(says):
    says("Your H makes this mosaic, from eighty matches.")
    says("is computed from eighty matches")
    for view in (MosaicView(), MosaicView(step=0.3)):
        points, uv, to = view.exact
        assert len(points) == 80
        for camera, pixels in ((view.second, uv), (view.first, to)):
            R, t = camera.cam_from_world.rotation, camera.cam_from_world.translation
            np.testing.assert_allclose(cv2.projectPoints(points, R.as_rotvec(), t, K, None)[0][:, 0], pixels, atol=1e-9)


def test_a_step_leaves_one_plane_together(says):
    says("Fitted to the wall, the wall and its picture are sharp. The globe is there twice.")
    says("Fitted to the floor, the tiles are sharp")
    (step,) = says("Now the second picture is taken 30 cm farther to the right.")
    z_and_y = {"wall": (2, 6.5), "floor": (1, 1.25)}
    for name, (axis, at) in z_and_y.items():
        view = MosaicView(step=step.value / 100, fit=name, noise=0.0)
        points, uv, to = view.exact
        on = np.abs(points[:, axis] - at) < 0.02
        by_opencv = np.linalg.norm(carried(cv2.findHomography(uv[on], to[on])[0], uv) - to, axis=-1)
        assert by_opencv[on].max() < 1.5
        assert by_opencv[~on].max() > 20
        assert view.miss[on].max() < 1.5


def test_parallax(says):
    f, b, wall, globe = says(
        "f is 686 pixels, and the step is 0.3 m. How far do the wall, 6.5 m away, and the globe, 3.3 m away, move "
        "apart?"
    )
    far, shift = says("at 30 m the same step shifts things by 7 pixels")
    assert f == F
    assert b == MosaicView(step=0.3).step
    X = np.array([[0.0, 0, z.value] for z in (wall, globe, far)])
    steps = np.zeros(3), np.array([-b.value, 0, 0])
    before, after = (cv2.projectPoints(X, np.zeros(3), t, K, None)[0][:, 0, 0] for t in steps)
    assert (before - after)[:2].round(1).tolist() == [31.7, 62.4]  # what the cell prints
    assert shift == (before - after)[2]


def test_the_inverse_depth_of_a_plane_is_linear_in_the_pixel(says):
    """1/Z of the wall and of the floor, by the plane's equation, and f b/Z beside OpenCV's shifted pixels; Z is not."""
    says("on a plane 1/Z is linear in the pixel. So the shift f b / Z is linear in it, too, and fits into H.")
    pixels = np.stack(np.meshgrid([0.0, 200, 320, 639], [300.0, 350, 400, 479]), axis=-1).reshape(-1, 2)
    x = np.column_stack([pixels, np.ones(len(pixels))])
    rays, b = x @ np.linalg.inv(K).T, 0.3
    for normal, offset in (((0, 1.0, 0), 1.25), ((0.3, -0.2, 1.0), 6.5)):
        Z = offset / (rays @ normal)
        shifted = cv2.projectPoints(Z[:, None] * rays, np.zeros(3), np.array([-b, 0, 0]), K, None)[0][:, 0]
        np.testing.assert_allclose(pixels[:, 0] - shifted[:, 0], F * b / Z, atol=1e-9)
        for values, linear in ((1 / Z, True), (Z, False)):
            left = values - x @ np.linalg.lstsq(x, values, rcond=None)[0]
            assert (np.abs(left).max() < 1e-9 * np.abs(values).max()) == linear


def test_no_h_joins_everything_only_after_a_step(says):
    says("For which of these four can no H join everything, even if every match is used and right?")
    says("For the step alone, unless all that matters lies on one plane.")
    says("After a turn the right H exists, and it still exists where noise and wrong matches make it hard to find.")
    for options in ({"turn": 30.0}, {"noise": 2.0}, {"wrong": 50.0}):
        _, uv, to = MosaicView(**options).exact  # every match, and each of them right
        assert np.linalg.norm(carried(cv2.findHomography(uv, to)[0], uv) - to, axis=-1).max() < 1e-3
    _, uv, to = MosaicView(step=0.3).exact
    assert np.linalg.norm(carried(cv2.findHomography(uv, to)[0], uv) - to, axis=-1).max() > 5


def test_what_stays_open_without_K(says):
    """Any projective map of the scene gives the same pixels; square pixels tell f by E's two equal singular values."""
    says("That holds for a known K. If K is unknown and free in every picture, more stays open")
    says("One constant K, or square pixels, usually allows auto-calibration: the pictures then tell K as well")
    scene, rng = true_scene(), np.random.default_rng(19)
    X = np.column_stack([scene.points, np.ones(len(scene.points))])
    bent = np.eye(4) + 0.1 * rng.normal(size=(4, 4))
    for view, seen in zip(scene.cameras, scene.seen, strict=True):
        P = view.intrinsics.K @ np.column_stack(view.extrinsics)
        np.testing.assert_allclose(project(X @ bent.T, P @ np.linalg.inv(bent)), seen, atol=1e-6)
    Fs = [cv2.findFundamentalMat(scene.seen[i], scene.seen[j], cv2.FM_8POINT)[0] for i, j in ((0, 1), (1, 2), (0, 2))]

    def unlike(f):
        guess = np.array([[f, 0, K[0, 2]], [0, f, K[1, 2]], [0, 0, 1]])
        s = [np.linalg.svd(guess.T @ one @ guess, compute_uv=False) for one in Fs]
        return sum((1 - each[1] / each[0]) ** 2 for each in s)

    tried = np.linspace(200, 2000, 901)
    assert tried[np.argmin([unlike(f) for f in tried])] == pytest.approx(CAMERA.intrinsics.fx, abs=3)


def test_wrong_matches(says):
    says("In the garden about one match in ten is wrong")
    (numbers,) = says("describes the surroundings of each by 128 numbers")
    assert numbers == cv2.SIFT_create().descriptorSize()
    says("With one wrong match in twenty the mosaic is spoilt, as long as RANSAC is off.")
    says("With it, half of the matches may be wrong.")
    assert MosaicView(wrong=5.0, robust=False).miss.max() > 20
    assert MosaicView(wrong=50.0).miss.max() < 1
    view = MosaicView()
    greys = [cv2.cvtColor(garden.taken(one, 640)[0], cv2.COLOR_RGB2GRAY) for one in (view.first, view.second)]
    (a, b), (c, d) = (cv2.SIFT_create(3000).detectAndCompute(one, None) for one in greys)
    pairs = [one for one, two in cv2.BFMatcher().knnMatch(d, b, k=2) if one.distance < 0.75 * two.distance]
    uv, to = np.array([c[one.queryIdx].pt for one in pairs]), np.array([a[one.trainIdx].pt for one in pairs])
    wrong = np.linalg.norm(carried(turned(24), uv) - to, axis=-1) > 3
    assert wrong.mean() == pytest.approx(0.1, abs=0.03)


def test_draws_beside_a_published_table(says):
    """Hartley & Zisserman (2004), table 4.3; and SciPy's geometric distribution."""
    (sure,) = says(
        "The grey dots are the table of Hartley and Zisserman (2004), section 4.7.1, for a certainty of 0.99."
    )
    draws = exercise("19.draws").reference
    right = np.array([0.95, 0.9, 0.8, 0.75, 0.7, 0.6, 0.5])
    for n, table in ((4, [3, 5, 9, 13, 17, 34, 72]), (8, [5, 9, 26, 44, 78, 272, 1177])):
        assert draws(right, n, sure.value).tolist() == table
        assert geom.ppf(sure.value, right**n).tolist() == table


# Three views ---------------------------------------------------------------------------------------------------------


def test_the_second_step(says):
    (ratio,) = says("At 1.6 first steps all crosses sit in their rings at once.")
    centres = np.array([one.centre for one in true_scene().cameras])
    first, second = np.linalg.norm(np.diff(centres, axis=0), axis=1)
    assert (first, second) == pytest.approx(STEPS)
    assert ratio == second / first
    assert np.abs(ThreeViews(length=ratio.value).residuals).max() < 1e-9
    assert np.linalg.norm(ThreeViews(length=1.0).residuals[2], axis=-1).min() > 10
    for scale in (0.2, 0.8):
        assert np.abs(ThreeViews(length=ratio.value, scale=scale).residuals).max() < 1e-9
    three, again = says(
        "You get `points` (n, 3) in the second camera's frame, R and `direction` of third_from_second, "
        "and `rays` (n, 3)"
    )
    assert three == again.value == true_scene().points.shape[1]


def motion(left, right, camera):
    """R and t, by OpenCV's own eight points and its choice among four motions."""
    E = camera.T @ cv2.findFundamentalMat(left, right, cv2.FM_8POINT)[0] @ camera
    _, R, t, _ = cv2.recoverPose(E, left, right, camera)
    return R, t[:, 0]


def nearest(rays, poses):
    """The point nearest to two rays of two cameras [R | t], by least squares."""
    across = [(np.eye(3) - np.outer(r, r)) @ R for r, (R, t) in zip(rays, poses, strict=True)]
    b = [-(np.eye(3) - np.outer(r, r)) @ t for r, (R, t) in zip(rays, poses, strict=True)]
    return np.linalg.lstsq(np.concatenate(across), np.concatenate(b), rcond=None)[0]


def project(x, camera):
    x = x @ camera.T
    return x[..., :2] / x[..., 2:]


@pytest.fixture(scope="module")
def bundle():
    """The lesson's noisy pixels, their chain, and what SciPy makes of it: as far as it goes, by Levenberg-Marquardt."""
    camera, scene = CAMERA.intrinsics.K, true_scene()
    seen = scene.seen + 0.5 * np.random.default_rng(19).normal(size=scene.seen.shape)
    rays = np.concatenate([seen, np.ones((3, 50, 1))], axis=-1) @ np.linalg.inv(camera).T
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    (R1, t1), (R2, t2) = motion(seen[0], seen[1], camera), motion(seen[1], seen[2], camera)
    poses = [(np.eye(3), np.zeros(3)), (R1, t1)]
    points = np.array([nearest(two, poses) for two in zip(rays[0], rays[1], strict=True)])
    a, b = np.cross(rays[2], t2), np.cross(rays[2], (points @ R1.T + t1) @ R2.T)
    s = np.linalg.lstsq(a.reshape(-1, 1), -b.ravel(), rcond=None)[0][0]
    poses.append((R2 @ R1, R2 @ t1 + s * t2))
    start = np.concatenate([*(np.r_[cv2.Rodrigues(R)[0][:, 0], t] for R, t in poses[1:]), points.ravel()])

    def errors(x):
        each = [
            (np.eye(3), np.zeros(3)),
            *((Rotation.from_rotvec(c[:3]).as_matrix(), c[3:]) for c in x[:12].reshape(2, 6)),
        ]
        world = x[12:].reshape(-1, 3)
        return np.concatenate(
            [(uv - project(world @ R.T + t, camera)).ravel() for (R, t), uv in zip(each, seen, strict=True)]
        )

    end = least_squares(errors, start, method="lm", xtol=1e-15, ftol=1e-15, gtol=1e-15).x
    return camera, seen, start, end, errors


def rms(residuals):
    return np.sqrt(np.mean(np.sum(residuals.reshape(-1, 2) ** 2, axis=1)))


def onto(points, true):
    """Umeyama's similarity by SciPy's alignment of vectors, and the best scale after it."""
    a, b = points - points.mean(axis=0), true - true.mean(axis=0)
    turned = Rotation.align_vectors(b, a)[0].apply(a)
    return np.sum(turned * b) / np.sum(a * a) * turned + true.mean(axis=0)


def test_bundle_adjustment(says, bundle):
    _, seen, start, end, errors = bundle
    before, after = says("From 1.29 px to 0.49 px.")
    assert before == rms(errors(start))
    assert after == rms(errors(end))
    noise, measured, free, unknowns = says(
        "less than the noise, 0.71 px for both coordinates together: 300 numbers were measured, and 161 were free to "
        "follow them, the 162 unknowns less the scale"
    )
    left, of, expected = says("The root of 139/300 of the noise is 0.48 px.")
    assert noise == 0.5 * np.sqrt(2)
    assert measured == of.value == seen.size
    J = np.stack([(errors(end + 1e-6 * one) - errors(end)) / 1e-6 for one in np.eye(len(end))], axis=1)
    s = np.linalg.svd(J / np.linalg.norm(J, axis=0), compute_uv=False)
    assert unknowns == len(end)
    assert free == (s > 1e-5 * s[0]).sum()
    assert left == measured.value - free.value
    assert expected == 0.5 * np.sqrt(2) * np.sqrt(left.value / of.value)
    cameras, points, coordinates, rows, columns, share = says(
        "The other two have 12 numbers, and the 50 points have 150. Each residual depends on one camera and one point, "
        "so of the 300 × 162 derivatives only 4 % differ from zero."
    )
    assert (rows.value, columns.value) == J.shape
    assert cameras.value + coordinates.value == len(end)
    assert points.value * 3 == coordinates.value
    assert share == 100 * (np.abs(J) > 1e-6).mean()


def test_the_points_gain(says, bundle):
    *_, start, end, _ = bundle
    before, after = says("they are off by 8.1 cm before the adjustment (root mean square), and by 2.3 cm after it")
    for said, x in ((before, start), (after, end)):
        off = onto(x[12:].reshape(-1, 3), true_scene().points) - true_scene().points
        assert said == 100 * np.sqrt(np.mean(np.sum(off**2, axis=-1)))


def test_colmap_ends_at_the_same_points(says, bundle):
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap, the oracle of this test, is not installed")
    camera, seen, start, end, _ = bundle
    (near,) = says("ends at the same points to 0.000001 first steps")
    made = pycolmap.Reconstruction()
    params = [camera[0, 0], camera[1, 1], camera[0, 2] + 0.5, camera[1, 2] + 0.5]
    made.add_camera_with_trivial_rig(
        pycolmap.Camera(model="PINHOLE", width=640, height=480, params=params, camera_id=1)
    )
    poses = [np.zeros(6), *start[:12].reshape(2, 6)]
    for number, (pose, uv) in enumerate(zip(poses, seen, strict=True), 1):
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
    theirs = np.array([made.points3D[k].xyz for k in sorted(made.points3D)])
    ours = end[12:].reshape(-1, 3)
    off = np.abs(onto(theirs, ours) - ours).max() / np.linalg.norm(end[3:6])
    print(f"COLMAP's points are {off:.1e} first steps off")
    assert off <= near.value


def test_opencv_s_points_are_the_true_ones_after_alignment(says):
    says("With exact pixels, aligned, they lie on the true points to less than a micrometre.")
    scene, camera = true_scene(), CAMERA.intrinsics.K
    E = cv2.findEssentialMat(scene.seen[0], scene.seen[1], camera, cv2.RANSAC, 0.9999, 1e-3)[0]
    _, R, t, _ = cv2.recoverPose(E, scene.seen[0], scene.seen[1], camera)
    X = cv2.triangulatePoints(camera @ np.eye(3, 4), camera @ np.column_stack([R, t]), scene.seen[0].T, scene.seen[1].T)
    points = (X[:3] / X[3]).T
    for moved in (exercise("19.aligned").reference(points, scene.points), onto(points, scene.points)):
        assert np.abs(moved - scene.points).max() < 1e-6
    assert np.abs(ThreeViews(length=STEPS[1] / STEPS[0]).model[1] - points).max() <= 1e-6 * np.abs(points).max()


def test_a_residual_is_detected_less_projected(says):
    """A point detected 1 px to the right of its projection has the residual (+1, 0), as the glossary has it."""
    says("is where a point was detected, less where the model projects it.")
    scene = true_scene()
    poses = [one.cam_from_world for one in scene.cameras]
    turns, steps = np.array([[p.rotation.as_rotvec(), p.translation] for p in poses]).swapaxes(0, 1)
    right = exercise("19.residuals").reference(turns, steps, scene.points, scene.seen + (1.0, 0.0), CAMERA.intrinsics.K)
    np.testing.assert_allclose(right, np.broadcast_to([1.0, 0.0], right.shape), atol=1e-9)
    model = ThreeViews(length=0.5 * STEPS[1] / STEPS[0])
    (first, second), points = scene.pairs, model.model[1]
    at = cv2.projectPoints(
        (second.rotation * first.rotation).apply(points)
        + second.rotation.apply(first.translation)
        + model.length * second.translation,
        np.zeros(3), np.zeros(3), CAMERA.intrinsics.K, None,
    )[0][:, 0]  # fmt: skip
    np.testing.assert_allclose(model.residuals[2], scene.seen[2] - at, atol=1e-9)


def test_shapes_of_the_residuals(says):
    three, again, two, same = says(
        "You get rotation vectors `turns` (m, 3) and translations `steps` (m, 3) of m cameras, both cam_from_world, "
        "n points, and where each camera has `seen` them (m, n, 2). Return the residuals (m, n, 2)."
    )
    assert same == two.value
    R = Rotation.from_rotvec(np.zeros((4, 3))).as_matrix()
    assert three == again.value == R.shape[-1]
    assert two.value + 1 == R.shape[-1]
    shapes = says("R has shape (m, 3, 3), and `points @ R.T` for all cameras at once has shape (m, n, 3).")
    shapes += says("has shape (m, 3, 3)")
    assert all(one == 3 for one in shapes)
    given, true = says("Move, turn and scale `points` (n, 3) so that they lie as near as they can to `true` (n, 3).")
    assert given == true.value == true_scene().points.shape[1]
    (mirror,) = says("Where det(U Vᵀ) is −1")
    assert mirror == np.linalg.det(np.diag([1.0, 1, -1]))


def test_a_church_twice_as_large_gives_the_same_pictures(says):
    (count,) = says("A model of a church was made of 200 photographs")
    (again,) = says("gives the same 200 pictures")
    assert count == again.value
    X, t = true_scene().points, np.array([0.3, 0.1, 2.0])
    small = cv2.projectPoints(X / 20, np.zeros(3), t / 20, K, None)[0]
    np.testing.assert_allclose(cv2.projectPoints(X, np.zeros(3), t, K, None)[0], small, rtol=0, atol=1e-9)
