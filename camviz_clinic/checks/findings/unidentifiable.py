"""What the corners cannot decide: parameters that may change together while hardly a corner moves."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from camviz.cameras import Camera
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.enumeration import enumerated
from camviz_clinic.calibration.jacobian import PINHOLE
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.calibration.undecided import Undecided
from camviz_clinic.checks.evidence import Evidence
from camviz_clinic.checks.refit import far_columns
from camviz_clinic.checks.registry import Finding, Rng, finding
from camviz_clinic.checks.virtual import single, single_in_the_middle

MOST_STEPS = 30  # of a solver, along a valley without an end
MOST_NAMED = 8  # parameters with the amount of their change
HARMFUL_PX = 1.0  # RMS over the image, the limit of `camviz check`: less, and the camera sees what it saw
ALIKE = (
    "boards that all stand alike, or one view alone",
    "Tilt the board by 30° to 45°, to different sides, show it near and far, and solve again.",
)
EMPTY = (
    "boards that leave a part of the image empty",
    "Show the board close to each border and corner of the image, or hold the last terms at 0 (--fix).",
)
TERMS = (
    "a model with more terms than these views can tell apart",
    "Solve for fewer terms: --model standard, or hold some at 0 (--fix).",
)
OF_REFINEMENT = {"s1", "s2", "s3", "s4", "tau_x", "tau_y"}  # beside the terms of a denominator
STANDARD = ("fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3")


@finding(
    "unidentifiable",
    severity="warning",
    view="correlation",
    symptom="Some parameters have no ±: the corners cannot decide between them.",
    causes=(ALIKE[0], EMPTY[0], TERMS[0]),
    remedy="Tilt the board to different sides, show it out to the borders, or solve for fewer parameters "
    "(--model, --fix).",
    threshold="One standard deviation of a combination would shift the picture by 1 % of its longer side, were the "
    "boards held. It is a note where far points are seen where they were, within a pixel over the image.",
    explains=("aspect", "principal-point", "fold", "near-pole", "inverse-not-converged", "split-disagreement"),
)
def unidentifiable(evidence: Evidence) -> Iterator[Finding]:
    """The check looks for changes of the parameters, taken together, which the poses of the boards make up for. It
    counts what corners say, and not what a solver assumes. Of a file without corners it reads the covariance.
    """
    combinations = {name: evidence.undecided(name) for name in {**evidence.observed, **evidence.cameras}}
    if not any(combinations.values()) and not evidence.calibration.undecided:
        evidence.with_corners()
    for name, found in combinations.items():
        if found:
            camera = evidence.calibration.cameras[name]
            far = [_far(camera, each) for each in found]
            worst = int(np.argmax(far)) if max(far) > HARMFUL_PX else 0
            severity = "warning" if far[worst] > HARMFUL_PX else "note"
            sentence = f"{name}: {_said(found, worst, far[worst])}"
            cause, remedy = _settled(camera, found[worst])
            most = found[worst].most
            value = most if np.isfinite(most) else None
            yield unidentifiable.found(sentence, value, "px", name, severity=severity, causes=(cause,), remedy=remedy)


def _far(camera: Camera, one: Undecided) -> float:
    """How far a far point is seen elsewhere in pixels, RMS over the image, once a turn of the camera is taken out."""
    return float(np.linalg.norm(far_columns(camera, one.names) @ one.direction))


def _said(found: tuple[Undecided, ...], worst: int, far: float) -> str:
    changes = found[worst].changes
    others = list(dict.fromkeys(key for each in found for key in each.changes if key not in changes))
    amounts = [_amount(key, value) for key, value in list(changes.items())[:MOST_NAMED]]
    said = f"the corners do not decide {enumerated(tuple(changes))}{' together' * (len(changes) > 1)}. "
    said += f"Such a change is {', '.join(amounts)}{', …' * (len(changes) > MOST_NAMED)}. "
    if np.isfinite(found[worst].most):
        said += f"Where the boards follow it, no corner moves by more than {found[worst].most:.2g} px. "
    if far > HARMFUL_PX:
        said += f"Far points would be seen {far:.2g} px elsewhere (RMS over the image)."
    else:
        said += f"The camera sees the same either way: far points stay within {far:.2g} px (RMS over the image)."
    return said + (f" Nor do the corners decide {enumerated(tuple(others))}." if others else "")


def _amount(name: str, value: float) -> str:
    return f"{name} {value:+.3g}{' px' * (name in PINHOLE)}".replace("-", "−")


def _settled(camera: Camera, one: Undecided) -> tuple[str, str]:
    """Where it comes from and what would decide it, by the parameters that go together."""
    together = set(one.changes)
    if together & (OF_REFINEMENT | set(camera.lens.denominator_terms)):
        return TERMS
    return ALIKE if together & set(PINHOLE) and "xi" not in together else EMPTY


@unidentifiable.fault("boards parallel to the sensor", "°", (0.5, 1, 3), promised=0.5)
def parallel_to_the_sensor(rng: Rng, strength: float) -> Evidence:
    """No board is tilted by more, so that the focal length goes with the distance."""
    set_up = single(rng, tilt_deg=(0, strength))
    return Evidence(set_up.solved(set_up.observed(rng)))


@unidentifiable.fault("terms without corners", "of a side", (0.1, 0.15, 0.25), promised=0.15)
def terms_without_corners(rng: Rng, strength: float) -> Evidence:
    """The boards stay inside this part of the sides, where r⁵ and r⁷ are next to nothing."""
    set_up = single_in_the_middle(rng, strength)
    return Evidence(set_up.solved(set_up.observed(rng)))


@unidentifiable.fault("rational model of a mild lens", "radial terms", (6,), promised=6)
def rational_of_a_mild_lens(rng: Rng, strength: float) -> Evidence:
    """The six radial terms of the rational model are solved for where two describe the lens."""
    set_up = single(rng)
    return Evidence(set_up.solved(set_up.observed(rng), "rational"))


@unidentifiable.fault("thin prism and tilt", "terms", (6,), promised=6)
def thin_prism_and_tilt(rng: Rng, strength: float) -> Evidence:
    """Four terms of a thin prism and two of a tilted sensor are solved for where there is neither."""
    return Evidence(_solved(rng, (*STANDARD, "s1", "s2", "s3", "s4", "tau_x", "tau_y")))


@unidentifiable.fault("few views", "views", (1, 2, 3), promised=1)
def few_views(rng: Rng, strength: float) -> Evidence:
    """The camera was solved from so many views."""
    return Evidence(_solved(rng, STANDARD, int(strength)))


def _solved(rng: Rng, names: tuple[str, ...], views: int | None = None) -> Calibration:
    """The least squares next to the truth, without a prior, of what `calibrate` refuses or has no model for."""
    set_up = single(rng)
    corners = set_up.observed(rng)[0][:views]
    poses = set_up.cam_from_board[: len(corners)]
    best = Adjustment(set_up.board, {"camera": set_up.camera}, {"camera": corners}, poses, {"camera": names}).refined(
        most_steps=MOST_STEPS
    )
    return Calibration(
        best.cameras,
        Path("virtual"),
        "camviz",
        set_up.board,
        detections=best.detections,
        cam_from_board={"camera": best.first_from_board},
        estimated=best.estimated,
        intrinsics_covariance={"camera": best.intrinsics_covariance("camera")},
    )
