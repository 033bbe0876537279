"""The view of a calibration's poses says where the camera stood, and puts the corners where OpenCV does."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from every_view import written
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Camera, Intrinsics
from camviz.draw.marks import Discs
from camviz.lenses import BrownConrady
from camviz_clinic.files import load
from camviz_clinic.views.board_poses import BoardPosesView

# The first, second and ninth row of extrinsic_parameters in OpenCV's samples/data/left_intrinsics.yml (4.6.0).
PUBLISHED = np.array(
    [
        [0.1687, 0.2757, 0.0135, -0.0752, -0.1090, 0.3997],
        [0.4133, 0.6499, -1.3372, -0.0586, 0.0829, 0.3538],
        [0.2030, -0.4239, 0.1324, -0.0663, -0.0810, 0.2783],
    ]
)
POSES = RigidTransform.from_components(PUBLISHED[:, 3:], Rotation.from_rotvec(PUBLISHED[:, :3]))
CAMERA = Camera(
    Intrinsics(640, 480, 535.916, 535.916, 342.283, 235.571), BrownConrady(-0.266, -0.0386, 0.0018, -0.0003)
)


@pytest.mark.parametrize("picture", [1, 2, 3])
def test_corners_are_drawn_where_opencv_projects_them(picture):
    """And the camera stands at C = -Rᵀ t, whatever stands still."""
    view = BoardPosesView(CAMERA, POSES, picture=picture)
    rvec, t = PUBLISHED[picture - 1].reshape(2, 3)
    np.testing.assert_allclose(view.centres[picture - 1], -cv2.Rodrigues(rvec)[0].T @ t, atol=1e-12)
    coefficients = np.array([-0.266, -0.0386, 0.0018, -0.0003])
    there = cv2.projectPoints(view.board.corners, rvec, t, CAMERA.intrinsics.K, coefficients)[0].reshape(-1, 2)
    for still in ("board", "camera"):
        panel = view.but(still=still).figure(draft=True).marks.panels()["picture"]
        places = (there + 0.5) * (panel.width / 640, panel.height / 480)
        np.testing.assert_allclose(panel.marks.points("red"), places, atol=1e-6)


def test_the_published_poses_agree_with_the_photographs():
    """Within a pixel RMS for every photograph in which OpenCV's finder sees the board, in either order of corners."""
    folder = Path(os.environ.get("CAMVIZ_SAMPLES", "")) / "opencv-samples"
    if not (folder / "left_intrinsics.yml").is_file():
        pytest.skip("CAMVIZ_SAMPLES names no folder with the sample data")
    calibration = load(folder / "left_intrinsics.yml")
    ((name, camera),) = calibration.cameras.items()
    view = BoardPosesView(camera, calibration.cam_from_board[name], calibration.board)
    for number, path in enumerate(sorted(folder.glob("left??.jpg")), start=1):
        found, uv = cv2.findChessboardCornersSB(cv2.imread(str(path), cv2.IMREAD_GRAYSCALE), (9, 6))
        if found:
            errors = [uv.reshape(-1, 2)[::step] - view.but(picture=number).pixels() for step in (1, -1)]
            assert min(np.sqrt((e**2).sum(-1).mean()) for e in errors) < 1, path.name


def test_the_numbers_are_the_distance_and_angle_to_the_board():
    """A camera 0.5 m before the middle of the board, turned by 20° about y."""
    turned = Rotation.from_euler("y", 20, degrees=True)
    board_from_cam = RigidTransform.from_components([0.1, 0.0625, -0.5], turned)
    numbers = BoardPosesView(CAMERA, RigidTransform.concatenate([board_from_cam.inv()])).numbers()
    assert numbers["distance"] == pytest.approx(0.5, abs=1e-12)
    assert numbers["tilt_deg"] == pytest.approx(20, abs=1e-9)


def test_poses_and_photographs_have_to_be_as_many():
    with pytest.raises(ValueError, match="one pose per picture"):
        BoardPosesView(CAMERA, RigidTransform.identity())
    with pytest.raises(ValueError, match="as many as the 3 poses, got 1"):
        BoardPosesView(CAMERA, POSES, photographs=(np.zeros((480, 640, 3), np.uint8),))
    assert BoardPosesView(CAMERA, POSES, picture=13).index == 2


def test_the_readers_centres_are_drawn_and_their_largest_error():
    view = BoardPosesView(CAMERA, POSES)
    away = np.linalg.norm(PUBLISHED[:, 3:] - view.centres, axis=-1).max()
    for function, error in ((lambda R, t: -R.T @ t, 0.0), (lambda R, t: t, away)):
        picture = view.but(yours=function).figure(draft=True)
        assert f"wrong by up to {error:.2f} m" in written(picture)
        dots = [mark for mark in picture.marks.of("orange") if isinstance(mark, Discs) and mark.diameter > 10]
        assert sum(len(mark.points) for mark in dots) == 3
        assert "wrong by" not in written(view.but(yours=function, still="camera").figure(draft=True))
    assert view.but(yours=lambda R, t: None).figure(draft=True).marks.of("awaited")
    failing = written(view.but(yours=lambda R, t: np.eye(3)).figure(draft=True))
    assert "answers in shape" in failing
    assert "nan" not in failing
