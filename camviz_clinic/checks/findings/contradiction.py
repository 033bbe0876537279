"""What a file says twice, and not alike."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from math import radians

import yaml

from camviz.poses import RigidTransform, Rotation
from camviz_clinic.calibration.redundancy import Redundancy
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.findings.file import without_k3
from camviz_clinic.checks.registry import Finding, Rng, finding
from camviz_clinic.checks.virtual import as_file, healthy_pair
from camviz_clinic.files import kalibr

LARGE = {"°": 0.1, "mm": 1.0, "px": 1.0, "%": 1.0}  # by unit: above it numbers that differ are a fault
SMALL = {"°": 0.001, "mm": 0.01, "px": 0.01, "%": 0.01}  # below it nobody could tell


@finding(
    "contradiction",
    severity="fault",
    view="numbers",
    symptom="The file says one thing twice, and not alike.",
    causes=("a file put together from two calibrations, or edited in one of the two places",),
    remedy="Find out which of the two is right, and write the other anew from it. Programs differ in which they read.",
    threshold="It is more than rounding to the printed digits explains. It is a note up to 0.1°, 1 mm, 1 px or 1 %.",
    explains=("baseline-sign", "baseline-scale", "inverted-transform", "rectified-black", "models-differ"),
)
def contradiction(evidence: Evidence) -> Iterator[Finding]:
    """The check holds against each other what the reader of the format finds twice in a file."""
    redundant = evidence.calibration.redundant
    if not redundant:
        raise NotChecked("the file says nothing twice")
    for each in redundant:
        apart = {unit: value for unit, value in each.apart.items() if _counts(each, unit)}
        if apart:
            yield _found(each, apart)


def _counts(redundancy: Redundancy, unit: str) -> bool:
    """Whether a difference is neither rounding nor too small to matter."""
    return redundancy.apart[unit] > max(redundancy.printed[unit], SMALL[unit])


def _found(redundancy: Redundancy, apart: Mapping[str, float]) -> Finding:
    unit = max(apart, key=lambda each: apart[each] / LARGE[each])
    severity = contradiction.severity if apart[unit] > LARGE[unit] else "note"
    numbers = " and ".join(f"{value:.2g}{' ' * (of != '°')}{of}" for of, value in apart.items())
    sentence = f"{redundancy.what}: it differs by {numbers} from {redundancy.beside}."
    if redundancy.hint:
        sentence += f" {redundancy.hint}"
    return contradiction.found(sentence, apart[unit], unit, severity=severity)


@contradiction.fault("camera moved in one place", "mm", (0.005, 0.5, 3, 30), promised=3)
def moved(rng: Rng, strength: float) -> Evidence:
    """T_cn_cnm1 of a Kalibr chain was solved anew, and T_cam_imu was not."""
    solved = healthy_pair(rng)
    cameras = {name: replace(camera, lens=without_k3(camera)) for name, camera in solved.cameras.items()}
    imu = RigidTransform.from_components([0.01, 0.02, 0.03], Rotation.from_rotvec([0.0, 0.0, radians(90)]))
    tree = yaml.safe_load(kalibr.write(replace(solved, cameras=cameras, world_from_imu=imu)))
    tree["cam1"]["T_cn_cnm1"][0][3] += strength / 1000
    return as_file(yaml.safe_dump(tree))
