"""Widgets: what a reader touches. They hold no mathematics and no drawing."""

from camviz.widgets.explorer import Explorer, explore

__all__ = ["Explorer", "explore"]
