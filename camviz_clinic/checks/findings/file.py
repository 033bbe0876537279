"""What the text of a file tells by itself: matrices, the number of coefficients, and coefficients that are all zero."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import yaml

from camviz.cameras import Camera
from camviz.lenses import BrownConrady, Cylindrical, Equirectangular, KannalaBrandt, Perspective
from camviz_clinic.calibration.types import Calibration, CalibrationError
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.registry import VIEW_BY_VIEW, WRONG_NUMBERS, Finding, Rng, finding
from camviz_clinic.checks.virtual import alone, as_file, healthy, healthy_pair, single, spread_boards
from camviz_clinic.files import kalibr, ros

SQUARE = 0.02  # how far fx/fy may be from 1: sensors have square pixels to a few thousandths
STANDARD_ERRORS = 5.0
PANORAMAS = (Cylindrical, Equirectangular)


def named(evidence: Evidence, id: str) -> list[CalibrationError]:
    """The faults of this id that the reader of the file has noted."""
    return [fault for fault in evidence.calibration.faults if fault.id == id]


@finding(
    "not-a-rotation",
    severity="fault",
    view="numbers",
    symptom="R is not a rotation: its rows are not orthonormal, its determinant is -1, or its bottom row is off.",
    causes=("a matrix that was transposed, mirrored or edited by hand", "too few digits"),
    remedy="Write the rotation with all its digits: orthonormal rows, determinant 1, and bottom row 0 0 0 1.",
    threshold="An element of R Rᵀ - 1 or of the bottom row, or the length of a quaternion, is off by 0.001.",
)
def not_a_rotation(evidence: Evidence) -> Iterator[Finding]:
    """The check reads the rotations in the file."""
    for fault in named(evidence, "not-a-rotation"):
        yield not_a_rotation.of_file(fault)


@not_a_rotation.fault("edited rotation", "", (0.0002, 0.01, 0.3), promised=0.01)
def edited_rotation(rng: Rng, strength: float) -> Evidence:
    """An element of R is changed."""
    solved = healthy_pair(rng)
    cameras = {name: replace(camera, lens=without_k3(camera)) for name, camera in solved.cameras.items()}
    tree = yaml.safe_load(kalibr.write(replace(solved, cameras=cameras)))
    tree["cam1"]["T_cn_cnm1"][0][1] += strength
    return as_file(yaml.safe_dump(tree))


def without_k3(camera: Camera) -> BrownConrady:
    """The lens of a virtual camera as Kalibr's radtan has it."""
    assert isinstance(camera.lens, BrownConrady)
    return replace(camera.lens, k3=0.0)


@finding(
    "bad-k",
    severity="fault",
    view="numbers",
    symptom="K is transposed, or K[2, 2] is not 1.",
    causes=("MATLAB's IntrinsicMatrix, which is the transpose of K", "a matrix that was scaled as a whole"),
    remedy="Transpose K, or divide it by K[2, 2].",
    threshold="K is not upper triangular, or its last element is not 1.",
    explains=WRONG_NUMBERS,
)
def bad_k(evidence: Evidence) -> Iterator[Finding]:
    """The check reads the camera matrix in the file."""
    for fault in named(evidence, "bad-k"):
        yield bad_k.of_file(fault)


@bad_k.fault("transposed K", "times", (1, 2, 0.001), promised=1)
def transposed(rng: Rng, strength: float) -> Evidence:
    """K is transposed (1), or multiplied."""
    solved = healthy(rng)
    tree, K = yaml.safe_load(ros.write_one(solved)), solved.cameras["camera"].intrinsics.K
    tree["camera_matrix"]["data"] = (K.T if strength == 1 else strength * K).ravel().tolist()
    return as_file(yaml.safe_dump(tree))


@finding(
    "not-calibrated",
    severity="fault",
    view="numbers",
    symptom="The camera is not calibrated: a focal length is 0.",
    causes=("a driver or a template that writes a camera matrix of zeros until the camera is calibrated",),
    remedy="Calibrate the camera (camviz calibrate), and give the driver the file.",
    threshold="fx or fy is 0.",
)
def not_calibrated(evidence: Evidence) -> Iterator[Finding]:
    """The check reads the focal lengths in the file. Such a file is not read any further."""
    return (not_calibrated.of_file(fault) for fault in named(evidence, "not-calibrated"))


