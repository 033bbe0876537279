"""Whether the board in the pictures is the one that was described: what the board doctor finds."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from camviz.lenses import BrownConrady
from camviz.lenses.base import Array
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.checks.doctor import Shown, diagnose
from camviz_clinic.checks.doctor.interpolated import smooth_errors
from camviz_clinic.checks.evidence import Evidence, NotChecked
from camviz_clinic.checks.registry import WRONG_NUMBERS, Finding, Rng, finding
from camviz_clinic.checks.snapshots import pictured

WITHOUT = "no pictures of the board were given (--images)"
CHARUCO = Board(columns=6, rows=5, square_size=0.035, marker_size=0.026, dictionary="DICT_4X4_50")
VIEWS = 3


@finding(
    "wrong-board",
    severity="fault",
    view="numbers",
    symptom="The board is not found, or its corners are at wrong places.",
    causes=("a board that is not as it was described",),
    remedy="Describe the board as it was printed.",
    threshold="Nine tenths of the steps between neighbouring markers are those of another board. "
    "They are at least 2 %, and three, more than those of the board as described.",
    explains=WRONG_NUMBERS,
)
def wrong_board(evidence: Evidence) -> Iterator[Finding]:
    """The check reads the markers in up to twelve pictures, and counts how many squares each is from the next ones.

    It holds that against the layouts that OpenCV prints.
    """
    if evidence.shown is None or not evidence.shown.has_markers:
        raise NotChecked("the board has no markers by which to know it" if evidence.shown else WITHOUT)
    yield from described_wrong(evidence.shown)


def described_wrong(shown: Shown) -> Iterator[Finding]:
    """What pictures show of how a board is described."""
    for each in diagnose(shown, wrong_board.id):
        without = each.option.removeprefix("no ")
        remedy = f"Try {each.option}." if without == each.option else f"Leave {without} out."
        yield wrong_board.found(each.sentence, each.value, each.unit, causes=(each.cause,), remedy=remedy)


@finding(
    "interpolated-corners",
    severity="warning",
    view="residual-vectors",
    symptom="The corners are smooth, and beside those of the pictures.",
    causes=("corners that a homography of the markers gave, and no finder refined",),
    remedy="Find the corners again with `camviz calibrate`, which refines every one in the picture.",
    threshold="They are more than 0.15 px off (RMS) in the median view. Three quarters of the squares are smooth over "
    "the board.",
    explains=(*WRONG_NUMBERS, "board-warp"),
)
def interpolated(evidence: Evidence) -> Iterator[Finding]:
    """The check refines every corner in its picture, to the saddle point where four squares meet.

    What a finder is off by itself differs from corner to corner. What an interpolation is off is smooth.
    """
    if evidence.shown is None:
        raise NotChecked(WITHOUT)
    if evidence.calibration.line_delays:
        raise NotChecked("the corners in the file are those of a shutter of all rows at once, not of the pictures")
    seen = replace(evidence.shown, calibration=evidence.calibration)
    if not evidence.once(("saddles",), lambda: smooth_errors(seen)):
        raise NotChecked("the pictures given are not those of the corners in the file")
    for each in diagnose(seen, interpolated.id):
        yield interpolated.found(each.sentence, each.value, each.unit, each.sentence.split(": ")[0])


@wrong_board.fault("legacy pattern", "", (1,), promised=1)
def legacy(rng: Rng, strength: float) -> Evidence:
    """The board was printed by OpenCV before 4.6, and is described without that."""
    return _described(rng, replace(CHARUCO, legacy=True), legacy=False)


@wrong_board.fault("sides swapped", "", (1,), promised=1)
def swapped(rng: Rng, strength: float) -> Evidence:
    """Columns and rows of the board are taken for each other."""
    return _described(rng, CHARUCO, columns=CHARUCO.rows, rows=CHARUCO.columns)


@wrong_board.fault("wide border", "cells", (2,), promised=2)
def wide_border(rng: Rng, strength: float) -> Evidence:
    """The markers have a wider border than is said."""
    return _described(rng, replace(CHARUCO, border_bits=round(strength)), border_bits=1)


@wrong_board.fault("numbered later", "markers", (1, 7, 21), promised=7)
def numbered_later(rng: Rng, strength: float) -> Evidence:
    """The markers are numbered from another one than is said."""
    return _described(rng, replace(CHARUCO, first_id=round(strength)), first_id=0)


def _described(rng: Rng, printed: Board, **otherwise: Any) -> Evidence:
    """Pictures of a board that is described otherwise."""
    seen = pictured(rng, printed, VIEWS)
    calibration = Calibration({"camera": seen.camera}, Path("virtual"), "OpenCV FileStorage")
    return Evidence(calibration, shown=Shown(replace(printed, **otherwise), seen.pictures))


@interpolated.fault("by a homography", "k1", (0.15, 0.25, 0.35), promised=0.25)
def by_a_homography(rng: Rng, strength: float) -> Evidence:
    """The corners are those of a homography, in pictures of a lens with barrel distortion of that strength."""
    seen = pictured(rng, CHARUCO, VIEWS, BrownConrady(-strength, strength**2 / 3))
    corners = np.array([smooth(CHARUCO, each) for each in seen.corners])
    calibration = Calibration(
        {"camera": seen.camera},
        Path("virtual"),
        "OpenCV FileStorage",
        board=CHARUCO,
        detections={"camera": corners},
        pictures={"camera": tuple(seen.pictures)},
    )
    return Evidence(calibration, shown=Shown(CHARUCO, seen.pictures))


def smooth(board: Board, corners: Array) -> Array:
    """Where the homography that fits corners (n, 2) best has them."""
    plane = board.corners[:, :2]
    homography, _ = cv2.findHomography(plane, corners)
    return np.asarray(cv2.perspectiveTransform(plane[:, None], homography).reshape(-1, 2))
