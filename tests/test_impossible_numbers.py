"""Numbers that are finite and absurd: whichever of a file has them, it is inspected or refused, and the clinic says so.

What is put in the place of a number is a million of its unit, its negative, a hundred thousand, next to nothing, none.
"""

import re
from dataclasses import replace
from pathlib import Path

import calibrations
import numpy as np
import pytest
from scipy.spatial.transform import RigidTransform, Rotation

from camviz.cameras import Camera, Intrinsics
from camviz.lenses import (
    BrownConrady,
    DoubleSphere,
    Equidistant,
    KannalaBrandt,
    Perspective,
    Stereographic,
    UnifiedSphere,
)
from camviz_clinic.calibration.difference import NothingSharedError, difference
from camviz_clinic.checks import inspect, inspect_file
from camviz_clinic.checks.findings.impossible import (
    FARTHEST,
    FOCAL,
    MAX_FOCAL_RATIO,
    MAX_LOST,
    MAX_OFF_CENTRE,
    MAX_PIXEL_ASPECT,
    MAX_TANGENTIAL,
    STRETCHED,
    stretched,
)
from camviz_clinic.files import Calibration, CalibrationError, formats, write

ABSURD = (b"1e6", b"-1e6", b"1e5", b"1e-9", b"0")
NUMBER = re.compile(rb"(?<![\w.#])[-+]?\d+(?:\.\d*)?(?:[eE][-+]?\d+)?(?![\w.])")
SIZE = (640, 480)
IMU = RigidTransform.from_components([0.05, 0.02, -0.01], Rotation.from_rotvec([-0.2, 0.1, 1.4]))
APART = RigidTransform.from_components([0.11, 0.002, -0.001], Rotation.from_rotvec([0.01, 0.02, -0.005]))
CAMERA = Camera(Intrinsics(*SIZE, 500.0, 500.0, 321.25, 239.5), BrownConrady(-0.2, 0.05, 1e-3, -1e-3))
PLAIN = replace(CAMERA, lens=Perspective())
BINARY = ("mat", "colmap-bin")
PAIR = {"left": CAMERA, "right": CAMERA.at(APART)}
SHIFTED = {"left": PLAIN, "right": PLAIN.at(RigidTransform.from_translation([0.11, 0, 0]))}


def rig(cameras, imu=None):
    return Calibration(cameras, Path("made.yml"), "made", world_from_imu=imu)


RIGS = (rig(PAIR, IMU), rig(PAIR), rig(SHIFTED), rig({"camera": CAMERA}, IMU), rig({"camera": PLAIN}))


def text_files(name, folder):
    """A format's example as its files by name: its own, or what it writes of a pair where it holds one."""
    if held := formats()[name].example:
        return {"": held}
    for made in RIGS:
        try:
            write(made, folder / "made.yml", name)
        except CalibrationError:
            continue
        path = folder / "made.yml"
        return {each.name: each.read_bytes() for each in path.iterdir()} if path.is_dir() else {"": path.read_bytes()}
    raise AssertionError(f"{name} writes none of the rigs")


def refusal(path, **options):
    """The sentence that a file is refused with; empty where it is inspected."""
    try:
        inspect_file(path, **options)
    except CalibrationError as error:
        return str(error)
    return ""


@pytest.mark.sampled(10)
@pytest.mark.parametrize("name", sorted(set(formats()) - set(BINARY)))
def test_a_file_with_an_absurd_number_is_inspected_or_refused(name, tmp_path, thorough):
    """Whatever else is raised fails the test."""
    files = text_files(name, tmp_path)
    places = [(file, match.span()) for file, text in files.items() for match in NUMBER.finditer(text)]
    draws = [(place, value) for place in places for value in ABSURD]
    if not thorough:
        draws = [draws[index] for index in np.random.default_rng(len(draws)).choice(len(draws), 2, replace=False)]
    path = tmp_path / "damaged.yml"
    for (file, (start, end)), value in draws:
        changed = files | {file: files[file][:start] + value + files[file][end:]}
        path.mkdir(exist_ok=True) if "" not in files else None
        for each, text in changed.items():
            (path / each if each else path).write_bytes(text)
        said = refusal(path, size=SIZE)
        said = refusal(path) if "leave the size out" in said else said
        assert said == "" or (path.name in said and "\n" not in said), said


def findings(calibration):
    return [each for each in inspect(calibration).findings if each.id == "impossible-numbers"]


