"""Rigs: cameras that see a board in any of the frames stand where they were put, and the ± says how well."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from camviz_clinic.calibration import CannotCalibrate, Detections
from camviz_clinic.calibration.adjustment import Adjustment, twisted
from camviz_clinic.calibration.detection import seen
from camviz_clinic.rigs import calibrate_rig, in_frames, relative_pose, rig_of, solving, synchronised, virtual
from camviz_clinic.rigs.adjustment import RigAdjustment
from camviz_clinic.rigs.graph import Link, adjoint, chained, islands, parted
from camviz_clinic.rigs.rejection import deviation, limit
from camviz_clinic.rigs.start import alone, begun, spread_out


def of(truth, name, seen_from):
    return truth.cameras[seen_from].cam_from_world * truth.cameras[name].world_from_cam


def errors(beside, true):
    """The turn and the shift of a relative pose against the true one, (6,), in its σ."""
    turn = (beside.pose.rotation * true.rotation.inv()).as_rotvec()
    return np.concatenate([turn, beside.pose.translation - true.translation]) / beside.deviations


def every_error(truth, calibration):
    rig, names = rig_of(calibration), list(truth.cameras)
    return np.array(
        [errors(relative_pose(rig, b, a), of(truth, b, a)) for i, a in enumerate(names) for b in names[i + 1 :]]
    )


def solved(seed, *args, model="standard", **how):
    rng = np.random.default_rng(seed)
    truth = virtual.rig(rng, *args, **how)
    found = truth.observed(rng)
    return truth, found, calibrate_rig(found, truth.board, model)


@pytest.fixture(scope="module")
def pinholes():
    return solved(1, 4, frames=12, shared=0.4)


RIGS = ((2, 0.05, ()), (3, 1.0, ()), (3, 0.4, (1,)), (5, 0.2, ()))  # cameras, share seen together, fisheyes


def test_relative_poses_are_true_within_three_of_their_deviations(thorough):
    """Of 6 numbers for each two cameras of rigs of four kinds; a normal error goes beyond 3 σ in 0.27 %."""
    off = []
    for seed in range(20 if thorough else 1):
        for cameras, shared, fisheye in RIGS:
            model = {f"cam{i}": "fisheye" if i in fisheye else "standard" for i in range(cameras)}
            truth, _, calibration = solved(seed, cameras, frames=12, shared=shared, fisheye=fisheye, model=model)
            off.append(every_error(truth, calibration).ravel())
    off = np.concatenate(off)
    assert np.mean(np.abs(off) > 3) <= 0.01
    assert 0.7 < np.sqrt(np.mean(off**2)) < 1.3


@pytest.mark.thorough
@pytest.mark.parametrize("bend", [0, 0.5])
def test_intervals_hold_by_frames_also_where_a_board_bends_as_it_is_held(bend, thorough):
    """Of the 95 % intervals of relative poses and of intrinsics 90 to 98.5 % hold, whether each frame's board is bent
    by so many pixels in each of four ways, or not. With bent boards half of those by the noise of corners hold.
    """
    rng = np.random.default_rng(9)
    held = {True: [], False: []}  # by frames, by corners
    for _ in range(60 if thorough else 5):
        truth = virtual.rig(rng, 4, frames=8, shared=0.25)
        x, y = (2 * truth.board.corners[:, :2] / truth.board.corners[:, :2].max(axis=0) - 1).T
        bends = rng.normal(0, bend, (len(truth.world_from_board), 4, 2))
        bent = np.einsum("bc,fbi->fci", np.stack([x * x, x * y, y * y, x**3]), bends)
        corners = {name: truth.corners(name) + bent for name in truth.cameras}
        noisy = {name: each + rng.normal(0, truth.noise, each.shape) for name, each in corners.items()}
        estimated = dict.fromkeys(truth.cameras, ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"))
        start = RigAdjustment(truth.board, truth.cameras, noisy, truth.world_from_board, estimated)
        rig = start.refined()
        for by_frames, each in ((True, rig), (False, rig.by_corners)):
            for i, a in enumerate(truth.cameras):
                away = (each.intrinsics(a) - start.intrinsics(a)) / np.sqrt(np.diag(each.intrinsics_covariance(a)))
                held[by_frames].append(np.abs(away) < 1.96)
                for b in list(truth.cameras)[i + 1 :]:
                    held[by_frames].append(np.abs(errors(relative_pose(each, b, a), of(truth, b, a))) < 1.96)
    by_frames, by_corners = (np.mean(np.concatenate(held[key])) for key in (True, False))
    assert 0.9 < by_frames < 0.985
    assert by_corners < 0.65 if bend else by_corners > 0.9


def test_cameras_that_never_see_the_board_together_are_placed_by_way_of_the_others():
    """On an arc of 25° steps, the first and the last of five look at the board from sides that are 100° apart."""
    rng = np.random.default_rng(3)
    truth = virtual.rig(rng, 5, frames=12, shared=0.3)
    truth = replace(truth, seen={**truth.seen, "cam4": truth.seen["cam4"] & ~truth.seen["cam0"]})
    found = truth.observed(rng)
    assert not set(found["cam0"].places) & set(found["cam4"].places)
    beside = relative_pose(rig_of(calibrate_rig(found, truth.board)), "cam4", "cam0")
    assert np.abs(errors(beside, of(truth, "cam4", "cam0"))).max() < 4
    assert beside.distance_deviation < 0.003


def test_the_sparse_equations_are_those_of_the_whole_jacobian(pinholes):
    """Every block, beside the same problem in `Adjustment`, which knows nothing of who sees what."""
    _, _, calibration = pinholes
    off = {name: corners + 0.5 for name, corners in calibration.detections.items()}  # so that no gradient is 0
    rig, plain = (each.of(replace(calibration, detections=off)) for each in (RigAdjustment, Adjustment))
    for name in ("shared", "border", "blocks", "shared_gradient", "gradients"):
        ours, theirs = (getattr(each.normal_equations, name) for each in (rig, plain))
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9 * np.abs(theirs).max())


def test_a_bent_board_is_in_the_sparse_equations_too(pinholes):
    _, _, calibration = pinholes
    bent = replace(calibration, board_warp=np.array([0.001, 0.0005]))
    ours, theirs = (each.of(bent).normal_equations for each in (RigAdjustment, Adjustment))
    np.testing.assert_allclose(ours.shared, theirs.shared, rtol=1e-9, atol=1e-9 * np.abs(theirs.shared).max())
    np.testing.assert_allclose(ours.border, theirs.border, rtol=1e-9, atol=1e-9 * np.abs(theirs.border).max())


def test_the_deviation_by_frames_is_that_of_solving_anew_without_each_frame():
    """The delete-one jackknife by brute force: two cameras of known lenses, each frame of nine left out in turn.

    The frames are made to disagree more than their corners' noise lets them, by 3 pixels a frame, so that the jackknife
    is not the smaller of the two.
    """
    rng = np.random.default_rng(5)
    truth = virtual.rig(rng, 2, frames=5, shared=1.0)
    found = truth.observed(rng)
    found = {
        name: replace(each, corners=each.corners + rng.normal(0, 3, (len(each.corners), 1, 2)))
        for name, each in found.items()
    }

    def solve(left_out=None):
        rows = {name: [i for i, place in enumerate(each.places) if place != left_out] for name, each in found.items()}
        kept = {
            name: replace(
                each,
                pictures=tuple(each.pictures[i] for i in rows[name]),
                corners=each.corners[rows[name]],
                places=tuple(each.places[i] for i in rows[name]),
            )
            for name, each in found.items()
        }
        return rig_of(calibrate_rig(kept, truth.board, held=truth.cameras, robust=False))

    everything = solve()
    beside = relative_pose(everything, "cam1", "cam0")
    frames = sorted({place for each in found.values() for place in each.places})
    centres = np.array([relative_pose(solve(frame), "cam1", "cam0").pose.translation for frame in frames])
    n = len(frames)
    moves = centres - beside.pose.translation
    jackknife = np.sqrt((n - 1) / n * np.sum(moves**2, axis=0))
    np.testing.assert_allclose(beside.deviations[3:], jackknife, rtol=0.05)
    alone = relative_pose(everything.by_corners, "cam1", "cam0")
    assert np.all(beside.deviations[3:] > 3 * alone.deviations[3:])


def test_a_small_motion_is_carried_from_one_frame_to_the_other():
    """T exp(ξ) T⁻¹ = exp(Ad ξ) to first order: by SciPy's transforms, for a motion of 1e-6."""
    pose = RigidTransform.from_components([0.3, -0.2, 0.9], Rotation.from_rotvec([0.2, -0.5, 0.1]))
    for direction in np.eye(6):
        small = twisted(RigidTransform.identity(), 1e-6 * direction)
        carried = (pose * small * pose.inv()).as_matrix()
        expected = twisted(RigidTransform.identity(), 1e-6 * adjoint(pose) @ direction).as_matrix()
        np.testing.assert_allclose(carried, expected, atol=1e-11)


