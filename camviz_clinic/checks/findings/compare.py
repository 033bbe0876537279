"""How far another calibration of the same camera is from this one."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from camviz.distortion import image_corner_radius
from camviz.lenses import BrownConrady
from camviz_clinic.checks.camera_difference import differences
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.registry import Finding, Rng, finding
from camviz_clinic.checks.virtual import alone, healthy

APART_PX = 0.5
APART_SIGMAS = 3.0


@finding(
    "models-differ",
    severity="warning",
    view="difference",
    symptom="Two calibrations of one camera differ.",
    causes=("one of the two calibrations is wrong", "focus, zoom or lens changed between them", "too few views"),
    remedy="Do not use one in place of the other. Judge both on pictures that neither was solved from.",
    threshold="The median over the image is above 0.5 px. "
    "Or its 95 % are above three standard deviations of what the noise of both lets expect.",
)
def models_differ(evidence: Evidence) -> Iterator[Finding]:
    """The check sends far points through both cameras, once the rotation that makes them agree best is taken out."""
    if evidence.compare is None:
        raise NotChecked("it needs another calibration (--compare)")
    for each in differences(evidence):
        if each.median > APART_PX or (each.sigmas or 0) > APART_SIGMAS:
            yield models_differ.found(each.sentence, each.median, "px", each.camera)


@models_differ.fault("other lens", "px at the corner", (0.5, 5, 30), promised=5)
def other_lens(rng: Rng, strength: float) -> Evidence:
    """The other calibration has another k1, which moves the corner of the image by so much."""
    calibration = healthy(rng)
    camera = calibration.cameras["camera"]
    off = strength / (camera.intrinsics.fx * image_corner_radius(camera.intrinsics) ** 3)
    assert isinstance(camera.lens, BrownConrady)
    lens = replace(camera.lens, k1=camera.lens.k1 + off)
    return Evidence(calibration, alone(calibration, replace(camera, lens=lens)))
