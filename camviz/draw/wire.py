"""What an onlooker sees of a drawing in space, as SVG: lines, faces, pictures, marks and words.

Lines are cut into short pieces, so that each is as strong as it is near and can vanish where something solid hides it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import isfinite, nan

import numpy as np

from camviz.cameras import Camera
from camviz.draw import svg
from camviz.draw.items import Dots, Face, Item, Label, Line, TexturedMesh
from camviz.draw.marks import NOTHING, Marks, Segments, join
from camviz.draw.picture import png
from camviz.draw.sheets import warp
from camviz.lenses.base import Array

NEAR = 0.02  # metres before the eye, where everything is cut
LEVELS = 5  # of strength, from far to near
_YES = np.ones(1, dtype=bool)

Hidden = Callable[[Array, Array], np.ndarray]


def nothing_hides(px: Array, depth: Array) -> np.ndarray:
    """Says which points, pixels (n, 2) at depths (n,) in metres, something solid hides: none."""
    return np.zeros(len(px), dtype=bool)


@dataclass(frozen=True, eq=False)
class Viewport:
    """The onlooker's camera and how far it looks: what is `distance` metres deep is drawn at ordinary strength."""

    camera: Camera
    distance: float

    def points_cam(self, points_world: Array) -> Array:
        R, t = self.camera.extrinsics
        return points_world @ R.T + t

    def place(self, points_cam: Array) -> Array:
        """Picture units (..., 2), which count from the corner of the first pixel rather than from its centre."""
        return self.camera.intrinsics.to_pixels(self.camera.lens.project(points_cam)) + 0.5

    def strength(self, depth: Array) -> np.ndarray:
        """0 … LEVELS - 1, the nearer the stronger."""
        nearness = 0.5 + (self.distance - depth) / (1.1 * self.distance)
        return np.clip(nearness * LEVELS, 0, LEVELS - 1).astype(int)


@dataclass(frozen=True)
class Pieces:
    """Short straight pieces of lines: ends (n, 2, 2), depth (n,), whence each comes and whether it is hidden."""

    ends: Array
    depth: Array
    line: np.ndarray
    segment: np.ndarray
    hidden: np.ndarray


Fill = tuple[float, Marks, dict[str, bytes]]  # depth, marks, attached pictures


def draw_wire(
    viewport: Viewport, items: Sequence[Item], name: str, scale: float = 1, scenery: tuple[Item, ...] = ()
) -> tuple[Marks, dict[str, bytes]]:
    """Everything, farther things first (the painter's algorithm); pictures are called `name`-0, `name`-1, …

    What is seen of the `scenery`, things that do not change, is kept while the onlooker stands still.
    """
    stage, kept = _scenery(viewport, scenery, scale)
    fills = sorted([*kept, *_fills(viewport, items, name, scale)], key=lambda fill: -fill[0])
    depths = np.array([depth for depth, _, _ in fills])
    behind, lines = _lines(scenery), _lines(items)
    pieces = _joined(stage, len(behind), cut(viewport, lines, nothing_hides, fine=False))
    strokes = _strokes(viewport, [*behind, *lines], pieces, depths)
    layers = [strokes.get(0, NOTHING)]
    for i, (_, filled, _) in enumerate(fills):
        layers += [filled, strokes.get(i + 1, NOTHING)]
    photographs = {key: data for _, _, attached in fills for key, data in attached.items()}
    return join(layers) + draw_marks(viewport, [*scenery, *items]), photographs


def draw_lines(viewport: Viewport, items: Sequence[Item], hidden: Hidden = nothing_hides) -> Marks:
    """The lines alone, faint where something solid hides them."""
    lines = _lines(items)
    pieces = cut(viewport, lines, hidden, fine=hidden is not nothing_hides)
    return join(_strokes(viewport, lines, pieces, np.empty(0)).values())


@lru_cache(maxsize=4)
def _scenery(viewport: Viewport, items: tuple[Item, ...], scale: float) -> tuple[Pieces, list[Fill]]:
    return cut(viewport, _lines(items), nothing_hides, fine=False), list(_fills(viewport, items, "scenery", scale))


def _lines(items: Sequence[Item]) -> list[Line]:
    return [item for item in items if isinstance(item, Line)]


def _strokes(viewport: Viewport, lines: Sequence[Line], pieces: Pieces, depths: Array) -> dict[int, Marks]:
    """The lines, keyed by how many of the filled things at `depths` (descending) they come after."""
    slot = np.searchsorted(-depths, -0.98 * pieces.depth, side="left")
    level = np.where(pieces.hidden, -1, viewport.strength(pieces.depth))
    pens = {pen: i for i, pen in enumerate(dict.fromkeys((line.class_, line.width) for line in lines))}
    pen = np.array([pens[line.class_, line.width] for line in lines], dtype=int)[pieces.line]
    key = (slot * (LEVELS + 1) + level + 1) * len(pens) + pen
    layers: dict[int, Marks] = {}
    names = list(pens)
    for group, ends, continues in _joined_strokes(pieces, key):
        rest, which = divmod(group, len(pens))
        slot_, strength = divmod(rest, LEVELS + 1)
        layers[slot_] = layers.get(slot_, NOTHING) + [_stroke(ends, continues, *names[which], strength - 1)]
    last = max(layers, default=0)
    layers[last] = layers.get(last, NOTHING) + join(_heads(viewport, lines))
    return layers


