"""Whether a pair still stands as it was calibrated: its rows, its depths, and its baseline against the board."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from camviz_clinic.calibration.detection import Detections
from camviz_clinic.calibration.types import Board
from camviz_clinic.checks.judgement import FEWEST_VIEWS, VERDICTS, Judgement, px, rated
from camviz_clinic.checks.refit import Refit
from camviz_clinic.checks.rig import OWN_UNIT, StereoPair
from camviz_clinic.checks.rig_refit import RigRefit

SCALE_LIMIT = 0.01  # of the baseline: a quarter of a millimetre on a square of 25 mm, what a ruler tells
DEVIATIONS = 2.6  # σ either way, 99 % of a normal distribution


def pair_judgement(
    pair: StereoPair, found: Mapping[str, Detections], board: Board, limit: float, refits: Mapping[str, Refit]
) -> Judgement:
    """The judgement of a pair from the views that both cameras have."""
    names = (pair.left, pair.right)
    places = sorted(set(found[pair.left].places) & set(found[pair.right].places))
    if len(places) < FEWEST_VIEWS or not refits.keys() >= set(names):
        reason = f"{pair.title}: both cameras see the board in {len(places)} views, or one of them cannot be judged."
        settle = f"at least {FEWEST_VIEWS} moments at which both see it, and corners enough for each camera."
        return Judgement(pair.title, "inconclusive", reason, settle)
    metres = pair.calibration.format not in OWN_UNIT
    rig = _refit(pair, found, board, refits, places, metres)
    if not rig.overlaps:
        reason = f"{pair.title}: by the file the right camera sees nothing of what the left one sees."
        return Judgement(pair.title, "fail", reason)
    parts = _parts(rig, limit, metres)
    verdict, reason = min(parts, key=lambda part: VERDICTS.index(part[0]))
    if verdict == "pass":
        reason = "the pair holds: " + ", ".join(part[1] for part in parts)
    settle = f"more than {len(places)} views that both cameras see." if verdict in ("warn", "inconclusive") else ""
    return Judgement(pair.title, verdict, f"{pair.title}: {reason}.", settle, *_told(rig, len(places), metres))


def _refit(
    pair: StereoPair,
    found: Mapping[str, Detections],
    board: Board,
    refits: Mapping[str, Refit],
    places: list[int],
    metres: bool,
) -> RigRefit:
    corners, aside, cameras = {}, {}, []
    for side, name in (("left", pair.left), ("right", pair.right)):
        chosen = [found[name].places.index(place) for place in places]
        corners[side] = found[name].corners[chosen]
        aside[side] = ~refits[name].free.used[name][chosen]
        own = pair.calibration.cameras[name]
        cameras.append(refits[name].camera.at(own.world_from_cam))
    return RigRefit.of(cameras[0], cameras[1], board, corners, aside, metres=metres)


def _parts(rig: RigRefit, limit: float, metres: bool) -> list[tuple[str, str]]:
    """The verdict on rows, on disparity and on scale, each with its clause."""
    change, least, most = rig.rows
    said = f"rows are off by {px(change)} (RMS over the image, between {least:.2f} and {most:.2f} px)"
    parts = [(rated(least, most, limit), said)]
    if metres:
        change, least, most = rig.disparity
        said = f"depths are off by {rig.depth:.2%} at {rig.distance:.2g} m ({px(change)} of disparity)"
        parts.append((rated(least, most, limit), said))
        share, sigma = rig.scale
        spread = DEVIATIONS * sigma
        said = f"by the board the baseline is {share:+.2%} (± {spread:.2%}) from the file's"
        parts.append((rated(abs(share) - spread, abs(share) + spread, SCALE_LIMIT), said))
    return parts


def _told(rig: RigRefit, views: int, metres: bool) -> tuple[tuple[str, ...], dict[str, object]]:
    """The facts and the numbers."""
    share, sigma = rig.scale
    numbers: dict[str, object] = {
        "views": views,
        "distance_m": rig.distance,
        "rows_px": dict(zip(("change", "least", "most"), rig.rows, strict=True)),
        "disparity_px": dict(zip(("change", "least", "most"), rig.disparity, strict=True)) if metres else None,
        "depth_error": rig.depth if metres else None,
        "scale": share if metres else None,
        "scale_sigma": sigma if metres else None,
        "rectified_rows_px": None,
    }
    facts = [f"evidence: {views} views that both cameras see, {rig.distance:.2g} m away."]
    if not metres:
        facts.append("depths and scale are withheld: the file's lengths are not in metres.")
    try:
        rows = rig.rectified_rows
    except ValueError as error:
        return (*facts, f"rectified rows of the corners are withheld: {error}."), numbers
    rms = float(np.sqrt(np.mean(rows**2)))
    facts.append(
        f"corners, rectified by the file's numbers: rows differ by {px(rms)} (RMS), "
        f"{np.median(rows):+.2g} px (median), noise of the corners included."
    )
    return tuple(facts), numbers | {"rectified_rows_px": {"rms": rms, "median": float(np.median(rows))}}
