"""Gyroflow's lens profiles: what Gyroflow projects with, and what is said of the rest of a profile.

The equations stand here by themselves, or are OpenCV's; the profile is in Gyroflow's layout, its numbers are made.
"""

import json

import cv2
import numpy as np
import pytest

import camviz_clinic
from camviz.cameras import Camera, Intrinsics
from camviz.lenses import BrownConrady, Equidistant, KannalaBrandt, Perspective, UnifiedSphere
from camviz_clinic.calibration.stamp import Stamp
from camviz_clinic.commands import command
from camviz_clinic.files import Calibration, CalibrationError, write

POINTS = np.random.default_rng(5).uniform([-1.2, -0.7, 0.6], [1.2, 0.7, 3.0], size=(200, 3))
K4 = [0.03125, -0.0625, 0.015625, -0.0078125]
FX, FY, CX, CY = 1825.5, 1820.25, 1931.0, 1066.5


def profile(**changes):
    """A profile as Gyroflow 1.6 writes it; changes of `fisheye_params` have its keys, None takes a key away."""
    held = {
        "RMS_error": 0.5,
        "camera_matrix": [[FX, 0.0, CX], [0.0, FY, CY], [0.0, 0.0, 1.0]],
        "distortion_coeffs": K4,
        "radial_distortion_limit": None,
    }
    tree = {
        "name": "Maker_One_Wide__4k_16by9_3840x2160-59.94fps",
        "note": "",
        "calibrated_by": "somebody",
        "camera_brand": "Maker",
        "camera_model": "One",
        "lens_model": "Wide",
        "camera_setting": "NO-EIS",
        "calib_dimension": {"w": 3840, "h": 2160},
        "orig_dimension": {"w": 3840, "h": 2160},
        "output_dimension": {"w": 3840, "h": 2160},
        "frame_readout_time": None,
        "gyro_lpf": 0.0,
        "input_horizontal_stretch": 1.0,
        "input_vertical_stretch": 1.0,
        "num_images": 15,
        "fps": 59.94,
        "crop": None,
        "official": False,
        "asymmetrical": True,
        "fisheye_params": held,
        "identifier": "",
        "calibrator_version": "1.6.3",
        "date": "2025-03-04",
        "compatible_settings": [],
        "sync_settings": None,
        "distortion_model": None,
        "digital_lens": None,
        "digital_lens_params": None,
        "interpolations": None,
        "focal_length": 12.5,
        "crop_factor": None,
        "global_shutter": False,
    }
    for key, value in changes.items():
        part = held if key in held else tree
        if value is None:
            part.pop(key)
        else:
            part[key] = value
    return tree


@pytest.fixture
def loaded(tmp_path):
    """What is read of a profile with changes."""

    def load(**changes):
        path = tmp_path / "profile.json"
        path.write_text(json.dumps(profile(**changes)))
        return camviz_clinic.load(path)

    return load


def fisheye(points, K, D):
    return cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), np.array(K), np.array(D))[0][:, 0]


def matrix(cx=CX, cy=CY):
    return [[FX, 0, cx], [0, FY, cy], [0, 0, 1]]


def check(calibration, expected):
    np.testing.assert_allclose(calibration.cameras["camera"].project(POINTS), expected, rtol=0, atol=1e-8)


def test_a_profile_projects_as_opencvs_fisheye_does(loaded):
    calibration = loaded()
    check(calibration, fisheye(POINTS, matrix(), K4))
    assert calibration.format == "Gyroflow lens profile"
    assert calibration.notes == ("The profile says that its RMS error was 0.5 px.",)
    grid = calibration.cameras["camera"].intrinsics
    assert (grid.width, grid.height) == (3840, 2160)