@not_calibrated.fault("camera not calibrated", "", (1, 2), promised=1)
def zero_matrix(rng: Rng, strength: float) -> Evidence:
    """K is 0 (1), or fx alone (2)."""
    solved = healthy(rng)
    grid = solved.cameras["camera"].intrinsics
    return _refused(solved, [0.0] * 9 if strength == 1 else [0.0, 0.0, grid.cx, 0.0, grid.fy, grid.cy, 0.0, 0.0, 1.0])


def _refused(solved: Calibration, K: list[float]) -> Evidence:
    """The numbers of a camera alone, beside why a file with this K is refused."""
    tree = yaml.safe_load(ros.write_one(solved))
    tree["camera_matrix"]["data"] = K
    try:
        return as_file(yaml.safe_dump(tree))
    except CalibrationError as error:
        return Evidence(replace(alone(solved), faults=(error,)))


@finding(
    "reversed-axis",
    severity="fault",
    view="numbers",
    symptom="A focal length is negative: an axis of the camera points the other way.",
    causes=("a camera of another convention, whose y axis points up (OpenGL) or whose x axis points left",),
    remedy="Write the focal lengths as positive numbers, and turn the same axes of the camera's pose.",
    threshold="fx or fy is negative.",
)
def reversed_axis(evidence: Evidence) -> Iterator[Finding]:
    """The check reads the focal lengths in the file. Such a file is not read any further."""
    return (reversed_axis.of_file(fault) for fault in named(evidence, "reversed-axis"))


@reversed_axis.fault("axis reversed", "", (1, 2, 3), promised=1)
def negative_focal_length(rng: Rng, strength: float) -> Evidence:
    """The sign of fy (1), of fx (2) or of both (3) is changed."""
    signs = {1: [1, -1], 2: [-1, 1], 3: [-1, -1]}[round(strength)]
    solved = healthy(rng)
    grid = solved.cameras["camera"].intrinsics
    K = [signs[0] * grid.fx, 0.0, grid.cx, 0.0, signs[1] * grid.fy, grid.cy, 0.0, 0.0, 1.0]
    return _refused(solved, K)


@finding(
    "coefficient-count",
    severity="fault",
    view="numbers",
    symptom="The number of distortion coefficients does not fit the name of the model.",
    causes=(
        "coefficients of one model under the name of another, such as 8 as plumb_bob",
        "a program that left zeros out at the end, or added some",
    ),
    remedy="Give the model as many coefficients as it has, or write the name of the model that has as many.",
    threshold="The model has another number of coefficients.",
    explains=WRONG_NUMBERS,
)
def coefficient_count(evidence: Evidence) -> Iterator[Finding]:
    """The check reads the coefficients and the name of the model in the file."""
    for fault in named(evidence, "coefficient-count"):
        yield coefficient_count.of_file(fault, "coefficients")


@coefficient_count.fault("mislabelled coefficients", "numbers", (4, 5, 8), promised=4)
def mislabelled(rng: Rng, strength: float) -> Evidence:
    """The file has another number of coefficients than the model's name."""
    tree = yaml.safe_load(ros.write_one(healthy(rng)))
    held = tree["distortion_coefficients"]
    held["data"] = [*held["data"], 1e-3, 1e-4, 1e-5][: round(strength)]
    held["cols"] = len(held["data"])
    tree["distortion_model"] = "rational_polynomial" if strength == 5 else "plumb_bob"
    return as_file(yaml.safe_dump(tree))


