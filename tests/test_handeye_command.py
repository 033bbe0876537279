"""`camviz handeye`: from a camera, a table of poses and pictures to X with its ±, or to what is wrong and its mend."""

import json
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
import yaml
from commandline import main, refused

from camviz.poses import RigidTransform
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.checks.rig import lone_poses
from camviz_clinic.checks.snapshots import snapshot
from camviz_clinic.files.writing import write
from camviz_clinic.handeye.virtual import cell

BOARD = ("--board", "9x6", "--square-mm", "25")


@pytest.fixture(scope="module")
def shot(tmp_path_factory):
    """A calibration and the pictures of a cell whose camera is in the hand."""
    folder, rng = tmp_path_factory.mktemp("cell"), np.random.default_rng(5)
    true = cell(rng, 9, noise_px=0)
    (folder / "shots").mkdir()
    for number, pose in enumerate(lone_poses(true.camera, true.board, true.pixels), 1):
        cv2.imwrite(str(folder / f"shots/{number:02}.png"), snapshot(true.camera, true.board, pose, rng, 3.0))
    write(Calibration({"camera": true.camera}, folder, "virtual", board=true.board), folder / "camera.yaml", "opencv")
    return SimpleNamespace(folder=folder, true=true)


@pytest.fixture
def words(shot, room):
    """Writes a table of these poses, in millimetres with pictures' names, and gives the command's words."""

    def written(poses=None, header="picture,x,y,z,qx,qy,qz,qw", named=True, rows=range(9)):
        told = shot.true.base_from_hand if poses is None else poses
        numbers = np.column_stack([1000 * told.translation, told.rotation.as_quat()])
        lines = [",".join(f"{value:.9g}" for value in row) for row in numbers]
        if named:
            lines = [f"{number:02}.png,{line}" for number, line in enumerate(lines, 1)]
        (room / "poses.csv").write_text("\n".join([header, *(lines[row] for row in rows)]) + "\n", encoding="utf-8")
        return ("handeye", str(shot.folder / "camera.yaml"), "poses.csv", str(shot.folder / "shots"), *BOARD)

    return written


def test_x_is_printed_and_kept_with_a_sigma_that_reaches_the_truth(words, shot, room, capsys):
    assert main(words()) == 0
    said = capsys.readouterr().out
    assert said.startswith("Good to ±0.22 mm and ±0.021° on each axis. No problem found; 11 checks ran, 1 could not")
    assert "9 of 9 poses used" in said
    assert said.endswith("handeye.yaml: written.\n")
    kept = yaml.safe_load((room / "handeye.yaml").read_text(encoding="utf-8"))
    X, truth = np.array(kept["hand_from_cam"]["matrix"]), shot.true.X.as_matrix()
    assert kept["arrangement"] == "eye in hand"
    assert "scale" not in kept
    off = np.abs(X[:3, 3] - truth[:3, 3])
    assert (off < 4 * np.array(kept["sigma_m"])).all()
    assert (np.array(kept["sigma_m"]) < 0.001).all()
    assert [f"{1000 * x:.2f}" in said for x in X[:3, 3]] == [True] * 3
    assert np.sqrt(np.diag(kept["covariance"]))[3:] == pytest.approx(kept["sigma_m"])
    assert np.degrees(np.sqrt(np.diag(kept["covariance"])[:3])) == pytest.approx(kept["sigma_deg"])
    Z = RigidTransform.from_matrix(kept["base_from_board"]["matrix"])
    assert Z.translation == pytest.approx(shot.true.Z.translation, abs=0.002)


@pytest.mark.thorough
def test_json_is_strict_and_says_the_same(words, room, capsys):
    assert main((*words(), "--json", "-o", "other.yaml")) == 0
    said = json.loads(capsys.readouterr().out, parse_constant=lambda name: pytest.fail(name))
    kept = yaml.safe_load((room / "other.yaml").read_text(encoding="utf-8"))
    assert {key: said[key] for key in kept} == kept
    assert said["findings"] == []
    assert said["usable"] is True