@pytest.mark.parametrize("said", [False, None])
def test_the_principal_point_is_the_middle_unless_the_profile_is_asymmetrical(loaded, said):
    """Gyroflow does not use cx and cy of the solution then; the distance is said."""
    calibration = loaded(asymmetrical=said)
    check(calibration, fisheye(POINTS, matrix(1920, 1080), K4))
    assert calibration.notes[0] == (
        "Gyroflow takes the middle (1920, 1080) for the principal point, as the profile is not asymmetrical; it was "
        "solved for at (1931.00, 1066.50), 17.4 px away."
    )


def test_four_zeros_are_a_pinhole_to_gyroflow_and_no_equidistant_fisheye(loaded):
    calibration = loaded(distortion_coeffs=[0.0] * 4)
    assert calibration.cameras["camera"].lens == Perspective()


def brown_conrady(D):
    return cv2.projectPoints(POINTS, np.zeros(3), np.zeros(3), np.array(matrix(), float), np.array(D, float))[0][:, 0]


def radial(*coefficients):
    """x (1 + k1 r² + k2 r⁴), Gyroflow's poly5, or poly3 with one coefficient."""
    x, y = (POINTS[:, :2] / POINTS[:, 2:]).T
    r2 = x * x + y * y
    scale = 1 + sum(k * r2 ** (power + 1) for power, k in enumerate(coefficients))
    return np.stack([FX * x * scale + CX, FY * y * scale + CY], axis=-1)


def insta360(k1, k2, p1, p2, xi):
    """To the unit sphere, seen from xi behind its centre, then distorted: k1 k2 k3 p1 p2 xi in the file."""
    x, y, z = (POINTS / np.linalg.norm(POINTS, axis=1)[:, None]).T
    x, y = x / (z + xi), y / (z + xi)
    r2 = x * x + y * y
    scale = 1 + k1 * r2 + k2 * r2**2
    u = x * scale + 2 * p1 * x * y + p2 * (r2 + 2 * x * x)
    v = y * scale + 2 * p2 * x * y + p1 * (r2 + 2 * y * y)
    return np.stack([FX * u + CX, FY * v + CY], axis=-1)


STANDARD = [0.02, 0.003, 1e-3, -2e-3, 4e-4, 0.01, 2e-3, 1e-4, 1e-3, 2e-4, -1e-3, 3e-4]
SPHERE = (0.02, 0.003, 1e-3, -2e-3, 0.75)
OTHERS = {
    "opencv_fisheye": (K4, lambda: fisheye(POINTS, matrix(), K4)),
    "opencv_standard": (STANDARD, lambda: brown_conrady(STANDARD)),
    "poly3": ([0.0625], lambda: radial(0.0625)),
    "poly5": ([0.0625, 0.015625], lambda: radial(0.0625, 0.015625)),
    "insta360": ([*SPHERE[:2], 0.0, *SPHERE[2:]], lambda: insta360(*SPHERE)),
}


@pytest.mark.parametrize("model", OTHERS)
def test_each_model_projects_by_its_own_equation(loaded, model):
    coefficients, expected = OTHERS[model]
    check(loaded(distortion_model=model, distortion_coeffs=coefficients), expected())


@pytest.mark.parametrize("model", OTHERS)
def test_what_gyroflow_fills_with_zeros_may_be_there_or_not(loaded, model):
    coefficients, expected = OTHERS[model]
    padded = [*coefficients, *[0.0] * (12 - len(coefficients))]
    check(loaded(distortion_model=model, distortion_coeffs=padded), expected())