def test_a_chain_takes_the_links_that_place_it_best():
    """From a to c by way of b, whose two links of 1 mm together are better than the direct one of 2 mm."""
    turned = Rotation.from_rotvec([0, 0.5, 0])
    ab, bc = (RigidTransform.from_components([x, 0, 0], turned) for x in (1, 2))
    wrong = RigidTransform.from_translation([9, 9, 9])

    def link(one, other, pose, deviation):
        return Link(one, other, np.arange(3), pose, pose, deviation)

    links = {
        ("a", "b"): link("a", "b", ab, 0.001),
        ("b", "c"): link("b", "c", bc, 0.001),
        ("a", "c"): link("a", "c", wrong, 0.002),
    }
    placed = chained(["a", "b", "c"], links)
    np.testing.assert_allclose(placed["c"].as_matrix(), ab.as_matrix() @ bc.as_matrix(), atol=1e-12)
    links["a", "c"] = link("a", "c", wrong, 0.0014)  # less than √2 mm
    assert chained(["a", "b", "c"], links)["c"].translation.tolist() == [9, 9, 9]
    links = {("a", "c"): link("a", "c", ab, 0.001), ("b", "c"): link("b", "c", bc, 0.001)}  # to b against its link
    expected = ab.as_matrix() @ np.linalg.inv(bc.as_matrix())
    np.testing.assert_allclose(chained(["a", "b", "c"], links)["b"].as_matrix(), expected, atol=1e-12)


