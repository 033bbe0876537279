"""What spoils an edge so much that nothing is said of it."""

from __future__ import annotations

from typing import Any

import numpy as np

LEAST_ANGLE_DEG, MOST_ANGLE_DEG = 1.0, 30.0  # outside, phases repeat too early or rows blur the edge
FEWEST_ROWS = 16
LEAST_RISES = 1.2  # on either side: 3 standard deviations of a Gaussian blur
LEAST_CONTRAST = 10.0  # times the noise: below, the edge cannot be found in each row
MOST_CLIPPED = 0.05  # of the pixels of a side: with 5 % noise they move its level by 0.1 % of the contrast

MOST_UNEXPLAINED = 0.04  # of the contrast: scatter at the edge beyond the sides' noise
SHARE_OF_ROWS = 0.5  # of that scatter's variance: bends had 0.6 and more, all JPEGs but one of 400 less than 0.5
MOST_BENT = 0.15  # of ln MTF at MTF50: what rows off the line may take of it


def refuse_what_spoils(edge: Any) -> None:
    """Say what is wrong with an edge that cannot be measured.

    Raises: ValueError in one sentence.
    """
    rows, columns = edge.image.shape
    if rows < FEWEST_ROWS or columns < FEWEST_ROWS:
        raise ValueError(f"image must be at least {FEWEST_ROWS} × {FEWEST_ROWS} pixels, got {columns} × {rows}")
    if not np.isfinite(edge.line[0]) or (edge.sides.known and not edge.contrast > LEAST_CONTRAST * edge.noise):
        raise ValueError("image holds no edge: one side is hardly brighter than the other")
    if not LEAST_ANGLE_DEG <= abs(edge.angle_deg) <= MOST_ANGLE_DEG:
        raise ValueError(
            f"the edge leans by {abs(edge.angle_deg):.1f}°: expected {LEAST_ANGLE_DEG:g}° to {MOST_ANGLE_DEG:g}° "
            "against the pixels' columns or rows (about 5° is best)"
        )
    if not edge.sides.known or edge.flat < LEAST_RISES * edge.rise:
        raise ValueError("the edge's blur reaches the image's border: take more of both sides")
    inside = edge.rows[0]
    if len(inside) < FEWEST_ROWS:
        raise ValueError(f"the edge lies within {len(inside)} rows only: take at least {FEWEST_ROWS}")
    if abs(edge.line[0]) * np.ptp(inside) < 1:
        raise ValueError(
            f"the edge crosses less than one pixel within {len(inside)} rows: take more of it, or lean it more"
        )
    _refuse_clipped(edge)
    _refuse_scattered(edge)


def _refuse_clipped(edge: Any) -> None:
    shares = edge.clipped_shares
    if max(shares) > MOST_CLIPPED:
        side = "dark" if shares[0] > shares[1] else "bright"
        raise ValueError(
            f"{100 * max(shares):.0f} % of the {side} side's pixels are at an end of the scale, so its light is not "
            "known: expose so that neither side is cut off"
        )


def _refuse_scattered(edge: Any) -> None:
    """A bend or a spot moves rows' edges, and pixels scatter for it; a JPEG lets them scatter in straight rows, too."""
    error = edge.error
    scatters = error.unexplained > MOST_UNEXPLAINED
    by_the_rows = error.scatter_off_the_line**2 > SHARE_OF_ROWS * error.unexplained**2
    if (np.isfinite(edge.mtf50) and error.bend > MOST_BENT) or (scatters and by_the_rows):
        raise ValueError(
            f"the rows' edges lie {error.off_the_line:.2f} px off a straight line, which blurs them: take a "
            "shorter piece, or one without spots"
        )
    if scatters:
        raise ValueError(
            f"pixels at the edge scatter by {100 * error.unexplained:.0f} % of its contrast, beyond the noise "
            "beside it, as in a JPEG of low quality: save the photograph with less compression"
        )
