"""What lesson 07 says about epipolar geometry, recomputed with OpenCV and NumPy."""

from itertools import pairwise

import cv2
import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from camviz.scenes import textured_scene
from camviz.views import garden
from camviz.views.epipolar import EpipolarView
from camviz_school.course.exercises import exercise

EXCEPTIONS: dict[str, str] = {}


def homogeneous(uv):
    return np.concatenate([uv, np.ones_like(uv[..., :1])], axis=-1)


def cross_matrix(t):
    return np.cross(t, np.eye(3)).T


def true_F(view):
    """From the cameras' matrices and poses alone."""
    left, right = view.left, view.right
    motion = right.cam_from_world * left.world_from_cam
    E = cross_matrix(motion.translation) @ motion.rotation.as_matrix()
    return np.linalg.inv(right.intrinsics.K).T @ E @ np.linalg.inv(left.intrinsics.K)


def to_root_two(uv):
    centre = uv.mean(axis=0)
    s = np.sqrt(2) / np.linalg.norm(uv - centre, axis=1).mean()
    return np.array([[s, 0, -s * centre[0]], [0, s, -s * centre[1]], [0, 0, 1]])


def eight_point(left, right, undo="T_right^T F T_left"):
    """By NumPy's SVD; `undo` says how the normalisation is taken back, or that there is none."""
    T_left, T_right = (np.eye(3), np.eye(3)) if undo == "none" else (to_root_two(left), to_root_two(right))
    x_left, x_right = homogeneous(left) @ T_left.T, homogeneous(right) @ T_right.T
    A = (x_right[:, :, None] * x_left[:, None, :]).reshape(-1, 9)
    U, s, Vt = np.linalg.svd(np.linalg.svd(A)[2][-1].reshape(3, 3))
    F = U @ np.diag([s[0], s[1], 0]) @ Vt
    return T_left.T @ F @ T_right if undo == "swapped" else T_right.T @ F @ T_left


def off_their_lines(F, left, right):
    """√(d_left² + d_right²) in pixels, by OpenCV's lines."""
    lines = [
        cv2.computeCorrespondEpilines(np.float64(uv).reshape(-1, 1, 2), which, F).reshape(-1, 3)
        for uv, which in ((left, 1), (right, 2))
    ]
    return np.hypot(*(np.sum(a * homogeneous(b), axis=1) for a, b in zip(lines, (right, left), strict=True)))


# 1: a point on a ray -------------------------------------------------------------------------------------------------


def test_all_depths_lie_on_one_line_that_can_be_computed_before(says):
    says("On one line, which can be computed before looking.")
    says("The right-hand point runs along the green line and never leaves it.")
    view = EpipolarView()
    a, b, c = true_F(view) @ (view.u, view.v, 1)
    for depth in (0.5, 1.0, 2.0, 5.0, 12.0):
        u, v = view.but(depth=depth).uv_right
        assert abs(a * u + b * v + c) / np.hypot(a, b) < 1e-9


def test_four_depths_look_alike_one_for_every_second_square(says):
    depths = [
        one.value for one in says("On the board there are four that look alike: 2.20 m, 2.92 m, 4.20 m and 7.2 m")
    ]
    says("one for every second square")
    view = EpipolarView()
    assert min(np.abs(np.array(depths) - np.linalg.norm(view.surface - view.left.centre))) < 0.005  # one is the truth
    pictures = [cv2.cvtColor(garden.taken(one, garden.FINE)[0], cv2.COLOR_RGB2GRAY) for one in (view.left, view.right)]
    scale = pictures[0].shape[1] / 640

    def likeness(depth):
        places = np.array([(view.u, view.v), view.but(depth=depth).uv_right]) * scale + (scale - 1) / 2
        size = (int(48 * scale) | 1,) * 2
        here, there = (
            cv2.getRectSubPix(np.float32(picture), size, tuple(map(float, at)))
            for picture, at in zip(pictures, places, strict=True)
        )
        return cv2.matchTemplate(there, here, cv2.TM_CCOEFF_NORMED)[0, 0]

    assert all(likeness(depth) > 0.8 for depth in depths)
    between = [np.sqrt(a * b) for a, b in pairwise(depths)]
    assert all(likeness(depth) < 0.5 for depth in between)
    hit = []
    for depth in depths:
        ray = view.right.unproject(view.but(depth=depth).uv_right)
        hit.append(view.right.centre + float(textured_scene().trace(view.right.centre, ray)[1]) * ray)
    steps = np.linalg.norm(np.diff(hit, axis=0), axis=1)
    np.testing.assert_allclose(steps, 0.2, atol=0.005)  # metres: squares of 10 cm


def test_a_turn_of_twenty_degrees_moves_every_point_out_of_a_small_disc(says):
    says("Turn the right camera by twenty degrees, and every point has left its disc.")
    view = EpipolarView(right_x=0.01, yaw=20.0, depth=5.0)
    moved = [np.linalg.norm(view.but(u=u, v=v).uv_right - (u, v)) for u in (200.0, 600.0) for v in (50.0, 400.0)]
    assert min(moved) > 100


def test_the_first_point_flies_away_and_the_picture_stays():
    """As the lesson's first sentences say; the header is held below."""
    near, far = (EpipolarView(panels="space", depth=depth) for depth in (0.4, 12.0))
    parts = [{tile.name: tile.body for tile in view.figure(draft=True).tiles} for view in (near, far)]
    assert parts[0]["left picture"] == parts[1]["left picture"]
    assert parts[0]["space"] != parts[1]["space"]


def test_the_depths_of_the_first_view_and_the_second_camera(says):
    near, far = says("the point flies along its ray, from 0.4 m away to 12 m")
    depth = EpipolarView.controls()["depth"]
    assert (near.value, far.value) == (depth.low, depth.high)
    (beside,) = says("It stands 0.7 m to the right of the first one and is turned a little to the left.")
    view = EpipolarView()
    x, y, z = view.left.cam_from_world.apply(view.right.centre)
    assert beside == x
    assert abs(y) + abs(z) < 1e-9
    assert -20 < np.degrees((view.left.cam_from_world * view.right.world_from_cam).rotation.as_rotvec()[1]) < 0


