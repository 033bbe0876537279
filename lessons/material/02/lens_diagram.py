"""The thin lens as it is drawn: rays from an object through lens and aperture to the sensor, and a loupe over its end.

Behind the lens the drawing is to scale. Before it, distances run from the lens to infinity: the drawing there is the
projective map (z, y) → (z, y) / (1 + z/k), which keeps every line straight, every ray through the middle of the lens in
its direction, and the lens in its place. Infinity lies k before the lens.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from camviz import optics
from camviz.draw import svg
from camviz.draw.panel import Panel
from camviz.lenses.base import Array
from camviz.views.marks import circle
from camviz_school.views.aperture import Aperture, ThinLensCamera

HORIZON_MM = 180.0  # k: where infinity is drawn, before the lens
BEHIND_MM = 125.0  # as much as is drawn behind it
OBJECT_MM = 270.0  # the arrow's height: the globe's radius
_LOUPE_MM = (5.0, 1.25)  # half of what the loupe shows, along the axis and across


def diagram_panel(x: float, y: float, width: float, height: float) -> Panel:
    """A panel in millimetres, the lens at 0, the object on the left, up being up."""
    across = (HORIZON_MM + BEHIND_MM) * height / width / 2
    return Panel("rays", x, y, width, height, -HORIZON_MM, BEHIND_MM, across, -across)


def loupe_panel(x: float, y: float, width: float, height: float, image_mm: float) -> Panel:
    """A panel around the sensor, in millimetres: stretched across, for the cones are slender."""
    along, across = _LOUPE_MM
    return Panel("loupe", x, y, width, height, image_mm - along, image_mm + along, across, -across)


def before_lens(z_mm: ArrayLike, y_mm: ArrayLike) -> Array:
    """Where points (...) z mm before the lens and y mm above its axis are drawn: (..., 2), the panel's millimetres."""
    z, y = np.broadcast_arrays(np.asarray(z_mm, float), np.asarray(y_mm, float))
    share = 1 / (1 + z / HORIZON_MM)
    return np.stack([-HORIZON_MM * (1 - share), y * share], axis=-1)


def rays(panel: Panel, lens: ThinLensCamera, object_mm: float) -> svg.Marks:
    """Axis, focal points, object and image, the sensor, the lens with its stop, and the rays that make the image."""
    f, v = lens.focal_mm, float(optics.image_distance_mm(lens.focal_mm, object_mm))
    axis = svg.line(panel.place([(panel.left, 0), (panel.right, 0)]), "muted dashed thin")
    tip, image_y = before_lens(object_mm, OBJECT_MM), -OBJECT_MM * v / object_mm
    return (
        axis
        + _cones(panel, lens, object_mm, tip, np.array([v, image_y]))
        + _central_ray(panel, tip, np.array([v, image_y]))
        + _arrow(panel, before_lens(object_mm, 0.0), tip, "blue")
        + _arrow(panel, np.array([v, 0.0]), np.array([v, image_y]), "orange")
        + _lens(panel, lens)
        + _sensor(panel, lens)
        + _focal_points(panel, f)
        + _name(panel, panel.place(tip) + (0, -7), "object", "blue")
    )


def _central_ray(panel: Panel, tip: Array, image: Array) -> svg.Marks:
    """The ray through the middle of the lens, which alone is not bent, on to the edge of the panel."""
    return svg.line(panel.place(np.array([tip, (0.0, 0.0), image * panel.right / image[0]])), "muted")


def _cones(panel: Panel, lens: ThinLensCamera, object_mm: float, tip: Array, image: Array) -> svg.Marks:
    """All the light from the object's foot and from its tip: cones as wide as the aperture, and then to a point."""
    half, foot = lens.aperture_mm / 2, before_lens(object_mm, 0.0)
    shade = svg.polygon(panel.place(np.array([foot, (0, half), (image[0], 0), (0, -half)])), "wash fill-blue")
    edges = svg.NOTHING
    for start, end, class_ in ((foot, image * (1, 0), "blue thin"), (tip, image, "orange thin")):
        rims = [np.array([0.0, side * half]) for side in (1, -1)]
        beyond = [rim + (end - rim) * panel.right / end[0] for rim in rims]
        edges += svg.path([panel.place([start, rim, far]) for rim, far in zip(rims, beyond, strict=True)], class_)
    return shade + edges


def cone_height(lens: ThinLensCamera, object_mm: float, z_mm: float) -> float:
    """Height z behind the lens of the ray from the object's foot through the upper rim."""
    v = float(optics.image_distance_mm(lens.focal_mm, object_mm))
    return lens.aperture_mm / 2 * (1 - z_mm / v)


