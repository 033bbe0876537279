"""Hand and eye: X against simulated truth and against OpenCV 4's solution, and a σ that holds."""

from dataclasses import replace

import numpy as np
import pytest

from camviz.cameras import Camera
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.motions import Motions, Turning
from camviz_clinic.calibration.motions_solving import park
from camviz_clinic.checks.rig import lone_poses
from camviz_clinic.handeye import PoseError, hand_eye, hand_eye_from_corners
from camviz_clinic.handeye.adjusting import STRAY, Adjusted, Noise, Pixels, far_off, robust
from camviz_clinic.handeye.solving import corner_noise
from camviz_clinic.handeye.virtual import about_one_axis, cell, strayed
from camviz_clinic.handeye.weighing import BoardPoses, weighed

BOTH = pytest.mark.parametrize("eye_to_hand", [False, True], ids=["eye in hand", "eye to hand"])
PARK = {
    False: ([-0.006944596636013021, 1.0462150104949977, 0.7418703724366881],
            [-0.09607602710754189, -0.045210609496364254, -0.08103822840261715]),
    True: ([-0.006685361384552267, 1.046361438187018, 0.7422667976656727],
           [0.48950600408693784, 0.574848535671674, 0.5154657984063418]),
}  # fmt: skip
"""Rotation vector and translation by OpenCV 4.12.0's calibrateHandEye, CALIB_HAND_EYE_PARK, of `cell` with seed 12."""


def solved(true, **more):
    return hand_eye_from_corners(
        true.base_from_hand, true.pixels, true.camera, true.board, eye_to_hand=true.eye_to_hand, **more
    )


def off(found, true):
    """The error of X, (rotation vector, translation), in the mount's frame."""
    return np.concatenate(
        [
            (found.mount_from_cam.rotation * true.X.rotation.inv()).as_rotvec(),
            found.mount_from_cam.translation - true.X.translation,
        ]
    )


@BOTH
def test_the_closed_form_is_opencvs(eye_to_hand):
    true = cell(np.random.default_rng(12), poses=12, eye_to_hand=eye_to_hand)
    boards = lone_poses(true.camera, true.board, true.pixels)
    X, _ = park(Motions.of(true.base_from_hand, boards, eye_to_hand), np.stack(np.triu_indices(12, 1), axis=-1))
    turn, place = PARK[eye_to_hand]
    assert Rotation.from_matrix(X[:3, :3]).as_rotvec() == pytest.approx(turn, abs=2e-7)
    assert X[:3, 3] == pytest.approx(place, abs=2e-7)


PERFECT = {
    "to a nanometre": {"robot_mm": 1e-6, "robot_deg": 1e-7, "noise_px": 1e-6},
    "wholly": {
        "robot_mm": 0,
        "robot_deg": 1e-12,
        "noise_px": 1e-9,
    },  # its errors are looked for to the last step
}


@BOTH
@pytest.mark.parametrize("how", ["to a nanometre", pytest.param("wholly", marks=pytest.mark.thorough)])
def test_a_perfect_robot_and_camera_give_x_and_z_exactly(eye_to_hand, how):
    true = cell(np.random.default_rng(4), 8, eye_to_hand, **PERFECT[how])
    found = solved(true)
    for ours, theirs in ((found.mount_from_cam, true.X), (found.other_from_board, true.Z)):
        assert ours.as_matrix() == pytest.approx(theirs.as_matrix(), abs=1e-7)


@pytest.mark.sampled(1)
@BOTH
def test_from_corners_x_is_nearer_than_in_closed_form_and_the_robots_errors_are_found(eye_to_hand, thorough):
    errors, sizes = [], []
    for seed in range(5 if thorough else 3):
        true = cell(np.random.default_rng(seed), 15, eye_to_hand)
        found = solved(true)
        boards = lone_poses(true.camera, true.board, true.pixels)
        X, _ = park(found.motions, np.stack(np.triu_indices(15, 1), axis=-1))
        errors.append((np.linalg.norm(off(found, true)[3:]), np.linalg.norm(X[:3, 3] - true.X.translation)))
        sizes.append((1000 * found.noise.shift, np.degrees(found.noise.turn), found.noise.px))
        assert len(boards) == 15
    ours, closed = np.sqrt(np.mean(np.square(errors), axis=0))
    assert ours < closed
    assert ours < 0.0006
    assert np.mean(sizes, axis=0) == pytest.approx([0.2, 0.03, 0.2], rel=0.2)