def with_lens(**values):
    return replace(CAMERA, lens=replace(CAMERA.lens, **values))


@pytest.mark.thorough
def test_a_pair_whose_halves_share_no_rays_is_inspected_and_its_numbers_are_named():
    """The corners of the left camera, solved anew from a skew of 100,000, lead nowhere: not checked, and why."""
    pair = calibrations.pair()
    left, right = pair.cameras.values()
    broken = replace(left, intrinsics=replace(left.intrinsics, skew=1e5))
    inspection = inspect(replace(pair, cameras={"left": broken, "right": right}))
    (found,) = [each for each in inspection.findings if each.id == "impossible-numbers"]
    points = np.stack([pose.apply(pair.board.corners) for pose in pair.cam_from_board["left"]])
    off = np.linalg.norm(broken.project(points) - pair.detections["left"], axis=-1)
    assert found.value == pytest.approx(np.nanmedian(off), rel=1e-6)
    assert found.camera == "left"
    assert "have no rays in common (left)" in dict(inspection.skipped)["split-disagreement"]


def test_two_cameras_that_share_no_rays_have_no_difference():
    beside = replace(PLAIN, intrinsics=replace(PLAIN.intrinsics, cx=1e8))
    lens = BrownConrady(k1=-1e5)
    with pytest.raises(NothingSharedError, match="at least three rays must be known to both cameras"):
        difference(replace(PLAIN, lens=lens), replace(beside, lens=lens))


@pytest.mark.parametrize("key", ["fx", "fy"])
@pytest.mark.parametrize(("low", "high"), [(FOCAL[0] * (1 - 1e-9), FOCAL[1] * (1 + 1e-9)), FOCAL])
def test_a_focal_length_outside_the_range_of_lenses_is_named_and_its_ends_are_not(key, low, high):
    """A hundredth of 640 pixels is 6.4, and a thousand times is 640,000."""
    for share in (low, high):
        camera = replace(PLAIN, intrinsics=replace(PLAIN.intrinsics, **{key: 640 * share}))
        said = [each.sentence for each in findings(rig({"camera": camera})) if "longer side" in each.sentence]
        named = [each for each in said if f"{key} = " in each]
        assert len(named) == (share not in FOCAL)


@pytest.mark.parametrize("others", [[], [0.3]])
def test_a_camera_that_stands_beyond_any_rig_is_named_and_one_at_the_limit_is_not(others):
    for away in (FARTHEST, FARTHEST * 1.001):
        places = [0.0, *others, away + max(others, default=0)]
        cameras = {f"cam{i}": CAMERA.at(RigidTransform.from_translation([0, x, 0])) for i, x in enumerate(places)}
        found = findings(rig(cameras))
        assert [each.value for each in found] == pytest.approx([away] * (away > FARTHEST))
        assert [each.camera for each in found] == ["cam2" if others else None] * len(found)


def test_a_scene_in_its_own_unit_may_be_as_wide_as_it_likes():
    cameras = {"a": CAMERA, "b": CAMERA.at(RigidTransform.from_translation([1e6, 0, 0]))}
    assert len(findings(rig(cameras))) == 1
    assert findings(Calibration(cameras, Path("made"), "COLMAP")) == []


@pytest.mark.parametrize("beyond", [1 - 1e-6, 1 + 1e-6])
def test_a_border_that_is_stretched_beyond_any_lens_is_named_and_one_at_the_limit_is_not(beyond):
    """r_d = r + k1 r³ is three times r where k1 = 2/r², at the pixel farthest from the principal point."""
    r_d = np.linalg.norm(np.array([321.25, 239.5]) / 500)
    camera = replace(CAMERA, lens=BrownConrady(k1=beyond * 18 / r_d**2))
    assert stretched(camera) == pytest.approx(3, rel=1e-6)
    assert [each.value > STRETCHED for each in findings(rig({"camera": camera}))] == [True] * (beyond > 1)


@pytest.mark.parametrize(
    "lens",
    [
        Perspective(),
        BrownConrady(0.1, 0.02),
        KannalaBrandt(0.07, -0.01, 0.002, -0.0005),
        Equidistant(),
        Stereographic(),
        UnifiedSphere(1.7, -0.2, 0.04),
        DoubleSphere(-0.2, 0.55),
    ],
    ids=lambda lens: type(lens).__name__,
)
@pytest.mark.parametrize("focal", [150.0, 500.0, 4000.0])
def test_lenses_that_there_are_stretch_the_border_less(lens, focal):
    assert stretched(Camera(replace(CAMERA.intrinsics, fx=focal, fy=focal), lens)) < 1.6