# 2: one camera in front of the other ---------------------------------------------------------------------------------


def test_the_star(says):
    forward, sideways = says("Now the right camera stands 90 cm *in front* of the left one and 15 cm to its right")
    view = EpipolarView(right_x=0.15, right_z=0.9, yaw=0.0, depth=3.0)
    x, _, z = view.left.cam_from_world.apply(view.right.centre)
    assert forward == 100 * z
    assert sideways == 100 * x
    says("A star: they all meet where one camera sees the other.")
    seen = view.left.intrinsics.K @ (x, 0, z)
    F = true_F(view)
    np.testing.assert_allclose(F @ seen / np.linalg.norm(F) / np.linalg.norm(seen), 0, atol=1e-12)


def test_where_the_epipoles_go(says):
    (x,) = says("With x = 0.7 and z = 0 it is at infinity in the left picture, and the lines there are parallel.")
    says("the right epipole moves, and the left one does not")
    e = np.linalg.svd(true_F(EpipolarView(right_x=x.value)))[2][-1]
    assert abs(e[2]) < 1e-9 * np.abs(e[:2]).max()
    states = [EpipolarView(right_x=0.15, right_z=0.9, yaw=yaw) for yaw in (-10.0, 0.0, 15.0)]
    left, right = (np.array([one(true_F(view)) for view in states]) for one in (_left_epipole, _right_epipole))
    assert np.ptp(left, axis=0).max() < 1e-6
    assert np.ptp(right[:, 0]) > 50


def _left_epipole(F):
    e = np.linalg.svd(F)[2][-1]
    return e[:2] / e[2]


def _right_epipole(F):
    return _left_epipole(F.T)


def test_epipolar_lines_are_rows_only_if_the_rows_are_parallel_to_the_baseline(says):
    says("Only if the rows of both pictures are parallel to the baseline.")
    says("They are rows only if the rows are parallel to the baseline.")

    def slopes(**state):
        view = EpipolarView(**state)
        lines = [true_F(view) @ (u, v, 1) for u in (100.0, 500.0) for v in (100.0, 400.0)]
        lines += [true_F(view).T @ (u, v, 1) for u in (100.0, 500.0) for v in (100.0, 400.0)]
        return max(abs(a / b) for a, b, _ in lines)

    assert slopes(yaw=0.0) < 1e-9
    assert slopes(yaw=0.0, roll=10.0) > 0.1  # the image planes are parallel to the baseline, the rows are not
    assert slopes(yaw=-10.0) > 0.01
    assert slopes(yaw=0.0, right_y=0.3) > 0.1


# 3: three vectors in one plane ---------------------------------------------------------------------------------------


def test_one_pair_by_hand(says):
    (beside,) = says("the right one stands 0.7 m to the right of the left one and looks the same way")
    point = [one.value for one in says("A point at X = (0.5, 0.2, 2), in metres in the left camera's frame")]
    left, right = np.array(point), np.array(point) - (beside.value, 0, 0)
    in_left, in_right = left / left[2], right / right[2]
    says("The right pair gives zero, and the ray that is off its line does not.")
    E = cross_matrix((-beside.value, 0, 0))
    assert abs(in_right @ E @ in_left) < 1e-12
    assert abs((in_right + (0, 0.1, 0)) @ E @ in_left) > 0.05


def test_the_epipole_is_K_t(says):
    left, right = says("Here the right camera turns from 10° left to 10° right.")
    says("The white rings show the truth, which comes from the poses: the image K t of the left camera's centre.")
    for yaw in (-left.value, 0.0, right.value):
        view = EpipolarView(right_x=0.15, right_z=0.9, yaw=yaw)
        t = (view.right.cam_from_world * view.left.world_from_cam).translation
        e = view.right.intrinsics.K @ t
        np.testing.assert_allclose(_right_epipole(true_F(view)), e[:2] / e[2], atol=1e-6)
        assert view.right.intrinsics.contains(e[:2] / e[2])  # so that the ring is in the picture


def test_E_has_two_equal_singular_values_and_five_numbers(says):
    (five,) = says("(5: three of rotation, two of the direction of t.)")

    def E(p):
        matrix = cross_matrix(p[3:]) @ Rotation.from_rotvec(p[:3]).as_matrix()
        return (matrix / np.linalg.norm(matrix)).ravel()

    at, step = np.array([0.1, -0.2, 0.05, -0.7, 0.1, 0.2]), 1e-6 * np.eye(6)
    slopes = np.array([(E(at + d) - E(at - d)) / 2e-6 for d in step])
    assert five == np.linalg.matrix_rank(slopes, tol=1e-6)
    says("Two equal singular values and a zero: that is what makes a matrix essential.")
    s = np.linalg.svd(E(at).reshape(3, 3))[1]
    np.testing.assert_allclose(s / s[0], [1, 1, 0], atol=1e-9)
    says("The two singular values of [t]× R are equal to |t|, if nobody has rescaled E.")
    s = np.linalg.svd(cross_matrix(at[3:]) @ Rotation.from_rotvec(at[:3]).as_matrix())[1]
    np.testing.assert_allclose(s[:2], np.linalg.norm(at[3:]))


def test_the_product_is_zero_at_every_depth(says):
    says("It is zero at every depth, also at the four where the pictures look alike.")
    F = true_F(EpipolarView())
    F = F / np.linalg.norm(F)
    for depth in (0.4, 2.2, 2.92, 4.2, 7.2, 12.0):
        view = EpipolarView(depth=depth, panels="right match numbers")
        assert abs(np.append(view.uv_right, 1) @ F @ (view.u, view.v, 1)) < 1e-9
        assert view.numbers()["xᵀFx"] == "0.000"


def test_fifteen_lines_make_the_star(says):
    says("Fifteen left pixels are marked, and your lines of them make the star")
    asked = []

    def lines(F, uv):
        asked.append((F, uv))
        return homogeneous(uv) @ F.T

    EpipolarView(right_x=0.15, right_z=0.9, yaw=0.0, your_lines=lines).figure(draft=True)
    ((F, uv),) = asked
    assert len(uv) == 15
    np.testing.assert_allclose(homogeneous(uv) @ F.T @ np.append(_right_epipole(F), 1), 0, atol=1e-9)