@finding(
    "zero-distortion",
    severity="warning",
    view="numbers",
    symptom="All distortion coefficients are zero.",
    causes=("coefficients that were never estimated, or not kept", "a picture that was undistorted before"),
    remedy="Keep the coefficients that the calibration returns. If the pictures are undistorted already, "
    "write a format that has pinholes (camviz convert --to colmap), or pass --ignore zero-distortion.",
    threshold="All are zero and, where there are corners, k1 is at least five standard deviations from 0.",
    explains=(
        *VIEW_BY_VIEW,
        "models-differ",
        "rolling-shutter",
        "pose-absorbs-error",
        "model-too-simple",
        "split-disagreement",
    ),
)
def zero_distortion(evidence: Evidence) -> Iterator[Finding]:
    """The check reads the coefficients of a model that has some. Corners tell whether k1 would fit better."""
    if all(isinstance(camera.lens, Perspective) for camera in evidence.cameras.values()):
        raise NotChecked("the file describes pinholes, which have no distortion coefficients")
    for name, camera in evidence.cameras.items():
        if camera.lens in (BrownConrady(), KannalaBrandt()):
            yield from _zero(evidence, name)


def _zero(evidence: Evidence, name: str) -> Iterator[Finding]:
    sentence, observed = f"{name}: all distortion coefficients are 0", evidence.observed.get(name)
    if observed is None:
        yield zero_distortion.found(f"{sentence}.", 0, "", name)
        return
    bent = replace(observed.adjustment, estimated={name: ("fx", "fy", "cx", "cy", "k1")}).refined()
    k1, sigma = bent.intrinsics(name)[-1], float(np.sqrt(bent.intrinsics_covariance(name)[-1, -1]))
    if abs(k1) > STANDARD_ERRORS * sigma:
        yield zero_distortion.found(
            f"{sentence}, but the corners fit better with k1 = {k1:.3g} ± {sigma:.1g}.", k1, "", name
        )


@zero_distortion.fault("zeroed distortion", "of k1 = -0.2", (0.002, 0.3, 1), promised=0.3)
def zeroed(rng: Rng, strength: float) -> Evidence:
    """The coefficients were not kept. The corners were seen through so much of the lens."""
    set_up = single(rng)
    camera = replace(set_up.camera, lens=BrownConrady(k1=-0.2 * strength))
    set_up = replace(set_up, cameras=(camera,))
    set_up = replace(set_up, cam_from_board=spread_boards(rng, set_up.cameras, set_up.board, 15, (15, 40)))
    solved = set_up.solved(set_up.observed(rng))
    return Evidence(replace(solved, cameras={"camera": replace(solved.cameras["camera"], lens=BrownConrady())}))


@finding(
    "aspect",
    severity="warning",
    view="numbers",
    symptom="fx and fy differ.",
    causes=("pictures resized by different factors in width and height", "a camera matrix scaled along one axis only"),
    remedy="Rescale fx and cx by the width's factor, and fy and cy by the height's.",
    threshold="The ratio is 2 % from 1 and, where the file's corners tell it, five standard deviations.",
)
def aspect(evidence: Evidence) -> Iterator[Finding]:
    """The check divides fx by fy. Pixels of sensors are square to a few thousandths."""
    cameras = {name: each for name, each in evidence.cameras.items() if not isinstance(each.lens, PANORAMAS)}
    if not cameras:
        raise NotChecked("the pixels of a panorama are angles")
    for name, camera in cameras.items():
        ratio = camera.intrinsics.fx / camera.intrinsics.fy
        sigma = (evidence.sigma_of(name, "fx") or 0.0) / camera.intrinsics.fx
        if abs(np.log(ratio)) > max(SQUARE, STANDARD_ERRORS * sigma):
            wider = f"{abs(1 / ratio - 1) * 100:.3g} % {'wider' if ratio < 1 else 'narrower'}"
            yield aspect.found(f"{name}: fx/fy = {ratio:.4g}, as if pixels were {wider} than high.", ratio, "", name)


@aspect.fault("uneven resize", "times", (1.01, 1.05, 1.33), promised=1.05)
def resized_unevenly(rng: Rng, strength: float) -> Evidence:
    """Pictures were resized in width alone."""
    solved = healthy(rng)
    camera: Camera = solved.cameras["camera"]
    grid = camera.intrinsics.resized(round(camera.intrinsics.width * strength), camera.intrinsics.height)
    return Evidence(alone(solved, replace(camera, intrinsics=grid)))
