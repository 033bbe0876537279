"""Which combinations of a camera's parameters its corners leave undecided: directions of theirs without information.

Boards that are parallel to the sensor look alike from twice as far with twice the focal length. Where the poses of the
boards, or other parameters, make up for a change, no corner tells of it, and a standard deviation has no end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from camviz.cameras import Camera
from camviz.lenses import Perspective
from camviz.lenses.base import Array
from camviz_clinic.calibration.adjustment import Adjustment
from camviz_clinic.calibration.arrowhead import inverse
from camviz_clinic.calibration.difference import pixel_grid
from camviz_clinic.calibration.jacobian import pixel_jacobian
from camviz_clinic.calibration.undecided import Undecided

UNDECIDED = 0.01  # of the picture's longer side: what is known of a camera before any picture was taken
PART = 0.01  # of the squares of a combination: parameters with less are not named
ORDINARY_NOISE = 0.3  # pixels: corners that scatter more have a trouble of their own
GRID = (24, 18)  # points of the picture


def undecided(adjustment: Adjustment, name: str, noise: float) -> tuple[Undecided, ...]:
    """The combinations of camera `name`'s estimated intrinsics that the corners do not decide, the worst first.

    Each parameter is measured by what it alone does to the picture: S_j is the RMS shift over the picture in pixels for
    one unit of it. With Λ, the information on the intrinsics once the poses and all other parameters have taken their
    share (`Arrowhead.information`), the eigenvectors of S⁻¹ Λ S⁻¹ are the combinations, and noise/√λ is the standard
    deviation of each, in pixels. It is undecided above 1 % of the picture's longer side. Priors do not count: they are
    what is assumed, and not what corners say. `noise` is that of one coordinate of a corner in pixels, of which at most
    0.3 px are taken, so that bad corners do not pass for missing views. Units that one would have to choose do not
    matter (Belsley, Kuh & Welsch 1980, "Regression Diagnostics", section 3.2, scale the columns to the same end).

    >>> from camviz_clinic.checks.virtual import single
    >>> rng = np.random.default_rng(1)
    >>> for tilt in (40, 1):  # degrees, to all sides
    ...     set_up = single(rng, tilt_deg=(0, tilt))
    ...     solved = set_up.solved(set_up.observed(rng))
    ...     [list(each.changes) for each in undecided(Adjustment.of(solved), "camera", set_up.noise)[:1]]  # the worst
    []
    [['fx', 'fy']]
    """
    names = adjustment.estimated[name]
    if not names or not adjustment.used[name].any():
        return ()
    camera, data = adjustment.cameras[name], replace(adjustment, priors={}) if adjustment.at_work else adjustment
    follow = _follow(data, name)
    information = follow.T @ data.normal_equations.information @ follow
    shifts = _shifts(camera, names)
    return _combinations(
        camera,
        names,
        shifts,
        information / min(noise, ORDINARY_NOISE) ** 2,
        lambda direction: _farthest(data, name, follow @ direction),
    )


def undecided_by_covariance(camera: Camera, names: tuple[str, ...], covariance: Array) -> tuple[Undecided, ...]:
    """The same of a camera without corners, whose file holds the covariance (n, n) of the parameters `names`.

    Its inverse is the information, whatever the corners were of. How far one of them would move is not known: NaN.

    >>> from camviz.cameras import Intrinsics
    >>> camera = Camera(Intrinsics.from_fov(640, 480, 60))
    >>> for sigma in (1.0, 300.0):  # pixels, of a focal length that both axes have in common
    ...     covariance = np.eye(2) + sigma**2
    ...     [list(each.changes) for each in undecided_by_covariance(camera, ("fx", "fy"), covariance)]
    []
    [['fx', 'fy']]
    """
    if not names or not np.isfinite(covariance).all():
        return ()
    shifts = _shifts(camera, names)
    values, vectors = np.linalg.eigh(covariance * np.outer(shifts, shifts))
    values = np.maximum(values, np.finfo(float).eps * max(values[-1], np.finfo(float).tiny))
    information = (vectors / values) @ vectors.T * np.outer(shifts, shifts)
    return _combinations(camera, names, shifts, information, lambda direction: np.nan)


def undecided_names(adjustment: Adjustment, name: str) -> set[str]:
    """Those of camera `name`'s estimated intrinsics that are part of such a combination, by the fit's own noise."""
    return {key for each in undecided(adjustment, name, adjustment.sigma) for key in each.changes}


def _combinations(
    camera: Camera, names: tuple[str, ...], shifts: Array, information: Array, farthest: Callable[[Array], float]
) -> tuple[Undecided, ...]:
    """Those that this information (n, n), the inverse of a covariance, leaves undecided, the worst first."""
    values, vectors = np.linalg.eigh(information / np.outer(shifts, shifts))
    values = np.maximum(values, np.finfo(float).eps * max(values[-1], np.finfo(float).tiny))
    deviations = 1 / np.sqrt(values)
    longer = UNDECIDED * max(camera.intrinsics.width, camera.intrinsics.height)
    visible = np.sqrt(np.maximum(np.diag(information), 0))
    return tuple(
        _combination(names, longer * vector / shifts, visible, farthest, float(deviation / longer))
        for deviation, vector in zip(deviations, vectors.T, strict=True)
        if deviation > longer
    )


def _combination(
    names: tuple[str, ...], direction: Array, visible: Array, farthest: Callable[[Array], float], deviation: float
) -> Undecided:
    """In words: the parameters whose effects on the corners cancel, `visible` (n,) being that of one unit of each."""
    direction = direction * np.sign(direction[np.abs(direction * visible).argmax()] or 1.0)
    squares = (direction * visible) ** 2
    named = squares > PART * squares.sum()
    changes = {key: float(value) for key, value, said in zip(names, direction, named, strict=True) if said}
    return Undecided(names, direction, changes, farthest(direction), deviation)


def _follow(data: Adjustment, name: str) -> Array:
    """How all shared parameters follow camera `name`'s intrinsics, (s, n), where that costs the least squares."""
    information, place = data.normal_equations.information, data.intrinsics_of(name)
    own = np.zeros(len(information), bool)
    own[place] = True
    follow = np.zeros((len(information), int(own.sum())))
    follow[own] = np.eye(follow.shape[1])
    if not own.all():
        follow[~own] = -inverse(information[np.ix_(~own, ~own)]) @ information[np.ix_(~own, own)]
    return follow