def test_F_has_rank_two_and_what_zero_means(says):
    (rank,) = says("F has rank 2")
    F = true_F(EpipolarView(roll=5.0, right_z=0.2))
    assert rank == np.linalg.matrix_rank(F / np.linalg.norm(F), tol=1e-9)
    (zero,) = says("You compute x_rightᵀ F x_left with the true F and get 0.000.")
    says("Put *any* other pixel of that line in place of x_right: the product is zero again.")
    x_left = np.array([300.0, 200.0, 1.0])
    a, b, c = F @ x_left
    for u in (0.0, 100.0, 600.0):
        assert zero == (u * a - (a * u + c) / b * b + c) / np.linalg.norm(F)


# 4: F from pixels alone ----------------------------------------------------------------------------------------------


def test_normalising_pays_the_more_the_more_pairs_there_are(says):
    """300 throws of our own. The lesson's table is one throw."""
    ratios = says(
        "normalising makes the lines about 2.2 times better with 20 matches, 3.3 times with 50 and 4.5 times with 100"
    )
    few = says("With only 8 it makes hardly a difference.")
    everything = EpipolarView(matches=100).pairs

    def better(matches, rng):
        left, right = EpipolarView(matches=int(matches)).pairs
        found = []
        for _ in range(300):
            noisy = left + rng.normal(size=left.shape), right + rng.normal(size=right.shape)
            with_it, without = (off_their_lines(eight_point(*noisy, undo), *everything) for undo in ("", "none"))
            found.append(np.abs(without).mean() / np.abs(with_it).mean())
        return np.median(found)

    rng = np.random.default_rng(11)
    by_matches = {}
    for ratio, matches in zip(ratios[::2], ratios[1::2], strict=True):
        by_matches[matches.value] = better(matches.value, rng)
        assert ratio.about(by_matches[matches.value], 0.1)
    says("With twenty pairs its lines are typically less than half as far off, with a hundred less than a third.")
    assert by_matches[20] > 2
    assert by_matches[100] > 3
    assert better(few[0].value, rng) == pytest.approx(1, abs=0.1)


def equations(points, centre, R):
    """The rank of the equations for F of points (n, 3), seen from 0 and from a centre by a camera turned by R."""
    A = ((points - centre) @ R.T)[:, :, None] * points[:, None, :]
    return np.linalg.matrix_rank(A.reshape(-1, 9), tol=1e-9)


def test_eight_pairs_must_be_in_general_position(says):
    says("so eight pairs in general position are enough, but not seven on one plane and one beside.")
    says("nor any number on a ruled quadric that holds the centres of both cameras.")
    rng, R = np.random.default_rng(1), Rotation.from_rotvec([0.05, -0.2, 0.1]).as_matrix()
    points, centre = rng.uniform([-2, -1, 3], [2, 1, 8], (8, 3)), np.array([0.7, 0.1, -0.1])
    assert equations(points, centre, R) == 8
    points[:6, 2] = 5 + 0.3 * points[:6, 0]
    assert equations(points, centre, R) == 8
    points[6, 2] = 5 + 0.3 * points[6, 0]
    assert equations(points, centre, R) == 7
    z, turn = rng.uniform(-1, 1, 102), rng.uniform(0, 2 * np.pi, 102)
    sheet = np.stack([np.hypot(1, z) * np.cos(turn), np.hypot(1, z) * np.sin(turn), z], axis=-1)  # x² + y² − z² = 1
    left, right, points = sheet[0], sheet[1], sheet[2:]
    assert equations(points - left, right - left, R) == 7
    assert equations(points - left, right - left + [0.1, 0.2, 0.1], R) == 8


def test_the_eight_pairs_and_no_pair_to_spare(says):
    eight, most = says("Set **matches** to 8: with no pair to spare, every error goes into F. Set it to 100.")
    left, right = EpipolarView(matches=int(eight.value)).pairs
    assert most == len(EpipolarView(matches=int(most.value)).pairs[0])
    rng = np.random.default_rng(3)
    noisy = left + rng.normal(size=left.shape), right + rng.normal(size=right.shape)
    A = homogeneous(noisy[1])[:, :, None] * homogeneous(noisy[0])[:, None, :]
    _, _, Vt = np.linalg.svd(A.reshape(-1, 9))
    np.testing.assert_allclose(A.reshape(-1, 9) @ Vt[-1], 0, atol=1e-9)  # all noise included


def test_how_large_the_terms_are(says):
    products, u = says("In one row of A the product u′u is about 100,000 and u about 300, while the last entry is 1.")
    (again,) = says("u·u′ is about 100,000 in pixels, and 1 stays 1")
    left, right = EpipolarView(matches=20).pairs
    assert products.about((left[:, 0] * right[:, 0]).mean(), 0.1)
    assert again == products.value
    assert u.about(left[:, 0].mean(), 0.2)
    says("An error of one pixel changes the first by hundreds and the last by nothing.")
    assert 100 < right[:, 0].mean() < 1000


def test_the_loss_comes_from_the_noise_and_not_from_rounding(says):
    says("But the loss you are about to see comes from the *noise*: with any number of digits it would be the same.")
    says("Nothing: a change of units cannot change the answer.")
    says("With exact points this is true.")
    exact = EpipolarView(matches=20).pairs
    assert np.abs(off_their_lines(eight_point(*exact, "none"), *exact)).max() < 1e-4
    rng = np.random.default_rng(7)
    left, right = (uv + rng.normal(size=uv.shape) for uv in exact)
    A = (homogeneous(right)[:, :, None] * homogeneous(left)[:, None, :]).reshape(-1, 9)
    digits = [np.linalg.svd(np.float32(A))[2][-1], np.linalg.svd(A)[2][-1]]
    lines = [np.abs(off_their_lines(F.astype(float).reshape(3, 3), *exact)).mean() for F in digits]
    assert lines[0] == pytest.approx(lines[1], rel=0.05)  # seven digits more change next to nothing


