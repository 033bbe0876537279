"""A guided calibration without a page: what is taken and what is not, where it ends, and that nothing waits."""

import json
import threading

import cv2
import numpy as np
import pytest

import camviz_clinic
from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration import Board, CannotCalibrate, Detections, calibrate, find_corners
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.guidance import next_board_poses, rim_poses, shows_whole
from camviz_clinic.calibration.problem import moved
from camviz_clinic.calibration.uncertainty import expected_errors, largest_expected_error
from camviz_clinic.checks.snapshots import snapshot
from camviz_clinic.checks.virtual import spread_boards
from camviz_clinic.files import load
from camviz_clinic.films.reading import FilmError
from camviz_clinic.live import Session, capture, guiding, session, tracking
from camviz_clinic.live.tracking import BLURRED, LONG_S, STILL, Tracked, decoded, sharpness, track

TRUTH = Camera(Intrinsics(640, 480, 560, 561, 325, 236), BrownConrady(-0.12, 0.05))
BOARD = Board(9, 6, 0.025)
GRAY = np.full((480, 640), 127, np.uint8)
SEEN = TRUTH.project(spread_boards(np.random.default_rng(3), (TRUTH,), BOARD, 1, (30, 30))[0].apply(BOARD.corners))


class Hands:
    """What a session sees in place of pictures: `corners` by the exact finder and, a moment later, by the quick one."""

    def __init__(self, monkeypatch, **limits):
        self.corners, self.sharpness, self.time_s = SEEN, 1.0, 0.0
        self.session = Session(BOARD, **limits)
        self.rng = np.random.default_rng(1)
        monkeypatch.setattr(session, "track", lambda gray, board, time_s: self.tracked(time_s))
        monkeypatch.setattr(session, "find_corners", lambda gray, board: self.found())

    def tracked(self, time_s):
        return None if self.corners is None else Tracked(self.corners, time_s, self.sharpness)

    def found(self):
        return self.corners + self.rng.normal(0, 0.05, self.corners.shape)

    def show(self, corners, frames=2, **more):
        """The last answer to frames of a board at rest, a tenth of a second apart, solved for where one was taken."""
        self.corners = corners
        vars(self).update(more)
        for _ in range(frames):
            self.time_s += 0.1
            answer = self.session.look(GRAY, self.time_s)
            if answer.taken:
                break
        self.session.wait()
        return answer

    def follow(self, rng):
        """Show the board where the ghost is, off by a few degrees and per cent."""
        ghost = self.session.guide.ghost
        turn = Rotation.from_rotvec(rng.normal(0, 0.05, 3)) * ghost.rotation
        pose = RigidTransform.from_components(ghost.translation * rng.normal(1, 0.03), turn)
        corners = TRUTH.project(pose.apply(BOARD.corners))
        return self.show(corners if TRUTH.intrinsics.contains(corners).all() else None)


@pytest.fixture
def hands(monkeypatch):
    return Hands(monkeypatch)


@pytest.fixture(scope="module")
def pictures():
    """Boards whole in the picture at eight poses, rendered."""
    rng = np.random.default_rng(8)
    poses = guiding.candidate_poses(TRUTH, BOARD)
    poses = poses[guiding.tilt_deg(poses, BOARD) > 20]
    chosen = poses[np.random.default_rng(7).choice(len(poses), 8, replace=False)]
    return [snapshot(TRUTH, BOARD, pose, rng) for pose in chosen]


def worst_held_out(found):
    poses = spread_boards(np.random.default_rng(99), (TRUTH,), BOARD, 20, (0, 45))
    exact = np.array([TRUTH.project(pose.apply(BOARD.corners)) for pose in poses])
    fitted = Adjustment(BOARD, dict(found.cameras), {"camera": exact}, poses, {"camera": ()}).refined(only_poses=True)
    return np.linalg.norm(fitted.residuals["camera"], axis=-1).max()


# What it comes to -----------------------------------------------------------------------------------------------------


