"""Drawings of a camera and its mirror: in space, cut along the axis, and as a sphere that is seen from ξ behind it."""

from __future__ import annotations

from functools import lru_cache
from math import cos, isfinite, pi, radians, sin

import numpy as np

from camviz.cameras import Intrinsics
from camviz.draw import svg
from camviz.draw.items import Item, Label, Line, TexturedMesh
from camviz.draw.panel import Panel
from camviz.draw.space import Dots
from camviz.lenses.base import Array, unit
from camviz.panoramas.mirrors import Catadioptric, Mirror, MirrorLens, eccentricity

RIM_MM = 40.0  # from the axis to the edge of what is shown
LEAST_XI = 1e-3  # below it a mirror is flat to within a micrometre
SPHERE_MM, SPHERE_AWAY_MM = 50.0, 150.0
MARGIN_DEG = 8.0  # that a hyperboloid ends before its asymptote
LOWEST_MM = 104.0  # below the viewpoint, where a drawing ends
RAY_MM = 75.0


@lru_cache(maxsize=8)
def mirror_camera(kind: str, xi: float, rim_deg: float, shift_mm: float) -> Catadioptric:
    """The camera of a mirror that shows `rim_deg` from its axis, 40 mm in radius, as far as it can; metres.

    The camera stands in the second focus, `shift_mm` farther away; before a sphere, 150 mm away. Raises ValueError
    where it would stand within the mirror.
    """
    if kind == "spherical":
        whole = Catadioptric(Mirror(0.0, SPHERE_MM / 1000, 0.99 * SPHERE_MM / 1000), SPHERE_AWAY_MM / 1000)
        whole = whole.moved(shift_mm / 1000)
        xs = np.linspace(0, 0.999 * whole.rim(), 400)
        angles = MirrorLens(whole).angle(xs)
        point, _ = whole.trace([float(np.interp(radians(rim_deg), angles, xs)), 0.0])
        return Catadioptric(Mirror(0.0, SPHERE_MM / 1000, float(point[0])), whole.distance)
    e = eccentricity(max(xi, LEAST_XI)) if kind == "hyperbolic" else 1.0
    edge = min(radians(rim_deg), np.arccos(-1 / e) - radians(MARGIN_DEG))
    p = RIM_MM / 1000 * (1 + e * cos(edge)) / sin(edge)
    central = Catadioptric.central(Mirror(e, p, RIM_MM / 1000))
    if e <= 1:
        return central
    nearest = 1000 * (central.mirror.top - central.distance)
    if not shift_mm > nearest:
        raise ValueError(f"shift_mm must be above {nearest:.1f}: there the camera meets this mirror, got {shift_mm:g}")
    return central.moved(shift_mm / 1000)


def viewpoint(camera: Catadioptric) -> float:
    """z of the point on the axis that is nearest to the rays of the whole picture."""
    return camera.best_viewpoint(np.linspace(0.02, 0.98, 60) * camera.rim())


# In space ------------------------------------------------------------------------------------------------------------


def in_space(camera: Catadioptric, picture: np.ndarray, towards: Array, *, draft: bool = False) -> list[Item]:
    """The mirror wearing its picture, the camera below it, and rays; decimetres in a frame whose y axis is down.

    `picture` is square and holds the mirror's image; `towards` (3,), in the viewpoint's frame, is where the orange ray
    comes from.
    """
    rings, around = (3, 13) if draft else (6, 33)
    radius = camera.mirror.rim * np.sqrt(np.linspace(0, 1, rings))[:, None] * (1 - 1e-12)
    turn = np.linspace(0, 2 * pi, around)
    z = camera.mirror.top - camera.mirror.depth(radius) + 0 * turn
    bowl = _upright(np.stack([radius * np.cos(turn), radius * np.sin(turn), z], axis=-1))
    items: list[Item] = [_wearing(bowl, _rings(camera, radius, turn), picture), Line(bowl[-1], "ink", 1.8)]
    azimuth = np.arange(8)[:, None] * pi / 4
    blue = 0.72 * camera.rim() * np.concatenate([np.cos(azimuth), np.sin(azimuth)], axis=-1)
    legs = _legs(camera, np.vstack([blue, MirrorLens(camera).project(towards)]))
    focus = _upright(np.array([0, 0, viewpoint(camera)]))
    for i, (start, point, end) in enumerate(_upright(legs)):
        colour, width = ("orange", 2.4) if i == len(blue) else ("blue", 1.2)
        back = point - np.linalg.norm(point - focus) * unit(start - point)
        items += [
            Line(np.array([start, point, end]), colour, width),
            Line(np.array([point, back]), "muted dashed", 0.9),
        ]
    lowest = min(camera.distance, LOWEST_MM / 1000)
    words = "camera" if lowest == camera.distance else "to the camera"
    return [
        *items,
        Dots(focus, "red", 7),
        Label(focus + (0.04, -0.06, 0), "viewpoint", "label red halo"),
        Dots(_upright(np.array([0, 0, lowest])), "ink", 8),
        Label(_upright(np.array([0.006, 0, lowest])), words, "label halo"),
    ]


def _upright(points: Array) -> Array:
    """Decimetres, with the viewpoint's z, towards the camera, downwards: (x, y, z) → (x, z, -y)."""
    return 10 * np.stack([points[..., 0], points[..., 2], -points[..., 1]], axis=-1)


