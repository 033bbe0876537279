"""`camviz dataset`: photographs become a posed dataset, read back by camviz and pycolmap, against rendered truth."""

import json
from types import SimpleNamespace

import cv2
import numpy as np
import pytest
from commandline import main, refused

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz.poses import RigidTransform
from camviz_clinic.calibration.types import Board
from camviz_clinic.checks.snapshots import snapshot
from camviz_clinic.checks.virtual import spread_boards
from camviz_clinic.files import load

CAMERA = Camera(Intrinsics(640, 480, 530, 531, 322, 238), BrownConrady(-0.2, 0.05))
TAGS = Board(9, 6, 0.025, 0.019, "DICT_5X5_100")
OPTIONS = ("--board", "9x6", "--square-mm", "25", "--charuco", "5X5_100", "--marker-mm", "19")


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """Ten photographs, one of which has a blank in its name, and two more without a pose; and the dataset of them."""
    folder, rng = tmp_path_factory.mktemp("scene"), np.random.default_rng(1)
    (folder / "photos").mkdir()
    truth = spread_boards(rng, (CAMERA,), TAGS, 10, (15, 40))
    names = [f"IMG {number}.png" if number == 9 else f"IMG_{number}.png" for number in range(10)]
    for name, pose in zip(names, truth, strict=True):
        cv2.imwrite(str(folder / "photos" / name), snapshot(CAMERA, TAGS, pose, rng, 4))
    cv2.imwrite(str(folder / "photos/none.png"), np.full((480, 640), 130, np.uint8))
    (folder / "photos/bad.png").write_bytes(b"\x89PNG")
    status = main(("dataset", str(folder / "photos"), *OPTIONS, "-o", str(folder / "out"), "--alpha", "0.5"))
    return SimpleNamespace(folder=folder, out=folder / "out", status=status, names=names, truth=truth)


def archive(scene):
    with np.load(scene.out / "poses.npz") as held:
        return dict(held)


def test_everything_is_written_and_what_has_no_pose_is_not(scene):
    assert scene.status == 0
    held = archive(scene)
    written = {each.name for each in (scene.out / "images").iterdir()}
    assert written == set(held["names"].tolist()) == {name.replace(" ", "_") for name in scene.names}
    assert {each.name for each in scene.out.iterdir()} == {
        *("images", "mask.png", "camera.yaml", "photographs.yaml", "transforms.json", "sparse", "poses.npz")
    }
    assert not list(scene.folder.glob(".camviz-*"))


def test_the_poses_are_within_3_sigmas_of_the_rendered_truth(scene):
    held, off = archive(scene), []
    for name, world_from_cam, covariance in zip(held["names"], held["world_from_cam"], held["covariance"], strict=True):
        true = scene.truth[[each.replace(" ", "_") for each in scene.names].index(name)]
        found = RigidTransform.from_matrix(world_from_cam).inv()
        turn = (found.rotation * true.rotation.inv()).as_rotvec()
        shift = found.translation - true.translation
        twist = np.concatenate([turn, shift + np.cross(found.translation, turn)])
        off.append(twist / np.sqrt(np.diag(covariance)))
        place = world_from_cam[:3, 3] - true.inv().translation
        assert np.linalg.norm(place) < 0.003
    assert (np.abs(off) < 3).mean() >= 0.95


def test_the_board_lies_in_the_undistorted_pictures_where_the_files_say(scene):
    """The corners are found anew in the written pictures: all three files put the board there to 0.1 px."""
    from camviz_clinic.calibration import find_corners

    transforms, model = load(scene.out / "transforms.json").cameras, load(scene.out / "sparse/0").cameras
    for name, world_from_cam in list(zip(archive(scene)["names"], archive(scene)["world_from_cam"], strict=True))[:3]:
        seen = find_corners(cv2.imread(str(scene.out / "images" / name), cv2.IMREAD_GRAYSCALE), TAGS)
        there = np.isfinite(seen).all(axis=1)
        own = load(scene.out / "camera.yaml").cameras["camera"].at(RigidTransform.from_matrix(world_from_cam))
        for camera in (own, transforms[f"images/{name}"], model[name]):
            off = camera.project(TAGS.corners)[there] - seen[there]
            assert np.sqrt(np.mean(off**2)) < 0.2
            assert np.abs(off.mean(axis=0)) == pytest.approx(0, abs=0.1)


POINTS = TAGS.corners + [0, 0, 0.01]
"""A centimetre behind the board."""


def test_transforms_and_the_model_are_read_back_to_a_billionth_of_a_pixel(scene):
    transforms, model = load(scene.out / "transforms.json").cameras, load(scene.out / "sparse/0").cameras
    held = archive(scene)
    for name, cam_from_world in zip(held["names"], held["cam_from_world"], strict=True):
        X = POINTS @ cam_from_world[:3, :3].T + cam_from_world[:3, 3]
        uv = (X / X[:, 2:]) @ held["K"].T
        for camera in (transforms[f"images/{name}"], model[name]):
            assert np.abs(camera.project(POINTS) - uv[:, :2]).max() < 1e-9


