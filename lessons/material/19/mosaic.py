"""The mosaic visualizer: two pictures of the garden, one of them laid into the plane of the other by a homography.

A reader's own homography can lay it there.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar

import cv2
import numpy as np
from numpy.typing import NDArray

from camviz import twoview
from camviz.cameras import Camera, Intrinsics
from camviz.draw import svg
from camviz.draw.flow import Cell, rows, shortened
from camviz.draw.panel import Panel, image_panel, placed_image
from camviz.draw.picture import Picture, jpeg
from camviz.draw.readout import listed, readout
from camviz.lenses.base import Array
from camviz.poses import RigidTransform, Rotation
from camviz.scenes import textured_scene
from camviz.scenes.standard import FLOOR
from camviz.views import garden
from camviz.views.base import View, choice, slider, switch
from camviz.views.marks import on_photograph
from camviz.views.yours import YOURS_HERE, is_unwritten, tried

LEFT, TOP, ACROSS, DOWN = -20, -110, 1330, 700
"""The mosaic's canvas, in pixels of the first picture's plane."""
NO_H = "No H here: it takes four matches, no three of them on one line."
AGREES = 3.0  # px: a match that is farther off is wrong for RANSAC
_FIRST = RigidTransform.from_rotation(Rotation.from_euler("Y", -8, degrees=True))
_CAMERA = Camera(Intrinsics.from_fov(640, 480, 50))
_TRIED, _MOST = 300, 80  # landmarks, and matches
_HIGH = {"mosaic": 318, "first": 360, "second": 360, "numbers": 230}


@dataclass(frozen=True)
class MosaicView(View):
    """Two pictures joined: the second is warped by the homography that fits the matches best.

    The second camera is turned by `turn` degrees to the right of the first one and stands `step` metres to its right.
    `fit` says which matches H is estimated from; each has an error of `noise` pixels, and `wrong` percent of them are
    nonsense, which RANSAC sorts out if `robust`. `panels` names what is drawn: mosaic, and any of pictures, matches
    (the marks on the mosaic) and numbers. `yours` is a reader's function of (uv, to), pixels (n, 2) of the second
    picture and of the first one, that gives H (3, 3).
    """

    title: ClassVar[str] = "Mosaic"
    openable: ClassVar[Mapping[str, str]] = {"pictures": "the two pictures", "matches": "matches", "numbers": "numbers"}

    turn: float = slider(24.0, 0.0, 30.0, 0.25, unit="°", help="of the second camera, to the right")
    step: float = slider(0.0, 0.0, 0.6, 0.01, unit="m", help="of the second camera, to the right")
    fit: str = choice("all", "wall", "floor", label="fit to", help="the matches from which H is estimated")
    noise: float = slider(0.3, 0.0, 3.0, 0.1, unit="px", help="error of each coordinate of a match")
    wrong: float = slider(
        0.0, 0.0, 60.0, 1.0, label="wrong matches", unit="%", help="pairs that do not belong together"
    )
    robust: bool = switch(True, label="RANSAC", help="sort out the wrong matches first")
    panels: str = "mosaic pictures matches numbers"
    first: ClassVar[Camera] = _CAMERA.at(_FIRST)
    yours: Callable[..., Any] | None = field(default=None, compare=False, repr=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if "mosaic" not in (wanted := self.panels.split()) or not {*wanted} <= {"mosaic", *self.openable}:
            raise ValueError(f"panels must be mosaic and any of {', '.join(self.openable)}, got {self.panels!r}")

    # The geometry ----------------------------------------------------------------------------------------------------

    @cached_property
    def second(self) -> Camera:
        """The second camera, where the sliders put it."""
        turned = Rotation.from_euler("Y", self.turn, degrees=True)
        return _CAMERA.at(_FIRST * RigidTransform.from_components([self.step, 0, 0], turned))

    @cached_property
    def exact(self) -> tuple[Array, Array, Array]:
        """The points (n, 3) that both cameras see, and their pixels (n, 2) in the second and in the first picture."""
        points = garden.landmarks(self.first)[:_TRIED]
        points = points[in_sight(self.second, points)][:_MOST]
        return points, self.second.project(points), self.first.project(points)

    @cached_property
    def matches(self) -> tuple[Array, Array]:
        """The pixels (n, 2) of each match in the second picture and in the first one, with their errors."""
        _, uv, to = self.exact
        rng = np.random.default_rng(3)
        error = rng.normal(size=(2, _MOST, 2))[:, : len(uv)]
        nonsense = rng.uniform((0, 0), (640, 480), (_MOST, 2))[: len(uv)]
        is_wrong = np.arange(len(uv))[:, None] < round(self.wrong / 100 * len(uv))
        return uv + self.noise * error[0], np.where(is_wrong, nonsense, to + self.noise * error[1])

    @cached_property
    def used(self) -> NDArray[np.bool_]:
        """Which of the matches (n,) H is estimated from."""
        points = self.exact[0]
        on = {"wall": np.abs(points[:, 2] - 6.5) < 0.04, "floor": np.abs(points[:, 1] - FLOOR) < 0.02}
        chosen = on.get(self.fit, np.ones(len(points), dtype=bool))
        if self.robust and self.wrong and chosen.sum() >= 4:
            uv, to = (part[chosen] for part in self.matches)
            found, kept = cv2.findHomography(uv, to, cv2.RANSAC, AGREES, maxIters=2000, confidence=0.999)
            if found is not None:
                chosen[chosen] = kept.ravel() > 0
        return chosen

    @cached_property
    def H(self) -> Array:
        """The homography (3, 3) from the second picture into the first one; NaN where the matches leave it open."""
        try:
            return twoview.homography(*(part[self.used] for part in self.matches))
        except ValueError:
            return np.full((3, 3), np.nan)

    @cached_property
    def shown_H(self) -> tuple[Array, str]:
        """The H (3, 3) of the reader's function, and what is wrong with it; the right one where there is none yet."""
        if self.yours is None:
            return self.H, ""
        answer, problem = tried(self.yours, tuple(part[self.used] for part in self.matches), np.eye(3))
        return (self.H if is_unwritten(problem) else answer), problem

    @cached_property
    def miss(self) -> Array:
        """How far (n,) each true pixel of the second picture comes to lie from its partner in the first, in pixels."""
        _, uv, to = self.exact
        return np.linalg.norm(warped(self.shown_H[0], uv) - to, axis=-1)

    def numbers(self) -> dict[str, str]:
        """The state's key figures, as text."""
        return {
            "matches in both pictures": f"{len(self.miss)}",
            "of them used": f"{int(self.used.sum())}",
            "H is off by (mean)": _pixels(self.miss.mean()),
            "at most": _pixels(self.miss.max()),
        }

    def description(self) -> str:
        where = f"The second camera is turned by {self.turn:g}° and stands {self.step:g} m to the right."
        return f"{where} {listed(self.numbers())}." if self._has("numbers") else where

    # The picture -----------------------------------------------------------------------------------------------------

    def picture(self, *, draft: bool = False) -> np.ndarray:
        """The mosaic (height, width, 3), uint8: the mean of both pictures where they overlap."""
        first, second = self._taken(draft)
        scale = first.shape[1] / 640
        size = round(ACROSS * scale), round(DOWN * scale)
        small = np.array([[scale, 0, (scale - 1) / 2], [0, scale, (scale - 1) / 2], [0, 0, 1]])
        to_canvas = np.array([[1.0, 0, -LEFT], [0, 1, -TOP], [0, 0, 1]])
        H = np.nan_to_num(self.shown_H[0])
        made, weight = np.zeros((size[1], size[0], 3), np.float32), np.zeros((size[1], size[0]), np.float32)
        for image, matrix in ((first, np.eye(3)), (second, H)):
            if matrix.any():
                into = small @ to_canvas @ matrix @ np.linalg.inv(small)
                made += cv2.warpPerspective(image.astype(np.float32), into, size)
                weight += cv2.warpPerspective(np.ones(image.shape[:2], np.float32), into, size)
        ground = np.maximum(1 - weight, 0)[..., None] * np.asarray(garden.NOTHING, np.float32)
        return np.asarray((made / np.maximum(weight, 1)[..., None] + ground).round(), np.uint8)

    def _taken(self, draft: bool) -> tuple[np.ndarray, np.ndarray]:
        if draft:
            second = garden.taken(self.second, garden.DRAFT) if self.step else garden.drafted(self.second)
            return garden.taken(self.first, garden.DRAFT)[0], second[0]
        return garden.taken(self.first, garden.FINE)[0], garden.taken(self.second, garden.FINE)[0]

    def figure(self, *, draft: bool = False) -> Picture:
        parts, attached = {"mosaic": self._mosaic()}, {"mosaic": jpeg(self.picture(draft=draft))}
        if self._has("numbers"):
            x, y, *_ = self._layout["numbers"]
            column = readout(self.numbers(), (x + 10, y + 56), (0, 44), (0, 18))
            parts["numbers"] = svg.text((x + 10, y + 26), "How well they fit", "title") + column
        if self._has("pictures"):
            for name, image, words in zip(("first", "second"), self._taken(draft), ("First", "Second"), strict=True):
                x, y, *_ = self._layout[name]
                panel = image_panel(name, x + 10, y + 34, 420, 640, 480)
                parts[name] = panel.show(placed_image(panel, name, 640, 480), title=f"{words} picture")
                attached[name] = jpeg(image)
        return self.tiled(self._layout, parts, attached)

    @cached_property
    def _layout(self) -> dict[str, Cell]:
        top = {"mosaic": 540.0} | ({"numbers": 240.0} if self._has("numbers") else {})
        below = {"first": 480.0, "second": 480.0} if self._has("pictures") else {}
        return shortened(rows((_HIGH["mosaic"], top), (_HIGH["first"], below)), **_HIGH)

    def _mosaic(self) -> svg.Marks:
        panel = Panel("mosaic", 10, 34, 520, 520 * DOWN / ACROSS, LEFT, LEFT + ACROSS, TOP, TOP + DOWN)
        content = svg.image("mosaic", 0, 0, panel.width, panel.height)
        content += self._marks(panel) if self._has("matches") else svg.NOTHING
        problem = self.shown_H[1] or (NO_H if np.isnan(self.shown_H[0]).any() else "")
        content = svg.group(content, "awaited") if is_unwritten(problem) else content
        content += notice(panel, problem)
        return panel.show(content, title=f"Both pictures, joined by {'your' if self.yours else 'one'} H")

    def _marks(self, panel: Panel) -> svg.Marks:
        """A dot where the first picture has a match, and a line to it from where H takes the second one's pixel."""
        uv, to = self.matches
        ends = np.stack([panel.place(to), panel.place(warped(self.shown_H[0], uv))], axis=1)
        far = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1) > 1.5
        off = on_photograph(ends[far], "red") if far.any() else svg.NOTHING
        kept = ends[self.used, 0]
        return off + svg.dots(ends[:, 0], "paper-dot", 7) + svg.dots(ends[:, 0], "red", 5) + svg.dots(kept, "green", 5)


