"""A surface as quadrilaterals, for renderers that know nothing of rays."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from camviz.lenses.base import Array
from camviz.scenes.light import to_display, to_linear
from camviz.scenes.texture import Texture


@dataclass(frozen=True)
class Mesh:
    """A surface as quadrilaterals, for a solid renderer.

    Attributes:
        name: What it belongs to.
        vertices: (n, 3), in metres.
        quads: (m, 4), indices of vertices.
        uv: (n, 2), places of the vertices on the texture's picture, as shares of it: u to the right and v upwards.
        texture: What lies on it.
        shade: The light that it receives, 1 for full light.

    >>> wall = Rectangle((0, 0, 2), (1, 0, 0), (0, 1, 0), Texture.plain((1, 0, 0))).mesh()
    >>> wall.vertices.shape, wall.quads.tolist(), wall.rgb
    ((4, 3), [[0, 1, 2, 3]], (255, 0, 0))
    """

    name: str
    vertices: Array
    quads: NDArray[np.intp]
    uv: Array
    texture: Texture
    shade: float = 1.0

    @property
    def picture(self) -> NDArray[np.uint8]:
        """sRGB bytes (height, width, 3) of the shaded texture, for a renderer with textures."""
        return to_display(to_linear(np.arange(256) / 255) * self.shade)[self.texture.photograph]

    @property
    def rgb(self) -> tuple[int, int, int]:
        """The mean of the picture, 0 … 255, for a renderer without textures."""
        red, green, blue = to_display(self.texture.mean * self.shade).tolist()
        return red, green, blue


def lattice(columns: int, rows: int) -> tuple[Array, Array, Array, NDArray[np.intp]]:
    """s, r, uv and the quads of a rectangular net, for a surface wound around an axis."""
    r, s = np.meshgrid(np.linspace(0, 1, rows + 1), np.linspace(0, 1, columns + 1), indexing="ij")
    index = np.arange(r.size).reshape(r.shape)
    quads = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1).reshape(-1, 4)
    return s.ravel(), r.ravel(), np.stack([s.ravel(), 1 - r.ravel()], axis=-1), quads
