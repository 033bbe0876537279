"""A stranger's lens is one file and its rows: those of docs/recipes.md, put into a copy, appear everywhere."""

import pytest
from house import examples, house

# r = sin(kθ)/k: orthographic at k = 1, equisolid at k = 1/2. It turns back at kθ = 90°.
SINE = examples("A lens")
ROWS = {
    "tests/lens_examples.py",
    "camviz_clinic/files/parameter_layouts.py",
    "camviz_clinic/calibration/camera_models.py",
}


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A copy of the repository with the lens and its rows."""
    made = house(tmp_path_factory.mktemp("checkout") / "camviz")
    made.add(SINE)
    return made


def test_a_new_lens_is_one_file_and_rows_in_tables(checkout):
    assert checkout.touched() == {"camviz/lenses/sine_fisheye.py", *ROWS}
    for path in ROWS:
        before, after = checkout.before[path].decode().splitlines(), checkout.text(path).splitlines()
        assert len(after) - len(before) == SINE[path].count("\n+")
        assert set(before) <= set(after)


@pytest.mark.thorough
def test_it_obeys_the_laws_of_all_lenses(checkout):
    """The contract tests try its examples, valid and invalid."""
    words = "sine or SineFisheye or every_lens"
    said = checkout.run(
        "-m", "pytest", "-v", "-o", "addopts=", "-p", "no:cacheprovider", "-k", words, "tests/test_lenses.py"
    )
    assert " passed" in said
    assert int(said.split(" passed")[0].split()[-1]) > 40


def test_formats_write_it_as_its_rows_say_and_read_it_back(checkout):
    code = """
from pathlib import Path
from camviz_clinic import load
from camviz_clinic.calibration import Calibration
from camviz.cameras import Camera, Intrinsics
from camviz_clinic.files import write
from camviz.lenses import SineFisheye
from camviz.poses import RigidTransform
camera = Camera(Intrinsics(640, 480, 200.0, 200.0, 320.0, 241.0), SineFisheye(0.6))
made = Calibration({"cam0": camera}, Path(), "here", world_from_imu=RigidTransform.identity())
for form, name in (("basalt", "a.json"), ("mrcal", "a.cameramodel"), ("colmap", "model"), ("colmap-bin", "binary")):
    write(made, name, form)
    print(*(camera.lens for camera in load(name).cameras.values()))
try:
    write(made, "a.yaml", "kalibr")
except ValueError as error:
    print(error)
"""
    lines = checkout.run("-c", code).splitlines()
    assert lines[:4] == ["SineFisheye(k=0.6)"] * 4
    assert "Kalibr has no SineFisheye lens" in lines[4].replace("Kalibr camchain", "Kalibr")
    assert '"sine"' in checkout.text("a.json")
    assert "SINE 640 480" in checkout.text("model/cameras.txt")


def test_the_clinic_sees_where_it_folds(checkout):
    """At k = 0.9 it turns back at 100°, 1.11 focal lengths from the middle; the picture's corners are at 1.6."""
    code = """
from pathlib import Path
from camviz_clinic.calibration import Calibration
from camviz.cameras import Camera, Intrinsics
from camviz_clinic.checks.findings.lens import fold
from camviz_clinic.checks.evidence import Evidence
from camviz.lenses import SineFisheye
camera = Camera(Intrinsics(640, 480, 250.0, 250.0, 319.5, 239.5), SineFisheye(0.9))
for finding in fold.check(Evidence(Calibration({"camera": camera}, Path(), "here"))):
    print(finding.id, finding.sentence)
"""
    said = checkout.run("-c", code)
    assert said.startswith("fold camera: ")
    assert "The distortion turns back 100.0° from the axis, which is 1.11 focal lengths" in said


@pytest.mark.thorough
def test_it_can_be_calibrated_with_no_solver_of_opencvs(checkout):
    """From six exact views of a board, the camera that saw them."""
    code = """
import numpy as np
from camviz_clinic.calibration import MODELS, Board, Detections, calibrate
from camviz_clinic.calibration.problem import moved
from camviz.cameras import Camera, Intrinsics
from camviz.lenses import SineFisheye
from camviz.poses import RigidTransform, Rotation
truth = Camera(Intrinsics(640, 480, 250.0, 252.0, 325.0, 236.0), SineFisheye(0.7))
board = Board(8, 6, 0.03)
turns = Rotation.from_rotvec([[0.4, 0, 0], [-0.4, 0.2, 0], [0, 0.5, 0.1], [0.1, -0.5, 0], [0.3, 0.3, 0.5], [0, 0, 0]])
places = [[-0.1, -0.1, 0.2], [-0.2, 0, 0.2], [0, -0.1, 0.2], [-0.1, 0, 0.25], [-0.3, -0.1, 0.15], [0.05, 0, 0.2]]
corners = truth.project(moved(RigidTransform.from_components(places, turns), board.corners))
found = calibrate(Detections(tuple("abcdef"), corners, 640, 480), board, "sine").cameras["camera"]
print(*MODELS, f"{found.lens.k:.4f} {found.intrinsics.fx:.2f} {found.intrinsics.cy:.2f}")
"""
    *models, k, fx, cy = checkout.run("-c", code).split()
    assert "sine" in models
    assert (float(k), float(fx), float(cy)) == (0.7, 250.0, 236.0)


def test_the_help_of_camviz_calibrate_lists_it(checkout):
    said = checkout.run("-m", "camviz", "calibrate", "--help")
    assert "  sine        k of r = sin(kθ)/k\n" in said