def _pixels(length: float) -> str:
    if not np.isfinite(length):
        return "no H"
    return f"{length:.1f} px" if length < 1000 else "more than 1000 px"


def warped(H: Array, uv: Array) -> Array:
    """Where the homography takes pixels (n, 2); NaN or infinite where it takes them nowhere."""
    mapped = np.column_stack([uv, np.ones(len(uv))]) @ H.T
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray(mapped[:, :2] / mapped[:, 2:])


def notice(panel: Panel, problem: str) -> svg.Marks:
    """What is to be said of a reader's function over a photograph; nothing where all is well."""
    if is_unwritten(problem):
        return svg.text((panel.width / 2, 0.14 * panel.height), YOURS_HERE, "title halo middle")
    ground = svg.rectangle(8, 8, panel.width - 16, 60, "paper")
    return ground + svg.paragraph((18, 28), problem, panel.width - 36) if problem else svg.NOTHING


def in_sight(camera: Camera, points: Array) -> NDArray[np.bool_]:
    """Which of the garden's points (n, 3) are in a camera's picture, and nothing is in front of them."""
    rays = points - camera.centre
    away = np.linalg.norm(rays, axis=-1)
    _, met = textured_scene().trace(camera.centre, rays / away[:, None])
    return camera.intrinsics.contains(camera.project(points)) & (np.abs(met - away) < 0.02)
