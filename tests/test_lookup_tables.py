"""Lookup tables say what the camera does, to programs that know nothing of its lens."""

import cv2
import numpy as np
import pytest
from scipy.interpolate import RegularGridInterpolator

from camviz.cameras import Camera, Intrinsics
from camviz.distortion import remap, undistort_maps
from camviz.lenses import BrownConrady, DoubleSphere, KannalaBrandt
from camviz.poses import RigidTransform
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.commands.command import main
from camviz_clinic.files.lookup_tables import LookupTables, RayTable, table_error
from camviz_clinic.files.writing import write

CAMERA = Camera(Intrinsics(640, 480, 530.0, 532.0, 325.0, 236.0), BrownConrady(-0.28, 0.1, 1e-3, -5e-4, 0.01))
D = np.array([-0.28, 0.1, 1e-3, -5e-4, 0.01])
LENSES = {
    "Brown-Conrady": CAMERA,
    "fisheye": Camera(Intrinsics(320, 240, 110.0, 111.0, 160.0, 119.0), KannalaBrandt(0.01, -0.002, 3e-4, -4e-4)),
    "double sphere": Camera(Intrinsics(320, 240, 175.0, 175.0, 161.0, 119.0), DoubleSphere(-0.2, 0.6)),
}


@pytest.fixture
def converted(tmp_path):
    """What `convert --to lut` writes of a camera."""

    def run(camera, *options):
        write(Calibration({"camera": camera}, tmp_path, "virtual"), tmp_path / "in.yml", "opencv")
        status = main(["convert", str(tmp_path / "in.yml"), str(tmp_path / "out.npz"), "--to", "lut", *options])
        return status, tmp_path / "out.npz"

    return run


def test_the_maps_undistort_by_cv2_remap_as_opencv_and_camviz_do(converted):
    status, path = converted(CAMERA)
    assert status == 0
    held = np.load(path)
    width, height = held["target_size"]
    K = held["target_K"]
    theirs = cv2.initUndistortRectifyMap(CAMERA.intrinsics.K, D, None, K, (int(width), int(height)), cv2.CV_32FC1)
    target = Intrinsics.from_matrix(K, int(width), int(height))
    ours = undistort_maps(CAMERA, target)
    for axis, name in enumerate(("map_x", "map_y")):
        assert held[name].dtype == np.float32
        assert np.abs(held[name] - theirs[axis]).max() < 1e-3
        assert np.abs(held[name] - ours[axis]).max() < 1e-3
    # A picture that says where each of its pixels is, remapped, says where they came from.
    u, v = np.meshgrid(np.arange(640, dtype=np.float32), np.arange(480, dtype=np.float32))
    for picture, axis in ((u, 0), (v, 1)):
        seen = cv2.remap(picture, held["map_x"], held["map_y"], cv2.INTER_LINEAR)
        np.testing.assert_array_equal(seen, remap(picture, ours))
        assert np.abs(seen - theirs[axis])[2:-2, 2:-2].max() < 1 / 32  # the steps of cv2.remap's weights


@pytest.mark.parametrize("step", [4.0, 16.0])
def test_the_error_of_the_rays_is_that_of_brute_force(step):
    table = RayTable.of(CAMERA, step)
    said = table_error(CAMERA, table)
    assert max(np.diff(table.u).max(), np.diff(table.v).max()) <= step
    assert (table.u[0], table.u[-1], table.v[0], table.v[-1]) == (0, 639, 0, 479)
    read = RegularGridInterpolator((table.v, table.u), table.rays.astype(float))
    v, u = np.mgrid[0:480, 0:640]
    rays = read(np.stack([v.ravel(), u.ravel()], axis=1))
    seen = cv2.projectPoints(rays, np.zeros(3), np.zeros(3), CAMERA.intrinsics.K, D)[0][:, 0]
    error = np.hypot(*(seen - np.stack([u.ravel(), v.ravel()], axis=1)).T)
    assert said.median == pytest.approx(np.median(error), abs=2e-6)
    assert said.worst == pytest.approx(error.max(), abs=2e-6)
    assert error.reshape(480, 640)[said.worst_at[::-1]] == pytest.approx(error.max(), abs=2e-6)
    assert said.share == 1


