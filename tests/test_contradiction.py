"""What a file says twice is held against each other: rounding is no contradiction, a real one is named by its size."""

import json

import cv2
import numpy as np
import pytest
import yaml

from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.redundancy import half_last_digit
from camviz_clinic.checks import inspect, inspect_file
from camviz_clinic.files import load

TURN = Rotation.from_euler("xyz", [2.03, -1.27, 0.71], degrees=True)
K1 = np.array([[701.2345678, 0, 331.1234567], [0, 702.3456789, 251.2345671], [0, 0, 1]])
K2 = np.array([[691.7654321, 0, 309.9876543], [0, 689.8765432, 234.8765439], [0, 0, 1]])
D = np.array([-0.2123456, 0.0512345, 1.123e-4, 2.234e-4, 0.0])


def contradictions(inspection):
    return [each for each in inspection.findings if each.id == "contradiction"]


# Kalibr --------------------------------------------------------------------------------------------------------------


def chain(step, by_the_imu=None, key="T_cam_imu"):
    """A camchain of two cameras, whose T_cn_cnm1 is `step`; T_cam_imu agrees with another step where one is given."""
    imu = RigidTransform.from_components([0.0213, -0.0512, 0.0134], Rotation.from_rotvec([0.31, 1.12, -0.42]))
    pose = (step if by_the_imu is None else by_the_imu) * imu
    poses = [imu, pose] if key == "T_cam_imu" else [imu.inv(), pose.inv()]
    common = {"camera_model": "pinhole", "intrinsics": [460.5, 459.25, 375.0, 241.5], "resolution": [752, 480]}
    common |= {"distortion_model": "radtan", "distortion_coeffs": [-0.28, 0.07, 0.0001, 0.0002]}
    tree = {f"cam{i}": common | {key: pose.as_matrix().tolist()} for i, pose in enumerate(poses)}
    tree["cam1"]["T_cn_cnm1"] = step.as_matrix().tolist()
    return tree


def inspected(tree, path):
    path.write_text(yaml.safe_dump(tree))
    return inspect_file(path)


STEP = RigidTransform.from_components([-0.1101, 0.0023, -0.0012], TURN)


@pytest.mark.parametrize("key", ["T_cam_imu", "T_imu_cam"])
@pytest.mark.parametrize(
    ("degrees", "millimetres", "severity"), [(2.5, 0, "fault"), (0, 14, "fault"), (0, 0.3, "note")]
)
def test_a_camchain_says_by_how_much_its_two_ways_differ(tmp_path, key, degrees, millimetres, severity):
    """A turn about the camera's own axis in place of T_cam_imu, and a shift: both are known."""
    turn = Rotation.from_rotvec([0, np.radians(degrees), 0])
    moved = RigidTransform.from_components(STEP.translation + [0, 0, millimetres / 1000], turn * STEP.rotation)
    (finding,) = contradictions(inspected(chain(STEP, moved, key), tmp_path / "camchain.yaml"))
    assert finding.severity == severity
    said = f"{degrees}°" if degrees else f"{millimetres} mm"
    assert finding.sentence == f"cam1.T_cn_cnm1: it differs by {said} from {key} of cam0 and cam1."
    assert finding.value == pytest.approx(degrees or millimetres, rel=1e-5)


def test_an_inverse_is_called_one(tmp_path):
    (finding,) = contradictions(inspected(chain(STEP, STEP.inv()), tmp_path / "camchain.yaml"))
    assert finding.sentence.endswith("The inverse of the one is the other.")


@pytest.mark.parametrize("decimals", [4, 5, 6, 8])
def test_rounding_is_no_contradiction_but_a_difference_beyond_it_is(tmp_path, decimals):
    """Both cameras' poses printed with few decimals; then one element is off by 30 units of the last one."""
    for seed in range(4):
        rng = np.random.default_rng(seed)
        step = RigidTransform.from_components(rng.uniform(-0.2, 0.2, 3), Rotation.random(rng=rng))
        tree = chain(step)
        for part in tree.values():
            part |= {key: np.round(part[key], decimals).tolist() for key in ("T_cam_imu", "T_cn_cnm1") if key in part}
        inspection = inspected(tree, tmp_path / "camchain.yaml")
        assert "contradiction" in inspection.checked
        assert contradictions(inspection) == []
        tree["cam1"]["T_cn_cnm1"][0][3] += 30 * 10.0**-decimals
        beyond = 30 * 10 ** (3 - decimals) > 0.01  # mm: what is less is not worth a word
        assert bool(contradictions(inspected(tree, tmp_path / "camchain.yaml"))) == beyond


