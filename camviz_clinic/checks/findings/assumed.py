"""What the reader of a file took for granted, because the file does not say it."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import yaml

from camviz.cameras import Camera
from camviz.lenses import BrownConrady, KannalaBrandt
from camviz_clinic.calibration.difference import pixel_grid
from camviz_clinic.calibration.solving import STOPPED_SHORT
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.registry import VIEW_BY_VIEW, Finding, Rng, finding
from camviz_clinic.checks.virtual import as_file
from camviz_clinic.files.opencv import FOUR_COEFFICIENTS

HARMLESS_PX = 1.0
GRID = (60, 40)
LATER = ("set aside", STOPPED_SHORT)  # what a solution says in the same notes, which is no reading


@finding(
    "assumed-coefficients",
    severity="warning",
    view="distortion",
    symptom="Four distortion coefficients have two readings, and the file does not say which.",
    causes=("a file of cv2.fisheye or of cv2.calibrateCamera that does not name its model",),
    remedy="Say in the file which it is: fisheye_model: 1 for cv2.fisheye, or five coefficients with k3 = 0. "
    "Straighten a picture to see which is right.",
    threshold="The two readings are a pixel apart somewhere in the image. It is a note below that, and where the "
    "file's corners fit the reading that was taken.",
    explains=(
        *VIEW_BY_VIEW,
        "fold",
        "near-pole",
        "inverse-not-converged",
        "pose-absorbs-error",
        "model-too-simple",
        "split-disagreement",
        "models-differ",
    ),
)
def assumed_coefficients(evidence: Evidence) -> Iterator[Finding]:
    """The check sends the rays of all pixels through both readings, k1 k2 p1 p2 and cv2.fisheye's k1 k2 k3 k4."""
    if FOUR_COEFFICIENTS not in evidence.calibration.notes:
        return
    for name, camera in evidence.cameras.items():
        lens = camera.lens
        if not isinstance(lens, BrownConrady) or any((lens.k3, lens.k4, lens.k5, lens.k6)):
            continue
        apart, lost = readings_apart(camera, lens)
        observed = evidence.observed.get(name)
        fits = observed is not None and observed.adjustment.rms < 0.2 * apart
        severity = "note" if apart <= HARMLESS_PX or fits else assumed_coefficients.severity
        sentence = (
            f"{name}: four distortion coefficients are read as k1 k2 p1 p2. If they are cv2.fisheye's k1 k2 k3 k4, "
            f"points are off by up to {apart:.2g} px{lost}.{' The corners fit the reading that was taken.' * fits}"
        )
        yield assumed_coefficients.found(sentence, apart, "px", name, severity=severity)


def readings_apart(camera: Camera, lens: BrownConrady) -> tuple[float, str]:
    """How many pixels apart the image has the same rays in the two readings, at most; and where rays have no pixel."""
    uv = pixel_grid(camera.intrinsics, GRID)
    fisheye = KannalaBrandt(lens.k1, lens.k2, lens.p1, lens.p2)
    rays = fisheye.unproject(camera.intrinsics.from_pixels(uv))
    pixels = camera.intrinsics.to_pixels(lens.project(rays))
    length = np.linalg.norm(pixels - uv, axis=-1)
    lost = float(np.mean(np.isnan(length)))
    said = f", and {lost:.0%} of the pixels have no ray in common" if lost >= 0.01 else ""
    return (float(np.nanmax(length)) if lost < 1 else 0.0), said


@assumed_coefficients.fault("four coefficients", "of k1 = -0.2", (0.0, 0.5, 1.0), promised=1.0)
def four(rng: Rng, strength: float) -> Evidence:
    """A file has four coefficients and no name of a model."""
    tree = {"rows": 3, "cols": 3, "data": [700.0, 0.0, 640.0, 0.0, 700.0, 360.0, 0.0, 0.0, 1.0]}
    held = {"rows": 1, "cols": 4, "data": [-0.2 * strength, 0.03 * strength, 0.0, 0.0]}
    file = {"image_width": 1280, "image_height": 720, "K": tree, "D": held}
    return as_file(yaml.safe_dump(file))


@finding(
    "assumed-reading",
    severity="note",
    view="numbers",
    symptom="The reader of the file took something for granted, or left something out.",
    causes=("a file that does not say all that a calibration needs",),
    remedy="See that it is meant so, or add to the file what is missing.",
    threshold="Always, for each thing.",
)
def assumed_reading(evidence: Evidence) -> Iterator[Finding]:
    """The check repeats what the reader of the format has noted."""
    for note in evidence.calibration.notes:
        if note != FOUR_COEFFICIENTS and not any(said in note for said in LATER):
            yield assumed_reading.found(note)


@assumed_reading.fault("place not said", "", (1,), promised=1)
def place_not_said(rng: Rng, strength: float) -> Evidence:
    """A chain does not say where its second camera stands."""
    camera = {
        "camera_model": "pinhole",
        "intrinsics": [700.0, 700.0, 640.0, 360.0],
        "distortion_model": "radtan",
        "distortion_coeffs": [-0.1, 0.01, 0.0, 0.0],
        "resolution": [1280, 720],
    }
    return as_file(yaml.safe_dump({"cam0": camera, "cam1": {**camera, "intrinsics": [701.0, 701.0, 641.0, 361.0]}}))
