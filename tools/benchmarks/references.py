"""Cameras as the files of tools/benchmarks/formats.toml define them, read with nothing of camviz.

A function for each format, by the format's name: its own equation for the pixels, and where each camera stands.
"""

from __future__ import annotations

import ast
import configparser
import json
import re
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import cv2
import numpy as np
import scipy.io
import yaml
from equations import Array, Reference, camera, double_sphere, extended_unified, fisheye, matrix, opencv
from scipy.spatial.transform import Rotation

SIZES = {"bal": (1200, 800)}  # of files that hold none, where the equation needs one
OPENGL = np.diag([1.0, -1.0, -1.0])


def qualisys(path: Path) -> Iterator[Reference]:
    """Lengths in 1/64 px less the window's corner; y up and z backward; millimetres."""
    for each in ElementTree.parse(path).iter("camera"):
        window, held, pose = (each.find(name).attrib for name in ("fov_video", "intrinsic", "transform"))  # type: ignore[union-attr]
        U, V = ((float(held[f"focalLength{a}"]) / 64, float(held[f"centerPoint{a}"]) / 64) for a in "UV")
        K = matrix(U[0], V[0], U[1] - float(window["left"]), V[1] - float(window["top"]))
        radial = [float(held[f"radialDistortion{n}"]) for n in (1, 2, 3)]
        D = [*radial[:2], *(float(held[f"tangentalDistortion{n}"]) for n in (1, 2)), radial[2]]
        R = np.diag([1, -1, -1]) @ [[float(pose[f"r{i}{j}"]) for j in (1, 2, 3)] for i in (1, 2, 3)]
        yield camera(K, D, R, -R @ [float(pose[axis]) / 1000 for axis in "xyz"])


def zed(path: Path) -> Iterator[Reference]:
    """The largest size; X_right = R X_left - T."""
    ini = configparser.ConfigParser()
    ini.read(path)
    stereo = {key: float(value) for key, value in ini["STEREO"].items()}
    turn = Rotation.from_rotvec([stereo[f"{key}_2k"] for key in ("rx", "cv", "rz")]).as_matrix()
    place = [-stereo[key] / 1000 for key in ("baseline", "ty", "tz")]
    for side, R, t in (("LEFT", np.eye(3), [0, 0, 0]), ("RIGHT", turn, place)):
        held = {key: float(value) for key, value in ini[f"{side}_CAM_2K"].items()}
        K = matrix(*(held[key] for key in ("fx", "fy", "cx", "cy")))
        yield camera(K, [held.get(key, 0.0) for key in ("k1", "k2", "p1", "p2", "k3")], R, t)


def realsense(path: Path) -> Iterator[Reference]:
    """Without coefficients."""
    held = json.loads(path.read_text())
    yield camera(matrix(held["fx"], held["fy"], held["ppx"], held["ppy"]), np.zeros(5))


def oak(path: Path) -> Iterator[Reference]:
    """x_to = R x + t / 100 along toCameraSocket; the world is socket 0."""
    held = dict(json.loads(path.read_text())["cameraData"])
    for socket in sorted(held):
        R, t, at = np.eye(3), np.zeros(3), socket
        while at != 0:
            step = held[at]["extrinsics"]
            turn, place = np.array(step["rotationMatrix"]), np.array([step["translation"][axis] for axis in "xyz"])
            R, t, at = turn @ R, turn @ t + place / 100, step["toCameraSocket"]
        yield camera(held[socket]["intrinsicMatrix"], held[socket]["distortionCoeff"], R.T, -R.T @ t)


def ost(path: Path) -> Iterator[Reference]:
    """Blocks of numbers under their names; # and ; begin remarks."""
    text = re.sub(r"^[#;].*$", "", path.read_text(), flags=re.MULTILINE)
    blocks = re.findall(r"^(camera matrix|distortion)\n((?:[-+.\deE \t]+\n)+)", text, re.MULTILINE)
    held = {name: [float(word) for word in numbers.split()] for name, numbers in blocks}
    yield camera(np.reshape(held["camera matrix"], (3, 3)), held["distortion"])


def easymocap(path: Path) -> Iterator[Reference]:
    """The cameras of intri.yml that extri.yml has too."""
    inside, outside = (cv2.FileStorage(str(path.with_name(f"{name}.yml")), 0) for name in ("intri", "extri"))
    names = inside.getNode("names")
    for name in (names.at(index).string() for index in range(names.size())):
        if not outside.getNode(f"T_{name}").empty():
            K, D = (inside.getNode(f"{key}_{name}").mat() for key in ("K", "dist"))
            R, t = (outside.getNode(f"{key}_{name}").mat() for key in ("Rot", "T"))
            yield camera(K, D, R, t)


