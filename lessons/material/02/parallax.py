"""A thin-lens picture in a fraction of the time: trace every thing once, then look at it from all over the lens.

From another point of the lens a thing is seen shifted by its parallax, fx a (1/s - 1/z), and hides other parts of what
is behind it. So each thing is traced by itself from the middle of the lens, hidden parts included, and for each point
of the lens the layers are shifted, near over far, and added up. It is geometry, ray for ray; what it takes from the
middle of the lens is only which side of a thing is turned to the camera. `aperture.photograph` traces every ray, and
the tests hold the two against each other.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import product

import cv2
import numpy as np

from camviz.cameras import Camera, Intrinsics
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.scenes.rays import Floats
from camviz.scenes.scene import Scene
from camviz.scenes.surfaces import Surface
from camviz.scenes.texture import Texture
from camviz_school.views.aperture import ThinLensCamera

_STEP = 16  # pixels by which the margin around the picture grows, so that layers are seldom traced afresh
_NEAR = 1.0  # metres: what is nearer still may be cut off at the picture's border when it is very blurred
_ZOOM = 1.08  # by which a rough picture's layers are enlarged at most
_ROOM = 1.1  # a ball's outline is a little more than its great circle
Box = tuple[int, int, int, int]  # left, top, right, bottom in pixels of the picture
_BLACK = Texture.plain((0, 0, 0))


@dataclass(frozen=True, eq=False)
class Layer:
    """A thing as seen from the middle of the lens, in a box of the picture whose first pixel is (left, top).

    `light` (h, w, 4) is linear RGB and coverage 0 or 1, `nearness` (h, w) is 1/depth in 1/m, and `typical` its mean
    over the thing; both go on a little beyond its outline, where the coverage is 0. An `opaque` layer has no outline.
    """

    left: int
    top: int
    light: Floats
    nearness: Floats
    typical: float
    opaque: bool = False

    @property
    def right(self) -> int:
        return self.left + self.nearness.shape[1]

    @property
    def bottom(self) -> int:
        return self.top + self.nearness.shape[0]


def photograph(scene: Scene, camera: ThinLensCamera, samples: int = 64, *, rough: bool = False) -> Floats:
    """The picture (height, width, 3), linear light, as `aperture.photograph` takes it.

    While the focus is being moved, and the picture breathes with it, a `rough` one is soon made: its layers are those
    of a focal length up to 8 % shorter, enlarged, so that few pictures in a row need to trace any.
    """
    margin = _STEP * int(np.ceil(camera.parallax_px * max(1 / camera.focus_m, 1 / _NEAR) / _STEP))
    pose = tuple(camera.world_from_cam.as_matrix().ravel().tolist())
    pixels = camera.camera.intrinsics
    shorter = _ZOOM ** np.floor(np.log(pixels.fx) / np.log(_ZOOM)) if rough else pixels.fx
    parts = _kept(scene, replace(pixels, fx=shorter, fy=shorter), pose, margin)
    if rough:
        parts = tuple(_enlarged(part, pixels, shorter) for part in parts)
    return looked_through(parts, camera, samples)


def _enlarged(part: Layer, pixels: Intrinsics, fx: float) -> Layer:
    """A layer as a camera with these pixels sees it, from how one with the focal length `fx` does."""
    zoom, centre = pixels.fx / fx, np.array([pixels.cx, pixels.cy])
    first = np.ceil(centre + zoom * ([part.left, part.top] - centre))
    last = np.maximum(first, np.floor(centre + zoom * ([part.right - 1, part.bottom - 1] - centre)))
    from_first = np.column_stack([np.eye(2) / zoom, centre + (first - centre) / zoom - [part.left, part.top]])
    size, how = (last - first + 1).astype(int).tolist(), cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    light, nearness = (
        cv2.warpAffine(one, from_first, size, flags=how, borderMode=cv2.BORDER_REPLICATE)
        for one in (part.light, part.nearness)
    )
    left, top = first.astype(int).tolist()
    return replace(part, left=left, top=top, light=light, nearness=nearness)


@lru_cache(maxsize=2)
def _kept(scene: Scene, pixels: Intrinsics, pose: tuple[float, ...], margin: int) -> tuple[Layer, ...]:
    """The layers while only the aperture changes."""
    return layers(scene, Camera(pixels, world_from_cam=RigidTransform.from_matrix(np.reshape(pose, (4, 4)))), margin)


def looked_through(parts: tuple[Layer, ...], camera: ThinLensCamera, samples: int) -> Floats:
    """The mean over `samples` points of the lens of the layers as seen from there, far ones first."""
    light = np.zeros((camera.height, camera.width, 4), dtype=np.float32)
    view = np.zeros_like(light)
    placed = [(part, *_grid(part)) for part in parts]
    points, passes = camera.points(samples)
    for parallax, passing in zip(points * camera.parallax_px, passes, strict=True):
        if passing > 0:
            for part, u, v in placed:
                _over(view, part, u, v, parallax, 1 / camera.focus_m)
            cv2.scaleAdd(view, passing / samples, light, dst=light)
    return light[..., :3]


def _over(view: Floats, part: Layer, u: Floats, v: Floats, parallax: Array, sharp: float) -> None:
    """Draw a layer over the view from a point of the lens.

    A point seen at p from the middle is seen at p + parallax (sharp - nearness). Turned round, pixel q shows what the
    middle sees at q - parallax (sharp - nearness), with the nearness looked up where the layer's mean shift leads.
    """
    step = np.rint(parallax * (sharp - part.typical)).astype(int)
    height, width = view.shape[:2]
    x, y = part.left + step[0], part.top + step[1]  # the box, moved
    left, right = max(x, 0), min(x + u.shape[1], width)
    top, bottom = max(y, 0), min(y + u.shape[0], height)
    if left >= right or top >= bottom:
        return
    inside = np.s_[top - y : bottom - y, left - x : right - x]
    shift = step - parallax * sharp
    map_u = cv2.addWeighted(part.nearness[inside], parallax[0], u[inside], 1, shift[0])
    map_v = cv2.addWeighted(part.nearness[inside], parallax[1], v[inside], 1, shift[1])
    seen = cv2.remap(part.light, map_u, map_v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    behind = view[top:bottom, left:right]
    if part.opaque:
        behind[:] = seen
        return
    covered = cv2.extractChannel(seen, 3)
    behind[:] = cv2.blendLinear(seen, behind, covered, 1.0 - covered)


def _grid(part: Layer) -> tuple[Floats, Floats]:
    """Columns and rows (h, w) of a layer's box."""
    height, width = part.nearness.shape
    u, v = np.meshgrid(np.arange(width, dtype=np.float32), np.arange(height, dtype=np.float32))
    return u, v


