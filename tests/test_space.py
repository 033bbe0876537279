"""Drawings in space show every point where the onlooker's camera has it."""

import subprocess
import sys
from itertools import product

import cv2
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Camera, Intrinsics, look_at
from camviz.draw.items import Dots, Face, Label, Line, TexturedMesh, axes_triad, camera_body, grid_lines
from camviz.draw.space import OrbitCamera, chosen_renderer, draw_space, scene_items, space_panel
from camviz.draw.writing import PageWriter
from camviz.lenses import BrownConrady, KannalaBrandt
from camviz.scenes import textured_scene

PANEL = space_panel("space", 10, 30, 480, 360)
EYE = OrbitCamera(target=(0, 0.2, 3), distance=6)


def wire(items, eye=EYE, panel=PANEL):
    return draw_space(panel, items, eye, renderer="wire")


def pixels(eye, points, width=480, height=360):
    """Where OpenCV has world points (n, 3) in the eye's picture, in picture units."""
    camera = eye.camera(width, height)
    R, t = camera.cam_from_world.rotation.as_matrix(), camera.cam_from_world.translation
    uv, _ = cv2.projectPoints(np.asarray(points, float), cv2.Rodrigues(R)[0], t, camera.intrinsics.K, None)
    return uv.reshape(-1, 2) + 0.5


def test_the_eye_looks_at_its_target_from_its_distance():
    for yaw, pitch in product((-170, -30, 0, 90), (-85, 0, 40)):
        eye = OrbitCamera((1, 2, 3), 5, yaw, pitch)
        camera = eye.camera(480, 360)
        assert np.linalg.norm(camera.centre - (1, 2, 3)) == pytest.approx(5)
        np.testing.assert_allclose(camera.project((1, 2, 3)), (239.5, 179.5), atol=1e-9)


def test_at_yaw_and_pitch_0_the_eye_looks_as_an_identity_camera_does():
    pose = OrbitCamera((0, 0, 5), 5, 0, 0).camera(480, 360).world_from_cam
    np.testing.assert_allclose(pose.as_matrix(), np.eye(4), atol=1e-12)


def test_pitch_raises_the_eye_above_its_target():
    assert OrbitCamera(pitch_deg=30).camera(480, 360).centre[1] < 0  # y points down


def test_the_vertical_field_of_view_spans_the_picture():
    eye = OrbitCamera((0, 0, 0), 2, 0, 0, vfov_deg=90)
    np.testing.assert_allclose(pixels(eye, [(0, -2, 0), (0, 2, 0)])[:, 1], [0, 360], atol=1e-9)


def test_what_is_near_follows_the_pointer():
    near = np.array([(0, 0.2, 1.0)])  # in front of the target
    eye = OrbitCamera((0, 0.2, 3), 6, 0, 10)
    before = pixels(eye, near)[0]
    assert pixels(eye.orbited(20, 0), near)[0][0] > before[0]
    assert pixels(eye.orbited(0, 20), near)[0][1] > before[1]


def test_the_eye_never_tips_over():
    eye = OrbitCamera().orbited(0, 1e5)
    assert eye.pitch_deg == 85
    assert -180 <= OrbitCamera().orbited(1e5, 0).yaw_deg < 180


def test_keys_turn_and_approach():
    assert OrbitCamera().key("ArrowRight") == OrbitCamera().orbited(12.5, 0)
    assert OrbitCamera().key("+").distance < OrbitCamera().distance < OrbitCamera().key("-").distance
    assert OrbitCamera().key("q") == OrbitCamera()
    assert OrbitCamera().zoomed(3).zoomed(-3).distance == pytest.approx(OrbitCamera().distance)


@pytest.mark.parametrize(
    ("field", "value"), [("distance", 0), ("distance", float("nan")), ("vfov_deg", 180), ("pitch_deg", 90)]
)
def test_an_eye_that_cannot_see_is_refused_by_name(field, value):
    with pytest.raises(ValueError, match=field):
        OrbitCamera(**{field: value})


def test_lines_end_where_opencv_projects_their_ends():
    points = np.array([(-1, 0.5, 2), (1, -0.5, 4), (0.3, 1, 3)])
    drawn = wire([Line(points, "blue")])[0].points("blue")
    for expected in pixels(EYE, points):
        assert np.linalg.norm(drawn - expected, axis=1).min() < 0.1


