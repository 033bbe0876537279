"""Catadioptric cameras: a camera that looks into a curved mirror, traced ray by ray.

The frame is that of the viewpoint: its origin is the focus of the mirror, z runs from there towards the camera, which
looks back along -z. Image points are not mirrored: left and right are swapped back.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from math import inf, isfinite, sqrt

import numpy as np
from numpy.typing import ArrayLike

from camviz.cameras import Intrinsics, transform
from camviz.lenses.arrays import Points, Rays
from camviz.lenses.base import Array, as_points, unit
from camviz.lenses.fisheye import Fisheye
from camviz.poses import RigidTransform
from camviz.scenes import Scene
from camviz.scenes.rays import Floats

TABLE = 2049  # image radii whose rays are traced to find those of angles


def eccentricity(xi: float) -> float:
    """Of the mirror whose camera has this ξ = 2e/(1 + e²), 0 < ξ ≤ 1 (Geyer & Daniilidis 2000): 1 is a paraboloid."""
    if not 0 < xi <= 1:
        raise ValueError(f"xi must be above 0 and at most 1, got {xi}")
    return (1 + sqrt(1 - xi * xi)) / xi


@dataclass(frozen=True)
class Mirror:
    """A curved mirror: a conic turned about its axis, x² + y² = 2 p s - (1 - e²) s², s metres below its top.

    The origin is its focus; z runs from there towards the camera, with the top p/(1 + e) above.

    Args:
        eccentricity: e: 0 for a sphere, 1 for a paraboloid, more for a hyperboloid.
        curvature_radius: p, of its top, in metres.
        rim: The distance of its edge from the axis, in metres.

    Raises: ValueError for an eccentricity below 0, and a radius or rim that is not positive.
    Source: S. Baker and S. K. Nayar, A theory of single-viewpoint catadioptric image formation, Int. J. Comput. Vis. 35
    (1999).

    A paraboloid of p = 4 cm is x² / 2p = 1.125 cm deep at a rim of 3 cm:

    >>> mirror = Mirror(eccentricity=1, curvature_radius=0.04, rim=0.03)
    >>> mirror.top, mirror.depth(0.03)
    (0.02, array(0.01125))
    """

    eccentricity: float
    curvature_radius: float
    rim: float = inf

    def __post_init__(self) -> None:
        if not (isfinite(self.eccentricity) and self.eccentricity >= 0):
            raise ValueError(f"eccentricity must be a number of at least 0, got {self.eccentricity}")
        if not (isfinite(self.curvature_radius) and self.curvature_radius > 0):
            raise ValueError(f"curvature_radius must be a positive number of metres, got {self.curvature_radius}")
        if not self.rim > 0:
            raise ValueError(f"rim must be a positive number of metres, got {self.rim}")

    @property
    def top(self) -> float:
        """z of the mirror's point on the axis, in metres."""
        return self.curvature_radius / (1 + self.eccentricity)

    @property
    def second_focus(self) -> float:
        """z of the other focus in metres, where a perspective camera must stand; at e = 1 it is infinite, for an
        orthographic one.
        """
        e = self.eccentricity
        if e < 1:
            raise ValueError(f"eccentricity must be at least 1 for a second focus in front of the mirror, got {e}")
        return 2 * self.curvature_radius * e / (e * e - 1) if e > 1 else inf

    def depth(self, radius: ArrayLike) -> Array:
        """How far below the top the surface is.

        Args:
            radius: (...), distances from the axis in metres.

        Returns: (...), in metres; NaN where there is no mirror.
        """
        radius, p = np.asarray(radius, dtype=float), self.curvature_radius
        with np.errstate(invalid="ignore"):
            root = np.sqrt(p * p - (1 - self.eccentricity**2) * radius**2)
        return np.where(radius <= self.rim, radius**2 / (p + root), np.nan)

    def normal(self, points: ArrayLike) -> Rays:
        """The surface's normals, outwards: half the gradient of the quadric.

        Args:
            points: (..., 3), of the surface, in metres.
        """
        x, y, z = np.moveaxis(as_points(points, 3, "points"), -1, 0)
        return unit(np.stack([x, y, self.curvature_radius - (1 - self.eccentricity**2) * (self.top - z)], axis=-1))

    def intersect(self, origins: Array, directions: Array) -> Points:
        """Where rays meet the mirror first.

        Args:
            origins, directions: (..., 3), in metres; the directions of any length.
        """
        shape = 1 - self.eccentricity**2
        start, step = self.top - origins[..., 2], -directions[..., 2]
        a = np.sum(directions[..., :2] ** 2, axis=-1) + shape * step**2
        b = np.sum(origins[..., :2] * directions[..., :2], axis=-1) + (shape * start - self.curvature_radius) * step
        c = np.sum(origins[..., :2] ** 2, axis=-1) + (shape * start - 2 * self.curvature_radius) * start
        with np.errstate(invalid="ignore", divide="ignore"):
            q = -b - np.copysign(np.sqrt(b * b - a * c), b)  # a t² + 2 b t + c = 0 without losing digits
            roots = np.stack([q / a, c / q])
            below = start + roots * step  # a hyperboloid's other half lies above the top
            good = (roots > 0) & (below > -1e-9 * self.curvature_radius)
            along = np.where(good, roots, inf).min(axis=0)
            points = origins + along[..., None] * directions
            return np.where(np.hypot(points[..., 0], points[..., 1])[..., None] <= self.rim, points, np.nan)