def layers(scene: Scene, camera: Camera, margin: int) -> tuple[Layer, ...]:
    """The things of a scene, far to near, each traced alone, in a picture wider by `margin` pixels all around.

    The first is what surrounds the camera, ground and sky, and covers everything.
    """
    left, top, right, bottom = frame = _frame(camera, margin)
    wider = replace(camera, intrinsics=camera.intrinsics.cropped(left, top, right - left, bottom - top))
    rays = wider.rays()
    around = [thing for thing in _things(scene) if _surrounds(thing, camera)]
    things = [thing for thing in _things(scene) if thing not in around]
    found = [_thing(thing, camera, rays, _box(thing, camera, frame), frame) for thing in things]
    seen = sorted((part for part in found if part is not None), key=lambda part: part.typical)
    for i, part in enumerate(seen):
        for nearer in seen[i + 1 :]:
            _uncover(part, nearer)
    return (_surroundings(scene, around, camera, rays, frame), *seen)


def _uncover(part: Layer, nearer: Layer) -> None:
    """Where one thing stands on another, parts of the farther layer are nearer: there the nearer layer is removed."""
    left, top = max(part.left, nearer.left), max(part.top, nearer.top)
    right, bottom = min(part.right, nearer.right), min(part.bottom, nearer.bottom)
    if left < right and top < bottom:
        a, b = (np.s_[top - one.top : bottom - one.top, left - one.left : right - one.left] for one in (part, nearer))
        wrong = (part.light[a][..., 3] > 0) & (part.nearness[a] > nearer.nearness[b])
        nearer.light[b][..., 3][wrong] = 0


@lru_cache(maxsize=2)
def _things(scene: Scene) -> tuple[Scene, ...]:
    """Each thing of a scene as a scene of its own, under a black sky: surfaces of one name whose balls overlap."""
    things: list[list[Surface]] = []
    for surface in scene.surfaces:
        joined = [thing for thing in things if any(_touch(surface, other) for other in thing)]
        things = [thing for thing in things if thing not in joined]
        things.append([*(other for thing in joined for other in thing), surface])
    return tuple(Scene(thing, _BLACK) for thing in things)


def _touch(one: Surface, other: Surface) -> bool:
    pairs = product(one.bounding_spheres(), other.bounding_spheres()) if one.name == other.name else ()
    return any(np.linalg.norm(a - b) <= r + s for (a, r, _), (b, s, _) in pairs)


