"""Panels: rectangles of a picture with coordinates of their own."""

from dataclasses import dataclass, replace
from math import inf
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from camviz.draw import svg
from camviz.draw.flow import Cell
from camviz.draw.marks import Inset, Marks


@dataclass(frozen=True)
class Panel:
    """A rectangle of the picture (x, y, width, height) that shows the data rectangle left … right × top … bottom."""

    name: str
    x: float
    y: float
    width: float
    height: float
    left: float
    right: float
    top: float
    bottom: float

    def place(self, points: ArrayLike) -> np.ndarray:
        """Panel coordinates (..., 2) of data points (..., 2)."""
        return (np.asarray(points, dtype=float) - (self.left, self.top)) * self.scale

    def data(self, points: ArrayLike) -> np.ndarray:
        """Data points (..., 2) of panel coordinates (..., 2)."""
        return np.asarray(points, dtype=float) / self.scale + (self.left, self.top)

    @property
    def scale(self) -> np.ndarray:
        """Picture units per unit of data, (2,)."""
        return np.array([self.width / (self.right - self.left), self.height / (self.bottom - self.top)])

    def show(
        self,
        content: Marks,
        *,
        title: str = "",
        note: str = "",
        hint: str = "",
        drag: str | None = None,
        label: str = "",
    ) -> Marks:
        """The content clipped to the panel, with its title and a note above.

        With `drag` the whole panel becomes a handle of that name for pointer and arrow keys; `label` tells a screen
        reader what it does, and `hint` a reader, where the picture is live.
        """
        # Beside the title, and beyond the end of a panel too narrow for both.
        right = (self.x + max(self.width, 7.8 * len(title) + 6.8 * len(note or hint) + 10), self.y - 8)
        heading = svg.text((self.x, self.y - 8), title, "title") * bool(title)
        heading += svg.text(right, note, "note end") * bool(note)
        heading += svg.text(right, hint, "note end hint") * bool(hint)
        handle = {"data_drag": drag, "tabindex": 0, "role": "group", "aria_label": label or drag} if drag else {}
        backdrop = svg.rectangle(0, 0, self.width, self.height, "card")
        inset = Inset(self.name, self.x, self.y, self.width, self.height, backdrop + content, handle)
        return heading + [inset] + svg.rectangle(self.x, self.y, self.width, self.height, "frame")


def image_panel(
    name: str,
    x: float,
    y: float,
    width: float,
    image_width: int,
    image_height: int,
    margin: float = 0,
    tallest: float = inf,
) -> Panel:
    """A panel in the aspect of an image, in its pixel coordinates, with `margin` pixels around it.

    It is `width` wide, or narrower where it would else be taller than `tallest`.
    """
    left, right = -0.5 - margin, image_width - 0.5 + margin
    top, bottom = -0.5 - margin, image_height - 0.5 + margin
    aspect = (right - left) / (bottom - top)
    width = min(width, tallest * aspect)
    return Panel(name, x, y, width, width / aspect, left, right, top, bottom)


def image_in(cell: Cell, name: str, image_width: int, image_height: int) -> Panel:
    """A panel of an image in the middle of a tile, as large as the tile lets it be below a title."""
    x, y, width, height = cell
    panel = image_panel(name, x, y + 34, width - 20, image_width, image_height, tallest=height - 44)
    return replace(panel, x=x + (width - panel.width) / 2)


def placed_image(panel: Panel, attached: str, image_width: int, image_height: int, **style: Any) -> Marks:
    """The attached photograph where its pixels belong in an image panel."""
    (x0, y0), (x1, y1) = panel.place([(-0.5, -0.5), (image_width - 0.5, image_height - 0.5)])
    return svg.image(attached, x0, y0, x1 - x0, y1 - y0, **style)
