"""Meshes for PyVista: their points lie where cameras, boards and scenes are, in the colours that these have."""

import numpy as np
import pytest
from calibrations import BOARD, TRUE, bare, pair, poses, sick, single
from test_repository import python

from camviz.cameras import Camera, Intrinsics, look_at, transform
from camviz.scenes import textured_scene, to_display
from camviz_clinic import meshes
from camviz_clinic.views.observations import Missing, Observations

pyvista = pytest.importorskip("pyvista")


@pytest.mark.parametrize(
    ("module", "library"), [("camviz_clinic.plots", "matplotlib"), ("camviz_clinic.meshes", "pyvista")]
)
def test_a_neighbour_is_not_imported_before_it_is_used(module, library):
    assert python(f"import sys, {module}; print('{library}' in sys.modules)").strip() == "False"


def test_the_rim_of_a_camera_is_where_its_picture_ends():
    camera = TRUE.at(look_at([1, 0, 0], [0, 0, 2]))
    mesh = meshes.camera(camera, depth=0.5)
    on_lines = np.unique(np.delete(mesh.lines.reshape(-1, 3), 0, axis=1))
    uv = camera.project(mesh.points[on_lines].astype(float))
    uv = uv[np.linalg.norm(mesh.points[on_lines] - camera.centre, axis=-1) > 0.1]  # all but the centre
    distance = np.minimum(np.abs(uv - (-0.5, -0.5)), np.abs(uv - (639.5, 479.5))).min(axis=-1)
    assert len(uv) > 60
    np.testing.assert_allclose(distance, 0, atol=0.01)
    assert set(mesh.point_data["rgba"][:, 3].tolist()) == {255, 26, 230}  # lines, sides and the mark above


def test_a_camera_whose_lens_folds_before_the_border_is_drawn_as_far_as_it_sees():
    folded = Camera(TRUE.intrinsics, type(TRUE.lens)(k1=-0.9))
    assert np.isfinite(meshes.camera(folded).points).all()


def test_the_corners_of_a_board_are_corners_of_two_black_and_two_white_squares():
    pose = poses(1)[0]
    mesh = meshes.board(BOARD, pose)
    assert mesh.n_cells == (BOARD.columns + 1) * (BOARD.rows + 1)
    for corner in transform(pose, BOARD.corners):
        at = np.linalg.norm(mesh.points - corner, axis=-1) < 1e-5
        assert sorted((mesh.point_data["rgba"][at, 0] > 128).tolist()) == [False, False, True, True]
    first = np.linalg.norm(mesh.points - transform(pose, [-0.025, -0.025, 0]), axis=-1).argmin()
    assert mesh.point_data["rgba"][first, 0] < 128  # as `find_corners` counts, from a black square


def test_boards_and_rig_are_named_and_stand_in_the_world():
    both = meshes.boards(pair(), "right")
    assert both.keys() == [f"view {i}" for i in range(1, 9)]
    expected = transform(pair().cam_from_board["left"][2], BOARD.corners[0])
    assert np.linalg.norm(both["view 3"].points - expected, axis=-1).min() < 2e-3  # the two solutions' difference
    assert meshes.rig(pair()).keys() == ["left", "right"]
    with pytest.raises(ValueError, match="must hold a board and its poses before camera"):
        meshes.boards(bare())


def test_a_scene_has_the_colours_that_a_ray_meets_there():
    scene = textured_scene()
    blocks = meshes.scene(scene, detail=200)
    (name,) = [key for key in blocks.keys() if key.endswith(" picture")]  # noqa: SIM118 - a MultiBlock yields its blocks
    points = blocks[name].points.astype(float)
    eye = points.mean(axis=0) - (0, 0, 1.5)
    rays = points - eye
    light, depth = scene.trace(eye, rays / np.linalg.norm(rays, axis=-1, keepdims=True))
    there = np.abs(depth - np.linalg.norm(rays, axis=-1)) < 1e-3
    off = np.abs(to_display(light).astype(int) - blocks[name].point_data["rgba"][:, :3])[there]
    assert there.mean() > 0.97
    assert np.median(off) <= 4
    assert np.quantile(off, 0.9) < 40  # between neighbouring texels


def test_a_repeated_texture_goes_on_and_a_single_one_ends_at_its_border():
    picture = np.arange(4, dtype=np.uint8).reshape(2, 2, 1).repeat(3, axis=2)
    uv = np.array([(0, 1), (1, 1), (1, 0), (0, 0), (1.25, 0.75), (2.75, -0.75)])
    assert meshes._sampled(picture, uv)[:, 0].tolist() == [0, 1, 3, 2, 0, 3]


def test_a_residual_of_its_own_length_ends_on_the_ray_of_the_detected_corner():
    calibration = sick()
    mesh, seen = meshes.residuals(calibration, scale=1), Observations.of(calibration)
    ends = mesh.points.reshape(-1, 2, 3).astype(float)
    assert len(ends) == seen.used.sum()
    np.testing.assert_allclose(calibration.cameras["camera"].project(ends[:, 1]), seen.detections[seen.used], atol=0.01)
    np.testing.assert_allclose(mesh.point_data["pixels"][::2], seen.lengths[seen.used])
    longer = meshes.residuals(calibration, scale=10).points.reshape(-1, 2, 3)
    np.testing.assert_allclose(np.diff(longer, axis=1), 10 * np.diff(ends, axis=1), atol=1e-5)
    with pytest.raises(Missing):
        meshes.residuals(bare())


def test_points_keep_their_colours():
    colours = np.array([(1, 2, 3), (250, 251, 252)], np.uint8)
    np.testing.assert_array_equal(meshes.points(np.eye(3)[:2], colours).point_data["rgba"][:, :3], colours)


def test_a_saved_mesh_comes_back_with_its_surfaces_and_colours(tmp_path):
    whole = meshes.joined([meshes.board(BOARD), meshes.camera(Camera(Intrinsics.from_fov(64, 48, 60)))])
    whole.save(tmp_path / "whole.ply", texture="rgba")
    back = pyvista.read(tmp_path / "whole.ply")
    faces = meshes.board(BOARD).n_cells + 5  # four sides and the mark above
    assert back.n_cells >= faces
    np.testing.assert_allclose(back.bounds, whole.bounds, atol=1e-6)
    assert {"RGB", "RGBA"} & set(back.point_data)


def test_any_plotter_shows_meshes_and_blocks():
    from camviz.draw.opengl import pyvista_plotter, why_not_pyvista

    if why_not_pyvista():
        pytest.skip(why_not_pyvista())
    plotter = pyvista_plotter()
    plotter.window_size = (64, 48)
    for mesh in (meshes.camera(TRUE), meshes.rig(pair()), meshes.boards(single()), meshes.residuals(single())):
        plotter.add_mesh(mesh, rgb=True)
    assert np.ptp(plotter.screenshot()) > 50
    plotter.close()
