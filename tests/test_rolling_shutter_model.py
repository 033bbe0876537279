"""A camera with a rolling shutter is found from a film: its numbers, its line delay, and their ±."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.poses import Rotation
from camviz_clinic.calibration import Board, CannotCalibrate, Detections, calibrate
from camviz_clinic.calibration.line_delay import LineDelay
from camviz_clinic.calibration.rolling_solving import (
    Filmed,
    NotByRows,
    clearly,
    even_times,
    pieces_of,
    solved_film,
    with_rolling_shutter,
)
from camviz_clinic.calibration.trajectory import left_jacobian
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.findings.moving import motion
from camviz_clinic.films.virtual import SmoothTake, take

BOARD = Board(8, 6, 0.03)
CAMERA = Camera(Intrinsics(640, 480, 540, 542, 325, 233), BrownConrady(-0.12, 0.06, 3e-4, -2e-4))
RATE, NOISE = 30.0, 0.1


def filmed(seed=1, readout_s=0.02, frames=72):
    """The corners of a film whose board is carried around, and the solution as if all rows were read at once."""
    rng = np.random.default_rng(seed)
    path = SmoothTake(**vars(take(rng, CAMERA, BOARD, 8, rest_s=0, way_s=0.5, rate=RATE, readout_s=readout_s)))
    times = np.arange(frames) / RATE
    corners = path.corners(times)
    moved = path.corners(times + readout_s / 2) - path.corners(times - readout_s / 2)
    corners += rng.normal(0, NOISE, corners.shape)
    seen = Detections(tuple(f"film_{i:06}.png" for i in range(frames)), corners, 640, 480)
    few = np.arange(0, frames, 4)
    some = replace(seen, pictures=tuple(seen.pictures[i] for i in few), corners=corners[few], places=())
    start = calibrate(some, BOARD, fixed=("k3",), robust=False)
    shear = float(np.sqrt(np.nanmean(np.sum(moved**2, axis=-1))))
    return SimpleNamespace(seen=seen, times=times, start=start, delay=readout_s / 480, shear=shear)


def off(camera):
    """By what part of themselves fx and fy are off."""
    found = camera.intrinsics
    return max(abs(found.fx / 540 - 1), abs(found.fy / 542 - 1))


@pytest.fixture(scope="module")
def film():
    return filmed()


@pytest.fixture(scope="module")
def found(film):
    return with_rolling_shutter(film.start, film.seen, film.times)


def test_camera_and_delay_are_found_where_rows_shear_the_board(film, found):
    """K within 0.5 % and the delay within 1 %, where the solution for all rows at once is off by more than 1 %."""
    assert film.shear >= 1
    assert off(film.start.cameras["camera"]) > 0.01
    assert off(found.cameras["camera"]) < 0.005
    delay = found.line_delays["camera"]
    assert delay.seconds == pytest.approx(film.delay, rel=0.01)
    assert abs(delay.seconds - film.delay) < 4 * delay.sigma
    assert delay.sigma < 0.01 * film.delay
    assert found.rms("camera") == pytest.approx(NOISE * np.sqrt(2), rel=0.1)
    for key, truth in {"fx": 540, "fy": 542, "cx": 325, "cy": 233}.items():
        place = found.estimated["camera"].index(key)
        sigma = np.sqrt(found.intrinsics_covariance["camera"][place, place])
        assert abs(getattr(found.cameras["camera"].intrinsics, key) - truth) < 4 * sigma


def test_what_is_kept_are_corners_of_all_rows_at_once(film, found):
    """So the finding of a rolling shutter, which the film's own corners raise, is not raised by the result."""
    observed = Evidence(found).observed["camera"]
    assert not motion(observed).is_there
    assert observed.adjustment.rms == pytest.approx(NOISE * np.sqrt(2), rel=0.1)
    assert "where a shutter of all rows at once would have seen them" in found.notes[0]


def test_a_held_delay_is_kept_and_gives_the_camera(film):
    found = with_rolling_shutter(film.start, film.seen, film.times, film.delay)
    assert found.line_delays["camera"] == LineDelay(film.delay, None)
    assert off(found.cameras["camera"]) < 0.005


def test_a_global_shutter_has_no_delay_and_is_not_offered_one():
    film = filmed(seed=2, readout_s=0.0, frames=48)
    solved, _ = solved_film(film.start, Filmed(film.seen, film.times, BOARD))
    assert abs(solved.line_delay) < 3 * solved.deviation("line_delay")
    assert clearly(solved) < 0.01
    with pytest.raises(NotByRows, match=r"shows no rolling shutter: rows are -?\d"):
        with_rolling_shutter(film.start, film.seen, film.times)


@pytest.mark.thorough
def test_what_is_read_along_columns_is_not_taken_for_rows(film):
    """The film on its side: its columns are read one after the other."""
    corners = film.seen.corners[..., ::-1][:32]
    side = Detections(film.seen.pictures[:32], corners, 480, 640)
    some = replace(side, pictures=side.pictures[::3], corners=corners[::3], places=())
    start = calibrate(some, BOARD, fixed=("k3",), robust=False)
    with pytest.raises(NotByRows):
        with_rolling_shutter(start, side, film.times[:32])


