"""Solid pictures agree with the camera, hide what is hidden, and never take the process down."""

import signal
import subprocess
import sys
import threading

import cv2
import numpy as np
import pytest

from camviz.draw import opengl, solid
from camviz.draw.backdrop import Backdrops
from camviz.draw.items import Dots, Face, Line, TexturedMesh
from camviz.draw.opengl import opengl_works, why_not_solid
from camviz.draw.space import OrbitCamera, chosen_renderer, draw_space, space_panel
from camviz.draw.wire import Viewport
from camviz.draw.writing import PageWriter

EYE = OrbitCamera(target=(0, 0.2, 3), distance=6)
PANEL = space_panel("space", 0, 0, 480, 360)
SQUARE = np.array([(-1, -1, 3), (1, -1, 3), (1, 1, 3), (-1, 1, 3)], float)

works, reason = opengl_works()
needs_opengl = pytest.mark.skipif(not works, reason=reason)


def shot_of(items, eye=EYE, scale=1.0):
    """A solid picture, taken where all are taken."""
    viewport = Viewport(eye.camera(480, 360), eye.distance)
    return solid._stage().submit(solid._shoot, viewport, items, scale).result()


@needs_opengl
@pytest.mark.parametrize("scale", [1.0, 1.5, 2.0])
@pytest.mark.parametrize("eye", [EYE, OrbitCamera((0, 0, 3), 4, 50, -30, 60)])
def test_both_renderers_put_a_point_at_the_same_pixel(eye, scale):
    """The centroid of a disc parallel to the picture is where the camera projects its middle."""
    middle = np.array([0.6, -0.4, 2.6])
    turn = np.linspace(0, 2 * np.pi, 48, endpoint=False)[:, None]
    right, down = 0.2 * eye.camera(480, 360).world_from_cam.rotation.as_matrix().T[:2]
    alpha = shot_of([Face(middle + np.cos(turn) * right + np.sin(turn) * down)], eye, scale).alpha
    v, u = np.nonzero(alpha)
    centroid = (np.array([u.mean(), v.mean()]) + 0.5) / scale - 0.5
    assert np.linalg.norm(centroid - eye.camera(480, 360).project(middle)) < 0.1


def pyvista_alpha(faces, eye, width, height):
    """The alpha of a picture by PyVista's own plotter, its camera set from the yaw, pitch and distance of the eye."""
    import pyvista as pv

    plotter = pv.Plotter(off_screen=True, notebook=False, window_size=[width, height], theme=pv.themes.Theme())
    plotter.disable_anti_aliasing()  # as here: with it, what is half covered would count
    for face in faces:
        plotter.add_mesh(pv.PolyData(face.vertices, faces=[len(face.vertices), *range(len(face.vertices))]))
    yaw, pitch = np.radians([eye.yaw_deg, eye.pitch_deg])
    outward = np.array([-np.sin(yaw) * np.cos(pitch), -np.sin(pitch), -np.cos(yaw) * np.cos(pitch)])
    plotter.camera_position = [eye.target + eye.distance * outward, eye.target, (0, -1, 0)]
    plotter.camera.view_angle = eye.vfov_deg
    alpha = plotter.screenshot(None, transparent_background=True, return_img=True)[..., 3]
    plotter.close()
    return np.array(alpha)


@needs_opengl
@pytest.mark.parametrize(
    "eye", [EYE, OrbitCamera((0, 0, 3), 5, 50, -30, 60), OrbitCamera((0.5, 0, 3), 5, -120, 60, 50)]
)
def test_pyvista_covers_the_same_pixels(eye, monkeypatch):
    """Intersection over union of both silhouettes above 0.999: five faces without symmetry, from three sides."""
    monkeypatch.setenv("VTK_DEFAULT_OPENGL_WINDOW", reason)
    corners = np.random.default_rng(5).uniform(-1, 1, (4, 3, 3)) + (0, 0, 3)
    faces = [Face(SQUARE), *map(Face, corners)]
    ours = shot_of(faces, eye).alpha > 127
    theirs = solid._stage().submit(pyvista_alpha, faces, eye, 480, 360).result() > 127
    assert 5000 < theirs.sum() < 150000
    assert (ours & theirs).sum() / (ours | theirs).sum() > 0.999


@needs_opengl
def test_the_depth_of_a_surface_is_its_distance_along_the_cameras_axis():
    eye = OrbitCamera((0, 0, 3), 6, 0, 0)
    shot = shot_of([Face(SQUARE), Face(SQUARE * (5, 5, 3), "red")], eye)
    assert shot.depth(np.array([(240, 180), (400, 180)])) == pytest.approx([6, 12], rel=1e-3)
    nowhere = np.array([(5, 5), (-1, 180), (240, 360), (np.nan, np.nan)])
    assert (shot_of([Face(SQUARE)], eye).depth(nowhere) == np.inf).all()