def test_half_the_step_is_a_quarter_of_the_error():
    coarse, fine = (table_error(CAMERA, RayTable.of(CAMERA, step)).worst for step in (32, 16))
    assert coarse / fine == pytest.approx(4, rel=0.35)


@pytest.mark.parametrize("name", LENSES)
def test_every_lens_has_tables_and_its_rays_come_back_to_their_pixels(name):
    camera = LENSES[name]
    tables = LookupTables.of(camera, 4)
    assert tables.target.fx == tables.target.fy
    assert tables.error.share > 0.9
    assert tables.error.worst < 0.2
    uv = np.array([[10.3, 20.7], [camera.intrinsics.width / 2, 100.0], [camera.intrinsics.width - 1.0, 50.5]])
    rays = tables.table.at(uv)
    np.testing.assert_allclose(np.linalg.norm(rays, axis=-1), 1, rtol=1e-6)
    assert np.abs(camera.project(rays) - uv).max() <= tables.error.worst * 1.5


def test_pixels_without_a_ray_are_nan_and_the_share_says_how_many(converted, capsys):
    folded = Camera(CAMERA.intrinsics, BrownConrady(-0.5))
    status, path = converted(folded, "--alpha", "1")
    assert status == 0
    held = np.load(path)
    assert np.isnan(held["rays"]).any()
    assert 0.5 < held["ray_share"] < 1
    assert f"over {float(held['ray_share']):.0%} of the pixels" in capsys.readouterr().out
    assert np.isfinite(held["map_x"]).all()
    assert (held["map_x"] == -1).any()
    black = cv2.remap(np.full((480, 640), 255, np.uint8), held["map_x"], held["map_y"], cv2.INTER_LINEAR)
    assert not black[(held["map_x"] == -1) & (held["map_y"] == -1)].any()


def test_what_is_said_is_what_is_in_the_archive(converted, capsys):
    _, path = converted(CAMERA, "--step", "16")
    held, said = np.load(path), capsys.readouterr().out
    median, worst = held["ray_error_px"]
    u, v = held["ray_error_at"]
    assert f"{median:.2g} px off (median) and {worst:.2g} px at most, at ({u}, {v})" in said
    assert f"fx = {held['target_K'][0, 0]:.2f}" in said


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--to", "lut", "--step", "0"], "expected a grid step in pixels, from 1 to 1000"),
        (["--to", "ros", "--step", "8"], "--step belongs to --to lut"),
        (["--to", "lutt"], "did you mean lut?"),
    ],
)
def test_wrong_options_are_refused_in_one_sentence(tmp_path, capsys, options, said):
    write(Calibration({"camera": CAMERA}, tmp_path, "virtual"), tmp_path / "in.yml", "opencv")
    try:
        status = main(["convert", str(tmp_path / "in.yml"), str(tmp_path / "out.npz"), *options])
    except SystemExit as left:
        status = left.code
    assert status == 2
    assert said in capsys.readouterr().err
    assert not (tmp_path / "out.npz").exists()


def test_a_pair_must_choose_one_of_its_cameras(tmp_path, capsys):
    pair = {"left": CAMERA, "right": CAMERA.at(RigidTransform.from_translation([0.1, 0, 0]))}
    write(Calibration(pair, tmp_path, "virtual"), tmp_path / "in.yml", "opencv")
    words = ["convert", str(tmp_path / "in.yml"), str(tmp_path / "out.npz"), "--to", "lut"]
    assert main(words) == 2
    assert "choose one of left, right (--camera NAME)" in capsys.readouterr().err
    assert main([*words, "--camera", "right"]) == 0
