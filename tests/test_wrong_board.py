"""Pictures that show another board than the one asked for: one sentence that says which, and what to try."""

from functools import cache

import cv2
import numpy as np
import pytest

from camviz.cameras import Camera, Intrinsics
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration import Board, CannotCalibrate, detect, find_corners
from camviz_clinic.calibration.wrong_board import part_of_a_larger
from camviz_clinic.checks.photographs import photographed

QUICK = {"finder": "classic", "workers": 1}  # the thorough finder takes a second to find nothing
CAMERA = Camera(Intrinsics.from_fov(480, 360, 60))
POSES = [
    RigidTransform.from_components([-0.09, -0.05, 0.38], Rotation.from_rotvec(turn))
    for turn in ([0.3, -0.2, 0.1], [-0.2, 0.3, -0.1])
]
SHOWN = {
    "chessboard": (Board(8, 5, 0.028), r"a chessboard with 8×5 inner corners \(9×6 squares\): try --board 8x5$"),
    "aprilgrid": (
        Board.aprilgrid(4, 3, 0.04, 0.3),
        "an AprilGrid of 4×3 tags: try --kind aprilgrid --board 4x3$",
    ),
    "charuco": (
        Board(6, 4, 0.035, 0.026, "DICT_4X4_50"),
        "a ChArUco board of DICT_4X4_50 with 6×4 inner corners: try --board 6x4 --charuco 4X4_50$",
    ),
    "circles": (
        Board(4, 9, 0.02, kind="asymmetric-circles"),
        "an asymmetric grid of 4×9 circles: try --kind asymmetric-circles --board 4x9$",
    ),
}


@pytest.fixture(scope="module")
def taken(tmp_path_factory):
    """Two photographs of each board of `SHOWN`, made once."""
    return cache(lambda kind: photographs(SHOWN[kind][0], tmp_path_factory.mktemp(kind)))


def photographs(board, folder):
    paths = []
    for view, pose in enumerate(POSES):
        paths.append(folder / f"view{view}.png")
        cv2.imwrite(str(paths[-1]), photographed(CAMERA, board, pose))
    return paths


@pytest.mark.sampled(1)
@pytest.mark.parametrize("kind", SHOWN)
def test_a_board_that_was_not_asked_for_is_named_with_the_options_that_ask_for_it(kind, taken):
    _, said = SHOWN[kind]
    with pytest.raises(CannotCalibrate, match=f"view0.png and view1.png show what looks like {said}"):
        detect(taken(kind), Board(11, 7, 0.02), **QUICK)


@pytest.mark.parametrize("kind", ["charuco", "aprilgrid"])
def test_mirrored_pictures_are_named_as_such(kind, taken, tmp_path):
    paths = [tmp_path / path.name for path in taken(kind)]
    for path, original in zip(paths, taken(kind), strict=True):
        cv2.imwrite(str(path), cv2.imread(str(original))[:, ::-1])
    said = (
        "view0.png and view1.png show this board mirrored: turn off the camera's mirroring, or flip them left to right"
    )
    with pytest.raises(CannotCalibrate, match=said):
        detect(paths, SHOWN[kind][0], **QUICK)


def test_a_part_of_a_larger_board_is_not_taken_for_the_board(taken):
    """Of 8×5 corners 6×4 could be found; beyond them the squares go on, beyond all of them they do not."""
    whole, part = SHOWN["chessboard"][0], Board(6, 4, 0.028)
    paths = taken("chessboard")
    corners = [find_corners(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), whole) for path in paths]
    some = [each.reshape(5, 8, 2)[:4, 1:7].reshape(-1, 2) for each in corners]
    names = [path.name for path in paths]
    said = part_of_a_larger(paths, names, some, part)
    assert said.startswith("view0.png and view1.png show more squares than a chessboard with 6×4 inner corners")
    assert said.endswith("try --board 8x5")
    assert part_of_a_larger(paths, names, corners, whole) == ""


def test_pictures_of_nothing_are_not_taken_for_a_board(tmp_path):
    paths = [tmp_path / "a.png", tmp_path / "b.png"]
    for path in paths:
        cv2.imwrite(str(path), np.random.default_rng(1).integers(0, 255, (200, 300), dtype=np.uint8))
    with pytest.raises(CannotCalibrate, match="count the corners where four squares meet"):
        detect(paths, Board(8, 5, 0.02), **QUICK)
