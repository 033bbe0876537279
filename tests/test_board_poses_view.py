"""The view of a calibration's poses says where the camera stood, and puts the corners where OpenCV does."""

import os
from pathlib import Path

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Camera, Intrinsics
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


@pytest.fixture
def view():
    return BoardPosesView(CAMERA, POSES)


def test_the_camera_stood_where_minus_r_transposed_t_says(view):
    for (rvec, t), centre in zip(PUBLISHED.reshape(-1, 2, 3), view.centres, strict=True):
        np.testing.assert_allclose(centre, -cv2.Rodrigues(rvec)[0].T @ t, atol=1e-12)


@pytest.mark.parametrize("picture", [1, 2, 3])
def test_the_corners_are_put_where_opencv_projects_them(view, picture):
    rvec, t = PUBLISHED[picture - 1].reshape(2, 3)
    coefficients = np.array([-0.266, -0.0386, 0.0018, -0.0003])
    there = cv2.projectPoints(view.board.corners, rvec, t, CAMERA.intrinsics.K, coefficients)[0].reshape(-1, 2)
    np.testing.assert_allclose(view.but(picture=picture).pixels(), there, atol=1e-9)


def test_the_published_poses_put_the_corners_where_the_photographs_have_them():
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


def test_the_numbers_are_the_distance_and_the_angle_to_the_board(view):
    """A camera 0.5 m before the middle of the board, turned by 20° about y."""
    turned = Rotation.from_euler("y", 20, degrees=True)
    board_from_cam = RigidTransform.from_components([0.1, 0.0625, -0.5], turned)
    numbers = BoardPosesView(CAMERA, RigidTransform.concatenate([board_from_cam.inv()])).numbers()
    assert numbers["distance"] == pytest.approx(0.5, abs=1e-12)
    assert numbers["tilt_deg"] == pytest.approx(20, abs=1e-9)


def test_the_description_states_where_the_camera_stood(view):
    text = view.but(picture=3).description()
    assert "Picture 3: t = (−0.066, −0.081, 0.278) m" in text
    assert "C = (−0.050, 0.021, −0.292) m" in text


def test_every_control_changes_the_picture_and_a_picture_beyond_the_last_is_the_last(view):
    pictures = [view.but(picture=n).figure(draft=True).svg() for n in (1, 2, 3)]
    assert len({*pictures, view.but(still="camera").figure(draft=True).svg()}) == 4
    assert view.but(picture=13).figure(draft=True).svg() == pictures[2]


def test_the_pose_is_the_same_whatever_stands_still(view):
    assert view.but(still="camera").pixels() == pytest.approx(view.pixels(), abs=0)


def test_dragging_and_arrow_keys_walk_around(view):
    assert view.dragged("eye", 0, 0, 50, 0).eye.yaw_deg == pytest.approx(view.eye.yaw_deg + 20)
    assert view.pressed("eye", "ArrowUp").eye.pitch_deg != view.eye.pitch_deg
    assert view.pressed("eye", "+").eye.distance < view.eye.distance


def test_poses_and_photographs_have_to_be_as_many():
    with pytest.raises(ValueError, match="one pose per picture"):
        BoardPosesView(CAMERA, RigidTransform.identity())
    with pytest.raises(ValueError, match="as many as the 3 poses, got 1"):
        BoardPosesView(CAMERA, POSES, photographs=(np.zeros((480, 640, 3), np.uint8),))


# The reader's own centres --------------------------------------------------------------------------------------------


def test_the_readers_centres_are_dots_and_their_largest_error_is_told(view):
    right = view.but(yours=lambda R, t: -R.T @ t)
    np.testing.assert_allclose(right.your_centres[0], view.centres, atol=1e-12)
    assert "wrong by up to 0.00 m" in right.figure(draft=True).body
    wrong = view.but(yours=lambda R, t: t)
    away = np.linalg.norm(PUBLISHED[:, 3:] - view.centres, axis=-1).max()
    assert f"wrong by up to {away:.2f} m" in wrong.figure(draft=True).body
    assert "wrong by" not in wrong.but(still="camera").figure(draft=True).body
    assert "wrong by" not in view.figure(draft=True).body


def test_a_function_that_is_not_written_has_its_place_and_one_that_fails_says_why(view):
    waiting = view.but(yours=lambda R, t: None).figure(draft=True).body
    assert "yours appears here" in waiting
    assert 'class="awaited"' in waiting
    failing = view.but(yours=lambda R, t: np.eye(3)).figure(draft=True).body
    assert "answers in shape" in failing
    assert "nan" not in failing
