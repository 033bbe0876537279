"""The remedy that a finding prints, carried out on the fault that led to it: the finding is gone.

A remedy is carried out where an edit of the file or a command can do it. What only new pictures or a hand can do is
listed with its reason.
"""

import re
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.spatial.transform import RigidTransform

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady
from camviz_clinic.calibration import calibrate
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.checks import Inspection, faults, inspect, inspect_file
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.findings.described import CHARUCO
from camviz_clinic.checks.findings.frames import with_right
from camviz_clinic.checks.findings.lens import CLOSE_PX, round_trip
from camviz_clinic.checks.rig import FLIPPED
from camviz_clinic.checks.virtual import changed, detections, healthy_pair
from camviz_clinic.files import Calibration, ros, write

FAULTS = faults()
SEED = 20_003


def rng():
    return np.random.default_rng(SEED)


def grid_of(evidence):
    return evidence.calibration.cameras["camera"].intrinsics


def edited(evidence, **values):
    """Other numbers in the camera matrix of the file."""
    return replace(evidence, calibration=changed(evidence.calibration, **values))


def with_lens(evidence, lens):
    calibration = evidence.calibration
    cameras = {name: replace(camera, lens=lens) for name, camera in calibration.cameras.items()}
    return replace(evidence, calibration=replace(calibration, cameras=cameras))


def said_by(evidence, id):
    return next(each for each in Inspection.of(evidence).findings if each.id == id)


def numbers(text):
    return [float(each) for each in re.findall(r"[-+]?\d+\.?\d*", text)]


def solved_again(evidence, model="standard", leave_out=(), **options):
    """`camviz calibrate` with the corners in the file, without some views."""
    calibration = evidence.calibration
    corners = np.delete(calibration.detections["camera"], leave_out, axis=0)
    seen = detections(calibration.cameras["camera"], corners)
    return Evidence(calibrate(seen, calibration.board, model, **options))


def without_the_views_named(id):
    def remedy(evidence):
        named = {view for each in Inspection.of(evidence).findings if each.id == id for view in each.pictures}
        return solved_again(evidence, leave_out=sorted(named))

    return remedy


def unfolded(evidence):
    """Fix k3 to 0."""
    remedy = said_by(evidence, "fold").remedy
    terms = re.match(r"Fix (.+) to 0", remedy)[1].replace(" and ", ", ").split(", ")
    lens = evidence.calibration.cameras["camera"].lens
    return with_lens(evidence, replace(lens, **dict.fromkeys(terms, 0.0)))


def half_a_pixel_back(evidence):
    dx, dy = numbers(said_by(evidence, "half-pixel").remedy)[:2]
    return edited(evidence, cx=grid_of(evidence).cx + dx, cy=grid_of(evidence).cy + dy)


def size_exchanged(evidence):
    return edited(evidence, width=grid_of(evidence).height, height=grid_of(evidence).width)


def rescaled_to_the_image(evidence):
    """K is for pictures of 1.5 times the size: s = 1/1.5."""
    grid, s = grid_of(evidence), 1 / said_by(evidence, "wrong-size").value
    return edited(evidence, fx=s * grid.fx, fy=s * grid.fy, cx=s * grid.cx + (s - 1) / 2, cy=s * grid.cy + (s - 1) / 2)


def rescaled_to_the_pictures(evidence):
    grid, ((width, height),) = grid_of(evidence), set(evidence.sizes.values())
    s = width / grid.width
    scaled = edited(
        evidence, fx=s * grid.fx, fy=s * grid.fy, cx=s * grid.cx + (s - 1) / 2, cy=s * grid.cy + (s - 1) / 2
    )
    return edited(scaled, width=width, height=height)


def width_rescaled(evidence):
    grid, s = grid_of(evidence), 1 / said_by(evidence, "aspect").value
    return edited(evidence, width=round(s * grid.width), fx=s * grid.fx, cx=s * grid.cx + (s - 1) / 2)


def left_and_right_exchanged(evidence):
    cameras = dict(zip(("left", "right"), reversed(evidence.calibration.cameras.values()), strict=True))
    return Evidence(replace(evidence.calibration, cameras=cameras))


def lenses_exchanged(evidence):
    left, right = evidence.calibration.cameras.values()
    cameras = {"left": right.at(left.world_from_cam), "right": left.at(right.world_from_cam)}
    return Evidence(replace(evidence.calibration, cameras=cameras))


def transform_inverted(evidence):
    right = evidence.calibration.cameras["right"]
    return replace(evidence, calibration=with_right(evidence.calibration, right.world_from_cam))