def test_the_sampson_distance_has_no_scale_and_is_that_of_the_nearest_pair(says):
    says("It must not change if F is multiplied by any number.")
    says("how far the two pixels must move, together and to first order, until they satisfy F")
    F, left, right = true_F(EpipolarView(roll=10.0, right_z=0.3)), np.array([300.0, 200]), np.array([250.0, 212])
    first = np.sqrt(cv2.sampsonDistance(np.append(left, 1), np.append(right, 1), F))
    assert np.sqrt(cv2.sampsonDistance(np.append(left, 1), np.append(right, 1), -7 * F)) == pytest.approx(first)

    def off(moved):  # whatever the left pixel becomes, the right one goes to its line
        a, b, c = F @ np.append(left + moved, 1)
        return np.append(moved, (a * right[0] + b * right[1] + c) / np.hypot(a, b))

    assert np.linalg.norm(least_squares(off, np.zeros(2)).fun) == pytest.approx(first, rel=0.01)


def test_one_mistake_of_a_hundred_pixels(says):
    says("In a sum of squares, one mistake of a hundred pixels weighs as much as ten thousand errors of one pixel.")
    assert 100**2 == 10_000 * 1**2


def test_how_many_draws(says):
    share, percent, sure, rest, again = says(
        "For w = 0.7 that is 5.8 %, so to be 99.9 % sure of one lucky draw takes "
        "$\\log 0.001 / \\log(1 - 0.7^8) = 117$ of them."
    )
    assert percent == 100 * share.value**8
    assert again == share.value
    assert rest == 1 - sure.value / 100
    assert np.ceil(np.log(rest.value) / np.log(1 - share.value**8)) == 117
    lucky = 1 - (1 - share.value**8) ** 117
    assert lucky > sure.value / 100


# One plane, and the model that is enough -----------------------------------------------------------------------------


def torr(distances, dimension, parameters, sigma):
    """GRIC, written as Torr has it: ρ for each pair, λ₁ = ln r, λ₂ = ln(r n), λ₃ = 2."""
    r, n = 4, len(distances)
    rho = [min(d * d / sigma**2, 2 * (r - dimension)) for d in distances]
    return sum(rho) + np.log(r) * dimension * n + np.log(r * n) * parameters


def off_a_homography(H, left, right):
    """First-order distances (n,) in the space of (u, v, u', v') from x' × H x = 0 (H&Z, section 4.2.6)."""
    w = homogeneous(left) @ H.T
    e = np.stack([w[:, 0] - right[:, 0] * w[:, 2], w[:, 1] - right[:, 1] * w[:, 2]], axis=-1)
    J = np.zeros((len(left), 2, 4))
    for row in range(2):
        J[:, row, :2] = H[row, :2] - right[:, row, None] * H[2, :2]
        J[:, row, 2 + row] = -w[:, 2]
    return np.sqrt(np.einsum("ni,nij,nj->n", e, np.linalg.inv(J @ J.transpose(0, 2, 1)), e))


def sampson_by_opencv(F, left, right):
    pairs = zip(homogeneous(left), homogeneous(right), strict=True)
    return [np.sqrt(cv2.sampsonDistance(*pair, F)) for pair in pairs]


def wall_pairs(thickness, n, distance, noise, rng):
    """Noisy pairs of the wall, and exact ones of the room around it."""
    view = EpipolarView(roll=10.0, right_z=0.3)
    across, before = rng.uniform((-1.5, -1.1), (1.5, 1.1), (n, 2)), rng.uniform(-0.5, 0.5, n)
    found = []
    for depth, sigma in ((distance + thickness * before, noise), (rng.uniform(2, 8, n), 0)):
        world = view.left.world_from_cam.apply(np.column_stack([across, depth]))
        found += [one.project(world) + rng.normal(0, sigma, (n, 2)) for one in (view.left, view.right)]
    return found


def test_on_a_wall_the_best_f_knows_nothing_of_the_room(says):
    (far,) = says("Sixty points lie on a wall, 4 m away. Two cameras see them, with half a pixel of noise.")
    says("On the wall F fits best, and everywhere else it is useless.")
    on_wall, in_room, by_plane = [], [], []
    for seed in range(20):
        left, right, *room = wall_pairs(0, 60, far.value, 0.5, np.random.default_rng(seed))
        F = eight_point(left, right)
        on_wall.append(np.sqrt(np.mean(off_their_lines(F, left, right) ** 2)))
        in_room.append(off_their_lines(F, *room).mean())
        by_plane.append(np.sqrt(np.mean(off_a_homography(cv2.findHomography(left, right)[0], left, right) ** 2)))
    assert max(on_wall) < 1.2 < 5 < np.median(in_room)  # both pictures' noise, 0.5 px across each line, is 0.7 px
    assert np.mean(by_plane) == pytest.approx(0.5 * np.sqrt(2 * (1 - 8 / 120)), rel=0.02)  # two of four numbers fixed


def test_for_one_plane_every_epipole_gives_an_f_of_all_pairs(says):
    says(
        "Then every … satisfies all pairs, whatever the epipole e is: the line through e and Hx always passes "
        "through Hx."
    )
    left, right, *_ = wall_pairs(0, 30, 4.0, 0.0, np.random.default_rng(3))
    H = cv2.findHomography(left, right)[0]
    for e in ([100.0, 900.0, 1.0], [-3000.0, 20.0, 1.0], [1.0, 0.0, 0.0]):
        assert off_their_lines(cross_matrix(np.array(e)) @ H, left, right).max() < 1e-3


def test_the_prices_of_both_models(says):
    """F: a pair (u, v, u', v') on a hypersurface; H: on a surface; as many parameters as their scale leaves free."""
    quoted = says("with D = 3 and k = 7 for F, D = 2 and k = 8 for H.")
    D_of_F, k_of_F, D_of_H, k_of_H = quoted
    assert D_of_F == 4 - 1  # one equation: xᵀFx = 0
    assert k_of_F == 9 - 1 - 1  # scale and rank
    assert D_of_H == 4 - 2
    assert k_of_H == 9 - 1


def test_one_pair_s_share_by_hand(says):
    sigma, near, far, square, for_F, for_H = says(
        "with σ = 0.5 px, a distance of 0.5 px counts 1. One of 3 px would count 36, and it counts 2 for F and 4 for H."
    )
    assert (near.value / sigma.value) ** 2 == 1
    assert square == (far.value / sigma.value) ** 2
    prices = [torr([0.0], D, 0, sigma.value) for D in (3, 2)]
    assert for_F == torr([far.value], 3, 0, sigma.value) - prices[0]
    assert for_H == torr([far.value], 2, 0, sigma.value) - prices[1]