def openmvg(path: Path) -> Iterator[Reference]:
    """Intrinsics without poses: three radial coefficients."""
    for each in json.loads(path.read_text())["intrinsics"]:
        held = each["value"]["ptr_wrapper"]["data"]
        k1, k2, k3 = held["disto_k3"]
        f = held["focal_length"]
        yield camera(matrix(f, f, *held["principal_point"]), [k1, k2, 0, 0, k3])


def gyroflow(path: Path) -> Iterator[Reference]:
    """cv2.fisheye's four coefficients; the principal point is the middle unless the profile is asymmetrical."""
    held = json.loads(path.read_text())
    K = np.array(held["fisheye_params"]["camera_matrix"])
    if not held.get("asymmetrical"):
        K[:2, 2] = held["calib_dimension"]["w"] / 2, held["calib_dimension"]["h"] / 2
    yield fisheye(K, held["fisheye_params"]["distortion_coeffs"])


def photonvision(path: Path) -> Iterator[Reference]:
    """OpenCV's K and coefficients, rows after rows."""
    held = json.loads(path.read_text())
    yield camera(np.reshape(held["cameraIntrinsics"]["data"], (3, 3)), held["distCoeffs"]["data"])


def ocamcalib(path: Path) -> Iterator[Reference]:
    """cam2world of the toolbox, inverted by bisection along each ray's radius."""
    lines = [line for line in path.read_text().splitlines() if line.strip() and not line.startswith("#")]
    s, (row, column), (c, d, e) = (np.array(lines[i].split(), float) for i in (0, 2, 3))

    def project(points: Array) -> Array:
        across = np.hypot(points[:, 0], points[:, 1])
        low, high = np.zeros(len(points)), np.full(len(points), 2000.0)
        for _ in range(200):
            rho = (low + high) / 2
            beyond = rho * points[:, 2] > -np.polyval(s[:0:-1], rho) * across  # the ray is (x, y, f(ρ)), z backward
            low, high = np.where(beyond, low, rho), np.where(beyond, rho, high)
        x, y = rho * points[:, 1] / across, rho * points[:, 0] / across  # its x runs down the rows
        return np.stack([column + e * x + y, row + c * x + d * y], axis=-1)

    yield Reference(project, np.eye(3), np.zeros(3))


def orbslam(path: Path) -> Iterator[Reference]:
    """ORB-SLAM3's pair; LEFT and RIGHT as they were before cv::stereoRectify, or the one camera of an RGB-D set."""
    if "Stereo.T_c1_c2" in path.read_text():
        yield from orbslam3(document(path))
        return
    held = cv2.FileStorage(str(path), cv2.FILE_STORAGE_READ)
    if held.getNode("LEFT.K").empty():
        K = matrix(*(held.getNode(f"Camera.{key}").real() for key in ("fx", "fy", "cx", "cy")))
        yield camera(K, [held.getNode(f"Camera.{key}").real() for key in ("k1", "k2", "p1", "p2", "k3")])
        return
    turns = {side: held.getNode(f"{side}.R").mat() for side in ("LEFT", "RIGHT")}
    P = held.getNode("RIGHT.P").mat()
    for side, shift in (("LEFT", 0.0), ("RIGHT", P[0, 3] / P[0, 0])):
        K, D = (held.getNode(f"{side}.{key}").mat() for key in "KD")
        yield camera(K, D, turns[side].T @ turns["LEFT"], turns[side].T @ [shift, 0, 0])


def orbslam3(held: dict[str, Any]) -> Iterator[Reference]:
    """Camera1 and Camera2; x_left = T_c1_c2 x_right."""
    project = fisheye if held["Camera.type"] == "KannalaBrandt8" else camera
    names = "k1 k2 k3 k4" if project is fisheye else "k1 k2 p1 p2"
    for number, pose in ((1, np.eye(4)), (2, np.linalg.inv(np.reshape(held["Stereo.T_c1_c2"]["data"], (4, 4))))):
        K, D = ([held[f"Camera{number}.{key}"] for key in keys.split()] for keys in ("fx fy cx cy", names))
        yield project(matrix(*K), D, pose[:3, :3], pose[:3, 3])


def document(path: Path) -> Any:
    """A YAML file, also one that begins as OpenCV's do and names its types."""
    text = re.sub(r"^%YAML:1.0.*$", "", path.read_text(), flags=re.MULTILINE).replace("!!opencv-matrix", "")
    return yaml.safe_load(text)