def test_a_line_through_the_eye_is_cut_in_front_of_it():
    behind = EYE.camera(480, 360).world_from_cam.apply([(0.5, 0.2, -3), (0.5, 0.2, 8)])
    drawn = wire([Line(behind, "blue")])[0].points("blue")
    assert len(drawn) >= 2
    expected = pixels(EYE, behind[1:])[0]
    assert np.linalg.norm(drawn - expected, axis=1).min() < 0.1
    assert (np.abs(drawn - (240, 180)) < (300, 230)).all()


def test_what_lies_outside_the_picture_costs_nothing():
    assert wire([Line([(50, 0, 3), (50, 1, 3)], "blue")])[0].points("blue").size == 0


def test_nan_interrupts_a_line():
    points = np.array([(-1, 0, 3), (0, 0, 3), (np.nan,) * 3, (0.5, 0, 3), (1, 0, 3)])
    marks, _ = wire([Line(points, "blue")])
    drawn = marks.points("blue")
    gap = pixels(EYE, [(0, 0, 3), (0.5, 0, 3)])[:, 0]
    assert not ((drawn[:, 0] > gap[0] + 0.1) & (drawn[:, 0] < gap[1] - 0.1)).any()
    assert sum((~segments.continues).sum() for segments in marks) == 2


def test_nearer_lines_are_stronger():
    marks, _ = wire([Line([(-1, 0, z), (1, 0, z)], f"line{z}") for z in (0, 9)], OrbitCamera((0, 0.2, 3), 6, 0, 10))
    width = {mark.class_: mark.style["stroke_width"] for mark in marks}
    assert width["line0"] > width["line9"]


def test_near_things_are_painted_over_far_ones():
    square = np.array([(-1, -1, 0), (1, -1, 0), (1, 1, 0), (-1, 1, 0)])
    faces, _ = wire([Face(square + (0, 0, z), colour) for z, colour in ((1, "red"), (5, "blue"), (3, "green"))])
    assert [mark.class_ for mark in faces] == ["fill-blue", "fill-green", "fill-red"]
    between, _ = wire([Line([(-1, 0, 4), (1, 0, 4)], "ink"), *(Face(square + (0, 0, z), "red") for z in (2, 6))])
    assert [mark.class_ for mark in between] == ["fill-red", "ink", "fill-red"]


def test_a_face_that_reaches_behind_the_eye_is_cut():
    floor = np.array([(-9, 1, -30), (9, 1, -30), (9, 1, 30), (-9, 1, 30)])
    assert len(wire([Face(floor)])[0].points("fill-blue")) == 4


def test_dots_and_labels_stand_at_their_points():
    (dots, label), _ = wire([Dots([(0.5, 0.5, 3)], "red"), Label((0.5, 0.5, 3), "here")])
    expected = pixels(EYE, [(0.5, 0.5, 3)])[0]
    np.testing.assert_allclose(dots.points[0], expected, atol=1e-6)
    assert (label.words, label.x) == ("here", pytest.approx(expected[0]))


def test_a_picture_in_space_is_seen_in_exact_perspective():
    """Each quarter of a flat picture appears where OpenCV projects it."""
    colours = np.array([[(255, 0, 0), (0, 255, 0)], [(0, 0, 255), (255, 255, 0)]], np.uint8)
    picture = np.repeat(np.repeat(colours, 60, 0), 80, 1)
    corners = np.array([[(-1, -0.5, 2), (1, -0.5, 4)], [(-1, 1, 2), (1, 1, 4)]], float)
    (image,), photographs = wire([TexturedMesh.over(corners, picture)])
    x, y, width, height = image.x, image.y, image.width, image.height
    seen = cv2.imdecode(np.frombuffer(photographs["space-0"], np.uint8), cv2.IMREAD_UNCHANGED)
    scale = seen.shape[1] / width
    assert seen.shape[0] / height == pytest.approx(scale)
    for i, j in product((0, 1), (0, 1)):
        s, r = 0.25 + 0.5 * j, 0.25 + 0.5 * i
        middle = np.einsum("i,j,ijk", [1 - r, r], [1 - s, s], corners)
        u, v = ((pixels(EYE, [middle])[0] - (x, y)) * scale).astype(int)
        np.testing.assert_array_equal(seen[v, u], [*colours[i, j, ::-1], 255])


