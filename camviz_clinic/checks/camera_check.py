"""Whether one camera is still as it was calibrated: its verdict, the reason, and what would settle it."""

from __future__ import annotations

from dataclasses import replace
from math import ceil

import numpy as np

from camviz.lenses.base import Array
from camviz_clinic.calibration.detection import Detections
from camviz_clinic.calibration.enumeration import enumerated
from camviz_clinic.calibration.problem import LEAST_CORNERS
from camviz_clinic.calibration.types import Board, Calibration
from camviz_clinic.checks.gaps import gaps
from camviz_clinic.checks.judgement import FEWEST_VIEWS, Judgement, px, rated
from camviz_clinic.checks.refit import Refit, far_columns, reach
from camviz_clinic.checks.stamps import SizeChange, size_change

FEWEST_CORNERS = 60  # 120 measurements, for 6 of each pose, 2 of the board's bend and 5 of the camera
MOST_ASIDE = 0.2  # of the corners; of OpenCV's photographs it is 0.02
NO_IMAGE = 0.01  # of the corners
MOST_TIMES = 10  # as many views as there are: who takes more has better means
Said = tuple[str, str, str]  # a verdict, its reason and what would settle it


def camera_judgement(
    calibration: Calibration, name: str, seen: Detections, board: Board, limit: float
) -> tuple[Judgement, Refit | None]:
    """The judgement of one camera, and the refit that it rests on, where the corners suffice for one."""
    camera = calibration.cameras[name]
    grid, resized = camera.intrinsics, ""
    if (seen.width, seen.height) != (grid.width, grid.height):
        scale = seen.width / grid.width
        sizes = f"the pictures have {seen.width}×{seen.height} pixels, the calibration has {grid.width}×{grid.height}"
        change = size_change((grid.width, grid.height), (seen.width, seen.height))
        sizes += f", which {change.words}"
        if abs(scale * grid.height - seen.height) > 1:
            return _cropped(name, sizes, change), None
        camera = replace(camera, intrinsics=grid.resized(seen.width, seen.height))
        resized = f"{sizes}. Converted by f' = s f and c' = s c + (s - 1)/2, with s = {scale:.4g}, "
    count = np.isfinite(seen.corners).all(axis=-1).sum(axis=1)
    if (count >= LEAST_CORNERS).sum() < FEWEST_VIEWS or count.sum() < FEWEST_CORNERS:
        return _too_few(name, count), None
    try:
        refit = Refit.of(name, camera, board, seen.corners)
    except np.linalg.LinAlgError:  # a corner on the very fold of the lens
        reason = f"{name}: the lens folds among the corners, and no camera near the calibrated one sees them."
        return Judgement(name, "inconclusive", reason, "`camviz inspect` says where the lens folds."), None
    if unusable := _unusable(refit):
        verdict, reason, settle = unusable
        numbers = {"views": refit.views, "corners": len(refit.corners), "set_aside": refit.set_aside}
        return Judgement(name, verdict, f"{name}: {resized}{reason}.", settle, numbers=numbers), None
    covariance = None if resized else calibration.intrinsics_covariance.get(name)
    verdict, reason, settle = _judged(refit, limit, calibration.estimated.get(name, ()), covariance)
    if resized and verdict == "pass":
        verdict, settle = "warn", "nothing more; give the calibration the converted numbers, or pictures of its size."
    return Judgement(name, verdict, f"{name}: {resized}{reason}.", settle, _facts(refit), _numbers(refit)), refit


def _cropped(name: str, sizes: str, change: SizeChange) -> Judgement:
    crop = " and the crop's first pixel (x0, y0), with c' = c - (x0, y0)" if "crop" in change.kind else ""
    settle = f"pictures of the calibration's size{'; or' * bool(crop)}{crop.removeprefix(' and')}."
    return Judgement(name, "fail", f"{name}: {sizes}.", settle, numbers={"size_change": change.kind})


def _too_few(name: str, count: Array) -> Judgement:
    views, total = int((count >= LEAST_CORNERS).sum()), int(count.sum())
    reason = f"{name}: there are too few corners, {total} in {views} view{'s' * (views != 1)}."
    settle = f"at least {FEWEST_VIEWS} views and {FEWEST_CORNERS} corners; better 20 views, tilted, all over the image."
    return Judgement(name, "inconclusive", reason, settle, numbers={"views": views, "corners": total})


def _unusable(refit: Refit) -> Said | None:
    """Where the corners cannot be compared with the camera."""
    if refit.without_image > NO_IMAGE:
        return "fail", f"{refit.without_image:.0%} of the corners lie where this calibration has no image", ""
    if refit.set_aside > MOST_ASIDE or refit.views < FEWEST_VIEWS:
        settle = "sharp pictures of a flat board, and the right --board."
        return "inconclusive", f"{refit.set_aside:.0%} of the corners contradict the others", settle
    return None