def test_the_derivatives_are_those_of_differences():
    true = cell(np.random.default_rng(2), 5)
    boards = lone_poses(true.camera, true.board, true.pixels)
    motions = Motions.of(true.base_from_hand, boards, False)
    twists = np.random.default_rng(3).normal(0, 1, (5, 6))
    here = Adjusted(motions, Pixels(true.camera, true.board.corners, true.pixels), true.X, true.Z, also=(twists,))

    def moved(step):
        from camviz_clinic.calibration.adjustment import twisted

        A = motions.other_from_mount * twisted(RigidTransform.identity(5), step[12] * twists)
        X, Z = twisted(true.X, step[:6]), twisted(true.Z, step[6:12])
        return -Adjusted(Motions(A, boards), here.measured, X, Z).residuals.reshape(5, -1)

    for column, step in enumerate(1e-6 * np.eye(13)):
        slope = (moved(step) - moved(-step)) / 2e-6
        assert here.jacobian[..., column] == pytest.approx(slope, abs=2e-3 * np.abs(slope).max())


def test_the_covariance_is_the_jackknifes():
    """Each pose left out in turn and all solved anew, with the noise that was learnt: (n-1)/n Σ(θᵢ - θ)²."""
    from dataclasses import replace

    true = cell(np.random.default_rng(6), 20)
    found = solved(true)
    boards = lone_poses(true.camera, true.board, true.pixels)
    motions = Motions.of(true.base_from_hand, boards, False)
    whole = Adjusted(motions, Pixels(true.camera, true.board.corners, true.pixels), found.mount_from_cam,
                     found.other_from_board, noise=found.noise)  # fmt: skip
    places = []
    for left_out in range(20):
        kept = np.arange(20) != left_out
        places.append(
            replace(whole, motions=motions.only(kept), measured=whole.measured.only(kept)).refined().X.translation
        )
    moves = np.array(places) - found.mount_from_cam.translation
    assert found.used.all()
    assert found.translation_sigma == pytest.approx(np.sqrt(19 / 20 * np.sum(moves**2, axis=0)), rel=0.03)


@pytest.mark.thorough
@BOTH
def test_of_many_cells_95_in_100_lie_within_95_per_cent_intervals(eye_to_hand, thorough):
    inside, z = [], []
    for seed in range(60 if thorough else 8):
        true = cell(np.random.default_rng(100 + seed), 12, eye_to_hand)
        found = solved(true)
        sigma = np.concatenate([found.rotation_sigma, found.translation_sigma])
        inside.append(np.abs(off(found, true)) < found.times_sigma * sigma)
        z.append(off(found, true) / sigma)
    assert 0.88 <= np.mean(inside) <= 0.99
    assert 0.75 < np.sqrt(np.mean(np.square(z))) < 1.35


def test_one_pose_that_does_not_belong_is_set_aside_and_the_rest_is_solved():
    rng = np.random.default_rng(8)
    true, which = strayed(rng, cell(rng, 15), 20, 3)
    found = solved(true)
    assert np.flatnonzero(~found.used).tolist() == [which]
    assert np.linalg.norm(off(found, true)[3:]) < 0.002


def test_a_pose_is_set_aside_from_five_times_the_median_on():
    assert STRAY == 5
    assert far_off(np.array([2.0, 2.0, 2.0, 10.0])) == [3]
    assert far_off(np.array([2.0, 2.0, 2.0, 9.99])) == []


