"""Films: frames are read as they were recorded, damage is named by frame, and the chosen frames tell most."""

from dataclasses import replace
from itertools import combinations
from types import SimpleNamespace

import cv2
import numpy as np
import pytest

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz_clinic.calibration import detect
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.finding import find_corners
from camviz_clinic.calibration.solving import calibrate
from camviz_clinic.calibration.types import Board
from camviz_clinic.calibration.uncertainty import projection_uncertainty
from camviz_clinic.films import Film, FilmError, chosen_frames
from camviz_clinic.films.candidates import candidates, sharpness, speed
from camviz_clinic.films.choosing import greedy, most_telling_of_boards
from camviz_clinic.films.virtual import take
from camviz_clinic.rigs import calibrate_boards, virtual_boards

BOARD = Board(7, 5, 0.03)
CAMERA = Camera(Intrinsics(256, 192, 212, 212.4, 129, 95), BrownConrady(-0.1, 0.02))
SEARCH = {"finder": "classic", "workers": 1}
FRAMES = 10


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    """A film of a board that rests and is carried, in the ways that OpenCV writes it, and its pictures."""
    folder, rng = tmp_path_factory.mktemp("films"), np.random.default_rng(7)
    filmed = take(rng, CAMERA, BOARD, 16, rest_s=0.15, way_s=0.4, rate=8.0, exposure_s=0.02)
    pictures = list(filmed.pictures(rng, moments=2))
    for name, code in (("film.avi", "MJPG"), ("film.mp4", "mp4v"), ("film.mkv", "MJPG")):
        written(folder / name, pictures, code)
    return SimpleNamespace(folder=folder, filmed=filmed, pictures=pictures)


def written(path, pictures, code, rate=8.0):
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*code), rate, (256, 192))
    for picture in pictures:
        writer.write(cv2.cvtColor(picture, cv2.COLOR_GRAY2BGR))
    writer.release()


def read(path):
    with Film(path) as film:
        return list(film.frames()), film


# Reading