def lengths_divided(evidence):
    """All translations by the number in the sentence; the board's squares go with them."""
    calibration, by = evidence.calibration, 1.03
    cameras = {
        name: camera.at(
            RigidTransform.from_components(camera.world_from_cam.translation / by, camera.world_from_cam.rotation)
        )
        for name, camera in calibration.cameras.items()
    }
    return replace(evidence, calibration=replace(calibration, cameras=cameras))


def square_as_measured(evidence):
    """Solved again with the right --square-mm."""
    return Evidence(healthy_pair(rng()))


def axes_negated(evidence):
    poses = {name: FLIPPED * pose for name, pose in evidence.calibration.cam_from_board.items()}
    return replace(evidence, calibration=replace(evidence.calibration, cam_from_board=poses))


def order_turned(evidence):
    calibration = evidence.calibration
    right = calibration.detections["right"].copy()
    views = [view for each in Inspection.of(evidence).findings if each.id == "corner-order" for view in each.pictures]
    right[views] = right[views, ::-1]
    return Evidence(replace(calibration, detections={**calibration.detections, "right": right}))


def described_as_printed(evidence):
    shown = evidence.shown
    return replace(evidence, shown=replace(shown, board=replace(CHARUCO, legacy=True)))


def refined_with(*names):
    """Solved again with these parameters free."""

    def remedy(evidence):
        start = replace(Adjustment.of(evidence.calibration), estimated={"camera": ("fx", "fy", "cx", "cy", *names)})
        best = start.refined()
        poses = {"camera": best.first_from_board}
        return Evidence(
            replace(
                evidence.calibration, cameras=best.cameras, cam_from_board=poses, estimated=best.estimated, set_aside={}
            )
        )

    return remedy


def two_more_cameras_named_right(evidence):
    cameras = evidence.calibration.cameras
    crossed = Inspection.of(evidence).findings
    first, second = re.match(
        r"(\S+) and (\S+) are", next(e.sentence for e in crossed if e.id == "rig-exchanged")
    ).groups()
    swap = {first: second, second: first}
    return replace(
        evidence, calibration=replace(evidence.calibration, cameras={n: cameras[swap.get(n, n)] for n in cameras})
    )


STANDARD = ("k1", "k2", "p1", "p2", "k3")
REMEDIES = {
    "four coefficients": lambda evidence: replace(evidence, calibration=replace(evidence.calibration, notes=())),
    "zeroed distortion": refined_with(*STANDARD),
    "uneven resize": width_rescaled,
    "resized K": rescaled_to_the_image,
    "sides exchanged": size_exchanged,
    "resized pictures": rescaled_to_the_pictures,
    "folding polynomial": unfolded,
    "near-pole rational model": solved_again,
    "outlier corner": without_the_views_named("outlier-view"),
    "blurred view": without_the_views_named("outlier-view"),
    "column off": without_the_views_named("outlier-line"),
    "rows swapped": without_the_views_named("outlier-line"),
    "rational model of a mild lens": solved_again,
    "thin prism and tilt": solved_again,
    "lens too rich": refined_with(*STANDARD),
    "warped board": lambda evidence: solved_again(evidence, board_warp="on"),
    "half pixel": half_a_pixel_back,
    "half pixel between two": half_a_pixel_back,
    "swapped cameras": left_and_right_exchanged,
    "swapped cameras, rectified": left_and_right_exchanged,
    "two baselines": lengths_divided,
    "square in millimetres": square_as_measured,
    "wrong square": square_as_measured,
    "lenses or pictures exchanged": lenses_exchanged,
    "inverted transform": transform_inverted,
    "OpenGL axes": axes_negated,
    "order flipped": order_turned,
    "legacy pattern": described_as_printed,
}
BY_FILE = {
    *("edited rotation", "transposed K", "mislabelled coefficients", "axis reversed", "camera not calibrated"),
    *("place not said", "camera moved in one place", "strong lens", "crop"),
}  # below, as edits of a file
NOT_MECHANICAL = {
    "new pictures or views": {
        *("column set aside", "boards in the middle", "parallel boards", "few noisy views", "moved centre"),
        *("boards parallel to the sensor", "terms without corners", "few views", "rolling shutter", "bending board"),
        *("autofocus drift", "loose board", "by a homography", "cameras in two groups", "one frame in common"),
        *("board on a turntable", "camera a frame late", "camera knocked", "moved zoom", "runaway focal length"),
    },
    "the true numbers": {"misplaced coefficient", "misplaced tangential coefficient", "right camera turned"},
    "which of two calibrations is right": {"other lens"},
    "as legacy pattern, by another option of the board": {"sides swapped", "wide border", "numbered later"},
    "tests/test_rig_findings.py has smaller ones": {"two folders exchanged"},
}