def test_a_picture_without_the_board_takes_its_pose_with_it():
    true = cell(np.random.default_rng(9), 10)
    pixels = true.pixels.copy()
    pixels[3] = np.nan
    found = hand_eye_from_corners(true.base_from_hand, pixels, true.camera, true.board)
    assert np.flatnonzero(~found.used).tolist() == [3]
    assert np.isnan(found.displacements[3])
    assert np.linalg.norm(off(found, true)[3:]) < 0.002


def seen_badly_along_the_optical_axis(rng, true, turn=0.002, across=0.0005, along=0.006):
    """The boards of a cell with errors of these sizes in turn and place."""
    other_from_mount = true.base_from_hand.inv() if true.eye_to_hand else true.base_from_hand
    boards = true.X.inv() * other_from_mount.inv() * true.Z
    turned = boards.rotation * Rotation.from_rotvec(rng.normal(0, turn, (len(boards), 3)))
    shift = rng.normal(0, 1, (len(boards), 3)) * [across, across, along]
    return RigidTransform.from_components(boards.translation + shift, turned)


@pytest.mark.thorough
@BOTH
def test_poses_of_a_board_whose_distance_is_seen_badly_give_x_by_their_directions(eye_to_hand):
    """X is nearer than where all counts alike, in 12 cells, and the sizes of turn and distance are found."""
    plain, learnt, sizes, z = [], [], [], []
    for seed in range(12):
        rng = np.random.default_rng([321, seed])
        true = cell(rng, 20, eye_to_hand, robot_mm=0.05, robot_deg=0.005)
        boards = seen_badly_along_the_optical_axis(rng, true)
        found = hand_eye(true.base_from_hand, boards, eye_to_hand=eye_to_hand)
        alike = robust(found.motions, found.mount_from_cam, found.other_from_board)
        alike = replace(alike, weights=None).refined()
        plain.append(np.linalg.norm(alike.X.translation - true.X.translation))
        learnt.append(np.linalg.norm(off(found, true)[3:]))
        measured = found.adjusted.measured
        assert isinstance(measured, BoardPoses)
        sizes.append([measured.turn, measured.along])
        z.append(off(found, true)[3:] / found.translation_sigma)
    assert np.median(learnt) < 0.7 * np.median(plain)
    assert np.median(sizes, axis=0) == pytest.approx([0.002, 0.006], rel=0.2)  # what lies across may be the robot's
    assert 0.6 < np.sqrt(np.mean(np.square(z))) < 1.5


@pytest.mark.thorough
def test_where_all_errors_are_alike_weighing_them_changes_next_to_nothing():
    """Sizes that are learnt cost little where there is nothing to learn."""
    plain, learnt = [], []
    for seed in range(12):
        rng = np.random.default_rng([322, seed])
        true = cell(rng, 15, robot_mm=1e-3, robot_deg=1e-4)
        boards = seen_badly_along_the_optical_axis(rng, true, 0.004, 0.002, 0.002)
        found = hand_eye(true.base_from_hand, boards)
        alike = robust(found.motions, found.mount_from_cam, found.other_from_board)
        even = replace(alike, weights=None).refined()
        plain.append(np.linalg.norm(even.X.translation - true.X.translation))
        learnt.append(np.linalg.norm(weighed(even, slice(0, 6)).X.translation - true.X.translation))
    assert np.sqrt(np.mean(np.square(learnt))) < 1.1 * np.sqrt(np.mean(np.square(plain)))


@BOTH
@pytest.mark.parametrize("factor", [0.14, 2.0])
def test_lengths_in_any_unit_are_brought_to_the_robots(eye_to_hand, factor):
    """Boards whose distances are multiplied by a factor give X in the robot's unit, and the factor, within 4 σ."""
    true = cell(np.random.default_rng(77), 20, eye_to_hand)
    boards = lone_poses(true.camera, true.board, true.pixels)
    longer = RigidTransform.from_components(factor * boards.translation, boards.rotation)
    found = hand_eye(true.base_from_hand, longer, eye_to_hand=eye_to_hand, any_scale=True)
    assert found.scale == pytest.approx(1 / factor, rel=5e-3)
    assert (np.abs(off(found, true)[3:]) < 4 * found.translation_sigma).all()
    assert found.translation_sigma.max() < 3e-3
    given = hand_eye(true.base_from_hand, longer, eye_to_hand=eye_to_hand)
    assert given.scale == 1
    assert np.linalg.norm(off(given, true)[3:]) > 0.1


