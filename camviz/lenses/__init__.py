"""Lenses: how directions become points on the image, before any pixel is counted."""

from camviz.lenses.base import Lens
from camviz.lenses.perspective import Perspective

__all__ = ["Lens", "Perspective"]