def test_the_exercise_is_torr_s_sum():
    for arguments in exercise("07.gric").cases(np.random.default_rng(1)):
        assert exercise("07.gric").reference(*arguments) == pytest.approx(torr(*arguments), rel=1e-12)


def test_up_to_which_thickness_a_homography_is_enough(says):
    """With the lesson's points and noise, drawn from its seed."""
    (thick,) = says("Up to 8 cm the homography is enough.")
    rng, n, sigma = np.random.default_rng(7), 60, 0.5
    across, before = rng.uniform((-1.5, -1.1), (1.5, 1.1), (n, 2)), rng.uniform(-0.5, 0.5, n)
    noise, view = rng.normal(size=(2, n, 2)), EpipolarView(roll=10.0, right_z=0.3)
    enough = []
    for centimetres in range(0, 32, 2):
        world = view.left.world_from_cam.apply(np.column_stack([across, 4 + centimetres / 100 * before]))
        left, right = (
            one.project(world) + sigma * error for one, error in zip((view.left, view.right), noise, strict=True)
        )
        F, H = eight_point(left, right), cv2.findHomography(left, right)[0]
        off_lines = sampson_by_opencv(F, left, right)
        off_plane = np.linalg.norm(cv2.perspectiveTransform(left[None], H)[0] - right, axis=1) / np.sqrt(2)
        assert np.sqrt(np.mean(off_plane**2)) == pytest.approx(
            np.sqrt(np.mean(off_a_homography(H, left, right) ** 2)), rel=0.05
        )
        enough.append(torr(off_plane, 2, 8, sigma) < torr(off_lines, 3, 7, sigma))
    assert thick == 2 * (enough.index(False) - 1)
    assert not any(enough[enough.index(False) :])


def test_every_board_alone_asks_for_a_homography_and_two_for_f(says, rig):
    says("By the right sums, a homography is enough for every board alone, and F is needed as soon as there are two.")

    def for_a_plane(left, right):
        F, H = eight_point(left, right), cv2.findHomography(left, right)[0]
        off_lines = sampson_by_opencv(F, left, right)
        return torr(off_a_homography(H, left, right), 2, 8, 0.2) < torr(off_lines, 3, 7, 0.2)

    left, right = (np.float64(rig[side][3]).reshape(-1, 54, 2) for side in ("left", "right"))
    assert all(for_a_plane(*one) for one in zip(left, right, strict=True))
    together = [one.reshape(-1, 2) for one in (left[:2], right[:2])]
    assert not for_a_plane(*together)


def test_on_a_plane_calibrated_cameras_leave_two_motions(says):
    """OpenCV's four decompositions of H; points of the plane in front of both cameras leave two at most."""
    says("for points of one plane, however many, at most two motions remain, not a whole family.")
    view = EpipolarView(roll=10.0, right_z=0.3)
    left, right, *_ = wall_pairs(0, 40, 4.0, 0.0, np.random.default_rng(5))
    K = view.left.intrinsics.K
    H = cv2.findHomography(left, right)[0]
    _, turns, _, normals = cv2.decomposeHomographyMat(H, K)
    rays = homogeneous(left) @ np.linalg.inv(K).T
    in_front = [i for i, normal in enumerate(normals) if (rays @ normal > 0).all()]
    assert 1 <= len(in_front) <= 2
    true = (view.right.cam_from_world * view.left.world_from_cam).rotation.as_matrix()
    assert min(np.abs(turns[i] - true).max() for i in in_front) < 1e-3


# 5: the motion inside E ----------------------------------------------------------------------------------------------


def test_W_and_the_four_motions(says):
    says("W is a quarter turn about the z axis. So the two rotations differ by a half turn about the baseline.")
    says("All four have the same epipolar lines.")
    says("(U and V are taken with determinant 1, if need be by changing their sign.)")
    W = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    np.testing.assert_allclose(Rotation.from_matrix(W).as_rotvec(), (0, 0, np.pi / 2), atol=1e-12)
    R, t = Rotation.from_rotvec((0.1, -0.2, 0.05)).as_matrix(), np.array([-0.7, 0.1, 0.2])
    U, _, Vt = np.linalg.svd(cross_matrix(t) @ R)
    U, Vt = U * np.linalg.det(U), Vt * np.linalg.det(Vt)
    ours = sorted((U @ turn @ Vt).round(9).tolist() for turn in (W, W.T))
    R1, R2, direction = cv2.decomposeEssentialMat(cross_matrix(t) @ R)
    np.testing.assert_allclose(ours, sorted(one.round(9).tolist() for one in (R1, R2)), atol=1e-8)
    assert min(np.abs(np.array(one) - R).max() for one in ours) < 1e-8
    np.testing.assert_allclose(np.abs(U[:, 2]), np.abs(direction.ravel()), atol=1e-9)
    says("All four are proper rotations. Two of them differ from the others by a half turn about the baseline.")
    assert all(np.linalg.det(one) > 0 for one in ours)
    between = Rotation.from_matrix(R1 @ R2.T)
    assert between.magnitude() == pytest.approx(np.pi)
    np.testing.assert_allclose(np.abs(between.as_rotvec()) / np.pi, np.abs(t) / np.linalg.norm(t), atol=1e-6)


def test_five_pairs_leave_a_few_E(says):
    says(
        "E has five free numbers: three of rotation, two of the direction of t. So with known K five pairs are enough."
    )
    says("The *five-point algorithm* (Nistér 2004) finds the few E that fit five pairs exactly.")
    R, t = Rotation.from_rotvec((0.1, -0.2, 0.05)).as_matrix(), np.array([-0.7, 0.1, 0.2])
    points = np.random.default_rng(9).uniform([-2, -1, 3], [2, 1, 8], (5, 3))
    left, right = (p[:, :2] / p[:, 2:] for p in (points, points @ R.T + t))
    found = cv2.findEssentialMat(left, right, np.eye(3), cv2.RANSAC, 0.999, 1e-6)[0].reshape(-1, 3, 3)
    assert 1 <= len(found) <= 10
    true = cross_matrix(t) @ R / np.linalg.norm(t) / np.sqrt(2)
    found = [E / np.linalg.norm(E) for E in found]
    assert min(np.abs(E - sign * true).max() for E in found for sign in (1, -1)) < 1e-6