def test_one_frame_in_common_has_the_deviation_of_its_corners():
    """Without this frame nothing ties the two cameras: it cannot be left out, and says nothing of how frames differ."""
    rng = np.random.default_rng(2)
    truth = virtual.rig(rng, 2, frames=8, shared=0.05)
    found = truth.observed(rng)
    common = sorted(set(found["cam0"].places) & set(found["cam1"].places))
    truth = replace(truth, seen={**truth.seen, "cam1": truth.seen["cam1"] & ~np.isin(np.arange(16), common[1:])})
    rig = rig_of(calibrate_rig(truth.observed(rng), truth.board, held=truth.cameras))
    clustered, plain = (relative_pose(each, "cam1", "cam0").deviations for each in (rig, rig.by_corners))
    np.testing.assert_allclose(clustered, plain, rtol=1e-6)
    assert np.abs(errors(relative_pose(rig, "cam1", "cam0"), of(truth, "cam1", "cam0"))).max() < 4


def test_a_share_of_a_frame_is_that_of_the_whole_jacobian(pinholes):
    """Information and gradient of every frame, beside the same problem in `Adjustment`."""
    _, _, calibration = pinholes
    ours, theirs = (each.of(calibration).by_view for each in (RigAdjustment, Adjustment))
    for name in ("information", "gradient"):
        expected = getattr(theirs, name)
        np.testing.assert_allclose(getattr(ours, name), expected, rtol=1e-9, atol=1e-9 * np.abs(expected).max())


def test_lenses_that_are_held_stay_and_place_the_cameras_better(pinholes):
    truth, found, free = pinholes
    held = calibrate_rig(found, truth.board, held=truth.cameras)
    assert [each.intrinsics for each in held.cameras.values()] == [each.intrinsics for each in truth.cameras.values()]
    assert held.estimated["cam1"] == ()
    both = [relative_pose(rig_of(each), "cam3", "cam0").distance_deviation for each in (held, free)]
    assert both[0] < both[1]