def with_grid(**values):
    return replace(PLAIN, intrinsics=replace(PLAIN.intrinsics, **values))


def folding_at(lost):
    """k1 < 0 alone: r + k1 r³ turns back at r² = 1/(-3 k1), where it is 2/3 r; so large is the picture's circle."""
    radius = np.sqrt((1 - lost) * 640 * 480 / np.pi) / 500
    return replace(CAMERA, lens=BrownConrady(k1=-4 / 27 / radius**2))


@pytest.mark.parametrize(
    ("make", "limit", "slack"),
    [
        (lambda p: with_lens(p1=-p), MAX_TANGENTIAL, 1e-9),
        (lambda p: with_lens(p2=p), MAX_TANGENTIAL, 1e-9),
        (lambda s: with_lens(s1=s), 3 * MAX_TANGENTIAL, 1e-9),
        (lambda off: with_grid(cx=319.5 - 640 * off), MAX_OFF_CENTRE, 1e-9),
        (lambda off: with_grid(cx=319.5, cy=239.5 + 640 * off), MAX_OFF_CENTRE, 1e-9),
        (lambda ratio: with_grid(fy=500 / ratio), MAX_PIXEL_ASPECT, 1e-9),
        (folding_at, MAX_LOST, 0.01),
    ],
    ids=["p1", "p2", "s1", "cx", "cy", "aspect", "lost"],
)
def test_an_impossible_magnitude_is_named_from_its_bound_on(make, limit, slack):
    below, above = (findings(rig({"camera": make(limit * by)})) for by in (1 - slack, 1 + slack))
    assert (len(below), len(above)) == (0, 1)


def test_the_bound_of_tangential_coefficients_is_a_tilt_of_17_degrees():
    """A sensor tilted by τ about y has x/(1 - x tan τ), by OpenCV's own tilted model; p2 gives x + 3 p2 x² on y = 0."""
    x, tau = 1e-3, np.arctan(3 * MAX_TANGENTIAL)
    tilted = BrownConrady(tau_y=tau).distort([[x, 0], [-x, 0]])[:, 0]
    bent = BrownConrady(p2=MAX_TANGENTIAL).distort([[x, 0], [-x, 0]])[:, 0]
    assert np.degrees(tau) == pytest.approx(16.7, abs=0.05)
    assert abs(tilted.sum()) == pytest.approx(bent.sum(), rel=0.1)


@pytest.mark.parametrize("ratio", [3 / 4 * 9 / 16 * 4 / 3, 1 / 2, 9 / 16 * 4 / 3, 2])
def test_an_aspect_that_resizing_or_binning_explains_is_possible(ratio):
    assert findings(rig({"camera": with_grid(fy=500 / ratio)})) == []


def test_like_cameras_of_a_pair_with_very_different_focal_lengths_are_named():
    """Not cameras with pictures of two sizes, nor three cameras."""
    for ratio, count in ((MAX_FOCAL_RATIO * (1 - 1e-9), 0), (MAX_FOCAL_RATIO * (1 + 1e-9), 1)):
        f = {"fx": 500 * ratio, "fy": 500 * ratio}
        right = replace(with_grid(**f), world_from_cam=APART)
        assert len(findings(rig({"cam0": PLAIN, "cam1": right}))) == count
        larger = replace(right, intrinsics=replace(right.intrinsics, width=1280, height=960, cx=640, cy=480))
        assert findings(rig({"cam0": PLAIN, "cam1": larger})) == []
        assert findings(rig({"cam0": PLAIN, "cam1": right, "cam2": PLAIN.at(IMU)})) == []


def test_the_published_runaway_pair_and_uneven_camera_are_impossible():
    """Two public reports: fx = 474 and 3808 px of two like cameras, and pixels 1.58 times as high as wide."""
    first = Camera(Intrinsics(648, 486, 474.318, 477.518, 346.873, 244.364))
    second = Camera(Intrinsics(648, 486, 3808.49, 3826.463, 304.443, 233.327)).at(APART)
    assert ["474.3 and 3808" in each.sentence for each in findings(rig({"cam0": first, "cam1": second}))] == [True]
    uneven = Camera(Intrinsics(1280, 960, 3039.117, 4814.029, 644.948, 431.326))
    assert ["1.58 times" in each.sentence for each in findings(rig({"camera": uneven}))] == [True]