@dataclass(frozen=True)
class Catadioptric:
    """A camera that looks into a curved mirror, on the mirror's axis, traced ray by ray.

    All rays it sees pass, when prolonged, through one point only where the camera stands in the mirror's other focus.
    Image points are (x, y)/z of the camera; of an orthographic one x and y in metres. They are not mirrored: left and
    right are swapped back.

    Args:
        mirror: Its focus is the origin.
        distance: The camera is at z = `distance` metres; at infinity it is orthographic.

    Raises: ValueError for a camera that is not above the mirror's top.
    Source: S. Baker and S. K. Nayar, A theory of single-viewpoint catadioptric image formation, Int. J. Comput. Vis. 35
    (1999); C. Geyer and K. Daniilidis, A unifying theory for central panoramic systems and practical implications, ECCV
    2000.

    A paraboloid shows the horizon at the radius p, and what it shows comes straight from its focus:

    >>> camera = Catadioptric.central(Mirror(eccentricity=1, curvature_radius=0.04))
    >>> points, directions = camera.trace([0.04, 0])
    >>> points.round(6), directions.round(6)
    (array([0.04, 0.  , 0.  ]), array([1., 0., 0.]))
    """

    mirror: Mirror
    distance: float

    def __post_init__(self) -> None:
        if not self.distance > self.mirror.top:
            raise ValueError(f"distance must be beyond the mirror's top, at {self.mirror.top:g} m, got {self.distance}")

    @classmethod
    def central(cls, mirror: Mirror) -> Catadioptric:
        """With the camera in the mirror's second focus, so that there is a single viewpoint.

        Args:
            mirror: A paraboloid or a hyperboloid.

        Returns: Catadioptric with a perspective camera, or with an orthographic one for a paraboloid.
        Raises: ValueError for an eccentricity below 1.
        """
        return cls(mirror, mirror.second_focus)

    def moved(self, metres: float) -> Catadioptric:
        """With the camera farther from the mirror.

        Args:
            metres: By how much.
        """
        return replace(self, distance=self.distance + metres)

    @property
    def unified(self) -> tuple[float, float]:
        """ξ and the scale that `UnifiedSphere(xi).project` must be multiplied by, for a camera in the second focus.

        ξ = 2e/(1 + e²) and (e² - 1)/(e² + 1), after Geyer and Daniilidis; a paraboloid has 1 and its p. A camera that
        stands elsewhere, whose rays no such lens describes, is refused with a ValueError.
        """
        e = self.mirror.eccentricity
        if self.distance != self.mirror.second_focus:
            raise ValueError(f"distance must be {self.mirror.second_focus:g} m for one viewpoint, got {self.distance}")
        return 2 * e / (1 + e * e), (e * e - 1) / (e * e + 1) if e > 1 else self.mirror.curvature_radius

    def before(self, xy: ArrayLike) -> tuple[Array, Array]:
        """The camera's own rays to image points, before the mirror.

        Args:
            xy: (..., 2), in focal lengths; of an orthographic camera in metres.

        Returns:
            starts: (..., 3), in metres.
            directions: (..., 3), unit vectors.
        """
        xy = as_points(xy, 2, "xy")
        back = -np.ones_like(xy[..., :1])
        if isfinite(self.distance):
            directions = unit(np.concatenate([xy, back], axis=-1))
            return np.broadcast_to([0, 0, self.distance], directions.shape), directions
        starts = np.concatenate([xy, 0 * back + 2 * self.mirror.top], axis=-1)
        return starts, np.concatenate([0 * xy, back], axis=-1)

    def trace(self, xy: ArrayLike) -> tuple[Array, Array]:
        """The rays seen at image points: where they leave the mirror, by the law of reflection d - 2 (d·n) n.

        Args:
            xy: (..., 2), in focal lengths; of an orthographic camera in metres.

        Returns:
            points: (..., 3), where the rays leave the mirror, in metres; NaN where there is none.
            directions: (..., 3), unit vectors; NaN where there is none.
        """
        starts, directions = self.before(xy)
        points = self.mirror.intersect(starts, directions)
        normals = self.mirror.normal(points)
        return points, directions - 2 * np.sum(directions * normals, axis=-1, keepdims=True) * normals

    def rim(self) -> float:
        """The radius of the image of the mirror's rim.

        Returns: In focal lengths; of an orthographic camera in metres.
        """
        below = float(self.mirror.depth(self.mirror.rim))
        away = self.distance - self.mirror.top + below
        return self.mirror.rim / away if isfinite(self.distance) else self.mirror.rim

    def caustic(self, xs: ArrayLike) -> Array:
        """Where neighbouring rays of one plane through the axis cross: the envelope of the reflected rays, prolonged.

        Args:
            xs: (n,), image radii, in focal lengths or metres.

        Returns: (n, 2), radius and z in metres; one point for a central camera.
        Source: R. Swaminathan, M. D. Grossberg and S. K. Nayar, Non-single viewpoint catadioptric cameras: geometry and
        analysis, Int. J. Comput. Vis. 66 (2006).
        """
        xs = np.asarray(xs, dtype=float)
        h = 1e-5 * np.abs(xs).max()
        (p0, d0), (p1, d1) = (self._meridian(xs + step) for step in (-h, h))
        with np.errstate(invalid="ignore", divide="ignore"):
            along = _cross(p1 - p0, d1) / _cross(d0, d1)
        return p0 + along[..., None] * d0

    def _meridian(self, xs: Array) -> tuple[Array, Array]:
        points, directions = self.trace(np.stack([xs, 0 * xs], axis=-1))
        return points[..., ::2], directions[..., ::2]

    def best_viewpoint(self, xs: ArrayLike) -> float:
        """The point on the axis that is nearest, by least squares, to the rays that are seen.

        Args:
            xs: (n,), image radii, in focal lengths or metres.

        Returns: Its z in metres.
        """
        points, directions = self._meridian(np.asarray(xs, dtype=float))
        sine, off = directions[:, 0], _cross(points, directions)  # the distance from (0, z) is |off + z sine|
        return float(-np.nansum(off * sine) / np.nansum(sine * sine))


