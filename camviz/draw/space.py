"""Drawing in space: items, a camera that looks at them, and the choice between a solid and a wireframe picture."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np

from camviz.draw.items import Dots, Face, Item, Label, Line, TexturedMesh, axes_triad, camera_body, grid_lines
from camviz.draw.marks import Marks
from camviz.draw.orbit_camera import OrbitCamera
from camviz.draw.panel import Panel
from camviz.draw.wire import Viewport, draw_wire
from camviz.lenses.base import Array
from camviz.poses import RigidTransform
from camviz.scenes import Scene, wireframe_scene
from camviz.scenes.mesh import Mesh

__all__ = [
    "Dots", "Face", "Item", "Label", "Line", "OrbitCamera", "TexturedMesh", "axes_triad", "camera_body",
    "chosen_renderer", "draw_space", "grid_lines", "scene_items", "space_panel",
]  # fmt: skip


def space_panel(name: str, x: float, y: float, width: float, height: float) -> Panel:
    """A panel whose coordinates are its own picture units, to be filled by `draw_space`.

    Args:
        name: Of the panel, within its picture.
        x, y: Its upper left in picture units.
        width, height: Its size in picture units.

    Returns: Empty.

    >>> space_panel("world", 10, 20, 300, 200).right
    300
    """
    return Panel(name, x, y, width, height, 0, width, 0, height)


def draw_space(
    panel: Panel,
    items: Sequence[Item],
    eye: OrbitCamera,
    *,
    draft: bool = False,
    renderer: str | None = None,
    frame: RigidTransform | None = None,
    scenery: tuple[Item, ...] = (),
) -> tuple[Marks, dict[str, bytes]]:
    """The content of a panel, and the photographs it needs.

    Solid and wireframe pictures show the same points at the same places. Unless `renderer` says which, it is solid
    wherever OpenGL works and the environment variable CAMVIZ_RENDERER does not say "wire".

    Args:
        panel: Of `space_panel`.
        items: What is drawn.
        eye: From where.
        draft: Quickly, while something is dragged.
        renderer: {"solid", "wire"}, how.
        frame: world_from_frame, where the eye stands in another frame than the world's.
        scenery: Of `scene_items`.

    Returns:
        content: Marks.
        photographs: Pictures that it shows, by name.

    Raises: ValueError for another renderer.

    >>> eye = OrbitCamera(distance=4, yaw_deg=0, pitch_deg=0)
    >>> marks, _ = draw_space(space_panel("", 0, 0, 200, 100), [Line([(0, 0, 0), (1, 0, 0)])], eye, renderer="wire")
    >>> marks.points("ink").tolist()  # 1 m, 4 m away: 50 / tan(35°/2) / 4
    [[100.0, 50.0], [139.6, 50.0]]
    """
    viewport = _viewport(eye, round(panel.width), round(panel.height))
    if frame is not None:
        viewport = Viewport(viewport.camera.at(frame * viewport.camera.world_from_cam), eye.distance)
    if chosen_renderer(renderer, draft) == "solid":
        from camviz.draw.solid import draw_solid

        return draw_solid(viewport, items, panel.name, draft, scenery)
    return draw_wire(viewport, items, panel.name, 0.5 if draft else 2, scenery)


@lru_cache(maxsize=4)
def _viewport(eye: OrbitCamera, width: int, height: int) -> Viewport:
    return Viewport(eye.camera(width, height), eye.distance)


@lru_cache(maxsize=4)
def scene_items(make: Callable[[], Scene], renderer: str) -> tuple[Item, ...]:
    """The items of a scene: its textured surfaces, or its outlines, lightly filled.

    The lawn and what stands far off on it are left out: seen from outside, a scene is a model on a table. The items are
    kept and the scene, which is far larger, is not.

    Args:
        make: Makes the Scene.
        renderer: {"solid", "wire"}, what shows it.

    Returns: For `draw_space`.
    Raises: ValueError for another renderer.

    >>> from camviz.scenes import textured_scene
    >>> {type(item).__name__ for item in scene_items(textured_scene, "solid")}
    {'TexturedMesh'}
    """
    if renderer not in ("solid", "wire"):
        raise ValueError(f"renderer must be 'solid' or 'wire', got {renderer!r}")
    scene = make()
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


def _sheet(meshes: Sequence[Mesh]) -> TexturedMesh:
    """Meshes with one picture as one sheet: a renderer's time goes with the sheets rather than with their faces."""
    counts = [len(mesh.vertices) for mesh in meshes]
    quads = [first + mesh.quads for first, mesh in zip(np.cumsum([0, *counts]), meshes, strict=False)]
    vertices, uv = (np.concatenate([getattr(mesh, name) for mesh in meshes]) for name in ("vertices", "uv"))
    return TexturedMesh(vertices, np.concatenate(quads), uv, meshes[0].picture)


def _near(name: str, points: Array) -> bool:
    return name not in ("ground", "lawn") and bool(np.nanmax(np.abs(points)) < 12)


def chosen_renderer(renderer: str | None = None, draft: bool = False) -> str:
    """Which renderer is used: the one that was asked for, as far as this machine can do it.

    Where nobody asked, a draft is a wireframe once solid pictures have proved too slow to be dragged.

    Args:
        renderer: {"solid", "wire"}, what is asked for; unless given, what the environment variable CAMVIZ_RENDERER
            says.
        draft: Quickly, while something is dragged.

    Returns: "solid" or "wire".
    Raises: ValueError for another renderer.

    >>> chosen_renderer("wire")
    'wire'
    """
    asked = renderer or os.environ.get("CAMVIZ_RENDERER") or ""
    if asked not in ("solid", "wire", ""):
        raise ValueError(f"renderer must be 'solid' or 'wire', got {asked!r}")
    if asked == "wire":
        return "wire"
    from camviz.draw.opengl import opengl_works
    from camviz.draw.solid import too_slow

    return "wire" if not opengl_works()[0] or (draft and not asked and too_slow()) else "solid"
