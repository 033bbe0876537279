"""`camviz undistort`: the mapping against OpenCV and pycolmap, the border's mask, and a folder written whole or not."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from commandline import main, refused

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, DoubleSphere, KannalaBrandt, Perspective
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.datasets.undistortion import Undistortion
from camviz_clinic.files import load
from camviz_clinic.files.writing import write

GRID = Intrinsics(640, 480, 530, 532, 325, 236)
BARREL = Camera(GRID, BrownConrady(-0.28, 0.1, 1e-3, -5e-4))
FISHEYE = Camera(Intrinsics(640, 480, 230, 231, 331, 229), KannalaBrandt(-0.02, 0.01, -0.001, 0.0002))
ALPHAS = (0, 0.4, 1)


def off(maps, others):
    """The largest distance of two mappings in pixels, where both lead into the photograph."""
    inside = [np.isfinite(each) & (each > -50) & (each < 700) for each in (*maps, *others)]
    return np.hypot(maps[0] - others[0], maps[1] - others[1])[np.all(inside, axis=0)].max()


@pytest.mark.parametrize("alpha", ALPHAS)
def test_the_mapping_is_opencvs_to_a_hundredth_of_a_pixel(alpha):
    flat = Undistortion.of(BARREL, alpha)
    lens = np.array([-0.28, 0.1, 1e-3, -5e-4])
    theirs = cv2.initUndistortRectifyMap(GRID.K, lens, None, flat.target.K, (640, 480), cv2.CV_32FC1)
    assert off(flat.maps, theirs) < 0.01
    wide = Undistortion.of(FISHEYE, alpha)
    lens = np.array([-0.02, 0.01, -0.001, 0.0002])
    theirs = cv2.fisheye.initUndistortRectifyMap(
        FISHEYE.intrinsics.K, lens, np.eye(3), wide.target.K, (640, 480), cv2.CV_32FC1
    )
    assert off(wide.maps, theirs) < 0.01


def test_pixels_are_square_and_k_is_opencvs_along_one_axis():
    """OpenCV fits the picture along each axis: without borders the larger f is kept, with every pixel the smaller."""
    for alpha, chosen, stretch in ((0, max, 0.05), (1, min, 0.001)):
        K, _ = cv2.getOptimalNewCameraMatrix(GRID.K, np.array([-0.28, 0.1, 1e-3, -5e-4]), (640, 480), alpha)
        target = Undistortion.of(BARREL, alpha).target
        assert abs(K[0, 0] / K[1, 1] - 1) > stretch
        assert target.fx == target.fy == pytest.approx(chosen(K[0, 0], K[1, 1]), rel=5e-3)
        ends = [(0.0 - K[:2, 2]) / np.diag(K)[:2], ([639, 479] - K[:2, 2]) / np.diag(K)[:2]]
        middle = target.fx * np.mean(ends, axis=0) + [target.cx, target.cy]
        assert middle == pytest.approx([319.5, 239.5], abs=1.5)


def pycolmaps(camera, model, lens):
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap, the oracle of this test, is not installed")
    grid = camera.intrinsics
    params = [grid.fx, grid.fy, grid.cx + 0.5, grid.cy + 0.5, *lens]
    return pycolmap.Camera(model=model, width=640, height=480, params=params)


CASES = [
    pytest.param(BARREL, "OPENCV", [-0.28, 0.1, 1e-3, -5e-4], id="plain"),
    pytest.param(FISHEYE, "OPENCV_FISHEYE", [-0.02, 0.01, -0.001, 0.0002], id="fisheye"),
]


@pytest.mark.parametrize(("camera", "model", "lens"), CASES)
@pytest.mark.parametrize("alpha", ALPHAS)
def test_the_mapping_is_pycolmaps_whose_first_pixel_is_at_a_half(camera, model, lens, alpha):
    theirs, flat = pycolmaps(camera, model, lens), Undistortion.of(camera, alpha)
    uv = flat.target.grid()[::9, ::9]
    rays = Perspective().unproject(flat.target.from_pixels(uv))
    seen = np.reshape(theirs.img_from_cam(rays.reshape(-1, 3)), uv.shape) - 0.5
    assert off([each[::9, ::9] for each in flat.maps], np.moveaxis(seen, -1, 0)) < 0.01


@pytest.mark.parametrize(("camera", "model", "lens"), CASES)
def test_a_picture_is_pycolmaps_undistorted_picture_of_the_same_k(camera, model, lens):
    """Slopes reach 13 grey levels a pixel: two levels are 0.15 px, the mean of 0.6 is what 8 bits leave."""
    theirs = pycolmaps(camera, model, lens)
    import pycolmap

    u, v = np.meshgrid(np.arange(640), np.arange(480))
    photograph = np.rint(127 + 60 * np.sin(u / 5) + 60 * np.sin(v / 5)).astype(np.uint8)
    image, flat = pycolmap.undistort_image(
        pycolmap.UndistortCameraOptions(), pycolmap.Bitmap.from_array(photograph), theirs
    )
    fx, fy, cx, cy = flat.params
    ours = Undistortion(camera, Intrinsics(flat.width, flat.height, fx, fy, cx - 0.5, cy - 0.5))
    seen = cv2.erode(ours.mask, np.ones((5, 5))) > 0
    differ = np.abs(ours.picture(photograph).astype(float) - np.squeeze(image.to_array()))[seen]
    assert seen.mean() > 0.5
    assert differ.max() <= 2
    assert differ.mean() < 0.6


def test_the_interpolation_itself_is_true_to_a_hundredth_of_a_pixel():
    """A ramp along u, of 90 grey levels (16 bits) a pixel, shows at each pixel where it was read."""
    ramp = np.tile(np.arange(640, dtype=np.uint16) * 90, (480, 1))
    flat = Undistortion.of(BARREL, 0)
    read, inner = flat.picture(ramp) / 90.0, np.s_[1:-1, 1:-1]
    assert np.abs(read - flat.maps[0])[inner].max() < (0.01 if int(cv2.__version__[0]) >= 5 else 0.02)


@pytest.mark.parametrize("camera", [FISHEYE, replace(FISHEYE, lens=DoubleSphere(-0.1, 0.55))], ids=["kb", "ds"])
def test_a_fisheye_keeps_its_principal_point_in_square_pixels(camera):
    grid = camera.intrinsics
    for alpha in ALPHAS:
        target = Undistortion.of(camera, alpha).target
        assert (target.cx, target.cy) == (grid.cx, grid.cy)
        assert target.fx == target.fy
    assert Undistortion.of(camera, 0).masked == 0
    focal = [Undistortion.of(camera, alpha).target.fx for alpha in ALPHAS]
    assert focal == sorted(focal, reverse=True)
    aside = replace(camera, intrinsics=replace(grid, cx=-3.0))
    with pytest.raises(ValueError, match=r"must lie inside the picture|not in the picture|sees none"):
        Undistortion.of(aside, 0)


def test_with_alpha_one_every_pixel_of_a_fisheye_within_80_degrees_is_shown():
    flat = Undistortion.of(FISHEYE, 1)
    rays = FISHEYE.lens.unproject(FISHEYE.intrinsics.from_pixels(FISHEYE.intrinsics.border(64)))
    rays = rays[rays[:, 2] > np.cos(np.radians(79)) * np.linalg.norm(rays, axis=1)]
    assert len(rays) > 50
    assert flat.target.contains(flat.pinhole.project(rays)).all()


def test_the_mask_is_where_a_white_photograph_stays_white():
    for camera in (BARREL, FISHEYE):
        for alpha in ALPHAS:
            flat = Undistortion.of(camera, alpha)
            white = flat.picture(np.full((480, 640), 255, np.uint8))
            assert ((flat.mask == 255) <= (white >= 252)).all()
            assert ((white == 255) <= (flat.mask == 255)).all()
    assert Undistortion.of(BARREL, 0).masked == 0
    assert 0.05 < Undistortion.of(BARREL, 1).masked < 0.3


def test_maps_that_are_made_in_parts_have_no_seam(monkeypatch):
    whole = Undistortion.of(BARREL, 0.5).maps
    monkeypatch.setattr("camviz_clinic.datasets.undistortion.ROWS", 7)
    assert np.array_equal(whole, Undistortion.of(BARREL, 0.5).maps)


def test_a_line_of_the_world_is_straight_in_the_written_picture():
    """The barrel bends it by 8 px; the edge in the undistorted picture is off a line by what pixels round."""
    points = np.column_stack([np.linspace(-0.5, 0.5, 200), np.full(200, -0.35), np.ones(200)])
    photograph = np.zeros((480, 640), np.uint8)
    rays = BARREL.rays()
    photograph[(rays[..., 1] / rays[..., 2]) > -0.35] = 255
    flat, columns = Undistortion.of(BARREL, 0), np.arange(60, 580)
    edges = 479.5 - (flat.picture(photograph)[:, columns] / 255.0).sum(axis=0)
    assert np.ptp(np.interp(columns, *BARREL.project(points).T)) > 8
    true = flat.target.fy * -0.35 + flat.target.cy
    assert np.abs(edges - true).max() < 0.8
    assert edges.mean() == pytest.approx(true, abs=0.1)


# The command ---------------------------------------------------------------------------------------------------------


@pytest.fixture
def shots(room):
    """A calibration and three photographs, two of which have a blank in their name or 16 bits."""
    (room / "photos").mkdir()
    u, _ = np.meshgrid(np.arange(640), np.arange(480))
    cv2.imwrite("photos/a.png", (u % 256).astype(np.uint8))
    cv2.imwrite("photos/b 1.jpg", np.dstack([u % 256] * 3).astype(np.uint8))
    cv2.imwrite("photos/deep.png", (u * 90).astype(np.uint16))
    write(Calibration({"camera": BARREL}, room, "virtual"), room / "camera.yaml", "opencv")
    return ("undistort", "camera.yaml", "photos")


def test_a_folder_is_written_with_the_pinhole_that_its_pictures_are_of(shots, room, capsys):
    assert main((*shots, "-o", "flat", "--alpha", "1")) == 0
    said = capsys.readouterr().out
    assert "flat: 3 pictures written, with camera.yaml and mask.png." in said
    flat = Undistortion.of(BARREL, 1)
    assert f"fx = {flat.target.fx:.2f}" in said
    assert f"{flat.masked:.1%} of a picture shows nothing" in said
    assert sorted(each.name for each in (room / "flat/images").iterdir()) == ["a.png", "b_1.jpg", "deep.png"]
    camera = load(room / "flat/camera.yaml").cameras["camera"]
    assert pytest.approx(flat.target.K, abs=1e-9) == camera.intrinsics.K
    assert camera.project([0.3, 0.2, 1]) == pytest.approx(flat.pinhole.project([0.3, 0.2, 1]), abs=1e-9)
    deep = cv2.imread("flat/images/deep.png", cv2.IMREAD_UNCHANGED)
    assert deep.dtype == np.uint16
    assert np.array_equal(cv2.imread("flat/mask.png", cv2.IMREAD_UNCHANGED), flat.mask)
    assert np.array_equal(deep, flat.picture(cv2.imread("photos/deep.png", cv2.IMREAD_UNCHANGED)))


def test_what_cannot_be_undistorted_is_named_and_left_out(shots, room, capsys):
    (room / "photos/bad.jpg").write_bytes(b"\xff\xd8\xff")
    cv2.imwrite("photos/turned.png", np.zeros((640, 480), np.uint8))
    assert main((*shots, "-o", "flat")) == 0
    said = capsys.readouterr().out
    assert "bad.jpg: skipped, " in said
    assert "turned.png: skipped, it has 480×640 pixels, the camera 640×480, as if it were turned." in said
    assert "flat: 3 pictures written" in said
    assert len(list((room / "flat/images").iterdir())) == 3


def test_bad_input_is_one_sentence_and_leaves_nothing_behind(shots, room, capsys):
    (room / "other").mkdir()
    (room / "empty").mkdir()
    cv2.imwrite("other/a.png", np.zeros((10, 12), np.uint8))
    assert "a new folder, or of an empty one" in refused(capsys, room, *shots, "-o", "photos")
    assert "there is no directory" in refused(capsys, room, *shots, "-o", "none/flat")
    assert "a folder is written, which stdout cannot hold" in refused(capsys, room, *shots, "-o", "-")
    assert "would both be written as a.png" in refused(capsys, room, *shots, "other/a.png", "-o", "flat")
    assert "none of the pictures can be used: it has 12×10" in refused(capsys, room, *shots[:2], "other", "-o", "flat")
    assert "there are no pictures in this folder" in refused(capsys, room, *shots[:2], "empty", "-o", "flat")
    assert "there is no such file" in refused(capsys, room, "undistort", "none.yaml", "photos", "-o", "flat")
    assert "from 0 to 1" in refused(capsys, room, *shots, "-o", "flat", "--alpha", "1.01")
    assert "expected --camera to be one of camera" in refused(capsys, room, *shots, "-o", "flat", "--camera", "left")
    assert main((*shots, "-o", "empty")) == 0