REFUSED = {
    "distortion_model: expected opencv_fisheye or .* got 'ptlens'": {"distortion_model": "ptlens"},
    "distortion_model: .* got 'sony'": {"distortion_model": "sony"},
    "distortion_model: .* got 'generic_polynomial'": {"distortion_model": "generic_polynomial"},
    "distortion_model: .* got 'gopro'": {"distortion_model": "gopro"},
    "digital_lens: expected none, .* got gopro_superview": {"digital_lens": "gopro_superview"},
    "0 as k3 of insta360": {"distortion_model": "insta360", "distortion_coeffs": [0.1, 0, 0.2, 0, 0, 0.9]},
    "distortion_coeffs: expected 4 numbers for opencv_fisheye, with zeros": {"distortion_coeffs": [*K4, 0.5]},
    "distortion_coeffs: expected 1, .* or 12 numbers .* got 13": {"distortion_coeffs": [0.0] * 13},
    "camera_matrix: expected 3×3 numbers, got 0": {"camera_matrix": []},
    "camera_matrix: expected no skew, .* got 2": {"camera_matrix": [[FX, 2.0, CX], [0.0, FY, CY], [0.0, 0.0, 1.0]]},
    "got fx = -1825.5 and fy = 1820.25 px: the x axis points left": {
        "camera_matrix": [[-FX, 0, CX], [0, FY, CY], [0, 0, 1]]
    },
    "crop: expected a positive number, got 0": {"crop": 0.0},
    "frame_readout_direction: expected TopToBottom or": {
        "frame_readout_time": 8.0,
        "frame_readout_direction": "Sideways",
    },
}


@pytest.mark.parametrize("sentence", REFUSED)
def test_what_no_lens_here_can_hold_is_refused_by_name(loaded, sentence):
    with pytest.raises(CalibrationError, match=sentence) as caught:
        loaded(**REFUSED[sentence])
    assert "\n" not in str(caught.value)


def test_a_crop_divides_the_focal_lengths(loaded):
    grid = loaded(crop=1.25).cameras["camera"].intrinsics
    assert (grid.fx, grid.fy, grid.cx, grid.cy) == pytest.approx((FX / 1.25, FY / 1.25, CX, CY), abs=1e-12)


SAID = {
    "A frame is read out in 16.25 ms, from the top: the camera here has no rolling shutter.": {
        "frame_readout_time": 16.25
    },
    "A frame is read out in 16.25 ms, from the bottom: the camera here has no rolling shutter.": {
        "frame_readout_time": -16.25
    },
    "A frame is read out in 16.25 ms, from the left: the camera here has no rolling shutter.": {
        "frame_readout_time": 16.25,
        "frame_readout_direction": "LeftToRight",
    },
    "The profile ends 45.0° from the axis (radial_distortion_limit 1): the camera here does not.": {
        "radial_distortion_limit": 1.0
    },
    "Gyroflow stretches recorded pictures by 1.5 in width and 1 in height: this camera is for pictures resized to "
    "calib_dimension.": {"input_horizontal_stretch": 1.5},
    "The recorded pictures have 2704×1520 px; this camera is for calib_dimension.": {
        "orig_dimension": {"w": 2704, "h": 1520}
    },
    "The profile changes with the zoom (interpolations): the camera without it is read.": {
        "interpolations": {"24": {"focal_length": 24.0}}
    },
}


@pytest.mark.parametrize("sentence", SAID)
def test_what_is_not_the_camera_is_said_and_changes_nothing(loaded, sentence):
    """Gyroflow multiplies K by the stretch and divides the pixel by it: K is for calib_dimension whatever it is."""
    calibration = loaded(**SAID[sentence])
    assert sentence in calibration.notes
    check(calibration, fisheye(POINTS, matrix(), K4))


@pytest.mark.parametrize("changes", [{"frame_readout_time": 0.0}, {"radial_distortion_limit": 0.0}, {"RMS_error": 0.0}])
def test_nothing_is_said_of_zeros(loaded, changes):
    assert loaded(**{"RMS_error": 0.0} | changes).notes == ()


@pytest.mark.parametrize("never_set", [0.0, None, 0.01])
def test_a_stretch_that_was_never_set_is_none(loaded, never_set):
    assert loaded(input_horizontal_stretch=never_set, RMS_error=0.0).notes == ()


def test_a_profile_of_the_first_versions_has_fewer_keys(loaded):
    gone = dict.fromkeys(
        ["orig_dimension", "input_horizontal_stretch", "input_vertical_stretch", "asymmetrical", "frame_readout_time"]
    )
    calibration = loaded(**gone, focal_length=None, radial_distortion_limit=None, calibrator_version="0.2.1-alpha")
    check(calibration, fisheye(POINTS, matrix(1920, 1080), K4))