def test_the_triad_points_along_the_frames_axes():
    pose = RigidTransform.from_components([1, 2, 3], Rotation.from_euler("YXZ", [0.3, -0.2, 0.5]))
    arrows = [item for item in axes_triad(pose, 0.5) if isinstance(item, Line)]
    for axis, arrow in zip(pose.rotation.as_matrix().T, arrows, strict=True):
        np.testing.assert_allclose(arrow.points, [[1, 2, 3], (1, 2, 3) + 0.5 * axis], atol=1e-12)
        assert arrow.head
    assert [item.words for item in axes_triad(pose, 0.5) if isinstance(item, Label)] == ["x", "y", "z"]


@pytest.mark.parametrize(
    "camera",
    [
        Camera(Intrinsics(640, 480, 500, 450, 300, 260), world_from_cam=look_at((1, -1, 0), (0, 0, 4))),
        Camera(Intrinsics.from_fov(640, 480, 80), BrownConrady(k1=-0.25, k2=0.06)),
        Camera(Intrinsics(600, 600, 190, 190, 299.5, 299.5), KannalaBrandt(0, 0, 0, 0)),
    ],
)
def test_a_cameras_rim_is_what_its_image_border_sees(camera):
    rim = next(item.points for item in camera_body(camera, 1.5) if isinstance(item, Line))
    border = camera.intrinsics.border(16)
    np.testing.assert_allclose(camera.project(rim[:-1]), border, atol=1e-6)


def test_a_pinholes_rim_is_flat_and_a_distorting_lens_bends_it():
    intrinsics = Intrinsics.from_fov(640, 480, 80)
    flat = camera_body(Camera(intrinsics), 1.5)[0].points
    np.testing.assert_allclose(flat[:, 2], 1.5, atol=1e-12)
    np.testing.assert_allclose(flat[:17, 1], flat[0, 1], atol=1e-12)
    bent = camera_body(Camera(intrinsics, BrownConrady(k1=-0.25, k2=0.06)), 1.5)[0].points
    assert np.ptp(bent[:17, 1]) > 0.05


def test_the_up_marker_is_on_the_cameras_upper_side():
    camera = Camera(Intrinsics.from_fov(64, 48, 60), world_from_cam=look_at((1, -1, 0), (0, 0, 4)))
    marker = camera_body(camera, 1)[-1].vertices
    above = camera.cam_from_world.apply(marker)[:, 1]
    assert above.max() < camera.cam_from_world.apply(camera_body(camera, 1)[0].points)[:, 1].min() + 1e-9


def test_ground_lines_lie_in_their_plane_and_are_evenly_spaced():
    (line,) = grid_lines((1, 0.5, 2), 2, 0.5)
    points = line.points[np.isfinite(line.points).all(axis=1)]
    assert (points[:, 1] == 0.5).all()
    np.testing.assert_allclose(np.unique(points[:, 0]), np.arange(-1, 3.01, 0.5))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: Line(np.zeros((2, 2))), "points"),
        (lambda: Face(np.zeros((3, 3)), opacity=2), "opacity"),
        (lambda: TexturedMesh.over(np.zeros((1, 2, 3)), np.zeros((4, 4, 3), np.uint8)), "points"),
        (lambda: TexturedMesh.over(np.zeros((2, 2, 3)), np.zeros((4, 4, 3))), "picture"),
    ],
)
def test_things_that_cannot_be_drawn_are_refused_by_name(make, words):
    with pytest.raises(ValueError, match=words):
        make()


def test_an_unknown_renderer_is_refused(monkeypatch):
    with pytest.raises(ValueError, match="'solid' or 'wire'"):
        draw_space(PANEL, [], EYE, renderer="povray")
    monkeypatch.setenv("CAMVIZ_RENDERER", "povray")
    with pytest.raises(ValueError, match="povray"):
        chosen_renderer()


def test_the_standard_scene_as_wireframe_is_small():
    marks, photographs = wire(scene_items(textured_scene, "wire"))
    assert 5_000 < len(PageWriter().write(marks)) < 40_000
    assert not photographs


def test_a_wireframe_needs_neither_vtk_nor_pyvista():
    code = (
        "import sys; from camviz.draw.space import *; from camviz.draw.space import space_panel;"
        "draw_space(space_panel('a', 0, 0, 48, 36), [], OrbitCamera(), renderer='wire');"
        "print([m for m in sys.modules if m.startswith(('vtk', 'pyvista', 'matplotlib', 'ipywidgets'))])"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"
