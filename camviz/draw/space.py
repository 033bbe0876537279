"""Drawing in space: items, an eye that looks at them, and the choice between a solid and a wireframe picture."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from math import cos, exp, radians, sin, tan

import numpy as np

from camviz.cameras import Camera, Intrinsics, look_at
from camviz.draw.items import Dots, Face, Item, Label, Line, Sheet, axes_triad, camera_body, grid_lines
from camviz.draw.panel import Panel
from camviz.draw.wire import Sight, draw_wire
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.scenes import Scene, wireframe_scene
from camviz.scenes.surfaces import Mesh

__all__ = [
    "Dots", "Eye", "Face", "Item", "Label", "Line", "Sheet", "axes_triad", "camera_body", "chosen_renderer",
    "draw_space", "grid_lines", "scene_items", "space_panel",
]  # fmt: skip


@dataclass(frozen=True)
class Eye:
    """The onlooker, `distance` metres from the `target` (3,) it looks at and can walk around.

    At yaw 0 and pitch 0 it looks along z, as a camera in the identity pose does; pitch raises it above the target.
    """

    target: tuple[float, float, float] = (0.0, 0.0, 0.0)
    distance: float = 5.0
    yaw_deg: float = 30.0
    pitch_deg: float = 20.0
    vfov_deg: float = 35.0

    def __post_init__(self) -> None:
        if not self.distance > 0:
            raise ValueError(f"distance must be a positive number of metres, got {self.distance}")
        if not 0 < self.vfov_deg < 180:
            raise ValueError(f"vfov_deg must lie between 0 and 180 degrees, got {self.vfov_deg}")
        if not -89 <= self.pitch_deg <= 89:
            raise ValueError(f"pitch_deg must lie between -89 and 89 degrees, got {self.pitch_deg}")

    def camera(self, width: int, height: int) -> Camera:
        """The pinhole camera through which it sees."""
        yaw, pitch = radians(self.yaw_deg), radians(self.pitch_deg)
        outward = np.array([-sin(yaw) * cos(pitch), -sin(pitch), -cos(yaw) * cos(pitch)])
        f = height / (2 * tan(radians(self.vfov_deg) / 2))
        intrinsics = Intrinsics(width, height, f, f, (width - 1) / 2, (height - 1) / 2)
        return Camera(intrinsics, world_from_cam=look_at(self.target + self.distance * outward, self.target))

    def orbited(self, dx: float, dy: float) -> Eye:
        """After a drag by (dx, dy) picture units: what is near follows the pointer."""
        yaw = (self.yaw_deg + 0.4 * dx + 180) % 360 - 180
        return replace(self, yaw_deg=yaw, pitch_deg=min(85.0, max(-85.0, self.pitch_deg + 0.4 * dy)))

    def zoomed(self, steps: float) -> Eye:
        """Nearer by a tenth for every positive step."""
        return replace(self, distance=min(1e4, max(0.05, self.distance * exp(-0.1 * steps))))

    def key(self, key: str) -> Eye:
        """After a key: arrows walk around by 5°, + and - (or page up and down) walk nearer and back."""
        turns = {"ArrowLeft": (-12.5, 0), "ArrowRight": (12.5, 0), "ArrowUp": (0, -12.5), "ArrowDown": (0, 12.5)}
        steps = {"+": 1, "=": 1, "PageUp": 1, "-": -1, "_": -1, "PageDown": -1}
        if key in turns:
            return self.orbited(*turns[key])
        return self.zoomed(steps[key]) if key in steps else self


def space_panel(name: str, x: float, y: float, width: float, height: float) -> Panel:
    """A panel whose coordinates are its own picture units, to be filled by `draw_space`."""
    return Panel(name, x, y, width, height, 0, width, 0, height)


def draw_space(
    panel: Panel,
    items: Sequence[Item],
    eye: Eye,
    *,
    draft: bool = False,
    renderer: str | None = None,
    frame: RigidTransform | None = None,
    scenery: tuple[Item, ...] = (),
) -> tuple[str, dict[str, bytes]]:
    """The content of a panel, and the photographs it needs: the `scenery`, of `scene_items`, and the items in it.

    `renderer` is "solid" or "wire"; left out, it is solid wherever OpenGL works, unless the environment variable
    CAMVIZ_RENDERER says "wire". Both show the same points at the same places. `frame` is world_from_frame where the eye
    stands in another frame than the world's. Raises ValueError for another renderer.
    """
    sight = _sight(eye, round(panel.width), round(panel.height))
    if frame is not None:
        sight = Sight(sight.camera.at(frame * sight.camera.world_from_cam), eye.distance)
    if chosen_renderer(renderer, draft) == "solid":
        from camviz.draw.solid import draw_solid

        return draw_solid(sight, items, panel.name, draft, scenery)
    return draw_wire(sight, items, panel.name, 0.5 if draft else 2, scenery)


@lru_cache(maxsize=4)
def _sight(eye: Eye, width: int, height: int) -> Sight:
    return Sight(eye.camera(width, height), eye.distance)


@lru_cache(maxsize=4)
def scene_items(scene: Scene, renderer: str) -> tuple[Item, ...]:
    """A scene as a renderer shows it: its textured surfaces for "solid", its outlines, lightly filled, for "wire".

    The lawn and what stands far off on it are left out: seen from outside, a scene is a model on a table.
    """
    meshes = [mesh for mesh in scene.faces() if _near(mesh.name, mesh.vertices)]
    if renderer == "solid":
        alike: dict[bytes, list[Mesh]] = {}
        for mesh in meshes:
            alike.setdefault(mesh.picture.tobytes(), []).append(mesh)
        return tuple(_sheet(those) for those in alike.values())
    flat = [mesh for mesh in meshes if len(mesh.quads) == 1 and mesh.name != "terrace"]
    fills = [Face(mesh.vertices[mesh.quads[0]], f"#{bytes(mesh.rgb).hex()}", 0.25) for mesh in flat]
    lines = [(name, line) for name, line in scene.outlines() if _near(name, line)]
    drawn = [
        Line(line, "muted" if name in ("wall", "lamp", "easel", "terrace") else "ink", 1.2) for name, line in lines
    ]
    squares = [Line(line, "ink", 0.7) for _, line in wireframe_scene().only("board")]
    ground = [Line(line, "grid", 1.2) for _, line in wireframe_scene().only("ground")]
    return (*ground, *fills, *drawn, *squares)


def _sheet(meshes: Sequence[Mesh]) -> Sheet:
    """Meshes with one picture as one sheet: a renderer's time goes with the sheets rather than with their faces."""
    counts = [len(mesh.vertices) for mesh in meshes]
    quads = [first + mesh.quads for first, mesh in zip(np.cumsum([0, *counts]), meshes, strict=False)]
    vertices, uv = (np.concatenate([getattr(mesh, name) for mesh in meshes]) for name in ("vertices", "uv"))
    return Sheet(vertices, np.concatenate(quads), uv, meshes[0].picture)


def _near(name: str, points: Array) -> bool:
    return name not in ("ground", "lawn") and bool(np.nanmax(np.abs(points)) < 12)


def chosen_renderer(renderer: str | None = None, draft: bool = False) -> str:
    """ "solid" or "wire": what was asked for, as far as this machine can do it.

    Where nobody asked, a draft is a wireframe once solid pictures have proved too slow to be dragged.
    """
    asked = renderer or os.environ.get("CAMVIZ_RENDERER") or ""
    if asked not in ("solid", "wire", ""):
        raise ValueError(f"renderer must be 'solid' or 'wire', got {asked!r}")
    if asked == "wire":
        return "wire"
    from camviz.draw.opengl import opengl_works
    from camviz.draw.solid import too_slow

    return "wire" if not opengl_works()[0] or (draft and not asked and too_slow()) else "solid"
