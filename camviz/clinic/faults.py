"""The fault lab: the faults that can be put into a virtual calibration, and what an inspection must name."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np

from camviz.clinic.injections import (
    Case,
    absurd_centre,
    autofocus_drift,
    boards_in_the_middle,
    edited_rotation,
    fold,
    half_pixel,
    half_pixel_against,
    in_opengl,
    inverted,
    mislabelled,
    near_pole,
    one_column_off,
    one_corner_off,
    one_view_blurred,
    other_order,
    parallel_boards,
    resized,
    resized_pictures,
    resized_unevenly,
    richer_lens,
    rolling_shutter,
    rows_swapped,
    square_in_millimetres,
    strong_lens,
    swapped,
    transposed,
    turned_away,
    uncropped,
    warped_board,
    with_corners,
    wrong_square,
    zeroed,
)

__all__ = ["FAULTS", "Case", "Fault"]

Rng = np.random.Generator


@dataclass(frozen=True)
class Fault:
    """One fault: the finding that must name it, what `strength` measures, from slight to gross, and from where on
    an inspection is promised to find it."""

    finding: str
    sentence: str
    unit: str
    strengths: tuple[float, ...]
    promised: float
    inject: Callable[[Rng, float], Case]


FAULTS: Mapping[str, Fault] = {
    "outlier corner": Fault(
        "outlier-view",
        "one corner of one view is off",
        "px",
        (1, 3, 10, 30),
        10,
        partial(with_corners, change=one_corner_off),
    ),
    "blurred view": Fault(
        "outlier-view",
        "one view's corners scatter",
        "px",
        (0.3, 1, 3, 10),
        3,
        partial(with_corners, change=one_view_blurred),
    ),
    "column off": Fault(
        "outlier-line",
        "a column is taken for its neighbour",
        "squares",
        (0.02, 0.1, 0.5, 1),
        0.5,
        partial(with_corners, change=one_column_off),
    ),
    "rows swapped": Fault(
        "outlier-line", "two rows are exchanged", "views", (1, 2, 3), 1, partial(with_corners, change=rows_swapped)
    ),
    "order flipped": Fault(
        "corner-order", "the right camera's corners are counted backwards", "views", (1, 2, 3), 1, other_order
    ),
    "parallel boards": Fault("parallel-boards", "no board is tilted by more", "°", (0.5, 3, 8), 8, parallel_boards),
    "boards in the middle": Fault(
        "low-coverage",
        "the boards stay inside this part of the sides",
        "of a side",
        (0.15, 0.25, 0.4),
        0.25,
        boards_in_the_middle,
    ),
    "warped board": Fault(
        "board-warp", "the board is bent along its rows", "% of its length", (0.1, 0.5, 1, 2), 1, warped_board
    ),
    "autofocus drift": Fault(
        "split-disagreement",
        "the focal length grows from the first view to the last",
        "%",
        (0.2, 1, 3, 10),
        10,
        autofocus_drift,
    ),
    "rolling shutter": Fault(
        "pose-absorbs-error", "the board moves while the image is read out", "px", (1, 3, 10, 30), 30, rolling_shutter
    ),
    "absurd centre": Fault(
        "pose-absorbs-error",
        "the principal point was moved, the poses follow",
        "% of the width",
        (0.3, 1, 3, 8),
        8,
        absurd_centre,
    ),
    "lens too rich": Fault(
        "model-too-simple",
        "an r⁵ term is left to a model with k1 alone",
        "px at the corner",
        (0.3, 3, 10, 30),
        30,
        richer_lens,
    ),
    "near-pole rational model": Fault(
        "near-pole", "the denominator at the farthest corner's ray", "", (0.5, 0.15, 0.05), 0.15, near_pole
    ),
    "folding polynomial": Fault(
        "fold", "the polynomial turns back at", "of the corner's radius", (1.6, 0.95, 0.8), 0.95, fold
    ),
    "strong lens": Fault(
        "inverse-not-converged", "a barrel lens, 80° wide", "-k1", (0.1, 0.25, 0.35), 0.35, strong_lens
    ),
    "uneven resize": Fault(
        "aspect", "pictures were resized in width alone", "times", (1.01, 1.05, 1.33), 1.05, resized_unevenly
    ),
    "resized K": Fault("wrong-size", "K is for pictures of another size", "times", (0.5, 1.5, 2), 1.5, resized),
    "resized pictures": Fault(
        "wrong-size", "the pictures have another size", "times", (0.5, 1.25, 2), 1.25, resized_pictures
    ),
    "crop": Fault("principal-point", "pictures were cropped at the left", "% of the width", (5, 30, 40), 30, uncropped),
    "zeroed distortion": Fault(
        "zero-distortion", "the coefficients were not kept", "of k1 = -0.2", (0.002, 0.3, 1), 0.3, zeroed
    ),
    "half pixel": Fault("half-pixel", "cx and cy are counted from elsewhere", "px", (0.5, 1), 0.5, half_pixel),
    "half pixel between two": Fault(
        "half-pixel", "the same beside another calibration", "px", (0.5, 1), 0.5, half_pixel_against
    ),
    "mislabelled coefficients": Fault(
        "coefficient-count", "another number than the name has", "numbers", (4, 5, 8), 4, mislabelled
    ),
    "edited rotation": Fault(
        "not-a-rotation", "an element of R is changed", "", (0.0002, 0.01, 0.3), 0.01, edited_rotation
    ),
    "transposed K": Fault("bad-k", "K is transposed (1), or multiplied", "times", (1, 2, 0.001), 1, transposed),
    "swapped cameras": Fault("baseline-sign", "left is right", "", (1,), 1, swapped),
    "swapped cameras, rectified": Fault("rectified-black", "left is right", "", (1,), 1, swapped),
    "right camera turned": Fault("rectified-black", "the transform of another pair", "°", (5, 60, 90), 60, turned_away),
    "square in millimetres": Fault(
        "baseline-scale", "the square is taken for", "times itself", (1000,), 1000, square_in_millimetres
    ),
    "wrong square": Fault(
        "baseline-scale", "beside a calibration with the right one", "%", (0.5, 4, 20), 4, wrong_square
    ),
    "inverted transform": Fault(
        "inverted-transform", "beside its corners (1), beside another (2)", "", (1, 2), 1, inverted
    ),
    "OpenGL axes": Fault("mirrored-frame", "of the boards (1), of the pair (2)", "", (1, 2), 1, in_opengl),
}
