"""A calibration with all that was recorded of it comes back from its file as it was, and OpenCV can read it too."""

from pathlib import Path

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, KannalaBrandt, UnifiedSphere
from camviz_clinic.files import Board, Calibration, load, write

GRID = Intrinsics(640, 480, 533.25, 534.125, 342.5, 233.0)
LENSES = {
    "standard": BrownConrady(-0.28, 0.05, 0.001, -0.002, 0.1),
    "rational": BrownConrady(0.3, 0.05, 0.001, -0.002, 0.1, 0.5, 0.2, 0.01),
    "thin-prism": BrownConrady(-0.28, 0.05, 0.001, -0.002, 0.1, s1=0.01, s3=-0.01),
    "fisheye": KannalaBrandt(0.01, -0.002, 0.001, 0.0005),
    "omni": UnifiedSphere(1.2, -0.1, 0.02, 0.001, 0.002),
}
NAMES = ("fx", "fy", "cx", "cy", "k1", "s1", "tau_x")

words = st.text(st.characters(exclude_categories=("Cs", "Cc")), max_size=20) | st.sampled_from(
    [
        "left01.jpg",
        "001",
        "true",
        "null",
        "~",
        "it's",
        'a"b\\c',
        "a: b #c",
        "- x",
        "x\ny",
        "<a>&b",
        "50 %",
        "100%25",
        "",
    ]
)
numbers = st.floats(-1e6, 1e6, allow_subnormal=False)


@st.composite
def calibrations(draw):
    names = draw(st.sampled_from([["camera"], ["left", "right"]]))
    views, board = draw(st.integers(1, 3)), Board(3, 2, draw(st.floats(0.001, 10)))
    if draw(st.booleans()):
        board = Board(3, 2, board.square_size, board.square_size / 2, "DICT_4X4_50")
    lens = LENSES[draw(st.sampled_from(sorted(LENSES)))]
    place = RigidTransform.from_components([0.1, 0.02, -0.003], Rotation.from_rotvec([0.01, -0.2, 0.03]))
    cameras = {name: Camera(GRID, lens).at(place if name == "right" else place.identity()) for name in names}
    corners = {name: draw(arrays(float, (views, 6, 2), elements=numbers)) for name in names}
    for each in corners.values():
        each[0, draw(st.integers(0, 5))] = np.nan
    estimated = tuple(draw(st.lists(st.sampled_from(NAMES), min_size=1, unique=True)))
    poses = {
        name: RigidTransform.from_components(
            draw(arrays(float, (views, 3), elements=numbers)),
            Rotation.from_rotvec(draw(arrays(float, (views, 3), elements=st.floats(-1.5, 1.5)))),
        )
        for name in names
    }
    return Calibration(
        cameras,
        Path("x"),
        "camviz",
        board,
        detections=corners,
        cam_from_board=poses,
        per_view_errors={name: draw(arrays(float, views, elements=st.floats(0, 100))) for name in names},
        notes=tuple(draw(st.lists(words, max_size=2))),
        pictures={name: tuple(draw(st.lists(words, min_size=views, max_size=views))) for name in names},
        set_aside={name: draw(arrays(bool, (views, 6))) for name in names},
        estimated=dict.fromkeys(names, estimated),
        intrinsics_covariance={
            name: draw(arrays(float, (len(estimated), len(estimated)), elements=numbers)) for name in names
        },
        board_warp=draw(st.none() | arrays(float, 2, elements=st.floats(-0.01, 0.01))),
        board_warp_covariance=draw(st.none() | arrays(float, (2, 2), elements=st.floats(0, 1))),
        skipped=tuple(draw(st.lists(st.tuples(words, words), max_size=2))),
    )


@given(calibrations(), st.sampled_from([".yaml", ".xml", ".json"]))
def test_nothing_of_a_calibration_is_lost_in_its_file(tmp_path_factory, calibration, ending):
    path = tmp_path_factory.mktemp("file") / f"camera{ending}"
    assert write(calibration, path, "opencv") == ()
    back = load(path)
    assert back.board == calibration.board
    assert back.skipped == calibration.skipped
    assert back.notes == calibration.notes
    assert back.pictures == calibration.pictures
    assert back.estimated == calibration.estimated
    for field in ("detections", "per_view_errors", "set_aside", "intrinsics_covariance"):
        first, second = getattr(calibration, field), getattr(back, field)
        assert first.keys() == second.keys()
        for name, values in first.items():
            assert second[name].dtype == values.dtype
            np.testing.assert_array_equal(second[name], values)
    for name, poses in calibration.cam_from_board.items():
        np.testing.assert_allclose(back.cam_from_board[name].as_matrix(), poses.as_matrix(), rtol=1e-14, atol=1e-14)
        assert back.cameras[name].lens == calibration.cameras[name].lens
        assert back.cameras[name].intrinsics == calibration.cameras[name].intrinsics
    np.testing.assert_array_equal(back.board_warp, calibration.board_warp)
    np.testing.assert_array_equal(back.board_warp_covariance, calibration.board_warp_covariance)