@pytest.mark.thorough
def test_a_camera_without_its_distortion_is_not_blamed_on_the_robot():
    """Corners of pictures that were not solved from lie nearer than where all but their own scatter is the robot's."""
    learnt, blamed = [], []
    for seed in range(5):
        true = cell(np.random.default_rng([411, seed]), 24, robot_mm=0.05, robot_deg=0.005)
        undistorted = Camera(true.camera.intrinsics)
        found = hand_eye_from_corners(true.base_from_hand[:12], true.pixels[:12], undistorted, true.board).adjusted
        own = corner_noise(found.measured, found.motions.cam_from_board)
        size = np.sqrt(np.mean(found.displacements**2) / 6)
        robots = replace(found, noise=Noise(own, size / found.motions.lever, size, found.noise.side)).refined()
        boards = lone_poses(undistorted, true.board, true.pixels[12:])
        motions = Motions.of(true.base_from_hand[12:], boards, False)
        new = Pixels(undistorted, true.board.corners, true.pixels[12:])
        for solution, errors in ((found, learnt), (robots, blamed)):
            there = replace(solution, noise=None, motions=motions, measured=new)
            errors.append(np.sqrt(np.mean(there.residuals**2)))
        assert found.noise.px > 3 * own
    assert np.median(learnt) < 0.6 * np.median(blamed)


@pytest.mark.thorough
def test_turns_about_one_axis_leave_x_unknown_along_it_and_nowhere_else():
    rng = np.random.default_rng(10)
    true = cell(rng, turns=about_one_axis(rng, 15), robot_deg=0.01)
    found = solved(true)
    (axis,) = found.unknown_directions
    assert found.motions.turning.deg[1] < 0.1
    error = off(found, true)[3:]
    assert np.linalg.norm(error - error @ axis * axis) < 0.002
    assert np.abs(off(found, true)[:3]).max() < np.radians(0.3)


@pytest.mark.parametrize(("wobble", "unknown"), [(0.99, 1), (1.01, 0)])
def test_a_direction_is_unknown_below_one_degree_about_every_second_axis(wobble, unknown):
    from dataclasses import replace

    found = solved(cell(np.random.default_rng(11), 8, robot_deg=0.01))
    turning = Turning(np.array([20.0, wobble, 0.1]), np.eye(3))
    motions = replace(found.motions)
    motions.__dict__["turning"] = turning
    there = replace(found, adjusted=replace(found.adjusted, motions=motions))
    assert len(there.unknown_directions) == unknown
    assert there.known.tolist() == [not unknown, True, True]


def test_the_noise_of_the_corners_is_that_of_the_pictures():
    true = cell(np.random.default_rng(3), 20, noise_px=0.35)
    boards = lone_poses(true.camera, true.board, true.pixels)
    seen = Pixels(true.camera, true.board.corners, true.pixels)
    assert corner_noise(seen, boards) == pytest.approx(0.35, rel=0.05)


def test_too_few_poses_and_poses_of_another_number_are_refused():
    true = cell(np.random.default_rng(1), 3)
    with pytest.raises(PoseError, match="at least 3 poses with a picture of the board are needed, got 2"):
        hand_eye_from_corners(true.base_from_hand[:2], true.pixels[:2], true.camera, true.board)
    with pytest.raises(PoseError, match="as many poses as pictures, got 2 and 3"):
        hand_eye_from_corners(true.base_from_hand[:2], true.pixels, true.camera, true.board)
    with pytest.raises(PoseError, match="as many poses of the robot as of the board, got 2 and 3"):
        hand_eye(true.base_from_hand[:2], true.base_from_hand)
