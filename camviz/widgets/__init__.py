"""Widgets: what a reader touches. They hold no mathematics and no drawing."""

from camviz.views.patience import notices
from camviz.widgets.explorer import Explorer, explore
from camviz.widgets.waiting import told_in_its_view

__all__ = ["Explorer", "explore"]

notices.append(told_in_its_view)