@pytest.mark.thorough
def test_of_squares_that_are_told_too_long_the_scale_is_told_kept_and_no_fault(words, room, capsys):
    """Squares of 25 mm that are told as 30: by the robot they are 25, within three ±; and told as 25 the scale is 1."""
    given = [*words(), "--unknown-scale"]
    assert main(given) == 0
    metric = yaml.safe_load((room / "handeye.yaml").read_text(encoding="utf-8"))
    assert metric["scale"]["factor"] == pytest.approx(1, abs=3 * metric["scale"]["sigma"])
    assert metric["scale"]["sigma"] < 0.002
    capsys.readouterr()
    given[given.index("25")] = "30"
    assert main(given) == 0
    said = capsys.readouterr().out
    kept = yaml.safe_load((room / "handeye.yaml").read_text(encoding="utf-8"))
    scale = kept["scale"]
    assert scale["factor"] == pytest.approx(25 / 30, abs=3 * scale["sigma"])
    assert scale["square_mm"] == pytest.approx(25, abs=3 * scale["square_sigma_mm"])
    assert f"scale: {scale['factor']:.4f} ± {scale['sigma']:.4f}. In the robot's unit" in said
    assert "Not checked, the scale was solved for: wrong-unit, scale-differs." in said
    assert np.array(kept["hand_from_cam"]["matrix"]) == pytest.approx(
        np.array(metric["hand_from_cam"]["matrix"]), abs=1e-4
    )
    assert main([*given, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["scale"] == scale


@pytest.mark.thorough
def test_poses_that_must_be_mended_are_a_fault_and_nothing_is_written(words, room, shot, capsys):
    assert main(words(shot.true.base_from_hand.inv())) == 1
    said = capsys.readouterr().out
    assert "✗ fault poses-inverted" in said
    assert "with --invert" in said
    assert not (room / "handeye.yaml").exists()
    assert main((*words(shot.true.base_from_hand.inv()), "--invert")) == 0
    assert (room / "handeye.yaml").exists()
    capsys.readouterr()
    assert main((*words(), "--unit", "m", "--json")) == 1
    assert [each["id"] for each in json.loads(capsys.readouterr().out)["findings"]] == ["wrong-unit"]


def test_rows_belong_to_pictures_by_name_and_a_row_without_one_is_left_out(words, room, capsys):
    assert main(words(rows=[8, 0, 3, 2, 1, 5, 7])) == 0
    said = capsys.readouterr().out
    assert "7 of 7 poses used" in said
    assert "05.png: skipped, the table has no row for it." in said


def test_what_does_not_fit_together_is_refused_in_one_sentence(words, shot, room, capsys):
    plain = words(header="x,y,z,qx,qy,qz,qw", named=False, rows=range(8))
    assert "there are 8 poses and 9 pictures: name the pictures" in refused(capsys, room, *plain)
    words(header="x,y,z,qx,qy,qz,qw", named=False, rows=[0, 1, 2, 3, 5, 6, 7, 8])
    said = refused(capsys, room, *plain)
    assert "if from 05.png on each picture belongs to the pose 1 row further up. Look for a missing row" in said
    (room / "poses.csv").write_text("picture,x,y,z,rx,ry,rz\nnone.png,0,0,1,0,0,0\n", encoding="utf-8")
    assert "no row names one of the pictures, such as 01.png" in refused(capsys, room, *plain)
    (room / "poses.csv").write_text("picture,x,y,z,rx,ry,rz\n01.png,0,0,1,0,0,0\n", encoding="utf-8")
    assert "at least 3 poses with a picture of the board are needed, got 1" in refused(capsys, room, *plain)
    assert "there is no such file" in refused(capsys, room, plain[0], plain[1], "none.csv", *plain[3:])
    assert "expected matrix, xyzw" in refused(capsys, room, *plain, "--rotation", "euler-xxx")
    assert "would overwrite" in refused(capsys, room, *plain, "-o", "poses.csv")
    assert "--json is printed on stdout already" in refused(capsys, room, *plain, "-o", "-", "--json")
    assert "expected --camera to be one of camera, got left" in refused(capsys, room, *words(), "--camera", "left")
    text = (shot.folder / "camera.yaml").read_text(encoding="utf-8").replace("1280", "1300")
    (room / "larger.yaml").write_text(text, encoding="utf-8")
    larger = (plain[0], "larger.yaml", *words()[2:])
    assert "have 1280×960 pixels, the calibration has 1300×960" in refused(capsys, room, *larger)