def _lens(panel: Panel, lens: ThinLensCamera) -> svg.Marks:
    """A slim lens, its glass as tall as an f/1.2 would need, and the stop that leaves only the aperture open."""
    half, open_ = 0.5 * lens.focal_mm / 1.2, lens.aperture_mm / 2
    y = np.linspace(-half, half, 25)
    bulge = 3.2 * (1 - (y / half) ** 2)
    outline = np.concatenate([np.stack([bulge, y], -1), np.stack([-bulge, y], -1)[::-1]])
    glass = svg.polygon(panel.place(outline), "wash fill-sky") + svg.line(panel.place(outline), "sky thin")
    reach = max(half + 3, open_ + 3)
    stops = [[(0, side * open_), (0, side * reach)] for side in (1, -1)]
    return glass + svg.path([panel.place(stop) for stop in stops], "ink thick")


def _sensor(panel: Panel, lens: ThinLensCamera) -> svg.Marks:
    half = lens.sensor_mm * lens.height / lens.width / 2
    ends = panel.place([(lens.image_mm, half), (lens.image_mm, -half)])
    return svg.line(ends, "red thick") + _name(panel, ends[1] + (0, 16), "sensor", "red")


def _name(panel: Panel, at: Array, words: str, class_: str) -> svg.Marks:
    """A name over a place, moved as far as it takes to stay inside the panel."""
    return svg.text((np.clip(at[0], 36, panel.width - 36), at[1]), words, f"{class_} halo middle")


def _focal_points(panel: Panel, f: float) -> svg.Marks:
    places = panel.place(np.array([before_lens(f, 0.0), (f, 0.0)]))
    names = (svg.text(p + (-9, 19), name, "green halo end") for p, name in zip(places, ("F", "F'"), strict=True))
    return svg.dots(places, "green", 8) + svg.join(names)


def _arrow(panel: Panel, foot: Array, tip: Array, class_: str) -> svg.Marks:
    a, b = panel.place(np.array([foot, tip]))
    head = min(7.0, abs(b[1] - a[1]) / 2)
    back = np.sign(a[1] - b[1]) * head
    barbs = [b + (-0.5 * head, back), b, b + (0.5 * head, back)]
    return svg.path([[a, b], barbs], f"{class_} thick")


def loupe(panel: Panel, lens: ThinLensCamera, depths: list[tuple[float, str, str]]) -> svg.Marks:
    """The ends of the cones from points of the axis, each (depth in mm, class, name), and the sensor that cuts them."""
    middle = panel.place([(lens.image_mm, panel.top), (lens.image_mm, panel.bottom)])
    axis = panel.place([(panel.left, 0), (panel.right, 0)])
    cones = svg.join(_cone_end(panel, lens, depth, class_) for depth, class_, _ in depths)
    names = svg.NOTHING
    for (depth, class_, name), y in zip(depths, (18, panel.height - 10), strict=True):
        v = float(optics.image_distance_mm(lens.focal_mm, depth))
        x = float(np.clip(panel.place((v, 0))[0], 74, panel.width - 74))  # its name stands beside it, off the sensor
        side = "" if x > middle[0, 0] + 4 else "end"
        names += svg.text((x + (-8 if side else 8), y), name, f"{class_} halo {side}")
    return svg.line(axis, "muted dashed thin") + svg.line(middle, "red") + cones + names


def _cone_end(panel: Panel, lens: ThinLensCamera, depth_mm: float, class_: str) -> svg.Marks:
    """Where the light of a point comes together and parts again, and how wide the sensor cuts it."""
    v = float(optics.image_distance_mm(lens.focal_mm, depth_mm))
    (left, right), at_sensor = (
        [cone_height(lens, depth_mm, z) for z in (panel.left, panel.right)],
        cone_height(lens, depth_mm, lens.image_mm),
    )
    edges = [[(panel.left, side * left), (panel.right, side * right)] for side in (1, -1)]
    tip = [(v, 0.0)] if v > panel.left else [edges[1][1], edges[0][1]]
    shade = svg.polygon(panel.place([edges[0][0], edges[1][0], *tip]), f"wash fill-{class_}")
    cut = panel.place([(lens.image_mm, at_sensor), (lens.image_mm, -at_sensor)])
    return shade + svg.path([panel.place(edge) for edge in edges], class_) + svg.line(cut, f"{class_} thick")


def opening(panel: Panel, aperture: Aperture, points: Array, passes: Array) -> svg.Marks:
    """The lens from behind: which of its points look at the scene, and which are stopped."""
    rim = panel.place(circle(49))
    through, stopped = panel.place(points[passes > 0]), panel.place(points[passes <= 0])
    return svg.line(rim, "ink") + svg.dots(through, "blue", 5) + svg.dots(stopped, "muted faint", 4)