def draw_marks(viewport: Viewport, items: Sequence[Item], hidden: Hidden = nothing_hides) -> Marks:
    """Dots and labels, over everything else; dots that something hides are faint."""
    parts = []
    for item in items:
        if isinstance(item, Dots):
            points_cam = viewport.points_cam(item.points)
            px = viewport.place(points_cam)
            behind = hidden(px, points_cam[:, 2])
            parts.append(svg.dots(px[~behind], item.class_, item.diameter))
            parts.append(svg.dots(px[behind], f"{item.class_} faint", item.diameter))
    for item in items:
        if isinstance(item, Label):
            px = viewport.place(viewport.points_cam(item.point))
            parts.append(svg.text(px + (0, 4.5), item.words, f"{item.class_} halo middle"))
    return join(parts)


def cut(viewport: Viewport, lines: Sequence[Line], hidden: Hidden, fine: bool) -> Pieces:
    """The visible parts of the lines, cut into pieces a few pixels long (`fine`) or as long as their depth allows."""
    starts, ends, line = _segments(viewport, lines)
    starts, ends, inside = _clipped(viewport, starts, ends)
    segment, line = np.flatnonzero(inside), line[inside]
    px0, px1, z0, z1 = viewport.place(starts), viewport.place(ends), starts[:, 2], ends[:, 2]
    length = np.linalg.norm(px1 - px0, axis=-1)
    count = np.ceil(np.maximum(length / (5 if fine else 160), np.abs(np.log(z1 / z0)) / 0.15)).clip(1, 300).astype(int)
    whole = np.repeat(np.arange(len(count)), count)
    step = np.arange(len(whole)) - np.repeat(np.cumsum(count) - count, count)
    t = (step[:, None] + [0.0, 0.5, 1.0]) / count[whole, None]
    # In perspective, 1/z rather than z is linear along the image of a line.
    depth = 1 / ((1 - t) / z0[whole, None] + t / z1[whole, None])
    px = px0[whole, None] + t[..., None] * (px1 - px0)[whole, None]
    return Pieces(px[:, [0, 2]], depth[:, 1], line[whole], segment[whole], hidden(px[:, 1], depth[:, 1]))


def _joined(first: Pieces, lines: int, then: Pieces) -> Pieces:
    """The pieces of `lines` lines, then those of others."""
    both = {name: np.concatenate([getattr(first, name), getattr(then, name)]) for name in vars(first)}
    count = len(first.line)
    both["line"][count:] += lines
    both["segment"][count:] += 1 + first.segment.max(initial=0)
    return Pieces(**both)


def _segments(viewport: Viewport, lines: Sequence[Line]) -> tuple[Array, Array, np.ndarray]:
    if not lines:
        return np.empty((0, 3)), np.empty((0, 3)), np.empty(0, int)
    points = viewport.points_cam(np.concatenate([line.points for line in lines]))
    line = np.repeat(np.arange(len(lines)), [len(line.points) for line in lines])
    here = (line[1:] == line[:-1]) & np.isfinite(points[1:] + points[:-1]).all(axis=-1)
    return points[:-1][here], points[1:][here], line[1:][here]


def _clipped(viewport: Viewport, starts: Array, ends: Array) -> tuple[Array, Array, np.ndarray]:
    """The parts of segments (n, 3) inside the view, and which of the segments have one (Liang & Barsky 1984)."""
    planes = _pyramid(viewport)
    d0, d1 = starts @ planes[:, :3].T - planes[:, 3], ends @ planes[:, :3].T - planes[:, 3]
    with np.errstate(divide="ignore", invalid="ignore"):
        t = d0 / (d0 - d1)
    enter = np.where(d0 < 0, t, 0).max(axis=-1, initial=0)
    leave = np.where(d1 < 0, t, 1).min(axis=-1, initial=1)
    inside = (enter < leave) & ~((d0 < 0) & (d1 < 0)).any(axis=-1)
    a, b, enter, leave = starts[inside], ends[inside], enter[inside, None], leave[inside, None]
    return a + enter * (b - a), a + leave * (b - a), inside


def _pyramid(viewport: Viewport) -> Array:
    """Planes (5, 4) with n · p ≥ d inside: the near plane, and the sides of a view a little wider than the picture."""
    k = viewport.camera.intrinsics
    x, y = 0.55 * k.width / k.fx, 0.55 * k.height / k.fy
    return np.array([(0, 0, 1, NEAR), (1, 0, x, 0), (-1, 0, x, 0), (0, 1, y, 0), (0, -1, y, 0)])