def behind_an_imu(imu_from_cam: list[Array], cameras: list[Reference]) -> Iterator[Reference]:
    """The cameras with the first one's frame as the world."""
    for pose, each in zip(imu_from_cam, cameras, strict=True):
        there = np.linalg.inv(pose) @ imu_from_cam[0]
        yield Reference(each.project, there[:3, :3], there[:3, 3])


def bal(path: Path) -> Iterator[Reference]:
    """P = R X + t, p = -P / P_z, p' = f (1 + k1 |p|² + k2 |p|⁴) p from the middle, y up, z backward."""
    words = path.read_text().split()
    count, _, observations = map(int, words[:3])
    numbers = np.array(words[3 + 4 * observations :][: 9 * count], float).reshape(count, 9)
    middle = (np.array(SIZES["bal"]) - 1) / 2
    for *pose, f, k1, k2 in numbers:

        def project(points: Array, f: float = f, k1: float = k1, k2: float = k2) -> Array:
            P = points @ OPENGL
            p = -P[:, :2] / P[:, 2:]
            squared = (p**2).sum(axis=1, keepdims=True)
            return f * (1 + k1 * squared + k2 * squared**2) * p * [1, -1] + middle

        turn, _ = cv2.Rodrigues(np.array(pose[:3]))
        yield Reference(project, OPENGL @ turn, OPENGL @ pose[3:])


def basalt(path: Path) -> Iterator[Reference]:
    """ds and eucm of Usenko et al. 2018; T_imu_cam is a quaternion and a place."""
    held = json.loads(path.read_text())["value0"]
    poses = []
    for each in held["T_imu_cam"]:
        poses.append(np.eye(4))
        poses[-1][:3, :3] = Rotation.from_quat([each[f"q{axis}"] for axis in "xyzw"]).as_matrix()
        poses[-1][:3, 3] = [each[f"p{axis}"] for axis in "xyz"]
    cameras = []
    for each in held["intrinsics"]:
        model = {"ds": double_sphere, "eucm": extended_unified}[each["camera_type"]]
        cameras.append(Reference(model(**each["intrinsics"]), np.eye(3), np.zeros(3)))
    yield from behind_an_imu(poses, cameras)


def camodocal(path: Path) -> Iterator[Reference]:
    """PINHOLE, and MEI: onto the unit sphere, seen from xi behind its centre, then distorted."""
    held = document(path)
    D = [held["distortion_parameters"][key] for key in ("k1", "k2", "p1", "p2")]
    grid = held["projection_parameters"]
    if held["model_type"] == "PINHOLE":
        yield camera(matrix(*(grid[key] for key in ("fx", "fy", "cx", "cy"))), D)
        return
    K, xi = matrix(*(grid[key] for key in ("gamma1", "gamma2", "u0", "v0"))), held["mirror_parameters"]["xi"]
    shift = np.array([0, 0, xi])
    lengths = lambda points: np.linalg.norm(points, axis=1, keepdims=True)  # noqa: E731
    yield Reference(lambda points: opencv(points / lengths(points) + shift, K, D), np.eye(3), np.zeros(3))


def kalibr(path: Path) -> Iterator[Reference]:
    """pinhole with radtan or equidistant, behind one IMU: T_cam_imu, or OpenVINS's T_imu_cam."""
    held = document(path)
    parts = [held[key] for key in sorted(held) if re.fullmatch(r"cam\d+", key)]
    models = {"radtan": camera, "equidistant": fisheye}
    cameras = [models[p["distortion_model"]](matrix(*p["intrinsics"]), p["distortion_coeffs"]) for p in parts]
    poses = [np.array(p["T_imu_cam"]) if "T_imu_cam" in p else np.linalg.inv(p["T_cam_imu"]) for p in parts]
    yield from behind_an_imu(poses, cameras)


def mrcal(path: Path) -> Iterator[Reference]:
    """OPENCV8 of x_cam = r x_ref + t."""
    held = ast.literal_eval(path.read_text())
    pose = np.array(held["extrinsics"])
    numbers = held["intrinsics"]
    yield camera(matrix(*numbers[:4]), numbers[4:], cv2.Rodrigues(pose[:3])[0], pose[3:])


