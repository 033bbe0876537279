"""A stranger's lens is one file: the one of docs/recipes.md, put into a copy of the package, appears everywhere."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
RECIPES = (ROOT / "docs/recipes.md").read_text(encoding="utf-8")

# r = sin(kθ)/k: orthographic at k = 1, equisolid at k = 1/2. It turns back at kθ = 90°.
SINE = re.search(r"\n## A lens\n.*?```python\n(.*?)```\n", RECIPES, flags=re.DOTALL)[1]


@pytest.fixture(scope="module")
def checkout(tmp_path_factory):
    """A folder whose camviz is this one's, file by file, but for one more file among the lenses."""
    root = tmp_path_factory.mktemp("checkout")
    ours, theirs = ROOT / "camviz", root / "camviz"
    theirs.mkdir()
    for path in ours.iterdir():
        if path.name not in ("lenses", "__pycache__"):
            (theirs / path.name).symlink_to(path)
    shutil.copytree(ours / "lenses", theirs / "lenses", ignore=shutil.ignore_patterns("__pycache__"))
    (theirs / "lenses" / "sine_fisheye.py").write_text(SINE, encoding="utf-8")
    for name in ("camviz_clinic", "camviz_school"):
        (root / name).symlink_to(ROOT / name)
    return root


def python(checkout, code):
    """What a fresh interpreter in that folder prints."""
    environment = os.environ | {"PYTHONPATH": str(checkout), "PYTHONDONTWRITEBYTECODE": "1", "PYTHONUTF8": "1"}
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=checkout, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_a_new_lens_is_one_file(checkout):
    def files(root):
        return {path.relative_to(root): path.read_bytes() for path in root.rglob("*.py")}

    before, after = files(ROOT / "camviz" / "lenses"), files(checkout / "camviz" / "lenses")
    assert {path for path in after if before.get(path) != after[path]} == {Path("sine_fisheye.py")}
    assert [path.name for path in (checkout / "camviz").iterdir() if not path.is_symlink()] == ["lenses"]


@pytest.mark.thorough
def test_it_obeys_the_laws_of_all_lenses(checkout):
    """The contract tests find its examples, valid and invalid."""
    said = python(
        checkout,
        "import camviz.lenses, pytest; assert 'SineFisheye' in camviz.lenses.__all__\n"
        f"raise SystemExit(pytest.main(['-v', '-p', 'no:cacheprovider', '-k', 'sine or SineFisheye or every_lens', "
        f"{str(ROOT / 'tests/test_lenses.py')!r}]))",
    )
    assert " passed" in said
    assert int(said.split(" passed")[0].split()[-1]) > 40


def test_formats_write_it_under_the_names_it_declares_and_read_it_back(checkout):
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
    lines = python(checkout, code).splitlines()
    assert lines[:4] == ["SineFisheye(k=0.6)"] * 4
    assert "Kalibr has no SineFisheye lens" in lines[4].replace("Kalibr camchain", "Kalibr")
    assert '"sine"' in (checkout / "a.json").read_text()
    assert "SINE 640 480" in (checkout / "model" / "cameras.txt").read_text()


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
    said = python(checkout, code)
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
    *models, k, fx, cy = python(checkout, code).split()
    assert "sine" in models
    assert (float(k), float(fx), float(cy)) == (0.7, 250.0, 236.0)


def test_the_help_of_camviz_calibrate_lists_it(checkout):
    said = python(
        checkout, "import sys; from camviz_clinic.commands.command import main; main(['calibrate', '--help'])"
    )
    assert "  sine        k of r = sin(kθ)/k\n" in said