def _surrounds(thing: Scene, camera: Camera) -> bool:
    centres, radii, _ = _extent(thing)
    return bool((np.linalg.norm(centres - camera.centre, axis=1) <= radii).any())


@lru_cache(maxsize=256)
def _extent(thing: Scene) -> tuple[Array, Array, Array]:
    """Centres (n, 3) and radii (n,) of balls around its surfaces, and points (m, 3) a little outside its outline."""
    balls = [one.bounding_spheres() for one in thing.surfaces]
    middles = [np.mean([centre for centre, _, _ in those], axis=0) for those in balls]
    lines = [(middle, line) for middle, one in zip(middles, thing.surfaces, strict=True) for line in one.outline()]
    outside = [middle + _ROOM * (line - middle) for middle, line in lines]
    centres, radii = (np.array([ball[i] for those in balls for ball in those]) for i in (0, 1))
    return centres, radii, np.concatenate(outside) if outside else np.empty((0, 3))


def _frame(camera: Camera, margin: int) -> Box:
    pixels = camera.intrinsics
    return -margin, -margin, pixels.width + margin, pixels.height + margin


def _box(thing: Scene, camera: Camera, frame: Box) -> Box:
    """left, top, right, bottom in whole pixels around a thing, and inside the frame."""
    left, top, right, bottom = frame
    uv = camera.project(_extent(thing)[2])
    if not np.isfinite(uv).all():
        return left, top, right, bottom
    (u0, v0), (u1, v1) = np.floor(uv.min(axis=0)).astype(int) - 2, np.ceil(uv.max(axis=0)).astype(int) + 3
    return max(left, u0), max(top, v0), min(right, u1), min(bottom, v1)


def _thing(thing: Scene, camera: Camera, rays: Array, box: Box, frame: Box) -> Layer | None:
    """A thing as a layer; None where no ray of its box meets it."""
    left, top, right, bottom = box
    if left >= right or top >= bottom:
        return None
    light, nearness = _traced(
        thing, camera, rays[top - frame[1] : bottom - frame[1], left - frame[0] : right - frame[0]]
    )
    covered = (nearness > 0).astype(np.float32)
    if not covered.any():
        return None
    rows, columns = (_span(covered.max(axis=axis)) for axis in (1, 0))
    light, nearness, covered = (part[rows, columns] for part in (light, nearness, covered))
    seen = np.dstack([_grown(light, covered), covered])
    typical = float(nearness[covered > 0].mean())
    return Layer(left + columns.start, top + rows.start, seen, _grown(nearness, covered), typical)


def _surroundings(scene: Scene, around: list[Scene], camera: Camera, rays: Array, frame: Box) -> Layer:
    """What is behind everything, the sky included."""
    surfaces = [surface for thing in around for surface in thing.surfaces]
    light, nearness = _traced(Scene(surfaces, scene.sky), camera, rays)
    seen = np.dstack([light, np.ones_like(nearness)])
    return Layer(frame[0], frame[1], seen, nearness, float(nearness.mean()), opaque=True)


def _traced(scene: Scene, camera: Camera, rays: Array) -> tuple[Floats, Floats]:
    """Light (h, w, 3) along unit rays (h, w, 3) from the camera's centre, and 1/depth (h, w), 0 in the sky."""
    light, distance = scene.trace(camera.centre, rays, spread=1 / camera.intrinsics.fx)
    depth = distance * (rays @ camera.world_from_cam.as_matrix()[:3, 2]).astype(np.float32)
    return light, np.nan_to_num(1 / depth, nan=0.0)


def _span(covered: Floats) -> slice:
    """From the first place covered to the last, and a pixel more on either side where there is one."""
    found = np.flatnonzero(covered)
    return slice(max(int(found[0]) - 1, 0), int(found[-1]) + 2)


def _grown(values: Floats, covered: Floats) -> Floats:
    """The values (h, w, ...), continued beyond the outline: near it by the mean around, farther by the whole mean."""
    inside = covered > 0
    around, of = (
        cv2.blur(values * (covered[..., None] if values.ndim == 3 else covered), (9, 9)),
        cv2.blur(covered, (9, 9)),
    )
    near = of > 1e-3
    beyond = around / np.maximum(of, np.float32(1e-3)).reshape(of.shape + (1,) * (values.ndim - 2))
    beyond[~near] = values[inside].mean(axis=0)
    np.copyto(beyond, values, where=inside.reshape(inside.shape + (1,) * (values.ndim - 2)))
    return beyond