def test_every_fault_says_whether_its_remedy_is_carried_out():
    parts = [set(REMEDIES), BY_FILE, *NOT_MECHANICAL.values()]
    assert sum(map(len, parts)) == len(set().union(*parts))
    assert set().union(*parts) == set(FAULTS)


@pytest.mark.parametrize("name", REMEDIES)
def test_the_remedy_of_a_finding_takes_it_away(name):
    fault = FAULTS[name]
    evidence = fault.inject(rng(), fault.promised)
    assert fault.finding in {each.id for each in Inspection.of(evidence).findings}
    better = REMEDIES[name](evidence)
    assert fault.finding not in {each.id for each in Inspection.of(better).findings}


# Edits of a file -----------------------------------------------------------------------------------------------------

GRID = Intrinsics(640, 480, 535.9, 536.1, 322.3, 235.6)
LENS = BrownConrady(-0.266, -0.0386, 0.00178, -0.00028, 0.238)
CAMERA = Calibration({"camera": Camera(GRID, LENS)}, Path("made"), "made")
MILD = BrownConrady(-0.1, 0.01)
PAIR = {
    "cam0": Camera(GRID, MILD),
    "cam1": Camera(GRID, MILD).at(RigidTransform.from_translation([0.11, 0, 0])),
}


def found_in(path, tree):
    path.write_text(yaml.safe_dump(tree, sort_keys=False))
    return {each.id: each for each in inspect_file(path).findings}


@pytest.mark.parametrize(
    ("id", "damage", "repair", "remedy"),
    [
        ("bad-k", lambda K: K.T, lambda K: K.T, "Transpose K."),
        ("bad-k", lambda K: 4 * K, lambda K: K / K[2, 2], "Divide k by K[2, 2] = 4."),
        ("bad-k", lambda K: 4 * K.T, lambda K: K.T / K[2, 2], "Transpose K and divide K by K[2, 2] = 4."),
        ("reversed-axis", lambda K: K * [[1], [-1], [1]] * [1, 1, 1], None, "Write fy without the minus"),
        ("not-calibrated", lambda K: 0 * K, None, "Calibrate the camera"),
    ],
)
def test_the_remedy_for_a_camera_matrix_makes_one(tmp_path, id, damage, repair, remedy):
    tree = yaml.safe_load(ros.write(CAMERA))
    K = np.array(tree["camera_matrix"]["data"]).reshape(3, 3)
    repair = repair or (lambda _: K)
    tree["camera_matrix"]["data"] = damage(K).ravel().tolist()
    assert remedy.lower() in found_in(tmp_path / "bad.yaml", tree)[id].remedy.lower()
    tree["camera_matrix"]["data"] = repair(damage(K)).ravel().tolist()
    assert id not in found_in(tmp_path / "good.yaml", tree)


@pytest.mark.parametrize(
    ("model", "coefficients", "remedy", "edits"),
    [
        ("plumb_bob", [-0.2, 0.05, 1e-3, 1e-4], "add k3 = 0 as the fifth number", [("plumb_bob", [0.0], 5)]),
        ("plumb_bob", [-0.02, 0.01, 1e-3, 1e-4], "write equidistant", [("equidistant", [], 4)]),
        ("rational_polynomial", [-0.2, 0.05, 1e-3, 1e-4], "write plumb_bob and add k3 = 0", [("plumb_bob", [0.0], 5)]),
        ("rational_polynomial", [-0.2, 0.05, 1e-3, 1e-4, 0.01], "Write plumb_bob", [("plumb_bob", [], 5)]),
        ("plumb_bob", [-0.2, 0.05, 1e-3, 1e-4, 0.01, 0.1, 0.1, 0.1], "Write rational",
         [("rational_polynomial", [], 8)]),
        ("plumb_bob", [-0.2, 0.05, 1e-3, 1e-4, 0.01, 0, 0, 0], "Delete the last 3 numbers", [("plumb_bob", [], 5)]),
        ("rational_polynomial", [0.1, -0.2, 1e-3, 2e-4, 0.1, 0.05, -0.1, 0.03] + 6 * [0], "Delete the last 6 numbers",
         [("rational_polynomial", [], 8)]),
        ("equidistant", [-0.2, 0.05, 1e-3, 1e-4, 0.01], "Write plumb_bob", [("plumb_bob", [], 5)]),
        ("equidistant", [-0.02, 0.01, 1e-3, 1e-4, 0], "Delete the last number", [("equidistant", [], 4)]),
    ],
)  # fmt: skip
def test_the_remedy_for_a_count_of_coefficients_helps(tmp_path, model, coefficients, remedy, edits):
    tree = yaml.safe_load(ros.write(CAMERA))
    tree["distortion_model"] = model
    tree["distortion_coefficients"] = {"rows": 1, "cols": len(coefficients), "data": [*map(float, coefficients)]}
    finding = found_in(tmp_path / "bad.yaml", tree)["coefficient-count"]
    assert remedy in finding.remedy
    for name, more, count in edits:
        data = [*map(float, coefficients), *more][:count]
        good = {**tree, "distortion_model": name, "distortion_coefficients": {"rows": 1, "cols": count, "data": data}}
        assert "coefficient-count" not in found_in(tmp_path / "good.yaml", good)