def _judged(refit: Refit, limit: float, names: tuple[str, ...], covariance: Array | None) -> Said:
    """By how far the camera is off; `covariance` is that of its parameters `names` by the calibration's own corners."""
    least, most = refit.bounds
    off = f"it is off by {px(refit.change)} over the image (RMS)"
    verdict, missing = rated(least, most, limit), gaps(refit.camera, refit.corners)
    if verdict in ("fail", "warn") and refit.pattern < limit / 2 and refit.explained_by(names, covariance):
        known = reach(far_columns(refit.camera, names), np.asarray(covariance))
        longer = max(refit.camera.intrinsics.width, refit.camera.intrinsics.height)
        how = f"known better than to {px(known)}" if known < longer else "decided by its own views"
        reason = f"{off}, which its own uncertainty explains: it was never {how}"
        return "warn", reason, "a calibration from more views."
    if verdict == "fail":
        return "fail", f"the calibration does not describe this camera: {off}, surely by more than {px(least)}", ""
    if verdict == "warn":
        reason = f"{off}, surely by more than {px(least)}, which is half of the {px(limit)} allowed, or more"
        return "warn", reason, _more(refit, limit)
    if missing:
        parts = enumerated(missing)
        more = f" In all, {_more(refit, limit)}" if verdict == "inconclusive" else ""
        return "inconclusive", f"there are too few corners in {parts}", f"views with corners in {parts}.{more}"
    if verdict == "inconclusive":
        reason = f"{off}, but {px(most)} cannot be ruled out, and {px(limit)} are allowed"
        return "inconclusive", reason, _more(refit, limit)
    return "pass", f"the calibration holds: {off}, surely by less than {px(most)}", ""


def _more(refit: Refit, limit: float) -> str:
    """How many views would do, if the uncertainty falls with their root."""
    least, most = refit.bounds
    room = limit - refit.change
    times = (most - refit.change if room > 0 else refit.change - least) ** 2 / max(room**2, np.finfo(float).tiny)
    if times > MOST_TIMES:
        return f"many more views than {refit.views}, for the change is close to the limit; or a new calibration."
    wanted = ceil(refit.views * max(times, 1.1))
    return f"about {wanted} views like these {refit.views}; or larger and more tilted boards, and sharper pictures."


def _facts(refit: Refit) -> tuple[str, ...]:
    """The numbers in words."""
    values = refit.values()
    (fx, fx_now, sigma), (cx, cx_now, cx_sigma), (cy, cy_now, cy_sigma) = (values[key] for key in ("fx", "cx", "cy"))
    told = {"fx": f"{sigma / fx:.2%}", "cx": f"{cx_sigma:.2f}", "cy": f"{cy_sigma:.2f}"}
    told |= dict.fromkeys(set(told) & set(refit.undecided), "not known")
    facts = [
        f"evidence: {refit.views} views, {len(refit.corners)} corners, {refit.set_aside:.1%} set aside; residuals of "
        f"{px(refit.sigma)} in each coordinate, counted less six for each pose.",
        f"over the image: {px(np.median(refit.lengths))} (median), {px(np.percentile(refit.lengths, 95))} (95 %);"
        f" chance alone shows up to {px(refit.noise)}.",
        f"solved anew: fx changes by {fx_now / fx - 1:+.2%} (± {told['fx']}), the principal point by "
        f"({cx_now - cx:+.2f}, {cy_now - cy:+.2f}) px (± {told['cx']}, {told['cy']}). It lessens the squares with "
        f"F = {refit.F:.3g}, which independent noise does {refit.chance:.1g} of the time.",
    ]
    if refit.undecided:
        facts.append(
            f"the new views do not decide {enumerated(refit.undecided)}: boards tilted to different sides would."
        )
    if refit.scatter > 2:
        facts.append(
            f"the views differ {refit.scatter:.2g} times as much as their noise explains, in variance: a board that "
            "bends, blur, or focus that hunts. The bounds allow for it."
        )
    return tuple(facts)


def _numbers(refit: Refit) -> dict[str, object]:
    """The same for programs."""
    least, most = refit.bounds
    parameters = {
        key: {"calibrated": was, "now": now, "sigma": None if key in refit.undecided else sigma}
        for key, (was, now, sigma) in refit.values().items()
    }
    return {
        "views": refit.views,
        "corners": len(refit.corners),
        "set_aside": refit.set_aside,
        "residual_px": refit.sigma,
        "change_px": refit.change,
        "least_px": least,
        "most_px": most,
        "median_px": float(np.median(refit.lengths)),
        "p95_px": float(np.percentile(refit.lengths, 95)),
        "chance_px": refit.noise,
        "pattern_px": refit.pattern,
        "F": refit.F,
        "F_chance": refit.chance,
        "scatter": refit.scatter,
        "parameters": parameters,
        "gaps": list(gaps(refit.camera, refit.corners)),
    }