def test_a_view_whose_corners_are_counted_from_the_other_end_is_set_aside():
    """A chessboard of 9×6 looks the same from both ends; in one camera's picture it is read the other way round."""
    truth, found, calibration = solved(4, 3, frames=10, shared=0.5)
    view = next(i for i, place in enumerate(found["cam1"].places) if place in found["cam0"].places)
    turned = found["cam1"].corners.copy()
    turned[view] = turned[view][::-1]
    again = calibrate_rig({**found, "cam1": replace(found["cam1"], corners=turned)}, truth.board)
    frame = sorted({p for each in found.values() for p in each.places}).index(found["cam1"].places[view])
    assert np.flatnonzero(again.set_aside["cam1"].all(axis=1)).tolist() == [frame]
    assert not again.set_aside["cam0"].all(axis=1).any()
    assert any(note.startswith("cam1: 1 of ") and " views " in note for note in again.notes)
    moved = again.cameras["cam2"].centre - calibration.cameras["cam2"].centre
    assert np.linalg.norm(moved) < 0.001


def test_each_camera_is_judged_by_its_own_noise():
    """One camera finds corners five times as exactly: its outlier of 2 px goes, and no good one of the other does."""
    rng = np.random.default_rng(6)
    truth = virtual.rig(rng, 2, frames=10, shared=0.6)
    fine, coarse = (replace(truth, noise=noise).observed(rng) for noise in (0.1, 0.5))
    found = {"cam0": fine["cam0"], "cam1": coarse["cam1"]}
    found["cam0"].corners[3, 20] += (2, 0)
    calibration = calibrate_rig(found, truth.board)
    rig = rig_of(calibration)
    assert deviation(rig, "cam0") == pytest.approx(0.1, rel=0.1)
    assert deviation(rig, "cam1") == pytest.approx(0.5, rel=0.1)
    assert limit(rig, "cam0") < 2 < limit(rig, "cam1")
    assert calibration.set_aside["cam0"].sum() == 1
    assert calibration.set_aside["cam1"].sum() == 0


def test_islands_are_named_with_the_cameras_to_show_the_board_to():
    rng = np.random.default_rng(7)
    truth = virtual.rig(rng, 4, frames=8, shared=0.5)
    early = np.arange(32) < 16  # cam1 and cam2 see the board together in frames 8 to 23
    apart = {name: early if name in ("cam0", "cam1") else ~early for name in truth.cameras}
    truth = replace(truth, seen={name: truth.seen[name] & apart[name] for name in truth.cameras})
    with pytest.raises(CannotCalibrate) as refused:
        calibrate_rig(truth.observed(rng), truth.board)
    assert str(refused.value) == (
        "cam0 and cam1 never see the board in one frame with cam2 and cam3: show it to cam1 and cam2 together"
    )


def test_three_islands_make_one_sentence():
    frames = np.eye(3, dtype=bool)
    seen = dict(zip("abc", frames, strict=True))
    assert islands(seen) == [("a",), ("b",), ("c",)]
    assert parted(islands(seen), list(seen)) == (
        "a never sees the board in one frame with b; nor with c: show it to a and b, and to a and c together"
    )
    seen["b"] = seen["a"] | seen["c"]  # who joins two groups makes them one
    assert islands(seen) == [("a", "b", "c")]


def test_what_cannot_be_a_rig_is_refused_in_one_sentence(pinholes):
    truth, found, _ = pinholes
    with pytest.raises(ValueError, match="detections must be of at least two cameras, got 1"):
        calibrate_rig({"cam0": found["cam0"]}, truth.board)
    with pytest.raises(ValueError, match="model must name cameras of cam0, cam1, cam2, cam3, got cam9"):
        calibrate_rig(found, truth.board, {"cam9": "fisheye"})
    with pytest.raises(ValueError, match="model must be given for every camera, it lacks cam1, cam2, cam3"):
        calibrate_rig(found, truth.board, {"cam0": "standard"})
    twice = replace(found["cam0"], places=(0,) * len(found["cam0"].places))
    with pytest.raises(ValueError, match="places of cam0 must be different frames, got one twice"):
        calibrate_rig({**found, "cam0": twice}, truth.board)
    few = replace(found["cam0"], pictures=found["cam0"].pictures[:2], corners=found["cam0"].corners[:2], places=(0, 1))
    with pytest.raises(CannotCalibrate, match="cam0: at least 3 views of the board are needed"):
        calibrate_rig({**found, "cam0": few}, truth.board)
    with pytest.raises(ValueError, match="of and seen_from must be two cameras, got cam1 twice"):
        relative_pose(rig_of(pinholes[2]), "cam1", "cam1")


