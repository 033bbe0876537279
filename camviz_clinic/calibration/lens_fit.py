"""The camera of another lens model that shows the same rays at nearly the same pixels, and how far it is off."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.lenses.base import Array
from camviz_clinic.calibration.camera_models import MODELS
from camviz_clinic.calibration.difference import pixel_grid
from camviz_clinic.calibration.jacobian import parameter, pixel_jacobian, with_parameters

FITTED_ON = (60, 40)  # columns × rows of pixels
JUDGED_ON = 320  # at most so many columns and rows
SAME = 1 - 1e-4  # of the worst error: corners that mirror each other differ by rounding, and the first is named
FAR = 1e6  # pixels: the error of parameters that the lens does not take


@dataclass(frozen=True, eq=False)
class LensFit:
    """A camera of another model, and its error in pixels over the image.

    Errors are taken at the pixels where the first camera has a ray, which is a `share` of the image; `worst` is
    infinite where the other model has no image of a ray.
    """

    camera: Camera
    median: float
    worst: float
    worst_at: tuple[float, float]
    share: float


def fit_lens(camera: Camera, model: str) -> LensFit:
    """The camera of one of `MODELS` by least squares of the pixels that its rays come to.

    Raises ValueError for an unknown model, and where no ray of the camera has an image in it.

    >>> from camviz.lenses import DoubleSphere
    >>> fit = fit_lens(Camera(Intrinsics(640, 480, 350.0, 350.0, 320.0, 240.0), DoubleSphere(-0.2, 0.6)), "fisheye")
    >>> type(fit.camera.lens).__name__, fit.worst < 0.05
    ('KannalaBrandt', True)
    """
    if model not in MODELS:
        raise ValueError(f"model must be one of {', '.join(MODELS)}, got {model!r}")
    wanted = MODELS[model]
    lens, names = wanted.lens, wanted.coefficients.split()
    start: dict[str, Any] = {name: 1.0 for name in lens.parameters() if not hasattr(lens, name)}  # has no default
    start |= dict(zip(names, wanted.start, strict=False))
    uv = pixel_grid(camera.intrinsics, FITTED_ON).reshape(-1, 2)
    rays = camera.lens.unproject(camera.intrinsics.from_pixels(uv))
    first = replace(camera, intrinsics=_start(camera, lens(**start)), lens=lens(**start))
    seen = np.isfinite(rays).all(axis=1) & np.isfinite(first.lens.project_unchecked(rays)).all(axis=1)
    if seen.sum() < 4 + len(names):
        raise ValueError(f"{wanted.title} has no image of the rays of this camera")
    return _judged(camera, _solved(first, ["fx", "fy", "cx", "cy", *names], rays[seen], uv[seen]))


def _start(camera: Camera, lens: Any) -> Intrinsics:
    """Intrinsics with the scale that the camera has at its principal point, for another lens."""
    near = np.array([[1e-4, 0, 1], [0, 1e-4, 1.0]])
    ours, theirs = (np.diag(each.project(near)) for each in (camera.lens, lens))
    grid = camera.intrinsics
    x, y = ours / theirs
    return Intrinsics(grid.width, grid.height, grid.fx * x, grid.fy * y, grid.cx, grid.cy)


def _solved(first: Camera, names: list[str], rays: Array, uv: Array) -> Camera:
    from scipy.optimize import least_squares

    def camera_of(values: Array) -> Camera:
        return with_parameters(first, dict(zip(names, values, strict=True)))

    def off(values: Array) -> Array:
        try:
            camera = camera_of(values)
        except ValueError:  # the lens does not take them
            return np.full(uv.size, FAR)
        pixels = camera.intrinsics.to_pixels(camera.lens.project_unchecked(rays))
        return np.nan_to_num(pixels - uv, nan=FAR, posinf=FAR, neginf=-FAR).ravel()

    def slopes(values: Array) -> Array:
        return np.nan_to_num(pixel_jacobian(camera_of(values), rays, names)[2]).reshape(-1, len(names))

    begin = np.array([parameter(first, name) for name in names])
    solution = least_squares(off, begin, jac=slopes, method="lm", x_scale="jac", ftol=1e-12, xtol=1e-12, gtol=1e-12)
    return camera_of(solution.x)


def _judged(camera: Camera, fitted: Camera) -> LensFit:
    """The error on a dense grid that reaches into the corners."""
    grid = camera.intrinsics
    uv = pixel_grid(grid, (min(grid.width, JUDGED_ON), min(grid.height, JUDGED_ON))).reshape(-1, 2)
    rays = camera.lens.unproject(grid.from_pixels(uv))
    seen = np.isfinite(rays).all(axis=1)
    error = np.linalg.norm(fitted.intrinsics.to_pixels(fitted.lens.project(rays[seen])) - uv[seen], axis=1)
    error = np.nan_to_num(error, nan=np.inf)
    u, v = uv[seen][np.argmax(error >= error.max() * SAME)]
    return LensFit(fitted, float(np.median(error)), float(error.max()), (float(u), float(v)), float(seen.mean()))