def nerfstudio(path: Path) -> Iterator[Reference]:
    """OPENCV with the first pixel's centre at 0.5; transform_matrix: camera → world, y up and z backward."""
    held = json.loads(path.read_text())
    K = matrix(held["fl_x"], held["fl_y"], held["cx"] - 0.5, held["cy"] - 0.5)
    for frame in sorted(held["frames"], key=lambda each: str(each["file_path"])):
        pose = np.linalg.inv(np.array(frame["transform_matrix"]) @ np.diag([1, -1, -1, 1]))
        yield camera(K, [held[key] for key in ("k1", "k2", "p1", "p2")], pose[:3, :3], pose[:3, 3])


def okvis(path: Path) -> Iterator[Reference]:
    """radialtangential; T_SC: camera → IMU."""
    parts = document(path)["cameras"]
    grids = [matrix(*part["focal_length"], *part["principal_point"]) for part in parts]
    cameras = [camera(K, part["distortion_coefficients"]) for K, part in zip(grids, parts, strict=True)]
    yield from behind_an_imu([np.reshape(part["T_SC"], (4, 4)) for part in parts], cameras)


def opensfm(path: Path) -> Iterator[Reference]:
    """perspective: lengths in units of the longer side, from the middle."""
    held = json.loads(path.read_text())[0]
    for shot in held["shots"].values():
        c = held["cameras"][shot["camera"]]
        f = c["focal"] * max(c["width"], c["height"])
        turn, _ = cv2.Rodrigues(np.array(shot["rotation"]))
        K = matrix(f, f, (c["width"] - 1) / 2, (c["height"] - 1) / 2)
        yield camera(K, [c["k1"], c["k2"], 0, 0], turn, shot["translation"])


def anipose(path: Path) -> Iterator[Reference]:
    """cameraMatrix and dist of OpenCV; rotation and translation: world → camera. Pose2Sim's and anipose's tables."""
    for part in tomllib.loads(path.read_text()).values():
        if isinstance(part, dict) and "rotation" in part and "matrix" in part:
            held = np.array(part["rotation"])  # a vector, or in caliscope's older files a matrix
            turn = held if held.size == 9 else cv2.Rodrigues(held)[0]
            yield camera(part["matrix"], part["distortions"], turn, part["translation"])


def ros(path: Path) -> Iterator[Reference]:
    """plumb_bob."""
    held = document(path)
    yield camera(np.reshape(held["camera_matrix"]["data"], (3, 3)), held["distortion_coefficients"]["data"])


def stella(path: Path) -> Iterator[Reference]:
    """perspective, fisheye and equirectangular: θ = (u / cols - 1/2) 2π, φ = -(v / rows - 1/2) π."""
    held = document(path)["Camera"]
    if held["model"] == "equirectangular":
        across, down = held["cols"], held["rows"]

        def project(points: Array) -> Array:
            x, y, z = (points / np.linalg.norm(points, axis=1, keepdims=True)).T
            u, v = across * (0.5 + np.arctan2(x, z) / (2 * np.pi)), down * (0.5 + np.arcsin(y) / np.pi)
            return np.stack([u, v], axis=-1)

        yield Reference(project, np.eye(3), np.zeros(3))
        return
    K = matrix(*(held[key] for key in ("fx", "fy", "cx", "cy")))
    names = ("k1", "k2", "k3", "k4") if held["model"] == "fisheye" else ("k1", "k2", "p1", "p2", "k3")
    yield (fisheye if held["model"] == "fisheye" else camera)(K, [held[key] for key in names])


def svo(path: Path) -> Iterator[Reference]:
    """pinhole with radial-tangential or equidistant, T_B_C: camera → body; rpg_svo's ATAN in fractions of the sides."""
    held = document(path)
    if held.get("cam_model") == "ATAN":
        sides = np.array([held["cam_width"], held["cam_height"]])
        f, c = sides * [held["cam_fx"], held["cam_fy"]], sides * [held["cam_cx"], held["cam_cy"]] - 0.5
        s = held["cam_d0"]

        def project(points: Array) -> Array:
            plane = points[:, :2] / points[:, 2:]
            r = np.linalg.norm(plane, axis=1, keepdims=True)
            return f * plane * np.arctan(2 * r * np.tan(s / 2)) / (s * r) + c

        yield Reference(project, np.eye(3), np.zeros(3))
        return
    parts = held["cameras"]
    models = {"radial-tangential": camera, "equidistant": fisheye}
    cameras = []
    for part in (each["camera"] for each in parts):
        bent = part["distortion"]
        cameras.append(models[bent["type"]](matrix(*part["intrinsics"]["data"]), bent["parameters"]["data"]))
    yield from behind_an_imu([np.reshape(part["T_B_C"]["data"], (4, 4)) for part in parts], cameras)