def test_pictures_of_one_moment_have_the_same_name_or_the_same_last_number():
    names = {"a": ["a/2.png", "a/10.png"], "b": ["b/10.png", "b/11.png"], "c": ["c/2.png"]}
    paths = {name: [Path(each) for each in several] for name, several in names.items()}
    assert synchronised(paths) == {"a": (0, 1), "b": (1, 2), "c": (0,)}
    numbered = {"a": [Path("left_2.png"), Path("left_10.png")], "b": [Path("right_010.png")]}
    assert synchronised(numbered) == {"a": (0, 1), "b": (1,)}
    nameless = {"a": [Path("x.png"), Path("y.png")], "b": [Path("v.png"), Path("w.png")]}
    assert synchronised(nameless) == {"a": (0, 1), "b": (0, 1)}
    with pytest.raises(CannotCalibrate, match=r"\(2 of a, 2 of b\), and their names do not tell"):
        synchronised(nameless, by_order=False)
    with pytest.raises(CannotCalibrate, match=r"\(2 of a, 1 of b\), and their names do not tell"):
        synchronised({**nameless, "b": nameless["b"][:1]})


def test_views_of_corner_files_find_each_other_by_their_names():
    corners = np.zeros((2, 54, 2))
    found = {
        "a": Detections(("a03.png", "a05.png"), corners, 640, 480),
        "b": Detections(("b05.png", "b06.png"), corners, 640, 480),
    }
    assert [each.places for each in in_frames(found).values()] == [(0, 1), (1, 2)]


def test_a_distance_and_its_deviation_are_of_the_same_direction():
    """A camera 5 m away along (0.6, 0, 0.8); its centre is known to 1, 1 and 2 mm, to a ± of √(0.36 + 0.64 · 4) mm."""
    _, _, calibration = solved(8, 2, frames=6, shared=0.5)
    beside = replace(
        relative_pose(rig_of(calibration), "cam1", "cam0"),
        pose=RigidTransform.from_components([3, 0, 4], Rotation.from_rotvec([0, 0.5, 0])),
        covariance=np.diag([0.01, 0.02, 0.03, 0.001, 0.001, 0.002]) ** 2,
    )
    assert beside.distance == pytest.approx(5)
    assert beside.distance_deviation == pytest.approx(0.001 * np.sqrt(0.36 + 0.64 * 4))
    assert beside.angle == pytest.approx(0.5)
    assert beside.angle_deviation == pytest.approx(0.02)


def test_views_that_went_first_come_back_where_the_lens_is_wild_without_them(monkeypatch):
    rng = np.random.default_rng(0)
    truth = virtual.rig(rng, 2, frames=20, shared=1.0)
    found = truth.observed(rng)
    seen_by = found["cam1"]
    corners = seen_by.corners + rng.normal(0, 0.6, seen_by.corners.shape)
    radii = np.linalg.norm(corners - [seen_by.width / 2, seen_by.height / 2], axis=-1)
    order = np.argsort(np.nanmax(radii, axis=1))
    inner, outer = order[:5], order[-3:]
    for view in inner:  # what five views tell of the middle of the picture says nothing of its border
        corners[view][radii[view] > 170] = np.nan
    found["cam1"] = replace(seen_by, corners=corners).only(sorted([*inner, *outer]))
    frames = sorted({place for each in found.values() for place in each.places})
    lone = {
        name: spread_out(alone(each, truth.board, "standard", (), True, None), list(map(frames.index, each.places)),
                         len(frames)) for name, each in found.items()
    }  # fmt: skip
    start = begun(lone, truth.board)
    rows = [frames.index(seen_by.places[view]) for view in outer]
    gone = {name: np.zeros(each.shape[:2], dtype=bool) for name, each in start.detections.items()}
    gone["cam1"][rows] = seen(start.detections["cam1"][rows])
    assert np.array_equal(solving._judged(replace(start, set_aside=gone)).set_aside["cam1"], gone["cam1"])
    monkeypatch.setattr(solving, "hopeless", lambda adjustment: gone)
    assert not solving.judged(start).set_aside["cam1"].any()