def test_two_rays_by_hand(says):
    (t,) = says("R = I and t = (−1, 0, 0)")
    (x,) = says("Take the rays (0.25, 0, 1) and (0, 0, 1)")
    x_again, one = says("gives 0.25 λ − 1 = 0 in the first row and λ = μ in the third, so λ = μ = **4**.")
    (other,) = says("the same two rows give λ = μ = **−4**")
    left, right = np.array([x.value, 0, 1]), np.array([0.0, 0, 1])
    assert x_again.value == x.value
    for answer, sign in ((one, 1), (other, -1)):
        found = np.linalg.lstsq(np.column_stack([left, -right]), -np.array([sign * t.value, 0, 0]), rcond=None)[0]
        assert answer == found[0] == pytest.approx(found[1])


def test_a_scene_ten_times_as_large_looks_the_same(says):
    says(
        "Make the whole scene ten times as large, and the distance between the cameras too: the pictures stay the same."
    )
    near, far = says(
        "A model house, a hundred times smaller, seen from 1 cm apart gives the same pictures as the house "
        "from 1 m apart."
    )
    cm_per_m, smaller = 100, 100
    assert far.value * cm_per_m == smaller * near.value
    points, turn, t = (
        np.random.default_rng(4).uniform([-1, -1, 4], [1, 1, 8], (9, 3)),
        np.array([0.0, 0.1, 0]),
        np.array([-1.0, 0, 0]),
    )
    K = np.diag([500.0, 500, 1])
    house, model = (cv2.projectPoints(points * s, turn, t * s, K, None)[0] for s in (1.0, 0.01))
    np.testing.assert_allclose(house, model, atol=1e-9)


def test_a_camera_that_turns_leaves_families_of_F(says):
    says("A pixel's partner does not depend on its depth, and whole families of F satisfy every pair.")
    says("for a plane a whole family of F satisfies every pair")
    rng = np.random.default_rng(5)
    K, R = np.array([[500.0, 0, 320], [0, 500, 240], [0, 0, 1]]), Rotation.from_rotvec((0.05, 0.2, -0.1)).as_matrix()
    points = rng.uniform([-2, -1, 3], [2, 1, 9], (40, 3))
    on_a_plane = np.column_stack([points[:, :2], 5 + 0.3 * points[:, 0]])
    for world, t in ((points, np.zeros(3)), (on_a_plane, np.array([-0.7, 0, 0.1]))):
        left, right = (p[:, :2] / p[:, 2:] for p in (world @ K.T, (world @ R.T + t) @ K.T))
        x_left, x_right = homogeneous(left) @ to_root_two(left).T, homogeneous(right) @ to_root_two(right).T
        s = np.linalg.svd((x_right[:, :, None] * x_left[:, None, :]).reshape(-1, 9))[1]
        assert s[5] > 1e-3 * s[0]
        assert s[6] < 1e-10 * s[0]


# Exercises ----------------------------------------------------------------------------------------------------------


def test_the_exercise_s_bug_is_small_for_pictures_much_alike(says):
    says("for two pictures that are much alike its lines are wrong by only a pixel or so")
    says(
        "Where both pictures' points have the same centre and spread, T_left and T_right are equal, and nobody notices."
    )
    alike, other = EpipolarView(yaw=0.0, matches=100).pairs, EpipolarView(roll=10.0, right_z=0.3, matches=100).pairs
    assert 0.5 < np.abs(off_their_lines(eight_point(*alike, "swapped"), *alike)).mean() < 2
    assert np.abs(off_their_lines(eight_point(*other, "swapped"), *other)).mean() > 20
    assert np.abs(off_their_lines(eight_point(*other), *other)).max() < 1e-6


def test_shapes(says):
    (pixel,) = says("For any number of left pixels (..., 2), write their lines (a, b, c) in the right picture.")
    pixels = np.zeros((5, 1, 2))
    assert pixel == pixels.shape[-1]
    assert cv2.computeCorrespondEpilines(pixels, 1, np.eye(3)).shape[-1] == len("abc")
    (three,) = says("For a motion [R | t] and corresponding rays (n, 3)")
    rows, unknowns = says("A has shape (n, 3, 2): three equations in two unknowns for every pair.")
    assert three == rows.value == len(cross_matrix((1.0, 2, 3)))
    assert unknowns == len(("λ", "μ"))
    again = says("all of them at once, for A of shape (n, 3, 2)")
    assert [one.value for one in again] == [rows.value, unknowns.value]


def test_the_normaliser_s_mean_distance(says):
    (two,) = says("scale them to a mean distance of √2, solve, and undo both")
    uv = np.random.default_rng(6).uniform(0, 640, (30, 2))
    moved = homogeneous(uv) @ to_root_two(uv).T
    assert np.linalg.norm(moved[:, :2], axis=1).mean() == pytest.approx(np.sqrt(two.value))
    np.testing.assert_allclose(moved.mean(axis=0), (0, 0, 1), atol=1e-9)


# 7: two real cameras -------------------------------------------------------------------------------------------------

NUMBERS = (1, 2, 3, 4, 5, 6, 7, 8, 9, 11, 12, 13, 14)
BOARD = np.float32([(0.025 * column, 0.025 * row, 0) for row in range(6) for column in range(9)])


@pytest.fixture(scope="module")
def rig(samples):
    """Corners, K, coefficients and undistorted corners of the two cameras, by OpenCV."""
    sides = {}
    for side in ("left", "right"):
        seen = []
        for number in NUMBERS:
            path = samples / f"{side}{number:02}.jpg"
            grey = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE)
            uv = cv2.findChessboardCorners(grey, (9, 6))[1].reshape(-1, 1, 2)
            seen.append(cv2.cornerSubPix(grey, uv, (5, 5), (-1, -1), (3, 40, 1e-3)).reshape(54, 2))
        _, K, coefficients, *_ = cv2.calibrateCamera([BOARD] * 13, seen, (640, 480), None, None)
        points = np.float64(seen).reshape(-1, 1, 2)
        straight = cv2.undistortPoints(points, K, coefficients, P=K).reshape(-1, 2)
        sides[side] = (seen, K, coefficients, straight)
    return sides


