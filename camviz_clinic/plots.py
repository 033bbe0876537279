"""Calibrations and cameras on axes of matplotlib, for a figure of one's own or a paper.

Every function draws on the axes `ax` that it is given, or on new ones, and returns them. Fonts, line widths and colours
are those of matplotlib's `rcParams`; more keywords go to the lines, arrows or dots that are drawn. Axes over a picture
count pixels as camviz does: u to the right, v down, whole numbers at the centres of pixels. Axes in space are metres,
x right, y down, z forward. matplotlib is imported when axes are made.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Camera, Intrinsics, Rig, transform
from camviz.distortion import displacement
from camviz.draw.items import Line, camera_body
from camviz.lenses.base import Array, as_points
from camviz.twoview.epipolar import epipolar_curve
from camviz_clinic.calibration.types import Calibration
from camviz_clinic.views.observations import Observations

__all__ = ["boards", "coverage", "distortion", "epipolar", "frusta", "radial", "residuals"]

_DISTANCES = np.append(np.geomspace(0.01, 1000, 200), np.inf)  # metres along a ray


def residuals(
    calibration: Calibration,
    ax: Any = None,
    *,
    camera: str = "",
    view: int | None = None,
    scale: float = 100,
    **options: Any,
) -> Any:
    """Arrows from where every used corner is projected towards where it was detected.

    Args:
        calibration: With corners and poses.
        ax: Axes, where to draw; new ones unless given.
        camera: The first unless named.
        view: Counts from 1; all views unless given.
        scale: How many times as long as the residuals the arrows are.
        **options: Go to `Axes.quiver`.

    Returns: Axes, in pixels.
    Raises: ValueError for a view that there is not; as `Missing`, where the calibration holds no corners or poses.

    >>> from camviz_clinic.checks import virtual
    >>> calibration = virtual.healthy(np.random.default_rng(1))
    >>> residuals(calibration).get_title() == f"residuals × 100, {calibration.rms('camera'):.3g} px RMS"
    True
    """
    seen = Observations.of(calibration, camera)
    used = seen.used & _chosen(view, len(seen))[:, None]
    ax = image_axes(seen.camera.intrinsics, ax)
    starts, arrows = seen.projected[used], scale * seen.residuals[used]
    _quiver(ax, starts, arrows, **options)
    ax.set_title(f"residuals × {scale:g}, {_rms(seen.lengths[used]):.3g} px RMS")
    return ax


def coverage(calibration: Calibration, ax: Any = None, *, camera: str = "", **options: Any) -> Any:
    """Every corner that a camera detected, a colour for each view.

    Args:
        calibration: With corners.
        ax: Axes, where to draw; new ones unless given.
        camera: The first unless named.
        **options: Go to `Axes.plot`.

    Returns: Axes, in pixels.

    Raises:
        Missing: A ValueError, where the calibration holds no corners.

    >>> from camviz_clinic.checks import virtual
    >>> calibration = virtual.healthy(np.random.default_rng(1))
    >>> len(coverage(calibration, marker="+").lines) == len(calibration.detections["camera"])
    True
    """
    seen = Observations.of(calibration, camera)
    ax = image_axes(seen.camera.intrinsics, ax)
    style = {"linestyle": "none", "marker": ".", **options}
    for corners, shown in zip(seen.detections, seen.used | seen.aside, strict=True):
        ax.plot(*corners[shown].T, **style)
    return ax


def distortion(camera: Camera, ax: Any = None, *, step_px: float | None = None, **options: Any) -> Any:
    """Arrows from where a perspective lens puts a point to where this lens does, with contours of their length.

    Args:
        camera: With any lens.
        ax: Axes, where to draw; new ones unless given.
        step_px: Distance of neighbouring arrows in pixels; a sixteenth of the picture's width unless given.
        **options: Go to `Axes.quiver`.

    Returns: Axes, in pixels.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> from camviz.lenses import BrownConrady
    >>> ax = distortion(Camera(Intrinsics(401, 401, 200, 200, 200, 200), BrownConrady(-0.2)), step_px=100)
    >>> float(ax.collections[0].U.min().round(6))  # at (1, 0.5): -0.2 · 1.25 · 200 px
    -50.0
    """
    k = camera.intrinsics
    ax = image_axes(k, ax)
    _quiver(ax, *displacement(camera, step_px or k.width / 16), **options)
    fine, moved = displacement(camera, k.width / 80)
    lengths = np.ma.masked_invalid(np.linalg.norm(moved, axis=-1))
    if lengths.count() and np.ptp(lengths) > 0:
        ax.clabel(ax.contour(fine[..., 0], fine[..., 1], lengths, linewidths=0.8, colors="gray"), fmt="%g px")
    return ax


def radial(camera: Camera, ax: Any = None, *, relative: bool = False, **options: Any) -> Any:
    """How far from the principal point a ray lands against its angle to the axis, out to the far corner.

    Of a lens that is not round, along the picture's x axis.

    Args:
        camera: With any lens.
        ax: Axes, where to draw; new ones unless given.
        relative: Draw how much farther than behind a perspective lens, which needs angles below 90°.
        **options: Go to `Axes.plot`.

    Returns: Axes, degrees, and pixels.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> ax = radial(Camera(Intrinsics.from_fov(640, 480, 90)), label="perspective")
    >>> degrees, pixels = ax.lines[0].get_data()
    >>> f"{degrees[-1]:.1f}° from the axis, {pixels[-1]:.0f} px from the principal point"
    '51.3° from the axis, 399 px from the principal point'
    """
    k, ax = camera.intrinsics, ax or _new_axes()
    corner = np.nanmax(np.linalg.norm(k.to_pixels(k.from_pixels(k.border(1))) - (k.cx, k.cy), axis=-1))
    angle = np.linspace(0, np.pi, 3601)[: 1700 if relative else None]
    rays = np.stack([np.sin(angle), 0 * angle, np.cos(angle)], axis=-1)
    distance = k.to_pixels(camera.lens.project(rays))[:, 0] - k.cx
    inside = np.logical_and.accumulate(distance <= corner)
    shown = distance - k.fx * np.tan(angle) if relative else distance
    ax.plot(np.degrees(angle[inside]), shown[inside], **options)
    ax.set_xlabel("angle to the axis [°]")
    ax.set_ylabel("distortion [px]" if relative else "distance from the principal point [px]")
    return ax


def epipolar(left: Camera, right: Camera, uv_left: ArrayLike, ax: Any = None, **options: Any) -> Any:
    """The epipolar line in the right picture of every left pixel, a colour for each; a curve if lenses bend it.

    `ax.imshow` shows the right photograph below it.

    Args:
        left, right: In place.
        uv_left: (n, 2), pixels of the left picture.
        ax: Axes, where to draw; new ones unless given.
        **options: Go to `Axes.plot`.

    Returns: Axes, in pixels.
    Raises: ValueError where the last axis of `uv_left` has not 2 coordinates.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> from camviz.poses import RigidTransform
    >>> left = Camera(Intrinsics.from_fov(640, 480, 90))
    >>> ax = epipolar(left, left.at(RigidTransform.from_translation([0.1, 0, 0])), [(400, 100)])
    >>> np.nanmax(np.abs(ax.lines[0].get_ydata() - 100)) < 1e-9  # side by side: along the same row
    np.True_
    """
    ax = image_axes(right.intrinsics, ax)
    for curve in epipolar_curve(left, right, as_points(uv_left, 2, "uv_left").reshape(-1, 2), _DISTANCES):
        ax.plot(*np.where(right.intrinsics.contains(curve)[:, None], curve, np.nan).T, **options)
    return ax


def frusta(
    cameras: Camera | Rig | Calibration | Mapping[str, Camera], ax: Any = None, *, depth: float = 0.3, **options: Any
) -> Any:
    """What cameras see, in space, a colour for each.

    Args:
        cameras: Where they stand.
        ax: Axes3D, where to draw; new ones unless given.
        depth: How far their volumes reach, in metres.
        **options: Go to `Axes.plot`.

    Returns: Axes3D, in metres.
    Raises: ValueError for axes that are not 3D.

    >>> from camviz.cameras import Camera, Intrinsics
    >>> one = Camera(Intrinsics.from_fov(640, 480, 90))
    >>> [line.get_label() for line in frusta({"left": one, "right": one}).lines]
    ['left', 'right']
    """
    ax = space_axes(ax)
    named = cameras if isinstance(cameras, Mapping) else getattr(cameras, "cameras", {"": cameras})
    for name, camera in named.items():
        lines = [item.points for item in camera_body(camera, depth) if isinstance(item, Line)]
        _lines(ax, lines, label=name or None, **options)
    ax.set_aspect("equal")
    return ax


def boards(calibration: Calibration, ax: Any = None, *, camera: str = "", **options: Any) -> Any:
    """The outline of the board at every pose from which a camera saw it, in space.

    Args:
        calibration: With corners and poses.
        ax: Axes3D, where to draw; new ones unless given.
        camera: The first unless named.
        **options: Go to `Axes.plot`.

    Returns: Axes3D, in metres.
    Raises: ValueError for axes that are not 3D; as `Missing`, where the calibration holds no corners or poses.

    >>> from camviz_clinic.checks import virtual
    >>> calibration = virtual.healthy(np.random.default_rng(1))
    >>> len(boards(calibration).lines) == len(calibration.detections["camera"])
    True
    """
    seen, ax = Observations.of(calibration, camera), space_axes(ax)
    world_from_cam = calibration.cameras[seen.name].world_from_cam
    left, top, right, bottom = seen.board.area
    outline = np.array([(left, top, 0), (right, top, 0), (right, bottom, 0), (left, bottom, 0), (left, top, 0)])
    for view in np.flatnonzero(seen.shown):
        _lines(ax, [transform(world_from_cam * seen.cam_from_board[view], outline)], **options)
    ax.set_aspect("equal")
    return ax


# Axes -----------------------------------------------------------------------------------------------------------------


def image_axes(intrinsics: Intrinsics, ax: Any = None) -> Any:
    """Axes over the whole of a picture, u to the right and v down, in pixels."""
    ax = ax or _new_axes()
    ax.set(xlim=(-0.5, intrinsics.width - 0.5), ylim=(intrinsics.height - 0.5, -0.5), xlabel="u [px]", ylabel="v [px]")
    ax.set_aspect("equal")
    return ax


def space_axes(ax: Any = None) -> Any:
    """Axes in space, y down, in metres. Raises ValueError for axes that are not 3D."""
    ax = ax or _new_axes(projection="3d")
    if ax.name != "3d":
        raise ValueError(f"ax must be 3D axes, as `figure.add_subplot(projection='3d')` makes, got {ax.name!r} axes")
    ax.set(xlabel="x [m]", ylabel="y [m]", zlabel="z [m]")
    ax.view_init(elev=-20, azim=-150, roll=180, vertical_axis="y")  # upside down, for an inverted axis would mirror
    return ax


def _new_axes(**options: Any) -> Any:
    import matplotlib.pyplot as plt

    return plt.figure(layout="constrained").add_subplot(**options)


def _lines(ax: Any, lines: list[Array], **options: Any) -> None:
    """Lines (n, 3) as one line of one colour."""
    joined = np.concatenate([part for line in lines for part in (line, np.full((1, 3), np.nan))])
    ax.plot(*joined.T, **options)


def _quiver(ax: Any, starts: Array, arrows: Array, **options: Any) -> None:
    """Arrows in the first colour of the cycle, as long as they are in the units of the axes."""
    (first,) = ax.plot([], [])
    style = {"color": first.get_color(), "angles": "xy", "scale_units": "xy", "scale": 1, "width": 0.003, **options}
    first.remove()
    ax.quiver(starts[..., 0], starts[..., 1], arrows[..., 0], arrows[..., 1], **style)


def _chosen(view: int | None, count: int) -> np.ndarray:
    if view is not None and not 1 <= view <= count:
        raise ValueError(f"view must lie between 1 and {count}, got {view}")
    return np.arange(1, count + 1) == view if view is not None else np.ones(count, dtype=bool)


def _rms(lengths: Array) -> float:
    return float(np.sqrt(np.mean(lengths**2))) if lengths.size else float("nan")
