"""One calibration as one HTML page: its verdict and the three visualizers, all inside, readable without a network."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields
from html import escape
from itertools import combinations
from pathlib import Path

import numpy as np

from camviz.cameras import Camera
from camviz.distortion import fold_angle
from camviz.draw.page import document, figure
from camviz.lenses import Lens
from camviz.poses import RigidTransform
from camviz.views.distortion import DistortionView
from camviz.views.epipolar import EpipolarView
from camviz.views.frustum import FrustumView
from camviz_clinic.checks.inspection import Inspection
from camviz_clinic.files import Calibration
from camviz_clinic.report.findings import said_html

SIDE_STEP = 0.1  # metres: how far a lone camera is moved to give it a partner


def write_page(inspection: Inspection, path: str | Path) -> None:
    """Write the page of an inspection's calibration to `path`."""
    Path(path).write_text(page(inspection), encoding="utf-8")


def page(inspection: Inspection) -> str:
    """The page as HTML text: what the inspection says, the cameras' numbers, their frusta, distortion and epipoles.

    Raises: ValueError for the inspection of a file that could not be read.
    """
    calibration = inspection.calibration
    if calibration is None:
        raise ValueError("a page shows a calibration, and this inspection has none")
    more = f"<p><code>camviz inspect {escape(calibration.source.name)}</code> says what was checked.</p>"
    sections = [numbers_table(calibration), *_frusta(calibration), *_distortions(calibration), *_epipolar(calibration)]
    said = f"{said_html(inspection)}{more}<p>{escape(calibration.format)}</p>"
    return document(calibration.source.name, f"{said}{''.join(sections)}")


def numbers_table(calibration: Calibration) -> str:
    """The cameras' numbers as a table, and what the file's notes say."""
    head = "".join(f"<th>{title}</th>" for title in ("camera", "image", "fx", "fy", "cx", "cy", "lens"))
    rows = "".join(_row(name, camera) for name, camera in calibration.cameras.items())
    notes = "".join(f'<p class="note">{escape(note)}</p>' for note in calibration.notes)
    return f'<div class="scroll"><table><tr>{head}</tr>{rows}</table></div>{notes}'


def _row(name: str, camera: Camera) -> str:
    K = camera.intrinsics
    cells = [
        name,
        f"{K.width} × {K.height}",
        *(f"{value:.2f}" if abs(value) > 0.1 else f"{value:.3g}" for value in (K.fx, K.fy, K.cx, K.cy)),
        _lens(camera.lens),
    ]
    return f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in cells)}</tr>"


def _lens(lens: Lens) -> str:
    """The lens's kind and those of its parameters that are not at rest."""
    moved = [f for f in fields(lens) if getattr(lens, f.name) != f.default]  # type: ignore[arg-type]
    parameters = ", ".join(f"{f.name} = {getattr(lens, f.name):.6g}" for f in moved)
    return type(lens).__name__ + (f": {parameters}" if parameters else "")


def _frusta(calibration: Calibration) -> Iterator[str]:
    yield "<h2>What the camera sees</h2><p>The camera in camviz's garden, through its own lens and pixels.</p>"
    for name, camera in calibration.cameras.items():
        yield figure(name, FrustumView.of(camera.at(RigidTransform.identity())).figure())


def _distortions(calibration: Calibration) -> Iterator[str]:
    yield "<h2>What the lens does</h2>"
    if any(map(_fold_in_sight, calibration.cameras.values())):
        yield (
            "<p>A red circle marks where the model folds: rays beyond it land where others already are, and pixels "
            "beyond it have no ray at all.</p>"
        )
    for name, camera in calibration.cameras.items():
        yield figure(name, DistortionView.of(camera).figure())


def _fold_in_sight(camera: Camera) -> bool:
    """Whether the circle lies in the picture, bent by the lens or among ideal points: the last rays before the fold."""
    angle = fold_angle(camera.lens) * (1 - 1e-6)
    if not np.isfinite(angle):
        return False
    turn = np.linspace(0, 2 * np.pi, 90)
    around = np.stack([np.cos(turn), np.sin(turn)], axis=-1)
    rays = np.hstack([np.sin(angle) * around, np.full((90, 1), np.cos(angle))])
    places = [camera.lens.project(rays)] + [np.tan(angle) * around] * (angle < np.pi / 2)
    return bool(camera.intrinsics.contains(camera.intrinsics.to_pixels(np.concatenate(places))).any())


def _epipolar(calibration: Calibration) -> Iterator[str]:
    yield "<h2>What two pictures share</h2>"
    pairs = [pair for pair in combinations(calibration.cameras, 2) if _apart(calibration, *pair)]
    for left, right in pairs:
        view = EpipolarView.of(calibration.cameras[left], calibration.cameras[right])
        yield figure(f"{left} and {right}", view.figure())
    if not pairs:
        yield (
            f"<p>The file does not say how one camera stands to another, so each is shown with its own copy "
            f"{SIDE_STEP * 100:.0f} cm to its right.</p>"
        )
        for name, camera in calibration.cameras.items():
            yield figure(name, EpipolarView.of(camera, camera.at(_stepped_aside(camera))).figure())


def _apart(calibration: Calibration, a: str, b: str) -> bool:
    return bool(np.linalg.norm(calibration.cameras[a].centre - calibration.cameras[b].centre) > 1e-9)


def _stepped_aside(camera: Camera) -> RigidTransform:
    return camera.world_from_cam * RigidTransform.from_translation([SIDE_STEP, 0, 0])
