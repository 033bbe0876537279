"""The visualizer of three pictures: poses in a chain, points where rays meet, and the scale that stays free.

A reader's own function can say how long the second step is.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from itertools import pairwise
from typing import Any, ClassVar, NamedTuple

import numpy as np

from camviz import twoview
from camviz.cameras import Camera, Intrinsics, look_at, transform
from camviz.draw import svg
from camviz.draw.flow import Cell, rows, shortened
from camviz.draw.panel import image_panel, placed_image
from camviz.draw.picture import Picture
from camviz.draw.readout import listed, readout
from camviz.draw.space import Dots, Item, Label, Line, OrbitCamera, camera_body, space_panel
from camviz.lenses.base import Array, unit
from camviz.poses import RigidTransform
from camviz.views import garden
from camviz.views.base import Drawn, OrbitView, slider
from camviz.views.marks import cross, on_photograph, ring
from camviz.views.yours import is_unwritten, tried
from camviz_school.views.mosaic import in_sight, notice

POINTS = 50
STEPS = 0.4, 0.64
"""Lengths of the two steps in metres: the second one is 1.6 times the first."""
CAMERA = Camera(Intrinsics.from_fov(640, 480, 55))
_PLACES = np.array([[-0.45, 0.0, 0.0], [-0.05, 0.0, 0.0], [0.55, -0.1, 0.0396**0.5]])
_WIDE = {"picture": 480.0, "space": 480.0, "numbers": 260.0}
_THREE = {"picture": 400.0, "space": 340.0, "numbers": 220.0}


@dataclass(frozen=True)
class ThreeViews(OrbitView):
    """Three pictures of the garden, and what two pairs of them say about the third.

    The first pair gives the direction of the first step, the second pair that of the second one; neither gives a
    length. `length` is the second step in first steps, and `scale` the first step in metres. `panels` are
    picture (the third one) and any of space and numbers. `yours` is a reader's function of (points, R, direction, rays)
    that gives the length of the second step.
    """

    title: ClassVar[str] = "Three views"
    openable: ClassVar[Mapping[str, str]] = {"space": "cameras and points in space", "numbers": "numbers"}

    length: float = slider(1.0, 0.4, 2.6, 0.01, label="second step", unit="first steps", help="its assumed length")
    scale: float = slider(0.4, 0.2, 0.8, 0.01, unit="m", help="the assumed length of the first step")
    panels: str = "picture space numbers"
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)
    eye: OrbitCamera = OrbitCamera(target=(0.1, 0.2, 2.6), distance=10.0, yaw_deg=-52, pitch_deg=34, vfov_deg=40)

    def __post_init__(self) -> None:
        super().__post_init__()
        if "picture" not in (wanted := self.panels.split()) or not {*wanted} <= {*_WIDE}:
            raise ValueError(f"panels must be picture and any of {', '.join(self.openable)}, got {self.panels!r}")

    # What is measured, and what follows ------------------------------------------------------------------------------

    @cached_property
    def given(self) -> tuple[Array, Array, Array, Array]:
        """What a reader's function is given: points of the second camera, R and direction to the third, its rays."""
        first, second = true_scene().pairs
        points = transform(first, twoview.triangulate([CAMERA, CAMERA.at(first.inv())], true_scene().seen[:2]))
        rays = CAMERA.lens.unproject(CAMERA.intrinsics.from_pixels(true_scene().seen[2]))
        return points, second.rotation.as_matrix(), second.translation, rays

    @cached_property
    def your_length(self) -> tuple[float, str]:
        """The length that the reader's function finds, and what is wrong with it."""
        answer, problem = tried(self.yours, self.given, np.array(0.0)) if self.yours else (np.nan, "")
        return float(answer), problem

    @property
    def _waits(self) -> bool:
        """Whether a reader's function is given and not written yet: the right answer keeps its place."""
        return self.yours is not None and is_unwritten(self.your_length[1])

    @cached_property
    def model(self) -> tuple[tuple[RigidTransform, ...], Array]:
        """The poses cam_from_first of the three cameras and the points (n, 3), in first steps."""
        first, second = true_scene().pairs
        found = STEPS[1] / STEPS[0] if self._waits else self.your_length[0] if self.yours else self.length
        length = np.clip(np.nan_to_num(found), -100, 100)
        step = RigidTransform.from_components(length * second.translation, second.rotation)
        return (RigidTransform.identity(), first, step * first), transform(first.inv(), self.given[0])

    @cached_property
    def residuals(self) -> Array:
        """Where (3, n, 2) the points were detected less where the model projects them, in pixels."""
        poses, points = self.model
        return true_scene().seen - np.stack([CAMERA.at(pose.inv()).project(points) for pose in poses])

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        each = np.sqrt(np.mean(np.sum(self.residuals**2, axis=-1), axis=-1))
        steps = np.linalg.norm(np.diff([pose.inv().translation for pose in self.model[0]], axis=0), axis=-1)
        found = {f"error in picture {i}": f"{one:.2f} px" for i, one in enumerate(each, 1)}
        found["second step / first"] = f"{steps[1] / steps[0]:.3f}"
        return found | {"first step": f"{self.scale:.2f} m", "second step": f"{self.scale * steps[1]:.2f} m"}

    def description(self) -> str:
        return f"Three cameras and {POINTS} points. {listed(self.numbers())}."

    # The picture -----------------------------------------------------------------------------------------------------

    def figure(self, *, draft: bool = False) -> Picture:
        image = garden.taken(true_scene().cameras[2], garden.FINE)[1]
        parts, attached = {"picture": self._third_picture()}, {"third": image}
        if self._has("space"):
            parts["space"], sheets = self._space(draft)
            attached |= sheets
        if self._has("numbers"):
            x, y, *_ = self._layout["numbers"]
            column = readout(self.numbers(), (x + 14, y + 54), (0, 42), (0, 17))
            parts["numbers"] = svg.text((x + 14, y + 26), "How well they fit", "title") + column
        return self.tiled(self._layout, parts, attached)

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        shown = [name for name in _WIDE if self._has(name)]
        across = {1: {"picture": 400.0}, 2: _WIDE, 3: _THREE}[len(shown)]
        high = 44 + 0.75 * (across["picture"] - 20)
        return shortened(rows((max(high, 370), {name: across[name] for name in shown})), picture=high, space=high)

    def _third_picture(self) -> svg.Marks:
        """Rings where the third picture has the points, and crosses where the chain of two pairs expects them."""
        panel = image_panel("third", 10, 34, self._layout["picture"][2] - 20, 640, 480)
        at = panel.place(true_scene().seen[2])
        ends = at - panel.scale * self.residuals[2]
        colour = "muted" if self._waits else "orange" if self.yours is not None else "red"
        marks = on_photograph(np.stack([at, ends], axis=1), f"{colour} thin") + cross(ends, colour, 4)
        content = placed_image(panel, "third", 640, 480) + svg.join(ring(one, "green", 6) for one in at) + marks
        content += notice(panel, self.your_length[1])
        return panel.show(content, title="The third picture")

    def _space(self, draft: bool) -> Drawn:
        x, y, across, high = self._layout["space"]
        panel = space_panel("space", x + 10, y + 34, across - 20, high - 44)
        label = "Cameras and points in space; drag or press the arrow keys to walk around, plus and minus to go nearer"
        return self.in_space(panel, self._items(), draft, "Cameras and points", label)

    def _items(self) -> list[Item]:
        poses, points = self.model
        first = true_scene().cameras[0]
        size = self.scale / float(np.linalg.norm(poses[1].inv().translation))
        drawn, centres = list[Item](), []
        for number, (pose, colour) in enumerate(zip(poses, ("blue", "purple", "orange"), strict=True), 1):
            back = pose.inv()
            here = first.world_from_cam * RigidTransform.from_components(size * back.translation, back.rotation)
            drawn += camera_body(CAMERA.at(here), 0.45 * self.scale / STEPS[0], colour=colour)
            centres.append(here.translation)
            drawn.append(Label(here.translation - (0, 0.12 + 0.4 * self.scale, 0), str(number), f"label {colour}"))
        bar = np.array([[-0.5, 1.25, 1.0], [0.5, 1.25, 1.0]])
        return [
            *drawn,
            Line(np.array(centres), "green", 2.4),
            Dots(transform(first.world_from_cam, size * points), "red", 5),
            Line(bar, "ink", 3),
            Label(bar.mean(axis=0) + (0, 0.28, 0), "1 m", "label middle"),
        ]


class TrueScene(NamedTuple):
    """Three cameras, their motions second_from_first and third_from_second of length 1, points, pixels (3, n, 2)."""

    cameras: list[Camera]
    pairs: list[RigidTransform]
    points: Array
    seen: Array


@lru_cache(maxsize=1)
def true_scene() -> TrueScene:
    """The cameras in the garden, and the points that all of them see."""
    cameras = [CAMERA.at(look_at(place, (0.0, 0.15, 3.6))) for place in _PLACES]
    points = garden.landmarks(cameras[1])
    points = points[np.all([in_sight(one, points) for one in cameras], axis=0)][:POINTS]
    steps = [twoview.right_from_left(*two) for two in pairwise(cameras)]
    pairs = [RigidTransform.from_components(unit(one.translation), one.rotation) for one in steps]
    return TrueScene(cameras, pairs, points, np.stack([one.project(points) for one in cameras]))