@pytest.mark.parametrize("name", ["film.avi", "film.mp4", "film.mkv"])
def test_every_frame_comes_once_with_its_time_and_looks_as_it_was_filmed(shot, name):
    frames, film = read(shot.folder / name)
    assert [frame.number for frame in frames] == list(range(len(shot.pictures)))
    assert [frame.time_s for frame in frames] == pytest.approx(np.arange(len(frames)) / 8, abs=2e-3)
    assert (film.width, film.height, film.notes) == (256, 192, [])
    for frame in frames[:: len(frames) // 5]:
        off = np.abs(frame.gray.astype(float) - shot.pictures[frame.number])
        assert off.mean() < 4


def test_a_film_that_breaks_off_names_the_frame_and_what_comes_before_is_read(shot, tmp_path):
    for name in ("film.avi", "film.mkv"):
        whole = (shot.folder / name).read_bytes()
        (tmp_path / name).write_bytes(whole[: len(whole) * 2 // 3])
        frames, film = read(tmp_path / name)
        count = len(shot.pictures)
        assert 0.6 * count < len(frames) < 0.7 * count
        assert film.notes == [
            f"the film ends at frame {len(frames)} of {count} ({len(frames) / 8:.2f} s), where it is damaged or was "
            "interrupted; what comes before was used."
        ]
        assert frames[-1].gray == pytest.approx(read(shot.folder / name)[0][len(frames) - 1].gray)


@pytest.mark.parametrize("name", ["film.avi", "film.mp4", "film.mkv"])
def test_damage_within_a_film_names_the_frame_before_it_and_the_rest_is_read(shot, tmp_path, name):
    broken = bytearray((shot.folder / name).read_bytes())
    at = len(broken) // 2
    broken[at : at + 30_000 if name != "film.mp4" else at + 3_000] = np.random.default_rng(3).bytes(
        30_000 if name != "film.mp4" else 3_000
    )
    (tmp_path / name).write_bytes(broken)
    frames, film = read(tmp_path / name)
    count = len(shot.pictures)
    assert count > len(frames) > 0.8 * count
    (note,) = film.notes
    assert note.startswith(f"{count - len(frames)} of its {count} frames cannot be read, the first after frame ")
    named = int(note.split("after frame ")[1].split()[0])
    sizes = np.cumsum([len(cv2.imencode(".jpg", picture)[1]) for picture in shot.pictures])
    where = int(np.searchsorted(sizes, sizes[-1] / 2))
    assert abs(named - where) <= (3 if name != "film.mp4" else count // 5)  # mp4v's frames differ much in size


def test_a_hole_in_a_short_film_is_damage_and_no_variable_rate(shot, tmp_path):
    pictures = shot.pictures[:40]
    written(tmp_path / "short.mp4", pictures, "mp4v")
    broken = bytearray((tmp_path / "short.mp4").read_bytes())
    at, size = len(broken) // 2, len(broken) // 6
    broken[at : at + size] = np.random.default_rng(3).bytes(size)
    (tmp_path / "short.mp4").write_bytes(broken)
    frames, film = read(tmp_path / "short.mp4")
    assert 3 <= 40 - len(frames) <= 12
    gap = int(np.argmax(np.diff([frame.time_s for frame in frames])))
    assert film.notes == [
        f"{40 - len(frames)} of its 40 frames cannot be read, the first after frame {gap} ({gap / 8:.2f} s), where the "
        "film is damaged; the others were used."
    ]


def test_a_recording_without_its_index_is_refused_in_words_that_say_so(shot, tmp_path):
    whole = (shot.folder / "film.mp4").read_bytes()
    (tmp_path / "cut.mp4").write_bytes(whole[: len(whole) // 2])
    with pytest.raises(FilmError, match=r"cut\.mp4: the recording was interrupted before .* index \(moov\)"):
        Film(tmp_path / "cut.mp4")


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "it is empty, expected a film"),
        (b"#EXTM3U\nhttp://example.org/film.ts\n", "it is not a film that can be read, it begins with 23 45"),
        (b"RIFF\0\0\1\0AVI " + bytes(300), "no frame can be read"),
        (None, "there is no such film"),
    ],
)
def test_what_is_no_film_is_refused_in_one_sentence(tmp_path, content, why):
    if content is not None:
        (tmp_path / "x.avi").write_bytes(content)
    with pytest.raises(FilmError, match=why):
        Film(tmp_path / "x.avi")


def turned(film, degrees):
    """An MP4 whose track asks to be turned: the matrix of its track header (ISO/IEC 14496-12, section 8.3.2)."""
    one = 1 << 16
    rows = {90: (0, one, -one, 0), 180: (-one, 0, 0, -one)}[degrees]
    words = [rows[0], rows[1], 0, rows[2], rows[3], 0, 0, 0, 1 << 30]
    at = film.index(b"tkhd") + 4 + 40
    return film[:at] + b"".join(word.to_bytes(4, "big", signed=True) for word in words) + film[at + 36 :]


def test_frames_are_not_turned_as_a_phone_asks_for(shot, tmp_path):
    plain = read(shot.folder / "film.mp4")[0]
    for degrees in (90, 180):
        path = tmp_path / "phone.mp4"
        path.write_bytes(turned((shot.folder / "film.mp4").read_bytes(), degrees))
        assert cv2.VideoCapture(str(path)).read()[1].shape[:2] == ((256, 192) if degrees == 90 else (192, 256))
        frames, film = read(path)
        assert film.turned_deg == degrees
        assert f"asks to be shown turned by {degrees}°; it is not turned here" in film.notes[0]
        np.testing.assert_array_equal(frames[5].gray, plain[5].gray)


def at_times(film, ticks):
    """An MP4 whose frames last so many ticks each: its table of times is written anew (14496-12, section 8.6.1.2)."""
    at = film.index(b"stts") - 4
    length = int.from_bytes(film[at : at + 4], "big")
    table = b"stts" + bytes(4) + len(ticks).to_bytes(4, "big")
    table += b"".join((1).to_bytes(4, "big") + tick.to_bytes(4, "big") for tick in ticks)
    more = 4 + len(table) - length
    film = film[:at] + (4 + len(table)).to_bytes(4, "big") + table + film[at + length :]
    for box in (b"moov", b"trak", b"mdia", b"minf", b"stbl"):
        start = film.index(box) - 4
        size = int.from_bytes(film[start : start + 4], "big") + more
        film = film[:start] + size.to_bytes(4, "big") + film[start + 4 :]
    return film


def test_frames_of_a_variable_rate_have_their_own_times(shot, tmp_path):
    count = len(shot.pictures)
    whole = (shot.folder / "film.mp4").read_bytes()
    at = whole.index(b"stts")
    tick = int.from_bytes(whole[at + 16 : at + 20], "big")
    ticks = [tick * 3 // 2 if frame % 2 else tick // 2 for frame in range(count)]
    (tmp_path / "phone.mp4").write_bytes(at_times(whole, ticks))
    frames, film = read(tmp_path / "phone.mp4")
    assert len(frames) == count
    expected = np.concatenate([[0], np.cumsum(ticks[:-1])]) / tick / 8
    assert [frame.time_s for frame in frames] == pytest.approx(expected, abs=2e-3)
    assert film.notes == ["its frames are 62 to 188 ms apart (a variable rate): they are taken at their own times."]


def test_a_film_that_was_trimmed_is_not_called_interrupted(shot, tmp_path):
    """A phone trims by a list of what to show (14496-12, section 8.6.6), and leaves the frames where they are."""
    whole = (shot.folder / "film.mp4").read_bytes()
    at = whole.index(b"elst") + 12
    shown = int.from_bytes(whole[at : at + 4], "big") // 2
    (tmp_path / "phone.mp4").write_bytes(whole[:at] + shown.to_bytes(4, "big") + whole[at + 4 :])
    frames, film = read(tmp_path / "phone.mp4")
    assert len(frames) == pytest.approx(len(shot.pictures) / 2, abs=2)
    assert film.notes == [
        f"frame {len(frames) - 1} of {len(shot.pictures)} ({(len(frames) - 1) / 8:.2f} s) is the last that can be "
        "read: the film was trimmed, or is damaged behind it."
    ]


# Looking


def test_speed_is_that_of_the_picture_and_sharpness_falls_with_blur():
    rng = np.random.default_rng(2)
    waves = rng.normal(0, 0.2, (20, 2))  # radians a pixel
    u, v = np.meshgrid(np.arange(100), np.arange(80))

    def wavy(right):
        return np.float32(sum(np.sin(a * (u - right) + b * v) for a, b in waves) / 40 + 0.5)

    smooth = wavy(0)
    for pixels in (0.1, 0.3):
        along = np.sum(np.abs(np.gradient(smooth, axis=1)) * np.hypot(*np.gradient(smooth)))
        share = along / np.sum(np.hypot(*np.gradient(smooth)) ** 2)  # of edges that a shift to the right can move
        assert speed(smooth, wavy(pixels), 0.1) == pytest.approx(10 * pixels * share, rel=0.1)
    assert speed(smooth, smooth, 0.1) == 0
    assert sharpness(smooth) > 2 * sharpness(cv2.GaussianBlur(smooth, (0, 0), 2))


def test_the_frames_looked_at_are_stiller_than_most(shot, tmp_path):
    with Film(shot.folder / "film.avi") as film:
        found = candidates({"camera": film}, tmp_path, 20)
    assert len(found) == 20
    assert sorted(tmp_path.iterdir()) == sorted(each.pictures["camera"] for each in found)

    def moved(time_s):
        poses = shot.filmed.at(np.array([time_s, time_s + 0.02]))
        return float(np.ptp([pose.apply(BOARD.corners[0]) for pose in poses], axis=0).max())

    every = [moved(frame / 8) for frame in range(len(shot.pictures))]
    share = np.mean([moved(each.time_s) for each in found]) / np.mean(every)
    assert share < 0.4
    assert [each.number for each in found] == [int(each.pictures["camera"].stem[-6:]) for each in found]


# Choosing


def test_greedy_choice_is_near_the_best_of_all_choices():
    rng = np.random.default_rng(4)
    rows = rng.normal(0, 1, (9, 4, 3)) * rng.uniform(0.2, 2, (9, 1, 1))
    information, noise = np.swapaxes(rows, 1, 2) @ rows, rng.uniform(1, 4, 9)

    def mean_variance(views):
        views = list(views)
        inverse = np.linalg.inv(information[views].sum(axis=0))
        scatter = inverse @ np.einsum("v,vij->ij", noise[views], information[views]) @ inverse
        whole = np.linalg.inv(information.sum(axis=0))
        least = np.diag(whole @ np.einsum("v,vij->ij", noise, information) @ whole)
        return float(np.mean(np.diag(scatter) / least))

    every = sorted(mean_variance(views) for views in combinations(range(9), 4))
    chosen = greedy(information, noise, 4)
    assert len(set(chosen.tolist())) == 4
    assert mean_variance(chosen) < 1.1 * every[0]
    assert mean_variance(chosen) < 0.6 * np.median(every)


@pytest.mark.thorough
def test_of_several_boards_the_frames_are_chosen_by_which_cameras_and_places_are_known_best():
    def mean_sigma(places):
        some = {
            camera: {
                name: one.only([at for at, place in enumerate(one.places) if place in places])
                for name, one in each.items()
            }
            for camera, each in seen.items()
        }
        covariance = calibrate_boards(some, truth.boards, robust=False).adjustment.corner_covariance
        return float(np.sqrt(np.diag(covariance) / np.diag(whole)).mean())

    rng = np.random.default_rng(2)
    truth = virtual_boards.back_to_back(rng)
    seen = truth.observed(rng)
    whole = calibrate_boards(seen, truth.boards, robust=False).adjustment.corner_covariance
    chosen = most_telling_of_boards(seen, truth.boards, "standard", 10)
    assert len(chosen) == 10
    assert mean_sigma(chosen) < 0.8 * mean_sigma(np.linspace(0, 24, 10).round())
    assert mean_sigma(chosen) < 0.95 * np.mean([mean_sigma(rng.choice(25, 10, replace=False)) for _ in range(5)])


def sigmas(detections):
    """By the noise of corners and by the scatter of views: σ of the parameters, and of a pixel on average."""
    problem = Adjustment.of(calibrate(detections, BOARD, fixed=("k3",)), "camera")
    u, v = np.meshgrid(np.linspace(10, 245, 9), np.linspace(10, 181, 7))
    pixel = np.nanmean(projection_uncertainty(problem, np.stack([u, v], axis=-1)))
    return np.sqrt(np.diag(problem.corner_covariance)), float(pixel), problem


def test_the_chosen_frames_tell_more_than_as_many_that_are_equally_spaced(shot, tmp_path):
    chosen = chosen_frames(
        [{"camera": shot.folder / "film.avi"}], tmp_path, BOARD, FRAMES, fixed=("k3",), search=SEARCH
    )
    pictures = chosen.pictures["camera"]
    assert len(pictures) == FRAMES
    assert sorted(tmp_path.iterdir()) == sorted(pictures)
    assert chosen.notes[0].startswith("film.avi: 10 frames were chosen, of ")
    found = detect(pictures, BOARD, **SEARCH)
    frames = read(shot.folder / "film.avi")[0]
    every = [find_corners(frame.gray, BOARD, "classic") for frame in frames]
    shown = [corners for corners in every if corners is not None]
    spaced = [shown[place] for place in np.linspace(0, len(shown) - 1, FRAMES).round().astype(int)]
    equal = replace(
        found, pictures=tuple("abcdefghij"), corners=np.array(spaced), places=tuple(range(FRAMES)), skipped=()
    )
    corners, pixel, problem = sigmas(found)
    corners_of_equal, pixel_of_equal, _ = sigmas(equal)
    assert (corners < corners_of_equal).all()
    assert pixel < 0.9 * pixel_of_equal
    truth = [212, 212.4, 129, 95, -0.1, 0.02, 0, 0]
    assert (np.abs(problem.intrinsics("camera") - truth) < 5 * np.sqrt(np.diag(problem.covariance))).all()


def test_a_film_without_the_board_gives_its_frames_evenly_for_others_to_say_why(shot, tmp_path):
    chosen = chosen_frames(
        [{"camera": shot.folder / "film.avi"}], tmp_path, Board(5, 4, 0.03, 0.02, "DICT_4X4_50"), 5, search=SEARCH
    )
    numbers = [int(path.stem[-6:]) for path in chosen.pictures["camera"]]
    assert len(numbers) == 5
    assert np.diff(numbers).min() > 0.1 * len(shot.pictures)
    with pytest.raises(ValueError, match="frames must be at least 1, got 0"):
        chosen_frames([{"camera": shot.folder / "film.avi"}], tmp_path, BOARD, 0)


def test_two_films_of_one_name_have_frames_of_different_names(shot, tmp_path):
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        written(tmp_path / folder / "film.avi", shot.pictures[:12], "MJPG")
    takes = [{"camera": tmp_path / folder / "film.avi"} for folder in ("a", "b")]
    chosen = chosen_frames(takes, tmp_path / "out", BOARD, 20, search=SEARCH)
    names = {path.stem[:-7] for path in chosen.pictures["camera"]}
    assert names == {"a-film", "b-film"}


def test_cameras_that_film_at_once_keep_frames_of_the_same_moments(shot, tmp_path):
    written(tmp_path / "fast.avi", shot.pictures[:40], "MJPG")
    written(tmp_path / "slow.avi", shot.pictures[:40:2], "MJPG", rate=4.0)
    with Film(tmp_path / "fast.avi") as fast, Film(tmp_path / "slow.avi") as slow:
        found = candidates({"fast": fast, "slow": slow}, tmp_path / "out", 6)
    assert len(found) == 6
    for each in found:
        one, other = (each.pictures[name] for name in ("fast", "slow"))
        assert one.stem.split("_")[1] == other.stem.split("_")[1] == f"{each.number:06}"
        assert np.abs(cv2.imread(str(one), 0).astype(int) - cv2.imread(str(other), 0)).mean() < 2