def test_the_path_breaks_at_a_gap_and_short_stretches_are_left_out(film):
    """Of 48 frames 20 … 23 and 28 … 31 are missing: those between them are too few."""
    kept = np.array([i for i in range(48) if not 20 <= i < 24 and not 28 <= i < 32])
    seen = replace(
        film.seen, pictures=tuple(film.seen.pictures[i] for i in kept), corners=film.seen.corners[kept], places=()
    )
    found = with_rolling_shutter(film.start, seen, film.times[kept], film.delay)
    assert "4 of 40 frames that show the board were left out" in " ".join(found.notes)
    assert "film_000024.png" not in found.pictures["camera"]
    assert len(found.pictures["camera"]) == 36
    assert off(found.cameras["camera"]) < 0.005


def test_frames_too_far_apart_or_too_few_are_refused(film):
    every = replace(film.seen, pictures=film.seen.pictures[::6], corners=film.seen.corners[::6], places=())
    with pytest.raises(CannotCalibrate, match=r"the frames are 0\.2 s apart, too far"):
        with_rolling_shutter(film.start, every, film.times[::6])
    few = replace(film.seen, pictures=film.seen.pictures[:12], corners=film.seen.corners[:12], places=())
    with pytest.raises(CannotCalibrate, match="at least 3 stretches of 6 frames"):
        with_rolling_shutter(film.start, few, film.times[:12])
    with pytest.raises(CannotCalibrate, match=r"480 rows would take 96 ms, longer than the 33\.3 ms"):
        with_rolling_shutter(film.start, film.seen, film.times, 2e-4)


def test_without_a_time_for_each_frame_there_is_no_film(film):
    with pytest.raises(ValueError, match="times must be one for each of 72 frames"):
        with_rolling_shutter(film.start, film.seen, np.array([]))
    with pytest.raises(ValueError, match="times must rise"):
        with_rolling_shutter(film.start, film.seen, film.times[::-1])


def test_corners_that_the_rest_contradicts_are_set_aside(film):
    corners = film.seen.corners.copy()
    corners[10, 5] += 8
    found = with_rolling_shutter(film.start, replace(film.seen, corners=corners), film.times, film.delay)
    view = found.pictures["camera"].index("film_000010.png")
    assert found.set_aside["camera"][view, 5]
    assert found.set_aside["camera"].sum() <= 3
    assert off(found.cameras["camera"]) < 0.005


def test_the_jacobian_is_the_derivative(film):
    """By the shared parameters and by the control poses, against differences."""
    solved, _ = solved_film(film.start, Filmed(film.seen, film.times, BOARD), film.delay)
    assert "line_delay" not in solved.parameters
    bent = replace(solved, delay_free=True, warp=np.array([1e-3, -2e-3]))
    by_shared, by_piece, _ = bent._measured

    def numeric(shared, own, step):
        ends = [bent._moved(sign * step * shared, sign * step * own).residuals for sign in (-1, 1)]
        return np.where(bent.used[..., None], ends[0] - ends[1], 0).reshape(len(by_piece), -1) / (2 * step)

    still = np.zeros((len(by_piece), by_piece.shape[2]))
    for place, name in enumerate(bent.parameters):
        step = {"line_delay": 1e-8, "warp_x": 1e-6, "warp_y": 1e-6}.get(name, 1e-4)
        expected = numeric(np.eye(len(bent.parameters))[place], still, step)
        assert by_shared[..., place] == pytest.approx(expected, abs=2e-4 * np.abs(expected).max()), name
    for column in (6, 11, 14, 19):
        own = still.copy()
        own[:, column] = 1
        expected = numeric(np.zeros(len(bent.parameters)), own, 1e-6)
        assert by_piece[..., column] == pytest.approx(expected, abs=1e-4 * np.abs(expected).max())


def test_the_left_jacobian_turns_by_a_little_more():
    omega, little = np.array([0.4, -0.9, 0.3]), 1e-6 * np.array([1.0, 2.0, -3.0])
    turned = Rotation.from_rotvec(left_jacobian(omega) @ little) * Rotation.from_rotvec(omega)
    assert turned.as_rotvec() == pytest.approx(omega + little, abs=1e-11)
    near = left_jacobian(np.array([0.01, 0, 0]) * 1.0001)
    assert near == pytest.approx(left_jacobian(np.array([0.01, 0, 0]) * 0.9999), abs=2e-6)


def test_pieces_and_times():
    assert [len(piece) for piece in pieces_of(np.arange(100) / 30, 1 / 30)] == [9] * 4 + [8] * 8
    assert pieces_of(np.arange(5) / 30, 1 / 30) == []
    uneven = np.array([0, 0.033, 0.060, 0.1])
    assert even_times(range(4), uneven) is uneven


def test_a_delay_says_which_row_is_first():
    assert LineDelay(-2e-5, 1e-7).sentence == "a row is read every 20.00 ± 0.10 µs, the bottom one first"
