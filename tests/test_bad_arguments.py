"""What a reader may well pass by mistake is answered in one sentence: what was expected, and what came."""

import re

import numpy as np
import pytest

from camviz import distortion
from camviz.cameras import Camera, Intrinsics, Rig, look_at
from camviz.draw.space import Label, grid_lines, scene_items
from camviz.scenes import textured_scene
from camviz.views.distortion import DistortionView
from camviz.widgets import explore
from camviz_clinic import plots
from camviz_clinic.calibration import Board, Detections, calibrate, detect, find_corners
from camviz_clinic.checks import inspect
from camviz_clinic.files.corners import load_corners
from camviz_school.views.zhang import board_pose, focal_lengths

CAMERA = Camera(Intrinsics.from_fov(64, 48, 60))
BOARD = Board(9, 6, 0.025)
GREY = np.zeros((100, 100), np.uint8)

MISTAKES = {
    "a camera that is not in the rig": (
        lambda: Rig({"left": CAMERA}).a_from_b("left", "right"),
        "camera must be one of left, got 'right'",
    ),
    "a place on a plane": (lambda: look_at((0, 0), (0, 0, 1)), "eye must have shape (3,), got (2,)"),
    "half a corner": (lambda: Board(9.5, 6, 0.025), "columns must be a whole number of points, at least 1, got 9.5"),
    "a third sagitta": (lambda: BOARD.warped((0, 0, 0)), "warp must have shape (2,), got (3,)"),
    "corners of one view": (
        lambda: Detections(("a.png",), [[1, 2]], 64, 48),
        "corners must have shape (1, corners, 2), as there are pictures, got (1, 2)",
    ),
    "one path": (lambda: detect("a.png", BOARD), "pictures must be a list of paths, got the one path 'a.png'"),
    "an unknown finder": (
        lambda: detect(["a.png"], BOARD, finder="new"),
        "finder must be one of auto, sectors, classic, saddles, got 'new'",
    ),
    "a picture of floats": (
        lambda: find_corners(GREY / 255, BOARD),
        "image must be uint8 (height, width) or (height, width, 3), got float64 (100, 100)",
    ),
    "one fixed word": (
        lambda: calibrate(Detections(("a.png",), np.zeros((1, 54, 2)), 64, 48), BOARD, fixed="k3"),
        "fixed must be a list of parameters, got the one word 'k3'",
    ),
    "half a centre": (lambda: focal_lengths([np.eye(3)], (320,)), "centre must have shape (2,), got (1,)"),
    "a matrix without inverse": (
        lambda: board_pose(np.eye(3), np.ones((3, 3))),
        "K must be a camera matrix, which has an inverse, got [[1.0, 1.0, 1.0], [1.0, 1.0, 1.0], [1.0, 1.0, 1.0]]",
    ),
    "a path to be inspected": (
        lambda: inspect("camera.yaml"),
        "calibration must be a Calibration, as `load` reads one, got str; `inspect_file` takes a path",
    ),
    "a step of nothing": (
        lambda: distortion.displacement(CAMERA, 0),
        "step_px must be a positive number of pixels, got 0",
    ),
    "every zeroth pixel": (
        lambda: distortion.valid_region(CAMERA, 0),
        "step_px must be at least 1 pixel, got 0",
    ),
    "a label at two points": (lambda: Label(np.zeros((2, 3)), "C"), "point must have shape (3,), got (2, 3)"),
    "lines without distance": (
        lambda: grid_lines((0, 0, 0), 1, 0),
        "step must be a positive number of metres, got 0",
    ),
    "an unknown renderer": (
        lambda: scene_items(textured_scene, "fine"),
        "renderer must be 'solid' or 'wire', got 'fine'",
    ),
    "no corner files": (lambda: load_corners([]), "paths: expected at least one file of corners, got none"),
    "pixels on a line": (
        lambda: plots.epipolar(CAMERA, CAMERA, (1, 2, 3)),
        "uv_left must have shape (..., 2), got (3,)",
    ),
    "a range of one number": (
        lambda: explore(DistortionView(), k1=0.5),
        "a range must be (low, high) or (low, high, step), got 0.5 for k1",
    ),
}


@pytest.mark.parametrize("mistake", MISTAKES)
def test_a_mistake_is_answered_in_one_sentence(mistake):
    call, sentence = MISTAKES[mistake]
    with pytest.raises((ValueError, KeyError), match=f"^[\"']?{re.escape(sentence)}[\"']?$"):
        call()


def test_mistakes_with_meshes_are_answered_in_one_sentence():
    pytest.importorskip("pyvista")
    from camviz_clinic import meshes

    with pytest.raises(ValueError, match=r"^positions must have shape \(\.\.\., 3\), got \(1, 2\)$"):
        meshes.points([[1, 2]])
    with pytest.raises(ValueError, match=r"^colours must be one for each of 1 positions, got 2$"):
        meshes.points(np.zeros((1, 3)), np.zeros((2, 3)))
    with pytest.raises(ValueError, match=r"^meshes must be at least one, got none$"):
        meshes.joined([])
    with pytest.raises(ValueError, match=r"^colour must be #rrggbb or one of blue, .*, got 'mauve'$"):
        meshes.camera(CAMERA, colour="mauve")