@needs_opengl
def test_scenery_that_stays_is_drawn_once_and_looks_as_if_it_were_drawn_anew(monkeypatch):
    """A see-through face that moves before, behind and through a sheet, seen from two places in turns."""
    scenery = (
        TexturedMesh(SQUARE, np.array([[0, 1, 2, 3]]), SQUARE[:, :2] / 2 + 0.5, np.full((1, 1, 3), 200, np.uint8)),
    )
    eyes = [OrbitCamera((0, 0, 3), 5, 30, 20, 60), OrbitCamera((0, 0, 3), 6, -40, 10, 60)]
    moved = [Face(0.5 * SQUARE + (x, 0.1, 1.5), "blue", 0.5) for x in (-0.4, 0.0, 0.5, 0.9)]
    kept = []
    monkeypatch.setattr(Backdrops, "keep", lambda self, key, keep=Backdrops.keep: (kept.append(key), keep(self, key)))
    viewports = [Viewport(eye.camera(480, 360), eye.distance) for eye in eyes]
    ours, anew = (
        [
            solid._stage().submit(solid._shoot, viewport, items(face), 1, stays).result()
            for face in moved
            for viewport in viewports
        ]
        for items, stays in ((lambda face: [face], scenery), (lambda face: [face, *scenery], ()))
    )
    for one, other in zip(ours, anew, strict=True):
        assert (one.alpha > 0).sum() > 5_000
        assert (one.alpha == other.alpha).mean() > 0.999
        assert (np.abs(one.rgb.astype(int) - other.rgb) <= 2).mean() > 0.999
        assert (one.buffer == other.buffer).mean() > 0.999
    assert len(kept) == len(set(kept)) == 2


@needs_opengl
def test_scenery_that_is_no_opaque_sheet_is_drawn_too():
    eye, line = OrbitCamera((0, 0, 3), 6, 0, 0), Line([(-0.5, 0.1, 2), (0.5, 0.1, 2)], "line")
    glass = TexturedMesh(
        SQUARE, np.array([[0, 1, 2, 3]]), SQUARE[:, :2], np.full((1, 1, 3), 200, np.uint8), opacity=0.5
    )
    as_scenery = draw_space(PANEL, [], eye, renderer="solid", scenery=(line, glass, Face(SQUARE + (0, 0, 1))))
    as_items = draw_space(PANEL, [line, glass, Face(SQUARE + (0, 0, 1))], eye, renderer="solid")
    written = [(PageWriter().write(marks), attached) for marks, attached in (as_scenery, as_items)]
    assert written[0] == written[1]
    assert as_scenery[0].of("line")


@needs_opengl
def test_lines_behind_a_surface_are_faint_and_lines_before_it_are_not():
    eye = OrbitCamera((0, 0, 3), 6, 0, 0)
    lines = [Line([(-0.5, 0.1, z), (0.5, 0.1, z)], f"line{z}") for z in (2, 5)]
    marks, _ = draw_space(PANEL, [Face(SQUARE), *lines], eye, renderer="solid")
    opacity = {z: marks.of(f"line{z}")[0].style["stroke_opacity"] for z in (2, 5)}
    assert opacity[5] < 0.2 < 0.5 < opacity[2]
    assert draw_space(PANEL, [Face(SQUARE), Dots((0, 0, 5))], eye, renderer="solid")[0].of("faint")


@needs_opengl
def test_the_outline_of_a_surface_is_not_hidden_by_it():
    outline = Line(np.vstack([SQUARE, SQUARE[:1]]), "blue")
    for eye in (EYE, EYE.orbited(60, 50), EYE.orbited(-90, -30)):
        marks, _ = draw_space(PANEL, [Face(SQUARE), outline], eye, renderer="solid")
        assert min(mark.style["stroke_opacity"] for mark in marks.of("blue")) > 0.16


@needs_opengl
def test_only_what_is_solid_covers_the_background():
    shot = shot_of([Face(SQUARE, "#ff8040"), Face(SQUARE + (3, 0, 0), "#ff8040", 0.5)], OrbitCamera((0, 0, 3), 6, 0, 0))
    assert shot.alpha[180, 240] == 255
    assert shot.alpha[5, 5] == 0
    u, v = OrbitCamera((0, 0, 3), 6, 0, 0).camera(480, 360).project((2.3, 0, 3)).astype(int)
    assert shot.alpha[v, u] == pytest.approx(128, abs=2)
    np.testing.assert_allclose(shot.rgb[v, u], shot.rgb[180, 240], atol=6)


@needs_opengl
def test_a_picture_keeps_its_colours_and_stands_upright():
    colours = np.array([[(200, 30, 30), (30, 200, 30)], [(30, 30, 200), (200, 200, 30)]], np.uint8)
    picture = np.repeat(np.repeat(colours, 64, 0), 64, 1)
    eye = OrbitCamera((0, 0, 3), 6, 0, 0)
    rgb = shot_of([TexturedMesh.over(SQUARE[[0, 1, 3, 2]].reshape(2, 2, 3), picture)], eye).rgb
    for i, y in enumerate((-0.5, 0.5)):
        for j, x in enumerate((-0.5, 0.5)):
            u, v = eye.camera(480, 360).project((x, y, 3)).round().astype(int)
            np.testing.assert_allclose(rgb[v, u], colours[i, j], atol=2)


