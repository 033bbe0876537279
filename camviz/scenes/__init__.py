"""Scenes: surfaces with textures, a tracer that photographs them through any lens, and the same world as lines.

How the tracer works is read most easily in `camviz.scenes.plain_tracer`.
"""

from camviz.scenes.light import to_display, to_encoded, to_linear
from camviz.scenes.mesh import Mesh
from camviz.scenes.scene import Scene, render, snapshot
from camviz.scenes.standard import board_corners, textured_scene, wireframe_scene
from camviz.scenes.surfaces import Column, Ground, Rectangle, Sphere, box
from camviz.scenes.texture import Texture
from camviz.scenes.wireframe import Wireframe

__all__ = [
    "Column",
    "Ground",
    "Mesh",
    "Rectangle",
    "Scene",
    "Sphere",
    "Texture",
    "Wireframe",
    "board_corners",
    "box",
    "render",
    "snapshot",
    "textured_scene",
    "to_display",
    "to_encoded",
    "to_linear",
    "wireframe_scene",
]