def test_the_singular_values_hardly_see_K(says, rig):
    (_, K_left, _, left), (_, K_right, _, right) = rig["left"], rig["right"]
    F = eight_point(left, right)

    def ratio(K_left, K_right):
        s = np.linalg.svd(K_right.T @ F @ K_left)[1]
        return s[1] / s[0]

    longer = np.array([[1.1, 1, 1], [1, 1.1, 1], [1, 1, 1]])
    pairs, within = says("half of the 702 pairs lie within 0.07 px of what F demands")
    assert pairs == len(left)
    distances = [
        np.sqrt(cv2.sampsonDistance(a, b, F)) for a, b in zip(homogeneous(left), homogeneous(right), strict=True)
    ]
    assert within == np.median(distances)
    (as_it_is,) = says("the two larger singular values of E are nearly equal, 1 : 0.9984")
    assert as_it_is == ratio(K_left, K_right)
    factor, longer_ratio = says("Multiply both focal lengths by 1.1, and the ratio is 0.9990.")
    assert factor.value == longer[0, 0]
    assert longer_ratio == ratio(K_left * longer, K_right * longer)
    shift, shifted = says("Move both principal points 60 px to the right, and it is 0.9983.")
    moved = np.array([[0, 0, shift.value], [0, 0, 0], [0, 0, 0]])
    assert shifted == ratio(K_left + moved, K_right + moved)
    factor, alone = says("multiply the left focal length alone by 1.1, and it falls to 0.91")
    assert factor.value == longer[0, 0]
    assert alone == ratio(K_left * longer, K_right)


def test_two_cameras_side_by_side_have_equal_singular_values_with_any_K(says):
    """With the lesson's own numbers, where the sample pictures are missing."""
    says(
        "Two cameras that stand side by side and look the same way have two equal singular values with *any* K, as "
        "long as it is the same for both."
    )
    K = np.array([[535.0, 0, 335], [0, 535, 241], [0, 0, 1]])
    F = np.linalg.inv(K).T @ cross_matrix((-1.0, 0, 0)) @ np.linalg.inv(K)
    wrong = np.array([[900.0, 0, 200], [0, 700, 400], [0, 0, 1]])
    for guess, other in ((K, K), (wrong, wrong)):
        s = np.linalg.svd(other.T @ F @ guess)[1]
        assert s[1] / s[0] == pytest.approx(1)
    s = np.linalg.svd(K.T @ F @ (K * [[1.1, 1, 1], [1, 1.1, 1], [1, 1, 1]]))[1]
    assert s[1] / s[0] == pytest.approx(1 / 1.1)


def test_where_the_second_camera_stands(says, rig):
    (seen_left, K_left, d_left, left), (seen_right, K_right, d_right, right) = rig["left"], rig["right"]
    (pictures,) = says("find two real cameras' places from 26 photographs")
    assert pictures == 2 * len(seen_left)
    (apart,) = says("the right camera stands **8.3 cm** to the right of the left one and is turned by half a degree")
    F = eight_point(left, right)
    rays_left, rays_right = (
        (homogeneous(uv) @ np.linalg.inv(K).T)[:, :2] for uv, K in ((left, K_left), (right, K_right))
    )
    _, R, t, _ = cv2.recoverPose(K_right.T @ F @ K_left, rays_left, rays_right, np.eye(3))
    points = cv2.triangulatePoints(np.eye(3, 4), np.hstack([R, t]), rays_left.T, rays_right.T)
    grid = (points[:3] / points[3]).T.reshape(-1, 6, 9, 3)
    side = np.median(np.linalg.norm(np.diff(grid, axis=2), axis=-1))
    assert apart == 100 * 0.025 / side
    (again,) = says("Section 4 found a baseline of 8.3 cm.")
    assert again == apart.value
    centre = -R.T @ t.ravel()
    assert centre[0] > 0.99
    assert np.degrees(Rotation.from_matrix(R).magnitude()) == pytest.approx(0.5, abs=0.05)
    (at_once,) = says("A stereo calibration, which fits all corners at once, says 8.32 cm.")
    many = [BOARD] * 13
    result = cv2.stereoCalibrate(
        many, seen_left, seen_right, K_left, d_left, K_right, d_right, (640, 480), flags=cv2.CALIB_FIX_INTRINSIC
    )
    assert at_once == 100 * np.linalg.norm(result[6])


def test_bundle_adjustment_of_the_real_pair(says, rig):
    """By OpenCV's pose and triangulation, and SciPy's least squares with derivatives of our own start."""
    (each,) = says("Here it takes every sixth corner, 9 of each board")
    before, after = says("With the photographs the reprojection error falls from 0.27 px to 0.09 px")
    t_before, t_after = says("The direction of t changes a little in its third number, from 0.0004 to 0.0047.")
    (t_stereo,) = says("The stereo calibration has 0.0043 there.")
    says("(root mean square over both pictures)")
    (seen_left, K_left, d_left, left), (seen_right, K_right, d_right, right) = rig["left"], rig["right"]
    rays_left, rays_right = (homogeneous(uv) @ np.linalg.inv(K).T for uv, K in ((left, K_left), (right, K_right)))
    E = K_right.T @ eight_point(left, right) @ K_left
    _, R, t, _ = cv2.recoverPose(E, rays_left[:, :2].copy(), rays_right[:, :2].copy(), np.eye(3))
    t = t.ravel()
    assert t_before == t[2]
    some = slice(None, None, 6)
    assert each == len(BOARD[some])
    pairs = zip(rays_left[some], rays_right[some], strict=True)
    depths = [np.linalg.lstsq(np.column_stack([R @ a, -b / np.linalg.norm(b)]), -t, rcond=None)[0][0] for a, b in pairs]

    def errors(unknowns):
        world = unknowns[6:].reshape(-1, 3)
        in_left, in_right = world @ K_left.T, (world @ Rotation.from_rotvec(unknowns[:3]).as_matrix().T) @ K_right.T
        in_right = in_right + K_right @ unknowns[3:6]
        found = [in_left[:, :2] / in_left[:, 2:] - left[some], in_right[:, :2] / in_right[:, 2:] - right[some]]
        return np.concatenate(found).ravel()

    points = np.array(depths)[:, None] * rays_left[some]
    start = np.concatenate([Rotation.from_matrix(R).as_rotvec(), t, points.ravel()])
    end = least_squares(errors, start).x
    rms = [np.linalg.norm(errors(at)) / np.sqrt(2 * len(points)) for at in (start, end)]
    assert before == rms[0]
    assert after == rms[1]
    assert t_after == end[5] / np.linalg.norm(end[3:6])
    result = cv2.stereoCalibrate(
        [BOARD] * 13, seen_left, seen_right, K_left, d_left, K_right, d_right, (640, 480), flags=cv2.CALIB_FIX_INTRINSIC
    )
    assert t_stereo == (result[6] / np.linalg.norm(result[6]))[2, 0]