@needs_opengl
def test_a_new_picture_replaces_the_old_one():
    eye = OrbitCamera((0, 0, 3), 6, 0, 0)
    for grey in (40, 200, 90):
        sheet = TexturedMesh.over(SQUARE[[0, 1, 3, 2]].reshape(2, 2, 3), np.full((8, 8, 3), grey, np.uint8))
        np.testing.assert_allclose(shot_of([sheet], eye).rgb[180, 240], grey, atol=2)
    assert shot_of([], eye).alpha.max() == 0


@needs_opengl
def test_pictures_asked_for_from_many_threads_are_all_right():
    """An OpenGL context belongs to one thread; a notebook's messages arrive on several."""
    seen = {}

    def take(side):
        panel = space_panel(f"p{side}", 0, 0, side, side)
        seen[side] = draw_space(panel, [Face(SQUARE)], EYE, renderer="solid", draft=True)[1][f"p{side}-solid"]

    threads = [threading.Thread(target=take, args=(side,)) for side in (100, 140, 180, 220)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for side, data in seen.items():
        pixels = round(solid.DRAFT * side)
        assert cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_COLOR).shape == (pixels, pixels, 3)


@needs_opengl
def test_a_draft_is_coarser_than_the_finished_picture():
    sizes = []
    for draft in (True, False):
        _, photographs = draw_space(PANEL, [Face(SQUARE)], EYE, renderer="solid", draft=draft)
        sizes.append(cv2.imdecode(np.frombuffer(photographs["space-solid"], np.uint8), cv2.IMREAD_COLOR).shape[1])
    assert sizes == [480 * solid.DRAFT, 480 * solid.FINE]


@needs_opengl
def test_a_process_that_drew_solid_pictures_ends_well():
    code = (
        "import numpy as np; from camviz.draw.space import *; from camviz.draw.space import space_panel;"
        "print(list(draw_space(space_panel('a', 0, 0, 48, 36), [Face(np.eye(3))], OrbitCamera(), renderer='solid')[1]))"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (run.returncode, run.stdout.strip(), run.stderr) == (0, "['a-solid', 'a-mask']", "")


def test_wireframes_can_be_asked_for(monkeypatch):
    monkeypatch.setenv("CAMVIZ_RENDERER", "wire")
    assert chosen_renderer() == "wire"
    assert "CAMVIZ_RENDERER" in why_not_solid()


def test_pyvista_is_not_wanted_where_wireframes_are_and_vtk_stays_out(monkeypatch):
    code = (
        "import sys; from camviz.draw.opengl import why_not_pyvista; print(why_not_pyvista());"
        "print('vtkmodules' in sys.modules, 'pyvista' in sys.modules)"
    )
    monkeypatch.setenv("CAMVIZ_RENDERER", "wire")
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "CAMVIZ_RENDERER=wire" in run.stdout
    assert run.stdout.endswith("False False\n")


def test_without_pyvista_its_absence_is_the_reason(monkeypatch):
    monkeypatch.setattr(opengl, "find_spec", lambda name: None)
    assert "pip install pyvista" in opengl.why_not_pyvista()


@needs_opengl
def test_a_pyvista_plotter_draws_and_says_nothing_on_stderr():
    pytest.importorskip("pyvista")
    code = (
        "import numpy as np; from camviz.draw.opengl import pyvista_plotter; plotter = pyvista_plotter();"
        "plotter.add_lines(np.eye(3), color='black', connected=True); print(np.ptp(plotter.screenshot()) > 100)"
    )
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert (run.returncode, run.stdout.strip(), run.stderr) == (0, "True", "")


def test_a_crash_while_asking_for_opengl_is_survived_and_named(monkeypatch):
    crash = f"import os; os.kill(os.getpid(), {int(signal.SIGSEGV)})"
    run = subprocess.run
    monkeypatch.setattr(opengl.subprocess, "run", lambda command, **how: run([*command[:2], crash], **how))
    monkeypatch.setattr(opengl, "_windows", lambda: ["vtkEGLRenderWindow"])
    works, reason = opengl.opengl_works.__wrapped__()
    assert not works
    assert "SIGSEGV" in reason
    assert "libegl1" in reason


def test_without_vtk_pictures_are_wireframes(monkeypatch):
    monkeypatch.setattr(opengl, "find_spec", lambda name: None)
    works, reason = opengl.opengl_works.__wrapped__()
    assert not works
    assert "pip install" in reason


@needs_opengl
def test_what_is_too_slow_to_drag_is_dragged_as_a_wireframe(monkeypatch):
    monkeypatch.delenv("CAMVIZ_RENDERER", raising=False)
    shot_of([])
    studio = solid._stage().submit(solid._studio).result()
    monkeypatch.setattr(studio, "pace", [0.2] * 5)
    assert (chosen_renderer(draft=True), chosen_renderer(draft=False)) == ("wire", "solid")
    monkeypatch.setattr(studio, "pace", [0.2, 0.2, 0.004, 0.2, 0.2])
    assert chosen_renderer(draft=True) == "solid"