def _farthest(data: Adjustment, name: str, shared: Array) -> float:
    """How far the corner moves in pixels that moves most, for a change (s,) that the poses follow."""
    by_shared, by_pose = data.jacobian(name)
    twists = data.normal_equations.pose_response @ shared
    moved = by_shared @ shared - np.einsum("vcip,vp->vci", by_pose, twists)
    return float(np.linalg.norm(moved, axis=-1)[data.used[name][data.posed]].max())


def _shifts(camera: Camera, names: tuple[str, ...]) -> Array:
    """The RMS shift (n,) of the picture in pixels for one unit of each parameter.

    A lens that the corners leave open may fold inside its own picture: pixels without a ray stand for a pinhole's.
    """
    xy = camera.intrinsics.from_pixels(pixel_grid(camera.intrinsics, GRID).reshape(-1, 2))
    rays = camera.lens.unproject(xy)
    straight = Perspective().unproject(xy)
    _, _, by_parameter = pixel_jacobian(camera, np.where(np.isfinite(rays), rays, straight), names)
    squares = np.sum(by_parameter**2, axis=1)
    squares = squares[np.isfinite(squares).all(axis=-1)]
    shifts = np.sqrt(squares.mean(axis=0)) if len(squares) else np.ones(len(names))
    return np.where(shifts > 0, shifts, 1.0)