def test_a_file_that_says_nothing_twice_is_not_checked(tmp_path):
    tree = chain(STEP)
    del tree["cam1"]["T_cam_imu"]
    assert ("contradiction", "the file says nothing twice") in inspected(tree, tmp_path / "camchain.yaml").skipped


def test_digits_are_told_from_the_numbers():
    """What a program prints with a format has that format's rounding, whatever the numbers."""
    rng = np.random.default_rng(3)
    for _ in range(20):
        numbers = rng.normal(0, 10.0 ** rng.uniform(-3, 3), 12)
        fixed = half_last_digit([float(f"{x:.4f}") for x in numbers])
        assert np.all(fixed <= 1.001 * max(0.5e-4, 0)) or np.abs(numbers).max() < 0.01
        significant = half_last_digit([float(f"{x:.7g}") for x in numbers])
        assert np.all(significant >= 0.5 * 10.0 ** (np.floor(np.log10(np.abs(numbers))) - 6) * 0.999)


# OpenCV --------------------------------------------------------------------------------------------------------------


def opencv_pair(vertical=False, fisheye=False):
    """The matrices of a pair by the names of OpenCV's manual, as its own functions compute them."""
    R, T = TURN.as_matrix(), np.array([[3.2], [-110.3], [2.1]]) if vertical else np.array([[-119.7], [2.3], [3.1]])
    if fisheye:
        R1, R2, P1, P2, Q = cv2.fisheye.stereoRectify(K1, D[:4], K2, D[:4], (640, 480), R, T, 0, balance=0.4)
    else:
        R1, R2, P1, P2, Q, _, _ = cv2.stereoRectify(K1, D, K2, D, (640, 480), R, T, flags=0, alpha=0.6)
    E = np.cross(T[:, 0], R, axisb=0, axisc=0)
    F = np.linalg.inv(K2).T @ E @ np.linalg.inv(K1)
    held = {"M1": K1, "D1": D[None], "M2": K2, "D2": D[None], "R": R, "T": T, "E": E, "F": F / F[2, 2]}
    return held | {"R1": R1, "R2": R2, "P1": P1, "P2": P2, "Q": Q}


def of_pair(held, path):
    tree = {"image_width": 640, "image_height": 480}
    tree |= {key: {"rows": len(m), "cols": len(m[0]), "data": np.ravel(m).tolist()} for key, m in held.items()}
    path.write_text(json.dumps(tree))
    return inspect_file(path)


@pytest.mark.parametrize(("vertical", "fisheye"), [(False, False), (True, False), (False, True)])
def test_what_opencv_computes_agrees(tmp_path, vertical, fisheye):
    inspection = of_pair(opencv_pair(vertical, fisheye), tmp_path / "pair.json")
    assert contradictions(inspection) == []
    assert len(inspection.calibration.redundant) == 7
    assert max(max(each.apart.values()) for each in inspection.calibration.redundant) < 1e-6


@pytest.mark.parametrize(
    ("key", "place", "by", "named"),
    [
        ("T", (1, 0), 9.0, {"E", "F", "P2"}),
        ("E", (0, 2), 9.0, {"E"}),
        ("F", (0, 1), 1e-5, {"F"}),
        ("M1", (1, 2), 12.0, {"F"}),
        ("P1", (0, 0), 4.0, {"P2", "Q"}),
        ("P2", (0, 3), 1500.0, {"P2", "Q"}),
        ("Q", (0, 3), -3.0, {"Q"}),
        ("Q", (3, 2), 1e-3, {"Q"}),
    ],
)
def test_one_changed_number_of_a_pair_is_named(tmp_path, key, place, by, named):
    held = {name: np.array(value) for name, value in opencv_pair().items()}
    held[key][place] += by
    found = contradictions(of_pair(held, tmp_path / "pair.json"))
    assert {each.sentence.split(":")[0] for each in found} == named
    assert "fault" in {each.severity for each in found}