def _stroke(ends: Array, continues: np.ndarray, class_: str, width: float, level: int) -> Segments:
    nearness = max(level, 0) / (LEVELS - 1)
    opacity = 0.16 if level < 0 else 0.55 + 0.45 * nearness
    style = {"stroke_width": round(width * (0.75 + 0.5 * nearness), 2), "stroke_opacity": round(opacity, 2)}
    return Segments(ends.reshape(-1, 2, 2), class_, continues, style)


def _joined_strokes(pieces: Pieces, key: np.ndarray) -> Iterator[tuple[int, Array, np.ndarray]]:
    """Of all pieces with one key, in ascending order of keys: the key, strokes (n, 4), and which (n,) continue another.

    Consecutive pieces of one segment become one stroke, strokes that touch become one line.
    """
    order = np.argsort(key, kind="stable")
    if not len(order):
        return
    key, segment = key[order], pieces.segment[order]
    broken = (key[1:] != key[:-1]) | (order[1:] != order[:-1] + 1) | (segment[1:] != segment[:-1])
    firsts, lasts = np.concatenate([_YES, broken]), np.concatenate([broken, _YES])
    strokes = np.concatenate([pieces.ends[order[firsts], 0], pieces.ends[order[lasts], 1]], axis=-1).round(1)
    key = key[firsts]
    touches = np.concatenate([~_YES, (strokes[1:, :2] == strokes[:-1, 2:]).all(axis=-1) & (key[1:] == key[:-1])])
    starts = np.flatnonzero(np.concatenate([_YES, key[1:] != key[:-1]])).tolist()
    for start, end in zip(starts, [*starts[1:], len(strokes)], strict=True):
        yield int(key[start]), strokes[start:end], touches[start:end]


def _heads(viewport: Viewport, lines: Sequence[Line]) -> Iterator[Marks]:
    """Arrow heads, shorter where the arrow points towards the eye or away from it."""
    arrows = [line for line in lines if line.head]
    if not arrows:
        return
    ends = viewport.place(viewport.points_cam(np.array([line.points[-2:] for line in arrows])))
    for line, (tail, tip) in zip(arrows, ends, strict=True):
        along = tip - tail
        length = float(np.hypot(*along))
        if np.isfinite(length) and length > 1:
            along *= min(4.2 * line.width, length) / length
            across = 0.38 * np.array([-along[1], along[0]])
            colour = line.class_.split()[0]
            yield svg.polygon(
                [tip + 0.3 * along, tip - 0.7 * along + across, tip - 0.7 * along - across], f"fill-{colour}"
            )


def _fills(viewport: Viewport, items: Sequence[Item], name: str, scale: float) -> Iterator[Fill]:
    """Every face and sheet in view."""
    solids = [(i, item) for i, item in enumerate(items) if isinstance(item, Face | TexturedMesh)]
    if not solids:
        return
    points_cam = viewport.points_cam(np.concatenate([item.vertices for _, item in solids]))
    px = viewport.place(points_cam)
    end = 0
    for i, item in solids:
        here = slice(end, end := end + len(item.vertices))
        if isinstance(item, Face):
            fill = _face(viewport, item, points_cam[here], px[here])
        else:
            fill = _sheet(viewport, item, points_cam[here], px[here], f"{name}-{i}", scale)
        if fill is not None:
            yield fill


def _face(viewport: Viewport, face: Face, points_cam: Array, px: Array) -> Fill | None:
    if points_cam[:, 2].min() < NEAR:
        points_cam = _cut_near(points_cam)
        px = viewport.place(points_cam)
    depth = float(points_cam[:, 2].mean()) if len(points_cam) > 2 else nan
    return (depth, _fill(px, face), {}) if isfinite(depth) else None


def _sheet(
    viewport: Viewport, sheet: TexturedMesh, points_cam: Array, px: Array, name: str, scale: float
) -> Fill | None:
    window = warp(px, sheet, viewport.camera.intrinsics, scale)
    if window is None:
        return None
    rectangle, pixels = window
    return float(np.nanmean(points_cam[:, 2])), svg.image(name, *rectangle), {name: png(pixels)}


def _fill(px: Array, face: Face) -> Marks:
    opacity = round(min(face.opacity, 0.8), 2)
    if face.colour.startswith("#"):
        return svg.polygon(px, "face", fill_opacity=opacity, fill=face.colour)
    return svg.polygon(px, f"fill-{face.colour}", fill_opacity=opacity)


def _cut_near(vertices: Array) -> Array:
    """The part of a convex outline (n, 3) beyond the near plane (Sutherland & Hodgman 1974)."""
    inside = vertices[:, 2] >= NEAR
    if inside.all():
        return vertices
    kept = []
    for a, b, a_inside, b_inside in zip(vertices, np.roll(vertices, -1, 0), inside, np.roll(inside, -1), strict=True):
        if a_inside:
            kept.append(a)
        if a_inside != b_inside:
            kept.append(a + (NEAR - a[2]) / (b[2] - a[2]) * (b - a))
    return np.array(kept).reshape(-1, 3)