@pytest.mark.thorough
def test_who_follows_the_ghost_knows_the_camera_after_twelve_views(hands, tmp_path):
    rng = np.random.default_rng(2)
    hands.show(None)
    for _ in range(40):
        if hands.follow(rng) and hands.session.done:
            break
    found = hands.session.calibration
    known = hands.session.known
    assert hands.session.done
    assert 6 <= len(hands.session.views) <= 12
    assert found.cameras["camera"].intrinsics.fx == pytest.approx(560, rel=0.005)
    assert worst_held_out(found) < 2
    assert known[-1].sigma < known[0].sigma
    assert known[-1].largest <= 1 < known[0].largest
    assert hands.session.verdict.startswith("The goal is reached: fx = 5")
    assert hands.session.look(GRAY, 1e3).sentence == hands.session.verdict  # and nothing more is looked for
    hands.session.save(tmp_path / "camera.yaml", "ros")
    assert load(tmp_path / "camera.yaml").cameras["camera"].intrinsics.fx == found.cameras["camera"].intrinsics.fx
    assert found.stamps["camera"].views == len(hands.session.views)


def test_a_film_in_place_of_the_camera_gives_f_within_half_a_per_cent(pictures, tmp_path):
    writer = cv2.VideoWriter(str(tmp_path / "film.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 1, (640, 480))
    for picture in pictures:
        for _ in range(8):  # seconds: who follows no ghost is asked for less after five
            writer.write(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))
    writer.release()
    widget = capture(BOARD, tmp_path / "film.avi", goal=2.0).run()
    found = widget.calibration
    assert widget.session.done
    assert found.cameras["camera"].intrinsics.fx == pytest.approx(560, rel=0.005)
    assert worst_held_out(found) < 2
    widget.session.save_pictures(tmp_path / "views")
    assert [path.name for path in sorted((tmp_path / "views").iterdir())] == list(found.pictures["camera"])


def views_in_the_middle():
    """An adjustment by eight boards at the middle of the picture, tilted; corners to 0.06 px."""
    rng = np.random.default_rng(5)
    everywhere = guiding.candidate_poses(TRUTH, BOARD)
    central = np.linalg.norm(TRUTH.project(everywhere.apply(BOARD.corners.mean(axis=0))) - [320, 240], axis=-1) < 40
    central &= guiding.tilt_deg(everywhere, BOARD) > 20
    chosen = everywhere[rng.choice(np.flatnonzero(central), 8, replace=False)]
    corners = TRUTH.project(moved(chosen, BOARD.corners))
    names = tuple(f"{number}.png" for number in range(len(corners)))
    return Adjustment.of(calibrate(Detections(names, corners + rng.normal(0, 0.06, corners.shape), 640, 480), BOARD))


def test_the_ghost_lies_where_the_error_is_largest_and_lessens_it_there_more_than_one_for_the_whole_picture():
    known = views_in_the_middle()
    uv, expected = expected_errors(known)
    led = guiding.guide(known, 8)
    assert np.linalg.norm(led.pixels[:, None] - uv[expected > 0.9 * expected.max()], axis=-1).min() < 0.15 * 640
    assert led.largest == largest_expected_error(known)
    by_mean = next_board_poses(known)[0].cam_from_board
    instead = next_board_poses(known, RigidTransform.concatenate([by_mean]), uv=led.worst)[0]
    assert led.candidate.after < 0.9 * instead.after < instead.before == led.candidate.before


def test_boards_at_the_rim_are_whole_and_come_near_to_every_corner_of_the_picture_in_every_size():
    poses = rim_poses(TRUTH, BOARD)
    assert shows_whole(TRUTH, BOARD, poses).all()
    seen = TRUTH.project(moved(poses, BOARD.corners))
    width = np.ptp(seen[..., 0], axis=1) / 640
    for corner in [(0, 0), (640, 0), (640, 480), (0, 480)]:
        near = np.linalg.norm(seen - corner, axis=-1).min(axis=1) < 0.15 * 640
        assert width[near].min() < 0.2
        assert width[near].max() > 0.45


# What is taken --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("share", "still"), [(0.99, True), (1.01, False)])
@pytest.mark.parametrize("seconds", [0.1, 0.2, 3.0])
def test_a_board_is_still_below_its_speed_and_a_long_while_counts_as_a_fifth_of_a_second(share, still, seconds):
    moved = share * STILL * 640 * min(seconds, LONG_S)
    after = Tracked(SEEN + [moved, 0], seconds, 1.0)
    assert after.still_since(Tracked(SEEN, 0.0, 1.0), 640) == still
    assert not after.still_since(None, 640)
    assert not after.still_since(Tracked(SEEN, seconds, 1.0), 640)


def test_a_moving_board_is_not_taken_and_one_that_rests_is(hands):
    answers = [hands.show(SEEN + [20 * step, 0], frames=1) for step in range(4)]
    assert [answer.taken for answer in answers] == [False] * 4
    assert answers[-1].sentence.endswith("Then rest.")
    assert hands.show(SEEN + [60, 0], frames=1).taken


@pytest.mark.parametrize(("share", "taken"), [(0.99, False), (1.01, True)])
def test_a_board_more_blurred_than_the_sharpest_is_not_taken(hands, share, taken):
    assert hands.show(SEEN).taken
    answer = hands.show(SEEN + [0, 60], sharpness=share * BLURRED)
    assert answer.taken == taken
    assert taken or "blurred" in answer.sentence


@pytest.mark.parametrize(("share", "taken"), [(0.99, False), (1.01, True)])
def test_a_view_differs_from_all_others(hands, share, taken):
    assert hands.show(SEEN).taken
    moved = SEEN + [share * session.NEW * 640, 0]
    assert hands.show(moved).taken == taken
    assert hands.show(moved[::-1]).taken is False  # a board turned by 180 degrees is the same


@pytest.mark.parametrize(("seconds", "taken"), [(4.7, False), (5.3, True)])
def test_after_five_seconds_half_as_much_is_asked(hands, monkeypatch, seconds, taken):
    monkeypatch.setattr(guiding.Guide, "share", lambda self, corners: session.ENOUGH / 2)
    assert not hands.show(SEEN).taken
    hands.time_s += seconds - 0.3
    assert hands.show(SEEN).taken == taken


def test_without_tilt_or_ghost_a_first_board_says_nothing(hands):
    flat = RigidTransform.from_components([-0.1, -0.06, 0.6], Rotation.identity())
    assert not hands.show(TRUTH.project(flat.apply(BOARD.corners))).taken
    assert hands.show(hands.session.guide.pixels).taken


def test_at_the_ghost_a_view_gains_what_the_ghost_would(hands, monkeypatch):
    rng = np.random.default_rng(2)
    hands.show(None)
    while hands.session.guide.adjustment is None:
        hands.follow(rng)
    guide = hands.session.guide
    monkeypatch.setattr(guiding, "NEAR", 0.0)
    assert guide.share(guide.pixels) == pytest.approx(1, abs=1e-3)
    assert guide.share(hands.session.views[-1].corners) < 1
    to_the_right_edge = 639.5 - guide.pixels[:, 0].mean()
    assert guide.share(guide.pixels + [to_the_right_edge, 0]) == 0  # half of it lies outside


# What does not happen -------------------------------------------------------------------------------------------------


def test_frames_are_answered_while_a_solution_takes_long_and_none_waits(hands, monkeypatch):
    go_on, begun = threading.Event(), []
    monkeypatch.setattr(
        Session, "_solved", lambda self, gray: (begun.append(1), go_on.wait(60), session._Step(None))[2]
    )
    hands.corners = SEEN
    answers = [hands.session.look(GRAY, 0.1 * number) for number in range(1, 200)]
    assert sum(answer.taken for answer in answers) == 1
    assert "worked out" in answers[-1].sentence
    go_on.set()
    hands.session.wait()
    assert len(begun) == 1
    hands.corners = SEEN + [40, 0]
    assert hands.session.look(GRAY, 20.1).sentence.startswith("Chessboard was not found exactly, so no view. Cover")


def test_it_ends_with_the_most_views_and_says_that_the_goal_is_missed(monkeypatch):
    monkeypatch.setattr(session, "FEWEST", 3)  # which is quicker
    hands, rng = Hands(monkeypatch, goal=1e-3, most=4), np.random.default_rng(2)
    hands.show(None)
    for _ in range(40):
        hands.follow(rng)
    assert hands.session.done
    assert len(hands.session.views) == 4
    assert hands.session.verdict.startswith("The goal is not reached: fx = 5")


def test_what_cannot_be_is_refused_in_one_sentence(hands, tmp_path):
    for wrong, said in (
        ({"model": "pinholo"}, "model must be one of "),
        ({"goal": 0}, "goal must be a positive number of pixels, got 0"),
        ({"most": 5}, "most must be at least 6 views, got 5"),
    ):
        with pytest.raises(ValueError, match=said):
            Session(BOARD, **wrong)
    with pytest.raises(CannotCalibrate, match="no camera is known yet: 0 views were taken"):
        hands.session.save(tmp_path / "camera.yaml")
    assert list(tmp_path.iterdir()) == []
    hands.show(None)
    with pytest.raises(ValueError, match="frames must have 640 × 480 pixels as the first had, got 320 × 240"):
        hands.session.look(GRAY[:240, :320], 1.0)
    with pytest.raises(FilmError, match=r"none\.mp4: there is no such film"):
        capture(BOARD, "none.mp4")
    with pytest.raises(ValueError, match="film must be given to run without a page"):
        capture(BOARD).run()


# The page's messages --------------------------------------------------------------------------------------------------


@pytest.fixture
def page():
    """A widget, and what it has sent."""
    widget, sent = camviz_clinic.capture(BOARD), []
    widget.send = lambda content, buffers=(): sent.append(content)
    return widget, sent


def test_a_frame_is_answered_by_its_number_in_json(page, pictures):
    widget, sent = page
    jpeg = cv2.imencode(".jpg", pictures[0])[1].tobytes()
    for number in (1, 2):
        widget._receive(widget, {"number": number, "time": 0.1 * number, "delay": 42.0}, [memoryview(jpeg)])
    assert [answer["number"] for answer in sent] == [1, 2]
    assert len(sent[1]["corners"]) == 54
    assert np.shape(sent[1]["ghost"]) == (8, 11, 2)
    assert list(widget.delays_ms) == [42, 42]
    json.dumps(sent, allow_nan=False)


@pytest.mark.parametrize(
    ("message", "buffers", "said"),
    [
        ({"number": 7, "time": 0.1}, [], "must hold one frame"),
        ({"number": 7, "time": 0.1}, [b"no picture"], "must be a JPEG"),
        ({"number": 7, "time": 0.1}, [b""], "must be a JPEG"),
        ({"number": 7, "time": 0.1}, [bytes(8_000_001)], "at most 8000000 bytes"),
        ("nonsense", [], "AttributeError"),
    ],
)
def test_a_message_that_is_none_is_answered_by_a_sentence(page, message, buffers, said):
    widget, sent = page
    widget._receive(widget, message, buffers)
    assert said in sent[0]["error"]


# The quick finder -----------------------------------------------------------------------------------------------------


def test_the_quick_finder_is_within_a_pixel_of_the_exact_one(pictures):
    both = [(track(picture, BOARD, 0.0), find_corners(picture, BOARD)) for picture in pictures[:5]]
    off = [tracking.apart(quick.corners, exact) for quick, exact in both if quick is not None]
    assert len(off) == 5
    assert max(off) < 1
    assert track(GRAY, BOARD, 0.0) is None
    assert decoded(cv2.imencode(".jpg", GRAY)[1].tobytes()).shape == GRAY.shape


@pytest.mark.parametrize("sigma", [2.0, 3.0])
def test_sharpness_is_half_the_inverse_square_of_an_edges_blur(sigma):
    square = np.zeros((200, 200), np.float32)
    square[60:140, 60:140] = 200
    blurred = cv2.GaussianBlur(square, (0, 0), sigma).astype(np.uint8)
    within = np.array([[20.0, 20.0], [180.0, 180.0]])
    assert sharpness(blurred, within) == pytest.approx(0.5 / (sigma**2 + 1), rel=0.05)  # of which 1 is its own
    one_way = cv2.blur(cv2.GaussianBlur(square, (0, 0), 1), (9, 1)).astype(np.uint8)
    assert sharpness(one_way, within) == pytest.approx(sharpness(one_way.T.copy(), within), rel=1e-3)