def test_a_turned_rectification_is_named_by_its_angle(tmp_path):
    held = opencv_pair()
    held["R1"] = Rotation.from_rotvec([0, np.radians(3), 0]).as_matrix() @ held["R1"]
    (finding,) = contradictions(of_pair(held, tmp_path / "pair.json"))
    assert finding.sentence == "R: it differs by 3° from R1 and R2."


def test_poses_under_r1_and_r2_and_other_things_under_e_f_and_p_are_left_alone(tmp_path):
    """R1 and R2 as each camera's rotation to the world, P as K [R | t], f as a focal length."""
    held = opencv_pair()
    first = Rotation.from_rotvec([0.2, 0.1, -0.3]).as_matrix()
    kept = {key: held[key] for key in ("M1", "D1", "M2", "D2", "R", "T")}
    kept |= {"R1": first, "R2": held["R"] @ first, "P1": K1 @ np.eye(3, 4), "E": np.zeros((3, 3)), "F": [[35.0]]}
    kept["P2"] = K2 @ np.hstack([held["R"], held["T"]])
    inspection = of_pair(kept, tmp_path / "pair.json")
    assert contradictions(inspection) == []


# Others --------------------------------------------------------------------------------------------------------------


def test_an_angle_of_view_that_belongs_to_another_focal_length_is_named(tmp_path):
    tree = {"w": 1280, "h": 720, "fl_x": 1000, "camera_angle_x": 2 * np.arctan(640 / 1000)}
    path = tmp_path / "transforms.json"
    path.write_text(json.dumps(tree))
    assert contradictions(inspect(load(path))) == []
    path.write_text(json.dumps(tree | {"camera_angle_x": 2 * np.arctan(640 / 990)}))
    (finding,) = contradictions(inspect(load(path)))
    assert finding.sentence == "fl_x: it differs by 10 px from camera_angle_x and the image size."


def test_matlabs_two_spellings_of_a_camera_matrix(tmp_path):
    K = [[800.5, 0, 330.25], [0, 801.5, 240.75], [0, 0, 1]]
    tree = {"ImageSize": [480, 640], "K": K, "FocalLength": [800.5, 801.5], "PrincipalPoint": [330.25, 250.75]}
    path = tmp_path / "camera.json"
    path.write_text(json.dumps(tree | {"IntrinsicMatrix": np.transpose(K).tolist()}))
    (finding,) = contradictions(inspect_file(path))
    assert finding.sentence == "IntrinsicMatrix: it differs by 10 px from FocalLength and PrincipalPoint."


def test_easymocaps_vector_and_matrix(tmp_path):
    def matrix(values):
        values = np.atleast_2d(values)
        return {"rows": values.shape[0], "cols": values.shape[1], "dt": "d", "data": values.ravel().tolist()}

    turn = Rotation.from_rotvec([0.31, -0.22, 0.13])
    inner = {"names": ["01"], "K_01": matrix(K1), "dist_01": matrix(D), "H_01": 480, "W_01": 640}
    outer = {"names": ["01"], "Rot_01": matrix(turn.as_matrix()), "T_01": matrix([[0.1], [0.2], [3]])}
    (tmp_path / "intri.yml").write_text(yaml.safe_dump(inner))
    for off, named in ((0, []), (0.01, ["R_01: it differs by 0.57° from Rot_01."])):
        vector = (Rotation.from_rotvec([0, 0, off]) * turn).as_rotvec()
        (tmp_path / "extri.yml").write_text(yaml.safe_dump(outer | {"R_01": matrix(vector[:, None])}))
        found = contradictions(inspect_file(tmp_path / "extri.yml"))
        assert [each.sentence for each in found] == named