@dataclass(frozen=True)
class MirrorLens(Fisheye):
    """A mirror as a lens that has the directions of its rays, as if all passed through one point.

    For a central camera they do, and `UnifiedSphere` is the formula. Both ways are looked up in a table of
    traced rays, which errs by less than 1e-6 of the rim's image and of a radian.
    """

    camera: Catadioptric

    @property
    def max_angle(self) -> float:
        return float(_angles(self.camera)[0][-1])

    def radial(self, theta: ArrayLike) -> Array:
        return np.interp(np.asarray(theta, dtype=float), *_angles(self.camera))

    def angle(self, radius: Array) -> Array:
        angles, radii = _angles(self.camera)
        return np.interp(radius, radii, angles)


@lru_cache(maxsize=4)
def _angles(camera: Catadioptric) -> tuple[Array, Array]:
    """Angles from the axis, traced, and the image radii (n,) of their rays, out to the rim."""
    radii = np.linspace(0, camera.rim() * (1 - 1e-9), TABLE)
    _, directions = camera.trace(np.stack([radii, 0 * radii], axis=-1))
    return np.arctan2(directions[:, 0], directions[:, 2]), radii


def miss(points: ArrayLike, directions: ArrayLike, viewpoint: ArrayLike = (0, 0, 0)) -> Array:
    """How far (...) rays through `points` along unit `directions`, prolonged, pass from a viewpoint (3,); metres."""
    offsets = as_points(points, 3, "points") - as_points(viewpoint, 3, "viewpoint")
    return np.linalg.norm(np.cross(offsets, as_points(directions, 3, "directions")), axis=-1)


def direction_error(missed: ArrayLike, distance: ArrayLike) -> Array:
    """By what angle (...) in radians a point `distance` metres from a viewpoint is mistaken when its ray misses that.

    The pixel was given its ray's direction, which is right infinitely far away: sin ε = miss / distance.
    """
    with np.errstate(invalid="ignore"):
        return np.arcsin(np.asarray(missed, dtype=float) / np.asarray(distance, dtype=float))


def photograph(scene: Scene, camera: Catadioptric, pixels: Intrinsics, world_from_viewpoint: RigidTransform) -> Floats:
    """The scene (height, width, 3) in the mirror, linear light, every ray followed from where it leaves the mirror.

    The camera's own reflection in the middle is left out.
    """
    points, directions = camera.trace(pixels.from_pixels(pixels.grid()))
    turned = np.nan_to_num(directions) @ world_from_viewpoint.as_matrix()[:3, :3].T
    turned[np.isnan(directions[..., 0])] = np.nan
    spread = float(np.nanmedian(np.linalg.norm(np.diff(directions, axis=1), axis=-1)))
    return scene.trace(transform(world_from_viewpoint, np.nan_to_num(points)), turned, spread)[0]


def _cross(a: Array, b: Array) -> Array:
    return a[..., 0] * b[..., 1] - a[..., 1] * b[..., 0]