def test_pycolmap_reads_the_model_to_a_billionth_of_a_pixel(scene):
    pycolmap = pytest.importorskip("pycolmap", reason="pycolmap, the oracle of this test, is not installed")
    held, model = archive(scene), pycolmap.Reconstruction(scene.out / "sparse/0")
    assert model.num_points3D() == 0
    images = {each.name: each for each in model.images.values()}
    assert set(images) == set(held["names"].tolist())
    for name, cam_from_world in zip(held["names"], held["cam_from_world"], strict=True):
        X = POINTS @ cam_from_world[:3, :3].T + cam_from_world[:3, 3]
        uv = (X / X[:, 2:]) @ held["K"].T
        image = images[name]
        assert image.camera.model.name == "SIMPLE_PINHOLE"  # as the pixels are square
        theirs = image.camera.img_from_cam(image.cam_from_world() * POINTS)
        assert np.abs(theirs - 0.5 - uv[:, :2]).max() < 1e-9


def test_transforms_are_nerfstudios_by_its_own_equations(scene):
    """camera_to_world with x right, y up, z backward; u = fl_x x/-z + cx in pixels whose first centre is at 0.5."""
    tree, held = json.loads((scene.out / "transforms.json").read_text(encoding="utf-8")), archive(scene)
    assert tree["camera_model"] == "PINHOLE"
    assert not {"k1", "k2", "k3", "p1", "p2"} & set(tree)
    for frame, name, cam_from_world in zip(tree["frames"], held["names"], held["cam_from_world"], strict=True):
        assert frame["file_path"] == f"images/{name}"
        assert (scene.out / frame["file_path"]).is_file()
        assert (scene.out / frame["mask_path"]).is_file()
        X = np.linalg.solve(np.array(frame["transform_matrix"]), np.column_stack([POINTS, np.ones(54)]).T)[:3]
        u, v = tree["fl_x"] * X[0] / -X[2] + tree["cx"], tree["fl_y"] * -X[1] / -X[2] + tree["cy"]
        true = POINTS @ cam_from_world[:3, :3].T + cam_from_world[:3, 3]
        uv = (true / true[:, 2:]) @ held["K"].T
        assert np.abs(np.column_stack([u, v]) - 0.5 - uv[:, :2]).max() < 1e-9


def test_what_the_commands_write_inspects_as_healthy(scene, capsys, monkeypatch):
    """calibrate, undistort, dataset and convert, of photographs of a healthy camera."""
    monkeypatch.chdir(scene.folder)
    assert main(("calibrate", "photos", *OPTIONS, "-o", "camera.yaml")) == 0
    assert main(("undistort", "camera.yaml", "photos", "-o", "flat")) == 0
    assert main(("convert", "camera.yaml", "camera_info.yaml", "--to", "ros")) == 0
    assert main(("convert", "flat/camera.yaml", "flat.json", "--to", "nerfstudio")) == 0
    own = [f"out/{name}" for name in ("camera.yaml", "photographs.yaml", "transforms.json", "sparse/0")]
    for path in ("camera.yaml", "flat/camera.yaml", "camera_info.yaml", "flat.json", *own):
        capsys.readouterr()
        assert main(("inspect", path)) == 0
        assert "No problem found" in capsys.readouterr().out.partition("\n")[0], path


def test_the_camera_as_it_took_the_photographs_is_kept_with_its_corners(scene):
    kept = load(scene.out / "photographs.yaml")
    assert kept.cameras["camera"].intrinsics.fx == pytest.approx(530, rel=0.005)
    assert kept.detections["camera"].shape == (10, 54, 2)
    assert len(kept.estimated["camera"]) > 4


def test_bad_input_is_one_sentence_and_leaves_nothing_behind(scene, room, capsys):
    photos = str(scene.folder / "photos")
    words = ("dataset", photos, *OPTIONS, "-o", "out")
    assert "are required: -o/--output" in refused(capsys, room, *words[:-2])
    assert "a new folder, or of an empty one" in refused(capsys, room, *words[:-1], photos)
    assert "there is no such picture" in refused(capsys, room, "dataset", "none", *words[2:])
    few = ("dataset", *(f"{photos}/IMG_{number}.png" for number in (0, 1)), *words[2:])
    assert "at least 3 views of the board are needed for a calibration, got 2" in refused(capsys, room, *few)
    blank = ("dataset", f"{photos}/none.png", *words[2:])
    assert "was found in any of 1 pictures" in refused(capsys, room, *blank)
    bad = ("dataset", f"{photos}/bad.png", *words[2:])
    assert "none of the pictures can be used" in refused(capsys, room, *bad)