def test_fourteen_coefficients_that_all_count_are_read_from_opencvs_file(tmp_path):
    """ROS has no model for thin prisms and tilts; OpenCV's YAML has."""
    values = [0.1, -0.2, 1e-3, 2e-4, 0.1, 0.05, -0.1, 0.03, 1e-3, 0, 1e-3, 0, 0.01, 0.02]
    tree = yaml.safe_load(ros.write(CAMERA)) | {"distortion_model": "rational_polynomial"}
    tree["distortion_coefficients"] = {"rows": 1, "cols": 14, "data": values}
    assert "OpenCV's YAML" in found_in(tmp_path / "bad.yaml", tree)["coefficient-count"].remedy
    camera = Calibration({"camera": Camera(GRID, BrownConrady(*values))}, Path("made"), "made")
    write(camera, tmp_path / "good.yml", "opencv")
    assert "coefficient-count" not in {each.id for each in inspect_file(tmp_path / "good.yml").findings}


def test_the_remedies_for_a_kalibr_chain_help(tmp_path):
    """A rotation with an edited element; a camera without a place; a step that contradicts the IMU's transforms."""
    write(
        Calibration(PAIR, Path("made"), "made", world_from_imu=RigidTransform.identity()), tmp_path / "c.yaml", "kalibr"
    )
    text = (tmp_path / "c.yaml").read_text()
    good, bad = yaml.safe_load(text), yaml.safe_load(text)
    assert found_in(tmp_path / "good.yaml", good).keys() == set()
    bad["cam1"]["T_cn_cnm1"][0][1] += 0.01
    assert {"not-a-rotation"} <= found_in(tmp_path / "bad.yaml", bad).keys()
    bad = yaml.safe_load(text)
    bad["cam1"]["T_cn_cnm1"][0][3] += 0.003
    assert {"contradiction"} <= found_in(tmp_path / "bad.yaml", bad).keys()
    for part in bad.values():
        part.pop("T_cam_imu")
    assert "contradiction" not in found_in(tmp_path / "good.yaml", bad)
    bad["cam1"].pop("T_cn_cnm1")
    assert {"assumed-reading"} <= found_in(tmp_path / "bad.yaml", bad).keys()


def test_a_crop_applied_to_the_principal_point_is_no_longer_found():
    """The middle 60 % of the width: the first pixel of the crop is 128."""
    uncropped = replace(GRID, width=384)
    found = [{e.id for e in inspect(Calibration({"c": Camera(each, LENS)}, Path("made"), "made")).findings}
             for each in (uncropped, replace(uncropped, cx=GRID.cx - 128))]  # fmt: skip
    assert ["principal-point" in each for each in found] == [True, False]


def test_the_criteria_that_are_advised_bring_opencvs_inverse_home():
    """24_full.xml's lens needs more than five steps, and a strong one of 80° 100."""
    full = BrownConrady(0.29717157478222633, -2.4931471522485045, 0, 0, 7.0091780164034398)
    for camera in (
        Camera(Intrinsics(1280, 960, 1000, 1000, 639.5, 479.5), full),
        FAULTS["strong lens"].inject(rng(), 0.35).calibration.cameras["camera"],
    ):
        (finding,) = inspect(Calibration({"c": camera}, Path("made"), "made")).findings
        steps = int(re.search(r"EPS, (\d+),", finding.remedy)[1])
        assert round_trip(camera) > CLOSE_PX >= round_trip(camera, steps)


def test_a_fold_that_no_term_explains_says_how_far_the_image_can_be_used():
    """14_rostopic.txt: without k2 it folds inside the image as well. Within the radius every pixel has a ray."""
    camera = Camera(GRID, replace(LENS, k3=0.0, p1=0.0, p2=0.0))
    (finding, *_) = inspect(Calibration({"c": camera}, Path("made"), "made")).findings
    assert finding.id == "fold"
    (radius,) = numbers(re.search(r"within .* px", finding.remedy)[0])
    around = np.linspace(0, 2 * np.pi, 32, endpoint=False)
    for by, seen in ((0.995, True), (1.005, False)):
        pixels = [GRID.cx, GRID.cy] + by * radius * np.stack([np.cos(around), np.sin(around)], axis=-1)
        assert np.isfinite(camera.unproject(pixels)).all() == seen