def test_the_real_lines_are_nearly_rows(says, rig):
    says("The lines are nearly rows, because the two cameras stand side by side and look almost the same way.")
    left, right = rig["left"][3], rig["right"][3]
    lines = homogeneous(left) @ eight_point(left, right).T
    assert np.abs(lines[:, 0] / lines[:, 1]).max() < 0.05


def test_one_board_is_not_enough(says, rig):
    says("The first board fits better than before, and the lines of the other twelve are far off.")
    (pairs,) = says("| 54 exact pairs determine F |")
    left, right = rig["left"][3], rig["right"][3]
    n = int(pairs.value)
    assert n == len(BOARD)
    one, every = eight_point(left[:n], right[:n]), eight_point(left, right)
    median = [np.median(np.abs(off_their_lines(F, left, right))[:n]) for F in (one, every)]
    assert median[0] < median[1] < 0.2
    assert np.median(np.abs(off_their_lines(one, left, right))[n:]) > 10


# Before the lesson ---------------------------------------------------------------------------------------------------


def test_before_the_lesson_what_moves_the_epipole(says):
    says("the epipole of the right picture is where the right camera sees the left one, or would see it")
    view = EpipolarView()
    F = true_F(view)
    epipole = np.linalg.svd(F)[0][:, 2]
    seen = view.right.intrinsics.K @ (view.right.cam_from_world * view.left.world_from_cam).translation
    np.testing.assert_allclose(np.cross(epipole, seen / np.linalg.norm(seen)), 0, atol=1e-9)


def test_before_the_lesson_e_knows_no_length(says):
    says("everything a hundred times smaller, a toy drone would take the same two pictures")
    K, turn, t = np.diag([500.0, 500.0, 1.0]), np.array([0.0, 0.1, 0.02]), np.array([1.0, 0.1, 0.2])
    points = np.random.default_rng(7).uniform([-2, -2, 4], [2, 2, 9], (10, 3))
    large, small = (cv2.projectPoints(s * points, turn, s * t, K, None)[0] for s in (1.0, 0.01))
    np.testing.assert_allclose(large, small, atol=1e-9)
    says("The program made that vector as long as 1, or whatever it likes.")
    E = cross_matrix(t) @ cv2.Rodrigues(turn)[0]
    assert np.linalg.norm(cv2.recoverPose(E, large, large, K)[2]) == pytest.approx(1)
    says("Any multiple of them serves as well, so their size has no meaning.")
    x = cv2.convertPointsToHomogeneous(large)[:, 0] @ np.linalg.inv(K).T
    X = points / points[:, 2:]
    for scale in (1, -3, 0.1):
        assert np.abs(np.einsum("ni,ij,nj->n", x, scale * E, X)).max() < 1e-9


def test_before_the_lesson_a_camera_that_pans(says):
    (angle,) = says("A calibrated camera on a pole pans by 20° between two pictures and does not move from its place.")
    (claimed,) = says("A turn of 20°, and no way.")
    assert claimed == angle.value
    (right,) = says("A turn of 20°, and a direction that means nothing.")
    assert right == angle.value
    says("The right turn with any direction fits these pairs exactly, and noise picks the direction.")
    says("An F that holds the right R, and an epipole that means nothing.")
    says("Without a baseline an F of every epipole satisfies all pairs, and noise picks one.")
    R = Rotation.from_euler("y", angle.value, degrees=True).as_matrix()
    x = np.random.default_rng(8).uniform([-1, -1, 2], [1, 1, 5], (20, 3))
    A = ((x @ R.T)[:, :, None] * x[:, None, :]).reshape(-1, 9)
    assert np.linalg.matrix_rank(A) == 9 - 3
    for axis in np.eye(3):
        assert np.abs(A @ (cross_matrix(axis) @ R).ravel()).max() < 1e-12
    K, rng, off, directions = np.array([[800.0, 0, 320], [0, 800, 240], [0, 0, 1]]), np.random.default_rng(9), [], []
    for _ in range(50):
        left = rng.uniform([0, 0], [640, 480], (400, 2))
        right = cv2.perspectiveTransform(left[None], K @ R @ np.linalg.inv(K))[0]
        left, right = (
            one[right[:, 0] < 640] + rng.normal(0, 0.5, (400, 2))[right[:, 0] < 640] for one in (left, right)
        )
        F = cv2.findFundamentalMat(left, right, cv2.FM_8POINT)[0]
        *turns, t = cv2.decomposeEssentialMat(K.T @ F @ K)
        off.append(min(np.degrees(Rotation.from_matrix(turn @ R.T).magnitude()) for turn in turns))
        directions.append(t.ravel())
    assert np.median(off) < 0.2
    assert np.sqrt(np.mean(np.square(directions), axis=0)).min() > 0.3  # they point anywhere


def test_before_the_lesson_four_motions(says):
    says("All four R are turns, with determinant +1.")
    E = cross_matrix(np.array([1.0, 0.2, -0.1])) @ Rotation.from_euler("yx", [10, -4], degrees=True).as_matrix()
    for R in cv2.decomposeEssentialMat(E)[:2]:
        assert np.linalg.det(R) == pytest.approx(1)