def euroc(path: Path) -> Iterator[Reference]:
    """radial-tangential; alone, so that its own frame is the world's."""
    held = document(path)
    yield camera(matrix(*held["intrinsics"]), held["distortion_coefficients"])


def kitti(path: Path) -> Iterator[Reference]:
    """P = K [1 | t] of cameras without distortion."""
    for line in path.read_text().splitlines():
        if re.match(r"P\d:", line):
            P = np.array(line.split()[1:], float).reshape(3, 4)
            yield camera(P[:, :3], np.zeros(5), t=np.linalg.solve(P[:, :3], P[:, 3]))


def kitti_raw(path: Path) -> Iterator[Reference]:
    """The cameras before rectification: K, five coefficients D, and x_i = R x_0 + T."""
    held = dict(line.split(":", 1) for line in path.read_text().splitlines() if re.match(r"[KDRT]_\d\d:", line))
    for number in sorted(key[2:] for key in held if key.startswith("K_")):
        K, D, R, T = (np.array(held[f"{what}_{number}"].split(), float) for what in "KDRT")
        yield camera(K.reshape(3, 3), D, R.reshape(3, 3), T)


def mat(path: Path) -> Iterator[Reference]:
    """stereoParameters as a struct, read by SciPy: [u v 1] ~ x IntrinsicMatrix from (1, 1) on, x2 = x1 R + t in mm."""
    held = scipy.io.loadmat(path, simplify_cells=True)["stereoParams"]
    poses = [(np.eye(3), np.zeros(3)), (held["RotationOfCamera2"].T, held["TranslationOfCamera2"] / 1000)]
    for number, (R, t) in enumerate(poses, 1):
        part = held[f"CameraParameters{number}"]
        assert part["WorldUnits"] == "mm"
        K = part["IntrinsicMatrix"].T - np.array([[0, 0, 1], [0, 0, 1], [0, 0, 0]])
        yield camera(K, [*part["RadialDistortion"], *part["TangentialDistortion"]], R, t)


def metashape(path: Path) -> Iterator[Reference]:
    """The frame camera of Metashape's manual, appendix D, first pixel's centre at 0.5; transform: camera → chunk."""
    chunk = ElementTree.parse(path).getroot().find("chunk")
    assert chunk is not None
    sensors = {each.get("id"): each.find("calibration") for each in chunk.iter("sensor")}
    for each in chunk.iter("camera"):
        held, pose = sensors[each.get("sensor_id")], each.findtext("transform")
        if held is None or pose is None:
            continue
        w, h = (float(held.find("resolution").attrib[side]) for side in ("width", "height"))  # type: ignore[union-attr]
        names = "f cx cy b1 b2 k1 k2 k3 p1 p2"
        f, cx, cy, b1, b2, k1, k2, k3, p1, p2 = (float(held.findtext(name, "0")) for name in names.split())

        def project(points: Array, *n: float) -> Array:
            w, h, f, cx, cy, b1, b2, k1, k2, k3, p1, p2 = n
            x, y = (points[:, :2] / points[:, 2:]).T
            r2 = x * x + y * y
            radial = 1 + k1 * r2 + k2 * r2**2 + k3 * r2**3
            u = x * radial + p1 * (r2 + 2 * x * x) + 2 * p2 * x * y
            v = y * radial + p2 * (r2 + 2 * y * y) + 2 * p1 * x * y
            return np.stack([w / 2 + cx + u * f + u * b1 + v * b2, h / 2 + cy + v * f], axis=-1) - 0.5

        numbers = (w, h, f, cx, cy, b1, b2, k1, k2, k3, p1, p2)
        there = np.linalg.inv(np.array(pose.split(), float).reshape(4, 4))
        yield Reference(lambda points, n=numbers: project(points, *n), there[:3, :3], there[:3, 3])  # type: ignore[misc]


REFERENCES: dict[str, Callable[[Path], Iterator[Reference]]] = {
    each.__name__.replace("_", "-"): each
    for each in (
        anipose,
        bal,
        basalt,
        camodocal,
        easymocap,
        euroc,
        gyroflow,
        kalibr,
        kitti,
        kitti_raw,
        mat,
        metashape,
        mrcal,
        nerfstudio,
        oak,
        ocamcalib,
        okvis,
        openmvg,
        opensfm,
        orbslam,
        ost,
        photonvision,
        qualisys,
        realsense,
        ros,
        stella,
        svo,
        zed,
    )
}
