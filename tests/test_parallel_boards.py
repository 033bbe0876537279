"""Boards that are all parallel leave the focal length open: no camera is written from them."""

from types import SimpleNamespace

import numpy as np
import pytest
from commandline import main, refused

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.types import Board
from camviz_clinic.checks import kinds
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.findings import boards
from camviz_clinic.checks.findings.boards import PARALLEL_DEG, SAME_WAY_DEG, UNCERTAIN, leave_focal_length_open
from camviz_clinic.checks.virtual import single
from camviz_clinic.files import load

BOARD = Board(9, 6, 0.025)
CAMERA = Camera(Intrinsics(1280, 720, 640, 640, 640, 360), BrownConrady(-0.1, 0.01))
WORDS = ("--board", "9x6", "--square-mm", "25", "--size", "1280x720", "-o", "camera.yaml")


def turned(kind, tilt_deg, rng, views):
    """Rotations of the boards: alike, spun about the optical axis, or tilted and then spun."""
    spin = Rotation.from_rotvec(rng.uniform(0, 2 * np.pi, (views, 1)) * [0, 0, 1])
    tilt = Rotation.from_rotvec([np.radians(tilt_deg), 0, 0])
    shake = Rotation.from_rotvec(rng.normal(0, 0.5, (views, 3)), degrees=True)
    return {"alike": tilt * shake, "spun on the spot": tilt * spin, "tilted to all sides": spin * tilt}[kind]


def corners_csv(path, kind, tilt_deg, views=10):
    """A file of corners with 0.1 px of noise."""
    rng = np.random.default_rng(4)
    lines = ["image,row,column,u,v"]
    for view, turn in enumerate(turned(kind, tilt_deg, rng, views)):
        seen = np.full((1, 2), -9.0)
        while not CAMERA.intrinsics.contains(seen).all():
            middle = rng.uniform(0.25, 0.6) * np.array([*rng.uniform(-0.6, 0.6, 2), 1])
            pose = RigidTransform.from_components(middle - turn.apply(BOARD.corners.mean(axis=0)), turn)
            seen = CAMERA.project(pose.apply(BOARD.corners))
        seen = seen + rng.normal(0, 0.1, seen.shape)
        lines += [f"{view}.png,{i // 9},{i % 9},{u:.4f},{v:.4f}" for i, (u, v) in enumerate(seen)]
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


@pytest.mark.parametrize(
    ("kind", "tilt_deg"), [("alike", 0), ("alike", 40), ("spun on the spot", 0), ("spun on the spot", 30)]
)
def test_parallel_boards_give_no_camera(room, capsys, kind, tilt_deg):
    corners_csv(room / "corners.csv", kind, tilt_deg)
    said = refused(capsys, room, "calibrate", "--corners", "corners.csv", *WORDS)
    assert "camera: all 10 boards are parallel within " in said
    assert "do not determine the focal length" in said
    assert "tilted by 30° to 45°" in said


def test_boards_tilted_to_all_sides_give_a_camera(room, capsys):
    corners_csv(room / "corners.csv", "tilted to all sides", 25)
    assert main(("calibrate", "--corners", "corners.csv", *WORDS)) == 0
    assert load(room / "camera.yaml").cameras["camera"].intrinsics.fx == pytest.approx(640, rel=0.01)


def test_two_views_give_no_camera(room, capsys):
    corners_csv(room / "corners.csv", "tilted to all sides", 30, views=2)
    assert "at least 3 views" in refused(capsys, room, "calibrate", "--corners", "corners.csv", *WORDS)


@pytest.mark.parametrize(
    ("open_names", "uncertain", "below_deg"),
    [(("fx", "fy"), 0.001, SAME_WAY_DEG), (("k3",), 1.01 * UNCERTAIN, PARALLEL_DEG), (("k3",), 0.99 * UNCERTAIN, 0)],
)
@pytest.mark.parametrize("off_deg", [-0.01, 0.01])
def test_boards_are_parallel_below_an_angle(monkeypatch, off_deg, open_names, uncertain, below_deg):
    monkeypatch.setattr(boards, "_left_open", lambda evidence, name: uncertain)
    apart_deg = max(below_deg + off_deg, 0)
    poses = RigidTransform.from_rotation(Rotation.from_rotvec([[0, 0, 0], [apart_deg, 0, 0]], degrees=True))
    evidence = SimpleNamespace(
        cam_from_board={"camera": poses},
        calibration=SimpleNamespace(detections={}),
        undecided=lambda name: [SimpleNamespace(changes=dict.fromkeys(open_names, 1.0))],
    )
    assert leave_focal_length_open(evidence, "camera") == (apart_deg < below_deg)


def test_parallel_boards_in_a_file_are_a_fault():
    rng = np.random.default_rng(1)
    set_up = single(rng, tilt_deg=(0, 1))
    (found,) = kinds()["parallel-boards"].check(Evidence(set_up.solved(set_up.observed(rng))))
    assert found.severity == "fault"