def test_what_the_profile_is_of_becomes_its_stamp(loaded):
    assert loaded().stamps["camera"] == Stamp(
        made="2025-03-04",
        program="Gyroflow 1.6.3",
        views=15,
        conditions="NO-EIS",
        cameras=("Maker One",),
        lenses=("Wide",),
        focal_lengths=(12.5,),
    )


@pytest.mark.parametrize(
    "lens",
    [
        Perspective(),
        KannalaBrandt(*K4),
        BrownConrady(*STANDARD),
        UnifiedSphere(0.75, *SPHERE[:4]),
    ],
    ids=lambda lens: type(lens).__name__,
)
def test_what_is_written_is_read_back_to_the_last_digit(tmp_path, lens):
    camera = Camera(Intrinsics(3840, 2160, FX, FY, CX, CY), lens)
    stamp = Stamp("2026-01-31 12:00 UTC", "camviz 9", "", 12, "indoors", ("Maker One",), ("Wide",), (12.5,))
    path = tmp_path / "profile.json"
    assert write(Calibration({"camera": camera}, path, "made", stamps={"camera": stamp}), path, "gyroflow") == ()
    back = camviz_clinic.load(path)
    assert back.cameras["camera"].intrinsics == camera.intrinsics
    assert back.cameras["camera"].lens == lens
    assert back.stamps["camera"] == stamp
    assert back.notes == ()


@pytest.mark.parametrize(
    ("lens", "sentence"),
    [
        (Equidistant(), "has no place for camera's fisheye of four zeros, which it takes for a pinhole"),
        (KannalaBrandt(), "has no place for camera's fisheye of four zeros, which it takes for a pinhole"),
        (BrownConrady(tau_x=0.1), "has no place for tau_x of camera"),
    ],
)
def test_what_has_no_place_is_refused_and_leaves_no_file(tmp_path, lens, sentence):
    camera = Camera(Intrinsics(3840, 2160, FX, FY, CX, CY), lens)
    path = tmp_path / "profile.json"
    with pytest.raises(CalibrationError, match=sentence):
        write(Calibration({"camera": camera}, path, "made"), path, "gyroflow")
    assert list(tmp_path.iterdir()) == []


def test_gyroflow_takes_what_is_written_for_a_whole_profile(tmp_path):
    """It refuses one without calibrator_version, camera_matrix or calib_dimension, and uses cx, cy if asymmetrical."""
    camera = Camera(Intrinsics(1280, 720, 700.0, 701.0, 640.5, 359.25), KannalaBrandt(*K4))
    path = tmp_path / "profile.json"
    write(Calibration({"camera": camera}, path, "made"), path, "gyroflow")
    tree = json.loads(path.read_text())
    assert tree["calibrator_version"]
    assert tree["asymmetrical"] is True
    assert (tree["calib_dimension"], tree["orig_dimension"]) == ({"w": 1280, "h": 720},) * 2
    assert tree["fisheye_params"]["camera_matrix"] == [[700.0, 0.0, 640.5], [0.0, 701.0, 359.25], [0.0, 0.0, 1.0]]
    assert tree["fisheye_params"]["distortion_coeffs"] == K4


def test_inspect_shows_a_profile_and_convert_carries_it_over(tmp_path, capsys):
    path, out = tmp_path / "profile.json", tmp_path / "camera.yaml"
    path.write_text(json.dumps(profile(frame_readout_time=16.25)))
    assert command.main(["inspect", str(path)]) == 0
    assert "note assumed-reading: A frame is read out in 16.25 ms, from the top" in capsys.readouterr().out
    assert command.main(["convert", str(path), str(out), "--to", "opencv"]) == 0
    check(camviz_clinic.load(out), fisheye(POINTS, matrix(), K4))