def _rings(camera: Catadioptric, radius: Array, turn: Array) -> Array:
    """The image points of points of the mirror, (m, n, 2), in radii of its rim's image."""
    below = camera.mirror.depth(radius)
    away = camera.distance - camera.mirror.top + below if isfinite(camera.distance) else 1.0
    scaled = radius / away / camera.rim()
    return np.stack([scaled * np.cos(turn), scaled * np.sin(turn)], axis=-1)


def _wearing(bowl: Array, image: Array, picture: np.ndarray) -> TexturedMesh:
    """The mirror (m, n, 3) with its picture on it."""
    sheet = TexturedMesh.over(bowl, picture, 0.9)
    uv = np.stack([0.5 + 0.5 * image[..., 0], 0.5 - 0.5 * image[..., 1]], axis=-1).reshape(-1, 2)
    return TexturedMesh(sheet.vertices, sheet.quads, uv, picture, 0.9)


def _legs(camera: Catadioptric, xy: Array) -> Array:
    """Of the rays of image points (n, 2): RAY_MM out, on the mirror, and where they leave the drawing, (n, 3, 3)."""
    points, directions = camera.trace(xy)
    _, came = camera.before(xy)
    lowest = min(camera.distance, LOWEST_MM / 1000)
    ends = points - (points[:, 2:] - lowest) / came[:, 2:] * came
    return np.stack([points + RAY_MM / 1000 * directions, points, ends], axis=1)


# Cut along the axis --------------------------------------------------------------------------------------------------


def section(panel: Panel, camera: Catadioptric, towards_deg: float) -> svg.Marks:
    """The mirror cut along its axis, rays of nine pixels, their prolongations, and where neighbours of these cross.

    Millimetres across and, downwards, towards the camera. The orange ray comes from `towards_deg` off the axis.
    """
    rim = camera.rim()
    x = np.append(np.linspace(-0.96, 0.96, 10) * rim, MirrorLens(camera).radial(radians(towards_deg)))
    rays = 1000 * _legs(camera, np.stack([x, 0 * x], axis=-1))[..., ::2]
    start, point = rays[:, 0], rays[:, 1]
    back = point - 1.25 * np.linalg.norm(point, axis=-1, keepdims=True) * unit(start - point)
    r = np.linspace(-1, 1, 81) * camera.mirror.rim * (1 - 1e-12)
    profile = np.stack([r, camera.mirror.top - camera.mirror.depth(np.abs(r))], axis=-1)
    return (
        svg.segments(panel.place(point), panel.place(back), "muted thin dashed")
        + svg.path(panel.place(rays[:-1]), "blue thin")
        + svg.line(panel.place(rays[-1]), "orange thick")
        + svg.line(panel.place(1000 * profile), "ink thick")
        + _crossings(panel, camera)
    )


def _crossings(panel: Panel, camera: Catadioptric) -> svg.Marks:
    """Where neighbouring rays cross: in one point, or along a caustic."""
    caustic = 1000 * camera.caustic(np.linspace(0.02, 0.985, 60) * camera.rim())
    if np.nanmax(np.ptp(caustic, axis=0)) > 1e-3:  # micrometres
        both, words = [panel.place(caustic * side) for side in ((1, 1), (-1, 1))], "caustic: no single viewpoint"
        return svg.path(both, "red thick") + svg.text((panel.width / 2, 18), words, "label red halo middle")
    dot = svg.dots([panel.place((0, 0))], "red", 8)
    return dot + svg.text((panel.width / 2, 18), "one viewpoint: the focus", "label red halo middle")


# The sphere ----------------------------------------------------------------------------------------------------------


def sphere(panel: Panel, xi: float, rim_deg: float, towards_deg: float) -> svg.Marks:
    """The unified sphere, cut: directions go to the sphere, and from there to a plane, seen from ξ above its centre."""
    turn = np.linspace(0, 2 * pi, 121)
    circle = np.stack([np.sin(turn), np.cos(turn)], axis=-1)
    flat = 1.5  # where the plane is drawn, below the centre
    eye, drawn = np.array([0.0, -xi]), svg.NOTHING
    for angle, class_ in [(a, "blue thin") for a in np.linspace(-rim_deg, rim_deg, 10)] + [(towards_deg, "orange")]:
        on = np.array([sin(radians(angle)), cos(radians(angle))])
        depth = on[1] + xi
        if depth < 0.05:
            continue
        hit = eye + (flat + xi) / depth * (on - eye)
        drawn += svg.line(panel.place([2.2 * on, on]), class_) + svg.line(panel.place([eye, on]), "muted thin dashed")
        drawn += svg.line(panel.place([on, hit] if depth > 0 else [on, eye]), class_) + svg.dots(
            [panel.place(hit)], class_.split()[0], 6
        )
    plane = panel.place([(panel.left, flat), (panel.right, flat)])
    words = f"seen from ξ = {xi:g} above the centre"
    return (
        drawn
        + svg.line(panel.place(circle), "ink")
        + svg.line(plane, "ink thick")
        + svg.dots([panel.place((0, 0))], "red", 8)
        + svg.dots([panel.place(eye)], "ink", 8)
        + svg.text((panel.width / 2, 18), words, "label halo middle")
        + svg.text(plane[0] + (6, -7), "image", "note halo")
    )


def picture_pixels(side: int, scale: float) -> Intrinsics:
    """Square pixels whose inscribed circle is `scale` in lens coordinates."""
    f = side / 2 / scale
    return Intrinsics(side, side, f, f, (side - 1) / 2, (side - 1) / 2)
